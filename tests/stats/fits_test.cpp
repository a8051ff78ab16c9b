// Fits of the common models: the truth within the 95 % region, far from the origin and in any unit, exact points
// exactly.
#include <stats/fit_summary.hpp>
#include <stats/fits.hpp>
#include <stats/random.hpp>

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/Geometry>

#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

namespace {

using namespace liestat;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;

/// Squared distance of the truth under a covariance that constraints may have made singular.
template <int N>
double squaredDistance(const Fit<N>& fit, const Eigen::Matrix<double, N, 1>& truth, int rank) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, N, N>> eigen(fit.covariance);
  const Eigen::Matrix<double, N, 1> along = eigen.eigenvectors().transpose() * (truth - fit.parameter);
  double sum = 0;
  for (int i = N - rank; i < N; ++i) sum += along[i] * along[i] / eigen.eigenvalues()[i];
  return sum;
}

/// Means of the squared distances and of χ² over trials follow their laws, to four standard errors.
template <int N, class Make>
void expectConsistent(const Eigen::Matrix<double, N, 1>& truth, int rank, const Make& make) {
  constexpr int trials = 100;
  double squares = 0, chi2 = 0, dof = 0;
  for (std::uint64_t t = 0; t < trials; ++t) {
    CounterRng rng(3, t);
    const Fit<N> fit = make(rng);
    ASSERT_TRUE(fit.ok() || fit.end == ConstrainedEnd::inconsistent) << name(fit.end) << ", trial " << t;
    if (!fit.ok()) continue;
    squares += squaredDistance<N>(fit, truth, rank);
    chi2 += fit.chi2, dof = fit.degrees_of_freedom;
  }
  EXPECT_NEAR(squares / trials, rank, 4 * std::sqrt(2.0 * rank / trials) + 0.05 * rank);
  EXPECT_NEAR(chi2 / trials, dof, 4 * std::sqrt(2 * dof / trials));
}

constexpr double sigma = 0.01;
Vector2d noisy(const Vector2d& m, CounterRng& rng) { return m + sigma * rng.normalVector<2>(); }
Vector3d noisy(const Vector3d& m, CounterRng& rng) { return m + sigma * rng.normalVector<3>(); }

TEST(Fits, circle) {
  expectConsistent<3>({100, -50, 2}, 3, [](CounterRng& rng) {
    std::vector<Vector2d> points;
    for (int i = 0; i < 25; ++i)
      points.push_back(noisy(Vector2d(100 + 2 * std::cos(0.2 * i), -50 + 2 * std::sin(0.2 * i)), rng));
    return fitCircle(points, sigma);
  });
}

TEST(Fits, sphere) {
  expectConsistent<4>({1, 2, 3, 1.5}, 4, [](CounterRng& rng) {
    std::vector<Vector3d> points;
    for (int i = 0; i < 30; ++i) {
      points.push_back(noisy(Vector3d(Vector3d(1, 2, 3) + 1.5 * rng.normalVector<3>().normalized()), rng));
    }
    return fitSphere(points, sigma);
  });
}

TEST(Fits, lineAndPlane) {
  const double c = std::cos(0.4), s = std::sin(0.4);
  expectConsistent<3>({c, s, -3}, 2, [&](CounterRng& rng) {
    std::vector<Vector2d> points;
    for (int i = 0; i < 15; ++i)
      points.push_back(noisy(Vector2d(3 * Vector2d(c, s) + (0.2 * i - 1) * Vector2d(-s, c)), rng));
    Fit<3> fit = fitLine(points, sigma);
    if (fit.parameter[0] < 0) fit.parameter = -fit.parameter;
    return fit;
  });
  const Vector3d n = Vector3d(1, 2, 2) / 3, u = Vector3d(2, -2, 1) / 3, v = Vector3d(2, 1, -2) / 3;
  expectConsistent<4>({n.x(), n.y(), n.z(), 5}, 3, [&](CounterRng& rng) {
    std::vector<Vector3d> points;
    for (int i = 0; i < 30; ++i) {
      points.push_back(noisy(Vector3d(-5 * n + (0.5 * (i % 6) - 1) * u + (0.5 * (i / 6) - 1) * v), rng));
    }
    Fit<4> fit = fitPlane(points, sigma);
    if (fit.parameter[0] < 0) fit.parameter = -fit.parameter;
    return fit;
  });
}

