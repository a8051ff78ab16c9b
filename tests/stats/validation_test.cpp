// The harness on estimators whose law is known exactly. Where a run must pass, the false-alarm probability is the 1e-5
// of passed(), at a fixed seed; where it must fail, the deviation is more than ten standard errors.

#include <stats/compat/tbb.hpp>
#include <stats/validation.hpp>

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using namespace liestat;

const double nan = std::numeric_limits<double>::quiet_NaN();
const SerialExecutor serial;

/// The mean of n normal vectors about a truth, with its known covariance (scaled by `claim`).
struct MeanOfVectors {
  struct Scene {
    Eigen::Vector3d truth;
    std::vector<Eigen::Vector3d> data;
  };
  struct Estimate {
    Eigen::Vector3d mean;
    Eigen::Matrix3d covariance;
    int iterations = 1;
    bool converged = true;
  };

  std::size_t n = 10;
  double claim = 1;
  bool from_residuals = false;

  Eigen::Matrix3d root() const {
    Eigen::Matrix3d root;
    root << 1, 0, 0, 0.5, 2, 0, -1, 0.3, 0.2;
    return root;
  }
  Scene operator()(CounterRng& rng) const {
    Scene scene{10 * rng.normalVector<3>(), {}};
    for (std::size_t i = 0; i < n; ++i) scene.data.push_back(scene.truth + root() * rng.normalVector<3>());
    return scene;
  }
  Estimate estimate(const Scene& scene) const {
    const auto size = static_cast<double>(n);
    Estimate result{Eigen::Vector3d::Zero(), root() * root().transpose() * (claim / size)};
    for (const auto& x : scene.data) result.mean += x / size;
    if (from_residuals) {
      result.covariance.setZero();
      for (const auto& x : scene.data) {
        result.covariance += (x - result.mean) * (x - result.mean).transpose() * (claim / (size * (size - 1)));
      }
    }
    return result;
  }
};

ValidationReport run(const MeanOfVectors& problem, const ReferenceLaw& law, std::size_t trials = 4000) {
  return validate(serial, {.trials = trials, .seed = 1}, law, problem,
                  [&](const MeanOfVectors::Scene& scene) { return problem.estimate(scene); });
}

/// Trials whose distance follows χ²_3 exactly, times a factor.
auto chiSquaredTrial(double factor = 1) {
  return [factor](CounterRng& rng, std::uint64_t) {
    return TrialOutcome{.mu2 = factor * rng.normalVector<3>().squaredNorm()};
  };
}

TEST(Validation, exactCovariancePasses) {
  const ValidationReport report = run({}, ReferenceLaw::chiSquared(3));
  EXPECT_TRUE(report.passed()) << report;
  EXPECT_EQ(report.verdict(), ValidationVerdict::passed);
  EXPECT_EQ(report.trials, 4000u);
  EXPECT_EQ(report.size(), 4000u);
  EXPECT_EQ(report.failures, 0u);
  EXPECT_EQ(report.dof, 3);
  EXPECT_NEAR(report.index, 3, 4.5 * report.index_se_expected);
  EXPECT_NEAR(report.index_se_expected, std::sqrt(6. / 4000), 1e-15);
  EXPECT_NEAR(report.index_se / report.index_se_expected, 1, 0.1);
  EXPECT_NEAR(report.variance, 6, 0.6);
  EXPECT_EQ(report.mean_iterations, 1);
  EXPECT_EQ(report.max_iterations, 1);
  for (const Coverage& c : report.coverage) {
    EXPECT_NEAR(c.observed, c.level, 4.5 * c.standard_error) << c.level;
    EXPECT_NEAR(c.standard_error, std::sqrt(c.level * (1 - c.level) / 4000), 1e-15);
  }
}

TEST(Validation, wrongCovarianceFails) {
  const ValidationReport large = run({.claim = 1.3}, ReferenceLaw::chiSquared(3));
  EXPECT_FALSE(large.passed());
  EXPECT_EQ(large.verdict(), ValidationVerdict::index_too_small);
  EXPECT_NEAR(large.index, 3 / 1.3, 5 * large.index_se);
  const ValidationReport small = run({.claim = 1 / 1.3}, ReferenceLaw::chiSquared(3));
  EXPECT_FALSE(small.passed());
  EXPECT_EQ(small.verdict(), ValidationVerdict::index_too_large);
  EXPECT_NEAR(small.index, 3 * 1.3, 5 * small.index_se);
}

