// Definitions of fusion/trajectory_misfit.hpp; docs/evaluate.md, "Misfit before statistics".
#pragma once

#include <fusion/trajectories/detail/misfit_dependence.hpp>
#include <fusion/trajectories/detail/misfit_finder.hpp>
#include <fusion/trajectories/detail/misfit_starts.hpp>
#include <fusion/trajectories/detail/misfit_words.hpp>
#include <fusion/trajectory_misfit.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <utility>

namespace liestat {

namespace detail {

inline MisfitSearch MisfitFinder::find() {
  MisfitSearch search;
  constexpr std::size_t least_poses = 20;
  if (has_clock_) keepRows(nodesAt(0).there);
  if (size() < least_poses) {
    search.reason = "fewer than 20 poses";
    return search;
  }
  Eigen::Vector3d low = reference_[0].translation(), high = low;
  for (const SE3d& T : reference_) {
    centre_ += T.translation() / static_cast<double>(size());
    low = low.cwiseMin(T.translation()), high = high.cwiseMax(T.translation());
  }
  const MisfitMatrix6 between = has_clock_ ? stream_.interpolationError() : MisfitMatrix6(MisfitMatrix6::Zero());
  const double extent = std::max((high - low).norm(), 1e-3 * high.norm());
  floor_t_ = std::max(1e-18 + 1e-18 * extent * extent, between.topLeftCorner<3, 3>().trace() / 3);
  floor_r_ = std::max(1e-18, between.bottomRightCorner<3, 3>().trace() / 3);

  // Readings, then the clock of each.
  struct Candidate {
    MisfitReading reading;
    std::vector<SE3d> read;
    MisfitFit fit;
    MisfitNoise noise = {};
    double cost = 0, least = 0;  // -2 log likelihood of the fit under its noise, and the squares that it leaves
  };
  std::vector<std::size_t> all(size()), some;
  std::iota(all.begin(), all.end(), std::size_t{0});
  const MisfitMask everything = maskOf(15), but_clock = maskOf(14);
  MisfitNodes still = nodesAt(0);
  std::vector<Candidate> candidates;
  const auto middle = [&](const std::vector<SE3d>& read, const MisfitNodes& nodes, MisfitFit fit, bool of_world) {
    // The pose in the middle agrees.
    const std::size_t i = size() / 2;
    const SE3d T = nodes.poses[i], M = posed(read[i], fit);
    if (of_world) {
      fit.world = T * M.inverse() * fit.world;
    } else {
      fit.body = fit.body * M.inverse() * T;
    }
    return fit;
  };
  for (auto& [reading, start] : starts(still)) {
    Candidate c{reading, readAll(reading), start};
    c.fit = fitted(reading, c.read, start, but_clock, still, all, nullptr, 10);
    if (reading.rotation_inverse && reading.position_inverse) {
      candidates.push_back(c);
      candidates.back().reading.local_noise = true;
    }
    candidates.push_back(std::move(c));
  }
  Candidate& as_read = candidates.back();
  for (const bool of_world : {false, true}) {
    const MisfitFit other = fitted(as_read.reading, as_read.read, middle(as_read.read, still, {}, of_world), but_clock,
                                   still, all, nullptr, 10);
    if (other.cost < as_read.fit.cost) as_read.fit = other;
  }
  const auto cheaper = [](const Candidate& a, const Candidate& b) { return a.fit.cost < b.fit.cost; };
  if (has_clock_) {
    const std::size_t every = 1 + size() / 80;
    for (std::size_t i = 0; i < size(); i += every) some.push_back(i);
    constexpr double range = 1, step = 0.04;  // s
    // The delay of the likeliest reading serves the others, which are as good only if they turn alike.
    std::vector<Candidate*> scanned{&*std::min_element(candidates.begin(), candidates.end(), cheaper)};
    if (scanned[0] != &as_read) scanned.push_back(&as_read);
    std::vector<double> least(scanned.size(), infinity);
    std::vector<MisfitFit> found(scanned.size());
    for (double delay = -range; delay < range + 0.5 * step; delay += step) {
      const MisfitNodes nodes = nodesAt(delay, every);
      std::vector<std::size_t> rows;
      for (const std::size_t i : some) {
        if (nodes.there[i]) rows.push_back(i);
      }
      if (2 * rows.size() < some.size()) continue;
      for (std::size_t k = 0; k < scanned.size(); ++k) {
        MisfitFit fit = scanned[k]->fit;
        fit.delay = delay;
        fit = fitted(scanned[k]->reading, scanned[k]->read, fit, but_clock, nodes, rows, nullptr, 3);
        if (const double mean = fit.cost / static_cast<double>(rows.size()); mean < least[k]) {
          least[k] = mean, found[k] = fit;
        }
      }
    }
    std::vector<bool> there = still.there;
    for (std::size_t k = 0; k < scanned.size(); ++k) {
      if (!std::isfinite(least[k])) continue;
      const MisfitNodes nodes = nodesAt(found[k].delay);
      for (std::size_t i = 0; i < size(); ++i) there[i] = there[i] && nodes.there[i];
      for (Candidate& c : candidates) {
        if (&c == scanned[k]) c.fit = found[k];
        if (k == 0 && &c != &as_read) c.fit.delay = found[0].delay;
      }
    }
    if (static_cast<std::size_t>(std::count(there.begin(), there.end(), true)) < least_poses) {
      search.reason = "fewer than 20 poses at the times of both clocks";
      return search;
    }
    keepRows(there);
    all.resize(size());
    still = nodesAt(0);
    for (Candidate& c : candidates) {
      c.read = readAll(c.reading);
      c.fit = timedFit(c.reading, c.read, c.fit, everything, all, nullptr, 8);
    }
  }
  const Candidate& best = *std::min_element(candidates.begin(), candidates.end(), cheaper);
  search.poses = size();
  std::vector<MisfitRow> rows;
  const auto rowsOf = [&](const Candidate& c, const MisfitNoise& noise) {
    linearise(c.reading, c.read, c.fit, nodesAt(c.fit.delay), all, rows, &noise);
    return rows;
  };
  MisfitNoise walk = gapsOf();
  walk.relative = true;
  // Drift may suit other readings better than the poses as they are; its noise does not.
  auto [likelihood, noise] = noiseOf(rowsOf(best, gapsOf()), rowsOf(best, walk));
  if (&best != &as_read) {
    const auto [other, noise_of] = noiseOf(rowsOf(as_read, gapsOf()), rowsOf(as_read, walk));
    if (other > likelihood) noise = noise_of;
  }
  std::erase_if(candidates, [&, most = best.fit.cost + 60](const Candidate& c) {
    return c.fit.cost > most && !c.reading.faults().empty();
  });
  for (Candidate& c : candidates) {
    c.noise = noise;
    c.cost = scatter(c.noise, rowsOf(c, c.noise));
    c.fit = timedFit(c.reading, c.read, c.fit, everything, all, &c.noise, 6);
    c.least = c.fit.cost;
  }

  // All subsets of faults under this noise.
  struct Explained {
    const Candidate* of;
    unsigned groups;
    MisfitFit fit;
    std::vector<Misfit> faults;
    double penalty, cost;
  };
  // Penalties are quantiles of χ² with as many degrees of freedom at 1e-4, and for a reading the number of readings.
  constexpr double of_reading = 14, of_one = 15.1, of_six = 27.9;
  const double freedom = 6 * static_cast<double>(size()) - misfit_parameters;
  const auto penaltyOf = [&](const Candidate& c, unsigned groups) {
    return of_reading * static_cast<double>(c.reading.faults().size()) + of_one * std::popcount(groups & 3u) +
           of_six * std::popcount(groups & 12u);
  };
  const auto ratio = [&](const Candidate& c, double squares) { return c.cost + freedom * std::log(squares / c.least); };
  std::vector<std::pair<const Candidate*, unsigned>> tries;
  for (const Candidate& c : candidates) {
    for (unsigned groups = 0; groups < 16; ++groups) {
      if ((groups & ~suspects()) == 0) tries.push_back({&c, groups});
    }
  }
  std::stable_sort(tries.begin(), tries.end(), [&](const auto& a, const auto& b) {
    return penaltyOf(*a.first, a.second) < penaltyOf(*b.first, b.second);
  });
  std::vector<Explained> explained;
  double lowest = infinity;
  for (const auto& [of, groups] : tries) {
    const Candidate& c = *of;
    // An explanation that costs more than the best one is not better, and not simpler.
    if (c.cost + penaltyOf(c, groups) > lowest + 1) continue;
    const MisfitMask mask = maskOf(groups);
    MisfitFit start;
    if (groups & 1) start.delay = c.fit.delay;
    if (mask[1]) start.scale = c.fit.scale;
    const MisfitNodes nodes = groups & 1 ? nodesAt(c.fit.delay) : still;
    std::vector<MisfitFit> from{start};
    const bool world = mask[8], body = (groups & 4) != 0;
    if (body && world) {
      start.body = c.fit.body, start.world = c.fit.world;
      from.push_back(start);
    }
    if (world && mask[11]) from.push_back(middle(c.read, nodes, from[0], true));
    if (body) from.push_back(middle(c.read, nodes, from[0], false));
    MisfitFit fit;
    for (const MisfitFit& x : from) {
      const MisfitFit now = groups & 1 ? timedFit(c.reading, c.read, x, mask, all, &c.noise, 6)
                                       : fitted(c.reading, c.read, x, mask, still, all, &c.noise, 8);
      if (now.cost < fit.cost) fit = now;
    }
    if (!std::isfinite(fit.cost)) continue;
    Explained e{&c, groups, fit, c.reading.faults(), penaltyOf(c, groups), ratio(c, fit.cost)};
    for (const auto& [bit, fault] : {std::pair(1u, Misfit::clock), std::pair(2u, Misfit::scale),
                                     std::pair(4u, Misfit::body), std::pair(8u, Misfit::world)}) {
      if (groups & bit) e.faults.push_back(fault);
    }
    lowest = std::min(lowest, e.cost + e.penalty);
    explained.push_back(std::move(e));
  }
  search.searched = true, search.reason.clear();
  std::stable_sort(explained.begin(), explained.end(),
                   [&](const Explained& a, const Explained& b) { return a.cost + a.penalty < b.cost + b.penalty; });
  // Errors as users see them: plain least squares.
  const auto plain = [&](const Explained& e) {
    const MisfitNodes nodes = nodesAt(e.fit.delay);
    const MisfitFit fit = fitted(e.of->reading, e.of->read, e.fit, maskOf(e.groups), nodes, all, nullptr, 8);
    std::vector<MisfitRow> left;
    linearise(e.of->reading, e.of->read, fit, nodes, all, left);
    const auto [t, r] = meanSquares(left);
    return std::pair(t - floor_t_, r - floor_r_);
  };
  const auto as_is = std::find_if(explained.begin(), explained.end(), [](const auto& e) { return e.faults.empty(); });
  if (as_is == explained.end()) return search;
  const auto [before_t, before_r] = plain(*as_is);
  search.position_rmse = std::sqrt(3 * before_t), search.rotation_rmse = std::sqrt(3 * before_r);
  if (explained.front().faults.empty()) return search;
  // Less than this share of the errors is no explanation of them. Of errors that drift another frame of body or world
  // always explains the most.
  constexpr double least_share = 0.1, least_share_of_drift = 0.98, indistinguishable = 9;
  const double record = times_.back() - times_.front();
  const bool drifts = noise.relative || std::any_of(noise.time_constant.begin(), noise.time_constant.end(),
                                                    [&](double tau) { return tau > 0.05 * record; });
  const double of_first = explained.front().cost;
  const auto parameters = [](const Explained& e) {
    return std::popcount(e.groups & 3u) + 6 * std::popcount(e.groups & 12u);
  };
  for (const Explained& e : explained) {
    const auto contains = [&](const MisfitExplanation& x) {
      return std::all_of(x.faults.begin(), x.faults.end(),
                         [&](Misfit f) { return std::find(e.faults.begin(), e.faults.end(), f) != e.faults.end(); });
    };
    // Some of the first one's parameters may only be there because the noise pays for them.
    const int fewer = parameters(explained.front()) - parameters(e);
    const double limit = indistinguishable + 2.5 * std::max(0, fewer);
    if (!search.explanations.empty() &&
        (e.cost - of_first > limit || e.faults.size() > explained.front().faults.size() ||
         std::any_of(search.explanations.begin(), search.explanations.end(), contains))) {
      continue;
    }
    const auto [t, r] = plain(e);
    MisfitExplanation x;
    x.faults = e.faults;
    x.explained = 1 - 2 / ((before_t + floor_t_) / (t + floor_t_) + (before_r + floor_r_) / (r + floor_r_));
    x.position_rmse = std::sqrt(3 * t), x.rotation_rmse = std::sqrt(3 * r);
    if (x.explained < (drifts && (e.groups & 12) != 0 ? least_share_of_drift : least_share)) {
      if (search.explanations.empty()) return search;
      continue;
    }
    Eigen::Matrix<double, misfit_parameters, misfit_parameters> information;
    const MisfitFit fit = fitted(e.of->reading, e.of->read, e.fit, maskOf(e.groups), nodesAt(e.fit.delay), all,
                                 &e.of->noise, 2, &information);
    const auto covariance = Cholesky<double, misfit_parameters>(information).inverse();
    x.delay = e.groups & 1 ? fit.delay : 0, x.scale = fit.scale, x.body = fit.body, x.world = fit.world;
    if (e.groups & 1) x.delay_sigma = std::sqrt(covariance(0, 0));
    if (maskOf(e.groups)[1]) x.scale_sigma = x.scale * std::sqrt(covariance(1, 1));
    x.rotation_axes_left = e.of->reading.A, x.rotation_axes_right = e.of->reading.B, x.position_axes = e.of->reading.C;
    search.explanations.push_back(std::move(x));
  }
  return search;
}

}  // namespace detail

LIESTAT_FUSION_INLINE MisfitSearch findMisfit(std::span<const SE3d> estimate, std::span<const SE3d> reference,
                                              std::span<const double> times, const PoseStream& stream,
                                              AlignmentModel alignment, double offset) {
  MisfitSearch none;
  none.reason = "not as many poses in both";
  if (estimate.size() != reference.size()) return none;
  MisfitSearch search = detail::MisfitFinder(estimate, reference, times, stream, alignment).find();
  for (MisfitExplanation& e : search.explanations) e.offset = offset + e.delay;
  return search;
}

}  // namespace liestat
