// The point groups, and the quotients of SO(3) by them: groups by their products, operations by brute force over
// copies.

#include <lie/crystal_orientation.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace {

using namespace liestat;
using Eigen::Vector3d;
using Traits = ManifoldTraits<CrystalOrientation>;

constexpr double pi = 3.14159265358979323846;

std::vector<PointGroup> allGroups() {
  std::vector<PointGroup> groups;
  for (const auto& row : detail::proper_point_groups) groups.push_back(*PointGroup::fromName(row.name));
  return groups;
}

SO3d element(int index) {
  const auto& q = detail::crystal_rotations[static_cast<std::size_t>(index)];
  return SO3d::fromParams({q[0], q[1], q[2], q[3]});
}

SO3d randomRotation(std::mt19937& rng) {
  std::normal_distribution<double> normal;
  return SO3d(Eigen::Quaterniond(normal(rng), normal(rng), normal(rng), normal(rng)));
}

double angleBetween(const SO3d& a, const SO3d& b) { return (a.inverse() * b).log().norm(); }

TEST(PointGroups, areGroups) {
  for (const PointGroup group : allGroups()) {
    int found = 0, pairs = 0;
    double least = 2 * pi;
    for (int i = 0; i < detail::num_crystal_rotations; ++i) {
      EXPECT_NEAR(element(i).params().norm(), 1, 1e-15);
      if (!group.contains(i)) continue;
      if (i > 0) least = std::min(least, element(i).log().norm());
      for (int j = 0; j < detail::num_crystal_rotations; ++j) {
        if (!group.contains(j)) continue;
        ++pairs;
        for (int k = 0; k < detail::num_crystal_rotations; ++k) {
          found += group.contains(k) && angleBetween(element(i) * element(j), element(k)) < 1e-7;
        }
      }
    }
    EXPECT_EQ(pairs, group.order() * group.order()) << group.name();
    EXPECT_EQ(found, pairs) << group.name() << ": each product is one element";
    EXPECT_NEAR(group.leastAngle(), least, 1e-12) << group.name();
  }
}

TEST(PointGroups, orders) {
  const std::vector<std::pair<std::string, int>> orders{{"1", 1},    {"2", 2},   {"222", 4}, {"3", 3},
                                                        {"32", 6},   {"4", 4},   {"422", 8}, {"6", 6},
                                                        {"622", 12}, {"23", 12}, {"432", 24}};
  for (const auto& [name, order] : orders) {
    ASSERT_TRUE(PointGroup::fromName(name)) << name;
    EXPECT_EQ(PointGroup::fromName(name)->order(), order) << name;
    EXPECT_EQ(PointGroup::fromName(name)->name(), name);
  }
}

/// All 32 point groups by their rotations and their Laue classes' ones.
TEST(PointGroups, ofAllThirtyTwo) {
  const std::vector<std::pair<const char*, const char*>> proper{
      {"1", "1"},      {"-1", "1"},     {"2", "2"},       {"m", "2"},   {"2/m", "2"},  {"222", "222"},
      {"mm2", "222"},  {"mmm", "222"},  {"4", "4"},       {"-4", "4"},  {"4/m", "4"},  {"422", "422"},
      {"4mm", "422"},  {"-42m", "422"}, {"4/mmm", "422"}, {"3", "3"},   {"-3", "3"},   {"32", "32"},
      {"3m", "32"},    {"-3m", "32"},   {"6", "6"},       {"-6", "6"},  {"6/m", "6"},  {"622", "622"},
      {"6mm", "622"},  {"-62m", "622"}, {"6/mmm", "622"}, {"23", "23"}, {"m-3", "23"}, {"432", "432"},
      {"-43m", "432"}, {"m-3m", "432"}};
  EXPECT_EQ(proper.size(), 32U);
  for (const auto& [name, expected] : proper) {
    ASSERT_TRUE(PointGroup::fromName(name)) << name;
    EXPECT_EQ(PointGroup::fromName(name)->name(), expected) << name;
  }
  for (const char* name : {"", "5", "532", "4 3 2", "M-3M"}) EXPECT_FALSE(PointGroup::fromName(name)) << name;
}

