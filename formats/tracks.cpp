#include <formats/tracks.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <unordered_map>
#include <utility>

#include <formats/input_error.hpp>
#include <formats/numeric_table.hpp>
#include <formats/detail/rotation_matrix.hpp>
#include <formats/text.hpp>

namespace liestat {
namespace {

struct NamedValue {
  double value;
  std::size_t line;
};

std::map<std::string, NamedValue> readNamedValues(const TextFile& file) {
  LineReader reader(file.text);
  std::vector<std::string_view> fields;
  if (!reader.next()) throw InputError(file.name, 0, "the file is empty", "rows name,value");
  splitFields(reader.line(), Separator::comma, fields);
  if (fields.size() != 2 || fields[0] != "name" || fields[1] != "value") {
    throw InputError(file.name, reader.number(), "the header is '" + printable(reader.line()) + "'", "name,value");
  }
  std::map<std::string, NamedValue> values;
  while (reader.next()) {
    splitFields(reader.line(), Separator::comma, fields);
    if (fields.size() != 2) {
      throw InputError(file.name, reader.number(),
                       fmt::format("{} {}", fields.size(), fields.size() == 1 ? "field" : "fields"), "name,value");
    }
    std::string name(fields[0]);
    const double value = numberField(fields[1], printable(name), file.name, reader.number());
    const auto [place, is_new] = values.emplace(std::move(name), NamedValue{value, reader.number()});
    if (!is_new)
      throw InputError(file.name, reader.number(), "'" + printable(place->first) + "' appears twice", "it once");
  }
  return values;
}

double positive(const TextFile& file, std::string_view name, const NamedValue& named) {
  if (named.value > 0) return named.value;
  throw InputError(file.name, named.line, fmt::format("{} is {}", name, named.value), "a positive number");
}

}  // namespace

std::vector<StereoObservation> readStereoTracks(const std::string& path) {
  const NumericTable table = readTable(path, {"frame", "track", "uL", "vL", "uR", "vR"});
  std::vector<StereoObservation> observations;
  observations.reserve(table.rows());
  for (std::size_t row = 0; row < table.rows(); ++row) {
    observations.push_back(
        {table.index(row, 0), table.index(row, 1), table(row, 2), table(row, 3), table(row, 4), table(row, 5)});
  }
  return observations;
}

std::vector<CameraPose> readCameraPoses(const std::string& path) {
  const NumericTable table = readTable(
      path, {"frame", "t_s", "R00", "R01", "R02", "R10", "R11", "R12", "R20", "R21", "R22", "cx", "cy", "cz"});
  std::vector<CameraPose> poses;
  poses.reserve(table.rows());
  std::unordered_map<std::size_t, std::size_t> seen;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    CameraPose pose;
    pose.frame = table.index(row, 0);
    const auto [first, is_new] = seen.emplace(pose.frame, table.line(row));
    if (!is_new)
      throw InputError(table.file(), table.line(row),
                       fmt::format("frame {} again, as in line {}", pose.frame, first->second), "it once");
    pose.t = table(row, 1);
    Eigen::Matrix3d matrix;
    for (int i = 0; i < 9; ++i) matrix(i / 3, i % 3) = table(row, 2 + static_cast<std::size_t>(i));
    pose.R_camera_world =
        detail::nearestRotation(matrix, detail::rotation_tolerance, table.file(), table.line(row)).rotation.matrix();
    pose.c = Eigen::Vector3d(table(row, 11), table(row, 12), table(row, 13));
    poses.push_back(pose);
  }
  return poses;
}

