// Rendered images of textured planes before a moving camera, with the truth of every pixel.
#pragma once

#include <fusion/tracking/images.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <random>
#include <vector>

namespace liestat::testing {

enum class RenderedKind { still_light, blur, light, occlusion, repeated, foreshortening };
inline constexpr std::array<const char*, 6> rendered_kinds = {"noise alone", "blur",     "light",
                                                              "occlusion",   "repeated", "foreshortening"};

/// Grey values over a torus of texels: discs and rectangles of all sizes over soft noise, or one tile of them again and again.
class RenderedTexture {
 public:
  static constexpr int size = 1024;

  RenderedTexture(std::uint32_t seed, int tile) : values_(size * size) {
    std::mt19937 rng(seed);
    const auto uniform = [&](double a, double b) { return a + (b - a) * rng() / 4294967296.; };
    std::fill(values_.begin(), values_.end(), 128.f);
    const double area = static_cast<double>(tile) * tile;
    for (double covered = 0; covered < 4 * area;) {
      const double r = std::min(uniform(3, 6) * std::pow(uniform(0.02, 1), -0.7), tile / 3.);
      const double cu = uniform(0, tile), cv = uniform(0, tile), angle = uniform(0, 3.2), long_side = uniform(0.4, 1);
      const float grey = static_cast<float>(uniform(40, 215));
      const bool disc = uniform(0, 1) < 0.3;
      const double c = std::cos(angle), s = std::sin(angle);
      for (int v = static_cast<int>(cv - r); v <= cv + r; ++v) {
        for (int u = static_cast<int>(cu - r); u <= cu + r; ++u) {
          const double x = c * (u - cu) + s * (v - cv);
          const double y = -s * (u - cu) + c * (v - cv);
          const bool in = disc ? x * x + y * y < r * r : std::abs(x) < 0.7 * r && std::abs(y) < 0.7 * long_side * r;
          if (in) values_[static_cast<std::size_t>(((v + tile) % tile) * size + (u + tile) % tile)] = grey;
        }
      }
      covered += r * r;
    }
    for (int v = 0; v < size; ++v) {
      for (int u = 0; u < size; ++u) values_[static_cast<std::size_t>(v * size + u)] = at(u % tile, v % tile);
    }
  }

  float operator()(double u, double v) const {
    const double fu = std::floor(u), fv = std::floor(v);
    const int iu = static_cast<int>(fu), iv = static_cast<int>(fv);
    const float a = static_cast<float>(u - fu), b = static_cast<float>(v - fv);
    return (1 - b) * ((1 - a) * at(iu, iv) + a * at(iu + 1, iv)) +
           b * ((1 - a) * at(iu, iv + 1) + a * at(iu + 1, iv + 1));
  }

 private:
  float at(int u, int v) const { return values_[static_cast<std::size_t>((v & (size - 1)) * size + (u & (size - 1)))]; }
  std::vector<float> values_;
};

/// Blurs by a Gaussian of so many pixels; borders are repeated.
inline void smoothImage(std::vector<float>& grey, int width, int height, double sigma) {
  const int reach = static_cast<int>(std::ceil(3.5 * sigma));
  std::vector<float> weights;
  float sum = 0;
  for (int i = -reach; i <= reach; ++i) {
    weights.push_back(static_cast<float>(std::exp(-i * i / (2 * sigma * sigma))));
    sum += weights.back();
  }
  for (const bool rows : {true, false}) {
    std::vector<float> out(grey.size());
    for (int v = 0; v < height; ++v) {
      for (int u = 0; u < width; ++u) {
        float total = 0;
        for (int i = -reach; i <= reach; ++i) {
          const int x = rows ? std::clamp(u + i, 0, width - 1) : u, y = rows ? v : std::clamp(v + i, 0, height - 1);
          total += weights[static_cast<std::size_t>(i + reach)] * grey[static_cast<std::size_t>(y * width + x)];
        }
        out[static_cast<std::size_t>(v * width + u)] = total / sum;
      }
    }
    grey = std::move(out);
  }
}

/// A camera of 400 px before a plane (occlusion: another one of bounded size nearer to it), image after image.
class RenderedScene {
 public:
  RenderedScene(RenderedKind kind, double noise, std::uint32_t seed, int width = 320, int height = 240)
      : kind_(kind),
        noise_(noise),
        width_(width),
        height_(height),
        rng_(seed),
        back_(seed + 1000, kind == RenderedKind::repeated ? 32 : 1024),
        front_(seed + 2000, kind == RenderedKind::occlusion ? 1024 : 16) {
    std::uniform_real_distribution<double> u(-1, 1);
    for (double& p : path_) p = u(rng_);
  }

