// Covariances in other conventions: each against what a small error does in that convention, and there and back.

#include <lie/lie.hpp>
#include <stats/convention_charts.hpp>
#include <stats/convention_layouts.hpp>
#include <stats/convention_losses.hpp>
#include <stats/convention_presets.hpp>
#include <stats/conventions.hpp>
#include <stats/propagation.hpp>
#include <stats/sampling.hpp>

#include <support/dynamic.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace liestat {
namespace {

using liestat_test::dynamic, liestat_test::fixed, liestat_test::gap, liestat_test::outer;

template <class M>
M randomFeature(CounterRng& rng) {
  if constexpr (requires { M::sampleUniform(rng); }) {
    return M::sampleUniform(rng);
  } else {
    return sampleInCube<M>(rng);
  }
}

template <class M>
Gaussian<M> randomGaussian(CounterRng& rng) {
  constexpr int k = ManifoldTraits<M>::DoF;
  SquareOf<M> A;
  for (int i = 0; i < k; ++i) A.col(i) = rng.normalVector<k>();
  return {randomFeature<M>(rng), fixed<SquareOf<M>>(outer(dynamic(A)) + Eigen::MatrixXd::Identity(k, k))};
}

template <class M>
class ConventionsTest : public testing::Test {};
using Types = testing::Types<SO2d, SO3d, SE2d, SE3d, SE23d, RxSO2d, RxSO3d, Sim2d, Sim3d, Frame2d, Frame3d>;
TYPED_TEST_SUITE(ConventionsTest, Types);

// There and back is a handful of products with matrices whose condition is below 100.
constexpr double rounding = 1e-12;

TYPED_TEST(ConventionsTest, thereAndBack) {
  using M = TypeParam;
  CounterRng rng(1, 0);
  for (int trial = 0; trial < 10; ++trial) {
    const auto g = randomGaussian<M>(rng);
    const Eigen::MatrixXd covariance = dynamic(g.covariance);
    const double tolerance = rounding * covariance.norm();
    const Gaussian<M> there_and_back = fromWorldAxesCovariance(g.mean, worldAxesCovariance(g));
    EXPECT_LT(gap(dynamic(there_and_back.covariance), covariance), tolerance);
    const SquareOf<M> reordered = covarianceInOrder<M>(g.covariance, rotation_first);
    EXPECT_EQ(dynamic(covarianceFromOrder<M>(reordered, rotation_first)), covariance) << "a permutation is exact";
    if constexpr (LieGroup<M>) {
      const Gaussian<M> back = fromLeftCovariance(g.mean, leftCovariance(g));
      EXPECT_LT(gap(dynamic(back.covariance), covariance), tolerance);
    }
  }
}

TYPED_TEST(ConventionsTest, leftErrorsMoveTheWorld) {
  using M = TypeParam;
  if constexpr (LieGroup<M>) {
    CounterRng rng(2, 0);
    const M x = M::sampleUniform(rng);
    const TangentOf<M> e = 0.1 * rng.normalVector<M::DoF>();
    // The covariance of one error vector is its square.
    const TangentOf<M> left = (x * M::exp(e) * x.inverse()).log();
    const SquareOf<M> covariance = leftCovariance(Gaussian<M>{x, fixed<SquareOf<M>>(outer(dynamic(e)))});
    EXPECT_LT(gap(dynamic(covariance), outer(dynamic(left))), rounding);
  }
}

TYPED_TEST(ConventionsTest, worldAxesAreThoseOfTheWorld) {
  using M = TypeParam;
  CounterRng rng(3, 0);
  const M x = randomFeature<M>(rng);
  // First order: an error of 1e-6 has a second order of 1e-12.
  const TangentOf<M> e = 1e-6 * rng.normalVector<ManifoldTraits<M>::DoF>();
  const M y = exp(x, e);
  TangentOf<M> moved = TangentOf<M>::Zero();
  int at = 0;
  if constexpr (requires { x.translation(); }) {
    constexpr int dim = ManifoldTraits<M>::Group::Dim;
    moved.template head<dim>() = y.translation() - x.translation();
    at = dim;
  }
  const auto turn = (y.rotationMatrix() * x.rotationMatrix().transpose()).eval();
  if constexpr (std::decay_t<decltype(turn)>::RowsAtCompileTime == 2) {
    moved[at++] = std::atan2(turn(1, 0), turn(0, 0));
  } else {
    moved.template segment<3>(at) = SO3d(turn).log();
    at += 3;
  }
  if constexpr (requires { x.velocity(); }) moved.template tail<3>() = y.velocity() - x.velocity();
  if constexpr (requires { x.scale(); }) moved[at] = std::log(y.scale() / x.scale());
  const Eigen::MatrixXd covariance =
      dynamic(worldAxesCovariance(Gaussian<M>{x, fixed<SquareOf<M>>(outer(dynamic(e)))}));
  EXPECT_LT(gap(covariance, outer(dynamic(moved))), 1e-4 * covariance.norm());
}

TEST(Conventions, turnsAboutTheOriginMoveWhatIsFarFromIt) {
  // A pose at (10, 0, 0) that is sure but for its heading: about its own place nothing moves, about the origin the
  // position moves by ten times the angle.
  Gaussian<SE3d> g{SE3d::transX(10), SquareOf<SE3d>::Zero()};
  g.covariance(5, 5) = 0.01;
  EXPECT_NEAR(worldAxesCovariance(g)(1, 1), 0, 1e-15);
  EXPECT_NEAR(leftCovariance(g)(1, 1), 100 * 0.01, 1e-13);
}

TEST(Conventions, ordersOfNamedParts) {
  Eigen::Matrix<double, 9, 1> v;
  v << 1, 2, 3, 4, 5, 6, 7, 8, 9;
  Eigen::Matrix<double, 9, 1> expected;
  expected << 4, 5, 6, 7, 8, 9, 1, 2, 3;
  const auto P = tangentPermutation<SE23d>({TangentPart::rotation, TangentPart::velocity, TangentPart::translation});
  EXPECT_EQ((P * v).eval(), expected);
  expected << 4, 5, 6, 1, 2, 3, 7, 8, 9;
  EXPECT_EQ((tangentPermutation<SE23d>(rotation_first) * v).eval(), expected);
  EXPECT_EQ((tangentPermutation<SE2d>(rotation_first) * Eigen::Vector3d(1, 2, 3)).eval(), Eigen::Vector3d(3, 1, 2));
  Eigen::Matrix<double, 7, 1> similarity, other;
  similarity << 1, 2, 3, 4, 5, 6, 7;
  other << 4, 5, 6, 1, 2, 3, 7;
  EXPECT_EQ((tangentPermutation<Sim3d>(rotation_first) * similarity).eval(), other);
  EXPECT_EQ((tangentPermutation<SO3d>(rotation_first) * Eigen::Vector3d(1, 2, 3)).eval(), Eigen::Vector3d(1, 2, 3));
}

TEST(Conventions, nanGivesNan) {
  Gaussian<SE3d> g;
  g.covariance(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(leftCovariance(g).allFinite());
  EXPECT_FALSE(worldAxesCovariance(g).allFinite());
  EXPECT_FALSE(covarianceInOrder<SE3d>(g.covariance, rotation_first).allFinite());
}

// --- Conventions of poses -------------------------------------------------------------------------------------------

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
constexpr double eps = std::numeric_limits<double>::epsilon();

/// Each perturbation in each order and unit.
std::vector<Convention> allCoordinates() {
  std::vector<Convention> all;
  for (const Perturbation p : all_perturbations) {
    for (const auto order : {CovarianceOrder::translation_rotation, CovarianceOrder::rotation_translation}) {
      for (const auto unit :
           {RotationUnit::radian, RotationUnit::half_angle, RotationUnit::double_angle, RotationUnit::degree}) {
        all.push_back({order, p, unit});
      }
    }
  }
  return all;
}
std::vector<NamedConvention> allNamed() {
  std::vector<NamedConvention> all(std::begin(convention_presets), std::end(convention_presets));
  all.insert(all.end(), std::begin(convention_aliases), std::end(convention_aliases));
  return all;
}

/// A rotation of 1 rad or so, a position some metres away, a full covariance with eigenvalues from 0.8 to 14, scaled.
Gaussian<SE3d> fullGaussian(CounterRng& rng, double scale = 1) {
  const Eigen::Vector3d axis = rng.normalVector<3>().normalized();
  const SE3d T(SO3d::exp(axis * (0.7 + 0.6 * rng.uniform())), 2 * rng.normalVector<3>().normalized());
  Matrix6 A, V = Matrix6::Zero();
  for (int i = 0; i < 6; ++i) A.col(i) = rng.normalVector<6>();
  const Matrix6 Q = A.householderQr().householderQ();
  const double eigenvalues[] = {0.8, 1.5, 3, 5, 9, 14};
  for (int i = 0; i < 6; ++i) V += eigenvalues[i] * Q.col(i) * Q.col(i).transpose();
  return {T, scale * V};
}

/// The largest |A - B| of an entry (i, j) in units of σ_i σ_j of B.
double scaledGap(const Matrix6& A, const Matrix6& B) {
  double largest = 0;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      const double gap = std::abs(A(i, j) - B(i, j)) / std::sqrt(B(i, i) * B(j, j));
      if (!(gap <= largest)) largest = gap;  // NaN stays
    }
  }
  return largest;
}

