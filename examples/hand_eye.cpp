// Hand-eye calibration: where is the camera on the gripper, how well is that known, and what do the motions not say?

#include <fusion/hand_eye.hpp>
#include <lie/se3.hpp>
#include <lie/units.hpp>
#include <stats/random.hpp>

#include <cmath>
#include <cstdio>
#include <vector>

int main() {
  using namespace liestat;
  using units::degree;
  const double mm = 1e-3;
  CounterRng random(1);

  // The truth, and the noise of the robot (A) and of the camera's poses at the target (B), each in its own frame.
  const SE3d gripper_T_camera(SO3d::rotZ(1.5) * SO3d::rotX(0.1), Eigen::Vector3d(0.05, -0.02, 0.12));
  const SE3d base_T_target(SO3d::rotY(0.3), Eigen::Vector3d(0.8, 0.1, 0.0));
  Eigen::Matrix<double, 6, 1> sigma_a, sigma_b;
  sigma_a << 0.2 * mm, 0.2 * mm, 0.2 * mm, 0.05 * degree, 0.05 * degree, 0.05 * degree;
  sigma_b << mm, mm, 5 * mm, degree, degree, 0.2 * degree;  // worst in depth, and about the axes across it

  const auto poses = [&](bool planar) {
    std::vector<PosePair> pairs;
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector3d turn = random.normalVector<3>(), shift = random.normalVector<3>();
      SE3d A = SE3d(SO3d::exp(0.4 * turn), 0.1 * shift);
      if (planar) A = SE3d(SO3d::rotZ(0.4 * turn[2]), Eigen::Vector3d(0.1 * shift[0], 0.1 * shift[1], 0.3));
      const SE3d B = base_T_target.inverse() * A * gripper_T_camera;
      PosePair& pair = pairs.emplace_back();
      pair.a.mean = A * SE3d::exp(sigma_a.cwiseProduct(random.normalVector<6>()));
      pair.a.covariance = sigma_a.cwiseAbs2().asDiagonal();
      pair.b.mean = B * SE3d::exp(sigma_b.cwiseProduct(random.normalVector<6>()));
      pair.b.covariance = sigma_b.cwiseAbs2().asDiagonal();
    }
    return pairs;
  };

  const HandEyeResult result = estimateRobotWorld(poses(false));
  const auto error = (result.X.mean.inverse() * gripper_T_camera).log();
  std::printf("%s: chi2 %.1f with %d degrees of freedom\n", name(result.status), result.chi2,
              result.degrees_of_freedom);
  for (int k = 0; k < 6; ++k) {
    const double unit = k < 3 ? mm : degree;
    std::printf("  %s %c: off by %6.3f, sd %.3f %s\n", k < 3 ? "translation" : "rotation   ", "xyz"[k % 3],
                error[k] / unit, std::sqrt(result.X.covariance(k, k)) / unit, k < 3 ? "mm" : "deg");
  }

  // A gripper that turns about one direction alone.
  const HandEyeResult planar = estimateRobotWorld(poses(true));
  std::printf("planar motion: %s\n", name(planar.status));
  for (const OpenDirection& direction : planar.directions) std::printf("  open: %s\n", describe(direction).c_str());

  const bool right = result.ok() && mahalanobisSquared(result.X, gripper_T_camera) < 22.5 &&
                     planar.status == FusionStatus::undetermined && planar.directions.size() == 1;
  return right ? 0 : 1;
}
