// The kernels of the Mahalanobis mean of semi- and non-oriented frames against the sums of the manifolds' own
// operations: the representative that the nearest rotation angle says, measurement by measurement.
#include <lie/lie.hpp>
#include <stats/maha.hpp>

#include <support/instruction_sets.hpp>
#include <support/thread_for_each_chunk.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

namespace {

using namespace liestat;
using test::instructionSets;
using test::ThreadForEachChunk;

template <class M>
class MahaQuotientKernels : public testing::Test {
 protected:
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  static constexpr double eps = static_cast<double>(std::numeric_limits<S>::epsilon());
  using Problem = detail::MahaProblem<M, std::vector<Gaussian<M>>>;

  TangentOf<M> normal(double sigma) {
    TangentOf<M> v;
    for (int i = 0; i < 6; ++i) v[i] = static_cast<S>(sigma * gauss_(engine_));
    return v;
  }
  /// Full covariances with deviations from 0.1 to 1.
  SquareOf<M> covariance() {
    SquareOf<M> A;
    for (int i = 0; i < 6; ++i) A.col(i) = normal(0.3);
    return A * A.transpose() + S(0.01) * SquareOf<M>::Identity();
  }
  /// Measurements at a rotation angle from y, in each of their representatives.
  std::vector<Gaussian<M>> ring(const M& y, double angle, std::size_t n) {
    std::vector<Gaussian<M>> data;
    for (std::size_t i = 0; i < n; ++i) {
      TangentOf<M> v = normal(1);
      v.template tail<3>() *= static_cast<S>(angle / static_cast<double>(v.template tail<3>().norm()));
      constexpr auto count = static_cast<std::size_t>(T::num_representatives);
      const M x = T::representative(exp(y, v), T::representatives[i % count]);
      data.push_back({x, covariance()});
    }
    return data;
  }
  static Problem problem(const std::vector<Gaussian<M>>& data, bool by_kernels) {
    Problem p{data, CovarianceAt::measured, false};
    p.by_kernels = by_kernels;
    for (const Gaussian<M>& g : data) p.append(g.mean, detail::Cholesky<S, 6>(g.covariance));
    return p;
  }
  void compare(const std::vector<Gaussian<M>>& data, const M& y) {
    const Problem kernels = problem(data, true);
    ASSERT_TRUE(kernels.by_kernels);
    const auto expected = problem(data, false).evaluate(SerialExecutor{}, y);
    // Terms as large as the information, 100, times vectors as long as π.
    const double near = 200 * 100 * eps * static_cast<double>(data.size());
    const InstructionSet before = instructionSet();
    for (const InstructionSet set : instructionSets()) {
      SCOPED_TRACE(name(set));
      useInstructionSet(set);
      const auto sums = kernels.evaluate(SerialExecutor{}, y);
      EXPECT_NEAR(sums.cost, expected.cost, near);
      EXPECT_LE((sums.gradient - expected.gradient).norm(), near);
      EXPECT_LE((sums.gauss_newton - expected.gauss_newton).norm(), near);
      EXPECT_LE((sums.hessian - expected.hessian).norm(), near);
    }
    useInstructionSet(before);
  }

