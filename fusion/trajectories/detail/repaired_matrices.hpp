// The matrices behind faulty ones: MatrixFault of fusion/convention_diagnosis_types.hpp, undone.
#pragma once

#include <lie/detail/small_eigen.hpp>
#include <fusion/convention_diagnosis_types.hpp>
#include <lie/detail/small_products.hpp>

#include <cmath>

namespace liestat::detail {

using Vector6d = Eigen::Matrix<double, 6, 1>;

/// A matrix with its halves of six coordinates exchanged.
inline Matrix6d halvesExchanged(const Matrix6d& M) {
  Matrix6d X;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) X(i, j) = M((i + 3) % 6, (j + 3) % 6);
  }
  return X;
}
inline bool crossUnknown(const Matrix6d& M) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 3; j < 6; ++j) {
      if (std::isnan(M(i, j))) return true;
    }
  }
  return false;
}
inline bool blocksFinite(const Matrix6d& M) {
  return M.topLeftCorner<3, 3>().allFinite() && M.bottomRightCorner<3, 3>().allFinite();
}
inline Matrix6d withoutCross(Matrix6d M) {
  M.topRightCorner<3, 3>().setZero();
  M.bottomLeftCorner<3, 3>().setZero();
  return M;
}

/// The intended matrix behind a faulty one; both in the order translation, rotation, perturbation of the pose T. NaN
/// where there is none. Faults of rows are the caller's.
inline Matrix6d repaired(MatrixFault fault, const Matrix6d& M, const SE3d& T) {
  const auto axes = [&](const Eigen::Matrix3d& S) {
    Matrix6d B = Matrix6d::Zero();
    B.topLeftCorner<3, 3>() = B.bottomRightCorner<3, 3>() = S;
    return congruence(B, M);
  };
  const auto ofJacobian = [&](const Matrix6d& J) { return congruence(inverse<double, 6>(J), M); };
  Matrix6d C = M;
  switch (fault) {
    case MatrixFault::cross_sign:
      C.topRightCorner<3, 3>() *= -1, C.bottomLeftCorner<3, 3>() *= -1;
      return C;
    case MatrixFault::cross_transposed:
      C.topRightCorner<3, 3>() = M.bottomLeftCorner<3, 3>(), C.bottomLeftCorner<3, 3>() = M.topRightCorner<3, 3>();
      return C;
    case MatrixFault::off_diagonal_half:
    case MatrixFault::off_diagonal_twice: {
      C *= fault == MatrixFault::off_diagonal_half ? 2 : 0.5;
      C.diagonal() = M.diagonal();
      return C;
    }
    case MatrixFault::factor:
    case MatrixFault::factor_averaged: {
      Matrix6d L = Matrix6d::Zero();
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j <= i; ++j) L(i, j) = i == j || fault == MatrixFault::factor ? M(i, j) : 2 * M(i, j);
      }
      return productTransposed(L, L);
    }
    case MatrixFault::factor_transposed: {
      // M = LᵀL: the Cholesky factor of M with its coordinates reversed is L's transpose, reversed.
      Matrix6d reversed;
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) reversed(i, j) = M(5 - i, 5 - j);
      }
      const Cholesky<double, 6> root(reversed);
      if (!root.ok()) return Matrix6d::Constant(not_a_number);
      // root⁻¹ reversed gives the factor itself: F = root⁻¹ reversed is Fᵀ with reversed = F Fᵀ.
      const Matrix6d Ft = root.halfSolve<6>(reversed);  // = Fᵀ
      Matrix6d L;
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) L(i, j) = Ft(5 - i, 5 - j);
      }
      return productTransposed(L, L);
    }
    case MatrixFault::information_factor: {
      Matrix6d U = Matrix6d::Zero();
      for (int i = 0; i < 6; ++i) {
        for (int j = i; j < 6; ++j) U(i, j) = M(i, j);
      }
      const Matrix6d Ut = U.transpose();
      return Cholesky<double, 6>(productTransposed(Ut, Ut)).inverse();
    }
    case MatrixFault::squared:
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) {
          C(i, j) = i == j ? std::sqrt(M(i, i)) : M(i, j) / std::sqrt(std::sqrt(M(i, i) * M(j, j)));
        }
      }
      return C;
    case MatrixFault::matrix_squared: {
      const SymmetricEigen eigen(M);
      return eigen.vectors * eigen.values.cwiseMax(0).cwiseSqrt().asDiagonal() * eigen.vectors.transpose();
    }
    case MatrixFault::inverse_diagonal:
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) C(i, j) = i == j ? 1 / M(i, i) : M(i, j);
      }
      return C;
    case MatrixFault::reversed:
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) C(i, j) = M(5 - i, 5 - j);
      }
      return C;
    case MatrixFault::axes_ned_enu:
      return axes((Eigen::Matrix3d() << 0, 1, 0, 1, 0, 0, 0, 0, -1).finished());
    case MatrixFault::axes_optical:
      return axes((Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished());
    case MatrixFault::axes_from_optical:
      return axes((Eigen::Matrix3d() << 0, -1, 0, 0, 0, -1, 1, 0, 0).finished());
    case MatrixFault::axes_y_up:
      return axes((Eigen::Matrix3d() << 1, 0, 0, 0, 0, -1, 0, 1, 0).finished());
    case MatrixFault::lever_arm_sign: {
      Matrix6d J = T.Adj();
      J.topRightCorner<3, 3>() *= -1;
      return ofJacobian(J);
    }
    case MatrixFault::adjoint_inverse:
      return ofJacobian(T.inverse().Adj());
    case MatrixFault::adjoint_transposed:
      return ofJacobian(T.Adj().transpose());
    case MatrixFault::diagonal_alone:
      return M.diagonal().asDiagonal();
    case MatrixFault::blocks_alone:
      return withoutCross(M);
    default:
      return C;
  }
}

}  // namespace liestat::detail
