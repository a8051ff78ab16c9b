// stats/detail/rotation_sums.hpp against the manifolds' own operations: the same sums, for every decade of the angle.
#include <lie/lie.hpp>
#include <stats/mean.hpp>

#include <support/instruction_sets.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <type_traits>
#include <vector>

namespace {

using namespace liestat;
using test::instructionSets;

constexpr double eps = std::numeric_limits<double>::epsilon();

template <class M>
constexpr int num_parameters = static_cast<int>(sizeof(M) / sizeof(ScalarOf<M>)) - (sizeof(M) == 64 ? 1 : 0);
/// The first parameters, which have length one.
template <class M>
constexpr int unit_parameters = detail::HasRotationSums<M>    ? 4
                                : detail::HasDirectionSums<M> ? 3
                                : detail::HasPlanarSums<M>    ? 2
                                                              : 0;

template <class M>
class MeanKernel : public testing::Test {
 protected:
  static constexpr int DoF = ManifoldTraits<M>::DoF;
  using Tangent = TangentOf<M>;

  Tangent normal(double sigma = 1) {
    Tangent v;
    for (int i = 0; i < DoF; ++i) v[i] = sigma * gauss_(engine_);
    return v;
  }
  /// Features at the rotation angle from y, their translations as far.
  std::vector<M> ring(const M& y, double angle, std::size_t n) {
    std::vector<M> features;
    for (std::size_t i = 0; i < n; ++i) {
      constexpr int rotation = std::is_same_v<M, Frame2d> ? 1 : DoF == 6 ? 3 : DoF;
      Tangent v = normal();
      v.template tail<rotation>() *= angle / v.template tail<rotation>().norm();
      v.template head<DoF - rotation>() *= angle;
      features.push_back(exp(y, v));
      // q and -q are the same rotation.
      if constexpr (detail::HasRotationSums<M>) {
        if (i % 2) flip(features.back());
      }
    }
    return features;
  }
  static void flip(M& x) {
    for (int i = 0; i < 4; ++i) x.data()[i] = -x.data()[i];
  }
  std::vector<double> weights(std::size_t n) {
    std::vector<double> p;
    for (std::size_t i = 0; i < n; ++i) p.push_back(0.1 + std::abs(gauss_(engine_)));
    return p;
  }

  /// Both ways of the same range of features, which the packs must take, with each set of instructions.
  template <class W>
  void compare(const std::vector<M>& features, const W& p, const M& y, double tolerance) {
    detail::MeanPass<M> general;
    detail::addTerms<true>(features, p, y, {0, features.size()}, general);
    for (const InstructionSet set : instructionSets()) {
      SCOPED_TRACE(name(set));
      compare(set, features, p, y, tolerance, general);
    }
  }
  template <class W>
  void compare(InstructionSet set, const std::vector<M>& features, const W& p, const M& y, double tolerance,
               const detail::MeanPass<M>& general) {
    const ChunkRange all{0, features.size()};
    detail::MeanPass<M> packs, packs_alone;
    ASSERT_TRUE(detail::addTermsByPacks<detail::KernelPass::last>(set, features, p, y, all, packs));
    ASSERT_TRUE(detail::addTermsByPacks<detail::KernelPass::step>(set, features, p, y, all, packs_alone));
    // Vectors of length one and shorter, n of them: rounding grows with the sum of the weights, and tiny residuals
    // have the rounding of the quaternions that they come from. The scale of a square is the largest residual's.
    const double weight = general.sums.weight, length = general.scatter.largest, near = tolerance * weight;
    // Across a direction the Hessian is θ cot θ, which a rounding of the angle changes by θ/sin² θ of it.
    const double sine = detail::HasDirectionSums<M> && length > 1 ? std::sin(length) : 1, steep = 1 / (sine * sine);
    // And a rounding of x turns the direction of its log by its part of sin θ.
    const double turned = near / sine;
    EXPECT_NEAR(packs.sums.weight, weight, 8 * eps * weight);
    EXPECT_NEAR(packs.sums.cost, general.sums.cost, near * (length + eps) * (1 + length));
    EXPECT_LE((packs.sums.gradient - general.sums.gradient).norm(), turned * (1 + length));
    EXPECT_LE((packs.sums.hessian - general.sums.hessian).norm(), near * steep);
    EXPECT_LE((packs.scatter.scatter - general.scatter.scatter).norm(), turned * (length + eps) * (1 + length));
    EXPECT_LE((packs.scatter.squared - general.scatter.squared).norm(), 3 * turned * (length + eps) * (1 + length));
    EXPECT_NEAR(packs.scatter.largest, length, tolerance * (1 + length));
    if (std::isfinite(general.scatter.smallest_gap)) {
      EXPECT_NEAR(packs.scatter.smallest_gap, general.scatter.smallest_gap, 2 * tolerance);
    }
    // Fused multiplications may differ, so not the same bits.
    EXPECT_LE((packs_alone.sums.gradient - packs.sums.gradient).norm(), near * (1 + length));
    EXPECT_LE((packs_alone.sums.hessian - packs.sums.hessian).norm(), 3e-7 * weight + near * steep);
    EXPECT_NEAR(packs_alone.sums.cost, packs.sums.cost, near * (length + eps) * (1 + length));
  }

