// What the windows of a recording say together: the direction of gravity, the velocity and the biases. Each window's
// estimate meets what the windows before it have said, carried to its first image by the inertial sensor, in a
// Mahalanobis mean of stats/; χ² says whether the two agree.
//
//   liestat::WindowFusion fusion(9.81);  // |G|
//   for (…) {  // disjoint windows, in the order of time, refined withSharedPrior(options, n)
//     const auto meeting = fusion.add(liestat::windowStates(refined, window), integrate_gap);  // meeting.chi2 ~ χ²(11)
//   }
//   if (fusion.ok()) … fusion.state(): at the last image of the last window, with its covariance
//
// Nothing counts twice. A reading serves one window or one gap between two: from the first image of a window to its
// last, what came from before is carried by the window's own estimate (its joint covariance of both ends), not by the
// readings that this was made of. And the prior of the biases, which is the same for all windows, is divided among
// them. Source: the design note on visual-inertial initialisation; X. Pennec, "Computing the mean of geometric
// features", 1998, section 4.2 (the mean) and 5.2 (the test).
#pragma once

#include <fusion/imu/preintegration.hpp>
#include <fusion/imu/window.hpp>
#include <fusion/init/inertial_state.hpp>
#include <fusion/init/results.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <stats/gaussian.hpp>
#include <stats/maha.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

namespace liestat {

namespace detail {

using Matrix11 = Eigen::Matrix<double, 11, 11>;

}  // namespace detail

/// The state at the end of a motion that begins where the state is: gravity and velocity by the inertial sensor, with
/// its noise, the biases with their random walk. Gravity's length in m/s². The motion is updated to the state's biases
/// to first order: over seconds it should have been integrated with them.
inline Gaussian<InertialState> carried(const Gaussian<InertialState>& state, const Preintegration<double>& motion,
                                       double gravity) {
  const auto& [direction, velocity, gyroscope, resting_force] = state.mean.parts();
  const ImuBias<double> bias{gyroscope, accelerometerBias(state.mean, gravity)};
  const SE23d step = motion.increment(bias);
  const Eigen::Matrix3d back = step.so3().inverse().matrix();
  const double t = motion.duration();
  const Eigen::Vector3d down = direction.unit_vector();
  const Eigen::Vector3d down_after = back * down;
  const Eigen::Vector3d velocity_after = back * (velocity + (gravity * t) * down + step.velocity());
  const S2d direction_after(down_after);

  // The motion's error ξ = (p, φ, v) on its right turns what is seen from its end by -φ.
  Eigen::Matrix<double, 12, 15> by_noise = Eigen::Matrix<double, 12, 15>::Zero();
  by_noise.block<3, 3>(0, 3) = detail::skew(down_after);
  by_noise.block<3, 3>(3, 3) = detail::skew(velocity_after);
  by_noise.block<3, 3>(3, 6).setIdentity();
  by_noise.block<6, 6>(6, 9).setIdentity();
  Eigen::Matrix<double, 12, 12> F = Eigen::Matrix<double, 12, 12>::Identity();
  F.block<3, 3>(0, 0) = F.block<3, 3>(3, 3) = back;
  F.block<3, 3>(3, 0) = (gravity * t) * back;
  F.block<6, 6>(0, 6) = detail::product(by_noise.topLeftCorner<6, 9>(), motion.biasJacobian(bias));

  Gaussian<InertialState> after;
  after.mean = InertialState(direction_after, velocity_after, gyroscope,
                             Eigen::Vector3d(bias.accelerometer - gravity * down_after));
  const Eigen::Matrix<double, 11, 12> to_tangent = detail::toInertialTangent(direction_after, gravity);
  const detail::Matrix11 by_state =
      detail::product(to_tangent, detail::product(F, detail::fromInertialTangent(direction, gravity)));
  const Eigen::Matrix<double, 11, 15> noise = detail::product(to_tangent, by_noise);
  after.covariance =
      detail::congruence(by_state, state.covariance) + detail::congruence(noise, motion.covarianceWithBias());
  return after;
}

/// A window's estimate of the states at its first and its last image, with the covariance of both.
struct WindowStates {
  Gaussian<InertialState> first, last;
  /// The last state's error is by_first times the first one's, and what is independent of it.
  detail::Matrix11 by_first = detail::Matrix11::Zero(), independent = detail::Matrix11::Zero();