TEST(Validation, residualCovarianceFollowsHotelling) {
  for (std::size_t n : {4u, 5u, 7u, 10u, 30u}) {
    const auto law = ReferenceLaw::hotelling(3, static_cast<int>(n));
    const ValidationReport report = run({.n = n, .from_residuals = true}, law);
    EXPECT_TRUE(report.passed()) << report;
    EXPECT_FALSE(run({.n = n, .claim = 1.3, .from_residuals = true}, law).passed()) << n;
    EXPECT_FALSE(run({.n = n, .from_residuals = true}, ReferenceLaw::chiSquared(3)).passed()) << n;
  }
}

TEST(Validation, rightMeanAndWrongShapeFails) {
  const ValidationReport report = validate(
      serial, {.trials = 4000}, ReferenceLaw::chiSquared(3),
      [](CounterRng& rng, std::uint64_t) { return TrialOutcome{.mu2 = 3 * rng.normalVector<1>().squaredNorm()}; });
  EXPECT_GT(report.index_p_value, 1e-3);
  EXPECT_EQ(report.verdict(), ValidationVerdict::wrong_law);
}

TEST(Validation, toleranceForgivesASystematicDeviation) {
  const ValidationReport report =
      validate(serial, {.trials = 20000}, ReferenceLaw::chiSquared(3), chiSquaredTrial(1.05));
  EXPECT_FALSE(report.passed());
  EXPECT_FALSE(report.passed(1e-5, {.index = 0.05})) << "the law's shape is off as well";
  // The laws of χ²_3 and of 1.05 χ²_3 are 0.0123 apart at most.
  EXPECT_TRUE(report.passed(1e-5, {.index = 0.05, .ks = 0.0125})) << report;
  EXPECT_FALSE(report.passed(1e-5, {.index = 0.01, .ks = 0.0125}));
  EXPECT_FALSE(validate(serial, {.trials = 20000}, ReferenceLaw::chiSquared(3), chiSquaredTrial(0.9))
                   .passed(1e-5, {.index = 0.05, .ks = 1}));
}

TEST(Validation, pValuesOfTheIndexAreUniformAndTheVerdictKeepsItsPromise) {
  // 1000 small runs, two laws, one of which has no mean. Bounds: 5 standard errors of the binomial.
  for (const bool residuals : {false, true}) {
    const ReferenceLaw law = residuals ? ReferenceLaw::hotelling(3, 5) : ReferenceLaw::chiSquared(3);
    double below_tenth = 0, below_half = 0, failed = 0;
    for (std::uint64_t seed = 0; seed < 1000; ++seed) {
      // 3·(4/2)·F(3, 2): F as the ratio of two χ² over their degrees of freedom.
      const auto report = validate(serial, {.trials = 30, .seed = seed}, law, [&](CounterRng& rng, std::uint64_t) {
        const double chi = rng.normalVector<3>().squaredNorm(), other = rng.normalVector<2>().squaredNorm();
        return TrialOutcome{.mu2 = residuals ? 3 * (4. / 2) * (chi / 3) / (other / 2) : chi};
      });
      below_tenth += report.index_p_value < 0.1;
      below_half += report.index_p_value < 0.5;
      failed += !report.passed(0.1);
    }
    EXPECT_NEAR(below_tenth / 1000, 0.1, 5 * std::sqrt(0.1 * 0.9 / 1000));
    EXPECT_NEAR(below_half / 1000, 0.5, 5 * std::sqrt(0.5 * 0.5 / 1000));
    // Two tests of 0.05 each, not independent.
    EXPECT_LT(failed / 1000, 0.1 + 5 * std::sqrt(0.1 * 0.9 / 1000));
    EXPECT_GT(failed / 1000, 0.05 - 5 * std::sqrt(0.05 * 0.95 / 1000));
  }
}

