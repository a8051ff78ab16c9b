// Null vectors of a few linear equations, exact ones and those of least squares.
#pragma once

#include <lie/detail/least_vector.hpp>

#include <Eigen/Core>

#include <cmath>

namespace liestat::detail {

/// Equations in nine unknowns in the columns, and a zero below each: ten rows are five packets.
template <int Count>
using NineColumns = Eigen::Matrix<double, 10, Count>;

/// Orthonormal vectors that solve Count linear equations in nine unknowns. False where an equation depends on those
/// before it to about 1e-12 of its own size, or is not finite.
template <int Count>
bool nullBasis(NineColumns<Count>& a, NineColumns<9 - Count>& basis) {
  // Gauss' and Jordan's elimination; the largest coefficient of each equation is its pivot.
  Eigen::Matrix<int, Count, 1> pivots;
  bool free[9] = {true, true, true, true, true, true, true, true, true};
  for (int i = 0; i < Count; ++i) {
    const double size = a.col(i).squaredNorm();
    // Jordan's part is done when the equation is reached: less to do in those before.
    for (int k = 0; k < i; ++k) a.col(i) -= a(pivots[k], i) * a.col(k);
    int pivot = 0;
    double largest = 0;
    for (int j = 0; j < 9; ++j) {
      const double x = free[j] ? std::abs(a(j, i)) : 0;
      pivot = x > largest ? j : pivot;
      largest = x > largest ? x : largest;
    }
    if (!(largest * largest > 1e-24 * size) || !std::isfinite(size)) return false;
    a.col(i) *= 1 / a(pivot, i);
    for (int k = 0; k < i; ++k) a.col(k) -= a(pivot, k) * a.col(i);
    pivots[i] = pivot;
    free[pivot] = false;
  }
  int column = 0;
  for (int j = 0; j < 9; ++j) {
    if (!free[j]) continue;
    auto b = basis.col(column);
    b.setZero();
    b[j] = 1;
    for (int i = 0; i < Count; ++i) b[pivots[i]] = -a(j, i);
    for (int k = 0; k < column; ++k) b -= basis.col(k).dot(b) * basis.col(k);
    b *= 1 / b.norm();
    ++column;
  }
  return true;
}

}  // namespace liestat::detail
