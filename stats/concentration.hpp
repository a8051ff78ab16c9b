// Test whether rotations, directions and the like have a mean: their scatter against that of uniform ones. Needs Eigen
// alone.
//
// Under the uniform law of a compact homogeneous space every feature has the same expected squared distance V₀ from the
// data, so there is no mean; the one of a sample is an accident, and its covariance means nothing. The test: the mean
// squared distance V of n uniform data about their own Fréchet mean falls below V₀ (1 - q(n)/√n) with probability 0.01.
// It is Rayleigh's test in the geodesic distance, has the same power on the sphere and more among few data, and serves
// quotients too, for which no vector mean exists.
#pragma once

#include <stats/detail/compact_part.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/detail/weights.hpp>
#include <stats/detail/search_space.hpp>
#include <stats/detail/sum_certificates.hpp>
#include <stats/mean.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <ranges>
#include <tuple>
#include <vector>

namespace liestat {

/// How scattered the compact parts of features (rotations, directions, angles) are about a mean.
struct Concentration {
  double mean_square = 0;                                    ///< Σ p_i θ_i²/Σ p_i about the mean, rad²
  double uniform = std::numeric_limits<double>::infinity();  ///< V₀, what it is expected to be of uniform features
  double limit = std::numeric_limits<double>::infinity();    ///< uniform features stay above with probability 0.99
  bool concentrated = true;  ///< the uniform law is rejected; true also where nothing is compact or known to be

  /// Less than a quarter of the scatter of uniform features: few of them are near the cut locus of their mean.
  bool isModest() const { return mean_square <= 0.25 * uniform; }
  /// Keeps the more scattered of two factors of a product.
  void worsen(const Concentration& factor) {
    if (concentrated != factor.concentrated ? concentrated
                                            : !(factor.mean_square * uniform <= mean_square * factor.uniform)) {
      *this = factor;
    }
  }
};

namespace detail {

/// The law of the mean squared distance of n uniform data about their Fréchet mean: expectation about a given point,
/// and the coefficients of q(n) = Σ c_k n^(-k/2), fitted to 10 000 samples each of n = 2 to 50, 500 to 5000 of n to
/// 2000 (within 0.03, about three standard errors; tests/stats/concentration_test.cpp has the level).
struct UniformLaw {
  double expectation;
  std::array<double, 5> quantile;

  double limit(double n) const {
    if (!(n >= 2)) return 0;  // one datum is its own mean, whatever its law
    const double x = 1 / std::sqrt(n);
    double q = 0;
    for (std::size_t k = quantile.size(); k-- > 0;) q = q * x + quantile[k];
    return expectation * std::max(0.0, 1 - q * x);
  }
};

inline UniformLaw circleLaw() { return {pi * pi / 3, {2.881, -2.912, 10.537, -25.902, 17.926}}; }
inline UniformLaw sphereLaw() { return {0.5 * (pi * pi - 4), {2.670, -2.284, 4.387, -9.260, 5.742}}; }
/// SO(3) modulo a finite group, whatever its setting. The crystals' (all but half-turns about one and all axes) are
/// fitted to 6000 samples each of n = 2 to 10, 400 to 4000 of n to 500, within 0.06 but for 622 (0.09).
inline UniformLaw rotationLaw(PointGroup group = {}) {
  const char first = group.name().front();
  switch (group.order()) {
    case 2:
      return {3.534856, {2.246, -0.795, -0.549, -0.049, 0}};
    case 3:
      return {3.203834, {2.314, -0.872, 1.842, -7.711, 6.027}};
    case 4:
      if (first == '4') return {3.087149, {2.440, -1.596, 4.437, -12.043, 8.515}};
      return {1.853103, {1.971, -0.647, 0.615, -1.221, 0}};
    case 6:
      if (first == '6') return {3.003520, {2.495, -1.718, 4.570, -11.897, 8.183}};
      return {1.465165, {2.038, -0.908, 2.066, -4.885, 2.758}};
    case 8:
      return {1.324977, {1.975, 1.450, -9.168, 14.614, -8.762}};
    case 12:
      if (first == '6') return {1.223420, {2.126, -0.425, 0.324, -3.325, 2.342}};
      return {0.869931, {1.985, -0.524, -0.026, -0.476, -0.190}};
    case 24:
      return {0.544223, {1.918, 0.176, -2.686, 3.817, -2.636}};
    default:
      return {pi * pi / 3 + 2, {1.992, -0.311, -0.440, -0.464, 0}};
  }
}

/// The uniform law on the compact factor of M, which is known.
template <Metric M>
UniformLaw uniformLaw(const M& mean) {
  if constexpr (compactFactor<M>() == CompactFactor::circle) {
    return circleLaw();
  } else if constexpr (compactFactor<M>() == CompactFactor::sphere) {
    return sphereLaw();
  } else {
    return rotationLaw(rotationGroup(mean));
  }
}

/// Sums over angles from a mean.
struct ScatterOfAngles {
  double weight = 0, squared_weight = 0, sum = 0, plain = 0, n = 0;

