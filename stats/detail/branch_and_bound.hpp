// The global search behind stats/uniqueness.hpp: branch and bound for the Fréchet mean on SO(3), on its quotients by
// half-turns and on the sphere (means.md, section 5.2).
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

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

namespace liestat {
namespace detail {

inline constexpr double pi = static_cast<double>(EIGEN_PI);

/// A datum as seen from a point: lengths of the shortest and of the second shortest geodesic (rad), the error vector.
struct Sighting {
  double angle = 0, second = 0;
  Eigen::Vector3d z = Eigen::Vector3d::Zero();
  double gap() const { return second - angle; }
};

/// SO(3), or its quotient by half-turns about some of the axes. Points are unit quaternions x y z w, chart and error
/// vectors are rotation vectors.
struct RotationSpace {
  static constexpr int dimension = 3;
  static constexpr bool convex_to_cut_locus = true;
  using Point = Eigen::Vector4d;
  using Chart = Eigen::Vector3d;

  std::array<bool, 3> half_turns{};  ///< the axes whose half-turns are divided out

  bool isQuotient() const { return half_turns[0] || half_turns[1] || half_turns[2]; }

  static Point exp(const Eigen::Vector3d& v) {
    const double t = v.norm();
    const double s = t > 1e-9 ? std::sin(0.5 * t) / t : 0.5;
    return Point(s * v[0], s * v[1], s * v[2], std::cos(0.5 * t));
  }
  static Point exp(const Point& a, const Eigen::Vector3d& v) {
    const Point b = exp(v);
    return Point(a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
                 a[3] * b[1] + a[1] * b[3] + a[2] * b[0] - a[0] * b[2],
                 a[3] * b[2] + a[2] * b[3] + a[0] * b[1] - a[1] * b[0],
                 a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2])
        .normalized();
  }
  static Point fromChart(const Chart& v) { return exp(v); }
  /// Rotation vector from the base to the nearest representative of a point.
  Chart toChart(const Point& p) const { return see(Point(0, 0, 0, 1), p).z; }

  /// a⁻¹b: components x y z w.
  static Point relative(const Point& a, const Point& b) {
    return Point(a[3] * b[0] - a[0] * b[3] - a[1] * b[2] + a[2] * b[1],
                 a[3] * b[1] - a[1] * b[3] - a[2] * b[0] + a[0] * b[2],
                 a[3] * b[2] - a[2] * b[3] - a[0] * b[1] + a[1] * b[0], a.dot(b));
  }
  Sighting see(const Point& from, const Point& datum) const {
    const Point r = relative(from, datum);
    int best = 3;
    double c = std::abs(r[3]), c2 = -1;
    for (int axis = 0; axis < 3; ++axis) {
      if (!half_turns[static_cast<std::size_t>(axis)]) continue;
      const double candidate = std::abs(r[axis]);
      if (candidate > c) {
        c2 = c, c = candidate, best = axis;
      } else {
        c2 = std::max(c2, candidate);
      }
    }
    Sighting s;
    // The vector part of r times the unit quaternion of the axis.
    switch (best) {
      case 0:
        s.z = Eigen::Vector3d(r[3], r[2], -r[1]);
        break;
      case 1:
        s.z = Eigen::Vector3d(-r[2], r[3], r[0]);
        break;
      case 2:
        s.z = Eigen::Vector3d(r[1], -r[0], r[3]);
        break;
      default:
        s.z = r.head<3>();
    }
    // The scalar part of the representative is r[3], or minus the component that became it.
    const bool negative = best == 3 ? r[3] < 0 : r[best] > 0;
    const double sine = s.z.norm();
    s.angle = 2 * std::atan2(sine, c);
    s.second = c2 >= 0 ? 2 * std::acos(std::min(c2, 1.0)) : 2 * pi - s.angle;
    s.z *= (negative ? -1 : 1) * (sine > 1e-9 ? s.angle / sine : 2);
    return s;
  }
  /// Whether every point within ρ of p is nearer to the base by another representative.
  bool isOutsideDomain(const Point& p, double rho) const {
    double other = 0;
    for (int axis = 0; axis < 3; ++axis) {
      if (half_turns[static_cast<std::size_t>(axis)]) other = std::max(other, std::abs(p[axis]));
    }
    const double own = std::abs(p[3]);
    return other > own && 2 * (std::acos(std::min(own, 1.0)) - std::acos(std::min(other, 1.0))) > 2 * rho;
  }
  /// (θ/2)cot(θ/2)
  static double transverse(double t) { return t < 1e-4 ? 1 - t * t / 12 : 0.5 * t / std::tan(0.5 * t); }
};

/// The unit sphere of R^3. Points are unit vectors, the base is (0, 0, 1), error vectors are tangent vectors in R^3.
struct SphereSpace {
  static constexpr int dimension = 2;
  static constexpr bool convex_to_cut_locus = false;
  using Point = Eigen::Vector3d;
  using Chart = Eigen::Vector2d;