TEST(Fits, lineOfSpace) {
  const Vector3d u = Vector3d(1, 2, 2) / 3, p = Vector3d(2, -2, 1);
  Eigen::Matrix<double, 6, 1> truth;
  truth << p, u;
  expectConsistent<6>(truth, 4, [&](CounterRng& rng) {
    std::vector<Vector3d> points;
    for (int i = 0; i < 20; ++i) points.push_back(noisy(Vector3d(p + (0.3 * i + 1) * u), rng));
    Fit<6> fit = fitLine3(points, sigma);
    if (fit.parameter[3] < 0) fit.parameter.tail<3>() = -fit.parameter.tail<3>();
    EXPECT_NEAR(fit.parameter.head<3>().dot(fit.parameter.tail<3>()), 0, 1e-9);
    return fit;
  });
}

std::vector<Vector2d> ellipsePoints(CounterRng* rng, double unit = 1) {
  std::vector<Vector2d> points;
  const double c = std::cos(0.5), s = std::sin(0.5);
  for (int i = 0; i < 40; ++i) {
    const double x = 2 * std::cos(0.16 * i), y = std::sin(0.16 * i);
    const Vector2d m(7 + c * x - s * y, -4 + s * x + c * y);
    points.push_back(unit * (rng ? noisy(m, *rng) : m));
  }
  return points;
}

TEST(Fits, ellipseAndConic) {
  Eigen::Matrix<double, 5, 1> truth;
  truth << 7, -4, 2, 1, 0.5;
  expectConsistent<5>(truth, 5, [&](CounterRng& rng) { return fitEllipse(ellipsePoints(&rng), sigma); });
  // The same ellipse in any unit, with the same χ².
  CounterRng first(3, 0), second(3, 0);
  const Fit<5> metres = fitEllipse(ellipsePoints(&first), sigma),
               millimetres = fitEllipse(ellipsePoints(&second, 1e3), 1e3 * sigma);
  ASSERT_TRUE(metres.ok() && millimetres.ok());
  EXPECT_NEAR(millimetres.chi2, metres.chi2, 1e-8 * metres.chi2);
  EXPECT_LT((millimetres.parameter.head<4>() - 1e3 * metres.parameter.head<4>()).norm(), 1e-6);
  // Exact points, and a conic that they satisfy.
  const auto exact = ellipsePoints(nullptr);
  EXPECT_LT((fitEllipse(exact, sigma).parameter - truth).norm(), 1e-9);
  const Fit<6> conic = fitConic(exact, sigma);
  ASSERT_TRUE(conic.ok());
  EXPECT_NEAR(conic.parameter.norm(), 1, 1e-12);
  for (const Vector2d& m : exact) {
    const auto& q = conic.parameter;
    EXPECT_NEAR(q[0] * m.x() * m.x() + q[1] * m.x() * m.y() + q[2] * m.y() * m.y() + q[3] * m.x() + q[4] * m.y() + q[5],
                0, 1e-9);
  }
  // A hyperbola is no ellipse.
  std::vector<Vector2d> hyperbola;
  for (int i = 0; i < 20; ++i) hyperbola.push_back({std::cosh(0.2 * i - 2), (i % 2 ? 1 : -1) * std::sinh(0.2 * i - 2)});
  EXPECT_EQ(fitEllipse(hyperbola, sigma).end, ConstrainedEnd::contradictory);
}

