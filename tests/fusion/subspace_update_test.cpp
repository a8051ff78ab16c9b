// The compact form of the subspace constraint against the printed, dense one, and its derivatives against differences.
#include <experiments/motion_scene.hpp>
#include <fusion/motion/flow_rows.hpp>
#include <fusion/motion/search.hpp>
#include <fusion/motion/subspace_update.hpp>
#include <fusion/two_view/errors.hpp>
#include <lie/product.hpp>
#include <stats/implicit_ekf.hpp>
#include <support/dense_subspace.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include <cmath>
#include <functional>
#include <vector>

namespace {

using namespace liestat;
using experiments::MotionScene;
using experiments::MotionWorld;
using tests::DenseSubspace;
using tests::DenseUpdate;

/// A frame at a direction that is not the true one, with errors of unequal sizes.
struct Example {
  std::vector<FlowPoint<double>> points;
  S2d direction;
  Eigen::Vector3d V;
  Eigen::Matrix<double, 3, 2> E;
  std::vector<FlowRow<double>> rows;
  FlowRotationSums<double> rotation;
  RotationPrior<double> prior;
  Eigen::Vector3d Omega;
  SubspaceSums<double> sums;

  explicit Example(std::uint64_t seed, MotionWorld world = MotionWorld::general, bool gyroscope = false) {
    MotionScene scene({.world = world, .sigma = 2}, 7, seed);
    scene.advance();
    CounterRng rng(8, seed);
    for (PointPair pair : scene.pairs) {
      pair.sigma *= rng.uniform(0.5, 2);
      points.push_back(flowOf(pair, Flow::midpoint));
    }
    const Eigen::Vector2d off = 0.3 * rng.normalVector<2>();
    direction = exp(S2d(scene.velocity), off);
    if (gyroscope) {
      prior.mean = scene.rotation + 0.01 * rng.normalVector<3>();
      prior.information = 3e3 * Eigen::Matrix3d::Identity();
    }
    at(direction);
  }
  void at(const S2d& d) {
    direction = d;
    V = d.unit_vector();
    E = ManifoldTraits<S2d>::placement(d).matrix().leftCols<2>();
    rows.resize(points.size());
    flowRows<double>(points, V, rows);
    rotation = rotationSums<double>(rows);
    Omega = rotation.solve(prior);
    sums = subspaceSums<double>(points, rows, E, Omega, rotation.M);
  }
  FrameInformation<double, 2> information() const { return eliminateRotation(sums, Omega, prior); }
  double cost(const Eigen::Vector2d& xi) const {
    std::vector<FlowRow<double>> scratch(points.size());
    return subspaceCost(points, exp(direction, xi).unit_vector(), scratch, prior);
  }
};

constexpr std::uint64_t cases = 20;

TEST(SubspaceUpdate, ProjectorIsThatOfTheNormals) {
  // P = Nᵀ(I - H H⁺) N with N = blkdiag(nᵀ), H = rows hᵀ, of unit weights after the whitening.
  for (std::uint64_t seed = 0; seed < cases; ++seed) {
    const Example x(seed);
    const DenseSubspace dense(x.points, x.V);
    const auto n = static_cast<Eigen::Index>(x.points.size());
    Eigen::MatrixXd N = Eigen::MatrixXd::Zero(n, 2 * n), H(n, 3);
    for (Eigen::Index i = 0; i < n; ++i) {
      const FlowRow<double>& row = x.rows[static_cast<std::size_t>(i)];
      N(i, 2 * i) = row.n0, N(i, 2 * i + 1) = row.n1;
      H.row(i) << row.h0, row.h1, row.h2;
      H.row(i) *= std::sqrt(row.weight);
    }
    const Eigen::MatrixXd Q = Eigen::HouseholderQR<Eigen::MatrixXd>(H).householderQ() * Eigen::MatrixXd::Identity(n, 3);
    const Eigen::MatrixXd compact = N.transpose() * (Eigen::MatrixXd::Identity(n, n) - Q * Q.transpose()) * N;
    EXPECT_LE((dense.P - compact).cwiseAbs().maxCoeff(), 1e-12) << "seed " << seed;
    EXPECT_NEAR(dense.P.trace(), static_cast<double>(n - 3), 1e-10);
  }
}

TEST(SubspaceUpdate, CostDepthsAndRotationAreTheLeastSquaresSolution) {
  for (std::uint64_t seed = 0; seed < cases; ++seed) {
    const Example x(seed);
    const DenseSubspace dense(x.points, x.V);
    const auto n = static_cast<Eigen::Index>(x.points.size());
    EXPECT_NEAR(x.sums.cost, dense.constraint().squaredNorm(), 1e-10 * x.sums.cost);
    EXPECT_LE((x.Omega - dense.p.tail<3>()).norm(), 1e-11);
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      EXPECT_NEAR(flowResidual(x.points[k], x.rows[k], x.Omega).rho, dense.p[i], 1e-10);
    }
    // At the minimum over the rotation its gradient vanishes.
    EXPECT_LE(x.sums.bo.norm(), 1e-9 * x.rotation.right.norm());
  }
}

