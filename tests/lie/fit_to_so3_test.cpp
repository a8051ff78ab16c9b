// SO3::fitToSO3 against the singular value decomposition.

#include <lie/lie.hpp>

#include <Eigen/SVD>
#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace {

using namespace liestat;

constexpr double eps = std::numeric_limits<double>::epsilon();

// The nearest rotation is that of the singular value decomposition, for matrices of either determinant, near and far
// from rotations.
TEST(FitToSO3, IsTheNearestRotation) {
  std::mt19937 generator(5);
  for (int trial = 0; trial < 3000; ++trial) {
    Eigen::Matrix3d M;
    for (int i = 0; i < 9; ++i) M(i) = detail::uniform<double>(generator, -1, 1);
    // From any matrix to nearly a rotation.
    if (trial % 3 == 1) M = SO3d::sampleUniform(generator).matrix() + 1e-3 * M;
    if (trial % 3 == 2) M = SO3d::sampleUniform(generator).matrix() + 1e-12 * M;
    if (trial % 7 == 0) M *= 1e8;
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::Matrix3d U = svd.matrixU(), V = svd.matrixV();
    const double sign = (U * V.transpose()).determinant();
    const Eigen::Matrix3d nearest = U * Eigen::Vector3d(1, 1, sign).asDiagonal() * V.transpose();
    // A perturbation of M turns the result by its size over the least of the sums of two singular values.
    const Eigen::Vector3d s = svd.singularValues();
    const double gap = (s[1] + sign * s[2]) / s[0];
    EXPECT_LE((SO3d::fitToSO3(M).matrix() - nearest).norm(), 64 * eps / gap) << M << "\n gap " << gap;
  }
}
// A rounding of the matrix turns the result by its size over the sum of the two least singular values, one with the sign
// of the determinant, and no more is lost where that is small.
TEST(FitToSO3, LosesNoMoreThanTheMatrixDoes) {
  std::mt19937 generator(6);
  for (const double gap : {1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5}) {
    for (int trial = 0; trial < 100; ++trial) {
      const SO3d U = SO3d::sampleUniform(generator), V = SO3d::sampleUniform(generator);
      const Eigen::Matrix3d S = Eigen::Vector3d(1, 0.5, gap - 0.5).asDiagonal();
      const Eigen::Matrix3d R = SO3d::fitToSO3(U.matrix() * S * V.matrix().transpose()).matrix();
      EXPECT_LE((R - U.matrix() * V.matrix().transpose()).norm(), 16 * eps / gap) << gap;
    }
  }
}
TEST(FitToSO3, OfMatricesWithoutOneNearestRotationIsARotation) {
  for (const Eigen::Matrix3d& M :
       {Eigen::Matrix3d(Eigen::Matrix3d::Zero()), Eigen::Matrix3d(-Eigen::Matrix3d::Identity()),
        Eigen::Matrix3d(Eigen::Vector3d(1, 0, 0).asDiagonal()), Eigen::Matrix3d(Eigen::Matrix3d::Ones())}) {
    const Eigen::Matrix3d R = SO3d::fitToSO3(M).matrix();
    EXPECT_LE((R * R.transpose() - Eigen::Matrix3d::Identity()).norm(), 8 * eps) << M;
    // No rotation is nearer: tr(Rᵀ M) is the sum of the singular values, the least with the sign of the determinant.
    const Eigen::Vector3d s = Eigen::JacobiSVD<Eigen::Matrix3d>(M).singularValues();
    EXPECT_NEAR((R.transpose() * M).trace(), s[0] + s[1] + (M.determinant() < 0 ? -s[2] : s[2]), 1e-7) << M;
  }
  EXPECT_TRUE(SO3d::fitToSO3(Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN())).params().hasNaN());
}

}  // namespace
