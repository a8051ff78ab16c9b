// The step of a constrained estimate: linear equations, which it solves at once, against a dense reference; what does
// not change it; singular information; square roots of singular matrices.

#include <lie/detail/small_reduced.hpp>
#include <lie/rn.hpp>
#include <stats/constrained.hpp>
#include <stats/random.hpp>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <tuple>
#include <vector>

namespace {

using namespace liestat;

constexpr int N = 5, K = 4, P = 2, p = 2;
constexpr std::size_t M = 20;
using Parameter = Eigen::Matrix<double, N, 1>;
using Measurement = Eigen::Matrix<double, K, 1>;

template <int Rows, int Cols>
Eigen::Matrix<double, Rows, Cols> random(CounterRng& rng) {
  Eigen::Matrix<double, Rows, Cols> A;
  for (int j = 0; j < Cols; ++j) A.col(j) = rng.normalVector<Rows>();
  return A;
}

/// C q + D m = d.
struct LinearEquation {
  Eigen::Matrix<double, P, N> C;
  Eigen::Matrix<double, P, K> D;
  Eigen::Matrix<double, P, 1> d;

  Eigen::Matrix<double, P, 1> operator()(const Parameter& q, const Measurement& m) const { return C * q + D * m - d; }
  EquationDerivatives<P, N, K> linearize(const Parameter& q, const Measurement& m) const {
    return {(*this)(q, m), C, D};
  }
};

struct Problem {
  std::vector<LinearEquation> equations;
  LinearConstraint<p, N> constraint;
  std::vector<Measurement> measured;
  std::vector<Eigen::Matrix<double, K, K>> information;
  Parameter start, prior;

  explicit Problem(std::uint64_t seed, int rank = K) {
    CounterRng rng(seed);
    constraint = {random<p, N>(rng), random<p, 1>(rng)};
    start = random<N, 1>(rng), prior = random<N, 1>(rng);
    for (std::size_t i = 0; i < M; ++i) {
      equations.push_back({random<P, N>(rng), random<P, K>(rng), random<P, 1>(rng)});
      measured.push_back(random<K, 1>(rng));
      const Eigen::Matrix<double, K, K> half = random<K, K>(rng);
      information.push_back(half.leftCols(rank) * half.leftCols(rank).transpose());
    }
  }

  struct Solution {
    ConstrainedResult<Parameter> result;
    Eigen::VectorXd x;
  };
  Solution solved(const ConstrainedOptions<Parameter>& options) const {
    std::vector<InformationNoise<K>> noises(information.begin(), information.end());
    const auto channel = measurements(measured, noises, equations);
    ConstrainedEstimator estimator(start, constraint, options, channel);
    while (estimator.iterate()) {
    }
    Solution s{estimator.result(), Eigen::VectorXd(N + static_cast<int>(M) * K)};
    s.x.head<N>() = s.result.parameter;
    for (std::size_t i = 0; i < M; ++i) s.x.segment<K>(N + static_cast<int>(i) * K) = estimator.corrected()[i];
    return s;
  }

  /// The limit ν → 0 of information + ν I, with dense decompositions: least in ‖·‖_Q, then nearest to x_0.
  Eigen::VectorXd reference(const Parameter& q_0, const Eigen::Matrix<double, N, N>& Q_0) const {
    const int size = N + static_cast<int>(M) * K, rows = p + static_cast<int>(M) * P;
    Eigen::MatrixXd Q = Eigen::MatrixXd::Zero(size, size), C = Eigen::MatrixXd::Zero(rows, size);
    Eigen::VectorXd x_0(size), d(rows);
    Q.topLeftCorner<N, N>() = Q_0, x_0.head<N>() = q_0;
    C.topLeftCorner<p, N>() = constraint.G, d.head<p>() = constraint.f;
    for (std::size_t i = 0; i < M; ++i) {
      const int at = N + static_cast<int>(i) * K, row = p + static_cast<int>(i) * P;
      Q.block<K, K>(at, at) = information[i], x_0.segment<K>(at) = measured[i];
      C.block<P, N>(row, 0) = equations[i].C, C.block<P, K>(row, at) = equations[i].D;
      d.segment<P>(row) = equations[i].d;
    }
    const Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> factor(C);
    const Eigen::VectorXd z = factor.solve(d - C * x_0);
    const Eigen::MatrixXd Z = Eigen::FullPivLU<Eigen::MatrixXd>(C).kernel();
    const Eigen::MatrixXd basis =
        Eigen::HouseholderQR<Eigen::MatrixXd>(Z).householderQ() * Eigen::MatrixXd::Identity(size, Z.cols());
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(Q);
    const Eigen::MatrixXd root =
        eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() * eigen.eigenvectors().transpose();
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> half;
    half.setThreshold(1e-11);
    half.compute(root * basis);
    return x_0 + z + basis * half.solve(-root * z);
  }
};

TEST(ConstrainedStep, AgreesWithTheDenseReference) {
  for (const double scale : {1.0, 1e-4, 0.0}) {
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      const Problem problem(seed);
      const Eigen::Matrix<double, N, N> Q_0 = scale * Eigen::Matrix<double, N, N>::Identity();
      const auto found =
          problem.solved({.prior = ParameterPrior<Parameter>{problem.prior, Q_0}, .noise = StatedNoise::trusted});
      const Eigen::VectorXd expected = problem.reference(problem.prior, Q_0);
      ASSERT_EQ(found.result.end, ConstrainedEnd::converged) << name(found.result.end);
      EXPECT_LE((found.x - expected).norm(), 1e-9 * expected.norm()) << scale << ", seed " << seed;
      // Linear equations are solved by the first step; the second sees that.
      EXPECT_EQ(found.result.iterations, 2);
      EXPECT_LE(found.result.equation_error, 1e-18 * (1 + found.result.chi2));
      EXPECT_EQ(found.result.degrees_of_freedom, p + P * static_cast<int>(M) - (scale > 0 ? 0 : N));
      EXPECT_EQ(found.result.free_parameters, N - p);
    }
  }
}

