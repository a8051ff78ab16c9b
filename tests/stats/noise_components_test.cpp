// The components of pose errors that carry noise: what is left out, and what must stay.

#include <stats/noise_components.hpp>
#include <stats/random.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace liestat {
namespace {

using Vector6 = NoiseComponents::Vector6;
using Matrix6 = NoiseComponents::Matrix6;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// Rows with errors of varying covariance in all components, as `change` leaves them.
NoiseComponents componentsOf(const std::function<void(std::size_t, Vector6&, Matrix6&)>& change, std::size_t n = 20) {
  CounterRng rng(5);
  NoiseComponentScan scan;
  for (std::size_t i = 0; i < n; ++i) {
    const double scale = 1 + 0.1 * static_cast<double>(i);
    Matrix6 C = 0.01 * scale * Matrix6::Identity();
    C(0, 1) = C(1, 0) = 0.002;
    Vector6 e = 0.1 * std::sqrt(scale) * rng.normalVector<6>();
    change(i, e, C);
    scan.add(e, C, 10);
  }
  return scan.components();
}
/// z, roll and pitch have this variance.
auto filled(double variance, double error) {
  return [=](std::size_t, Vector6& e, Matrix6& C) {
    for (const int k : {2, 3, 4}) {
      if (error == 0) e[k] = 0;
      C.row(k).setZero(), C.col(k).setZero(), C(k, k) = variance;
      if (std::isnan(variance)) C.row(k).setConstant(nan), C.col(k).setConstant(nan);
    }
  };
}

TEST(NoiseComponents, AllAreJudgedWhereAllCarryNoise) {
  const NoiseComponents all = componentsOf([](std::size_t, Vector6&, Matrix6&) {});
  EXPECT_FALSE(all.omits());
  EXPECT_EQ(all.judged(), "x, y, z, rotation x, rotation y, rotation z");
  EXPECT_TRUE(all.omissions().empty());
  // A matrix that is the same in every row keeps all, whatever its numbers; an error that is tiny is an error.
  EXPECT_FALSE(
      componentsOf([](std::size_t, Vector6&, Matrix6& C) { C = 0.01 * Matrix6::Identity(), C(2, 2) = 1e-6; }).omits());
  EXPECT_FALSE(componentsOf([](std::size_t, Vector6& e, Matrix6&) { e[2] *= 1e-5; }).omits());
  // Too few rows, or errors that are all zero, decide nothing.
  EXPECT_FALSE(componentsOf(filled(1e-6, 0), 9).omits());
  EXPECT_FALSE(componentsOf([](std::size_t, Vector6& e, Matrix6&) { e.setZero(); }).omits());
  EXPECT_FALSE(NoiseComponentScan().components().omits());
}

TEST(NoiseComponents, FillersAreLeftOutAndNamed) {
  const auto sentence = [](double variance, double error) {
    const NoiseComponents c = componentsOf(filled(variance, error));
    EXPECT_EQ(c.judged(), "x, y, rotation z");
    EXPECT_EQ(c.count(), 3);
    EXPECT_EQ(c.count(0, 3), 2);
    return c.omissions().empty() ? std::string() : c.omissions()[0];
  };
  const std::string who = "not judged: z, rotation x, rotation y ";
  for (const double variance : {0.0, 1e-9, 1e-6, 0.5, 1e6, 1e308, nan}) {
    EXPECT_EQ(sentence(variance, 0), who + "(errors are zero in every row)") << variance;
  }
  EXPECT_EQ(sentence(1e-6, 1), who + "(the variance is 1e-06 in every row, while others vary)");
  for (const double variance : {-1.0, 0.0, 999.0, 1e3, 99999.0, 1e6, 1e308}) {
    EXPECT_EQ(sentence(variance, 1),
              who + "(the variance is " + significant(variance) + " in every row, which stands for unknown)");
  }
  EXPECT_EQ(sentence(nan, 1), who + "(the variance is unknown in every row)");
  // A sentinel is one in a matrix that is the same in every row, too; 998 is none.
  const auto constant = [](double variance) {
    return componentsOf([=](std::size_t i, Vector6& e, Matrix6& C) {
      C = 0.01 * Matrix6::Identity();
      filled(variance, 1)(i, e, C);
    });
  };
  EXPECT_EQ(constant(1e6).count(), 3);
  EXPECT_EQ(constant(998).count(), 6);
}

TEST(NoiseComponents, WhatVariesOrIsTouchedStays) {
  const auto kept = [](const std::function<void(std::size_t, Matrix6&)>& change) {
    return componentsOf([&](std::size_t i, Vector6& e, Matrix6& C) { filled(1e-3, 1)(i, e, C), change(i, C); })
        .keeps(2);
  };
  EXPECT_FALSE(kept([](std::size_t, Matrix6&) {}));
  EXPECT_FALSE(kept([](std::size_t, Matrix6& C) { C(2, 2) *= 1 + 1e-13; }));
  EXPECT_TRUE(kept([](std::size_t i, Matrix6& C) { C(2, 2) *= i == 7 ? 1.001 : 1; }));
  EXPECT_TRUE(kept([](std::size_t i, Matrix6& C) { C(2, 0) = C(0, 2) = i == 7 ? 1e-5 : 0; }));
  EXPECT_TRUE(kept([](std::size_t i, Matrix6& C) {
    if (i == 7) C(2, 0) = C(0, 2) = nan;
  }));
  EXPECT_TRUE(kept([](std::size_t i, Matrix6& C) {
    if (i == 7) C(2, 2) = nan;
  }));
}

TEST(NoiseComponents, ReducedToTheMarginal) {
  NoiseComponents c;
  c.roles[2] = ComponentRole::no_error;
  Vector6 e = Vector6::Ones();
  Matrix6 C = Matrix6::Constant(0.5) + Matrix6::Identity();
  c.reduce(e, C);
  EXPECT_EQ(e, (Vector6() << 1, 1, 0, 1, 1, 1).finished());
  for (int k = 0; k < 6; ++k) EXPECT_EQ(C(2, k), k == 2);
  EXPECT_EQ(C(0, 1), 0.5);
  EXPECT_EQ(std::string(name(ComponentRole::filler)), "filler");
}

}  // namespace
}  // namespace liestat
