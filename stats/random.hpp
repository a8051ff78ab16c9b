#pragma once

// Random numbers that are a function of a counter (needs Random123, Debian: librandom123-dev).
//
// A Monte-Carlo result must not depend on how the work was shared out: the draws of trial i are a pure function of
// (seed, trial, stream), so they are the same on one thread or on a hundred ranks, and a run may be stopped and
// resumed.
//
// Source: J. Salmon, M. Moraes, R. Dror, D. Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC 2011, section 3.4
// (Philox4x32 with ten rounds).

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Random123/boxmuller.hpp>
#include <Random123/philox.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

namespace liestat {

/// Counter-based generator, Philox4x32-10: key = seed, counter = (block, stream, trial low, trial high).
///
/// Two generators with equal (seed, trial, stream) give equal sequences; any two that differ in one of them give
/// independent ones. `stream` separates the uses within a trial (the scene, the noise, a sampler's own choices), so
/// that drawing more of one leaves the others alone.
///
/// A std::uniform_random_bit_generator of 64-bit words. It repeats after 2^33 words. 64 bytes, cheap to construct: make
/// one for each trial.
class CounterRng {
 public:
  using result_type = std::uint64_t;

  explicit CounterRng(std::uint64_t seed, std::uint64_t trial = 0, std::uint32_t stream = 0)
      : key_{{low(seed), high(seed)}}, counter_{{0, stream, low(trial), high(trial)}} {}

  static constexpr result_type min() { return 0; }
  static constexpr result_type max() { return std::numeric_limits<result_type>::max(); }

  /// The next 64 uniform bits: words (0, 1) of a Philox block, then words (2, 3), the lower word first.
  result_type operator()() {
    if (position_ == 0) {
      block_ = r123::Philox4x32_R<10>()(counter_, key_);
      ++counter_.v[0];
    }
    const result_type bits = block_.v[position_] | (static_cast<result_type>(block_.v[position_ + 1]) << 32);
    position_ = (position_ + 2) % 4;
    return bits;
  }

  /// Uniform on the open interval (0, 1): the 2^52 midpoints of an equal subdivision, so never 0 nor 1 and symmetric
  /// about 1/2. (One more bit would round the largest value to 1.)
  double uniform() { return (static_cast<double>((*this)() >> 12) + 0.5) * 0x1p-52; }

  /// Uniform between two numbers.
  double uniform(double low, double high) { return low + (high - low) * uniform(); }

  /// Standard normal, by Random123's own Box-Muller transform: unlike std::normal_distribution it is the same function
  /// with every standard library. Pairs are made from two words; the second of a pair is kept for the next call.
  double normal() {
    if (has_normal_) {
      has_normal_ = false;
      return normal_;
    }
    const result_type angle = (*this)();
    const result_type radius = (*this)();
    const r123::double2 pair = r123::boxmuller(angle, radius);
    normal_ = pair.y;
    has_normal_ = true;
    return pair.x;
  }

  /// N independent standard normals, drawn in the order of the coefficients.
  template <int N>
  Eigen::Matrix<double, N, 1> normalVector() {
    static_assert(N > 0, "normalVector needs a fixed size");
    Eigen::Matrix<double, N, 1> v;
    for (int i = 0; i < N; ++i) v[i] = normal();
    return v;
  }

  /// A unit vector uniform on the sphere of N - 1 dimensions: N normals, normalised.
  template <int N>
  Eigen::Matrix<double, N, 1> unitVector() {
    for (;;) {
      const Eigen::Matrix<double, N, 1> v = normalVector<N>();
      // Box-Muller's radius is exactly zero once in 2^54 words: the direction is then undefined, draw again.
      if (const double norm = v.norm(); norm > 0) return v / norm;
    }
  }

  /// A rotation uniform under the Haar measure, as a unit quaternion: four normals, normalised (the normal density
  /// depends on the norm alone). Both signs occur.
  Eigen::Quaterniond unitQuaternion() {
    for (;;) {
      const double w = normal(), x = normal(), y = normal(), z = normal();
      const double norm = std::sqrt((w * w + x * x) + (y * y + z * z));
      // Box-Muller's radius is exactly zero once in 2^54 words: the direction is then undefined, draw again.
      if (norm > 0) return Eigen::Quaterniond(w / norm, x / norm, y / norm, z / norm);
    }
  }

 private:
  static constexpr std::uint32_t low(std::uint64_t x) { return static_cast<std::uint32_t>(x); }
  static constexpr std::uint32_t high(std::uint64_t x) { return static_cast<std::uint32_t>(x >> 32); }

  r123::Philox4x32_R<10>::key_type key_;
  r123::Philox4x32_R<10>::ctr_type counter_;
  r123::Philox4x32_R<10>::ctr_type block_{};
  double normal_ = 0;
  std::uint32_t position_ = 0;
  bool has_normal_ = false;
};

}  // namespace liestat
