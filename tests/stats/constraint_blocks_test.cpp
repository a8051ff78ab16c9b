// Constraints with inequalities, alternatives and qualitative variables: what they mean, and estimates under them.

#include <stats/auto_diff.hpp>
#include <stats/constrained.hpp>
#include <stats/constraint_blocks.hpp>
#include <stats/random.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace {

using namespace liestat;

template <int N>
using Vector = Eigen::Matrix<double, N, 1>;

/// The parameter's first K coordinates are measured.
template <int N, int K>
struct Measured {
  template <class S>
  Eigen::Matrix<S, K, 1> operator()(const Eigen::Matrix<S, N, 1>& q, const Eigen::Matrix<S, K, 1>& m) const {
    return q.template head<K>() - m;
  }
};
template <int N, int K, class Constraint>
auto nearest(const Vector<N>& start, const Vector<K>& to, const Constraint& constraint) {
  const std::vector<Vector<K>> one{to};
  return constrainedEstimate(start, measurements(one, IsotropicNoise<K>(1), autoDiff(Measured<N, K>{})),
                             autoDiff(constraint));
}

const auto right_of_one = [](const auto& q) { return q[0] - 1.0; };

TEST(ConstraintBlocks, InequalitiesHoldByTheirSlacks) {
  const Vector<2> inside(3, std::sqrt(2.)), outside(0, 1);
  EXPECT_NEAR(atLeastZero(right_of_one, 1)(inside), 0, 1e-15);
  EXPECT_LT(atLeastZero(right_of_one, 1)(outside), -0.9);
  EXPECT_NEAR(aboveZero(right_of_one, 1)(Vector<2>(3, slackForAboveZero(2))), 0, 1e-15);
  EXPECT_NEAR(notZero(right_of_one, 1)(Vector<2>(-3, slackForNotZero(-4))), 0, 1e-15);
  EXPECT_NEAR(slackForAtLeastZero(2), std::sqrt(2.), 1e-15);
  for (const double c : {-5.0, -1e-9, 0.0}) {
    EXPECT_GT(slackForAtLeastZero(c), 0.01);
    EXPECT_TRUE(std::isfinite(slackForAboveZero(c)) && std::isfinite(slackForNotZero(c)));
  }
  // Negations: of c >= 0, -c > 0; twice gives the first again.
  const auto below = negation(atLeastZero(right_of_one, 1));
  EXPECT_NEAR(below(Vector<2>(-1, slackForAboveZero(2))), 0, 1e-15);
  EXPECT_NEAR(negation(below)(inside), 0, 1e-15);
  EXPECT_EQ(negation(negation(right_of_one, 1))(inside), right_of_one(inside));
}

TEST(ConstraintBlocks, NearestPointOfAHalfPlane) {
  // (x, y, λ): from inside the point itself, from outside its projection.
  for (const double x : {3.0, -2.0}) {
    const Vector<2> to(x, 5);
    const Vector<3> start(x, 5, slackForAtLeastZero(x - 1));
    const auto result = nearest<3, 2>(start, to, atLeastZero(right_of_one, 2));
    EXPECT_TRUE(result.end == ConstrainedEnd::converged || result.end == ConstrainedEnd::unobservable ||
                result.end == ConstrainedEnd::stalled)
        << name(result.end);
    EXPECT_NEAR(result.parameter[0], std::max(x, 1.0), 1e-4) << name(result.end);
    EXPECT_NEAR(result.parameter[1], 5, 1e-6);
  }
}

TEST(ConstraintBlocks, ASlackThatStartsAtZeroLeavesIt) {
  // At λ = 0 the inequality is an equation: its gradient by λ vanishes, and the border is a saddle where the
  // measurement is inside.
  const auto result = nearest<3, 2>(Vector<3>(1, 5, 0), Vector<2>(3, 5), atLeastZero(right_of_one, 2));
  EXPECT_TRUE(result.ok()) << name(result.end);
  EXPECT_NEAR(result.parameter[0], 3, 1e-6);
  EXPECT_EQ(result.active_bounds, 0);
  // Without second derivatives it is reported.
  const std::vector<Vector<2>> one{{3, 5}};
  const auto unseen =
      constrainedEstimate(Vector<3>(1, 5, 0), measurements(one, IsotropicNoise<2>(1), autoDiff(Measured<3, 2>{})),
                          autoDiff(atLeastZero(right_of_one, 2)), {.second_order = false});
  EXPECT_EQ(unseen.end, ConstrainedEnd::unobservable);
  EXPECT_FALSE(unseen.minimum_checked);
  EXPECT_EQ(unseen.unobservable, 1) << "λ";
  // What is determined has its covariance.
  EXPECT_NEAR(unseen.covariance(1, 1), 1, 1e-9);
  EXPECT_TRUE(std::isnan(unseen.covariance(2, 2)) && std::isnan(unseen.covariance(2, 1)));
}

