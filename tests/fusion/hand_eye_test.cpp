// Hand-eye calibration: equations and their derivatives, the estimate against the dense iteration, invariances, open
// directions, wrong pairs, traps with covariances, bad input.

#include <experiments/hand_eye_scene.hpp>
#include <fusion/hand_eye/detail/hand_eye_problem.hpp>
#include <fusion/hand_eye/detail/hand_eye_refine.hpp>
#include <fusion/hand_eye.hpp>
#include <fusion/pose_stream.hpp>
#include <lie/linear.hpp>
#include <stats/random.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace liestat {
namespace {

using detail::Matrix6;
using detail::Vector6;
using experiments::HandEyeMotion;
using experiments::HandEyeNoise;
using experiments::HandEyeOutliers;
using experiments::HandEyeScene;

Vector6 errorOf(const SE3d& estimate, const SE3d& truth) { return (estimate.inverse() * truth).log(); }
double squared(const Gaussian<SE3d>& estimate, const SE3d& truth) { return mahalanobisSquared(estimate, truth); }

/// The pairs without noise, with the covariances of the noisy ones.
std::vector<PosePair> exactPairs(const HandEyeScene& scene) {
  std::vector<PosePair> pairs = scene.pairs;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    pairs[i].a.mean = scene.truth[i].a.mean, pairs[i].b.mean = scene.truth[i].b.mean;
  }
  return pairs;
}

TEST(HandEye, JacobiansAgreeWithDifferences) {
  CounterRng rng(1);
  for (const double size : {0.0, 1e-6, 0.3, 2.0}) {
    const auto pose = [&] { return SE3d(SO3d(rng.unitQuaternion()), rng.normalVector<3>()); };
    const SE3d X = pose(), Y = pose(), B = pose();
    const SE3d A = Y * B * SE3d::exp(size * rng.unitVector<6>()) * X.inverse();
    const detail::HandEyeJacobians J({X, Y}, A, B);
    const double h = 1e-6;
    Matrix6 by_x, by_y, by_a, by_b;
    for (int k = 0; k < 6; ++k) {
      const SE3d plus = SE3d::exp(h * Vector6::Unit(k)), minus = plus.inverse();
      const auto difference = [&](const Vector6& there, const Vector6& back) -> Vector6 {
        return (there - back) / (2 * h);
      };
      using detail::handEyeError;
      by_x.col(k) = difference(handEyeError({X * plus, Y}, A, B), handEyeError({X * minus, Y}, A, B));
      by_y.col(k) = difference(handEyeError({X, Y * plus}, A, B), handEyeError({X, Y * minus}, A, B));
      by_a.col(k) = difference(handEyeError({X, Y}, A * plus, B), handEyeError({X, Y}, A * minus, B));
      by_b.col(k) = difference(handEyeError({X, Y}, A, B * plus), handEyeError({X, Y}, A, B * minus));
    }
    // Second order in h, and rounding over h.
    EXPECT_LT((J.X - by_x).norm(), 1e-8 * (1 + by_x.norm())) << size;
    EXPECT_LT((J.Y - by_y).norm(), 1e-8 * (1 + by_y.norm())) << size;
    EXPECT_LT((J.A - by_a).norm(), 1e-8 * (1 + by_a.norm())) << size;
    EXPECT_LT((J.B - by_b).norm(), 1e-8 * (1 + by_b.norm())) << size;
  }
}

// The step solves the normal equations, whatever is eliminated and whichever basis the directions have.
TEST(HandEye, StepsSolveTheNormalEquations) {
  CounterRng rng(3);
  Eigen::Matrix<double, 12, 12> A;
  for (int k = 0; k < 12; ++k) A.col(k) = rng.normalVector<12>();
  const Eigen::Matrix<double, 12, 12> H = A * A.transpose() + Eigen::Matrix<double, 12, 12>::Identity();
  const Eigen::Matrix<double, 12, 1> g = rng.normalVector<12>();
  detail::HandEyeSums sums;
  sums.xx = H.topLeftCorner<6, 6>(), sums.xy = H.topRightCorner<6, 6>(), sums.yy = H.bottomRightCorner<6, 6>();
  sums.x = g.head<6>(), sums.y = g.tail<6>();
  detail::HandEyeExcitation excitation;
  for (int k = 0; k < 6; ++k) excitation.vectors.col(k) = rng.normalVector<6>();
  const auto [x, y] = detail::handEyeStep(sums, excitation, 0, true);
  Eigen::Matrix<double, 12, 1> step;
  step << x, y;
  // Rounding times the condition, some 1e3.
  EXPECT_LT((H * step + g).norm(), 1e-11 * g.norm());
  EXPECT_LT((sums.yy * detail::handEyeStep(sums, excitation, 0, false).second + sums.y).norm(), 1e-11 * g.norm());
}

