// The error that an integration scheme makes because rate and force vary within a step, carried along an interval.
#pragma once

#include <fusion/imu/preintegration.hpp>

#include <Eigen/Core>

namespace liestat::detail {

/// Rate and force at a time, or their change.
template <class S>
struct ImuReading {
  Eigen::Matrix<S, 3, 1> rate = Eigen::Matrix<S, 3, 1>::Zero(), force = Eigen::Matrix<S, 3, 1>::Zero();

  ImuReading operator+(const ImuReading& o) const { return {rate + o.rate, force + o.force}; }
  ImuReading operator-(const ImuReading& o) const { return {rate - o.rate, force - o.force}; }
  ImuReading operator*(const S& s) const { return {s * rate, s * force}; }
};

/// The increment by a scheme of the next order minus that of the scheme, to first order: position, rotation and velocity
/// in the axes of the start.
template <class S>
struct SchemeError {
  using Vector3 = Eigen::Matrix<S, 3, 1>;

  Vector3 position = Vector3::Zero(), rotation = Vector3::Zero(), velocity = Vector3::Zero();

  /// Carries it over a step of h seconds from one increment to the next, and adds the step's own error in the axes of
  /// the body at its start.
  void advance(const S& h, const SE23<S>& before, const SE23<S>& after, const SchemeError& own) {
    const SO3<S> R = before.so3();
    const Vector3 gain = after.velocity() - before.velocity();
    position += h * velocity -
                Vector3(after.translation() - before.translation() - h * before.velocity()).cross(rotation) +
                R * own.position;
    velocity += R * own.velocity - gain.cross(rotation);
    rotation += R * own.rotation;
  }

  /// A step's own: what a rate and a force that go straight from `first` to `last` do beyond their means, to the fourth
  /// power of h, with `curved` (times s) the integral of what they do beyond the straight line.
  static SchemeError ofStep(const S& h, const ImuReading<S>& first, const ImuReading<S>& last,
                            const ImuReading<S>& curved) {
    const S c = h * h / S(12);
    SchemeError e;
    // Coning and sculling (docs/theory/visual_inertial.md, section 2.6).
    e.rotation = curved.rate + c * first.rate.cross(last.rate);
    e.velocity = curved.force + c * (first.rate.cross(last.force) + first.force.cross(last.rate));
    e.position = (S(0.5) * h) * curved.force - c * (last.force - first.force) -
                 (S(0.5) * h * c) * (last.rate - first.rate).cross(first.force);
    return e;
  }
};

}  // namespace liestat::detail
