// Is the mean the only one? Certificates for a Fréchet mean, cheap ones first, then a certified global search; and
// certifiedMean, which withholds a covariance that would mislead.
//
// A Fréchet mean minimises C(y) = ½ Σ p_i d²(y, x_i), which may have several minima on a compact manifold. The
// certificates (means.md, section 5.2; the criterion separates, so of a frame only the rotation matters):
//   a priori    the data lie in a ball of radius r < ½ min(injectivity radius, π/√Δ), Δ the largest sectional
//   curvature:
//               the mean is unique (Kendall 1990, Afsari 2011). Rotations, directions: π/2, quotient frames: π/4
//   local       C is strictly convex along every geodesic of length r* from the mean; and every y with C(y) ≤ C(mean)
//   is
//               within 2 Σp_i θ_i / Σp_i, by the triangle inequality. Where the first radius exceeds the second: unique
//   circle      SO(2), Frame2: all minima by sorting, exact
//   global      branch and bound on SO(3), its quotients and S² (stats/detail/branch_and_bound.hpp)
//   factors     of a product each factor's minimum is certified by itself
// Needs Eigen alone. Data never throws: what is not finite is not_certified.
#pragma once

#include <stats/covariance.hpp>
#include <stats/detail/branch_and_bound.hpp>
#include <lie/detail/small_matrix.hpp>
#include <stats/gaussian.hpp>
#include <stats/mean.hpp>

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <ranges>
#include <tuple>
#include <utility>
#include <vector>

namespace liestat {

/// What is known about the minimum of the criterion.
enum class Uniqueness {
  unique,        ///< proven: no other feature has as small a cost
  ambiguous,     ///< there are others of equal cost, up to the tolerance
  not_certified  ///< neither was proven within the budget
};

/// The name used in files and messages.
constexpr const char* name(Uniqueness uniqueness) {
  switch (uniqueness) {
    case Uniqueness::unique:
      return "unique";
    case Uniqueness::ambiguous:
      return "ambiguous";
    case Uniqueness::not_certified:
      return "not_certified";
  }
  return "unknown";
}

/// Options of uniqueness().
struct UniquenessOptions {
  /// Search globally where the cheap certificates fail. Its time grows with the cells and with the data (bins of them
  /// where there are thousands): microseconds for tight data, seconds at the budget.
  bool branch_and_bound = true;
  std::size_t budget = 1'000'000;  ///< cells
  /// Minima are rivals if their costs differ by less than this, relative (at least 64 eps of the scalar), and they are
  /// 1e-3 rad apart: the search does not resolve nearer ones.
  double tie_tolerance = 1e-9;
  std::size_t max_rivals = 16;  ///< the search stops when it has found so many
};

/// What uniqueness() returns.
template <Metric M>
struct UniquenessResult {
  Uniqueness unique = Uniqueness::not_certified;
  /// The best minimum that was found: the given mean, unless `improved`.
  M minimiser = ManifoldTraits<M>::origin();
  bool improved = false;   ///< the given mean is not the minimum: `minimiser` is lower
  ScalarOf<M> cost = 0;    ///< C at the minimiser
  std::vector<M> rivals;   ///< the other minimisers of equal cost that were found
  double r_star = 0;       ///< radius about the minimiser in which it is the only minimum, rad
  std::size_t cells = 0;   ///< of the global search; 0: it was not needed
  const char* proof = "";  ///< which certificate holds, in words
};

namespace detail {

/// The compact factor of a manifold, the only one on which means can fail to be unique.
enum class CompactFactor { none, circle, sphere, rotation, unknown };

template <Metric M>
constexpr CompactFactor compactFactor() {
  if constexpr (requires(const M& x) {
                  x.unit_quaternion();
                  x.params();
                }) {
    return CompactFactor::rotation;
  } else if constexpr (requires(const M& x) {
                         x.unit_vector();
                         x.params();
                       }) {
    return CompactFactor::sphere;
  } else if constexpr (
      requires(const M& x) {
        x.unit_complex();
        x.params();
      } ||
      requires(const M& x) {
        x.so2();
        x.params();
      }) {
    return CompactFactor::circle;
  } else if constexpr (requires(const M& x) {
                         x.rows();
                         x.cols();
                       }) {  // R^n
    return CompactFactor::none;
  } else {
    return CompactFactor::unknown;
  }
}

/// Which half-turns a quotient frame divides out: those whose image of the origin is the origin.
template <Metric M>
RotationSpace rotationSpace() {
  RotationSpace space;
  if constexpr (Quotient<M>) {
    for (int axis = 0; axis < 3; ++axis) {
      typename M::Params p = M().params();
      p.template head<4>().setZero();
      p[axis] = 1;
      space.half_turns[static_cast<std::size_t>(axis)] =
          ManifoldTraits<M>::nearestRepresentative(M::fromParams(p)).index == axis + 1;
    }
  }
  return space;
}

template <Metric M>
auto searchSpace() {
  if constexpr (compactFactor<M>() == CompactFactor::rotation) {
    return rotationSpace<M>();
  } else {
    return SphereSpace{};
  }
}

/// A feature's compact part in the frame of y.
template <class Space, Metric M>
typename Space::Point relativePoint(const typename ManifoldTraits<M>::Group& to_y, const M& x) {
  using Point = typename Space::Point;
  const M p = ManifoldTraits<M>::act(to_y, x);
  return Point(p.params().template head<Point::RowsAtCompileTime>().template cast<double>()).normalized();
}

template <class Space, Metric M, class R, class W>
PackedData<Space> pack(const Space& space, const R& samples, const W& weights, const M& y) {
  PackedData<Space> data{space, {}, 0};
  const std::size_t n = std::ranges::size(samples);
  data.items.reserve(n);
  const auto to_y = ManifoldTraits<M>::placement(y).inverse();
  for (std::size_t i = 0; i < n; ++i) {
    const double p = static_cast<double>(weights[i]);
    if (p > 0) {
      data.add(relativePoint<Space>(to_y, M(samples[static_cast<std::ptrdiff_t>(i)])), p);
    }
  }
  return data;
}

/// The feature whose compact part is a point of the search, seen from y; the rest as y.
template <class Space, Metric M>
M featureAt(const Space& space, const M& y, const typename Space::Point& point) {
  TangentOf<M> v = TangentOf<M>::Zero();
  v.template tail<Space::dimension>() = space.toChart(point).template cast<ScalarOf<M>>();
  return exp(y, v);
}

/// ½ min(injectivity radius, π/√Δ)
template <Metric M>
double aPrioriRadius() {
  using T = ManifoldTraits<M>;
  const double injectivity = static_cast<double>(T::injectivityRadius());
  const double curvature = static_cast<double>(T::maxSectionalCurvature());
  return 0.5 * (curvature > 0 ? std::min(injectivity, pi / std::sqrt(curvature)) : injectivity);
}

/// The centre of a small ball that holds all the data, starting from the base: each step goes towards the farthest
/// datum (Bădoiu and Clarkson 2003; Arnaudon and Nielsen 2013 on manifolds). Stops once the radius is below `enough`.
template <class Space>
std::pair<typename Space::Point, double> enclosingBall(const PackedData<Space>& data, double enough) {
  typename Space::Point c = Space::fromChart(Space::Chart::Zero());
  std::pair<typename Space::Point, double> best{c, std::numeric_limits<double>::infinity()};
  for (int step = 1; step <= 100; ++step) {
    Sighting farthest;
    for (const auto& item : data.items) {
      const Sighting s = data.space.see(c, item.point);
      if (s.angle >= farthest.angle) farthest = s;
    }
    if (farthest.angle < best.second) best = {c, farthest.angle};
    if (best.second < enough) break;
    c = Space::exp(c, farthest.z / (step + 1));
  }
  return best;
}

/// All that one call of uniqueness() needs on a manifold with a search space.
template <Metric M, class Space, class R, class W>
class UniquenessSearch {
 public:
  using Point = typename Space::Point;