  std::mt19937_64 engine_{7};
  std::normal_distribution<double> gauss_;
};

using Manifolds =
    testing::Types<SO3d, Frame3d, SemiOrientedFrame3d, NonOrientedFrame3d, S2d, SO2d, Frame2d, Eigen::Vector3d>;
TYPED_TEST_SUITE(MeanKernel, Manifolds);

TYPED_TEST(MeanKernel, agrees_at_every_decade_of_the_angle) {
  using T = ManifoldTraits<TypeParam>;
  const TypeParam y = T::expOrigin(this->normal(0.7));
  std::vector<double> angles;
  for (double a = 1e-12; a < 2; a *= 10) angles.push_back(a), angles.push_back(3 * a);
  for (const double a : {0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.1}) angles.push_back(a);
  for (double d = 0.1; d > 1e-9; d /= 10) angles.push_back(std::numbers::pi - d);
  for (const double angle : angles) {
    SCOPED_TRACE(angle);
    // Around the number that a register holds and the size of a block, so that each remainder is met.
    for (const std::size_t n : {1, 2, 3, 7, 64, 65, 200}) {
      const auto features = this->ring(y, angle, n);
      this->compare(features, detail::UnitWeights{}, y, 20 * eps);
      this->compare(features, this->weights(n), y, 20 * eps);
    }
  }
}

TYPED_TEST(MeanKernel, agrees_far_from_the_mean) {
  using T = ManifoldTraits<TypeParam>;
  std::vector<TypeParam> features;
  for (int i = 0; i < 1000; ++i) features.push_back(T::expOrigin(this->normal(1.5)));
  const TypeParam y = T::expOrigin(this->normal());
  this->compare(features, detail::UnitWeights{}, y, 40 * eps);
  this->compare(features, this->weights(features.size()), y, 40 * eps);
}

TYPED_TEST(MeanKernel, rescales_quaternions_that_are_unit_in_single_precision_only) {
  using T = ManifoldTraits<TypeParam>;
  const TypeParam y = T::expOrigin(this->normal(0.7));
  auto features = this->ring(y, 0.7, 100);
  for (std::size_t i = 0; i < features.size(); ++i) {
    for (int c = 0; c < unit_parameters<TypeParam>; ++c) features[i].data()[c] *= 1 + (i % 2 ? 1e-7 : -2e-7);
  }
  // 5/16 of the third power of the excess of |q|² is left.
  this->compare(features, detail::UnitWeights{}, y, 40 * eps);
}

TYPED_TEST(MeanKernel, leaves_quaternions_far_from_unit_to_the_general_formulas) {
  using T = ManifoldTraits<TypeParam>;
  const TypeParam y = T::expOrigin(this->normal(0.7));
  auto features = this->ring(y, 0.7, 100);
  for (int c = 0; c < unit_parameters<TypeParam>; ++c) features[50].data()[c] *= 1.001;
  constexpr bool constrained = unit_parameters < TypeParam >> 0;  // any numbers are a point
  const detail::UnitWeights p;
  for (const InstructionSet set : instructionSets()) {
    detail::MeanPass<TypeParam> pass;
    EXPECT_EQ(detail::addTermsByPacks<detail::KernelPass::last>(set, features, p, y, {0, features.size()}, pass),
              !constrained)
        << name(set);
    EXPECT_TRUE(detail::addTermsByPacks<detail::KernelPass::last>(set, features, p, y, {0, 50}, pass)) << name(set);
  }
}

TYPED_TEST(MeanKernel, not_a_number_in_not_a_number_out) {
  using T = ManifoldTraits<TypeParam>;
  const TypeParam y = T::expOrigin(this->normal(0.7));
  for (int parameter = 0; parameter < num_parameters<TypeParam>; ++parameter) {
    for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
      auto features = this->ring(y, 0.7, 100);
      features[70].data()[parameter] = bad;
      const auto result = mean(features, {.start = y});
      EXPECT_FALSE(converged(result.status)) << parameter << ' ' << bad;
      EXPECT_EQ(result.status, Status::not_converged);
      EXPECT_FALSE(std::isfinite(result.cost));
    }
  }
  auto p = this->weights(100);
  p[3] = std::numeric_limits<double>::quiet_NaN();
  const auto features = this->ring(y, 0.7, 100);
  EXPECT_FALSE(converged(mean(features, p, {.start = y}).status));
}