TEST(SubspaceUpdate, RowIsTheContinuousEpipolarConstraint) {
  // |a| e = (X̃ × V)·(ẋ~ - Ω × X̃), and h = X̃ × (X̃ × V)/|a|, for any rotation.
  for (std::uint64_t seed = 0; seed < cases; ++seed) {
    const Example x(seed);
    const Eigen::Vector3d Omega = CounterRng(9, seed).normalVector<3>();
    for (std::size_t i = 0; i < x.points.size(); ++i) {
      const FlowPoint<double>& p = x.points[i];
      const Eigen::Vector3d X(p.x, p.y, 1), flow(p.u, p.v, 0);
      const double e = flowResidual(p, x.rows[i], Omega).e / x.rows[i].inverse_length;
      EXPECT_NEAR(e, X.cross(x.V).dot(flow - Omega.cross(X)), 1e-14);
      const Eigen::Vector3d h = X.cross(X.cross(x.V)) * x.rows[i].inverse_length;
      EXPECT_LE((h - Eigen::Vector3d(x.rows[i].h0, x.rows[i].h1, x.rows[i].h2)).norm(), 1e-13);
    }
  }
}

TEST(SubspaceUpdate, CompactUpdateIsTheDenseOne) {
  for (std::uint64_t seed = 0; seed < cases; ++seed) {
    const Example x(seed);
    const DenseSubspace dense(x.points, x.V);
    const Eigen::MatrixXd J = dense.jacobian(x.points, x.E);
    Eigen::Matrix2d P;
    P << 0.04, 0.01, 0.01, 0.02;
    const DenseUpdate printed(dense, J, P);
    EXPECT_EQ(printed.rank, static_cast<Eigen::Index>(x.points.size()) - 3);
    FilterCovariance<double, 2> compact{P, P};
    const FilterStep<double, 2> step = updateCovariance(compact, x.information(), 100.);
    EXPECT_LE((step.step - printed.step).norm(), 1e-10 * (1 + printed.step.norm()));
    EXPECT_LE((compact.gain - printed.covariance).norm(), 1e-10 * compact.gain.norm());
    // The same P in the two-sided form where the information is that of Gauss-Newton.
    FrameInformation<double, 2> plain = x.information();
    plain.corrected = plain.gauss_newton;
    FilterCovariance<double, 2> joseph{P, P};
    updateCovariance(joseph, plain, 100.);
    EXPECT_LE((joseph.reported - joseph.gain).norm(), 1e-12 * joseph.gain.norm());
  }
}

using Motion = Product<S2d, Eigen::Vector3d>;

