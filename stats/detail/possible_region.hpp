// The region of a mean, grown until no feature beyond it explains the measurements as well. Needs Eigen alone.
//
// Minima of a criterion may form a ring or a valley: of directions with flipped signs they lie on a circle about the
// axis, and the covariance at one of its points says how wide the valley is there and not how long. A feature y is
// *possible* if neither its score nor its cost is rejected. The score is the mean v̄(y) of the logarithms of the data
// at y, which vanishes at the truth; T²(y) = n v̄ᵀ S(y)⁻¹ v̄ with their own scatter S(y) is Hotelling's there. The cost
// is judged by the paired z of stats/near_ties.hpp. On flat ground T² is the squared Mahalanobis distance from the
// mean. The region is grown shell by shell while shells have possible features (docs/theory/means.md, section 7.7).
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <stats/covariance.hpp>
#include <stats/detail/averaged_slope.hpp>
#include <stats/detail/compact_part.hpp>
#include <stats/detail/find_uniqueness.hpp>
#include <stats/detail/part_growth.hpp>
#include <stats/detail/settled_covariance.hpp>
#include <stats/detail/sum_certificates.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/near_ties.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <numbers>
#include <optional>
#include <ranges>
#include <tuple>
#include <vector>

namespace liestat::detail {

/// The levels at which the score and, one-sided, the cost of a feature are rejected. That of the score is the level of
/// the region, so that flat ground does not widen it. There z is half the Mahalanobis distance, and the cost is
/// rejected far outside the region only; on a ring the minimum of the sample is lower than those of the population by
/// what noise explains. A higher level of either leaves points of rings outside, a lower one refuses strips of ten
/// data.
inline constexpr double possible_score_tail = 0.05, possible_cost_tail = 0.005;
/// The level of the score at which a region is grown further, once a shell has had a possible feature, so that the
/// ground is not flat: it shall hold all points of a ring, and one of many is rejected more often than each. Whether
/// data determine a mean is decided before.
inline constexpr double grown_score_tail = 0.005;
/// The factor of the first shell, which flat ground does not reach (its square times the quantile), and of each to the
/// next; and that beyond which the data do not determine a mean: a region of more than three times the size has little
/// to do with the covariance that it was made from.
inline constexpr double first_shell = 1.05, shell_ratio = 1.09, largest_region_factor = 3.5;
/// The part of the space beyond which a possible feature leaves nothing to be called a mean: two thirds of all features
/// are nearer (directions: 109 degrees, rotations: 150).
inline constexpr double largest_part_of_space = 2.0 / 3;
/// That is said of so many data. Fewer reject little so far away, and Hotelling's law has made their region large
/// already: their region is widened, to largest_region_factor at most, and their costs are judged at a higher level.
inline constexpr std::size_t min_data_of_valley = 20;
inline constexpr double possible_cost_tail_of_few = 0.02;

/// The part of a compact space that is nearer than an angle.
template <Metric M>
double partOfSpace(const M& mean, double angle) {
  if constexpr (compact_dimension<M> == 1) {
    return angle / pi;
  } else if constexpr (compact_dimension<M> == 2) {
    return 0.5 * (1 - std::cos(angle));
  } else {
    double representatives = 1;
    if constexpr (Quotient<M>) representatives = static_cast<double>(representativesOf(mean).size());
    return representatives * (angle - std::sin(angle)) / pi;
  }
}

/// Unit vectors in K = 1, 2 or 3 dimensions, evenly spread: both ways, on a circle, on a spiral.
template <int K>
struct EvenDirections {
  static constexpr int count = K == 1 ? 2 : K == 2 ? 64 : 150;
  /// About the angle between neighbours.
  static double spacing() { return K == 2 ? 2 * pi / count : std::sqrt(4 * pi / count); }
  std::array<Eigen::Matrix<double, K, 1>, static_cast<std::size_t>(count)> list;