  static bool isQuotient() { return false; }
  static Point exp(const Point& a, const Eigen::Vector3d& v) {
    const double t = v.norm();
    return (std::cos(t) * a + (t > 1e-9 ? std::sin(t) / t : 1.0) * v).normalized();
  }
  static Point fromChart(const Chart& v) { return exp(Point(0, 0, 1), Eigen::Vector3d(v[0], v[1], 0)); }
  static Chart toChart(const Point& p) { return see(Point(0, 0, 1), p).z.head<2>(); }
  static Sighting see(const Point& from, const Point& datum) {
    Sighting s;
    const double c = from.dot(datum);
    s.z = datum - c * from;
    const double sine = s.z.norm();
    s.angle = std::atan2(sine, c);
    s.second = 2 * pi - s.angle;
    if (sine > 1e-12) {
      s.z *= s.angle / sine;
    } else if (c < 0) {  // the antipode: any direction
      s.z = pi * from.unitOrthogonal();
    }
    return s;
  }
  static bool isOutsideDomain(const Point&, double) { return false; }
  /// θ cot θ
  static double transverse(double t) { return t < 1e-4 ? 1 - t * t / 3 : t / std::tan(t); }
};

/// The transverse eigenvalue from a table, rounded down.
template <class Space>
class TransverseTable {
 public:
  TransverseTable() {
    for (int i = 0; i <= size; ++i) values_[static_cast<std::size_t>(i)] = Space::transverse(i * pi / size);
    if constexpr (Space::convex_to_cut_locus) {
      values_[size] = 0;
    } else {
      values_[size] = -std::numeric_limits<double>::infinity();
    }
  }
  /// At most g(t): the value at the next node, since g decreases.
  double operator()(double t) const {
    const double i = t * (size / pi);
    return i < size ? values_[static_cast<std::size_t>(i) + 1] : values_[size];
  }

 private:
  static constexpr int size = 2048;
  std::array<double, size + 1> values_;
};

/// Data in the frame of the base: a list, or the tree of groupedData.
template <class Space>
struct PackedData {
  struct Item {
    typename Space::Point point;
    double weight = 0;
    double radius = 0;                 ///< of a bin: largest distance of its data from `point`
    double scatter = 0;                ///< of a bin: Σ p d²(point, x)
    double offset = 0;                 ///< of a bin: |Σ p log(point, x)|, next to nothing since `point` is the mean
    std::uint32_t begin = 0, end = 0;  ///< of a bin: the items that it consists of
  };
  Space space;
  std::vector<Item> items;
  std::size_t roots = 0;  ///< the first items, which stand for all the data

