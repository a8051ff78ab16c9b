// Pennec 1998, section 5, on frames, semi- and non-oriented frames: both covariance models, the printed formulas, and
// the spread at which the quotients' means are ill-defined. References as in pennec_rotations_test.cpp: four standard
// errors.

#include <experiments/means_experiment.hpp>
#include <experiments/means_report.hpp>

#include <gtest/gtest.h>

#include <cmath>

#include "paper/full_run.hpp"

namespace liestat::experiments {
namespace {

constexpr double third = 1.0 / 3;

MethodMask only(std::initializer_list<Method> list) {
  MethodMask mask{};
  for (const Method& method : list) mask[methodIndex(method)] = true;
  return mask;
}

const Method lsq_known{Criterion::lsq, true, true};
const Method lsq_residual{Criterion::lsq, true, false};
const Method maha_corrected{Criterion::maha, true, true};
const Method maha_printed{Criterion::maha, false, true};

void expectNear(double ours, double our_se, double reference, double reference_se, const char* what) {
  EXPECT_NEAR(ours, reference, 4 * std::hypot(our_se, reference_se)) << what << ", our SE " << our_se;
}

double ratio(const MeansReport& report, ErrorRatio index) { return std::exp(report.of(index).mean); }
double ratioError(const MeansReport& report, ErrorRatio index) {
  const TrialStatistic s = report.of(index);
  return ratio(report, index) * s.standard_deviation / std::sqrt(static_cast<double>(s.count));
}

TEST(PennecFrames, leastSquaresAtModerateSpread) {
  // n, exact-Hessian index and its SE, ratio of the residual form to Hotelling's mean.
  struct Row {
    Noise noise;
    std::size_t n;
    double index, se, residual_ratio;
  };
  for (const Row& row : {Row{Noise::iid, 10, 6.66, 0.11, 0.926}, Row{Noise::iid, 30, 6.25, 0.09, 0.996},
                         Row{Noise::iid, 60, 6.07, 0.08, 1.001}, Row{Noise::idd, 30, 6.09, 0.08, 0.984}}) {
    const auto reports = run({.feature = Feature::frame,
                              .noise = row.noise,
                              .n = row.n,
                              .spread = third,
                              .trials = trialsOf(2000, 4),
                              .seed = 5,
                              .wanted = only({lsq_known, lsq_residual})},
                             0);
    expectNear(reports[0].index, reports[0].index_se, row.index, row.se, "known noise");
    const double mean = reports[1].law.mean();
    const double reference_se = std::sqrt(reports[1].law.variance() / 2000) / mean;
    expectNear(reports[1].index / mean, reports[1].index_se / mean, row.residual_ratio,
               std::isfinite(reference_se) ? reference_se : 0.05, "residuals over Hotelling");
    EXPECT_EQ(reports[0].failures, 0u);
  }
}

TEST(PennecFrames, mahaInTheEstimatesFrame) {
  // The report's noise x = f e: M2 with LSQ/M2 1.61 (IID) and 2.20 (IDD) in rotation, 1.00 and 1.72 ± 0.05 in
  // translation.
  for (const Noise noise : {Noise::iid, Noise::idd}) {
    const auto reports = run({.feature = Feature::frame,
                              .noise = noise,
                              .n = 30,
                              .spread = third,
                              .trials = trialsOf(1000, 2),
                              .seed = 6,
                              .wanted = only({lsq_known, maha_corrected})},
                             0);
    EXPECT_EQ(reports[1].failures, 0u);
    EXPECT_TRUE(reports[1].passed(1e-5, {.index = 0.06, .ks = 0.03})) << reports[1];
    const bool iid = noise == Noise::iid;
    expectNear(ratio(reports[0], log_ratio_rotation), ratioError(reports[0], log_ratio_rotation), iid ? 1.61 : 2.20,
               0.05, "LSQ/M2 rotation");
    expectNear(ratio(reports[0], log_ratio_translation), ratioError(reports[0], log_ratio_translation),
               iid ? 1.00 : 1.72, 0.05, "LSQ/M2 translation");
  }
}

TEST(PennecFrames, mahaInTheMeasurementsFrame) {
  // Noise that is Gaussian in the sensor's frame, M1: indices 5.75 ± 0.12 (IID) and 5.94 ± 0.12 (IDD) with H_GN⁻¹,
  // LSQ/M1 1.02 and 1.70 in rotation, 1.87 and 2.51 in translation.
  for (const Noise noise : {Noise::iid, Noise::idd}) {
    const auto reports = run({.feature = Feature::frame,
                              .noise = noise,
                              .n = 30,
                              .spread = third,
                              .covariance_at = CovarianceAt::measured,
                              .trials = trialsOf(800, 2),
                              .seed = 8,
                              .wanted = only({lsq_known, maha_corrected, maha_printed})},
                             0);
    const bool iid = noise == Noise::iid;
    EXPECT_EQ(reports[1].failures, 0u);
    EXPECT_TRUE(reports[1].passed(1e-5, {.index = 0.06, .ks = 0.03})) << reports[1];
    expectNear(ratio(reports[0], log_ratio_rotation), ratioError(reports[0], log_ratio_rotation), iid ? 1.02 : 1.70,
               0.05, "LSQ/M1 rotation");
    expectNear(ratio(reports[0], log_ratio_translation), ratioError(reports[0], log_ratio_translation),
               iid ? 1.87 : 2.51, 0.06, "LSQ/M1 translation");
    // As printed MAHA fails in some trials and lies in the others (index about 30 and 19).
    EXPECT_GT(reports[2].failures, 0u);
    EXPECT_GT(reports[2].index, 10.0);
  }
}

TEST(PennecFrames, quotientsCoincideWithRotationsAtModerateSpread) {
  for (const Feature feature : {Feature::semi_oriented_frame, Feature::non_oriented_frame}) {
    const auto reports = run({.feature = feature,
                              .noise = Noise::idd,
                              .n = 30,
                              .spread = third,
                              .trials = trialsOf(1000, 2),
                              .seed = 6,
                              .wanted = only({lsq_known, maha_corrected})},
                             0);
    EXPECT_EQ(reports[1].failures, 0u);
    EXPECT_TRUE(reports[1].passed(1e-5, {.index = 0.06, .ks = 0.03})) << reports[1];
    expectNear(ratio(reports[0], log_ratio_rotation), ratioError(reports[0], log_ratio_rotation), 2.22, 0.05,
               "rotation");
    expectNear(ratio(reports[0], log_ratio_translation), ratioError(reports[0], log_ratio_translation), 1.75, 0.06,
               "translation");
  }
}

TEST(PennecFrames, quotientsAreIllDefinedAtTheReportsSpread) {
  // No first-order covariance can be right: rotation part 8.23 ± 0.30 (semi, IID), 8.53 ± 0.29 (non) where 3 is
  // expected.
  for (const Feature feature : {Feature::semi_oriented_frame, Feature::non_oriented_frame}) {
    const auto reports = run({.feature = feature,
                              .noise = Noise::iid,
                              .n = 30,
                              .trials = trialsOf(2000, 8),
                              .seed = 9,
                              .wanted = only({lsq_known})},
                             0);
    EXPECT_GT(reports[0].index, 6 + 4 * reports[0].index_se);
    EXPECT_LT(reports[0].ks_p_value, 1e-3);
  }
}

}  // namespace
}  // namespace liestat::experiments
