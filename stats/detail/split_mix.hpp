// A generator of random numbers in a few lines, for headers that need Eigen alone; stats/random.hpp has the one for
// simulations.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

namespace liestat::detail {

/// SplitMix64 (G. Steele, D. Lea, C. Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014).
struct SplitMix {
  std::uint64_t state = 1;

  std::uint64_t bits() {
    std::uint64_t z = state += 0x9e3779b97f4a7c15;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
  }
  /// Uniform between 0 and 1.
  double uniform() { return (static_cast<double>(bits() >> 11) + 0.5) * 0x1p-53; }
  /// A whole number below n < 2³².
  std::size_t below(std::size_t n) { return static_cast<std::size_t>(((bits() >> 32) * n) >> 32); }
  /// Standard normal, by Box and Muller's formula.
  double normal() {
    const double radius = std::sqrt(-2 * std::log(uniform()));
    return radius * std::cos(6.283185307179586 * uniform());
  }
};

}  // namespace liestat::detail
