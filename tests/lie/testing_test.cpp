// The checkers themselves: a sphere with one defect at a time, each of which must be found, by name; and records of
// operations of which each in turn is a little wrong.

#include <lie/product.hpp>
#include <lie/rn.hpp>
#include <lie/s2.hpp>
#include <lie/se2.hpp>
#include <lie/se3.hpp>
#include <lie/semi_oriented_frame3.hpp>
#include <lie/so3.hpp>
#include <lie/testing.hpp>

#include <support/turned_s2.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

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

using Operations = liestat::ManifoldOperations;

// Values of a wrong operation of each kind: a little too much, or a place a little aside.
Eigen::MatrixXd spoilt(const Operations&, const Eigen::MatrixXd& m) {
  return m + Eigen::MatrixXd::Constant(m.rows(), m.cols(), 1e-4);
}
Eigen::VectorXd spoilt(const Operations&, const Eigen::VectorXd& v) {
  return v + Eigen::VectorXd::Constant(v.size(), 1e-4);
}
double spoilt(const Operations&, double x) { return 1.001 * x; }
Operations::Point spoilt(const Operations& good, const Operations::Point& x) {
  return good.exp(x, Eigen::VectorXd::Constant(good.dimension, 1e-4));
}
Operations::Element spoilt(const Operations& good, const Operations::Element& f) {
  return good.group.product(f, good.group.exp(Eigen::VectorXd::Constant(good.group.dimension, 1e-4)));
}

std::vector<Operations::Point> spoilt(const Operations& good, std::vector<Operations::Point> points) {
  for (Operations::Point& x : points) x = spoilt(good, x);
  return points;
}

/// The record with one operation spoilt must fail, and did not before.
template <class Owner, class Result, class... Arguments>
void expectFound(const Operations& good, Owner& (*owner)(Operations&),
                 std::function<Result(const Arguments&...)> Owner::*operation, const char* name) {
  Operations bad = good;
  const std::function<Result(const Arguments&...)> right = owner(bad).*operation;
  ASSERT_TRUE(right) << name << " is not in the record";
  owner(bad).*operation = [&](const Arguments&... arguments) { return Result(spoilt(good, right(arguments...))); };
  liestat::ContractOptions few;
  few.samples = 1;
  EXPECT_TRUE(liestat::checkContract(good, few).ok()) << name;
  EXPECT_FALSE(liestat::checkContract(bad, few).ok()) << name << " is wrong, and nothing noticed";
}

