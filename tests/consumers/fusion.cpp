// A program that calls estimators of fusion/, linked or header-only.
#include <Eigen/Core>
#include <cstdio>
#include <fusion/evaluate.hpp>
#include <fusion/hand_eye.hpp>
#include <vector>

int main() {
  using liestat::SE3d;
  liestat::PoseTrajectory reference;
  std::vector<liestat::PosePair> pairs;
  const SE3d X = SE3d::exp((Eigen::Matrix<double, 6, 1>() << 0.1, 0, 0.2, 0.3, -0.4, 0.5).finished());
  for (int i = 0; i < 12; ++i) {
    const SE3d pose =
        SE3d::exp((Eigen::Matrix<double, 6, 1>() << 0.3 * i, 0.1, 0, 0.2 * i, 0.5 * (i % 3), 0.1).finished());
    reference.times.push_back(i), reference.poses.push_back({pose, 1e-6 * Eigen::Matrix<double, 6, 6>::Identity()});
    liestat::PosePair pair;
    pair.a.mean = pose, pair.b.mean = X.inverse() * pose * X;
    pair.a.covariance = pair.b.covariance = 1e-8 * Eigen::Matrix<double, 6, 6>::Identity();
    pairs.push_back(pair);
  }
  const auto calibration = liestat::estimateHandEye(pairs);
  const auto evaluation = liestat::evaluateTrajectory(reference, reference);
  const double apart = (calibration.X.mean.inverse() * X).log().norm();
  std::printf("hand-eye: %g from the truth; APE: %g m\n", apart, evaluation.ape_statistics.rmse);
  return apart < 1e-6 && evaluation.ape_statistics.rmse == 0 ? 0 : 1;
}
