// Definitions of fusion/motion/study.hpp.
#pragma once

#include <fusion/motion/essential_filter.hpp>
#include <fusion/motion/motion_filter.hpp>
#include <fusion/motion/search.hpp>
#include <fusion/motion/structure.hpp>
#include <fusion/motion/study.hpp>
#include <fusion/motion/subspace_filter.hpp>
#include <fusion/motion/track_pairs.hpp>
#include <lie/units.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <utility>
#include <vector>

namespace liestat {
namespace detail {

// The residual of one frame over the hemisphere about an estimate: figures 5, 6 and 11.

inline constexpr double grid_step = 3, not_there = std::numeric_limits<double>::quiet_NaN();  // degrees
inline constexpr int grid_half = 31;  // one step beyond the hemisphere, so that minima at its rim have all neighbours

/// Half the cost's second derivatives by differences, degrees⁻².
inline Eigen::Matrix2d curvature(const std::function<double(const Eigen::Vector2d&)>& cost, const Eigen::Vector2d& at) {
  const double h = 0.2;
  const auto f = [&](double x, double y) { return cost(at + h * Eigen::Vector2d(x, y)); };
  const double centre = f(0, 0), cross = 0.25 * (f(1, 1) - f(1, -1) - f(-1, 1) + f(-1, -1));
  Eigen::Matrix2d H;
  H << f(1, 0) + f(-1, 0) - 2 * centre, cross, cross, f(0, 1) + f(0, -1) - 2 * centre;
  return 0.5 / (h * h) * H;
}

/// A residual, even in the direction, of the pairs that are used.
struct DirectionResidual {
  std::function<double(const Eigen::Vector3d&)> cost;  ///< χ²
  double degrees_of_freedom = 1;
};

/// The subspace constraint's with the rotation eliminated; Flow::discrete: the essential constraint's, least over
/// rotations.
inline DirectionResidual residualOf(std::span<const PointPair> pairs, Flow flow, const SO3d& near) {
  DirectionResidual residual;
  residual.degrees_of_freedom = std::max(static_cast<double>(pairs.size()) - 3, 1.0);
  if (flow == Flow::discrete) {
    residual.cost = [pairs, near](const Eigen::Vector3d& T) { return essentialCostOverRotations(pairs, T, near).cost; };
    return residual;
  }
  const auto points = std::make_shared<std::vector<FlowPoint<double>>>();
  for (const PointPair& pair : pairs) points->push_back(flowOf(pair, flow));
  const auto rows = std::make_shared<std::vector<FlowRow<double>>>(points->size());
  residual.cost = [points, rows](const Eigen::Vector3d& V) { return subspaceCost(*points, V, *rows); };
  return residual;
}

/// The essential constraint's at one rotation.
inline DirectionResidual residualAtRotation(std::span<const PointPair> pairs, const SO3d& rotation) {
  DirectionResidual residual;
  residual.degrees_of_freedom = std::max(static_cast<double>(pairs.size()), 1.0);
  residual.cost = [pairs, rotation](const Eigen::Vector3d& T) { return essentialCost(pairs, rotation, T); };
  return residual;
}

inline ResidualMap residualMap(const DirectionResidual& residual, const HemisphereChart& chart) {
  const auto cost = [&](const Eigen::Vector2d& at) {
    const double value = residual.cost(chart.direction(at));
    return std::isfinite(value) ? value : std::numeric_limits<double>::infinity();
  };
  ResidualMap map;
  for (int k = -grid_half; k <= grid_half; ++k) {
    map.grid.x.push_back(grid_step * k), map.grid.y.push_back(grid_step * k);
  }
  const std::size_t n = map.grid.x.size();
  Eigen::Vector2d best = Eigen::Vector2d::Zero();
  double least = std::numeric_limits<double>::infinity();
  for (const double y : map.grid.y) {
    for (const double x : map.grid.x) {
      const Eigen::Vector2d at(x, y);
      const double value = at.norm() <= 90 + 1.5 * grid_step ? cost(at) : not_there;
      map.grid.value.push_back(value / residual.degrees_of_freedom);
      if (at.norm() <= 90 && value < least) least = value, best = at;
    }
  }
  const auto isMinimum = [&](std::size_t i, std::size_t j) {
    const double value = map.grid.at(i, j);
    for (const std::size_t b : {j - 1, j, j + 1}) {
      for (const std::size_t a : {i - 1, i, i + 1}) {
        if ((a != i || b != j) && !(map.grid.at(a, b) > value)) return false;
      }
    }
    return true;
  };
  std::vector<Eigen::Vector2d> minima;
  for (std::size_t j = 1; j + 1 < n; ++j) {
    for (std::size_t i = 1; i + 1 < n; ++i) {
      const Eigen::Vector2d at(map.grid.x[i], map.grid.y[j]);
      if (at.norm() <= 90 && at != best && isMinimum(i, j)) minima.push_back(at);
    }
  }
  for (std::size_t k = 0; k < map.grid.value.size(); ++k) {
    if (Eigen::Vector2d(map.grid.x[k % n], map.grid.y[k / n]).norm() >= 90) map.grid.value[k] = not_there;
  }
  // Between the directions of the grid, by ever smaller steps along the axes and diagonals.
  for (double step = 0.5 * grid_step; step > 1e-3;) {
    bool moved = false;
    for (const double x : {-1.0, 0.0, 1.0}) {
      for (const double y : {-1.0, 0.0, 1.0}) {
        const Eigen::Vector2d at = best + step * Eigen::Vector2d(x, y);
        const double value = cost(at);
        if (value < least) least = value, best = at, moved = true;
      }
    }
    if (!moved) step *= 0.5;
  }
  map.minimum = best, map.residual = least / residual.degrees_of_freedom;
  // A minimum at the rim is seen on both sides of it, and one between grid points may be lower at two of them.
  std::vector<Eigen::Vector3d> known{chart.direction(best)};
  for (const Eigen::Vector2d& at : minima) {
    const Eigen::Vector3d V = chart.direction(at);
    const bool is_known = std::any_of(known.begin(), known.end(), [&](const Eigen::Vector3d& other) {
      return std::abs(other.dot(V)) > std::cos(2 * grid_step * units::degree);
    });
    if (is_known) continue;
    known.push_back(V), map.others.push_back(at);
  }
  const Eigen::Matrix2d H = curvature(cost, best);
  if (H.allFinite() && H.determinant() > 0 && H.trace() > 0) map.covariance = H.inverse();
  return map;
}

// Runs of the filters from starts of choice: figures 7 to 10, 12 and 13.

/// A way that ends so near (5 degrees) has arrived.
inline constexpr double arrived = 0.9962;
/// Frames of the structure, at most; fewer where hardly any track is seen in all of them.
inline constexpr std::size_t max_snapshots = 25, enough_tracks = 14, min_tracks = 4;

template <class Filter, class Pairs>
MotionTrace traceOf(Filter& filter, std::span<const MotionPairs> frames, const Eigen::Vector3d& start,
                    const Pairs& of) {
  MotionTrace trace;
  trace.start = start;
  for (const MotionPairs& frame : frames) {
    const MotionEstimate& e = filter.update(of(frame));
    trace.frames.push_back(frame.frame);
    trace.directions.emplace_back(e.direction.mean.unit_vector());
    trace.evidence.push_back(e.sign_evidence);
  }
  return trace;
}

/// A single start that is not given up.
inline MotionTrace traceFrom(const Eigen::Vector3d& start, MotionFilterOptions options, bool positive_depth,
                             std::span<const MotionPairs> frames) {
  options.positive_depth = positive_depth, options.lost_innovation = std::numeric_limits<double>::infinity();
  SubspaceFilter filter(options);
  filter.start({S2d(start), Eigen::Matrix2d::Identity()});
  return traceOf(filter, frames, start, [](const MotionPairs& frame) { return std::span(frame.pairs); });
}

/// From the rubbery state of the estimate.
inline MotionTrace essentialTrace(const MotionFrameStudy& study, MotionFilterOptions options, bool positive_depth,
                                  std::span<const MotionPairs> frames) {
  options.positive_depth = positive_depth, options.lost_innovation = std::numeric_limits<double>::infinity();
  EssentialFilter filter(options);
  const Eigen::Vector3d opposite = -study.translation.mean.unit_vector();
  Gaussian<Essentiald> state;
  state.mean = Essentiald(study.rotation, S2d(opposite));
  state.covariance = 0.01 * Eigen::Matrix<double, 5, 5>::Identity();
  filter.start(state);
  std::vector<PointPair> steps;
  return traceOf(filter, frames, opposite, [&](const MotionPairs& frame) {
    pairsOver(study.interval, frame.pairs, steps);
    return std::span<const PointPair>(steps);
  });
}

/// The tracks that all of these frames have.
inline std::vector<std::uint64_t> commonTracks(std::span<const std::vector<StructurePoint>> frames) {
  std::map<std::uint64_t, std::size_t> seen;
  for (const auto& points : frames) {
    for (const StructurePoint& p : points) ++seen[p.track];
  }
  std::vector<std::uint64_t> common;
  for (const auto& [track, times] : seen) {
    if (times == frames.size()) common.push_back(track);
  }
  return common;
}

inline std::pair<MotionInterpretation, RigidityTest> interpretation(std::span<const std::vector<StructurePoint>> frames,
                                                                    std::span<const std::uint64_t> tracks) {
  MotionInterpretation result;
  RigidityTest rigidity;
  std::vector<Eigen::Vector3d> positions;
  for (const std::vector<StructurePoint>& points : frames) {
    std::vector<StructurePoint> common;
    positions.clear();
    for (const std::uint64_t track : tracks) {
      common.push_back(
          *std::find_if(points.begin(), points.end(), [&](const StructurePoint& p) { return p.track == track; }));
      positions.push_back(common.back().position());
    }
    rigidity.add(positions);
    result.points.push_back(std::move(common));
  }
  result.spread = rigidity.spread(), result.rotation = rigidity.rotation();
  return {std::move(result), std::move(rigidity)};
}

/// The study's velocity is what the starts are chosen by; the essential filter starts from its rotation and opposite
/// translation.
inline MotionWindowRuns runMotionWindow(std::span<const MotionPairs> frames, const MotionFilterOptions& given,
                                        const MotionFrameStudy& study) {
  const Eigen::Vector3d velocity = study.velocity.mean.unit_vector();
  MotionFilterOptions options = given;
  options.flow = Flow::midpoint, options.estimate_bias = false;
  MotionWindowRuns runs;
  SubspaceFilter filter(options);
  MotionStructure structure;
  std::vector<std::map<std::size_t, Eigen::Vector3d>> hypotheses;  // by frame, by start
  std::vector<std::vector<StructurePoint>> points, turned;
  for (const MotionPairs& frame : frames) {
    const MotionEstimate& motion = filter.update(frame.pairs);
    structure.update(frame.tracks, frame.pairs, filter.inverse_depths(), motion);
    points.push_back(structure.inFront()), turned.push_back(structure.turnedRound());
    hypotheses.emplace_back();
    for (const MotionHypothesis& h : filter.hypotheses()) {
      hypotheses.back().emplace(h.start, h.direction.unit_vector());
    }
  }
  for (const InverseDepth& depth : filter.inverse_depths()) runs.inliers.push_back(depth.inlier);

  const std::vector<Eigen::Vector3d> lattice = hemisphereLattice(std::max<std::size_t>(options.starts, 1));
  const auto left = filter.hypotheses();
  if (!left.empty()) {
    const auto best =
        std::min_element(left.begin(), left.end(), [](const auto& a, const auto& b) { return a.score < b.score; });
    runs.winner.start = lattice[best->start];
    for (std::size_t k = 0; k < frames.size(); ++k) {
      const auto at = hypotheses[k].find(best->start);
      if (at == hypotheses[k].end()) continue;
      runs.winner.frames.push_back(frames[k].frame), runs.winner.directions.push_back(at->second);
    }
  }
  // Starts by their distance, up to sign, the farthest first.
  std::vector<Eigen::Vector3d> starts = lattice;
  const auto nearness = [&](const Eigen::Vector3d& start) { return std::abs(start.dot(velocity)); };
  std::sort(starts.begin(), starts.end(),
            [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return nearness(a) < nearness(b); });
  for (const Eigen::Vector3d& start : starts) {
    runs.released = traceFrom(start, options, false, frames);
    const Eigen::Vector3d& end = runs.released.directions.back();
    if (nearness(end) < arrived && &start != &starts.back()) continue;
    // Costs do not tell a start from its antipode: from one of the two the filter ends at the rubbery state.
    const double side = end.dot(velocity) > 0 ? -1 : 1;
    const Eigen::Vector3d from = side * start;
    runs.released = traceFrom(from, options, false, frames), runs.held = traceFrom(from, options, true, frames);
    break;
  }
  runs.essential_held = essentialTrace(study, options, true, frames);
  runs.essential_released = essentialTrace(study, options, false, frames);

  // As many frames as have enough tracks in common.
  std::size_t n = std::min(max_snapshots, frames.size());
  const auto last = [&](const std::vector<std::vector<StructurePoint>>& all, std::size_t count) {
    return std::span(all).last(count);
  };
  while (n > 2 && commonTracks(last(points, n)).size() < enough_tracks) --n;
  const auto tracks = n > 1 ? commonTracks(last(points, n)) : std::vector<std::uint64_t>{};
  if (tracks.size() >= min_tracks) {
    for (const MotionPairs& frame : frames.last(n)) runs.frames.push_back(frame.frame);
    const bool behind = structure.meanInverseDepth() < 0;
    auto rigid = interpretation(last(behind ? turned : points, n), tracks);
    auto rubbery = interpretation(last(behind ? points : turned, n), tracks);
    runs.comparison = compareRigidity(rigid.second, rubbery.second);
    runs.rigid = std::move(rigid.first), runs.rubbery = std::move(rubbery.first);
  }
  return runs;
}

}  // namespace detail

LIESTAT_FUSION_INLINE MotionFrameStudy studyFrame(const MotionWindow& window, const MotionResult& result) {
  const MotionPairs& at = window.frames().back();
  MotionFrameStudy study;
  study.frame = at.frame, study.first_frame = window.frames().front().frame;
  study.motion = at.motion, study.min_pairs = result.settings.min_pairs;
  for (const PointPair& pair : at.pairs) study.interval = std::max(study.interval, pair.frames);
  MotionEstimate over = at.motion;
  over.rotation.mean = study.rotation = SO3d::exp(Eigen::Vector3d(study.interval * at.motion.rotation.mean.log()));
  study.velocity = velocityDirection(at.motion), study.translation = translationDirection(over);
  const auto of = std::find_if(result.frames.begin(), result.frames.end(),
                               [&](const MotionFrame& frame) { return frame.frame == at.frame; });
  if (of != result.frames.end() && of->truth && of->direction_error) {
    study.true_velocity = of->truth->velocity.normalized();
    const Eigen::Vector3d turn = study.interval * of->truth->rotation;
    study.true_translation = (SO3d::leftJacobian(turn) * *study.true_velocity).normalized();
  }
  study.runs = detail::runMotionWindow(window.frames(), result.settings, study);
  for (std::size_t i = 0; i < at.pairs.size(); ++i) {
    if (i < study.runs.inliers.size() && study.runs.inliers[i]) study.pairs.push_back(at.pairs[i]);
  }
  pairsOver(study.interval, study.pairs, study.whole);
  if (!study.hasMaps()) return study;
  const auto mapOf = [&](const detail::DirectionResidual& residual, const Gaussian<S2d>& centre) {
    return detail::residualMap(residual, HemisphereChart(centre.mean.unit_vector()));
  };
  study.forward = mapOf(detail::residualOf(study.pairs, Flow::forward, study.rotation), study.velocity);
  study.midpoint = mapOf(detail::residualOf(study.pairs, Flow::midpoint, study.rotation), study.velocity);
  study.discrete = mapOf(detail::residualOf(study.whole, Flow::discrete, study.rotation), study.translation);
  study.essential = mapOf(detail::residualAtRotation(study.whole, study.rotation), study.translation);
  return study;
}

}  // namespace liestat
