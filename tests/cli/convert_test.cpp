// liestat convert: round trips of every format, what is not known, what is ambiguous, and files that are wrong.
#include <cli/commands/commands.hpp>
#include <formats/pose_graph.hpp>
#include <formats/trajectory.hpp>
#include <formats/detail/trajectory_rows.hpp>
#include <stats/convention_presets.hpp>
#include <stats/random.hpp>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <support/temporary_directory.hpp>

namespace liestat::cli {
namespace {

/// The command in this process, with what it says.
struct ConvertRun {
  int status = -1;
  std::string output, errors;
};
ConvertRun convert(const std::vector<std::string>& arguments) {
  std::vector<std::string> words = {"liestat", "convert"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  ConvertRun run;
  run.status = runCommandLine(static_cast<int>(argv.size()), argv.data(), {{"", "", {addConvertCommand}}});
  run.output = testing::internal::GetCapturedStdout();
  run.errors = testing::internal::GetCapturedStderr();
  return run;
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// Poses a tenth of a second apart, of any rotation, with full covariances.
std::string csvOf(int rows, double scale = 1e-4, double distance = 3) {
  CounterRng rng(5, 0);
  std::string text = "t,tx,ty,tz,qx,qy,qz,qw";
  for (int i = 0; i < 6; ++i) {
    for (int j = i; j < 6; ++j) text += fmt::format(",cov_{}{}", i, j);
  }
  for (int k = 0; k < rows; ++k) {
    const Eigen::Vector4d q = rng.unitQuaternion().coeffs();
    const Eigen::Vector3d p = distance * rng.unitVector<3>();
    Matrix6d C = scale * Matrix6d::Identity();
    for (int m = 0; m < 4; ++m) {
      const Eigen::Matrix<double, 6, 1> u = rng.normalVector<6>();
      C += scale * u * u.transpose();
    }
    text += fmt::format("\n17{:08}.{}5", k / 10, k % 10);
    for (const double v : {p[0], p[1], p[2], q[0], q[1], q[2], q[3]}) text += fmt::format(",{:.17g}", v);
    for (int i = 0; i < 6; ++i) {
      for (int j = i; j < 6; ++j) text += fmt::format(",{:.17g}", C(i, j));
    }
  }
  return text + "\n";
}

/// The largest difference of covariances, relative to the largest entry; poses must agree to rounding, and what is
/// unknown in one must be so in the other.
double gapOf(const Trajectory& a, const Trajectory& b, bool cross = true) {
  EXPECT_EQ(a.size(), b.size());
  double largest = 0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    EXPECT_LE((a.poses[i].matrix() - b.poses[i].matrix()).cwiseAbs().maxCoeff(), 1e-14);
    Matrix6d A = a.covariances[i], B = b.covariances[i];
    if (!cross) {
      EXPECT_TRUE((B.topRightCorner<3, 3>().array().isNaN()).all());
      for (Matrix6d* M : {&A, &B}) M->topRightCorner<3, 3>().setZero(), M->bottomLeftCorner<3, 3>().setZero();
    }
    const double gap = (A - B).cwiseAbs().maxCoeff() / A.cwiseAbs().maxCoeff();
    if (!(gap <= largest)) largest = gap;
  }
  return largest;
}

class Convert : public testing::Test {
 protected:
  std::string path(const std::string& name) const { return directory_ / name; }
  std::string write(const std::string& name, const std::string& text) const { return directory_.write(name, text); }
  /// The message of a run that must fail and write nothing.
  std::string refusal(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin() + 1, path("refused"));
    const ConvertRun run = convert(arguments);
    EXPECT_EQ(run.status, 2) << run.output;
    EXPECT_FALSE(std::filesystem::exists(path("refused")));
    EXPECT_EQ(std::count(run.errors.begin(), run.errors.end(), '\n'), 1) << run.errors;
    return run.errors;
  }
  TemporaryDirectory directory_;
};

TEST_F(Convert, everyFormatGivesBackWhatItWasGiven) {
  const std::string given = write("given.csv", csvOf(12));
  const Trajectory before = readTrajectory(given);
  std::string times;
  for (std::size_t i = 0; i < before.time_texts.size(); ++i) times += before.time_texts[i] + "\n";
  const std::string times_file = write("times.txt", times);
  for (const std::string& format : trajectoryFormatNames(false)) {
    if (format == "auto") continue;
    for (const char* convention : {"ros-fixed", "right,unit=deg", "mrpt-ypr", "left,order=rt,content=sigmas"}) {
      if (format == "openvins" && contains(convention, "left")) continue;  // mixes the blocks, of which one is lost
      const std::string there = path("there_" + format), back = path("back.csv");
      ConvertRun run = convert({given, there, "--to", format, "--cov-to", convention});
      ASSERT_EQ(run.status, 0) << format << ": " << run.errors;
      std::vector<std::string> arguments = {there, back, "--from", format, "--to", "csv", "--cov-from", convention};
      if (format == "kitti") arguments.insert(arguments.end(), {"--times", times_file});
      run = convert(arguments);
      ASSERT_EQ(run.status, 0) << format << ": " << run.errors;
      const Trajectory after = readTrajectory(back);
      EXPECT_LE(gapOf(before, after, format != "openvins"), 1e-13) << format << " " << convention;
      EXPECT_EQ(after.times, before.times) << format;
      EXPECT_EQ(after.stated_convention, Convention{});
      // Told by its content alone.
      EXPECT_EQ(readTrajectory(there).format, format);
    }
  }
}

TEST_F(Convert, everyConventionGoesThereAndBack) {
  const std::string given = write("given.csv", csvOf(5));
  const Trajectory before = readTrajectory(given);
  for (const NamedConvention& c : convention_presets) {
    const std::string there = path("there.csv"), back = path("back.csv");
    ASSERT_EQ(convert({given, there, "--cov-to", std::string(c.name)}).status, 0) << c.name;
    // The header of the file says what it is, so that no flag is needed, and another one is an error.
    ASSERT_EQ(convert({there, back, "--cov-to", "right"}).status, 0) << c.name;
    EXPECT_LE(gapOf(before, readTrajectory(back)), 1e-11) << c.name;
    if (c.name != "right") {
      EXPECT_TRUE(contains(refusal({there, "--to", "csv", "--cov-from", "right"}), "--cov-from says 'right'"));
    }
    const Trajectory read = readTrajectory(there);
    const std::vector<Gaussian<SE3d>> ours = gaussiansOf(read, conventionOf(read, std::nullopt, "--cov-from"));
    EXPECT_LE((ours[0].covariance - before.covariances[0]).cwiseAbs().maxCoeff(), 1e-14) << c.name;
  }
}

TEST_F(Convert, sameConventionKeepsEachDigit) {
  const std::string given = write("given.csv", csvOf(3));
  ASSERT_EQ(convert({given, path("a.tum"), "--to", "tum"}).status, 0);
  EXPECT_TRUE(contains(contentOf(path("a.tum.cov")),
                       "# liestat-covariance 1\n# order: tr\n# perturbation: right\n# unit: rad\n"
                       "# content: covariance\n# layout: upper21\n1700000000.05 "));
  const Trajectory before = readTrajectory(given), after = readTrajectory(path("a.tum"));
  EXPECT_EQ(after.covariance_source, path("a.tum.cov"));
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(after.covariances[i], before.covariances[i]);
}

TEST_F(Convert, layoutsAfterTumsColumns) {
  const Trajectory before = readTrajectory(write("given.csv", csvOf(4)));
  for (const auto& [layout, size] :
       std::vector<std::pair<std::string, int>>{{"full36", 36}, {"upper21", 21}, {"lower21", 21}}) {
    ASSERT_EQ(convert({path("given.csv"), path("x.tum"), "--to", "tum", "--cov-to", "left,layout=" + layout}).status,
              0);
    // As other programs write it: the numbers behind the pose.
    std::string text;
    const std::string tum = contentOf(path("x.tum")), side = contentOf(path("x.tum.cov"));
    std::size_t a = 0, b = side.find("\n17") + 1;
    for (std::size_t i = 0; i < 4; ++i) {
      const std::size_t end_a = tum.find('\n', a), end_b = side.find('\n', b);
      text += tum.substr(a, end_a - a) + side.substr(side.find(' ', b), end_b - side.find(' ', b)) + "\n";
      a = end_a + 1, b = end_b + 1;
    }
    const std::string wide = write("wide.txt", text);
    ASSERT_EQ(convert({wide, path("back.csv"), "--to", "csv", "--cov-layout", layout, "--cov-from", "left"}).status, 0)
        << size;
    EXPECT_LE(gapOf(before, readTrajectory(path("back.csv"))), 1e-12) << layout;
    EXPECT_TRUE(contains(refusal({wide, "--to", "csv", "--cov-from", "left"}),
                         fmt::format("{} numbers without a header", 8 + size)));
    EXPECT_TRUE(contains(refusal({wide, "--to", "csv", "--cov-layout", layout}), "does not say what its covariances"));
  }
}

TEST_F(Convert, ambiguousConventionsNeedAFlag) {
  const std::string given = write("given.csv", csvOf(2));
  for (const char* format : {"openvins", "ros-json", "ros-yaml", "ros-csv"}) {
    EXPECT_TRUE(contains(refusal({given, "--to", format}), "cannot say what its covariances mean, expected --cov-to"));
    ASSERT_EQ(convert({given, path("there"), "--to", format, "--cov-to", "ros-rpy"}).status, 0);
    EXPECT_TRUE(contains(refusal({path("there"), "--to", "csv"}), "does not say what its covariances mean"));
  }
  EXPECT_TRUE(contains(refusal({given, "--to", "csv", "--cov-to", "ros-fixd"}), "is it 'ros-fixed'?"));
  EXPECT_TRUE(contains(refusal({given, "--to", "csv", "--cov-to", "right,unit=grad"}), "there is no convention"));
}

// --- What is not known ------------------------------------------------------------------------------------------------

const std::string ros_pose = R"("pose":{"position":{"x":1,"y":2,"z":3},"orientation":{"x":0,"y":0.6,"z":0,"w":0.8}})";
std::string rosMessage(const std::string& covariance) {
  return R"({"header":{"stamp":{"sec":5,"nanosec":7},"frame_id":"map"},"pose":{)" + ros_pose + ",\"covariance\":[" +
         covariance + "]}}\n";
}
std::string diagonal(const std::vector<std::string>& values) {
  std::string text;
  for (std::size_t i = 0; i < 36; ++i) text += (i > 0 ? "," : "") + (i % 7 == 0 ? values[i / 7] : std::string("0"));
  return text;
}

TEST_F(Convert, sentinelsAreUnknown) {
  const std::string zeros = rosMessage(diagonal({"0", "0", "0", "0", "0", "0"}));
  const std::string minus = rosMessage(diagonal({"-1", "0", "0", "0", "0", "0"}));
  const std::string partly = rosMessage(diagonal({"1", "2", "99999", "0.1", "1e6", "0.2"}));
  const Trajectory read = parseTrajectory(zeros + minus + partly, "x");
  ASSERT_EQ(read.covariances.size(), 3U);
  EXPECT_TRUE(read.covariances[0].array().isNaN().all());
  EXPECT_TRUE(read.covariances[1].array().isNaN().all());
  EXPECT_EQ(read.n_unmeasured, 1U);
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      EXPECT_EQ(std::isnan(read.covariances[2](i, j)), i == 2 || j == 2 || i == 4 || j == 4);
    }
  }
  EXPECT_EQ(read.time_texts[0], "5.000000007");
  // Through a conversion: nothing unknown becomes a number, and the message says it again as it was.
  const std::string file = write("m.json", zeros + partly);
  ASSERT_EQ(
      convert({file, path("m.csv"), "--to", "csv", "--cov-from", "ros-body-ori", "--cov-to", "ros-body-ori"}).status,
      0);
  const Trajectory back = readTrajectory(path("m.csv"));
  EXPECT_TRUE(back.covariances[0].array().isNaN().all());
  EXPECT_EQ(back.covariances[1](5, 5), 0.2);
  const ConvertRun again = convert({path("m.csv"), path("again.json"), "--to", "ros-json", "--cov-to", "ros-body-ori"});
  ASSERT_EQ(again.status, 0) << again.errors;
  EXPECT_TRUE(contains(again.output, "2 unknown components are written as a variance of 1e6"));
  const Trajectory twice = readTrajectory(path("again.json"));
  EXPECT_TRUE(twice.covariances[0].array().isNaN().all());
  EXPECT_TRUE(std::isnan(twice.covariances[1](2, 2)));
  EXPECT_EQ(twice.covariances[1](1, 1), 2);