/// y = q₀ + q₁ x at x = m₀, which is exact.
struct OnSlope {
  template <class S>
  Eigen::Matrix<S, 1, 1> operator()(const Eigen::Matrix<S, 3, 1>& q, const Eigen::Matrix<S, 2, 1>& m) const {
    return Eigen::Matrix<S, 1, 1>(m[1] - q[0] - q[1] * m[0]);
  }
};

// A slope that is at least zero, by a slack variable: half of the estimates stand on the bound where it is zero. They
// are the least-squares answers under the bound, and the region without it holds on either side.
TEST(ConstraintBlocks, ASlopeThatIsAtLeastZero) {
  const int trials = 300, n = 10;
  const double sigma = 0.1, sd = sigma / std::sqrt(n * 1.2222 / 3);
  for (const double truth : {0.0, 0.5 * sd}) {
    int active = 0, inside = 0;
    for (int t = 0; t < trials; ++t) {
      CounterRng rng(991, static_cast<std::uint64_t>(t));
      std::vector<Vector<2>> points;
      double y = 0, xx = 0, xy = 0;
      for (int i = 0; i < n; ++i) {
        const double x = -1 + 2 * i / 9.0, value = 1 + truth * x + sigma * rng.normal();
        points.emplace_back(x, value);
        y += value / n, xx += x * x, xy += x * value;
      }
      const double slope = xy / xx;
      const Eigen::Matrix2d noise = Eigen::Vector2d(0, sigma * sigma).asDiagonal();
      const auto r = constrainedEstimate(Vector<3>(y, std::max(slope, 0.), slackForAtLeastZero(slope)),
                                         measurements(points, CovarianceNoise<2>(noise), autoDiff(OnSlope{})),
                                         autoDiff(atLeastZero([](const auto& q) { return q[1]; }, 2)),
                                         {.noise = StatedNoise::trusted});
      ASSERT_TRUE(r.ok()) << t << " " << name(r.end);
      EXPECT_NEAR(r.parameter[0], y, 1e-7) << t;
      EXPECT_NEAR(r.parameter[1], std::max(slope, 0.), 1e-7) << t;
      EXPECT_TRUE(r.covariance.allFinite() && r.minimum_checked);
      EXPECT_EQ(r.active_bounds, slope < 0) << t << " " << slope;
      active += r.active_bounds;
      // Of both numbers, as without a bound.
      EXPECT_NEAR(r.covariance(1, 1), sd * sd, 1e-3 * sd * sd) << t;
      EXPECT_NEAR(r.covariance(0, 0), sigma * sigma / n, 1e-6 * sigma * sigma) << t;
      const double squared = std::pow((r.parameter[1] - truth) / sd, 2) + n * std::pow((r.parameter[0] - 1) / sigma, 2);
      inside += squared < 5.9915;
    }
    if (truth == 0) {
      EXPECT_NEAR(active, trials / 2., 4 * std::sqrt(trials / 4.));
    }
    EXPECT_GE(inside, 0.95 * trials - 4 * std::sqrt(0.0475 * trials)) << truth;
  }
}

TEST(ConstraintBlocks, NearestPointOfTwoLines) {
  const auto horizontal = [](const auto& q) { return q[1]; };
  const auto vertical = [](const auto& q) { return q[0]; };
  const auto either = disjunction(horizontal, vertical);
  // The estimate is that of the line where it starts.
  const auto below = nearest<2, 2>(Vector<2>(2, 0.1), Vector<2>(2, 0.5), either);
  ASSERT_TRUE(below.ok()) << name(below.end);
  EXPECT_NEAR((below.parameter - Vector<2>(2, 0)).norm(), 0, 1e-8);
  const auto left = nearest<2, 2>(Vector<2>(0.1, 2), Vector<2>(0.5, 2), either);
  ASSERT_TRUE(left.ok());
  EXPECT_NEAR((left.parameter - Vector<2>(0, 2)).norm(), 0, 1e-8);
  // Where both vanish the gradient does: the equation is dropped, and said to be.
  const auto crossing = nearest<2, 2>(Vector<2>(0, 0), Vector<2>(0, 0), either);
  EXPECT_EQ(crossing.dropped_constraints, 1);
  // Both at once.
  const auto corner = nearest<2, 2>(Vector<2>(2, 1), Vector<2>(2, 1), conjunction(horizontal, vertical));
  ASSERT_TRUE(corner.ok());
  EXPECT_NEAR(corner.parameter.norm(), 0, 1e-8);
}

