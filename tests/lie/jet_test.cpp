// Jets: values and slopes of every function, and derivatives of functions of Jets, by central differences and by hand.
#include <lie/jet.hpp>
#include <lie/se3.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace {

using namespace liestat;
using J1 = Jet<double, 1>;
using J2 = Jet<double, 2>;

struct Function {
  std::string name;
  std::function<double(double)> value;
  std::function<J1(const J1&)> jet;
  std::vector<double> at;
};

#define LIESTAT_FUNCTION(f, ...)                                                              \
  Function {                                                                                  \
#f, [](double x) { return std::f(x); }, [](const J1& x) { return f(x); }, { __VA_ARGS__ } \
  }

TEST(Jet, SlopesAreThoseOfTheFunctions) {
  const std::vector<Function> functions{
      LIESTAT_FUNCTION(abs, -2, 0.3),         LIESTAT_FUNCTION(sqrt, 0.2, 3),    LIESTAT_FUNCTION(cbrt, -0.2, 3),
      LIESTAT_FUNCTION(exp, -1, 2),           LIESTAT_FUNCTION(expm1, -1, 1e-3), LIESTAT_FUNCTION(log, 0.5, 4),
      LIESTAT_FUNCTION(log1p, -0.5, 1e-3, 3), LIESTAT_FUNCTION(sin, -1, 0, 2),   LIESTAT_FUNCTION(cos, -1, 0, 2),
      LIESTAT_FUNCTION(tan, -1, 0.3),         LIESTAT_FUNCTION(asin, -0.7, 0.3), LIESTAT_FUNCTION(acos, -0.7, 0.3),
      LIESTAT_FUNCTION(atan, -3, 0.3),        LIESTAT_FUNCTION(sinh, -1, 2),     LIESTAT_FUNCTION(cosh, -1, 2),
      LIESTAT_FUNCTION(tanh, -1, 2)};
  for (const Function& f : functions) {
    for (const double x : f.at) {
      const J1 y = f.jet(J1(x, 0));
      EXPECT_EQ(y.a, f.value(x)) << f.name << " at " << x;
      const double h = 1e-5, slope = (f.value(x + h) - f.value(x - h)) / (2 * h);
      EXPECT_NEAR(y.v[0], slope, 1e-9 * (1 + std::abs(slope))) << f.name << " at " << x;
    }
  }
}

TEST(Jet, FunctionsOfTwoVariables) {
  const J2 x(0.7, 0), y(-1.3, 1);
  const auto expect = [&](const J2& found, double value, double by_x, double by_y) {
    EXPECT_NEAR(found.a, value, 1e-15);
    EXPECT_NEAR(found.v[0], by_x, 1e-15);
    EXPECT_NEAR(found.v[1], by_y, 1e-15);
  };
  const double r2 = 0.7 * 0.7 + 1.3 * 1.3, r = std::sqrt(r2);
  expect(x + y, -0.6, 1, 1);
  expect(x - 2 * y, 3.3, 1, -2);
  expect(x * y, -0.91, -1.3, 0.7);
  expect(x / y, -0.7 / 1.3, -1 / 1.3, -0.7 / 1.69);
  expect(2 / x, 2 / 0.7, -2 / 0.49, 0);
  expect(atan2(y, x), std::atan2(-1.3, 0.7), 1.3 / r2, 0.7 / r2);
  expect(hypot(x, y), r, 0.7 / r, -1.3 / r);
  expect(pow(x, 3.0), 0.343, 3 * 0.49, 0);
  expect(pow(x, y), std::pow(0.7, -1.3), -1.3 * std::pow(0.7, -2.3), std::pow(0.7, -1.3) * std::log(0.7));
  expect(fmax(x, y), 0.7, 1, 0);
  expect(fmin(x, y), -1.3, 0, 1);
  J2 z = x;
  z *= y, z += 1, z /= x, z -= y;
  expect(z, 1 / 0.7, -1 / 0.49, 0);
  EXPECT_TRUE(y < x && x > y && x >= x && y <= x && x == x && x != y && x > 0.5 && 1 > x);
}

TEST(Jet, WhatIsNotFiniteIsSeen) {
  EXPECT_TRUE(isfinite(J1(1, 0)));
  EXPECT_FALSE(isfinite(sqrt(J1(0, 0))));
  EXPECT_TRUE(isnan(log(J1(-1, 0))));
  EXPECT_TRUE(isnan(J1(std::numeric_limits<double>::quiet_NaN())));
}

/// A Jet of Jets has the second derivatives: those of sin(x y) eˣ/√y, by hand.
TEST(Jet, Nested) {
  using JJ = Jet<J2, 2>;
  const double a = 0.3, b = 0.7;
  const JJ x(J2(a, 0), 0), y(J2(b, 1), 1);
  const JJ f = sin(x * y) * exp(x) / sqrt(y);
  const double s = std::sin(a * b), c = std::cos(a * b), e = std::exp(a) / std::sqrt(b);
  EXPECT_NEAR(f.a.a, s * e, 1e-15);
  EXPECT_NEAR(f.v[0].a, (b * c + s) * e, 1e-15);
  EXPECT_NEAR(f.a.v[0], (b * c + s) * e, 1e-15);
  EXPECT_NEAR(f.v[0].v[0], (-b * b * s + 2 * b * c + s) * e, 1e-14);
  const double mixed = (c - a * b * s + a * c) * e - (b * c + s) * e / (2 * b);
  EXPECT_NEAR(f.v[0].v[1], mixed, 1e-14);
  EXPECT_NEAR(f.v[1].v[0], mixed, 1e-14);
}

/// Groups over Jets: log(exp(v)) is v with its derivatives, at zero, at tiny angles and near a half-turn.
TEST(Jet, OfAGroup) {
  using J = Jet<double, 6>;
  for (const double angle : {0.0, 1e-12, 1e-6, 1e-3, 0.5, 2.0, 3.14}) {
    Eigen::Matrix<J, 6, 1> v;
    const double axis[] = {0.6, 0.0, 0.8};
    for (int i = 0; i < 6; ++i) v[i] = J(i < 3 ? 0.3 * i : angle * axis[i - 3], i);
    const Eigen::Matrix<J, 6, 1> back = SE3<J>::exp(v).log();
    for (int i = 0; i < 6; ++i) {
      EXPECT_NEAR(back[i].a, v[i].a, 1e-14) << angle;
      for (int k = 0; k < 6; ++k) EXPECT_NEAR(back[i].v[k], i == k, angle > 3 ? 1e-10 : 1e-13) << angle;
    }
    // double and Jet meet in a product.
    const SE3<J> product = SE3d() * SE3<J>::exp(v);
    EXPECT_LT((product.translation() - SE3<J>::exp(v).translation()).norm().a, 1e-15);
  }
}

}  // namespace
