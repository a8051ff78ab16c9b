// Factors of covariances: their squares, and factors along principal axes. One of the headers of small matrices
// (lie/detail/small_matrix.hpp).
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_orthogonal.hpp>

#include <Eigen/Core>

#include <limits>

namespace liestat::detail {

/// A Aᵀ, symmetric to the last bit and with a Cholesky factor where A is regular and finite. Where rounding takes the
/// smallest eigenvalue (its ratio to the largest is of the order of eps), the diagonal is raised by that rounding.
template <class S, int N>
Eigen::Matrix<S, N, N> squareOfFactor(const Eigen::Matrix<S, N, N>& A) {
  Eigen::Matrix<S, N, N> C;
  for (int j = 0; j < N; ++j) {
    for (int i = j; i < N; ++i) {
      S sum(0);
      for (int k = 0; k < N; ++k) sum += A(i, k) * A(j, k);
      C(i, j) = C(j, i) = sum;
    }
  }
  S rounding = S(N) * std::numeric_limits<S>::epsilon();
  for (int tries = 0; tries < 8 && !Cholesky<S, N>(C).ok(); ++tries, rounding *= S(2)) {
    for (int i = 0; i < N; ++i) C(i, i) += rounding * C(i, i);
  }
  return C;
}

/// Standard deviations along principal axes of A Aᵀ: a factor with orthogonal columns, the shortest first.
template <class S, int N>
Eigen::Matrix<S, N, N> principalFactor(const Eigen::Matrix<S, N, N>& A) {
  const SmallSvd<N> svd(BasicSmallMatrix<N>::of(Eigen::Matrix<double, N, N>(A.template cast<double>())));
  Eigen::Matrix<S, N, N> result;
  for (int k = 0; k < N; ++k) {
    for (int i = 0; i < N; ++i) result(i, N - 1 - k) = static_cast<S>(svd.value(k) * svd.u(k, i));
  }
  return result;
}

}  // namespace liestat::detail