void expectSameBits(const ValidationReport& a, const ValidationReport& b) {
  EXPECT_EQ(a.trials, b.trials);
  EXPECT_EQ(a.failures, b.failures);
  EXPECT_EQ(a.mu2, b.mu2);
  EXPECT_EQ(a.index, b.index);
  EXPECT_EQ(a.index_se, b.index_se);
  EXPECT_EQ(a.variance, b.variance);
  EXPECT_EQ(a.index_p_value, b.index_p_value);
  EXPECT_EQ(a.ks_statistic, b.ks_statistic);
  EXPECT_EQ(a.ks_p_value, b.ks_p_value);
  EXPECT_EQ(a.mean_iterations, b.mean_iterations);
  EXPECT_EQ(a.max_iterations, b.max_iterations);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(a.coverage[i].observed, b.coverage[i].observed);
  }
}

/// An outcome with numbers of its own.
struct MixedOutcome : TrialOutcome {
  double always = nan, never = nan, sometimes = nan, unlisted = 1;
  static constexpr std::array statistics = {&MixedOutcome::always, &MixedOutcome::never, &MixedOutcome::sometimes};
};

void expectSameBits(const ValidationReportOf<MixedOutcome>& a, const ValidationReportOf<MixedOutcome>& b) {
  expectSameBits(static_cast<const ValidationReport&>(a), static_cast<const ValidationReport&>(b));
  for (std::size_t i = 0; i < a.statistics.size(); ++i) {
    EXPECT_EQ(a.statistics[i].count, b.statistics[i].count);
    if (a.statistics[i].count > 0) {
      EXPECT_EQ(a.statistics[i].mean, b.statistics[i].mean);
      EXPECT_EQ(a.statistics[i].standard_deviation, b.statistics[i].standard_deviation);
    }
  }
}

/// Distances, iterations, statistics and failures of all kinds, from the trial's generator alone.
MixedOutcome mixedTrial(CounterRng& rng, std::uint64_t number) {
  MixedOutcome outcome;
  outcome.mu2 = rng.normalVector<3>().squaredNorm();
  outcome.iterations = static_cast<int>(number % 7);
  outcome.always = rng.normal();
  if (number % 3 == 0) outcome.sometimes = 1e10 * rng.normal();
  outcome.failed = rng.uniform() < 0.02;
  if (rng.uniform() < 0.02) outcome.mu2 = nan;
  return outcome;
}

TEST(Validation, givesTheSameBitsOnAnyNumberOfThreadsInAnyCut) {
  const ValidationOptions options{.trials = 3001, .seed = 9};
  const auto law = ReferenceLaw::chiSquared(3);
  const ValidationReportOf<MixedOutcome> reference = validate(serial, options, law, mixedTrial);
  for (int threads : {1, 2, 8}) expectSameBits(validate(TbbExecutor{threads}, options, law, mixedTrial), reference);
  for (std::size_t chunk_size : {1u, 100u, 5000u}) {
    expectSameBits(validate(TbbExecutor{2}, {.trials = 3001, .seed = 9, .chunk_size = chunk_size}, law, mixedTrial),
                   reference);
  }
  EXPECT_NE(validate(serial, {.trials = 3001, .seed = 10}, law, mixedTrial).index, reference.index);
}

TEST(Validation, continuesByNumber) {
  const auto law = ReferenceLaw::chiSquared(3);
  const auto whole = validate(serial, {.trials = 100, .seed = 3}, law, chiSquaredTrial());
  const auto first = validate(serial, {.trials = 60, .seed = 3}, law, chiSquaredTrial());
  const auto second = validate(serial, {.trials = 40, .seed = 3, .first_trial = 60}, law, chiSquaredTrial());
  std::vector<double> together = first.mu2;
  together.insert(together.end(), second.mu2.begin(), second.mu2.end());
  std::sort(together.begin(), together.end());
  EXPECT_EQ(together, whole.mu2);
}

