// The global search behind stats/uniqueness.hpp: branch and bound for the Fréchet mean on SO(3), on its quotients by
// half-turns and on the sphere (docs/theory/means.md, section 5.2).
//
// Everything is in double and in the frame of a base point, the mean. A datum, or a bin of data, is a point with a
// weight, the radius of the bin and its scatter. With θ the distance of a point y from a datum, f = ½θ², z the error
// vector and u a tangent vector at y, three facts bound f from below at exp(y, u), |u| ≤ ρ:
//   Lipschitz   f ≥ ½ max(0, θ - ρ)².
//   convex      f ≥ ½θ² - z·u + ½ g(θ + ρ)|u|² while no cut locus is met, 2ρ < θ₂ - θ. g is the transverse eigenvalue
//               of the Hessian of ½d², which decreases with θ; θ₂ is the length of the second shortest geodesic: 2π -
//               θ, or the angle of the second-best representative. The terms z·u of all the data are added before a
//               norm is taken, so near a minimum this bound is of second order in ρ where Lipschitz's is of first
//               order.
//   kink        f ≥ ½θ² - z·u - max(0, ½θ² + θρ - ½(θ₂ - ρ)²) beyond: the second geodesic stays longer than θ₂ - ρ.
// Very many data are grouped into a tree of bins. A bin about the mean m of its data, of radius ρ_b, has
// Σ p f(x) ≥ (Σp) f(m) + ½ g(θ + ρ + ρ_b) Σ p d²(m, x) where no cut locus is met, because the first-order terms cancel
// at m: almost no loss however large the bin. Only bins near the cut locus are opened, down to the size of the cell;
// what is left of them has Lipschitz's bound with ρ + ρ_b.
#pragma once

#include <stats/detail/criterion_bounds.hpp>
#include <stats/executor.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace liestat::detail {

/// The tree of cells: cubes of the exponential chart at the base, which is 1-Lipschitz because the curvature is not
/// negative. Best first: the cell of least lower bound is split next. Where there are many data the bounds of a cell's
/// parts are worked out by the executor.
template <class Space, Executor E>
class CellSearch {
 public:
  static constexpr int N = Space::dimension;
  using Point = typename Space::Point;
  using Chart = typename Space::Chart;

  struct Cell {
    double lower;
    double centre_cost;
    Chart centre;
    double half_side;
  };

  CellSearch(const E& executor, const PackedData<Space>& data, const TransverseTable<Space>& g, double reach,
             std::size_t budget)
      : executor_(executor), data_(data), g_(g), reach_(std::min(reach, pi)), budget_(budget) {
    split({0, 0, Chart::Zero(), pi});
  }

  /// No point of a ball is a better minimum than those that are known.
  void exclude(const ExcludedBall<Space>& ball) { balls_.push_back(ball); }
  /// Cells whose lower bound exceeds `threshold` are done with. So are those within `distinct` of the centre of an
  /// excluded ball whose bound exceeds `same`: there is no telling their minima from the known one.
  void setThreshold(double threshold, double same, double distinct) {
    threshold_ = threshold;
    same_ = same;
    distinct_ = distinct;
  }
  std::size_t cells() const { return cells_; }
  std::size_t looks() const { return looks_; }
  /// Counts what was spent on the search elsewhere.
  void spend(std::size_t looks) { looks_ += looks; }

  enum class Step { done, split, exhausted };
  /// Splits the most promising cell, which is shown to `visit` before; exhausted once the budget of looks is spent.
  template <class Visit>
  Step step(const Visit& visit) {
    while (!heap_.empty()) {
      std::pop_heap(heap_.begin(), heap_.end(), later);
      const Cell cell = heap_.back();
      heap_.pop_back();
      if (cell.lower > threshold_) {  // so are all the others
        heap_.clear();
        return Step::done;
      }
      if (isExcluded(cell.centre, cell.half_side)) continue;
      if (looks_ >= budget_ || cell.half_side < 1e-9) return Step::exhausted;
      visit(cell);
      split(cell);
      return Step::split;
    }
    return Step::done;
  }

 private:
  static bool later(const Cell& a, const Cell& b) { return a.lower > b.lower; }

