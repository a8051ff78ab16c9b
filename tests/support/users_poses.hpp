// Poses of users, made manifolds by SimpleManifold: without params(), templates of their scalar.
#pragma once

#include <lie/frame3.hpp>
#include <lie/se3.hpp>
#include <lie/simple_manifold.hpp>

namespace liestat_test {

/// A pose as a driver has it: a rotation matrix and a position, no member in common with the library's types.
template <class S>
struct DriverPose {
  Eigen::Matrix<S, 3, 3> axes = Eigen::Matrix<S, 3, 3>::Identity();
  Eigen::Matrix<S, 3, 1> position = Eigen::Matrix<S, 3, 1>::Zero();
};
template <class S>
liestat::Frame3<S> toFrame(const DriverPose<S>& x) {
  return liestat::Frame3<S>(liestat::SO3<S>(x.axes), x.position);
}
template <class S>
DriverPose<S> fromFrame(const liestat::Frame3<S>& f) {
  return {f.so3().matrix(), f.translation()};
}

/// The camera's pose in a filter: camera_T_world, perturbed from the left, Exp(d)·camera_T_world. The library moves
/// world_T_camera from the right.
template <class S>
struct LeftPose {
  liestat::SE3<S> camera_T_world;
};
template <class S>
liestat::SE3<S> toGroup(const LeftPose<S>& x) {
  return x.camera_T_world.inverse();
}
template <class S>
LeftPose<S> fromGroup(const liestat::SE3<S>& f) {
  return {f.inverse()};
}

}  // namespace liestat_test

template <class S>
struct liestat::ManifoldTraits<liestat_test::DriverPose<S>>
    : liestat::SimpleManifold<liestat_test::DriverPose<S>, liestat::Frame3<S>, &liestat_test::toFrame<S>,
                              &liestat_test::fromFrame<S>> {};
template <class S>
struct liestat::ManifoldTraits<liestat_test::LeftPose<S>>
    : liestat::SimpleManifold<liestat_test::LeftPose<S>, liestat::SE3<S>, &liestat_test::toGroup<S>,
                              &liestat_test::fromGroup<S>> {};