TEST(HandEye, ExactPairsGiveTheTruth) {
  for (const bool motions : {false, true}) {
    for (const std::size_t n : {3, 10}) {
      const HandEyeScene scene({.pairs = n, .relative = motions}, 1, n);
      const auto pairs = exactPairs(scene);
      const HandEyeResult result = motions ? estimateHandEye(pairs) : estimateRobotWorld(pairs);
      ASSERT_TRUE(result.ok()) << name(result.status);
      EXPECT_LT(errorOf(result.X.mean, scene.X).norm(), 1e-12);
      if (!motions) {
        EXPECT_LT(errorOf(result.Y.mean, scene.Y).norm(), 1e-12);
      }
      EXPECT_LT(result.chi2, 1e-18);
      EXPECT_EQ(result.degrees_of_freedom, 6 * static_cast<int>(n) - (motions ? 6 : 12));
      EXPECT_GT(result.excitations.minCoeff(), 100);
      EXPECT_TRUE(result.outliers.empty());
    }
  }
}

/// The strict estimate by dense normal equations over total corrections of the poses, as a reference.
struct DenseReference {
  detail::HandEyeValue value;
  Eigen::Matrix<double, 12, 12> covariance = Eigen::Matrix<double, 12, 12>::Zero();
  double chi2 = 0;

  DenseReference(detail::HandEyeValue start, const std::vector<PosePair>& pairs, int steps) : value(start) {
    std::vector<Vector6> a(pairs.size(), Vector6::Zero()), b = a;
    for (int step = 0; step < steps; ++step) {
      Eigen::Matrix<double, 12, 12> H = Eigen::Matrix<double, 12, 12>::Zero();
      Eigen::Matrix<double, 12, 1> g = Eigen::Matrix<double, 12, 1>::Zero();
      struct Block {
        Eigen::Matrix<double, 6, 12> J;
        Matrix6 A, B, S;
        Vector6 w;
      };
      std::vector<Block> blocks;
      for (std::size_t i = 0; i < pairs.size(); ++i) {
        const detail::HandEyeJacobians at(value, pairs[i].a.mean * SE3d::exp(a[i]), pairs[i].b.mean * SE3d::exp(b[i]));
        Block block;
        block.J << at.X, at.Y;
        block.A = at.A * SE3d::rightJacobian(a[i]), block.B = at.B * SE3d::rightJacobian(b[i]);
        block.w = at.e - block.A * a[i] - block.B * b[i];
        block.S = block.A * pairs[i].a.covariance * block.A.transpose() +
                  block.B * pairs[i].b.covariance * block.B.transpose();
        const detail::Cholesky<double, 6> factor(block.S);
        H += block.J.transpose() * factor.solve<12>(block.J);
        g += block.J.transpose() * factor.solve<1>(block.w);
        blocks.push_back(block);
      }
      const detail::Cholesky<double, 12> normal(H);
      covariance = normal.inverse();
      const Eigen::Matrix<double, 12, 1> p = -normal.solve<1>(g);
      chi2 = 0;
      for (std::size_t i = 0; i < pairs.size(); ++i) {
        const Vector6 r = blocks[i].w + blocks[i].J * p;
        const Vector6 k = detail::Cholesky<double, 6>(blocks[i].S).solve<1>(r);
        a[i] = -(pairs[i].a.covariance * blocks[i].A.transpose() * k);
        b[i] = -(pairs[i].b.covariance * blocks[i].B.transpose() * k);
        chi2 += r.dot(k);
      }
      value.X = value.X * SE3d::exp(p.head<6>()), value.Y = value.Y * SE3d::exp(p.tail<6>());
    }
  }
};

TEST(HandEye, EqualsTheDenseIteration) {
  for (const HandEyeNoise noise : experiments::all_hand_eye_noises) {
    const HandEyeScene scene({.noise = noise, .pairs = 12}, 2);
    const HandEyeResult result = estimateRobotWorld(scene.pairs, {.find_outliers = false});
    ASSERT_TRUE(result.ok()) << name(result.status);
    const DenseReference dense({scene.X, scene.Y}, scene.pairs, 8);
    // In standard deviations.
    EXPECT_LT(std::sqrt(squared(result.X, dense.value.X)), 1e-6) << experiments::name(noise);
    EXPECT_LT(std::sqrt(squared(result.Y, dense.value.Y)), 1e-6) << experiments::name(noise);
    EXPECT_NEAR(result.chi2, dense.chi2, 1e-7 * dense.chi2);
    EXPECT_LT((result.covariance - dense.covariance).norm(), 1e-6 * dense.covariance.norm());
  }
}

