// The certificates of stats/uniqueness.hpp on rotations, their quotients and the sphere: cheap ones first, then branch
// and bound. The search knows points of its space and no manifold, so that it is compiled once for all manifolds with
// that space; the manifold's side of it is stats/detail/searched_manifold.hpp.
#pragma once

#include <stats/detail/branch_and_bound.hpp>
#include <stats/executor.hpp>
#include <stats/uniqueness_types.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
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

/// The features whose mean a search certifies: their compact parts, and the iteration to which the search returns a few
/// times. Points are seen from the base, which is the mean at first.
template <class Space>
class SearchedMean {
 public:
  using Point = typename Space::Point;

  /// Where the iteration for a mean of the features ended.
  struct Found {
    bool converged;
    bool lower;         ///< its cost is below the base's
    Point point;        ///< its compact part
    std::size_t looks;  ///< at features
  };

  /// The compact parts of the features.
  virtual PackedData<Space> data() const = 0;
  /// Iterates from a point of the search.
  virtual Found iterate(const Point& start) = 0;
  /// Makes the result of the last iteration, a better minimum, the base; there are no rivals yet.
  virtual void takeAsBase() = 0;
  /// Adds the result of the last iteration to the rivals of the base.
  virtual void keepAsRival() = 0;
  /// The feature at a point is a rival of the base.
  virtual void addRival(const Point& point) = 0;

 protected:
  ~SearchedMean() = default;
};

/// Properties of the manifold and of the mean from which a search starts, and the limits of the search.
struct SearchOptions {
  double tie;              ///< costs that differ by less, relative, are equal
  double a_priori_radius;  ///< data in a smaller ball have one mean
  bool base_converged;     ///< the base is a minimum
  bool branch_and_bound;
  std::size_t budget;  ///< looks at features and bins of them
  std::size_t max_rivals;
  const std::function<void(double)>& progress;  ///< is told which part of the budget is spent
  const std::function<bool()>& stop;
};

/// The search's verdict on the base.
struct SearchVerdict {
  Uniqueness unique = Uniqueness::not_certified;
  double r_star = 0;
  std::size_t cells = 0;
  const char* proof = "";
  bool more_rivals = false;
};

/// All that one call of uniqueness() needs in a space.
template <class Space, Executor E>
class UniquenessSearch {
 public:
  using Point = typename Space::Point;

  UniquenessSearch(const E& executor, SearchedMean<Space>& mean, const SearchOptions& options)
      : executor_(executor), mean_(mean), options_(options) {}

  SearchVerdict run() {
    setBase();
    if (!std::isfinite(profile_.cost) || !(profile_.weight > 0)) return verdict_;
    if (options_.base_converged && cheap()) return verdict_;
    if (options_.branch_and_bound) global();
    return verdict_;
  }

 private:
  struct Minimum {
    Point point;
    double cost;  ///< cost of the compact part
    ExcludedBall<Space> ball;
  };

  /// Cost of packing, ordering and grouping a datum, in looks.
  static constexpr std::size_t looks_to_pack = 8;

  void setBase() {
    data_ = mean_.data();
    looks_ += looks_to_pack * data_.items.size();
    profile_ = profile(data_, Space::fromChart(Space::Chart::Zero()));
    verdict_.r_star = convexityRadius<Space>(profile_);
  }

  /// Goes on from the better minimum that was found last.
  void adopt() {
    mean_.takeAsBase();
    options_.base_converged = true;
    setBase();
  }

  /// Says how far the budget is spent, a hundred times at most.
  void tell(std::size_t looks) {
    if (!options_.progress || looks < next_told_) return;
    options_.progress(std::min(1.0, static_cast<double>(looks) / static_cast<double>(options_.budget)));
    next_told_ = looks + options_.budget / 100;
  }

  bool prove(const char* proof) {
    verdict_.unique = Uniqueness::unique;
    verdict_.proof = proof;
    return true;
  }

  /// The radius about the mean that holds everything as good as the mean.
  double reach() const {
    const double m = profile_.mean_angle;
    return (m + std::sqrt(m * m + 2 * options_.tie * profile_.cost / profile_.weight)) * (1 + 1e-9) + 1e-12;
  }