/// e(V, Ω, ẋ) = nᵀ(ẋ - B Ω) = 0 at a fixed point, as the general filter wants it.
struct FlowEquation {
  FlowPoint<double> at;
  EquationDerivatives<1, 5, 2> linearize(const Motion& motion, const Eigen::Vector2d& flow) const {
    FlowPoint<double> p = at;
    p.u = flow.x(), p.v = flow.y();
    const S2d& direction = motion.get<0>();
    const FlowRow<double> row = flowRow(p, Eigen::Vector3d(direction.unit_vector()));
    const FlowResidual<double> r = flowResidual(p, row, motion.get<1>());
    const Eigen::Matrix<double, 3, 2> E = ManifoldTraits<S2d>::placement(direction).matrix().leftCols<2>();
    EquationDerivatives<1, 5, 2> J;
    J.value << r.e;
    J.by_parameter << -r.along * flowTurn(p, row, E), -row.h0, -row.h1, -row.h2;
    J.by_measurement << row.n0, row.n1;
    return J;
  }
};

/// The general filter's update by the same flows, its covariance still in the frame at the prior's mean.
struct GeneralUpdate {
  FilterUpdate<Motion> result;
  SquareOf<Motion> covariance;

  GeneralUpdate(const Gaussian<Motion>& prior, const std::vector<FlowPoint<double>>& points) {
    ImplicitEkf<Motion> filter(prior);
    result = filter.updateAll([&](auto& sums) {
      for (const FlowPoint<double>& p : points) {
        sums.add(Eigen::Vector2d(p.u, p.v), IsotropicNoise<2>(std::sqrt(p.variance)), FlowEquation{p});
      }
    });
    const SquareOf<Motion> back = detail::expJacobian(prior.mean, result.step).inverse();
    covariance = back * filter.state().covariance * back.transpose();
  }
};

TEST(SubspaceUpdate, BothFiltersAreTheImplicitFilter) {
  for (std::uint64_t seed = 0; seed < cases; ++seed) {
    const Example x(seed);
    SquareOf<Motion> P = SquareOf<Motion>::Zero();
    P.topLeftCorner<2, 2>() << 0.04, 0.01, 0.01, 0.02;
    // Rotation as a state, as in the essential filter.
    P.bottomRightCorner<3, 3>() = 1e-4 * Eigen::Matrix3d::Identity();
    P(0, 3) = P(3, 0) = 5e-4;
    const GeneralUpdate essential({Motion(x.direction, x.Omega), P}, x.points);
    FilterCovariance<double, 5> wide{P, P};
    const FilterStep<double, 5> step = updateCovariance(wide, keepRotation(x.sums, x.Omega, x.prior), 100.);
    EXPECT_EQ(essential.result.status, FilterStatus::ok);
    EXPECT_LE((step.step - essential.result.step).norm(), 1e-10 * (1 + step.step.norm()));
    EXPECT_LE((wide.gain - essential.covariance).norm(), 1e-10 * wide.gain.norm());
    EXPECT_NEAR(x.sums.cost - step.reduction, essential.result.nis, 1e-10 * x.sums.cost);
    // Rotation eliminated, as in the subspace filter: one of which nothing is known, at the value that fits best.
    P.topRightCorner<2, 3>().setZero(), P.bottomLeftCorner<3, 2>().setZero();
    P.bottomRightCorner<3, 3>() = 1e4 * Eigen::Matrix3d::Identity();
    const GeneralUpdate subspace({Motion(x.direction, x.Omega), P}, x.points);
    FilterCovariance<double, 2> narrow{P.topLeftCorner<2, 2>(), P.topLeftCorner<2, 2>()};
    const FilterStep<double, 2> turn = updateCovariance(narrow, x.information(), 100.);
    EXPECT_LE((turn.step - subspace.result.step.head<2>()).norm(), 1e-6 * (1 + turn.step.norm()));
    EXPECT_LE((narrow.gain - subspace.covariance.topLeftCorner<2, 2>()).norm(), 1e-6 * narrow.gain.norm());
    EXPECT_NEAR(x.sums.cost - turn.reduction, subspace.result.nis, 1e-6 * x.sums.cost);
  }
}