  bool isExcluded(const Chart& centre, double h) const {
    const double rho = std::sqrt(double(N)) * h;
    const Point c = Space::fromChart(centre);
    const double corner = (centre.cwiseAbs().array() + h).matrix().norm();
    for (std::size_t i = 0; i < balls_.size(); ++i) {
      // The first ball is about the base, where the chart shows distances as they are.
      if (i == 0 && corner <= balls_[i].radius) return true;
      if (rho <= balls_[i].radius && data_.space.see(c, balls_[i].centre).angle + rho <= balls_[i].radius) return true;
    }
    return false;
  }

  bool isNearKnown(const Point& c, double rho) const {
    return rho < distinct_ && std::any_of(balls_.begin(), balls_.end(), [&](const ExcludedBall<Space>& ball) {
             return data_.space.see(c, ball.centre).angle + rho < distinct_;
           });
  }

  /// The bounds in balls of radius ρ about some points.
  std::vector<BallBound> boundsAt(const std::vector<Point>& centres, double rho) const {
    constexpr std::size_t worth_sharing = 2048;  // sightings, some 50 µs
    const auto bound = [&](std::size_t i) { return std::vector<BallBound>{boundInBall(data_, g_, centres[i], rho)}; };
    const auto append = [](std::vector<BallBound>& a, const std::vector<BallBound>& b) {
      a.insert(a.end(), b.begin(), b.end());
    };
    if (centres.size() * data_.roots < worth_sharing) return SerialExecutor{}.reduce(centres.size(), bound, append);
    return executor_.reduce(centres.size(), bound, append);
  }

  void split(const Cell& cell) {
    const double h = 0.5 * cell.half_side;
    const double rho = std::sqrt(double(N)) * h;
    std::vector<Chart> charts;
    std::vector<Point> centres;
    for (int child = 0; child < 1 << N; ++child) {
      Chart centre = cell.centre;
      for (int k = 0; k < N; ++k) centre[k] += (child >> k & 1) ? h : -h;
      const double nearest = (centre.cwiseAbs().array() - h).max(0.0).matrix().norm();
      if (nearest > pi) continue;  // covered by the cells at the other side
      const Point c = Space::fromChart(centre);
      if (data_.space.isOutsideDomain(c, rho)) continue;
      ++cells_;
      if (nearest > reach_ || isExcluded(centre, h)) continue;
      charts.push_back(centre);
      centres.push_back(c);
    }
    const std::vector<BallBound> bounds = boundsAt(centres, rho);
    for (std::size_t i = 0; i < bounds.size(); ++i) {
      const BallBound& bound = bounds[i];
      looks_ += bound.looks;
      if (bound.lower > threshold_ || (bound.lower > same_ && isNearKnown(centres[i], rho))) continue;
      heap_.push_back({std::max(bound.lower, cell.lower), bound.centre, charts[i], h});
      std::push_heap(heap_.begin(), heap_.end(), later);
    }
  }

  const E& executor_;
  const PackedData<Space>& data_;
  const TransverseTable<Space>& g_;
  double reach_;
  std::size_t budget_, looks_ = 0, cells_ = 0;
  double threshold_ = std::numeric_limits<double>::infinity(), same_ = threshold_, distinct_ = 0;
  std::vector<Cell> heap_;
  std::vector<ExcludedBall<Space>> balls_;
};

/// Eq. (4) from a point: monotone, also across the cut locus. Returns where it comes to rest, and in `steps` after how
/// many of them.
template <class Space>
typename Space::Point descend(const PackedData<Space>& data, typename Space::Point y, std::size_t& steps,
                              std::size_t most = 60, double tolerance = 1e-5) {
  for (steps = 0; steps < most; ++steps) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double weight = 0;
    for (std::size_t k = 0; k < data.roots; ++k) {
      sum += data.items[k].weight * data.space.see(y, data.items[k].point).z;
      weight += data.items[k].weight;
    }
    y = Space::exp(y, sum / weight);
    if (sum.norm() <= tolerance * weight) break;
  }
  return y;
}

}  // namespace liestat::detail
