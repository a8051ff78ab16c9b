#include "cli/calibration.hpp"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <cmath>

#include "cli/input_error.hpp"
#include "cli/text.hpp"

namespace liestat::cli {
namespace {

std::size_t lineOf(const YAML::Node& node) { return static_cast<std::size_t>(node.Mark().line + 1); }

double density(const YAML::Node& sensor, const char* key, const std::string& file) {
  const YAML::Node node = sensor[key];
  if (!node) throw InputError(file, 0, fmt::format("there is no {}", key), "the densities of noise and walk of an IMU");
  double value = 0;
  if (!node.IsScalar() || parseNumber(node.Scalar(), value) != NumberKind::finite || value < 0) {
    throw InputError(file, lineOf(node),
                     fmt::format("{} is '{}'", key, node.IsScalar() ? printable(node.Scalar()) : "a list"),
                     "a number of zero or more");
  }
  return value;
}

}  // namespace

ImuNoise<double> parseImuNoise(std::string_view text, const std::string& name) {
  // OpenCV's directive is none of YAML's; as a comment it keeps the numbers of the lines.
  std::string yaml(text);
  if (yaml.rfind("%YAML:", 0) == 0) yaml[0] = '#';
  try {
    const YAML::Node root = YAML::Load(yaml);
    if (!root.IsMap()) throw InputError(name, 0, "this is no YAML file of named values");
    const YAML::Node section = root["imu0"];
    const YAML::Node sensor = section && section.IsMap() ? section : root;
    return {.gyroscope = density(sensor, "gyroscope_noise_density", name),
            .accelerometer = density(sensor, "accelerometer_noise_density", name),
            .gyroscope_walk = density(sensor, "gyroscope_random_walk", name),
            .accelerometer_walk = density(sensor, "accelerometer_random_walk", name)};
  } catch (const YAML::Exception& error) {
    throw InputError(name, static_cast<std::size_t>(error.mark.line + 1), "YAML: " + printable(error.msg, 200));
  }
}

ImuNoise<double> readImuNoise(const std::string& path) {
  const TextFile file = loadText(path);
  return parseImuNoise(file.text, file.name);
}

}  // namespace liestat::cli
