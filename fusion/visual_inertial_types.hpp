// The input and the result of the initialisation of a visual-inertial recording (fusion/visual_inertial.hpp), for
// units that only look at it: the estimators cost a compiler more than the rest of the library.
#pragma once

#include <fusion/camera.hpp>
#include <fusion/imu/preintegrate.hpp>
#include <fusion/imu/window.hpp>
#include <fusion/init/options.hpp>
#include <fusion/init/filter_start.hpp>
#include <fusion/init/inertial_state.hpp>
#include <fusion/init/results.hpp>
#include <fusion/noise_calibration_types.hpp>
#include <fusion/status.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

namespace liestat {

/// A track as one image of one camera saw it, in pixels.
struct PixelMeasurement {
  std::size_t image = 0;  ///< index into the recording's image times
  std::size_t track = 0;  ///< which track, counted from 0
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  std::size_t camera = 0;           ///< index into the recording's cameras
  std::optional<double> time = {};  ///< s; none: that of its image, as it must be to 1 µs so far
};

/// The same as a direction.
struct BearingMeasurement {
  std::size_t image = 0;
  std::size_t track = 0;
  Eigen::Vector3d bearing = Eigen::Vector3d::Zero();  ///< in the axes of its camera; of any length but zero
  double sigma = 0;                                   ///< rad, its standard deviation in each direction across it
  std::size_t camera = 0;
  std::optional<double> time = {};
};

/// Bearings of pixels with a noise of so many pixels in u and in v each. Those that the model of their lens can't
/// explain, or whose camera does not exist, are left out.
inline std::vector<BearingMeasurement> bearingsOf(std::span<const PixelMeasurement> pixels,
                                                  std::span<const Camera> cameras, double pixel_sigma) {
  std::vector<BearingMeasurement> bearings;
  bearings.reserve(pixels.size());
  for (const PixelMeasurement& seen : pixels) {
    if (seen.camera >= cameras.size()) continue;
    const auto ray = cameras[seen.camera].bearingWithSigma(seen.pixel, pixel_sigma);
    if (ray) bearings.push_back({seen.image, seen.track, ray->direction, ray->sigma, seen.camera, seen.time});
  }
  return bearings;
}

/// The measurements of a recording. Times are on one clock (s).
struct VisualInertialRecording {
  std::span<const ImuSample<double>> readings = {};  ///< in the order of time; a view: they must outlive the call
  ImuNoise<double> noise = {};                       ///< noise of the readings; both white densities must be positive
  std::vector<double> image_times = {};              ///< ascending
  std::vector<SE3d> cameras = {SE3d()};  ///< body_T_camera of each camera (m); the body is the inertial sensor
  std::vector<BearingMeasurement> observations = {};
};

struct VisualInertialOptions {
  double window = 2;                           ///< s
  double stride = 0;                           ///< s from the start of a window to that of the next; 0: the window
  double image_rate = 10;                      ///< Hz: of the images that are used, at most; 0: all
  std::size_t max_features = 50;               ///< a window: those that were seen most often are taken; 0: all
  std::size_t min_observations = 4;            ///< minimum for a feature in a window
  std::optional<double> begin = {}, end = {};  ///< s; none: the first and the last image
  bool consensus = true;                       ///< tracks may be wrong
  bool refinement = true;                      ///< else the closed form alone
  double stretch = 12;                         ///< s: windows that are fused; 0: none
  /// The densities of the sensor's noise are tested, and calibrated where the windows refute them, by all meetings of
  /// windows of the recording (fusion/noise_calibration.hpp). Not without refinement, stretches or unknown biases.
  bool calibrate_noise = true;
  bool inflate = false;  ///< multiply the covariance of a stretch that is not ok by its inflation
  ImuScheme scheme = ImuScheme::averaged;
  double max_gap = 0.1;             ///< s, between readings
  std::size_t max_windows = 20000;  ///< more are bad_option
  /// The biases at a time where they are known: then they are not estimated. Empty: they never are.
  std::function<std::optional<ImuBias<double>>(double time)> known_bias = {};
  /// Gravity, the priors of the biases, the seed, and all that the steps need. The noise of bearings is that of the
  /// observations; the accelerometer's bias is estimated in closed form in windows of two seconds and more, because it
  /// is not told in less (docs/theory/visual_inertial.md, section 3.5).
  InitialisationOptions initialisation = {};
  FilterStartOptions filter_start = {};  ///< what is free of a filter's start, and how it is shown
  /// Asked before each window; once it says true, no further window is estimated.
  std::function<bool()> stop = {};
};

/// One window.
struct InitialisedWindow {
  double begin = 0, end = 0;        ///< s, of its first and last image
  Fault fault;                      ///< fault of the readings, with the reading's index
  double fault_time = 0;            ///< s
  std::vector<std::size_t> images;  ///< indices of the recording's images
  std::vector<std::size_t> tracks;  ///< indices of the recording's tracks; features of the results in this order
  InertialWindow measured;          ///< integrated with the biases of the closed form
  bool known_biases = false;        ///< nothing was estimated
  /// Motion, tracks that agree, and the gyroscope's bias. Where biases are known, or all tracks are right, what was not
  /// asked for is as it was given.
  RobustInitialisation found;
  std::optional<RefinementResult> refined;