StereoCamera readStereoCamera(const std::string& path) {
  const TextFile file = loadText(path);
  const std::map<std::string, NamedValue> values = readNamedValues(file);
  const auto required = [&](const char* name) -> const NamedValue& {
    const auto found = values.find(name);
    if (found == values.end())
      throw InputError(file.name, 0, fmt::format("there is no row '{}'", name), "rows fu, fv, cu, cv and b");
    return found->second;
  };
  StereoCamera camera;
  camera.fu = positive(file, "fu", required("fu"));
  camera.fv = positive(file, "fv", required("fv"));
  camera.cu = required("cu").value;
  camera.cv = required("cv").value;
  camera.b = positive(file, "b", required("b"));

  const std::array<const char*, 4> names = {"y_var0", "y_var1", "y_var2", "y_var3"};
  const auto there =
      std::count_if(names.begin(), names.end(), [&](const char* name) { return values.count(name) > 0; });
  if (there == 0) return camera;
  Eigen::Vector4d variance;
  for (int i = 0; i < 4; ++i) {
    const char* name = names[static_cast<std::size_t>(i)];
    const auto found = values.find(name);
    if (found == values.end())
      throw InputError(file.name, 0, fmt::format("there is no row '{}'", name), "all of y_var0 to y_var3 or none");
    variance(i) = positive(file, name, found->second);
  }
  camera.pixel_variance = variance;
  return camera;
}

std::vector<Eigen::Vector3d> readLandmarks(const std::string& path) {
  const NumericTable table = readTable(path, {"x", "y", "z"});
  std::vector<Eigen::Vector3d> landmarks;
  landmarks.reserve(table.rows());
  for (std::size_t row = 0; row < table.rows(); ++row)
    landmarks.emplace_back(table(row, 0), table(row, 1), table(row, 2));
  return landmarks;
}

Matches readMatches(const std::string& path) {
  const TextFile file = loadText(path);
  Matches matches;
  const NumericTable any = parseTable(file.text, file.name, {}, {"frame", "track"});
  if (!any.has("frame") || !any.has("track")) {
    const NumericTable pairs = parseTable(file.text, file.name, {"x1", "y1", "x2", "y2"});
    for (std::size_t i = 0; i < pairs.rows(); ++i) {
      matches.points.emplace_back(pairs(i, 0), pairs(i, 1), pairs(i, 2), pairs(i, 3));
    }
    return matches;
  }
  const NumericTable table = parseTable(file.text, file.name, {"frame", "track", "u", "v"}, {"sigma"});
  const bool has_sigmas = table.has("sigma");
  const std::size_t sigma = table.column("sigma");
  std::set<std::size_t> frames;
  for (std::size_t i = 0; i < table.rows(); ++i) frames.insert(table.index(i, 0));
  if (frames.size() != 2) {
    throw InputError(file.name, 0, fmt::format("tracks of {} images", frames.size()), "two, or rows x1,y1,x2,y2");
  }
  std::map<std::size_t, std::array<std::optional<std::size_t>, 2>> rows;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    std::optional<std::size_t>& row = rows[table.index(i, 1)][table.index(i, 0) == *frames.begin() ? 0 : 1];
    if (row) throw InputError(file.name, table.line(i), "this frame and track again", "them once");
    row = i;
  }
  std::vector<double> variances;
  for (const auto& [track, both] : rows) {
    if (!both[0] || !both[1]) continue;
    matches.points.emplace_back(table(*both[0], 2), table(*both[0], 3), table(*both[1], 2), table(*both[1], 3));
    if (!has_sigmas) continue;
    const double first = sigmaOfTrack(table, *both[0], sigma), second = sigmaOfTrack(table, *both[1], sigma);
    variances.push_back((first * first + second * second) / 2);
  }
  if (matches.points.empty()) throw InputError(file.name, 0, "no track is in both images", "tracks of two images");
  if (!has_sigmas) return matches;
  std::vector<double> sorted = variances;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
  const double most = 4 * sorted[sorted.size() / 2];
  std::size_t kept = 0;
  double sum = 0;
  for (std::size_t i = 0; i < variances.size(); ++i) {
    if (variances[i] > most) continue;
    sum += variances[i];
    matches.points[kept++] = matches.points[i];
  }
  matches.left_out = variances.size() - kept;
  matches.points.resize(kept);
  matches.sigma = std::sqrt(sum / static_cast<double>(kept));
  return matches;
}

}  // namespace liestat