  const Trajectory mavlink = parseTrajectory(
      R"([{"mavpackettype":"ATTITUDE","roll":1},{"mavpackettype":"ODOMETRY","time_usec":12,"x":1,"y":2,"z":3,"q":[0.8,0,0.6,0],"pose_covariance":[NaN,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0]}])",
      "m");
  ASSERT_EQ(mavlink.size(), 1U);
  EXPECT_TRUE(mavlink.covariances[0].array().isNaN().all());
  EXPECT_NEAR(mavlink.poses[0].unit_quaternion().w(), 0.8, 1e-15) << "w stands first";
  EXPECT_EQ(mavlink.time_texts[0], "0.000012");
  EXPECT_EQ(mavlink.stated_convention->perturbation, Perturbation::roll_pitch_yaw);
}

TEST_F(Convert, unknownCrossBlocks) {
  const std::string vins = write("vins.txt",
                                 "# timestamp(s) tx ty tz qx qy qz qw Pr11 ...\n"
                                 "1.5 1 2 3 0 0.6 0 0.8 0.01 0 0 0.02 0 0.03 1 0.1 0 2 0 3\n"
                                 "2.5 1 2 3 0 0.6 0 0.8 0 0 0 0 0 0 0 0 0 0 0 0\n"
                                 "3.5 1 2 3 0 0.6 0 0.8\n");
  ASSERT_EQ(convert({vins, path("a.csv"), "--to", "csv", "--cov-from", "openvins"}).status, 0);
  const Trajectory read = readTrajectory(path("a.csv"));
  EXPECT_TRUE((read.covariances[0].topRightCorner<3, 3>().array().isNaN().all()));
  EXPECT_NEAR(read.covariances[0](4, 4), 0.02, 1e-17) << "the rotation's block stands first in the file";
  EXPECT_TRUE(read.covariances[1].array().isNaN().all()) << "zeros throughout";
  EXPECT_TRUE(read.covariances[2].array().isNaN().all()) << "no numbers";
  // A block that is not known cannot be written in a message, nor put into an information matrix.
  EXPECT_TRUE(contains(refusal({vins, "--to", "ros-json", "--cov-from", "openvins", "--cov-to", "ros-fixed"}),
                       "vins.txt:2: some covariances between components are not known"));
  EXPECT_TRUE(contains(refusal({vins, "--to", "csv", "--cov-from", "openvins", "--cov-to", "g2o-full"}),
                       "vins.txt:2: the matrix does not determine one of 'g2o-full'"));
  const ConvertRun run = convert(
      {vins, path("b.csv"), "--to", "csv", "--cov-from", "openvins", "--cov-to", "left", "--assume-uncorrelated"});
  ASSERT_EQ(run.status, 0) << run.errors;
  EXPECT_TRUE(contains(run.output, "1 covariances: unknown correlations taken as 0"));
  EXPECT_TRUE(readTrajectory(path("b.csv")).covariances[0].allFinite());
}

