// All minima of the criterion of a mean on a circle, for stats/uniqueness.hpp.
#pragma once

#include <stats/detail/search_space.hpp>
#include <stats/mean.hpp>
#include <stats/uniqueness_types.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <ranges>
#include <utility>
#include <vector>

namespace liestat::detail {

/// SO(2), Frame2 and RxSO2: with the angles from the mean in order, the minimum over all ways to unroll the circle is the
/// minimum of C, since C(y) is the least of their parabolas; n of them matter. Exact up to rounding, O(n log n).
template <Metric M, Executor E, class R, class W>
UniquenessResult<M> circleUniqueness(const E& executor, const R& samples, const W& weights,
                                     const MeanResult<M>& mean_result, const UniquenessOptions& options) {
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
    const double angle = relativeAngle(to_mean, M(samples[i]));
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
    v[T::compact_begin] = ScalarOf<M>(angle);
    return exp(mean_result.mean, v);
  };
  const auto polished = [&](double angle) {
    MeanOptions<M> start;
    start.start = at(angle);
    return detail::frechetMean<M>(executor, samples, weights, start);
  };

  // The given mean is one of the candidates, or else it is no minimum.
  double chosen = best->angle;
  for (const Candidate& c : candidates) {
    if (c.cost <= limit && std::abs(c.angle) < std::abs(chosen)) chosen = c.angle;
  }
  if (std::abs(chosen) > 1e-6 || !converged(mean_result.status)) {
    const MeanResult<M> better = polished(chosen);
    result.minimiser = better.mean;
    result.cost = better.cost;
    result.improved = better.cost < mean_result.cost || !converged(mean_result.status);
    if (!converged(better.status)) return result;
  }
  std::vector<double> rival_angles;
  for (const Candidate& c : candidates) {
    if (c.cost > limit || apart(c.angle, chosen) < 1e-6) continue;
    if (std::any_of(rival_angles.begin(), rival_angles.end(), [&](double a) { return apart(a, c.angle) < 1e-6; })) {
      continue;
    }
    rival_angles.push_back(c.angle);
    result.more_rivals = result.rivals.size() >= options.max_rivals;
    if (result.more_rivals) break;
    result.rivals.push_back(polished(c.angle).mean);
  }
  largest = 0;
  for (const auto& [angle, p] : data) largest = std::max(largest, apart(angle, chosen));
  result.r_star = pi - largest;
  result.unique = result.rivals.empty() ? Uniqueness::unique : Uniqueness::ambiguous;
  result.proof = result.rivals.empty() ? "all minima on the circle were compared" : "several minima of equal cost";
  return result;
}

}  // namespace liestat::detail
