#include <cli/show/motion_report_runs.hpp>

#include <fusion/motion/essential_filter.hpp>
#include <fusion/motion/search.hpp>
#include <fusion/motion/subspace_filter.hpp>

#include <algorithm>
#include <map>

namespace liestat::cli {
namespace {

/// A way that ends so near (5 degrees) has arrived.
constexpr double arrived = 0.9962;
/// Frames of the structure, at most; fewer where hardly any track is seen in all of them.
constexpr std::size_t most_snapshots = 25, enough_tracks = 14, fewest_tracks = 4;

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
MotionTrace traceFrom(const Eigen::Vector3d& start, MotionFilterOptions options, bool positive_depth,
                      std::span<const MotionPairs> frames) {
  options.positive_depth = positive_depth, options.lost_innovation = std::numeric_limits<double>::infinity();
  SubspaceFilter filter(options);
  filter.start({S2d(start), Eigen::Matrix2d::Identity()});
  return traceOf(filter, frames, start, [](const MotionPairs& frame) { return std::span(frame.pairs); });
}

/// From the rubbery state of the estimate.
MotionTrace essentialTrace(const MotionReference& reference, MotionFilterOptions options, bool positive_depth,
                           std::span<const MotionPairs> frames) {
  options.positive_depth = positive_depth, options.lost_innovation = std::numeric_limits<double>::infinity();
  EssentialFilter filter(options);
  const Eigen::Vector3d opposite = -reference.translation;
  Gaussian<Essentiald> state;
  state.mean = Essentiald(reference.rotation, S2d(opposite));
  state.covariance = 0.01 * Eigen::Matrix<double, 5, 5>::Identity();
  filter.start(state);
  return traceOf(filter, frames, opposite,
                 [&](const MotionPairs& frame) { return pairsOver(reference.interval, frame.pairs); });
}

/// The tracks that all of these frames have.
std::vector<std::uint64_t> commonTracks(std::span<const std::vector<StructurePoint>> frames) {
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

MotionInterpretation interpretation(std::span<const std::vector<StructurePoint>> frames,
                                    std::span<const std::uint64_t> tracks) {
  MotionInterpretation result;
  std::vector<Eigen::Vector3d> positions;
  for (const std::vector<StructurePoint>& points : frames) {
    std::vector<StructurePoint> common;
    positions.clear();
    for (const std::uint64_t track : tracks) {
      common.push_back(
          *std::find_if(points.begin(), points.end(), [&](const StructurePoint& p) { return p.track == track; }));
      positions.push_back(common.back().position());
    }
    result.rigidity.add(positions);
    result.points.push_back(std::move(common));
  }
  return result;
}

}  // namespace

std::vector<PointPair> pairsOver(double interval, std::span<const PointPair> pairs) {
  std::vector<PointPair> whole;
  for (const PointPair& pair : pairs) {
    if (pair.frames != interval) continue;
    whole.push_back(pair);
    whole.back().frames = 1;
  }
  return whole;
}

MotionWindowRuns runMotionWindow(std::span<const MotionPairs> frames, const MotionFilterOptions& given,
                                 const MotionReference& reference) {
  const Eigen::Vector3d& velocity = reference.velocity;
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
  runs.essential_held = essentialTrace(reference, options, true, frames);
  runs.essential_released = essentialTrace(reference, options, false, frames);

  // As many frames as have enough tracks in common.
  std::size_t n = std::min(most_snapshots, frames.size());
  const auto last = [&](const std::vector<std::vector<StructurePoint>>& all, std::size_t count) {
    return std::span(all).last(count);
  };
  while (n > 2 && commonTracks(last(points, n)).size() < enough_tracks) --n;
  const auto tracks = n > 1 ? commonTracks(last(points, n)) : std::vector<std::uint64_t>{};
  if (tracks.size() >= fewest_tracks) {
    for (const MotionPairs& frame : frames.last(n)) runs.frames.push_back(frame.frame);
    const bool behind = structure.meanInverseDepth() < 0;
    runs.rigid = interpretation(last(behind ? turned : points, n), tracks);
    runs.rubbery = interpretation(last(behind ? points : turned, n), tracks);
    runs.comparison = compareRigidity(runs.rigid.rigidity, runs.rubbery.rigidity);
  }
  return runs;
}

}  // namespace liestat::cli
