// The angles in a tangent vector, of manifolds that need not have a metric: what MAHA and barycentres of groups know of
// cut loci and of uniform scatter.
#pragma once

#include <lie/manifold.hpp>
#include <stats/concentration.hpp>
#include <stats/detail/averaged_slope.hpp>
#include <stats/detail/compact_part.hpp>
#include <stats/detail/part_growth.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <ranges>

namespace liestat::detail {

/// Coordinates of a tangent vector, the first `count` of the array.
template <int N>
struct CoordinateList {
  std::array<int, static_cast<std::size_t>(N)> index{};
  int count = 0;
};

/// Which coordinates are in rad: as the traits say, or all of a manifold of which nothing is known.
template <Homogeneous M>
constexpr CoordinateList<ManifoldTraits<M>::DoF> angularCoordinates() {
  using T = ManifoldTraits<M>;
  CoordinateList<T::DoF> list;
  const auto add = [&](int begin, int size) {
    for (int i = begin; i < begin + size; ++i) list.index[static_cast<std::size_t>(list.count++)] = i;
  };
  if constexpr (HasTangentParts<M>) {
    for (const TangentBlock& part : T::tangent_parts) {
      if (isAngular(part.part)) add(part.begin, part.size);
    }
  } else if constexpr (has_compact_factor<M>) {
    add(T::compact_begin, compact_dimension<M>);
  } else if constexpr (compactFactor<M>() == CompactFactor::unknown) {
    add(0, T::DoF);
  }
  return list;
}

/// The K coordinates of a list.
template <int K, int N>
constexpr std::array<int, static_cast<std::size_t>(K)> coordinatesOf(const CoordinateList<N>& list) {
  std::array<int, static_cast<std::size_t>(K)> index{};
  for (std::size_t i = 0; i < index.size(); ++i) index[i] = list.index[i];
  return index;
}

/// The squared length of a part of a tangent vector; by a loop, as its size is known at run time only.
template <class Tangent>
double squaredLength(const Tangent& z, const TangentBlock& part) {
  double sum = 0;
  for (int i = part.begin; i < part.begin + part.size; ++i) {
    sum += static_cast<double>(z[i]) * static_cast<double>(z[i]);
  }
  return sum;
}

/// The largest angle among the parts of the tangent vector from one feature to another, rad.
template <Homogeneous M>
double largestAngle(const M& from, const M& to) {
  double largest = 0;
  if constexpr (HasTangentParts<M>) {
    const TangentOf<M> z = log(from, to);
    for (const TangentBlock& part : ManifoldTraits<M>::tangent_parts) {
      if (isAngular(part.part)) largest = std::max(largest, squaredLength(z, part));
    }
  }
  return std::sqrt(largest);
}

/// The uniform law of an angular part.
inline UniformLaw lawOf(const TangentBlock& part) {
  return part.size == 1 ? circleLaw() : part.size == 2 ? sphereLaw() : rotationLaw();
}

/// How far an estimate may turn before it meets the cut locus of a feature, rad.
template <Homogeneous M, class R>
double angleToCutLocus(const R& features, const M& y) {
  if constexpr (Metric<M>) {
    return distanceToCutLocus(features, y);
  } else if constexpr (HasTangentParts<M>) {
    double largest = 0;
    for (std::size_t i = 0; i < std::ranges::size(features); ++i) {
      const TangentOf<M> z = log(y, M(features[i]));
      for (const TangentBlock& part : ManifoldTraits<M>::tangent_parts) {
        if (!isAngular(part.part)) continue;
        largest = std::max(largest, squaredLength(z, part));
      }
    }
    return pi - std::sqrt(largest);
  } else {
    return std::numeric_limits<double>::infinity();
  }
}

/// The factor of the law over whose angular coordinates a slope is taken, from a covariance of all coordinates, `width`
/// standard deviations wide and no narrower than min_region_sigma.
template <int K, class Matrix, class List>
Eigen::Matrix<double, K, K> angularRegion(const Matrix& covariance, const List& list, double width) {
  Eigen::Matrix<double, K, K> region;
  for (int a = 0; a < K; ++a) {
    for (int b = 0; b < K; ++b) {
      region(a, b) = width * width *
                     static_cast<double>(
                         covariance(list.index[static_cast<std::size_t>(a)], list.index[static_cast<std::size_t>(b)]));
    }
    region(a, a) += min_region_sigma * min_region_sigma;
  }
  return Cholesky<double, K>(region).lower();
}

/// A covariance whose part for the angles is that of a region which was widened by a factor.
template <Homogeneous M>
SquareOf<M> withWidenedAngles(const SquareOf<M>& covariance, double factor) {
  constexpr auto angular = angularCoordinates<M>();
  if constexpr (angular.count > 0) {
    if (factor > 1) {
      const auto index = coordinatesOf<angular.count>(angular);
      return covariance + widening(covariance, index, factor);
    }
  }
  return covariance;
}

/// The concentration of the angles in features about one of them: by the metric where there is one, else by the parts
/// of their logarithms, of which the most scattered counts.
template <Homogeneous M, class R, class W>
Concentration angularConcentration(const R& samples, const W& weights, const M& y) {
  Concentration result;
  if constexpr (Metric<M>) {
    result = findConcentration(samples, weights, y);
  } else if constexpr (HasTangentParts<M>) {
    for (const TangentBlock& part : ManifoldTraits<M>::tangent_parts) {
      if (!isAngular(part.part)) continue;
      ScatterOfAngles angles;
      for (std::size_t i = 0; i < std::ranges::size(samples); ++i) {
        angles.add(static_cast<double>(weights[i]), squaredLength(log(y, M(samples[i])), part));
      }
      result.worsen(angles.judge(lawOf(part)));
    }
  }
  return result;
}

/// True if noise of this covariance turns features by less than a quarter of what uniform ones scatter.
template <Homogeneous M>
bool isModestAngularNoise(const SquareOf<M>& noise) {
  if constexpr (Metric<M>) {
    return isModestNoise(ManifoldTraits<M>::origin(), noise);
  } else if constexpr (HasTangentParts<M>) {
    for (const TangentBlock& part : ManifoldTraits<M>::tangent_parts) {
      if (!isAngular(part.part)) continue;
      double trace = 0;
      for (int i = part.begin; i < part.begin + part.size; ++i) trace += static_cast<double>(noise(i, i));
      if (!(trace <= 0.25 * lawOf(part).expectation)) return false;
    }
  }
  return true;
}

}  // namespace liestat::detail