  void add(const typename Space::Point& point, double weight) {
    items.push_back({point, weight, 0, 0, 0, 0, 0});
    roots = items.size();
  }
};

/// The data as a tree of bins: cubes of the chart with sides from 0.4 rad, halved until a few data are left.
template <class Space>
PackedData<Space> groupedData(const PackedData<Space>& data) {
  using Item = typename PackedData<Space>::Item;
  constexpr int N = Space::dimension, coarsest = 4, finest = 10;
  constexpr std::uint32_t few = 8;
  // Position along a space-filling curve: the bins of each level are runs of it.
  std::vector<std::pair<std::uint64_t, std::uint32_t>> order;
  order.reserve(data.items.size());
  for (std::size_t i = 0; i < data.items.size(); ++i) {
    const typename Space::Chart v = data.space.toChart(data.items[i].point);
    std::uint64_t key = 0;
    std::array<std::uint32_t, N> cell;
    for (int k = 0; k < N; ++k) {
      const double x = std::ldexp((v[k] + pi) / (2 * pi), finest);
      cell[static_cast<std::size_t>(k)] = static_cast<std::uint32_t>(std::clamp(x, 0.0, std::ldexp(1.0, finest) - 1));
    }
    for (int bit = finest - 1; bit >= 0; --bit) {
      for (const std::uint32_t c : cell) key = key << 1 | (c >> bit & 1);
    }
    order.emplace_back(key, static_cast<std::uint32_t>(i));
  }
  std::sort(order.begin(), order.end());

  struct Run {
    std::uint32_t begin, end;
    int level;
  };
  std::vector<Run> runs;
  const auto split = [&](std::uint32_t begin, std::uint32_t end, int level) {
    const int shift = N * (finest - level);
    for (std::uint32_t first = begin; first < end;) {
      std::uint32_t last = first + 1;
      while (last < end && order[last].first >> shift == order[first].first >> shift) ++last;
      runs.push_back({first, last, level});
      first = last;
    }
  };
  PackedData<Space> tree{data.space, {}, 0};
  split(0, static_cast<std::uint32_t>(order.size()), coarsest);
  tree.roots = runs.size();
  std::vector<std::pair<std::uint32_t, std::uint32_t>> parts;  // of each bin; first == second: its data themselves
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const Run run = runs[i];
    const auto first = static_cast<std::uint32_t>(runs.size());
    if (run.end - run.begin > few && run.level < finest) split(run.begin, run.end, run.level + 1);
    parts.emplace_back(first, static_cast<std::uint32_t>(runs.size()));
  }
  const auto bins = static_cast<std::uint32_t>(runs.size());
  tree.items.reserve(bins + order.size());
  for (std::uint32_t i = 0; i < bins; ++i) {
    const Run run = runs[i];
    Item bin;
    bin.begin = parts[i].first, bin.end = parts[i].second;
    if (bin.begin == bin.end) bin.begin = bins + run.begin, bin.end = bins + run.end;
    typename Space::Chart start = Space::Chart::Zero();
    for (std::uint32_t k = run.begin; k < run.end; ++k) {
      const Item& x = data.items[order[k].second];
      start += x.weight * data.space.toChart(x.point);
      bin.weight += x.weight;
    }
    bin.point = Space::fromChart(start / bin.weight);
    // One step of eq. (4), which contracts by radius²/18, then the sums about the mean.
    for (const bool last : {false, true}) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (std::uint32_t k = run.begin; k < run.end; ++k) {
        const Item& x = data.items[order[k].second];
        const Sighting s = data.space.see(bin.point, x.point);
        sum += x.weight * s.z;
        if (last) {
          bin.radius = std::max(bin.radius, s.angle);
          bin.scatter += x.weight * s.angle * s.angle;
        }
      }
      if (last) bin.offset = sum.norm();
      if (!last) bin.point = Space::exp(bin.point, sum / bin.weight);
    }
    tree.items.push_back(bin);
  }
  for (const auto& [key, i] : order) tree.items.push_back(data.items[i]);
  return tree;
}

/// What one pass over the data says about the ball of radius ρ about a point.
struct BallBound {
  double lower = 0;   ///< of the criterion in the ball
  double centre = 0;  ///< the criterion at the centre; with bins, at least it
};

