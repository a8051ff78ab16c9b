#pragma once

#include <experiments/cell_run.hpp>
#include <experiments/judged_report.hpp>

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace liestat::experiments {

/// The question asked of a preintegrated motion.
enum class PreintegrationCheck {
  motion,           ///< the increment under its 9×9 covariance, biases known and constant
  walk,             ///< the increment under its 9×9 covariance, biases that walk
  motion_and_bias,  ///< increment and change of the biases under their 15×15 covariance; merged out of two halves
  recording  ///< the increment of a recording as preintegrate() gives it: scenes, rates, faults of the readings' times
};
inline constexpr std::array all_preintegration_checks = {PreintegrationCheck::motion, PreintegrationCheck::walk,
                                                         PreintegrationCheck::motion_and_bias,
                                                         PreintegrationCheck::recording};
/// Names in options and JSON fields, in the order of the enumerators.
inline constexpr std::array preintegration_check_names{"motion", "walk", "motion_and_bias", "recording"};
inline std::string name(PreintegrationCheck check) {
  return preintegration_check_names[static_cast<std::size_t>(check)];
}
/// Degrees of freedom of the error that is judged.
int degreesOfFreedom(PreintegrationCheck check);

/// A run of `liestat validate preintegration`: the product of the lists, at 200 readings a second, and the recordings.
struct PreintegrationValidation {
  std::vector<PreintegrationCheck> checks{all_preintegration_checks.begin(), all_preintegration_checks.end()};
  std::vector<double> windows{0.1, 0.5, 1.0, 2.0};  ///< s
  std::vector<double> noises{1, 10, 100};           ///< densities over those of an ADIS16448
  bool all_recordings = false;                      ///< or a few of them
  RunSize run{.trials = 2000};                      ///< trials of a row
};

/// One row. The distances themselves are not kept.
struct PreintegrationRow : JudgedReport {
  PreintegrationCheck check{};
  double window = 0;  ///< s
  double noise = 0;   ///< densities over those of an ADIS16448
  /// A recording: "wild 200 Hz, 20 % dropped, cubic". Trials in which preintegrate() says that the covariance may be
  /// off (RecordingResult::sampling) count as failures, and are not judged.
  std::string scene;
};

/// Up to this multiple of the ADIS16448's noise the laws are promised (docs/preintegration.md).
inline constexpr double preintegration_promise = 10;

template <class V>
void describe(V& v, const PreintegrationRow& row) {
  v("check", name(row.check))("scene", row.scene, "motion, readings and scheme of a recording; else empty")(
      "window", row.window, "", "s")("noise", row.noise, "over that of an ADIS16448");
  v("in_domain", row.passed.has_value());
  describeReport(v, row.report);
  v("failures", row.report.failures)("passed", row.passed);
}

std::vector<PreintegrationRow> validatePreintegration(const PreintegrationValidation& validation,
                                                      const RunProgress& progress = {});

/// The promises on the rows.
Judgement judgementOf(const std::vector<PreintegrationRow>& rows);

}  // namespace liestat::experiments