// --- Edges ------------------------------------------------------------------------------------------------------------

const std::string g2o_edge =
    "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 7 1 2 3 0 0.6 0 0.8\nFIX 0\n"
    "EDGE_SE3:QUAT 0 7 1 2 3 0 0.6 0 0.8 "
    "10 1 0 0.5 0 0 20 2 0 0.25 0 30 0 0 1 400 5 0 500 7 600\n";

TEST_F(Convert, edgesOfGraphs) {
  const std::string g2o = write("a.g2o", g2o_edge);
  EXPECT_TRUE(contains(refusal({g2o, "--to", "toro"}), "--cov-from g2o-half or g2o-full"));
  ConvertRun run = convert({g2o, path("a.graph"), "--to", "toro", "--cov-from", "g2o-half"});
  ASSERT_EQ(run.status, 0) << run.errors;
  EXPECT_TRUE(contains(run.output, "FIX has no counterpart"));
  const std::string toro = contentOf(path("a.graph"));
  EXPECT_EQ(toro.find("VERTEX3 0 0 0 0 0 0 0\n"), 0U) << toro;
  EXPECT_TRUE(contains(toro, "EDGE3 0 7 1 2 3 "));
  run = convert({path("a.graph"), path("b.g2o"), "--to", "g2o", "--cov-to", "g2o-half"});
  ASSERT_EQ(run.status, 0) << run.errors;
  const PoseGraph before = parseGraph(g2o_edge, "a"), after = parseGraph(contentOf(path("b.g2o")), "b");
  ASSERT_EQ(after.edges.size(), 1U);
  EXPECT_LE((after.edges[0].matrix - before.edges[0].matrix).cwiseAbs().maxCoeff(), 600 * 1e-12);
  EXPECT_LE((after.edges[0].measurement.matrix() - before.edges[0].measurement.matrix()).norm(), 1e-14);
  // Half and whole angles differ by a factor of four in the rotation's block, two in the cross block.
  ASSERT_EQ(convert({g2o, path("c.g2o"), "--cov-from", "g2o-half", "--cov-to", "g2o-full"}).status, 0);
  const Matrix6d full = parseGraph(contentOf(path("c.g2o")), "c").edges[0].matrix;
  EXPECT_NEAR(full(3, 3), 100, 1e-11);
  EXPECT_NEAR(full(0, 3), 0.25, 1e-14);
  EXPECT_NEAR(full(0, 0), 10, 1e-13);
  EXPECT_EQ(parseGraph(contentOf(path("c.g2o")), "c").fixed, std::vector<std::int64_t>{0});
}

