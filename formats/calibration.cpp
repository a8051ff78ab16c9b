#include <formats/calibration.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <utility>

#include <formats/input_error.hpp>
#include <formats/text.hpp>
#include <formats/detail/yaml_values.hpp>

namespace liestat {
namespace {

/// T_cam_imu and T_imu_cam of one file may differ by this, rad and m: they are rounded each for itself.
constexpr double pose_tolerance = 1e-3;

constexpr std::array densities = {"gyroscope_noise_density", "accelerometer_noise_density", "gyroscope_random_walk",
                                  "accelerometer_random_walk"};

double density(const detail::Section& sensor, const char* key) {
  const auto value = sensor.find(key);
  if (!value) {
    throw InputError(sensor.file, 0, fmt::format("there is no {}", key), "the densities of noise and walk of an IMU");
  }
  double number = 0;
  if (!value->node.IsScalar() || parseNumber(value->node.Scalar(), number) != NumberKind::finite || number < 0) {
    throw InputError(sensor.file, value->line(), fmt::format("{} is {}", key, detail::shown(value->node)),
                     "a number of zero or more");
  }
  return number;
}

ImuNoise<double> imuNoise(const detail::Section& sensor) {
  return {.gyroscope = density(sensor, densities[0]),
          .accelerometer = density(sensor, densities[1]),
          .gyroscope_walk = density(sensor, densities[2]),
          .accelerometer_walk = density(sensor, densities[3])};
}

Distortion distortionOf(const detail::Section& section) {
  const char* expected = "radtan (radial-tangential), equidistant or none; others are not supported";
  const auto model = section.find("distortion_model");
  if (!model) section.complainMissing("distortion_model", expected);
  const std::string name = model->node.IsScalar() ? model->node.Scalar() : "";
  if (name == "none") return Distortion::none;
  if (name == "radtan" || name == "radial-tangential" || name == "plumb_bob") return Distortion::radtan;
  if (name == "equidistant") return Distortion::equidistant;
  model->complain("is " + detail::shown(model->node), expected);
}

Eigen::Vector4d coefficientsOf(const detail::Section& section, Distortion distortion) {
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

/// Kalibr's camera models: the lens that goes before the distortion, and its numbers before fu fv cu cv.
struct CameraModel {
  const char* name;
  Distortion lens;
  const char* expected;  ///< of the intrinsics
  std::size_t own;       ///< numbers
};
constexpr CameraModel camera_models[] = {{"pinhole", Distortion::none, "four numbers, fu fv cu cv in pixels", 0},
                                         {"omni", Distortion::omni, "five numbers, xi fu fv cu cv", 1},
                                         {"ds", Distortion::double_sphere, "six numbers, xi alpha fu fv cu cv", 2},
                                         {"eucm", Distortion::eucm, "six numbers, alpha beta fu fv cu cv", 2}};

CameraModel modelOf(const detail::Section& section) {
  const auto model = section.find("camera_model");
  if (!model) return camera_models[0];
  for (const CameraModel& known : camera_models) {
    if (model->node.IsScalar() && model->node.Scalar() == known.name) return known;
  }
  model->complain("is " + detail::shown(model->node), "pinhole, omni, ds or eucm; others are not supported");
}

Camera cameraOf(const detail::Section& section) {
  Camera camera;
  const CameraModel model = modelOf(section);
  const auto intrinsics = section.find("intrinsics");
  if (!intrinsics) section.complainMissing("intrinsics", model.expected);
  std::vector<double> values = numbers(*intrinsics, model.expected);
  if (values.size() != 4 + model.own) intrinsics->complain(fmt::format("are {}", values.size()), model.expected);
  const std::vector<double> own(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(model.own));
  values.erase(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(model.own));
  for (const std::size_t i : {0U, 1U}) {
    if (!(values[i] > 0)) intrinsics->complain(fmt::format("have the focal length {}", values[i]), "a positive one");
  }
  // Beyond these the models are none: alpha is a share, and beta and the mirror stretch.
  const bool eucm = model.lens == Distortion::eucm, spheres = model.lens == Distortion::double_sphere;
  if ((eucm && !(own[0] >= 0 && own[0] <= 1 && own[1] > 0)) || (spheres && !(own[1] >= 0 && own[1] <= 1)) ||
      (model.lens == Distortion::omni && !(own[0] >= 0))) {
    intrinsics->complain(fmt::format("begin with {}", fmt::join(own, " ")),
                         "alpha from 0 to 1, a positive beta, and no negative xi of omni");
  }
  camera.fu = values[0], camera.fv = values[1], camera.cu = values[2], camera.cv = values[3];
  camera.distortion = distortionOf(section);
  camera.coefficients = coefficientsOf(section, camera.distortion);
  if (model.lens != Distortion::none) {
    const bool bends = camera.distortion != Distortion::none;
    if (bends && (model.lens != Distortion::omni || camera.distortion == Distortion::equidistant)) {
      section.find("distortion_model")
          ->complain("does not go with the camera_model " + std::string(model.name),
                     model.lens == Distortion::omni ? "radtan or none" : "none");
    }
    camera.distortion = model.lens;
    if (model.lens == Distortion::omni) {
      camera.mirror = own[0];
    } else {
      camera.coefficients = Eigen::Vector4d(own[0], own[1], 0, 0);
    }
  }
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

/// The contents of one file. A pose by T_BS is to the body's axes, which another file may set apart from the sensor's.
struct Parsed {
  Calibration calibration;
  std::vector<bool> to_body;       ///< for each camera: imu_T_cam is still body_T_cam
  std::optional<SE3d> body_T_imu;  ///< where the sensor has a T_BS
  std::string file;
};

void addCamera(const detail::Section& section, std::string name, Parsed& parsed, bool needs_pose = true) {
  CameraCalibration result;
  result.name = std::move(name);
  result.camera = cameraOf(section);
  const auto T_cam_imu = section.find("T_cam_imu"), T_imu_cam = section.find("T_imu_cam"), T_BS = section.find("T_BS");
  if (T_imu_cam) result.imu_T_cam = detail::rigidMotion(*T_imu_cam);
  if (T_cam_imu) {
    const SE3d inverse = detail::rigidMotion(*T_cam_imu).inverse();
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
  const bool to_body = !T_cam_imu && !T_imu_cam && (needs_pose || T_BS);
  if (to_body) {
    if (!T_BS) {
      section.complainMissing(
          "pose on the IMU",
          "T_cam_imu (takes the IMU's coordinates to the camera's) or T_imu_cam (its inverse), or EuRoC's T_BS");
    }
    result.imu_T_cam = detail::rigidMotion(*T_BS);
  } else if (T_BS && (T_cam_imu || T_imu_cam)) {
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

/// The name of a sensor.yaml's sensor: the directory that the file lies in.
std::string directoryOf(const std::string& path) {
  const std::size_t end = path.rfind('/');
  if (end == std::string::npos || end == 0) return {};
  const std::size_t begin = path.rfind('/', end - 1);
  return path.substr(begin == std::string::npos ? 0 : begin + 1, end - (begin == std::string::npos ? 0 : begin + 1));
}

void addImu(const detail::Section& section, Parsed& parsed) {
  parsed.calibration.imu = imuNoise(section);
  if (const auto T_BS = section.find("T_BS")) parsed.body_T_imu = detail::rigidMotion(*T_BS);
}

/// A camera of OpenCV's FileStorage, or of ROS.
void addStoredCamera(const detail::Section& root, Parsed& parsed) {
  const auto findAny = [&](std::initializer_list<const char*> keys) {
    for (const char* key : keys) {
      if (auto found = root.find(key)) return found;
    }
    return std::optional<detail::NamedNode>();
  };
  const auto valuesOf = [](const detail::NamedNode& matrix, const std::string& expected) {
    detail::NamedNode data = matrix;
    if (matrix.node.IsMap() && matrix.node["data"].IsDefined()) data.node.reset(matrix.node["data"]);
    return detail::numbers(data, expected);
  };
  CameraCalibration result;
  result.name = "camera";
  Camera& camera = result.camera;
  const auto matrix = findAny({"camera_matrix", "Camera_Matrix", "cameraMatrix", "K"});
  const std::string rows = "nine numbers, fu 0 cu 0 fv cv 0 0 1";
  const std::vector<double> k = valuesOf(*matrix, rows);
  if (k.size() != 9) matrix->complain(fmt::format("has {} numbers", k.size()), rows);
  if (!(k[0] > 0) || !(k[4] > 0)) matrix->complain(fmt::format("has the focal lengths {} and {}", k[0], k[4]), rows);
  if (k[1] != 0) matrix->complain(fmt::format("has the skew {}", k[1]), "none");
  camera.fu = k[0], camera.cu = k[2], camera.fv = k[4], camera.cv = k[5];
  const auto list =
      findAny({"distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "dist_coeffs", "distortion", "D"});
  const auto model = findAny({"distortion_model"}), fisheye = findAny({"fisheye_model"});
  const std::string word = model && model->node.IsScalar() ? model->node.Scalar() : "";
  const bool bends_by_angle = word == "equidistant" || word == "fisheye" ||
                              (fisheye && fisheye->node.IsScalar() && fisheye->node.Scalar() != "0");
  if (model && !bends_by_angle && word != "plumb_bob" && word != "rational_polynomial") {
    model->complain("is " + detail::shown(model->node), "plumb_bob, rational_polynomial or equidistant");
  }
  if (list) {
    const std::string expected = bends_by_angle ? "four numbers, k1 k2 k3 k4" : "k1 k2 p1 p2 and k3, others zero";
    const std::vector<double> c = valuesOf(*list, expected);
    const std::size_t used = bends_by_angle ? 4 : 5;
    if (c.size() < 4 || c.size() > 14 || (bends_by_angle && c.size() != 4)) {
      list->complain(fmt::format("are {}", c.size()), expected);
    }
    for (std::size_t i = used; i < c.size(); ++i) {
      if (c[i] != 0) list->complain(fmt::format("have {} in place {}", c[i], i + 1), expected);
    }
    camera.distortion = bends_by_angle ? Distortion::equidistant : Distortion::radtan;
    camera.coefficients << c[0], c[1], c[2], c[3];
    if (!bends_by_angle && c.size() > 4) camera.k3 = c[4];
  }
  const auto sizeOf = [&](std::initializer_list<const char*> keys) {
    const auto size = findAny(keys);
    if (!size) return 0;
    const double pixels = size->number("whole pixels");
    if (!(pixels >= 1 && pixels <= 1e6 && pixels == std::floor(pixels))) {
      size->complain(fmt::format("is {}", pixels), "whole pixels");
    }
    return static_cast<int>(pixels);
  };
  camera.width = sizeOf({"image_width", "image_Width", "width"});
  camera.height = sizeOf({"image_height", "image_Height", "height"});
  parsed.calibration.cameras.push_back(std::move(result));
}

/// OpenCV's XML as YAML, line by line: elements that hold elements are maps, and a matrix's numbers are a list.
std::string yamlOfXml(std::string_view text, const std::string& file) {
  const auto refuse = [&](std::size_t at, const std::string& found) {
    return InputError(
        file,
        1 + static_cast<std::size_t>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n')),
        found, "OpenCV's FileStorage: <opencv_storage> with <camera_matrix>");
  };
  std::string yaml;
  std::vector<std::string> open;
  std::size_t at = 0;
  const auto lines = [&](std::string_view part) {
    return std::string(static_cast<std::size_t>(std::count(part.begin(), part.end(), '\n')), '\n');
  };
  while (true) {
    const std::size_t begin = text.find('<', at);
    if (begin == std::string_view::npos) break;
    std::string content(text.substr(at, begin - at));
    const bool comment = text.substr(begin, 4) == "<!--";
    const std::size_t end = text.find(comment ? "-->" : ">", begin);
    if (end == std::string_view::npos) throw refuse(begin, "a tag is not closed");
    std::string tag(text.substr(begin + 1, end - begin - 1));
    at = end + (comment ? 3 : 1);
    const std::string skipped = lines(text.substr(begin, at - begin));
    if (comment || tag[0] == '?' || tag[0] == '!') {
      yaml += lines(content) + skipped;
      continue;
    }
    if (tag[0] != '/') {
      yaml += lines(content) + skipped;
      const std::string name = tag.substr(0, tag.find_first_of(" \t\r\n/"));
      if (name.empty() || name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-") !=
                              std::string::npos) {
        throw refuse(begin, "a tag has the name '" + printable(name) + "'");
      }
      yaml += (open.empty() ? "" : "\"" + name + "\": ");
      if (tag.back() == '/') {
        yaml += "\"\",";
      } else {
        open.push_back(name);
        // A map or a value: the next tag tells.
        const std::size_t next = text.find('<', at);
        const bool holds = next != std::string_view::npos && text.substr(next, 2) != "</";
        if (holds) yaml += "{";
      }
      continue;
    }
    if (open.empty() || tag.substr(1) != open.back())
      throw refuse(begin, "</" + printable(tag.substr(1)) + "> closes nothing");
    const bool held = !yaml.empty() && yaml.find_last_not_of(" \n\t\r") != std::string::npos &&
                      (yaml[yaml.find_last_not_of(" \n\t\r")] == ',' || yaml[yaml.find_last_not_of(" \n\t\r")] == '{');
    if (held) {
      yaml += lines(content) + skipped + "}";
    } else if (open.back() == "data") {
      std::string list;
      bool between = false;
      for (const char c : content) {
        const bool blank = c == ' ' || c == '\t' || c == '\r' || c == '\n';
        if (!blank && between) list += ',';
        list += blank ? (c == '\n' ? '\n' : ' ') : c;
        between = blank && (between || list.find_first_not_of(" \n") != std::string::npos);
      }
      yaml.append("[").append(list).append("]").append(skipped);
    } else {
      std::string value = content;
      std::replace(value.begin(), value.end(), '"', ' ');
      yaml.append("\"").append(value).append("\"").append(skipped);
    }
    open.pop_back();
    if (!open.empty()) yaml += ",";
  }
  if (!open.empty()) throw refuse(text.size(), "<" + printable(open.back()) + "> is not closed");
  return yaml;
}

Parsed parseFile(std::string_view text, const std::string& name, bool needs_pose = true) {
  std::string converted;
  if (!needs_pose && text.substr(0, 5) == "<?xml") text = converted = yamlOfXml(text, name);
  return detail::withRoot(text, name, [&](const detail::Section& root) {
    Parsed parsed;
    parsed.file = name;
    if (!needs_pose) {
      for (const char* key : {"camera_matrix", "Camera_Matrix", "cameraMatrix", "K"}) {
        if (root.has(key)) return addStoredCamera(root, parsed), parsed;
      }
    }
    for (const auto& entry : root.node) {
      if (!entry.first.IsScalar()) continue;
      const std::string key = entry.first.Scalar();
      if (!entry.second.IsMap()) continue;
      if (isCameraName(key)) addCamera(detail::Section(entry.second, name, key), key, parsed, needs_pose);
      if (key == "imu0") addImu(detail::Section(entry.second, name, key), parsed);
    }
    const auto sensor_type = root.find("sensor_type");
    const std::string type = sensor_type && sensor_type->node.IsScalar() ? sensor_type->node.Scalar() : "";
    if (type == "camera" || (type.empty() && root.has("intrinsics"))) {
      const std::string directory = directoryOf(name);
      addCamera(root, directory.empty() ? "cam0" : printable(directory), parsed, needs_pose);
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

std::vector<CameraCalibration> parseCameras(std::string_view text, const std::string& name) {
  Parsed parsed = parseFile(text, name, false);
  if (parsed.calibration.cameras.empty()) {
    throw InputError(name, 0, "there is no camera in it",
                     "camera_matrix (OpenCV, ROS), cam0 (Kalibr, OpenVINS) or EuRoC's sensor.yaml");
  }
  return std::move(parsed.calibration.cameras);
}

std::vector<CameraCalibration> readCameras(const std::string& path) {
  const TextFile file = loadText(path);
  return parseCameras(file.text, file.name);
}

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
  return detail::withRoot(text, name, [&](const detail::Section& root) {
    const YAML::Node section = root.node["imu0"];
    return imuNoise(section && section.IsMap() ? detail::Section(section, name, "imu0") : root);
  });
}

ImuNoise<double> readImuNoise(const std::string& path) {
  const TextFile file = loadText(path);
  return parseImuNoise(file.text, file.name);
}

}  // namespace liestat
