// The checkers themselves: a sphere with one defect at a time, each of which must be found, by name.

#include <lie/s2.hpp>
#include <lie/testing.hpp>

#include <gtest/gtest.h>

#include <limits>
#include <sstream>
#include <string>

namespace {

enum class Defect {
  none,
  placement,
  action,
  short_log,
  log_beyond_a_right_angle,
  nan_at_small_angles,
  dexp,
  dlog,
  isotropy,
  projection,
  placement_jacobian,
  hessian,
  weights
};

/// The sphere as S2 has it, but for the defect.
struct Sphere {
  liestat::S2d direction;
};
Defect defect = Defect::none;

}  // namespace

template <>
struct liestat::ManifoldTraits<Sphere> {
  using M = Sphere;
  using Base = ManifoldTraits<S2d>;
  using Group = SO3d;
  using Scalar = double;
  static constexpr int DoF = 2;
  using Tangent = Eigen::Vector2d;
  using Square = Eigen::Matrix2d;

  static double wrong(Defect d, double factor) { return defect == d ? factor : 1; }

  static M origin() { return {}; }
  static M act(const Group& f, const M& x) {
    return {Base::act(defect == Defect::action ? f.inverse() : f, x.direction)};
  }
  static Group placement(const M& x) {
    return Base::placement(x.direction) * SO3d::rotX(defect == Defect::placement ? 1e-9 : 0);
  }
  static M expOrigin(const Tangent& v) { return {Base::expOrigin(v)}; }
  static Tangent logOrigin(const M& x) {
    const Tangent v = Base::logOrigin(x.direction);
    if (defect == Defect::log_beyond_a_right_angle && x.direction.params()[2] < 0) return -v;
    if (defect == Defect::nan_at_small_angles && v.norm() > 0 && v.norm() < 1e-11) return v / 0.0 * 0.0;
    return wrong(Defect::short_log, 1 + 1e-12) * v;
  }
  static Square dexpOrigin(const Tangent& v) { return wrong(Defect::dexp, 1 + 1e-7) * Base::dexpOrigin(v); }
  static Square dlogOrigin(const M& x) {
    return defect == Defect::dlog ? Square::Identity() : Base::dlogOrigin(x.direction);
  }
  static Square isotropy(const Group& f, const M& x) {
    const Square turn = Base::isotropy(f, x.direction);
    return defect == Defect::isotropy ? Square(turn.transpose()) : turn;
  }
  static Eigen::Matrix<double, 2, 3> originProjection() {
    return wrong(Defect::projection, -1) * Base::originProjection();
  }
  static Eigen::Matrix<double, 3, 2> placementJacobian(const M& x) {
    Eigen::Matrix<double, 3, 2> J = Base::placementJacobian(x.direction);
    J.row(2) *= wrong(Defect::placement_jacobian, 0);
    return J;
  }
  static bool isPlacementSmooth(const M& x) { return Base::isPlacementSmooth(x.direction); }
  static Tangent metricWeights() { return Tangent(1, wrong(Defect::weights, 2)); }
  static double injectivityRadius() { return Base::injectivityRadius(); }
  static double maxSectionalCurvature() { return Base::maxSectionalCurvature(); }
  static Square hessianHalfSquaredDistance(const Tangent& z) {
    return defect == Defect::hessian ? Square::Identity() : Base::hessianHalfSquaredDistance(z);
  }
};

namespace {

struct Found {
  Defect defect;
  const char* invariant;  ///< one that this defect breaks
};

const Found all_found[] = {
    {Defect::placement, "act(placement(x), origin()) == x"},
    {Defect::action, "act(f, act(g, x)) == act(f * g, x)"},
    {Defect::short_log, "logOrigin(expOrigin(v)) == v"},
    {Defect::log_beyond_a_right_angle, "logOrigin(expOrigin(v)) == v"},
    {Defect::nan_at_small_angles, "expOrigin(logOrigin(x)) == x"},
    {Defect::dexp, "dexpOrigin against differences"},
    {Defect::dlog, "principalChartJacobian against differences"},
    {Defect::isotropy, "isotropy(f, x) against differences"},
    {Defect::projection, "actionTransformationJacobian against differences"},
    {Defect::placement_jacobian, "placementJacobian against differences"},
    {Defect::hessian, "hessianHalfSquaredDistance against second differences"},
    {Defect::weights, "distance(f x, f y) == distance(x, y)"},
};

TEST(ContractCheckers, FindEveryDefectByName) {
  for (const Found& found : all_found) {
    defect = found.defect;
    const liestat::ContractReport report = liestat::checkContract<Sphere>();
    defect = Defect::none;
    EXPECT_FALSE(report.ok());
    bool named = false;
    for (const liestat::ContractCheck& check : report.checks()) {
      if (check.invariant != found.invariant) continue;
      named = true;
      EXPECT_FALSE(check.ok()) << found.invariant << " did not notice";
      EXPECT_FALSE(check.input.empty());
    }
    EXPECT_TRUE(named) << found.invariant << " was not checked";
  }
}

TEST(ContractCheckers, PassWithoutADefect) {
  const liestat::ContractReport report = liestat::checkContract<Sphere>();
  EXPECT_TRUE(report.ok()) << report;
}

TEST(ContractReport, KeepsTheWorstInputOfEachInvariant) {
  liestat::ContractReport report;
  EXPECT_FALSE(report.ok()) << "nothing was checked";
  report.record("a == b", 1e-16, 1e-15, {{"x", Eigen::Vector2d(1, 2)}});
  EXPECT_TRUE(report.ok());
  report.record("a == b", 3e-15, 1e-15, {{"x", Eigen::Vector2d(3, 0.5)}});
  report.record("a == b", 2e-15, 1e-15, {{"x", Eigen::Vector2d(5, 6)}});
  report.record("c == d", 0, 0, {});
  ASSERT_EQ(report.checks().size(), 2U);
  EXPECT_FALSE(report.ok());
  EXPECT_EQ(report.checks()[0].error, 3e-15);
  EXPECT_EQ(report.checks()[0].cases, 3);
  EXPECT_EQ(report.checks()[0].input, "x = (3 0.5)");
  EXPECT_TRUE(report.checks()[1].ok());
  std::ostringstream text;
  text << report;
  EXPECT_EQ(text.str(),
            "FAILS a == b: error 3e-15 of 1e-15 allowed, 3 cases, at x = (3 0.5)\n"
            "ok    c == d: error 0 of 0 allowed, 1 cases\n");
}

TEST(ContractReport, NaNIsWorseThanEverything) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  liestat::ContractReport report;
  report.record("a == b", 7, 1, {});
  report.record("a == b", nan, 1, {{"x", Eigen::Matrix<double, 1, 1>(4)}});
  report.record("a == b", std::numeric_limits<double>::infinity(), 1, {});
  ASSERT_EQ(report.checks().size(), 1U);
  EXPECT_FALSE(report.checks()[0].ok());
  EXPECT_EQ(report.checks()[0].input, "x = (4)");
}

}  // namespace
