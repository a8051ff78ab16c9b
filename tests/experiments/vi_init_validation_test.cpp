// The validation of visual-inertial initialisation: each check, what it can't pass, and what it does not judge.

#include <experiments/vi_init_trials.hpp>
#include <experiments/vi_init_validation.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

namespace liestat::experiments {
namespace {

ViInitValidation small(std::vector<ViInitCheck> checks, std::size_t trials) {
  ViInitValidation validation;
  validation.checks = std::move(checks);
  validation.run.trials = trials;
  validation.recordings = 1;
  return validation;
}

const ViInitRow& find(const std::vector<ViInitRow>& rows, ViInitEstimator estimator, ViInitQuantity quantity,
                      double window = 2) {
  for (const ViInitRow& row : rows) {
    if (row.estimator == estimator && row.quantity == quantity && row.window.seconds == window) return row;
  }
  throw std::out_of_range("no such row");
}

bool allPassed(const std::vector<ViInitRow>& rows) {
  return std::all_of(rows.begin(), rows.end(), [](const ViInitRow& row) { return row.passed.value_or(true); });
}

TEST(ValidateViInit, eachCheckRunsAndKeepsItsPromises) {
  // Rows a kind of window: 10 of the refinement, 6 with walks; 2, and 3 with the bias; 6 of each accuracy; 5; 3 at
  // rest, and 2 of slow motion; 10; 2 intervals, and where factors are equal 3.
  const std::pair<ViInitCheck, std::size_t> expected[] = {
      {ViInitCheck::consistency, 5 * 10}, {ViInitCheck::walk, 3 * 6},         {ViInitCheck::closed_form, 3 * 2 + 3 * 3},
      {ViInitCheck::accuracy, 4 * 6},     {ViInitCheck::gyroscope_bias, 5},   {ViInitCheck::rest, 2 * 3 + 12 * 2},
      {ViInitCheck::drift, 10},           {ViInitCheck::noise, 3 * 3 + 4 * 2}};
  for (const auto& [check, count] : expected) {
    const auto rows = validateViInit(small({check}, 24));
    EXPECT_EQ(rows.size(), count) << name(check);
    for (const ViInitRow& row : rows) {
      EXPECT_EQ(row.check, check);
      const bool slow = check == ViInitCheck::rest && row.estimator != ViInitEstimator::at_rest;
      EXPECT_EQ(row.trials, check == ViInitCheck::noise ? 1U : slow ? 2U : 24U);
      EXPECT_EQ(row.passed.has_value(), row.promise.has_value());
      EXPECT_TRUE(row.passed.value_or(true)) << name(row.quantity) << ": " << reason(row.verdict);
      // Each row has its one kind of number.
      EXPECT_EQ(row.report.has_value() + std::isfinite(row.median) + std::isfinite(row.value), 1)
          << name(row.estimator) << " " << name(row.quantity);
    }
  }
}

TEST(ValidateViInit, whatIsNotPromisedIsNotJudged) {
  const auto rows = validateViInit(small({ViInitCheck::gyroscope_bias, ViInitCheck::drift}, 24));
  EXPECT_FALSE(find(rows, ViInitEstimator::bias_ignored, ViInitQuantity::scale).passed);
  EXPECT_FALSE(find(rows, ViInitEstimator::no_selection, ViInitQuantity::speed).passed);
  // Estimation and selection are worth their cost: the factors measured are 20 and 100.
  EXPECT_GT(find(rows, ViInitEstimator::bias_ignored, ViInitQuantity::gravity).median,
            5 * find(rows, ViInitEstimator::bias_estimated, ViInitQuantity::gravity).median);
  EXPECT_GT(find(rows, ViInitEstimator::no_selection, ViInitQuantity::speed).median,
            10 * find(rows, ViInitEstimator::robust, ViInitQuantity::speed).median);
}

TEST(ValidateViInit, noiseThatNobodyToldFails) {
  for (const ViInitCheck check : all_vi_init_checks) {
    if (check == ViInitCheck::noise) continue;  // below
    ViInitValidation wrong = small({check}, 60);
    wrong.noise = 2;
    wrong.windows = {2};
    const auto rows = validateViInit(wrong);
    EXPECT_FALSE(allPassed(rows)) << name(check);
    if (check == ViInitCheck::consistency || check == ViInitCheck::walk) {
      // Four times the variance, of which the priors' part is told right from wrong too.
      const ViInitRow& row = find(rows, ViInitEstimator::refinement, ViInitQuantity::nees_v_g);
      EXPECT_NEAR(row.report->index, 20, 6);
      EXPECT_EQ(*row.passed, false);
    }
  }
}

// One kind of recording of the seven: a second each.
TEST(ValidateViInit, intervalsOfTheCalibrationMissNoiseThatNobodyTold) {
  int held = 0;
  for (std::uint64_t i = 0; i < 6; ++i) {
    CounterRng rng(1, i);
    const NoiseOutcome outcome = noiseTrial<4, 4>({2, 11, 40}, 2, rng);
    held += outcome.gyroscope + outcome.accelerometer + outcome.common;
  }
  // 18 intervals, of which 16 are promised to hold the factor.
  EXPECT_LT(held, 9) << held;
}

// A window that can't be solved has no distance and infinite errors: it is not dropped.
TEST(ValidateViInit, lostWindowsAreMarked) {
  const ViInitWindow two_images{2, 2, 20};
  CounterRng rng(1);
  const double infinite = std::numeric_limits<double>::infinity();
  const auto expectNone = [](std::initializer_list<double> distances) {
    for (const double distance : distances) EXPECT_TRUE(std::isnan(distance));
  };
  const auto expectLost = [&](const ViErrors& errors) {
    for (const double error : {errors.speed, errors.gravity, errors.scale}) EXPECT_EQ(error, infinite);
  };
  for (const ViInitTrial<ClosedFormOutcome> trial : {closedFormNeesTrial, closedFormBiasNeesTrial}) {
    const ClosedFormOutcome closed = trial(two_images, 1, rng);
    expectNone({closed.nees_v_g, closed.nees_all, closed.chi2.cost, closed.chi2.degrees_of_freedom});
  }
  for (const ViInitTrial<RefinementOutcome> trial : {refinementTrial, walkTrial}) {
    const RefinementOutcome refined = trial(two_images, 1, rng);
    expectNone({refined.nees_v, refined.nees_v_g, refined.nees_all, refined.nees_last_state, refined.nees_at_last,
                refined.nees_filter_start, refined.chi2.cost, refined.chi2.degrees_of_freedom});
    expectLost(refined.errors);
    EXPECT_EQ(refined.scale_of_features, infinite);
  }
  const AccuracyOutcome accuracy = closedFormErrorsTrial(two_images, 1, rng);
  expectLost(accuracy.closed_form);
  expectLost(accuracy.least_squares);
  const GyroscopeBiasOutcome gyroscope = gyroscopeBiasTrial(two_images, 1, rng);
  EXPECT_EQ(gyroscope.bias, infinite);
  expectLost(gyroscope.estimated);
  expectLost(gyroscope.ignored);
  const RestOutcome rest = restTrial(two_images, 1, rng);
  EXPECT_FALSE(rest.stationary);
  expectNone({rest.nees, rest.nees_filter_start});
  EXPECT_FALSE(slowTrial<20>(two_images, 1, rng).stationary);
  const DriftOutcome drift = driftTrial(two_images, 1, rng);
  EXPECT_FALSE(drift.exact_selection);
  expectLost(drift.robust);
  expectLost(drift.oracle);
  expectLost(drift.no_selection);
}

TEST(ValidateViInit, doesNotDependOnThreads) {
  ViInitValidation validation = small({ViInitCheck::accuracy, ViInitCheck::drift}, 20);
  validation.windows = {2};
  validation.run.threads = 1;
  const auto one = validateViInit(validation);
  validation.run.threads = 3;
  const auto three = validateViInit(validation);
  ASSERT_EQ(one.size(), three.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    if (std::isfinite(one[i].median)) {
      EXPECT_EQ(one[i].median, three[i].median);
      EXPECT_EQ(one[i].p95, three[i].p95);
    }
  }
}

}  // namespace
}  // namespace liestat::experiments