TEST(HandEye, TheOrderOfThePairsChangesNoBit) {
  for (const bool motions : {false, true}) {
    const HandEyeScene scene({.pairs = 15, .relative = motions, .outliers = 0.2}, 3);
    const auto estimate = [&](const std::vector<PosePair>& pairs) {
      return motions ? estimateHandEye(pairs) : estimateRobotWorld(pairs);
    };
    const HandEyeResult first = estimate(scene.pairs);
    std::vector<PosePair> reversed(scene.pairs.rbegin(), scene.pairs.rend());
    std::swap(reversed[2], reversed[9]);
    const HandEyeResult second = estimate(reversed);
    EXPECT_EQ(first.X.mean.params(), second.X.mean.params());
    EXPECT_EQ(first.Y.mean.params(), second.Y.mean.params());
    EXPECT_EQ(first.covariance, second.covariance);
    EXPECT_EQ(first.chi2, second.chi2);
    EXPECT_EQ(first.outliers.size(), 3U);
    EXPECT_EQ(first.outliers.size(), second.outliers.size());
    EXPECT_EQ(first.pairs[0].chi2, second.pairs[14].chi2);
  }
}

/// The error between estimates, in standard deviations.
double apart(const Gaussian<SE3d>& x, const SE3d& y) { return std::sqrt(squared(x, y)); }
Matrix6 carried(const SE3d& f, const Matrix6& covariance) { return f.Adj() * covariance * f.Adj().transpose(); }

// Covariances that differ are kept apart, equal ones once; neither changes the result.
TEST(HandEye, ListsOfLittleMemoryGiveTheSame) {
  HandEyeScene scene({.pairs = 30}, 6);
  for (const bool same : {true, false}) {
    for (std::size_t i = 0; i < scene.pairs.size(); ++i) {
      scene.pairs[i].a.covariance = (same ? 1e-6 : 1e-6 * static_cast<double>(1 + i % 3)) * Matrix6::Identity();
    }
    const PosePairList list{std::span<const PosePair>(scene.pairs)};
    EXPECT_EQ(list.a.keepsEach(), !same);
    for (std::size_t i = 0; i < list.size(); ++i) {
      EXPECT_EQ((list[i].a.covariance - scene.pairs[i].a.covariance).norm(), 0);
      EXPECT_EQ((list[i].b.covariance - scene.pairs[i].b.covariance).norm(), 0);
    }
    const HandEyeResult one = estimateRobotWorld(scene.pairs), two = estimateRobotWorld(list, HandEyeOptions{});
    EXPECT_EQ((one.X.mean.params() - two.X.mean.params()).norm(), 0);
    EXPECT_EQ((one.covariance - two.covariance).norm(), 0);
  }
  PosePair skew = scene.pairs[0];
  skew.a.covariance(0, 1) += 1e-6;
  EXPECT_TRUE(std::isnan(PosePairList(std::vector<PosePair>{skew})[0].a.covariance(0, 0)));
}

TEST(HandEye, InvariantUnderFramesUnitsAndExchange) {
  CounterRng rng(4);
  const SE3d F(SO3d(rng.unitQuaternion()), rng.normalVector<3>()), G(SO3d(rng.unitQuaternion()), rng.normalVector<3>());
  for (const bool motions : {false, true}) {
    const HandEyeScene scene({.noise = HandEyeNoise::anisotropic, .pairs = 15, .relative = motions}, 5);
    const auto estimate = [&](const std::vector<PosePair>& pairs) {
      return motions ? estimateHandEye(pairs) : estimateRobotWorld(pairs);
    };
    const auto transformed = [&](const std::function<void(PosePair&)>& change) {
      std::vector<PosePair> pairs = scene.pairs;
      for (PosePair& pair : pairs) change(pair);
      return estimate(pairs);
    };
    const HandEyeResult r = estimate(scene.pairs);
    ASSERT_TRUE(r.ok()) << name(r.status);

    // Other frames of gripper and camera, and of base and target where there are any: A' = F A G, B' = F B G.
    const HandEyeResult framed = transformed([&](PosePair& pair) {
      pair.a.mean = (motions ? G.inverse() : F) * pair.a.mean * G;
      pair.a.covariance = carried(G.inverse(), pair.a.covariance);
      pair.b.mean = (motions ? F.inverse() : G) * pair.b.mean * F;
      pair.b.covariance = carried(F.inverse(), pair.b.covariance);
    });
    EXPECT_LT(apart(framed.X, G.inverse() * r.X.mean * F), 1e-9);
    EXPECT_NEAR(framed.chi2, r.chi2, 1e-8 * r.chi2);

    // Millimetres.
    const HandEyeResult scaled = transformed([&](PosePair& pair) {
      Matrix6 D = Matrix6::Identity();
      D.diagonal().head<3>().setConstant(1000);
      for (Gaussian<SE3d>* g : {&pair.a, &pair.b}) {
        g->mean.translation() *= 1000;
        g->covariance = D * g->covariance * D;
      }
    });
    SE3d in_mm = r.X.mean;
    in_mm.translation() *= 1000;
    EXPECT_LT(apart(scaled.X, in_mm), 1e-9);
    EXPECT_LT((scaled.excitations - r.excitations).norm(), 1e-6 * r.excitations.norm());

    // B X⁻¹ = Y⁻¹ A.
    const HandEyeResult exchanged = transformed([&](PosePair& pair) { std::swap(pair.a, pair.b); });
    EXPECT_LT(apart(exchanged.X, r.X.mean.inverse()), 1e-9);
    EXPECT_LT((exchanged.X.covariance - carried(r.X.mean, r.X.covariance)).norm(),
              1e-6 * exchanged.X.covariance.norm());
  }
}

