// Null vectors of a few linear equations, exact ones and those of least squares.
#pragma once

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>

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

/// The unit vector with the least xᵀ A x, A symmetric and positive semi-definite (the lower triangle is read). False
/// where it is not unique: A has rank below N - 1 to about 1e-13 of its trace; or not finite.
template <int N>
bool leastVector(Eigen::Matrix<double, N, N> A, Eigen::Matrix<double, N, 1>& x) {
  const double trace = A.trace();
  if (!(trace > 0) || !std::isfinite(trace)) return false;
  // L D Lᵀ with the largest pivot first: A's null vector is nearly what the last pivot belongs to.
  const double rounding = 4 * std::numeric_limits<double>::epsilon() * trace;
  for (int j = 0; j < N; ++j) {
    A(j, j) += rounding;
    for (int i = j + 1; i < N; ++i) A(j, i) = A(i, j);
  }
  Eigen::Matrix<int, N, 1> order;
  for (int i = 0; i < N; ++i) order[i] = i;
  for (int j = 0; j < N; ++j) {
    int pivot = j;
    for (int i = j + 1; i < N; ++i) {
      if (A(i, i) > A(pivot, pivot)) pivot = i;
    }
    if (pivot != j) {
      A.row(j).swap(A.row(pivot));
      A.col(j).swap(A.col(pivot));
      const int other = order[j];
      order[j] = order[pivot];
      order[pivot] = other;
    }
    const double d = A(j, j);
    if (!(d > (j < N - 1 ? 1e-13 * trace : -trace))) return false;
    for (int i = j + 1; i < N; ++i) {
      const double l = A(i, j) / d;
      for (int k = j + 1; k <= i; ++k) A(i, k) -= l * A(j, k);
      for (int k = j + 1; k <= i; ++k) A(k, i) = A(i, k);
      A(i, j) = l;
    }
  }
  A(N - 1, N - 1) = std::max(A(N - 1, N - 1), rounding);
  Eigen::Matrix<double, N, 1> y = Eigen::Matrix<double, N, 1>::Unit(N - 1);
  for (int iteration = 0; iteration < 100; ++iteration) {
    const Eigen::Matrix<double, N, 1> before = y;
    // In the first round the forward half is done: y is what it makes of a vector near the null vector.
    if (iteration > 0) {
      for (int i = 0; i < N; ++i) {
        for (int k = 0; k < i; ++k) y[i] -= A(i, k) * y[k];
      }
      for (int i = 0; i < N; ++i) y[i] /= A(i, i);
    }
    for (int i = N - 1; i >= 0; --i) {
      for (int k = i + 1; k < N; ++k) y[i] -= A(k, i) * y[k];
    }
    y /= y.norm();
    if (iteration > 1 && (y - before).squaredNorm() < 1e-30) break;
  }
  for (int i = 0; i < N; ++i) x[order[i]] = y[i];
  return x.allFinite();
}

}  // namespace liestat::detail
