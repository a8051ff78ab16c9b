// Viéville, Lingrand and Gaspard 2000, section 3: the properties of the projection (3.6), and what the report says
// differently from what is right, each beside its correction (docs/constrained.md lists them).

#include <support/constrained_models.hpp>
#include <stats/measurement_error.hpp>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
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

TEST(ReportsErrata, Section35ConvergesLinearly) {
  // "Quadratic" is what 3.5 says of full steps. On the circle the ratio of successive errors is |1 - ρ|.
  const double rho = 1.3;
  const Eigen::Vector2d x_0(rho, 0);
  Eigen::Vector2d x(std::cos(0.1), std::sin(0.1));
  double last = x.y(), ratio = 0;
  for (int k = 0; k < 12; ++k, last = x.y()) {
    const Eigen::Vector2d C = 2 * x;
    x = x_0 - C * (C.dot(x_0) - (C.dot(x) - x.squaredNorm() + 1)) / C.squaredNorm();
    ratio = std::abs(x.y() / last);
  }
  EXPECT_NEAR(ratio, std::abs(1 - rho), 1e-4);
}

TEST(ReportsErrata, Equation19LacksOneHalf) {
  // c = xᵀ H x + gᵀ x has no third derivative: after α of a step that meets its linear part, c = (1 - α) c + α² h.
  const Eigen::Matrix2d H{{1, 0.3}, {0.3, -2}};
  const Eigen::Vector2d g(1, 2), x(0.7, -0.2);
  const auto c = [&](const Eigen::Vector2d& y) { return y.dot(H * y) + g.dot(y); };
  const Eigen::Vector2d C = 2 * H * x + g, s = -C * c(x) / C.squaredNorm();
  const double alpha = 0.5, printed = s.dot(2 * H * s);
  const auto predicted = [&](double h) { return (1 - alpha) * c(x) + alpha * alpha * h; };
  EXPECT_NEAR(c(x + alpha * s), predicted(printed / 2), 1e-14);
  EXPECT_GT(std::abs(c(x + alpha * s) - predicted(printed)), 1e-3);
}

/// A line that does not go through the origin.
struct OnLine {
  template <class S>
  Eigen::Matrix<S, 1, 1> operator()(const Eigen::Matrix<S, 2, 1>& q, const Eigen::Matrix<S, 2, 1>& m) const {
    return Eigen::Matrix<S, 1, 1>(q[0] * m[0] + q[1] * m[1] - S(1));
  }
};

TEST(ReportsErrata, Equation23TakesTheDerivativeByTheParameter) {
  // The line q·m = 1, whose derivatives by q and m are both of two numbers; only that by m has the unit of the noise.
  const Eigen::Vector2d q(0.4, 0.3), m(3, 1);
  const double sigma = 0.2, c = q.dot(m) - 1, exact = std::pow(c / (q.norm() * sigma), 2);
  const double printed = std::pow(c / (m.norm() * sigma), 2);
  const auto error = measurementError(q, m, IsotropicNoise<2>(sigma), autoDiff(OnLine{}));
  EXPECT_NEAR(error.squared, exact, 1e-13 * exact);
  EXPECT_GT(exact, 30 * printed);
  // The second term of (24) is zero: the corrected measurement obeys the equation.
  EXPECT_LE(error.remaining, 1e-24);
}

/// Appendix A on linear equations: C_i q + D_i m_i = d_i with as many equations, coordinates and parameters, so that the
/// printed products have fitting sizes, and a constraint c_0.
struct LinearProblem {
  static constexpr int n = 2;
  Eigen::Matrix2d Q_0 = spd(1);
  Eigen::Vector2d q_0 = vector(2);
  Eigen::RowVector2d C_0 = vector(3).transpose();
  double d_0 = 0.7;
  std::vector<Eigen::Matrix2d> Q, C, D;
  std::vector<Eigen::Vector2d> m, d;

