#include <stats/inference.hpp>
#include <stats/model_choice_f_test.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

namespace {

using namespace liestat;

const double nan = std::numeric_limits<double>::quiet_NaN();
const double inf = std::numeric_limits<double>::infinity();

static_assert(std::is_trivially_copyable_v<ReferenceLaw>);

TEST(ChiSquared, agreesWithItsClosedForms) {
  // k = 2: exponential. k = 4: 1 - (1 + x/2) exp(-x/2). k = 1: erf. Relative, 8 ulp.
  for (double x : {1e-12, 1e-3, 0.5, 1., 3., 10., 60., 600.}) {
    EXPECT_NEAR(chiSquaredSurvival(x, 2) / std::exp(-x / 2), 1, 2e-15) << x;
    EXPECT_NEAR(chiSquaredCdf(x, 2) / -std::expm1(-x / 2), 1, 2e-15) << x;
    EXPECT_NEAR(chiSquaredSurvival(x, 4) / ((1 + x / 2) * std::exp(-x / 2)), 1, 4e-15) << x;
    EXPECT_NEAR(chiSquaredCdf(x, 1) / std::erf(std::sqrt(x / 2)), 1, 2e-15) << x;
    EXPECT_NEAR(chiSquaredPdf(x, 2) / (0.5 * std::exp(-x / 2)), 1, 4e-15) << x;
  }
}

TEST(FTest, rejectsBeyondTheQuantile) {
  // Two parameters more, r' = 8: P(F > f) = (1 + 2 f/8)^(-8/2).
  const double probability = 0.99, f = 8 / 2 * (std::pow(1 - probability, -2.0 / 8) - 1);
  const FTestPhi phi{probability};
  EXPECT_NEAR(phi(10, 8), 10.0 / 8 / (1 + f * 2 / 8), 1e-14);
  // ((χ² - χ'²)/2)/(χ'²/8) on either side of f.
  for (const double factor : {0.999, 1.001}) {
    const ModelFit general{8, 12, 4}, specific{8 + 2 * f * factor, 12, 2};
    EXPECT_EQ(fitRejects(specific, general, phi), factor > 1);
  }
  EXPECT_TRUE(std::isnan(phi(8, 10)));
}

TEST(ChiSquared, quantileAndThresholdInvert) {
  for (double k : {1., 3., 6., 15.}) {
    for (double p : {1e-9, 0.05, 0.5, 0.95, 0.999999}) {
      EXPECT_NEAR(chiSquaredCdf(chiSquaredQuantile(p, k), k) / p, 1, 1e-12) << k << " " << p;
      EXPECT_NEAR(chiSquaredSurvival(chiSquaredThreshold(p, k), k) / p, 1, 1e-12) << k << " " << p;
    }
    EXPECT_NEAR(chiSquaredSurvival(chiSquaredThreshold(1e-40, k), k) / 1e-40, 1, 1e-11) << k;
  }
  EXPECT_NEAR(chiSquaredQuantile(0.95, 3), 7.814727903251178, 1e-13);
  EXPECT_NEAR(twoSidedNormalQuantile(0.05), 1.959963984540054, 1e-14);
}

TEST(ChiSquared, endsAndBadArguments) {
  EXPECT_EQ(chiSquaredCdf(0, 3), 0);
  EXPECT_EQ(chiSquaredCdf(inf, 3), 1);
  EXPECT_EQ(chiSquaredSurvival(0, 3), 1);
  EXPECT_EQ(chiSquaredSurvival(inf, 3), 0);
  EXPECT_EQ(chiSquaredPdf(0, 3), 0);
  EXPECT_EQ(chiSquaredPdf(0, 2), 0.5);
  EXPECT_EQ(chiSquaredPdf(0, 1), inf);
  EXPECT_EQ(chiSquaredPdf(inf, 3), 0);
  EXPECT_EQ(chiSquaredQuantile(0, 3), 0);
  EXPECT_EQ(chiSquaredQuantile(1, 3), inf);
  EXPECT_EQ(chiSquaredThreshold(0, 3), inf);
  EXPECT_EQ(chiSquaredThreshold(1, 3), 0);
  for (double x : {-1., nan, -inf}) {
    EXPECT_TRUE(std::isnan(chiSquaredCdf(x, 3)));
    EXPECT_TRUE(std::isnan(chiSquaredSurvival(x, 3)));
    EXPECT_TRUE(std::isnan(chiSquaredPdf(x, 3)));
    EXPECT_TRUE(std::isnan(chiSquaredQuantile(x, 3)));
    EXPECT_TRUE(std::isnan(chiSquaredThreshold(x, 3)));
  }
  EXPECT_TRUE(std::isnan(chiSquaredQuantile(1.5, 3)));
  for (double k : {0., -3., nan}) {
    EXPECT_TRUE(std::isnan(chiSquaredCdf(1, k)));
    EXPECT_TRUE(std::isnan(chiSquaredSurvival(1, k)));
    EXPECT_TRUE(std::isnan(chiSquaredPdf(1, k)));
    EXPECT_TRUE(std::isnan(chiSquaredQuantile(0.5, k)));
    EXPECT_TRUE(std::isnan(chiSquaredThreshold(0.5, k)));
  }
}

TEST(Binomial, survivalIsTheSumOfItsTerms) {
  for (const double p : {0.002, 0.3, 0.97}) {
    for (const std::size_t n : {1u, 7u, 40u}) {
      double term = std::pow(1 - p, n), below = 0;
      for (std::size_t count = 0; count <= n; ++count) {
        EXPECT_NEAR(binomialSurvival(count, n, p), 1 - below, 1e-13) << count << " of " << n << " at " << p;
        below += term;
        term *= p / (1 - p) * static_cast<double>(n - count) / static_cast<double>(count + 1);
      }
    }
  }
  // Where it is tiny: p^n.
  EXPECT_NEAR(binomialSurvival(30, 30, 0.01) / 1e-60, 1, 1e-12);
}

TEST(Binomial, endsAndBadArguments) {
  EXPECT_EQ(binomialSurvival(0, 10, 0), 1);
  EXPECT_EQ(binomialSurvival(1, 10, 0), 0);
  EXPECT_EQ(binomialSurvival(10, 10, 1), 1);
  EXPECT_EQ(binomialSurvival(11, 10, 1), 0);
  EXPECT_EQ(binomialSurvival(0, 0, 0.5), 1);
  for (const double p : {-0.1, 1.1, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_TRUE(std::isnan(binomialSurvival(1, 10, p)));
  }
}

TEST(Hotelling, ofOneDimensionIsStudentSquared) {
  // n = 2: Cauchy, P(t² ≤ x) = 2/pi atan(sqrt x); n = 3: P(t² ≤ x) = sqrt(x / (2 + x)).
  const double pi = 3.14159265358979323846;
  for (double x : {1e-6, 0.1, 1., 7., 1e4}) {
    EXPECT_NEAR(Hotelling({1, 2}).cdf(x), 2 / pi * std::atan(std::sqrt(x)), 1e-14) << x;
    EXPECT_NEAR(Hotelling({1, 3}).cdf(x), std::sqrt(x / (2 + x)), 1e-14) << x;
  }
}

TEST(Hotelling, pdfIsTheDerivativeAndQuantileTheInverseOfCdf) {
  for (const Hotelling law : {Hotelling{3, 4}, Hotelling{3, 10}, Hotelling{6, 30}, Hotelling{1, 100}}) {
    for (double x : {0.3, 2., 6., 20.}) {
      const double h = 1e-4 * x;
      EXPECT_NEAR((law.cdf(x + h) - law.cdf(x - h)) / (2 * h), law.pdf(x), 1e-6 * law.pdf(x)) << law.k << " " << x;
      EXPECT_NEAR(law.cdf(x) + law.survival(x), 1, 1e-14);
      EXPECT_NEAR(law.quantile(law.cdf(x)) / x, 1, 1e-11);
      EXPECT_NEAR(law.threshold(law.survival(x)) / x, 1, 1e-11);
    }
  }
}

TEST(Hotelling, momentsAreTheIntegralsOfTheSurvival) {
  // E X = ∫ S, E X² = ∫ 2x S, by the trapezoidal rule in log x; the tail beyond e^16 weighs less than 1e-8 here.
  for (const Hotelling law : {Hotelling{3, 10}, Hotelling{3, 30}, Hotelling{6, 20}}) {
    double m1 = 0, m2 = 0;
    const double h = 0.01;
    for (double u = -30; u < 16; u += h) {
      const double x = std::exp(u);
      m1 += h * x * law.survival(x);
      m2 += h * 2 * x * x * law.survival(x);
    }
    EXPECT_NEAR(m1 / law.mean(), 1, 1e-6);
    EXPECT_NEAR((m2 - m1 * m1) / law.variance(), 1, 1e-4);
  }
}

TEST(Hotelling, meanRatiosOfTheNotes) {
  EXPECT_NEAR(Hotelling({3, 30}).mean() / 3, 1.160, 5e-4);
  EXPECT_NEAR(Hotelling({6, 50}).mean() / 6, 1.167, 5e-4);
  EXPECT_NEAR(Hotelling({6, 60}).mean() / 6, 1.135, 5e-4);
}

TEST(Hotelling, distanceToChiSquaredOfTheNotes) {
  // docs/theory/means.md, section 5.1: the Kolmogorov-Smirnov distance between both laws, three digits.
  const struct {
    int k, n;
    double distance, half_digit;
  } table[] = {{3, 10, 0.177, 5e-4},   {3, 20, 0.0816, 5e-5}, {3, 30, 0.0530, 5e-5}, {3, 50, 0.0312, 5e-5},
               {3, 100, 0.0154, 5e-5}, {6, 20, 0.235, 5e-4},  {6, 30, 0.151, 5e-4},  {6, 50, 0.0880, 5e-5},
               {6, 60, 0.0728, 5e-5},  {6, 100, 0.0430, 5e-5}};
  for (const auto& row : table) {
    const Hotelling law{row.k, row.n};
    double distance = 0;
    for (double x = 0.01; x < 40; x += 0.01) distance = std::max(distance, chiSquaredCdf(x, row.k) - law.cdf(x));
    EXPECT_NEAR(distance, row.distance, 1.01 * row.half_digit) << row.k << " " << row.n;
  }
}

TEST(Hotelling, tendsToChiSquared) {
  const Hotelling law{3, 100000000};
  for (double x : {0.1, 1., 5., 20.}) EXPECT_NEAR(law.cdf(x), chiSquaredCdf(x, 3), 1e-7);
}

TEST(Hotelling, endsAndBadArguments) {
  const Hotelling good{3, 10};
  EXPECT_EQ(good.cdf(0), 0);
  EXPECT_EQ(good.cdf(inf), 1);
  EXPECT_EQ(good.survival(inf), 0);
  EXPECT_EQ(good.pdf(0), 0);
  EXPECT_EQ(good.quantile(0), 0);
  EXPECT_EQ(good.quantile(1), inf);
  EXPECT_EQ(Hotelling({3, 5}).mean(), inf);
  EXPECT_EQ(Hotelling({3, 4}).mean(), inf);
  EXPECT_TRUE(std::isfinite(Hotelling({3, 6}).mean()));
  EXPECT_EQ(Hotelling({3, 7}).variance(), inf);
  EXPECT_TRUE(std::isfinite(Hotelling({3, 8}).variance()));
  EXPECT_TRUE(std::isnan(good.cdf(-1)));
  EXPECT_TRUE(std::isnan(good.cdf(nan)));
  EXPECT_TRUE(std::isnan(good.quantile(nan)));
  const int lowest = std::numeric_limits<int>::min();
  for (const Hotelling bad :
       {Hotelling{3, 3}, Hotelling{3, 0}, Hotelling{0, 5}, Hotelling{-1, 5}, Hotelling{3, lowest}}) {
    EXPECT_TRUE(std::isnan(bad.cdf(1)));
    EXPECT_TRUE(std::isnan(bad.survival(1)));
    EXPECT_TRUE(std::isnan(bad.pdf(1)));
    EXPECT_TRUE(std::isnan(bad.quantile(0.5)));
    EXPECT_TRUE(std::isnan(bad.threshold(0.5)));
    EXPECT_TRUE(std::isnan(bad.mean()));
    EXPECT_TRUE(std::isnan(bad.variance()));
  }
}

TEST(ReferenceLaw, isOneOfTheTwo) {
  const ReferenceLaw chi = ReferenceLaw::chiSquared(3), t2 = ReferenceLaw::hotelling(3, 30);
  EXPECT_STREQ(chi.name(), "chi2");
  EXPECT_STREQ(t2.name(), "hotelling");
  EXPECT_EQ(chi.dof(), 3);
  EXPECT_EQ(t2.dof(), 3);
  EXPECT_EQ(t2.samples(), 30);
  EXPECT_EQ(chi.mean(), 3);
  EXPECT_EQ(chi.variance(), 6);
  EXPECT_EQ(t2.mean(), Hotelling({3, 30}).mean());
  EXPECT_EQ(t2.variance(), Hotelling({3, 30}).variance());
  for (double x : {0.5, 3., 10.}) {
    EXPECT_EQ(chi.cdf(x), chiSquaredCdf(x, 3));
    EXPECT_EQ(chi.survival(x), chiSquaredSurvival(x, 3));
    EXPECT_EQ(chi.pdf(x), chiSquaredPdf(x, 3));
    EXPECT_EQ(t2.cdf(x), Hotelling({3, 30}).cdf(x));
    EXPECT_EQ(t2.survival(x), Hotelling({3, 30}).survival(x));
    EXPECT_EQ(t2.pdf(x), Hotelling({3, 30}).pdf(x));
  }
  EXPECT_EQ(chi.quantile(0.9), chiSquaredQuantile(0.9, 3));
  EXPECT_EQ(t2.quantile(0.9), Hotelling({3, 30}).quantile(0.9));
  EXPECT_EQ(t2.threshold(0.1), Hotelling({3, 30}).threshold(0.1));
  EXPECT_TRUE(std::isnan(ReferenceLaw::chiSquared(0).mean()));
  EXPECT_TRUE(std::isnan(ReferenceLaw::chiSquared(0).cdf(1)));
}

TEST(ReferenceLaw, equivalentChiSquaredHasTheSameRank) {
  const ReferenceLaw chi = ReferenceLaw::chiSquared(3), t2 = ReferenceLaw::hotelling(3, 6);
  EXPECT_EQ(chi.equivalentChiSquared(2.5), 2.5);
  for (double x : {0., 1e-6, 0.5, 5., 100., 1e5}) {
    const double y = t2.equivalentChiSquared(x);
    EXPECT_NEAR(chi.cdf(y), t2.cdf(x), 1e-14) << x;
    EXPECT_NEAR(chi.survival(y), t2.survival(x), 1e-11 * t2.survival(x)) << x;
  }
  EXPECT_TRUE(std::isnan(t2.equivalentChiSquared(-1)));
  EXPECT_TRUE(std::isnan(t2.equivalentChiSquared(nan)));
  EXPECT_TRUE(std::isnan(chi.equivalentChiSquared(nan)));
}

TEST(ConfidenceEllipsoid, rebuildsTheCovariance) {
  Eigen::Matrix3d a;
  a << 2, 0.3, -0.1, 0.4, 1, 0.2, 0, 0.5, 3;
  const Eigen::Matrix3d covariance = a * a.transpose();
  const auto e = confidenceEllipsoid(covariance, 0.9);
  ASSERT_TRUE(e.valid);
  EXPECT_EQ(e.threshold, chiSquaredQuantile(0.9, 3));
  EXPECT_GE(e.semi_axes[0], e.semi_axes[1]);
  EXPECT_GE(e.semi_axes[1], e.semi_axes[2]);
  const Eigen::Matrix3d scaled = e.directions * e.semi_axes.asDiagonal();
  EXPECT_LT((scaled * scaled.transpose() - e.threshold * covariance).norm(), 1e-13 * covariance.norm() * e.threshold);
  EXPECT_LT((e.directions.transpose() * e.directions - Eigen::Matrix3d::Identity()).norm(), 1e-14);
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d end = e.semi_axes[i] * e.directions.col(i);
    EXPECT_NEAR(end.dot(covariance.inverse() * end), e.threshold, 1e-12);
    EXPECT_EQ(e.directions.col(i).maxCoeff(), e.directions.col(i).cwiseAbs().maxCoeff());
  }
}

TEST(ConfidenceEllipsoid, ofResidualsIsLarger) {
  const Eigen::Matrix3d covariance = Eigen::Vector3d(1, 4, 9).asDiagonal();
  const auto known = confidenceEllipsoid(covariance, 0.95);
  const auto residual = confidenceEllipsoid(covariance, 0.95, ReferenceLaw::hotelling(3, 10));
  EXPECT_NEAR(known.semi_axes[0], 3 * std::sqrt(chiSquaredQuantile(0.95, 3)), 1e-14);
  EXPECT_NEAR(residual.semi_axes[0], 3 * std::sqrt(Hotelling({3, 10}).quantile(0.95)), 1e-14);
}

TEST(ConfidenceEllipsoid, takesDynamicFloatAndSingularCovariances) {
  const Eigen::MatrixXd dynamic = Eigen::Vector4d(1, 2, 3, 4).asDiagonal();
  EXPECT_NEAR(ellipsoid(dynamic, 1).semi_axes[0], 2, 1e-15);
  EXPECT_NEAR(ellipsoid(Eigen::Matrix3f(Eigen::Matrix3f::Identity()), 4).semi_axes[1], 2, 1e-6);
  const Eigen::Vector3d v(1, 2, 3);
  const auto flat = ellipsoid(Eigen::Matrix3d(v * v.transpose()), 1);
  ASSERT_TRUE(flat.valid);
  EXPECT_NEAR(flat.semi_axes[0], v.norm(), 1e-14);
  EXPECT_NEAR(flat.semi_axes[2], 0, 1e-7);
  EXPECT_TRUE(ellipsoid(Eigen::Matrix3d(Eigen::Matrix3d::Zero()), 1).valid);
}

TEST(ConfidenceEllipsoid, badInputIsMarked) {
  const Eigen::Matrix3d good = Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d indefinite = Eigen::Vector3d(1, 2, -0.1).asDiagonal();
  Eigen::Matrix3d bad = good;
  bad(1, 0) = nan;
  for (const auto& e : {confidenceEllipsoid(indefinite, 0.9), confidenceEllipsoid(bad, 0.9),
                        confidenceEllipsoid(good, nan), confidenceEllipsoid(good, 1.0), confidenceEllipsoid(good, 1.5),
                        confidenceEllipsoid(good, -0.1), confidenceEllipsoid(good, 0.9, ReferenceLaw::hotelling(3, 3)),
                        confidenceEllipsoid(good, 0.9, ReferenceLaw::chiSquared(2)), ellipsoid(good, -1)}) {
    EXPECT_FALSE(e.valid);
    EXPECT_TRUE(e.semi_axes.array().isNaN().all());
    EXPECT_TRUE(e.directions.array().isNaN().all());
    EXPECT_TRUE(std::isnan(e.threshold));
  }
}

}  // namespace