TYPED_TEST(MeanKernel, the_mean_is_a_zero_of_the_general_gradient) {
  using T = ManifoldTraits<TypeParam>;
  const TypeParam centre = T::expOrigin(this->normal(0.7));
  for (const double sigma : {1e-9, 1e-4, 0.1, 0.3}) {
    std::vector<TypeParam> features;
    for (int i = 0; i < 3000; ++i) features.push_back(exp(centre, this->normal(sigma)));
    for (const MeanMethod method : {MeanMethod::newton, MeanMethod::fixed_point}) {
      const auto result = mean(features, {.method = method});
      ASSERT_EQ(result.status, Status::ok) << sigma;
      detail::MeanPass<TypeParam> pass;
      detail::addTerms<true>(features, detail::UnitWeights{}, result.mean, {0, features.size()}, pass);
      EXPECT_LE(pass.sums.gradient.norm() / 3000, method == MeanMethod::newton ? 20 * eps : 1e-12) << sigma;
      // Sums of the last pass belong to a point within the last step of the mean.
      // Residuals have the rounding of unit quaternions, however short they are.
      EXPECT_LE((result.scatter - pass.scatter.scatter).norm(),
                1e-12 * pass.scatter.scatter.norm() + 3000 * 20 * eps * sigma);
      EXPECT_LE((result.hessian - pass.sums.hessian).norm(), 1e-12 * pass.sums.hessian.norm());
    }
  }
}

template <class Polynomials>
void comparePolynomials(const Polynomials& polynomials, int steps) {
  const auto at = [&](const auto& coefficients, double x) { return detail::evaluatePolynomial(coefficients, x); };
  for (int i = 0; i <= steps; ++i) {
    const long double phi = std::numbers::pi_v<long double> / 2 * i / 1000, s = std::sin(phi), w = std::cos(phi);
    // By the half angle, 1 - cos φ keeps its digits.
    const long double h = std::sin(phi / 2);
    const double x = static_cast<double>(2 * h * h / polynomials.range - 1);
    const long double f = i == 0 ? 2 : 2 * phi / s;
    EXPECT_NEAR(at(polynomials.log, x), static_cast<double>(f), 6 * eps) << phi;
    // The closed form of g loses digits with the square of the angle.
    if (i < 20) continue;
    const double g = static_cast<double>((1 - w * f / 2) / (s * s));
    EXPECT_NEAR(at(polynomials.exact_hessian, x), g, 4 * eps) << phi;
    EXPECT_NEAR(at(polynomials.newton_hessian, x), g, 1e-7) << phi;
  }
}
TEST(RotationPolynomials, agree_with_long_double_closed_forms) {
  comparePolynomials(detail::any_rotation<double>, 1000);
  comparePolynomials(detail::small_rotation<double>, 500);
}

