// Certificates from what the last pass of a mean has seen: the largest angle, the smallest gap, the second and fourth
// moments of the angles. No datum is looked at again. The bounds are derived in docs/theory/means.md, section 5.7; each
// of them proves, and where it proves nothing the functions that look at the data decide.
#pragma once

#include <stats/detail/averaged_slope.hpp>
#include <stats/detail/search_space.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/detail/weights_of_one.hpp>
#include <stats/mean.hpp>
#include <stats/uniqueness_types.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>

namespace liestat::detail {

/// Sums over the weights of data, all of them positive.
struct WeightSums {
  double n = 0, sum = 0, squares = 0;
  bool ones = true;  ///< all weights are one

  static WeightSums ofOnes(std::size_t count) {
    const double n = static_cast<double>(count);
    return {n, n, n, true};
  }
};

/// In eight lanes, so that the additions do not wait for each other.
template <class W>
WeightSums weightSums(const W& weights, std::size_t count) {
  if constexpr (std::is_same_v<W, UnitWeights>) {
    return WeightSums::ofOnes(count);
  } else {
    constexpr std::size_t lanes = 8;
    double sums[lanes] = {}, squares[lanes] = {}, positive[lanes] = {}, others[lanes] = {};
    for (std::size_t i = 0; i < count; i += lanes) {
      const std::size_t end = std::min(lanes, count - i);
      for (std::size_t l = 0; l < end; ++l) {
        const double p = static_cast<double>(weights[i + l]);
        sums[l] += p, squares[l] += p * p, positive[l] += p != 0 ? 1 : 0, others[l] += p != 1 ? 1 : 0;
      }
    }
    WeightSums result{0, 0, 0, true};
    for (std::size_t l = 0; l < lanes; ++l) {
      result.n += positive[l], result.sum += sums[l], result.squares += squares[l];
      result.ones = result.ones && others[l] == 0;
    }
    return result;
  }
}

/// The rounding of angles, relative: bounds keep this distance from the limits that they prove.
template <class S>
inline constexpr double angle_margin = std::max(1e-9, 64 * static_cast<double>(std::numeric_limits<S>::epsilon()));

/// A mean whose last step was longer, by a coarse tolerance, is not certified by sums.
inline constexpr double largest_shift = 1e-4;

/// How the compact parts of the data lie about a converged mean.
struct AngleSums {
  double mean_square = 0;  ///< Σ p θ²/Σ p
  double fourth = 0;       ///< Σ p θ⁴/Σ p
  double largest = 0;
  /// A radius in which the criterion is strictly convex along every geodesic from the mean: r* of
  /// docs/theory/means.md, section 5.2, for directions a lower bound of it. Zero or less if none is known.
  double convex = 0;
  double single = 0;  ///< a radius in which the mean is the only critical point
  double injectivity = 0;
  double shift = 0;         ///< the last step: no more than this is the mean away from where the sums were taken
  bool small_ball = false;  ///< the data lie in the ball about the mean in which theirs is the only mean
  bool sphere = false;

  /// The transverse eigenvalue of Hess ½d².
  double transverse(double angle) const {
    return sphere ? SphereSpace::transverse(angle) : RotationSpace::transverse(angle);
  }
};

/// A lower bound of r* on the sphere from the largest angle and a mean angle that is not below that of the data. θ cot
/// θ is concave, so its mean over the data is no less than that over data at 0 and at the largest angle alone; secants
/// of that mean, concave too, are below it, and so are their zeros below its own.
inline double convexRadiusOnSphere(double largest, double mean_angle) {
  if (!(largest > 0)) return 0.5 * pi;
  const double far = std::min(mean_angle / largest, 1.0);
  const auto meanSlope = [&](double r) {
    return (1 - far) * SphereSpace::transverse(r) + far * SphereSpace::transverse(largest + r);
  };
  double low = 0, high = 0, at_low = 0, at_high = 0;
  if (largest < 0.5 * pi) {
    // No term is concave up to `low` if the data lie in a hemisphere. One tangent serves both ends: t cot t vanishes at
    // a right angle.
    const double tangent = std::tan(largest);
    low = 0.5 * pi - largest, high = 0.5 * pi;
    at_low = (1 - far) * low * tangent, at_high = -far * (0.5 * pi + largest) * tangent;
    if (!(at_low > 0)) return low;
    low += largest * at_low / (at_low - at_high);
    const double next = std::tan(low);
    at_low = (1 - far) * low / next + far * (largest + low) * (1 - tangent * next) / (tangent + next);
  } else {
    high = (pi - largest) * (1 - 1e-9);
    at_low = meanSlope(low), at_high = meanSlope(high);
    if (!(at_low > 0)) return low;
    if (at_high > 0) return high;
    low += (high - low) * at_low / (at_low - at_high);
    at_low = meanSlope(low);
  }
  if (at_low > 0) low += (high - low) * at_low / (at_low - at_high);
  return low * (1 - 1e-9);
}

template <Metric M>
AngleSums angleSums(const MeanResult<M>& mean) {
  static_assert(has_compact_factor<M>);
  constexpr int K = compact_dimension<M>, begin = ManifoldTraits<M>::compact_begin;
  AngleSums a;
  a.mean_square = static_cast<double>(mean.scatter.template block<K, K>(begin, begin).trace()) / mean.sum_of_weights;
  a.fourth = mean.angle_fourth_moment / mean.sum_of_weights;
  a.shift = mean.residual;
  a.largest = static_cast<double>(mean.largest_angle) + a.shift;
  a.injectivity = static_cast<double>(injectivityRadiusAt(mean.mean));
  a.sphere = compactFactor<M>() == CompactFactor::sphere;
  const double small = aPrioriRadius(mean.mean) * (1 - angle_margin<ScalarOf<M>>);
  a.small_ball = a.largest < small;
  a.convex = leastDistanceToCutLocus(mean) - a.shift;
  if (a.sphere && a.convex > 0) a.convex = convexRadiusOnSphere(a.largest, std::sqrt(a.mean_square) + a.shift);
  a.single = a.small_ball ? std::max(a.convex, small) : a.convex;
  return a;
}

/// The proof of section 5.7 that every minimum but the mean is much higher. With C(y) - C(mean) = Σ p (½ρ² + ρ s), ρ
/// the distance of y, no |s| exceeds the datum's angle. The excess is the mean of ½ρ + s.
class ExcessBound {
 public:
  explicit ExcessBound(const AngleSums& angles)
      : angles_(angles), root_(std::sqrt(angles.mean_square) + 2 * angles.shift) {}

