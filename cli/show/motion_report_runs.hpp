// Runs of the filters over the frames of a report, from starts of its choice: the figures 7 to 10, 12 and 13.
#pragma once

#include <cli/show/motion_report.hpp>
#include <fusion/motion/structure.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace liestat::cli {

/// The way of a filter from its start.
struct MotionTrace {
  Eigen::Vector3d start = Eigen::Vector3d::Zero();
  std::vector<std::size_t> frames;
  std::vector<Eigen::Vector3d> directions;  ///< after each frame
  std::vector<double> evidence;             ///< of positive depths, in its standard deviations
};

/// Both interpretations of the points over the last frames of the window.
struct MotionInterpretation {
  std::vector<std::vector<StructurePoint>> points;  ///< by frame, the same tracks in each
  RigidityTest rigidity;
};

/// All runs are of images alone, with the midpoint flow; directions are velocities but for the essential filter.
struct MotionWindowRuns {
  MotionTrace winner;  ///< of the hypotheses the one that is best in the end
  /// With and without the sign of the depths, from the start farthest from the estimate of those that get there (or to its
  /// antipode).
  MotionTrace held, released;
  MotionTrace essential_held, essential_released;  ///< from the antipode of the estimate, with its rotation
  std::vector<std::size_t> frames;                 ///< of the structure
  MotionInterpretation rigid, rubbery;
  RigidityComparison comparison;
  std::vector<bool> inliers;  ///< of the last frame's pairs

  bool hasStructure() const { return rigid.rigidity.snapshots() > 1; }
};

/// The last frame: the direction of the velocity, and the rotation and the direction of the translation over the longest
/// interval of its pairs.
struct MotionReference {
  Eigen::Vector3d velocity = Eigen::Vector3d::UnitZ(), translation = Eigen::Vector3d::UnitZ();
  SO3d rotation;
  double interval = 1;  ///< frames
};

/// Pairs of this interval, each as one step: those of an epipolar constraint.
std::vector<PointPair> pairsOver(double interval, std::span<const PointPair> pairs);

/// The reference is what the starts are chosen by; the essential filter starts from its rotation and opposite translation.
MotionWindowRuns runMotionWindow(std::span<const MotionPairs> frames, const MotionFilterOptions& options,
                                 const MotionReference& reference);

}  // namespace liestat::cli
