// Images of planar targets before a camera, with the pose that they show.
#pragma once

#include <fusion/camera.hpp>
#include <fusion/targets/target_pose.hpp>
#include <fusion/tracking/images.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

namespace liestat::testing {

/// A sheet of cells (0 black, 1 white), `cell` metres each, white round the cells for a cell, grey beyond.
struct RenderedSheet {
  int columns = 0, rows = 0;
  std::vector<std::uint8_t> white;
  double cell = 0;
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();  ///< of the target's axes, in cells

  double grey(const Eigen::Vector2d& point) const {
    const Eigen::Array2d at = (point / cell + origin).array().floor();
    const int x = static_cast<int>(at.x()), y = static_cast<int>(at.y());
    if (x < -1 || y < -1 || x > columns || y > rows) return 120;
    const bool beyond = x < 0 || y < 0 || x >= columns || y >= rows;
    return beyond || white[static_cast<std::size_t>(y * columns + x)] != 0 ? 200 : 40;
  }
};

/// The cells of a chessboard of so many inner corners.
inline RenderedSheet chessboardSheet(int columns, int rows, double size) {
  RenderedSheet sheet{columns + 1, rows + 1, {}, size, {1, 1}};
  for (int i = 0; i < sheet.columns * sheet.rows; ++i) {
    sheet.white.push_back(static_cast<std::uint8_t>((i % sheet.columns + i / sheet.columns) % 2));
  }
  return sheet;
}

struct RenderedImage {
  int width = 640, height = 480;
  std::vector<std::uint8_t> pixels;
  GreyView view() const { return {pixels.data(), width, height, width}; }
};

/// Renders sheets, each at its pose camera_T_sheet; sub-pixels where the pattern changes, a blur of the lens, and noise.
inline RenderedImage renderSheets(const std::vector<std::pair<RenderedSheet, SE3d>>& sheets, const Camera& camera,
                                  double noise, double blur, std::mt19937& rng) {
  RenderedImage image{camera.width, camera.height, {}};
  constexpr int fine = 6, sub = 2;
  const int wide = image.width, high = image.height;
  const auto corner = [&](int u, int v) { return static_cast<std::size_t>(v * (wide + 1) + u); };
  // Directions at the pixels' corners; within a pixel a lens is linear to 1e-4 px.
  std::vector<Eigen::Vector2d> directions;
  for (int v = 0; v <= high; ++v) {
    for (int u = 0; u <= wide; ++u) directions.emplace_back(camera.bearing({u - 0.5, v - 0.5})->hnormalized());
  }
  std::vector<Eigen::Matrix3d> to_cells;
  for (const auto& [sheet, pose] : sheets) {
    Eigen::Matrix3d plane;
    plane << pose.so3().matrix().leftCols<2>(), pose.translation();
    to_cells.emplace_back(plane.inverse());
  }
  const auto greyOf = [&](const Eigen::Vector2d& direction) {
    for (std::size_t i = 0; i < sheets.size(); ++i) {
      const double grey = sheets[i].first.grey((to_cells[i] * direction.homogeneous()).hnormalized());
      if (grey != 120) return static_cast<float>(grey);
    }
    return 120.f;
  };
  // (x, y) from 0 to 1 within the pixel.
  const auto greyAt = [&](int u, int v, double x, double y) {
    const Eigen::Vector2d above = (1 - x) * directions[corner(u, v)] + x * directions[corner(u + 1, v)];
    const Eigen::Vector2d below = (1 - x) * directions[corner(u, v + 1)] + x * directions[corner(u + 1, v + 1)];
    return greyOf((1 - y) * above + y * below);
  };
  std::vector<float> corners;
  for (const Eigen::Vector2d& direction : directions) corners.push_back(greyOf(direction));
  std::vector<float> detail(static_cast<std::size_t>(fine * wide) * static_cast<std::size_t>(fine * high));
  for (int v = 0; v < high; ++v) {
    for (int u = 0; u < wide; ++u) {
      // In detail where one of the pixels around shows a change: a cell of two pixels has no pixel of its own.
      const float first = corners[corner(u, v)];
      bool same = true;
      for (int y = std::max(v - 1, 0); same && y <= std::min(v + 2, high); ++y) {
        for (int x = std::max(u - 1, 0); same && x <= std::min(u + 2, wide); ++x) {
          same = corners[corner(x, y)] == first;
        }
      }
      for (int i = 0; i < fine * fine; ++i) {
        float sum = same ? first * sub * sub : 0;
        for (int s = 0; !same && s < sub * sub; ++s) {
          const double x = i % fine * sub + s % sub + 0.5, y = i / fine * sub + s / sub + 0.5;
          sum += greyAt(u, v, x / (fine * sub), y / (fine * sub));
        }
        detail[static_cast<std::size_t>((v * fine + i / fine) * fine * wide + u * fine + i % fine)] = sum / (sub * sub);
      }
    }
  }
  // The lens and the pixel's aperture together.
  const int reach = static_cast<int>(std::ceil(fine * (0.5 + 4 * blur)));
  std::vector<double> weights;
  for (int i = -reach; i <= reach; ++i) {
    double sum = 0;
    for (int k = 0; k < fine; ++k) {
      const double z = (i - k + 0.5 * (fine - 1)) / (fine * blur);
      sum += std::exp(-0.5 * z * z);
    }
    weights.push_back(sum);
  }
  // Offsets from a pixel's centre, which lies between two of its details.
  const auto centred = [&](const auto& at, int most, int pixel) {
    double total = 0, sum = 0;
    for (int i = -reach; i <= reach; ++i) {
      const double w = weights[static_cast<std::size_t>(i + reach)];
      total += 2 * w;
      sum += w * (at(std::clamp(pixel * fine + fine / 2 + i, 0, most - 1)) +
                  at(std::clamp(pixel * fine + fine / 2 - 1 - i, 0, most - 1)));
    }
    return sum / total;
  };
  std::vector<double> rows(static_cast<std::size_t>(fine * high) * static_cast<std::size_t>(wide)), grey;
  for (int v = 0; v < fine * high; ++v) {
    const float* const row = detail.data() + static_cast<std::size_t>(v) * static_cast<std::size_t>(fine * wide);
    for (int u = 0; u < wide; ++u) {
      rows[static_cast<std::size_t>(v * wide + u)] = centred([&](int x) { return row[x]; }, fine * wide, u);
    }
  }
  for (int v = 0; v < high; ++v) {
    for (int u = 0; u < wide; ++u) {
      grey.push_back(centred([&](int y) { return rows[static_cast<std::size_t>(y * wide + u)]; }, fine * high, v));
    }
  }
  std::normal_distribution<double> normal;
  for (const double g : grey) {
    image.pixels.push_back(static_cast<std::uint8_t>(std::clamp(std::lround(g + noise * normal(rng)), 0L, 255L)));
  }
  return image;
}

/// A pose in which cells of `cell` metres are `pixels` wide, tilted by so many radians about a random axis.
inline SE3d renderedPose(const Camera& camera, double cell, double pixels, double tilt, std::mt19937& rng) {
  std::uniform_real_distribution<double> u(-1, 1);
  const double azimuth = EIGEN_PI * u(rng), roll = EIGEN_PI * u(rng);
  const Eigen::Vector3d ahead =
      Eigen::Vector3d(0.1 * u(rng) * camera.width / camera.fu, 0.1 * u(rng) * camera.height / camera.fv, 1)
          .normalized();
  const Eigen::Quaterniond q = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), ahead) *
                               Eigen::AngleAxisd(tilt, Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), 0)) *
                               Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ());
  return SE3d::fromParams((SE3d::Params() << q.coeffs(), camera.fu * cell / pixels * ahead).finished());
}

}  // namespace liestat::testing