  UniquenessSearch(const R& samples, const W& weights, const MeanResult<M>& mean, const UniquenessOptions& options)
      : samples_(samples),
        weights_(weights),
        options_(options),
        tie_(std::max(options.tie_tolerance, 64 * static_cast<double>(std::numeric_limits<ScalarOf<M>>::epsilon()))),
        space_(searchSpace<M>()),
        base_(mean) {
    result_.minimiser = mean.mean;
    result_.cost = mean.cost;
  }

  UniquenessResult<M> run() {
    setBase();
    if (!std::isfinite(profile_.cost) || !(profile_.weight > 0)) return result_;
    if (!base_.converged) {
      // An iteration that ran out of steps: go on from where it stands.
      const MeanResult<M> further = polished(base_.mean);
      if (further.converged && further.cost <= base_.cost) adopt(further);
    }
    if (base_.converged && cheap()) return result_;
    if (options_.branch_and_bound) global();
    return result_;
  }

 private:
  struct Minimum {
    MeanResult<M> mean;
    Point point;
    double cost;  ///< of the compact part
    ExcludedBall<Space> ball;
  };

  MeanResult<M> polished(const M& start) const {
    MeanOptions<M> options;
    options.start = start;
    return detail::frechetMean<M>(SerialExecutor{}, samples_, weights_, options);
  }

  void setBase() {
    data_ = pack(space_, samples_, weights_, base_.mean);
    profile_ = profile(data_, Space::fromChart(Space::Chart::Zero()));
    result_.r_star = convexityRadius<Space>(profile_);
  }

  void adopt(const MeanResult<M>& better) {
    base_ = better;
    result_.minimiser = better.mean;
    result_.cost = better.cost;
    result_.improved = true;
    setBase();
  }

  bool prove(const char* proof) {
    result_.unique = Uniqueness::unique;
    result_.proof = proof;
    return true;
  }

