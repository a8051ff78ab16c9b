// Singular values and eigenvalues of small matrices (lie/detail/small_orthogonal.hpp, small_eigen.hpp): singular matrices,
// and columns of all sizes.

#include <lie/detail/small_eigen.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_orthogonal.hpp>

#include <Eigen/QR>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace {

using namespace liestat::detail;

constexpr double eps = std::numeric_limits<double>::epsilon();

template <int N>
Eigen::Matrix<double, N, N> matrixOf(const BasicSmallMatrix<N>& rows) {
  Eigen::Matrix<double, N, N> M;
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < N; ++j) M(i, j) = rows(i, j);
  }
  return M;
}

/// A = Uᵀ diag(values) V with the vectors in rows, U and V orthogonal, values descending; a few sweeps.
template <int N>
SmallSvd<N> checked(const Eigen::Matrix<double, N, N>& A) {
  const SmallSvd<N> svd(BasicSmallMatrix<N>::template of<N, N>(A));
  const Eigen::Matrix<double, N, N> U = matrixOf<N>(svd.u), V = matrixOf<N>(svd.v);
  const Eigen::Matrix<double, N, 1> values = Eigen::Map<const Eigen::Matrix<double, N, 1>>(svd.values.data());
  const auto I = Eigen::Matrix<double, N, N>::Identity();
  EXPECT_LE((U * U.transpose() - I).norm(), 100 * eps * N) << A;
  EXPECT_LE((V * V.transpose() - I).norm(), 100 * eps * N) << A;
  EXPECT_LE((U.transpose() * values.asDiagonal() * V - A).norm(), 100 * eps * A.norm()) << A;
  EXPECT_TRUE(std::is_sorted(svd.values.begin(), svd.values.end(), std::greater<>()));
  EXPECT_LE(svd.sweeps, 12) << A;
  return svd;
}

template <int N>
Eigen::Matrix<double, N, N> random(std::mt19937_64& rng) {
  std::normal_distribution<double> normal;
  Eigen::Matrix<double, N, N> A;
  for (int i = 0; i < N * N; ++i) A.data()[i] = normal(rng);
  return A;
}

TEST(SmallMatrix, StepsAndPseudoInversesOfThreeEquations) {
  std::mt19937_64 rng(8);
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::Matrix3d A = random<3>(rng), H = A * A.transpose() + 0.1 * Eigen::Matrix3d::Identity();
    const Eigen::Vector3d b = random<3>(rng).col(0);
    Eigen::Vector3d x;
    ASSERT_TRUE(solveStep(H, b, x));
    // Cofactors lose the square of the condition, at most 1e4 here.
    EXPECT_LE((H * x - b).norm(), 1e-8 * b.norm()) << H;
    int rank = 0;
    const Eigen::Matrix3d all = pseudoInverse(H, rank);
    EXPECT_EQ(rank, 3);
    EXPECT_LE((all * H - Eigen::Matrix3d::Identity()).norm(), 1e-11) << H;
    // Penrose's equations of a matrix of rank two.
    const Eigen::Matrix3d two = A.leftCols<2>() * A.leftCols<2>().transpose(), X = pseudoInverse(two, rank);
    EXPECT_EQ(rank, 2);
    EXPECT_LE((two * X * two - two).norm(), 1e-11 * two.norm()) << two;
    EXPECT_LE((X * two * X - X).norm(), 1e-10 * X.norm()) << two;
    EXPECT_LE((X * two - two * X).norm(), 1e-10) << two;
  }
}

TEST(SmallSvd, OfSingularMatricesEndsAfterAFewSweeps) {
  std::mt19937_64 rng(1);
  for (int trial = 0; trial < 200; ++trial) {
    for (int rank = 1; rank <= 9; ++rank) {
      // Dependent rows; rows of zeros below others; dependent columns.
      Eigen::Matrix<double, 9, 9> A = random<9>(rng), B = random<9>(rng), C = A;
      A.rightCols(9 - rank).setZero();
      C.bottomRows(9 - rank).setZero();
      EXPECT_LE(checked<9>(A * B).value(8), rank < 9 ? 1e-13 : 1e9);
      EXPECT_GT(checked<9>(A * B).value(rank - 1), 1e-9);
      checked<9>(C);
      checked<9>(A);
    }
  }
  checked<9>(Eigen::Matrix<double, 9, 9>::Zero());
  checked<9>(Eigen::Matrix<double, 9, 9>::Ones());
}