// float against the general sums in double of the same features.
template <class M, class F>
void compareFloat(double sigma) {
  using T = ManifoldTraits<M>;
  constexpr double eps_f = std::numeric_limits<float>::epsilon();
  std::mt19937_64 engine(11);
  std::normal_distribution<double> gauss;
  const auto normal = [&](double s) {
    return TangentOf<M>(TangentOf<M>::NullaryExpr([&] { return s * gauss(engine); }));
  };
  const M centre = T::expOrigin(normal(0.7));
  std::vector<F> features;
  std::vector<M> exact;
  for (int i = 0; i < 2500; ++i) {
    features.push_back(exp(centre, normal(sigma)).template cast<float>());
    exact.push_back(features.back().template cast<double>());
    Eigen::Map<Eigen::Vector4d>(exact.back().data()).normalize();
  }
  const F y = centre.template cast<float>();
  M y_exact = y.template cast<double>();
  Eigen::Map<Eigen::Vector4d>(y_exact.data()).normalize();
  detail::MeanPass<M> general;
  detail::addTerms<true>(exact, detail::UnitWeights{}, y_exact, {0, exact.size()}, general);
  const double n = 2500, length = general.scatter.largest;
  for (const InstructionSet set : instructionSets()) {
    SCOPED_TRACE(name(set));
    detail::MeanPass<F> packs;
    ASSERT_TRUE(detail::addTermsByPacks<detail::KernelPass::last>(set, features, detail::UnitWeights{}, y,
                                                                  {0, features.size()}, packs));
    EXPECT_NEAR(static_cast<double>(packs.sums.cost), general.sums.cost,
                40 * eps_f * n * (length + eps_f) * (1 + length));
    EXPECT_LE((packs.sums.gradient.template cast<double>() - general.sums.gradient).norm(),
              40 * eps_f * n * (1 + length));
    EXPECT_LE((packs.sums.hessian.template cast<double>() - general.sums.hessian).norm(), 40 * eps_f * n);
    EXPECT_LE((packs.scatter.scatter.template cast<double>() - general.scatter.scatter).norm(),
              40 * eps_f * n * (length + eps_f) * (1 + length));
    if (Quotient<M>) {
      EXPECT_NEAR(static_cast<double>(packs.scatter.smallest_gap), general.scatter.smallest_gap, 40 * eps_f);
    }
  }
}
TEST(MeanKernelFloat, agrees_with_double) {
  for (const double sigma : {1e-6, 1e-3, 0.1, 0.5, 1.0}) {
    SCOPED_TRACE(sigma);
    compareFloat<SO3d, SO3f>(sigma);
    compareFloat<Frame3d, Frame3f>(sigma);
    compareFloat<NonOrientedFrame3d, NonOrientedFrame3<float>>(sigma);
  }
}

/// Where one datum is the start, the log of the other is as long as can be and its direction a rounding error. There is a
/// minimum half way on either side; a datum itself costs twice as much.
TEST(MeanKernel, antipodes_meet_half_way) {
  std::mt19937 engine(77);
  std::normal_distribution<double> normal;
  const auto direction = [&] {
    const double x = normal(engine), y = normal(engine), z = normal(engine);
    return Eigen::Vector3d(Eigen::Vector3d(x, y, z).normalized());
  };
  for (const double delta : {0.0, 1e-15, 1e-13, 1e-11, 1e-9, 1e-7, 1e-5, 1e-3}) {
    SCOPED_TRACE(delta);
    const double cost = 0.25 * std::pow(static_cast<double>(EIGEN_PI) + delta, 2);
    for (int trial = 0; trial < 100; ++trial) {
      const Eigen::Vector3d axis = direction();
      const S2d x(axis);
      const S2d y(SO3d::exp(delta * axis.unitOrthogonal()) * Eigen::Vector3d(-axis));
      EXPECT_LE(mean(std::vector<S2d>{x, y}).cost, cost + 1e-12);
      const SO3d R = SO3d::exp(3 * direction()), turn = SO3d::exp((static_cast<double>(EIGEN_PI) - delta) * axis);
      EXPECT_LE(mean(std::vector<SO3d>{R, R * turn}).cost, cost + 1e-12);
      const SO2d a(axis[0]), half_turn(static_cast<double>(EIGEN_PI) - delta);
      EXPECT_LE(mean(std::vector<SO2d>{a, a * half_turn}).cost, cost + 1e-12);
      const S2f xf(axis.cast<float>());
      EXPECT_NEAR(mean(std::vector<S2f>{xf, S2f(Eigen::Vector3f(-xf.params()))}).cost, 0.25 * EIGEN_PI * EIGEN_PI,
                  1e-5);
    }
  }
}

static_assert(detail::HasRotationSums<SO3d> && detail::HasRotationSums<SO3f> &&
              detail::HasRotationSums<NonOrientedFrame3d>);
static_assert(!detail::HasRotationSums<S2d> && !detail::HasRotationSums<SE3d> &&
              !detail::HasRotationSums<Eigen::Vector3d>);

}  // namespace
