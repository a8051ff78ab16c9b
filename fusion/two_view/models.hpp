// The models of the motion between two views as a hierarchy (stats/hierarchy.hpp): what a match obeys under each, what it
// leaves free, and which contains which (Viéville, Lingrand and Gaspard 2000, section 7).
//
//   name                  equation      with                         free  sample  contains
//   none                  ũ' ~ H ũ      H = I                        0     0       -
//   retinal translation                 H = [I τ; 0 1]               2     1       none
//   zoom                                H = diag(s, s, 1)            1     1       none
//   retinal displacement                H = [Q τ; 0 1], Q Qᵀ = I     3     2       retinal translation
//   rotation                            H Hᵀ = I                     3     2       none
//   homography                          ‖H‖² = 3                     8     4       retinal displacement, zoom, rotation
//   translation           ũ'ᵀ F ũ = 0   F = [t]×, ‖F‖² = 2           2     2       retinal translation, zoom
//   essential                           F = [t]× R, |t| = 1          5     5       translation, rotation, retinal displ.
//   fundamental                         det F = 0, ‖F‖² = 2          7     7       essential, homography, zoom, transl.
//
// The parameter is the nine entries of the matrix, column after column, under those constraints, as in the report; of
// `essential` it is the pose, a point of Essential, with the tangent (direction, rotation).
//
// `essential` does not contain `homography`: a homography of a plane in two views of one camera obeys more than that.
// Coordinates are normalised, u = (p - c)/f; the models below homography and fundamental but for retinal translation and
// displacement mean something only then.
//
// Optional models (TwoViewModelOptions); a model that is left out is replaced by those that it contains:
//
//   name                  equation      with                         free  sample  contains
//   free zoom             ũ' ~ H ũ      H = [s I τ; 0 1]             3     2       retinal translation, zoom
//   similarity                          H = [s Q τ; 0 1]             4     2       retinal displacement, free zoom
//   affine                              H = [A τ; 0 1]               6     3       similarity
//   rotation and zoom                   H = diag(r, r, 1) R          4     2       rotation, zoom
//   affine epipolar       ũ'ᵀ F ũ = 0   F11 = F12 = F21 = F22 = 0    4     4       affine
//   upright                             F = [t]× R, R g = g'         3     3       none; translation if g = g'
//   shared focal length                 F = K⁻ᵀ [t]× R K⁻¹           6     7       essential
//
// Homography contains affine and rotation and zoom, fundamental contains affine epipolar and shared focal length,
// translation contains free zoom, and essential contains upright and similarity: a plane parallel to the image, seen by a
// camera that moves and turns about its axis. Uncalibrated shared focal length contains translation and similarity.
// Free zoom holds at s = 1, too, where its centre is at infinity: a retinal translation is one of it, not a limit.
//
// Upright needs the verticals g, g' in both cameras' frames, which it takes as exact. Shared focal length, K = diag(f, f,
// 1), has no estimate (Status::not_applicable) where the matches do not tell f: the optical axes meet within three
// standard deviations or are parallel, a plane explains nine tenths of the matches, or log f is not told to 0.1. Six
// matches would determine it; its samples have seven (fusion/two_view/shared_focal.hpp).
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/two_view/errors.hpp>
#include <lie/essential.hpp>
#include <stats/hierarchy_types.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <memory>
#include <optional>
#include <vector>

namespace liestat {

/// The parameter of a model of two-view motion: H or F, and for `essential`, `upright` and `shared focal length` the pose
/// that it belongs to.
struct TwoViewMotionModel {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  Essentiald pose = Essentiald();  ///< second_T_first up to scale, on the side that most matches lie in front of
  double focal_length = 1;         ///< f of both views in the unit of the matches, for `shared focal length`
};

using TwoViewModel = HierarchyModel<Eigen::Vector4d, TwoViewMotionModel>;

/// Noise and size of the images, as the models take them.
struct TwoViewImages {
  MatchNoise noise = {};  ///< noise of the matches, in their unit
  /// Width and height of the second image in that unit: by them a random match fits a model.
  Eigen::Vector2d size = Eigen::Vector2d::Ones();
};

/// Prior knowledge of the cameras.
enum class TwoViewCalibration {
  calibrated,   ///< coordinates are normalised
  uncalibrated  ///< centred, in any unit: rotation and essential are left out
};

/// Models that the default lattice does not have.
enum class TwoViewNode { free_zoom, similarity, affine, rotation_zoom, affine_epipolar, shared_focal };

/// The vertical in the frames of both cameras, of any length: both up, or both down.
struct TwoViewVerticals {
  Eigen::Vector3d first = Eigen::Vector3d::UnitY(), second = Eigen::Vector3d::UnitY();
};

/// Which lattice it shall be.
struct TwoViewModelOptions {
  TwoViewCalibration calibration = TwoViewCalibration::calibrated;
  /// Models beyond the default ones, in any order. Where cameras are uncalibrated rotation_zoom is left out.
  std::vector<TwoViewNode> nodes = {};
  /// With them `upright` is a model, where cameras are calibrated.
  std::optional<TwoViewVerticals> verticals = {};

  bool has(TwoViewNode node) const { return std::find(nodes.begin(), nodes.end(), node) != nodes.end(); }
};

using TwoViewModels = std::vector<std::shared_ptr<const TwoViewModel>>;

namespace detail {

/// The part of the lattice that homographies make, that of epipolar geometries, and optional ones of these.
LIESTAT_FUSION_API TwoViewModels homographyModels(const TwoViewImages& images, const TwoViewModelOptions& options);
LIESTAT_FUSION_API TwoViewModels epipolarModels(const TwoViewImages& images, const TwoViewModelOptions& options);
LIESTAT_FUSION_API TwoViewModels poseModels(const TwoViewImages& images, const TwoViewModelOptions& options);

}  // namespace detail

/// The lattice. ModelEstimate::covariance is 9×9, of the rank that is free; of `essential` 5×5 in the tangent of the pose,
/// of `upright` the same of rank three, of `shared focal length` 6×6, the last one log f.
LIESTAT_FUSION_API inline TwoViewModels twoViewModels(const TwoViewImages& images, const TwoViewModelOptions& options) {
  TwoViewModels models = detail::homographyModels(images, options);
  for (const TwoViewModels& more : {detail::epipolarModels(images, options), detail::poseModels(images, options)}) {
    models.insert(models.end(), more.begin(), more.end());
  }
  return models;
}
/// The default lattice.
LIESTAT_FUSION_API inline TwoViewModels twoViewModels(const TwoViewImages& images,
                                                      TwoViewCalibration calibration = TwoViewCalibration::calibrated) {
  return twoViewModels(images, TwoViewModelOptions{.calibration = calibration});
}

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/two_view/detail/epipolar_models.hpp>
#include <fusion/two_view/detail/homography_models.hpp>
#include <fusion/two_view/detail/pose_models.hpp>
#endif
