// Preintegrated motions under Ceres: derivatives along the manifolds, whitening, and a chain of states that is found.

#include <fusion/compat/ceres.hpp>
#include <lie/compat/ceres.hpp>

#include <ceres/ceres.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <vector>

namespace {

using namespace liestat;
using Eigen::Vector3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Vector9 = Eigen::Matrix<double, 9, 1>;

const Vector3d gravity(0, 0, -9.81);

Preintegration<double> someMotion(unsigned seed) {
  std::mt19937 generator(seed);
  const auto draw = [&] { return static_cast<double>(generator()) * 0x1p-31 - 1; };
  Preintegration<double> motion({.noise = {1e-3, 1e-2, 1e-3, 2e-2}});
  for (int i = 0; i < 40; ++i) {
    motion.add(0.005, Vector3d(draw(), draw(), draw()), Vector3d(draw(), draw(), 9.8 + draw()));
  }
  return motion;
}

/// Where a motion leads.
SE23d reached(const Preintegration<double>& motion, const SE23d& first, const ImuBias<double>& bias) {
  const SE23d D = motion.increment(bias);
  const double t = motion.duration();
  const SO3d R(first.so3());
  return SE23d(
      R * SO3d(D.so3()),
      Vector3d(first.translation() + t * first.velocity() + 0.5 * t * t * gravity + R * Vector3d(D.translation())),
      Vector3d(first.velocity() + t * gravity + R * Vector3d(D.velocity())));
}

/// Blocks of parameters with the manifolds they are on; those of states have ten numbers.
struct Blocks {
  std::vector<Eigen::VectorXd> values;
  CeresManifold<SE23d> state;