/// Bound of C(y) = ½ Σ p θ² in the ball of radius ρ about y.
template <class Space>
BallBound boundInBall(const PackedData<Space>& data, const TransverseTable<Space>& g, const typename Space::Point& y,
                      double rho) {
  double centre = 0, lipschitz = 0, mixed = 0, curvature = 0;
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  const auto add = [&](const auto& self, const typename PackedData<Space>::Item& item) -> void {
    const Sighting s = data.space.see(y, item.point);
    const double reach = rho + item.radius;
    const bool smooth = s.gap() > 2 * reach;
    if (!smooth && item.begin < item.end && item.radius > 0.25 * rho) {
      for (std::uint32_t k = item.begin; k < item.end; ++k) self(self, data.items[k]);
      return;
    }
    const double half = 0.5 * s.angle * s.angle;
    centre += item.weight * half + 0.5 * item.scatter + s.angle * item.offset;
    const double left = std::max(0.0, s.angle - reach);
    const double first_order = 0.5 * left * left;
    lipschitz += item.weight * first_order;

    // The loss below the value at the centre that cannot be shared with other data decides between the bounds.
    double kink = 0, bend = 0, scatter = 0;
    if (smooth) {
      bend = g(s.angle + rho);
      scatter = 0.5 * g(s.angle + reach) * item.scatter - (s.angle + rho) * item.offset;
    } else if (Space::convex_to_cut_locus && item.radius == 0) {
      const double second = std::max(0.0, s.second - rho);
      kink = std::max(0.0, half + s.angle * rho - 0.5 * second * second);
    } else {
      kink = std::numeric_limits<double>::infinity();
    }
    const double loss = kink + std::max(0.0, -0.5 * bend * rho * rho);
    if (loss <= 0.5 * (half - first_order)) {
      mixed += item.weight * (half - kink) + scatter;
      gradient += item.weight * s.z;
      curvature += item.weight * bend;
    } else {
      mixed += item.weight * first_order;
    }
  };
  for (std::size_t i = 0; i < data.roots; ++i) add(add, data.items[i]);
  const double slope = gradient.norm();
  if (curvature > 0 && slope < curvature * rho) {
    mixed -= 0.5 * slope * slope / curvature;
  } else {
    mixed -= slope * rho - 0.5 * curvature * rho * rho;
  }
  return {std::max(lipschitz, mixed), centre};
}

/// How the data lie about a critical point: all that local certificates need.
struct Profile {
  struct Item {
    double angle = 0, second = 0, weight = 0;
  };
  std::vector<Item> items;
  double slope = 0;  ///< norm of the gradient of C
  double cost = 0;   ///< ½ Σ p θ²
  double weight = 0;
  double largest = 0, mean_angle = 0, smallest_gap = std::numeric_limits<double>::infinity();
};

/// The profile seen from y. Of very many data angles are rounded up and gaps down, by two per cent, which can only
/// weaken a certificate.
template <class Space>
Profile profile(const PackedData<Space>& data, const typename Space::Point& y) {
  constexpr std::size_t many = 20000;
  constexpr double grid = 0.004, least_gap = 1e-9, steps_an_octave = 32;
  Profile p;
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  std::vector<std::pair<std::uint64_t, double>> rounded;
  for (const auto& item : data.items) {
    const Sighting s = data.space.see(y, item.point);
    gradient += item.weight * s.z;
    p.cost += 0.5 * item.weight * s.angle * s.angle;
    p.weight += item.weight;
    p.mean_angle += item.weight * s.angle;
    p.largest = std::max(p.largest, s.angle);
    p.smallest_gap = std::min(p.smallest_gap, s.gap());
    if (data.items.size() <= many) {
      p.items.push_back({s.angle, s.second, item.weight});
    } else {
      const auto up = static_cast<std::uint64_t>(std::ceil(s.angle / grid));
      const double octaves = std::log2(std::max(s.gap(), least_gap) / least_gap);
      const auto down = static_cast<std::uint64_t>(octaves * steps_an_octave);
      rounded.emplace_back(up << 32 | down, item.weight);
    }
  }
  std::sort(rounded.begin(), rounded.end());
  for (std::size_t i = 0; i < rounded.size();) {
    const std::uint64_t key = rounded[i].first;
    double weight = 0;
    for (; i < rounded.size() && rounded[i].first == key; ++i) weight += rounded[i].second;
    const double angle = std::min(grid * static_cast<double>(key >> 32), p.largest);
    const auto down = static_cast<double>(key & 0xffffffffu);
    const double gap = down > 0 ? least_gap * std::exp2(down / steps_an_octave) : 0;
    p.items.push_back({angle, angle + gap, weight});
  }
  p.mean_angle /= p.weight;
  p.slope = gradient.norm();
  return p;
}

/// r* of means.md, section 5.2: the criterion is strictly convex along every geodesic of length r* from the point.
template <class Space>
double convexityRadius(const Profile& p) {
  double low = 0, high = 0.5 * p.smallest_gap;
  const auto convex = [&](double r) {
    double sum = 0;
    for (const auto& item : p.items) {
      sum += item.weight * Space::transverse(std::min(item.angle + r, pi * (1 - 1e-12)));
    }
    return sum > 0;
  };
  if (!(high > 0) || !convex(0)) return 0;
  if (convex(high)) return high;
  for (int i = 0; i < 40; ++i) {
    const double r = 0.5 * (low + high);
    (convex(r) ? low : high) = r;
  }
  return low;
}