  /// The radius about the mean that holds everything as good as the mean.
  double reach() const {
    const double m = profile_.mean_angle;
    return (m + std::sqrt(m * m + 2 * tie_ * profile_.cost / profile_.weight)) * (1 + 1e-9) + 1e-12;
  }

  bool cheap() {
    const double radius = aPrioriRadius<M>() * (1 - 1e-9);
    if (profile_.largest < radius) return prove("the data lie in a ball about the mean that is small enough");
    if (result_.r_star > reach()) return prove("no rival can lie outside the ball in which the criterion is convex");
    if (data_.items.size() <= 100000 && profile_.largest < 2 * radius) {
      const auto [centre, r] = enclosingBall(data_, radius);
      if (r < radius) {
        // The mean is the only critical point inside that ball: if the given one is outside, it is another.
        if (data_.space.see(centre, Space::fromChart(Space::Chart::Zero())).angle >= radius) {
          const MeanResult<M> better = polished(featureAt(space_, base_.mean, centre));
          if (!better.converged || !(better.cost < base_.cost)) return false;
          adopt(better);
        }
        return prove("the data lie in a ball that is small enough");
      }
    }
    if (data_.items.size() == 2 && profile_.items.size() == 2) {
      const Sighting s = data_.space.see(data_.items[0].point, data_.items[1].point);
      if (!space_.isQuotient() && s.angle > pi - 1e-7) {
        // Both ways round are equally long; the point opposite on the great circle mirrors the mean.
        const Sighting to_first = data_.space.see(Space::fromChart(Space::Chart::Zero()), data_.items[0].point);
        result_.rivals.push_back(
            featureAt(space_, base_.mean, Space::exp(Space::fromChart(Space::Chart::Zero()), 2 * to_first.z)));
        result_.unique = Uniqueness::ambiguous;
        result_.proof = "two features as far apart as can be have several midpoints";
        return true;
      }
    }
    return false;
  }

  void global() {
    const TransverseTable<Space> g;
    while (searchFromBase(g)) {
    }
  }

  /// Searches in the chart at the base. True if a better minimum was found, from which to search again.
  bool searchFromBase(const TransverseTable<Space>& g) {
    constexpr std::size_t few = 500;
    if (data_.items.size() <= few) return searchIn(data_, g);
    return searchIn(groupedData(data_), g);
  }

  bool searchIn(const PackedData<Space>& data, const TransverseTable<Space>& g) {
    const std::size_t budget = options_.budget;
    const Point origin = Space::fromChart(Space::Chart::Zero());
    const double best = profile_.cost;
    const double threshold = best * (1 + tie_);
    std::vector<Minimum> rivals, others;
    std::optional<MeanResult<M>> better;
    CellSearch<Space> search(data, g, reach(), budget > result_.cells ? budget - result_.cells : 0);
    constexpr double distinct = 1e-3;  // rad; nearer minima are one
    const double same = best * (1 - tie_);
    search.setThreshold(threshold, same, distinct);
    const double excluded = base_.converged ? exclusionRadius<Space>(profile_, g, result_.r_star, best) : 0;
    search.exclude({origin, excluded});

    // From a promising cell down to the minimum below it.
    const auto explore = [&](const typename CellSearch<Space>::Cell& cell) {
      const Point rest = descend(data, Space::fromChart(cell.centre));
      const auto known = [&](const Point& p, double within) {
        const auto near = [&](const Point& q) { return data_.space.see(q, p).angle < within; };
        return (base_.converged && near(origin)) ||
               std::any_of(rivals.begin(), rivals.end(), [&](const Minimum& m) { return near(m.point); }) ||
               std::any_of(others.begin(), others.end(), [&](const Minimum& m) { return near(m.point); });
      };
      const double cost_at_rest = boundInBall(data, g, rest, 0).centre;
      if (known(rest, distinct) && !(cost_at_rest < same)) return;
      // The costs of bins are upper bounds, and a step through many data is dear.
      if (data.roots < data_.items.size() && cost_at_rest > 1.05 * best) return;
      Minimum m{polished(featureAt(space_, base_.mean, rest)), rest, 0, {}};
      if (!m.mean.converged) return;
      m.point = relativePoint<Space>(ManifoldTraits<M>::placement(base_.mean).inverse(), m.mean.mean);
      const Profile seen = profile(data_, m.point);
      m.cost = seen.cost;
      if (m.cost < same || (!base_.converged && m.cost <= best)) {
        better = m.mean;
        return;
      }
      if (known(m.point, distinct)) return;
      m.ball = {m.point, exclusionRadius<Space>(seen, g, convexityRadius<Space>(seen), std::min(m.cost, threshold))};
      search.exclude(m.ball);
      (m.cost <= threshold ? rivals : others).push_back(m);
    };

    std::size_t visits = 0, next_exploration = 8;
    auto step = CellSearch<Space>::Step::split;
    while (step == CellSearch<Space>::Step::split && !better && rivals.size() < options_.max_rivals) {
      step = search.step([&](const typename CellSearch<Space>::Cell& cell) {
        const bool promising = cell.centre_cost < best;
        if (!promising && ++visits < next_exploration) return;
        if (!promising) next_exploration += 8 + next_exploration / 4;
        explore(cell);
      });
    }
    result_.cells += search.cells();
    if (better) {
      adopt(*better);
      return true;
    }
    if (!rivals.empty()) {
      result_.unique = Uniqueness::ambiguous;
      result_.proof = "several minima of equal cost";
      for (const Minimum& m : rivals) result_.rivals.push_back(m.mean.mean);
      return false;
    }
    if (step == CellSearch<Space>::Step::done && base_.converged) prove("branch and bound");
    return false;
  }