TEST(SubspaceUpdate, GradientAndJacobiansByDifferences) {
  const double h = 1e-5;
  for (std::uint64_t seed = 0; seed < cases; ++seed) {
    for (const bool gyroscope : {false, true}) {
      const Example x(seed, MotionWorld::general, gyroscope);
      const Eigen::Vector2d g = x.information().gradient;
      for (int k = 0; k < 2; ++k) {
        const Eigen::Vector2d d = h * Eigen::Vector2d::Unit(k);
        const double slope = (x.cost(d) - x.cost(-d)) / (4 * h);
        EXPECT_NEAR(g[k], slope, 1e-6 * (1 + g.norm())) << "seed " << seed;
        Example plus = x, minus = x;
        plus.at(exp(x.direction, d)), minus.at(exp(x.direction, Eigen::Vector2d(-d)));
        for (std::size_t i = 0; i < x.points.size(); ++i) {
          // The row at a fixed rotation.
          const FlowResidual<double> r = flowResidual(x.points[i], x.rows[i], x.Omega);
          const double G = -r.along * flowTurn(x.points[i], x.rows[i], x.E)[k];
          const double by_difference = (flowResidual(x.points[i], plus.rows[i], x.Omega).e -
                                        flowResidual(x.points[i], minus.rows[i], x.Omega).e) /
                                       (2 * h);
          EXPECT_NEAR(G, by_difference, 1e-6 * (1 + std::abs(G)));
        }
      }
    }
  }
}

TEST(SubspaceUpdate, SecondDerivativesMakeTheExactHessian) {
  // C, and the term that the filter leaves out as its mean is zero: Σ w e along (nAᵀ tA + tAᵀ nA)/|a|².
  const double h = 1e-4;
  for (std::uint64_t seed = 0; seed < cases; ++seed) {
    for (const bool gyroscope : {false, true}) {
      const Example x(seed, MotionWorld::general, gyroscope);
      Eigen::Matrix2d exact = x.information().corrected;
      for (std::size_t i = 0; i < x.points.size(); ++i) {
        const FlowRow<double>& row = x.rows[i];
        const FlowResidual<double> r = flowResidual(x.points[i], row, x.Omega);
        const Eigen::Matrix<double, 2, 2> AE = flowByVelocity(x.points[i].x, x.points[i].y) * x.E;
        const Eigen::RowVector2d nA = Eigen::RowVector2d(row.n0, row.n1) * AE;
        const Eigen::RowVector2d tA = Eigen::RowVector2d(row.n1, -row.n0) * AE;
        exact += row.weight * r.e * r.along * row.inverse_length * row.inverse_length *
                 (nA.transpose() * tA + tA.transpose() * nA);
      }
      Eigen::Matrix2d differences;
      for (int i = 0; i < 2; ++i) {
        for (int k = 0; k < 2; ++k) {
          const Eigen::Vector2d a = h * Eigen::Vector2d::Unit(i), b = h * Eigen::Vector2d::Unit(k);
          differences(i, k) = (x.cost(a + b) - x.cost(a - b) - x.cost(b - a) + x.cost(-a - b)) / (8 * h * h);
        }
      }
      // Fourth derivatives times h² and the rounding of the cost over h².
      EXPECT_LE((exact - differences).norm(), 2e-6 * (x.sums.Hxx.norm() + x.sums.cost)) << "seed " << seed;
    }
  }
}