TEST(Fits, homographyAndFundamental) {
  Eigen::Matrix3d H;
  H << 1.1, 0.05, 20, -0.03, 0.95, -10, 1e-4, -5e-5, 1;
  Eigen::Matrix<double, 9, 1> h;
  for (int k = 0; k < 9; ++k) h[k] = H(k / 3, k % 3) / H.norm();
  expectConsistent<9>(h, 8, [&](CounterRng& rng) {
    std::vector<Vector4d> matches;
    for (int i = 0; i < 40; ++i) {
      const Vector3d x(200 * rng.uniform() + 50, 200 * rng.uniform() + 50, 1), y = H * x;
      Vector4d m;
      m << x.head<2>(), y.head<2>() / y.z();
      matches.push_back(m + 0.3 * rng.normalVector<4>());
    }
    return fitHomography(matches, 0.3);
  });
  // A camera that moves sideways and turns, in units of its focal length: in pixels the smallest variances of F are
  // below the rounding of the largest.
  Eigen::Matrix3d skew, R;
  const Vector3d t(1, 0.2, 0.1);
  skew << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  R = Eigen::AngleAxisd(0.1, Vector3d(0, 1, 0)).toRotationMatrix();
  const Eigen::Matrix3d F = skew * R;
  Eigen::Matrix<double, 9, 1> f;
  for (int k = 0; k < 9; ++k) f[k] = F(k / 3, k % 3);
  Eigen::Index largest = 0;
  f.cwiseAbs().maxCoeff(&largest);
  f /= f.norm() * (f[largest] > 0 ? 1 : -1);
  expectConsistent<9>(f, 7, [&](CounterRng& rng) {
    std::vector<Vector4d> matches;
    for (int i = 0; i < 80; ++i) {
      const Vector3d X(4 * rng.uniform() - 2, 3 * rng.uniform() - 1.5, 4 + 4 * rng.uniform()), x = X, y = R * X + t;
      Vector4d m;
      m << x.head<2>() / x.z(), y.head<2>() / y.z();
      matches.push_back(m + 4e-4 * rng.normalVector<4>());
    }
    const Fit<9> fit = fitFundamental(matches, 4e-4);
    const Eigen::Matrix3d found = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(fit.parameter.data());
    EXPECT_LT(std::abs(found.determinant()), 1e-12);
    return fit;
  });
}

TEST(Fits, withoutASigmaThatOfTheResiduals) {
  CounterRng rng(5, 0);
  const auto points = ellipsePoints(&rng);
  const Fit<5> found = fitEllipse(points), stated = fitEllipse(points, found.sigma);
  ASSERT_TRUE(found.ok() && stated.ok());
  EXPECT_NEAR(found.sigma, sigma, 4 * sigma / std::sqrt(2.0 * found.degrees_of_freedom));
  EXPECT_TRUE(std::isnan(found.fit_p));
  EXPECT_NEAR(stated.chi2, stated.degrees_of_freedom, 1e-3 * stated.degrees_of_freedom);
  EXPECT_LT((found.covariance - stated.covariance).norm(), 1e-6 * stated.covariance.norm());
  // A sigma that is three times too small is refuted.
  EXPECT_EQ(fitEllipse(points, sigma / 3).end, ConstrainedEnd::inconsistent);
}

TEST(Fits, tooFewAndBadInput) {
  const std::vector<Vector2d> two{{0, 0}, {1, 1}};
  EXPECT_EQ(fitCircle(two, sigma).end, ConstrainedEnd::too_few);
  EXPECT_EQ(fitEllipse(two, sigma).status(), Status::too_few);
  EXPECT_EQ(fitLine(two).end, ConstrainedEnd::too_few);  // no residual says how large the noise is
  EXPECT_TRUE(fitLine(two, sigma).ok());
  std::vector<Vector2d> bad = ellipsePoints(nullptr);
  bad[3].x() = std::nan("");
  EXPECT_FALSE(fitEllipse(bad, sigma).ok());
  EXPECT_FALSE(fitCircle(bad, sigma).ok());
  EXPECT_FALSE(fitConic(std::vector<Vector2d>(10, Vector2d(1, 2)), sigma).ok());
}

/// Points of an ellipse with semi-axes 1 ± e about the origin.
std::vector<Vector2d> nearlyRound(double e, CounterRng& rng) {
  std::vector<Vector2d> points;
  for (int i = 0; i < 20; ++i) {
    const double angle = 2 * std::numbers::pi * i / 20;
    points.push_back(noisy(Vector2d((1 + e) * std::cos(angle), (1 - e) * std::sin(angle)), rng));
  }
  return points;
}