TEST_F(Convert, planarEdges) {
  const std::string text = "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 2 0.5\nEDGE_SE2 0 1 1 2 0.5 100 10 5 200 7 4000\n";
  const std::string g2o = write("p.g2o", text);
  EXPECT_TRUE(contains(refusal({g2o, "--to", "toro"}), "TORO's planar edges do not say along which axes"));
  // The same axes: the numbers in TORO's sequence.
  ASSERT_EQ(convert({g2o, path("p.graph"), "--to", "toro", "--cov-to", "g2o-full"}).status, 0);
  const PoseGraph same = parseGraph(contentOf(path("p.graph")), "p");
  EXPECT_TRUE(contains(contentOf(path("p.graph")), " 100 10 200 4000 5 7\n")) << contentOf(path("p.graph"));
  EXPECT_TRUE(std::isnan(same.edges[0].matrix(2, 2)));
  // Along the axes of the vertex that the edge leaves, and back; an angle in the plane is never a half.
  ASSERT_EQ(convert({g2o, path("q.graph"), "--to", "toro", "--cov-to", "toro"}).status, 0);
  ASSERT_EQ(convert({path("q.graph"), path("q.g2o"), "--to", "g2o", "--cov-from", "toro"}).status, 0);
  const Matrix6d there = parseGraph(contentOf(path("q.graph")), "q").edges[0].matrix;
  const double c = std::cos(0.5), s = std::sin(0.5);
  EXPECT_NEAR(there(0, 0), c * c * 100 - 2 * c * s * 10 + s * s * 200, 1e-10);
  EXPECT_NEAR(there(5, 5), 4000, 1e-9);
  const Matrix6d back = parseGraph(contentOf(path("q.g2o")), "q").edges[0].matrix;
  EXPECT_NEAR(back(0, 1), 10, 1e-10);
  EXPECT_NEAR(back(0, 5), 5, 1e-10);
  EXPECT_EQ(conventionOf(parseGraph(text, "p"), *parseConvention("g2o-half"), "x").unit, RotationUnit::radian);
}

