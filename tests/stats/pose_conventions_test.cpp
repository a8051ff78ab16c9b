// Conventions of poses' covariances: Jacobians against differences of the exact coordinates, round trips, what commutes
// with a conversion, and mistakes that must show.

#include <stats/convention_charts.hpp>
#include <stats/convention_layouts.hpp>
#include <stats/convention_losses.hpp>
#include <stats/convention_presets.hpp>
#include <stats/conventions.hpp>
#include <stats/propagation.hpp>
#include <stats/random.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace liestat {
namespace {

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