TEST(ConstraintBlocks, ConditionsAreTheirNormalForm) {
  // If x = 0 then y = 0 else y = 1; q = (x, y, λ).
  const auto x_is_zero = [](const auto& q) { return q[0]; };
  const auto y_is_zero = [](const auto& q) { return q[1]; };
  const auto y_is_one = [](const auto& q) { return q[1] - 1.0; };
  const auto f = conditional(x_is_zero, 2, y_is_zero, y_is_one);
  EXPECT_EQ(f(Vector<3>(0, 0, 7)).norm(), 0);
  EXPECT_NEAR(f(Vector<3>(2, 1, 0.5)).norm(), 0, 1e-15);
  for (const double slack : {-3.0, 0.0, 0.5, 20.0}) {
    EXPECT_GT(f(Vector<3>(0, 1, slack)).norm(), 0.5);
    EXPECT_GT(f(Vector<3>(2, 0, slack)).norm(), 0.5);
  }
  // A conditional on an inequality: if x >= 1 then y = 0 else y = 1.
  const auto g = conditional(atLeastZero(right_of_one, 2), y_is_zero, y_is_one);
  EXPECT_NEAR(g(Vector<3>(3, 0, slackForAtLeastZero(2))).norm(), 0, 1e-14);
  EXPECT_NEAR(g(Vector<3>(-3, 1, slackForAboveZero(4))).norm(), 0, 1e-14);
  for (double slack = -4; slack <= 4; slack += 0.1) {
    EXPECT_GT(g(Vector<3>(3, 1, slack)).norm(), 0.1) << slack;
    EXPECT_GT(g(Vector<3>(-3, 0, slack)).norm(), 0.1) << slack;
  }
}

template <class Values, int N>
void checkValues() {
  const int n = N;
  for (int k = 0; k < n; ++k) {
    const auto x = Values::value(k);
    EXPECT_NEAR(Values::constraint(x).norm(), 0, 1e-12);
    EXPECT_EQ(Values::nearest(x), k);
    for (int j = 0; j < n; ++j) EXPECT_NEAR(Values::selector(x, j), j == k, 1e-12);
  }
  // No other point near by or between holds.
  CounterRng rng(4);
  for (int trial = 0; trial < 200; ++trial) {
    typename Values::Point x = Values::value(trial % n);
    for (int i = 0; i < Values::dimension; ++i) x[i] += rng.uniform(-0.4, 0.4);
    const double away = (x - Values::value(Values::nearest(x))).norm();
    if (away > 1e-3) {
      EXPECT_GT(Values::constraint(x).norm(), 1e-2 * away);
    }
    // A start is drawn to the nearest value.
    const auto result = nearest<Values::dimension, Values::dimension>(x, x, IsQualitative<Values>{0});
    if (away < 0.25) {
      ASSERT_TRUE(result.ok()) << name(result.end);
      EXPECT_NEAR((result.parameter - Values::value(trial % n)).norm(), 0, 1e-6);
    }
  }
}

TEST(ConstraintBlocks, QualitativeVariables) {
  checkValues<SortedValues<5>, 5>();
  checkValues<CyclicValues<6>, 6>();
  checkValues<EquidistantValues<3>, 3>();
  checkValues<EquidistantValues<5>, 5>();
  // How far values are from each other is what tells the three apart.
  const auto distance = [](auto a, auto b) { return (a - b).norm(); };
  for (int k = 2; k < 5; ++k) {
    using E = EquidistantValues<5>;
    EXPECT_NEAR(distance(E::value(0), E::value(1)), distance(E::value(0), E::value(k)), 1e-14);
    EXPECT_NEAR(E::value(k).norm(), 1, 1e-14);
  }
  using C = CyclicValues<6>;
  EXPECT_NEAR(distance(C::value(0), C::value(5)), distance(C::value(0), C::value(1)), 1e-14);
  EXPECT_GT(distance(SortedValues<6>::value(0), SortedValues<6>::value(5)), 4.9);
}

