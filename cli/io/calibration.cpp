#include <cli/io/calibration.hpp>

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

#include <cli/io/input_error.hpp>
#include <cli/io/rotation_matrix.hpp>
#include <cli/io/text.hpp>

namespace liestat::cli {
namespace {

/// Files print four digits at least; what is farther from a rotation than that is none.
constexpr double rotation_tolerance = 1e-3;
/// T_cam_imu and T_imu_cam of one file may differ by this, rad and m: they are rounded each for itself.
constexpr double pose_tolerance = 1e-3;

constexpr std::array densities = {"gyroscope_noise_density", "accelerometer_noise_density", "gyroscope_random_walk",
                                  "accelerometer_random_walk"};

std::size_t lineOf(const YAML::Node& node) { return static_cast<std::size_t>(node.Mark().line + 1); }

std::string shown(const YAML::Node& node) {
  if (node.IsScalar()) return "'" + printable(node.Scalar()) + "'";
  return node.IsSequence() ? "a list" : node.IsMap() ? "a map" : "empty";
}

/// A value and what messages call it by.
struct Named {
  YAML::Node node;
  const std::string& file;
  std::string name;

  std::size_t line() const { return lineOf(node); }
  [[noreturn]] void complain(const std::string& found, const std::string& expected) const {
    throw InputError(file, line(), name + " " + found, expected);
  }
  double number(const std::string& expected) const {
    double value = 0;
    if (!node.IsScalar() || parseNumber(node.Scalar(), value) != NumberKind::finite)
      complain("is " + shown(node), expected);
    return value;
  }
};

/// A map whose keys appear once: of two, one would be lost.
struct Section {
  YAML::Node node;
  const std::string& file;
  std::string name;  ///< cam0; empty for the file as a whole

