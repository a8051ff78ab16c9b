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

/// The M×N product of A, with K columns, and the matrix of which entry(k, j) is an element.
template <int M, int K, int N, class Factor, class Entry>
Eigen::Matrix<typename Factor::Scalar, M, N> productWith(const Factor& A, const Entry& entry) {
  using S = typename Factor::Scalar;
  Eigen::Matrix<S, M, N> C;
  for (int j = 0; j < N; ++j) {
    S column[static_cast<std::size_t>(M)];
    const S first = entry(0, j);
#pragma GCC unroll 12
    for (int i = 0; i < M; ++i) column[i] = A(i, 0) * first;
    for (int k = 1; k < K; ++k) {
      const S b = entry(k, j);
#pragma GCC unroll 12
      for (int i = 0; i < M; ++i) column[i] += A(i, k) * b;
    }
#pragma GCC unroll 12
    for (int i = 0; i < M; ++i) C(i, j) = column[i];
  }
  return C;
}

/// A B. Factors may be expressions, which are evaluated first.
template <class Left, class Right>
  requires FixedSizes<Left, Right>
auto product(const Eigen::MatrixBase<Left>& left, const Eigen::MatrixBase<Right>& right) {
  constexpr int M = Left::RowsAtCompileTime, K = Left::ColsAtCompileTime, N = Right::ColsAtCompileTime;
  static_assert(K == Right::RowsAtCompileTime, "columns of the left factor, rows of the right");
  const typename Left::PlainObject& A = left.derived();
  const typename Right::PlainObject& B = right.derived();
  return productWith<M, K, N>(A, [&B](int k, int j) { return B(k, j); });
}

/// A Bᵀ.
template <class Left, class Right>
  requires FixedSizes<Left, Right>
auto productTransposed(const Eigen::MatrixBase<Left>& left, const Eigen::MatrixBase<Right>& right) {
  constexpr int M = Left::RowsAtCompileTime, K = Left::ColsAtCompileTime, N = Right::RowsAtCompileTime;
  static_assert(K == Right::ColsAtCompileTime, "columns of both factors");
  const typename Left::PlainObject& A = left.derived();
  const typename Right::PlainObject& B = right.derived();
  return productWith<M, K, N>(A, [&B](int k, int j) { return B(j, k); });
}

/// A C Aᵀ: a covariance C through a Jacobian A.
template <class Jacobian, class Covariance>
auto congruence(const Eigen::MatrixBase<Jacobian>& A, const Eigen::MatrixBase<Covariance>& C) {
  return productTransposed(product(A, C), A);
}

}  // namespace liestat::detail
