// Accuracy of the groups with a scale, over decades of the scale from 1e-6 to 1e6 and near one, at every decade of the
// angle. The bar: 32 eps, relative where the result is larger than one; the exponential of RxSO2 and RxSO3, which may
// be small as a whole, relative to its size.

#include <support/high_precision.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace {

using namespace liestat_test;

template <class G>
void sweep(const char* name, int translation) {
  using S = typename G::Scalar;
  const Table worst = sweepScaledGroup<G>(translation);
  print(name, is_float<S> ? "float" : "double", worst);
  const double bar = 32 * static_cast<double>(std::numeric_limits<S>::epsilon());
  for (const auto& [operation, w] : worst) {
    EXPECT_LE(w.error, bar) << name << (is_float<S> ? " float " : " double ") << operation << " at angle " << w.angle;
  }
}

TEST(AccuracyScaled, RxSO2) { sweep<liestat::RxSO2d>("RxSO2", 0), sweep<liestat::RxSO2f>("RxSO2", 0); }
TEST(AccuracyScaled, RxSO3) { sweep<liestat::RxSO3d>("RxSO3", 0), sweep<liestat::RxSO3f>("RxSO3", 0); }
TEST(AccuracyScaled, Sim2) { sweep<liestat::Sim2d>("Sim2", 2), sweep<liestat::Sim2f>("Sim2", 2); }
TEST(AccuracyScaled, Sim3) { sweep<liestat::Sim3d>("Sim3", 3), sweep<liestat::Sim3f>("Sim3", 3); }

// Beyond the admitted scales products and exponentials stop at their ends, in either direction, and come back.
template <class G>
void checkSaturation() {
  using S = typename G::Scalar;
  const double least = is_float<S> ? 1e-5 : 1e-10, some = 4e-6;
  const auto scaled = [](double sigma) {
    typename G::Tangent v = G::Tangent::Constant(S(0.3));
    v[G::DoF - 1] = static_cast<S>(sigma);
    return G::exp(v);
  };
  EXPECT_NEAR(static_cast<double>(scaled(-100).scale()) / least, 1, 8 * some);
  EXPECT_NEAR(static_cast<double>(scaled(100).scale()) * least, 1, 8 * some);
  G x = scaled(-8), y = scaled(8);
  for (int i = 0; i < 5; ++i) {
    x *= x, y *= y;
    EXPECT_GE(static_cast<double>(x.scale()), least);
    EXPECT_LE(static_cast<double>(y.scale()), 1 / least);
  }
  EXPECT_NEAR(static_cast<double>(x.scale()) / least, 1, some);
  EXPECT_NEAR(static_cast<double>(y.scale()) * least, 1, some);
  EXPECT_NEAR(static_cast<double>((x * y).scale()), 1, some);
  // The rotation is not touched: 32 times that of the factors.
  EXPECT_LE((x.rotationMatrix() - y.rotationMatrix()).norm(), S(some));
  typename G::Tangent zero = G::Tangent::Zero();
  zero[G::DoF - 1] = std::numeric_limits<S>::quiet_NaN();
  EXPECT_TRUE(std::isnan(static_cast<double>(G::exp(zero).scale())));
}
TEST(Saturation, StopsAtTheEndsOfTheRange) {
  checkSaturation<liestat::RxSO2d>(), checkSaturation<liestat::RxSO2f>();
  checkSaturation<liestat::RxSO3d>(), checkSaturation<liestat::RxSO3f>();
  checkSaturation<liestat::Sim2d>(), checkSaturation<liestat::Sim2f>();
  checkSaturation<liestat::Sim3d>(), checkSaturation<liestat::Sim3f>();
}

}  // namespace
