// Checks of a window, and the table of what can be used of it.
#pragma once

#include <fusion/init/closed_form_types.hpp>
#include <fusion/detail/closed_form_blocks.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace liestat::detail {

/// The first fault of a window, with its index. Comparisons are written so that NaN is a fault.
inline ClosedFormFault faultOf(const ClosedFormWindow& window, const ClosedFormOptions& options, std::size_t& index) {
  using Fault = ClosedFormFault;
  index = 0;
  const auto positive = [](double x) { return x > 0 && std::isfinite(x); };
  if ((options.gravity && !positive(*options.gravity)) || !(options.bearing_noise >= 0) ||
      !std::isfinite(options.bearing_noise) || (options.estimate_bias && !(options.bias_deviation > 0)) ||
      !window.camera.allFinite()) {
    return Fault::bad_option;
  }
  if (window.images.size() < 2) return Fault::too_few_images;
  for (; index < window.images.size(); ++index) {
    const WindowImage& image = window.images[index];
    if (!std::isfinite(image.time) || !image.rotation.allFinite() || !image.displacement.allFinite() ||
        !image.displacement_by_bias.allFinite()) {
      return Fault::image_not_finite;
    }
    if (index == 0 ? image.time != 0 : !(image.time > window.images[index - 1].time)) return Fault::image_order;
    const Eigen::Matrix3d error = image.rotation.transpose() * image.rotation - Eigen::Matrix3d::Identity();
    if (!(error.norm() < 1e-6) ||
        !(image.rotation.col(0).cross(image.rotation.col(1)).dot(image.rotation.col(2)) > 0)) {
      return Fault::not_a_rotation;
    }
  }
  for (index = 0; index < window.features.size(); ++index) {
    for (const TrackedBearing& seen : window.features[index]) {
      if (seen.image >= window.images.size()) return Fault::wrong_index;
      const double norm = seen.bearing.norm();
      if (!(norm > 0) || !std::isfinite(norm) || !positive(seen.deviation)) return Fault::bad_bearing;
    }
  }
  index = 0;
  return Fault::none;
}

/// The observations of features that two images have seen, turned into t0, with the counts of the result.
inline RayTable rayTable(const ClosedFormWindow& window, ClosedFormResult& result) {
  RayTable table;
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
      const Eigen::Vector3d u = window.images[b.image].rotation * b.bearing.normalized();
      const double precision = 1 / b.deviation;
      table.rays.push_back({u, b.image, 1, precision});
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
    feature.deviation = std::sqrt(static_cast<double>(track.size()) / weights);
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
  for (const WindowImage& image : window.images) {
    const double scale = 2 / (table.window * table.window);
    table.images.push_back({image.time / table.window, image.displacement + image.rotation * window.camera,
                            scale * image.displacement_by_bias});
  }
  return table;
}

/// Whether a feature's parallax is at least so much (rad, for bearings of a deviation of one).
inline bool hasParallax(const ClosedFormFeature& feature, double least) {
  return feature.parallax >= least * feature.deviation;
}

/// The features of a table whose parallax is at least so much (rad, for bearings of a deviation of one).
inline RayTable withParallax(const RayTable& table, const ClosedFormResult& result, double least) {
  RayTable kept;
  kept.window = table.window;
  kept.images = table.images;
  kept.rays.reserve(table.rays.size());
  for (std::size_t i = 0; i < table.features(); ++i) {
    if (!hasParallax(result.features[table.feature[i]], least)) continue;
    const std::span<const Ray> rays = table.of(i);
    kept.rays.insert(kept.rays.end(), rays.begin(), rays.end());
    kept.begin.push_back(kept.rays.size());
    kept.feature.push_back(table.feature[i]);
  }
  return kept;
}

}  // namespace liestat::detail
