// The residual of a preintegrated motion through ceres::Jet agrees with its analytic derivatives.

#include <fusion/imu/factor.hpp>

#include <ceres/jet.h>
#include <gtest/gtest.h>

namespace {

using namespace liestat;
using Vector3 = Eigen::Vector3d;

TEST(PreintegrationFactor, DerivativesByJets) {
  using Jet = ceres::Jet<double, 27>;
  Preintegration<double> motion({.bias = {Vector3(0.01, 0, 0.02), Vector3(0.1, 0.2, 0)}});
  for (int i = 0; i < 30; ++i) motion.add(0.01, Vector3(1, 0.1 * i, -0.5), Vector3(0.1 * i, -1, 9));
  const SE23d first(SO3d::exp({0.3, -1, 2}), Vector3(1, 2, 3), Vector3(-1, 0.5, 2));
  const SE23d second(SO3d::exp({0.9, -0.5, 1}), Vector3(2, 1, 2), Vector3(0, 0.5, 1));
  const ImuBias<double> bias{Vector3(0.02, 0.01, 0), Vector3(0, 0.1, 0.3)};
  const Vector3 gravity(0.2, 0.1, -9.8);

  const auto seeded = [](const auto& v, int first_index) {
    Eigen::Matrix<Jet, std::remove_cvref_t<decltype(v)>::RowsAtCompileTime, 1> x;
    for (int i = 0; i < x.size(); ++i) x[i] = Jet(v[i], first_index + i);
    return x;
  };
  const Eigen::Matrix<double, 9, 1> zero = Eigen::Matrix<double, 9, 1>::Zero();
  const ImuBias<Jet> jet_bias{seeded(bias.gyroscope, 18), seeded(bias.accelerometer, 21)};
  const auto error = preintegrationError<Jet>(motion, SE23<Jet>(first.cast<Jet>() * SE23<Jet>::exp(seeded(zero, 0))),
                                              SE23<Jet>(second.cast<Jet>() * SE23<Jet>::exp(seeded(zero, 9))), jet_bias,
                                              seeded(gravity, 24));
  const auto r = preintegrationResidual(motion, first, second, bias, gravity);
  Eigen::Matrix<double, 9, 27> analytic;
  analytic << r.by_first, r.by_second, r.by_bias, r.by_gravity;
  for (int i = 0; i < 9; ++i) {
    EXPECT_NEAR(error[i].a, r.value[i], 1e-14);
    EXPECT_LE((error[i].v.transpose() - analytic.row(i)).norm(), 1e-12) << "row " << i;
  }
}

}  // namespace
