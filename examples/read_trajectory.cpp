// Poses with covariances from a file of another program: the odometry of robot_localization, whose covariances are
// those of roll, pitch and yaw. Prints the standard deviations in the library's convention, and writes the same poses as
// CSV.
//
//   read_trajectory odometry.json
#include <formats/input_error.hpp>
#include <formats/trajectory.hpp>

#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

int main(int argc, char** argv) {
  if (argc != 2) return std::fprintf(stderr, "read_trajectory FILE\n"), 2;
  try {
    const liestat::Trajectory file = liestat::readTrajectory(argv[1]);
    const std::vector<liestat::Gaussian<liestat::SE3d>> poses = liestat::gaussiansOf(file, "ros-rpy");
    std::printf("%zu poses, format %s\n", file.size(), file.format.c_str());
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const Eigen::Matrix<double, 6, 1> sigma = poses[i].covariance.diagonal().cwiseSqrt();
      std::printf("%s s  sd along the body's axes %.3f %.3f %.3f m  %.4f %.4f %.4f rad\n", file.time_texts[i].c_str(),
                  sigma[0], sigma[1], sigma[2], sigma[3], sigma[4], sigma[5]);
    }

    // The library's convention is that of a CSV file without a header, which everybody can read back without being told.
    const std::string path = (std::filesystem::temp_directory_path() / "read_trajectory.csv").string();
    for (const std::string& note : liestat::writeTrajectory(path, liestat::trajectoryOf(poses, file.times), {"csv"})) {
      std::printf("note: %s\n", note.c_str());
    }
    const auto again = liestat::gaussiansOf(liestat::readTrajectory(path));
    std::filesystem::remove(path);
    return again.size() == poses.size() && again.back().covariance.isApprox(poses.back().covariance) ? 0 : 1;
  } catch (const liestat::InputError& error) {
    return std::fprintf(stderr, "%s\n", error.what()), 2;
  }
}
