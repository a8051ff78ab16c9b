// The last pass of the mean of a product, its scatter with the blocks of two factors included, by the kernels of its
// factors against the product's own operations.
#include <lie/lie.hpp>
#include <stats/mean.hpp>

#include <support/instruction_sets.hpp>
#include <support/product_samples.hpp>
#include <support/thread_for_each_chunk.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <deque>
#include <limits>
#include <vector>

namespace {

using namespace liestat;
using Eigen::Vector2d;
using Eigen::Vector3d;
using liestat_test::scattered;
using test::instructionSets;
using test::ThreadForEachChunk;

using Vector9d = Eigen::Matrix<double, 9, 1>;

template <class M>
class ProductKernel : public testing::Test {
 protected:
  using S = ScalarOf<M>;
  static constexpr double eps = static_cast<double>(std::numeric_limits<S>::epsilon());

  std::vector<double> weights(std::size_t n) {
    std::vector<double> p;
    for (std::size_t i = 0; i < n; ++i) p.push_back(0.5 + 0.25 * static_cast<double>(i % 7));
    return p;
  }
  static M reference(const std::vector<M>& features, double spread) {
    return exp(features[0], TangentOf<M>(TangentOf<M>::Constant(static_cast<S>(0.1 * spread))));
  }
  template <class R, class W>
  void compare(const R& features, const W& p, const M& y, const ChunkRange& range) {
    detail::MeanPass<M> general;
    detail::addTerms<true>(features, p, y, range, general);
    const double weight = general.sums.weight, length = static_cast<double>(general.scatter.largest);
    // Residuals have the rounding of coordinates of size one.
    const double near = 40 * eps * weight, near_square = near * (length + eps) * (1 + length);
    for (const InstructionSet set : instructionSets()) {
      SCOPED_TRACE(name(set));
      detail::MeanPass<M> packs;
      ASSERT_TRUE(detail::addTermsByPacks<detail::KernelPass::last>(set, features, p, y, range, packs));
      EXPECT_NEAR(packs.sums.weight, weight, 8 * std::numeric_limits<double>::epsilon() * weight);
      EXPECT_NEAR(packs.sums.cost, general.sums.cost, near_square);
      EXPECT_LE((packs.sums.gradient - general.sums.gradient).norm(), near * (1 + length));
      EXPECT_LE((packs.sums.hessian - general.sums.hessian).norm(), near);
      EXPECT_LE((packs.scatter.scatter - general.scatter.scatter).norm(), near_square);
      EXPECT_LE((packs.scatter.squared - general.scatter.squared).norm(), 3 * near_square);
      EXPECT_NEAR(packs.scatter.largest, length, 40 * eps * (1 + length));
      EXPECT_EQ(packs.scatter.scatter, packs.scatter.scatter.transpose());
      if constexpr (Quotient<M>) {
        EXPECT_NEAR(packs.scatter.smallest_gap, general.scatter.smallest_gap, 40 * eps);
      }
    }
  }
};

// Factors with kernels, in double and float; a factor without one; a product among the factors; few coordinates.
using Products = testing::Types<Product<NonOrientedFrame3d, S2d>, Product<SO3f, Frame2f>, Product<Vector9d, SO2d>,
                                Product<Product<S2d, Vector2d>, SO3d>>;
TYPED_TEST_SUITE(ProductKernel, Products);

TYPED_TEST(ProductKernel, agrees_for_every_number_of_features) {
  const double spread = 0.3;
  const auto features = scattered<TypeParam>(1100, spread);
  const auto p = this->weights(features.size());
  const TypeParam y = this->reference(features, spread);
  std::vector<std::size_t> counts;
  for (std::size_t n = 1; n <= 100; ++n) counts.push_back(n);
  for (const std::size_t n : {255, 256, 257, 511, 513, 1024, 1090}) counts.push_back(n);
  for (const std::size_t n : counts) {
    SCOPED_TRACE(n);
    const ChunkRange range{n % 5, n % 5 + n};
    this->compare(features, detail::UnitWeights{}, y, range);
    this->compare(features, p, y, range);
    if (this->HasFailure()) return;
  }
}

TYPED_TEST(ProductKernel, agrees_for_every_spread) {
  for (double spread = 1e-12; spread < 2; spread *= 10) {
    SCOPED_TRACE(spread);
    const auto features = scattered<TypeParam>(300, spread);
    const TypeParam y = this->reference(features, spread);
    this->compare(features, detail::UnitWeights{}, y, {0, features.size()});
    this->compare(features, this->weights(features.size()), y, {0, features.size()});
  }
}

template <class M>
void sameBitsEverywhere() {
  const auto features = scattered<M>(2500, 0.3);
  std::vector<double> p;
  for (std::size_t i = 0; i < features.size(); ++i) p.push_back(0.5 + 0.25 * static_cast<double>(i % 7));
  const std::deque<M> elsewhere(features.begin(), features.end());
  const auto same = [](const auto& a, const auto& b) {
    EXPECT_EQ(a.scatter, b.scatter);
    EXPECT_EQ(a.squared_weight_scatter, b.squared_weight_scatter);
    EXPECT_EQ(a.hessian, b.hessian);
    EXPECT_EQ(a.cost, b.cost);
    EXPECT_EQ(a.largest_distance, b.largest_distance);
    EXPECT_EQ(a.iterations, b.iterations);
  };
  const auto plain = mean(features), weighted = mean(features, p);
  same(mean(elsewhere), plain);
  same(mean(ThreadForEachChunk{}, features), plain);
  same(mean(ThreadForEachChunk{}, features, p), weighted);
}
TEST(ProductKernelBits, are_those_of_copies_from_scattered_memory_and_of_any_threads) {
  sameBitsEverywhere<Product<SO3d, Vector3d>>();
  sameBitsEverywhere<Product<S2f, SO2f>>();
}

// The factor's own operations take over, for the block in which the feature lies.
TEST(ProductKernelRefusal, takes_quaternions_far_from_unit) {
  using M = Product<Vector3d, SO3d>;
  auto features = scattered<M>(700, 0.3);
  for (int c = 0; c < 4; ++c) features[300].get<1>().data()[c] *= 1.001;
  const M y = features[1];
  detail::MeanPass<M> general, packs;
  const ChunkRange all{0, features.size()};
  detail::addTerms<true>(features, detail::UnitWeights{}, y, all, general);
  ASSERT_TRUE(detail::addTermsByPacks<detail::KernelPass::last>(supportedInstructionSet(), features,
                                                                detail::UnitWeights{}, y, all, packs));
  EXPECT_NEAR(packs.sums.cost, general.sums.cost, 1e-12 * general.sums.cost);
  EXPECT_LE((packs.scatter.scatter - general.scatter.scatter).norm(), 1e-12 * general.scatter.scatter.norm());
  EXPECT_LE((packs.sums.hessian - general.sums.hessian).norm(), 1e-12 * general.sums.hessian.norm());
}

TEST(ProductKernelRefusal, not_a_number_in_not_a_number_out) {
  using M = Product<Vector3d, SO3d>;
  for (const std::size_t bad : {0, 299, 599}) {
    auto features = scattered<M>(600, 0.3);
    features[bad].get<1>().data()[2] = std::numeric_limits<double>::quiet_NaN();
    const M y = features[1];
    EXPECT_EQ(mean(features, {.start = y}).status, Status::not_converged);
    EXPECT_FALSE(std::isfinite(mean(features, {.start = y}).cost));
  }
}

// A type whose factors are made anew each time, which have no place in memory.
struct Turned {
  SO3d rotation;
  Vector3d point = Vector3d::Zero();
};

}  // namespace