  LinearProblem() {
    for (std::uint64_t i = 0; i < 3; ++i) {
      Q.push_back(spd(10 + i)), C.push_back(square(20 + i)), D.push_back(square(30 + i));
      m.push_back(vector(40 + i)), d.push_back(vector(50 + i));
    }
  }
  static Eigen::Vector2d vector(std::uint64_t i) { return CounterRng(8, i).normalVector<2>(); }
  static Eigen::Matrix2d square(std::uint64_t i) {
    CounterRng rng(9, i);
    Eigen::Matrix2d A;
    for (int j = 0; j < n; ++j) A.col(j) = rng.normalVector<2>();
    return A;
  }
  static Eigen::Matrix2d spd(std::uint64_t i) {
    return square(i) * square(i).transpose() + 0.1 * Eigen::Matrix2d::Identity();
  }
  int size() const { return n * (1 + static_cast<int>(m.size())); }

  /// Q, the equations and x_0 of all unknowns, as (8) has them.
  struct Compact {
    Eigen::MatrixXd Q, C;
    Eigen::VectorXd x_0, d;
  };
  Compact compact() const {
    const int N = size();
    Compact all{Eigen::MatrixXd::Zero(N, N), Eigen::MatrixXd::Zero(N - 1, N), Eigen::VectorXd(N),
                Eigen::VectorXd(N - 1)};
    all.Q.topLeftCorner<n, n>() = Q_0, all.x_0.head<n>() = q_0, all.C.topLeftCorner<1, n>() = C_0, all.d[0] = d_0;
    for (std::size_t i = 0; i < m.size(); ++i) {
      const int at = n * (1 + static_cast<int>(i)), row = at - n + 1;
      all.Q.block<n, n>(at, at) = Q[i], all.x_0.segment<n>(at) = m[i];
      all.C.block<n, n>(row, 0) = C[i], all.C.block<n, n>(row, at) = D[i], all.d.segment<n>(row) = d[i];
    }
    return all;
  }
  /// x and the multipliers of its equations, by the conditions of the optimum: Q (x - x_0) + Cᵀ λ = 0, C x = d.
  struct Solution {
    Eigen::VectorXd x, lambda;
    Eigen::Vector2d q() const { return x.head<n>(); }
    Eigen::Vector2d corrected(std::size_t i) const { return x.segment<n>(n * (1 + static_cast<int>(i))); }
    Eigen::Vector2d multipliers(std::size_t i) const { return lambda.segment<n>(1 + n * static_cast<int>(i)); }
  };
  Solution solved() const {
    const Compact all = compact();
    const int N = size(), p = N - 1;
    Eigen::MatrixXd K = Eigen::MatrixXd::Zero(N + p, N + p);
    K.topLeftCorner(N, N) = all.Q, K.topRightCorner(N, p) = all.C.transpose(), K.bottomLeftCorner(p, N) = all.C;
    Eigen::VectorXd right(N + p);
    right << all.Q * all.x_0, all.d;
    const Eigen::VectorXd both = K.fullPivLu().solve(right);
    return {both.head(N), both.tail(p)};
  }
  Eigen::Matrix2d S(std::size_t i) const { return D[i] * Q[i].inverse() * D[i].transpose(); }
};

TEST(ReportsErrata, Equations39And40HaveTheObservedMeasurement) {
  const LinearProblem problem;
  const auto found = problem.solved();
  for (std::size_t i = 0; i < problem.m.size(); ++i) {
    const Eigen::Vector2d by_parameter = problem.C[i] * found.q() - problem.d[i];
    const Eigen::Vector2d printed = by_parameter + problem.D[i] * found.corrected(i);
    const Eigen::Vector2d right = by_parameter + problem.D[i] * problem.m[i];
    EXPECT_LE(printed.norm(), 1e-12) << "the equation itself, which is zero and not S λ";
    EXPECT_LE((right - problem.S(i) * found.multipliers(i)).norm(), 1e-12 * right.norm());
    EXPECT_GT(right.norm(), 1e-2);
  }
}

