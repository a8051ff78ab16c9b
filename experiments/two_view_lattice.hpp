// The lattice that a simulated motion is tried with, and how far the truth is from an estimate.
#pragma once

#include <experiments/semidefinite_distance.hpp>
#include <experiments/two_view_scene.hpp>
#include <fusion/two_view/models.hpp>

#include <Eigen/Core>

#include <cmath>
#include <optional>

namespace liestat::experiments {

/// The optional model of a motion, but for upright, which has verticals instead.
inline std::optional<TwoViewNode> nodeOf(TwoViewMotion motion) {
  switch (motion) {
    case TwoViewMotion::free_zoom:
      return TwoViewNode::free_zoom;
    case TwoViewMotion::similarity:
      return TwoViewNode::similarity;
    case TwoViewMotion::affine:
      return TwoViewNode::affine;
    case TwoViewMotion::affine_epipolar:
      return TwoViewNode::affine_epipolar;
    case TwoViewMotion::rotation_zoom:
      return TwoViewNode::rotation_zoom;
    case TwoViewMotion::shared_focal:
      return TwoViewNode::shared_focal;
    default:
      return std::nullopt;
  }
}

/// Noise and size of a scene's images, as the models take them.
inline TwoViewImages imagesOf(const TwoViewSceneOptions& o) {
  const double sigma = o.sigma / o.focal_length;
  return {{sigma, sigma}, Eigen::Vector2d(o.width, o.height) / o.focal_length};
}

/// The default lattice, and the optional model of the motion if it is of one.
inline TwoViewModels modelsFor(const TwoViewScene& scene) {
  TwoViewModelOptions options;
  if (const auto node = nodeOf(scene.options.motion)) options.nodes = {*node};
  if (scene.options.motion == TwoViewMotion::upright) {
    options.verticals = TwoViewVerticals{scene.vertical, scene.R * scene.vertical};
  }
  return twoViewModels(imagesOf(scene.options), options);
}

/// The squared Mahalanobis distance of the true parameter from an estimate of the true model, which has `rank` free
/// parameters.
inline double distanceOfTruth(const TwoViewScene& scene, const ModelEstimate<TwoViewMotionModel>& estimate, int rank) {
  const TwoViewMotion motion = scene.options.motion;
  const bool focal = motion == TwoViewMotion::shared_focal;
  if (motion == TwoViewMotion::essential || motion == TwoViewMotion::upright || focal) {
    Eigen::VectorXd error(focal ? 6 : 5);
    error.head<5>() = log(estimate.parameter.pose, Essentiald(SO3d::fitToSO3(scene.R), scene.t));
    if (focal) error[5] = std::log(scene.focal_scale / estimate.parameter.focal_length);
    return squaredDistance(error, estimate.covariance, rank);
  }
  Eigen::Matrix3d truth = isEpipolar(motion) ? scene.F : scene.H;
  if ((truth.array() * estimate.parameter.matrix.array()).sum() < 0) truth = -truth;
  const Eigen::Matrix3d error = truth - estimate.parameter.matrix;
  return squaredDistance(Eigen::Map<const Eigen::Matrix<double, 9, 1>>(error.data()), estimate.covariance, rank);
}

}  // namespace liestat::experiments
