// Fundamental matrices of seven matches for a random search, where most samples are wrong: as solveFundamental, in half
// the time, to the precision that an estimate from all inliers needs to start from.
#pragma once

#include <fusion/two_view/detail/null_vectors.hpp>
#include <fusion/two_view/epipolar_solvers.hpp>
#include <lie/detail/small_matrix.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>

namespace liestat::detail {

/// The real roots of z³ + a z² + b z + c, each after a step of Newton's method; how many.
inline int cubicRoots(double a, double b, double c, std::array<double, 3>& roots) {
  const double third = a / 3, p = third * third - b / 3, q = third * third * third - 0.5 * (third * b - c);
  const double discriminant = p * p * p - q * q;
  int count = 3;
  if (discriminant > 0) {
    const double angle = std::acos(std::clamp(-q / (p * std::sqrt(p)), -1., 1.)) / 3;
    const double size = 2 * std::sqrt(p), cosine = std::cos(angle);
    const double sine = std::numbers::sqrt3 * std::sqrt(std::max(1 - cosine * cosine, 0.));
    roots = {size * cosine - third, -0.5 * size * (cosine - sine) - third, -0.5 * size * (cosine + sine) - third};
  } else {
    const double root = std::cbrt(-q - std::copysign(std::sqrt(-discriminant), q));
    roots[0] = (root != 0 ? root + p / root : 0) - third;
    count = 1;
  }
  for (int i = 0; i < count; ++i) {
    double& z = roots[static_cast<std::size_t>(i)];
    const double slope = (3 * z + 2 * a) * z + b, value = ((z + a) * z + b) * z + c;
    if (slope != 0) z -= value / slope;
  }
  return count;
}

/// Up to three, appended, of matches whose coordinates are centred and of order one; none where an equation depends on
/// the others to 1e-10.
template <class Keep>
void solveSevenPoints(std::span<const Eigen::Vector4d> matches, const Keep& keep) {
  // Gauss' elimination, an equation a column; the largest coefficient of each is its pivot.
  NineColumns<7> equations;
  std::array<int, 7> pivots{};
  std::array<bool, 9> free = {true, true, true, true, true, true, true, true, true};
  for (int i = 0; i < 7; ++i) {
    auto e = equations.col(i);
    e = epipolarEquation(matches[static_cast<std::size_t>(i)]);
    for (int k = 0; k < i; ++k) e -= e[pivots[static_cast<std::size_t>(k)]] * equations.col(k);
    int pivot = 0;
    double largest = 0;
    for (int j = 0; j < 9; ++j) {
      const double x = free[static_cast<std::size_t>(j)] ? std::abs(e[j]) : 0;
      pivot = x > largest ? j : pivot;
      largest = x > largest ? x : largest;
    }
    if (!(largest > 1e-10)) return;
    e *= 1 / e[pivot];
    pivots[static_cast<std::size_t>(i)] = pivot;
    free[static_cast<std::size_t>(pivot)] = false;
  }
  // Two solutions, each with one of the free entries.
  NineColumns<2> basis = NineColumns<2>::Zero();
  std::array<int, 2> open{};
  for (int j = 0, column = 0; j < 9; ++j) {
    if (free[static_cast<std::size_t>(j)]) open[static_cast<std::size_t>(column++)] = j;
  }
  basis(open[0], 0) = basis(open[1], 1) = 1;
  for (int i = 6; i >= 0; --i) {
    const auto e = equations.col(i);
    double first = e[open[0]], second = e[open[1]];
    for (int k = i + 1; k < 7; ++k) {
      const int at = pivots[static_cast<std::size_t>(k)];
      first += e[at] * basis(at, 0), second += e[at] * basis(at, 1);
    }
    const int at = pivots[static_cast<std::size_t>(i)];
    basis(at, 0) = -first, basis(at, 1) = -second;
  }
  const Eigen::Matrix3d A = matrixOf(basis.col(0)), B = matrixOf(basis.col(1));
  // det(A + z B), by z's powers.
  const Eigen::Matrix3d a = cofactors(A), b = cofactors(B);
  const double d0 = A.col(0).dot(a.col(0)), d1 = B.cwiseProduct(a).sum(), d2 = A.cwiseProduct(b).sum(),
               d3 = B.col(0).dot(b.col(0));
  std::array<double, 3> roots{};
  // From the end where the leading coefficient is the larger.
  const bool reversed = std::abs(d0) > std::abs(d3);
  const double lead = reversed ? d0 : d3;
  if (!(std::abs(lead) > 0)) return;
  const int count = reversed ? cubicRoots(d1 / lead, d2 / lead, d3 / lead, roots)
                             : cubicRoots(d2 / lead, d1 / lead, d0 / lead, roots);
  for (int i = 0; i < count; ++i) {
    const double z = roots[static_cast<std::size_t>(i)];
    const Eigen::Matrix3d F = reversed ? Eigen::Matrix3d(z * A + B) : Eigen::Matrix3d(A + z * B);
    const double size = F.squaredNorm();
    if (size > 0 && std::isfinite(size)) keep(F);
  }
}

}  // namespace liestat::detail
