// `liestat two-view --colmap`: databases that the test writes, and, where COLMAP is installed, one that COLMAP makes of
// rendered images and reconstructs from the copy.

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Dense>

#include <cli/program_output.hpp>
#include <formats/pose_graph.hpp>
#include <formats/trajectory.hpp>
#include <fusion/camera.hpp>
#include <lie/se3.hpp>
#include <support/temporary_directory.hpp>

namespace liestat::cli {
namespace {

using Json = nlohmann::json;
using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// Tables ------------------------------------------------------------------------------------------------------------

template <class T>
std::string bytesOf(const std::vector<T>& numbers) {
  return {reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(T)};
}

/// A database of COLMAP 3.8, of which the columns are those that its documentation lists.
class Database {
 public:
  explicit Database(std::string path) : path_(std::move(path)) {
    sqlite3_open(path_.c_str(), &db_);
    run("CREATE TABLE cameras(camera_id INTEGER PRIMARY KEY, model INTEGER, width INTEGER, height INTEGER, params "
        "BLOB, "
        "prior_focal_length INTEGER);"
        "CREATE TABLE images(image_id INTEGER PRIMARY KEY, name TEXT, camera_id INTEGER, prior_qw REAL);"
        "CREATE TABLE keypoints(image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);"
        "CREATE TABLE matches(pair_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);"
        "CREATE TABLE two_view_geometries(pair_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB, config "
        "INTEGER, F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB);"
        "INSERT INTO two_view_geometries VALUES(7, 0, 2, x'', 1, x'', x'', x'', x'', x'')");
  }
  ~Database() { sqlite3_close(db_); }
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  const std::string& path() const { return path_; }
  void run(const std::string& sql, const std::string& blob = {}) {
    sqlite3_stmt* s = nullptr;
    const char* rest = sql.c_str();
    while (rest != nullptr && *rest != 0) {
      ASSERT_EQ(sqlite3_prepare_v2(db_, rest, -1, &s, &rest), SQLITE_OK) << sqlite3_errmsg(db_);
      sqlite3_bind_blob(s, 1, blob.data(), static_cast<int>(blob.size()), SQLITE_TRANSIENT);
      ASSERT_EQ(sqlite3_step(s), SQLITE_DONE) << sqlite3_errmsg(db_);
      sqlite3_finalize(s);
    }
  }
  void camera(int id, int model, int width, int height, const std::vector<double>& params, bool known) {
    run("INSERT INTO cameras VALUES(" + std::to_string(id) + "," + std::to_string(model) + "," + std::to_string(width) +
            "," + std::to_string(height) + ",?," + (known ? "1" : "0") + ")",
        bytesOf(params));
  }
  /// An image with one keypoint for each pixel, of four columns as COLMAP's are.
  void image(int id, int camera, const std::vector<Eigen::Vector2d>& pixels) {
    const std::string name = std::to_string(id), n = std::to_string(pixels.size());
    run("INSERT INTO images VALUES(" + name + ",'image " + name + "'," + std::to_string(camera) + ",NULL)");
    std::vector<float> numbers;
    for (const auto& p : pixels) {
      for (const double x : {p.x(), p.y(), 1., 0.}) numbers.push_back(static_cast<float>(x));
    }
    run("INSERT INTO keypoints VALUES(" + name + "," + n + ",4,?)", bytesOf(numbers));
  }
  /// Matches of keypoints i of one image and n - 1 - i of the other.
  void matches(std::int64_t first, std::int64_t second, std::uint32_t n) {
    std::vector<std::uint32_t> numbers;
    for (std::uint32_t i = 0; i < n; ++i) numbers.push_back(i), numbers.push_back(n - 1 - i);
    run("INSERT INTO matches VALUES(" + std::to_string(2147483647 * first + second) + "," + std::to_string(n) + ",2,?)",
        bytesOf(numbers));
  }

