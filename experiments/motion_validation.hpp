// Monte-Carlo trials of the filters of fusion/motion/: how many find the direction, how well, and is its covariance true?
#pragma once

#include <experiments/cell_run.hpp>
#include <experiments/judgement.hpp>
#include <experiments/motion_scene.hpp>

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat::experiments {

/// The cells that are run.
enum class MotionMethod {
  subspace,          ///< 32 starts
  single_start,      ///< one start in a direction that is uniform on the sphere
  forward,           ///< 32 starts, the report's forward difference
  discrete,          ///< 32 starts, the exact flow
  gauss_newton,      ///< 32 starts, the covariance without second derivatives
  released,          ///< 32 starts, positive depth not enforced
  near_start,        ///< one start 10° off
  search,            ///< the residuals of 300 directions, summed over the frames (Heeger and Jepson 1992)
  essential,         ///< essential filter, 32 starts
  essential_near,    ///< the same from a direction 0.3 rad off and a rotation 30 % off
  composition,       ///< MotionFilter: subspace filter, then essential filter
  intervals,         ///< subspace filter, pairs of up to six frames (orbit) or four
  gyroscope,         ///< subspace filter with a gyroscope, discrete flow, linear start
  gyroscope_bias,    ///< the same, the gyroscope's bias a state
  gyroscope_robust,  ///< the same without the bias, expecting outliers, 32 starts
  essential_bias,    ///< essential filter with a gyroscope, its bias a state
  upset              ///< MotionFilter where something is wrong that it is not told: which frames does it call usable?
};
inline constexpr std::array all_motion_methods = {
    MotionMethod::subspace,       MotionMethod::single_start,   MotionMethod::forward,
    MotionMethod::discrete,       MotionMethod::gauss_newton,   MotionMethod::released,
    MotionMethod::near_start,     MotionMethod::search,         MotionMethod::essential,
    MotionMethod::essential_near, MotionMethod::composition,    MotionMethod::intervals,
    MotionMethod::gyroscope,      MotionMethod::gyroscope_bias, MotionMethod::gyroscope_robust,
    MotionMethod::essential_bias, MotionMethod::upset};
std::string name(MotionMethod method);

struct MotionValidation {
  std::vector<MotionMethod> methods{all_motion_methods.begin(), all_motion_methods.end()};
  RunSize run{.trials = 300};  ///< trials of a row
  double noise_factor = 1;     ///< standard deviation of the noise that is drawn over that which the filters are told
};

/// The frames at which a run is looked at.
inline constexpr std::array<int, 3> motion_frames = {20, 50, 100};
/// An error below this (degrees) is a success.
inline constexpr double motion_success = 10;

/// The documentation's promise on a row; none: shown for comparison.
struct MotionPromise {
  std::array<double, 3> success{};  ///< probability of an error below 10°, at least; 0: nothing
  std::array<double, 3> median{};   ///< degrees, at most; 0: nothing
  double coverage = 0;       ///< probability that a successful run's error is in the 95 % region at frame 100, at least
  double usable_frames = 0;  ///< share of the frames that are usable, at least
  double wrong_frames = 0;   ///< share of the frames that are usable and wrong, at most; 0: nothing
};

/// One cell of the tables.
struct MotionRow {
  MotionMethod method = MotionMethod::subspace;
  MotionSceneOptions scene;
  std::size_t trials = 0;
  std::array<std::size_t, 3> successes{};
  std::array<double, 3> median{};       ///< degrees, over all trials
  std::array<double, 3> consistency{};  ///< mean of ξᵀ P⁻¹ ξ/2 over the successes: 1 where the covariance is right
  double coverage = 0;                  ///< share of the successes whose error is in the 95 % region, at frame 100
  double convergence =
      0;              ///< median number of the frame from which on the error stays below 10°, of those where it does
  double usable = 0;  ///< share of the trials whose last estimate is called usable
  double usable_wrong = 0;  ///< share of these with an error above 10°
  /// Shares of the frames from 20 on: usable ones, usable ones with an error above 10°; and their standard errors.
  double usable_frames = 0, wrong_frames = 0, usable_error = 0, wrong_error = 0;
  std::optional<MotionPromise> promise;
  std::optional<bool> passed;
  std::string reason;  ///< the failed criteria, in words
};

template <class V>
void describe(V& v, const MotionRow& row) {
  v("method", name(row.method))("scene", nameOf(row.scene.world))("sigma_px", row.scene.sigma, "", "px");
  v("points", row.scene.points)("rotation_deg", row.scene.rotation, "of a frame", "deg");
  v("outliers", row.scene.outliers, "share")("gyroscope_sigma_deg", row.scene.gyroscope_sigma, "", "deg");
  v("gyroscope_bias_deg", row.scene.gyroscope_bias, "", "deg")("upset", nameOf(row.scene.upset))("trials", row.trials);
  const MotionPromise promise = row.promise.value_or(MotionPromise{});
  for (std::size_t k = 0; k < motion_frames.size(); ++k) {
    const std::string at = "_" + std::to_string(motion_frames[k]);
    v(("successes" + at).c_str(), row.successes[k], "trials")(("median_deg" + at).c_str(), row.median[k], "", "deg");
    v(("consistency" + at).c_str(), row.consistency[k], "1 where the covariance is right");
    if (promise.success[k] > 0) v(("promised_success" + at).c_str(), promise.success[k], "share");
    if (promise.median[k] > 0) v(("promised_median_deg" + at).c_str(), promise.median[k], "", "deg");
  }
  v("coverage95", row.coverage)("convergence_frame", row.convergence);
  if (promise.coverage > 0) v("promised_coverage95", promise.coverage);
  v("usable_frames", row.usable_frames, "share of the frames from 20 on");
  v("wrong_frames", row.wrong_frames, "share that is usable and more than 10 deg off");
  if (promise.wrong_frames > 0) {
    v("promised_usable_frames", promise.usable_frames)("promised_wrong_frames", promise.wrong_frames);
  }
  v("usable", row.usable)("usable_wrong", row.usable_wrong)("in_domain", row.promise.has_value());
  v("passed", row.passed)("reason", row.reason);
}

/// A scene in one cell of a table: the world and what is not the default.
std::string sceneOf(const MotionRow& row);

/// The cells of some methods, in their order.
std::vector<MotionRow> motionCells(const std::vector<MotionMethod>& methods);

/// Runs everything.
std::vector<MotionRow> validateMotion(const MotionValidation& validation, const RunProgress& progress = {});

/// The promises on the rows.
Judgement judgementOf(const std::vector<MotionRow>& rows);

}  // namespace liestat::experiments
