#include <formats/colmap.hpp>

#include <formats/input_error.hpp>
#include <formats/pose_graph.hpp>
#include <formats/text.hpp>
#include <stats/convention_presets.hpp>

#ifdef LIESTAT_HAS_SQLITE_LIBRARY
#include <formats/detail/sqlite_file.hpp>
#endif

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <map>
#include <memory>
#include <string_view>
#include <utility>

namespace liestat {

ColmapPair colmapPairOf(const ColmapMatches& m, const TwoViewMotionEstimate& estimate) {
  ColmapPair pair{.first = m.first,
                  .second = m.second,
                  .first_name = m.first_name,
                  .second_name = m.second_name,
                  .matches = m.matches.size(),
                  .inliers = estimate.inliers};
  pair.status = name(estimate.status), pair.reason = m.fault.empty() ? estimate.reason : m.fault;
  if (!m.fault.empty()) pair.status = name(Status::not_applicable);
  if (!m.fault.empty() || estimate.lattice.empty()) return pair;
  const TwoViewModelRow& row = estimate.chosenModel();
  pair.model = row.name, pair.rms = row.rms;
  if (!estimate.ok()) return pair;
  const bool known = estimate.calibrated;
  pair.matrix = estimate.matrix;
  pair.edge = edgeOf(estimate);
  if (estimate.equations == 1) {
    pair.config = pair.edge ? ColmapConfig::calibrated : ColmapConfig::uncalibrated;
  } else if (known && (row.name == "rotation" || row.name == "none")) {
    pair.config = ColmapConfig::panoramic;
  } else {
    pair.config = known && row.name == "homography" ? ColmapConfig::planar : ColmapConfig::planar_or_panoramic;
  }
  if (!known) {
    pair.reason = "no edge: a focal length is not known (prior_focal_length)";
  } else if (!pair.edge) {
    pair.reason = row.name == "homography" ? "no edge: two poses explain a plane"
                                           : "no edge: " + row.name + " tells no pose with a covariance";
  } else if (!pair.edge->information) {
    pair.reason = "in the CSV alone: " + row.name + " states that nothing turns, without any variance";
  }
  for (std::size_t i = 0; i < m.places.size(); ++i) {
    if (estimate.inlier[i]) pair.inlier_places.push_back(m.places[i]);
  }
  return pair;
}

std::string formatColmapGraph(const std::vector<ColmapPair>& pairs) {
  PoseGraph graph;
  // The vector part of g2o's quaternions is half of a rotation vector.
  Eigen::Matrix<double, 6, 1> units;
  units << 1, 1, 1, 2, 2, 2;
  for (const ColmapPair& p : pairs) {
    if (!p.edge || !p.edge->information) continue;
    graph.edges.push_back(
        {p.second, p.first, p.edge->second_T_first, units.asDiagonal() * *p.edge->information * units.asDiagonal()});
  }
  return formatGraph(graph, GraphFormat::g2o, *conventionPreset("g2o-half"));
}

std::string formatColmapEdges(const std::vector<ColmapPair>& pairs) {
  std::string text = "first,second,first_name,second_name,model,inliers,tx,ty,tz,qx,qy,qz,qw";
  const char* const names[] = {"tx", "ty", "tz", "rx", "ry", "rz"};
  const auto out = std::back_inserter(text);
  for (int i = 0; i < 6; ++i) {
    for (int j = i; j < 6; ++j) fmt::format_to(out, ",cov_{}_{}", names[i], names[j]);
  }
  text += '\n';
  const auto quoted = [](const std::string& name) {
    std::string q = "\"";
    for (const char c : name) q += c == '"' ? "\"\"" : std::string(1, c);
    return q + '"';
  };
  for (const ColmapPair& p : pairs) {
    if (!p.edge) continue;
    fmt::format_to(out, "{},{},{},{},{},{}", p.first, p.second, quoted(p.first_name), quoted(p.second_name), p.model,
                   p.inliers);
    for (const double x : p.edge->second_T_first.translation()) fmt::format_to(out, ",{:.17g}", x);
    for (const double x : p.edge->second_T_first.unit_quaternion().coeffs()) fmt::format_to(out, ",{:.17g}", x);
    for (int i = 0; i < 6; ++i) {
      for (int j = i; j < 6; ++j) fmt::format_to(out, ",{:.17g}", p.edge->covariance(i, j));
    }
    text += '\n';
  }
  return text;
}

#ifdef LIESTAT_HAS_SQLITE_LIBRARY

namespace {

using detail::SqliteFile;

constexpr sqlite3_int64 pair_base = 2147483647;  // pair_id = base · first + second

/// A camera as the database has it.
struct ColmapCamera {
  Camera camera;
  bool focal_length_is_known = false;
  std::string fault;
};
struct ColmapImage {
  std::string name;
  sqlite3_int64 camera = 0;
};

/// The parameters of a model: focal lengths, principal point, coefficients.
struct ColmapModel {
  const char* name;
  int focal_lengths, coefficients;
  Distortion distortion;
  bool is_read = true;
};
constexpr ColmapModel colmap_models[] = {
    {"SIMPLE_PINHOLE", 1, 0, Distortion::none},
    {"PINHOLE", 2, 0, Distortion::none},
    {"SIMPLE_RADIAL", 1, 1, Distortion::radtan},
    {"RADIAL", 1, 2, Distortion::radtan},
    {"OPENCV", 2, 4, Distortion::radtan},
    {"OPENCV_FISHEYE", 2, 4, Distortion::equidistant},
    {"FULL_OPENCV", 2, 8, Distortion::radtan, false},
    {"FOV", 2, 1, Distortion::none, false},
    {"SIMPLE_RADIAL_FISHEYE", 1, 1, Distortion::equidistant},
    {"RADIAL_FISHEYE", 1, 2, Distortion::equidistant},
    {"THIN_PRISM_FISHEYE", 2, 8, Distortion::equidistant, false},
};

template <class T>
T numberAt(std::string_view bytes, std::size_t i) {
  T value;
  std::memcpy(&value, bytes.data() + i * sizeof(T), sizeof(T));
  return value;
}

ColmapCamera cameraOf(sqlite3_stmt* s) {
  ColmapCamera result;
  Camera& c = result.camera;
  const sqlite3_int64 id = sqlite3_column_int64(s, 0), model = sqlite3_column_int64(s, 1);
  const sqlite3_int64 width = sqlite3_column_int64(s, 2), height = sqlite3_column_int64(s, 3);
  result.focal_length_is_known = sqlite3_column_int(s, 5) != 0;
  if (width > 0 && height > 0 && std::max(width, height) < 1000000) {
    c.width = static_cast<int>(width), c.height = static_cast<int>(height);
  } else {
    result.fault = fmt::format("camera {} has {} x {} px", id, width, height);
    return result;
  }
  if (!result.focal_length_is_known) return result;
  if (model < 0 || model >= static_cast<sqlite3_int64>(std::size(colmap_models)) || !colmap_models[model].is_read) {
    result.fault = fmt::format("camera {} is of the model {}, which cannot be undistorted here", id,
                               model >= 0 && model < static_cast<sqlite3_int64>(std::size(colmap_models))
                                   ? colmap_models[model].name
                                   : std::to_string(model));
    return result;
  }
  const ColmapModel& m = colmap_models[model];
  const std::string_view bytes = SqliteFile::blob(s, 4);
  std::vector<double> numbers;
  for (std::size_t i = 0; i < bytes.size() / sizeof(double); ++i) numbers.push_back(numberAt<double>(bytes, i));
  const auto focal = static_cast<std::size_t>(m.focal_lengths), more = static_cast<std::size_t>(m.coefficients);
  const bool finite = std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); });
  if (numbers.size() != focal + 2 + more || !finite || !(numbers[0] > 0) || !(numbers[focal - 1] > 0)) {
    result.fault = fmt::format("the {} parameters of camera {} are no {}", numbers.size(), id, m.name);
    return result;
  }
  c.fu = numbers[0], c.fv = numbers[focal - 1], c.cu = numbers[focal], c.cv = numbers[focal + 1];
  c.distortion = m.distortion;
  for (std::size_t k = 0; k < more; ++k) c.coefficients[static_cast<Eigen::Index>(k)] = numbers[focal + 2 + k];
  return result;
}