  void add(double p, double squared_angle) {
    if (p == 0) return;
    weight += p, squared_weight += p * p, sum += p * squared_angle;
    plain += squared_angle, ++n;
  }
  Concentration judge(const UniformLaw& law) const {
    Concentration result;
    result.mean_square = sum / weight;
    result.uniform = law.expectation;
    result.limit = law.limit(weight * weight / squared_weight);
    // Without their weights uniform data scatter no less, wherever the weights put the mean. A few precise data do not
    // hide that the others are concentrated too.
    result.concentrated = result.mean_square < result.limit || plain / n < law.limit(n);
    return result;
  }
};

template <Metric M, class R, class W>
Concentration findConcentration(const R& samples, const W& weights, const M& mean) {
  eigen_assert(haveOneSize(samples, weights));
  Concentration result;
  if constexpr (Factored<M>) {
    forEachIndex<std::tuple_size_v<FactorsOf<M>>>([&](auto i) {
      result.worsen(
          findConcentration(FactorRange<i, M, R>{samples}, weights, std::get<i>(ManifoldTraits<M>::factors(mean))));
    });
  } else if constexpr (has_compact_factor<M>) {
    using T = ManifoldTraits<M>;
    const auto to_mean = T::placement(mean).inverse();
    ScatterOfAngles angles;
    for (std::size_t i = 0; i < std::ranges::size(samples); ++i) {
      const TangentOf<M> z = T::logOrigin(T::act(to_mean, M(samples[i])));
      angles.add(static_cast<double>(weights[i]),
                 static_cast<double>(z.template segment<compact_dimension<M>>(T::compact_begin).squaredNorm()));
    }
    result = angles.judge(uniformLaw(mean));
  }
  return result;
}

/// From the sums of a mean's last pass, so that no logarithm is taken again; false if they do not decide.
template <Metric M>
bool concentrationBySums(const MeanResult<M>& mean, const WeightSums& weights, Concentration& result) {
  if constexpr (Factored<M>) {
    return false;
  } else if constexpr (has_compact_factor<M>) {
    if (!converged(mean.status)) return false;
    constexpr int K = compact_dimension<M>, begin = ManifoldTraits<M>::compact_begin;
    ScatterOfAngles angles;
    angles.sum = static_cast<double>(mean.scatter.template block<K, K>(begin, begin).trace());
    angles.weight = weights.sum, angles.squared_weight = weights.squares, angles.n = weights.n;
    // The plain sum is not among those of the mean; it matters only where the weighted one is too large.
    angles.plain = weights.ones ? angles.sum : std::numeric_limits<double>::infinity();
    result = angles.judge(uniformLaw(mean.mean));
    return weights.ones || result.concentrated;
  } else {
    result = {};
    return true;
  }
}

/// The same, where they do not decide from the data.
template <Metric M, class R, class W>
Concentration findConcentration(const R& samples, const W& weights, const MeanResult<M>& mean) {
  if constexpr (!Factored<M> && has_compact_factor<M>) {
    if (converged(mean.status)) {
      Concentration known;
      if (concentrationBySums(mean, weightSums(weights, std::ranges::size(samples)), known)) return known;
    }
  }
  return findConcentration(samples, weights, mean.mean);
}

/// True if noise of this covariance scatters less than a quarter as much as uniform features; for products each factor.
template <Metric M>
bool isModestNoise(const M& mean, const SquareOf<M>& noise) {
  if constexpr (Factored<M>) {
    bool modest = true;
    forEachIndex<std::tuple_size_v<FactorsOf<M>>>([&](auto i) {
      using F = std::tuple_element_t<i, FactorsOf<M>>;
      constexpr int k = ManifoldTraits<F>::DoF, begin = factorOffset<i, M>();
      const F factor = std::get<i>(ManifoldTraits<M>::factors(mean));
      modest = modest && isModestNoise<F>(factor, SquareOf<F>(noise.template block<k, k>(begin, begin)));
    });
    return modest;
  } else if constexpr (has_compact_factor<M>) {
    constexpr int K = compact_dimension<M>, begin = ManifoldTraits<M>::compact_begin;
    return static_cast<double>(noise.template block<K, K>(begin, begin).trace()) <= 0.25 * uniformLaw(mean).expectation;
  } else {
    return true;
  }
}

/// The same of the mean of several covariances, in whatever frames.
template <Metric M>
bool isModestNoise(const M& mean, const std::vector<SquareOf<M>>& noise) {
  if (noise.empty()) return false;
  SquareOf<M> sum = SquareOf<M>::Zero();
  for (const SquareOf<M>& v : noise) sum += v;
  sum /= ScalarOf<M>(noise.size());
  return isModestNoise(mean, sum);
}
}  // namespace detail

/// The scatter of features about their mean, weighted or not, and whether uniform features would scatter as little by
/// chance (p = 0.01; weights w count as (Σw)²/Σw² data). Rotations, directions, planar rotations, frames, quotient
/// frames, and products of such, of which the most scattered factor counts.
template <detail::AnyRange R, class M = detail::MetricInSignature<R>>
Concentration concentration(R&& samples, const std::type_identity_t<M>& mean) {
  if constexpr (detail::RequireMean<R>::ok) {
    return detail::findConcentration(detail::asSamples(samples), detail::UnitWeights{}, mean);
  } else {
    return {};
  }
}
template <detail::AnyRange R, detail::AnyRange W, class M = detail::MetricInSignature<R>>
Concentration concentration(R&& samples, W&& weights, const std::type_identity_t<M>& mean) {
  if constexpr (detail::RequireMean<R>::ok && detail::RequireWeights<W>::ok) {
    return detail::withRelativeWeights<M>(
        detail::asSamples(samples), detail::asWeights(weights),
        [&](const auto& features, const auto& numbers, const detail::KeptRows&) {
          return detail::findConcentration(features, numbers, mean);
        },
        [] {
          Concentration none;
          none.concentrated = false;
          return none;
        });
  } else {
    return {};
  }
}

}  // namespace liestat
