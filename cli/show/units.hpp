// The units in which people read angles and lengths.
#pragma once

#include <lie/concepts.hpp>
#include <lie/units.hpp>

namespace liestat::cli {

/// Degrees of a radian.
inline constexpr double degrees = 1 / units::degree;

/// A unit that is shown, and how many of it make the unit that is computed in (rad, m).
struct Unit {
  const char* name;
  double scale;
};

/// The unit in which a part of a tangent vector is shown: degrees or metres.
constexpr Unit unitOf(const TangentBlock& block) { return isAngular(block.part) ? Unit{"deg", degrees} : Unit{"m", 1}; }

}  // namespace liestat::cli