  const R& samples_;
  const W& weights_;
  const UniquenessOptions& options_;
  double tie_;
  Space space_;
  MeanResult<M> base_;
  PackedData<Space> data_;
  Profile profile_;
  UniquenessResult<M> result_;
};

/// SO(2) and Frame2: with the angles from the mean in order, the minimum over all ways to unroll the circle is the
/// minimum of C, since C(y) is the least of their parabolas; n of them matter. Exact up to rounding, O(n log n).
template <Metric M, class R, class W>
UniquenessResult<M> circleUniqueness(const R& samples, const W& weights, const MeanResult<M>& mean_result,
                                     const UniquenessOptions& options) {
  using T = ManifoldTraits<M>;
  UniquenessResult<M> result;
  result.minimiser = mean_result.mean;
  result.cost = mean_result.cost;
  const std::size_t n = std::ranges::size(samples);
  const auto to_mean = T::placement(mean_result.mean).inverse();
  std::vector<std::pair<double, double>> data;  // angle, weight
  data.reserve(n);
  double weight = 0, sum = 0, squares = 0, largest = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double p = static_cast<double>(weights[i]);
    if (!(p > 0)) continue;
    const auto x = T::act(to_mean, M(samples[static_cast<std::ptrdiff_t>(i)]));
    const double angle = std::atan2(static_cast<double>(x.params()[1]), static_cast<double>(x.params()[0]));
    data.emplace_back(angle, p);
    weight += p, sum += p * angle, squares += p * angle * angle;
    largest = std::max(largest, std::abs(angle));
  }
  if (!std::isfinite(sum) || data.empty()) return result;
  std::sort(data.begin(), data.end());