  const ClosedFormResult& closedForm() const { return found.result; }
  bool isRefined() const { return refined && refined->converged(); }
  /// The best known.
  ImuBias<double> bias() const {
    if (isRefined()) return refined->bias;
    ImuBias<double> best = measured.bias();
    if (!closedForm().solutions.empty()) best.accelerometer += closedForm().solutions[0].accelerometer_bias;
    return best;
  }
  /// At each image, those of the closed form's first solution with its biases; empty: there is none.
  std::vector<SE23d> closedFormStates() const;
  /// The refined states, or those.
  std::vector<SE23d> states() const { return isRefined() ? refined->states : closedFormStates(); }
  /// How it ended: what the closed form says, or what the refinement says against it.
  FusionStatus verdict() const {
    const FusionStatus closed = closedForm().status;
    if (fault) return fault == FaultKind::gap ? FusionStatus::gap : FusionStatus::no_readings;
    if (tracks.empty() || closedForm().fault == FaultKind::no_feature) return FusionStatus::no_features;
    // Tracks at rest, and readings that are not.
    if (closed == FusionStatus::stationary && refined && !isRefined()) return FusionStatus::no_parallax;
    if (closed != FusionStatus::ok) return closed;
    if (found.inliers.empty()) return FusionStatus::no_consensus;
    if (found.second) return FusionStatus::ambiguous;
    if (refined ? refined->ok() : closedForm().consistent) return FusionStatus::ok;
    if (!refined || refined->status == FusionStatus::ok) return FusionStatus::inconsistent;
    return refined->converged() ? refined->status : FusionStatus::not_refined;
  }
  /// Exactly one answer, converged, that explains the data.
  bool ok() const { return verdict() == FusionStatus::ok; }
};

/// The state that disjoint windows give together (fusion/init/window_fusion.hpp), at the last image of the last.
struct FusedStretch {
  double begin = 0, end = 0;         ///< s
  std::vector<std::size_t> windows;  ///< indices of the result's windows
  bool has_state = false;            ///< false: there is none, as each window may fail when it is refined again
  double chi2 = 0;                   ///< χ² of the windows' distances from each other
  std::size_t degrees_of_freedom = 0;
  double p = 1;                   ///< the probability of so large a χ² of windows that agree
  double inflation = 1;           ///< factor of the covariances at which they would, at least 1
  bool inflated = false;          ///< it was applied
  double gravity = 0;             ///< |G| that was used (m/s²)
  Gaussian<InertialState> state;  ///< at the end

  /// A single window has nothing that could contradict it.
  bool tested() const { return has_state && degrees_of_freedom > 0; }
  /// True if there is a state with a covariance that the windows were able to contradict and do not: p ≥ 1e-3, or it
  /// was inflated.
  bool ok() const { return tested() && (p >= min_p_of_fusion || inflated); }
  const char* word() const { return !has_state ? "no_state" : !tested() ? "untested" : ok() ? "ok" : "inconsistent"; }
};

struct VisualInertialResult {
  /// bad_option: not usable, or too many windows; too_few_images: no window fits; wrong_index: the observation.
  Fault fault;
  std::vector<InitialisedWindow> windows;
  std::vector<FusedStretch> stretches;
  std::optional<NoiseCalibration> noise_calibration;  ///< none: it was not asked for, or could not be
  FilterStart filter_start;                           ///< as of filterStart() (fusion/visual_inertial.hpp)
  double bearing_noise = 0;                           ///< rad, the median of the observations
  std::size_t images_outside = 0;                     ///< that the readings do not cover
  std::size_t windows_left = 0;                       ///< that were not estimated, because of options.stop
};

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/init/detail/closed_form_states.hpp>
#endif