bool sameCamera(const Camera& a, const Camera& b) {
  return a.fu == b.fu && a.fv == b.fv && a.cu == b.cu && a.cv == b.cv && a.width == b.width && a.height == b.height &&
         a.distortion == b.distortion && a.coefficients == b.coefficients;
}

/// The rows of a blob of `size` bytes a number, at least `columns` of them; nothing where its size is another.
std::optional<std::size_t> rowsOf(sqlite3_stmt* s, std::string_view bytes, sqlite3_int64 columns, std::size_t size) {
  const sqlite3_int64 rows = sqlite3_column_int64(s, 0), cols = sqlite3_column_int64(s, 1);
  if (rows < 0 || cols < columns || rows > (1 << 28) || cols > 1000) return std::nullopt;
  if (bytes.size() != static_cast<std::size_t>(rows * cols) * size) return std::nullopt;
  return static_cast<std::size_t>(rows);
}

/// Positions of the keypoints of an image, the first two columns of its table; nothing where they are damaged.
std::optional<std::vector<Eigen::Vector2d>> keypointsOf(const SqliteFile& file, sqlite3_int64 image) {
  std::optional<std::vector<Eigen::Vector2d>> points;
  file.each("SELECT rows, cols, data FROM keypoints WHERE image_id=?", image, [&](sqlite3_stmt* s) {
    const std::string_view bytes = SqliteFile::blob(s, 2);
    const std::optional<std::size_t> rows = rowsOf(s, bytes, 2, sizeof(float));
    if (!rows) return;
    const auto cols = static_cast<std::size_t>(sqlite3_column_int64(s, 1));
    points.emplace();
    for (std::size_t i = 0; i < *rows; ++i) {
      points->push_back({numberAt<float>(bytes, i * cols), numberAt<float>(bytes, i * cols + 1)});
    }
  });
  return points;
}

