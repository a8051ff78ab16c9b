// The subspace constraint of Soatto and Perona 1994 as it is printed, (5), with matrices of 2N rows: the reference of
// fusion/motion/subspace_update.hpp. Rows are divided by the points' standard deviations.
#pragma once

#include <fusion/motion/flow_rows.hpp>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>

#include <cmath>
#include <span>

namespace liestat::tests {

struct DenseSubspace {
  Eigen::MatrixXd C;     ///< [blkdiag(A_i V) | B], 2N × (N + 3)
  Eigen::VectorXd flow;  ///< ẋ, 2N
  Eigen::MatrixXd P;     ///< I - C C⁺
  Eigen::VectorXd p;     ///< C⁺ ẋ: inverse depths, then the rotation

  DenseSubspace(std::span<const FlowPoint<double>> points, const Eigen::Vector3d& V) {
    const auto n = static_cast<Eigen::Index>(points.size());
    C.setZero(2 * n, n + 3);
    flow.resize(2 * n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const FlowPoint<double>& point = points[static_cast<std::size_t>(i)];
      const double w = 1 / std::sqrt(point.variance);
      C.block<2, 1>(2 * i, i) = w * (flowByVelocity(point.x, point.y) * V);
      C.block<2, 3>(2 * i, n) = w * flowByRotation(point.x, point.y);
      flow.segment<2>(2 * i) << w * point.u, w * point.v;
    }
    // A decomposition that compiles in a third of the time of singular values.
    const Eigen::MatrixXd inverse = C.completeOrthogonalDecomposition().pseudoInverse();
    P = Eigen::MatrixXd::Identity(2 * n, 2 * n) - C * inverse;
    p = inverse * flow;
  }
  Eigen::VectorXd constraint() const { return P * flow; }
  /// d(P ẋ)/dξ without the part that is orthogonal to the range of P: -P dC p.
  Eigen::MatrixXd jacobian(std::span<const FlowPoint<double>> points, const Eigen::Matrix<double, 3, 2>& E) const {
    Eigen::MatrixXd moved(flow.size(), 2);
    for (Eigen::Index i = 0; i < flow.size() / 2; ++i) {
      const FlowPoint<double>& point = points[static_cast<std::size_t>(i)];
      moved.middleRows<2>(2 * i) = p[i] / std::sqrt(point.variance) * (flowByVelocity(point.x, point.y) * E);
    }
    return -(P * moved);
  }
};

/// One update in the printed form, with the Jacobian of the constraint in the gain, a minus, and a pseudo-inverse of the
/// innovation's covariance, which has rank N - 3.
struct DenseUpdate {
  Eigen::Vector2d step;
  Eigen::Matrix2d covariance;
  Eigen::Index rank = 0;

  DenseUpdate(const DenseSubspace& dense, const Eigen::MatrixXd& J, const Eigen::Matrix2d& P) {
    // D R Dᵀ: the errors of the flow have unit variance, the constraint takes P of them.
    const Eigen::MatrixXd Lambda = J * P * J.transpose() + dense.P * dense.P.transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(Lambda);
    Eigen::VectorXd inverse = eigen.eigenvalues();
    const double largest = inverse.maxCoeff();
    for (double& value : inverse) {
      const bool zero = value < 1e-9 * largest;
      rank += zero ? 0 : 1;
      value = zero ? 0 : 1 / value;
    }
    const Eigen::MatrixXd& V = eigen.eigenvectors();
    const Eigen::MatrixXd L = P * J.transpose() * V * inverse.asDiagonal() * V.transpose();
    step = -(L * dense.constraint());
    const Eigen::Matrix2d Gamma = Eigen::Matrix2d::Identity() - L * J;
    covariance = Gamma * P * Gamma.transpose() + L * dense.P * dense.P.transpose() * L.transpose();
  }
};

}  // namespace liestat::tests
