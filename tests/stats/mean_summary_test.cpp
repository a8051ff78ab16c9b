// Remarks on a mean beside its numbers: whether errors are independent in time, notes, verdicts, and
// the summaries that are the same for all types.
#include <lie/rn.hpp>
#include <lie/s2.hpp>
#include <lie/se23.hpp>
#include <lie/se3.hpp>
#include <lie/so3.hpp>
#include <report/describe.hpp>
#include <stats/laws.hpp>
#include <stats/mean_notes.hpp>
#include <stats/random.hpp>
#include <stats/summarized_mean.hpp>
#include <stats/summarized_mean_splits.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

namespace {

using namespace liestat;
using Point = Eigen::Vector3d;

/// Errors of unit variance that keep a part `memory` from one row to the next (AR(1)).
std::vector<Point> series(std::size_t n, double memory, std::uint64_t seed) {
  CounterRng rng(seed, 7);
  std::vector<Point> list;
  Point x = rng.normalVector<3>();
  for (std::size_t i = 0; i < n; ++i) {
    list.push_back(Point(1, 2, 3) + x);
    x = memory * x + std::sqrt(1 - memory * memory) * rng.normalVector<3>();
  }
  return list;
}

std::vector<double> everyTenth(std::size_t n) {
  std::vector<double> times(n);
  for (std::size_t i = 0; i < n; ++i) times[i] = 0.1 * static_cast<double>(i);
  return times;
}

MeanSummary timedMean(const std::vector<Point>& points, bool inflate, std::vector<SquareOf<Point>> covariances = {}) {
  const std::vector<double> times = everyTenth(points.size());
  return summarizedMean(
      SerialExecutor{},
      MeanInput<Point>{.features = points, .covariances = std::move(covariances), .times = times, .inflate = inflate});
}

// Lists that do not belong to the features give a reason and no number; each of them did harm in silence.
TEST(MeanInputs, ListsOfTheWrongLengthAreRefused) {
  const std::vector<Point> points = series(30, 0, 1);
  const std::vector<double> weights(29, 1.0), times = everyTenth(31);
  std::vector<double> broken = everyTenth(30);
  broken[7] = std::numeric_limits<double>::quiet_NaN();
  const std::vector<SquareOf<Point>> two(2, SquareOf<Point>::Identity());
  const struct {
    MeanInput<Point> input;
    const char* reason;
  } cells[] = {{{.weights = weights}, "weights: 29 for 30 features"},
               {{.covariances = two}, "covariances: 2 for 30 features"},
               {{.criterion = Criterion::maha, .covariances = two}, "covariances: 2 for 30 features"},
               {{.criterion = Criterion::maha}, "a Mahalanobis mean without covariances"},
               {{.times = times}, "times: 31 for 30 features"},
               {{.times = broken}, "times that are not finite"}};
  for (auto [input, reason] : cells) {
    input.features = points;
    const MeanSummary mean = summarizedMean(SerialExecutor{}, input);
    EXPECT_EQ(mean.status, Status::not_applicable);
    EXPECT_EQ(mean.reason, reason);
    EXPECT_FALSE(mean.hasCovariance());
    EXPECT_TRUE(mean.verdict().isNo());
  }
  EXPECT_EQ(summarizedMean(SerialExecutor{}, MeanInput<Point>{.features = points}).status, Status::ok);
}

// The region of a mean of independent errors stays what it is but in few samples, to the last bit.
TEST(MeanDependence, IndependentErrorsKeepTheirCovariance) {
  constexpr int trials = 200;
  int dependent = 0, changed = 0;
  for (int t = 0; t < trials; ++t) {
    const std::vector<Point> points = series(60, 0, static_cast<std::uint64_t>(t));
    const MeanSummary plain = timedMean(points, false), inflated = timedMean(points, true);
    ASSERT_TRUE(plain.dependence.tested);
    dependent += plain.dependence.dependent();
    changed += !inflated.hasCovariance() || inflated.covariance != plain.covariance;
  }
  EXPECT_LE(dependent, 9) << "1 % may be: more than 9 of 200 once in 3e4 runs";
  EXPECT_LE(changed, 30);
}

// Of 300 rows whose errors keep nine tenths from row to row: without times or the request 95 % of the truths are
// outside of the region, with it 5 %; binomial, 4 standard errors. With stated noise, χ²'s law holds.
TEST(MeanDependence, ErrorsWithMemoryAreInTheWidenedRegion) {
  constexpr int trials = 150;
  for (const bool stated : {false, true}) {
    int given = 0, outside = 0, plainly_outside = 0;
    for (int t = 0; t < trials; ++t) {
      const std::vector<Point> points = series(300, 0.9, static_cast<std::uint64_t>(t));
      std::vector<SquareOf<Point>> noise;
      if (stated) noise.push_back(SquareOf<Point>::Identity());
      const auto distance = [](const MeanSummary& mean) {
        const Point off = mean.mean.parameters - Point(1, 2, 3);
        return off.dot(Point(mean.covariance.inverse() * off));
      };
      const auto isOutside = [&](const MeanSummary& mean) {
        const double quantile =
            mean.known_noise ? chiSquaredQuantile(0.95, 3) : Hotelling{3, static_cast<int>(mean.law_n)}.quantile(0.95);
        return distance(mean) > quantile;
      };
      const MeanSummary plain = timedMean(points, false, noise), widened = timedMean(points, true, noise);
      if (plain.hasCovariance()) {
        EXPECT_TRUE(plain.dependence.dependent());
        plainly_outside += isOutside(plain);
      }
      if (!widened.hasCovariance()) continue;
      EXPECT_TRUE(widened.inflated);
      EXPECT_GT(widened.dependence.correlation_factor, 3);
      ++given, outside += isOutside(widened);
    }
    EXPECT_GT(plainly_outside, trials / 2);
    EXPECT_GE(given, trials / 2) << stated;
    EXPECT_LE(outside, given * 0.07 + 4 * std::sqrt(given * 0.07 * 0.93)) << stated << " of " << given;
  }
}

TEST(MeanDependence, AMeanOfRowsThatAreWorthTooFewHasNoCovariance) {
  const MeanSummary mean = timedMean(series(60, 0.98, 1), true);
  EXPECT_FALSE(mean.hasCovariance());
  EXPECT_EQ(mean.status, Status::not_applicable);
  EXPECT_TRUE(mean.trusted());
  EXPECT_NE(mean.reason.find("independent ones"), std::string::npos) << mean.reason;
}

TEST(MeanDependence, NotesSayItUnlessTheCovarianceIsWidened) {
  const auto notes = [](bool inflate) {
    MeanSummary mean = timedMean(series(300, 0.9, 2), inflate);
    addMeanNotes(mean, 300);
    return mean.notes;
  };
  ASSERT_EQ(notes(false).size(), 1U);
  EXPECT_EQ(notes(false)[0].find("the errors of successive rows are not independent: "), 0U);
  EXPECT_TRUE(notes(true).empty());
  const MeanSummary few = timedMean(series(19, 0.9, 2), true);
  EXPECT_FALSE(few.dependence.tested);
  EXPECT_FALSE(few.inflated);
}

MeanSummary noted(const std::vector<Point>& points, std::vector<double> weights = {},
                  std::vector<SquareOf<Point>> covariances = {}) {
  MeanInput<Point> input{.features = points, .weights = weights, .covariances = covariances};
  if (!covariances.empty()) input.criterion = Criterion::maha;
  MeanSummary mean = summarizedMean(SerialExecutor{}, input);
  addMeanNotes(mean, points.size());
  return mean;
}

bool says(const MeanSummary& mean, const std::string& part) {
  return std::any_of(mean.notes.begin(), mean.notes.end(),
                     [&](const std::string& note) { return note.find(part) != std::string::npos; });
}

TEST(MeanNotes, SayWhatIsRemarkable) {
  const std::vector<Point> points = series(50, 0, 3);
  EXPECT_TRUE(noted(points).notes.empty());
  std::vector<double> weights(50, 1.0);
  weights[7] = 0;
  EXPECT_TRUE(says(noted(points, weights), "1 measurement has no weight beside the others and is not counted"));
  EXPECT_EQ(noted({{1, 2, 3}}).notes, std::vector<std::string>{"one measurement is its own mean"});
  EXPECT_TRUE(says(noted(std::vector<Point>(9, Point(1, 2, 3))), "all measurements are equal: a covariance"));
  std::vector<Point> twice = points;
  twice.insert(twice.end(), points.begin(), points.end());
  EXPECT_TRUE(says(noted(twice), "rows are repeated, on average each by 1.0 others"));
  EXPECT_TRUE(noted(twice).doubt.isNo());
  std::vector<Point> flat = points;
  for (Point& p : flat) p.z() = 1;
  EXPECT_TRUE(says(noted(flat), "do not vary in every direction"));
  // Covariances that say a quarter of the variance: four times the expected distance, p below poor_fit.
  EXPECT_TRUE(says(noted(points, {}, {50, 0.25 * SquareOf<Point>::Identity()}), "scatter more than their covariances"));
  const MeanSummary right = noted(points, {}, {50, SquareOf<Point>::Identity()});
  EXPECT_FALSE(says(right, "scatter more")) << right.fit.chi2 << " of " << right.fit.degrees_of_freedom;
  EXPECT_EQ(right.fit.degrees_of_freedom, 147);
}

TEST(SplitOutcome, VerdictHasThreeAnswers) {
  SplitOutcome outcome{.settings = {.splits = 2}, .random = {{3, 3}, 3, 3, 60, 0}, .by_blocks = {{3, 3}, 3, 3, 27, 0}};
  EXPECT_TRUE(outcome.passed());
  EXPECT_EQ(outcome.verdict().text.find("PASSED: "), 0U);
  EXPECT_TRUE(outcome.verdict().causes.empty());
  outcome.by_blocks.index = 27;
  EXPECT_FALSE(outcome.passed());
  EXPECT_TRUE(outcome.verdict().isNo());
  EXPECT_NE(outcome.verdict().text.find("which halves at random do not show"), std::string::npos);
  outcome.random.index = 27;
  EXPECT_EQ(outcome.verdict().causes.size(), 1U);
  EXPECT_EQ(outcome.verdict().text.find("which halves at random"), std::string::npos);
  outcome.by_blocks.distances.pop_back();
  EXPECT_TRUE(outcome.verdict().isNone());
  EXPECT_FALSE(outcome.passed()) << "what was not tested has not passed";
  EXPECT_EQ(outcome.verdict().text.find("INTERRUPTED: 3 of 4 splits"), 0U);
}

template <class M>
std::vector<M> features(std::size_t n) {
  CounterRng rng(5, 1);
  std::vector<M> list;
  for (std::size_t i = 0; i < n; ++i) {
    list.push_back(exp(ManifoldTraits<M>::origin(), TangentOf<M>(0.1 * rng.normalVector<ManifoldTraits<M>::DoF>())));
  }
  return list;
}

// The same bits as the function that it calls, by whichever path.
TEST(SummarizedMean, IsTheCertifiedMean) {
  const std::vector<SO3d> rotations = features<SO3d>(30);
  std::vector<double> weights(30);
  std::iota(weights.begin(), weights.end(), 1.0);
  const MeanSummary plain = summarizedMean(SerialExecutor{}, MeanInput<SO3d>{.features = rotations});
  const MeanSummary weighted =
      summarizedMean(SerialExecutor{}, MeanInput<SO3d>{.features = rotations, .weights = weights});
  EXPECT_EQ(plain.covariance, Eigen::MatrixXd(certifiedMean(rotations).estimate->covariance));
  EXPECT_EQ(weighted.covariance, Eigen::MatrixXd(certifiedMean(rotations, weights).estimate->covariance));
  EXPECT_EQ(featureOf<SO3d>(plain.mean).params(), certifiedMean(rotations).mean.mean.params());
  EXPECT_TRUE(weighted.weighted);
  EXPECT_FALSE(plain.weighted);
  const MeanSummary fast =
      summarizedMean(SerialExecutor{}, MeanInput<SO3d>{.features = rotations}, {.certificates = false});
  EXPECT_EQ(fast.mean.parameters, plain.mean.parameters);
  EXPECT_EQ(fast.unique, Uniqueness::not_certified);
  EXPECT_EQ(fast.covariance, Eigen::MatrixXd(covarianceFromResiduals(mean(rotations))));
  EXPECT_EQ(plain.verdict().text, "The mean is " + plain.uniquenessInWords() + ".");
}

TEST(SummarizedMean, SaysWhyThereIsNoCovariance) {
  const std::vector<SO3d> none, two = features<SO3d>(2), half_turns{SO3d(), SO3d::exp({0, 0, EIGEN_PI})};
  const auto of = [](const std::vector<SO3d>& list, bool certificates) {
    return summarizedMean(SerialExecutor{}, MeanInput<SO3d>{.features = list}, {.certificates = certificates});
  };
  for (const bool certificates : {true, false}) {
    EXPECT_EQ(of(none, certificates).status, Status::too_few);
    EXPECT_EQ(of(two, certificates).status, Status::not_applicable) << "there is a mean";
    EXPECT_TRUE(of(two, certificates).trusted());
    EXPECT_FALSE(of(two, certificates).hasCovariance());
  }
  EXPECT_EQ(of(half_turns, true).status, Status::ambiguous);
  EXPECT_TRUE(of(half_turns, true).verdict().isNo());
}

TEST(MeanVerdict, IsTheWorstFinding) {
  // A mean with a covariance: what is found about it, and the answer.
  const auto judged = [](auto&& spoil) {
    MeanSummary m;
    m.n = 50, m.covariance = Eigen::Matrix3d::Identity();
    m.farthest = {FarthestMeasurement{.distance = 1}};
    spoil(m);
    addMeanNotes(m, 50);
    return m;
  };
  const auto in_rows = [](MeanSummary& m) { m.order.correlation = 0.8, m.order.z = 5; };
  const auto scatter = [](MeanSummary& m) {
    m.known_noise = true;
    m.fit.p = 0.03, m.fit.chi2 = 200, m.fit.degrees_of_freedom = 150;
  };
  EXPECT_TRUE(judged([](MeanSummary&) {}).verdict().isYes());
  const MeanSummary rows = judged(in_rows), doubtful = judged(scatter);
  EXPECT_TRUE(rows.verdict().isNo());
  EXPECT_NE(rows.verdict().text.find("about 9 times too small"), std::string::npos) << rows.verdict().text;
  EXPECT_TRUE(rows.trusted()) << "the mean may be used";
  EXPECT_TRUE(doubtful.verdict().isNone()) << doubtful.verdict().text;
  EXPECT_TRUE(judged([&](MeanSummary& m) { scatter(m), in_rows(m); }).verdict().isNo());
  EXPECT_TRUE(judged([&](MeanSummary& m) { in_rows(m), m.covariance.resize(0, 0); }).verdict().isYes())
      << "there is no covariance that could be too small";
}

TEST(FeatureValue, HasThePartsOfTheType) {
  const SE3d pose(SO3d::exp({0.3, 0.2, 0.1}), Point(1, 2, 3));
  const FeatureValue value = featureValue(pose);
  EXPECT_EQ(*value.translation, Point(1, 2, 3));
  EXPECT_NEAR((*value.rotation_vector - Point(0.3, 0.2, 0.1)).norm(), 0, 1e-15);
  EXPECT_EQ(featureOf<SE3d>(value).params(), pose.params());
  // q and -q are one rotation, which is shown with w ≥ 0; the parameters keep theirs.
  const SO3d negative = SO3d::fromParams(Eigen::Vector4d(0, 0, std::sin(2.0), std::cos(2.0)));
  EXPECT_GT((*featureValue(negative).quaternion_xyzw)[3], 0);
  EXPECT_EQ(featureOf<SO3d>(featureValue(negative)).params(), negative.params());
  const FeatureValue state = featureValue(features<SE23d>(1)[0]);
  EXPECT_EQ(*state.velocity, Point(state.parameters.tail<3>()));
  EXPECT_TRUE(featureValue(Point(1, 2, 3)).point);
  EXPECT_TRUE(featureValue(S2d(Point(0, 0, 1))).direction);
}

}  // namespace