 private:
  std::string path_;
  sqlite3* db_ = nullptr;
};

/// The geometries of a copy.
struct Geometry {
  int config = 0;
  std::vector<std::uint32_t> inliers;
  RowMajor F, E, H;
  Eigen::Vector4d wxyz;
  Eigen::Vector3d t;
};
std::map<std::pair<int, int>, Geometry> geometriesOf(const std::string& path) {
  std::map<std::pair<int, int>, Geometry> all;
  sqlite3* db = nullptr;
  sqlite3_open(path.c_str(), &db);
  sqlite3_stmt* s = nullptr;
  sqlite3_prepare_v2(db, "SELECT pair_id, rows, data, config, F, E, H, qvec, tvec FROM two_view_geometries", -1, &s,
                     nullptr);
  while (sqlite3_step(s) == SQLITE_ROW) {
    const std::int64_t id = sqlite3_column_int64(s, 0);
    Geometry& g = all[{id / 2147483647, id % 2147483647}];
    g.config = sqlite3_column_int(s, 3);
    const auto copy = [&](int column, void* to, std::size_t bytes) {
      EXPECT_EQ(static_cast<std::size_t>(sqlite3_column_bytes(s, column)), bytes);
      if (bytes > 0) std::memcpy(to, sqlite3_column_blob(s, column), bytes);
    };
    g.inliers.resize(2 * static_cast<std::size_t>(sqlite3_column_int(s, 1)));
    copy(2, g.inliers.data(), 4 * g.inliers.size());
    copy(4, g.F.data(), 72), copy(5, g.E.data(), 72), copy(6, g.H.data(), 72);
    copy(7, g.wxyz.data(), 32), copy(8, g.t.data(), 24);
  }
  sqlite3_finalize(s);
  sqlite3_close(db);
  return all;
}

/// Squared distance of a pose, its translation scaled to length one, from an edge, by the edge's information.
double distance(const GraphEdge& edge, const SE3d& truth) {
  const SE3d unit(truth.so3(), Eigen::Vector3d(truth.translation().normalized()));
  const Eigen::Matrix<double, 6, 1> e = (edge.measurement.inverse() * unit).log();
  Eigen::Matrix<double, 6, 1> g2o = e;
  g2o.tail<3>() *= 0.5;
  return g2o.dot(edge.matrix * g2o);
}

// Scenes ------------------------------------------------------------------------------------------------------------

constexpr int n_points = 120;

/// Pixels of points in depth (or on a plane), seen by two cameras, with noise of half a pixel; the second image's in
/// reverse order.
std::array<std::vector<Eigen::Vector2d>, 2> seen(std::mt19937& random, const Camera& first, const Camera& second,
                                                 const SE3d& second_T_first, bool plane) {
  std::uniform_real_distribution<double> u(-1, 1);
  std::normal_distribution<double> noise(0, 0.5);
  std::array<std::vector<Eigen::Vector2d>, 2> pixels;
  while (pixels[0].size() < n_points) {
    const double x = u(random), y = 0.8 * u(random), z = plane ? 5 / (1 + 0.3 * x + 0.2 * y) : 5 + 2 * u(random);
    const Eigen::Vector3d p(0.45 * z * x, 0.45 * z * y, z);
    const auto a = first.project(p), b = second.project(second_T_first * p);
    if (!a || !b) continue;
    pixels[0].push_back(*a + Eigen::Vector2d(noise(random), noise(random)));
    pixels[1].insert(pixels[1].begin(), *b + Eigen::Vector2d(noise(random), noise(random)));
  }
  return pixels;
}

Camera cameraOf(double f, double cu, double cv, const Eigen::Vector4d& k = Eigen::Vector4d::Zero()) {
  Camera c;
  c.fu = c.fv = f, c.cu = cu, c.cv = cv, c.width = static_cast<int>(2 * cu), c.height = static_cast<int>(2 * cv);
  if (!k.isZero(0)) c.distortion = Distortion::radtan, c.coefficients = k;
  return c;
}

Words asked(const std::string& database, const std::string& copy, const Words& more = {},
            const std::string& sigma = "0.5") {
  return Words{"two-view", "--colmap", database, "--output", copy, "--sigma", sigma} + more;
}

TEST(Colmap, geometriesOfEveryConfiguration) {
  const TemporaryDirectory directory;
  Database db(directory / "in.db");
  const Camera pinhole = cameraOf(600, 320, 240), bent = cameraOf(580, 330, 250, {-0.1, 0.02, 1e-3, -1e-3}),
               small = cameraOf(400, 200, 150);
  db.camera(1, 0, 640, 480, {600, 320, 240}, true);
  db.camera(2, 4, 660, 500, {580, 580, 330, 250, -0.1, 0.02, 1e-3, -1e-3}, true);
  db.camera(3, 2, 400, 300, {480, 200, 150, 0}, false);  // a guess of COLMAP's
  db.camera(4, 7, 640, 480, {500, 500, 320, 240, 0.9}, true);
  std::mt19937 random(4);
  const SE3d moved(SO3d::exp(Eigen::Vector3d(0.05, -0.1, 0.02)), Eigen::Vector3d(0.8, 0.1, 0.1)),
      turned(moved.so3(), Eigen::Vector3d::Zero());
  int next = 1;
  const auto pair = [&](int a, const Camera& first, int b, const Camera& second, const SE3d& motion, bool plane) {
    const auto pixels = seen(random, first, second, motion, plane);
    db.image(next, a, pixels[0]), db.image(next + 1, b, pixels[1]);
    db.matches(next, next + 1, n_points);
    next += 2;
  };
  pair(1, pinhole, 2, bent, moved, false);      // 1, 2
  pair(1, pinhole, 1, pinhole, turned, false);  // 3, 4
  pair(1, pinhole, 1, pinhole, moved, true);    // 5, 6
  pair(3, small, 1, pinhole, moved, false);     // 7, 8: one focal length is a guess
  pair(3, small, 3, small, turned, false);      // 9, 10
  pair(4, pinhole, 1, pinhole, moved, false);   // 11, 12: FOV
  pair(1, pinhole, 1, pinhole, moved, false);   // 13, 14
  db.run("UPDATE matches SET data=randomblob(rows*8) WHERE pair_id=2147483647*13+14");
  db.image(15, 1, seen(random, pinhole, pinhole, moved, false)[0]);  // matched with another scene
  db.matches(1, 15, n_points);
  const std::string before = contentOf(db.path());

  const ProgramOutput out = run(asked(db.path(), directory / "out.db", {"--json", directory / "out.json"}));
  ASSERT_EQ(out.exit_code, 0) << out.error << out.output;
  EXPECT_EQ(contentOf(db.path()), before) << "the original is left as it is";
  EXPECT_FALSE(std::filesystem::exists(directory / "out.db.new"));
  const auto found = geometriesOf(directory / "out.db");
  const std::map<std::pair<int, int>, int> expected = {
      {{1, 2}, 2}, {{3, 4}, 5}, {{5, 6}, 4}, {{7, 8}, 3}, {{9, 10}, 6}};
  ASSERT_EQ(found.size(), expected.size()) << out.output;
  for (const auto& [images, config] : expected) {
    ASSERT_TRUE(found.contains(images)) << images.first << "\n" << out.output;
    const Geometry& g = found.at(images);
    EXPECT_EQ(g.config, config) << images.first;
    EXPECT_GT(g.inliers.size(), 2 * 0.9 * n_points);
    for (std::size_t i = 0; i < g.inliers.size(); i += 2) EXPECT_EQ(g.inliers[i] + g.inliers[i + 1], n_points - 1);
    EXPECT_EQ(g.F.isZero(0), config > 3) << images.first;
    EXPECT_EQ(g.H.isZero(0), config <= 3) << images.first;
    EXPECT_EQ(g.E.isZero(0), config != 2) << images.first;
    EXPECT_EQ(g.wxyz.isZero(0), config != 2 && config != 5) << images.first;
  }
  // The matrices act on COLMAP's pixels, between images of different sizes, too, and row by row.
  const auto residual = [](const Geometry& g, const Camera& a, const Camera& b, const SE3d& T, double z) {
    const Eigen::Vector3d p(0.3 * z, -0.2 * z, z), x = a.project(p)->homogeneous(), y = b.project(T * p)->homogeneous();
    if (!g.H.isZero(0)) return ((g.H * x).hnormalized() - y.head<2>()).norm();
    const Eigen::Vector3d line = g.F * x;
    return std::abs(y.dot(line)) / line.head<2>().norm();
  };
  EXPECT_LT(residual(found.at({1, 2}), pinhole, cameraOf(580, 330, 250), moved, 5), 1);
  EXPECT_LT(residual(found.at({3, 4}), pinhole, pinhole, turned, 5), 1);
  EXPECT_LT(residual(found.at({5, 6}), pinhole, pinhole, moved, 4.5), 1);  // a point of the plane
  for (const double z : {4., 6.}) EXPECT_LT(residual(found.at({7, 8}), small, pinhole, moved, z), 1.5);
  EXPECT_LT(residual(found.at({9, 10}), small, small, turned, 5), 1);
  const Geometry& g = found.at({1, 2});
  const SO3d R(Eigen::Quaterniond(g.wxyz[0], g.wxyz[1], g.wxyz[2], g.wxyz[3]));
  EXPECT_LT((SO3d::hat(g.t) * R.matrix() - g.E).norm(), 1e-12);
  EXPECT_LT((R.inverse() * moved.so3()).log().norm(), 0.02);
  EXPECT_LT(found.at({3, 4}).t.norm(), 1e-15);

  // Edges: the pose within its covariance (5 degrees of freedom, 1e-4; 3 of the rotation).
  const PoseGraph graph = readPoseGraph(directory / "out.g2o");
  ASSERT_EQ(graph.edges.size(), 2U);
  EXPECT_EQ(graph.edges[0].from, 2);
  EXPECT_EQ(graph.edges[0].to, 1);
  EXPECT_LT(distance(graph.edges[0], moved), 25.7);
  EXPECT_LT(distance(graph.edges[1], turned), 21.1);
  // The information, of half angles, is the inverse of the CSV's covariance in the five directions that are told.
  const std::string csv = contentOf(directory / "out.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 3);
  const std::size_t row = csv.find("1,2,\"image 1\",\"image 2\",essential,");
  ASSERT_NE(row, std::string::npos) << csv;
  std::istringstream fields(csv.substr(row));
  std::string field;
  for (int k = 0; k < 13; ++k) std::getline(fields, field, ',');
  Matrix6d C = Matrix6d::Zero();
  for (int i = 0; i < 6; ++i) {
    for (int j = i; j < 6; ++j) {
      std::getline(fields, field, i + j == 10 ? '\n' : ',');
      C(i, j) = C(j, i) = std::stod(field) * (i < 3 ? 1 : 0.5) * (j < 3 ? 1 : 0.5);
    }
  }
  EXPECT_NEAR((graph.edges[0].matrix * C).trace(), 5, 1e-6);
  const Json json = Json::parse(contentOf(directory / "out.json"));
  EXPECT_EQ(json["written"], 5);
  std::map<int, std::string> reasons;
  for (const Json& p : json["pairs"]) {
    if (p["config"] == "UNDEFINED") reasons[p["second"]] = p["reason"];
  }
  ASSERT_EQ(reasons.size(), 3U) << out.output;
  EXPECT_NE(reasons.at(12).find("FOV"), std::string::npos) << reasons.at(12);
  EXPECT_NE(reasons.at(14).find("keypoints"), std::string::npos) << reasons.at(14);
  EXPECT_NE(reasons.at(15).find("chance"), std::string::npos) << reasons.at(15);
}

TEST(Colmap, databasesThatAreNone) {
  const TemporaryDirectory directory;
  Database db(directory / "in.db");
  const auto error = [&](const Words& words) {
    const ProgramOutput out = run(words);
    EXPECT_EQ(out.exit_code, 2) << out.output;
    return out.error;
  };
  EXPECT_NE(error({"two-view", "--colmap", db.path()}).find("--output"), std::string::npos);
  EXPECT_NE(error(asked(db.path(), db.path())).find("the file exists"), std::string::npos);
  EXPECT_NE(error(asked(db.path(), directory / "o.db", {"--intrinsics", "1,1,0,0"})).find("cameras"),
            std::string::npos);
  EXPECT_NE(error({"two-view"}).find("--colmap"), std::string::npos);
  EXPECT_NE(error(asked(directory / "none.db", directory / "o.db")).find("SQLite"), std::string::npos);
  EXPECT_NE(error(asked(directory.write("text.db", "no database"), directory / "o.db")).find("text.db"),
            std::string::npos);
  db.run("INSERT INTO matches VALUES(2147483648, 1, 2, x'0000000000000000')");
  EXPECT_NE(error(asked(db.path(), directory / "o.db")).find("images 1 and 1"), std::string::npos);
  db.run("DELETE FROM matches; DROP TABLE keypoints; CREATE VIEW keypoints AS SELECT * FROM matches");
  EXPECT_NE(error(asked(db.path(), directory / "o.db")).find("tables of COLMAP"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(directory / "o.db"));
}

#ifdef LIESTAT_COLMAP

/// Smooth noise of several scales, in [0, 1].
double texture(double x, double y) {
  const auto lattice = [](std::int64_t i, std::int64_t j, std::uint64_t octave) {
    std::uint64_t h =
        static_cast<std::uint64_t>(i) * 0x9E3779B97F4A7C15U ^ static_cast<std::uint64_t>(j) * 0xC2B2AE3D27D4EB4FU;
    h = (h ^ octave * 0x165667B19E3779F9U ^ h >> 29) * 0xBF58476D1CE4E5B9U;
    return static_cast<double>((h ^ h >> 32) & 0xffff) / 65535;
  };
  double sum = 0;
  const double scales[] = {2, 5, 12, 30}, weights[] = {0.3, 0.3, 0.25, 0.15};
  for (std::uint64_t k = 0; k < 4; ++k) {
    const double X = x * scales[k], Y = y * scales[k], i = std::floor(X), j = std::floor(Y), u = X - i, v = Y - j;
    const auto at = [&](int a, int b) {
      return lattice(static_cast<std::int64_t>(i) + a, static_cast<std::int64_t>(j) + b, k);
    };
    sum += weights[k] * ((at(0, 0) * (1 - u) + at(1, 0) * u) * (1 - v) + (at(0, 1) * (1 - u) + at(1, 1) * u) * v);
  }
  return sum;
}

/// Four images of a wavy surface with grey noise of standard deviation two; the poses camera_T_world.
std::vector<SE3d> render(const std::string& folder) {
  constexpr int width = 400, height = 300;
  constexpr double f = 400;
  const auto depth = [](const Eigen::Vector3d& p) { return 5 + 0.9 * std::sin(1.3 * p.x()) * std::cos(1.1 * p.y()); };
  std::filesystem::create_directory(folder);
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 2);
  std::vector<SE3d> poses;
  for (int n = 0; n < 4; ++n) {
    const Eigen::Vector3d centre(-0.9 + 0.6 * n, 0.1 * n, 0.05 * n);
    const SO3d R = SO3d::exp(Eigen::Vector3d(0.02 * n, -0.1 * (n - 1.5), 0.03 * n));
    poses.push_back(SE3d(R, Eigen::Vector3d(-(R * centre))));
    std::string pixels;
    for (int v = 0; v < height; ++v) {
      for (int u = 0; u < width; ++u) {
        // COLMAP's pixels have their centres at halves.
        const Eigen::Vector3d ray = R.inverse() * Eigen::Vector3d((u + 0.5 - 200) / f, (v + 0.5 - 150) / f, 1);
        Eigen::Vector3d p = centre + (5 - centre.z()) / ray.z() * ray;
        for (int k = 0; k < 8; ++k) p = centre + (depth(p) - centre.z()) / ray.z() * ray;
        pixels += static_cast<char>(std::lround(std::clamp(255 * texture(p.x(), p.y()) + noise(random), 0., 255.)));
      }
    }
    std::ofstream(folder + "/" + std::to_string(n) + ".pgm", std::ios::binary) << "P5 400 300 255\n" << pixels;
  }
  return poses;
}

TEST(Colmap, colmapReadsTheCopy) {
  const TemporaryDirectory directory;
  const std::vector<SE3d> poses = render(directory / "images");
  const auto colmap = [&](const Words& words) {
    const ProgramResult result = runProgram(
        Words{"sh", "-c", "QT_QPA_PLATFORM=offscreen exec \"$0\" \"$@\" >/dev/null", LIESTAT_COLMAP} + words, ".");
    EXPECT_EQ(result.status, 0) << words[0] << result.errors;
  };
  const std::string db = directory / "in.db", copy = directory / "out.db", model = directory / "model";
  colmap({"feature_extractor", "--database_path", db, "--image_path", directory / "images",
          "--ImageReader.single_camera", "1", "--ImageReader.camera_model", "PINHOLE", "--ImageReader.camera_params",
          "400,400,200,150", "--SiftExtraction.use_gpu", "0", "--SiftExtraction.num_threads", "1",
          "--SiftExtraction.max_num_features", "400", "--SiftExtraction.first_octave", "0"});
  colmap(
      {"exhaustive_matcher", "--database_path", db, "--SiftMatching.use_gpu", "0", "--SiftMatching.num_threads", "1"});
  const ProgramOutput out = run(asked(db, copy, {}, "0.22"));
  ASSERT_EQ(out.exit_code, 0) << out.error << out.output;
  const PoseGraph graph = readPoseGraph(directory / "out.g2o");
  EXPECT_GE(graph.edges.size(), 4U) << out.output;
  for (const GraphEdge& e : graph.edges) {
    const SE3d truth =
        poses[static_cast<std::size_t>(e.from - 1)] * poses[static_cast<std::size_t>(e.to - 1)].inverse();
    EXPECT_LT(distance(e, truth), 25.7) << e.from << ' ' << e.to;
  }
  // COLMAP takes the correspondences of its reconstruction from the geometries of the copy.
  std::filesystem::create_directory(model);
  colmap({"mapper", "--database_path", copy, "--image_path", directory / "images", "--output_path", model,
          "--Mapper.extract_colors", "0", "--Mapper.num_threads", "1", "--Mapper.ba_refine_focal_length", "0",
          "--Mapper.ba_refine_extra_params", "0"});
  colmap({"model_converter", "--input_path", model + "/0", "--output_path", model, "--output_type", "TXT"});
  const Trajectory found = readTrajectory(model + "/images.txt");  // in the order of the names
  ASSERT_EQ(found.size(), 4U);
  for (std::size_t k = 1; k < 4; ++k) {
    const SO3d error =
        (found.poses[0].inverse() * found.poses[k]).so3().inverse() * (poses[0] * poses[k].inverse()).so3();
    EXPECT_LT(error.log().norm(), 0.01) << k;
  }
}

#endif

}  // namespace
}  // namespace liestat::cli