TEST(PoseConventions, jacobiansAreTheDerivativesOfTheCharts) {
  CounterRng rng(11, 0);
  for (int trial = 0; trial < 10; ++trial) {
    const SE3d T = fullGaussian(rng).mean;
    for (const Convention& c : allCoordinates()) {
      const Matrix6 J = conventionJacobian(c, T);
      Matrix6 differences;
      constexpr double h = 1e-5;  // rounding eps/h = 2e-11, truncation h²
      for (int i = 0; i < 6; ++i) {
        const Vector6 d = h * Vector6::Unit(i);
        differences.col(i) = (conventionLog(c, T, T * SE3d::exp(d)) - conventionLog(c, T, T * SE3d::exp(-d))) / (2 * h);
      }
      const double unit = std::max(1.0, unitsPerRadian(c.unit));
      EXPECT_LE((J - differences).cwiseAbs().maxCoeff(), 1e-9 * unit * std::max(1.0, J.norm() / unit))
          << conventionName(c);
      EXPECT_LE((J * conventionJacobianInverse(c, T) - Matrix6::Identity()).norm(), 1e-12) << conventionName(c);
      EXPECT_NEAR(conventionLogDeterminant(c, T), std::log(std::abs(J.determinant())), 1e-12) << conventionName(c);
    }
  }
}