TEST(ReportsErrata, Equation42HasTheOtherSign) {
  const LinearProblem problem;
  const auto found = problem.solved();
  Eigen::Matrix2d A = problem.Q_0;
  Eigen::Vector2d b = problem.Q_0 * problem.q_0 - problem.C_0.transpose() * found.lambda[0], printed = b;
  for (std::size_t i = 0; i < problem.m.size(); ++i) {
    const Eigen::Matrix2d weighed = problem.C[i].transpose() * problem.S(i).inverse();
    A += weighed * problem.C[i];
    b -= weighed * (problem.D[i] * problem.m[i] - problem.d[i]);
    printed += weighed * (problem.D[i] * problem.m[i] - problem.d[i]);
  }
  EXPECT_LE((A * found.q() - b).norm(), 1e-12 * b.norm());
  EXPECT_GT((A * found.q() - printed).norm(), 0.1 * b.norm());
}

TEST(ReportsErrata, Equation45IsTwiceTheCriterionAndNeedsTheConstraints) {
  const LinearProblem problem;
  const auto found = problem.solved();
  Eigen::Matrix2d A = problem.Q_0;
  Eigen::Vector2d b = problem.Q_0 * problem.q_0;
  double s = problem.q_0.dot(b);
  for (std::size_t i = 0; i < problem.m.size(); ++i) {
    const Eigen::Vector2d r = problem.D[i] * problem.m[i] - problem.d[i];
    const Eigen::Matrix2d weighed = problem.C[i].transpose() * problem.S(i).inverse();
    A += weighed * problem.C[i], b -= weighed * r, s += r.dot(problem.S(i).inverse() * r);
  }
  const double printed = found.q().dot(A * found.q()) - 2 * found.q().dot(b) + s;
  const auto all = problem.compact();
  const Eigen::VectorXd moved = found.x - all.x_0;
  const double criterion = 0.5 * moved.dot(all.Q * moved);
  EXPECT_NEAR(printed, 2 * criterion, 1e-11 * criterion);
  // As a function of q, with measurements corrected to it: only along the constraint.
  const auto costAt = [&](const Eigen::Vector2d& q) { return q.dot(A * q) - 2 * q.dot(b) + s; };
  const auto by45 = [&](const Eigen::Vector2d& q) { return (q - found.q()).dot(A * (q - found.q())) + printed; };
  const Eigen::Vector2d across = problem.C_0.transpose(), along(-across.y(), across.x());
  EXPECT_NEAR(by45(found.q() + along), costAt(found.q() + along), 1e-10 * criterion);
  EXPECT_GT(std::abs(by45(found.q() + across) - costAt(found.q() + across)), 0.1 * criterion);
}

