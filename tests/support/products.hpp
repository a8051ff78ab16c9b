// Products on which the contract is checked: of each kind of part, and nested.
#pragma once

#include <lie/lie.hpp>

#include <support/turned_s2.hpp>

namespace liestat_test {

template <class S>
using Vector2 = Eigen::Matrix<S, 2, 1>;
template <class S>
using Vector3 = Eigen::Matrix<S, 3, 1>;

/// Frame3 with its coordinates in another order.
template <class S>
using RotationAndVector = liestat::Product<liestat::SO3<S>, Vector3<S>>;
template <class S>
using FrameAndDirection = liestat::Product<liestat::Frame3<S>, liestat::S2<S>>;
/// Two quotients: eight representatives.
template <class S>
using Quotients = liestat::Product<liestat::SemiOrientedFrame3<S>, Vector2<S>, liestat::NonOrientedFrame3<S>>;
/// A user's type with a placement of his own, and a product in a product.
template <class S>
using UsersProduct = liestat::Product<TurnedS2<S>, liestat::Product<liestat::SO2<S>, Vector2<S>>>;
/// Extended pose with the biases of gyroscope and accelerometer: no metric.
template <class S>
using InertialState = liestat::Product<liestat::SE23<S>, Vector3<S>, Vector3<S>>;
template <class S>
using GroupOfThree = liestat::ProductGroup<liestat::SO3<S>, liestat::SE2<S>, liestat::Translation<S, 2>>;

}  // namespace liestat_test
