// The unscented transform against polynomials' exact moments and a quadrature of higher order.
#include <lie/frame3.hpp>
#include <lie/rn.hpp>
#include <lie/s2.hpp>
#include <lie/se3.hpp>
#include <lie/so3.hpp>
#include <stats/mean.hpp>
#include <stats/random.hpp>
#include <stats/unscented.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

using namespace liestat;

namespace {

template <int K>
Eigen::Matrix<double, K, K> someCovariance(double sd, CounterRng& rng) {
  Eigen::Matrix<double, K, K> A;
  for (int i = 0; i < K; ++i) A.col(i) = rng.normalVector<K>();
  return sd * sd * (A * A.transpose() / K + 0.2 * Eigen::Matrix<double, K, K>::Identity());
}

TEST(Unscented, pointsHaveTheMomentsToThirdOrder) {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  CounterRng rng(1);
  const Gaussian<SE3d> g{SE3d(SO3d::exp({1, 0.2, -2}), {1, 2, 3}), someCovariance<6>(0.1, rng)};
  for (const double c : {0.5, 3.0, 6.0, 8.0}) {
    const SigmaPoints<SE3d> sigma = sigmaPoints(g, c);
    double zeroth = 0;
    Vector6 first = Vector6::Zero();
    Eigen::Matrix<double, 6, 6> second = Eigen::Matrix<double, 6, 6>::Zero();
    double third = 0;
    for (std::size_t i = 0; i < sigma.points.size(); ++i) {
      const Vector6 z = log(g.mean, sigma.points[i]);
      zeroth += sigma.weights[i], first += sigma.weights[i] * z;
      second += sigma.weights[i] * z * z.transpose(), third += sigma.weights[i] * z[0] * z[1] * z[5];
    }
    EXPECT_NEAR(zeroth, 1, 1e-14);
    EXPECT_LT(first.norm(), 1e-14);
    EXPECT_LT((second - g.covariance).norm(), 1e-14);
    EXPECT_NEAR(third, 0, 1e-15);
  }
}

TEST(Unscented, meansOfCubicPolynomialsAreExact) {
  CounterRng rng(2);
  const Eigen::Vector3d m(0.3, -1, 2);
  const Eigen::Matrix3d C = someCovariance<3>(0.7, rng);
  const auto image = unscentedTransform(Gaussian<Eigen::Vector3d>{m, C}, [](const Eigen::Vector3d& x) {
    return Eigen::Vector2d(x[0] * x[0] * x[1] - 2 * x[2] * x[2] * x[2], x[1] * x[2] + x[0]);
  });
  const double first =
      m[0] * m[0] * m[1] + C(0, 0) * m[1] + 2 * C(0, 1) * m[0] - 2 * (m[2] * m[2] * m[2] + 3 * m[2] * C(2, 2));
  EXPECT_NEAR(image.estimate.mean[0], first, 1e-12);
  EXPECT_NEAR(image.estimate.mean[1], m[1] * m[2] + C(1, 2) + m[0], 1e-12);
  EXPECT_EQ(image.status, Status::ok);
}

/// Gauss and Hermite's quadrature with five nodes on each of three axes, exact to the ninth order.
template <class N, class F>
MeanAbout<N> quadrature(const Gaussian<SO3d>& g, const F& f) {
  const double a = std::sqrt(5 - std::sqrt(10.0)), b = std::sqrt(5 + std::sqrt(10.0));
  const double wa = (7 + 2 * std::sqrt(10.0)) / 60, wb = (7 - 2 * std::sqrt(10.0)) / 60;
  const double nodes[] = {0, a, -a, b, -b}, weights[] = {8.0 / 15, wa, wa, wb, wb};
  const Eigen::Matrix3d L = detail::Cholesky<double, 3>(g.covariance).lower();
  std::vector<N> images;
  std::vector<double> w;
  for (int i = 0; i < 125; ++i) {
    const int x = i % 5, y = i / 5 % 5, z = i / 25;
    images.push_back(f(exp(g.mean, Eigen::Vector3d(L * Eigen::Vector3d(nodes[x], nodes[y], nodes[z])))));
    w.push_back(weights[x] * weights[y] * weights[z]);
  }
  return meanAbout(images, w, images[0]);
}

TEST(Unscented, errorsOnManifoldsAreOfFourthOrder) {
  const auto f = [](const SO3d& r) { return S2d(r * Eigen::Vector3d(0.6, 0, 0.8)); };
  double before_mean = 0, before_covariance = 0;
  for (const double sd : {0.2, 0.1, 0.05}) {
    CounterRng rng(3);
    const Gaussian<SO3d> g{SO3d::exp({0.3, 0.4, 0.5}), someCovariance<3>(sd, rng)};
    const auto image = unscentedTransform(g, f);
    const MeanAbout<S2d> exact = quadrature<S2d>(g, f);
    const double error = distance(image.estimate.mean, exact.mean);
    const double spread = std::abs((image.estimate.covariance - exact.covariance).trace());
    // A factor of 16 but for the next order.
    if (before_mean > 0) {
      EXPECT_GT(before_mean, 11 * error) << sd;
      EXPECT_GT(before_covariance, 11 * spread) << sd;
    }
    before_mean = error, before_covariance = spread;
  }
}

TEST(Unscented, negativeWeightsConverge) {
  // κ = 3 - k, and a spread as small as filters take it, whose middle has a weight of minus a million.
  CounterRng rng(4);
  for (const double c : {3.0, 6e-6}) {
    for (int trial = 0; trial < 50; ++trial) {
      const SE3d mean(SO3d::exp(Eigen::Vector3d(rng.normalVector<3>())), rng.normalVector<3>());
      const Gaussian<SE3d> g{mean, someCovariance<6>(0.2, rng)};
      const auto image = unscentedTransform(
          g, [](const SE3d& x) { return x; }, c);
      ASSERT_EQ(image.status, Status::ok) << c;
      EXPECT_LT(log(g.mean, image.estimate.mean).norm(), 1e-9);
      EXPECT_LT((image.estimate.covariance - g.covariance).norm(), 1e-7);
      EXPECT_LT((image.cross - g.covariance).norm(), 1e-7);
    }
  }
}

TEST(Unscented, stepsThatOvershootAreHalved) {
  // Across the great circle of the three the residuals change by 5 - 4 · 1.5 cot 1.5 = 4.6 times a step.
  const S2d middle(0, 0, 1);
  const std::vector<S2d> x{middle, exp(middle, Eigen::Vector2d(1.5, 0)), exp(middle, Eigen::Vector2d(-1.5, 0))};
  const MeanAbout<S2d> about = meanAbout(x, std::vector<double>{5, -2, -2}, exp(middle, Eigen::Vector2d(0, 0.1)));
  EXPECT_EQ(about.status, Status::ok);
  EXPECT_LT(distance(about.mean, middle), 1e-12);
}

TEST(Unscented, positiveWeightsGiveTheMean) {
  CounterRng rng(5);
  std::vector<SO3d> x;
  std::vector<double> w;
  for (int i = 0; i < 20; ++i) {
    x.push_back(SO3d::exp(Eigen::Vector3d(0.4 * rng.normalVector<3>())));
    w.push_back(rng.uniform(0.5, 2));
  }
  const MeanAbout<SO3d> about = meanAbout(x, w, x[0]);
  EXPECT_EQ(about.status, Status::ok);
  EXPECT_LT(distance(about.mean, mean(x, w).mean), 1e-12);
}

TEST(Unscented, badWeightsAndNoFeaturesAreSaid) {
  const std::vector<SO3d> x(3);
  EXPECT_EQ(meanAbout(x, std::vector<double>{1, -2, 1}, SO3d()).status, Status::not_applicable);
  EXPECT_EQ(meanAbout(x, std::vector<double>{1, 1}, SO3d()).status, Status::not_applicable);
  EXPECT_EQ(meanAbout(x, std::vector<double>{1, NAN, 1}, SO3d()).status, Status::not_applicable);
  EXPECT_EQ(meanAbout(std::vector<SO3d>(), std::vector<double>(), SO3d()).status, Status::not_applicable);
  // A step within c standard deviations: the negative weight leaves no covariance.
  Gaussian<Eigen::Matrix<double, 6, 1>> g{Eigen::Matrix<double, 6, 1>::Zero(), Eigen::Matrix<double, 6, 6>::Identity()};
  const auto bent = unscentedTransform(
      g, [](const Eigen::Matrix<double, 6, 1>& v) { return Eigen::Matrix<double, 1, 1>(v.squaredNorm()); }, 0.5);
  EXPECT_EQ(bent.status, Status::ill_defined);
}

}  // namespace
