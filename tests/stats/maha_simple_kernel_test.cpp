// The kernels of the Mahalanobis mean of points, directions and plane rotations and frames, and those of single
// precision, against the sums of the manifolds' own operations.
#include <lie/lie.hpp>
#include <stats/maha.hpp>

#include <support/instruction_sets.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

namespace {

using namespace liestat;
using test::instructionSets;

template <class M>
class MahaKernels : public testing::Test {
 protected:
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  static constexpr int k = T::DoF;
  static constexpr double eps = static_cast<double>(std::numeric_limits<S>::epsilon());
  using Problem = detail::MahaProblem<M, std::vector<Gaussian<M>>>;

  TangentOf<M> normal(double sigma) {
    TangentOf<M> v;
    for (int i = 0; i < k; ++i) v[i] = static_cast<S>(sigma * gauss_(engine_));
    return v;
  }
  /// Full covariances with deviations from 0.1 to 1.
  SquareOf<M> covariance() {
    SquareOf<M> A;
    for (int i = 0; i < k; ++i) A.col(i) = normal(0.3);
    return A * A.transpose() + S(0.01) * SquareOf<M>::Identity();
  }
  std::vector<Gaussian<M>> ring(const M& y, double angle, std::size_t n) {
    constexpr int begin = k == 6 && !std::is_same_v<M, Eigen::Matrix<S, 6, 1>> ? 3
                          : std::is_same_v<M, Frame2<S>>                       ? 2
                                                                               : 0;
    std::vector<Gaussian<M>> data;
    for (std::size_t i = 0; i < n; ++i) {
      TangentOf<M> v = normal(1);
      v.template tail<k - begin>() *= static_cast<S>(angle / static_cast<double>(v.template tail<k - begin>().norm()));
      data.push_back({exp(y, v), covariance()});
    }
    return data;
  }
  static Problem problem(const std::vector<Gaussian<M>>& data, bool by_kernels) {
    Problem p{data, CovarianceAt::measured, false};
    p.by_kernels = by_kernels;
    for (const Gaussian<M>& g : data) p.append(g.mean, detail::Cholesky<S, k>(g.covariance));
    return p;
  }
  /// The general Hessian, for directions one of differences of the gradient in double precision.
  static SquareOf<M> hessian(const std::vector<Gaussian<M>>& data, const M& y, const Problem& general,
                             const detail::MahaSums<M>& sums) {
    if constexpr (std::is_same_v<M, S2f>) {
      std::vector<Gaussian<S2d>> wide;
      detail::MahaProblem<S2d, std::vector<Gaussian<S2d>>> problem{wide, CovarianceAt::measured, false};
      problem.by_kernels = false;
      for (const Gaussian<M>& g : data) {
        wide.push_back({g.mean.template cast<double>(), g.covariance.template cast<double>()});
        problem.append(wide.back().mean, detail::Cholesky<double, 2>(wide.back().covariance));
      }
      const S2d at = y.template cast<double>();
      return problem.hessian(SerialExecutor{}, at, problem.evaluate(SerialExecutor{}, at)).template cast<float>();
    } else {
      return general.hessian(SerialExecutor{}, y, sums);
    }
  }
  /// The sums by kernels of every set against the general ones; Hessians to `differences` more, of their own size.
  void compare(const std::vector<Gaussian<M>>& data, const M& y, double near, double differences) {
    const Problem general = problem(data, false), kernels = problem(data, true);
    ASSERT_TRUE(kernels.by_kernels);
    const auto expected = general.evaluate(SerialExecutor{}, y);
    const SquareOf<M> second = hessian(data, y, general, expected);
    const InstructionSet before = instructionSet();
    for (const InstructionSet set : instructionSets()) {
      SCOPED_TRACE(name(set));
      useInstructionSet(set);
      const auto sums = kernels.evaluate(SerialExecutor{}, y);
      EXPECT_NEAR(sums.cost, expected.cost, near);
      EXPECT_LE((sums.gradient - expected.gradient).norm(), near);
      EXPECT_LE((sums.gauss_newton - expected.gauss_newton).norm(), near);
      EXPECT_LE((sums.hessian - second).norm(), near + differences * static_cast<double>(second.norm()));
    }
    useInstructionSet(before);
  }