TEST(ConstrainedStep, EliminatesFreeDirectionsExactly) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Problem problem(seed, 3);
    const auto found = problem.solved({.noise = StatedNoise::trusted});
    ASSERT_TRUE(found.result.ok()) << name(found.result.end);
    const Eigen::VectorXd expected = problem.reference(problem.start, Eigen::Matrix<double, N, N>::Zero());
    EXPECT_LE((found.x - expected).norm(), 1e-11 * expected.norm()) << seed;
    // One of the two equations of each measurement finds its free direction.
    EXPECT_EQ(found.result.equations, static_cast<int>(M));
    EXPECT_EQ(found.result.dropped_equations, 0);
    // All equations hold, the one that was used up included.
    for (std::size_t i = 0; i < M; ++i) {
      const Measurement m = found.x.segment<K>(N + static_cast<int>(i) * K);
      EXPECT_LE(problem.equations[i](found.result.parameter, m).norm(), 1e-12 * expected.norm());
    }
  }
}

TEST(ConstrainedStep, MeasurementsThatAreFreeInAllTheirEquationsSayNothing) {
  const Problem problem(3, 2);
  const auto found = problem.solved({});
  EXPECT_EQ(found.result.uninformative, M);
  EXPECT_EQ(found.result.end, ConstrainedEnd::too_few);
  EXPECT_EQ(found.result.unobservable, N - p);
  EXPECT_FALSE(found.result.covariance.allFinite());
}

// -------------------------------------------------------------------------------------------------------- the roots

TEST(ClosestRoot, ReplacesSmallPivotsRelativeToTheMatrix) {
  CounterRng rng(5);
  const Eigen::Matrix<double, 4, 3> half = random<4, 3>(rng);
  const Eigen::Matrix4d S = half * half.transpose();
  for (const double scale : {1.0, 1e-18, 1e18}) {
    const Eigen::Matrix4d L = detail::closestRoot<double, 4>(scale * S);
    EXPECT_TRUE(L.isLowerTriangular());
    EXPECT_GT(L.diagonal().minCoeff(), 0);
    EXPECT_LE((L * L.transpose() - scale * S).norm(), 1e-14 * scale * S.norm()) << scale;
  }
  EXPECT_EQ((detail::closestRoot<double, 4>(Eigen::Matrix4d::Zero())), Eigen::Matrix4d::Zero());
}

TEST(ReducedRoot, KeepsIndependentRows) {
  CounterRng rng(6);
  Eigen::Matrix<double, 5, 3> C = random<5, 3>(rng);
  C.row(1) = 2 * C.row(0);                  // redundant
  C.row(3).setZero();                       // a gradient of zero
  C.row(4) = 1e-9 * (C.row(0) - C.row(2));  // redundant, of another scale
  const Eigen::Matrix<double, 5, 5> S = C * C.transpose();
  const detail::ReducedRoot<double, 5> first(S, detail::Pivoting::first);
  ASSERT_EQ(first.rank(), 2);
  EXPECT_EQ(first.row(0), 0);
  EXPECT_EQ(first.row(1), 2);
  const detail::ReducedRoot<double, 5> largest(S);
  EXPECT_EQ(largest.rank(), 2);
  for (const auto& root : {first, largest}) {
    // Whitened rows are orthonormal: L⁻¹ S L⁻ᵀ = I on those that are kept.
    const Eigen::Matrix<double, 5, 5> half = root.halfSolve<5>(S);
    const Eigen::Matrix<double, 5, 5> whole = root.halfSolve<5>(Eigen::Matrix<double, 5, 5>(half.transpose()));
    EXPECT_LE((whole.topLeftCorner<2, 2>() - Eigen::Matrix2d::Identity()).norm(), 1e-9);
    EXPECT_EQ(whole.bottomRows<3>().norm(), 0);
    // (L⁻ᵀ y)ᵀ x = yᵀ L⁻¹ x.
    const Eigen::Matrix<double, 5, 1> x = rng.normalVector<5>(), y = root.halfSolve<1>(rng.normalVector<5>());
    EXPECT_NEAR(root.halfSolveTransposed(y).dot(x), y.dot(root.halfSolve<1>(x)), 1e-12 * x.norm() * y.norm() * 1e9);
  }
  Eigen::Matrix2d broken = Eigen::Matrix2d::Constant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ((detail::ReducedRoot<double, 2>(broken).rank()), 0);
}

}  // namespace
