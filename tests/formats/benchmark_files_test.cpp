// Files of public benchmarks as trajectories: stamps that repeat, jump back or are no seconds, numbered columns, 4x4
// matrices, COLMAP's images, vertices of graphs; and the limits of what is read.
#include <formats/trajectory.hpp>

#include <formats/input_error.hpp>
#include <formats/pose_graph.hpp>
#include <support/temporary_directory.hpp>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <string>
#include <vector>

namespace liestat {
namespace {

Trajectory read(const std::string& text, const TrajectoryOptions& options = {}) {
  return parseTrajectory(text, "f", options);
}
Trajectory ordered(const std::string& text, std::optional<DuplicateRule> rule = {}) {
  Trajectory t = read(text);
  orderInTime(t, rule);
  return t;
}
bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }
std::string notes(const Trajectory& t) { return joined(t.notes, "; "); }
std::vector<double> xs(const Trajectory& t) {
  std::vector<double> list;
  for (const SE3d& pose : t.poses) list.push_back(pose.translation()[0]);
  return list;
}
using Numbers = std::vector<double>;

TEST(BenchmarkFiles, AStampThatRepeatsItsPoseIsDropped) {
  const Trajectory t = ordered("1 1 0 0 0 0 0 1\n2 2 0 0 0 0 0 1\n2 2.0000000001 0 0 0 0 0 -1\n3 3 0 0 0 0 0 1\n");
  EXPECT_EQ(xs(t), (Numbers{1, 2, 3}));
  EXPECT_EQ(t.times, (Numbers{1, 2, 3}));
  EXPECT_EQ(t.lines, (std::vector<std::size_t>{1, 2, 4}));
  EXPECT_EQ(t.time_texts.back(), "3");
  EXPECT_EQ(notes(t), "1 row repeats stamp and pose of an earlier one (first line 3): dropped");
}

TEST(BenchmarkFiles, AStampWithTwoPosesNeedsARule) {
  // The second of line 3 is 2e-9 m off, and a quarter of a turn about z apart is line 5.
  const std::string text =
      "1 1 0 0 0 0 0 1\n2 2 0 0 0 0 0 1\n2 2.000000002 0 0 0 0 0 1\n3 3 0 0 0 0 0 1\n"
      "3 5 0 0 0 0 0.7071067811865476 0.7071067811865476\n";
  EXPECT_EQ(errorOf([&] { ordered(text); }),
            "f:3: the time 2 stands in line 2 too, with another pose, expected each time once, or --duplicates drop "
            "(keeps the first) or mean");
  EXPECT_EQ(xs(ordered(text, DuplicateRule::drop)), (Numbers{1, 2, 3}));
  const Trajectory mean = ordered(text, DuplicateRule::mean);
  EXPECT_EQ(xs(mean), (Numbers{1, 2.000000001, 4}));
  EXPECT_NEAR(mean.poses[2].so3().log()[2], 0.25 * 3.14159265358979, 1e-12);
  EXPECT_EQ(notes(mean), "2 stamps have different poses (first line 3): their mean is taken");
}

TEST(BenchmarkFiles, CovariancesBelongToTheirPose) {
  std::string header = "t,tx,ty,tz,qx,qy,qz,qw", row = "2,0,0,0,0,0,0,1", wider = row;
  for (int i = 0; i < 6; ++i) {
    for (int j = i; j < 6; ++j) {
      header += fmt::format(",cov_{}{}", i, j), row += i == j ? ",1" : ",0", wider += i == j ? ",4" : ",0";
    }
  }
  const std::string first = "1" + row.substr(1);
  const std::string same = header + "\n" + row + "\n" + row + "\n" + first + "\n";
  const Trajectory t = ordered(same);
  ASSERT_EQ(t.size(), 2U);
  EXPECT_EQ(t.covariances.size(), 2U);
  EXPECT_TRUE(contains(notes(t), "1 time is before the row above (first line 4): sorted by time")) << notes(t);
  const std::string other = header + "\n" + row + "\n" + wider + "\n";
  EXPECT_TRUE(contains(errorOf([&] { ordered(other); }), "with another pose or covariance"));
  EXPECT_EQ(ordered(other, DuplicateRule::drop).covariances[0](0, 0), 1);
  EXPECT_TRUE(contains(errorOf([&] { ordered(other, DuplicateRule::mean); }), "mean of poses with covariances"));
}

TEST(BenchmarkFiles, UnsortedRowsAreSortedAndOthersStay) {
  const Trajectory t = ordered("3 3 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n2 2 0 0 0 0 0 1\n");
  EXPECT_EQ(xs(t), (Numbers{1, 2, 3}));
  EXPECT_EQ(t.lines, (std::vector<std::size_t>{2, 3, 1}));
  EXPECT_EQ(notes(t), "1 time is before the row above (first line 2): sorted by time");
  EXPECT_EQ(notes(ordered("1 3 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n")), "");
}

TEST(BenchmarkFiles, StampsSince1970TellTheirUnit) {
  const std::string pose = " 1 0 0 0 0 0 1\n";
  for (const auto& [stamp, next, seconds] :
       {std::tuple("1403636579763555584", "1403636579813555456", "1403636579.763555584"),
        std::tuple("1.403636579763555584000e+18", "1.403636579813555456000e+18", "1403636579.763555584000"),
        std::tuple("1403636579763555", "1403636579813555", "1403636579.763555"),
        std::tuple("1403636579763.5", "1403636579813", "1403636579.7635")}) {
    const Trajectory t = read(stamp + pose.substr(0) + next + pose);
    EXPECT_EQ(t.time_texts[0], seconds);
    EXPECT_NEAR(t.times[1] - t.times[0], 0.05, 1e-3) << stamp;
    EXPECT_TRUE(contains(notes(t), "since 1970")) << notes(t);
  }
  // Seconds since 1970, and numbers from zero on, stay what they are; the latter only the user knows.
  EXPECT_EQ(notes(read("1403636579.76" + pose + "1403636579.81" + pose)), "");
  EXPECT_EQ(read("0" + pose + "50000000" + pose).times[1], 5e7);
  EXPECT_EQ(read("0" + pose + "50000000" + pose, {.time_unit = StampUnit::ns}).time_texts[1], "0.050000000");
  EXPECT_EQ(read("-5" + pose + "5e1" + pose, {.time_unit = StampUnit::ms}).time_texts[0], "-0.005");
  const std::string euroc = "#timestamp [ns],p_x,p_y,p_z,q_w,q_x,q_y,q_z\n0,1,2,3,1,0,0,0\n50000000,1,2,3,1,0,0,0\n";
  EXPECT_EQ(read(euroc).times[1], 0.05);
  EXPECT_TRUE(contains(errorOf([&] { read(euroc, {.time_unit = StampUnit::us}); }), "--time-unit us"));
}

TEST(BenchmarkFiles, CovariancesBesideStampsInNanoseconds) {
  const TemporaryDirectory directory;
  const std::string path = directory.write("f.tum", "1403636579763555584 1 0 0 0 0 0 1\n");
  const std::string head =
      "# liestat-covariance 1\n# order: tr\n# perturbation: right\n# unit: rad\n# content: covariance\n# layout: "
      "diag6\n";
  for (const char* stamp : {"1403636579763555584", "1403636579.763555584"}) {
    directory.write("f.tum.cov", head + stamp + " 1 2 3 4 5 6\n");
    EXPECT_EQ(readTrajectory(path).covariances[0](5, 5), 6) << stamp;
  }
}

TEST(BenchmarkFiles, ColumnsByNumber) {
  const TrajectoryOptions how{.reading = {.columns = {"t=2", "tx=3", "ty=4", "tz=5", "qw=6", "qx=7", "qy=8", "qz=9"}}};
  for (const std::string text :
       {"a.png,1,4,5,6,0,1,0,0,9\nb.png,2,4,5,6,1,0,0,0,9\n", "a.png 1 4 5 6 0 1 0 0 9\nb.png 2 4 5 6 1 0 0 0 9\n"}) {
    // The first line is a header: its name is no number.
    EXPECT_EQ(read(text, how).size(), 1U);
  }
  const std::string numbers = "7,1,4,5,6,0,1,0,0,9\n7,2,4,5,6,1,0,0,0,9\n";
  const Trajectory t = read(numbers, how);
  ASSERT_EQ(t.size(), 2U);
  EXPECT_EQ(t.times, (Numbers{1, 2}));
  EXPECT_EQ(t.poses[0].unit_quaternion().x(), 1);
  const auto error = [&](std::vector<std::string> columns) {
    return errorOf([&] { read(numbers, {.reading = {.columns = std::move(columns)}}); });
  };
  EXPECT_TRUE(contains(error({"t=0"}), "expected 1 to 10"));
  EXPECT_TRUE(contains(error({"t=11"}), "the row has 10 columns"));
  EXPECT_TRUE(contains(error({"t=1", "tx=1"}), "it is there already"));
  EXPECT_TRUE(contains(error({"time=1"}), "there is no column 'time'"));
  EXPECT_TRUE(contains(errorOf([&] { read(numbers); }), "--columns t=1,tx=2"));
}

TEST(BenchmarkFiles, MatricesInOneRowOrInFour) {
  const std::string block = "0 -1 0 4\n1 0 0 5\n0 0 1 6\n0 0 0 1\n";
  std::string row = block;
  for (char& c : row) c = c == '\n' ? ' ' : c;
  for (const std::string& text : {block, block + "\n" + block, "0 0 1\n" + block + "1 1 2\n" + block, row + "\n"}) {
    const Trajectory t = read(text);
    EXPECT_EQ(t.format, "matrix");
    EXPECT_EQ(t.poses.back().translation(), Eigen::Vector3d(4, 5, 6));
    EXPECT_NEAR(t.poses.back().so3().log()[2], 3.14159265358979 / 2, 1e-12);
    EXPECT_FALSE(t.hasTimes());
  }
  EXPECT_EQ(read("0.5 " + row + "\n0.6 " + row + "\n").times, (Numbers{0.5, 0.6}));
  EXPECT_TRUE(contains(errorOf([&] { read("1 0 0 0 0 1 0 0 0 0 1 0 4 5 6 1\n"); }), "column by column"));
  EXPECT_TRUE(contains(errorOf([&] { read(block + "1 0 0 0\n"); }), "f:5: a matrix of 1 rows"));
  EXPECT_TRUE(contains(errorOf([&] { read("1 0 0 0\n0 1.01 0 0\n0 0 1 0\n0 0 0 1\n"); }), "--norm-tolerance"));
}

TEST(BenchmarkFiles, ImagesOfColmapAreCamerasInTheWorld) {
  const std::string head = "# Image list with two lines of data per image:\n";
  // Rotated by 90 degrees about z, the world's origin at (1, 2, 3) of the camera: the camera is at -R' t.
  const std::string second = "2 0.7071067811865476 0 0 0.7071067811865476 1 2 3 1 cam0/0002.png\n1 2 -1 3 4 7\n";
  const std::string first = "1 1 0 0 0 0 0 0 1 cam0/0001.png\n\n";
  const Trajectory t = read(head + second + first);
  EXPECT_EQ(t.format, "colmap");
  ASSERT_EQ(t.size(), 2U);
  EXPECT_TRUE(t.poses[1].translation().isApprox(Eigen::Vector3d(-2, 1, -3), 1e-12)) << t.poses[1].translation();
  EXPECT_FALSE(t.hasTimes());
  EXPECT_EQ(t.lines, (std::vector<std::size_t>{4, 2}));
  // Without the empty lines of images that have no points.
  EXPECT_EQ(read("1 1 0 0 0 0 0 0 1 a.png\n2 1 0 0 0 0 0 0 1 b.png\n").size(), 2U);
  const Trajectory stamped =
      read("1 1 0 0 0 0 0 0 1 1305031102.275326.png\n\n2 1 0 0 0 5 0 0 1 1305031102.175304.png\n\n");
  EXPECT_EQ(stamped.time_texts[0], "1305031102.175304");
  EXPECT_EQ(read("1 1 0 0 0 0 0 0 1 d/1403636579763555584.png\n").time_texts[0], "1403636579.763555584");
  EXPECT_TRUE(contains(errorOf([&] { read(head + first + "3 4\n"); }), "f:4: 2 fields, expected 10"));
}

TEST(BenchmarkFiles, VerticesOfAGraph) {
  const std::string graph =
      "PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 7 7 0 0 0 0 0 1\n"
      "VERTEX_SE3:QUAT 2 2 0 0 0 0 0 1\nEDGE_SE3:QUAT 2 7 5 0 0 0 0 0 1\n";
  const Trajectory t = read(graph);
  EXPECT_EQ(t.format, "g2o");
  EXPECT_EQ(xs(t), (Numbers{2, 7}));
  EXPECT_EQ(t.ids, (std::vector<std::int64_t>{2, 7}));
  EXPECT_EQ(read("VERTEX2 0 1 2 0.5\n").format, "toro");
  EXPECT_TRUE(
      contains(errorOf([&] { read(graph + "VERTEX_SE3:QUAT 7 7 0 0 0 0 0 1\n"); }), "the vertex 7 stands in line 2"));
  // Edges without information are known to have none.
  const PoseGraph edges = parseGraph(graph, "f");
  EXPECT_EQ(edges.n_unknown, 1U);
  EXPECT_TRUE(edges.edges[0].matrix.array().isNaN().all());
  EXPECT_TRUE(contains(errorOf([&] { formatTrajectory(t, "g2o", {}); }), "read, not written"));
}

TEST(BenchmarkFiles, MessagesNameTheWayOut) {
  std::string row = "1 2 3 4 0 0 0 1";
  for (int k = 0; k < 6; ++k) row += " 0.1";
  EXPECT_TRUE(contains(errorOf([&] { read(row); }), "14 (TUM and --cov-layout diag6)"));
  EXPECT_EQ(read(row, {.layout = CovarianceLayout::diag6}).covariances[0](5, 5), 0.1);
  EXPECT_TRUE(
      contains(errorOf([&] { read("1 2 3 4 0 0 0 1.002\n"); }), "1 within 0.001, or a larger --norm-tolerance"));
  EXPECT_EQ(read("1 2 3 4 0 0 0 1.002\n", {.reading = {.norm_tolerance = 0.01}}).n_normalised, 1U);
}

// --- Limits -----------------------------------------------------------------------------------------------------------

TEST(Limits, AliasesOfYamlAreRefused) {
  std::string bomb = "a: &a [1,1,1,1,1,1,1,1,1]\n";
  for (char c = 'b'; c < 'k'; ++c) {
    bomb += fmt::format("{0}: &{0} [", c);
    for (int k = 0; k < 9; ++k) bomb += fmt::format("{}*{}", k > 0 ? "," : "", static_cast<char>(c - 1));
    bomb += "]\n";
  }
  EXPECT_EQ(errorOf([&] { read("header:\n  x: 1\n" + bomb); }),
            "f:4: an alias of YAML (*name), expected each value where it belongs");
  EXPECT_EQ(errorOf([&] { read("---\nheader: &h {a: *h}\n"); }),
            "f:2: an alias of YAML (*name), expected each value where it belongs");
  // Text that yaml-cpp hands out as documents without an end.
  EXPECT_NE(errorOf([&] { read("*0\n}\n*1\n", {.format = "ros-yaml"}); }), "");
  // A star in a text is none.
  const std::string pose = "pose:\n  position: {x: 1, y: 2, z: 3}\n  orientation: {x: 0, y: 0, z: 0, w: 1}\n";
  EXPECT_EQ(read("note: 'a *b'\n" + pose, {.format = "ros-yaml"}).size(), 1U);
}

TEST(Limits, ColumnsAreCounted) {
  std::string header = "tx", row = "1";
  for (int k = 1; k < 20000; ++k) header += fmt::format(",c{}", k), row += ",1";
  EXPECT_EQ(errorOf([&] { read(header + "\n" + row + "\n"); }), "f:1: 20000 columns, expected at most 10000");
  EXPECT_EQ(errorOf([&] { read(row + "\n", {.reading = {.columns = {"t=1"}}}); }),
            "f:1: 20000 columns, expected at most 10000");
}

TEST(Limits, TextsAreAsLargeAsTheOptionSays) {
  const TemporaryDirectory directory;
  const std::string large(3000000, '\n'), path = directory / "zeros.gz";
  gzFile file = gzopen(path.c_str(), "wb");
  gzwrite(file, large.data(), static_cast<unsigned>(large.size()));
  gzclose(file);
  EXPECT_EQ(loadText(path).text.size(), large.size());
  EXPECT_EQ(
      errorOf([&] { loadText(path, 0.001); }),
      path + ": the compressed data expand to a larger text, expected at most 0.001 GB, or --largest-file with more");
  const std::string plain = directory.write("plain", large);
  EXPECT_TRUE(contains(errorOf([&] { loadText(plain, 0.001); }), "3000000 bytes, expected at most 0.001 GB"));
  EXPECT_EQ(loadText(plain, 0.003).text.size(), large.size());
  // What has no size: a device that never ends.
  EXPECT_TRUE(contains(errorOf([] { loadText("/dev/zero", 0.001); }), "a text without an end in sight"));
  EXPECT_TRUE(
      contains(errorOf([&] { readTrajectory(plain, {.reading = {.largest_file = 0.001}}); }), "--largest-file"));
}

TEST(TextLists, HoldTexts) {
  TextList list;
  EXPECT_TRUE(list.empty());
  for (const char* text : {"1.5", "", "1403636579.763555584"}) list.push_back(text);
  EXPECT_EQ(list.size(), 3U);
  EXPECT_EQ(list[1], "");
  EXPECT_EQ(list.front() + list.back(), "1.51403636579.763555584");
}

}  // namespace
}  // namespace liestat
