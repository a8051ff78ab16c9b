// Algebraic properties on random input: rapidcheck finds the case and shrinks it. The seed is fixed, so that a run is
// repeated; RC_PARAMS in the environment replaces it.

#include <lie/lie.hpp>

#include <gtest/gtest.h>
// After gtest, whose macros it uses.
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

namespace {

using namespace liestat;

/// Before main; rapidcheck reads its configuration at the first property.
[[maybe_unused]] const bool seeded = setenv("RC_PARAMS", "seed=20 max_success=200", /*overwrite=*/0) == 0;

/// A number in [-bound, bound]; shrinks towards zero. Half of the draws go through the decades down to 1e-9.
double number(double bound) {
  const double x = *rc::gen::inRange(-1000000, 1000001) * 1e-6 * bound;
  const int decade = *rc::gen::inRange(0, 20);
  return decade < 10 ? x : x * std::pow(10, 10 - decade);
}

template <class G>
G group() {
  typename G::Tangent v;
  for (int i = 0; i < G::DoF; ++i) v[i] = number(3);
  return G::exp(v);
}

template <class M>
typename ManifoldTraits<M>::Tangent tangent(double bound) {
  typename ManifoldTraits<M>::Tangent v;
  for (int i = 0; i < v.size(); ++i) v[i] = number(bound);
  return v;
}

template <class M>
M point() {
  return ManifoldTraits<M>::expOrigin(tangent<M>(3));
}

// Numbers here are at most some tens: translations of 3 turned and added a few times.
const double tolerance = 400 * std::numeric_limits<double>::epsilon();

template <class G>
double gap(const G& a, const G& b) {
  return (a.inverse() * b).log().norm();
}

template <class G>
class Group : public testing::Test {};
using Groups = testing::Types<SO2d, SO3d, SE2d, SE3d>;
TYPED_TEST_SUITE(Group, Groups);

TYPED_TEST(Group, ProductIsAssociative) {
  EXPECT_TRUE(rc::check([] {
    const auto a = group<TypeParam>(), b = group<TypeParam>(), c = group<TypeParam>();
    RC_ASSERT(gap((a * b) * c, a * (b * c)) <= tolerance);
  }));
}
TYPED_TEST(Group, InverseReversesProducts) {
  EXPECT_TRUE(rc::check([] {
    const auto a = group<TypeParam>(), b = group<TypeParam>();
    RC_ASSERT(gap((a * b).inverse(), b.inverse() * a.inverse()) <= tolerance);
  }));
}
TYPED_TEST(Group, ExpUndoesLog) {
  EXPECT_TRUE(rc::check([] {
    const auto a = group<TypeParam>();
    RC_ASSERT(gap(TypeParam::exp(a.log()), a) <= tolerance);
  }));
}
TYPED_TEST(Group, ActionIsThatOfTheMatrix) {
  EXPECT_TRUE(rc::check([] {
    const auto a = group<TypeParam>();
    typename TypeParam::Point p;
    for (int i = 0; i < TypeParam::Dim; ++i) p[i] = number(3);
    Eigen::Matrix<double, TypeParam::N, 1> homogeneous = Eigen::Matrix<double, TypeParam::N, 1>::Ones();
    homogeneous.template head<TypeParam::Dim>() = p;
    RC_ASSERT(((a.matrix() * homogeneous).template head<TypeParam::Dim>() - a * p).norm() <= tolerance);
  }));
}
// The Jacobi identity of the bracket.
TYPED_TEST(Group, BracketSatisfiesJacobi) {
  EXPECT_TRUE(rc::check([] {
    const auto a = group<TypeParam>().log(), b = group<TypeParam>().log(), c = group<TypeParam>().log();
    const auto bracket = [](const auto& x, const auto& y) { return TypeParam::lieBracket(x, y); };
    const auto sum = (bracket(a, bracket(b, c)) + bracket(b, bracket(c, a)) + bracket(c, bracket(a, b))).eval();
    RC_ASSERT(sum.norm() <= 10 * tolerance);
  }));
}

template <class M>
class Manifold : public testing::Test {};
using Manifolds = testing::Types<Eigen::Vector3d, SO3d, S2d, Frame2d, Frame3d, SemiOrientedFrame3d, NonOrientedFrame3d>;
TYPED_TEST_SUITE(Manifold, Manifolds);

TYPED_TEST(Manifold, DistanceIsInvariant) {
  EXPECT_TRUE(rc::check([] {
    const auto f = group<typename ManifoldTraits<TypeParam>::Group>();
    const auto x = point<TypeParam>(), y = point<TypeParam>();
    RC_ASSERT(std::abs(distance(act(f, x), act(f, y)) - distance(x, y)) <= tolerance);
  }));
}
TYPED_TEST(Manifold, DistanceIsAMetric) {
  EXPECT_TRUE(rc::check([] {
    const auto x = point<TypeParam>(), y = point<TypeParam>(), z = point<TypeParam>();
    RC_ASSERT(distance(x, x) <= tolerance);
    RC_ASSERT(std::abs(distance(x, y) - distance(y, x)) <= tolerance);
    RC_ASSERT(distance(x, z) <= distance(x, y) + distance(y, z) + tolerance);
  }));
}
TYPED_TEST(Manifold, ExpUndoesLog) {
  EXPECT_TRUE(rc::check([] {
    const auto x = point<TypeParam>(), y = point<TypeParam>();
    RC_ASSERT(distance(exp(x, log(x, y)), y) <= tolerance);
  }));
}
TYPED_TEST(Manifold, LogUndoesExpNearby) {
  EXPECT_TRUE(rc::check([] {
    const auto x = point<TypeParam>();
    // Each coordinate at most 0.8: together within pi/2, the least injectivity radius.
    const auto v = tangent<TypeParam>(0.8);
    RC_ASSERT((log(x, exp(x, v)) - v).norm() <= tolerance);
  }));
}
TYPED_TEST(Manifold, InterpolationRunsBothWays) {
  EXPECT_TRUE(rc::check([] {
    const auto x = point<TypeParam>();
    const auto y = exp(x, tangent<TypeParam>(0.8));
    const double s = std::abs(number(1));
    RC_ASSERT(distance(interpolate(x, y, s), interpolate(y, x, 1 - s)) <= tolerance);
  }));
}

// Rotations are moved from either side, and inverted, without a change of distance.
RC_GTEST_PROP(Rotation, DistanceIsBiInvariant, ()) {
  const SO3d x = group<SO3d>(), y = group<SO3d>(), f = group<SO3d>();
  RC_ASSERT(std::abs(distance(x * f, y * f) - distance(x, y)) <= tolerance);
  RC_ASSERT(std::abs(distance(x.inverse(), y.inverse()) - distance(x, y)) <= tolerance);
}

template <class M>
class Quotients : public testing::Test {};
using QuotientTypes = testing::Types<SemiOrientedFrame3d, NonOrientedFrame3d>;
TYPED_TEST_SUITE(Quotients, QuotientTypes);

TYPED_TEST(Quotients, DistanceIsThatOfTheNearestFrames) {
  EXPECT_TRUE(rc::check([] {
    using T = ManifoldTraits<TypeParam>;
    const TypeParam x = point<TypeParam>(), y = point<TypeParam>();
    double nearest = std::numeric_limits<double>::infinity();
    for (const int i : T::representatives) {
      nearest = std::min(nearest, distance(Frame3d(x.se3()), Frame3d(T::representative(y, i).se3())));
      RC_ASSERT(std::abs(distance(T::representative(x, i), y) - distance(x, y)) <= tolerance);
    }
    RC_ASSERT(std::abs(distance(x, y) - nearest) <= tolerance);
  }));
}
TYPED_TEST(Quotients, RepresentativesFormAGroup) {
  EXPECT_TRUE(rc::check([] {
    using T = ManifoldTraits<TypeParam>;
    const TypeParam x = point<TypeParam>();
    for (const int i : T::representatives) {
      // A half-turn twice is a whole turn: the other quaternion of the same rotation.
      const TypeParam twice = T::representative(T::representative(x, i), i);
      RC_ASSERT(distance(Frame3d(twice.se3()), Frame3d(x.se3())) <= tolerance);
      RC_ASSERT((T::representative(x, i).translation() - x.translation()).norm() == 0);
    }
  }));
}

}  // namespace