constexpr const char* expected_tables = "a database of COLMAP 3.8 or later, with cameras, images, keypoints, matches";

/// The cameras of a pair, if they are known, and the sizes of its images.
void takeCameras(const ColmapCamera* a, const ColmapCamera* b, ColmapMatches& m) {
  if (a == nullptr || b == nullptr) {
    m.fault = "an image has no camera";
    return;
  }
  m.fault = a->fault.empty() ? b->fault : a->fault;
  m.first_size = {a->camera.width, a->camera.height}, m.second_size = {b->camera.width, b->camera.height};
  if (!a->focal_length_is_known || !b->focal_length_is_known) return;
  m.first_camera = a->camera;
  if (!sameCamera(a->camera, b->camera)) m.second_camera = b->camera;
}

}  // namespace

void forEachColmapPair(const std::string& database, const std::function<void(std::size_t)>& pairs,
                       const std::function<void(ColmapMatches&&)>& take) {
  const SqliteFile file(database, sourceName(database));
  if (!file.hasTables("'cameras','images','keypoints','matches','two_view_geometries'", 5)) {
    const bool damaged = !file.each("SELECT count(*) FROM sqlite_schema", 0, [](sqlite3_stmt*) {});
    if (damaged) file.fail(expected_tables);
    throw InputError(file.name(), 0, "it has not the tables of COLMAP", expected_tables);
  }
  const auto each = [&](const char* sql, auto&& row) {
    if (!file.each(sql, 0, row)) file.fail(expected_tables);
  };
  std::map<sqlite3_int64, ColmapCamera> cameras;
  std::map<sqlite3_int64, ColmapImage> images;
  each("SELECT camera_id, model, width, height, params, prior_focal_length FROM cameras",
       [&](sqlite3_stmt* s) { cameras[sqlite3_column_int64(s, 0)] = cameraOf(s); });
  each("SELECT image_id, name, camera_id FROM images", [&](sqlite3_stmt* s) {
    images[sqlite3_column_int64(s, 0)] = {SqliteFile::text(s, 1), sqlite3_column_int64(s, 2)};
  });
  each("SELECT count(*) FROM matches WHERE rows>0", [&](sqlite3_stmt* s) {
    if (pairs) pairs(static_cast<std::size_t>(sqlite3_column_int64(s, 0)));
  });
  const auto cameraOfImage = [&](const ColmapImage& image) -> const ColmapCamera* {
    const auto c = cameras.find(image.camera);
    return c == cameras.end() ? nullptr : &c->second;
  };
  // Pairs of one first image follow one another.
  std::optional<std::vector<Eigen::Vector2d>> points;
  sqlite3_int64 points_of = -1;
  each("SELECT rows, cols, data, pair_id FROM matches WHERE rows>0 ORDER BY pair_id", [&](sqlite3_stmt* s) {
    const sqlite3_int64 id = sqlite3_column_int64(s, 3), first = id / pair_base, second = id % pair_base;
    const auto a = images.find(first), b = images.find(second);
    if (id < 0 || a == images.end() || b == images.end()) {
      throw InputError(file.name(), 0, fmt::format("the matches {} are of images {} and {}", id, first, second),
                       "pair_id = 2147483647 image_id1 + image_id2 of images that there are");
    }
    ColmapMatches m;
    m.first = static_cast<std::uint32_t>(first), m.second = static_cast<std::uint32_t>(second);
    m.first_name = a->second.name, m.second_name = b->second.name;
    takeCameras(cameraOfImage(a->second), cameraOfImage(b->second), m);
    const std::string_view bytes = SqliteFile::blob(s, 2);
    const std::optional<std::size_t> rows = rowsOf(s, bytes, 2, sizeof(std::uint32_t));
    if (points_of != first) points = keypointsOf(file, first), points_of = first;
    const std::optional<std::vector<Eigen::Vector2d>> others = keypointsOf(file, second);
    if (!points || !others || !rows || sqlite3_column_int64(s, 1) != 2) {
      m.fault = "keypoints or matches are damaged: the size of their bytes is not that of rows and cols";
    }
    for (std::size_t i = 0; m.fault.empty() && i < *rows; ++i) {
      const auto p = numberAt<std::uint32_t>(bytes, 2 * i), q = numberAt<std::uint32_t>(bytes, 2 * i + 1);
      if (p >= points->size() || q >= others->size()) {
        m.fault = fmt::format("match {} is of keypoints {} and {}, and there are {} and {}", i, p, q, points->size(),
                              others->size());
        m.places.clear(), m.matches.clear();
        break;
      }
      m.places.push_back({p, q});
      m.matches.emplace_back();
      m.matches.back() << (*points)[p], (*others)[q];
    }
    take(std::move(m));
  });
}

