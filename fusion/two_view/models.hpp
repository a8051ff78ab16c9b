// The models of the motion between two views as a hierarchy (stats/hierarchy.hpp): what a match obeys under each, what it
// leaves free, and which contains which (Viéville, Lingrand and Gaspard 2000, section 7).
//
//   name                  equation      q                          free  sample  contains
//   none                  ũ' ~ H ũ      -                            0     0     -
//   retinal translation   H = [I τ]     τ                            2     1     none
//   zoom                  diag(s,s,1)   ln s; about the centre       1     1     none
//   retinal displacement  [Q τ]         SE2                          3     2     retinal translation
//   rotation              R             SO3                          3     2     none
//   homography            any           vec H, ‖H‖² = 3              8     4     retinal displacement, zoom, rotation
//   translation           ũ'ᵀ F ũ = 0,  S2, direction of t           2     2     retinal translation, zoom
//                         F = [t]×
//   essential             [t]× R        Essential, x' = R x + t      5     5     translation, rotation, retinal displacement
//   fundamental           rank 2        vec F, ‖F‖² = 2              7     7     essential, homography, zoom
//
// `essential` does not contain `homography`: a homography of a plane in two views of one camera obeys more than that.
// Coordinates are normalised, u = (p - c)/f; the models below homography and fundamental but for retinal translation and
// displacement mean something only then.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/two_view/errors.hpp>
#include <lie/essential.hpp>
#include <stats/hierarchy_types.hpp>

#include <Eigen/Core>

#include <memory>
#include <vector>

namespace liestat {

/// The parameter of a model of two-view motion: H or F, and for `essential` the pose that it belongs to.
struct TwoViewMotionModel {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  Essentiald pose = Essentiald();  ///< second_T_first up to scale, on the side that most matches lie in front of
};

using TwoViewModel = HierarchyModel<Eigen::Vector4d, TwoViewMotionModel>;

/// What the models know of the images.
struct TwoViewImages {
  MatchNoise noise = {};  ///< of the matches, in their unit
  /// Width and height of the second image in that unit: by them a random match fits a model.
  Eigen::Vector2d size = Eigen::Vector2d::Ones();
};

/// What is known of the cameras.
enum class TwoViewCalibration {
  calibrated,   ///< coordinates are normalised
  uncalibrated  ///< centred, in any unit: rotation and essential are left out
};

/// The default lattice. ModelEstimate::covariance is that of q in its local frame (above).
std::vector<std::shared_ptr<const TwoViewModel>> twoViewModels(
    const TwoViewImages& images, TwoViewCalibration calibration = TwoViewCalibration::calibrated);

}  // namespace liestat

#ifndef LIESTAT_COMPILED_FUSION
#include <fusion/detail/two_view_models.hpp>
#endif
