// Pennec 1998, section 5, on rotations: the tables that a right implementation shows, with the corrected formulas and
// with the report's printed ones. The reference numbers were computed by an independent program with 2000 to 4000
// trials a cell; ± is one standard error of theirs. Bounds are four standard errors of both sides together, so that a
// comparison raises a false alarm with probability 6e-5, and the 60 comparisons of this file together with 4e-3 at a
// fresh seed; the seeds are fixed.

#include <experiments/means_experiment.hpp>
#include <experiments/means_report.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <vector>

#include "paper/full_run.hpp"

namespace liestat::experiments {
namespace {

constexpr std::size_t sizes[] = {5, 10, 20, 30, 50, 100};

std::size_t fullTrials(std::size_t n) { return n <= 30 ? 4000 : n == 50 ? 3000 : 2000; }

/// All methods on rotations at the report's spread; computed once for the tests of this file.
const std::vector<MeansReport>& cell(Noise noise, std::size_t n) {
  static std::map<std::pair<Noise, std::size_t>, std::vector<MeansReport>> cells;
  auto& reports = cells[{noise, n}];
  if (reports.empty()) {
    reports =
        run({.feature = Feature::rotation, .noise = noise, .n = n, .trials = trialsOf(fullTrials(n)), .seed = 1998}, 0);
  }
  return reports;
}

const MeansReport& report(Noise noise, std::size_t n, Method method) { return cell(noise, n)[methodIndex(method)]; }

/// A number with its standard error.
struct Estimate {
  double value, se;
};

/// The index over n = 10 … 100, each trial with the same weight.
Estimate pooledIndex(Noise noise, const Method& method) {
  double sum = 0, squares = 0, count = 0;
  for (const std::size_t n : sizes) {
    if (n == 5) continue;
    const MeansReport& r = report(noise, n, method);
    EXPECT_EQ(r.failures, method.criterion == Criterion::maha && !method.corrected ? r.failures : 0u);
    for (const double mu2 : r.mu2) sum += mu2, squares += mu2 * mu2, count += 1;
  }
  const double mean = sum / count;
  return {mean, std::sqrt((squares / count - mean * mean) / count)};
}

void expectNear(const Estimate& ours, const Estimate& reference, const std::string& what) {
  EXPECT_NEAR(ours.value, reference.value, 4 * std::hypot(ours.se, reference.se)) << what << ", our SE " << ours.se;
}

struct PooledRow {
  Noise noise;
  Method method;
  Estimate reference;
};

class PooledIndex : public testing::TestWithParam<PooledRow> {};

TEST_P(PooledIndex, agreesWithTheTable) {
  const PooledRow& row = GetParam();
  expectNear(pooledIndex(row.noise, row.method), row.reference, name(row.noise) + " " + name(row.method.criterion));
}

INSTANTIATE_TEST_SUITE_P(corrected, PooledIndex,
                         testing::Values(PooledRow{Noise::iid, {Criterion::lsq, true, true}, {3.053, 0.020}},
                                         PooledRow{Noise::isd, {Criterion::lsq, true, true}, {3.002, 0.019}},
                                         PooledRow{Noise::idd, {Criterion::lsq, true, true}, {3.046, 0.019}},
                                         PooledRow{Noise::isd, {Criterion::wlsq, true, true}, {3.003, 0.019}},
                                         PooledRow{Noise::idd, {Criterion::wlsq, true, true}, {3.032, 0.019}},
                                         PooledRow{Noise::iid, {Criterion::maha, true, true}, {2.917, 0.018}},
                                         PooledRow{Noise::isd, {Criterion::maha, true, true}, {2.989, 0.019}},
                                         PooledRow{Noise::idd, {Criterion::maha, true, true}, {2.995, 0.019}}));

INSTANTIATE_TEST_SUITE_P(printed, PooledIndex,
                         testing::Values(PooledRow{Noise::iid, {Criterion::lsq, false, true}, {2.914, 0.020}},
                                         PooledRow{Noise::isd, {Criterion::lsq, false, true}, {2.799, 0.018}},
                                         PooledRow{Noise::idd, {Criterion::lsq, false, true}, {2.874, 0.018}},
                                         PooledRow{Noise::isd, {Criterion::wlsq, false, true}, {2.942, 0.018}},
                                         PooledRow{Noise::idd, {Criterion::wlsq, false, true}, {2.922, 0.018}},
                                         PooledRow{Noise::iid, {Criterion::maha, false, true}, {4.407, 0.034}},
                                         PooledRow{Noise::isd, {Criterion::maha, false, true}, {3.324, 0.021}},
                                         PooledRow{Noise::idd, {Criterion::maha, false, true}, {4.627, 0.077}}));

TEST(PennecRotations, distancesFollowChiSquared) {
  // 1.63/√N is the 1 % point of the Kolmogorov-Smirnov statistic; 0.02 is what the third order of the noise leaves.
  for (const Noise noise : {Noise::iid, Noise::isd, Noise::idd}) {
    for (const std::size_t n : sizes) {
      if (n == 5) continue;
      for (const Criterion criterion : all_criteria) {
        const MeansReport& r = report(noise, n, {criterion, true, true});
        EXPECT_LT(r.ks_statistic, 1.63 / std::sqrt(static_cast<double>(r.size())) + 0.02)
            << name(noise) << " " << name(criterion) << " n = " << n;
      }
    }
  }
}

TEST(PennecRotations, residualsFollowHotelling) {
  for (const Noise noise : {Noise::iid, Noise::isd, Noise::idd}) {
    for (const std::size_t n : sizes) {
      const MeansReport& r = report(noise, n, {Criterion::lsq, true, false});
      if (noise == Noise::iid) {
        EXPECT_GT(r.ks_p_value, 1e-3) << "n = " << n;
      }
      if (n == 5) continue;  // the law has no mean
      // The bounds hold for the expectation; a share of the trials adds its own error.
      const double slack = isFullRun() ? 0 : 4 * r.index_se / r.law.mean();
      const double ratio = r.index / r.law.mean();
      EXPECT_GT(ratio, 0.93 - slack) << name(noise) << " n = " << n;
      EXPECT_LT(ratio, 1.06 + slack) << name(noise) << " n = " << n;
    }
  }
}

TEST(PennecRotations, printedResidualFormulaMissesEveryLaw) {
  // Eq. (6) has no curvature: under IID noise the Kolmogorov-Smirnov test of Hotelling's law sees it at once.
  for (const std::size_t n : {20u, 30u, 50u}) {
    EXPECT_LT(report(Noise::iid, n, {Criterion::lsq, false, false}).ks_p_value, 1e-3) << "n = " << n;
  }
}

struct RatioRow {
  Noise noise;
  std::size_t n;
  Estimate lsq, wlsq;
};

TEST(PennecRotations, relativeAccuracy) {
  // Geometric means of error ratios LSQ/MAHA and WLSQ/MAHA, corrected formulas.
  const RatioRow rows[] = {
      {Noise::iid, 5, {1.154, 0.008}, {1.154, 0.008}},  {Noise::iid, 10, {1.173, 0.008}, {1.173, 0.008}},
      {Noise::iid, 20, {1.195, 0.009}, {1.195, 0.009}}, {Noise::iid, 30, {1.219, 0.009}, {1.219, 0.009}},
      {Noise::iid, 50, {1.207, 0.011}, {1.207, 0.011}}, {Noise::iid, 100, {1.218, 0.013}, {1.218, 0.013}},
      {Noise::isd, 5, {1.253, 0.010}, {1.062, 0.005}},  {Noise::isd, 10, {1.319, 0.012}, {1.034, 0.005}},
      {Noise::isd, 20, {1.378, 0.013}, {1.019, 0.003}}, {Noise::isd, 30, {1.480, 0.014}, {1.017, 0.003}},
      {Noise::isd, 50, {1.534, 0.018}, {1.010, 0.003}}, {Noise::isd, 100, {1.612, 0.024}, {1.003, 0.002}},
      {Noise::idd, 5, {1.468, 0.014}, {1.401, 0.014}},  {Noise::idd, 10, {1.662, 0.017}, {1.585, 0.017}},
      {Noise::idd, 20, {1.819, 0.019}, {1.766, 0.019}}, {Noise::idd, 30, {1.898, 0.021}, {1.896, 0.021}},
      {Noise::idd, 50, {1.979, 0.025}, {1.992, 0.027}}, {Noise::idd, 100, {2.137, 0.035}, {2.177, 0.037}},
      {Noise::exp, 20, {2.75, 0.04}, {2.26, 0.03}},     {Noise::exp, 50, {2.80, 0.04}, {2.34, 0.03}}};
  for (const RatioRow& row : rows) {
    const auto ratio = [&](Criterion criterion) {
      const TrialStatistic s = report(row.noise, row.n, {criterion, true, true}).of(log_ratio_rotation);
      const double value = std::exp(s.mean);
      return Estimate{value, value * s.standard_deviation / std::sqrt(static_cast<double>(s.count))};
    };
    const std::string what = name(row.noise) + " n = " + std::to_string(row.n);
    expectNear(ratio(Criterion::lsq), row.lsq, what + " LSQ/MAHA");
    expectNear(ratio(Criterion::wlsq), row.wlsq, what + " WLSQ/MAHA");
  }
}

TEST(PennecRotations, smallSpreadIsTrueForLeastSquares) {
  // Spread (0.1, 0.2, 0.3): 3.03 and 3.02 ± 0.04 with the exact Hessian, MAHA as printed 3.44 ± 0.05.
  for (const Noise noise : {Noise::iid, Noise::isd}) {
    const auto reports = run({.feature = Feature::rotation,
                              .noise = noise,
                              .n = 30,
                              .spread = 1.0 / 3,
                              .trials = trialsOf(3000, 3),
                              .seed = 7},
                             0);
    const auto index = [&](const Method& method) {
      const MeansReport& r = reports[methodIndex(method)];
      return Estimate{r.index, r.index_se};
    };
    expectNear(index({Criterion::lsq, true, true}), {noise == Noise::iid ? 3.03 : 3.02, 0.04}, name(noise) + " LSQ");
    expectNear(index({Criterion::maha, false, true}), {noise == Noise::iid ? 3.44 : 3.04, 0.05}, name(noise) + " MAHA");
  }
}

TEST(PennecRotations, likelihoodClosesTheGapOfMaha) {
  // With the volume element and H⁻¹: 3.08 ± 0.07 (IID, n = 20), 3.10 ± 0.06 (IDD, n = 20).
  for (const Noise noise : {Noise::iid, Noise::idd}) {
    MeansExperiment experiment{.feature = Feature::rotation,
                               .noise = noise,
                               .n = 20,
                               .trials = trialsOf(4000),
                               .seed = 11,
                               .maha_likelihood = true};
    experiment.wanted = {};
    experiment.wanted[methodIndex({Criterion::maha, true, true})] = true;
    const MeansReport r = run(experiment, 0).front();
    expectNear({r.index, r.index_se}, {noise == Noise::iid ? 3.08 : 3.10, 0.065}, name(noise));
    EXPECT_EQ(r.failures, 0u);
  }
}

}  // namespace
}  // namespace liestat::experiments
