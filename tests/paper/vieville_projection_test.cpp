// Viéville, Lingrand and Gaspard 2000, section 3: the properties of the projection (3.6), and what the report says
// differently from what is right, each beside its correction (docs/constrained.md lists them).

#include <support/constrained_models.hpp>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <tuple>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat_test;

/// y = q₀ + q₁ t.
struct Line {
  double t;
  template <class S>
  Eigen::Matrix<S, 1, 1> operator()(const Eigen::Matrix<S, 2, 1>& q, const Eigen::Matrix<S, 1, 1>& y) const {
    return Eigen::Matrix<S, 1, 1>(y[0] - q[0] - q[1] * S(t));
  }
};
/// y = q₀ exp(q₁ t).
struct Growth {
  double t;
  template <class S>
  Eigen::Matrix<S, 1, 1> operator()(const Eigen::Matrix<S, 2, 1>& q, const Eigen::Matrix<S, 1, 1>& y) const {
    using std::exp;
    return Eigen::Matrix<S, 1, 1>(y[0] - q[0] * exp(q[1] * S(t)));
  }
};

using Number = Eigen::Matrix<double, 1, 1>;

/// Times, values, standard deviations, and an equation for each.
template <class Model>
struct Series {
  std::vector<Number> values;
  std::vector<IsotropicNoise<1>> noises;
  std::vector<AutoDiff<Model>> equations;

  Series(const Eigen::Vector2d& q, int n) {
    CounterRng rng(9);
    for (int i = 0; i < n; ++i) {
      const double t = 0.1 * i, sigma = 0.02 * (1 + i % 3);
      noises.emplace_back(sigma);
      equations.push_back(autoDiff(Model{t}));
      const Number zero(0.0);
      values.emplace_back(-equations.back()(q, zero)[0] + sigma * rng.normalVector<1>()[0]);
    }
  }
};

TEST(Projection, LinearMeasurementEquationsGiveWeightedLeastSquares) {
  const Series<Line> series({0.3, -0.7}, 20);
  const auto r =
      constrainedEstimate(Eigen::Vector2d(5, 5), measurements(series.values, series.noises, series.equations));
  Eigen::Matrix2d A = Eigen::Matrix2d::Zero();
  Eigen::Vector2d b = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < series.values.size(); ++i) {
    const Eigen::Vector2d x(1, series.equations[i].f.t);
    const double p = 1 / series.noises[i].covariance()(0, 0);
    A += p * x * x.transpose(), b += p * series.values[i][0] * x;
  }
  ASSERT_TRUE(r.ok());
  EXPECT_EQ(r.iterations, 2) << "the second sees that the first was enough";
  EXPECT_LE((r.parameter - A.ldlt().solve(b)).norm(), 1e-13);
  EXPECT_LE((r.covariance - A.inverse()).norm(), 1e-13 * A.inverse().norm());
  EXPECT_EQ(r.degrees_of_freedom, 18);
}

TEST(Projection, ExplicitEquationsGiveNonlinearLeastSquares) {
  const Series<Growth> series({0.8, 0.6}, 25);
  const auto r =
      constrainedEstimate(Eigen::Vector2d(1, 0), measurements(series.values, series.noises, series.equations),
                          NoConstraint{}, {.tolerance = 1e-11});
  ASSERT_TRUE(r.ok());
  // Gauss–Newton on Σ (y - f)² / σ², to its end.
  Eigen::Vector2d q(1, 0);
  for (int k = 0; k < 50; ++k) {
    Eigen::Matrix2d A = Eigen::Matrix2d::Zero();
    Eigen::Vector2d b = Eigen::Vector2d::Zero();
    for (std::size_t i = 0; i < series.values.size(); ++i) {
      const double t = series.equations[i].f.t, p = 1 / series.noises[i].covariance()(0, 0);
      const Eigen::Vector2d J(std::exp(q[1] * t), q[0] * t * std::exp(q[1] * t));
      A += p * J * J.transpose(), b += p * J * (series.values[i][0] - q[0] * std::exp(q[1] * t));
    }
    q += A.ldlt().solve(b);
  }
  EXPECT_LE((r.parameter - q).norm(), 1e-9);
  EXPECT_EQ(r.degrees_of_freedom, 23);
}