  // Unrolling k: the k smallest angles are moved once round.
  struct Candidate {
    double cost, angle;
  };
  std::vector<Candidate> candidates;
  const auto consider = [&] {
    const double m = sum / weight;
    candidates.push_back({0.5 * (squares - weight * m * m), std::remainder(m, 2 * pi)});
  };
  consider();
  for (std::size_t k = 0; k + 1 < data.size(); ++k) {
    const auto [angle, p] = data[k];
    sum += 2 * pi * p;
    squares += p * 4 * pi * (angle + pi);
    consider();
  }
  const auto best = std::min_element(candidates.begin(), candidates.end(),
                                     [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
  const double tie =
      std::max(options.tie_tolerance, 64 * static_cast<double>(std::numeric_limits<ScalarOf<M>>::epsilon()));
  // The costs are differences of numbers of the size of the largest squares.
  const double limit = best->cost * (1 + tie) + 64 * std::numeric_limits<double>::epsilon() * squares;
  const auto apart = [](double a, double b) { return std::abs(std::remainder(a - b, 2 * pi)); };
  const auto at = [&](double angle) {
    TangentOf<M> v = TangentOf<M>::Zero();
    v[ManifoldTraits<M>::DoF - 1] = ScalarOf<M>(angle);
    return exp(mean_result.mean, v);
  };
  const auto polished = [&](double angle) {
    MeanOptions<M> start;
    start.start = at(angle);
    return detail::frechetMean<M>(SerialExecutor{}, samples, weights, start);
  };

  // The given mean is one of the candidates, or else it is no minimum.
  double chosen = best->angle;
  for (const Candidate& c : candidates) {
    if (c.cost <= limit && std::abs(c.angle) < std::abs(chosen)) chosen = c.angle;
  }
  if (std::abs(chosen) > 1e-6 || !mean_result.converged) {
    const MeanResult<M> better = polished(chosen);
    result.minimiser = better.mean;
    result.cost = better.cost;
    result.improved = better.cost < mean_result.cost || !mean_result.converged;
    if (!better.converged) return result;
  }
  std::vector<double> rival_angles;
  for (const Candidate& c : candidates) {
    if (c.cost > limit || apart(c.angle, chosen) < 1e-6) continue;
    if (std::any_of(rival_angles.begin(), rival_angles.end(), [&](double a) { return apart(a, c.angle) < 1e-6; })) {
      continue;
    }
    rival_angles.push_back(c.angle);
    if (result.rivals.size() < options.max_rivals) result.rivals.push_back(polished(c.angle).mean);
  }
  largest = 0;
  for (const auto& [angle, p] : data) largest = std::max(largest, apart(angle, chosen));
  result.r_star = pi - largest;
  result.unique = result.rivals.empty() ? Uniqueness::unique : Uniqueness::ambiguous;
  result.proof = result.rivals.empty() ? "all minima on the circle were compared" : "several minima of equal cost";
  return result;
}

template <class W>
bool areValidWeights(const W& weights, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i) {
    const double p = static_cast<double>(weights[i]);
    if (!(p >= 0) || !std::isfinite(p)) return false;
  }
  return true;
}

/// The mean of the I-th factors: their part of a mean, from which it starts.
template <std::size_t I, Metric M, class R, class W>
auto factorMean(const R& samples, const W& weights, const MeanResult<M>& mean) {
  using F = std::tuple_element_t<I, FactorsOf<M>>;
  MeanOptions<F> options;
  options.start = std::get<I>(ManifoldTraits<M>::factors(mean.mean));
  return frechetMean<F>(SerialExecutor{}, FactorRange<I, M, R>{samples}, weights, options);
}

template <Metric M, class R, class W>
UniquenessResult<M> findUniqueness(const R& samples, const W& weights, const MeanResult<M>& mean,
                                   const UniquenessOptions& options);

/// The criterion of a product is a sum of its factors', each of which has its own variable: the minima of the product
/// are the tuples of the factors' minima.
template <Metric M, class R, class W>
UniquenessResult<M> uniquenessByFactors(const R& samples, const W& weights, const MeanResult<M>& mean,
                                        const UniquenessOptions& options) {
  using Factors = FactorsOf<M>;
  constexpr std::size_t n = std::tuple_size_v<Factors>;
  UniquenessResult<M> result;
  Factors best = ManifoldTraits<M>::factors(mean.mean);
  const auto rivals_of = [&]<std::size_t... I>(std::index_sequence<I...>) {
    return std::tuple<std::vector<std::tuple_element_t<I, Factors>>...>{};
  };
  auto rivals = rivals_of(std::make_index_sequence<n>{});
  bool certified = true, ambiguous = false, improved = false;
  result.cost = 0;
  result.r_star = std::numeric_limits<double>::infinity();
  forEachIndex<n>([&](auto i) {
    const FactorRange<i, M, R> factors{samples};
    const auto part = findUniqueness(factors, weights, factorMean<i>(samples, weights, mean), options);
    std::get<i>(best) = part.minimiser;
    std::get<i>(rivals) = part.rivals;
    certified = certified && part.unique != Uniqueness::not_certified;
    ambiguous = ambiguous || part.unique == Uniqueness::ambiguous;
    improved = improved || part.improved;
    result.cost += part.cost;
    result.r_star = std::min(result.r_star, part.r_star);
    result.cells += part.cells;
  });
  result.minimiser = ManifoldTraits<M>::fromFactors(best);
  result.improved = improved || (!mean.converged && result.cost < mean.cost);
  // Two minima of one factor make two of the product, whatever else there may be.
  result.unique = ambiguous ? Uniqueness::ambiguous : certified ? Uniqueness::unique : Uniqueness::not_certified;
  if (ambiguous) result.proof = "a factor has several minima of equal cost";
  if (result.unique == Uniqueness::unique) result.proof = "each factor's minimum is the only one";
  std::vector<Factors> minima{best};
  forEachIndex<n>([&](auto i) {
    const std::size_t so_far = minima.size();
    for (const auto& rival : std::get<i>(rivals)) {
      for (std::size_t k = 0; k < so_far && minima.size() <= options.max_rivals; ++k) {
        minima.push_back(minima[k]);
        std::get<i>(minima.back()) = rival;
      }
    }
  });
  for (std::size_t k = 1; k < minima.size(); ++k) {
    result.rivals.push_back(ManifoldTraits<M>::fromFactors(minima[k]));
  }
  return result;
}

template <Metric M, class R, class W>
UniquenessResult<M> findUniqueness(const R& samples, const W& weights, const MeanResult<M>& mean,
                                   const UniquenessOptions& options) {
  UniquenessResult<M> result;
  result.minimiser = mean.mean;
  result.cost = mean.cost;
  using std::isfinite;
  const std::size_t n = std::ranges::size(samples);
  if (n == 0 || !isfinite(static_cast<double>(mean.cost)) || !areValidWeights(weights, n)) return result;
  if constexpr (Factored<M>) {
    return uniquenessByFactors(samples, weights, mean, options);
  } else if constexpr (compactFactor<M>() == CompactFactor::none) {
    result.r_star = std::numeric_limits<double>::infinity();
    result.unique = Uniqueness::unique;
    result.proof = "the manifold is flat";
    return result;
  } else if constexpr (compactFactor<M>() == CompactFactor::circle) {
    return circleUniqueness(samples, weights, mean, options);
  } else if constexpr (compactFactor<M>() == CompactFactor::unknown) {
    // A user's manifold: the theorem holds for its whole distance.
    if (mean.converged && static_cast<double>(mean.largest_distance) < aPrioriRadius<M>() * (1 - 1e-9)) {
      result.unique = Uniqueness::unique;
      result.proof = "the data lie in a ball about the mean that is small enough";
    }
    return result;
  } else {
    using Space = decltype(searchSpace<M>());
    return UniquenessSearch<M, Space, R, W>(samples, weights, mean, options).run();
  }
}

template <Metric M, class R, class W>
double findLocalRadius(const R& samples, const W& weights, const M& mean) {
  if constexpr (Factored<M>) {
    double least = std::numeric_limits<double>::infinity();
    forEachIndex<std::tuple_size_v<FactorsOf<M>>>([&](auto i) {
      const auto factor = std::get<i>(ManifoldTraits<M>::factors(mean));
      least = std::min(least, findLocalRadius(FactorRange<i, M, R>{samples}, weights, factor));
    });
    return least;
  } else if constexpr (compactFactor<M>() == CompactFactor::none) {
    return std::numeric_limits<double>::infinity();
  } else if constexpr (compactFactor<M>() == CompactFactor::circle) {
    double largest = 0;
    const auto to_mean = ManifoldTraits<M>::placement(mean).inverse();
    for (std::size_t i = 0; i < std::ranges::size(samples); ++i) {
      const auto x = ManifoldTraits<M>::act(to_mean, M(samples[static_cast<std::ptrdiff_t>(i)]));
      largest = std::max(largest,
                         std::abs(std::atan2(static_cast<double>(x.params()[1]), static_cast<double>(x.params()[0]))));
    }
    return pi - largest;
  } else {
    static_assert(compactFactor<M>() != CompactFactor::unknown, "localRadius knows the manifolds of the library only");
    const auto space = searchSpace<M>();
    using Space = decltype(searchSpace<M>());
    return convexityRadius<Space>(profile(pack(space, samples, weights, mean), Space::fromChart(Space::Chart::Zero())));
  }
}

}  // namespace detail

/// r*: the largest radius (rad) about a mean in which the criterion is strictly convex along every geodesic from it, so
/// that the mean is the only minimum there: θ_i + r < π (quotients: 2r < gap_i) for all data and Σ p_i g(θ_i + r) > 0,
/// g the transverse eigenvalue of Hess ½d². 0 if there is none.
template <std::ranges::random_access_range R, Metric M = std::ranges::range_value_t<R>>
double localRadius(const R& samples, const M& mean) {
  return detail::findLocalRadius(samples, detail::UnitWeights{}, mean);
}
template <std::ranges::random_access_range R, std::ranges::random_access_range W,
          Metric M = std::ranges::range_value_t<R>>
double localRadius(const R& samples, const W& weights, const M& mean) {
  return detail::findLocalRadius(samples, weights, mean);
}

/// Is the mean of these features the only one? `mean` is what mean() returned for the same features and weights.
/// If a lower minimum turns up it is returned: this is a certified global search.
template <std::ranges::random_access_range R, Metric M = std::ranges::range_value_t<R>>
UniquenessResult<M> uniqueness(const R& samples, const MeanResult<M>& mean, const UniquenessOptions& options = {}) {
  return detail::findUniqueness(samples, detail::UnitWeights{}, mean, options);
}
template <std::ranges::random_access_range R, std::ranges::random_access_range W,
          Metric M = std::ranges::range_value_t<R>>
UniquenessResult<M> uniqueness(const R& samples, const W& weights, const MeanResult<M>& mean,
                               const UniquenessOptions& options = {}) {
  eigen_assert(std::ranges::size(samples) == std::ranges::size(weights));
  return detail::findUniqueness(samples, weights, mean, options);
}

/// How much of the data lies near the cut locus of a mean, and what it does to the Hessian.
struct CutLocusMass {
  double window = 0;  ///< gaps (second shortest minus shortest geodesic, rad) below this count
  double mass = 0;    ///< weighted fraction of the data with such a gap
  /// Largest relative change of the Hessian by the kinks of the squared distance (see cutLocusMass).
  double hessian_change = 0;