TEST(HandEye, DirectionsThatMotionsLeaveOpen) {
  for (const bool motions : {false, true}) {
    for (const HandEyeMotion motion : experiments::all_hand_eye_motions) {
      const std::string what = std::string(name(motion)) + (motions ? " AX = XB" : " AX = YB");
      for (std::uint64_t trial = 0; trial < 5; ++trial) {
        const HandEyeScene scene({.motion = motion, .pairs = 12, .relative = motions}, 6, trial);
        const HandEyeResult r = motions ? estimateHandEye(scene.pairs) : estimateRobotWorld(scene.pairs);
        const int open = experiments::openDimension(motion);
        ASSERT_EQ(static_cast<int>(r.directions.size()), open) << what;
        EXPECT_EQ(r.status, open == 0 ? FusionStatus::ok : FusionStatus::undetermined) << what;
        EXPECT_EQ(r.degrees_of_freedom, 72 - (motions ? 6 : 12) + open) << what;
        EXPECT_EQ(r.rotationIsOpen(), open == 2 || open == 4) << what;
        EXPECT_EQ(r.X.covariance.allFinite(), !r.rotationIsOpen()) << what;
        // X moved along what is open explains the poses as well: the residuals stay.
        for (const OpenDirection& d : r.directions) {
          const SE3d X = SE3d::exp(0.1 * d.twist) * r.X.mean;
          const SE3d Y = motions ? X : SE3d::exp(0.1 * d.twist_of_Y) * r.Y.mean;
          double before = 0, after = 0;
          for (const PosePair& pair : scene.pairs) {
            before += detail::handEyeSquaredError({r.X.mean, r.Y.mean}, pair);
            after += detail::handEyeSquaredError({X, Y}, pair);
          }
          // The direction is as uncertain as the noise makes it.
          EXPECT_LT(after, 2 * before + 30) << what << ": " << describe(d);
        }
        if (motion == HandEyeMotion::planar || motion == HandEyeMotion::parallel_axes) {
          EXPECT_NE(describe(r.directions[0]).find("translation along the rotation axis ("), std::string::npos);
          EXPECT_NE(describe(r.directions[0]).find("of the gripper"), std::string::npos);
          EXPECT_GT(std::abs(scene.axis.dot(r.directions[0].twist.head<3>())), 0.999);
        }
        if (motion == HandEyeMotion::one_axis) {
          EXPECT_NE(describe(r.directions[0]).find("rotation about the rotation axis ("), std::string::npos);
          EXPECT_FALSE(r.directions[1].rotates);
        }
        if (motion == HandEyeMotion::collinear) {
          EXPECT_NE(describe(r.directions[0]).find("rotation about the direction of motion ("), std::string::npos);
        }
      }
    }
  }
}

TEST(HandEye, LittleExcitationIsWeak) {
  // Rotations about one axis, and others of a few tenths of a degree.
  CounterRng rng(7);
  HandEyeScene scene({.motion = HandEyeMotion::planar, .pairs = 20, .relative = true}, 7);
  int weak = 0, trusted = 0, none = 0;
  for (const double wobble : {0.0, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0, 3.0}) {
    std::vector<PosePair> pairs = scene.pairs;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const Vector6 z = rng.normalVector<6>();
      const SE3d tilt = SE3d::exp((Vector6() << 0, 0, 0, wobble / 57.3 * z.head<3>()).finished());
      const SE3d A = scene.truth[i].a.mean * tilt;
      const SE3d noise_of_a = scene.truth[i].a.mean.inverse() * pairs[i].a.mean;
      const SE3d noise_of_b = scene.truth[i].b.mean.inverse() * pairs[i].b.mean;
      pairs[i].a.mean = A * noise_of_a;
      pairs[i].b.mean = scene.X.inverse() * A * scene.X * noise_of_b;
    }
    const HandEyeResult r = estimateHandEye(pairs);
    if (r.directions.empty()) {
      ++trusted;
    } else if (r.directions[0].weak) {
      ++weak;
      EXPECT_GE(r.directions[0].excitation, 3);
      EXPECT_LT(r.directions[0].excitation, 10);
    } else {
      ++none;
    }
  }
  EXPECT_GE(none, 1);
  EXPECT_GE(weak, 1);
  EXPECT_GE(trusted, 1);
}