template <>
struct liestat::ManifoldTraits<Turned> : ManifoldTraits<Product<SO3d, Vector3d>> {
  using Base = ManifoldTraits<Product<SO3d, Vector3d>>;
  using P = Product<SO3d, Vector3d>;
  static constexpr CompactFactor compact_factor = CompactFactor::rotation;
  static constexpr int compact_begin = 0;
  static Eigen::Vector4d compactCoordinates(const Turned& x) { return x.rotation.params(); }
  static P whole(const Turned& x) { return P(x.rotation, x.point); }
  static Turned of(const P& x) { return {x.get<0>(), x.get<1>()}; }
  static std::tuple<SO3d, Vector3d> factors(const Turned& x) { return {x.rotation, x.point}; }
  static Turned fromFactors(const std::tuple<SO3d, Vector3d>& parts) {
    return {std::get<0>(parts), std::get<1>(parts)};
  }
  static Turned origin() { return {}; }
  static Turned act(const Group& f, const Turned& x) { return of(Base::act(f, whole(x))); }
  static Group placement(const Turned& x) { return Base::placement(whole(x)); }
  static Turned expOrigin(const Tangent& v) { return of(Base::expOrigin(v)); }
  static Tangent logOrigin(const Turned& x) { return Base::logOrigin(whole(x)); }
  static Square dlogOrigin(const Turned& x) { return Base::dlogOrigin(whole(x)); }
  static Square isotropy(const Group& f, const Turned& x) { return Base::isotropy(f, whole(x)); }
  static auto placementJacobian(const Turned& x) { return Base::placementJacobian(whole(x)); }
  static bool isPlacementSmooth(const Turned& x) { return Base::isPlacementSmooth(whole(x)); }
};

namespace {

// The position of an oriented point and the rotation of an essential matrix turn with the direction: their frames are not
// those of their factors.
template <class M>
void takesStepsInItsOwnFrame() {
  static_assert(Factored<M> && !detail::hasFactorSums<M>());
  const auto features = scattered<M>(100, 0.2);
  const auto expected = mean(features);
  const auto found = mean(features, {.start = exp(expected.mean, TangentOf<M>(0.3 * TangentOf<M>::Ones()))});
  EXPECT_EQ(found.status, Status::ok);
  EXPECT_LE(found.iterations, 6);
  EXPECT_LE(distance(found.mean, expected.mean), 1e-12);
}
TEST(ProductKernelRefusal, features_that_turn_with_a_factor_take_steps_in_their_own_frame) {
  takesStepsInItsOwnFrame<OrientedPointd>();
  takesStepsInItsOwnFrame<Essentiald>();
}

TEST(ProductKernelOfATypeOfTheUser, has_the_bits_of_the_product) {
  static_assert(Metric<Turned> && Factored<Turned>);
  static_assert(!detail::RefersToFactors<Turned> && detail::RefersToFactors<Product<SO3d, Vector3d>>);
  const auto features = scattered<Product<SO3d, Vector3d>>(600, 0.3);
  std::vector<Turned> turned;
  for (const auto& x : features) turned.push_back(ManifoldTraits<Turned>::of(x));
  const auto expected = mean(features);
  const auto found = mean(turned);
  EXPECT_EQ(found.status, Status::ok);
  EXPECT_EQ(found.scatter, expected.scatter);
  EXPECT_EQ(found.cost, expected.cost);
  const auto rotations = mean(liestat_test::parts<0>(features));
  EXPECT_NEAR(found.largest_angle, rotations.largest_angle, 1e-12);
  EXPECT_NEAR(found.angle_fourth_moment, rotations.angle_fourth_moment, 1e-12 * rotations.angle_fourth_moment);
}

}  // namespace
