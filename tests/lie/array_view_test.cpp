// Views of arrays, and estimators over them.
#include <lie/array_view.hpp>
#include <lie/frame3.hpp>
#include <lie/rn.hpp>
#include <lie/se3.hpp>
#include <lie/so3.hpp>
#include <stats/covariance.hpp>
#include <stats/mean.hpp>

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <random>
#include <ranges>
#include <span>
#include <vector>

namespace liestat {
namespace {

struct Row {
  double time = 0;
  SE3d pose;
  Eigen::Vector3d accelerations;
  std::int64_t id = 0;
};

std::vector<Row> rows(std::size_t n) {
  std::mt19937_64 engine(3);
  std::normal_distribution<double> gauss;
  std::vector<Row> list(n);
  for (std::size_t i = 0; i < n; ++i) {
    const SE3d::Tangent v = SE3d::Tangent::NullaryExpr([&] { return 0.3 * gauss(engine); });
    list[i] = {static_cast<double>(i), SE3d::exp(v), v.head<3>(), static_cast<std::int64_t>(i)};
  }
  return list;
}

template <class T>
void expectShape(const ArrayView<T>& view, std::size_t size, std::size_t components) {
  EXPECT_EQ(view.size(), size);
  EXPECT_EQ(view.components(), components);
}

TEST(ArrayView, shows_elements_where_they_are) {
  std::vector<SE3d> poses(3);
  poses[2].translation() << 1, 2, 3;
  ArrayView<double> view(poses);
  expectShape(view, 3, 7);
  EXPECT_EQ(&view(2, 5), poses[2].data() + 5);
  view(1, 4) = 8;
  EXPECT_EQ(poses[1].translation()[0], 8);
  const ArrayView<const double> read(view), span(std::span<const SE3d>(poses.data() + 1, 2));
  EXPECT_EQ(read(2, 6), 3);
  EXPECT_EQ(span(1, 6), 3);
  EXPECT_EQ(&view.subview(1, 2)(1, 5), &view(2, 5));
  expectShape(view.subview(3, 0), 0, 7);
  expectShape(ArrayView<double>(poses[0]), 1, 7);
  std::vector<SE3d> none;
  EXPECT_EQ(ArrayView<double>(none).size(), 0u);

  std::vector<Eigen::Quaternionf> q(4);
  expectShape(ArrayView<float>(q), 4, 4);
  std::vector<double> angles(5);
  expectShape(ArrayView<double>(angles), 5, 1);
  std::array<std::array<double, 3>, 2> points{};
  expectShape(ArrayView<double>(points), 2, 3);
  std::array<double, 3> point{};
  expectShape(ArrayView<double>(point), 1, 3);
  std::vector<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> by_rows(2);
  EXPECT_TRUE(ArrayView<double>(by_rows).hasRows());
  std::vector<Eigen::Matrix3d> by_columns(2);
  EXPECT_FALSE(ArrayView<double>(by_columns).hasRows());

  static_assert(!std::is_constructible_v<ArrayView<double>, const std::vector<SE3d>&>);
  static_assert(!std::is_constructible_v<ArrayView<double>, std::vector<SE3d>>);
  static_assert(!std::is_constructible_v<ArrayView<double>, std::vector<SE3f>&>);
  static_assert(!std::is_constructible_v<ArrayView<double>, Eigen::MatrixXd&>);
  static_assert(!std::is_constructible_v<ArrayView<double>, Eigen::Matrix<double, 4, -1>>);
}

TEST(ArrayView, shows_matrices_of_either_order) {
  Eigen::Matrix<double, 4, Eigen::Dynamic> columns(4, 6);
  Eigen::Matrix<double, Eigen::Dynamic, 4> tall(6, 4);
  Eigen::Matrix<double, Eigen::Dynamic, 4, Eigen::RowMajor> tall_by_rows(6, 4);
  for (int i = 0; i < 6; ++i) {
    for (int c = 0; c < 4; ++c) columns(c, i) = tall(i, c) = tall_by_rows(i, c) = 10 * i + c;
  }
  Eigen::MatrixXd any = tall;
  const Eigen::Map<const Eigen::MatrixXd> map(any.data(), 6, 4);
  const ArrayView<const double> views[] = {columns,     tall,        tall_by_rows,
                                           rowsOf(any), rowsOf(map), ArrayView<const double>(any.data(), 6, 1, 6, 4)};
  for (const auto& view : views) {
    expectShape(view, 6, 4);
    for (std::size_t i = 0; i < 6; ++i) {
      for (std::size_t c = 0; c < 4; ++c) EXPECT_EQ(view(i, c), static_cast<double>(10 * i + c));
    }
  }
  expectShape(ArrayView<const double>(columnsOf(any)), 4, 6);
  expectShape(ArrayView<double>(columns.middleCols(1, 3)), 3, 4);
  EXPECT_EQ(ArrayView<double>(columns.middleCols(1, 3))(0, 2), 12);
}

TEST(ArrayView, shows_a_member_of_structs) {
  std::vector<Row> list = rows(5);
  const auto view = memberOf(list, &Row::pose);
  static_assert(std::is_same_v<decltype(view), const ArrayView<double>>);
  expectShape(view, 5, 7);
  EXPECT_EQ(&view(3, 1), list[3].pose.data() + 1);
  const std::vector<Row>& read = list;
  static_assert(std::is_same_v<decltype(memberOf(read, &Row::pose)), ArrayView<const double>>);
  const auto times = memberOf(read, &Row::time);
  expectShape(times, 5, 1);
  EXPECT_EQ(times(4, 0), 4);
  EXPECT_EQ(memberOf(std::span(list).first(0), &Row::pose).size(), 0u);
  EXPECT_EQ(memberOf(list, [](Row& row) -> Eigen::Vector3d& { return row.accelerations; })(2, 1),
            list[2].accelerations[1]);
}

static_assert(std::ranges::random_access_range<Strided<SO3d>> && std::ranges::sized_range<Strided<SO3d>>);
static_assert(SampleRange<Strided<Frame3d>>);

// A Strided goes through mean() as itself: nothing is copied.
static_assert(std::is_same_v<decltype(detail::asSamples(std::declval<const Strided<SO3d>&>())), Strided<SO3d>>);
static_assert(std::is_same_v<decltype(detail::asSamples(std::declval<Strided<SO3d>&>())), Strided<SO3d>>);

template <class M>
void compareMeans(const std::vector<Row>& list) {
  const Strided<M> strided(memberOf(list, &Row::pose));
  std::vector<M> copies;
  for (const M& x : strided) copies.push_back(x);
  ASSERT_EQ(copies.size(), list.size());
  EXPECT_EQ(strided[3].params(), copies[3].params());
  EXPECT_EQ((*(strided.end() - 2)).params(), copies[copies.size() - 2].params());
  const auto a = mean(strided), b = mean(copies);
  EXPECT_EQ(a.mean.params(), b.mean.params());
  EXPECT_EQ(covarianceFromResiduals(a), covarianceFromResiduals(b));
  EXPECT_TRUE(converged(a.status));
  const std::vector<double> weights(list.size(), 2.0);
  EXPECT_EQ(mean(strided, weights).mean.params(), mean(copies, weights).mean.params());
}
TEST(Strided, has_the_mean_of_its_elements) {
  const std::vector<Row> list = rows(1500);
  compareMeans<Frame3d>(list);
  // The rotations within the poses.
  const ArrayView<const double> poses = memberOf(list, &Row::pose);
  const Strided<SO3d> rotations(ArrayView<const double>(poses.layout().data, poses.size(), poses.layout().element));
  std::vector<SO3d> copies;
  for (const Row& row : list) copies.push_back(row.pose.so3());
  EXPECT_EQ(mean(rotations).mean.params(), mean(copies).mean.params());
  // And points, which have no kernel for rotations.
  const auto points = mean(Strided<Eigen::Vector3d>(memberOf(list, &Row::accelerations)));
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Row& row : list) sum += row.accelerations;
  EXPECT_LE((points.mean - sum / 1500).norm(), 1e-14);
}

}  // namespace
}  // namespace liestat
