#pragma once

#include <experiments/cell_run.hpp>
#include <experiments/hand_eye_scene.hpp>
#include <experiments/judged_report.hpp>
#include <stats/validation_report.hpp>

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace liestat::experiments {

/// The questions that `liestat validate hand-eye` asks.
enum class HandEyeExperiment {
  accuracy,     ///< well excited absolute poses: errors, covariance, χ² of the fit
  motions,      ///< directions that a motion leaves open, and the covariance of the rest
  outliers,     ///< three wrong pairs of ten: are they found?
  formulations  ///< relative motions that were made of absolute poses, for comparison
};
inline constexpr std::array all_hand_eye_experiments = {HandEyeExperiment::accuracy, HandEyeExperiment::motions,
                                                        HandEyeExperiment::outliers, HandEyeExperiment::formulations};
std::string name(HandEyeExperiment experiment);

/// Pairs for AX = XB from absolute poses. They share poses, which no χ² shows.
enum class HandEyeFormulation {
  poses,        ///< none: AX = YB from the poses
  motions,      ///< none: independent motions
  consecutive,  ///< each pose and the next
  to_first,     ///< each pose and the first
  all_pairs,
  all_pairs_scaled  ///< all pairs, the covariance times n/2
};
std::string name(HandEyeFormulation formulation);

struct HandEyeValidation {
  std::vector<HandEyeExperiment> experiments{all_hand_eye_experiments.begin(), all_hand_eye_experiments.end()};
  bool many_pairs = false;     ///< rows with 200 pairs, too
  RunSize run{.trials = 100};  ///< trials of a row
  /// Standard deviation of the noise that is drawn over that which the estimator is told.
  double noise_factor = 1;
};

/// One kind of scene and one estimate. The distances are the squared ones of the true X under the estimate's covariance,
/// or, of `fit`, the χ² of the residuals.
struct HandEyeRow : JudgedReport {
  HandEyeExperiment experiment = HandEyeExperiment::accuracy;
  HandEyeFormulation formulation = HandEyeFormulation::poses;
  HandEyeMotion motion = HandEyeMotion::general;
  HandEyeNoise noise = HandEyeNoise::isotropic;
  double scale = 1;  ///< factor of the noise
  std::size_t pairs = 0;
  std::optional<HandEyeOutliers> outliers;
  bool fit = false;
  std::size_t trials = 0;
  double rms_rotation = std::numeric_limits<double>::quiet_NaN();     ///< rad
  double rms_translation = std::numeric_limits<double>::quiet_NaN();  ///< m
  double rms_rotation_error = 0, rms_translation_error = 0;           ///< their standard errors
  double chi2_per_dof = std::numeric_limits<double>::quiet_NaN();     ///< mean
  /// RMS errors of an independent prototype, rad and m; NaN where it has none.
  double note_rotation = std::numeric_limits<double>::quiet_NaN();
  double note_translation = std::numeric_limits<double>::quiet_NaN();
  /// Trials with the right dimension of what is open (`motions`), or in which every wrong pair was found (`outliers`).
  std::size_t right = 0;
  std::optional<bool> right_passed;  ///< true if these are all; absent elsewhere
  double lost = 0;                   ///< share of the right pairs that were taken for wrong ones

  /// True if all that was judged passes; none if nothing was judged.
  std::optional<bool> answer() const {
    if (!right_passed && !passed) return std::nullopt;
    return right_passed.value_or(true) && passed.value_or(true);
  }
};

template <class V>
void describe(V& v, const HandEyeRow& row) {
  v("experiment", name(row.experiment))("formulation", name(row.formulation))("motion", name(row.motion));
  v("noise", name(row.noise))("noise_scale", row.scale)("pairs", row.pairs);
  v("outliers", row.outliers ? std::optional(name(*row.outliers)) : std::nullopt);
  v("quantity", row.fit ? "fit" : "calibration")("in_domain", row.promise.has_value());
  describeReport(v, row.report);
  v("rms_rotation", row.rms_rotation, "", "rad")("rms_translation", row.rms_translation, "", "m");
  v("note_rms_rotation", row.note_rotation, "of an independent prototype", "rad");
  v("note_rms_translation", row.note_translation, "", "m");
  v("chi2_per_dof", row.chi2_per_dof)("right", row.right, "trials")("right_passed", row.right_passed);
  v("lost", row.lost, "share of the right pairs that were taken for wrong ones");
  v("failures", row.report.failures)("passed", row.passed);
}

/// The noise of a row, with its factor.
std::string noiseName(const HandEyeRow& row);
/// A row in words.
std::string label(const HandEyeRow& row);

/// Rows in the order of the experiments.
std::vector<HandEyeRow> validateHandEye(const HandEyeValidation& validation, const RunProgress& progress = {});

/// The promises on the rows: what must be right in all trials, and the distances.
Judgement judgementOf(const std::vector<HandEyeRow>& rows);

}  // namespace liestat::experiments