  Section(const YAML::Node& map, const std::string& file_name, std::string section)
      : node(map), file(file_name), name(std::move(section)) {
    std::set<std::string> keys;
    for (const auto& entry : node) {
      if (entry.first.IsScalar() && !keys.insert(entry.first.Scalar()).second) {
        throw InputError(file, lineOf(entry.first), "'" + printable(entry.first.Scalar()) + "' appears twice",
                         "it once");
      }
    }
  }
  std::string nameOf(const char* key) const { return name.empty() ? key : name + "'s " + key; }
  std::size_t line() const { return name.empty() ? 0 : lineOf(node); }
  bool has(const char* key) const { return node[key].IsDefined(); }
  std::optional<Named> find(const char* key) const {
    const YAML::Node value = node[key];
    if (!value.IsDefined() || value.IsNull()) return std::nullopt;
    return Named{value, file, nameOf(key)};
  }
  [[noreturn]] void complainMissing(const std::string& what, const std::string& expected) const {
    throw InputError(file, line(), name.empty() ? "there is no " + what : name + " has no " + what, expected);
  }
};

double density(const Section& sensor, const char* key) {
  const auto value = sensor.find(key);
  if (!value) {
    throw InputError(sensor.file, 0, fmt::format("there is no {}", key), "the densities of noise and walk of an IMU");
  }
  double number = 0;
  if (!value->node.IsScalar() || parseNumber(value->node.Scalar(), number) != NumberKind::finite || number < 0) {
    throw InputError(sensor.file, value->line(), fmt::format("{} is {}", key, shown(value->node)),
                     "a number of zero or more");
  }
  return number;
}

ImuNoise<double> imuNoise(const Section& sensor) {
  return {.gyroscope = density(sensor, densities[0]),
          .accelerometer = density(sensor, densities[1]),
          .gyroscope_walk = density(sensor, densities[2]),
          .accelerometer_walk = density(sensor, densities[3])};
}

/// A list of numbers.
std::vector<double> numbers(const Named& list, const std::string& expected) {
  if (!list.node.IsSequence()) list.complain("is " + shown(list.node), expected);
  std::vector<double> values;
  for (const YAML::Node& node : list.node) values.push_back(Named{node, list.file, list.name}.number(expected));
  return values;
}

/// A rigid motion as rows (4x4, or 3x4), as 16 or 12 numbers in a row, or as OpenCV's map of rows, cols and data.
SE3d rigidMotion(const Named& matrix) {
  const std::string expected = "4 rows of 4 numbers, the last 0 0 0 1";
  const auto complainSize = [&](const std::string& found) { matrix.complain(found, expected); };
  const YAML::Node& map = matrix.node;
  if (map.IsMap()) {
    const YAML::Node rows = map["rows"], cols = map["cols"], list = map["data"];
    if (!rows || !cols || !list || !list.IsSequence()) complainSize("is a map without rows, cols and data");
    const double r = Named{rows, matrix.file, matrix.name + ": rows"}.number("4");
    const double c = Named{cols, matrix.file, matrix.name + ": cols"}.number("4");
    if ((r != 3 && r != 4) || c != 4) complainSize(fmt::format("is {} by {}", r, c));
    if (list.size() != static_cast<std::size_t>(4 * r)) complainSize(fmt::format("has {} numbers", list.size()));
  }
  const YAML::Node data = map.IsMap() ? map["data"] : map;
  if (!data.IsSequence()) complainSize("is " + shown(data));
  std::vector<std::pair<double, std::size_t>> values;  // and their lines
  const auto take = [&](const YAML::Node& node) {
    values.emplace_back(Named{node, matrix.file, matrix.name}.number("numbers"), lineOf(node));
  };
  const bool in_rows = data.size() <= 4;
  for (const YAML::Node& row : data) {
    if (!in_rows) {
      take(row);
      continue;
    }
    if (!row.IsSequence() || row.size() != 4) {
      throw InputError(matrix.file, lineOf(row),
                       fmt::format("a row of {} {}", matrix.name,
                                   row.IsSequence() ? fmt::format("has {} numbers", row.size()) : "is " + shown(row)),
                       expected);
    }
    for (const YAML::Node& cell : row) take(cell);
  }
  if (values.size() != 16 && values.size() != 12) {
    complainSize(in_rows ? fmt::format("has {} rows", data.size()) : fmt::format("has {} numbers", values.size()));
  }
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  for (int k = 0; k < 12; ++k) {
    const double value = values[static_cast<std::size_t>(k)].first;
    (k % 4 == 3 ? translation[k / 4] : rotation(k / 4, k % 4)) = value;
  }
  for (std::size_t k = 12; k < values.size(); ++k) {
    if (std::abs(values[k].first - (k == 15 ? 1 : 0)) > 1e-9) {
      throw InputError(matrix.file, values[k].second,
                       fmt::format("the last row of {} is {} {} {} {}", matrix.name, values[12].first, values[13].first,
                                   values[14].first, values[15].first),
                       "0 0 0 1");
    }
  }
  try {
    return SE3d(nearestRotation(rotation, rotation_tolerance, matrix.file, matrix.line()).rotation, translation);
  } catch (const InputError& error) {
    throw InputError(matrix.file, matrix.line(), matrix.name + ": " + error.found(), error.expected());
  }
}

Distortion distortionOf(const Section& section) {
  const char* expected = "radtan (radial-tangential), equidistant or none; others are not supported";
  const auto model = section.find("distortion_model");
  if (!model) section.complainMissing("distortion_model", expected);
  const std::string name = model->node.IsScalar() ? model->node.Scalar() : "";
  if (name == "none") return Distortion::none;
  if (name == "radtan" || name == "radial-tangential" || name == "plumb_bob") return Distortion::radtan;
  if (name == "equidistant") return Distortion::equidistant;
  model->complain("is " + shown(model->node), expected);
}

Eigen::Vector4d coefficientsOf(const Section& section, Distortion distortion) {
  const auto list = section.find(section.has("distortion_coeffs") ? "distortion_coeffs" : "distortion_coefficients");
  if (!list) {
    if (distortion == Distortion::none) return Eigen::Vector4d::Zero();
    section.complainMissing("distortion_coeffs", "four numbers");
  }
  const std::string expected =
      distortion == Distortion::equidistant ? "four numbers, k1 k2 k3 k4" : "four numbers, k1 k2 p1 p2";
  const std::vector<double> values = numbers(*list, expected);
  if (distortion == Distortion::none) {
    if (std::any_of(values.begin(), values.end(), [](double x) { return x != 0; }))
      list->complain("are not zero", "none for the distortion_model none");
    return Eigen::Vector4d::Zero();
  }
  if (values.size() != 4) {
    list->complain(fmt::format("{} {}", values.size() == 1 ? "is" : "are", values.size()), expected);
  }
  return Eigen::Vector4d(values[0], values[1], values[2], values[3]);
}

Camera cameraOf(const Section& section) {
  Camera camera;
  if (const auto model = section.find("camera_model");
      model && !(model->node.IsScalar() && model->node.Scalar() == "pinhole"))
    model->complain("is " + shown(model->node), "pinhole; others are not supported");
  const char* expected = "four numbers, fu fv cu cv in pixels";
  const auto intrinsics = section.find("intrinsics");
  if (!intrinsics) section.complainMissing("intrinsics", expected);
  const std::vector<double> values = numbers(*intrinsics, expected);
  if (values.size() != 4) intrinsics->complain(fmt::format("are {}", values.size()), expected);
  for (const std::size_t i : {0U, 1U}) {
    if (!(values[i] > 0)) intrinsics->complain(fmt::format("have the focal length {}", values[i]), "a positive one");
  }
  camera.fu = values[0], camera.fv = values[1], camera.cu = values[2], camera.cv = values[3];
  camera.distortion = distortionOf(section);
  camera.coefficients = coefficientsOf(section, camera.distortion);
  if (const auto resolution = section.find("resolution")) {
    const char* size = "two whole numbers, width and height in pixels";
    const std::vector<double> pixels = numbers(*resolution, size);
    const bool fine = pixels.size() == 2 && std::all_of(pixels.begin(), pixels.end(), [](double x) {
                        return x >= 1 && x <= 1e6 && x == std::floor(x);
                      });
    if (!fine) resolution->complain(fmt::format("is {}", fmt::join(pixels, " by ")), size);
    camera.width = static_cast<int>(pixels[0]), camera.height = static_cast<int>(pixels[1]);
  }
  return camera;
}

/// What one file says. A pose by T_BS is to the body's axes, which another file may set apart from the sensor's.
struct Parsed {
  Calibration calibration;
  std::vector<bool> to_body;       ///< of each camera: imu_T_cam is body_T_cam still
  std::optional<SE3d> body_T_imu;  ///< where the sensor has a T_BS
  std::string file;
};

void addCamera(const Section& section, std::string name, Parsed& parsed) {
  CameraCalibration result;
  result.name = std::move(name);
  result.camera = cameraOf(section);
  const auto T_cam_imu = section.find("T_cam_imu"), T_imu_cam = section.find("T_imu_cam"), T_BS = section.find("T_BS");
  if (T_imu_cam) result.imu_T_cam = rigidMotion(*T_imu_cam);
  if (T_cam_imu) {
    const SE3d inverse = rigidMotion(*T_cam_imu).inverse();
    if (T_imu_cam) {
      const SE3d difference = result.imu_T_cam.inverse() * inverse;
      const double turn = difference.so3().log().norm(), shift = difference.translation().norm();
      if (!(turn < pose_tolerance && shift < pose_tolerance)) {
        T_cam_imu->complain(fmt::format("is not the inverse of T_imu_cam in line {}: {:.3g} rad and {:.3g} m from it",
                                        T_imu_cam->line(), turn, shift),
                            "one of the two, or both agreeing");
      }
    } else {
      result.imu_T_cam = inverse;
    }
  }
  const bool to_body = !T_cam_imu && !T_imu_cam;
  if (to_body) {
    if (!T_BS) {
      section.complainMissing(
          "pose on the IMU",
          "T_cam_imu (takes the IMU's coordinates to the camera's) or T_imu_cam (its inverse), or EuRoC's T_BS");
    }
    result.imu_T_cam = rigidMotion(*T_BS);
  } else if (T_BS) {
    T_BS->complain("stands beside T_cam_imu or T_imu_cam", "one of them");
  }
  if (const auto shift = section.find("timeshift_cam_imu")) result.timeshift_cam_imu = shift->number("seconds");
  parsed.calibration.cameras.push_back(std::move(result));
  parsed.to_body.push_back(to_body);
}

/// cam0, cam12.
bool isCameraName(const std::string& key) {
  return key.size() > 3 && key.compare(0, 3, "cam") == 0 && key.find_first_not_of("0123456789", 3) == std::string::npos;
}

/// What a sensor.yaml is called by: the directory that it lies in.
std::string directoryOf(const std::string& path) {
  const std::size_t end = path.rfind('/');
  if (end == std::string::npos || end == 0) return {};
  const std::size_t begin = path.rfind('/', end - 1);
  return path.substr(begin == std::string::npos ? 0 : begin + 1, end - (begin == std::string::npos ? 0 : begin + 1));
}

void addImu(const Section& section, Parsed& parsed) {
  parsed.calibration.imu = imuNoise(section);
  if (const auto T_BS = section.find("T_BS")) parsed.body_T_imu = rigidMotion(*T_BS);
}

/// Calls a function with the file's root; what yaml-cpp throws becomes an InputError.
template <class Function>
auto withRoot(std::string_view text, const std::string& name, Function&& function) {
  // OpenCV's directive is none of YAML's; as a comment it keeps the numbers of the lines.
  std::string yaml(text);
  if (yaml.rfind("%YAML:", 0) == 0) yaml[0] = '#';
  try {
    const YAML::Node root = YAML::Load(yaml);
    if (!root.IsMap()) throw InputError(name, 0, "this is no YAML file of named values");
    return function(Section(root, name, ""));
  } catch (const YAML::Exception& error) {
    throw InputError(name, static_cast<std::size_t>(error.mark.line + 1), "YAML: " + printable(error.msg, 200));
  }
}

Parsed parseFile(std::string_view text, const std::string& name) {
  return withRoot(text, name, [&](const Section& root) {
    Parsed parsed;
    parsed.file = name;
    for (const auto& entry : root.node) {
      if (!entry.first.IsScalar()) continue;
      const std::string key = entry.first.Scalar();
      if (!entry.second.IsMap()) continue;
      if (isCameraName(key)) addCamera(Section(entry.second, name, key), key, parsed);
      if (key == "imu0") addImu(Section(entry.second, name, key), parsed);
    }
    const auto sensor_type = root.find("sensor_type");
    const std::string type = sensor_type && sensor_type->node.IsScalar() ? sensor_type->node.Scalar() : "";
    if (type == "camera" || (type.empty() && root.has("intrinsics"))) {
      const std::string directory = directoryOf(name);
      addCamera(root, directory.empty() ? "cam0" : printable(directory), parsed);
    }
    const bool any_density = std::any_of(densities.begin(), densities.end(), [&](auto* key) { return root.has(key); });
    if (!parsed.calibration.imu && (type == "imu" || any_density)) addImu(root, parsed);
    if (!parsed.calibration.imu && parsed.calibration.cameras.empty()) {
      throw InputError(name, 0, "there is neither a camera nor an IMU",
                       "cam0 or imu0 of Kalibr's and OpenVINS' chains, or EuRoC's sensor.yaml");
    }
    return parsed;
  });
}

/// Poses on the body become poses on the sensor, once all files are read.
Calibration finished(Parsed&& parsed) {
  for (std::size_t i = 0; parsed.body_T_imu && i < parsed.to_body.size(); ++i) {
    SE3d& pose = parsed.calibration.cameras[i].imu_T_cam;
    if (parsed.to_body[i]) pose = parsed.body_T_imu->inverse() * pose;
  }
  return std::move(parsed.calibration);
}

}  // namespace

Calibration parseCalibration(std::string_view text, const std::string& name) { return finished(parseFile(text, name)); }

Calibration readCalibration(const std::vector<std::string>& paths) {
  Parsed all;
  std::string file_of_imu;
  std::vector<std::string> file_of_camera;
  for (const std::string& path : paths) {
    const TextFile file = loadText(path);
    Parsed parsed = parseFile(file.text, file.name);
    if (parsed.calibration.imu) {
      if (all.calibration.imu)
        throw InputError(file.name, 0, "it has an IMU, as has " + file_of_imu, "one in all files");
      all.calibration.imu = parsed.calibration.imu;
      all.body_T_imu = parsed.body_T_imu;
      file_of_imu = file.name;
    }
    for (std::size_t i = 0; i < parsed.calibration.cameras.size(); ++i) {
      CameraCalibration& camera = parsed.calibration.cameras[i];
      const std::vector<CameraCalibration>& others = all.calibration.cameras;
      const auto same =
          std::find_if(others.begin(), others.end(), [&](const auto& c) { return c.name == camera.name; });
      if (same != others.end()) {
        const auto place = static_cast<std::size_t>(same - others.begin());
        throw InputError(file.name, 0, "it has " + camera.name + ", as has " + file_of_camera[place],
                         "each camera once");
      }
      all.calibration.cameras.push_back(std::move(camera));
      all.to_body.push_back(parsed.to_body[i]);
      file_of_camera.push_back(file.name);
    }
  }
  return finished(std::move(all));
}

ImuNoise<double> parseImuNoise(std::string_view text, const std::string& name) {
  return withRoot(text, name, [&](const Section& root) {
    const YAML::Node section = root.node["imu0"];
    return imuNoise(section && section.IsMap() ? Section(section, name, "imu0") : root);
  });
}

ImuNoise<double> readImuNoise(const std::string& path) {
  const TextFile file = loadText(path);
  return parseImuNoise(file.text, file.name);
}

}  // namespace liestat::cli
