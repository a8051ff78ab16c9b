// Rotations with outliers: the mean, the geodesic median and Huber's mean, and the outliers by name.
#include <lie/so3.hpp>
#include <lie/units.hpp>
#include <stats/mean.hpp>
#include <stats/random.hpp>
#include <stats/robust_mean.hpp>

#include <iostream>
#include <vector>

using namespace liestat;

int main() {
  const SO3d truth = SO3d::exp({0.4, -0.2, 1.0});
  CounterRng rng(1);
  std::vector<SO3d> measured;
  for (int i = 0; i < 40; ++i) measured.push_back(exp(truth, Eigen::Vector3d(units::degree * rng.normalVector<3>())));
  // A tenth is wrong in any way.
  for (const std::size_t i : {3U, 11U, 25U, 38U}) {
    measured[i] = SO3d::exp(Eigen::Vector3d(rng.uniform(1, 3) * rng.unitVector<3>()));
  }

  std::cout << "mean: " << distance(mean(measured).mean, truth) / units::degree << " degrees from the truth\n";
  const RobustMean<SO3d> median = robustMean(measured, RobustLoss::median), huber = robustMean(measured);
  std::cout << "median: " << distance(median.mean, truth) / units::degree << " degrees\n";
  std::cout << "Huber's mean: " << distance(huber.mean, truth) / units::degree << " degrees, " << name(huber.status)
            << "\n";
  for (const RobustOutlier& x : huber.outliers) {
    std::cout << "measurement " << x.index << " is " << x.distance / units::degree << " degrees away, p " << x.p
              << "\n";
  }
  if (!huber.estimate) return 1;
  const Eigen::Vector3d sd = huber.estimate->covariance.diagonal().cwiseSqrt() / units::degree;
  std::cout << "standard deviations: " << sd.transpose() << " degrees\n";
  return huber.outliers.size() == 4 && distance(huber.mean, truth) < units::degree ? 0 : 1;
}
