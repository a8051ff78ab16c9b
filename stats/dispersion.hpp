// How features scatter about one of them: their dispersion, and which of them is farthest in each part of the tangent
// vector. Needs Eigen alone.
#pragma once

#include <lie/manifold.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/detail/weights.hpp>
#include <stats/mean.hpp>

#include <cmath>
#include <cstddef>
#include <limits>
#include <ranges>
#include <type_traits>
#include <vector>

namespace liestat {

/// The feature that is farthest from another in one part of the tangent vector.
struct FarthestFeature {
  TangentBlock block;
  double distance = 0;    ///< norm of these coordinates, rad, m or whatever they are in
  std::size_t index = 0;  ///< in the range; the first of those that are equal but for rounding
};

/// The result of dispersionAbout().
template <Homogeneous M>
struct Dispersion {
  SquareOf<M> covariance = SquareOf<M>::Zero();  ///< Σ p_i z_i z_iᵀ / Σ p_i, z_i = log(y, x_i)
  std::vector<FarthestFeature> farthest = {};    ///< one for each of the type's tangent_parts, none if it says none
};

namespace detail {

template <Homogeneous M, class R, class W>
Dispersion<M> findDispersion(const R& samples, const W& weights, const M& y) {
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  eigen_assert(haveOneSize(samples, weights));
  Dispersion<M> result;
  if constexpr (HasTangentParts<M>) {
    for (const TangentBlock& block : T::tangent_parts) result.farthest.push_back({block, 0, 0});
  }
  const typename T::Group to_y = T::placement(y).inverse();
  S weight(0);
  // Two features are equally far from their midpoint: rounding is not to choose.
  const double tie = 64 * static_cast<double>(std::numeric_limits<S>::epsilon());
  for (std::size_t i = 0; i < std::ranges::size(samples); ++i) {
    const TangentOf<M> z = T::logOrigin(T::act(to_y, M(samples[i])));
    const S p = S(weights[i]);
    result.covariance += p * z * z.transpose();
    weight += p;
    for (FarthestFeature& f : result.farthest) {
      double squares = 0;
      for (int k = f.block.begin; k < f.block.begin + f.block.size; ++k) {
        squares += static_cast<double>(z[k]) * static_cast<double>(z[k]);
      }
      const double size = std::sqrt(squares);
      if (size > f.distance * (1 + tie) || i == 0) f.distance = size, f.index = i;
    }
  }
  result.covariance /= weight;
  return result;
}

}  // namespace detail

/// Dispersion of a range of features about y, weighted or not, in the local frame at y. NaN for an empty range.
template <detail::AnyRange R, class M = detail::SampleInSignature<R>>
Dispersion<M> dispersionAbout(R&& samples, const std::type_identity_t<M>& y) {
  if constexpr (detail::RequireSamples<R>::ok) {
    return detail::findDispersion(detail::asSamples(samples), detail::UnitWeights{}, y);
  } else {
    return {};
  }
}
template <detail::AnyRange R, detail::AnyRange W, class M = detail::SampleInSignature<R>>
Dispersion<M> dispersionAbout(R&& samples, W&& weights, const std::type_identity_t<M>& y) {
  if constexpr (detail::RequireSamples<R>::ok && detail::RequireWeights<W>::ok) {
    return detail::withRelativeWeights<M>(
        detail::asSamples(samples), detail::asWeights(weights),
        [&](const auto& features, const auto& numbers, const detail::KeptRows& rows) {
          Dispersion<M> result = detail::findDispersion(features, numbers, y);
          for (FarthestFeature& f : result.farthest) f.index = rows[f.index];
          return result;
        },
        [] {
          Dispersion<M> none;
          none.covariance.setConstant(std::numeric_limits<ScalarOf<M>>::quiet_NaN());
          return none;
        });
  } else {
    return {};
  }
}

}  // namespace liestat
