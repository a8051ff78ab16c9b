// Means of products: the criterion is a sum over the parts, so the means are those of the parts.

#include <stats/covariance.hpp>
#include <stats/group_mean.hpp>
#include <stats/mean.hpp>

#include <lie/lie.hpp>

#include <support/product_samples.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace {

using namespace liestat;
using Eigen::Vector2d;
using Eigen::Vector3d;
using liestat_test::parts, liestat_test::scattered;

template <class M>
class ProductTest : public testing::Test {};
// Small ones, for each costs the compiler seconds.
using Products = testing::Types<Product<SO3d, Vector3d>, Product<SemiOrientedFrame3d, Vector2d>>;
TYPED_TEST_SUITE(ProductTest, Products);

TYPED_TEST(ProductTest, MeanIsThatOfTheParts) {
  using M = TypeParam;
  const auto samples = scattered<M>(20, 0.3);
  std::vector<double> weights;
  for (int i = 0; i < 20; ++i) weights.push_back(0.5 + 0.1 * i);
  const auto whole = mean(samples), weighted = mean(samples, weights);
  const auto first = mean(parts<0>(samples));
  const auto second = mean(parts<1>(samples)), second_weighted = mean(parts<1>(samples), weights);
  ASSERT_TRUE(converged(whole.status) && converged(weighted.status));
  EXPECT_LE(distance(whole.mean.template get<0>(), first.mean), 1e-11);
  EXPECT_LE(distance(whole.mean.template get<1>(), second.mean), 1e-11);
  EXPECT_LE(distance(weighted.mean.template get<1>(), second_weighted.mean), 1e-11);
  EXPECT_NEAR(whole.cost, first.cost + second.cost, 1e-12 * whole.cost);
  const SquareOf<M> covariance = covarianceFromResiduals(whole);
  EXPECT_LE((M::template covarianceBlock<0, 0>(covariance) - covarianceFromResiduals(first)).norm(), 1e-12);
  EXPECT_LE((M::template covarianceBlock<1, 1>(covariance) - covarianceFromResiduals(second)).norm(), 1e-12);
}

// The frame's order of blocks is (translation, rotation).
TEST(Product, RotationWithVectorIsTheFrame) {
  using M = Product<SO3d, Vector3d>;
  const auto samples = scattered<M>(30, 0.4);
  std::vector<Frame3d> frames;
  for (const auto& [rotation, translation] : samples) frames.push_back(Frame3d(rotation, translation));
  const auto product = mean(samples);
  const auto frame = mean(frames);
  ASSERT_TRUE(converged(product.status) && converged(frame.status));
  EXPECT_LE(distance(Frame3d(product.mean.get<0>(), product.mean.get<1>()), frame.mean), 1e-12);
  EXPECT_NEAR(product.cost, frame.cost, 1e-12);
  EXPECT_LE((M::covarianceBlock<0, 0>(product.hessian) - frame.hessian.bottomRightCorner<3, 3>()).norm(), 1e-11);
  EXPECT_LE((M::covarianceBlock<1, 1>(product.hessian) - frame.hessian.topLeftCorner<3, 3>()).norm(), 1e-11);
  // The frame's translations are seen from its own axes.
  const Eigen::Matrix3d R = frame.mean.rotationMatrix();
  EXPECT_LE((M::covarianceBlock<0, 1>(product.scatter) - frame.scatter.bottomLeftCorner<3, 3>() * R.transpose()).norm(),
            1e-11);
}

TEST(Product, GroupMeanIsThatOfTheParts) {
  using G = ProductGroup<SO3d, SE3d, Translation<double, 2>>;
  const auto samples = scattered<G>(15, 0.3);
  const auto whole = groupMean(samples);
  ASSERT_TRUE(converged(whole.status));
  EXPECT_LE(log(groupMean(parts<0>(samples)).mean, whole.mean.get<0>()).norm(), 1e-11);
  EXPECT_LE(log(groupMean(parts<1>(samples)).mean, whole.mean.get<1>()).norm(), 1e-11);
  EXPECT_LE(log(groupMean(parts<2>(samples)).mean, whole.mean.get<2>()).norm(), 1e-11);
  // Equivariant from both sides.
  const G f = G::exp(0.4 * G::Tangent::Ones());
  std::vector<G> moved;
  for (const G& x : samples) moved.push_back(f * x * f);
  EXPECT_LE(log(groupMean(moved).mean, f * whole.mean * f).norm(), 1e-11);
}

}  // namespace
