// How did the camera move between two images? Matches in pixels, the cameras as far as they are known, and the answer:
// the model of the motion, its physical parameters with their covariance, and the matches that agree with it.
//
//   const TwoViewMotionEstimate found = estimateTwoViewMotion(matches, {.sigma = 1, .first = camera});
//   if (found.ok()) … found.chosenModel().name, found.physical, found.inlier, found.relative_pose …
//
// A match is (x, y, x', y') in pixels. Poses take points of the first camera to the second, x' = R x + t. The models are
// those of fusion/two_view/models.hpp; stats/hierarchy.hpp is the search, for whoever wants to look in between.
// docs/two_view.md has the models, what is promised, and the limits.
#pragma once

#include <fusion/camera.hpp>
#include <fusion/detail/compiled.hpp>
#include <fusion/two_view/models.hpp>
#include <fusion/two_view/pose.hpp>
#include <fusion/two_view/two_view_types.hpp>
#include <stats/hierarchy_types.hpp>
#include <stats/status.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace liestat {

/// Prior knowledge and the settings of the search.
struct TwoViewMotionOptions {
  double sigma = 1;  ///< standard deviation of each image coordinate, px
  /// The camera of the first image. Without it rotations and poses of calibrated views are no models, and the motion of a
  /// fundamental matrix has two unknown focal lengths.
  std::optional<Camera> first = {};
  /// The camera of the second image, if it is another one.
  std::optional<Camera> second = {};
  /// Width and height of both images, px. By default those of the cameras, else the bounding box of the matches, without
  /// coordinates that are far beyond all others. The centre of an image of unknown camera is the middle of this.
  std::optional<Eigen::Vector2d> image_size = {};
  std::vector<TwoViewNode> nodes = {};             ///< models beyond the default ones
  std::optional<TwoViewVerticals> verticals = {};  ///< in both cameras' frames; with them `upright` is a model
  bool planes_only = false;                        ///< the models of homographies alone: planes of a scene, one by one
  /// σ is right: errors beyond its threshold are then evidence for a more general model at once, and covariances are
  /// those of σ. Otherwise noise may be larger than stated, and the matches say by how much.
  bool noise_is_known = false;
  /// Standard deviations of what is given about the cameras: of the focal lengths, relative, and of the distortion k1. The
  /// covariances of the motion contain them, and are then larger than those of the matches; the estimate is that of the
  /// cameras as given. Where the matches speak for cameras that this excludes, the status is inconsistent. 0 takes them
  /// for known.
  double focal_length_sigma = 0, k1_sigma = 0;
  bool keep_contradictions = false;  ///< use matches that contradict each other, too (contradictions.hpp)
  HierarchyOptions search = {};
  StopRequest stop = {};  ///< true ends the search: the answer is what has been found so far
};

/// The estimate from matches in pixels. Equal matches count once. Matches that contradict each other take no part in it,
/// but may be inliers of what is found. Those that are not finite, or that no direction of a camera belongs to, are outliers
/// of all models. Nothing is thrown: the status says what is wrong. The same matches in another order give the same answer.
LIESTAT_FUSION_API TwoViewMotionEstimate estimateTwoViewMotion(std::span<const Eigen::Vector4d> matches,
                                                               const TwoViewMotionOptions& options);

/// Several motions: the matches that agree with the first are taken out, and the search runs again over the rest, until
/// chance explains what is found or there are `most` (stats/repeated_extraction.hpp). Each match belongs to the motion that
/// explains it best.
LIESTAT_FUSION_API TwoViewMotions estimateTwoViewMotions(std::span<const Eigen::Vector4d> matches,
                                                         const TwoViewMotionOptions& options, std::size_t most = 20);

/// The physical parameters of a model of the lattice by its name and its estimate, in the units of the matches that it
/// was estimated from: `unit` says how many px are one unit in each image. `matches` tell on which side of the cameras
/// points lie. Nothing for a model that is not of the lattice, or without a covariance.
LIESTAT_FUSION_API std::vector<PhysicalParameters> physicalParameters(const std::string& model,
                                                                      const ModelEstimate<TwoViewMotionModel>& estimate,
                                                                      std::span<const Eigen::Vector4d> matches,
                                                                      TwoViewCalibration calibration,
                                                                      const FocalLengths& unit);

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/two_view/detail/estimate_two_view_motion.hpp>
#include <fusion/two_view/detail/physical_parameters.hpp>
#endif
