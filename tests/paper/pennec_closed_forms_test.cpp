// Equalities that hold for every right implementation of the means of Pennec 1998, to rounding: closed forms for two
// features and for rotations about one axis, equivariance, symmetry, the group barycentre, and the derivatives of the
// Mahalanobis criterion in both models.

#include <lie/lie.hpp>
#include <stats/covariance.hpp>
#include <stats/group_mean.hpp>
#include <stats/maha.hpp>

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace liestat {
namespace {

/// Deterministic tangent vectors with entries in [-scale, scale].
template <class M>
class Draw {
 public:
  explicit Draw(unsigned seed) : generator_(seed) {}
  TangentOf<M> tangent(double scale) {
    TangentOf<M> v;
    for (int i = 0; i < v.size(); ++i) v[i] = scale * (2 * static_cast<double>(generator_()) / 4294967295.0 - 1);
    return v;
  }
  SquareOf<M> covariance(double scale) {
    SquareOf<M> A;
    for (int i = 0; i < A.cols(); ++i) A.col(i) = tangent(scale);
    return A * A.transpose() + 0.1 * scale * scale * SquareOf<M>::Identity();
  }
  M feature(double scale) { return exp(ManifoldTraits<M>::origin(), tangent(scale)); }

 private:
  std::mt19937 generator_;
};

template <class M>
class PennecClosedForms : public testing::Test {};
using Features =
    testing::Types<Eigen::Vector3d, SO2d, SO3d, S2d, Frame2d, Frame3d, SemiOrientedFrame3d, NonOrientedFrame3d>;
TYPED_TEST_SUITE(PennecClosedForms, Features);

TYPED_TEST(PennecClosedForms, meanOfTwoIsOnTheirGeodesic) {
  Draw<TypeParam> draw(1);
  for (int trial = 0; trial < 20; ++trial) {
    const TypeParam a = draw.feature(0.6), b = exp(a, draw.tangent(0.4));
    const std::vector<TypeParam> x{a, b};
    EXPECT_LT(log(mean(x).mean, interpolate(a, b, 0.5)).norm(), 1e-12);
    const std::vector<double> p{0.7, 2.1};
    EXPECT_LT(log(mean(x, p).mean, interpolate(a, b, 0.75)).norm(), 1e-12);
  }
}

TYPED_TEST(PennecClosedForms, meanOfASymmetricSampleIsItsCentre) {
  Draw<TypeParam> draw(2);
  const TypeParam centre = draw.feature(0.5);
  std::vector<TypeParam> x;
  for (int i = 0; i < 10; ++i) {
    const TangentOf<TypeParam> e = draw.tangent(0.5);
    x.push_back(exp(centre, e));
    x.push_back(exp(centre, TangentOf<TypeParam>(-e)));
  }
  EXPECT_LT(log(mean(x).mean, centre).norm(), 1e-12);
}

TYPED_TEST(PennecClosedForms, meansMoveWithTheData) {
  using Group = typename ManifoldTraits<TypeParam>::Group;
  Draw<TypeParam> draw(3);
  std::vector<TypeParam> x, moved;
  std::vector<Gaussian<TypeParam>> g, moved_g;
  typename Group::Tangent v;
  for (int i = 0; i < v.size(); ++i) v[i] = 0.3 * (i + 1) - 0.4;
  const Group f = Group::exp(v);
  const TypeParam centre = draw.feature(0.5);
  for (int i = 0; i < 12; ++i) {
    x.push_back(exp(centre, draw.tangent(0.3)));
    moved.push_back(act(f, x.back()));
    g.push_back({x.back(), draw.covariance(0.2)});
    moved_g.push_back(act(f, g.back()));
  }
  EXPECT_LT(log(mean(moved).mean, act(f, mean(x).mean)).norm(), 1e-12);
  const auto estimate = maha(g, CovarianceAt::measured).estimate();
  const auto moved_estimate = maha(moved_g, CovarianceAt::measured).estimate();
  const auto expected = act(f, estimate);
  EXPECT_LT(log(moved_estimate.mean, expected.mean).norm(), 1e-11);
  // The representative of a quotient is the start's; its covariance moves with it, so compare invariants.
  EXPECT_NEAR(moved_estimate.covariance.determinant() / expected.covariance.determinant(), 1, 1e-8);
}

TYPED_TEST(PennecClosedForms, newtonAndTheFixedPointAgree) {
  Draw<TypeParam> draw(4);
  std::vector<TypeParam> x;
  for (int i = 0; i < 15; ++i) x.push_back(draw.feature(0.4));
  const auto newton = mean(x);
  const auto fixed_point = mean(x, {.method = MeanMethod::fixed_point});
  EXPECT_TRUE(converged(newton.status) && converged(fixed_point.status));
  EXPECT_LE(newton.iterations, fixed_point.iterations);
  EXPECT_LT(log(newton.mean, fixed_point.mean).norm(), 1e-11);
}

TYPED_TEST(PennecClosedForms, derivativesOfTheMahalanobisCriterion) {
  // Gradient and Hessian of the criterion against its own differences, away from the minimum for the gradient.
  constexpr int k = ManifoldTraits<TypeParam>::DoF;
  using Tangent = TangentOf<TypeParam>;
  for (const bool likelihood : {false, true}) {
    for (const CovarianceAt at : {CovarianceAt::measured, CovarianceAt::estimated}) {
      Draw<TypeParam> draw(5);
      std::vector<Gaussian<TypeParam>> g;
      const TypeParam centre = draw.feature(0.5);
      for (int i = 0; i < 8; ++i) {
        SquareOf<TypeParam> S = draw.covariance(0.3);
        // Without a continuous placement only isotropic covariances belong to the estimate.
        if (std::is_same_v<TypeParam, S2d> && at == CovarianceAt::estimated)
          S = S(0, 0) * SquareOf<TypeParam>::Identity();
        g.push_back({exp(centre, draw.tangent(0.3)), S});
      }
      const MahaResult<TypeParam> result = maha(g, at, {.likelihood = likelihood});
      ASSERT_EQ(result.status, Status::ok);
      detail::MahaProblem<TypeParam, decltype(g)> problem{g, at, likelihood};
      for (const auto& measurement : g) {
        problem.append(measurement.mean,
                       detail::Cholesky<double, ManifoldTraits<TypeParam>::DoF>(measurement.covariance));
      }
      const auto cost = [&](const TypeParam& y, const Tangent& v) {
        return problem.evaluate(SerialExecutor{}, exp(y, v)).cost;
      };
      const TypeParam off = exp(result.mean, Tangent(Tangent::Constant(0.1)));
      Tangent gradient;
      SquareOf<TypeParam> hessian;
      for (int i = 0; i < k; ++i) {
        const Tangent a = 1e-5 * Tangent::Unit(i);
        gradient[i] = (cost(off, a) - cost(off, -a)) / 2e-5;
        for (int j = 0; j < k; ++j) {
          const Tangent b = 1e-4 * Tangent::Unit(i), c = 1e-4 * Tangent::Unit(j);
          hessian(i, j) = (cost(result.mean, b + c) - cost(result.mean, b - c) - cost(result.mean, c - b) +
                           cost(result.mean, -b - c)) /
                          4e-8;
        }
      }
      EXPECT_LT((gradient - problem.evaluate(SerialExecutor{}, off).gradient).norm(), 1e-6 * (1 + gradient.norm()));
      EXPECT_LT((hessian - result.hessian).norm(), 1e-6 * hessian.norm());
    }
  }
}

TEST(PennecClosedForm, rotationsAboutOneAxis) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1, -2, 0.5).normalized();
  const std::vector<double> angles{0.3, 1.1, 2.0, -0.4, 0.9}, weights{1, 2, 0.5, 1, 3};
  std::vector<SO3d> x;
  double sum = 0, weight = 0, sine = 0, cosine = 0;
  for (std::size_t i = 0; i < angles.size(); ++i) {
    x.push_back(SO3d::exp(angles[i] * axis));
    sum += weights[i] * angles[i], weight += weights[i];
    sine += weights[i] * std::sin(angles[i]), cosine += weights[i] * std::cos(angles[i]);
  }
  EXPECT_LT((mean(x, weights).mean.log() - sum / weight * axis).norm(), 1e-12);
  // The start is the chordal mean, whose angle is that of the summed vectors.
  EXPECT_LT((startOfMean<SO3d>(SerialExecutor{}, x, weights).log() - std::atan2(sine, cosine) * axis).norm(), 1e-12);
}