TEST(Validation, samplesSurviveTheJourneyToAnotherProcess) {
  detail::ValidationSamples samples;
  samples.list.resize(3);
  for (std::uint64_t i = 0; i < 50; ++i) {
    CounterRng rng(2, i);
    samples.list[i % 2].add(mixedTrial(rng, i));
  }
  const auto copy = detail::ValidationSamples::unpack(samples.pack());
  ASSERT_EQ(copy.list.size(), 3u);
  for (std::size_t m = 0; m < 3; ++m) {
    EXPECT_EQ(copy.list[m].mu2, samples.list[m].mu2);
    EXPECT_EQ(copy.list[m].statistics, samples.list[m].statistics);
    EXPECT_EQ(copy.list[m].trials, samples.list[m].trials);
    EXPECT_EQ(copy.list[m].failures, samples.list[m].failures);
    EXPECT_EQ(copy.list[m].iterations, samples.list[m].iterations);
    EXPECT_EQ(copy.list[m].max_iterations, samples.list[m].max_iterations);
  }
}

TEST(Validation, countsFailuresOfEveryKind) {
  const auto report = validate(serial, {.trials = 1000, .seed = 4}, ReferenceLaw::chiSquared(3),
                               [](CounterRng& rng, std::uint64_t number) {
                                 TrialOutcome outcome{.mu2 = rng.normalVector<3>().squaredNorm(), .iterations = 2};
                                 if (number % 10 == 0) outcome.mu2 = nan;
                                 if (number % 10 == 1) outcome.mu2 = std::numeric_limits<double>::infinity();
                                 if (number % 10 == 2) outcome.mu2 = -1;
                                 if (number % 10 == 3) outcome.failed = true;
                                 if (number % 10 == 4) throw std::runtime_error("estimator");
                                 return outcome;
                               });
  EXPECT_EQ(report.trials, 1000u);
  EXPECT_EQ(report.failures, 500u);
  EXPECT_EQ(report.exceptions, 100u);
  EXPECT_EQ(report.size(), 500u);
  EXPECT_NEAR(report.index, 3, 4.5 * report.index_se_expected);
  EXPECT_EQ(report.verdict(), ValidationVerdict::too_many_failures);
  EXPECT_TRUE(report.passed(1e-5, {.failure_fraction = 0.5})) << report;
  EXPECT_FALSE(report.passed(1e-5, {.failure_fraction = 0.42})) << "5.1 standard errors";
}

TEST(Validation, failuresAreJudgedByTheirProbabilityAndNotByTheirFraction) {
  const auto withFailures = [](std::uint64_t failures, std::size_t trials) {
    return validate(serial, {.trials = trials, .seed = 5}, ReferenceLaw::chiSquared(3),
                    [=](CounterRng& rng, std::uint64_t number) {
                      return TrialOutcome{.mu2 = rng.normalVector<3>().squaredNorm(), .failed = number < failures};
                    });
  };
  // One failure in 50 is ten times the allowed fraction, and happens in a tenth of the runs.
  EXPECT_TRUE(withFailures(1, 50).passed(1e-5, {.failure_fraction = 0.002}));
  EXPECT_FALSE(withFailures(5, 50).passed(1e-5, {.failure_fraction = 0.002}));  // probability 6e-8
  EXPECT_FALSE(withFailures(1, 50).passed());
  EXPECT_FALSE(withFailures(400, 20000).passed(1e-5, {.failure_fraction = 0.015})) << "5.8 standard errors";
}

/// χ²_3, and in one trial of 300 a tail that falls as 1/m: the distance to a truth that the second order of the noise
/// moved by about as much as a datum's deviation, if the square of the latter is uniform down to zero.
TrialOutcome tailedTrial(CounterRng& rng, std::uint64_t) {
  const double chi = rng.normalVector<3>().squaredNorm();
  return {.mu2 = rng.uniform() < 1. / 300 ? 16 / rng.uniform() : chi};
}

