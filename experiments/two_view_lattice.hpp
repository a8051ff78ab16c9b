// The lattice that a simulated motion is tried with.
#pragma once

#include <experiments/two_view_scene.hpp>
#include <fusion/two_view/models.hpp>

#include <Eigen/Core>

#include <optional>

namespace liestat::experiments {

/// The optional model of a motion.
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
    default:
      return std::nullopt;
  }
}

/// What the models know of the images of a scene.
inline TwoViewImages imagesOf(const TwoViewSceneOptions& o) {
  const double sigma = o.sigma / o.focal_length;
  return {{sigma, sigma}, Eigen::Vector2d(o.width, o.height) / o.focal_length};
}

/// The default lattice, and the optional model of the motion if it is of one.
inline TwoViewModels modelsFor(const TwoViewScene& scene) {
  TwoViewModelOptions options;
  if (const auto node = nodeOf(scene.options.motion)) options.nodes = {*node};
  return twoViewModels(imagesOf(scene.options), options);
}

}  // namespace liestat::experiments