/// The largest radius found up to which C exceeds `threshold` in the ball about the point of a profile, starting from a
/// radius for which that is known. Goes beyond r*, because the few data whose cut locus comes near cost only their
/// kink.
template <class Space>
double exclusionRadius(const Profile& p, const TransverseTable<Space>& g, double from, double threshold) {
  double r = from;
  while (r < pi) {
    const double next = std::min(pi, std::max(1.04 * r, 1e-7));
    double value = p.cost, curvature = 0;
    for (const auto& item : p.items) {
      const double half = 0.5 * item.angle * item.angle;
      const double second = std::max(0.0, item.second - next);
      const double left = std::max(0.0, item.angle - next);
      const double lipschitz = half + item.angle * next - 0.5 * left * left;
      double kink = lipschitz, bend = 0;
      if (item.second - item.angle > 2 * next) {
        const double b = g(item.angle + next);
        if (b > -2) kink = 0, bend = b;
      } else if (Space::convex_to_cut_locus) {
        kink = std::clamp(half + item.angle * next - 0.5 * second * second, 0.0, lipschitz);
      }
      value -= item.weight * kink;
      curvature += item.weight * bend;
    }
    const auto at = [&](double t) { return value - p.slope * t + 0.5 * curvature * t * t; };
    double least = std::min(at(r), at(next));
    if (curvature > 0) least = std::min(least, at(std::clamp(p.slope / curvature, r, next)));
    if (!(least > threshold)) break;
    r = next;
  }
  return r;
}

/// A known local minimum or critical region: C exceeds the threshold in the ball, but for the minimum itself.
template <class Space>
struct ExcludedBall {
  typename Space::Point centre;
  double radius = 0;
};

/// The tree of cells: cubes of the exponential chart at the base, which is 1-Lipschitz because the curvature is not
/// negative. Best first: the cell of least lower bound is split next.
template <class Space>
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

  CellSearch(const PackedData<Space>& data, const TransverseTable<Space>& g, double reach, std::size_t budget)
      : data_(data), g_(g), reach_(std::min(reach, pi)), budget_(budget) {
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

  enum class Step { done, split, exhausted };
  /// Splits the most promising cell, which is shown to `visit` before.
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
      if (cells_ >= budget_ || cell.half_side < 1e-9) return Step::exhausted;
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

  void split(const Cell& cell) {
    const double h = 0.5 * cell.half_side;
    const double rho = std::sqrt(double(N)) * h;
    for (int child = 0; child < 1 << N; ++child) {
      Chart centre = cell.centre;
      for (int k = 0; k < N; ++k) centre[k] += (child >> k & 1) ? h : -h;
      const double nearest = (centre.cwiseAbs().array() - h).max(0.0).matrix().norm();
      if (nearest > pi) continue;  // covered by the cells at the other side
      const Point c = Space::fromChart(centre);
      if (data_.space.isOutsideDomain(c, rho)) continue;
      ++cells_;
      if (nearest > reach_ || isExcluded(centre, h)) continue;
      const BallBound bound = boundInBall(data_, g_, c, rho);
      if (bound.lower > threshold_ || (bound.lower > same_ && isNearKnown(c, rho))) continue;
      heap_.push_back({std::max(bound.lower, cell.lower), bound.centre, centre, h});
      std::push_heap(heap_.begin(), heap_.end(), later);
    }
  }

  const PackedData<Space>& data_;
  const TransverseTable<Space>& g_;
  double reach_;
  std::size_t budget_, cells_ = 0;
  double threshold_ = std::numeric_limits<double>::infinity(), same_ = threshold_, distinct_ = 0;
  std::vector<Cell> heap_;
  std::vector<ExcludedBall<Space>> balls_;
};

/// Eq. (4) from a point: monotone, also across the cut locus. Returns where it comes to rest.
template <class Space>
typename Space::Point descend(const PackedData<Space>& data, typename Space::Point y, int steps = 60,
                              double tolerance = 1e-5) {
  for (int i = 0; i < steps; ++i) {
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

}  // namespace detail
}  // namespace liestat
