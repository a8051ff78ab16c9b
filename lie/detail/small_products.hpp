// Products of matrices of a fixed size, by plain loops. Each of Eigen's products is a tree of types of its own, for each
// shape and for each expression that it stands in: a compiler takes a second for the three factors of a transformed
// covariance, and no time for a loop. Unrolled, and a column summed up in registers, the loops are as fast as Eigen's
// products of 6×6 and faster from 9×9 on. One of the headers of small matrices, which lie/detail/small_matrix.hpp
// lists.
#pragma once

#include <Eigen/Core>

#include <cstddef>

namespace liestat::detail {

template <class Left, class Right>
concept FixedSizes = (Left::SizeAtCompileTime != Eigen::Dynamic) && (Right::SizeAtCompileTime != Eigen::Dynamic);

/// A B. Factors may be expressions, which are evaluated first.
template <class Left, class Right>
  requires FixedSizes<Left, Right>
auto product(const Eigen::MatrixBase<Left>& left, const Eigen::MatrixBase<Right>& right) {
  using S = typename Left::Scalar;
  constexpr int M = Left::RowsAtCompileTime, K = Left::ColsAtCompileTime, N = Right::ColsAtCompileTime;
  static_assert(K == Right::RowsAtCompileTime, "columns of the left factor, rows of the right");
  const typename Left::PlainObject& A = left.derived();
  const typename Right::PlainObject& B = right.derived();
  Eigen::Matrix<S, M, N> C;
  for (int j = 0; j < N; ++j) {
    S column[static_cast<std::size_t>(M)];
#pragma GCC unroll 12
    for (int i = 0; i < M; ++i) column[i] = A(i, 0) * B(0, j);
    for (int k = 1; k < K; ++k) {
      const S b = B(k, j);
#pragma GCC unroll 12
      for (int i = 0; i < M; ++i) column[i] += A(i, k) * b;
    }
#pragma GCC unroll 12
    for (int i = 0; i < M; ++i) C(i, j) = column[i];
  }
  return C;
}

/// A Bᵀ.
template <class Left, class Right>
  requires FixedSizes<Left, Right>
auto productTransposed(const Eigen::MatrixBase<Left>& left, const Eigen::MatrixBase<Right>& right) {
  using S = typename Left::Scalar;
  constexpr int M = Left::RowsAtCompileTime, K = Left::ColsAtCompileTime, N = Right::RowsAtCompileTime;
  static_assert(K == Right::ColsAtCompileTime, "columns of both factors");
  const typename Left::PlainObject& A = left.derived();
  const typename Right::PlainObject& B = right.derived();
  Eigen::Matrix<S, M, N> C;
  for (int j = 0; j < N; ++j) {
    S column[static_cast<std::size_t>(M)];
#pragma GCC unroll 12
    for (int i = 0; i < M; ++i) column[i] = A(i, 0) * B(j, 0);
    for (int k = 1; k < K; ++k) {
      const S b = B(j, k);
#pragma GCC unroll 12
      for (int i = 0; i < M; ++i) column[i] += A(i, k) * b;
    }
#pragma GCC unroll 12
    for (int i = 0; i < M; ++i) C(i, j) = column[i];
  }
  return C;
}

/// A C Aᵀ: a covariance C through a Jacobian A.
template <class Jacobian, class Covariance>
auto congruence(const Eigen::MatrixBase<Jacobian>& A, const Eigen::MatrixBase<Covariance>& C) {
  return productTransposed(product(A, C), A);
}

}  // namespace liestat::detail
