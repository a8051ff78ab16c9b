// The orientation of a slowly turning platform from a stream of noisy readings: one reading at a time, in fixed memory,
// with a covariance at any time, and old readings forgotten.
#include <lie/so3.hpp>
#include <stats/recursive_mean.hpp>

#include <cmath>
#include <iostream>
#include <random>

int main() {
  using liestat::SO3d;
  std::mt19937 generator(1);
  std::normal_distribution<double> normal(0, 0.05);  // rad
  const auto reading = [&](const SO3d& truth) {
    return truth * SO3d::exp({normal(generator), normal(generator), normal(generator)});
  };

  liestat::RecursiveMean<SO3d> all, recent({.forgetting = 0.95});
  SO3d truth;
  for (int i = 0; i < 400; ++i) {
    if (i >= 200) truth = truth * SO3d::exp({0, 0, 0.001});  // from here on it turns
    const SO3d x = reading(truth);
    all.add(x);
    recent.add(x);
  }
  const auto print = [&](const char* name, const liestat::RecursiveMean<SO3d>& mean) {
    const double sigma = std::sqrt(mean.covarianceFromResiduals()(2, 2));
    std::cout << name << ": " << mean.effective_n() << " readings count, sigma " << sigma << " rad, error about z "
              << (truth.inverse() * mean.mean()).log()[2] << " rad\n";
    return sigma;
  };
  // The platform's turn in the meantime is no noise: the covariances do not include it. Forgetting limits it to
  // 0.001 rad · λ/(1-λ) = 0.019 rad.
  const double sigma_all = print("none forgotten", all), sigma_recent = print("forgetting    ", recent);
  const double lag = (truth.inverse() * recent.mean()).log()[2];
  return sigma_all < sigma_recent && std::abs(lag + 0.019) < 5 * sigma_recent ? 0 : 1;
}