  /// Renders an image; valid until the next one.
  GreyView render(std::size_t image) {
    constexpr int sub = 4;
    const Eigen::Matrix3d back = planeToImage(image, false).inverse(), front = planeToImage(image, true).inverse();
    std::vector<float> grey(static_cast<std::size_t>(width_ * height_));
    for (int v = 0; v < height_; ++v) {
      for (int u = 0; u < width_; ++u) {
        float sum = 0;
        for (int s = 0; s < sub * sub; ++s) {
          const Eigen::Vector3d p(u + (s % sub + 0.5) / sub - 0.5, v + (s / sub + 0.5) / sub - 0.5, 1);
          if (kind_ == RenderedKind::occlusion) {
            const Eigen::Vector2d f = (front * p).hnormalized();
            if (inFront(f)) {
              sum += front_(f.x(), f.y());
              continue;
            }
          }
          const Eigen::Vector2d b = (back * p).hnormalized();
          sum += back_(b.x(), b.y());
        }
        grey[static_cast<std::size_t>(v * width_ + u)] = sum / (sub * sub);
      }
    }
    const double t = static_cast<double>(image);
    // A lens blurs, too; that of a camera out of focus changes.
    const double blur = kind_ == RenderedKind::blur ? 0.4 + 0.7 * (1 - std::cos(t / 5)) : 0.4;
    smoothImage(grey, width_, height_, blur);
    double gain = 1, offset = 0;
    if (kind_ == RenderedKind::light) {
      // 30 % in one image, and as much slowly, over a side of the image to the other.
      gain = image % 20 >= 10 ? 0.77 : 1, offset = 8 * std::sin(t / 4);
    }
    std::normal_distribution<double> normal;
    pixels_.resize(grey.size());
    for (std::size_t i = 0; i < grey.size(); ++i) {
      const double across = static_cast<double>(i % static_cast<std::size_t>(width_)) / width_ - 0.5;
      const double side = kind_ == RenderedKind::light ? 1 + 0.3 * std::sin(t / 7) * across : 1;
      const double value = side * gain * grey[i] + offset + noise_ * normal(rng_);
      pixels_[i] = static_cast<std::uint8_t>(std::clamp(std::lround(value), 0L, 255L));
    }
    return {pixels_.data(), width_, height_, width_};
  }

  /// The point of a plane that a pixel of an image shows, in another image.
  Eigen::Vector2d follow(const Eigen::Vector2d& pixel, std::size_t from, std::size_t to) const {
    const bool front = kind_ == RenderedKind::occlusion &&
                       inFront((planeToImage(from, true).inverse() * pixel.homogeneous()).hnormalized());
    return (planeToImage(to, front) * planeToImage(from, front).inverse() * pixel.homogeneous()).hnormalized();
  }

 private:
  static bool inFront(const Eigen::Vector2d& texel) {
    // Columns and gaps, so that there are edges everywhere.
    const double column = texel.x() / 160 - std::floor(texel.x() / 160);
    return column < 0.4 && std::abs(texel.y()) < 170;
  }

  /// Takes texels to pixels. Two texels are a pixel at the distance of 1.
  Eigen::Matrix3d planeToImage(std::size_t image, bool front) const {
    const double t = static_cast<double>(image), f = 400;
    const double tilt =
        kind_ == RenderedKind::foreshortening ? 0.5 + 0.7 * (0.5 - 0.5 * std::cos(t / 20)) : 0.15 * path_[0];
    const Eigen::Matrix3d turned =
        (Eigen::AngleAxisd(0.2 * path_[1] + 0.01 * path_[2] * t, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(tilt, Eigen::Vector3d(std::cos(3 * path_[3]), std::sin(3 * path_[3]), 0)))
            .toRotationMatrix();
    Eigen::Vector3d at(0.006 * path_[4] * t + 0.05 * std::sin(t / 6 + path_[5]), 0.05 * std::sin(t / 8 + 3 * path_[6]),
                       1 + 0.1 * std::sin(t / 10 + 3 * path_[7]));
    if (front) at.z() -= 0.35;
    Eigen::Matrix3d plane;
    plane << turned.col(0) / (2 * f), turned.col(1) / (2 * f), at;
    Eigen::Matrix3d camera;
    camera << f, 0, width_ / 2., 0, f, height_ / 2., 0, 0, 1;
    return camera * plane;
  }

  RenderedKind kind_;
  double noise_;
  int width_, height_;
  std::mt19937 rng_;
  RenderedTexture back_, front_;
  std::array<double, 8> path_{};
  std::vector<std::uint8_t> pixels_;
};

}  // namespace liestat::testing