TEST(Projection, AsManyEquationsAsUnknownsGiveNewtonsMethod) {
  // x² + y² = 4, xy = 1: one step is x - C⁻¹ c, and the end a common root.
  struct Both {
    Eigen::Vector2d operator()(const Eigen::Vector2d& q) const { return {q.squaredNorm() - 4, q[0] * q[1] - 1}; }
    ConstraintDerivatives<2, 2> linearize(const Eigen::Vector2d& q) const {
      return {(*this)(q), Eigen::Matrix2d{{2 * q[0], 2 * q[1]}, {q[1], q[0]}}};
    }
  };
  const Both both;
  const Eigen::Vector2d start(2, 0.6);
  ConstrainedOptions<Eigen::Vector2d> options{.max_iterations = 1};
  options.prior = ParameterPrior<Eigen::Vector2d>{start, Eigen::Matrix2d::Identity()};
  const auto one = constrainedEstimate(start, std::tuple<>(), both, options);
  const auto J = both.linearize(start);
  EXPECT_LE((one.parameter - (start - J.by_parameter.inverse() * J.value)).norm(), 1e-14);
  options.max_iterations = 50;
  const auto root = constrainedEstimate(start, std::tuple<>(), both, options);
  ASSERT_TRUE(root.ok());
  EXPECT_LE(both(root.parameter).norm(), 1e-14);
}

TEST(Projection, AMinimalSetIsSolvedExactly) {
  // (21): five points have a conic through them, and no measurement is corrected.
  const Ellipse ellipse(5, 0.01, 2);
  const auto channel = measurements(ellipse.points, IsotropicNoise<2>(0.01), autoDiff(OnConic{}));
  const auto unit_length = autoDiff(UnitLength{});
  ConstrainedEstimator estimator(ellipse.truth, unit_length, ConstrainedOptions<Vector6d>{}, channel);
  while (estimator.iterate()) {
  }
  ASSERT_TRUE(estimator.result().ok());
  EXPECT_EQ(estimator.result().degrees_of_freedom, 0);
  EXPECT_LE(estimator.result().chi2, 1e-15);
  for (std::size_t i = 0; i < 5; ++i) EXPECT_LE(estimator.correction(i).norm(), 1e-9);
}

// ----------------------------------------------------------------------------------------------------------- errata

TEST(ReportsErrata, Equation7IsNotTheExpectationOfTheCriterion) {
  double chi2 = 0;
  const int trials = 400;
  for (int t = 0; t < trials; ++t) {
    const Ellipse ellipse(30, 0.005, static_cast<std::uint64_t>(t));
    const auto r =
        constrainedEstimate(ellipse.truth, measurements(ellipse.points, IsotropicNoise<2>(0.005), autoDiff(OnConic{})),
                            autoDiff(UnitLength{}));
    ASSERT_TRUE(r.ok());
    EXPECT_EQ(r.degrees_of_freedom, 1 + 30 - 6) << "r = p + Σ p_i - (n - rank Q_0)";
    chi2 += r.chi2;
  }
  const int printed = 6 - 1 + 30;  // (7): n - p + Σ p_i
  EXPECT_NEAR(chi2 / trials, 25, 4 * std::sqrt(50. / trials));
  EXPECT_GT(std::abs(chi2 / trials - printed), 20 * std::sqrt(50. / trials));
}

TEST(ReportsErrata, TheInverseOfEquation6IsNotTheCovariance) {
  const RotatedPairs data(5, 1);
  const auto r = constrainedEstimate(elements(data.truth),
                                     measurements(data.pairs, DiagonalNoise<6>(data.sigmas), autoDiff(Rotates{})),
                                     autoDiff(Orthogonal{}));
  ASSERT_TRUE(r.ok());
  // Λ = Z (Zᵀ A Z)⁻¹ Zᵀ has the rank of what the constraints leave free; A⁻¹ knows nothing of them.
  const double printed = Eigen::Matrix<double, 9, 9>(r.information.inverse()).trace();
  EXPECT_GT(printed, 4 * r.covariance.trace());
  Eigen::FullPivLU<Eigen::Matrix<double, 9, 9>> factor;
  factor.setThreshold(1e-9).compute(r.covariance);
  EXPECT_EQ(factor.rank(), 3);
}

