// How much of the data lies near the cut locus of a mean, where the squared distance has a kink and no first-order
// covariance is right. Needs Eigen alone.
#pragma once

#include <lie/detail/small_eigen.hpp>
#include <lie/detail/small_matrix.hpp>
#include <stats/detail/averaged_slope.hpp>
#include <stats/detail/compact_part.hpp>
#include <stats/detail/find_uniqueness.hpp>
#include <stats/detail/search_space.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/detail/weights.hpp>
#include <stats/mean.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <ranges>
#include <tuple>
#include <type_traits>
#include <utility>

namespace liestat {

/// How much of the data lies near the cut locus of a mean, and what it does to the Hessian.
struct CutLocusMass {
  double window = 0;  ///< gaps (second shortest minus shortest geodesic, rad) below this count
  double mass = 0;    ///< weighted fraction of the data with such a gap
  /// Largest relative change of the Hessian by the kinks of the squared distance (see cutLocusMass).
  double hessian_change = 0;

  /// Keeps the larger change of two factors of a product.
  void worsen(const CutLocusMass& factor) {
    if (!std::isnan(hessian_change) && !(factor.hessian_change < hessian_change)) *this = factor;
  }
};

namespace detail {

/// Manifolds on whose compact part the squared distance has kinks that a mean can feel. On the sphere the cut locus is
/// a point.
template <Metric M>
inline constexpr bool has_kinks = compactFactor<M>() == CompactFactor::rotation
                                  || compactFactor<M>() == CompactFactor::circle;

/// z - z₂ of a feature in the frame of the mean, z its error vector and z₂ that of the second shortest geodesic, which
/// is `second` long.
template <Metric M, int N>
Eigen::Matrix<double, N, 1> jumpAcrossCutLocus(const M& x, const Eigen::Matrix<double, N, 1>& z, double second) {
  Eigen::Matrix<double, N, 1> jump = z.normalized() * (2 * pi);
  if constexpr (Quotient<M> && N == 3) {
    using T = ManifoldTraits<M>;
    const int nearest = T::nearestRepresentative(x).index;
    for (const int k : representativesOf(x)) {
      if (k == nearest) continue;
      const auto q = T::compactCoordinates(T::representative(x, k));
      const Eigen::Vector3d other = RotationSpace{}.toChart(Eigen::Vector4d(q.template cast<double>()).normalized());
      if (std::abs(other.norm() - second) < 1e-6) jump = z - other;
    }
  }
  return jump;
}

template <Metric M, class R, class W>
CutLocusMass findCutLocusMass(const R& samples, const W& weights, const MeanResult<M>& mean, double window) {
  eigen_assert(haveOneSize(samples, weights));
  CutLocusMass result;
  result.window = window;
  if constexpr (Factored<M>) {
    forEachIndex<std::tuple_size_v<FactorsOf<M>>>([&](auto i) {
      result.worsen(findCutLocusMass(FactorRange<i, M, R>{samples}, weights,
                                     factorMean<i>(SerialExecutor{}, samples, weights, mean), window));
    });
  } else if constexpr (has_kinks<M>) {
    using T = ManifoldTraits<M>;
    constexpr int N = compact_dimension<M>, begin = T::compact_begin;
    using Matrix = Eigen::Matrix<double, N, N>;
    using Vector = Eigen::Matrix<double, N, 1>;
    Matrix kinks = Matrix::Zero();
    double weight = 0;
    const std::size_t n = std::ranges::size(samples);
    const auto to_mean = T::placement(mean.mean).inverse();
    for (std::size_t i = 0; i < n; ++i) {
      const double p = static_cast<double>(weights[i]);
      const M x = T::act(to_mean, M(samples[i]));
      weight += p;
      const TangentOf<M> whole = T::logOrigin(x);
      const Vector z = whole.template segment<N>(begin).template cast<double>();
      const double angle = z.norm();
      double gap = 2 * (pi - angle);
      if constexpr (Quotient<M>) gap = static_cast<double>(T::nearestRepresentative(x).gap());
      if (!(gap < window)) continue;
      const Vector jump = jumpAcrossCutLocus<M, N>(x, z, angle + gap);
      result.mass += p;
      kinks += p * jump * jump.transpose() / ((2 * angle + gap) * window);
    }
    result.mass /= weight;
    const Matrix H = mean.hessian.template block<N, N>(begin, begin).template cast<double>();
    if (!kinks.allFinite() || !H.allFinite()) {
      result.hessian_change = std::numeric_limits<double>::quiet_NaN();
    } else if (result.mass > 0) {
      const Cholesky<double, N> factor_of_H(H);
      if (!factor_of_H.ok()) {
        result.hessian_change = std::numeric_limits<double>::infinity();
      } else {
        const Matrix half = factor_of_H.halfSolve(kinks);
        const Matrix relative = factor_of_H.halfSolve(Matrix(half.transpose()));
        result.hessian_change = detail::SymmetricEigen(relative).values[N - 1];
      }
    }
  }
  return result;
}

/// cos(acos(x)/3) for x in [-1, 1], the largest root y of 4 y³ - 3 y = x. With t = √((1 + x)/2) and y = ½ + t s the
/// equation is 2 t s³ + 3 s² = 1, which two steps of Newton's method for s from a parabola in t solve to 2e-13.
inline double cosineOfThird(double x) {
  const double t = std::sqrt(0.5 * (1 + x));
  double s = 0.57735 + t * (-0.1044 + t * 0.02705);
  for (int i = 0; i < 2; ++i) s -= (s * s * (3 + 2 * t * s) - 1) / (6 * s * (1 + t * s));
  return 0.5 + t * s;
}

/// The largest eigenvalue of a symmetric matrix; of three by the trigonometric solution of the characteristic equation.
template <int K>
double largestEigenvalue(const Eigen::Matrix<double, K, K>& A) {
  if constexpr (K == 3) {
    const double mean = (A(0, 0) + A(1, 1) + A(2, 2)) / 3;
    const double a = A(0, 0) - mean, d = A(1, 1) - mean, f = A(2, 2) - mean, l = A(1, 0), m = A(2, 0), n = A(2, 1);
    const double size2 = (a * a + d * d + f * f + 2 * (l * l + m * m + n * n)) / 6, size = std::sqrt(size2);
    if (!(size > 0)) return mean;
    const double half_determinant = 0.5 * (a * (d * f - n * n) - l * (l * f - n * m) + m * (l * n - d * m));
    return mean + 2 * size * cosineOfThird(std::clamp(half_determinant / (size2 * size), -1.0, 1.0));
  } else {
    return SymmetricEigen(A).values[K - 1];
  }
}

/// True if the sums of a mean prove that findCutLocusNearby finds no mass; `result` then has the window that it
/// reports.
template <Metric M>
bool isFarFromCutLocusBySums(const MeanResult<M>& mean, const SquareOf<M>& covariance, CutLocusMass& result) {
  if constexpr (Factored<M>) {
    return false;
  } else if constexpr (has_kinks<M>) {
    constexpr int K = compact_dimension<M>, begin = ManifoldTraits<M>::compact_begin;
    using Matrix = Eigen::Matrix<double, K, K>;
    const Matrix block = covariance.template block<K, K>(begin, begin).template cast<double>();
    // The mean may be anywhere in its confidence region, three standard deviations wide; gaps change at most twice as
    // fast as it moves. No less than 0.2 rad, or there is nothing to estimate a density from.
    const double widest = 36 * block.trace() <= 0.04 ? 0 : std::max(0.0, largestEigenvalue<K>(block));
    result.window = std::max(6 * std::sqrt(widest), 0.2);
    return 2 * leastDistanceToCutLocus(mean) >= result.window;
  } else {
    return true;
  }
}

template <Metric M, class R, class W>
CutLocusMass findCutLocusNearby(const R& samples, const W& weights, const MeanResult<M>& mean,
                                const SquareOf<M>& covariance) {
  eigen_assert(haveOneSize(samples, weights));
  CutLocusMass result;
  if constexpr (Factored<M>) {
    forEachIndex<std::tuple_size_v<FactorsOf<M>>>([&](auto i) {
      using F = std::tuple_element_t<i, FactorsOf<M>>;
      constexpr int k = ManifoldTraits<F>::DoF, begin = factorOffset<i, M>();
      const SquareOf<F> block = covariance.template block<k, k>(begin, begin);
      result.worsen(findCutLocusNearby(FactorRange<i, M, R>{samples}, weights,
                                       factorMean<i>(SerialExecutor{}, samples, weights, mean), block));
    });
  } else if constexpr (has_kinks<M>) {
    if (!isFarFromCutLocusBySums(mean, covariance, result)) {
      result = findCutLocusMass(samples, weights, mean, result.window);
    }
  }
  return result;
}

}  // namespace detail

/// The cut locus near a mean (rotations, quotient frames, planar rotations; nothing elsewhere).
///
/// ½d² = min(½θ², ½θ₂²) has a concave kink where both geodesics are equally long: its gradient jumps there by z - z₂.
/// The Hessian of the expected criterion therefore has a negative term that no Hessian of a sample sees
/// (docs/theory/means.md, section 7.5): minus |z - z₂| times the density of the data across the cut locus, in the
/// direction of z - z₂. The signed distance s from it obeys |z - z₂| s = ½θ₂² - ½θ², so a gap θ₂ - θ below w means |s|
/// < w (θ + θ₂)/(2|z - z₂|), on both sides; a fraction m of the data there is a density m |z - z₂|/(w (θ + θ₂)), and
/// the term is
///     - Σ_{gap < w} p (z - z₂)(z - z₂)ᵀ/((θ + θ₂) w).
/// hessian_change is its largest eigenvalue relative to the sample's Hessian: about π m/w for quotient frames folded
/// about one axis, 2π m/w for rotations.
template <detail::AnyRange R, class M = detail::MetricInSignature<R>>
CutLocusMass cutLocusMass(R&& samples, const MeanResult<std::type_identity_t<M>>& mean, double window) {
  if constexpr (detail::RequireMean<R>::ok) {
    return detail::findCutLocusMass(detail::asSamples(samples), detail::UnitWeights{}, mean, window);
  } else {
    return {};
  }
}
template <detail::AnyRange R, detail::AnyRange W, class M = detail::MetricInSignature<R>>
CutLocusMass cutLocusMass(R&& samples, W&& weights, const MeanResult<std::type_identity_t<M>>& mean, double window) {
  if constexpr (detail::RequireMean<R>::ok && detail::RequireWeights<W>::ok) {
    return detail::withRelativeWeights<M>(
        detail::asSamples(samples), detail::asWeights(weights),
        [&](const auto& features, const auto& numbers, const detail::KeptRows&) {
          return detail::findCutLocusMass(features, numbers, mean, window);
        },
        [] {
          CutLocusMass unknown;
          unknown.hessian_change = std::numeric_limits<double>::quiet_NaN();
          return unknown;
        });
  } else {
    return {};
  }
}

/// The same within the confidence region of a mean of the given covariance (rad², local frame): the window is six times
/// the largest standard deviation of the rotation, whatever its axis, and at least 0.2 rad.
template <detail::AnyRange R, class M = detail::MetricInSignature<R>>
CutLocusMass cutLocusNearby(R&& samples, const MeanResult<std::type_identity_t<M>>& mean,
                            const SquareOf<M>& covariance) {
  if constexpr (detail::RequireMean<R>::ok) {
    return detail::findCutLocusNearby(detail::asSamples(samples), detail::UnitWeights{}, mean, covariance);
  } else {
    return {};
  }
}
template <detail::AnyRange R, detail::AnyRange W, class M = detail::MetricInSignature<R>>
CutLocusMass cutLocusNearby(R&& samples, W&& weights, const MeanResult<std::type_identity_t<M>>& mean,
                            const SquareOf<M>& covariance) {
  if constexpr (detail::RequireMean<R>::ok && detail::RequireWeights<W>::ok) {
    return detail::withRelativeWeights<M>(
        detail::asSamples(samples), detail::asWeights(weights),
        [&](const auto& features, const auto& numbers, const detail::KeptRows&) {
          return detail::findCutLocusNearby(features, numbers, mean, covariance);
        },
        [] {
          CutLocusMass unknown;
          unknown.hessian_change = std::numeric_limits<double>::quiet_NaN();
          return unknown;
        });
  } else {
    return {};
  }
}

}  // namespace liestat
