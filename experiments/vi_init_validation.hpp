#pragma once

#include <experiments/cell_run.hpp>
#include <experiments/judged_report.hpp>
#include <experiments/vi_init_trials.hpp>

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace liestat::experiments {

/// The questions that are asked of visual-inertial initialisation.
enum class ViInitCheck {
  consistency,     ///< the refinement under its covariance, and its errors
  walk,            ///< the same covariance where biases walk
  closed_form,     ///< the closed form under its covariance, with image noise alone
  accuracy,        ///< errors of the closed form, biases known
  gyroscope_bias,  ///< errors where the gyroscope has a bias of 0.05 rad/s
  noise,           ///< the calibration of the sensor's noise where it is 1, 4, 16 times as large
  rest,            ///< rest is recognised, and slow motion is not called rest; gravity and biases at rest
  drift            ///< errors where 40 % of the tracks drift
};
inline constexpr std::array all_vi_init_checks = {
    ViInitCheck::consistency,    ViInitCheck::walk,  ViInitCheck::closed_form, ViInitCheck::accuracy,
    ViInitCheck::gyroscope_bias, ViInitCheck::noise, ViInitCheck::rest,        ViInitCheck::drift};
std::string name(ViInitCheck check);

/// The estimator that a row is about, and what it leaves out.
enum class ViInitEstimator {
  refinement,
  closed_form,
  closed_form_with_bias,  ///< the bias of the accelerometer
  least_squares,          ///< the closed form without the removal of the noise's bias
  bias_estimated,         ///< the bias of the gyroscope
  bias_ignored,           ///< the bias of the gyroscope
  robust,
  oracle,        ///< knows which tracks drift
  no_selection,  ///< takes all tracks
  at_rest,       ///< the initialisation of a body at rest
  /// And of one that moves at 0.25, 0.05, 0.0125, 0.0025 m/s among features 2 to 8 m away.
  speed_250_mm,
  speed_50_mm,
  speed_12_mm,
  speed_2_mm,
  /// The calibration of noise where the densities of gyroscope and accelerometer are so many times the given ones.
  noise_1_1,
  noise_4_4,
  noise_16_16,
  noise_4_1,
  noise_1_4,
  noise_16_1,
  noise_1_16
};
std::string name(ViInitEstimator estimator);

/// The quantity that a row is about.
enum class ViInitQuantity {
  nees_v,             ///< squared Mahalanobis distance of V, 3 degrees of freedom
  nees_v_g,           ///< the same for V and gravity, 5
  nees_all,           ///< the same for V, gravity and the biases that are estimated: 11, 8 in closed form
  nees_last_state,    ///< the same for the state at the last image, 9
  nees_at_last,       ///< the same for that state, gravity and the biases there, 17
  nees_at_rest,       ///< the same for gravity and both biases, 8
  nees_filter_start,  ///< the same for the start of a filter at the last image, 15
  chi2_per_dof,       ///< cost of the bearings, motions and priors
  speed,              ///< length of the error of V
  gravity,            ///< angle to the true one
  scale,              ///< length of V over the true one, off 1
  scale_of_features,
  bias,       ///< length of the error of the gyroscope's bias
  selection,  ///< fraction of the windows in which exactly the right tracks were kept
  told,  ///< fraction of the windows that were told right: rest called so; of slow motion: not called rest, or slower than what that excludes
  moving,                  ///< fraction of the windows of slow motion that were not called rest; no promise
  gyroscope_interval,      ///< fraction of the recordings in which the interval of the gyroscope's factor holds it
  accelerometer_interval,  ///< and the accelerometer's
  common_interval          ///< and that of both as one
};
std::string name(ViInitQuantity quantity);
/// Its unit; empty for a pure number.
std::string unit(ViInitQuantity quantity);

/// How a quantity is judged.
enum class ViInitStatistic {
  distance,     ///< squared distances, against their law
  chi_squared,  ///< a sum of squared residuals over its degrees of freedom
  error,        ///< by median and 95 % quantile
  fraction      ///< fraction of the windows
};
ViInitStatistic statistic(ViInitQuantity quantity);

/// The promise made about a row (docs/validation.md), and the figures of an independent prototype. Infinite:
/// none.
struct ViInitPromise {
  ValidationTolerance tolerance = {};  ///< tolerance of distances; its `failure_fraction` also of all others
  double median = std::numeric_limits<double>::infinity();
  double p95 = std::numeric_limits<double>::infinity();
  /// The prototype's figures, out of so many windows.
  double note_median = std::numeric_limits<double>::infinity();
  double note_p95 = std::numeric_limits<double>::infinity();
  std::size_t note_windows = 60;
  double deviation = 0;  ///< tolerated deviation of χ² per degree of freedom from 1
  double fraction = 0;   ///< at least
};

/// A run of `liestat validate vi-init`.
struct ViInitValidation {
  std::vector<ViInitCheck> checks{all_vi_init_checks.begin(), all_vi_init_checks.end()};
  std::vector<double> windows;  ///< s; of those that there are; all of them for none
  RunSize run{.trials = 600};   ///< windows of a row; of slow motion a tenth of them
  std::size_t recordings = 10;  ///< a row of the calibration of noise
  double noise = 1;             ///< simulated noise over the noise that the estimators are told
};

/// One line of the JSON. Numbers that do not apply are NaN.
struct ViInitRow {
  ViInitCheck check{};
  ViInitEstimator estimator{};
  ViInitQuantity quantity{};
  ViInitWindow window;
  std::size_t trials = 0, failures = 0;
  std::optional<ValidationReport> report;  ///< report on distances; their list is empty
  double median = std::numeric_limits<double>::quiet_NaN();
  double p95 = std::numeric_limits<double>::quiet_NaN();
  double value = std::numeric_limits<double>::quiet_NaN();     ///< χ² per degree of freedom, fraction
  double value_se = std::numeric_limits<double>::quiet_NaN();  ///< its standard error if the promise is kept
  std::optional<ViInitPromise> promise;
  std::optional<bool> passed;                             ///< true if the promise is kept; absent without one
  ValidationVerdict verdict = ValidationVerdict::passed;  ///< the same with the reason
};

template <class V>
void describe(V& v, const ViInitRow& row) {
  v("check", name(row.check))("estimator", name(row.estimator))("quantity", name(row.quantity));
  v("unit", unit(row.quantity), "of median and p95");
  v("window", row.window.seconds, "", "s")("images", row.window.images)("features", row.window.features);
  v("in_domain", row.promise.has_value());
  ValidationReport none;
  none.trials = row.trials;
  describeReport(v, row.report.value_or(none), row.report.has_value());
  v("failures", row.failures)("median", row.median, "of the errors")("p95", row.p95);
  v("value", row.value, "chi-squared per degree of freedom, or a fraction")("value_se", row.value_se);
  const ViInitPromise promise = row.promise.value_or(ViInitPromise{});
  v("promised_median", promise.median)("promised_p95", promise.p95);
  v("note_median", promise.note_median, "of an independent prototype")("note_p95", promise.note_p95);
  v("passed", row.passed);
}

/// The rows of one estimator in one kind of window.
struct ViInitGroup {
  std::vector<const ViInitRow*> rows;

  const ViInitRow& first() const { return *rows.front(); }
  const ViInitRow* of(ViInitQuantity quantity) const;  ///< null without one
  /// True if all that was judged passes; none if nothing was.
  std::optional<bool> passed() const;
};
/// The groups of a check, in the order of the rows.
std::vector<ViInitGroup> groups(const std::vector<ViInitRow>& rows, ViInitCheck check);

/// The promise made about a row, if there is one.
std::optional<ViInitPromise> viInitPromise(const ViInitRow& row);

/// Runs the checks; rows in the order of the checks, windows and quantities. The same for any number of threads.
std::vector<ViInitRow> validateViInit(const ViInitValidation& validation, const RunProgress& progress = {});

/// The promises on the rows.
Judgement judgementOf(const std::vector<ViInitRow>& rows);

}  // namespace liestat::experiments
