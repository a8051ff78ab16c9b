// The results of preintegrateWindows() (recording_windows.hpp), for units that only look at them.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/imu/preintegrate.hpp>
#include <stats/shown.hpp>
#include <stats/verdict.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat {

/// The motion over one window, and its error where the truth is known at both ends.
struct RecordingWindow {
  double begin = 0, end = 0;  ///< s
  RecordingResult<double> result;
  ImuBias<double> bias = {};  ///< that was taken off the readings
  /// Times (s) of the reading that is at fault, and of the one before it.
  std::optional<double> fault_time = {}, time_before_fault = {};
  /// preintegrationError() between the true states: position (m), rotation (rad), velocity (m/s).
  std::optional<Eigen::Matrix<double, 9, 1>> error = {};
  std::optional<double> squared_distance = {};  ///< the error's, under the covariance; none without noise
  /// Standard deviations of the noise that the Earth's rotation is worth where it is neglected: its angle, and with a
  /// truth Coriolis' acceleration. Zero without noise.
  double earth_rotation = 0;

  bool ok() const { return result.ok(); }
  /// "ok", "gap", "not covered", …
  const char* status() const;
};

/// Largest standard deviations along the axes of an increment over `duration` s.
struct IncrementSigmas {
  double duration = 0, rotation = 0, velocity = 0, position = 0;  ///< s, rad, m/s, m
};
/// Those of a motion with noise.
IncrementSigmas incrementSigmas(const Preintegration<double>& motion);

/// Test whether errors against a truth are those that the covariances predict: the sum of n windows' squared distances
/// under χ² with 9 n degrees of freedom.
struct IncrementTest {
  std::size_t windows = 0;  ///< that were compared
  double squared_distance = 0;
  double degrees_of_freedom = 0;
  double p = 0;  ///< probability of a larger sum

  double ratio() const { return squared_distance / degrees_of_freedom; }
};

/// The windows of a recording.
struct RecordingWindows {
  std::vector<RecordingWindow> windows;
  bool with_noise = false;  ///< both white densities are known, so there are covariances
  bool with_truth = false;

  /// Windows that have an increment.
  std::size_t okWindows() const;
  /// The test of the errors; none without truth, without noise, or where the truth covers no window.
  std::optional<IncrementTest> test() const;
  /// Verdict on the covariances: no, if the sum of the squared distances of the errors is exceeded with a
  /// probability below `false_alarm`. The law is exact if the noise of the sensor is Gaussian with the given densities,
  /// the biases are the true ones, windows do not overlap, and the truth is exact. The truth's own error is in no
  /// covariance: one that is not small beside the sensor's makes the answer no, and so does a known bias that is off.
  /// Windows that follow each other share the truth at their common end, so that its error counts in both, and with
  /// opposite signs. None without truth or without noise.
  Verdict verdict(double false_alarm = 1e-5) const;
  /// Verdict on the windows together: no, if one has no increment or the covariances are not those of the errors; with
  /// a truth as verdict(), else yes.
  Verdict outcome() const;
  /// Remarks on the increments beyond the faults, in sentences: windows that are bunched, undersampled, rough or
  /// untested, and where the Earth's rotation matters. They leave the verdict as it is.
  std::vector<std::string> notes() const;
  /// Every window has an increment.
  bool complete() const { return okWindows() > 0 && okWindows() == windows.size(); }
  /// There is an increment, and the verdict is not no.
  bool usable() const { return okWindows() > 0 && !verdict().isNo(); }
};

/// Fields of a window: those of an increment only where there is one, of an error only with a truth.
template <class V>
void describe(V& v, const RecordingWindow& w) {
  v("begin", w.begin, "", "s")("status", w.status(), "ok, or the fault of the readings");
  v("duration", w.result.motion.duration(), "", "s")("largest_gap", w.result.max_gap, "between readings", "s");
  if (shown(v, !w.ok() && w.fault_time)) {
    v("fault_time", w.fault_time.value_or(0),
      "of the reading that is at fault, if any; the fields below are then missing", "s");
  }
  if (!shown(v, w.ok())) return;
  const SE23d& x = w.result.motion.increment();
  v("quaternion_xyzw", Eigen::Vector4d(x.so3().params()))("rotation_vector", Eigen::Vector3d(x.so3().log()), "", "rad");
  v("position", Eigen::Vector3d(x.translation()), "", "m")("velocity", Eigen::Vector3d(x.velocity()), "", "m/s");
  const ImuNoise<double>& noise = w.result.motion.options().noise;
  const bool with_noise = noise.gyroscope > 0 && noise.accelerometer > 0;
  v("covariance",
    with_noise ? std::optional(Eigen::Matrix<double, 9, 9>(w.result.motion.gaussian().covariance)) : std::nullopt,
    "9 errors in m, rad, m/s; null without noise");
  v("rate", w.result.rate, "of the readings: the variance of one is the square of the density times this", "Hz");
  v("sampling", nameOf(w.result.sampling), "adequate, untested, rough, undersampled or bunched");
  v("scheme_error", with_noise ? std::optional(w.result.scheme_error) : std::nullopt,
    "squared length of the integration scheme's error, which the covariance has, in standard deviations of the noise");
  v("bias_jacobian", w.result.motion.biasJacobian(), "by the biases of gyroscope and accelerometer");
  using Error = Eigen::Matrix<double, 9, 1>;
  if (shown(v, w.error.has_value())) {
    v("error", w.error.value_or(Error::Zero()), "with a truth: position, rotation, velocity", "m, rad, m/s");
  }
  if (shown(v, w.squared_distance.has_value())) {
    v("squared_distance", w.squared_distance.value_or(0), "of the error, 9 expected; with a truth and noise");
  }
}

template <class V>
void describe(V& v, const RecordingWindows& r) {
  v("covariance_order", "position rotation velocity", "of the windows' covariances");
  v("covariance_side", "right", "on which errors are applied");
  v("covariance_frame", "axes of the body at the end of the window, m rad m/s", "in words")("windows", r.windows);
  v("notes", r.notes(), "what the readings say about the increments, besides their faults");
  const std::optional<IncrementTest> test = r.test();
  if (shown(v, test.has_value())) {
    const IncrementTest sum = test.value_or(IncrementTest{});
    v("squared_distance", sum.squared_distance, "with a truth and noise: sum over the windows");
    v("degrees_of_freedom", sum.degrees_of_freedom, "of the sum")("p", sum.p, "probability of a larger sum");
  }
  describe(v, r.verdict());
}

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/imu/detail/recording_windows_verdict.hpp>
#endif