void writeColmapPairs(const std::string& database, const std::string& copy, const std::vector<ColmapPair>& pairs) {
  std::error_code error;
  if (std::filesystem::exists(copy, error)) {
    throw InputError(sourceName(copy), 0, "the file exists", "a path where there is no file yet, for the copy");
  }
  const std::string beside = copy + ".new";
  std::filesystem::remove(beside, error);
  const std::unique_ptr<const char, int (*)(const char*)> removed(beside.c_str(), &std::remove);
  {
    SqliteFile file(SqliteFile(database, sourceName(database)), beside);
    file.run("BEGIN IMMEDIATE; DELETE FROM two_view_geometries");
    const SqliteFile::Statement s = file.prepared(
        "INSERT INTO two_view_geometries(pair_id, rows, cols, data, config, F, E, H, "
        "qvec, tvec) VALUES(?, ?, 2, ?, ?, ?, ?, ?, ?, ?)");
    if (!s) file.fail(expected_tables);
    for (const ColmapPair& p : pairs) {
      if (!p.isWritten()) continue;
      // Zero is what COLMAP writes where there is none; its matrices are row-major.
      using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
      RowMajor F = RowMajor::Zero(), E = F, H = F;
      const bool epipolar = p.config == ColmapConfig::calibrated || p.config == ColmapConfig::uncalibrated;
      (epipolar ? F : H) = p.matrix;
      Eigen::Vector4d wxyz = Eigen::Vector4d::Zero();
      Eigen::Vector3d t = Eigen::Vector3d::Zero();
      if (p.edge || p.model == "none") {
        const SE3d pose = p.edge ? p.edge->second_T_first : SE3d();
        const auto q = pose.unit_quaternion();
        wxyz << q.w(), q.x(), q.y(), q.z();
        t = pose.translation();
        if (epipolar) E = SO3d::hat(t) * pose.so3().matrix();
      }
      sqlite3_reset(s.get());
      const auto blob = [&](int place, const void* data, std::size_t bytes) {
        sqlite3_bind_blob(s.get(), place, data, static_cast<int>(bytes), SQLITE_STATIC);
      };
      sqlite3_bind_int64(s.get(), 1, pair_base * p.first + p.second);
      sqlite3_bind_int64(s.get(), 2, static_cast<sqlite3_int64>(p.inlier_places.size()));
      blob(3, p.inlier_places.data(), p.inlier_places.size() * sizeof(p.inlier_places[0]));
      sqlite3_bind_int(s.get(), 4, static_cast<int>(p.config));
      blob(5, F.data(), sizeof(double) * 9), blob(6, E.data(), sizeof(double) * 9),
          blob(7, H.data(), sizeof(double) * 9);
      blob(8, wxyz.data(), sizeof(double) * 4), blob(9, t.data(), sizeof(double) * 3);
      if (sqlite3_step(s.get()) != SQLITE_DONE) file.fail("room for the geometries");
    }
    file.run("COMMIT");
  }
  std::filesystem::rename(beside, copy, error);
  if (error) throw InputError(sourceName(copy), 0, "cannot be written: " + error.message());
}

#else

namespace {

[[noreturn]] void refuseColmap(const std::string& database) {
  throw InputError(sourceName(database), 0, "this build of liestat cannot read SQLite",
                   "a build with the package libsqlite3-dev");
}

}  // namespace

void forEachColmapPair(const std::string& database, const std::function<void(std::size_t)>&,
                       const std::function<void(ColmapMatches&&)>&) {
  refuseColmap(database);
}
void writeColmapPairs(const std::string& database, const std::string&, const std::vector<ColmapPair>&) {
  refuseColmap(database);
}

#endif

}  // namespace liestat
