// The figures of one frame of a sequence (Soatto and Perona 1994, figures 5 to 13) as numbers: the residual over the
// hemisphere of directions, the ways of the filters from starts of choice, and both interpretations of the structure.
// fusion/motion/study.hpp computes them.
#pragma once

#include <fusion/motion/results.hpp>
#include <fusion/motion/types.hpp>
#include <lie/manifold.hpp>
#include <lie/units.hpp>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

namespace liestat {

/// The pairs of one frame, the track of each, and the filter's estimate in their unit of time.
struct MotionPairs {
  std::size_t frame = 0;
  MotionEstimate motion;
  std::vector<PointPair> pairs;
  std::vector<std::uint64_t> tracks;
};

/// The frames that the figures of one moment are made of: the last sixty up to the one that is looked at.
class MotionWindow {
 public:
  static constexpr std::size_t last_frame = std::numeric_limits<std::size_t>::max(), max_frames = 60;

  /// Looks at the frame of this number, or at the last one.
  explicit MotionWindow(std::size_t looked_at = last_frame) : looked_at_(looked_at) {}

  /// The next frame; one whose number is not larger begins anew.
  void add(std::size_t frame, std::span<const PointPair> pairs, std::span<const std::uint64_t> tracks,
           const MotionEstimate& motion) {
    if (frame <= newest_) frames_.clear();
    newest_ = frame;
    if (frame > looked_at_) return;
    if (frames_.size() == max_frames) frames_.erase(frames_.begin());
    frames_.push_back({frame, motion, {pairs.begin(), pairs.end()}, {tracks.begin(), tracks.end()}});
  }
  std::span<const MotionPairs> frames() const { return frames_; }
  std::size_t looked_at() const { return looked_at_; }
  /// True once the frame that is looked at has come.
  bool has_looked_at() const {
    return !frames_.empty() && (looked_at_ == last_frame || frames_.back().frame == looked_at_);
  }

 private:
  std::size_t looked_at_, newest_ = 0;
  std::vector<MotionPairs> frames_;
};

/// Directions about a centre as points of a plane, in degrees: the tangent coordinates of the great circle from the
/// centre (axes as those of its covariance). A direction of the other hemisphere has those of its antipode.
class HemisphereChart {
 public:
  explicit HemisphereChart(const Eigen::Vector3d& centre) : centre_(centre) {}

  bool holds(const Eigen::Vector3d& direction) const { return direction.dot(centre_.unit_vector()) >= 0; }
  Eigen::Vector2d operator()(const Eigen::Vector3d& direction) const {
    const Eigen::Vector3d near = holds(direction) ? direction : Eigen::Vector3d(-direction);
    return log(centre_, S2d(near)) / units::degree;
  }
  Eigen::Vector3d direction(const Eigen::Vector2d& coordinates) const {
    return exp(centre_, Eigen::Vector2d(units::degree * coordinates)).unit_vector();
  }

 private:
  S2d centre_;
};

/// Values on a grid, row by row.
struct ResidualGrid {
  std::vector<double> x = {}, y = {}, value = {};
  double at(std::size_t column, std::size_t row) const { return value[row * x.size() + column]; }
};

/// The residual of one frame over a hemisphere, per degree of freedom.
struct ResidualMap {
  ResidualGrid grid;                                  ///< degrees; NaN beyond the hemisphere
  Eigen::Vector2d minimum = Eigen::Vector2d::Zero();  ///< degrees
  double residual = 0;                                ///< there
  std::optional<Eigen::Matrix2d> covariance;          ///< degrees², from the curvature there; none if it has none
  std::vector<Eigen::Vector2d> others;                ///< other local minima, on the grid
};

/// The way of a filter from its start.
struct MotionTrace {
  Eigen::Vector3d start = Eigen::Vector3d::Zero();
  std::vector<std::size_t> frames;
  std::vector<Eigen::Vector3d> directions;  ///< after each frame
  std::vector<double> evidence;             ///< evidence for positive depths, in its standard deviations
};

/// One interpretation of the points over the last frames of the window.
struct MotionInterpretation {
  std::vector<std::vector<StructurePoint>> points;     ///< by frame, the same tracks in each
  double spread = 0;                                   ///< RigidityTest::spread
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  ///< RigidityTest::rotation
};

/// All runs are of images alone, with the midpoint flow; directions are velocities but for the essential filter.
struct MotionWindowRuns {
  MotionTrace winner;  ///< the hypothesis that is best in the end
  /// With and without the sign of the depths, from the start farthest from the estimate of those that get there (or to
  /// its antipode).
  MotionTrace held, released;
  MotionTrace essential_held, essential_released;  ///< from the antipode of the estimate, with its rotation
  std::vector<std::size_t> frames;  ///< frames of the structure; none: no four tracks have a depth in two frames
  MotionInterpretation rigid, rubbery;
  RigidityComparison comparison;
  std::vector<bool> inliers;  ///< inliers among the last frame's pairs

  bool hasStructure() const { return !frames.empty(); }
};

/// The frame that is looked at.
struct MotionFrameStudy {
  std::size_t frame = 0, first_frame = 0;  ///< that one, and the first one of the window
  MotionEstimate motion;                   ///< in the unit of time of the pairs
  double interval = 1;                     ///< frames, the longest of the pairs'
  SO3d rotation;                           ///< over it, as the translations
  Gaussian<S2d> velocity, translation;
  std::optional<Eigen::Vector3d> true_velocity, true_translation;
  std::vector<PointPair> pairs, whole;  ///< without outliers; those over the interval, as one step
  std::size_t min_pairs = 0;            ///< that the maps need
  MotionWindowRuns runs;
  /// The subspace constraint's residual with forward and midpoint flow; the essential constraint's, least over
  /// rotations (discrete), and at the rotation of the estimate. Empty where there are too few pairs.
  ResidualMap forward, midpoint, discrete, essential;

  std::size_t usablePairs() const { return pairs.size() < whole.size() ? pairs.size() : whole.size(); }
  bool hasMaps() const { return usablePairs() >= min_pairs; }
  const Gaussian<S2d>& directionOf(Flow flow) const { return flow == Flow::discrete ? translation : velocity; }
  const std::optional<Eigen::Vector3d>& truthOf(Flow flow) const {
    return flow == Flow::discrete ? true_translation : true_velocity;
  }
};

}  // namespace liestat