TEST(Validation, aTailWithoutMeanIsCountedAndNotAveraged) {
  const auto law = ReferenceLaw::chiSquared(3);
  const ValidationTolerance averaged{.index = 0.06, .ks = 0.03};
  const ValidationTolerance counted{.index = 0.06, .ks = 0.03, .tail = 0.004};
  // Any number of trials, at a level at which a false alarm can be counted: 300 runs, bound 5 standard errors.
  for (const std::size_t trials : {1u, 10u, 50u, 200u, 1000u}) {
    double averaged_failed = 0, counted_failed = 0;
    for (std::uint64_t seed = 0; seed < 300; ++seed) {
      const auto report = validate(serial, {.trials = trials, .seed = seed}, law, tailedTrial);
      averaged_failed += !report.passed(0.01, averaged);
      counted_failed += !report.passed(0.01, counted);
    }
    EXPECT_LT(counted_failed / 300, 0.01 + 5 * std::sqrt(0.01 * 0.99 / 300)) << trials;
    if (trials == 200) {
      EXPECT_GT(averaged_failed / 300, 0.1);
    }
  }
  // Counted tails are judged: a thrice larger share beyond the quantile fails, as does a wrong covariance of all.
  const auto report = [&](double share, double factor) {
    return validate(serial, {.trials = 20000, .seed = 2}, law, [=](CounterRng& rng, std::uint64_t) {
      const double chi = factor * rng.normalVector<3>().squaredNorm();
      return TrialOutcome{.mu2 = rng.uniform() < share ? 16 / rng.uniform() : chi};
    });
  };
  EXPECT_EQ(report(0.004, 1).verdict(1e-5, counted), ValidationVerdict::passed);
  EXPECT_EQ(report(0.01, 1).verdict(1e-5, counted), ValidationVerdict::heavy_tail);
  EXPECT_EQ(report(0, 1.15).verdict(1e-5, counted), ValidationVerdict::index_too_large);
  EXPECT_EQ(report(0, 0.88).verdict(1e-5, counted), ValidationVerdict::index_too_small);
}

TEST(Validation, theBoundedIndexKeepsTheLawsExpectation) {
  for (const bool residuals : {false, true}) {
    const ReferenceLaw law = residuals ? ReferenceLaw::hotelling(3, 5) : ReferenceLaw::chiSquared(3);
    const std::size_t trials = 100000;
    const auto report = validate(serial, {.trials = trials, .seed = 3}, law, [&](CounterRng& rng, std::uint64_t) {
      const double chi = rng.normalVector<3>().squaredNorm(), other = rng.normalVector<2>().squaredNorm();
      return TrialOutcome{.mu2 = residuals ? 3 * (4. / 2) * (chi / 3) / (other / 2) : chi};
    });
    EXPECT_GT(report.indexPValue(0, true), 1e-3);
    EXPECT_NEAR(static_cast<double>(report.tailCount()), 100, 4.5 * 10);
    // Were the distances beyond cut off at the quantile, 0.06 % of the index would be missing: 0.2 standard errors.
    EXPECT_NEAR(std::log10(report.indexPValue(0, true) / report.indexPValue()), 0, 0.3);
  }
}

TEST(Validation, anEstimatorThatAlwaysFailsGivesAReport) {
  const auto report = validate(serial, {.trials = 50}, ReferenceLaw::chiSquared(3),
                               [](CounterRng&, std::uint64_t) { return TrialOutcome{.iterations = 100}; });
  EXPECT_EQ(report.failures, 50u);
  EXPECT_EQ(report.mean_iterations, 100);
  EXPECT_TRUE(std::isnan(report.index));
  EXPECT_TRUE(std::isnan(report.ks_p_value));
  EXPECT_TRUE(std::isnan(report.coverage[0].observed));
  EXPECT_EQ(report.verdict(1e-5, {1, 1, 1}), ValidationVerdict::no_trial_succeeded);
  std::ostringstream text;
  text << report;
  EXPECT_NE(text.str().find("FAILED: no trial succeeded"), std::string::npos);
  EXPECT_EQ(report.histogram(10).size(), 10u);
}

TEST(Validation, noTrialsAndLawsThatDoNotExistAreMarked) {
  const auto none = validate(serial, {.trials = 0}, ReferenceLaw::chiSquared(3), chiSquaredTrial());
  EXPECT_EQ(none.trials, 0u);
  EXPECT_TRUE(std::isnan(none.index));
  EXPECT_TRUE(std::isnan(none.mean_iterations));
  EXPECT_FALSE(none.passed());
  const auto one = validate(serial, {.trials = 1}, ReferenceLaw::chiSquared(3), chiSquaredTrial());
  EXPECT_TRUE(std::isfinite(one.index));
  EXPECT_TRUE(std::isnan(one.index_se));
  EXPECT_TRUE(one.passed());
  const auto no_law = validate(serial, {.trials = 100}, ReferenceLaw::hotelling(3, 3), chiSquaredTrial());
  EXPECT_FALSE(no_law.passed());
  EXPECT_TRUE(std::isnan(no_law.index_p_value));
  EXPECT_TRUE(std::isnan(no_law.ks_p_value));
  EXPECT_TRUE(std::isnan(no_law.coverage[0].observed));
  EXPECT_TRUE(no_law.histogram(10).empty());
}

