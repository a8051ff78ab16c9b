// The mean of directions: the normal of a wall from twelve measured normals, two of them good, with the cone in which
// the true normal lies. Directions have two degrees of freedom and no preferred axes across them.
#include <lie/s2.hpp>
#include <lie/units.hpp>
#include <stats/covariance.hpp>
#include <stats/inference.hpp>
#include <stats/sampling.hpp>

#include <iostream>
#include <vector>

int main() {
  using namespace liestat;
  using units::degree;
  const S2d wall(Eigen::Vector3d(0.6, -0.3, 0.9));

  // Laser scans from afar are good to 3°, two from close by to 0.5°.
  CounterRng rng(7);
  std::vector<S2d> normals;
  std::vector<double> weights;
  std::vector<Eigen::Matrix2d> noise;
  for (int i = 0; i < 12; ++i) {
    const double sd = (i < 2 ? 0.5 : 3) * degree;
    noise.push_back(sd * sd * Eigen::Matrix2d::Identity());
    normals.push_back(sample(Gaussian<S2d>{wall, noise.back()}, rng));
    weights.push_back(1 / (sd * sd));
  }

  const auto report = [&](const char* title, const MeanResult<S2d>& result, const Eigen::Matrix2d& covariance,
                          const ReferenceLaw& law) {
    const auto cone = confidenceEllipsoid(covariance, 0.95, law);
    std::cout << title << result.mean.unit_vector().transpose() << ", off by " << distance(result.mean, wall) / degree
              << " deg; 95 % within " << cone.semi_axes.transpose() / degree << " deg\n";
  };
  const int n = static_cast<int>(normals.size());
  const MeanResult<S2d> plain = mean(normals), weighted = mean(normals, weights);
  report("all alike      ", plain, covarianceFromNoise(plain, noise), ReferenceLaw::chiSquared(2));
  report("weighted       ", weighted, covarianceFromNoise(weighted, weights, noise), ReferenceLaw::chiSquared(2));
  // The scale of the noise unknown, the weights right: from the residuals, and wider, for it had to be estimated too.
  report("from residuals ", weighted, covarianceFromResiduals(weighted), ReferenceLaw::hotelling(2, n));

  // The sum of the unit vectors is the chordal mean: close, but another criterion.
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const S2d& x : normals) sum += x.unit_vector();
  std::cout << "the normalised sum of the vectors is " << distance(S2d(sum), plain.mean) / degree
            << " deg from the mean\n";
  return converged(plain.status) && converged(weighted.status) ? 0 : 1;
}