  std::mt19937_64 engine_{3};
  std::normal_distribution<double> gauss_;
};
using Manifolds = testing::Types<SemiOrientedFrame3d, NonOrientedFrame3d, NonOrientedFrame3f>;
TYPED_TEST_SUITE(MahaQuotientKernels, Manifolds);

TYPED_TEST(MahaQuotientKernels, agree_at_every_decade_of_the_angle) {
  constexpr bool single = std::is_same_v<ScalarOf<TypeParam>, float>;
  const TypeParam y = ManifoldTraits<TypeParam>::expOrigin(this->normal(0.7));
  std::vector<double> angles;
  for (double a = 1e-12; a < 3; a *= 10) angles.push_back(a), angles.push_back(3 * a);
  // Semi-oriented frames may be half a turn away, where single precision does not know which way round.
  for (double d = 0.1; d > (single ? 1e-2 : 1e-9); d /= 10) angles.push_back(std::numbers::pi - d);
  for (const double angle : angles) {
    SCOPED_TRACE(angle);
    for (const std::size_t n : {1, 7, 40}) this->compare(this->ring(y, angle, n), y);
    if (this->HasFailure()) return;
  }
}

TYPED_TEST(MahaQuotientKernels, agree_for_every_number_of_measurements) {
  const TypeParam y = ManifoldTraits<TypeParam>::expOrigin(this->normal(0.7));
  const auto all = this->ring(y, 0.9, 1100);
  std::vector<std::size_t> counts{1025};
  for (std::size_t n = 1; n <= 100; ++n) counts.push_back(n);
  for (const std::size_t n : counts) {
    SCOPED_TRACE(n);
    this->compare({all.begin(), all.begin() + static_cast<std::ptrdiff_t>(n)}, y);
    if (this->HasFailure()) return;
  }
}

// Between two representatives that are equally near, rounding chooses: the general formulas' everywhere.
TYPED_TEST(MahaQuotientKernels, choose_as_the_general_formulas_on_the_cut_locus) {
  using M = TypeParam;
  const M y = ManifoldTraits<M>::expOrigin(this->normal(0.7));
  for (const double off : {0.0, 1.0, -1.0, 3.0, 20.0, 1e3}) {
    SCOPED_TRACE(off);
    std::vector<Gaussian<M>> data;
    for (int i = 0; i < 40; ++i) {
      // A quarter of a turn about an axis of half-turns.
      TangentOf<M> v = this->normal(0.3);
      v.template tail<3>() << 0, 0, static_cast<ScalarOf<M>>(std::numbers::pi / 2 + off * this->eps);
      data.push_back({exp(y, v), this->covariance()});
    }
    this->compare(data, y);
  }
}

TYPED_TEST(MahaQuotientKernels, the_estimate_is_a_zero_of_the_general_gradient_on_any_threads) {
  using M = TypeParam;
  const M centre = ManifoldTraits<M>::expOrigin(this->normal(0.7));
  std::vector<Gaussian<M>> data;
  for (int i = 0; i < 3000; ++i) data.push_back({exp(centre, this->normal(0.1)), this->covariance()});
  const auto result = maha(data, CovarianceAt::measured);
  ASSERT_EQ(result.status, Status::ok);
  const auto general = this->problem(data, false).evaluate(SerialExecutor{}, result.mean);
  EXPECT_LE((general.gauss_newton.inverse() * general.gradient).norm(), 450 * this->eps);
  EXPECT_LE((result.gauss_newton - general.gauss_newton).norm(), 4500 * this->eps * general.gauss_newton.norm());
  EXPECT_LE((result.hessian - general.hessian).norm(), 4500 * this->eps * general.hessian.norm());
  const auto threads = maha(ThreadForEachChunk{}, data, CovarianceAt::measured);
  EXPECT_EQ(threads.mean.params(), result.mean.params());
  EXPECT_EQ(threads.hessian, result.hessian);
  EXPECT_EQ(threads.cost, result.cost);
}

TYPED_TEST(MahaQuotientKernels, what_is_not_finite_gives_no_estimate) {
  using M = TypeParam;
  auto data = this->ring(M(), 0.3, 20);
  data[12].mean = ManifoldTraits<M>::expOrigin(this->normal(std::numeric_limits<double>::quiet_NaN()));
  EXPECT_NE(maha(data, CovarianceAt::measured).status, Status::ok);
  data = this->ring(M(), 0.3, 20);
  data[12].mean.data()[5] = std::numeric_limits<ScalarOf<M>>::infinity();
  EXPECT_NE(maha(data, CovarianceAt::measured).status, Status::ok);
}

}  // namespace
