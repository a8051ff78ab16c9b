// A program that calls estimators of fusion/, linked or header-only.
#include <Eigen/Core>
#include <cstdio>
#include <fusion/evaluate.hpp>

#ifdef HAND_EYE
#include <fusion/hand_eye.hpp>
#endif

int main() {
  using liestat::SE3d;
#ifdef HAND_EYE
  if (!liestat::estimateHandEye({}).ok()) return 1;
#endif
  liestat::PoseTrajectory reference;
  for (int i = 0; i < 12; ++i) {
    const double turn = 0.5 * (i % 3);
    const Eigen::Matrix<double, 6, 1> v{0.3 * i, 0.1, 0, 0.2 * i, turn, 0.1};
    reference.times.push_back(i);
    reference.poses.push_back({SE3d::exp(v), Eigen::Matrix<double, 6, 6>::Zero()});
  }
  const auto evaluation = liestat::evaluateTrajectory(reference, reference);
  std::printf("APE: %g m, %s\n", evaluation.ape_statistics.rmse, evaluation.verdict().text.c_str());
  return evaluation.ok() && evaluation.ape_statistics.rmse == 0 && evaluation.verdict().isNone() ? 0 : 1;
}
