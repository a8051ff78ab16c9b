// The traits of each group against its matrices: the contract checks what traits say, and cannot know what they should
// have said and do not. And what happens if trivial_isotropy is forgotten.

#include <lie/lie.hpp>
#include <lie/testing.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <type_traits>

namespace {

using namespace liestat;

/// The traits that a group has; the others it must not have.
struct Traits {
  CompactFactor compact = CompactFactor::unknown;
  bool chordal = false, twin = false, parameters = false;
};

template <class G>
constexpr bool says(const Traits& expected) {
  return detail::compactFactor<G>() == expected.compact && HasChordalMoments<G> == expected.chordal &&
         HasMetricTwin<G> == expected.twin && HasRotationParameters<G> == expected.parameters && HasTangentParts<G> &&
         detail::HasTrivialIsotropy<G>;
}
template <template <class, int> class G>
constexpr bool inBothScalars(const Traits& expected) {
  return says<G<double, 0>>(expected) && says<G<float, 0>>(expected);
}

static_assert(inBothScalars<SO2>({.compact = CompactFactor::circle, .chordal = true}));
static_assert(inBothScalars<SO3>({.compact = CompactFactor::rotation, .chordal = true, .parameters = true}));
static_assert(inBothScalars<RxSO2>({.compact = CompactFactor::circle}));
static_assert(inBothScalars<RxSO3>({.compact = CompactFactor::rotation}));
static_assert(inBothScalars<SE2>({.chordal = true, .twin = true}));
static_assert(inBothScalars<SE3>({.chordal = true, .twin = true}));
static_assert(inBothScalars<SE23>({.chordal = true}));
static_assert(inBothScalars<Sim2>({}) && inBothScalars<Sim3>({}));
// Directions are smaller than their group.
static_assert(!detail::HasTrivialIsotropy<S2d>);

template <class G>
class GroupTraits : public testing::Test {};
using Groups = testing::Types<SO2d, SO3d, RxSO2d, RxSO3d, SE2d, SE3d, SE23d, Sim2d, Sim3d>;
TYPED_TEST_SUITE(GroupTraits, Groups);

/// Each part of a tangent vector by itself, seen in the group's matrix, whose first rows and columns are s R.
TYPED_TEST(GroupTraits, TangentPartsAreWhatTheMatrixShows) {
  using G = TypeParam;
  constexpr int n =
      std::is_same_v<G, SO2d> || std::is_same_v<G, RxSO2d> || std::is_same_v<G, SE2d> || std::is_same_v<G, Sim2d> ? 2
                                                                                                                  : 3;
  constexpr double tolerance = 1e-14;
  using Block = Eigen::Matrix<double, n, n>;
  int covered = 0;
  for (const TangentBlock& part : ManifoldTraits<G>::tangent_parts) {
    EXPECT_EQ(part.begin, covered);
    covered += part.size;
    typename G::Tangent v = G::Tangent::Zero();
    for (int i = 0; i < part.size; ++i) v[part.begin + i] = 0.3 + 0.1 * i;
    const G x = G::exp(v);
    const Eigen::MatrixXd matrix = x.matrix();
    const Block linear = matrix.topLeftCorner<n, n>();
    const Eigen::MatrixXd moved = matrix.topRightCorner(n, matrix.cols() - n);
    if (part.part == TangentPart::rotation) {
      EXPECT_LE((linear * linear.transpose() - Block::Identity()).norm(), tolerance);
      EXPECT_NEAR(linear.determinant(), 1, tolerance);
      // 1 + 2 cos θ in space, 2 cos θ in the plane.
      EXPECT_NEAR(linear.trace(), n - 2 + 2 * std::cos(v.norm()), tolerance);
    } else {
      const double scale = part.part == TangentPart::log_scale ? std::exp(0.3) : 1;
      EXPECT_LE((linear - scale * Block::Identity()).norm(), tolerance) << name(part.part);
    }
    if (part.part == TangentPart::rotation || part.part == TangentPart::log_scale) {
      EXPECT_EQ(moved.norm(), 0) << name(part.part);
      continue;
    }
    const auto expected = v.segment(part.begin, part.size).eval();
    EXPECT_NEAR(moved.norm(), expected.norm(), tolerance) << name(part.part);
    if constexpr (requires { x.velocity(); }) {
      if (part.part == TangentPart::velocity) {
        EXPECT_LE((x.velocity() - expected).norm(), tolerance);
      }
    }
    if constexpr (requires { x.translation(); }) {
      if (part.part == TangentPart::translation) {
        EXPECT_LE((x.translation() - expected).norm(), tolerance);
      }
    }
  }
  EXPECT_EQ(covered, G::DoF);
}

/// A rotation whose tangent vectors name the group's axes in another order. It defines originProjection and
/// placementJacobian again, and what it must say of that may be forgotten.
template <bool forgotten>
struct Reordered {
  SO3d rotation;
};

}  // namespace

template <bool forgotten>
struct liestat::ManifoldTraits<Reordered<forgotten>> : TrivialIsotropy<Reordered<forgotten>, SO3d> {
  using M = Reordered<forgotten>;
  using Tangent = Eigen::Vector3d;
  using Square = Eigen::Matrix3d;
  static constexpr bool trivial_isotropy = forgotten;
  static M act(const SO3d& f, const M& x) { return {f * x.rotation}; }
  static SO3d placement(const M& x) { return x.rotation; }
  static Square axes() { return (Square() << 0, 0, 1, 1, 0, 0, 0, 1, 0).finished(); }
  static M expOrigin(const Tangent& v) { return {SO3d::exp(axes() * v)}; }
  static Tangent logOrigin(const M& x) { return axes().transpose() * x.rotation.log(); }
  static Square dexpOrigin(const Tangent& v) { return axes().transpose() * SO3d::rightJacobian(axes() * v) * axes(); }
  static Square dlogOrigin(const M& x) {
    return axes().transpose() * SO3d::rightJacobianInverse(x.rotation.log()) * axes();
  }
  static Square originProjection() { return axes().transpose(); }
  static Square placementJacobian(const M&) { return axes(); }
};

namespace {

TEST(ContractCheckers, FindAForgottenTrivialIsotropy) {
  const ContractReport told = checkContract<Reordered<false>>();
  EXPECT_TRUE(told.ok()) << told;
  const ContractReport report = checkContract<Reordered<true>>();
  bool found = false;
  for (const ContractCheck& check : report.checks()) {
    if (check.invariant == "actionTransformationJacobian against differences") found = !check.ok();
  }
  EXPECT_TRUE(found) << report;
}

}  // namespace
