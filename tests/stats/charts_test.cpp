#include <lie/frame3.hpp>
#include <lie/rn.hpp>
#include <lie/so3.hpp>
#include <stats/charts.hpp>
#include <stats/dispersion.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace {

using namespace liestat;

TEST(Charts, OfPointsDifferByATranslation) {
  const std::vector<Eigen::Vector3d> points{{1, 0, 0}, {3, 0, 0}, {2, 1, 0}, {2, -1, 0}, {2, 0, 4}};
  const std::vector<double> weights(points.size(), 2.0);
  const Eigen::Vector3d y(2, 0, 0.8);
  const ChartScatter s = chartScatter(points, weights, y);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    EXPECT_TRUE(s.principal.col(column).isApprox(points[i]));
    EXPECT_TRUE(s.centred.col(column).isApprox(points[i] - y));
  }
  EXPECT_TRUE(s.mean.isApprox(y));
  EXPECT_TRUE(s.barycentre.isApprox(y));
  EXPECT_LT(s.barycentre_centred.norm(), 1e-15);
  // Σ d dᵀ/(n (n - 1)): variances of the coordinates over n.
  const Eigen::Vector3d variances = Eigen::Vector3d(2, 2, 12.8) / (5 * 4);
  EXPECT_TRUE(s.barycentre_covariance.isApprox(variances.asDiagonal().toDenseMatrix(), 1e-14));
  EXPECT_TRUE(s.barycentre_covariance_centred.isApprox(s.barycentre_covariance, 1e-14));
  EXPECT_EQ(s.dispersion.size(), 0);
  EXPECT_EQ(s.mean_covariance.size(), 0);
}

TEST(Charts, NoMoreFeaturesThanDimensionsHaveNoCovariance) {
  const std::vector<SO3d> rotations(3, SO3d::exp({0.1, 0, 0}));
  const ChartScatter s = chartScatter(rotations, std::vector<double>(3, 1.0), rotations[0]);
  EXPECT_EQ(s.barycentre_covariance.size(), 0);
  EXPECT_EQ(s.barycentre_covariance_centred.size(), 0);
}

template <class M>
M feature(int i) {
  TangentOf<M> v;
  for (int k = 0; k < v.size(); ++k) v[k] = 0.4 * std::sin(1 + i * (k + 2));
  return exp(ManifoldTraits<M>::expOrigin(TangentOf<M>::Constant(0.3)), v);
}

/// Covariances move with the derivative of the principal chart, here by central differences.
template <class M>
void expectDerivatives() {
  using T = ManifoldTraits<M>;
  const M y = feature<M>(3);
  std::vector<M> features;
  for (int i = 0; i < 12; ++i) features.push_back(feature<M>(i));
  const std::vector<double> weights(features.size(), 1.0);
  const SquareOf<M> dispersion = dispersionAbout(features, weights, y).covariance, covariance = dispersion / 12;
  const ChartScatter s = chartScatter(features, weights, y, dispersion, covariance);
  const double h = 1e-5;
  const auto derivative = [&](const auto& chart, const auto& along) {
    SquareOf<M> J;
    for (int k = 0; k < T::DoF; ++k) {
      const TangentOf<M> e = h * TangentOf<M>::Unit(k);
      J.col(k) = (chart(along(e)) - chart(along(TangentOf<M>(-e)))) / (2 * h);
    }
    return J;
  };
  // Central differences: h² of curvature and eps/h of rounding.
  const double bound = 1e-8;
  const SquareOf<M> J = derivative([](const M& x) { return TangentOf<M>(T::logOrigin(x)); },
                                   [&](const TangentOf<M>& e) { return exp(y, e); });
  EXPECT_LT((s.dispersion - J * dispersion * J.transpose()).norm(), bound);
  EXPECT_LT((s.mean_covariance - J * covariance * J.transpose()).norm(), bound);
  EXPECT_LT((s.mean - T::logOrigin(y)).norm(), 1e-14);

  const TangentOf<M> b = s.barycentre;
  EXPECT_LT((s.barycentre_centred - log(y, M(T::expOrigin(b)))).norm(), 1e-13);
  EXPECT_LT((s.barycentre - s.principal.rowwise().mean()).norm(), 1e-14);
  const SquareOf<M> C = derivative([&](const M& x) { return TangentOf<M>(log(y, x)); },
                                   [&](const TangentOf<M>& e) { return M(T::expOrigin(b + e)); });
  EXPECT_LT((s.barycentre_covariance_centred - C * s.barycentre_covariance * C.transpose()).norm(), bound);
}

TEST(Charts, CovariancesOfRotationsMoveWithTheDerivative) { expectDerivatives<SO3d>(); }
TEST(Charts, CovariancesOfFramesMoveWithTheDerivative) { expectDerivatives<Frame3d>(); }

TEST(Charts, FloatAgreesWithDouble) {
  std::vector<SO3d> features;
  std::vector<SO3f> single;
  for (int i = 0; i < 12; ++i) {
    features.push_back(feature<SO3d>(i));
    single.push_back(features.back().cast<float>());
  }
  const std::vector<double> weights(features.size(), 1.0);
  const ChartScatter s = chartScatter(features, weights, features[3]), f = chartScatter(single, weights, single[3]);
  EXPECT_LT((s.principal - f.principal).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT((s.centred - f.centred).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT((s.barycentre_covariance_centred - f.barycentre_covariance_centred).norm(), 1e-6);
}

}  // namespace