TEST(Validation, takesOptionalEstimatesAndTheirConvergence) {
  const MeanOfVectors problem;
  const auto estimate = [&](const MeanOfVectors::Scene& scene) -> std::optional<MeanOfVectors::Estimate> {
    MeanOfVectors::Estimate result = problem.estimate(scene);
    result.iterations = 7;
    if (scene.truth.x() > 10) return std::nullopt;
    if (scene.truth.x() < -10) result.converged = false;
    return result;
  };
  const auto report = validate(serial, {.trials = 1000, .seed = 5}, ReferenceLaw::chiSquared(3), problem, estimate);
  // One standard deviation on either side: 31.7 %.
  EXPECT_NEAR(static_cast<double>(report.failures) / 1000, 0.317, 5 * std::sqrt(0.317 * 0.683 / 1000));
  EXPECT_TRUE(report.passed(1e-5, {.failure_fraction = 0.5})) << report;
  EXPECT_EQ(report.max_iterations, 7);
}

TEST(Validation, takesAnyMahalanobisDistance) {
  struct Scene {
    double truth, seen;
  };
  const auto report = validate(
      serial, {.trials = 2000, .seed = 6}, ReferenceLaw::chiSquared(1),
      [](CounterRng& rng) {
        const double truth = rng.uniform();
        return Scene{truth, truth + 0.1 * rng.normal()};
      },
      [](const Scene& scene) { return scene.seen; },
      [](double truth, double seen) { return std::pow((truth - seen) / 0.1, 2); });
  EXPECT_TRUE(report.passed()) << report;
}

/// A type with its own mahalanobisSquared, as liestat::Gaussian has.
struct Angle {
  double value, variance;
};
double mahalanobisSquared(const Angle& estimate, double truth) {
  return std::pow(estimate.value - truth, 2) / estimate.variance;
}

TEST(Validation, findsTheDistanceOfTheEstimatesType) {
  EXPECT_EQ(DefaultMahalanobis{}(1., Angle{3, 2}), 2);
  const MeanOfVectors::Estimate bad{Eigen::Vector3d::Zero(), Eigen::Matrix3d(-Eigen::Matrix3d::Identity())};
  EXPECT_TRUE(std::isnan(DefaultMahalanobis{}(Eigen::Vector3d(1, 0, 0), bad)));
}

TEST(Validation, severalEstimatorsSeeTheSameScenes) {
  const auto both = [](CounterRng& rng, std::uint64_t) {
    const double mu2 = rng.normalVector<3>().squaredNorm();
    return std::array<TrialOutcome, 2>{TrialOutcome{.mu2 = mu2}, TrialOutcome{.mu2 = 2 * mu2}};
  };
  const auto law = ReferenceLaw::chiSquared(3);
  const auto reports = validateAll(TbbExecutor{2}, {.trials = 2000}, {law, law, law}, both);
  ASSERT_EQ(reports.size(), 3u);
  EXPECT_TRUE(reports[0].passed()) << reports[0];
  EXPECT_FALSE(reports[1].passed());
  for (std::size_t i = 0; i < 2000; ++i) EXPECT_EQ(reports[1].mu2[i], 2 * reports[0].mu2[i]);
  EXPECT_EQ(reports[2].failures, 2000u);  // an outcome that is missing
  EXPECT_EQ(validateAll(serial, {.trials = 0}, {law, law}, both).size(), 2u);
  const auto list = [](CounterRng& rng, std::uint64_t) {
    return std::vector<TrialOutcome>{TrialOutcome{.mu2 = rng.normalVector<3>().squaredNorm()}};
  };
  EXPECT_EQ(validateAll(serial, {.trials = 2000}, {law}, list)[0].mu2, reports[0].mu2);
}