TEST_F(Convert, edgesWithoutNumbersAreUnknown) {
  const std::string bare = write("bare.graph", "EDGE3 0 1 1 2 3 0.1 0.2 0.3\n");
  const PoseGraph graph = parseGraph(contentOf(bare), "bare");
  EXPECT_EQ(graph.n_unknown, 1U);
  EXPECT_TRUE(graph.edges[0].matrix.array().isNaN().all());
  EXPECT_TRUE(
      contains(refusal({bare, "--to", "g2o", "--cov-to", "g2o-full"}), "21 of 21 numbers of this edge's matrix"));
  ASSERT_EQ(convert({bare, path("again.graph")}).status, 0);
  EXPECT_TRUE(contains(contentOf(path("again.graph")), "EDGE3 0 1 1 2 3 0.1")) << "nothing is added";
  EXPECT_EQ(parseGraph(contentOf(path("again.graph")), "a").n_unknown, 1U);
}

// --- What is lost -----------------------------------------------------------------------------------------------------

TEST_F(Convert, refusesWhatWouldNotBeACovariance) {
  EXPECT_TRUE(contains(refusal({write("far.csv", csvOf(1, 1e-6, 5e6)), "--to", "csv", "--cov-to", "left"}),
                       "far.csv:2: |p| is 5e+06 m: the origin is so far away"));
  const std::string pole =
      write("pole.csv",
            "tx,ty,tz,qx,qy,qz,qw,cov_00,cov_01,cov_02,cov_03,cov_04,cov_05,cov_11,cov_12,cov_13,"
            "cov_14,cov_15,cov_22,cov_23,cov_24,cov_25,cov_33,cov_34,cov_35,cov_44,cov_45,cov_55\n"
            "1,2,3,0,0.70710678,0,0.70710678,1,0,0,0,0,0,1,0,0,0,0,1,0,0,0,0.01,0,0,0.01,0,0.01\n");
  EXPECT_TRUE(
      contains(refusal({pole, "--to", "csv", "--cov-to", "ros-rpy"}), "pole.csv:2: the standard deviation of an"));
  const std::string large = write("large.csv", csvOf(3, 0.02));
  ConvertRun run = convert({large, path("a.csv"), "--cov-to", "ros-fixed"});
  EXPECT_EQ(run.status, 0);
  EXPECT_TRUE(contains(run.output, "first order fails, use --sampled")) << run.output;
  run = convert({large, path("b.csv"), "--cov-to", "ros-fixed", "--sampled"});
  EXPECT_EQ(run.status, 0);
  EXPECT_TRUE(contains(run.output, "second moments by sampling")) << run.output;
  EXPECT_GT(gapOf(readTrajectory(path("a.csv")), readTrajectory(path("b.csv"))), 0.01);
}

