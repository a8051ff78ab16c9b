// A robot's odometry and what it means for a landmark: how uncertain is a pose after many uncertain motions, and where
// is a landmark that the robot sees from there?
//
// Every motion is known with some noise in the robot's own axes. Composition adds it up; the landmark's direction and
// range go through a function of our own, whose Jacobian Jets find. All of it is compared with 2000 simulated
// drives.
#include <lie/se3.hpp>
#include <lie/units.hpp>
#include <stats/auto_diff.hpp>
#include <stats/sampling.hpp>

#include <cstdio>
#include <vector>

using liestat::Gaussian, liestat::SE3, liestat::SE3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// Where a landmark is, seen at a range (m), a bearing and an elevation (rad) from a pose: any function will do that is
/// generic in the scalar.
const auto landmark = [](const auto& world_T_body, const auto& seen) {
  using std::cos, std::sin;  // for double; Jet's are found by their argument
  using S = typename std::decay_t<decltype(seen)>::Scalar;
  const Eigen::Matrix<S, 3, 1> in_body(seen[0] * cos(seen[2]) * cos(seen[1]), seen[0] * cos(seen[2]) * sin(seen[1]),
                                       seen[0] * sin(seen[2]));
  return Eigen::Matrix<S, 3, 1>(world_T_body * in_body);
};

int main() {
  // Half a metre ahead and a little to the left; sd 2 cm ahead, 5 mm aside, half a degree about the vertical.
  const Vector6 sd = (Vector6() << 0.02, 0.005, 0.005, 0.002, 0.002, 0.009).finished();
  const Gaussian<SE3d> motion{SE3d::transX(0.5) * SE3d::rotZ(0.03), sd.cwiseAbs2().asDiagonal()};
  const Gaussian<Eigen::Vector3d> seen{{8, 0.5, 0.1}, Eigen::Vector3d(0.01, 1e-4, 1e-4).asDiagonal()};
  constexpr int motions = 40, trials = 2000;

  Gaussian<SE3d> pose{SE3d(), liestat::SquareOf<SE3d>::Zero()};
  for (int i = 0; i < motions; ++i) pose = compose(pose, motion);
  const Gaussian<Eigen::Vector3d> where = propagate(pose, seen, landmark);

  double pose_index = 0, landmark_index = 0;
  for (int trial = 0; trial < trials; ++trial) {
    liestat::CounterRng rng(1, static_cast<std::uint64_t>(trial));
    SE3d truth;
    for (int i = 0; i < motions; ++i) truth = truth * sample(motion, rng);
    pose_index += mahalanobisSquared(pose, truth) / trials;
    landmark_index += mahalanobisSquared(where, landmark(truth, sample(seen, rng))) / trials;
  }

  const Vector6 pose_sd = pose.covariance.diagonal().cwiseSqrt();
  const Eigen::Vector3d degrees = pose_sd.tail<3>() / liestat::units::degree;
  const Eigen::Vector3d axes = where.covariance.diagonal().cwiseSqrt();
  std::printf("after %d motions, sd along the robot's axes: %.3f %.3f %.3f m, %.2f %.2f %.2f degrees\n", motions,
              pose_sd[0], pose_sd[1], pose_sd[2], degrees[0], degrees[1], degrees[2]);
  std::printf("the landmark at %.2f %.2f %.2f m, sd along the world's axes %.3f %.3f %.3f m\n", where.mean[0],
              where.mean[1], where.mean[2], axes[0], axes[1], axes[2]);
  std::printf("mean squared Mahalanobis distance of %d simulated drives: pose %.2f, 6 expected; landmark %.2f, 3\n",
              trials, pose_index, landmark_index);
  return pose_index > 5.5 && pose_index < 6.5 && landmark_index > 2.7 && landmark_index < 3.4 ? 0 : 1;
}
