// The average derivative of a vector field over a normal law, for stats/averaged_hessian.hpp and its like.
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <lie/manifold.hpp>
#include <stats/detail/compact_part.hpp>
#include <stats/mean.hpp>
#include <stats/detail/search_space.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <ranges>
#include <tuple>

namespace liestat::detail {

/// No region is taken to be narrower, rad, or there would be too few data in it to estimate a density from.
inline constexpr double min_region_sigma = 0.05;
/// More data are represented by every m-th of them.
inline constexpr std::size_t max_averaged = 4096;

/// The coordinates over which a Hessian is averaged: the compact ones, or all of a manifold of which nothing is known.
template <Metric M>
inline constexpr int averaged_dimension = has_compact_factor<M> ? compact_dimension<M> : ManifoldTraits<M>::DoF;
template <Metric M>
constexpr int averagedBegin() {
  if constexpr (has_compact_factor<M>) {
    return ManifoldTraits<M>::compact_begin;
  } else {
    return 0;
  }
}

/// Points that stand for a standard normal law in K dimensions: antipodal pairs ±ξ from a lattice (Roberts 2018, the
/// generalised golden ratio) by Box and Muller's transform. Their second moments need not be exact: slopes are
/// regressed.
template <int K>
class NormalNodes {
 public:
  static constexpr int pairs = 64;

  NormalNodes() {
    constexpr int uniforms = K + K % 2;
    double phi = 2;  // the root of x^(d+1) = x + 1
    for (int i = 0; i < 60; ++i) phi = std::pow(1 + phi, 1.0 / (uniforms + 1));
    for (int k = 0; k < pairs; ++k) {
      Eigen::Matrix<double, K, 1>& point = points_[static_cast<std::size_t>(k)];
      double step = 1;
      const auto next = [&] {
        step /= phi;
        const double x = 0.5 + step * (k + 1);
        return x - std::floor(x);
      };
      for (int j = 0; j < K; j += 2) {
        const double radius = std::sqrt(-2 * std::log(std::max(next(), 0.5 / pairs)));
        const double angle = 2 * pi * next();
        point[j] = radius * std::cos(angle);
        if (j + 1 < K) point[j + 1] = radius * std::sin(angle);
      }
      moments_ += point * point.transpose();
      longest_ = std::max(longest_, point.norm() * (1 + 1e-12));
    }
  }
  /// One of each pair.
  const std::array<Eigen::Matrix<double, K, 1>, pairs>& points() const { return points_; }
  /// Σ ξ ξᵀ over those.
  const Eigen::Matrix<double, K, K>& moments() const { return moments_; }

  /// The norm of the longest.
  double longest() const { return longest_; }

  static const NormalNodes& instance() {
    static const NormalNodes nodes;
    return nodes;
  }

 private:
  std::array<Eigen::Matrix<double, K, 1>, pairs> points_;
  Eigen::Matrix<double, K, K> moments_ = Eigen::Matrix<double, K, K>::Zero();
  double longest_ = 0;
};

/// The average derivative (D×K) of a field of D components over displacements N(0, L Lᵀ) of K coordinates:
/// E[field(v) vᵀ] (L Lᵀ)⁻¹ (Stein's identity), by regression on the nodes. It counts the jumps of the field.
template <int D, int K, class Field>
Eigen::Matrix<double, D, K> averagedDerivative(const Eigen::Matrix<double, K, K>& L, const Field& field) {
  const NormalNodes<K>& nodes = NormalNodes<K>::instance();
  Eigen::Matrix<double, K, D> sum = Eigen::Matrix<double, K, D>::Zero();
  for (const Eigen::Matrix<double, K, 1>& xi : nodes.points()) {
    const Eigen::Matrix<double, K, 1> v = L * xi;
    const Eigen::Matrix<double, D, 1> odd = 0.5 * (field(v) - field(Eigen::Matrix<double, K, 1>(-v)));
    sum += xi * odd.transpose();
  }
  // sum = Σ ξ ξᵀ Lᵀ slopeᵀ
  Eigen::Matrix<double, K, D> X = Cholesky<double, K>(nodes.moments()).template solve<D>(sum);
  for (int c = 0; c < D; ++c) {
    for (int i = K - 1; i >= 0; --i) {
      for (int k = i + 1; k < K; ++k) X(i, c) -= L(k, i) * X(k, c);
      X(i, c) /= L(i, i);
    }
  }
  return X.transpose();
}

/// A Hessian is averaged unless the cut locus of every datum is farther from the mean than this many times the reach of
/// the nodes. Inside the reach the gradient jumps; the half beyond it is for what bends before it jumps: the curvature
/// diverges towards the antipode of the sphere (docs/theory/means.md, section 7.6).
inline constexpr double cut_locus_margin = 1.5;

/// How far the nodes reach.
template <int K>
double reachOf(const Eigen::Matrix<double, K, K>& L) {
  double reach = 0;
  for (const Eigen::Matrix<double, K, 1>& xi : NormalNodes<K>::instance().points()) {
    reach = std::max(reach, (L * xi).norm());
  }
  return reach;
}

/// No less than reachOf(L).
template <int K>
double longestReach(const Eigen::Matrix<double, K, K>& L) {
  return L.norm() * NormalNodes<K>::instance().longest();
}

/// No more than distanceToCutLocus, from what the passes for a mean have seen: exact for manifolds that name their
/// compact factor, for others that of the farthest datum. Minus infinity if nothing is known.
template <Metric M>
double leastDistanceToCutLocus(const MeanResult<M>& mean) {
  if (Factored<M> || !converged(mean.status)) return -std::numeric_limits<double>::infinity();
  if constexpr (Quotient<M>) {
    return 0.5 * static_cast<double>(mean.smallest_gap);
  } else {
    const auto farthest = has_compact_factor<M> ? mean.largest_angle : mean.largest_distance;
    return static_cast<double>(injectivityRadiusAt(mean.mean)) - static_cast<double>(farthest);
  }
}

/// How far the mean may move before it meets the cut locus of a datum, rad.
template <Metric M, class R>
double distanceToCutLocus(const R& samples, const M& mean) {
  using T = ManifoldTraits<M>;
  if constexpr (Factored<M>) {
    double least = std::numeric_limits<double>::infinity();
    forEachIndex<std::tuple_size_v<FactorsOf<M>>>([&](auto i) {
      least = std::min(least, distanceToCutLocus(FactorRange<i, M, R>{samples}, std::get<i>(T::factors(mean))));
    });
    return least;
  } else {
    const double radius = static_cast<double>(injectivityRadiusAt(mean));
    const auto to_mean = T::placement(mean).inverse();
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < std::ranges::size(samples); ++i) {
      const M x = T::act(to_mean, M(samples[i]));
      if constexpr (Quotient<M>) {
        least = std::min(least, 0.5 * static_cast<double>(T::nearestRepresentative(x).gap()));
      } else if constexpr (has_compact_factor<M>) {
        const TangentOf<M> z = T::logOrigin(x);
        least = std::min(
            least, radius - static_cast<double>(z.template segment<averaged_dimension<M>>(averagedBegin<M>()).norm()));
      } else {
        const TangentOf<M> z = T::logOrigin(x);
        using std::sqrt;
        least = std::min(least, radius - static_cast<double>(sqrt(z.dot(T::metricWeights().cwiseProduct(z)))));
      }
    }
    return least;
  }
}

}  // namespace liestat::detail
