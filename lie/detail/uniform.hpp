// Uniform numbers from any generator of random bits, without <random>, whose distributions differ between libraries.
#pragma once

#include <Eigen/Core>

#include <cmath>
#include <cstdint>
#include <limits>

namespace liestat::detail {

/// A number in [0, 1] with 53 random bits, from a generator with min(), max() and operator() of an unsigned type.
template <class Generator>
double uniform01(Generator& generator) {
  using Bits = typename Generator::result_type;
  constexpr Bits range = Generator::max() - Generator::min();
  const auto draw = [&] { return static_cast<Bits>(generator() - Generator::min()); };
  if constexpr (std::numeric_limits<Bits>::digits >= 64 && range == std::numeric_limits<Bits>::max()) {
    return static_cast<double>(static_cast<std::uint64_t>(draw()) >> 11) * 0x1p-53;
  } else {
    // Two draws: most generators without 64 bits have about 32.
    const double base = static_cast<double>(range) + 1;
    const auto high = static_cast<double>(draw());
    return (high + static_cast<double>(draw()) / base) / base;
  }
}

/// A number in [low, high].
template <class S, class Generator>
S uniform(Generator& generator, double low, double high) {
  return S(low + (high - low) * uniform01(generator));
}

/// A vector whose coordinates are in [-1, 1].
template <class S, int N, class Generator>
Eigen::Matrix<S, N, 1> uniformInCube(Generator& generator) {
  Eigen::Matrix<S, N, 1> v;
  for (int i = 0; i < N; ++i) v[i] = uniform<S>(generator, -1, 1);
  return v;
}

/// A point of the unit circle, uniform.
template <class S, class Generator>
Eigen::Matrix<S, 2, 1> uniformOnCircle(Generator& generator) {
  const double angle = static_cast<double>(EIGEN_PI * (2 * uniform01(generator) - 1));
  return Eigen::Matrix<S, 2, 1>(S(std::cos(angle)), S(std::sin(angle)));
}

/// A unit quaternion (x, y, z, w), uniform on the sphere (K. Shoemake, "Uniform random rotations", Graphics Gems III,
/// 1992).
template <class S, class Generator>
Eigen::Matrix<S, 4, 1> uniformQuaternion(Generator& generator) {
  const double u = uniform01(generator);
  const Eigen::Matrix<double, 2, 1> a = std::sqrt(1 - u) * uniformOnCircle<double>(generator);
  const Eigen::Matrix<double, 2, 1> b = std::sqrt(u) * uniformOnCircle<double>(generator);
  return Eigen::Matrix<S, 4, 1>(S(a[0]), S(a[1]), S(b[0]), S(b[1]));
}

}  // namespace liestat::detail