  bool cheap() {
    const double radius = options_.a_priori_radius * (1 - 1e-9);
    if (profile_.largest < radius) return prove("the data lie in a ball about the mean that is small enough");
    if (verdict_.r_star > reach()) return prove("no rival can lie outside the ball in which the criterion is convex");
    if (data_.items.size() <= 100000 && profile_.largest < 2 * radius) {
      const auto [centre, r] = enclosingBall(data_, radius);
      if (r < radius) {
        // The mean is the only critical point inside that ball: if the given one is outside, it is another.
        if (data_.space.see(centre, Space::fromChart(Space::Chart::Zero())).angle >= radius) {
          const auto found = mean_.iterate(centre);
          if (!found.converged || !found.lower) return false;
          adopt();
        }
        return prove("the data lie in a ball that is small enough");
      }
    }
    if (data_.items.size() == 2 && profile_.items.size() == 2) {
      const Sighting s = data_.space.see(data_.items[0].point, data_.items[1].point);
      if (!data_.space.isQuotient() && s.angle > pi - 1e-7) {
        // Both ways round are equally long; the point opposite on the great circle mirrors the mean.
        const Sighting to_first = data_.space.see(Space::fromChart(Space::Chart::Zero()), data_.items[0].point);
        mean_.addRival(Space::exp(Space::fromChart(Space::Chart::Zero()), 2 * to_first.z));
        verdict_.unique = Uniqueness::ambiguous;
        verdict_.proof = "two features as far apart as can be have several midpoints";
        // On the sphere they are a great circle, in which rotations have two points.
        verdict_.more_rivals = Space::dimension == 2;
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
    const Point origin = Space::fromChart(Space::Chart::Zero());
    const double best = profile_.cost;
    const double threshold = best * (1 + options_.tie);
    std::vector<Minimum> rivals, others;
    bool found_better = false;
    CellSearch<Space, E> search(executor_, data, g, reach(), options_.budget > looks_ ? options_.budget - looks_ : 0);
    constexpr double distinct = 1e-3;  // rad; nearer minima are one
    const double same = best * (1 - options_.tie);
    search.setThreshold(threshold, same, distinct);
    const double excluded = options_.base_converged ? exclusionRadius<Space>(profile_, g, verdict_.r_star, best) : 0;
    search.exclude({origin, excluded});

    // From a promising cell down to the minimum below it.
    const auto explore = [&](const typename CellSearch<Space, E>::Cell& cell) {
      std::size_t steps = 0;
      const Point rest = descend(data, Space::fromChart(cell.centre), steps);
      search.spend(steps * data.roots);
      const auto known = [&](const Point& p, double within) {
        const auto near = [&](const Point& q) { return data_.space.see(q, p).angle < within; };
        return (options_.base_converged && near(origin)) ||
               std::any_of(rivals.begin(), rivals.end(), [&](const Minimum& m) { return near(m.point); }) ||
               std::any_of(others.begin(), others.end(), [&](const Minimum& m) { return near(m.point); });
      };
      const double cost_at_rest = boundInBall(data, g, rest, 0).centre;
      if (known(rest, distinct) && !(cost_at_rest < same)) return;
      // The costs of bins are upper bounds, and a step through many data is dear.
      if (data.roots < data_.items.size() && cost_at_rest > 1.05 * best) return;
      const auto found = mean_.iterate(rest);
      search.spend(found.looks);
      if (!found.converged) return;
      const Profile seen = profile(data_, found.point);
      Minimum m{found.point, seen.cost, {}};
      if (m.cost < same || (!options_.base_converged && m.cost <= best)) {
        found_better = true;
        return;
      }
      if (known(m.point, distinct)) return;
      m.ball = {m.point, exclusionRadius<Space>(seen, g, convexityRadius<Space>(seen), std::min(m.cost, threshold))};
      search.exclude(m.ball);
      const bool is_rival = m.cost <= threshold;
      (is_rival ? rivals : others).push_back(m);
      if (is_rival) mean_.keepAsRival();
    };

    std::size_t visits = 0, next_exploration = 8;
    auto step = CellSearch<Space, E>::Step::split;
    while (step == CellSearch<Space, E>::Step::split && !found_better && rivals.size() < options_.max_rivals) {
      step = search.step([&](const typename CellSearch<Space, E>::Cell& cell) {
        const bool promising = cell.centre_cost < best;
        if (!promising && ++visits < next_exploration) return;
        if (!promising) next_exploration += 8 + next_exploration / 4;
        explore(cell);
      });
      tell(looks_ + search.looks());
      if (options_.stop && options_.stop()) break;
    }
    verdict_.cells += search.cells();
    looks_ += search.looks();
    if (found_better) {
      adopt();
      return true;
    }
    if (!rivals.empty()) {
      verdict_.unique = Uniqueness::ambiguous;
      verdict_.proof = "several minima of equal cost";
      verdict_.more_rivals = step != CellSearch<Space, E>::Step::done;
      return false;
    }
    if (step == CellSearch<Space, E>::Step::done && options_.base_converged) prove("branch and bound");
    return false;
  }

  const E& executor_;
  SearchedMean<Space>& mean_;
  SearchOptions options_;
  PackedData<Space> data_;
  Profile profile_;
  SearchVerdict verdict_;
  std::size_t looks_ = 0, next_told_ = 0;
};

}  // namespace liestat::detail