  /// Of the factors of a product the one that has more of it counts.
  void worsen(const CutLocusMass& factor) {
    if (!std::isnan(hessian_change) && !(factor.hessian_change < hessian_change)) *this = factor;
  }
};

namespace detail {

template <Metric M, class R, class W>
CutLocusMass findCutLocusMass(const R& samples, const W& weights, const MeanResult<M>& mean, double window) {
  CutLocusMass result;
  result.window = window;
  if constexpr (Factored<M>) {
    forEachIndex<std::tuple_size_v<FactorsOf<M>>>([&](auto i) {
      const auto part =
          findCutLocusMass(FactorRange<i, M, R>{samples}, weights, factorMean<i>(samples, weights, mean), window);
      result.worsen(part);
    });
    return result;
  }
  constexpr CompactFactor factor = compactFactor<M>();
  if constexpr (factor == CompactFactor::rotation || factor == CompactFactor::circle) {
    constexpr int N = factor == CompactFactor::rotation ? 3 : 1;
    using Matrix = Eigen::Matrix<double, N, N>;
    Matrix kinks = Matrix::Zero();
    double weight = 0;
    const std::size_t n = std::ranges::size(samples);
    const auto to_mean = ManifoldTraits<M>::placement(mean.mean).inverse();
    for (std::size_t i = 0; i < n; ++i) {
      const double p = static_cast<double>(weights[i]);
      const M x = ManifoldTraits<M>::act(to_mean, M(samples[static_cast<std::ptrdiff_t>(i)]));
      weight += p;
      const TangentOf<M> whole = ManifoldTraits<M>::logOrigin(x);
      const Eigen::Matrix<double, N, 1> z = whole.template tail<N>().template cast<double>();
      const double angle = z.norm();
      double gap = 2 * (pi - angle);
      Eigen::Matrix<double, N, 1> jump = z.normalized() * (2 * pi);
      if constexpr (Quotient<M>) {
        using T = ManifoldTraits<M>;
        const auto choice = T::nearestRepresentative(x);
        gap = static_cast<double>(choice.gap());
        for (int k = 0; k <= 3; ++k) {
          if (k == choice.index) continue;
          const Eigen::Matrix<double, N, 1> other =
              T::Math::log(T::representative(x, k).params()).template tail<3>().template cast<double>();
          if (std::abs(other.norm() - static_cast<double>(choice.second_angle)) < 1e-6) jump = z - other;
        }
      }
      if (!(gap < window)) continue;
      result.mass += p;
      kinks += p * jump * jump.transpose() / ((2 * angle + gap) * window);
    }
    result.mass /= weight;
    const Matrix H = mean.hessian.template bottomRightCorner<N, N>().template cast<double>();
    if (!kinks.allFinite() || !H.allFinite()) {
      result.hessian_change = std::numeric_limits<double>::quiet_NaN();
    } else if (result.mass > 0) {
      const Cholesky<double, N> factor_of_H(H);
      if (!factor_of_H.ok()) {
        result.hessian_change = std::numeric_limits<double>::infinity();
      } else {
        const Matrix half = factor_of_H.halfSolve(kinks);
        const Matrix relative = factor_of_H.halfSolve(Matrix(half.transpose()));
        result.hessian_change = Eigen::SelfAdjointEigenSolver<Matrix>(relative).eigenvalues()[N - 1];
      }
    }
  }
  return result;
}

}  // namespace detail

/// The cut locus near a mean (rotations, quotient frames, planar rotations; nothing elsewhere).
///
/// ½d² = min(½θ², ½θ₂²) has a concave kink where both geodesics are equally long: its gradient jumps there by z - z₂.
/// The Hessian of the expected criterion therefore has a negative term that no Hessian of a sample sees (means.md,
/// section 7.5): minus |z - z₂| times the density of the data across the cut locus, in the direction of z - z₂. The
/// signed distance s from it obeys |z - z₂| s = ½θ₂² - ½θ², so a gap θ₂ - θ below w means |s| < w (θ + θ₂)/(2|z - z₂|),
/// on both sides; a fraction m of the data there is a density m |z - z₂|/(w (θ + θ₂)), and the term is
///     - Σ_{gap < w} p (z - z₂)(z - z₂)ᵀ/((θ + θ₂) w).
/// hessian_change is its largest eigenvalue relative to the sample's Hessian: about π m/w for quotient frames folded
/// about one axis, 2π m/w for rotations.
template <std::ranges::random_access_range R, Metric M = std::ranges::range_value_t<R>>
CutLocusMass cutLocusMass(const R& samples, const MeanResult<M>& mean, double window) {
  return detail::findCutLocusMass(samples, detail::UnitWeights{}, mean, window);
}
template <std::ranges::random_access_range R, std::ranges::random_access_range W,
          Metric M = std::ranges::range_value_t<R>>
CutLocusMass cutLocusMass(const R& samples, const W& weights, const MeanResult<M>& mean, double window) {
  return detail::findCutLocusMass(samples, weights, mean, window);
}

/// Options of certifiedMean().
template <Metric M>
struct CertifiedMeanOptions {
  MeanOptions<M> mean = {};
  UniquenessOptions uniqueness = {};
  ResidualNoise noise = ResidualNoise::scaled;
  /// The covariance is withdrawn when kinks may change the Hessian by more than this, relative. A change by 0.1 in one
  /// direction of three makes the squared Mahalanobis distances 8 % larger on average, (1/0.9² - 1)/3; much less could
  /// not be told from the chance that a datum or two lie there.
  double largest_hessian_change = 0.1;
};

/// A mean with all that is known about it.
template <Metric M>
struct CertifiedMean {
  MeanResult<M> mean;  ///< the improved one if the search found a lower minimum
  UniquenessResult<M> uniqueness;
  CutLocusMass cut_locus;
  /// The mean with its covariance from residuals (Hotelling's law); none unless status is ok.
  std::optional<Gaussian<M>> estimate;
  Status status = Status::too_few;
  const char* reason = "";  ///< why there is no estimate, in words
};

namespace detail {

/// The cut locus within the confidence region of a mean with the given covariance.
template <Metric M, class R, class W>
CutLocusMass cutLocusNearby(const R& samples, const W& weights, const MeanResult<M>& mean,
                            const SquareOf<M>& covariance, ResidualNoise noise) {
  CutLocusMass result;
  constexpr CompactFactor factor = compactFactor<M>();
  if constexpr (Factored<M>) {
    forEachIndex<std::tuple_size_v<FactorsOf<M>>>([&](auto i) {
      const auto part = factorMean<i>(samples, weights, mean);
      result.worsen(
          cutLocusNearby(FactorRange<i, M, R>{samples}, weights, part, covarianceFromResiduals(part, noise), noise));
    });
  } else if constexpr (factor == CompactFactor::rotation || factor == CompactFactor::circle) {
    constexpr int K = factor == CompactFactor::rotation ? 3 : 1;
    using Matrix = Eigen::Matrix<double, K, K>;
    const Matrix block = covariance.template bottomRightCorner<K, K>().template cast<double>();
    // The mean may be anywhere in its confidence region, three standard deviations wide; gaps change at most twice as
    // fast as it moves. No less than 0.2 rad, or there is nothing to estimate a density from.
    const double sd = std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Matrix>(block).eigenvalues()[K - 1]));
    result = findCutLocusMass(samples, weights, mean, std::max(6 * sd, 0.2));
  }
  return result;
}

