// Poses alone: 4x4 matrices, the images of a reconstruction by COLMAP, the vertices of a graph. They are read only.
#include <formats/detail/rotation_matrix.hpp>
#include <formats/detail/rows.hpp>
#include <formats/detail/trajectory_formats.hpp>
#include <formats/detail/trajectory_rows.hpp>
#include <formats/input_error.hpp>
#include <formats/numeric_table.hpp>
#include <formats/pose_graph.hpp>
#include <formats/text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace liestat::detail {
namespace {

bool areWhole(const std::vector<std::string_view>& fields) {
  return std::all_of(fields.begin(), fields.end(), [](std::string_view field) { return isWhole(field); });
}

/// The pose of a matrix whose last row is 0 0 0 1.
void appendMatrix(const std::array<double, 16>& T, const TrajectorySource& source, Trajectory& trajectory,
                  std::size_t line) {
  const double tolerance = source.options.reading.norm_tolerance;
  if (std::abs(T[12]) + std::abs(T[13]) + std::abs(T[14]) + std::abs(T[15] - 1) > 1e-9) {
    const bool by_column = std::abs(T[3]) + std::abs(T[7]) + std::abs(T[11]) + std::abs(T[15] - 1) < 1e-9;
    throw InputError(trajectory.name, line,
                     fmt::format("the last row of the matrix is {} {} {} {}{}", T[12], T[13], T[14], T[15],
                                 by_column ? ": it is written column by column" : ""),
                     by_column ? "a matrix row by row" : "0 0 0 1");
  }
  Eigen::Matrix3d R;
  for (std::size_t k = 0; k < 9; ++k) R(static_cast<int>(k / 3), static_cast<int>(k % 3)) = T[4 * (k / 3) + k % 3];
  const NearestRotation nearest = nearestRotation(R, tolerance, trajectory.name, line, norm_remedy);
  if (nearest.error > 1e-12) {
    ++trajectory.n_normalised;
    trajectory.largest_norm_error = std::max(trajectory.largest_norm_error, nearest.error);
  }
  trajectory.poses.emplace_back(nearest.rotation, Eigen::Vector3d(T[3], T[7], T[11]));
  trajectory.lines.push_back(line);
}

/// The stamp in the name of an image: its digits, without directories and ending, if they are so many that they are no
/// number of a frame. Empty otherwise.
std::string_view stampOf(std::string_view name) {
  name = name.substr(name.find_last_of('/') + 1);
  name = name.substr(0, name.rfind('.'));
  const bool digits = !name.empty() && name.find_first_not_of("0123456789.") == std::string_view::npos;
  const bool is_stamp = digits && std::count(name.begin(), name.end(), '.') < 2 && name.find('.') != 0 &&
                        std::min(name.find('.'), name.size()) >= 10;
  return is_stamp ? name : std::string_view();
}

}  // namespace

bool looksLikeBlocks(std::string_view text) {
  LineReader reader(text);
  std::vector<std::string_view> fields;
  for (int row = 0; row < 4; ++row) {
    if (!reader.next()) return false;
    splitFields(reader.line(), Separator::comma_or_blanks, fields);
    if (row == 0 && fields.size() == 3 && areWhole(fields)) {
      row = -1;
      continue;
    }
    if (fields.size() != 4 || !looksNumeric(fields)) return false;
  }
  return true;
}

/// A matrix in a row of 16 numbers, or of 17 with the time before them; or in four rows of four, above which the three
/// whole numbers of Redwood's logs may stand.
void readMatrices(const TrajectorySource& source, Trajectory& trajectory) {
  LineReader reader(source.text);
  std::vector<std::string_view> fields;
  std::array<double, 16> T{};
  std::size_t filled = 0, begin = 0, width = 0;
  while (reader.next()) {
    const std::size_t line = reader.number();
    splitFields(reader.line(), Separator::comma_or_blanks, fields);
    const std::size_t n = fields.size();
    if (n == 3 && filled == 0 && (width == 0 || width == 4) && areWhole(fields)) continue;
    if (width == 0 && (n == 4 || n == 16 || n == 17)) width = n;
    if (n != width) {
      throwWrongWidth(
          n, width == 0 ? 16 : width,
          width == 0 ? "of a 4x4 matrix (or 17 with the time, or 4 in each of four rows)" : "as in the first row",
          trajectory.name, line);
    }
    if (n == 17) appendTime(trajectory, fields[0], line);
    if (filled == 0) begin = line;
    for (std::size_t k = n == 17 ? 1 : 0; k < n; ++k) {
      T[filled] = numberField(fields[k], "a number of the matrix", trajectory.name, line);
      ++filled;
    }
    if (filled < T.size()) continue;
    appendMatrix(T, source, trajectory, begin);
    filled = 0;
  }
  if (filled > 0) {
    throw InputError(trajectory.name, begin, fmt::format("a matrix of {} rows", filled / 4), "four rows");
  }
}

