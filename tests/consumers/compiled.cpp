// A program that links the means instead of compiling them.
#include <Eigen/Core>
#include <cstdio>
#include <lie/so3.hpp>
#include <stats/certified_mean.hpp>
#include <vector>

#ifndef LIESTAT_COMPILED_MEANS
#error "liestat::means does not say that the means are compiled"
#endif

int main() {
  std::vector<liestat::SO3d> rotations;
  for (int i = -2; i <= 2; ++i) rotations.push_back(liestat::SO3d::exp(0.1 * i * Eigen::Vector3d(1, -1, 0.5 * i)));
  const auto mean = liestat::certifiedMean(rotations);
  const bool right = mean.mean.status == liestat::Status::ok && mean.estimate.has_value();
  std::printf("certified mean: %s\n", right ? "ok" : mean.reason);
  return right ? 0 : 1;
}
