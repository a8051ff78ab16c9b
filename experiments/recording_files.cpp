#include <experiments/recording_files.hpp>

#include <formats/input_error.hpp>
#include <formats/output_file.hpp>
#include <formats/text.hpp>

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <string_view>

namespace liestat::experiments {

using namespace experiments;

namespace {

constexpr std::array file_names = {"imu.csv",   "images.csv",    "tracks.csv",
                                   "truth.csv", "landmarks.csv", "calibration.yaml"};
constexpr const char* list_name = "liestat.txt";
constexpr std::string_view list_header = "# written by liestat simulate vi: FNV-1a of the contents, file";

/// FNV-1a: no protection against malice, but against replacing what somebody else has written.
std::uint64_t checksum(std::string_view text) {
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
  return hash;
}

std::string listLine(std::string_view name, std::string_view text) {
  return fmt::format("{:016x} {}\n", checksum(text), name);
}

}  // namespace

std::string calibrationText(const CameraCalibration& sensor, const std::optional<ImuNoise<double>>& noise) {
  const Camera& camera = sensor.camera;
  std::string text = "%YAML:1.0\n\ncam0:\n  T_imu_cam: # takes the camera's coordinates to the IMU's\n";
  const Eigen::Matrix4d T = sensor.imu_T_cam.matrix();
  for (int i = 0; i < 4; ++i) text += fmt::format("    - [{}, {}, {}, {}]\n", T(i, 0), T(i, 1), T(i, 2), T(i, 3));
  const Eigen::Vector4d& c = camera.coefficients;
  // In the order of Distortion; the models without distortion have their coefficients among the intrinsics.
  const char* lenses[] = {"pinhole", "pinhole", "pinhole", "omni", "ds", "eucm"};
  const char* models[] = {"none", "radtan", "equidistant", "radtan", "none", "none"};
  const auto lens = static_cast<std::size_t>(camera.distortion);
  const bool own = camera.distortion == Distortion::double_sphere || camera.distortion == Distortion::eucm;
  const std::string before = own                                     ? fmt::format("{}, {}, ", c[0], c[1])
                             : camera.distortion == Distortion::omni ? fmt::format("{}, ", camera.mirror)
                                                                     : "";
  text += fmt::format("  camera_model: {}\n  distortion_model: {}\n", lenses[lens], models[lens]);
  text += own ? "  distortion_coeffs: []\n"
              : fmt::format("  distortion_coeffs: [{}, {}, {}, {}]\n", c[0], c[1], c[2], c[3]);
  text += fmt::format("  intrinsics: [{}{}, {}, {}, {}] # {}fu, fv, cu, cv\n", before, camera.fu, camera.fv, camera.cu,
                      camera.cv, before.empty() ? "" : "those of the model, ");
  text += fmt::format("  resolution: [{}, {}]\n", camera.width, camera.height);
  text += fmt::format("  timeshift_cam_imu: {} # t_imu = t_cam + this\n", sensor.timeshift_cam_imu);
  if (!noise) return text;
  text += fmt::format("\nimu0:\n  gyroscope_noise_density: {}\n  gyroscope_random_walk: {}\n", noise->gyroscope,
                      noise->gyroscope_walk);
  text += fmt::format("  accelerometer_noise_density: {}\n  accelerometer_random_walk: {}\n", noise->accelerometer,
                      noise->accelerometer_walk);
  return text;
}

void writeRecording(const SimulatedRecording& recording, const std::string& directory) {
  createDirectory(directory);
  std::string list = std::string(list_header) + "\n";
  const auto write = [&](const char* name, const std::string& text) {
    writeOutput(directory + "/" + name, text);
    list += listLine(name, text);
  };
  const auto stamp = [&](double time) { return recording.start_ns + std::llround(1e9 * time); };
  std::string text;
  const auto append = [&](const Eigen::Vector3d& v) {
    fmt::format_to(std::back_inserter(text), ",{},{},{}", v.x(), v.y(), v.z());
  };

  text =
      "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m "
      "s^-2],a_RS_S_z [m s^-2]\n";
  for (const ImuSample<double>& reading : recording.imu) {
    fmt::format_to(std::back_inserter(text), "{}", stamp(reading.time));
    append(reading.angular_rate), append(reading.specific_force);
    text += '\n';
  }
  write("imu.csv", text);

  text = "#timestamp [ns],filename\n";
  for (const double time : recording.image_times) {
    const std::int64_t on_camera = stamp(time - recording.camera.timeshift_cam_imu);
    fmt::format_to(std::back_inserter(text), "{0},{0}.png\n", on_camera);
  }
  write("images.csv", text);

  text = "frame,track,u,v\n";
  for (const PixelObservation& o : recording.observations)
    fmt::format_to(std::back_inserter(text), "{},{},{},{}\n", o.image, o.track, o.u, o.v);
  write("tracks.csv", text);

  text =
      "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v_RS_R_x [m "
      "s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1], b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad "
      "s^-1], b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], b_a_RS_S_z [m s^-2]\n";
  for (const GroundTruth& row : recording.truth) {
    fmt::format_to(std::back_inserter(text), "{}", stamp(row.time));
    append(row.state.translation());
    const Eigen::Vector4d q = row.state.so3().params();
    fmt::format_to(std::back_inserter(text), ",{},{},{},{}", q[3], q[0], q[1], q[2]);
    append(row.state.velocity()), append(row.bias.gyroscope), append(row.bias.accelerometer);
    text += '\n';
  }
  write("truth.csv", text);

  text = "track,x,y,z,outlier\n";
  for (std::size_t i = 0; i < recording.tracks.size(); ++i) {
    fmt::format_to(std::back_inserter(text), "{}", i);
    append(recording.tracks[i].landmark);
    text += recording.tracks[i].outlier ? ",1\n" : ",0\n";
  }
  write("landmarks.csv", text);
  write("calibration.yaml", calibrationText(recording.camera, recording.noise));
  writeOutput(directory + "/" + list_name, list);
}

void requireOwnFiles(const std::string& directory) {
  const auto pathOf = [&](const char* name) { return directory + "/" + name; };
  const std::string list = std::filesystem::is_regular_file(pathOf(list_name)) ? loadText(pathOf(list_name)).text : "";
  const bool is_list = list.rfind(list_header, 0) == 0;
  const auto refuse = [&](const char* name) {
    throw InputError(pathOf(name), 0, "the file is there, and not as liestat simulate vi has written it",
                     "another directory, or --overwrite");
  };
  if (!list.empty() && !is_list) refuse(list_name);
  for (const char* name : file_names) {
    if (!std::filesystem::exists(pathOf(name))) continue;
    if (!is_list || !std::filesystem::is_regular_file(pathOf(name)) ||
        list.find("\n" + listLine(name, loadText(pathOf(name)).text)) == std::string::npos)
      refuse(name);
  }
}

}  // namespace liestat::experiments
