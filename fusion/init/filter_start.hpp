// The start of a visual-inertial filter or smoother: a state whose world has its z axis upwards, and a 15 × 15
// covariance, in the order and with the errors of the library or of another one.
//
//   const FilterStart start = liestat::initialiseRecording(recording, options).filter_start;
//   if (start.ok()) filter.set(start.state, start.bias, start.covarianceAs(liestat::FilterConvention::openvins));
//
// A camera and an inertial sensor tell 11 of the 15: the vertical, the velocity and the biases. Position and heading
// are free, and are therefore what the options say, by default zero: the world's origin is where the body is, and its
// heading the body's. They enter with the standard deviations of the options, independent of all that was estimated.
// The error of the heading is the turn about the vertical; it turns the velocity, so that the covariance of both is not
// zero. The defaults (1 mm, 1 mrad) are small and not zero, because a filter has to factor its covariance; whoever has
// a map or a compass states position, heading and their standard deviations.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/imu/readings.hpp>
#include <fusion/init/inertial_state.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/se23.hpp>
#include <stats/gaussian.hpp>
#include <stats/shown.hpp>
#include <stats/words.hpp>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <limits>

namespace liestat {

/// Whose order of the 15 coordinates, and whose errors. R is the body's orientation in the world, true = estimate with
/// the error applied.
enum class FilterConvention {
  liestat,   ///< position, rotation, velocity on the right of an SE_2(3) (axes of the body), gyroscope, accelerometer
  openvins,  ///< rotation (JPL's, of the world in the body: R Exp(θ)), then position, velocity in the world, gyroscope,
             ///< accelerometer
  gtsam,     ///< Pose3 (rotation, position, both in the body), velocity in the world, ConstantBias (accelerometer,
             ///< gyroscope)
  basalt     ///< position, rotation (Exp(θ) R), velocity in the world, gyroscope, accelerometer
};
constexpr auto words(FilterConvention) { return std::array{"liestat", "openvins", "gtsam", "basalt"}; }
/// The coordinates in their order, in words.
inline const char* orderOf(FilterConvention convention) {
  constexpr const char* orders[] = {
      "position rotation velocity gyroscope_bias accelerometer_bias; of an SE_2(3) on its right, axes of the body",
      "rotation position velocity gyroscope_bias accelerometer_bias; rotation in the body, position and velocity "
      "in the world",
      "rotation position velocity accelerometer_bias gyroscope_bias; rotation and position in the body, velocity "
      "in the world",
      "position rotation velocity gyroscope_bias accelerometer_bias; all in the world"};
  return orders[static_cast<std::size_t>(convention)];
}

struct FilterStartOptions {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< of the body in the world, m
  /// rad: the body is levelled by the shortest rotation, and then turned by so much about the world's z axis.
  double heading = 0;
  double position_sigma = 1e-3;  ///< m, standard deviation of each coordinate
  double heading_sigma = 1e-3;   ///< rad
  /// From rest, where the velocity is zero: how much a body that counts as resting may shake, m/s.
  double rest_speed_sigma = 0.01;
  FilterConvention convention = FilterConvention::liestat;  ///< in which results are shown
};

/// See the header comment.
struct FilterStart {
  using Covariance = Eigen::Matrix<double, 15, 15>;

  /// The state may be used if this is ok. untested: it is that of a single window, which nothing could contradict.
  /// inconsistent: windows contradict each other, there is no covariance. no_state: no window is ok, or at rest.
  enum class Status { ok, untested, inconsistent, no_state };
  Status status = Status::no_state;
  bool from_rest = false;     ///< the body rests
  double time = 0;            ///< s, of the state
  SE23d state = {};           ///< of the body in the world
  ImuBias<double> bias = {};  ///< true = measured - bias
  /// In the library's convention; positive definite where the options' standard deviations are positive; NaN without.
  Covariance covariance = Covariance::Constant(std::numeric_limits<double>::quiet_NaN());
  FilterConvention convention = FilterConvention::liestat;  ///< in which it is shown

  bool ok() const { return status == Status::ok; }
  bool hasState() const { return status == Status::ok || status == Status::untested; }
  const char* word() const {
    constexpr const char* words[] = {"ok", "untested", "inconsistent", "no_state"};
    return words[static_cast<std::size_t>(status)];
  }
  /// The covariance of the errors of another library, to first order.
  Covariance covarianceAs(FilterConvention of) const;
};

inline FilterStart::Covariance FilterStart::covarianceAs(FilterConvention of) const {
  if (of == FilterConvention::liestat) return covariance;
  constexpr int position = 0, rotation = 3, velocity = 6, gyroscope = 9, accelerometer = 12;
  const Eigen::Matrix3d same = Eigen::Matrix3d::Identity(), to_world = state.so3().matrix();
  Covariance by = Covariance::Zero();
  const auto set = [&](int row, int column, const Eigen::Matrix3d& block) { by.block<3, 3>(row, column) = block; };
  if (of == FilterConvention::basalt) {
    set(0, position, to_world), set(3, rotation, to_world);
  } else {
    set(0, rotation, same), set(3, position, of == FilterConvention::gtsam ? same : to_world);
  }
  set(6, velocity, to_world);
  const bool accelerometer_first = of == FilterConvention::gtsam;
  set(9, accelerometer_first ? accelerometer : gyroscope, same);
  set(12, accelerometer_first ? gyroscope : accelerometer, same);
  const Covariance other = detail::congruence(by, covariance);
  return 0.5 * (other + other.transpose());
}

/// The start from what is known without a map (fusion/init/inertial_state.hpp), at `time`; gravity's length in m/s².
/// Its status is ok if the covariance is finite.
LIESTAT_FUSION_API FilterStart filterStart(const Gaussian<InertialState>& state, double gravity, double time,
                                           const FilterStartOptions& options = {});

template <class V>
void describe(V& v, const FilterStart& x) {
  v("status", x.word(), "ok, untested (of a single window), inconsistent or no_state");
  v("convention", name(x.convention), "of the covariance: liestat, openvins, gtsam or basalt");
  if (!shown(v, x.hasState())) return;
  v("t", x.time, "", "s")("from_rest", x.from_rest, "the body rests");
  v("quaternion_xyzw", Eigen::Vector4d(x.state.so3().params()), "body in the world, z upwards");
  v("position", Eigen::Vector3d(x.state.translation()), "in the world", "m");
  v("velocity", Eigen::Vector3d(x.state.velocity()), "in the world", "m/s");
  v("gyroscope_bias", x.bias.gyroscope, "", "rad/s")("accelerometer_bias", x.bias.accelerometer, "", "m/s²");
  v("covariance", x.covarianceAs(x.convention), "position and heading are free: as the options say");
  v("covariance_order", orderOf(x.convention), "in words");
}

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/init/detail/start_filter.hpp>
#endif
