// One reading of an inertial sensor, with and without covariance and bias Jacobians, beside the dense F P Fᵀ + G Q Gᵀ
// that a straightforward program computes for the covariance alone.
#include "../inputs.hpp"

#include <fusion/imu/preintegration.hpp>

#include <benchmark/benchmark.h>

#include <vector>

namespace liestat::bench {
namespace {

constexpr std::size_t n = 200;

struct Readings {
  std::vector<Eigen::Vector3d> rate, force;
  Readings() {
    Inputs random;
    for (std::size_t i = 0; i < n; ++i) {
      rate.push_back(random.normal<3>());
      force.push_back(Eigen::Vector3d(random.normal<3>()) + Eigen::Vector3d(0, 0, 9.8));
    }
  }
};

void add(benchmark::State& state) {
  const Readings readings;
  while (state.KeepRunningBatch(static_cast<benchmark::IterationCount>(n))) {
    Preintegration<double> motion({.noise = {.gyroscope = 1.7e-4, .accelerometer = 2e-3}});
    for (std::size_t i = 0; i < n; ++i) motion.add(0.005, readings.rate[i], readings.force[i]);
    benchmark::DoNotOptimize(motion);
  }
}
BENCHMARK(add)->Name("Preintegration/add");

void stateAlone(benchmark::State& state) {
  const Readings readings;
  while (state.KeepRunningBatch(static_cast<benchmark::IterationCount>(n))) {
    SE23d x;
    for (std::size_t i = 0; i < n; ++i) {
      const Eigen::Vector3d theta = 0.005 * readings.rate[i];
      const Eigen::Vector3d gain = 0.005 * (SO3d::leftJacobian(theta) * readings.force[i]);
      x.translation() += 0.005 * x.velocity() + x.so3() * Eigen::Vector3d(0.0025 * gain);
      x.velocity() += x.so3() * gain;
      x.so3() *= SO3d::exp(theta);
    }
    benchmark::DoNotOptimize(x);
  }
}
BENCHMARK(stateAlone)->Name("Preintegration/the state alone");

void dense(benchmark::State& state) {
  using Matrix9 = Eigen::Matrix<double, 9, 9>;
  const Readings readings;
  while (state.KeepRunningBatch(static_cast<benchmark::IterationCount>(n))) {
    Matrix9 P = Matrix9::Zero();
    Matrix9 F = Matrix9::Identity();
    Eigen::Matrix<double, 9, 6> G = Eigen::Matrix<double, 9, 6>::Zero();
    for (std::size_t i = 0; i < n; ++i) {
      F.block<3, 3>(3, 0) = -0.005 * detail::skew(readings.force[i]);
      F.block<3, 3>(0, 0) = SO3d::exp(-0.005 * readings.rate[i]).matrix();
      G.block<3, 3>(3, 3) = 0.005 * F.block<3, 3>(0, 0);
      G.block<3, 3>(0, 0) = 0.005 * Eigen::Matrix3d::Identity();
      P = (F * P * F.transpose() + 1e-4 * G * G.transpose()).eval();
    }
    benchmark::DoNotOptimize(P);
  }
}
BENCHMARK(dense)->Name("Dense/covariance alone");

}  // namespace
}  // namespace liestat::bench