TEST(HandEye, WrongPairsAreFound) {
  for (const HandEyeOutliers kind : experiments::all_hand_eye_outliers) {
    for (const double share : {0.3, 0.45}) {
      const HandEyeScene scene({.pairs = 20, .outliers = share, .outlier_kind = kind}, 8);
      const HandEyeResult r = estimateRobotWorld(scene.pairs);
      for (std::size_t i = 0; i < scene.pairs.size(); ++i) EXPECT_EQ(r.pairs[i].inlier, scene.inlier[i]) << i;
      if (kind != HandEyeOutliers::flips) {
        EXPECT_EQ(r.outliers.size(), share == 0.3 ? 6U : 9U);
      }
      EXPECT_TRUE(r.ok()) << experiments::name(kind);
      EXPECT_LT(squared(r.X, scene.X), 22.5);
      // All of them together do not agree.
      const HandEyeResult all = estimateRobotWorld(scene.pairs, {.find_outliers = false});
      EXPECT_EQ(all.status, FusionStatus::inconsistent);
    }
  }
}

TEST(HandEye, NoiseUpToAFactor) {
  const HandEyeScene scene({.pairs = 20, .outliers = 0.2}, 9);
  const HandEyeResult known = estimateRobotWorld(scene.pairs);
  std::vector<PosePair> pairs = scene.pairs;
  for (PosePair& pair : pairs) pair.a.covariance *= 50, pair.b.covariance *= 50;
  const HandEyeResult scaled = estimateRobotWorld(pairs, {.known_noise = false});
  ASSERT_TRUE(scaled.ok()) << name(scaled.status);
  EXPECT_EQ(scaled.outliers, known.outliers);
  EXPECT_LT(apart(known.X, scaled.X.mean), 1e-6);
  EXPECT_NEAR(scaled.variance_factor, known.chi2 / known.degrees_of_freedom / 50, 1e-8);
  EXPECT_TRUE(std::isnan(scaled.p));
  const Matrix6 expected = known.X.covariance * (known.chi2 / known.degrees_of_freedom);
  EXPECT_LT((scaled.X.covariance - expected).norm(), 1e-6 * expected.norm());
}

/// Twenty trials under a wrong reading of the covariance of C = camera_T_target: mean squared distance of the truth and
/// mean χ² per degree of freedom.
struct Trap {
  double nees = 0, chi2_per_dof = 0;
  int inconsistent = 0;
};
Trap trapped(const std::function<Matrix6(const SE3d& C, const Matrix6& covariance)>& read) {
  Trap trap;
  const int trials = 20;
  for (int t = 0; t < trials; ++t) {
    const HandEyeScene scene({.noise = HandEyeNoise::target, .pairs = 20}, 10, static_cast<std::uint64_t>(t));
    std::vector<PosePair> pairs = scene.pairs;
    for (PosePair& pair : pairs) {
      const SE3d C = pair.b.mean.inverse();
      pair.b.covariance = read(C, carried(C.inverse(), pair.b.covariance));
    }
    const HandEyeResult r = estimateRobotWorld(pairs, {.find_outliers = false});
    trap.nees += squared(r.X, scene.X) / trials;
    trap.chi2_per_dof += r.chi2 / r.degrees_of_freedom / trials;
    trap.inconsistent += r.status == FusionStatus::inconsistent;
  }
  return trap;
}

TEST(HandEyeTraps, CovarianceOfTheInverseMustBeTransported) {
  const Trap right = trapped([](const SE3d& C, const Matrix6& V) { return carried(C, V); });
  EXPECT_NEAR(right.chi2_per_dof, 1, 4 * std::sqrt(2. / 108 / 20));
  EXPECT_NEAR(right.nees, 6, 4 * std::sqrt(12. / 20));
  const Trap wrong = trapped([](const SE3d&, const Matrix6& V) { return V; });
  EXPECT_GT(wrong.chi2_per_dof, 10);
  EXPECT_GT(wrong.nees, 50);
  EXPECT_EQ(wrong.inconsistent, 20);
}

TEST(HandEyeTraps, LeftIsNotRight) {
  // A covariance of Exp(e)·B read as one of B·Exp(e).
  const Trap wrong = trapped([](const SE3d& C, const Matrix6& V) { return carried(C.inverse(), carried(C, V)); });
  EXPECT_GT(wrong.chi2_per_dof, 10);
  EXPECT_EQ(wrong.inconsistent, 20);
}

TEST(HandEyeTraps, RotationFirstIsNotTranslationFirst) {
  const Trap wrong = trapped([](const SE3d& C, const Matrix6& V) {
    const Matrix6 right = carried(C, V);
    Matrix6 exchanged;
    exchanged << right.bottomRightCorner<3, 3>(), right.bottomLeftCorner<3, 3>(), right.topRightCorner<3, 3>(),
        right.topLeftCorner<3, 3>();
    return exchanged;
  });
  EXPECT_GT(wrong.chi2_per_dof, 10);
  EXPECT_EQ(wrong.inconsistent, 20);
}

