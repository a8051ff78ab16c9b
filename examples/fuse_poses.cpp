// Fusing measured poses, and why the caller must say where a covariance is attached.
//
// A pose is measured thirty times. The noise of a measurement is known, and much larger along one axis than along the
// others, but along whose axis?
//   CovarianceAt::estimated  the object's: its position is uncertain along its own z axis       x_i = exp(x, e_i)
//   CovarianceAt::measured   the measured frame's, which is itself turned by the error          exp(x_i, e_i) = x
// Both are Gaussian, with the same matrix. Each model is right for its own noise; for the other's it is not a little
// worse, but wrong: it trusts a distance along an axis that is not where it thinks.
#include <lie/frame3.hpp>
#include <stats/maha.hpp>
#include <stats/sampling.hpp>

#include <cstdio>
#include <vector>

int main() {
  using namespace liestat;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  // Translation first, m; then rotation, rad.
  const Vector6 sd = (Vector6() << 0.1, 0.5, 1, 0.1, 0.2, 0.3).finished();
  const Matrix6 noise = sd.cwiseAbs2().asDiagonal();
  const Frame3d truth(SO3d::exp({0.4, -0.2, 1.1}), {3, -1, 2});

  const auto measure = [&](CovarianceAt at, CounterRng& rng) {
    const Vector6 e = sd.cwiseProduct(rng.normalVector<6>());
    if (at == CovarianceAt::estimated) return exp(truth, e);
    return Frame3d(truth.se3() * exp(Frame3d(), e).se3().inverse());
  };

  // The squared Mahalanobis distance of the truth should be 6 on average: there are six degrees of freedom.
  constexpr int trials = 200, n = 30;
  std::printf("mean squared Mahalanobis distance of the true pose (6 expected), and position error in m\n");
  std::printf("%-34s %22s %22s\n", "", "model: estimated", "model: measured");
  bool right = true;
  for (const CovarianceAt noise_at : {CovarianceAt::estimated, CovarianceAt::measured}) {
    std::printf("noise in the frame of the %-11s", noise_at == CovarianceAt::estimated ? "object" : "measurement");
    for (const CovarianceAt model : {CovarianceAt::estimated, CovarianceAt::measured}) {
      double index = 0, squared_error = 0;
      int refuted = 0;
      for (int trial = 0; trial < trials; ++trial) {
        CounterRng rng(1, static_cast<std::uint64_t>(trial));
        std::vector<Gaussian<Frame3d>> measurements;
        for (int i = 0; i < n; ++i) measurements.push_back({measure(noise_at, rng), noise});
        // The covariance whatever the test of the noise says, which fuse() would withhold under the wrong model.
        const FuseResult<Frame3d> tested = testedFuse(measurements, model);
        const Gaussian<Frame3d>& fused = tested.estimate;
        refuted += tested.status == Status::inconsistent;
        index += mahalanobisSquared(fused, truth) / trials;
        squared_error += (fused.mean.translation() - truth.translation()).squaredNorm() / trials;
      }
      std::printf(" %12.1f %9.3f", index, std::sqrt(squared_error));
      right = right && (model == noise_at ? index > 5 && index < 7 && refuted < 3 : refuted > trials / 2);
    }
    std::printf("\n");
  }
  return right ? 0 : 1;
}