TEST_F(Convert, indefiniteMatricesAreCountedAndNamed) {
  std::string text = csvOf(3);
  // A correlation above one in the second row: cov_01.
  std::size_t at = 0;
  for (int k = 0; k < 2; ++k) at = text.find('\n', at) + 1;
  for (int k = 0; k < 9; ++k) at = text.find(',', at) + 1;
  text.replace(at, text.find(',', at) - at, "1");
  const std::string file = write("bad.csv", text);
  const ConvertRun run = convert({file, path("a.csv"), "--cov-to", "left"});
  EXPECT_EQ(run.status, 3);
  EXPECT_TRUE(contains(run.output, "1 of 3 matrices are indefinite (line 3)")) << run.output;
  EXPECT_TRUE(contains(refusal({file, "--to", "csv", "--cov-to", "g2o-full"}), "bad.csv:3: the matrix is indefinite"));
}

// --- Files that are wrong ---------------------------------------------------------------------------------------------

TEST_F(Convert, badFilesAreNamedWithLineValueAndExpectation) {
  const std::string numbers20 = "1 1 2 3 0 0 0 1 1 0 0 1 0 1 2 0 0 2 0 2\n";
  struct Case {
    const char* format;
    std::string text, message;
  };
  const std::vector<Case> cases = {
      {"auto", "", "the file is empty"},
      {"auto", "# only this\n", "the file has no data"},
      {"auto", "1 2 3\n", ":1: 3 numbers without a header"},
      {"tum", "1 1 2 3 0 0 0 1\n2 1 2 3 0 0 0\n", ":2: 7 fields, expected 8"},
      {"tum", "1 1 2 3 0 0 0 0\n", ":1: the quaternion is zero, expected a unit vector"},
      {"tum", "1 1 2 x 0 0 0 1\n", ":1: tz is 'x', expected a number"},
      {"openvins", numbers20 + "2 1 2 3 0 0 0 1 1 0\n", ":2: 10 fields, expected 20"},
      {"openvins", "1 1 2 3 0 0 0 1 1 0 0 1 0 1 -2 0 0 2 0 2\n", ":1: diagonal entry 3 of the matrix is -2"},
      {"openvins", "1 1 2 3 0 0 0 2 1 0 0 1 0 1 2 0 0 2 0 2\n", ":1: the norm of the quaternion is 2"},
      {"openvins", "1 1 2 3 0 0 0 1 1 0 0 1 0 1 2 0 0 2 inf 2\n", ":1: number 11 of the covariance is 'inf'"},
      {"ros-json", "{\"pose\": [", ":1: this is no JSON"},
      {"ros-json", "[\n{\"pose\":\n{\"position\":{\"x\":1e1652}}}]",
       ":3: a number is '1e1652', expected a finite number"},
      {"mavlink-json", "{\"x\": -1e400}\n", ":1: a number is '-1e400', expected a finite number"},
      {"ros-json", "[\n{\"pose\":{\"position\":{\"x\":1}}}]", "message 0.pose.position has no 'y'"},
      {"ros-json", "{" + ros_pose + ",\"header\":{}}", ":1: the message.header has no 'stamp'"},
      {"ros-json", rosMessage("1,2,3"), ":1: the message.pose.covariance has 3 numbers, expected 36, row by row"},
      {"ros-json", rosMessage("1,2," + diagonal({"1", "1", "1", "1", "1", "1"}).substr(4)),
       "is not symmetric (by 2 of"},
      {"ros-json", rosMessage(diagonal({"1", "\"a\"", "1", "1", "1", "1"})), "covariance is 'a', expected a number"},
      {"ros-yaml", "pose: [1, 2\n", ":2: YAML"},
      {"ros-yaml", "---\nheader: 1\npose:\n  position: 3\n", ":2: the message.header has no 'stamp'"},
      {"ros-csv", "%time,field.pose.pose.position.x\n1,2\n", ":1: there is no column 'field.pose.pose.position.y'"},
      {"mavlink-csv", "time_usec,x,y,z,q[0],q[1],q[2],q[3]\n1.5,1,2,3,1,0,0,0\n",
       ":2: the time is '1.5', expected a whole number of microseconds"},
      {"mavlink-json", "{\"mavpackettype\":\"ODOMETRY\",\"time_usec\":1,\"x\":1,\"y\":2,\"z\":3,\"q\":[1,0,0]}",
       "the message.q has 3 numbers, expected 4, w first"},
      {"g2o", "EDGE_SE3:QUAT 0 1 1 2 3 0 0 0 1 5 5\n", ":1: 12 fields, expected 31 of EDGE_SE3:QUAT"},
      {"g2o", "EDGE_SE3:QUAT a 1 1 2 3 0 0 0 1\n", ":1: the vertex is 'a', expected a whole number"},
      {"g2o", "VERTEX_SE2 0 0 0 0\nVERTEX_SE3:QUAT 1 1 2 3 0 0 0 1\n", ":2: VERTEX_SE3:QUAT in a file of EDGE_SE2"},
      {"g2o", "LANDMARK 1 2\n", ":1: a line of 'LANDMARK'"},
  };
  for (const Case& c : cases) {
    const std::string file = write("bad", c.text);
    const std::string error = refusal({file, "--from", c.format, "--cov-from", "g2o-full"});
    EXPECT_EQ(error.find(file), 0U) << error;
    EXPECT_TRUE(contains(error, c.message)) << c.text << "\n" << error << "expected " << c.message;
  }
}