TEST(HandEye, BadInput) {
  const HandEyeScene scene({.pairs = 6}, 11);
  const auto faultOf = [&](const std::function<void(std::vector<PosePair>&)>& spoil) {
    std::vector<PosePair> pairs = scene.pairs;
    spoil(pairs);
    const HandEyeResult r = estimateRobotWorld(pairs);
    EXPECT_EQ(r.status, FusionStatus::bad_input);
    EXPECT_FALSE(describe(r.fault).empty());
    return r.fault;
  };
  EXPECT_EQ(faultOf([](auto& p) { p.clear(); }), FaultKind::too_few_poses);
  EXPECT_EQ(faultOf([](auto& p) { p.resize(2); }), (Fault{FaultKind::too_few_poses, 2}));
  EXPECT_EQ(faultOf([](auto& p) { p[3].a.mean.translation()[1] = std::numeric_limits<double>::quiet_NaN(); }),
            (Fault{FaultKind::pose_not_finite, 3}));
  EXPECT_EQ(faultOf([](auto& p) { p[4].b.covariance(2, 2) = -1; }), (Fault{FaultKind::bad_covariance, 4}));
  EXPECT_EQ(faultOf([](auto& p) { p[4].b.covariance(2, 1) = 1; }), (Fault{FaultKind::bad_covariance, 4}));
  EXPECT_EQ(faultOf([](auto& p) { p[1].a.covariance.setZero(), p[1].b.covariance.setZero(); }),
            (Fault{FaultKind::bad_covariance, 1}));
  // Both rotations exact: errors of translation alone meet six equations.
  EXPECT_EQ(faultOf([](auto& p) {
              for (Gaussian<SE3d>* g : {&p[2].a, &p[2].b}) {
                g->covariance.setZero();
                g->covariance.diagonal().template head<3>().setConstant(1e-6);
              }
            }),
            (Fault{FaultKind::bad_covariance, 2}));
  EXPECT_EQ(estimateRobotWorld(scene.pairs, {.gate = -1}).fault, FaultKind::bad_option);
  EXPECT_EQ(estimateHandEye(std::vector<PosePair>(1)).fault, FaultKind::too_few_poses);

  // A pose of the robot may be exact.
  std::vector<PosePair> exact = scene.pairs;
  for (std::size_t i = 0; i < exact.size(); ++i) {
    exact[i].a = {scene.truth[i].a.mean, Matrix6::Zero()};
  }
  const HandEyeResult r = estimateRobotWorld(exact);
  EXPECT_TRUE(r.ok()) << name(r.status);
  EXPECT_LT(squared(r.X, scene.X), 22.5);
}

TEST(HandEye, IdenticalPosesLeaveEverythingOpen) {
  for (const bool motions : {false, true}) {
    const HandEyeScene scene({.pairs = 6, .relative = motions}, 12);
    const std::vector<PosePair> pairs(6, exactPairs(scene).front());
    const HandEyeResult r = motions ? estimateHandEye(pairs) : estimateRobotWorld(pairs);
    EXPECT_EQ(r.status, FusionStatus::undetermined);
    EXPECT_EQ(r.directions.size(), motions ? 2U : 6U);
    EXPECT_FALSE(r.X.covariance.allFinite());
  }
}

TEST(HandEye, TheVerdictIsThatOfTheStatus) {
  HandEyeResult result = estimateRobotWorld(HandEyeScene({.pairs = 12}, 3).pairs);
  ASSERT_TRUE(result.ok());
  EXPECT_EQ(result.verdict(), Verdict::Answer::yes);
  EXPECT_EQ(result.verdict().text, "ok: X and Y are determined");
  result.status = FusionStatus::inconsistent;
  EXPECT_EQ(result.verdict(), Verdict::Answer::no);
  EXPECT_EQ(result.verdict().text,
            "NOT TO BE TRUSTED (inconsistent): the residuals are larger than the covariances of the poses say");
  // The verdict says which input was wrong.
  const HandEyeResult bad = estimateHandEye(std::vector<PosePair>(1));
  EXPECT_EQ(bad.verdict(), Verdict::Answer::no);
  EXPECT_EQ(bad.inWords(), "1 pairs of poses are too few");
}

TEST(HandEye, StandardDeviationsAlongOpenDirectionsAreNone) {
  HandEyeResult result = estimateRobotWorld(HandEyeScene({.pairs = 12}, 3).pairs);
  std::vector<CalibratedPose> poses = calibratedPoses(result);
  ASSERT_EQ(poses.size(), 2U);
  // Translation in the parent's axes: R Σ Rᵀ.
  const Eigen::Matrix3d R = result.Y.mean.so3().matrix();
  const Eigen::Matrix3d turned = R * result.Y.covariance.topLeftCorner<3, 3>() * R.transpose();
  EXPECT_LT((poses[1].sigmas.head<3>() - turned.diagonal().cwiseSqrt()).norm(), 1e-12);
  OpenDirection open;
  open.twist[2] = 1;
  result.directions = {open};
  poses = calibratedPoses(result);
  EXPECT_TRUE(poses[0].sigmas.head<2>().allFinite() && poses[0].sigmas.tail<3>().allFinite());
  EXPECT_TRUE(std::isnan(poses[0].sigmas[2]));
  result.directions[0].rotates = true;
  EXPECT_FALSE(calibratedPoses(result)[0].has_covariance);
}

