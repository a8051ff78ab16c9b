// A program that reads a trajectory with covariances: the component formats.
#include <formats/trajectory.hpp>

#include <cstdio>

int main(int, char** argv) {
  const liestat::Trajectory file = liestat::readTrajectory(argv[1]);
  const auto poses = liestat::gaussiansOf(file, "ros-rpy");
  std::printf("%zu poses, %s, %g m\n", poses.size(), file.format.c_str(), poses[0].covariance(0, 0));
  return poses.size() == 4 && file.format == "ros-json" && poses[0].covariance(0, 0) > 0 ? 0 : 1;
}
