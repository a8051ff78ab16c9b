#include <cli/show/simulated_recording.hpp>

#include <report/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <vector>

namespace liestat::cli {

using namespace experiments;

std::string formatSimulatedRecording(const SimulatedRecording& recording, const ViSceneOptions& scene, bool as_recorded,
                                     const std::string& directory) {
  std::string text;
  const auto print = [&text](const std::string& line) { text += line + "\n"; };
  const auto listed = [](const Eigen::Vector3d& v) {
    return fmt::format("{:.4g}, {:.4g}, {:.4g}", v.x(), v.y(), v.z());
  };
  const double duration = recording.imu.back().time - recording.imu.front().time;
  print(fmt::format("{:.4g} s: {} readings {}, {} images at {:g} Hz", duration, recording.imu.size(),
                    as_recorded ? "as recorded" : "simulated", recording.image_times.size(), scene.image_rate));
  std::vector<std::size_t> lengths;
  std::size_t outliers = 0;
  for (const SimulatedTrack& track : recording.tracks) {
    if (track.images > 0) lengths.push_back(track.images);
    outliers += track.outlier ? 1 : 0;
  }
  std::sort(lengths.begin(), lengths.end());
  print(fmt::format("{} landmarks on a box of {:.4g} x {:.4g} x {:.4g} m", scene.landmarks, recording.box.x(),
                    recording.box.y(), recording.box.z()));
  print(fmt::format(
      "{} tracks of {} images in the median, {:.3g} an image, {} that drift", lengths.size(),
      lengths.empty() ? 0 : lengths[lengths.size() / 2],
      static_cast<double>(recording.observations.size()) / static_cast<double>(recording.image_times.size()),
      outliers));
  const ImuBias<double>& bias = recording.truth.front().bias;
  print(
      fmt::format("biases at the beginning {} rad/s and {} m/s^2", listed(bias.gyroscope), listed(bias.accelerometer)));
  print("\n" + nextCommand(directory));
  return text;
}

std::string nextCommand(const std::string& directory) {
  return commandLine({"liestat", "vi-init", "--imu", directory + "/imu.csv", "--tracks", directory + "/tracks.csv",
                      "--image-times", directory + "/images.csv", "--calibration", directory + "/calibration.yaml",
                      "--truth", directory + "/truth.csv"});
}

}  // namespace liestat::cli