/// The half-turns of 32 are about a: x with x along a, and 30 degrees from x with x along a*.
TEST(PointGroups, hexagonalAxes) {
  const auto halfTurnAbout = [](PointGroup group, double degrees) {
    const SO3d turn = SO3d::exp(pi * Vector3d(std::cos(degrees * pi / 180), std::sin(degrees * pi / 180), 0));
    for (int i = 0; i < detail::num_crystal_rotations; ++i) {
      if (group.contains(i) && angleBetween(element(i), turn) < 1e-7) return true;
    }
    return false;
  };
  for (const char* name : {"32", "-3m", "3m"}) {
    const PointGroup a = *PointGroup::fromName(name);
    const PointGroup a_star = *PointGroup::fromName(name, HexagonalAxes::x_along_a_star);
    for (const double degrees : {0.0, 60.0, 120.0}) {
      EXPECT_TRUE(halfTurnAbout(a, degrees));
      EXPECT_FALSE(halfTurnAbout(a_star, degrees));
      EXPECT_TRUE(halfTurnAbout(a_star, degrees + 30));
    }
  }
  EXPECT_EQ(PointGroup::fromName("622", HexagonalAxes::x_along_a_star), PointGroup::fromName("622"));
  EXPECT_EQ(PointGroup::fromName("312", HexagonalAxes::x_along_a_star), PointGroup::fromName("32"));
}

/// Distance, log, gap and Jacobians against all copies.
TEST(CrystalOrientation, operationsAreThoseOfTheNearestCopy) {
  std::mt19937 rng(1);
  for (const PointGroup group : allGroups()) {
    for (int trial = 0; trial < 200; ++trial) {
      const CrystalOrientation x(randomRotation(rng), group), y(randomRotation(rng), group);
      std::vector<double> angles;
      for (const int k : Traits::representativesOf(x)) {
        angles.push_back(angleBetween(y.rotation(), x.rotation() * element(k)));
      }
      std::sort(angles.begin(), angles.end());
      const CrystalOrientation between_them = between(y, x);
      EXPECT_NEAR(distance(y, x), angles[0], 1e-12) << group.name();
      EXPECT_NEAR(distance(x, y), angles[0], 1e-12) << group.name();
      const double second = angles.size() > 1 ? angles[1] : 2 * pi - angles[0];
      EXPECT_NEAR(Traits::nearestRepresentative(between_them).gap(), second - angles[0], 1e-7) << group.name();
      EXPECT_LT(distance(exp(y, log(y, x)), x), 1e-7);
      EXPECT_EQ(exp(y, log(y, x)).group(), group);
      EXPECT_NEAR(angleBetween(x.nearestTo(y.rotation()), y.rotation()), angles[0], 1e-12);
      if (Traits::nearestRepresentative(between_them).gap() < 1e-3) continue;
      const auto e = errorVector(y, x);
      for (int j = 0; j < 3; ++j) {
        const Vector3d h = 1e-6 * Vector3d::Unit(j);
        const Vector3d by_x = (log(y, exp(x, h)) - log(y, exp(x, Vector3d(-h)))) / 2e-6;
        const Vector3d by_y = (log(exp(y, h), x) - log(exp(y, Vector3d(-h)), x)) / 2e-6;
        EXPECT_LT((by_x - e.by_feature.col(j)).norm(), 1e-7) << group.name();
        EXPECT_LT((by_y - e.by_base.col(j)).norm(), 1e-7) << group.name();
      }
    }
  }
}

/// A copy is the same orientation, its tangent vectors turned; the disorientation of 432 is 62.8 degrees at most.
TEST(CrystalOrientation, copiesAreOneOrientation) {
  std::mt19937 rng(2);
  double largest = 0;
  for (const PointGroup group : allGroups()) {
    for (int trial = 0; trial < 500; ++trial) {
      const CrystalOrientation x(randomRotation(rng), group), y(randomRotation(rng), group);
      const Vector3d v(0.01, -0.02, 0.015);
      for (const int k : Traits::representativesOf(x)) {
        const CrystalOrientation copy = Traits::representative(x, k);
        EXPECT_NEAR(distance(y, copy), distance(y, x), 1e-12);
        EXPECT_LT(distance(exp(copy, Vector3d(Traits::representativeJacobian(k) * v)), exp(x, v)), 1e-7);
        if (group.order() == 24) largest = std::max(largest, distance(y, copy));
      }
    }
  }
  EXPECT_GT(largest, 55 * pi / 180);
  EXPECT_LT(largest, 62.8 * pi / 180);
}

/// Bunge's matrix takes the sample's coordinates to the crystal's.
TEST(CrystalOrientation, bungesAnglesArePassive) {
  const double a = 0.4, b = 1.1, c = -0.7;
  const auto about = [](int axis, double angle) { return SO3d::exp(angle * Vector3d::Unit(axis)).matrix(); };
  const Eigen::Matrix3d g = about(2, -c) * about(0, -b) * about(2, -a);
  const CrystalOrientation x = CrystalOrientation::fromBunge(a, b, c, *PointGroup::fromName("432"));
  EXPECT_LT((x.rotation().matrix() - g.transpose()).norm(), 1e-15);
  EXPECT_LT((x.bunge() - Vector3d(a, b, c)).norm(), 1e-15);
}

}  // namespace
