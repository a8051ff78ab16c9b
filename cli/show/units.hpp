// The units in which people read angles and lengths.
#pragma once

#include <lie/concepts.hpp>

#include <numbers>

namespace liestat::cli {

/// Degrees of a radian.
inline constexpr double degrees = 180 / std::numbers::pi;

/// A unit that is shown, and how many of it make the unit that is computed in (rad, m).
struct Unit {
  const char* name;
  double scale;
};

/// The unit in which a part of a tangent vector is shown: degrees or metres.
constexpr Unit unitOf(const TangentBlock& block) { return isAngular(block.part) ? Unit{"deg", degrees} : Unit{"m", 1}; }

}  // namespace liestat::cli