TEST(PennecClosedForm, meanRotationIsBiInvariant) {
  Draw<SO3d> draw(6);
  std::vector<SO3d> x, right, inverse;
  std::vector<Gaussian<SO3d>> g, right_g;
  const SO3d b = draw.feature(1.5);
  for (int i = 0; i < 12; ++i) {
    x.push_back(draw.feature(0.5));
    right.push_back(x.back() * b);
    inverse.push_back(x.back().inverse());
    g.push_back({x.back(), draw.covariance(0.2)});
    const Eigen::Matrix3d R = b.matrix();
    right_g.push_back({right.back(), R.transpose() * g.back().covariance * R});
  }
  const SO3d m = mean(x).mean;
  EXPECT_LT(log(mean(right).mean, m * b).norm(), 1e-12);
  EXPECT_LT(log(mean(inverse).mean, m.inverse()).norm(), 1e-12);
  EXPECT_LT(log(maha(right_g).mean, maha(g).mean * b).norm(), 1e-12);
}

TEST(PennecClosedForm, meanFrameIsMeanRotationAndArithmeticMean) {
  Draw<Frame3d> draw(7);
  std::vector<Frame3d> x;
  std::vector<SO3d> rotations;
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  for (int i = 0; i < 9; ++i) {
    x.push_back(draw.feature(0.6));
    rotations.push_back(x.back().so3());
    translation += x.back().translation() / 9;
  }
  const Frame3d m = mean(x).mean;
  EXPECT_LT(log(SO3d(m.so3()), mean(rotations).mean).norm(), 1e-12);
  EXPECT_LT((m.translation() - translation).norm(), 1e-12);
}

