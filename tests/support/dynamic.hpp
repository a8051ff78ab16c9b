// Matrices of fixed sizes as ones of run-time size: what a test computes with these is compiled once for all manifolds.
#pragma once

#include <Eigen/Core>

namespace liestat_test {

using Eigen::MatrixXd;

template <class Fixed>
MatrixXd dynamic(const Eigen::PlainObjectBase<Fixed>& m) {
  return Eigen::Map<const MatrixXd>(m.data(), m.rows(), m.cols());
}

/// e eᵀ, the covariance of one error vector.
inline MatrixXd outer(const MatrixXd& e) { return e * e.transpose(); }

/// The Frobenius norm of a difference.
inline double gap(const MatrixXd& a, const MatrixXd& b) { return (a - b).norm(); }

/// As a matrix of a fixed size.
template <class Fixed>
Fixed fixed(const MatrixXd& m) {
  return Eigen::Map<const Fixed>(m.data());
}

}  // namespace liestat_test
