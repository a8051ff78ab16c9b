// Ranges accepted as data and as weights: each kind gives the result of the same values in a std::vector, to the bit,
// because the estimators see the same numbers in the same order.
#include <lie/frame3.hpp>
#include <lie/rn.hpp>
#include <lie/se3.hpp>
#include <lie/so3.hpp>
#include <stats/covariance.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/group_mean.hpp>
#include <stats/maha.hpp>
#include <stats/mean.hpp>
#include <stats/printed.hpp>

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <deque>
#include <forward_list>
#include <list>
#include <ranges>
#include <span>
#include <sstream>
#include <vector>

namespace liestat {
namespace {

constexpr std::size_t n = 7;

Eigen::Vector3d tangent(std::size_t i) {
  const double a = static_cast<double>(i);
  return Eigen::Vector3d(std::sin(a), 0.3 * std::cos(2 * a), 0.1 * a);
}
double weight(std::size_t i) { return 1 + 0.5 * static_cast<double>(i); }

std::vector<SO3d> rotations() {
  std::vector<SO3d> list;
  for (std::size_t i = 0; i < n; ++i) list.push_back(SO3d::exp(tangent(i)));
  return list;
}
std::vector<double> weightList() {
  std::vector<double> list;
  for (std::size_t i = 0; i < n; ++i) list.push_back(weight(i));
  return list;
}

/// The result for `range` is that for `reference`, a std::vector of the same values, weighted or not.
template <class R, class M>
void expectSameMeans(R&& range, const std::vector<M>& reference, double tolerance = 0) {
  const auto close = [&](const MeanResult<M>& a, const MeanResult<M>& b) {
    EXPECT_EQ(a.status, Status::ok);
    EXPECT_LE(distance(a.mean, b.mean), tolerance);
    EXPECT_LE((a.scatter - b.scatter).norm(), tolerance);
    EXPECT_EQ(a.n, b.n);
  };
  close(mean(range), mean(reference));
  close(mean(range, weightList()), mean(reference, weightList()));
  close(mean(SerialExecutor{}, range, {.max_iterations = 50}), mean(reference));
  EXPECT_LE((empiricalCovariance(range, reference[0]) - empiricalCovariance(reference, reference[0])).norm(),
            tolerance);
}

TEST(Ranges, containersAndViewsOfMemory) {
  const std::vector<SO3d> x = rotations();
  std::array<SO3d, n> array;
  std::ranges::copy(x, array.begin());
  SO3d raw[n];
  std::ranges::copy(x, raw);
  expectSameMeans(array, x);
  expectSameMeans(raw, x);
  expectSameMeans(std::span(x), x);
  expectSameMeans(std::span<const SO3d, n>(x), x);
  expectSameMeans(std::deque<SO3d>(x.begin(), x.end()), x);
  expectSameMeans(std::list<SO3d>(x.begin(), x.end()), x);
  expectSameMeans(std::forward_list<SO3d>(x.begin(), x.end()), x);
  expectSameMeans(std::vector<SO3d>(x), x);
}

TEST(Ranges, nothingInMemoryIsCopied) {
  std::vector<SO3d> vector = rotations();
  EXPECT_EQ(&detail::asSamples(vector)[0], vector.data());
  const std::span<const SO3d> span(vector);
  EXPECT_EQ(&detail::asSamples(span)[1], vector.data() + 1);
  const std::deque<SO3d> deque(vector.begin(), vector.end());
  EXPECT_EQ(&detail::asSamples(deque)[2], &deque[2]);
  const std::vector<double> weights = weightList();
  EXPECT_EQ(&detail::asWeights(weights)[0], weights.data());
  auto moved = detail::asSamples(vector);
  const auto copy = detail::asSamples(std::as_const(deque));
  moved = detail::asSamples(vector);
  EXPECT_EQ(&moved[0], vector.data());
  std::list<SO3d> list(vector.begin(), vector.end());
  auto owner = detail::asSamples(list);
  const SO3d* const first = &owner[0];
  const auto taken = std::move(owner);
  EXPECT_EQ(&taken[0], first);
  EXPECT_EQ(taken.end() - taken.begin(), static_cast<std::ptrdiff_t>(n));
}

TEST(Ranges, columnsOfAMatrix) {
  Eigen::Matrix3Xd points(3, n);
  std::vector<Eigen::Vector3d> x;
  for (std::size_t i = 0; i < n; ++i) {
    x.push_back(tangent(i));
    points.col(static_cast<Eigen::Index>(i)) = x.back();
  }
  static_assert(std::same_as<SampleOf<decltype(points.colwise())>, Eigen::Vector3d>);
  expectSameMeans(points.colwise(), x);
  expectSameMeans(std::as_const(points).colwise(), x);
  const Eigen::Map<const Eigen::Matrix3Xd> map(points.data(), 3, n);
  expectSameMeans(map.colwise(), x);
}

TEST(Ranges, mapsStandForTheOwningType) {
  std::vector<SO3d> x = rotations();
  std::vector<Eigen::Map<const SO3d>> constant;
  std::vector<Eigen::Map<SO3d>> writable;
  for (SO3d& r : x) constant.emplace_back(r.data()), writable.emplace_back(r.data());
  static_assert(std::same_as<decltype(mean(constant).mean), SO3d>);
  expectSameMeans(constant, x);
  expectSameMeans(writable, x);
}

TEST(Ranges, quaternionsAreNormalised) {
  const std::vector<SO3d> x = rotations();
  std::vector<Eigen::Quaterniond> q;
  std::vector<Eigen::Map<const Eigen::Quaterniond>> views;
  for (std::size_t i = 0; i < n; ++i) {
    const auto& p = x[i].params();
    const double scale = 1 + static_cast<double>(i);
    q.emplace_back(scale * p[3], scale * p[0], scale * p[1], scale * p[2]);
  }
  for (const auto& one : q) views.emplace_back(one.coeffs().data());
  static_assert(std::same_as<decltype(mean(q).mean), SO3d>);
  const double rounding = 1e-14;  // rounding of a normalisation, a few units in the last place
  expectSameMeans(q, x, rounding);
  expectSameMeans(views, x, rounding);
}

/// A view that computes its elements; what std::views::transform is, for compilers that cannot use the library's.
class ComputedRotations {
 public:
  struct Iterator {
    using iterator_category = std::forward_iterator_tag;
    using value_type = SO3d;
    using difference_type = std::ptrdiff_t;
    SO3d operator*() const { return SO3d::exp(tangent(i)); }
    Iterator& operator++() { return ++i, *this; }
    Iterator operator++(int) { return {i++}; }
    bool operator==(const Iterator&) const = default;
    std::size_t i = 0;
  };
  Iterator begin() const { return {0}; }
  Iterator end() const { return {n}; }
};

TEST(Ranges, viewsThatComputeTheirElements) { expectSameMeans(ComputedRotations(), rotations()); }

#if !defined(__clang__) || __clang_major__ >= 16  // older ones cannot compile libstdc++'s views
TEST(Ranges, standardViews) {
  struct Pose {
    SE3d pose;
    bool valid = true;
  };
  const std::vector<SO3d> x = rotations();
  std::vector<Pose> poses;
  for (const SO3d& r : x) poses.push_back({SE3d(r, Eigen::Vector3d(1, 2, 3))});
  poses.insert(poses.begin() + 2, Pose{SE3d(), false});
  const auto valid = [](const Pose& p) { return p.valid; };
  const auto so3 = [](const Pose& p) { return SO3d(p.pose.so3()); };
  const auto view = [](const Pose& p) { return p.pose.so3(); };
  expectSameMeans(poses | std::views::filter(valid) | std::views::transform(so3), x);
  expectSameMeans(poses | std::views::filter(valid) | std::views::transform(view), x);  // elements are Eigen::Map
  expectSameMeans(x | std::views::reverse | std::views::reverse, x);
  EXPECT_EQ(groupMean(poses | std::views::transform(&Pose::pose)).n, n + 1);
}
#endif

TEST(Ranges, weightsOfEachKind) {
  const std::vector<SO3d> x = rotations();
  const std::vector<double> w = weightList();
  const SO3d expected = mean(x, w).mean;
  const auto expectSame = [&](auto&& weights) {
    const MeanResult<SO3d> result = mean(x, weights);
    EXPECT_EQ(result.mean.params(), expected.params());
    EXPECT_EQ(result.squared_weight_scatter, mean(x, w).squared_weight_scatter);
  };
  const Eigen::Map<const Eigen::VectorXd> map(w.data(), n);
  expectSame(map);
  expectSame(Eigen::VectorXd(map));
  expectSame(Eigen::ArrayXd(map.array()));
  expectSame(Eigen::RowVectorXd(map.transpose()));
  expectSame(Eigen::VectorXf(map.cast<float>()));  // the weights are halves: exact in float
  expectSame(std::vector<float>(w.begin(), w.end()));
  expectSame(std::list<double>(w.begin(), w.end()));
  expectSame(std::deque<double>(w.begin(), w.end()));
  const std::vector<int> ones(n, 1);
  EXPECT_EQ(mean(x, ones).sum_of_weights, static_cast<double>(n));
}

TEST(Ranges, singlePrecision) {
  std::vector<SO3f> x;
  for (const SO3d& r : rotations()) x.push_back(r.cast<float>());
  const std::list<SO3f> list(x.begin(), x.end());
  EXPECT_EQ(mean(list, Eigen::VectorXd::Ones(n).eval()).mean.params(), mean(x).mean.params());
  std::vector<Eigen::Quaternionf> q;
  for (const SO3f& r : x) q.emplace_back(r.unit_quaternion());
  static_assert(std::same_as<decltype(mean(q).mean), SO3f>);
  EXPECT_LT(distance(mean(q).mean, mean(x).mean), 1e-6f);
}

TEST(Ranges, groupMeansAndMahalanobisMeans) {
  std::vector<SE3d> x;
  std::vector<Gaussian<SE3d>> g;
  for (std::size_t i = 0; i < n; ++i) {
    x.emplace_back(SO3d::exp(tangent(i)), Eigen::Vector3d(tangent(i + 1)));
    const double s = 0.1 * (1 + static_cast<double>(i));
    g.push_back({x.back(), s * s * SquareOf<SE3d>::Identity()});
  }
  const std::list<SE3d> list(x.begin(), x.end());
  EXPECT_EQ(groupMean(list).mean.params(), groupMean(x).mean.params());
  EXPECT_EQ(groupMean(list, Eigen::VectorXd::Ones(n).eval()).mean.params(), groupMean(x).mean.params());
  EXPECT_EQ(groupMean(SerialExecutor{}, x, std::vector<int>(n, 1), x[2]).status, Status::ok);

  const std::list<Gaussian<SE3d>> gaussians(g.begin(), g.end());
  EXPECT_EQ(maha(gaussians).mean.params(), maha(g).mean.params());
  EXPECT_EQ(testedFuse(gaussians).estimate.covariance, testedFuse(g).estimate.covariance);
  EXPECT_EQ(fuse(gaussians).mean.params(), fuse(g).mean.params());
  EXPECT_EQ(maha(SerialExecutor{}, std::deque(g.begin(), g.end()), CovarianceAt::estimated).covariance,
            maha(g, CovarianceAt::estimated).covariance);
  EXPECT_EQ(printed::maha(gaussians).mean.params(), printed::maha(g).mean.params());
}

TEST(Ranges, covariancesFromNoise) {
  const std::vector<SO3d> x = rotations();
  const std::vector<double> w = weightList();
  const MeanResult<SO3d> result = mean(x, w);
  std::vector<Eigen::Matrix3d> noise;
  for (std::size_t i = 0; i < n; ++i) noise.push_back(Eigen::Vector3d(weight(i), 1, 2).asDiagonal());
  std::vector<Eigen::Map<const Eigen::Matrix3d>> maps;
  for (const auto& v : noise) maps.emplace_back(v.data());
  const Eigen::Map<const Eigen::VectorXd> p(w.data(), n);
  EXPECT_EQ(covarianceFromNoise(result, p, maps), covarianceFromNoise(result, w, noise));
  EXPECT_EQ(covarianceFromNoise(result, maps), covarianceFromNoise(result, noise));
  EXPECT_EQ(printed::covarianceFromNoise(std::list(x.begin(), x.end()), p, maps, result.mean),
            printed::covarianceFromNoise(x, w, noise, result.mean));
}

TEST(Ranges, emptyOnesAreTooFew) {
  EXPECT_EQ(mean(std::list<SO3d>()).status, Status::too_few);
  EXPECT_EQ(mean(std::vector<Eigen::Map<const SO3d>>(), Eigen::VectorXd()).status, Status::too_few);
  EXPECT_EQ(groupMean(std::list<SE3d>()).status, Status::too_few);
  EXPECT_EQ(maha(std::list<Gaussian<SO3d>>()).status, Status::too_few);
}

// Ranges that the concepts refuse; tests/consumers/sentences.cpp shows that the message is one sentence.
static_assert(!SampleRange<std::vector<int>>);
static_assert(!SampleRange<std::vector<Eigen::VectorXd>>);
static_assert(!WeightRange<std::vector<SO3d>>);
#if !defined(__clang__) || __clang_major__ >= 16  // as above
static_assert(!WeightRange<std::ranges::basic_istream_view<double, char>>);
#endif
static_assert(SampleRange<const std::list<SO3d>&>);

}  // namespace
}  // namespace liestat