/// A camera on a gripper that moves smoothly before a target, five pairs a second; B is wrong by what is planted.
struct MovingScene {
  std::vector<PosePair> pairs;
  HandEyeOptions options;
  SE3d X;

  MovingScene(int n, double delay, double scale, double focal, std::uint64_t seed) {
    CounterRng rng(seed, 77);
    X = SE3d(SO3d(rng.unitQuaternion()), Eigen::Vector3d(0.15 * rng.normalVector<3>()));
    const SE3d Y(SO3d(rng.unitQuaternion()), Eigen::Vector3d(rng.normalVector<3>()));
    Eigen::Matrix<double, 6, 3> size, phase, rate;
    for (int i = 0; i < 18; ++i) {
      size(i) = rng.uniform(0.3, 1.0), phase(i) = rng.uniform(0.0, 6.28), rate(i) = rng.uniform(0.6, 2.5);
    }
    const auto target_T_camera = [&](double t) {
      Vector6 w = Vector6::Zero();
      for (int i = 0; i < 6; ++i) {
        for (int k = 0; k < 3; ++k) w[i] += size(i, k) * std::sin(rate(i, k) * t + phase(i, k));
      }
      return SE3d(SO3d::exp(0.4 * w.tail<3>()), Eigen::Vector3d(0.12 * w[0], 0.12 * w[1], 0.55 + 0.06 * w[2]))
          .inverse();
    };
    Vector6 sigma_a, sigma_b;
    sigma_a << Eigen::Vector3d::Constant(5e-4), Eigen::Vector3d::Constant(9e-4);
    sigma_b << 2e-3, 2e-3, 1e-3, 3.5e-3, 3.5e-3, 7e-4;
    for (int k = -50; k < 10 * n + 50; ++k) {
      const SE3d A = Y * target_T_camera(0.02 * k) * X.inverse();
      options.stream_of_a.push_back({0.02 * k, A * SE3d::exp(sigma_a.cwiseProduct(rng.normalVector<6>()))});
    }
    for (int i = 0; i < n; ++i) {
      const TimedPose& a = options.stream_of_a[static_cast<std::size_t>(50 + 10 * i)];
      SE3d B = target_T_camera(a.time + delay);
      const Eigen::Vector3d target = -(B.so3().inverse() * B.translation());
      Vector6 wrong = Vector6::Zero();
      wrong.head<3>() = scale * target + Eigen::Vector3d(0, 0, focal * target.z());
      B = B * SE3d::exp(wrong) * SE3d::exp(sigma_b.cwiseProduct(rng.normalVector<6>()));
      pairs.push_back({{a.pose, sigma_a.cwiseAbs2().asDiagonal()}, {B, sigma_b.cwiseAbs2().asDiagonal()}});
      options.times.push_back(a.time);
    }
  }
  double squaredError(const Gaussian<SE3d>& estimate) const {
    const Vector6 e = (estimate.mean.inverse() * X).log();
    return e.dot(estimate.covariance.ldlt().solve(e));
  }
};

TEST(HandEyeSuspects, WhatIsPlantedIsNamedAndTakenIn) {
  struct {
    HandEyeSuspect suspect;
    double delay, scale, focal;
  } const cells[] = {{HandEyeSuspect::delay, 0.005, 0, 0},
                     {HandEyeSuspect::delay, -0.02, 0, 0},
                     {HandEyeSuspect::scale, 0, 0.01, 0},
                     {HandEyeSuspect::focal_length, 0, 0, 0.02}};
  constexpr int trials = 12;
  for (const auto& cell : cells) {
    const auto k = static_cast<std::size_t>(cell.suspect);
    const double planted = cell.delay + cell.scale + cell.focal;
    double nees = 0;
    int named = 0;
    for (std::uint64_t t = 0; t < trials; ++t) {
      MovingScene scene(100, cell.delay, cell.scale, cell.focal, t);
      const HandEyeResult plain = estimateRobotWorld(scene.pairs, scene.options);
      ASSERT_EQ(plain.suspects.size(), hand_eye_suspects);
      named += !plain.ok() && plain.suspects[k].in_group && plain.X_over_suspects &&
               plain.suspectsInWords().find("(estimate ") != std::string::npos;
      scene.options.suspect_sigmas[k] = std::numeric_limits<double>::infinity();
      const HandEyeResult taken = estimateRobotWorld(scene.pairs, scene.options);
      nees += scene.squaredError(taken.X) / trials;
      EXPECT_LT(std::abs(taken.suspects[k].value - planted), 4.5 * taken.suspects[k].value_sigma) << name(cell.suspect);
    }
    // 95 % are asked for: three or more misses of 12 have the probability 0.02 then, four 0.002.
    EXPECT_GE(named, trials - 3) << name(cell.suspect);
    EXPECT_NEAR(nees, 6, 4 * std::sqrt(12.0 / trials)) << name(cell.suspect);
  }
}