  std::vector<const double*> pointers() const {
    std::vector<const double*> p;
    for (const auto& v : values) p.push_back(v.data());
    return p;
  }
  Eigen::VectorXd residual(const ceres::CostFunction& cost) const {
    Eigen::VectorXd r(cost.num_residuals());
    EXPECT_TRUE(cost.Evaluate(pointers().data(), r.data(), nullptr));
    return r;
  }
  /// The analytic Jacobian by a block, along its manifold.
  Eigen::MatrixXd jacobian(const ceres::CostFunction& cost, std::size_t block) const {
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    RowMajor J(cost.num_residuals(), values[block].size());
    Eigen::VectorXd r(cost.num_residuals());
    std::vector<double*> jacobians(values.size(), nullptr);
    jacobians[block] = J.data();
    EXPECT_TRUE(cost.Evaluate(pointers().data(), r.data(), jacobians.data()));
    if (values[block].size() != 10) return J;
    RowMajor plus(10, 9);
    EXPECT_TRUE(state.PlusJacobian(values[block].data(), plus.data()));
    return J * plus;
  }
  Eigen::MatrixXd differences(const ceres::CostFunction& cost, std::size_t block) const {
    const double e = 1e-5;
    const Eigen::Index n = values[block].size() == 10 ? 9 : values[block].size();
    Eigen::MatrixXd J(cost.num_residuals(), n);
    for (Eigen::Index k = 0; k < n; ++k) {
      const auto at = [&](double step) {
        Blocks moved = *this;
        if (n == 9) {
          const Vector9 d = step * Vector9::Unit(k);
          EXPECT_TRUE(state.Plus(values[block].data(), d.data(), moved.values[block].data()));
        } else {
          moved.values[block][k] += step;
        }
        return moved.residual(cost);
      };
      J.col(k) = (at(e) - at(-e)) / (2 * e);
    }
    return J;
  }
};

Eigen::VectorXd asVector(const ImuBias<double>& bias) {
  Vector6 v;
  v << bias.gyroscope, bias.accelerometer;
  return v;
}

TEST(FusionCeres, JacobiansAgreeWithDifferencesAlongTheManifolds) {
  const auto motion = someMotion(5);
  const SE23d first(SO3d::exp({0.3, -1, 2}), Vector3d(1, 2, 3), Vector3d(-1, 0.5, 2));
  const ImuBias<double> bias{Vector3d(0.01, -0.02, 0.015), Vector3d(0.1, 0.05, -0.2)};
  const SE23d second = reached(motion, first, bias) * SE23d::exp(0.1 * Vector9::LinSpaced(9, -1, 1));
  ImuBias<double> later = bias;
  later.gyroscope += Vector3d(1e-3, 2e-3, -1e-3);
  const auto check = [](const ceres::CostFunction& cost, const Blocks& blocks) {
    for (std::size_t i = 0; i < blocks.values.size(); ++i) {
      const Eigen::MatrixXd analytic = blocks.jacobian(cost, i);
      EXPECT_LE((analytic - blocks.differences(cost, i)).norm(), 1e-7 * analytic.norm()) << "block " << i;
      EXPECT_GT(analytic.norm(), 0);
    }
  };
  check(PreintegrationCost(motion), {{first.params(), second.params(), asVector(bias), gravity}, {}});
  check(PreintegrationWalkCost(motion),
        {{first.params(), asVector(bias), second.params(), asVector(later), gravity}, {}});
}

TEST(FusionCeres, ResidualsAreMahalanobisDistances) {
  const auto motion = someMotion(6);
  const SE23d first(SO3d::exp({-1, 0.2, 0.5}), Vector3d(0, 1, 0), Vector3d(1, 0, 0));
  const ImuBias<double> bias{Vector3d(0.01, 0, 0), Vector3d(0, 0.1, 0)};
  const Vector9 error = 1e-3 * Vector9::LinSpaced(9, -2, 1);
  const SE23d second = reached(motion, first, bias) * SE23d::exp(error);
  const Blocks blocks{{first.params(), second.params(), asVector(bias), gravity}, {}};
  const double expected = error.dot(motion.gaussian().covariance.inverse() * error);
  EXPECT_NEAR(blocks.residual(PreintegrationCost(motion)).squaredNorm(), expected, 1e-9 * expected);

  Eigen::Matrix<double, 15, 1> both;
  both << error, 1e-3 * Vector6::LinSpaced(6, 1, -1);
  const Eigen::VectorXd later = asVector(bias) + both.tail<6>();
  const Blocks walking{{first.params(), asVector(bias), second.params(), later, gravity}, {}};
  const double joint = both.dot(motion.covarianceWithBias().inverse() * both);
  EXPECT_NEAR(walking.residual(PreintegrationWalkCost(motion)).squaredNorm(), joint, 1e-8 * joint);
}

TEST(FusionCeres, AnIncrementWithoutNoiseIsRefused) {
  Preintegration<double> exact;
  exact.add(0.1, Vector3d::Zero(), Vector3d(0, 0, 9.8));
  const Blocks blocks{{SE23d().params(), SE23d().params(), Vector6::Zero(), gravity}, {}};
  Vector9 r;
  EXPECT_FALSE(PreintegrationCost(exact).Evaluate(blocks.pointers().data(), r.data(), nullptr));
}

/// The position of a state alone, measured to a centimetre.
struct Position {
  Vector3d measured;
  template <class T>
  bool operator()(const T* state, T* r) const {
    for (int k = 0; k < 3; ++k) r[k] = (state[4 + k] - measured[k]) / 0.01;
    return true;
  }
};

// Ten motions from a known state, with the position of each end: the biases and all states are found.
TEST(FusionCeres, AChainOfStatesIsFound) {
  const ImuBias<double> truth{Vector3d(0.01, -0.02, 0.03), Vector3d(0.1, -0.1, 0.2)};
  std::vector<SE23d> states{SE23d(SO3d::exp({0.2, 0.1, 1}), Vector3d(0, 0, 1), Vector3d(1, 0, 0))};
  std::vector<Preintegration<double>> motions;
  for (unsigned i = 0; i < 10; ++i) {
    motions.push_back(someMotion(20 + i));
    states.push_back(reached(motions.back(), states.back(), truth));
  }
  std::vector<SE23d> found = states;
  Vector6 bias = Vector6::Zero();
  Vector3d g = gravity;
  ceres::Problem problem;
  for (SE23d& x : found) problem.AddParameterBlock(x.data(), 10, new CeresManifold<SE23d>);
  for (std::size_t i = 0; i < motions.size(); ++i) {
    problem.AddResidualBlock(new PreintegrationCost(motions[i]), nullptr, found[i].data(), found[i + 1].data(),
                             bias.data(), g.data());
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Position, 3, 10>(new Position{states[i + 1].translation()}), nullptr,
        found[i + 1].data());
    found[i + 1] = states[i + 1] * SE23d::exp(0.05 * Vector9::LinSpaced(9, -1, 1));
  }
  problem.SetParameterBlockConstant(found[0].data());
  problem.SetParameterBlockConstant(g.data());
  ceres::Solver::Options options;
  options.function_tolerance = options.gradient_tolerance = options.parameter_tolerance = 1e-14;
  options.max_num_iterations = 100;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  EXPECT_TRUE(summary.IsSolutionUsable()) << summary.BriefReport();
  EXPECT_LE(summary.final_cost, 1e-12);
  EXPECT_LE((bias - asVector(truth)).norm(), 1e-6);
  for (std::size_t i = 0; i < states.size(); ++i) {
    EXPECT_LE((states[i].inverse() * found[i]).log().norm(), 1e-6) << "state " << i;
  }
}

}  // namespace