TEST(Validation, aRunThatIsStoppedHasItsFirstTrials) {
  const auto law = ReferenceLaw::chiSquared(3);
  const auto trial = [](CounterRng& rng, std::uint64_t) {
    return TrialOutcome{.mu2 = rng.normalVector<3>().squaredNorm()};
  };
  for (const std::size_t least : {0U, 1U, 100U, 1900U, 2000U}) {
    std::atomic<std::size_t> begun{0};
    ValidationOptions options{.trials = 2000, .seed = 3, .stop = [&] { return begun >= least; }};
    const auto counted = [&](CounterRng& rng, std::uint64_t number) {
      ++begun;
      return trial(rng, number);
    };
    for (const bool threads : {false, true}) {
      begun = 0;
      const auto part =
          threads ? validate(TbbExecutor{2}, options, law, counted) : validate(serial, options, law, counted);
      ASSERT_LE(part.trials, 2000U);
      if (!threads) {
        // Tasks of 16 that have begun are finished.
        EXPECT_EQ(part.trials, (least + 15) / 16 * 16);
      }
      EXPECT_EQ(part.mu2, validate(serial, {.trials = part.trials, .seed = 3}, law, trial).mu2);
    }
  }
}

TEST(Validation, statisticsHaveMeanAndStandardDeviation) {
  const auto trial = [](CounterRng& rng, std::uint64_t number) {
    MixedOutcome outcome;
    outcome.mu2 = rng.normalVector<3>().squaredNorm();
    outcome.always = 5 + 2 * rng.normal();
    if (number % 4 == 0) outcome.sometimes = 1;
    return outcome;
  };
  const auto law = ReferenceLaw::chiSquared(3);
  const auto report = validate(serial, {.trials = 4000, .seed = 7}, law, trial);
  const TrialStatistic always = report.of(&MixedOutcome::always);
  EXPECT_EQ(always.count, 4000u);
  EXPECT_NEAR(always.mean, 5, 5 * 2 / std::sqrt(4000.));
  EXPECT_NEAR(always.standard_deviation, 2, 5 * 2 / std::sqrt(2 * 4000.));
  EXPECT_EQ(report.of(&MixedOutcome::never).count, 0u);
  EXPECT_TRUE(std::isnan(report.of(&MixedOutcome::never).mean));
  EXPECT_EQ(report.of(&MixedOutcome::sometimes).count, 1000u);
  EXPECT_EQ(report.of(&MixedOutcome::sometimes).mean, 1);
  EXPECT_EQ(report.of(&MixedOutcome::sometimes).standard_deviation, 0);
  EXPECT_EQ(report.of(&MixedOutcome::unlisted).count, 0u);

  // Two estimators on the same scenes, of which the second sometimes gives nothing.
  const auto both = [&](CounterRng& rng, std::uint64_t number) {
    std::vector<MixedOutcome> list(1, trial(rng, number));
    if (number % 2 == 0) list.push_back(list[0]);
    return list;
  };
  const auto reports = validateAll(serial, {.trials = 4000, .seed = 7}, {law, law}, both);
  EXPECT_EQ(reports[0].of(&MixedOutcome::always).mean, always.mean);
  EXPECT_EQ(reports[1].of(&MixedOutcome::always).count, 2000u);
  EXPECT_EQ(validateAll(serial, {.trials = 0}, {law}, both)[0].of(&MixedOutcome::always).count, 0u);
}

TEST(Validation, verdictsHaveNamesAndReasons) {
  EXPECT_STREQ(name(ValidationVerdict::passed), "passed");
  EXPECT_STREQ(reason(ValidationVerdict::passed), "");
  for (int i = 1; i <= static_cast<int>(ValidationVerdict::success_too_seldom); ++i) {
    const auto verdict = static_cast<ValidationVerdict>(i);
    EXPECT_STRNE(name(verdict), "unknown") << i;
    EXPECT_GT(std::string(reason(verdict)).size(), 10u) << i;
  }
}

/// Estimators of other libraries spell convergence by a status of their own.
namespace other {
enum class State { fine, lost };
bool converged(State state) { return state == State::fine; }
}  // namespace other

