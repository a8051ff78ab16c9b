// A simulated pair of images of several planes, side by side like the walls of a street: each match labelled with its
// plane, as the real pairs of AdelaideRMF are.
//
// Images of 1024×768 px, f = 800 px. The camera turns by 2 to 6 degrees about any axis and moves by 0.4 to 0.8 m; plane k
// fills the k-th of equal strips of the first image, at 3 to 8 m on the strip's middle ray, turned about the vertical by
// 20 to 50 degrees from facing the camera, to the left and to the right by turns. Wrong matches are uniform in both images. Each scene is a function of its options and its seed alone.
#pragma once

#include <experiments/two_view_pairs.hpp>
#include <lie/so3.hpp>
#include <lie/units.hpp>
#include <stats/random.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cmath>
#include <cstddef>
#include <cstdint>

namespace liestat::experiments {

struct PlaneSceneOptions {
  std::size_t planes = 3;
  std::size_t matches = 60;   ///< on each plane
  std::size_t outliers = 60;  ///< wrong matches
  double sigma = 0.5;         ///< standard deviation of each coordinate (px)
};

/// The matches, of the family adelaide.
inline TwoViewPair simulatePlanes(const PlaneSceneOptions& options, std::uint64_t seed) {
  constexpr double f = 800, width = 1024, height = 768;
  CounterRng rng(seed, 0, 7);
  TwoViewPair pair;
  pair.family = PairFamily::adelaide;
  pair.name = "planes";
  pair.size = {width, height};
  const auto inImage = [&](const Eigen::Vector2d& p) {
    return p.x() >= 0 && p.x() <= width && p.y() >= 0 && p.y() <= height;
  };
  const auto add = [&](const Eigen::Vector2d& first, const Eigen::Vector2d& second, std::size_t label) {
    pair.matches.emplace_back(first.x(), first.y(), second.x(), second.y());
    pair.labels.push_back(label);
  };
  const double angle = rng.uniform(2, 6) * units::degree;
  const Eigen::Vector3d axis = rng.unitVector<3>();
  const Eigen::Matrix3d R = SO3d::exp(Eigen::Vector3d(angle * axis)).matrix();
  const double length = rng.uniform(0.4, 0.8);
  const Eigen::Vector3d t = length * rng.unitVector<3>();
  const double strip = width / static_cast<double>(options.planes);
  const auto ray = [&](double x, double y) {
    return Eigen::Vector3d((x - 0.5 * width) / f, (y - 0.5 * height) / f, 1);
  };
  for (std::size_t k = 0; k < options.planes; ++k) {
    const double left = strip * static_cast<double>(k);
    const Eigen::Vector3d middle = ray(left + 0.5 * strip, 0.5 * height).normalized();
    const double distance = rng.uniform(3, 8), tilt = (k % 2 == 0 ? 1 : -1) * rng.uniform(20, 50) * units::degree;
    const Eigen::Vector3d sideways = middle.cross(Eigen::Vector3d::UnitY()).normalized();
    const Eigen::Vector3d normal = std::cos(tilt) * middle + std::sin(tilt) * sideways;
    const double offset = distance * normal.dot(middle);
    std::size_t have = 0;
    for (int tries = 0; have < options.matches && tries < 100000; ++tries) {
      const double x = left + strip * rng.uniform(), y = height * rng.uniform();
      const Eigen::Vector3d u = ray(x, y);
      if (!(normal.dot(u) > 0.05)) continue;
      const Eigen::Vector3d second = R * (offset / normal.dot(u) * u) + t;
      if (!(second.z() > 0)) continue;
      const Eigen::Vector4d noise = options.sigma * rng.normalVector<4>();
      const Eigen::Vector2d to(f * second.x() / second.z() + 0.5 * width, f * second.y() / second.z() + 0.5 * height);
      if (!inImage(to)) continue;
      add(Eigen::Vector2d(x, y) + noise.head<2>(), to + noise.tail<2>(), k + 1);
      ++have;
    }
  }
  for (std::size_t i = 0; i < options.outliers; ++i) {
    const double x = width * rng.uniform(), y = height * rng.uniform();
    const double u = width * rng.uniform(), v = height * rng.uniform();
    add({x, y}, {u, v}, 0);
  }
  return pair;
}

}  // namespace liestat::experiments