  /// False where the refinement gave no covariance.
  bool ok() const { return first.covariance.allFinite() && independent.allFinite(); }
};

/// The states at the ends of a refined window. A refinement has one bias for the whole window, the mean of one that
/// walks as the noise of the window's motions says: what it is at either end departs from that by a variance of a third
/// of what it walks. Not ok() where the refinement did not succeed.
inline WindowStates windowStates(const RefinementResult& refined, const InertialWindow& window) {
  WindowStates states;
  const auto none = [&states] {
    states.first.covariance.setConstant(std::numeric_limits<double>::quiet_NaN());
    states.last.covariance = states.first.covariance;
    return states;
  };
  if (refined.status != FusionStatus::ok) return none();
  // The refinement's unknowns: V (3), the last state (9: position, rotation, velocity), G, both biases.
  const Eigen::Matrix<double, 21, 21>& covariance = refined.covariance.joint;
  const SE23d& last = refined.states.back();
  const Eigen::Matrix3d back = last.so3().inverse().matrix();
  const double length = refined.gravity.norm();
  const Eigen::Vector3d G = back * refined.gravity, V = back * Eigen::Vector3d(last.velocity());

  // Changes of (G in the body, velocity, biases); G and not its direction, whose length may be an unknown too.
  Eigen::Matrix<double, 12, 21> at_first = Eigen::Matrix<double, 12, 21>::Zero(), at_last = at_first;
  at_first.block<3, 3>(0, 12).setIdentity();
  at_first.block<3, 3>(3, 0).setIdentity();
  at_first.block<6, 6>(6, 15).setIdentity();
  // The last state turns by φ and gains R ν: what is seen from the body turns the other way.
  at_last.block<3, 3>(0, 6) = detail::skew(G);
  at_last.block<3, 3>(0, 12) = back;
  at_last.block<3, 3>(3, 6) = detail::skew(V);
  at_last.block<3, 3>(3, 9).setIdentity();
  at_last.block<6, 6>(6, 15).setIdentity();
  const auto state = [&](const Eigen::Vector3d& gravity, const Eigen::Vector3d& velocity) {
    return InertialState(S2d(gravity), velocity, refined.bias.gyroscope,
                         Eigen::Vector3d(refined.bias.accelerometer - gravity));
  };
  const auto tangent = [&](const InertialState& x, const Eigen::Matrix<double, 12, 21>& by_unknowns) {
    Eigen::Matrix<double, 11, 12> J = detail::toInertialTangent(x.get<0>(), 1);
    J.topLeftCorner<2, 3>() /= length;
    return detail::product(J, by_unknowns);
  };
  states.first.mean = state(refined.gravity, refined.velocity());
  states.last.mean = state(G, V);
  const Eigen::Matrix<double, 11, 21> A = tangent(states.first.mean, at_first), B = tangent(states.last.mean, at_last);
  Eigen::Matrix<double, 11, 1> walked = Eigen::Matrix<double, 11, 1>::Zero();
  for (const Preintegration<double>& motion : window.motions()) {
    const ImuNoise<double>& noise = motion.options().noise;
    walked.segment<3>(5).array() += noise.gyroscope_walk * noise.gyroscope_walk * motion.duration();
    walked.tail<3>().array() += noise.accelerometer_walk * noise.accelerometer_walk * motion.duration();
  }
  states.first.covariance = detail::congruence(A, covariance);
  states.last.covariance = detail::congruence(B, covariance);
  states.first.covariance.diagonal() += walked / 3;
  states.last.covariance.diagonal() += walked / 3;
  // In sigmas, because those differ by factors of thousands.
  const Eigen::Matrix<double, 11, 1> unit = states.first.covariance.diagonal().cwiseSqrt();
  detail::Matrix11 both = detail::productTransposed(detail::product(A, covariance), B);
  both.diagonal() -= walked / 6;
  const detail::Matrix11 cross = unit.cwiseInverse().asDiagonal() * both;
  const detail::Cholesky<double, 11> factor(
      detail::Matrix11(unit.cwiseInverse().asDiagonal() * states.first.covariance * unit.cwiseInverse().asDiagonal()));
  if (!factor.ok()) return none();
  states.by_first = factor.solve<11>(cross).transpose() * unit.cwiseInverse().asDiagonal();
  const detail::Matrix11 half = factor.halfSolve<11>(cross);
  states.independent = states.last.covariance - detail::product(half.transpose(), half);
  return states;
}

/// Collects windows in the order of time; see the header comment.
class WindowFusion {
 public:
  /// The outcome for a window that was added.
  struct Meeting {
    Status status = Status::too_few;
    /// Squared distance of the window from all before it, under both covariances: χ² of 11 degrees of freedom where
    /// both are true (somewhat less where the prior says more than the windows, because it is common to both). 0 for
    /// the first window.
    double chi2 = 0;
    int degrees_of_freedom = 0;
  };

