// Linear equations of a small positive definite matrix whose size is a run-time number. One of the headers of small matrices,
// which lie/detail/small_matrix.hpp lists.
#pragma once

#include <Eigen/Core>

namespace liestat::detail {

/// A⁻¹ B of a positive definite matrix, by Cholesky's factors without square roots of up to
/// some tens of rows. Infinite or NaN where it is singular.
inline Eigen::MatrixXd solvedDefinite(Eigen::MatrixXd a, Eigen::MatrixXd b) {
  using Eigen::Index;
  const Index n = a.rows();
  for (Index k = 0; k < n; ++k) {
    for (Index i = k + 1; i < n; ++i) {
      const double f = a(i, k) / a(k, k);
      for (Index j = k + 1; j < n; ++j) a(i, j) -= f * a(k, j);
      for (Index j = 0; j < b.cols(); ++j) b(i, j) -= f * b(k, j);
    }
  }
  for (Index j = 0; j < b.cols(); ++j) {
    for (Index i = n; i-- > 0;) {
      for (Index k = i + 1; k < n; ++k) b(i, j) -= a(i, k) * b(k, j);
      b(i, j) /= a(i, i);
    }
  }
  return b;
}

}  // namespace liestat::detail
