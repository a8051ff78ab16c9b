#pragma once

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>

namespace liestat::detail {

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