/// The listing of fig. 17 with one line as it is printed, or with none.
enum class Fig17 { corrected, whitening, sums, constraint, correction, two_factors };
Eigen::VectorXd listing(const LinearProblem& problem, Fig17 slip) {
  Eigen::Matrix2d A = problem.Q_0;
  Eigen::Vector2d b = problem.Q_0 * problem.q_0;
  std::vector<Eigen::Vector2d> corrected;
  std::vector<Eigen::Matrix2d> K;
  for (std::size_t i = 0; i < problem.m.size(); ++i) {
    const Eigen::Matrix2d L_Q = problem.Q[i].llt().matrixL();
    const Eigen::Matrix2d D_t = L_Q.inverse() * problem.D[i].transpose();
    const Eigen::Matrix2d L = Eigen::Matrix2d(D_t.transpose() * D_t).llt().matrixL();
    const Eigen::Matrix2d C = slip == Fig17::whitening
                                  ? Eigen::Matrix2d((L.inverse() * problem.C[i].transpose()).transpose())
                                  : Eigen::Matrix2d(L.inverse() * problem.C[i]);
    const Eigen::Vector2d d = L.inverse() * (problem.d[i] - problem.D[i] * problem.m[i]);
    // D V of the measurement: L_i stands for the roots of Q_i and of S_i.
    const Eigen::Matrix2d back = slip == Fig17::two_factors
                                     ? Eigen::Matrix2d(L.transpose().inverse() * L.inverse() * D_t)
                                     : Eigen::Matrix2d(L_Q.transpose().inverse() * D_t * L.transpose().inverse());
    corrected.push_back(problem.m[i] + back * d), K.push_back(back * C);
    A += slip == Fig17::sums ? Eigen::Matrix2d(C * C.transpose()) : Eigen::Matrix2d(C.transpose() * C);
    b += C.transpose() * d;
  }
  const Eigen::Matrix2d R = A.llt().matrixL();
  Eigen::Vector2d y = R.inverse() * b;
  const Eigen::Vector2d C_0 = R.inverse() * problem.C_0.transpose();
  const double lambda = (C_0.dot(y) - problem.d_0) / C_0.squaredNorm();
  y -= lambda * (slip == Fig17::constraint ? Eigen::Vector2d(problem.C_0.transpose()) : C_0);
  Eigen::VectorXd x(problem.size());
  const Eigen::Vector2d q = R.transpose().inverse() * y;
  x.head<2>() = q;
  for (std::size_t i = 0; i < K.size(); ++i) {
    const Eigen::Matrix2d k = slip == Fig17::correction ? Eigen::Matrix2d(K[i].transpose()) : K[i];
    x.segment<2>(2 * (1 + static_cast<int>(i))) = corrected[i] - k * q;
  }
  return x;
}

TEST(ReportsErrata, Fig17sListingNeedsFiveCorrections) {
  const LinearProblem problem;
  const Eigen::VectorXd exact = problem.solved().x;
  EXPECT_LE((listing(problem, Fig17::corrected) - exact).norm(), 1e-12 * exact.norm());
  for (const Fig17 slip : {Fig17::whitening, Fig17::sums, Fig17::constraint, Fig17::correction, Fig17::two_factors}) {
    EXPECT_GT((listing(problem, slip) - exact).norm(), 0.02 * exact.norm()) << static_cast<int>(slip);
  }
}

TEST(ReportsErrata, AppendixBsDegreesOfFreedomAreThoseOfTheFittedSet) {
  // E Σ ‖m̃ - m̄‖² = n - p + Σ (n_i - p_i): the dimension of what is fitted, exactly the trace of the projection. (7) counts
  // p_i in its place, which is right by chance where n_i = 2 p_i.
  constexpr int n = 3, p = 1, measured = 5, n_i = 4, p_i = 1, size = n + measured * n_i, rows = p + measured * p_i;
  Eigen::MatrixXd C = Eigen::MatrixXd::Zero(rows, size);
  CounterRng rng(12);
  C.topLeftCorner<1, n>() = rng.normalVector<n>().transpose();
  for (int i = 0; i < measured; ++i) {
    C.block<1, n>(1 + i, 0) = rng.normalVector<n>().transpose();
    C.block<1, n_i>(1 + i, n + i * n_i) = rng.normalVector<n_i>().transpose();
  }
  // Measurements with Q_i = I that obey C x = 0, and no prior: m̃ = P m projects on the m of all such x.
  const Eigen::MatrixXd free = Eigen::FullPivLU<Eigen::MatrixXd>(C).kernel();
  const Eigen::MatrixXd basis = free.bottomRows(measured * n_i);
  const Eigen::MatrixXd P = basis * (basis.transpose() * basis).inverse() * basis.transpose();
  EXPECT_NEAR(P.trace(), n - p + measured * (n_i - p_i), 1e-9);
  EXPECT_GT(std::abs(P.trace() - (n - p + measured * p_i)), 5);
  EXPECT_NEAR(measured * n_i - P.trace(), p + measured * p_i - n, 1e-9) << "the residual has the others";
}

}  // namespace
