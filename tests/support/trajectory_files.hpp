// Files of simulated trajectories for the tests of the program: TUM, and the side file of covariances.
#pragma once

#include <formats/detail/trajectory_rows.hpp>
#include <experiments/trajectory_scene.hpp>
#include <stats/convention_layouts.hpp>

#include <fmt/format.h>

#include <cstddef>
#include <string>
#include <vector>

namespace liestat::cli {

inline std::string tumOf(const std::vector<double>& times, const std::vector<SE3d>& poses) {
  std::string text;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Eigen::Vector3d t = poses[i].translation();
    const Eigen::Vector4d q = poses[i].so3().params();
    text += fmt::format("{:.9f} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g}\n", times[i], t[0], t[1], t[2],
                        q[0], q[1], q[2], q[3]);
  }
  return text;
}
inline std::vector<SE3d> posesOf(const std::vector<Gaussian<SE3d>>& gaussians) {
  std::vector<SE3d> poses;
  for (const Gaussian<SE3d>& g : gaussians) poses.push_back(g.mean);
  return poses;
}
/// A side file of matrices in a convention; without a header's convention where `stated` is false.
inline std::string covarianceFileOf(const std::vector<double>& times, const std::vector<Gaussian<SE3d>>& gaussians,
                                    Convention c) {
  c.layout = CovarianceLayout::upper21;
  std::string text = detail::conventionHeader(c);
  for (std::size_t i = 0; i < times.size(); ++i) {
    text += fmt::format("{:.9f}", times[i]);
    const PackedCovariance packed = packCovariance(c, toConvention(c, gaussians[i]));
    for (const double x : packed.numbers()) text += fmt::format(" {:.17g}", x);
    text += "\n";
  }
  return text;
}
/// Rows of TUM with the 36 numbers of a matrix after them: their convention is for the user to say.
inline std::string tumWithCovariance(const std::vector<double>& times, const std::vector<Gaussian<SE3d>>& gaussians,
                                     const Convention& c) {
  std::string text;
  for (std::size_t i = 0; i < times.size(); ++i) {
    std::string row = tumOf({times[i]}, {gaussians[i].mean});
    row.pop_back();
    const Eigen::Matrix<double, 6, 6> M = toConvention(c, gaussians[i]);
    for (int k = 0; k < 36; ++k) row += fmt::format(" {:.17g}", M(k / 6, k % 6));
    text += row + "\n";
  }
  return text;
}

}  // namespace liestat::cli
