// A trajectory with covariances against its reference: are the covariances right, and which convention are they in?
#include <fusion/convention_diagnosis.hpp>
#include <fusion/evaluate.hpp>
#include <stats/sampling.hpp>

#include <cmath>
#include <cstdio>
#include <vector>

using namespace liestat;

int main() {
  // A body turns along a path; each estimate errs by T = T_hat Exp(e), e ~ N(0, S), in a world of its own.
  CounterRng rng(1);
  const SE3d estimate_T_truth(SO3d::rotZ(0.8), Eigen::Vector3d(2, -1, 0.5));
  PoseTrajectory reference, estimate{.has_covariances = true};
  for (int i = 0; i < 200; ++i) {
    const double t = 0.1 * i;
    const SE3d truth(SO3d::rotZ(0.4 * t) * SO3d::rotX(0.8 * std::sin(t)),
                     Eigen::Vector3d(3 * std::cos(t), 3 * std::sin(t), 0.1 * t));
    Eigen::Matrix<double, 6, 6> S = Eigen::Matrix<double, 6, 6>::Zero();
    S.diagonal() << 4e-4, 9e-4, 1e-4, 1e-4, 4e-5, 2e-4;
    S(1, 5) = S(5, 1) = 2e-4;  // a lateral error goes with the heading
    const SE3d error = sample(Gaussian<SE3d>{SE3d(), S}, rng);
    reference.poses.push_back({truth}), estimate.poses.push_back({estimate_T_truth * truth * error.inverse(), S});
  }

  const TrajectoryEvaluation e = evaluateTrajectory(reference, estimate, {.alignment = AlignmentModel::se3});
  std::printf("APE rmse %.3f m, %s\n", e.ape_statistics.rmse, e.verdict().text.c_str());

  // The same covariances, written along the axes of the world: the errors tell.
  std::vector<DiagnosedPose> file;
  const Convention ros{.perturbation = Perturbation::world_axes};
  for (const MatchedPose& p : e.matched) {
    file.push_back({p.estimate.mean, toConvention(ros, p.estimate), p.reference.mean});
  }
  const ConventionDiagnosis diagnosis = diagnoseConventions(file, {.alignment = AlignmentModel::se3});
  std::printf("%s: %s\n", name(diagnosis.verdict), diagnosis.reason.c_str());
  const bool right = e.verdict().isYes() && diagnosis.verdict == DiagnosisVerdict::identified &&
                     diagnosis.accepted.front().perturbation == Perturbation::world_axes;
  return right ? 0 : 1;
}