TEST(SmallSvd, SmallValuesOfScaledColumnsAreAccurate) {
  // Q diag(d): the values are those of d, over thirty decades, each to its own accuracy.
  std::mt19937_64 rng(2);
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::Matrix<double, 6, 6> Q =
        Eigen::HouseholderQR<Eigen::Matrix<double, 6, 6>>(random<6>(rng)).householderQ();
    Eigen::Matrix<double, 6, 1> d;
    for (int k = 0; k < 6; ++k) d[k] = std::pow(10., -6 * ((k + trial) % 6));
    const SmallSvd<6> svd(BasicSmallMatrix<6>::of<6, 6>(Eigen::Matrix<double, 6, 6>(Q * d.asDiagonal())));
    for (int k = 0; k < 6; ++k) EXPECT_NEAR(svd.value(k) / std::pow(10., -6 * k), 1, 1e-13) << k;
  }
}

/// A V = V diag(values) with V orthogonal and values ascending, within a bound relative to the largest value.
template <class Matrix>
SymmetricEigen<Matrix> checkedEigen(const Matrix& A, double bound) {
  const SymmetricEigen<Matrix> eigen(A);
  using Scalar = typename Matrix::Scalar;
  const Matrix V = eigen.vectors, D = eigen.values.asDiagonal(), I = Matrix::Identity(A.rows(), A.cols());
  EXPECT_LE((A * V - V * D).norm(), Scalar(bound) * A.norm()) << A;
  EXPECT_LE((V.transpose() * V - I).norm(), Scalar(bound)) << A;
  for (Eigen::Index k = 1; k < A.rows(); ++k) EXPECT_LE(eigen.values[k - 1], eigen.values[k]) << A;
  return eigen;
}

TEST(SymmetricEigen, OfIndefiniteSingularAndRepeatedValues) {
  std::mt19937_64 rng(3);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Matrix<double, 6, 6> B = random<6>(rng),
                                      Q = Eigen::HouseholderQR<Eigen::Matrix<double, 6, 6>>(B).householderQ();
    Eigen::Matrix<double, 6, 1> d;
    d << -3, -3, 0, 0, 2, 2;
    const Eigen::Matrix<double, 6, 6> A = Q * d.asDiagonal() * Q.transpose();
    const auto eigen = checkedEigen(Eigen::Matrix<double, 6, 6>(0.5 * (A + A.transpose())), 60 * eps);
    EXPECT_LE((eigen.values - d).norm(), 60 * eps * d.norm()) << A;
    // Sizes known at run time, and the other precision.
    checkedEigen(Eigen::MatrixXd(B + B.transpose()), 60 * eps);
    checkedEigen(Eigen::MatrixXf((B + B.transpose()).cast<float>()), 60 * std::numeric_limits<float>::epsilon());
  }
  checkedEigen(Eigen::Matrix3d(Eigen::Matrix3d::Zero()), eps);
  checkedEigen(Eigen::Matrix3d(Eigen::Matrix3d::Ones()), 8 * eps);
  checkedEigen(Eigen::Matrix2d{{0, 1e-300}, {1e-300, 0}}, 8 * eps);
  checkedEigen(Eigen::Matrix2d{{1, 1e-9}, {1e-9, 1}}, 8 * eps);
}

TEST(SymmetricEigen, SmallValuesOfScaledMatricesAreAccurate) {
  // D C D with a well-conditioned C: each value to its own accuracy over 24 decades, as of its exact inverse.
  std::mt19937_64 rng(4);
  for (int trial = 0; trial < 100; ++trial) {
    Eigen::Matrix3d C = Eigen::Matrix3d::Identity();
    for (const auto& [i, j] : {std::pair(1, 0), std::pair(2, 0), std::pair(2, 1)}) {
      C(i, j) = C(j, i) = std::uniform_real_distribution<double>(-0.3, 0.3)(rng);
    }
    const Eigen::Vector3d d(1, 1e-6, 1e-12);
    const Eigen::Matrix3d A = d.asDiagonal() * C * d.asDiagonal();
    // The largest value of the inverse, which has no cancellation, is the reciprocal of the smallest.
    const Eigen::Matrix3d inverse = d.cwiseInverse().asDiagonal() * C.inverse() * d.cwiseInverse().asDiagonal();
    const SymmetricEigen of(A), of_inverse(inverse);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(of.values[k] * of_inverse.values[2 - k], 1, 1e-13) << A;
  }
}

TEST(SymmetricEigen, ReadsTheLowerTriangleAndReportsWhatHasNoValues) {
  Eigen::Matrix3d A{{2, 9, 9}, {1, 3, 9}, {0.5, -1, 4}};
  const Eigen::Matrix3d symmetric = A.selfadjointView<Eigen::Lower>();
  EXPECT_EQ(SymmetricEigen(A).values, SymmetricEigen(symmetric).values);
  A(1, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(SymmetricEigen(A).values.array().isNaN().all());
  A(1, 0) = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(SymmetricEigen(A).values.array().isNaN().all());
}

}  // namespace