bool looksLikeColmap(std::string_view line) {
  std::vector<std::string_view> fields;
  splitFields(line, Separator::blanks, fields);
  if (fields.size() < 10 || !isWhole(fields[0]) || !isWhole(fields[8])) return false;
  double squared = 0, value = 0;
  for (std::size_t k = 1; k < 8; ++k) {
    if (parseNumber(fields[k], value) != NumberKind::finite) return false;
    if (k < 5) squared += value * value;
  }
  return std::abs(squared - 1) < 0.1;
}

/// COLMAP's images.txt: each image is a line IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, and a line of its points, which
/// is empty if it has none. The pose takes the world to the camera; here it is that of the camera in the world.
void readColmap(const TrajectorySource& source, Trajectory& trajectory) {
  constexpr std::string_view names[] = {"qw", "qx", "qy", "qz", "tx", "ty", "tz"};
  LineReader reader(source.text);
  std::vector<std::string_view> fields;
  std::vector<std::string> images;
  std::size_t points_line = 0;
  while (reader.next()) {
    const std::size_t line = reader.number();
    splitFields(reader.line(), Separator::blanks, fields);
    if (line == points_line && fields.size() % 3 == 0 && looksNumeric(fields)) continue;
    if (fields.size() < 10) {
      throwWrongWidth(fields.size(), 10, "(IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME)", trajectory.name, line);
    }
    points_line = line + 1;
    std::array<double, 7> p{};
    for (std::size_t k = 0; k < 7; ++k) p[k] = numberField(fields[k + 1], names[k], trajectory.name, line);
    const SE3d camera_T_world =
        poseOf({p[4], p[5], p[6]}, {p[1], p[2], p[3], p[0]}, source.options.reading.norm_tolerance, trajectory, line);
    trajectory.poses.push_back(camera_T_world.inverse());
    trajectory.lines.push_back(line);
    images.emplace_back(fields[9].data(), static_cast<std::size_t>(fields.back().end() - fields[9].begin()));
  }
  // The file has its images in no order.
  std::vector<std::size_t> order(images.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto before = [&](std::size_t i, std::size_t j) {
    return std::pair(images[i].size(), std::string_view(images[i])) <
           std::pair(images[j].size(), std::string_view(images[j]));
  };
  std::sort(order.begin(), order.end(), before);
  std::vector<SE3d> poses;
  std::vector<std::size_t> lines;
  for (const std::size_t i : order) poses.push_back(trajectory.poses[i]), lines.push_back(trajectory.lines[i]);
  trajectory.poses = std::move(poses), trajectory.lines = std::move(lines);
  const bool stamped =
      std::all_of(images.begin(), images.end(), [](const auto& name) { return !stampOf(name).empty(); });
  for (std::size_t k = 0; k < order.size() && stamped; ++k) {
    appendTime(trajectory, stampOf(images[order[k]]), trajectory.lines[k]);
  }
  trajectory.notes.push_back(stamped
                                 ? "poses of the cameras in the world; the times are the names of the images"
                                 : "poses of the cameras in the world, in the order of the images' names, which are "
                                   "no times");
}

/// The vertices of a graph in the order of their numbers.
void readVertices(const TrajectorySource& source, Trajectory& trajectory) {
  const PoseGraph graph = parseGraph(source.text, trajectory.name, true, source.options.reading.norm_tolerance);
  if (graph.vertices.empty()) throw InputError(trajectory.name, 0, "the graph has no vertices", "poses");
  std::vector<GraphVertex> vertices = graph.vertices;
  std::stable_sort(vertices.begin(), vertices.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  for (const GraphVertex& v : vertices) {
    if (!trajectory.ids.empty() && trajectory.ids.back() == v.id) {
      throw InputError(trajectory.name, v.line,
                       fmt::format("the vertex {} stands in line {} too", v.id, trajectory.lines.back()),
                       "each vertex once");
    }
    trajectory.poses.push_back(v.pose), trajectory.lines.push_back(v.line), trajectory.ids.push_back(v.id);
  }
  trajectory.n_normalised = graph.n_normalised;
  trajectory.notes.push_back(
      fmt::format("the {} vertices of the graph, in the order of their numbers", vertices.size()));
}

}  // namespace liestat::detail
