#pragma once

#include <lie/so3.hpp>

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <string_view>

namespace liestat::detail {

/// Files of calibrations and cameras print four digits at least; what is farther from a rotation than that is none.
inline constexpr double rotation_tolerance = 1e-3;

/// The rotation nearest to a matrix, and how far the matrix is from it.
struct NearestRotation {
  SO3d rotation;
  double error;  ///< half the Frobenius norm of RᵀR − I of the matrix that was given
};

/// The rotation matrix that a file means: the nearest one. Throws InputError where the matrix is a reflection or off by
/// more than the tolerance; `remedy` ends its message.
NearestRotation nearestRotation(const Eigen::Matrix3d& matrix, double tolerance, const std::string& file,
                                std::size_t line, std::string_view remedy = {});

/// The way out where a norm is off by more than the tolerance, for messages.
inline constexpr std::string_view norm_remedy = ", or a larger --norm-tolerance";

}  // namespace liestat::detail
