// The certificates of stats/uniqueness.hpp on rotations, their quotients and the sphere: cheap ones first, then branch
// and bound.
#pragma once

#include <stats/detail/branch_and_bound.hpp>
#include <stats/executor.hpp>
#include <stats/mean.hpp>
#include <stats/uniqueness_types.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

namespace liestat::detail {

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
template <Metric M, class Space, Executor E, class R, class W>
class UniquenessSearch {
 public:
  using Point = typename Space::Point;

  UniquenessSearch(const E& executor, const R& samples, const W& weights, const MeanResult<M>& mean,
                   const UniquenessOptions& options)
      : executor_(executor),
        samples_(samples),
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
    if (!converged(base_.status)) {
      // An iteration that ran out of steps: go on from where it stands.
      const MeanResult<M> further = polished(base_.mean);
      if (converged(further.status) && further.cost <= base_.cost) adopt(further);
    }
    if (converged(base_.status) && cheap()) return result_;
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
    return detail::frechetMean<M>(executor_, samples_, weights_, options);
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
          if (!converged(better.status) || !(better.cost < base_.cost)) return false;
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
    CellSearch<Space, E> search(executor_, data, g, reach(), budget > result_.cells ? budget - result_.cells : 0);
    constexpr double distinct = 1e-3;  // rad; nearer minima are one
    const double same = best * (1 - tie_);
    search.setThreshold(threshold, same, distinct);
    const double excluded = converged(base_.status) ? exclusionRadius<Space>(profile_, g, result_.r_star, best) : 0;
    search.exclude({origin, excluded});

    // From a promising cell down to the minimum below it.
    const auto explore = [&](const typename CellSearch<Space, E>::Cell& cell) {
      const Point rest = descend(data, Space::fromChart(cell.centre));
      const auto known = [&](const Point& p, double within) {
        const auto near = [&](const Point& q) { return data_.space.see(q, p).angle < within; };
        return (converged(base_.status) && near(origin)) ||
               std::any_of(rivals.begin(), rivals.end(), [&](const Minimum& m) { return near(m.point); }) ||
               std::any_of(others.begin(), others.end(), [&](const Minimum& m) { return near(m.point); });
      };
      const double cost_at_rest = boundInBall(data, g, rest, 0).centre;
      if (known(rest, distinct) && !(cost_at_rest < same)) return;
      // The costs of bins are upper bounds, and a step through many data is dear.
      if (data.roots < data_.items.size() && cost_at_rest > 1.05 * best) return;
      Minimum m{polished(featureAt(space_, base_.mean, rest)), rest, 0, {}};
      if (!converged(m.mean.status)) return;
      m.point = relativePoint<Space>(ManifoldTraits<M>::placement(base_.mean).inverse(), m.mean.mean);
      const Profile seen = profile(data_, m.point);
      m.cost = seen.cost;
      if (m.cost < same || (!converged(base_.status) && m.cost <= best)) {
        better = m.mean;
        return;
      }
      if (known(m.point, distinct)) return;
      m.ball = {m.point, exclusionRadius<Space>(seen, g, convexityRadius<Space>(seen), std::min(m.cost, threshold))};
      search.exclude(m.ball);
      (m.cost <= threshold ? rivals : others).push_back(m);
    };

    std::size_t visits = 0, next_exploration = 8;
    auto step = CellSearch<Space, E>::Step::split;
    while (step == CellSearch<Space, E>::Step::split && !better && rivals.size() < options_.max_rivals) {
      step = search.step([&](const typename CellSearch<Space, E>::Cell& cell) {
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
    if (step == CellSearch<Space, E>::Step::done && converged(base_.status)) prove("branch and bound");
    return false;
  }

  const E& executor_;
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

}  // namespace liestat::detail