TEST_F(Convert, sideFilesThatAreWrong) {
  const std::string poses = write("p.tum", "1.0 1 2 3 0.1 0.5 0.3 0.806225775\n2.0 1 2 3 0 0 0 1\n");
  const std::string header = detail::conventionHeader({.layout = CovarianceLayout::diag6});
  const auto side = [&](const std::string& text) {
    write("p.tum.cov", text);
    return refusal({poses, "--to", "csv"});
  };
  EXPECT_TRUE(
      contains(side("1.0 1 1 1 1 1 1\n"), "p.tum.cov:1: there is no header, expected '# liestat-covariance 1'"));
  EXPECT_TRUE(contains(side("# liestat-covariance 2\n1.0 1\n"), "version '2' of the header, expected 1"));
  EXPECT_TRUE(
      contains(side("# liestat-covariance 1\n# order: tr\n1.0 1\n"), "the header does not say the perturbation"));
  EXPECT_TRUE(contains(side("# liestat-covariance 1\n# order: xy\n1.0 1\n"), ":2: order is 'xy'"));
  EXPECT_TRUE(contains(side(header + "1.0 1 1 1 1 1\n"), ":7: 6 fields, expected 7 (time and diag6)"));
  EXPECT_TRUE(contains(side(header + "1 1 1 1 1 1 1\n"), "none of its 1 times is that of a pose"));
  EXPECT_TRUE(contains(side(header + "1.0 1 1 1 1 1 1\n3.0 1 1 1 1 1 1\n"), "1 of its 2 times are those of no pose"));
  EXPECT_TRUE(contains(side(header + "1.0 1 1 1 1 1 1\n1.0 1 1 1 1 1 2\n"), ":8: the time 1.0 appears twice"));
  // One of two poses: the other has none. A diagonal says nothing of correlations.
  write("p.tum.cov", header + "1.0 1 1 1 1 1 1\n");
  const Trajectory read = readTrajectory(poses);
  EXPECT_TRUE(read.covariances[1].array().isNaN().all());
  EXPECT_TRUE(std::isnan(read.covariances[0](0, 1)));
  EXPECT_TRUE(contains(refusal({poses, "--to", "csv", "--cov-to", "ros-fixed"}), "--assume-uncorrelated"));
  EXPECT_EQ(convert({poses, path("q.csv"), "--to", "csv", "--assume-uncorrelated"}).status, 0);
  EXPECT_EQ(readTrajectory(path("q.csv")).covariances[0](0, 1), 0);
}

