// Rendered images of a textured room with boxes in it, from any pose, and a recording of it on disk as EuRoC's are.
#pragma once

#include <fusion/camera.hpp>
#include <fusion/tracking/images.hpp>
#include <lie/se3.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include <support/rendered_scene.hpp>

namespace liestat::testing {

using TexturedBox = Eigen::AlignedBox3d;

class RenderedRoom {
 public:
  /// `noise` in grey values. The camera has no distortion.
  RenderedRoom(const TexturedBox& walls, const Camera& camera, double noise, std::uint32_t seed)
      : walls_(walls), camera_(camera), noise_(noise), rng_(seed), texture_(seed + 1000, RenderedTexture::size) {}

  std::vector<TexturedBox> boxes;

  /// Renders an image; valid until the next one.
  GreyView render(const SE3d& world_T_camera) {
    constexpr int sub = 3;
    const int width = camera_.width, height = camera_.height;
    const Eigen::Matrix3d world_R_camera = world_T_camera.so3().matrix();
    const Eigen::Vector3d at = world_T_camera.translation();
    std::vector<float> grey(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    for (int v = 0; v < height; ++v) {
      for (int u = 0; u < width; ++u) {
        float sum = 0;
        for (int s = 0; s < sub * sub; ++s) {
          const double x = u + (s % sub + 0.5) / sub - 0.5, y = v + (s / sub + 0.5) / sub - 0.5;
          sum += seen(
              at, world_R_camera * Eigen::Vector3d((x - camera_.cu) / camera_.fu, (y - camera_.cv) / camera_.fv, 1));
        }
        grey[static_cast<std::size_t>(v * width + u)] = sum / (sub * sub);
      }
    }
    smoothImage(grey, width, height, 0.5);
    std::normal_distribution<double> normal;
    pixels_.resize(grey.size());
    for (std::size_t i = 0; i < grey.size(); ++i) {
      pixels_[i] = static_cast<std::uint8_t>(std::clamp(std::lround(grey[i] + noise_ * normal(rng_)), 0L, 255L));
    }
    return {pixels_.data(), width, height, width};
  }

 private:
  /// Texels a metre: two a pixel of 450 px at 4 m.
  static constexpr double texels = 220;

  float seen(const Eigen::Vector3d& at, const Eigen::Vector3d& ray) const {
    double distance = std::numeric_limits<double>::infinity();
    int face = 0;
    // From within, the wall that is left first.
    for (int i = 0; i < 3; ++i) {
      const double to = ((ray[i] > 0 ? walls_.max()[i] : walls_.min()[i]) - at[i]) / ray[i];
      if (to < distance) distance = to, face = i + (ray[i] > 0 ? 3 : 0);
    }
    // From outside, the face that is entered last.
    for (std::size_t b = 0; b < boxes.size(); ++b) {
      double enter = 0, leave = distance;
      int entered = 0;
      for (int i = 0; i < 3; ++i) {
        const double near = ((ray[i] > 0 ? boxes[b].min()[i] : boxes[b].max()[i]) - at[i]) / ray[i];
        const double far = ((ray[i] > 0 ? boxes[b].max()[i] : boxes[b].min()[i]) - at[i]) / ray[i];
        if (near > enter) enter = near, entered = i;
        leave = std::min(leave, far);
      }
      if (enter > 0 && enter < leave) distance = enter, face = 6 + 3 * static_cast<int>(b) + entered;
    }
    const Eigen::Vector3d point = at + distance * ray;
    const int axis = face % 3;
    // Faces show other parts of the texture.
    return texture_(texels * point[(axis + 1) % 3] + 171 * face, texels * point[(axis + 2) % 3] + 333 * face);
  }

  TexturedBox walls_;
  Camera camera_;
  double noise_;
  std::mt19937 rng_;
  RenderedTexture texture_;
  std::vector<std::uint8_t> pixels_;
};

inline void writePgm(const std::string& path, const GreyView& image) {
  std::ofstream file(path, std::ios::binary);
  file << "P5\n" << image.width << " " << image.height << "\n255\n";
  for (int v = 0; v < image.height; ++v) {
    file.write(reinterpret_cast<const char*>(image.pixels + v * image.stride), image.width);
  }
}

}  // namespace liestat::testing
