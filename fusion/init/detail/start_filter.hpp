// The definitions of fusion/init/filter_start.hpp.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/init/filter_start.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/s2.hpp>
#include <lie/so3.hpp>

#include <Eigen/Core>

namespace liestat {

LIESTAT_FUSION_INLINE FilterStart filterStart(const Gaussian<InertialState>& state, double gravity, double time,
                                              const FilterStartOptions& options) {
  FilterStart start{.status = FilterStart::Status::ok, .time = time, .convention = options.convention};
  const Eigen::Vector3d down = state.mean.get<0>().unit_vector(), velocity = state.mean.get<1>();
  const SO3d level = ManifoldTraits<S2d>::placement(S2d(Eigen::Vector3d(-down))).inverse();
  const SO3d world_R_body = SO3d::exp(Eigen::Vector3d(0, 0, options.heading)) * level;
  start.state = SE23d(world_R_body, options.position, world_R_body * velocity);
  start.bias = {state.mean.get<2>(), accelerometerBias(state.mean, gravity)};

  // From changes of (down, velocity, biases) in the body. It turns by φ = δdown × down where down changes, and by any
  // turn about down, which is the heading's error; and R Exp(φ) (V + δV) = R (V + δV + φ × V).
  const Eigen::Matrix3d turn = -detail::skew(down);
  Eigen::Matrix<double, 15, 12> by_body = Eigen::Matrix<double, 15, 12>::Zero();
  by_body.block<3, 3>(3, 0) = turn;
  by_body.block<3, 3>(6, 0) = -detail::skew(velocity) * turn;
  by_body.block<3, 3>(6, 3).setIdentity();
  by_body.block<6, 6>(9, 6).setIdentity();
  const Eigen::Matrix<double, 15, 11> by_state =
      detail::product(by_body, detail::fromInertialTangent(state.mean.get<0>(), gravity));
  Eigen::Matrix<double, 15, 1> by_heading = Eigen::Matrix<double, 15, 1>::Zero();
  by_heading.segment<3>(3) = options.heading_sigma * down;
  by_heading.segment<3>(6) = options.heading_sigma * down.cross(velocity);
  start.covariance = detail::congruence(by_state, state.covariance) + by_heading * by_heading.transpose();
  start.covariance = 0.5 * (start.covariance + start.covariance.transpose()).eval();
  start.covariance.topLeftCorner<3, 3>().diagonal().array() += options.position_sigma * options.position_sigma;
  if (!start.covariance.allFinite()) start.status = FilterStart::Status::no_state;
  return start;
}

}  // namespace liestat
