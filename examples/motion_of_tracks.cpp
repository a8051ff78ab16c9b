// Which way does the camera move, and how well is that known? Points of a turning object, tracked with an error of 4
// pixels, frame by frame: by the subspace filter from successive frames, from pairs of up to four frames, and with a
// gyroscope (docs/motion.md).
#include <fusion/motion/subspace_filter.hpp>
#include <fusion/motion/track_pairs.hpp>
#include <lie/units.hpp>
#include <stats/random.hpp>

#include <cmath>
#include <cstdio>
#include <vector>

namespace {

using namespace liestat;

using units::degree;
constexpr double focal_length = 500, sigma = 4 / focal_length;

/// Twenty points in a ball of radius 0.5 at 1.5 m, which turns about its centre by 5° per frame.
struct Turntable {
  CounterRng rng{1};
  Eigen::Vector3d centre{0, 0, 1.5}, Omega = 5 * degree * Eigen::Vector3d(0.6, 0.8, 0).normalized();
  Eigen::Vector3d V = -Omega.cross(centre);
  std::vector<Eigen::Vector3d> points;

  Turntable() {
    for (int i = 0; i < 20; ++i) {
      const double radius = 0.5 * std::cbrt(rng.uniform());
      points.push_back(centre + radius * rng.unitVector<3>());
    }
  }
  void turn() {
    const SO3d R = SO3d::exp(Omega);
    for (Eigen::Vector3d& X : points) X = centre + R * Eigen::Vector3d(X - centre);
  }
  std::vector<TrackObservation> observe() {
    std::vector<TrackObservation> seen;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2d error = sigma * rng.normalVector<2>();
      seen.push_back({i, points[i].head<2>() / points[i].z() + error, sigma});
    }
    return seen;
  }
};

void print(const char* name, const MotionEstimate& e, const Turntable& world) {
  const double error = distance(e.direction.mean, S2d(world.V)) / degree;
  const double deviation = std::sqrt(e.direction.covariance.trace() / 2) / degree;
  std::printf("%-18s %7.2f %9.2f  %s\n", name, error, deviation, e.ok() ? "usable" : "not yet");
}

}  // namespace

int main() {
  Turntable world;
  SubspaceFilter successive, longer, inertial;
  TrackPairs neighbours, intervals({.frames = 4});
  neighbours.add(world.observe());
  CounterRng gyroscope(2);
  for (int frame = 1; frame <= 60; ++frame) {
    world.turn();
    const auto seen = world.observe();
    const auto pairs = neighbours.add(seen);
    successive.update(pairs);
    longer.update(intervals.add(seen));
    const double s = 0.1 * degree;
    const Eigen::Vector3d error = s * gyroscope.normalVector<3>();
    inertial.update(pairs, {world.Omega + error, s * s * Eigen::Matrix3d::Identity()});
    if (frame % 20 != 0) continue;
    std::printf("frame %d             error   1 sigma (deg)\n", frame);
    print("successive frames", successive.estimate(), world);
    print("up to 4 frames", longer.estimate(), world);
    print("with a gyroscope", inertial.estimate(), world);
  }
  const bool found = longer.estimate().ok() && distance(longer.estimate().direction.mean, S2d(world.V)) < 3 * degree &&
                     inertial.estimate().ok() &&
                     distance(inertial.estimate().direction.mean, S2d(world.V)) < 2 * degree;
  return found ? 0 : 1;
}
