// Fusion of measurements of products: without correlation between the parts it is that of the parts.

#include <stats/maha.hpp>
#include <stats/random.hpp>

#include <lie/lie.hpp>

#include <support/product_samples.hpp>

#include <gtest/gtest.h>

#include <vector>

namespace {

using namespace liestat;
using Eigen::Vector2d;
using Eigen::Vector3d;
using liestat_test::scattered;

TEST(Product, FusionWithoutCorrelationIsThatOfTheParts) {
  using M = Product<S2d, SO3d>;
  using First = typename M::template Part<0>;
  using Second = typename M::template Part<1>;
  CounterRng rng(2, 0);
  std::vector<Gaussian<M>> all;
  std::vector<Gaussian<First>> first;
  std::vector<Gaussian<Second>> second;
  for (const M& x : scattered<M>(8, 0.05)) {
    const TangentOf<M> d = 0.01 * (TangentOf<M>(rng.normalVector<M::DoF>()).array().square() + 0.1).matrix();
    Gaussian<M> g{x, d.asDiagonal()};
    all.push_back(g);
    first.push_back({x.template get<0>(), M::template covarianceBlock<0, 0>(g.covariance)});
    second.push_back({x.template get<1>(), M::template covarianceBlock<1, 1>(g.covariance)});
  }
  const auto whole = maha(all, CovarianceAt::measured);
  ASSERT_EQ(whole.status, Status::ok);
  const auto fused_first = fuse(first, CovarianceAt::measured);
  const auto fused_second = fuse(second, CovarianceAt::measured);
  EXPECT_LE(distance(whole.mean.template get<0>(), fused_first.mean), 1e-10);
  EXPECT_LE(distance(whole.mean.template get<1>(), fused_second.mean), 1e-10);
  // Second order by differences where a part (directions) has none in closed form: 1e-6.
  EXPECT_LE((M::template covarianceBlock<0, 0>(whole.covariance) - fused_first.covariance).norm(), 1e-6);
  EXPECT_LE((M::template covarianceBlock<1, 1>(whole.covariance) - fused_second.covariance).norm(), 1e-6);
}

// Correlating two vectors is no different from correlating the coordinates of one.
TEST(Product, CorrelatedVectorsAreOneVector) {
  using M = Product<Vector2d, Vector3d>;
  using Vector5d = Eigen::Matrix<double, 5, 1>;
  CounterRng rng(3, 0);
  std::vector<Gaussian<M>> two;
  std::vector<Gaussian<Vector5d>> one;
  for (int i = 0; i < 6; ++i) {
    const Vector5d x = rng.normalVector<5>();
    Eigen::Matrix<double, 5, 5> A;
    for (int k = 0; k < 5; ++k) A.col(k) = rng.normalVector<5>();
    one.push_back({x, A * A.transpose() + 0.1 * Eigen::Matrix<double, 5, 5>::Identity()});
    two.push_back({M(x.head<2>(), x.tail<3>()), one.back().covariance});
  }
  const auto fused = fuse(one);
  const auto fused_product = fuse(two);
  EXPECT_LE((fused_product.mean.params() - fused.mean).norm(), 1e-12);
  EXPECT_LE((fused_product.covariance - fused.covariance).norm(), 1e-12);
}

}  // namespace
