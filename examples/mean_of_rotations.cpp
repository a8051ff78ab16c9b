// The mean of four measured rotations, with what is needed to trust it. The README's example.
#include <lie/so3.hpp>
#include <stats/certified_mean.hpp>

#include <iostream>
#include <vector>

int main() {
  using liestat::SO3d;
  const std::vector<SO3d> measured = {SO3d::exp({0.31, 0.02, -0.11}), SO3d::exp({0.28, 0.05, -0.13}),
                                      SO3d::exp({0.33, 0.01, -0.08}), SO3d::exp({0.30, 0.04, -0.12})};
  const auto result = liestat::certifiedMean(measured);
  std::cout << "status      " << name(result.status) << ", " << name(result.uniqueness.unique) << "\n";
  if (!result.estimate) return 3;  // result.reason says why: ambiguous, too few, near the cut locus …
  std::cout << "mean        " << result.estimate->mean.log().transpose() << " rad\n"
            << "sigma       " << result.estimate->covariance.diagonal().cwiseSqrt().transpose() << " rad, body axes\n";
}