TEST(HandEyeSuspects, NothingIsNamedWhereNothingIsPlantedAndPriorsAreConsistent) {
  constexpr int trials = 30;
  int alarms = 0;
  double plain = 0, clean = 0, planted = 0;
  for (std::uint64_t t = 0; t < trials; ++t) {
    MovingScene scene(60, 0, 0, 0, 100 + t);
    const HandEyeResult result = estimateRobotWorld(scene.pairs, scene.options);
    alarms += !result.ok(), plain += scene.squaredError(result.X) / trials;
    MovingScene larger(60, 0, 0.005, 0, 200 + t);
    for (MovingScene* s : {&scene, &larger}) {
      s->options.suspect_sigmas = {0.003, 0.003, 0.005, 0, 0};
      const HandEyeResult with = estimateRobotWorld(s->pairs, s->options);
      (s == &scene ? clean : planted) += s->squaredError(with.X) / trials;
    }
  }
  EXPECT_LE(alarms, 3) << "at 1.5 % four of thirty have the probability 1e-3";
  for (const double nees : {plain, clean, planted}) EXPECT_NEAR(nees, 6, 4 * std::sqrt(12.0 / trials));
}

TEST(HandEyeStreams, AreInterpolatedAtTheTimesOfBAndALargeDelayIsFound) {
  constexpr int trials = 12;
  constexpr double delay = 0.3, off = 0.007;  // s
  double nees = 0;
  for (std::uint64_t t = 0; t < trials; ++t) {
    MovingScene scene(60, delay + off, 0, 0, 300 + t);
    for (double& time : scene.options.times) time += off;
    scene.options.interpolate = true;
    scene.options.largest_delay = 0.5;
    scene.options.suspect_sigmas[0] = std::numeric_limits<double>::infinity();
    const HandEyeResult result = estimateRobotWorld(scene.pairs, scene.options);
    ASSERT_TRUE(result.interpolation.has_value());
    EXPECT_EQ(result.interpolation->in_gaps, 0u);
    // White noise makes each pose differ from the cubic through its neighbours, which halving the step does not lessen.
    EXPECT_NEAR(result.interpolation->translation, 5e-4 * std::sqrt(3 * (1 + 2 * (81 + 1) / 256.)), 1e-4);
    EXPECT_LT(std::abs(result.suspects[0].value - delay), 4.5 * result.suspects[0].value_sigma);
    nees += scene.squaredError(result.X) / trials;
    scene.options.largest_delay = -1;
    EXPECT_EQ(estimateRobotWorld(scene.pairs, scene.options).fault.kind, FaultKind::bad_option);
    scene.options.largest_delay = 0, scene.options.times.clear();
    EXPECT_EQ(estimateRobotWorld(scene.pairs, scene.options).fault.kind, FaultKind::bad_option);
  }
  EXPECT_NEAR(nees, 6, 4 * std::sqrt(12.0 / trials));
}

TEST(PoseStreams, InterpolateToTheFourthOrderAndFindADelay) {
  const auto pose = [](double t) {
    return SE3d(SO3d::exp(Eigen::Vector3d(0.5 * std::sin(t), 0.4 * std::cos(1.3 * t), 0.3 * std::sin(0.7 * t))),
                Eigen::Vector3d(std::sin(0.9 * t), std::cos(t), 0.1 * t));
  };
  const auto stream = [&](double step, double shift) {
    std::vector<TimedPose> poses;
    for (int k = 0; k * step < 20; ++k) poses.push_back({k * step, pose(k * step + shift)});
    return PoseStream(poses);
  };
  double before = 0;
  for (const double step : {0.2, 0.1, 0.05}) {
    const PoseStream s = stream(step, 0);
    double squares = 0, n = 0;
    for (double t = 1 + step / 2; t < 18; t += step, ++n) squares += (pose(t).inverse() * *s.at(t)).log().squaredNorm();
    const double error = std::sqrt(squares / n);
    EXPECT_NEAR(s.interpolationError().trace() / (error * error), 1, 0.3) << "measured without the truth";
    if (before > 0) {
      EXPECT_NEAR(before / error, 16, 3);
    }
    before = error;
  }
  const PoseStream a = stream(0.02, 0), b = stream(0.05, 0.3);
  EXPECT_NEAR(delayOfSpeeds(a, b, 0.5), 0.3, 0.026);
  EXPECT_LT((a.poses()[500].pose.inverse() * *a.at(10)).log().norm(), 1e-12);
  EXPECT_FALSE(a.at(-0.01) || a.at(20.01) || PoseStream().at(0));
  std::vector<TimedPose> gap(a.poses().begin(), a.poses().end());
  gap.erase(gap.begin() + 300, gap.begin() + 310);
  EXPECT_FALSE(PoseStream(gap).at(6.1));
}

}  // namespace
}  // namespace liestat