TEST(SubspaceUpdate, VarianceOfAForwardDifference) {
  // e as a function of the noisy y₁ and y₂, at the true motion, by differences.
  const double h = 1e-6;
  for (std::uint64_t seed = 0; seed < cases; ++seed) {
    MotionScene scene({.world = MotionWorld::general, .sigma = 1, .rotation = 15}, 7, seed);
    scene.advance();
    const Eigen::Vector3d V = scene.velocity.normalized(), Omega = scene.rotation;
    for (PointPair pair : scene.pairs) {
      pair.frames = 1.5;
      const auto error = [&](const PointPair& of) {
        const FlowPoint<double> p = flowOf(of, Flow::forward);
        return flowResidual(p, flowRow(p, V), Omega).e;
      };
      double squared = 0;
      for (int k = 0; k < 2; ++k) {
        for (Eigen::Vector2d PointPair::*place : {&PointPair::first, &PointPair::second}) {
          PointPair plus = pair, minus = pair;
          (plus.*place)[k] += h, (minus.*place)[k] -= h;
          const double slope = (error(plus) - error(minus)) / (2 * h);
          squared += slope * slope;
        }
      }
      const FlowPoint<double> p = flowOf(pair, Flow::forward);
      const FlowRow<double> row = flowRow(p, V);
      const double rho = flowResidual(p, row, Omega).rho, variance = forwardVariance(p, row, rho, V, Omega);
      // The turn of n with the position, times e, is not in it: second order in the noise.
      const double e = error(pair);
      EXPECT_NEAR(variance / (pair.sigma * pair.sigma), squared,
                  0.01 * squared + 10 * std::abs(e) * row.inverse_length * std::sqrt(squared));
    }
  }
}

TEST(SubspaceUpdate, DiscreteFlowIsTheEpipolarConstraint) {
  for (std::uint64_t seed = 0; seed < cases; ++seed) {
    MotionScene scene({.world = MotionWorld::general, .sigma = 1, .rotation = 20}, 7, seed);
    scene.advance();
    const Eigen::Matrix3d R = SO3d::exp(scene.rotation).matrix();
    const Eigen::Vector3d T = scene.translation.normalized();
    const Eigen::Matrix3d F = detail::skew(T) * R;
    for (const PointPair& pair : scene.pairs) {
      const FlowPoint<double> p = flowAfter(R, pair);
      const FlowRow<double> row = flowRow(p, T);
      const Eigen::Vector3d turned = R * pair.first.homogeneous(), second = pair.second.homogeneous();
      Eigen::Matrix3d columns;
      columns << turned / turned.z(), T, second;
      const double e = flowResidual(p, row, Eigen::Vector3d::Zero().eval()).e;
      EXPECT_NEAR(e / row.inverse_length, columns.determinant(), 1e-14);
      // Sampson's error but for the size of the flow, which changes the normalisation in second order.
      const double sampson = epipolarError(F, {pair.first.x(), pair.first.y(), pair.second.x(), pair.second.y()},
                                           {pair.sigma, pair.sigma});
      EXPECT_NEAR(e * e * row.weight, sampson, 0.35 * sampson + 1e-9);
    }
  }
}

TEST(SubspaceUpdate, EssentialCostIsTheLeastOverRotations) {
  for (std::uint64_t trial = 0; trial < 10; ++trial) {
    MotionScene scene({.sigma = 1, .rotation = 10}, 24, trial);
    scene.advance();
    const SO3d R = SO3d::exp(scene.rotation);
    const Eigen::Vector3d T = scene.translation.normalized(), opposite = -T;
    const EssentialMinimum least = essentialCostOverRotations(scene.pairs, T);
    // The gain over the truth is χ² with three degrees of freedom, 35 at a probability of 1e-7.
    const double gain = essentialCost(scene.pairs, R, T) - least.cost;
    EXPECT_GE(gain, 0);
    EXPECT_LT(gain, 35);
    EXPECT_NEAR(essentialCost(scene.pairs, R, opposite), essentialCost(scene.pairs, R, T), 1e-9);
    // χ² with N - 3 = 17 degrees of freedom: 60 has a probability of 1e-6.
    EXPECT_LT(least.cost, 60);
    for (int k = 0; k < 3; ++k) {
      for (const double step : {-0.003, 0.003}) {
        const SO3d moved = SO3d::exp(Eigen::Vector3d(step * Eigen::Vector3d::Unit(k))) * least.rotation;
        EXPECT_GT(essentialCost(scene.pairs, moved, T), least.cost);
      }
    }
  }
  const EssentialMinimum none = essentialCostOverRotations({}, Eigen::Vector3d::UnitX());
  EXPECT_TRUE(std::isnan(none.cost));
}

