// The rotation that a gyroscope measured between two frames, in the sign and the axes of fusion/motion/: that of the
// points as the camera sees them, camera2_R_camera1 = Exp(Ω_g); and a gyroscope beside a sequence of frames, from
// rotations or rates per frame or from the readings of an inertial sensor.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/imu/preintegrate.hpp>
#include <fusion/imu/preintegration.hpp>
#include <fusion/motion/plan.hpp>
#include <fusion/motion/types.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace liestat {

/// The rotation of preintegrated readings from the time of the first frame to that of the second.
/// `camera_R_imu` takes the sensor's axes to the camera's. The covariance is that of an error on the left, Exp(n) Exp(Ω_g),
/// along the second frame's axes; it is only positive definite if the noise of the readings was given.
inline GyroscopeRotation gyroscopeRotation(const Preintegration<double>& motion, const SO3d& camera_R_imu) {
  const Eigen::Matrix3d R = camera_R_imu.matrix();
  // ΔR takes the sensor's axes at the end to those at the start; ΔR Exp(e) makes R (ΔR Exp(e))⁻¹ Rᵀ = Exp(-R e) Exp(Ω_g).
  return {-(R * motion.increment().so3().log()),
          R * Eigen::Matrix3d(motion.gaussian().covariance.block<3, 3>(3, 3)) * R.transpose()};
}

/// Rotation at a constant rate (rad/s, in the sensor's axes) over so many seconds, with a standard deviation of each
/// component of the rate (rad/s).
inline GyroscopeRotation gyroscopeRotation(const Eigen::Vector3d& rate, double seconds, double sigma,
                                           const SO3d& camera_R_imu) {
  const double s = sigma * seconds;
  return {-seconds * (camera_R_imu.matrix() * rate), s * s * Eigen::Matrix3d::Identity()};
}

/// The bias of the readings (rad/s, in the sensor's axes) from MotionEstimate::gyroscope_bias: measured minus true.
inline Eigen::Vector3d gyroscopeBiasRate(const Eigen::Vector3d& bias, double seconds, const SO3d& camera_R_imu) {
  return camera_R_imu.matrix().transpose() * bias / -seconds;
}

/// Two rotations one after the other, with independent errors on the left.
inline GyroscopeRotation composed(const GyroscopeRotation& first, const GyroscopeRotation& second) {
  const SO3d turn = SO3d::exp(second.rotation);
  const Eigen::Matrix3d R = turn.matrix();
  return {(turn * SO3d::exp(first.rotation)).log(), second.covariance + R * first.covariance * R.transpose()};
}

/// The rotation over an interval of so many frames as a prior of a filter of which each step takes an interval that
/// ends one frame after the one before. The intervals overlap, and each reading counts in as many of them as they have
/// frames: the covariance is that many times as large, so that all of them together claim no more. `whole_interval`:
/// the filter's unit of time is the interval; otherwise it is one frame.
inline GyroscopeRotation priorOfInterval(GyroscopeRotation over, std::size_t frames, bool whole_interval) {
  const auto n = static_cast<double>(frames);
  over.covariance *= n;
  if (whole_interval) return over;
  over.rotation /= n, over.covariance /= n * n;
  return over;
}

/// A gyroscope beside the frames of a sequence. Its times are those of the frames.
struct MotionGyroscope {
  struct Between {
    std::optional<GyroscopeRotation> rotation;  ///< rad over the interval
    std::string why;                            ///< there is none
  };
  /// The rotation from one frame to a later one, by their numbers; empty: there is no gyroscope.
  std::function<Between(std::size_t first, std::size_t second)> between;
  SO3d camera_R_sensor;
  double seconds = 0;                              ///< median time between two frames
  double bias_walk = 0;                            ///< rad/s/√s
  Eigen::Vector3d bias = Eigen::Vector3d::Zero();  ///< rad/s, sensor's axes: already taken off the readings

  bool given() const { return static_cast<bool>(between); }
  GyroscopeClock clock() const { return {given(), seconds, bias_walk}; }
  /// The bias of the readings (rad/s, in the sensor's axes) from that of an estimate per frame, with what was taken off
  /// before.
  Gaussian<Eigen::Vector3d> biasRate(const Gaussian<Eigen::Vector3d>& bias_per_frame) const;
};

/// From the rotation of each frame since the one before, in the sign and the axes of the filters: element k is that of
/// frame k, the first one is not read. `seconds` between frames are the unit of a bias. Rotations with numbers that are
/// not finite count as missing.
LIESTAT_FUSION_API MotionGyroscope gyroscopeOfRotations(std::vector<GyroscopeRotation> rotations, double seconds = 1);

/// A rate in the sensor's axes at the time of a frame.
struct FrameRate {
  double time = 0;                                 ///< s
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();  ///< rad/s
};
/// From rates at the frames, by their numbers: between two of them holds the mean of both. `sigma`: rad per frame, of
/// each component.
LIESTAT_FUSION_API MotionGyroscope gyroscopeOfRates(std::map<std::size_t, FrameRate> rates, double sigma,
                                                    const SO3d& camera_R_sensor,
                                                    const Eigen::Vector3d& bias = Eigen::Vector3d::Zero());

/// The readings of an inertial sensor beside a sequence of frames.
struct GyroscopeReadings {
  std::vector<ImuSample<double>> samples;  ///< in the order of time
  std::map<std::size_t, double> times;     ///< times of the frames, by their numbers, on the readings' clock
  RecordingOptions<double> how;            ///< with the noise, and the bias that is taken off
  /// Where a reading comes from, for the reasons in words; none: "reading 12".
  std::function<std::string(std::size_t index)> place = {};
};
/// From readings, preintegrated over each interval. The noise of the gyroscope must be positive.
LIESTAT_FUSION_API MotionGyroscope gyroscopeOfReadings(GyroscopeReadings readings, const SO3d& camera_R_sensor);

/// Why a gyroscope has no rotation for any interval of two successive ones of these frames (another clock, or another
/// recording); empty if it has one, or if there are not two frames.
LIESTAT_FUSION_API std::string reasonWithoutCover(const MotionGyroscope& gyroscope,
                                                  const std::map<std::size_t, double>& times);

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/motion/detail/motion_gyroscope.hpp>
#endif