TEST(PennecClosedForm, quotientsEqualRotationsInsideTheInjectivityRadius) {
  Draw<Frame3d> draw(8);
  std::vector<Frame3d> x;
  std::vector<SemiOrientedFrame3d> semi;
  std::vector<NonOrientedFrame3d> non;
  for (int i = 0; i < 9; ++i) {
    x.push_back(draw.feature(0.4));
    // Another representative of each.
    semi.push_back(ManifoldTraits<SemiOrientedFrame3d>::representative(SemiOrientedFrame3d(x.back().se3()), i % 2 * 3));
    non.push_back(ManifoldTraits<NonOrientedFrame3d>::representative(NonOrientedFrame3d(x.back().se3()), i % 4));
  }
  const auto reference = mean(x);
  const auto semi_mean = mean(semi);
  const auto non_mean = mean(non);
  EXPECT_LT(log(semi_mean.mean, SemiOrientedFrame3d(reference.mean.se3())).norm(), 1e-12);
  EXPECT_LT(log(non_mean.mean, NonOrientedFrame3d(reference.mean.se3())).norm(), 1e-12);
  EXPECT_NEAR(semi_mean.cost, reference.cost, 1e-12);
  EXPECT_NEAR(non_mean.cost, reference.cost, 1e-12);
}