TEST(SubspaceUpdate, CostIsChiSquaredAtTheTruthAndTheGradientHasItsInformation) {
  // 3000 independent frames; standard errors 0.006 and 0.018; a bound of 5 of them fails once in 10⁶ runs. Second-order
  // terms of the noise add up to 3 % at 1 and 8 px.
  for (const double sigma : {1., 8.}) {
    double cost = 0, score = 0, exact = 0;
    const std::size_t frames = 3000;
    for (std::uint64_t trial = 0; trial < frames; ++trial) {
      MotionScene scene({.world = MotionWorld::orbit, .sigma = sigma}, 3, trial);
      scene.advance();
      std::vector<FlowPoint<double>> points;
      for (const PointPair& pair : scene.pairs) points.push_back(flowOf(pair, Flow::midpoint));
      std::vector<FlowRow<double>> rows(points.size());
      const S2d truth(scene.velocity);
      flowRows<double>(points, truth.unit_vector(), rows);
      const FlowRotationSums<double> rotation = rotationSums<double>(rows);
      const Eigen::Vector3d Omega = rotation.solve({});
      const SubspaceSums<double> sums = subspaceSums<double>(
          points, rows, ManifoldTraits<S2d>::placement(truth).matrix().leftCols<2>(), Omega, rotation.M);
      const FrameInformation<double, 2> f = eliminateRotation(sums, Omega, {});
      cost += f.cost / static_cast<double>(frames);
      score += mahalanobisSquared<double, 2>(f.gradient, f.gauss_newton) / (2. * frames);
      // With the gyroscope's truth as a prior all N errors are free.
      RotationPrior<double> prior{scene.rotation, 1e12 * Eigen::Matrix3d::Identity()};
      std::vector<FlowRow<double>> scratch(points.size());
      exact += subspaceCost(points, truth.unit_vector(), scratch, prior) / static_cast<double>(frames);
    }
    EXPECT_NEAR(cost / 17, 1.015, 0.03 + 0.015) << sigma << " px";
    EXPECT_NEAR(exact / 20, 1.015, 0.03 + 0.015) << sigma << " px";
    EXPECT_NEAR(score, 1, 0.1) << sigma << " px";
  }
}

TEST(SubspaceUpdate, BiasTurnsTheIncrementByTheJacobianOfTheRotation) {
  // Exp(Ω_g - b) Rᵀ as an increment: its derivative by b is -J_l(Ω_g), to first order in the increment.
  const Eigen::Vector3d gyroscope(0.1, -0.2, 0.15);
  const Eigen::Matrix3d turn = SO3d::leftJacobian(gyroscope);
  const SO3d R = SO3d::exp(gyroscope);
  for (int k = 0; k < 3; ++k) {
    const double h = 1e-5;
    const Eigen::Vector3d b = h * Eigen::Vector3d::Unit(k);
    const Eigen::Vector3d up = (SO3d::exp(Eigen::Vector3d(gyroscope - b)) * R.inverse()).log();
    const Eigen::Vector3d down = (SO3d::exp(Eigen::Vector3d(gyroscope + b)) * R.inverse()).log();
    EXPECT_LE(((up - down) / (2 * h) + turn.col(k)).norm(), 1e-9);
  }
}

