// The unit in which people read angles. Those of the parts of a tangent vector: unitOf() of stats/feature_value.hpp.
#pragma once

#include <lie/units.hpp>

namespace liestat::cli {

/// Degrees of a radian.
inline constexpr double degrees = 1 / units::degree;

}  // namespace liestat::cli