  EvenDirections() {
    for (int i = 0; i < count; ++i) {
      Eigen::Matrix<double, K, 1>& u = list[static_cast<std::size_t>(i)];
      if constexpr (K == 1) {
        u[0] = i == 0 ? 1 : -1;
      } else if constexpr (K == 2) {
        u << std::cos(2 * pi * i / count), std::sin(2 * pi * i / count);
      } else {
        const double height = 1 - (2 * i + 1.0) / count, radius = std::sqrt(1 - height * height);
        const double turn = 2 * pi * i / std::numbers::phi;
        u << radius * std::cos(turn), radius * std::sin(turn), height;
      }
    }
  }
  static const EvenDirections& instance() {
    static const EvenDirections directions;
    return directions;
  }
};

/// Tests features of the compact part of M against data, about their mean. More than max_averaged data are represented
/// by every m-th, whose departures from their own score and cost at the mean stand for those of all.
template <Metric M>
class FeatureTest {
 public:
  static constexpr int K = compact_dimension<M>, begin = ManifoldTraits<M>::compact_begin;
  using T = ManifoldTraits<M>;
  using Vector = Eigen::Matrix<double, K, 1>;
  using Matrix = Eigen::Matrix<double, K, K>;

  template <class R, class W>
  FeatureTest(const R& samples, const W& weights, const MeanResult<M>& mean, ResidualNoise noise)
      : any_(noise == ResidualNoise::any), n_(static_cast<double>(mean.n)), weight_(mean.sum_of_weights) {
    const std::size_t n = std::ranges::size(samples), stride = (n + max_averaged - 1) / max_averaged;
    const auto to_mean = T::placement(mean.mean).inverse();
    for (std::size_t i = 0; i < n; i += stride) {
      const M x = T::act(to_mean, M(samples[i]));
      const Vector z = partOf(T::logOrigin(x));
      const double p = static_cast<double>(weights[i]);
      data_.push_back({x, p, z.squaredNorm()});
      represented_ += p;
      if (stride > 1) at_mean_ += p * z;
    }
    judgeScoresAt(possible_score_tail);
    const double cost_tail = mean.n < min_data_of_valley ? possible_cost_tail_of_few : possible_cost_tail;
    cost_quantile_ = whereTail(cost_tail, [&](double z) { return studentTail(z, n_ - 1); });
  }

  /// Sets the level at which scores are rejected.
  void judgeScoresAt(double tail) {
    score_quantile_ = whereTail(tail, [&](double t2) { return hotellingTail(t2, K, n_); });
  }
  /// Hotelling's quantile at that level, first that of the region.
  double scoreQuantile() const { return score_quantile_; }

  /// How far a feature is from being possible.
  struct Result {
    double level = std::numeric_limits<double>::infinity();  ///< it is possible up to 1: T² or z over its quantile
    double z = 0;
  };
  /// The feature at v from the mean.
  Result operator()(const Vector& v) const {
    TangentOf<M> step = TangentOf<M>::Zero();
    step.template segment<K>(begin) = v.template cast<ScalarOf<M>>();
    const M y = T::expOrigin(step);
    const auto to_y = T::placement(y).inverse();
    Vector sum = Vector::Zero(), other_sum = Vector::Zero();
    Matrix squares = Matrix::Zero();
    double others = 0, cost = 0, cost_squares = 0;
    for (const Datum& datum : data_) {
      const Vector z = partOf(T::logOrigin(T::act(to_y, datum.x)));
      const double p = datum.p, q = any_ ? p * p : p;
      const double e = 0.5 * p * (z.squaredNorm() - datum.squared);
      sum += p * z, other_sum += q * z, others += q;
      squares += q * z * z.transpose();
      cost += e, cost_squares += e * e;
    }
    const double count = static_cast<double>(data_.size());
    Vector average = sum / represented_;
    Matrix scatter = squares - other_sum * average.transpose() - average * other_sum.transpose() +
                     others * average * average.transpose();
    scatter *= any_ ? n_ * n_ / ((n_ - 1) * count) : weight_ / (count - 1);
    scatter.diagonal().array() += singular_part * scatter.trace();
    const double sd = std::sqrt(std::max(0.0, cost_squares - cost * cost / count) / (count - 1));
    double average_cost = cost / count;
    if (!at_mean_.isZero(0)) {
      TangentOf<M> gone = TangentOf<M>::Zero();
      gone.template segment<K>(begin) = (at_mean_ / represented_).template cast<ScalarOf<M>>();
      average -= partOf(TangentOf<M>(frameTransport(T::origin(), y) * gone));
      average_cost += at_mean_.dot(v) / count;
    }
    const Cholesky<double, K> factor(scatter);
    Result result;
    if (!factor.ok()) return result;
    const double t2 = weight_ * weight_ * factor.template halfSolve<1>(average).squaredNorm();
    result.z = std::sqrt(n_) * average_cost / sd;
    result.level = std::max(t2 / score_quantile_, std::abs(result.z) / cost_quantile_);
    if (std::isnan(result.level)) result.level = std::numeric_limits<double>::infinity();
    return result;
  }