TEST(PennecClosedForm, quotientRepresentativeMovesWithItsCovariance) {
  // Replacing x_i by another representative with its covariance conjugated leaves the MAHA mean as it is; without the
  // conjugation it moves.
  Draw<NonOrientedFrame3d> draw(9);
  using T = ManifoldTraits<NonOrientedFrame3d>;
  std::vector<Gaussian<NonOrientedFrame3d>> g, other, wrong;
  for (int i = 0; i < 10; ++i) {
    g.push_back({draw.feature(0.3), draw.covariance(0.3)});
    const auto K = T::representativeJacobian(i % 4);
    const auto y = T::representative(g.back().mean, i % 4);
    other.push_back({y, K * g.back().covariance * K.transpose()});
    wrong.push_back({y, g.back().covariance});
  }
  const auto options = MahaOptions<NonOrientedFrame3d>{.start = g[0].mean};
  const auto reference = maha(g, CovarianceAt::measured, options).mean;
  EXPECT_LT(log(reference, maha(other, CovarianceAt::measured, options).mean).norm(), 1e-12);
  EXPECT_GT(log(reference, maha(wrong, CovarianceAt::measured, options).mean).norm(), 0.01);
}

TEST(PennecClosedForm, groupBarycentreOfPoses) {
  Draw<SE3d> draw(10);
  std::vector<SE3d> x, left, right, inverse;
  const SE3d f = draw.feature(1.2);
  for (int i = 0; i < 15; ++i) {
    x.push_back(draw.feature(0.5));
    left.push_back(f * x.back());
    right.push_back(x.back() * f);
    inverse.push_back(x.back().inverse());
  }
  const auto result = groupMean(x);
  ASSERT_TRUE(converged(result.status));
  const SE3d m = result.mean;
  EXPECT_LT((groupMean(left).mean.inverse() * f * m).log().norm(), 1e-12);
  EXPECT_LT((groupMean(right).mean.inverse() * m * f).log().norm(), 1e-12);
  EXPECT_LT((groupMean(inverse).mean * m).log().norm(), 1e-12);
  // Rotation part: the mean rotation; translation in closed form with ρ_i = log(R̄ᵀ R_i).
  const Eigen::Matrix3d Rt = m.rotationMatrix().transpose();
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  std::vector<SO3d> rotations;
  for (const SE3d& p : x) {
    rotations.push_back(p.so3());
    const Eigen::Matrix3d J = SO3d::leftJacobianInverse((m.so3().inverse() * p.so3()).log()) * Rt;
    A += J;
    b += J * p.translation();
  }
  EXPECT_LT(log(SO3d(m.so3()), mean(rotations).mean).norm(), 1e-12);
  EXPECT_LT((A.inverse() * b - m.translation()).norm(), 1e-12);
}

TEST(PennecClosedForm, flatCovariances) {
  // On points every formula is the textbook's.
  Draw<Eigen::Vector3d> draw(11);
  std::vector<Eigen::Vector3d> x;
  std::vector<Eigen::Matrix3d> V;
  std::vector<double> p;
  std::vector<Gaussian<Eigen::Vector3d>> g;
  Eigen::Vector3d mean_x = Eigen::Vector3d::Zero(), information_sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero(), noise = Eigen::Matrix3d::Zero();
  double weight = 0;
  for (int i = 0; i < 7; ++i) {
    x.push_back(draw.feature(2));
    V.push_back(draw.covariance(1));
    p.push_back(0.5 + i);
    g.push_back({x.back(), V.back()});
    mean_x += p.back() * x.back(), weight += p.back();
    noise += p.back() * p.back() * V.back();
    information += V.back().inverse();
    information_sum += V.back().inverse() * x.back();
  }
  mean_x /= weight;
  const auto result = mean(x, p);
  EXPECT_LT((result.mean - mean_x).norm(), 1e-13);
  EXPECT_LT((covarianceFromNoise(result, p, V) - noise / (weight * weight)).norm(), 1e-12);
  Eigen::Matrix3d residual = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < x.size(); ++i) residual += p[i] * (x[i] - mean_x) * (x[i] - mean_x).transpose();
  EXPECT_LT((covarianceFromResiduals(result) - residual / (6 * weight)).norm(), 1e-12);
  const auto fused = maha(g);
  EXPECT_LT((fused.mean - information.inverse() * information_sum).norm(), 1e-11);
  EXPECT_LT((fused.covariance - information.inverse()).norm(), 1e-11);
}

}  // namespace
}  // namespace liestat
