// Essential matrices of two views whose vertical is known: three matches. A gyroscope and an accelerometer tell the
// vertical in each camera's frame; what is left of the rotation is a turn about it.
#pragma once

#include <fusion/two_view/detail/real_roots.hpp>
#include <fusion/two_view/epipolar_solvers.hpp>
#include <fusion/two_view/solutions.hpp>
#include <lie/detail/trig.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>

namespace liestat {
namespace detail {

/// The rotation of least angle that takes a unit vector to the y axis; half a turn about x from the opposite.
inline Eigen::Matrix3d toVertical(const Eigen::Vector3d& up) {
  // The quaternion (1 + cos, axis·sin) of (0, 1, 0): up × y = (-z, 0, x).
  if (!(up.y() > -1 + 1e-12)) return Eigen::Vector3d(1, -1, -1).asDiagonal();
  return Eigen::Quaterniond(1 + up.y(), -up.z(), 0, up.x()).normalized().toRotationMatrix();
}

}  // namespace detail

/// Essential matrices E = [t]× R, |t| = 1, of exactly three matches in normalised coordinates and the vertical (up or
/// down, of any length) in the frames of both cameras, with R first_vertical ~ second_vertical: up to four. The normals
/// (R q) × q' of the three epipolar planes have a determinant of degree six in the tangent of half the turn, of which
/// one plus its square is a factor. None where that determinant vanishes for every turn to 1e-12 (equal
/// matches), where a turn alone makes all three rays parallel to 1e-4 rad (t is open), of a zero vertical, or if not
/// finite.
inline MatrixSolutions<4> solveEssentialUpright(std::span<const Eigen::Vector4d> matches,
                                                const Eigen::Vector3d& first_vertical,
                                                const Eigen::Vector3d& second_vertical) {
  MatrixSolutions<4> result;
  const double length = first_vertical.norm(), length2 = second_vertical.norm();
  if (matches.size() != 3 || !(length > 0 && length2 > 0) || !std::isfinite(length + length2)) return result;
  const Eigen::Matrix3d A = detail::toVertical(first_vertical / length),
                        B = detail::toVertical(second_vertical / length2);
  // Rows of normals by 1, s and s², s the tangent: (1 + s²) R q = q₀ + s q₁ + s² q₂.
  std::array<Eigen::Matrix3d, 3> N;
  double size = 1;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector4d& m = matches[static_cast<std::size_t>(i)];
    const Eigen::Vector3d q = A * Eigen::Vector3d(m[0], m[1], 1).normalized(),
                          v = B * Eigen::Vector3d(m[2], m[3], 1).normalized();
    N[0].row(i) = q.cross(v);
    N[1].row(i) = Eigen::Vector3d(2 * q.z(), 0, -2 * q.x()).cross(v);
    N[2].row(i) = Eigen::Vector3d(-q.x(), q.y(), -q.z()).cross(v);
    size *= std::sqrt(N[0].row(i).squaredNorm() + N[1].row(i).squaredNorm() + N[2].row(i).squaredNorm());
  }
  std::array<double, 7> d{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      const Eigen::Vector3d cross = Eigen::Vector3d(N[i].row(0)).cross(Eigen::Vector3d(N[j].row(1)));
      for (std::size_t k = 0; k < 3; ++k) d[i + j + k] += N[k].row(2).dot(cross);
    }
  }
  // Divided by 1 + s², from both ends.
  const double e4 = d[6], e3 = d[5], e0 = d[0], e1 = d[1];
  const std::array<double, 5> quartic = {e0, e1, 0.5 * ((d[4] - e4) + (d[2] - e0)), e3, e4};
  double largest = 0;
  for (const double x : quartic) largest = std::max(largest, std::abs(x));
  if (!(largest > 1e-12 * size) || !std::isfinite(size)) return result;
  const detail::RealRoots<4> roots(quartic);
  for (int i = 0; i < roots.size(); ++i) {
    const double s = roots[i].z, w = roots[i].w, square = w * w + s * s;
    const Eigen::Matrix3d normals = w * w * N[0] + s * w * N[1] + s * s * N[2];
    const Eigen::Vector3d t = detail::rightNullVector(normals);
    const double norm = t.norm();
    if (!(normals.squaredNorm() > 1e-8 * square * square)) return {};
    // Normals that are all parallel leave t open.
    if (!(norm > 1e-12 * normals.squaredNorm())) continue;
    const double c = (w * w - s * s) / square, sine = 2 * s * w / square;
    Eigen::Matrix3d turn;
    turn << c, 0, sine, 0, 1, 0, -sine, 0, c;
    const Eigen::Matrix3d E = detail::skewTimes<double>(B.transpose() * t / norm, B.transpose() * turn * A);
    if (E.allFinite()) result.add(E);
  }
  return result;
}

}  // namespace liestat