TEST(SubspaceUpdate, BiasOfTheGyroscopeMatchesTheJointProblem) {
  // (ξ, b) with n eliminated against the normal equations of (ξ, δ, b) written out.
  for (std::uint64_t seed = 0; seed < cases; ++seed) {
    Example x(seed, MotionWorld::general, true);
    const Eigen::Matrix3d marginal = 500 * Eigen::Matrix3d::Identity();
    x.Omega = x.rotation.solve({x.prior.mean, marginal});
    x.sums = subspaceSums<double>(x.points, x.rows, x.E, x.Omega, x.rotation.M);
    const FrameInformation<double, 5> f = eliminateRotationWithBias(x.sums, x.Omega, x.prior, marginal);
    Eigen::Matrix<double, 8, 8> joint = Eigen::Matrix<double, 8, 8>::Zero();  // ξ, b, δ
    const Eigen::Matrix3d& L = x.prior.information;
    joint.topLeftCorner<2, 2>() = x.sums.Hxx;
    joint.block<3, 2>(5, 0) = x.sums.Hox;
    joint.block<2, 3>(0, 5) = x.sums.Hox.transpose();
    joint.block<3, 3>(2, 2) = L;
    joint.block<3, 3>(2, 5) = L;
    joint.block<3, 3>(5, 2) = L;
    joint.block<3, 3>(5, 5) = x.sums.M + L;
    const Eigen::Vector3d pull = L * (x.Omega - x.prior.mean);
    Eigen::Matrix<double, 8, 1> gradient;
    gradient << x.sums.bx, pull, x.sums.bo + pull;
    const Eigen::Matrix<double, 3, 3> inverse = joint.bottomRightCorner<3, 3>().inverse();
    const Eigen::Matrix<double, 5, 5> S =
        joint.topLeftCorner<5, 5>() - joint.topRightCorner<5, 3>() * inverse * joint.bottomLeftCorner<3, 5>();
    const Eigen::Matrix<double, 5, 1> g =
        gradient.head<5>() - joint.topRightCorner<5, 3>() * inverse * gradient.tail<3>();
    EXPECT_LE((f.gauss_newton - S).norm(), 1e-12 * joint.norm());
    EXPECT_LE((f.gradient - g).norm(), 1e-12 * (gradient.norm() + 1));
    const double start =
        x.sums.cost + pull.dot(x.Omega - x.prior.mean) - gradient.tail<3>().dot(inverse * gradient.tail<3>());
    EXPECT_NEAR(f.start, start, 1e-10 * (1 + start));
    // The cost is the least over the bias and the rotation together.
    EXPECT_NEAR(f.cost, subspaceCost(x.points, x.V, x.rows, {x.prior.mean, marginal}), 1e-9 * f.cost);
    // The essential filter keeps the rotation: the same problem in the order ξ, δ, b, before the elimination.
    const FrameInformation<double, 8> kept =
        keepRotationAndBias(x.sums, x.Omega, x.prior, Eigen::Matrix3d(Eigen::Matrix3d::Identity()), marginal);
    Eigen::PermutationMatrix<8> order;
    order.indices() << 0, 1, 5, 6, 7, 2, 3, 4;
    EXPECT_LE((kept.gauss_newton - order * joint * order.transpose()).norm(), 1e-12 * joint.norm());
    EXPECT_LE((kept.gradient - order * gradient).norm(), 1e-12 * (gradient.norm() + 1));
    EXPECT_NEAR(kept.start, x.sums.cost + pull.dot(x.Omega - x.prior.mean), 1e-10 * (1 + kept.start));
  }
}