TEST(Validation, takesConvergenceFromAStatus) {
  struct Scene {
    double truth, seen;
  };
  const auto draw = [](CounterRng& rng) { return Scene{0, rng.normal()}; };
  const auto distance = [](double, const auto& estimate) { return estimate.mean * estimate.mean; };
  const auto failures = [&](const auto& estimator) {
    return validate(serial, {.trials = 500}, ReferenceLaw::chiSquared(1), draw, estimator, distance).failures;
  };
  struct ByState {
    double mean;
    other::State status;
  };
  struct ByStatus {
    double mean;
    Status status;
  };
  struct ByFlag {
    double mean;
    bool converged;
  };
  const std::size_t lost = failures([](const Scene& s) { return ByFlag{s.seen, s.seen < 1}; });
  EXPECT_GT(lost, 20u);
  EXPECT_EQ(failures([](const Scene& s) {
              return ByState{s.seen, s.seen < 1 ? other::State::fine : other::State::lost};
            }),
            lost);
  EXPECT_EQ(failures([](const Scene& s) {
              return ByStatus{s.seen, s.seen < 1 ? Status::ok : Status::not_converged};
            }),
            lost);
}

TEST(Validation, histogramHoldsTheSampleAndTheLaw) {
  const auto report = validate(serial, {.trials = 20000, .seed = 8}, ReferenceLaw::chiSquared(3), chiSquaredTrial());
  const auto bins = report.histogram(20);
  ASSERT_EQ(bins.size(), 20u);
  EXPECT_EQ(bins.front().lower, 0);
  EXPECT_EQ(bins.back().upper, report.law.quantile(0.999));
  double inside = 0, expected = 0;
  for (const HistogramBin& bin : bins) {
    const double width = bin.upper - bin.lower, p = bin.expected * width;
    inside += static_cast<double>(bin.count);
    expected += p;
    EXPECT_NEAR(bin.density * width, static_cast<double>(bin.count) / 20000, 1e-15);
    EXPECT_NEAR(bin.density * width, p, 5 * std::sqrt(p * (1 - p) / 20000)) << bin.lower;
  }
  EXPECT_NEAR(expected, 0.999, 1e-12);
  EXPECT_EQ(inside, static_cast<double>(std::upper_bound(report.mu2.begin(), report.mu2.end(), bins.back().upper) -
                                        report.mu2.begin()));
  EXPECT_EQ(report.histogram(4, 8).back().upper, 8);
  EXPECT_TRUE(report.histogram(0).empty());
}

TEST(Validation, reportsProgressInOrder) {
  for (const bool threads : {false, true}) {
    std::vector<std::size_t> seen;
    std::atomic<int> inside{0};
    ValidationOptions options{.trials = 200, .chunk_size = 10};
    options.progress = [&](std::size_t done, std::size_t trials) {
      EXPECT_EQ(++inside, 1);
      EXPECT_EQ(trials, 200u);
      seen.push_back(done);
      --inside;
    };
    const auto law = ReferenceLaw::chiSquared(3);
    if (threads) {
      validate(TbbExecutor{4}, options, law, chiSquaredTrial());
    } else {
      validate(serial, options, law, chiSquaredTrial());
    }
    ASSERT_EQ(seen.size(), 19u);
    EXPECT_TRUE(std::is_sorted(seen.begin(), seen.end()));
    EXPECT_EQ(seen.back(), 200u);
  }
}

TEST(Validation, printsATableOfEightyColumnsTheVerdictLast) {
  for (const auto& report :
       {run({}, ReferenceLaw::chiSquared(3), 1000),
        run({.n = 5, .from_residuals = true}, ReferenceLaw::hotelling(3, 5), 1000),
        run({.claim = 1e-12}, ReferenceLaw::chiSquared(3), 100),
        validate(serial, {.trials = 100000}, ReferenceLaw::hotelling(3, 1000000),
                 [](CounterRng&, std::uint64_t) -> TrialOutcome { throw std::runtime_error("estimator"); })}) {
    std::ostringstream text;
    text << report;
    std::string line, last;
    std::istringstream lines(text.str());
    while (std::getline(lines, line)) {
      EXPECT_LE(line.size(), 80u) << line;
      last = line;
    }
    EXPECT_EQ(last.rfind(report.passed() ? "passed" : "FAILED: ", 0), 0u) << last;
  }
}

}  // namespace