  std::mt19937_64 engine_{3};
  std::normal_distribution<double> gauss_;
};
using Manifolds =
    testing::Types<Eigen::Matrix<double, 1, 1>, Eigen::Vector2d, Eigen::Vector3d, Eigen::Matrix<double, 6, 1>, SO2d,
                   Frame2d, S2d, Eigen::Vector3f, SO2f, Frame2f, S2f, SO3f, Frame3f>;
TYPED_TEST_SUITE(MahaKernels, Manifolds);

TYPED_TEST(MahaKernels, agree_at_every_decade_of_the_distance) {
  const TypeParam y = ManifoldTraits<TypeParam>::expOrigin(this->normal(0.7));
  constexpr bool single = std::is_same_v<ScalarOf<TypeParam>, float>;
  std::vector<double> angles;
  for (double a = 1e-12; a < 3; a *= 10) angles.push_back(a), angles.push_back(3 * a);
  // Nearer to half a turn single precision does not know which way round it is.
  for (double d = 0.1; d > (single ? 1e-2 : 1e-6); d /= 10) angles.push_back(std::numbers::pi - d);
  for (const double angle : angles) {
    SCOPED_TRACE(angle);
    constexpr bool direction = std::is_same_v<TypeParam, S2d> || std::is_same_v<TypeParam, S2f>;
    // Near half a turn the general Hessian of directions, one of differences, changes within their step.
    if (direction && angle > 3) continue;
    // The Jacobians of directions are as large as θ/sin θ.
    const double ratio = angle / std::sin(angle), scale = direction ? ratio * ratio : 1;
    for (const std::size_t n : {1, 7, 8, 200}) {
      const double near = 200 * 100 * this->eps * static_cast<double>(n) * scale;
      this->compare(this->ring(y, angle, n), y, near, direction ? 1e-8 : 0);
    }
  }
}

TYPED_TEST(MahaKernels, the_estimate_is_a_zero_of_the_general_gradient) {
  const TypeParam centre = ManifoldTraits<TypeParam>::expOrigin(this->normal(0.7));
  for (double sigma = 1e-4; sigma < 1; sigma *= 10) {
    std::vector<Gaussian<TypeParam>> data;
    for (int i = 0; i < 1500; ++i) data.push_back({exp(centre, this->normal(3 * sigma)), this->covariance()});
    // The covariances have nothing to do with the scatter.
    const auto result = maha(data, CovarianceAt::measured, {.refutation_level = 0});
    ASSERT_EQ(result.status, Status::ok);
    const auto problem = this->problem(data, false);
    const auto general = problem.evaluate(SerialExecutor{}, result.mean);
    EXPECT_LE((result.gauss_newton.inverse() * general.gradient).norm(), 450 * this->eps);
    EXPECT_LE((result.gauss_newton - general.gauss_newton).norm(), 4500 * this->eps * general.gauss_newton.norm());
  }
}

TYPED_TEST(MahaKernels, what_is_not_finite_gives_no_estimate) {
  auto data = this->ring(ManifoldTraits<TypeParam>::origin(), 0.3, 20);
  data[12].mean = ManifoldTraits<TypeParam>::expOrigin(this->normal(std::numeric_limits<double>::quiet_NaN()));
  EXPECT_NE(maha(data, CovarianceAt::measured).status, Status::ok);
}

TEST(MahaKernelRefusals, half_a_turn_goes_the_general_way) {
  const auto sums = [](const auto& problem, const auto& y) { return problem.evaluate(SerialExecutor{}, y); };
  std::vector<Gaussian<S2d>> directions;
  std::vector<Gaussian<SO2d>> rotations;
  for (int i = 0; i < 40; ++i) {
    directions.push_back({S2d(Eigen::Vector3d(0.1 * i, 1, 1)), 0.01 * Eigen::Matrix2d::Identity()});
    rotations.push_back({SO2d(0.01 * i), Eigen::Matrix<double, 1, 1>(0.01)});
  }
  const auto compare = [&]<class M>(const std::vector<Gaussian<M>>& data) {
    detail::MahaProblem<M, std::vector<Gaussian<M>>> kernels{data, CovarianceAt::measured, false},
        general{data, CovarianceAt::measured, false};
    general.by_kernels = false;
    for (const Gaussian<M>& g : data) {
      const detail::Cholesky<double, ManifoldTraits<M>::DoF> factor(g.covariance);
      kernels.append(g.mean, factor), general.append(g.mean, factor);
    }
    ASSERT_TRUE(kernels.by_kernels);
    const M y = exp(data[3].mean, TangentOf<M>(std::numbers::pi * TangentOf<M>::Unit(0)));
    const auto a = sums(kernels, y), b = sums(general, y);
    EXPECT_EQ(a.cost, b.cost);
    // The direction of a log at the antipode does not exist, on a circle it does.
    ASSERT_EQ(a.gradient.allFinite(), b.gradient.allFinite());
    if (!b.gradient.allFinite()) return;
    EXPECT_EQ(a.gradient, b.gradient);
    EXPECT_EQ(a.gauss_newton, b.gauss_newton);
  };
  compare(directions);
  compare(rotations);
}

TEST(MahaKernelRefusals, vectors_far_from_unit_go_the_general_way) {
  std::vector<Gaussian<S2d>> data(20, {S2d(Eigen::Vector3d(1, 2, 3)), 0.01 * Eigen::Matrix2d::Identity()});
  data[12].mean.data()[0] *= 1.001;
  detail::MahaProblem<S2d, std::vector<Gaussian<S2d>>> problem{data, CovarianceAt::measured, false};
  for (const auto& g : data) problem.append(g.mean, detail::Cholesky<double, 2>(g.covariance));
  EXPECT_FALSE(problem.by_kernels);
  EXPECT_EQ(problem.whitening.size(), data.size());
}

}  // namespace