/// Points on the line y = a (value 0) or x = a (value 1); q = (a, s), s a sorted qualitative variable.
const auto is_height = [](const auto& q, const auto& m) { return m[1] - q[0]; };
const auto is_width = [](const auto& q, const auto& m) { return m[0] - q[0]; };

TEST(ConstraintBlocks, OneVariableSwitchesMeasurementEquations) {
  std::vector<Eigen::Vector2d> points;
  CounterRng rng(1);
  for (int i = 0; i < 30; ++i) points.emplace_back(rng.uniform(-3, 3), 2 + 0.01 * rng.normal());
  const auto equation = autoDiff(switched<SortedValues<2>>(1, is_height, is_width));
  const auto channel = measurements(points, IsotropicNoise<2>(0.01), equation);
  const auto constraint = autoDiff(IsQualitative<SortedValues<2>>{1});
  const auto height = constrainedEstimate(Eigen::Vector2d(1, 0), channel, constraint);
  ASSERT_TRUE(height.ok()) << name(height.end);
  EXPECT_NEAR(height.parameter[0], 2, 0.01);
  EXPECT_NEAR(height.parameter[1], 0, 1e-9);
  EXPECT_NEAR(height.chi2, 29, 4 * std::sqrt(2. * 29));
  // The other value is a local answer, with a cost that says what it is worth: each value is tried.
  const auto width = constrainedEstimate(Eigen::Vector2d(1, 1), channel, constraint);
  EXPECT_NEAR(width.parameter[1], 1, 1e-6);
  EXPECT_GT(width.chi2, 1000 * height.chi2);
}

TEST(ConstraintBlocks, FunctionsOfFig22) {
  // q = (x, y, λ₁, λ₂). The absolute value: y = x or y = -x, and y >= 0.
  const auto y = [](const auto& q) { return q[1]; };
  const auto absolute =
      conjunction(disjunction([](const auto& q) { return q[1] - q[0]; }, [](const auto& q) { return q[1] + q[0]; }),
                  atLeastZero(y, 2));
  // Saturation, sat(x) = -1 below -1, 1 above 1, else x (the report prints "t < 1, -1").
  const auto above = [](const auto& q) { return q[0] - 1.0; };
  const auto below = [](const auto& q) { return -1.0 - q[0]; };
  const auto saturation = disjunction(conjunction(atLeastZero(above, 2), [](const auto& q) { return q[1] - 1.0; }),
                                      conjunction(atLeastZero(below, 2), [](const auto& q) { return q[1] + 1.0; }),
                                      conjunction(atLeastZero([](const auto& q) { return 1.0 - q[0] * q[0]; }, 3),
                                                  [](const auto& q) { return q[1] - q[0]; }));
  for (double x = -3; x <= 3; x += 0.25) {
    const double size = std::abs(x), clamped = std::max(-1.0, std::min(1.0, x));
    EXPECT_NEAR(absolute(Vector<4>(x, size, std::sqrt(size), 0)).norm(), 0, 1e-14);
    const double outside = std::sqrt(std::max(0.0, size - 1)), inside = std::sqrt(std::max(0.0, 1 - x * x));
    EXPECT_NEAR(saturation(Vector<4>(x, clamped, outside, inside)).norm(), 0, 1e-13) << x;
    // No slack makes another value one of the function.
    for (double l = -2; l <= 2; l += 0.25) {
      if (size > 0.2) {
        EXPECT_GT(absolute(Vector<4>(x, -size, l, 0)).norm(), 0.1);
      }
      for (double k = -2; k <= 2; k += 0.25) {
        EXPECT_GT(saturation(Vector<4>(x, clamped + 0.7, l, k)).norm(), 1e-3) << x << " " << l << " " << k;
      }
    }
  }
  // The nearest point of the saturation's graph, on the branch where it starts.
  const auto result = nearest<4, 2>(Vector<4>(2, 1, slackForAtLeastZero(1), 0.1), Vector<2>(2, 1.3), saturation);
  EXPECT_NEAR((result.parameter.head<2>() - Vector<2>(2, 1)).norm(), 0, 1e-6) << name(result.end);
}

TEST(ConstraintBlocks, HalfWayBetweenTwoValuesTheConstraintIsDropped) {
  // The trap of the report's footnote 6: the gradient of (s - 1)(s - 2) vanishes at s = 3/2.
  const Vector<1> between(0.5);
  const auto result = nearest<1, 1>(between, between, IsQualitative<SortedValues<2>>{0});
  EXPECT_FALSE(result.ok());
  EXPECT_EQ(result.dropped_constraints, 1);
}

}  // namespace
