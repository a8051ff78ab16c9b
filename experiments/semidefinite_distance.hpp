#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>

namespace liestat::experiments {

/// eᵀ Σ⁺ e for a covariance of known rank.
inline double squaredDistance(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance, int rank) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance);
  double sum = 0;
  for (int k = 0; k < rank; ++k) {
    const Eigen::Index i = covariance.rows() - 1 - k;
    const double along = eigen.eigenvectors().col(i).dot(error);
    sum += along * along / eigen.eigenvalues()[i];
  }
  return sum;
}

}  // namespace liestat::experiments