TEST(PoseConventions, chartsAreBijective) {
  CounterRng rng(12, 0);
  for (int trial = 0; trial < 20; ++trial) {
    const SE3d T_hat = fullGaussian(rng).mean;
    // Large errors: a radian, a metre.
    Vector6 xi = rng.normalVector<6>();
    xi.tail<3>() *= 0.5;
    const SE3d T = T_hat * SE3d::exp(xi);
    for (const Convention& c : allCoordinates()) {
      const SE3d back = conventionExp(c, T_hat, conventionLog(c, T_hat, T));
      EXPECT_LE((back.matrix() - T.matrix()).norm(), 1e-12) << conventionName(c);
      EXPECT_LE(conventionLog(c, T_hat, T_hat).norm(), 1e-14 * unitsPerRadian(RotationUnit::degree))
          << conventionName(c);
    }
  }
}

TEST(PoseConventions, roundTripsOfAllOrderedPairs) {
  CounterRng rng(13, 0);
  for (const double distance : {0.0, 2.0, 100.0, 1e4}) {
    Gaussian<SE3d> g = fullGaussian(rng, 1e-4);
    g.mean = SE3d(g.mean.so3(), distance * Eigen::Vector3d(g.mean.translation()).normalized());
    for (const NamedConvention& from : allNamed()) {
      const Matrix6 C = toConvention(from.convention, g);
      for (const NamedConvention& to : allNamed()) {
        const Gaussian<SE3d> there = fromConvention(from.convention, g.mean, C);
        const Matrix6 D = toConvention(to.convention, there);
        const Gaussian<SE3d> back = fromConvention(to.convention, g.mean, D);
        // An information matrix adds an inversion, whose error grows with the condition, here 18.
        const double bound = conversionLoss(from.convention, to.convention, g).round_trip +
                             conversionLoss({}, from.convention, g).round_trip +
                             conversionLoss({}, to.convention, g).round_trip;
        EXPECT_LE(scaledGap(back.covariance, g.covariance), bound)
            << from.name << " to " << to.name << " at " << distance << " m";
      }
    }
  }
}

TEST(PoseConventions, textOfConventions) {
  for (const Convention& c : allCoordinates()) {
    for (const auto content :
         {CovarianceContent::covariance, CovarianceContent::information, CovarianceContent::sigmas}) {
      for (const auto layout :
           {CovarianceLayout::full36, CovarianceLayout::upper21, CovarianceLayout::lower21, CovarianceLayout::blocks12,
            CovarianceLayout::diag6, CovarianceLayout::planar6, CovarianceLayout::toro6}) {
        Convention d = c;
        d.content = content;
        d.layout = layout;
        EXPECT_EQ(parseConvention(conventionName(d)), d) << conventionName(d);
      }
    }
  }
  for (const NamedConvention& n : allNamed()) EXPECT_EQ(parseConvention(n.name), n.convention) << n.name;
  EXPECT_EQ(conventionName(*parseConvention("gtsam")), "right,order=rt");
  for (const char* wrong :
       {"", "rigth", "right,", "right,order", "right,order=", "right,order=xy", "right,side=left"}) {
    EXPECT_FALSE(parseConvention(wrong)) << wrong;
  }
}

}  // namespace
}  // namespace liestat
