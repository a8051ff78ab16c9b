// Checks of a window, and the table of what can be used of it.
#pragma once

#include <fusion/init/closed_form_types.hpp>
#include <fusion/init/detail/closed_form_blocks.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace liestat::detail {

/// The first fault of a window. Comparisons are written so that NaN is a fault.
inline Fault faultOf(const ClosedFormWindow& window, const InitialisationOptions& options) {
  const auto positive = [](double x) { return x > 0 && std::isfinite(x); };
  if ((options.gravity && !positive(*options.gravity)) || !(options.bearing_noise >= 0) ||
      !std::isfinite(options.bearing_noise) ||
      (options.closed_form.estimate_bias && !(options.prior.accelerometer_sigma > 0))) {
    return FaultKind::bad_option;
  }
  for (const SE3d& camera : window.cameras) {
    if (!camera.matrix().allFinite()) return FaultKind::bad_option;
  }
  if (window.images.size() < 2) return FaultKind::too_few_images;
  for (std::size_t j = 0; j < window.images.size(); ++j) {
    const WindowImage& image = window.images[j];
    if (!std::isfinite(image.time) || !image.rotation.allFinite() || !image.displacement.allFinite() ||
        !image.displacement_by_bias.allFinite()) {
      return {FaultKind::image_not_finite, j};
    }
    if (j == 0 ? image.time != 0 : !(image.time > window.images[j - 1].time)) return {FaultKind::image_order, j};
    const Eigen::Matrix3d error = image.rotation.transpose() * image.rotation - Eigen::Matrix3d::Identity();
    if (!(error.norm() < 1e-6) ||
        !(image.rotation.col(0).cross(image.rotation.col(1)).dot(image.rotation.col(2)) > 0)) {
      return {FaultKind::not_a_rotation, j};
    }
  }
  for (std::size_t i = 0; i < window.features.size(); ++i) {
    for (const TrackedBearing& seen : window.features[i]) {
      if (seen.image >= window.images.size() || seen.camera >= window.cameras.size()) {
        return {FaultKind::wrong_index, i};
      }
      const double norm = seen.bearing.norm();
      if (!(norm > 0) || !std::isfinite(norm) || !positive(seen.relative_sigma)) return {FaultKind::bad_bearing, i};
      if (seen.time && !(std::abs(*seen.time - window.images[seen.image].time) <= 1e-6)) {
        return {FaultKind::bearing_time, i};
      }
    }
  }
  return {};
}

/// The observations of features that two images have seen, turned into t0, with the counts of the result.
inline RayTable rayTable(const ClosedFormWindow& window, ClosedFormResult& result) {
  RayTable table;
  table.cameras = std::max<std::size_t>(1, window.cameras.size());
  std::vector<Eigen::Matrix3d> rotations;
  for (const SE3d& camera : window.cameras) rotations.push_back(camera.so3().matrix());
  result.features.assign(window.features.size(), {});
  std::vector<bool> seen(window.images.size(), false);
  std::size_t observations = 0;
  for (const FeatureTrack& track : window.features) observations += track.size();
  table.rays.reserve(observations);
  table.begin.reserve(window.features.size() + 1);
  for (std::size_t i = 0; i < window.features.size(); ++i) {
    const FeatureTrack& track = window.features[i];
    ClosedFormFeature& feature = result.features[i];
    feature.observations = track.size();
    feature.used = std::any_of(track.begin(), track.end(),
                               [&](const TrackedBearing& b) { return b.image != track.front().image; });
    if (!feature.used) continue;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double weights = 0;
    for (const TrackedBearing& b : track) {
      const Eigen::Vector3d u = window.images[b.image].rotation * (rotations[b.camera] * b.bearing.normalized());
      const double precision = 1 / b.relative_sigma;
      table.rays.push_back({u, b.camera * window.images.size() + b.image, 1, precision});
      seen[b.image] = true;
      sum += (precision * precision) * u;
      weights += precision * precision;
    }
    // Chords of the directions to their mean.
    const Eigen::Vector3d mean = sum.normalized();
    double square = 0;
    for (std::size_t k = table.begin.back(); k < table.rays.size(); ++k) {
      const Ray& ray = table.rays[k];
      square += ray.precision * ray.precision * (ray.u - mean).squaredNorm();
    }
    feature.parallax = std::sqrt(square / weights);
    feature.relative_sigma = std::sqrt(static_cast<double>(track.size()) / weights);
    table.begin.push_back(table.rays.size());
    table.feature.push_back(i);
  }
  for (std::size_t j = 0; j < seen.size(); ++j) {
    if (!seen[j]) continue;
    ++result.images_used;
    table.window = window.images[j].time;
  }
  result.window = table.window;
  result.features_used = table.features();
  result.observations_used = table.rays.size();
  const double scale = 2 / (table.window * table.window);
  for (const SE3d& camera : window.cameras) {
    const Eigen::Vector3d lever = camera.translation();
    for (const WindowImage& image : window.images) {
      table.images.push_back(
          {image.time / table.window, image.displacement + image.rotation * lever, scale * image.displacement_by_bias});
    }
  }
  return table;
}

/// True if a feature's parallax is at least so much (rad, for bearings of a relative sigma of one).
inline bool hasParallax(const ClosedFormFeature& feature, double min_parallax) {
  return feature.parallax >= min_parallax * feature.relative_sigma;
}

/// The features of a table whose parallax is at least so much (rad, for bearings of a relative sigma of one).
inline RayTable withParallax(const RayTable& table, const ClosedFormResult& result, double min_parallax) {
  RayTable kept;
  kept.window = table.window;
  kept.images = table.images;
  kept.cameras = table.cameras;
  kept.rays.reserve(table.rays.size());
  for (std::size_t i = 0; i < table.features(); ++i) {
    if (!hasParallax(result.features[table.feature[i]], min_parallax)) continue;
    const std::span<const Ray> rays = table.of(i);
    kept.rays.insert(kept.rays.end(), rays.begin(), rays.end());
    kept.begin.push_back(kept.rays.size());
    kept.feature.push_back(table.feature[i]);
  }
  return kept;
}

}  // namespace liestat::detail