// The axes of a circle have no angle, and those of an ellipse that is nearly one no angle to first order.
TEST(Fits, anEllipseThatMayBeACircleHasNoCovariance) {
  constexpr int trials = 400;
  for (const double difference : {0.0, 1.0, 2.0, 6.0}) {  // of the axes, in standard deviations
    const double e = difference * sigma * std::sqrt(2.0 / 20);
    Eigen::Matrix<double, 5, 1> truth;
    truth << 0, 0, 1 + e, 1 - e, 0;
    int ok = 0, outside = 0;
    for (std::uint64_t t = 0; t < trials; ++t) {
      CounterRng rng(17, t);
      const Fit<5> fit = fitEllipse(nearlyRound(e, rng), sigma);
      if (!fit.ok()) {
        EXPECT_TRUE(std::isnan(fit.covariance(0, 0)));
        continue;
      }
      ++ok;
      Eigen::Matrix<double, 5, 1> error = fit.parameter - truth;
      error[4] = std::remainder(error[4], std::numbers::pi);
      outside += error.dot(fit.covariance.inverse() * error) > 11.07 ? 1 : 0;
    }
    // 5 % and four standard errors.
    EXPECT_LE(outside, 0.05 * trials + 4 * std::sqrt(0.05 * 0.95 * trials)) << difference;
    if (difference == 0) {
      EXPECT_LE(ok, 12);
    }
    if (difference == 6) {
      EXPECT_GE(ok, 0.98 * trials);
    }
  }
}

TEST(FitSummary, saysTheSameAsTheFit) {
  CounterRng rng(5, 0);
  Eigen::MatrixXd rows(25, 2);
  std::vector<Vector2d> points;
  for (int i = 0; i < 25; ++i) {
    points.push_back(noisy(Vector2d(3 * std::cos(0.2 * i), 1.5 * std::sin(0.2 * i)), rng));
    rows.row(i) = points.back().transpose();
  }
  const FitSummary summary = summarizedFit(FitModel::ellipse, rows, sigma);
  const Fit<5> fit = fitEllipse(points, sigma);
  EXPECT_TRUE(summary.verdict().isYes()) << summary.verdict().text;
  EXPECT_EQ((summary.parameter - fit.parameter).norm(), 0);
  EXPECT_EQ((summary.covariance - fit.covariance).norm(), 0);
  ASSERT_EQ(summary.names.size(), 5U);
  ASSERT_EQ(summary.distances.size(), 25U);
  double squares = 0;
  for (std::size_t i = 0; i < 25; ++i) {
    squares += summary.distances[i] * summary.distances[i];
    // The signed distance of the curve is the length of the correction, to first order.
    EXPECT_NEAR(std::abs(summary.distanceOf(points[i]).value), summary.distances[i], 0.03 * sigma);
  }
  EXPECT_NEAR(squares / (sigma * sigma), summary.chi2, 1e-6 * summary.chi2);

  EXPECT_TRUE(summarizedFit(FitModel::ellipse, rows).verdict().isNone()) << "nothing tests the sigma of the residuals";
  EXPECT_TRUE(summarizedFit(FitModel::ellipse, rows, 0.1 * sigma).verdict().isNo());
  EXPECT_EQ(summarizedFit(FitModel::sphere, rows, sigma).end, ConstrainedEnd::bad_input);
  EXPECT_EQ(summarizedFit(FitModel::line, rows, -1.0).end, ConstrainedEnd::bad_input);
  EXPECT_EQ(summarizedFit(FitModel::ellipse, rows.topRows(4), sigma).end, ConstrainedEnd::too_few);
  const FitSummary five = summarizedFit(FitModel::conic, rows.topRows(5), sigma);
  EXPECT_FALSE(five.verdict().isYes()) << "five points test no conic";
}

// The deviation of the curve's distance covers the true curve.
TEST(FitSummary, theBandHoldsTheTrueCurve) {
  constexpr int trials = 300;
  for (const FitModel model : {FitModel::circle, FitModel::ellipse, FitModel::conic}) {
    int ok = 0, inside = 0;
    for (std::uint64_t t = 0; t < trials; ++t) {
      CounterRng rng(9, t);
      Eigen::MatrixXd rows(30, 2);
      const double minor = model == FitModel::circle ? 3 : 1.5;
      for (int i = 0; i < 30; ++i) {
        rows.row(i) = noisy(Vector2d(3 * std::cos(0.15 * i), minor * std::sin(0.15 * i)), rng).transpose();
      }
      const FitSummary fit = summarizedFit(model, rows, sigma);
      if (!fit.ok()) continue;
      ++ok;
      const CurveDistance d = fit.distanceOf({3 * std::cos(2.0), minor * std::sin(2.0)});
      inside += std::abs(d.value) < 1.96 * d.deviation ? 1 : 0;
    }
    ASSERT_GT(ok, 280) << name(model);
    EXPECT_NEAR(inside, 0.95 * ok, 4 * std::sqrt(0.95 * 0.05 * ok)) << name(model);
  }
}

}  // namespace