#define EXPECT_FOUND(record, name) \
  expectFound(                     \
      record, +[](Operations& m) -> Operations& { return m; }, &Operations::name, #name)
#define EXPECT_FOUND_IN_GROUP(record, name) \
  expectFound(                              \
      record, +[](Operations& m) -> Operations::Group& { return m.group; }, &Operations::Group::name, "group." #name)
#define EXPECT_FOUND_IN_STATISTICS(record, name)                                                                     \
  expectFound(                                                                                                       \
      record, +[](Operations& m) -> Operations::Statistics& { return m.statistics; }, &Operations::Statistics::name, \
      "statistics." #name)

TEST(ContractCheckers, FindEachOperationOfAGroup) {
  const Operations se2 = liestat::operationsOf<liestat::SE2d>();
  EXPECT_FOUND_IN_GROUP(se2, identity);
  EXPECT_FOUND_IN_GROUP(se2, product);
  EXPECT_FOUND_IN_GROUP(se2, inverse);
  EXPECT_FOUND_IN_GROUP(se2, exp);
  EXPECT_FOUND_IN_GROUP(se2, log);
  EXPECT_FOUND_IN_GROUP(se2, Adj);
  EXPECT_FOUND_IN_GROUP(se2, leftJacobian);
  EXPECT_FOUND_IN_GROUP(se2, leftJacobianInverse);
  EXPECT_FOUND_IN_GROUP(se2, rightJacobian);
  EXPECT_FOUND_IN_GROUP(se2, rightJacobianInverse);
  EXPECT_FOUND_IN_GROUP(se2, ad);
  EXPECT_FOUND_IN_GROUP(se2, matrix);
  EXPECT_FOUND_IN_GROUP(se2, hat);
  EXPECT_FOUND_IN_GROUP(se2, vee);
}

TEST(ContractCheckers, FindEachOperationOfAManifold) {
  // A placement that does not carry frames in parallel, so that transvection matters.
  const Operations sphere = liestat::operationsOf<liestat_test::TurnedS2<double>>();
  EXPECT_FOUND(sphere, origin);
  EXPECT_FOUND(sphere, act);
  EXPECT_FOUND(sphere, placement);
  EXPECT_FOUND(sphere, expOrigin);
  EXPECT_FOUND(sphere, logOrigin);
  EXPECT_FOUND(sphere, dexpOrigin);
  EXPECT_FOUND(sphere, dlogOrigin);
  EXPECT_FOUND(sphere, isotropy);
  EXPECT_FOUND(sphere, originProjection);
  EXPECT_FOUND(sphere, placementJacobian);
  EXPECT_FOUND(sphere, exp);
  EXPECT_FOUND(sphere, log);
  EXPECT_FOUND(sphere, actionFeatureJacobian);
  EXPECT_FOUND(sphere, actionTransformationJacobian);
  EXPECT_FOUND(sphere, principalChartJacobian);
  EXPECT_FOUND(sphere, logBaseJacobian);
  EXPECT_FOUND(sphere, frameTransport);
  EXPECT_FOUND(sphere, errorVector);
  EXPECT_FOUND(sphere, errorByFeature);
  EXPECT_FOUND(sphere, errorByBase);
  EXPECT_FOUND(sphere, metricWeights);
  EXPECT_FOUND(sphere, hessianHalfSquaredDistance);
  EXPECT_FOUND(sphere, distance);
}

TEST(ContractCheckers, FindEachOperationOfAQuotient) {
  const Operations frame = liestat::operationsOf<liestat::SemiOrientedFrame3d>();
  EXPECT_FOUND(frame, representative);
  EXPECT_FOUND(frame, representativeGap);
  EXPECT_FOUND(frame, representativeJacobian);
  EXPECT_FOUND(frame, dlogFeatureTransposed);
  EXPECT_FOUND(frame, dlogBaseTransposed);
}

TEST(ContractCheckers, FindEachTraitOfStatistics) {
  const Operations rotation = liestat::operationsOf<liestat::SO3d>(), motion = liestat::operationsOf<liestat::SE3d>();
  EXPECT_FOUND_IN_STATISTICS(rotation, compactCoordinates);
  EXPECT_FOUND_IN_STATISTICS(rotation, chordalMean);
  EXPECT_FOUND_IN_STATISTICS(rotation, parameters);
  EXPECT_FOUND_IN_STATISTICS(motion, throughMetricTwin);
  const Operations product = liestat::operationsOf<liestat::Product<liestat::SO3d, Eigen::Vector3d>>();
  EXPECT_FOUND_IN_STATISTICS(product, throughFactors);
  EXPECT_FOUND_IN_STATISTICS(product, factorDistances);
}

TEST(ContractCheckers, FindWrongNumbersOfStatistics) {
  const Operations frame = liestat::operationsOf<liestat::SemiOrientedFrame3d>();
  liestat::ContractOptions few;
  few.samples = 1;
  ASSERT_TRUE(liestat::checkContract(frame, few).ok());
  const auto expectFound = [&](const char* what, const auto& spoil) {
    Operations bad = frame;
    spoil(bad.statistics);
    EXPECT_FALSE(liestat::checkContract(bad, few).ok()) << what;
  };
  expectFound("compact_begin", [](auto& s) { s.compact_begin = 0; });
  expectFound("a part is missing", [](auto& s) { s.tangent_parts.pop_back(); });
  expectFound("parts overlap", [](auto& s) { s.tangent_parts[1].begin = 2; });
  expectFound("compact_factor", [](auto& s) { s.compact_factor = liestat::CompactFactor::sphere; });
  expectFound("compact_begin beyond the tangent", [](auto& s) { s.compact_begin = 4; });
  expectFound("lengths for angles", [](auto& s) { std::swap(s.tangent_parts[0].part, s.tangent_parts[1].part); });
}

// A member that skips a check, or bounds the inputs of all, must not be able to do so unseen.
TEST(ContractCheckers, FindWhatWouldSkipThem) {
  liestat::ContractOptions few;
  few.samples = 1;
  Operations sphere = liestat::operationsOf<liestat_test::TurnedS2<double>>();
  ASSERT_TRUE(liestat::checkContract(sphere, few).ok());
  const auto is_smooth = sphere.isPlacementSmooth;
  sphere.isPlacementSmooth = [](const Operations::Point&) { return false; };
  EXPECT_FALSE(liestat::checkContract(sphere, few).ok()) << "isPlacementSmooth: nowhere";
  sphere.isPlacementSmooth = is_smooth;
  const double infinity = std::numeric_limits<double>::infinity();
  const double half_turn = static_cast<double>(EIGEN_PI);
  for (const double radius : {0.5 * half_turn, 0.9 * half_turn, 1.1 * half_turn, infinity}) {
    sphere.injectivityRadius = [radius] { return radius; };
    EXPECT_FALSE(liestat::checkContract(sphere, few).ok()) << "injectivityRadius " << radius;
  }
  Operations plane = liestat::operationsOf<Eigen::Vector2d>();
  ASSERT_TRUE(liestat::checkContract(plane, few).ok());
  plane.injectivityRadius = [half_turn] { return half_turn; };
  EXPECT_FALSE(liestat::checkContract(plane, few).ok()) << "injectivityRadius of the plane";
}

/// The sphere with a transvection that does not carry frames in parallel.
struct Twisted : liestat_test::TurnedS2<double> {};

}  // namespace

template <>
struct liestat::ManifoldTraits<Twisted> : ManifoldTraits<liestat_test::TurnedS2<double>> {
  using Base = ManifoldTraits<liestat_test::TurnedS2<double>>;
  static Twisted origin() { return {}; }
  static Twisted act(const Group& f, const Twisted& x) { return {Base::act(f, x)}; }
  static Twisted expOrigin(const Tangent& v) { return {Base::expOrigin(v)}; }
  static Group transvection(const Twisted& x) { return Base::placement(x); }
};

namespace {

TEST(ContractCheckers, FindAWrongTransvection) {
  const liestat::ContractReport report = liestat::checkContract<Twisted>();
  const auto failed = std::count_if(report.checks().begin(), report.checks().end(),
                                    [](const liestat::ContractCheck& check) { return !check.ok(); });
  EXPECT_GE(failed, 1) << report;
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