 private:
  struct Datum {
    M x;  ///< in the frame of the mean
    double p, squared;
  };

  static Vector partOf(const TangentOf<M>& z) { return z.template segment<K>(begin).template cast<double>(); }

  std::vector<Datum> data_;
  bool any_;
  double n_, weight_, represented_ = 0, score_quantile_ = 0, cost_quantile_ = 0;
  Vector at_mean_ = Vector::Zero();
};

/// A region after its growth.
template <Metric M>
struct GrownRegion {
  double factor = 1;  ///< of its size: the covariance's root
  /// Possible features lie beyond largest_region_factor or largest_part_of_space: the data do not determine a mean.
  bool open = false;
  std::optional<NearTie<M>> farthest = {};  ///< on the last shell that had a possible feature
};

/// Looks for a possible feature on a shell, the ellipsoid of the unit vectors by `shell`.
template <Metric M>
class ShellSearch {
 public:
  using Test = FeatureTest<M>;
  using Vector = typename Test::Vector;
  static constexpr int K = Test::K;

  explicit ShellSearch(const Test& test) : test_(test) {}

  /// The farthest one on a shell that the search has just found one on.
  std::pair<Vector, double> farthest(const typename Test::Matrix& shell) const {
    std::pair<Vector, double> best = *found_;
    for (const Vector& u : EvenDirections<K>::instance().list) {
      const Vector v = shell * u;
      if (!(v.norm() < pi) || v.norm() <= best.first.norm()) continue;
      const typename Test::Result result = test_(v);
      if (result.level <= 1) best = {v, result.z};
    }
    return best;
  }
  /// One on the shell that is possible: its logarithm and z.
  std::optional<std::pair<Vector, double>> operator()(const typename Test::Matrix& shell) {
    const auto& directions = EvenDirections<K>::instance().list;
    struct Tried {
      double level;
      Vector u;
    };
    constexpr std::size_t several = 3;  // from which the best are followed
    std::vector<Tried> tried;
    const auto level = [&](const Vector& u) {
      const Vector v = shell * u;
      if (!(v.norm() < pi)) return std::numeric_limits<double>::infinity();
      const typename Test::Result result = test_(v);
      if (result.level <= 1) found_ = {v, result.z};
      return result.level;
    };
    found_.reset();
    // A valley goes on where it went.
    for (std::size_t i = 0; i < directions.size(); ++i) {
      const std::size_t k = (first_ + i) % directions.size();
      tried.push_back({level(directions[k]), directions[k]});
      if (found_) {
        first_ = k;
        return found_;
      }
    }
    if constexpr (K > 1) {
      // Thin valleys pass between the directions.
      std::partial_sort(tried.begin(), tried.begin() + several, tried.end(),
                        [](const Tried& a, const Tried& b) { return a.level < b.level; });
      for (std::size_t i = 0; i < several; ++i) {
        Tried best = tried[i];
        double step = 0.5 * EvenDirections<K>::spacing();
        for (int halvings = 0; halvings < 5 && std::isfinite(best.level);) {
          Tried next = best;
          for (const Vector& t : tangents(best.u)) {
            for (const double sign : {1.0, -1.0}) {
              const Vector u = (best.u + sign * step * t).normalized();
              const double at = level(u);
              if (found_) return found_;
              if (at < next.level) next = {at, u};
            }
          }
          if (next.level < best.level) {
            best = next;
          } else {
            step *= 0.5, ++halvings;
          }
        }
      }
    }
    return std::nullopt;
  }

 private:
  static std::array<Vector, static_cast<std::size_t>(K - 1)> tangents(const Vector& u) {
    if constexpr (K == 2) {
      return {Vector(-u[1], u[0])};
    } else {
      const Vector a = u.unitOrthogonal();
      return {a, u.cross(a)};
    }
  }

