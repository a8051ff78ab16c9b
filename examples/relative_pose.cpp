// The relative pose of two calibrated views from matches in pixels, a third of them wrong: the fast estimate of the pose
// alone, and the one that first asks which motion it is.

#include <fusion/two_view/robust.hpp>
#include <fusion/two_view/two_view.hpp>
#include <lie/so3.hpp>
#include <lie/units.hpp>
#include <stats/random.hpp>

#include <cmath>
#include <cstdio>
#include <vector>

int main() {
  using namespace liestat;
  Camera camera;
  camera.fu = camera.fv = 800, camera.cu = 640, camera.cv = 480, camera.width = 1280, camera.height = 960;
  const double sigma = 1;  // px

  // x' = R x + t; the length of t cannot be seen.
  const SO3d R = SO3d::exp(Eigen::Vector3d(-0.02, 0.1, 0.01));
  const Eigen::Vector3d t(-0.5, 0.05, 0.1);
  CounterRng random(7);
  std::vector<Eigen::Vector4d> pixels;
  while (pixels.size() < 300) {
    const double x = random.uniform(-4, 4), y = random.uniform(-3, 3), z = random.uniform(4, 10);
    const Eigen::Vector3d point(x, y, z);
    const auto first = camera.project(point), second = camera.project(R * point + t);
    if (!first || !second || !camera.sees(*first) || !camera.sees(*second)) continue;
    Eigen::Vector4d& match = pixels.emplace_back();
    match << *first, *second;
    match += sigma * random.normalVector<4>();
    if (pixels.size() % 3 != 0) continue;
    match[2] = random.uniform(0, 1280);  // a wrong match
    match[3] = random.uniform(0, 960);
  }

  // One model: a search and an estimate in less than a millisecond. Coordinates are normalised, u = (p - c)/f.
  std::vector<Eigen::Vector4d> matches;
  const Eigen::Vector4d centre(camera.cu, camera.cv, camera.cu, camera.cv);
  for (const Eigen::Vector4d& p : pixels) matches.emplace_back((p - centre) / camera.fu);
  const RobustEssential pose = robustEssential(matches, {sigma / camera.fu, sigma / camera.fu});
  if (!pose.ok()) return 1;

  // All models: would a rotation, a plane or something else explain the matches as well?
  const TwoViewMotionEstimate motion = estimateTwoViewMotion(pixels, {.sigma = sigma, .first = camera});
  if (!motion.ok() || !motion.relative_pose) return 1;

  const Essentiald truth(R, t);
  const auto report = [&](const char* name, const Gaussian<Essentiald>& found, std::size_t inliers) {
    using units::degree;
    const auto error = log(found.mean, truth);
    std::printf(
        "%-9s %zu inliers, direction off by %.2f (sd %.2f, %.2f), rotation by %.3f (sd %.3f, %.3f, %.3f) degrees;",
        name, inliers, error.head<2>().norm() / degree, std::sqrt(found.covariance(0, 0)) / degree,
        std::sqrt(found.covariance(1, 1)) / degree, error.tail<3>().norm() / degree,
        std::sqrt(found.covariance(2, 2)) / degree, std::sqrt(found.covariance(3, 3)) / degree,
        std::sqrt(found.covariance(4, 4)) / degree);
    const double squared = mahalanobisSquared(found, truth);
    std::printf(" squared distance of the truth %.1f, 5 expected\n", squared);
    return squared < 20.5;  // exceeded once in a thousand times
  };
  std::printf("the matches call for '%s'\n", motion.chosenModel().name.c_str());
  const bool fine = report("one model", pose.pose, pose.inliers.size());
  return report("lattice", *motion.relative_pose, motion.inliers) && fine ? 0 : 1;
}
