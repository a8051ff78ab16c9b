// Means of products: the criterion is a sum over the parts, so the means are those of the parts.

#include <stats/covariance.hpp>
#include <stats/group_mean.hpp>
#include <stats/mean.hpp>

#include <lie/lie.hpp>

#include <support/product_samples.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>
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

// Sums by the kernels of the factors against the product's own operations, for every set of instructions.
template <class M>
void compareSums(double spread) {
  const auto samples = scattered<M>(203, spread);
  std::vector<double> weights;
  for (std::size_t i = 0; i < samples.size(); ++i) weights.push_back(0.5 + 0.01 * static_cast<double>(i));
  const detail::Samples<M> features(samples);
  const detail::Samples<double> numbers(weights);
  const M y = exp(samples[3], TangentOf<M>(TangentOf<M>::Constant(static_cast<ScalarOf<M>>(0.1 * spread))));
  const ChunkRange range{5, 203};
  const double eps = static_cast<double>(std::numeric_limits<ScalarOf<M>>::epsilon());
  detail::MeanPass<M> expected, weighted;
  detail::addTerms<false>(features, detail::UnitWeights{}, y, range, expected);
  detail::addTerms<false>(features, numbers, y, range, weighted);
  const auto isNear = [&](const detail::MeanPass<M>& a, const detail::MeanPass<M>& b) {
    // Residuals are differences of coordinates of size one, known to their rounding.
    const double rounding = 20 * eps * b.sums.weight;
    EXPECT_NEAR(a.sums.cost, b.sums.cost, rounding * spread);
    EXPECT_LE((a.sums.gradient - b.sums.gradient).norm(), rounding);
    // Without the scatter kernels take a Hessian for the next step, from shorter polynomials.
    EXPECT_LE((a.sums.hessian - b.sums.hessian).norm(), 3e-7 * b.sums.weight + rounding);
    EXPECT_NEAR(a.sums.weight, b.sums.weight, rounding);
  };
  for (const InstructionSet set : {InstructionSet::baseline, InstructionSet::avx2, InstructionSet::avx512}) {
    if (set > supportedInstructionSet()) continue;
    SCOPED_TRACE(name(set));
    detail::MeanPass<M> part, part_weighted;
    ASSERT_TRUE(
        detail::addTermsByPacks<detail::KernelPass::step>(set, features, detail::UnitWeights{}, y, range, part));
    ASSERT_TRUE(detail::addTermsByPacks<detail::KernelPass::step>(set, features, numbers, y, range, part_weighted));
    isNear(part, expected);
    isNear(part_weighted, weighted);
  }
}
TEST(Product, SumsByFactorsAreItsOwn) {
  for (double spread = 1e-6; spread < 1; spread *= 10) {
    SCOPED_TRACE(spread);
    compareSums<Product<SO3d, S2d, Vector2d>>(spread);
    compareSums<Product<Vector2d, SemiOrientedFrame3d>>(spread);
    compareSums<Product<SO3f, SO2f>>(spread);
  }
  // One that is not finite is seen by the factor's own operations.
  using M = Product<SO3d, Vector2d>;
  auto samples = scattered<M>(20, 0.3);
  samples[7].get<1>()[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(mean(samples).status, Status::not_converged);
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
