// Is your estimator's covariance right? Draw scenes of which the truth is known, and look where the truth lies under
// the covariance that the estimator itself returns.
//
// Here: a position from ranges to six beacons. All ranges of a scene share an unknown offset (a clock's) besides their
// own noise. One estimator knows of the offset. The other treats six equally wrong ranges as six independent ones: its
// covariance lies, and the harness says so.
#include <stats/validation.hpp>

#include <Eigen/Cholesky>

#include <iostream>
#include <vector>

namespace {

constexpr int n = 6;
constexpr double noise_sd = 0.02, offset_sd = 0.05;  // m
using Ranges = Eigen::Matrix<double, n, 1>;

/// A draw of the harness: the truth, and what the estimator gets to see.
struct Scene {
  Eigen::Vector2d truth;
  Eigen::Matrix<double, 2, n> beacons;
  Ranges ranges;
};

/// The result that the harness expects; `converged` and `iterations` are optional and used because they are there.
struct Estimate {
  Eigen::Vector2d mean;
  Eigen::Matrix2d covariance;
  bool converged = false;
  int iterations = 0;
};

Scene drawScene(liestat::CounterRng& rng) {
  Scene scene;
  scene.truth = {rng.uniform(), rng.uniform()};
  const double offset = offset_sd * rng.normal();
  for (int i = 0; i < n; ++i) {
    const double bearing = 0.5 * i;  // to one side: the offset does not cancel
    scene.beacons.col(i) = 10 * Eigen::Vector2d(std::cos(bearing), std::sin(bearing));
    scene.ranges[i] = (scene.beacons.col(i) - scene.truth).norm() + offset + noise_sd * rng.normal();
  }
  return scene;
}

/// Weighted least squares for a given covariance of the ranges.
Estimate locate(const Scene& scene, const Eigen::Matrix<double, n, n>& range_covariance) {
  const Eigen::LLT<Eigen::Matrix<double, n, n>> noise(range_covariance);
  Estimate estimate;
  estimate.mean.setZero();
  while (!estimate.converged && estimate.iterations < 20) {
    Eigen::Matrix<double, n, 2> J;
    Ranges residual;
    for (int i = 0; i < n; ++i) {
      const Eigen::Vector2d to_beacon = scene.beacons.col(i) - estimate.mean;
      residual[i] = scene.ranges[i] - to_beacon.norm();
      J.row(i) = -to_beacon.normalized();
    }
    const Eigen::Matrix2d information = J.transpose() * noise.solve(J);
    const Eigen::Vector2d step = information.llt().solve(J.transpose() * noise.solve(residual));
    estimate.mean += step;
    estimate.covariance = information.llt().solve(Eigen::Matrix2d::Identity());
    estimate.converged = step.norm() < 1e-10;
    ++estimate.iterations;
  }
  return estimate;
}

}  // namespace

int main() {
  using namespace liestat;
  using Covariance = Eigen::Matrix<double, n, n>;
  const Covariance independent = noise_sd * noise_sd * Covariance::Identity();
  const Covariance shared = independent + offset_sd * offset_sd * Covariance::Ones();
  const Covariance total = (noise_sd * noise_sd + offset_sd * offset_sd) * Covariance::Identity();

  const ValidationOptions options{.trials = 4000, .seed = 1};
  const ReferenceLaw law = ReferenceLaw::chiSquared(2);
  const auto honest =
      validate(SerialExecutor{}, options, law, drawScene, [&](const Scene& scene) { return locate(scene, shared); });
  std::cout << "knows that the ranges share an offset\n" << honest << "\n";
  // The variance of each single range is right; that they err together is what it does not know.
  const auto liar =
      validate(SerialExecutor{}, options, law, drawScene, [&](const Scene& scene) { return locate(scene, total); });
  std::cout << "takes them as independent, each with its full variance\n" << liar;
  return honest.passed() && !liar.passed() ? 0 : 1;
}
