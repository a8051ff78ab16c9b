// The definitions of fusion/init/window_fusion.hpp.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/init/window_fusion.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <stats/gaussian.hpp>
#include <stats/maha.hpp>

#include <Eigen/Core>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

namespace liestat {

LIESTAT_FUSION_INLINE Gaussian<InertialState> carried(const Gaussian<InertialState>& state,
                                                      const Preintegration<double>& motion, double gravity) {
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

LIESTAT_FUSION_INLINE WindowStates windowStates(const RefinementResult& refined) {
  WindowStates states;
  const auto none = [&states] {
    states.first.covariance.setConstant(std::numeric_limits<double>::quiet_NaN());
    states.last.covariance = states.first.covariance;
    return states;
  };
  if (!refined.converged()) return none();
  // The refinement's unknowns: V (3), the last state (9: position, rotation, velocity), G, both biases at either end.
  const Eigen::Matrix<double, 27, 27>& covariance = refined.covariance.joint;
  const SE23d& last = refined.states.back();
  const Eigen::Matrix3d back = last.so3().inverse().matrix();
  const double length = refined.gravity.norm();
  const Eigen::Vector3d G = back * refined.gravity, V = back * Eigen::Vector3d(last.velocity());

  // Changes of (G in the body, velocity, biases); G and not its direction, whose length may be an unknown too.
  Eigen::Matrix<double, 12, 27> at_first = Eigen::Matrix<double, 12, 27>::Zero(), at_last = at_first;
  at_first.block<3, 3>(0, 12).setIdentity();
  at_first.block<3, 3>(3, 0).setIdentity();
  at_first.block<6, 6>(6, 15).setIdentity();
  // The last state turns by φ and gains R ν: what is seen from the body turns the other way.
  at_last.block<3, 3>(0, 6) = detail::skew(G);
  at_last.block<3, 3>(0, 12) = back;
  at_last.block<3, 3>(3, 6) = detail::skew(V);
  at_last.block<3, 3>(3, 9).setIdentity();
  at_last.block<6, 6>(6, 21).setIdentity();
  const auto state = [](const Eigen::Vector3d& gravity, const Eigen::Vector3d& velocity, const ImuBias<double>& bias) {
    return InertialState(S2d(gravity), velocity, bias.gyroscope, Eigen::Vector3d(bias.accelerometer - gravity));
  };
  const auto tangent = [&](const InertialState& x, const Eigen::Matrix<double, 12, 27>& by_unknowns) {
    Eigen::Matrix<double, 11, 12> J = detail::toInertialTangent(x.get<0>(), 1);
    J.topLeftCorner<2, 3>() /= length;
    return detail::product(J, by_unknowns);
  };
  states.first.mean = state(refined.gravity, refined.velocity(), refined.bias);
  states.last.mean = state(G, V, refined.last_bias);
  const Eigen::Matrix<double, 11, 27> A = tangent(states.first.mean, at_first), B = tangent(states.last.mean, at_last);
  states.first.covariance = detail::congruence(A, covariance);
  states.last.covariance = detail::congruence(B, covariance);
  // In sigmas, because those differ by factors of thousands.
  const Eigen::Matrix<double, 11, 1> unit = states.first.covariance.diagonal().cwiseSqrt();
  const detail::Matrix11 both = detail::productTransposed(detail::product(A, covariance), B);
  const detail::Matrix11 cross = unit.cwiseInverse().asDiagonal() * both;
  const detail::Cholesky<double, 11> factor(
      detail::Matrix11(unit.cwiseInverse().asDiagonal() * states.first.covariance * unit.cwiseInverse().asDiagonal()));
  if (!factor.ok()) return none();
  states.by_first = factor.solve<11>(cross).transpose() * unit.cwiseInverse().asDiagonal();
  const detail::Matrix11 half = factor.halfSolve<11>(cross);
  states.independent = states.last.covariance - detail::product(half.transpose(), half);
  return states;
}

LIESTAT_FUSION_INLINE WindowFusion::Meeting WindowFusion::begin(const WindowStates& window) {
  Meeting meeting;
  meeting.status = Status::ill_defined;
  if (!window.ok()) return meeting;
  meeting.status = Status::ok;
  state_ = window.last;
  ++windows_;
  return meeting;
}

LIESTAT_FUSION_INLINE WindowFusion::Meeting WindowFusion::meet(const WindowStates& window,
                                                               const Preintegration<double>& since) {
  Meeting meeting;
  const std::array<Gaussian<InertialState>, 2> both{carried(state_, since, gravity_), window.first};
  const MahaResult<InertialState> mean =
      maha(both, CovarianceAt::measured, {.tolerance = 1e-7, .start = window.first.mean, .refutation_level = 0});
  meeting.status = mean.status;
  if (mean.status != Status::ok) return meeting;
  meeting.chi2 = 2 * mean.cost;
  meeting.degrees_of_freedom = 11;
  meeting.difference = log(window.first.mean, both[0].mean);
  meeting.difference_covariance = transport(both[0], window.first.mean).covariance + window.first.covariance;
  state_ = through(window, mean.estimate());
  ++windows_;
  chi2_ += meeting.chi2;
  degrees_of_freedom_ += static_cast<std::size_t>(meeting.degrees_of_freedom);
  return meeting;
}

LIESTAT_FUSION_INLINE Gaussian<InertialState> WindowFusion::through(const WindowStates& window,
                                                                    const Gaussian<InertialState>& at_first) {
  using Vector11 = Eigen::Matrix<double, 11, 1>;
  const detail::Matrix11 before = transport(at_first, window.first.mean).covariance;
  const Vector11 moved = window.by_first * Vector11(log(window.first.mean, at_first.mean));
  const Gaussian<InertialState> at_last{window.last.mean,
                                        detail::congruence(window.by_first, before) + window.independent};
  return transport(at_last, exp(window.last.mean, moved));
}

}  // namespace liestat