TEST(ReportsErrata, Equation18FreezesWhereItStartsOnTheConstraints) {
  // The nearest point of the circle to (0.5, 0), from 0.5 rad away: each tangential step raises |c| to second order, so
  // the report's rule halves it again and again.
  const Eigen::Vector2d x_0(0.5, 0);
  const auto c = [](const Eigen::Vector2d& x) { return x.squaredNorm() - 1; };
  const auto projected = [&](const Eigen::Vector2d& x) -> Eigen::Vector2d {
    const Eigen::Vector2d C = 2 * x;
    const double d = C.dot(x) - c(x);
    return x_0 - C * (C.dot(x_0) - d) / C.squaredNorm();
  };
  Eigen::Vector2d x(std::cos(0.5), std::sin(0.5)), before = x;
  double last = std::abs(c(x));
  x = projected(x);
  for (int k = 0; k < 20000; ++k) {
    if (std::abs(c(x)) < last + 1e-15) {
      last = std::abs(c(x));
      before = x;
      x = projected(x);
    } else {
      x = 0.5 * (x + before);
    }
  }
  EXPECT_GT(std::atan2(before.y(), before.x()), 0.4) << "frozen";
  ConstrainedOptions<Eigen::Vector2d> options;
  options.prior = ParameterPrior<Eigen::Vector2d>{x_0, Eigen::Matrix2d::Identity()};
  const auto ours = constrainedEstimate(Eigen::Vector2d(std::cos(0.5), std::sin(0.5)), std::tuple<>(),
                                        autoDiff(UnitLength{}), options);
  EXPECT_TRUE(ours.ok());
  EXPECT_LE(std::abs(ours.parameter.y()), 1e-9);
  EXPECT_LE(ours.iterations, 12);
}

TEST(ReportsErrata, Section33NeedsARelativeThreshold) {
  // Matrices of any scale are the same to the reduced root; the report's absolute threshold leaves nothing of this one.
  const Eigen::Matrix3d S = 1e-18 * Eigen::Matrix3d{{4, 1, 0}, {1, 3, 1}, {0, 1, 2}};
  EXPECT_LT(S.diagonal().maxCoeff(), 10 * std::numeric_limits<double>::epsilon());
  EXPECT_EQ((detail::ReducedRoot<double, 3>(S).rank()), 3);
  const Eigen::Matrix3d L = detail::closestRoot<double, 3>(S);
  EXPECT_LE((L * L.transpose() - S).norm(), 1e-15 * S.norm());
}

TEST(ReportsErrata, Equation14HasTheOtherTriangle) {
  // Bᵀ = L⁻¹ Cᵀ solves the equations, B = L⁻ᵀ Cᵀ as printed does not.
  CounterRng rng(4);
  Eigen::Matrix4d half;
  Eigen::Matrix<double, 2, 4> C;
  for (int j = 0; j < 4; ++j) half.col(j) = rng.normalVector<4>(), C.col(j) = rng.normalVector<2>();
  const Eigen::Matrix4d Q = half * half.transpose(), L = Q.llt().matrixL();
  const Eigen::Vector4d x_0 = rng.normalVector<4>();
  const Eigen::Vector2d d = rng.normalVector<2>();
  const auto step = [&](const Eigen::Matrix<double, 4, 2>& Bt) -> Eigen::Vector4d {
    const Eigen::Vector4d y_0 = L.transpose() * x_0;
    const Eigen::Vector2d lambda = (Bt.transpose() * Bt).inverse() * (Bt.transpose() * y_0 - d);
    return L.transpose().inverse() * (y_0 - Bt * lambda);
  };
  EXPECT_LE((C * step(L.inverse() * C.transpose()) - d).norm(), 1e-12);
  EXPECT_GT((C * step(L.transpose().inverse() * C.transpose()) - d).norm(), 1e-3);
}

}  // namespace
