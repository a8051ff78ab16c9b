// Gaussians on manifolds: what moves with a transformation, distances, charts, sampling, comparison of two estimates.

#include <lie/lie.hpp>
#include <stats/gaussian.hpp>
#include <stats/sampling.hpp>

#include <support/dynamic.hpp>

#include <gtest/gtest.h>

#include <cmath>

namespace liestat {
namespace {

using liestat_test::dynamic, liestat_test::fixed, liestat_test::gap, liestat_test::outer;

template <class M>
class GaussianTest : public testing::Test {};
using Features = testing::Types<Eigen::Vector3d, SO2d, SO3d, SE2d, SE3d, S2d, Frame2d, Frame3d, SemiOrientedFrame3d,
                                NonOrientedFrame3d, OrientedPointd, Essentiald, Product<SO3d, Eigen::Vector3d>,
                                Product<SemiOrientedFrame3d, Eigen::Vector2d>>;
TYPED_TEST_SUITE(GaussianTest, Features);

template <class M>
Gaussian<M> draw(CounterRng& rng, double sd) {
  constexpr int k = ManifoldTraits<M>::DoF;
  SquareOf<M> A;
  for (int i = 0; i < k; ++i) A.col(i) = rng.normalVector<k>();
  const Eigen::MatrixXd square = outer(dynamic(A)) / k + 0.2 * Eigen::MatrixXd::Identity(k, k);
  return {sampleInCube<M>(rng, 3), fixed<SquareOf<M>>(sd * sd * square)};
}

TYPED_TEST(GaussianTest, distanceIsInvariant) {
  using Group = typename ManifoldTraits<TypeParam>::Group;
  CounterRng rng(1, 0);
  for (int trial = 0; trial < 20; ++trial) {
    const auto g = draw<TypeParam>(rng, 0.2);
    const TypeParam y = sample(g, rng);
    const typename Group::Tangent v = rng.normalVector<Group::DoF>();
    const Group f = Group::exp(v);
    const double before = mahalanobisSquared(g, y), after = mahalanobisSquared(act(f, g), act(f, y));
    EXPECT_NEAR(after, before, 1e-9 * (1 + before));
    EXPECT_NEAR(mahalanobis(g, y) * mahalanobis(g, y), before, 1e-12 * (1 + before));
  }
}

TYPED_TEST(GaussianTest, chartConversionGoesThereAndBack) {
  CounterRng rng(2, 0);
  for (int trial = 0; trial < 20; ++trial) {
    const auto g = draw<TypeParam>(rng, 0.2);
    const SquareOf<TypeParam> back = covarianceFromPrincipalChart(g.mean, principalChartCovariance(g));
    EXPECT_LT(gap(dynamic(back), dynamic(g.covariance)), 1e-9 * (1 + dynamic(principalChartCovariance(g)).norm()));
  }
}

TYPED_TEST(GaussianTest, samplesHaveTheCovariance) {
  // 4000 draws; the standard error of an entry of the covariance is below √(2/4000) of the largest variance. Five of
  // them: at most 36 entries a type, a false alarm in 1e-4 of the seeds.
  CounterRng rng(3, 0);
  auto g = draw<TypeParam>(rng, 0.1);
  const Eigen::MatrixXd covariance = dynamic(g.covariance);
  Eigen::MatrixXd sum = 0 * covariance;
  const int n = 4000;
  for (int i = 0; i < n; ++i) sum += outer(dynamic(log(g.mean, sample(g, rng)))) / n;
  EXPECT_LT((sum - covariance).cwiseAbs().maxCoeff(), 5 * std::sqrt(2.0 / n) * covariance.diagonal().maxCoeff());
}

TYPED_TEST(GaussianTest, semiDefiniteCovariancesAreSampled) {
  CounterRng rng(4, 0);
  Gaussian<TypeParam> g = draw<TypeParam>(rng, 0.1);
  Eigen::MatrixXd singular = 0 * dynamic(g.covariance);
  singular(0, 0) = 0.01;
  g.covariance = fixed<SquareOf<TypeParam>>(singular);
  for (int i = 0; i < 20; ++i) {
    Eigen::MatrixXd e = dynamic(log(g.mean, sample(g, rng)));
    e(0) = 0;
    EXPECT_LT(e.norm(), 1e-12);
  }
}

TYPED_TEST(GaussianTest, distanceOfTwoEstimatesIsSymmetric) {
  // Exactly where log(b, a) == -log(a, b); elsewhere to the order of the approximation.
  const double tolerance = requires { requires ManifoldTraits<TypeParam>::covariance_models_coincide; }
  ? 1e-9 : 0.3;
  CounterRng rng(5, 0);
  for (int trial = 0; trial < 20; ++trial) {
    auto a = draw<TypeParam>(rng, 0.1);
    auto b = draw<TypeParam>(rng, 0.1);
    b.mean = sample(a, rng);
    const double there = mahalanobisSquared(a, b), back = mahalanobisSquared(b, a);
    EXPECT_NEAR(there, back, tolerance * (1 + there));
  }
}

TEST(Gaussian, comparisonOfTwoEstimatesFollowsChiSquared) {
  // 6000 pairs of rotations, Σ_1 = diag(0.3, 0.6, 0.9)²/15 and Σ_2 = diag(0.9, 0.3, 0.6)²/10: index 3.037 ± 0.033. Four
  // standard errors of both runs together.
  const Eigen::Matrix3d first = Eigen::Vector3d(0.09, 0.36, 0.81).asDiagonal() * (1 / 15.0);
  const Eigen::Matrix3d second = Eigen::Vector3d(0.81, 0.09, 0.36).asDiagonal() * (1 / 10.0);
  const int n = 6000;
  double sum = 0;
  for (int i = 0; i < n; ++i) {
    CounterRng rng(6, static_cast<std::uint64_t>(i));
    const SO3d exact = sampleInCube<SO3d>(rng);
    const SO3d a = sample(Gaussian<SO3d>{exact, first}, rng), b = sample(Gaussian<SO3d>{exact, second}, rng);
    sum += mahalanobisSquared(Gaussian<SO3d>{a, first}, Gaussian<SO3d>{b, second});
  }
  EXPECT_NEAR(sum / n, 3.037, 4 * std::hypot(0.033, std::sqrt(6.0 / n)));
}

TEST(Gaussian, transportCarriesTheGeodesicsDirection) {
  // Along the geodesic from x to y its direction stays what it is, log(x, y) at x and -log(y, x) at y, and so does the
  // one to its left.
  CounterRng rng(7, 0);
  for (int trial = 0; trial < 10; ++trial) {
    const S2d x = sampleInCube<S2d>(rng), y = sampleInCube<S2d>(rng);
    const Eigen::Vector2d at_x = log(x, y), at_y = -log(y, x);
    const auto tilted = [](const Eigen::Vector2d& v) {
      return Eigen::Vector2d(v + 0.5 * Eigen::Vector2d(-v.y(), v.x()));
    };
    const Eigen::Vector2d a = tilted(at_x), b = tilted(at_y);
    const Gaussian<S2d> there = transport(Gaussian<S2d>{x, a * a.transpose()}, y);
    EXPECT_LT((there.covariance - b * b.transpose()).norm(), 1e-12 * a.squaredNorm());
    EXPECT_LT(distance(there.mean, y), 1e-15);
  }
}

TEST(Gaussian, badCovarianceGivesNaN) {
  Gaussian<SO3d> g;
  g.covariance(1, 1) = -1;
  EXPECT_TRUE(std::isnan(mahalanobisSquared(g, SO3d::rotX(0.1))));
}

}  // namespace
}  // namespace liestat