/// Ratio of the eigenvalues of S, the information on the direction, without noise and at the truth.
struct Identifiability {
  double smallest = 0, largest = 0;
  bool rank_two() const { return smallest > 1e-6 * largest; }
};
Identifiability identifiability(const std::vector<Eigen::Vector3d>& positions, const Eigen::Vector3d& V,
                                const Eigen::Vector3d& Omega) {
  std::vector<FlowPoint<double>> points;
  for (const Eigen::Vector3d& X : positions) {
    FlowPoint<double> p;
    p.x = X.x() / X.z(), p.y = X.y() / X.z();
    const Eigen::Vector2d flow = flowByVelocity(p.x, p.y) * V / X.z() + flowByRotation(p.x, p.y) * Omega;
    p.u = flow.x(), p.v = flow.y(), p.variance = 1e-6;
    points.push_back(p);
  }
  std::vector<FlowRow<double>> rows(points.size());
  const S2d direction(V);
  flowRows<double>(points, direction.unit_vector(), rows);
  const FlowRotationSums<double> rotation = rotationSums<double>(rows);
  const Eigen::Vector3d at = rotation.solve({Eigen::Vector3d::Zero(), 1e-9 * Eigen::Matrix3d::Identity()});
  const SubspaceSums<double> sums = subspaceSums<double>(
      points, rows, ManifoldTraits<S2d>::placement(direction).matrix().leftCols<2>(), at, rotation.M);
  // A trace of a prior keeps M invertible where three points and fewer do not.
  const FrameInformation<double, 2> f =
      eliminateRotation(sums, at, {at, 1e-12 * rotation.M.trace() * Eigen::Matrix3d::Identity()});
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(f.gauss_newton);
  const double scale = sums.Hxx.trace();
  return {eigen.eigenvalues()[0], std::max(eigen.eigenvalues()[1], 1e-3 * scale)};
}

TEST(SubspaceUpdate, TwoDirectionsAreIdentifiedInGeneralPosition) {
  // Soatto and Perona 1994, section 3.1, and where it fails.
  for (std::uint64_t seed = 0; seed < cases; ++seed) {
    CounterRng rng(11, seed);
    const Eigen::Vector3d V = 0.1 * rng.unitVector<3>(), Omega = 0.1 * rng.unitVector<3>();
    const auto cloud = [&](std::size_t n) {
      std::vector<Eigen::Vector3d> X;
      for (std::size_t i = 0; i < n; ++i) {
        const double x = rng.uniform(-0.5, 0.5), y = rng.uniform(-0.5, 0.5), z = rng.uniform(1, 2);
        X.emplace_back(x * z, y * z, z);
      }
      return X;
    };
    for (const std::size_t n : {std::size_t{6}, std::size_t{20}}) {
      EXPECT_TRUE(identifiability(cloud(n), V, Omega).rank_two()) << n << " points, seed " << seed;
    }
    // N - 3 constraints: none of three points, one of four.
    EXPECT_FALSE(identifiability(cloud(3), V, Omega).rank_two());
    EXPECT_FALSE(identifiability(cloud(4), V, Omega).rank_two());
    // Points at infinity: the flow is that of a rotation.
    std::vector<Eigen::Vector3d> far = cloud(20);
    for (Eigen::Vector3d& X : far) X *= 1e9;
    EXPECT_LE(identifiability(far, V, Omega).smallest, 1e-9);
    // A critical surface: (X·δΩ)(X·V) - |X|² (V·δΩ) = X·(δV × V) has solutions (δV, δΩ) for points on a cylinder along V
    // that passes through the camera.
    std::vector<Eigen::Vector3d> cylinder;
    for (std::size_t i = 0; i < 20; ++i) {
      const double angle = rng.uniform(-1, 1), along = rng.uniform(-0.5, 0.5);
      cylinder.emplace_back(along, 0.75 * std::sin(angle), 0.75 * (1 + std::cos(angle)));
    }
    EXPECT_FALSE(identifiability(cylinder, 0.1 * Eigen::Vector3d::UnitX(), Omega).rank_two());
    EXPECT_TRUE(identifiability(cylinder, 0.1 * Eigen::Vector3d::UnitY(), Omega).rank_two());
    // A narrow field of view with little depth: S is nearly singular.
    std::vector<Eigen::Vector3d> narrow = cloud(20);
    for (Eigen::Vector3d& X : narrow) {
      const double z = 1.5 + 0.05 * (X.z() - 1.5);
      X = Eigen::Vector3d(0.1 * X.x() / X.z() * z, 0.1 * X.y() / X.z() * z, z);
    }
    const Identifiability wide = identifiability(cloud(20), V, Omega), thin = identifiability(narrow, V, Omega);
    EXPECT_LT(thin.smallest, 0.02 * wide.smallest);
  }
}

}  // namespace
