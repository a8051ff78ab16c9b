// The result of the calibration of an inertial sensor's noise (fusion/noise_calibration.hpp), for units that only look
// at it.
#pragma once

#include <fusion/imu/readings.hpp>
#include <fusion/status.hpp>
#include <stats/words.hpp>

#include <array>
#include <cstddef>
#include <limits>

namespace liestat {

/// A factor of a density with its 95 % interval.
struct NoiseFactor {
  double factor = 1, low = 0, high = std::numeric_limits<double>::infinity();

  /// True if the interval is narrower than a factor of six.
  bool isTold() const { return high < 6 * low; }
  /// True if densities three times as large are outside of the interval: no covariance is far too small.
  bool excludesLarger() const { return high < 3; }
  /// True if the densities as they were given are outside of the interval.
  bool refutesOne() const { return low > 1 || high < 1; }
};

/// A recording's evidence on the densities of its inertial sensor's noise.
enum class NoiseEvidence {
  unverified_noise,  ///< too few windows meet to tell the densities, which are hardly more than a claim, or a guess
  confirmed,         ///< the windows agree with those that were given, and would not with three times as large ones
  calibrated         ///< the windows refute those that were given: the densities that the windows tell are used
};
constexpr auto words(NoiseEvidence) { return std::array{"unverified_noise", "confirmed", "calibrated"}; }

/// The result of calibrateNoise().
struct NoiseCalibration {
  /// ok; undetermined: too few windows meet, or any factor explains them; not_converged: the factors do not settle;
  /// bad_input: see fault.
  FusionStatus status = FusionStatus::bad_input;
  Fault fault;
  /// Factor of each density, its walk included. One that is not told stays as near to 1 as its interval lets it; where
  /// none is, and χ² of the meetings refutes the given densities, it is the most likely one.
  NoiseFactor gyroscope, accelerometer;
  /// Common factor of both densities, if they share one; likewise.
  NoiseFactor common;
  /// The probability that two factors explain the meetings so much better than one, if they are one.
  double common_p = 1;
  /// True if the recording tells the two apart: both are told.
  bool separable = false;
  NoiseEvidence evidence = NoiseEvidence::unverified_noise;
  /// The densities to use: as they were given unless the recording refutes them. Then with the factors: each its own
  /// where they are separable or not one (common_p below 0.05), else the common one.
  ImuNoise<double> noise;
  std::size_t windows = 0, meetings = 0;  ///< used
  double chi2 = 0;                        ///< meetings, with the densities as they were given
  double calibrated_chi2 = 0;             ///< meetings, with the densities of `noise`
  std::size_t degrees_of_freedom = 0;     ///< degrees of freedom of both χ²

  /// True if each density has a factor of its own.
  bool hasTwoFactors() const { return separable || common_p < 0.05; }
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
  v("status", name(x.status));
  v("evidence", name(x.evidence),
    "confirmed: the windows agree with the given densities; calibrated: they refute them; unverified_noise: they tell "
    "neither");
  v("windows", x.windows, "that were refined");
  v("meetings", x.meetings, "of windows, whose states must agree")("chi2", x.chi2, "with the given densities");
  v("calibrated_chi2", x.calibrated_chi2, "with those that were used");
  v("degrees_of_freedom", x.degrees_of_freedom, "of both")("common", x.common, "one factor for both sensors");
  v("common_p", x.common_p, "probability that two factors explain so much more than one, if they are one");
  v("separable", x.separable, "the windows tell the sensors apart");
  v("gyroscope", x.gyroscope)("accelerometer", x.accelerometer)("noise", x.noise, "the densities that were used");
}

}  // namespace liestat
