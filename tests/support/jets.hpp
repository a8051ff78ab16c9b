// Values and derivatives out of ceres::Jet, and the tangent vectors at which they are compared.
#pragma once

#include <Eigen/Core>

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace liestat_test {

/// One width for all types, so that what they share (rotations, 3×3 matrices) is compiled once. Those with fewer
/// dimensions leave the last derivatives zero.
using Jet = ceres::Jet<double, 9>;

template <int N>
using JetVector = Eigen::Matrix<Jet, N, 1>;

/// v with the derivatives of the coordinates.
template <int N>
JetVector<N> variable(const Eigen::Matrix<double, N, 1>& v) {
  static_assert(N <= Jet::DIMENSION);
  JetVector<N> x;
  for (int i = 0; i < N; ++i) x[i] = Jet(v[i], i);
  return x;
}

template <class D>
Eigen::MatrixXd derivative(const Eigen::MatrixBase<D>& x) {
  Eigen::MatrixXd J(x.size(), D::Scalar::DIMENSION);
  for (Eigen::Index i = 0; i < x.size(); ++i) J.row(i) = x(i).v.transpose();
  return J;
}

template <class D>
Eigen::VectorXd value(const Eigen::MatrixBase<D>& x) {
  Eigen::VectorXd v(x.size());
  for (Eigen::Index i = 0; i < x.size(); ++i) v[i] = x(i).a;
  return v;
}

template <class D>
void expectFinite(const Eigen::MatrixBase<D>& m, const char* what, double angle) {
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    for (Eigen::Index j = 0; j < m.cols(); ++j) {
      EXPECT_TRUE(std::isfinite(m(i, j).a) && m(i, j).v.allFinite()) << what << " at angle " << angle;
    }
  }
}

/// Derivatives by variables that b has no column for must be zero.
inline void expectNear(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, double tolerance, const char* what,
                       double angle) {
  ASSERT_LE(b.cols(), a.cols()) << what;
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(a.rows(), a.cols());
  all.leftCols(b.cols()) = b;
  EXPECT_LE((a - all).norm(), tolerance) << what << " at angle " << angle << "\n" << a << "\nis not\n" << b;
}

inline const std::vector<double> swept_angles = {
    0,   1e-15, 1e-12,           1e-9,           1e-6, 1e-3, 0.1, 0.22, 0.23, 0.7, 1.5, 1.6, 2.2, 3.0,
    3.1, 3.14,  EIGEN_PI - 1e-6, EIGEN_PI - 1e-9};

/// A tangent vector whose `rotation` coordinates after the first `translation` (unless told: all the others) have the
/// norm `angle`.
template <int N>
Eigen::Matrix<double, N, 1> tangent(double angle, int translation, int rotation = 0) {
  Eigen::Matrix<double, N, 1> v;
  for (int i = 0; i < N; ++i) v[i] = 0.4 - 0.3 * (i % 6) + 0.11 * (i % 6) * (i % 6) - 0.07 * (i / 6);
  if (rotation == 0) rotation = N - translation;
  v.segment(translation, rotation) *= angle / v.segment(translation, rotation).norm();
  return v;
}

// The derivatives are sums of products of a few numbers of the size of one.
inline const double some_eps = 64 * std::numeric_limits<double>::epsilon();

}  // namespace liestat_test
