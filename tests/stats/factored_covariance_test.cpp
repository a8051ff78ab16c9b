// Covariances of Mahalanobis means are factored: symmetric and positive definite whatever the spectrum, small variances
// right to the rounding of the input, from full matrices and from factors.

#include <lie/detail/small_eigen.hpp>
#include <lie/detail/small_orthogonal.hpp>
#include <lie/lie.hpp>
#include <stats/certified_maha.hpp>
#include <stats/random.hpp>

#include <paper/full_run.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

namespace liestat {
namespace {

constexpr double eps = std::numeric_limits<double>::epsilon();

template <class M>
constexpr int dof = ManifoldTraits<M>::DoF;

/// Orthonormal columns, uniform.
template <int K>
Eigen::Matrix<double, K, K> randomAxes(CounterRng& rng) {
  Eigen::Matrix<double, K, K> Q;
  for (int c = 0; c < K; ++c) {
    Q.col(c) = rng.normalVector<K>();
    for (int pass = 0; pass < 2; ++pass) {
      for (int d = 0; d < c; ++d) Q.col(c) -= Q.col(d).dot(Q.col(c)) * Q.col(d);
    }
    Q.col(c).normalize();
  }
  return Q;
}

/// Principal variances of A Aᵀ, ascending.
template <int K>
std::vector<double> variancesOf(const Eigen::Matrix<double, K, K>& A) {
  const detail::SmallSvd<K> svd(detail::BasicSmallMatrix<K>::of(A));
  std::vector<double> list;
  for (int k = K - 1; k >= 0; --k) list.push_back(svd.value(k) * svd.value(k));
  return list;
}

/// The measurement whose error at the mean y is w in its own frame: log(x, y) = w, where that frame is unique.
template <class M>
M measurementOf(const M& y, const TangentOf<M>& w) {
  using T = ManifoldTraits<M>;
  if constexpr (T::Group::DoF == T::DoF) {
    return T::act(T::placement(y) * T::placement(T::expOrigin(w)).inverse(), T::origin());
  } else {
    return exp(y, w);
  }
}

/// Measurements with noise of standard deviations `sd` along axes that are random, and common to all or not.
template <class M>
std::vector<FactoredGaussian<M>> measurements(CounterRng& rng, const M& y, std::size_t n, const TangentOf<M>& sd,
                                              bool equal_axes, double noise = 1) {
  std::vector<FactoredGaussian<M>> list;
  SquareOf<M> Q = randomAxes<dof<M>>(rng);
  for (std::size_t i = 0; i < n; ++i) {
    if (!equal_axes) Q = randomAxes<dof<M>>(rng);
    const SquareOf<M> A = Q * sd.asDiagonal();
    const TangentOf<M> w = noise * (A * rng.normalVector<dof<M>>());
    const M x = measurementOf(y, w);
    // On a sphere the frames of both places differ by the transport between them.
    const bool sphere = ManifoldTraits<M>::Group::DoF != ManifoldTraits<M>::DoF;
    list.push_back({x, sphere ? SquareOf<M>(frameTransport(y, x) * A) : A});
  }
  return list;
}
template <class M>
std::vector<Gaussian<M>> fullOf(const std::vector<FactoredGaussian<M>>& list) {
  std::vector<Gaussian<M>> full;
  for (const auto& x : list) full.push_back(x.gaussian());
  return full;
}
template <class M>
M drawn(CounterRng& rng) {
  const TangentOf<M> v = 0.7 * rng.normalVector<dof<M>>();
  return ManifoldTraits<M>::expOrigin(v);
}

template <class M>
testing::AssertionResult isFactored(const SquareOf<M>& C) {
  if (!(C.array() == C.transpose().array()).all()) return testing::AssertionFailure() << "not symmetric:\n" << C;
  if (!detail::Cholesky<double, dof<M>>(C).ok()) return testing::AssertionFailure() << "no Cholesky factor:\n" << C;
  return testing::AssertionSuccess();
}

template <class M>
class FactoredCovariance : public testing::Test {};
using Manifolds = testing::Types<SO3d, Frame3d, NonOrientedFrame3d, SE3d, S2d, Eigen::Vector3d>;
TYPED_TEST_SUITE(FactoredCovariance, Manifolds);

// Any spectrum: ratios of standard deviations up to 1e8, of both signs of luck with axes, few and many measurements.
TYPED_TEST(FactoredCovariance, okImpliesSymmetryAndACholeskyFactor) {
  using M = TypeParam;
  const std::size_t trials = trialsOf(170'000, 50);
  std::size_t ok = 0;
  for (std::size_t t = 0; t < trials; ++t) {
    CounterRng rng(11, t);
    const M y = drawn<M>(rng);
    const double largest = 0.4 * std::exp(-3 * rng.uniform()), ratio = std::pow(10, 8 * rng.uniform());
    TangentOf<M> sd;
    for (int k = 0; k < dof<M>; ++k) sd[k] = largest * std::pow(ratio, -rng.uniform());
    sd[0] = largest, sd[dof<M> - 1] = largest / ratio;
    const std::size_t sizes[] = {1, 2, 5, 30};
    const auto factored = measurements(rng, y, sizes[t % 4], sd, rng.uniform() < 0.5);
    const auto full = fullOf(factored);
    for (const auto& x : full) ASSERT_TRUE(isFactored<M>(x.covariance)) << t;
    const auto result = t % 2 ? maha(full, CovarianceAt::measured) : maha(factored, CovarianceAt::measured);
    const auto fused = fuse(full, CovarianceAt::measured);
    const auto fused_factor = fuse(factored, CovarianceAt::measured);
    if (fused.covariance.allFinite()) {
      ASSERT_TRUE(isFactored<M>(fused.covariance)) << t;
    }
    if (fused_factor.factor.allFinite()) {
      ASSERT_TRUE(isFactored<M>(fused_factor.gaussian().covariance)) << t;
    }
    if (result.status != Status::ok) continue;
    ++ok;
    ASSERT_TRUE(isFactored<M>(result.covariance)) << t;
    ASSERT_TRUE(result.factor.allFinite()) << t;
  }
  // The others are rotations whose noise is of the order of what uniform ones scatter.
  EXPECT_GE(static_cast<double>(ok), 0.98 * static_cast<double>(trials));
}

// n measurements of the same place have the covariance C/n, exactly.
TYPED_TEST(FactoredCovariance, equalMeasurementsKeepEachVariance) {
  using M = TypeParam;
  CounterRng rng(12, 0);
  for (const double ratio : {1e1, 1e3, 1e6}) {
    for (const std::size_t n : {1, 2, 7, 100}) {
      TangentOf<M> sd;
      for (int k = 0; k < dof<M>; ++k) sd[k] = 0.1 * std::pow(ratio, -double(k) / (dof<M> - 1));
      const auto factored = measurements(rng, drawn<M>(rng), n, sd, true, 0);
      const auto from_factors = fuse(factored, CovarianceAt::measured);
      const auto variances = variancesOf<dof<M>>(from_factors.factor);
      const double smallest = sd[dof<M> - 1] * sd[dof<M> - 1] / static_cast<double>(n);
      EXPECT_NEAR(variances.front() / smallest, 1, 1e-9) << ratio << ' ' << n;
      const auto from_matrices = fuse(fullOf(factored), CovarianceAt::measured);
      const detail::SymmetricEigen<SquareOf<M>> eigen(from_matrices.covariance);
      EXPECT_NEAR(eigen.values[0] / smallest, 1, 10 * eps * ratio * ratio) << ratio << ' ' << n;
      EXPECT_NEAR(eigen.values[dof<M> - 1] / (0.01 / static_cast<double>(n)), 1, 10 * eps * ratio * ratio);
    }
  }
}

// The same with noise: against the same sums in long double.
template <class M>
struct Wide;
template <>
struct Wide<SO3d> {
  using type = SO3<long double>;
};
template <>
struct Wide<Frame3d> {
  using type = Frame3<long double>;
};
template <class M>
class AgainstLongDouble : public testing::Test {};
using WideManifolds = testing::Types<SO3d, Frame3d>;
TYPED_TEST_SUITE(AgainstLongDouble, WideManifolds);

TYPED_TEST(AgainstLongDouble, smallestVariance) {
  using M = TypeParam;
  using W = typename Wide<M>::type;
  CounterRng rng(13, 0);
  for (const double ratio : {1e2, 1e4, 1e6}) {
    for (const std::size_t n : {1, 3, 100}) {
      for (const bool equal : {true, false}) {
        TangentOf<M> sd = TangentOf<M>::Constant(0.2 / ratio);
        sd[0] = 0.2;
        const auto factored = measurements(rng, drawn<M>(rng), n, sd, equal);
        std::vector<FactoredGaussian<W>> wide;
        std::vector<Gaussian<W>> wide_full;
        const auto full = fullOf(factored);
        for (std::size_t i = 0; i < n; ++i) {
          const W x = W::fromParams(typename W::Params(factored[i].mean.params().template cast<long double>()));
          wide.push_back({x, factored[i].factor.template cast<long double>()});
          wide_full.push_back({x, full[i].covariance.template cast<long double>()});
        }
        const auto narrow = maha(factored, CovarianceAt::measured);
        const auto reference = maha(wide, CovarianceAt::measured);
        ASSERT_EQ(narrow.status, Status::ok) << ratio << ' ' << n << ' ' << equal;
        ASSERT_EQ(reference.status, Status::ok) << ratio << ' ' << n << ' ' << equal;
        const auto found = variancesOf<dof<M>>(narrow.factor);
        const auto expected = variancesOf<dof<M>>(SquareOf<M>(reference.factor.template cast<double>()));
        EXPECT_NEAR(found.front() / expected.front(), 1, 1e-9) << ratio << ' ' << n << ' ' << equal;
        const auto narrow_full = maha(full, CovarianceAt::measured);
        const auto reference_full = maha(wide_full, CovarianceAt::measured);
        ASSERT_EQ(narrow_full.status, Status::ok);
        const detail::SymmetricEigen<SquareOf<M>> a(narrow_full.covariance);
        const detail::SymmetricEigen<SquareOf<W>> b(reference_full.covariance);
        EXPECT_NEAR(a.values[0] / static_cast<double>(b.values[0]), 1, 10 * eps * ratio * ratio)
            << ratio << ' ' << n << ' ' << equal;
      }
    }
  }
}

// Five rotations with deviations of 0.3 : 3e-6 : 3e-6 rad about common oblique axes, as a file has them.
TEST(FactoredCovarianceOfAFile, sameObliqueAxes) {
  Eigen::Matrix3d C;
  C << 0.010903666092277662, -0.012481345700588028, -0.026583002517466862, -0.012481345700588028, 0.014287303866966122,
      0.030429365834024932, -0.026583002517466862, 0.030429365834024932, 0.064809030058756198;
  const double q[5][4] = {{0.080165988771853811, 0.087136332152992352, -0.65346061366860264, 0.74764289620580737},
                          {0.091587257197194613, 0.16358653767623153, -0.52555466886615443, 0.82984547299071765},
                          {0.10131573893850024, 0.24454409810769459, -0.36192394068892486, 0.89383687901106401},
                          {0.096245650082683112, 0.19956606016109771, -0.45680922341520341, 0.86153090244908681},
                          {0.084541823700174976, 0.11491523908601439, -0.60967019885082729, 0.77971111092791645}};
  std::vector<Gaussian<SO3d>> data;
  for (const auto& x : q) data.push_back({SO3d::fromParams(Eigen::Vector4d(x[0], x[1], x[2], x[3])), C});
  const auto result = certifiedMaha(data, CovarianceAt::measured);
  ASSERT_EQ(result.status, Status::ok) << result.reason;
  ASSERT_TRUE(isFactored<SO3d>(result.estimate->covariance));
  const detail::SymmetricEigen<Eigen::Matrix3d> eigen(result.estimate->covariance);
  // The rotations bend the tight axes by half a percent.
  EXPECT_NEAR(eigen.values[0] / 1.8e-12, 1, 0.03);
  EXPECT_NEAR(eigen.values[1] / 1.8e-12, 1, 0.03);
  EXPECT_NEAR(eigen.values[2] / 1.8e-2, 1, 0.03);
}

// The truth is in the 95 % region where standard deviations differ by factors of millions: within four standard errors.
TEST(FactoredCovarianceCoverage, ofRotations) {
  const std::size_t trials = trialsOf(5000, 10);
  for (const std::size_t n : {1, 5}) {
    for (const double ratio : {1e4, 1e5, 1e6}) {
      for (const bool equal : {true, false}) {
        std::size_t outside = 0, refuted = 0;
        for (std::size_t t = 0; t < trials; ++t) {
          CounterRng rng(14, t);
          const SO3d y = drawn<SO3d>(rng);
          const auto full =
              fullOf(measurements<SO3d>(rng, y, n, Eigen::Vector3d(0.3, 0.3 / ratio, 0.3 / ratio), equal));
          const FuseResult<SO3d> fused = testedFuse(full);
          refuted += fused.status == Status::inconsistent ? 1 : 0;
          ASSERT_TRUE(fused.estimate.covariance.allFinite()) << n << ' ' << ratio << ' ' << t;
          outside += !(mahalanobisSquared(fused.estimate, y) <= 7.8147) ? 1 : 0;
        }
        const double expected = 0.05 * static_cast<double>(trials);
        EXPECT_NEAR(static_cast<double>(outside), expected, 4 * std::sqrt(0.95 * expected)) << n << ' ' << ratio;
        const double false_alarms = refutation_level * static_cast<double>(trials);
        EXPECT_LE(static_cast<double>(refuted), 1 + false_alarms + 4 * std::sqrt(false_alarms));
      }
    }
  }
}

TEST(FactoredGaussian, isAGaussianWithAFactor) {
  const auto x = FactoredGaussian<Eigen::Vector3d>::fromDeviations({1, 2, 3}, {1e-9, 2, 3});
  const Eigen::Matrix3d expected = Eigen::Vector3d(1e-18, 4, 9).asDiagonal();
  EXPECT_TRUE(x.gaussian().covariance.isApprox(expected, 1e-15));
  // Beyond what a matrix can hold the smallest variance is raised, and a Cholesky factor stays.
  CounterRng rng(15, 0);
  const Eigen::Matrix3d A = randomAxes<3>(rng) * Eigen::Vector3d(1, 1e-10, 1e-12).asDiagonal();
  EXPECT_TRUE(isFactored<Eigen::Vector3d>(FactoredGaussian<Eigen::Vector3d>{{0, 0, 0}, A}.gaussian().covariance));
}

}  // namespace
}  // namespace liestat
