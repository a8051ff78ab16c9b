// How noisy the inertial sensor is in motion, from a recording: the factors of its densities at which the windows of the
// recording agree with each other.
//
//   const auto found = liestat::calibrateNoise(recording, {.window = 3});
//   if (found.status == liestat::FusionStatus::ok) recording.noise = found.noise;
//
// Data sheets tell the noise of a sensor at rest. In motion scale factors, vibration and time stamps add to it, which
// the refinement of a window does not see, because bearings rule its cost; but where two windows meet (window_fusion.hpp)
// their difference d has the covariance S that both expect, which grows with the densities. The factors minimise
// Σ dᵀ S⁻¹ d + log det S over all meetings, minus twice the log-likelihood; intervals are those of its profiles, for few
// meetings widened by Student's law.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/visual_inertial_types.hpp>

#include <cstddef>
#include <functional>
#include <limits>

namespace liestat {

/// A factor of a density with its 95 % interval.
struct NoiseFactor {
  double factor = 1, low = 0, high = std::numeric_limits<double>::infinity();

  /// True if the interval is narrower than a factor of six.
  bool isTold() const { return high < 6 * low; }
};

/// The result of calibrateNoise().
struct NoiseCalibration {
  /// ok; undetermined: too few windows meet, or any factor explains them; not_converged: the factors do not settle;
  /// bad_input: see fault.
  FusionStatus status = FusionStatus::bad_input;
  Fault fault;
  /// Factor of each density, its walk included. One that is not told stays as near to 1 as its interval lets it.
  NoiseFactor gyroscope, accelerometer;
  /// Common factor of both densities, if they share one; likewise.
  NoiseFactor common;
  /// The probability that two factors explain the meetings so much better than one, if they are one.
  double common_p = 1;
  /// True if the recording tells the two apart: both are told.
  bool separable = false;
  /// The densities with the factors: each its own where they are separable or not one (common_p below 0.05), else the
  /// common one; as they were given unless ok.
  ImuNoise<double> noise;
  std::size_t windows = 0, meetings = 0;  ///< used
  double chi2 = 0;                        ///< meetings, with the densities as they were given
  double calibrated_chi2 = 0;             ///< meetings, with the densities of `noise`
  std::size_t degrees_of_freedom = 0;     ///< degrees of freedom of both χ²
};

template <class V>
void describe(V& v, const NoiseFactor& x) {
  v("factor", x.factor, "of the densities");
  v("low", x.low, "lower end of its 95 % interval; null: no bound")("high", x.high, "upper end");
}

template <class V>
void describe(V& v, const ImuNoise<double>& x) {
  v("gyroscope", x.gyroscope, "", "rad/s/√Hz")("accelerometer", x.accelerometer, "", "m/s²/√Hz");
  v("gyroscope_walk", x.gyroscope_walk, "", "rad/s²/√Hz")("accelerometer_walk", x.accelerometer_walk, "", "m/s³/√Hz");
}

template <class V>
void describe(V& v, const NoiseCalibration& x) {
  v("status", name(x.status))("windows", x.windows, "that were refined");
  v("meetings", x.meetings, "of windows, whose states must agree")("chi2", x.chi2, "with the given densities");
  v("calibrated_chi2", x.calibrated_chi2, "with the calibrated ones");
  v("degrees_of_freedom", x.degrees_of_freedom, "of both")("common", x.common, "one factor for both sensors");
  v("common_p", x.common_p, "probability that two factors explain so much more than one, if they are one");
  v("separable", x.separable, "the windows tell the sensors apart");
  v("gyroscope", x.gyroscope)("accelerometer", x.accelerometer)("noise", x.noise, "the densities that were used");
}

/// Calibrates the densities of a recording's inertial sensor by its windows. Options as for initialiseRecording();
/// `progress(done, all)` counts windows, and then passes over all of them.
LIESTAT_FUSION_API NoiseCalibration
calibrateNoise(const VisualInertialRecording& recording, const VisualInertialOptions& options,
               const std::function<void(std::size_t done, std::size_t all)>& progress = {});

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/init/detail/calibrate_noise.hpp>
#endif