  /// Gravity's length in m/s².
  explicit WindowFusion(double gravity) : gravity_(gravity) {}

  /// Adds a window that begins at or after the end of the one before. integrate(bias) returns the motion from the last
  /// image of the one before to the first of this, integrated with that bias; of no duration where they are the same;
  /// it is not called for the first window. Status as of maha(): ill_defined where a window has no covariance, and then
  /// it is left out.
  template <class Integrate>
  Meeting add(const WindowStates& window, const Integrate& integrate) {
    Meeting meeting;
    meeting.status = Status::ill_defined;
    if (!window.ok()) return meeting;
    if (windows_ == 0) {
      meeting.status = Status::ok;
      state_ = window.last;
    } else {
      const ImuBias<double> bias{state_.mean.get<2>(), accelerometerBias(state_.mean, gravity_)};
      const std::array<Gaussian<InertialState>, 2> both{carried(state_, integrate(bias), gravity_), window.first};
      const MahaResult<InertialState> mean =
          maha(both, CovarianceAt::measured, {.tolerance = 1e-7, .start = window.first.mean});
      meeting.status = mean.status;
      if (mean.status != Status::ok) return meeting;
      meeting.chi2 = 2 * mean.cost;
      meeting.degrees_of_freedom = 11;
      state_ = through(window, mean.estimate());
    }
    ++windows_;
    chi2_ += meeting.chi2;
    degrees_of_freedom_ += static_cast<std::size_t>(meeting.degrees_of_freedom);
    return meeting;
  }

  /// Whether there is a state.
  bool hasState() const { return windows_ > 0; }
  /// Whether there is one and the windows do not contradict each other: five sigmas of χ².
  bool ok() const {
    const double dof = static_cast<double>(degrees_of_freedom_);
    return hasState() && chi2_ <= dof + 5 * std::sqrt(2 * dof) + 12;
  }
  /// At the last image of the last window.
  const Gaussian<InertialState>& state() const { return state_; }
  std::size_t windows() const { return windows_; }
  /// The sum over all meetings: larger than χ² of so many degrees of freedom says that windows contradict each other,
  /// or are noisier than their covariances say (chiSquaredSurvival of stats/inference.hpp is the probability).
  double chi2() const { return chi2_; }
  std::size_t degrees_of_freedom() const { return degrees_of_freedom_; }
  /// The factor of the covariances at which windows would be as far apart as these are; at least 1.
  double inflation() const {
    return degrees_of_freedom_ == 0 ? 1 : std::max(1., chi2_ / static_cast<double>(degrees_of_freedom_));
  }

 private:
  /// From the first image to the last by the window's own estimate.
  static Gaussian<InertialState> through(const WindowStates& window, const Gaussian<InertialState>& at_first) {
    using Vector11 = Eigen::Matrix<double, 11, 1>;
    const detail::Matrix11 before = transport(at_first, window.first.mean).covariance;
    const Vector11 moved = window.by_first * Vector11(log(window.first.mean, at_first.mean));
    const Gaussian<InertialState> at_last{window.last.mean,
                                          detail::congruence(window.by_first, before) + window.independent};
    return transport(at_last, exp(window.last.mean, moved));
  }

  double gravity_;
  Gaussian<InertialState> state_;
  std::size_t windows_ = 0, degrees_of_freedom_ = 0;
  double chi2_ = 0;
};

}  // namespace liestat