TEST_F(Convert, timesKeepTheirDigits) {
  EXPECT_EQ(detail::secondsOfTicks("1403636579763555584", 9), "1403636579.763555584");
  EXPECT_EQ(detail::secondsOfTicks("7", 9), "0.000000007");
  bool exact = false;
  EXPECT_EQ(detail::ticksOfSeconds("1403636579.763555584", 9, exact), "1403636579763555584");
  EXPECT_TRUE(exact);
  EXPECT_EQ(detail::ticksOfSeconds("0.0000000079", 9, exact), "7");
  EXPECT_FALSE(exact);
  EXPECT_EQ(detail::ticksOfSeconds("12", 6, exact), "12000000");
  const std::string euroc =
      write("e.csv", "#timestamp [ns],p_x,p_y,p_z,q_w,q_x,q_y,q_z\n1403636579763555584,1,2,3,1,0,0,0\n");
  ASSERT_EQ(convert({euroc, path("e.tum"), "--to", "tum"}).status, 0);
  EXPECT_EQ(contentOf(path("e.tum")), "1403636579.763555584 1 2 3 0 0 0 1\n")
      << "8 columns, single blanks, as evo wants";
  EXPECT_FALSE(std::filesystem::exists(path("e.tum.cov")));
  ASSERT_EQ(convert({path("e.tum"), path("f.csv"), "--to", "euroc"}).status, 0);
  EXPECT_TRUE(contains(contentOf(path("f.csv")), "\n1403636579763555584,1,2,3,1,0,0,0\n"));
  EXPECT_TRUE(contains(refusal({write("k.txt", "1 0 0 1 0 1 0 2 0 0 1 3\n"), "--to", "tum"}), "the file has no times"));
}

TEST_F(Convert, TopicsOfABag) {
  const TemporaryDirectory directory;
  const std::string bag = LIESTAT_SOURCE_DIR "/tests/data/bags/unindexed.mcap", out = directory / "o.csv";
  const ConvertRun list = convert({bag, "--list", "--json", directory / "l.json"});
  if (list.status == 2 && contains(list.errors, "libzstd-dev")) GTEST_SKIP() << list.errors;
  ASSERT_EQ(list.status, 0) << list.errors;
  EXPECT_TRUE(contains(list.output, "/odom       nav_msgs/Odometry                        cdr               5"));
  EXPECT_TRUE(contains(contentOf(directory / "l.json"), R"({"topic": "/imu", "type": "sensor_msgs/Imu")"));
  // As of ROS' text formats, what the matrices mean is for the user to say.
  const ConvertRun unnamed = convert({bag + ":/odom", out, "--to", "csv"});
  EXPECT_TRUE(unnamed.status == 2 && contains(unnamed.errors, "the format bag does not say what its covariances mean"));
  ASSERT_EQ(convert({bag + ":/odom", out, "--to", "csv", "--cov-from", "ros-fixed"}).status, 0);
  const Trajectory t = readTrajectory(bag + ":/odom"), written = readTrajectory(out);
  ASSERT_EQ(written.size(), 5U);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(written.time_texts[i], t.time_texts[i]);
    EXPECT_LT((gaussiansOf(written)[i].covariance - gaussiansOf(t, "ros-fixed")[i].covariance).norm(), 1e-16);
  }
  ASSERT_EQ(convert({bag, out, "--to", "tum", "--frames", "map:camera"}).status, 0);
  EXPECT_EQ(readTrajectory(out).size(), 5U);
  const ConvertRun same = convert({bag + ":/pose", out});
  EXPECT_TRUE(same.status == 2 && contains(same.errors, "read, not written")) << same.errors;
  EXPECT_TRUE(contains(convert({bag + ":/pose"}).errors, "OUT is missing"));
}

}  // namespace
}  // namespace liestat::cli