  /// By the triangle inequality, for all y that are ρ or more away.
  double far(double rho) const { return 0.5 * rho - root_; }
  /// By the convexity of the terms of the data whose cut locus is not met up to `high`, for low ≤ ρ ≤ high; the others,
  /// of whose weight the fourth moment says how little it is, by the triangle inequality.
  double near(double low, double high) const {
    const double cut = std::min(angles_.injectivity, angles_.sphere ? 0.5 * pi : pi) - high;
    // Data nearer than this count as near. At the end of that range rotations and directions lose their curvature.
    const double limit = angles_.injectivity > 0.75 * pi ? 0.75 * cut : cut;
    if (!(limit > 0)) return -std::numeric_limits<double>::infinity();
    const double curvature = angles_.transverse(std::min(limit + high, pi));
    double part = 0, angle = 0;
    if (!(angles_.largest < limit)) {
      angle = angles_.fourth / (limit * limit * limit);
      part = std::min(1.0, angle / limit);
    }
    return 0.5 * low * curvature * (1 - part) - 2 * angle - 4 * angles_.shift;
  }

  /// Whether, from `single` on, far or near satisfy `enough(excess, low, high, far)`, high = low for far.
  template <class Enough>
  bool everywhere(const Enough& enough) const {
    double rho = angles_.single;
    if (!(rho > 1e-3)) return false;
    for (int i = 0; i < 40; ++i) {
      if (far(rho) > 0 && enough(far(rho), rho, rho, true)) return true;
      const double next = 1.05 * rho, excess = near(rho, next);
      if (!(excess > 0) || !enough(excess, rho, next, false)) return false;
      rho = next;
    }
    return false;
  }

 private:
  const AngleSums& angles_;
  double root_;
};

/// Sets `result` and returns true if the sums prove that a converged mean is the only one.
template <Metric M>
bool isUniqueBySums(const MeanResult<M>& mean, double tie_tolerance, UniquenessResult<M>& result) {
  if (!converged(mean.status) || !(mean.residual < largest_shift) || !(mean.sum_of_weights > 0)) return false;
  const AngleSums angles = angleSums(mean);
  const double eps = static_cast<double>(std::numeric_limits<ScalarOf<M>>::epsilon());
  const double tie = std::max(tie_tolerance, 64 * eps) + angle_margin<ScalarOf<M>>;
  if (angles.small_ball) {
    result.proof = "the data lie in a ball about the mean that is small enough";
  } else if (angles.convex > 0 && ExcessBound(angles).everywhere([&](double excess, double low, double, bool) {
               return excess * low > 0.5 * tie * angles.mean_square + 1e-12;
             })) {
    result.proof = "no rival can lie outside the ball in which the criterion is convex";
  } else {
    return false;
  }
  result.r_star = angles.convex;
  result.unique = Uniqueness::unique;
  return true;
}

/// True if the sums prove that there are no near ties: for any other minimum the differences e_i of its costs from
/// those of the mean have a sum that is significant by Student's law.
template <Metric M>
bool haveNoNearTiesBySums(const MeanResult<M>& mean, const WeightSums& weights, double significance) {
  if (!converged(mean.status) || !(mean.residual < largest_shift) || !(weights.n >= 2)) return false;
  constexpr int K = compact_dimension<M>, begin = ManifoldTraits<M>::compact_begin;
  const AngleSums angles = angleSums(mean);
  const double dof = weights.n - 1, slack = 1 - 1e3 * angle_margin<ScalarOf<M>>;
  const double root = std::sqrt(angles.mean_square) + 2 * angles.shift, v = root * root;
  const double root_of_squares =
      std::sqrt(static_cast<double>(mean.squared_weight_scatter.template block<K, K>(begin, begin).trace())) +
      2 * angles.shift * std::sqrt(weights.squares);
  const auto isSignificant = [&](double squared_over_dof) {
    const double t2 = slack * squared_over_dof * dof;
    // Student's tails decrease with the degrees of freedom: P(T > 8) is 6e-6 of ten.
    if (t2 >= 64 && dof >= 10 && significance >= 1e-5) return true;
    return studentTail(std::sqrt(t2), dof) < significance;
  };
  return ExcessBound(angles).everywhere([&](double excess, double low, double high, bool far) {
    if (weights.ones) return isSignificant(far ? 0.25 * low * low / v - 1 : excess * excess / v);
    const double ratio = (0.5 * high * std::sqrt(weights.squares) + root_of_squares) / (weights.sum * excess);
    return isSignificant(1 / (weights.n * ratio * ratio - 1));
  });
}

}  // namespace liestat::detail