  const Test& test_;
  std::size_t first_ = 0;
  std::optional<std::pair<Vector, double>> found_;
};

/// True if sums of a mean prove that its region need not be grown, as they do for clouds.
template <Metric M>
bool isRegionClosedBySums(const MeanResult<M>& mean, const WeightSums& weights, const SquareOf<M>& region) {
  UniquenessResult<M> unique;
  return isHessianSettledBySums<M>(mean, region, averagingWidth(mean.n)) &&
         isUniqueBySums(mean, UniquenessOptions{}.tie_tolerance, unique) &&
         (isFarFromRivals(mean) || haveNoNearTiesBySums(mean, weights, NearTieOptions{}.significance));
}

/// Grows the region of a mean, whose covariance from residuals is `region`, and with it `covariance`, of which the
/// coordinates of M begin at `offset`; of a product those of each factor.
template <Metric M, int D, Executor E, class R, class W>
GrownRegion<M> growRegion(const E& executor, const R& samples, const W& weights, const MeanResult<M>& mean,
                          const SquareOf<M>& region, ResidualNoise noise, Eigen::Matrix<ScalarOf<M>, D, D>& covariance,
                          int offset = 0) {
  using T = ManifoldTraits<M>;
  GrownRegion<M> result;
  if constexpr (Factored<M>) {
    forEachIndex<std::tuple_size_v<FactorsOf<M>>>([&](auto i) {
      using F = std::tuple_element_t<i, FactorsOf<M>>;
      constexpr int k = ManifoldTraits<F>::DoF, begin = factorOffset<i, M>();
      if constexpr (Factored<F> || has_compact_factor<F>) {
        const GrownRegion<F> part = growRegion<F, D>(
            executor, FactorRange<i, M, R>{samples}, weights, factorMean<i>(executor, samples, weights, mean),
            SquareOf<F>(region.template block<k, k>(begin, begin)), noise, covariance, offset + begin);
        result.open = result.open || part.open;
        if (!(part.factor > result.factor)) return;
        auto factors = FactorsOf<M>(T::factors(mean.mean));
        std::get<i>(factors) = part.farthest->feature;
        result.factor = part.factor;
        result.farthest = NearTie<M>{M(T::fromFactors(factors)), part.farthest->z};
      }
    });
  } else if constexpr (has_compact_factor<M>) {
    constexpr int K = compact_dimension<M>, begin = T::compact_begin;
    using Test = FeatureTest<M>;
    const std::size_t n = std::ranges::size(samples);
    if (n <= static_cast<std::size_t>(K) || isRegionClosedBySums(mean, weightSums(weights, n), region)) return result;
    typename Test::Matrix part = region.template block<K, K>(begin, begin).template cast<double>();
    part.diagonal().array() += singular_part * part.trace();
    const Cholesky<double, K> factor(part);
    if (!factor.ok()) return result;
    Test test(samples, weights, mean, noise);
    ShellSearch<M> search(test);
    const typename Test::Matrix edge = std::sqrt(test.scoreQuantile()) * factor.lower();
    std::optional<std::pair<typename Test::Vector, double>> last;
    const bool few = n < min_data_of_valley;
    for (double shell = first_shell; !result.open && !(few && shell > largest_region_factor); shell *= shell_ratio) {
      if (!search(shell * edge)) break;
      last = search.farthest(shell * edge);
      result.factor = shell;
      result.open =
          !few && (shell > largest_region_factor || partOfSpace(mean.mean, last->first.norm()) > largest_part_of_space);
    }
    if (last && !few && !result.open) {
      test.judgeScoresAt(grown_score_tail);
      for (double shell = result.factor * shell_ratio; shell <= largest_region_factor && search(shell * edge);
           shell *= shell_ratio) {
        last = search.farthest(shell * edge);
        result.factor = shell;
      }
    }
    if (last) {
      TangentOf<M> step = TangentOf<M>::Zero();
      step.template segment<K>(begin) = last->first.template cast<ScalarOf<M>>();
      result.farthest = NearTie<M>{exp(mean.mean, step), last->second};
    }
    if (result.factor > 1) {
      covariance += widening(covariance, coordinatesFrom<K>(offset + begin), result.factor);
    }
  }
  return result;
}

}  // namespace liestat::detail
