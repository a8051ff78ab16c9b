// Pixels as the coordinates of the models of two-view motion.
#pragma once

#include <fusion/camera.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cmath>
#include <limits>
#include <optional>

namespace liestat::detail {

/// How the pixels of an image become the coordinates of the models: u = (p - centre)/focal.
struct TwoViewCoordinates {
  std::optional<Camera> camera;
  Eigen::Vector2d focal = Eigen::Vector2d::Ones(), centre = Eigen::Vector2d::Zero();

  double focalLength() const { return std::sqrt(focal.x() * focal.y()); }
  Eigen::Vector2d operator()(const Eigen::Vector2d& pixel) const {
    if (!camera || camera->distortion == Distortion::none) return (pixel - centre).cwiseQuotient(focal);
    const std::optional<Eigen::Vector3d> bearing = camera->bearing(pixel);
    if (!bearing || !(bearing->z() > 0)) return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
    return bearing->hnormalized();
  }
  /// The pixel with these coordinates; NaN where the camera has none.
  Eigen::Vector2d pixel(const Eigen::Vector2d& u) const {
    if (!camera) return u.cwiseProduct(focal) + centre;
    return camera->project(u.homogeneous())
        .value_or(Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()));
  }
  /// With a focal length that is so much longer.
  TwoViewCoordinates withFocalLength(double factor) const {
    TwoViewCoordinates moved = *this;
    moved.focal *= factor;
    if (moved.camera) moved.camera->fu *= factor, moved.camera->fv *= factor;
    return moved;
  }
  /// With a k1 that is so much larger; the same for a lens whose model has none.
  TwoViewCoordinates withDistortion(double k1) const {
    TwoViewCoordinates moved = *this;
    if (!moved.camera) {
      moved.camera.emplace();
      moved.camera->fu = focal.x(), moved.camera->fv = focal.y();
      moved.camera->cu = centre.x(), moved.camera->cv = centre.y();
    }
    Camera& lens = *moved.camera;
    if (lens.distortion == Distortion::none) lens.distortion = Distortion::radtan, lens.coefficients.setZero();
    if (lens.distortion != Distortion::double_sphere && lens.distortion != Distortion::eucm) lens.coefficients[0] += k1;
    return moved;
  }
  /// K: pixels without distortion from the coordinates.
  Eigen::Matrix3d pixels() const {
    Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
    K.diagonal().head<2>() = focal, K.topRightCorner<2, 1>() = centre;
    return K;
  }
};

inline TwoViewCoordinates coordinatesOf(const std::optional<Camera>& camera, const Eigen::Vector2d& size,
                                        const Eigen::Vector2d& corner) {
  if (camera) return {camera, {camera->fu, camera->fv}, {camera->cu, camera->cv}};
  return {std::nullopt, Eigen::Vector2d::Constant(0.5 * size.norm()), corner + 0.5 * size};
}

}  // namespace liestat::detail
