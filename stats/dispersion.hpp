// How features scatter about one of them: their dispersion, and which of them is farthest in each part of the tangent
// vector. Needs Eigen alone.
#pragma once

#include <lie/manifold.hpp>
#include <stats/detail/mardia_skewness.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/detail/weights.hpp>
#include <stats/mean.hpp>
#include <stats/row_order.hpp>
#include <stats/skewness.hpp>

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
  RowOrder order = {};                           ///< of the features as they came
  Skewness skewness = {};                        ///< of √p_i z_i
};

namespace detail {

/// Whitens the features' tangent vectors by the scatter of some thousand of them.
template <Homogeneous M, class R>
Cholesky<ScalarOf<M>, ManifoldTraits<M>::DoF> scatterOfSome(const R& samples,
                                                            const typename ManifoldTraits<M>::Group& to_y) {
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  constexpr std::size_t some = 1000;
  const std::size_t n = std::ranges::size(samples), stride = (n + some - 1) / some;
  SquareOf<M> sum = SquareOf<M>::Zero();
  for (std::size_t i = 0; i < n; i += stride) {
    const TangentOf<M> z = T::logOrigin(T::act(to_y, M(samples[i])));
    sum += z * z.transpose();
  }
  // Directions without any scatter must not divide by zero.
  const S least = S(16) * std::numeric_limits<S>::epsilon() * sum.trace();
  return Cholesky<S, T::DoF>(sum + least * SquareOf<M>::Identity());
}

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
  const std::size_t n = std::ranges::size(samples);
  const bool ordered = n >= RowOrder::min_rows;
  const bool skewed = n >= Skewness::min_rows && n <= Skewness::max_rows;
  const Cholesky<S, T::DoF> whitening =
      ordered || skewed ? scatterOfSome<M>(samples, to_y) : Cholesky<S, T::DoF>(SquareOf<M>::Identity());
  TangentOf<M> before = TangentOf<M>::Zero();
  double lag = 0, squared_lags = 0, squares_of_rows = 0;
  // Σ of a = log p, of q = p |z|² and their products, for the correlation of both.
  double a1 = 0, a2 = 0, q2 = 0, aq = 0;
  std::vector<Eigen::Matrix<double, T::DoF, 1>> errors;
  if (skewed) errors.reserve(n);
  for (std::size_t i = 0; i < n; ++i) {
    const TangentOf<M> z = T::logOrigin(T::act(to_y, M(samples[i])));
    const S p = S(weights[i]);
    TangentOf<M> u = TangentOf<M>::Zero();
    if (ordered || skewed) {
      using std::sqrt;
      u = whitening.halfSolve(TangentOf<M>(sqrt(p) * z));
    }
    if (skewed) errors.push_back(u.template cast<double>());
    if (ordered) {
      const double product = static_cast<double>(u.dot(before));
      lag += product, squared_lags += product * product;
      const double q = static_cast<double>(u.squaredNorm());
      squares_of_rows += q;
      before = u;
      if constexpr (!std::is_same_v<W, UnitWeights>) {
        const double a = std::log(static_cast<double>(p));
        a1 += a, a2 += a * a, q2 += q * q, aq += a * q;
      }
    }
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
  if (skewed) result.skewness = mardiaSkewness<T::DoF>(errors);
  if (ordered && squared_lags > 0) {
    // Errors about their own mean are correlated by -1/n.
    lag += squares_of_rows / static_cast<double>(n);
    result.order.correlation = lag / squares_of_rows;
    result.order.z = lag / std::sqrt(squared_lags);
    const double count = static_cast<double>(n), spread = a2 - a1 * a1 / count;
    if (spread > 1e-6 * count) {
      const double covariance = aq - a1 * squares_of_rows / count;
      const double of_squares = q2 - squares_of_rows * squares_of_rows / count;
      result.order.weight_z = std::sqrt(count) * covariance / std::sqrt(spread * of_squares);
    }
  }
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
