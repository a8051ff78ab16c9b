// Lower bounds of the criterion of a Fréchet mean in a ball, and how far about a critical point it is known to be convex
// or larger than a threshold. The facts behind them are in stats/detail/branch_and_bound.hpp.
#pragma once

#include <stats/detail/packed_data.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

namespace liestat::detail {

/// Bounds from one pass over the data on the ball of radius ρ about a point.
struct BallBound {
  double lower = 0;       ///< lower bound of the criterion in the ball
  double centre = 0;      ///< the criterion at the centre; with bins, at least it
  std::size_t looks = 0;  ///< at data and bins
};

/// Bound of C(y) = ½ Σ p θ² in the ball of radius ρ about y.
template <class Space>
BallBound boundInBall(const PackedData<Space>& data, const TransverseTable<Space>& g, const typename Space::Point& y,
                      double rho) {
  double centre = 0, lipschitz = 0, mixed = 0, curvature = 0;
  std::size_t looks = 0;
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  const auto add = [&](const auto& self, const typename PackedData<Space>::Item& item) -> void {
    const Sighting s = data.space.see(y, item.point);
    ++looks;
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
  return {std::max(lipschitz, mixed), centre, looks};
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
  constexpr double grid = 0.004, min_gap = 1e-9, steps_an_octave = 32;
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
      const double octaves = std::log2(std::max(s.gap(), min_gap) / min_gap);
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
    const double gap = down > 0 ? min_gap * std::exp2(down / steps_an_octave) : 0;
    p.items.push_back({angle, angle + gap, weight});
  }
  p.mean_angle /= p.weight;
  p.slope = gradient.norm();
  return p;
}

/// r* of docs/theory/means.md, section 5.2: the criterion is strictly convex along every geodesic of length r* from the
/// point.
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
  if (!(high > 0)) return 0;
  // No datum's term is concave before its cut locus.
  if constexpr (Space::convex_to_cut_locus) return high;
  if (!convex(0)) return 0;
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

}  // namespace liestat::detail