template <Metric M, class R, class W>
CertifiedMean<M> findCertifiedMean(const R& samples, const W& weights, const CertifiedMeanOptions<M>& options) {
  CertifiedMean<M> result;
  const auto without = [&](Status status, const char* reason) {
    result.status = status;
    result.reason = reason;
    return result;
  };
  result.mean = detail::frechetMean<M>(SerialExecutor{}, samples, weights, options.mean);
  if (result.mean.n == 0) return without(Status::too_few, "there are no features");
  result.uniqueness = findUniqueness(samples, weights, result.mean, options.uniqueness);
  if (result.uniqueness.improved) {
    MeanOptions<M> from_there = options.mean;
    from_there.start = result.uniqueness.minimiser;
    result.mean = detail::frechetMean<M>(SerialExecutor{}, samples, weights, from_there);
  }
  if (!result.mean.converged) return without(Status::not_converged, "the iteration for the mean did not converge");
  if (result.uniqueness.unique == Uniqueness::ambiguous) {
    return without(Status::ambiguous, "another feature explains the data as well");
  }
  constexpr int N = ManifoldTraits<M>::DoF;
  if (result.mean.n <= static_cast<std::size_t>(N)) {
    return without(Status::too_few, "a covariance from residuals needs more features than their dimension");
  }
  const SquareOf<M> covariance = covarianceFromResiduals(result.mean, options.noise);
  if (!covariance.allFinite()) {
    return without(Status::ill_defined, "the Hessian of the criterion is not positive definite at the mean");
  }
  result.cut_locus = cutLocusNearby(samples, weights, result.mean, covariance, options.noise);
  if (!(result.cut_locus.hessian_change <= options.largest_hessian_change)) {
    return without(Status::ill_defined,
                   "too many features lie near the cut locus of the mean, where the squared distance has a kink: no "
                   "first-order covariance is right");
  }
  result.estimate = Gaussian<M>{result.mean.mean, covariance};
  result.status = Status::ok;
  return result;
}

}  // namespace detail

/// The mean of a range of features, certified, with its covariance from the residuals where that can be trusted:
/// status ok. It is withheld, with the reason in words, when another feature explains the data as well (ambiguous),
/// when the mass near the cut locus makes the mean of quotient frames or of very scattered rotations ill-defined
/// (ill_defined), or when there are no more features than dimensions (too_few). A mean that is merely not certified to
/// be unique keeps its covariance.
template <std::ranges::random_access_range R, Metric M = std::ranges::range_value_t<R>>
CertifiedMean<M> certifiedMean(const R& samples, const CertifiedMeanOptions<M>& options = {}) {
  return detail::findCertifiedMean<M>(samples, detail::UnitWeights{}, options);
}
template <std::ranges::random_access_range R, std::ranges::random_access_range W,
          Metric M = std::ranges::range_value_t<R>>
CertifiedMean<M> certifiedMean(const R& samples, const W& weights, const CertifiedMeanOptions<M>& options = {}) {
  eigen_assert(std::ranges::size(samples) == std::ranges::size(weights));
  return detail::findCertifiedMean<M>(samples, weights, options);
}

}  // namespace liestat
