#include <formats/features.hpp>

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <string>
#include <stdexcept>
#include <utility>
#include <vector>

#include <formats/input_error.hpp>
#include <formats/numeric_table.hpp>
#include <support/temporary_directory.hpp>

namespace liestat {

namespace {

FeatureFile read(const std::string& text, const ReadingOptions& options = {}) {
  return readFeatures(text, "f.csv", options);
}

std::string errorIn(const std::string& text, const ReadingOptions& options = {}) {
  return errorOf([&] { read(text, options); });
}

TEST(Reading, LinesMayEndInCarriageReturns) {
  for (const char* end : {"\n", "\r\n", "\r"}) {
    const std::string text = std::string("x,y,z") + end + "1,2,3" + end + "4,5,6" + end;
    EXPECT_EQ(read(text).size(), 2U) << ::testing::PrintToString(end);
    EXPECT_EQ(errorIn(std::string("x,y,z") + end + "1,2,3" + end + "4,five,6" + end).substr(0, 8), "f.csv:3:");
  }
}

TEST(Reading, Points) {
  const FeatureFile file = read("x,y,z\n1,2,3\n-1e-3,+2.5,.5\n");
  EXPECT_EQ(file.kind, Feature::point);
  EXPECT_EQ(file.format, "csv");
  ASSERT_EQ(file.size(), 2U);
  EXPECT_EQ(file.positions[0], Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(file.positions[1], Eigen::Vector3d(-1e-3, 2.5, 0.5));
  EXPECT_EQ(file.lines, (std::vector<std::size_t>{2, 3}));
  EXPECT_TRUE(file.rotations.empty() && file.weights.empty() && file.times.empty() && file.covariances.empty());
}

TEST(Reading, CommentsBlankLinesCarriageReturnsSpacesQuotesAndMark) {
  const FeatureFile file =
      read("\xEF\xBB\xBF# a comment\r\n\r\n  \"x\" , y,\tz \r\n1, 2 ,3 # the first\r\n#\r\n\r\n 4,\"5\",6");
  ASSERT_EQ(file.size(), 2U);
  EXPECT_EQ(file.positions[0], Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(file.positions[1], Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(file.lines, (std::vector<std::size_t>{4, 7}));
}

TEST(Reading, ColumnsInAnyOrder) {
  const FeatureFile file = read("weight,qw,qx,t,qy,qz\n2,1,0,7.5,0,0\n");
  EXPECT_EQ(file.kind, Feature::rotation);
  EXPECT_EQ(file.rotations[0].coeffs(), Eigen::Vector4d(0, 0, 0, 1));
  EXPECT_EQ(file.weights, std::vector<double>{2});
  EXPECT_EQ(file.times, std::vector<double>{7.5});
  EXPECT_TRUE(file.positions.empty() && file.directions.empty());
}

TEST(Reading, ThreeFormsOfOneRotation) {
  // A third of a turn about (1,1,1) takes x to y, y to z and z to x.
  const FeatureFile quaternions = read("qx,qy,qz,qw\n0.5,0.5,0.5,0.5\n");
  const FeatureFile vectors = read("rx,ry,rz\n1.2091995761561452,1.2091995761561452,1.2091995761561452\n0,0,0\n");
  const FeatureFile matrices = read("r00,r01,r02,r10,r11,r12,r20,r21,r22\n0,0,1,1,0,0,0,1,0\n");
  for (const FeatureFile& file : {quaternions, vectors, matrices}) {
    EXPECT_EQ(file.kind, Feature::rotation);
    EXPECT_EQ(file.n_normalised, 0U);
    EXPECT_LT((file.rotations[0] * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), 1e-15);
  }
  EXPECT_EQ(vectors.rotations[1].w(), 1);
}

TEST(Reading, Frames) {
  const FeatureFile file = read("tx,ty,tz,rx,ry,rz\n1,2,3,0.1,0,0\n");
  EXPECT_EQ(file.kind, Feature::frame);
  EXPECT_EQ(file.positions[0], Eigen::Vector3d(1, 2, 3));
  EXPECT_DOUBLE_EQ(file.rotations[0].x(), std::sin(0.05));
}

TEST(Reading, Directions) {
  const FeatureFile file = read("dx,dy,dz,cov_00,cov_01,cov_11\n0,0.6,0.8,4,1,2\n");
  EXPECT_EQ(file.kind, Feature::direction);
  EXPECT_LT((file.directions[0] - Eigen::Vector3d(0, 0.6, 0.8)).norm(), 1e-15);
  const Eigen::Matrix2d expected{{4, 1}, {1, 2}};
  EXPECT_EQ(Eigen::Matrix2d(file.covariances[0]), expected);
}

TEST(Reading, Headings) {
  const FeatureFile file = read("t,heading_deg,weight,sd_0\n0,-90,1,0.1\n1,3690.5,2,0.2\n");
  EXPECT_EQ(file.kind, Feature::heading);
  EXPECT_EQ(file.headings, (std::vector<double>{-90, 3690.5}));
  EXPECT_EQ(file.covariances[1](0, 0), 0.2 * 0.2);
  EXPECT_NE(errorIn("heading_deg,tx,ty,tz\n1,0,0,0\n").find("tx,ty,tz beside heading_deg"), std::string::npos);
  EXPECT_NE(errorIn("heading_deg,cov_00,cov_01\n1,1,0\n").find("column 'cov_01' in a file of headings"),
            std::string::npos);
  // Rows of no use to a mean: see FeatureFile::unmeasured.
  EXPECT_EQ(read("heading_deg,cov_00\n1,-1\n2,1\n").unmeasured, (std::vector<std::size_t>{0}));
}

TEST(Reading, ChunksAreTheWholeFile) {
  const TemporaryDirectory directory;
  for (const char* end : {"\n", "\r\n"}) {
    for (const std::size_t n : {1U, 32768U, 70000U}) {
      std::string text = "# a comment\ndx,dy,dz,weight";
      for (std::size_t i = 0; i < n; ++i) {
        text += end + std::string(i % 1000 == 7 ? end : "") + "0,0.6,0.8," + std::to_string(i);
      }
      if (n == 1) text += "1";  // a weight of zero alone is refused
      const FeatureFile whole = read(text);
      FeatureFile sum;
      std::size_t chunks = 0;
      readFeatureChunks(directory.write("f.csv", text), {}, [&](const FeatureFile& rows) {
        ++chunks;
        EXPECT_EQ(rows.kind, Feature::direction);
        EXPECT_EQ(rows.format, "csv");
        sum.directions.insert(sum.directions.end(), rows.directions.begin(), rows.directions.end());
        sum.weights.insert(sum.weights.end(), rows.weights.begin(), rows.weights.end());
        sum.lines.insert(sum.lines.end(), rows.lines.begin(), rows.lines.end());
      });
      EXPECT_EQ(chunks, (n + 32767) / 32768);
      EXPECT_EQ(sum.lines, whole.lines);
      EXPECT_EQ(sum.weights, whole.weights);
      EXPECT_EQ(sum.directions, whole.directions);
    }
  }
  const auto complaint = [&](const std::string& text) {
    return errorOf([&] { readFeatureChunks(directory.write("g.csv", text), {}, [](const FeatureFile&) {}); });
  };
  EXPECT_NE(complaint("x,y,z\n1,2,3\n1,2\n").find("g.csv:3: 2 fields"), std::string::npos);
  EXPECT_NE(complaint("x,y,z\n").find("there is a header but no data"), std::string::npos);
  EXPECT_NE(complaint("").find("cannot be mapped"), std::string::npos);
}

TEST(Reading, CovarianceOfFramesHasTheUpperTriangle) {
  std::string header = "tx,ty,tz,qx,qy,qz,qw";
  std::string row = "0,0,0,0,0,0,1";
  Eigen::Matrix<double, 6, 6> expected;
  for (int i = 0; i < 6; ++i) {
    for (int j = i; j < 6; ++j) {
      header += ",cov_" + std::to_string(i) + std::to_string(j);
      expected(i, j) = expected(j, i) = i == j ? 10 + i : 0.125 * (i + j);
      row += "," + std::to_string(expected(i, j));
    }
  }
  const FeatureFile file = read(header + "\n" + row + "\n");
  ASSERT_EQ(file.covariances.size(), 1U);
  EXPECT_EQ(file.covariances[0], expected);
}

TEST(Reading, FactorsAndDeviationsOfCovariances) {
  const FeatureFile deviations = read("rx,ry,rz,sd_0,sd_1,sd_2\n0,0,0,0.3,3e-6,1e-9\n");
  ASSERT_EQ(deviations.factors.size(), 1U);
  EXPECT_EQ(deviations.factors[0].diagonal(), Eigen::Vector3d(0.3, 3e-6, 1e-9));
  EXPECT_EQ(deviations.covariances[0](0, 0), 0.3 * 0.3);
  const FeatureFile factors = read(
      "dx,dy,dz,factor_00,factor_01,factor_10,factor_11\n"
      "0,0,1,3,0,4,1e-9\n");
  ASSERT_EQ(factors.factors.size(), 1U);
  EXPECT_EQ(factors.factors[0](1, 0), 4);
  EXPECT_EQ(factors.factors[0](1, 1), 1e-9);
  EXPECT_EQ(factors.covariances[0](0, 1), 12);
  EXPECT_EQ(factors.covariances[0], factors.covariances[0].transpose());
  EXPECT_TRUE(read("x,y,z,cov_00,cov_01,cov_02,cov_11,cov_12,cov_22\n0,0,0,1,0,0,1,0,1\n").factors.empty());
}

TEST(Reading, FactorsThatAreNone) {
  EXPECT_EQ(errorIn("x,y,z,sd_0,sd_1,sd_2\n0,0,0,1,0,1\n"),
            "f.csv:2: sd_1 is 0, expected a standard deviation above 0");
  EXPECT_EQ(errorIn("x,y,z,sd_0,sd_1,sd_2,cov_00\n0,0,0,1,1,1,1\n").find("f.csv:1: cov_01"), 0U);
  EXPECT_NE(errorIn("dx,dy,dz,sd_0,sd_1,cov_00,cov_01,cov_11\n0,0,1,1,1,1,0,1\n").find("one form of a covariance"),
            std::string::npos);
  EXPECT_NE(errorIn("dx,dy,dz,factor_00,factor_01,factor_10,factor_11\n0,0,1,0,0,0,0\n").find("not positive definite"),
            std::string::npos);
}

// What messages write for "not measured" is no variance of a rotation in any file; of a length it may be one.
TEST(Reading, SentinelsOfRotations) {
  for (const char* sentinel : {"99999", "1e6", "-1", "1e308"}) {
    const std::string header = "rx,ry,rz,cov_00,cov_01,cov_02,cov_11,cov_12,cov_22\n";
    const FeatureFile file = read(header + "0,0,0,1,0,0,1,0,1\n0,0,0,1,0,0,1,0," + sentinel + "\n1,0,0,1,0,0,2,0,1\n");
    EXPECT_EQ(file.unmeasured, std::vector<std::size_t>{1}) << sentinel;
    EXPECT_TRUE(file.covariances[1].hasNaN());
    const FeatureFile left = withoutUnmeasured(file);
    ASSERT_EQ(left.size(), 2U);
    EXPECT_EQ(left.lines, (std::vector<std::size_t>{2, 4}));
    EXPECT_EQ(left.covariances[1](1, 1), 2);
    EXPECT_NEAR(left.rotations[1].x(), std::sin(0.5), 1e-15);
  }
  const FeatureFile lengths = read("x,y,z,sd_0,sd_1,sd_2\n0,0,0,1000,1,1\n0,0,0,1,1,1\n");
  EXPECT_TRUE(lengths.unmeasured.empty());
  EXPECT_EQ(lengths.n_large_variances, 1U);
}

TEST(Reading, Tum) {
  const FeatureFile file =
      read("# timestamp tx ty tz qx qy qz qw\n1305031102.1 1 2 3 0 0 0 1\n1305031102.2\t1  2 4 0 0 1 0\n");
  EXPECT_EQ(file.format, "tum");
  EXPECT_EQ(file.kind, Feature::frame);
  ASSERT_EQ(file.size(), 2U);
  EXPECT_EQ(file.positions[1], Eigen::Vector3d(1, 2, 4));
  EXPECT_EQ(file.rotations[1].z(), 1);
  EXPECT_DOUBLE_EQ(file.times[0], 1305031102.1);
}

TEST(Reading, Euroc) {
  const std::string rows = "1403715524907143168,0.5,2,1,0,1,0,0,-0.002,0\n";
  const FeatureFile file = read(
      "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v\n" + rows);
  EXPECT_EQ(file.format, "euroc");
  EXPECT_EQ(file.rotations[0].x(), 1);
  EXPECT_EQ(file.positions[0], Eigen::Vector3d(0.5, 2, 1));
  EXPECT_NEAR(file.times[0], 1403715524.907143168, 5e-7);
  EXPECT_EQ(read(rows).format, "euroc") << "known by its nanoseconds without a header too";
}

TEST(Reading, EurocHeaderWithAnotherOrderOfTheQuaternion) {
  EXPECT_EQ(errorIn("# note\n#timestamp, p_x, p_y, p_z, q_x, q_y, q_z, q_w\n1403715524907143168,0,0,0,0,0,0,1\n"),
            "f.csv:2: column 5 of the header is 'q_x', expected EuRoC's order: timestamp, p x y z, q w x y z");
}

TEST(Reading, Kitti) {
  const FeatureFile file = read("0 -1 0 5 1 0 0 6 0 0 1 7\n");
  EXPECT_EQ(file.format, "kitti");
  EXPECT_EQ(file.kind, Feature::frame);
  EXPECT_EQ(file.positions[0], Eigen::Vector3d(5, 6, 7));
  EXPECT_LT((file.rotations[0] * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), 1e-15);
  EXPECT_TRUE(file.times.empty());
}

TEST(Reading, TheFormatCanBeGiven) {
  EXPECT_EQ(read("1,1,2,3,0,0,0,1\n", {.format = "tum"}).kind, Feature::frame);
  EXPECT_EQ(read("1,0,0,5,0,1,0,6,0,0,1,7\n", {.format = "kitti"}).kind, Feature::frame);
  EXPECT_EQ(errorIn("1 2 3\n", {.format = "tum"}), "f.csv:1: 3 fields, expected 8 (t tx ty tz qx qy qz qw)");
  EXPECT_EQ(errorIn("1 0 0 5 0 1 0 6 0 0 1\n", {.format = "kitti"}),
            "f.csv:1: 11 fields, expected 12 (a 3x4 matrix row by row)");
  EXPECT_EQ(formatNames(), (std::vector<std::string>{"auto", "tum", "euroc", "kitti", "csv"}));
  EXPECT_THROW(read("x,y,z\n1,2,3\n", {.format = "excel"}), std::invalid_argument);
}

TEST(Reading, QuaternionsNearUnitNormAreNormalisedAndCounted) {
  const FeatureFile file = read("qx,qy,qz,qw\n0,0,0,1\n0,0,0,1.0005\n0,0.9999,0,0\n0,0,0,1.0000000000001\n");
  EXPECT_EQ(file.n_normalised, 2U) << "1e-13 is rounding";
  EXPECT_NEAR(file.largest_norm_error, 5e-4, 1e-12);
  for (const auto& q : file.rotations) EXPECT_NEAR(q.norm(), 1, 4 * std::numeric_limits<double>::epsilon());
}

TEST(Reading, QuaternionFarFromUnitNorm) {
  const std::string text = "# c\nqx,qy,qz,qw\n0,0,0,1\n0,0,0,1.1\n";
  EXPECT_EQ(errorIn(text),
            "f.csv:4: the norm of the quaternion is 1.1, expected 1 within 0.001, or a larger --norm-tolerance");
  EXPECT_EQ(read(text, {.norm_tolerance = 0.2}).n_normalised, 1U);
  EXPECT_EQ(errorIn("qx,qy,qz,qw\n0,0,0,0\n"), "f.csv:2: the quaternion is zero, expected a unit vector");
  EXPECT_EQ(errorIn("qx,qy,qz,qw\n0,0,1e200,0\n"),
            "f.csv:2: the norm of the quaternion is 1e+200, expected 1 within 0.001, or a larger --norm-tolerance");
}

TEST(Reading, DirectionFarFromUnitNorm) {
  EXPECT_EQ(errorIn("dx,dy,dz\n1,0,0\n0,0,0\n"), "f.csv:3: the direction is zero, expected a unit vector");
  EXPECT_EQ(errorIn("dx,dy,dz\n3,4,0\n"),
            "f.csv:2: the norm of the direction is 5, expected 1 within 0.001, or a larger --norm-tolerance");
}

TEST(Reading, MatricesNearARotationAreProjected) {
  const FeatureFile file = read("r00,r01,r02,r10,r11,r12,r20,r21,r22\n1.0001,0.0002,0,0,1,0,0,0,0.9999\n");
  EXPECT_EQ(file.n_normalised, 1U);
  EXPECT_GT(file.largest_norm_error, 1e-4);
  // The nearest rotation is the one about z by atan2(-0.0002, 2.0001).
  EXPECT_NEAR(2 * file.rotations[0].z(), -0.0002 / 2.0001, 1e-12);
}

TEST(Reading, MatricesThatAreNoRotation) {
  const std::string header = "r00,r01,r02,r10,r11,r12,r20,r21,r22\n";
  EXPECT_EQ(errorIn(header + "1,0,0,0,1,0,0,0,-1\n"),
            "f.csv:2: the rotation matrix has determinant -1, it is a reflection, expected determinant 1");
  EXPECT_EQ(errorIn(header + "1,0,0,0,1,0,0,0,1\n1,0,0,0,2,0,0,0,1\n"),
            "f.csv:3: the rotation matrix is not orthogonal (error 1.5), expected an error within 0.001, or a larger "
            "--norm-tolerance");
  EXPECT_EQ(errorIn(header + "0,0,0,0,0,0,0,0,0\n", {.norm_tolerance = 10}).substr(0, 45),
            "f.csv:2: the rotation matrix is not orthogona");
}

TEST(Reading, RotationVectorsOfAbsurdLength) {
  EXPECT_EQ(errorIn("rx,ry,rz\n1e300,0,0\n"),
            "f.csv:2: the rotation vector has length 1e+300, expected an angle in radians");
}

TEST(Reading, FilesThatAreNone) {
  const TemporaryDirectory directory;
  EXPECT_EQ(errorOf([&] { readFeatureFile(directory / "absent.csv"); }),
            directory / "absent.csv" + std::string(": no such file"));
  EXPECT_EQ(errorOf([&] { readFeatureFile(directory.path().string()); }),
            directory.path().string() + ": this is a directory, expected a file");
  const std::string path = directory.write("line.csv", "x,y,z\n1,2,3\n");
  EXPECT_EQ(readFeatureFile(path).size(), 1U);
}

TEST(Reading, NothingToRead) {
  EXPECT_EQ(errorIn(""), "f.csv: the file is empty");
  EXPECT_EQ(errorIn("\n# only\n\n"), "f.csv: the file has no data, only blank lines and comments");
  EXPECT_EQ(errorIn("# c\nx,y,z\n# c\n\n"),
            "f.csv:2: there is a header but no data, expected at least one row after it");
}

TEST(Reading, TextThatIsNone) {
  EXPECT_EQ(errorIn(std::string("\xFF\xFEx\0", 4)), "f.csv:1: the text is encoded as UTF-16, expected UTF-8");
  EXPECT_EQ(errorIn(std::string("x,y,z\n1,\0,3\n", 12)),
            "f.csv:2: this is not text (it contains a zero byte), expected a text file");
}

const std::string known =
    "t; tx,ty,tz; qx,qy,qz,qw or rx,ry,rz or roll,pitch,yaw or r00 ... r22; x,y,z; dx,dy,dz; heading_deg; weight; "
    "cov_00 ... cov_55 "
    "or "
    "factor_00 ... factor_55 or sd_0 ... sd_5";
const std::string or_else = " (--ignore-unknown passes over others, --columns maps names)";

TEST(Reading, SemicolonsAndTabs) {
  for (const char* mark : {";", "\t", " ; ", ","}) {
    const std::string m = mark;
    const FeatureFile file = readFeatures("x" + m + "y" + m + "z\n1" + m + "2" + m + "3\n", "f.csv", {});
    ASSERT_EQ(file.size(), 1U) << mark;
    EXPECT_EQ(file.positions[0], Eigen::Vector3d(1, 2, 3)) << mark;
  }
  // Decimal commas are not guessed at.
  EXPECT_EQ(errorIn("x;y;z\n0,5;2;3\n"), "f.csv:2: x is '0,5', expected a number");
  // TUM's rows, with tabs.
  const FeatureFile tum = readFeatures("0\t1\t2\t3\t0\t0\t0\t1\n", "f.tum", {});
  EXPECT_EQ(tum.format, "tum");
}

TEST(Reading, QuaternionsCalledWxyz) {
  const FeatureFile file = readFeatures("w,x,y,z\n0.5,-0.5,0.1,0.7\n", "f.csv", {});
  EXPECT_EQ(file.kind, Feature::rotation);
  EXPECT_EQ(file.rotations[0].coeffs(), Eigen::Vector4d(-0.5, 0.1, 0.7, 0.5));
  const FeatureFile pose = readFeatures("tx;ty;tz;x;y;z;w\n1;2;3;0;0;0;1\n", "f.csv", {});
  EXPECT_EQ(pose.kind, Feature::frame);
}

TEST(Reading, RollPitchYaw) {
  const double roll = 0.3, pitch = -0.4, yaw = 2.1;
  const Eigen::Matrix3d expected =
      (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  const FeatureFile rad = readFeatures("yaw,pitch,roll\n2.1,-0.4,0.3\n", "f.csv", {});
  EXPECT_LE((rad.rotations[0].toRotationMatrix() - expected).norm(), 1e-15);
  const FeatureFile deg =
      readFeatures("roll,pitch,yaw\n90,0,0\n", "f.csv", ReadingOptions{.angles = AngleUnit::degrees});
  EXPECT_LE((deg.rotations[0] * Eigen::Vector3d::UnitY() - Eigen::Vector3d::UnitZ()).norm(), 1e-15);
  EXPECT_EQ(
      errorIn("roll,pitch,yaw\n90,0,0\n"),
      "f.csv:2: an angle of roll, pitch, yaw is 90, more than a turn: in degrees?, expected radians, or --degrees; "
      "--radians takes them as they are");
  EXPECT_EQ(errorIn("roll,pitch\n1,2\n"), "f.csv:1: yaw is missing, expected all of roll,pitch,yaw");
}

TEST(Reading, UnknownColumns) {
  EXPECT_EQ(errorIn("x,y,z,wieght\n1,2,3,1\n"),
            "f.csv:1: unknown column 'wieght' (is it 'weight'?), expected " + known + or_else);
  EXPECT_EQ(errorIn("q_x,qy,qz,qw\n"), "f.csv:1: unknown column 'q_x' (is it 'qx'?), expected " + known + or_else);
  EXPECT_EQ(errorIn("timestamp,x,y,z\n"),
            "f.csv:1: unknown column 'timestamp' (is it 't'?), expected " + known + or_else);
  EXPECT_EQ(errorIn("#\n\nx,y,z,elephant\n"), "f.csv:3: unknown column 'elephant', expected " + known + or_else);
  EXPECT_EQ(errorIn("x y q\n1 2 3\n"),
            "f.csv:1: unknown column 'x y q', expected columns separated by commas: " + known);
}

TEST(Reading, HeadersThatDoNotMakeAFeature) {
  EXPECT_EQ(errorIn("x,y,z,x\n"), "f.csv:1: column 'x' appears twice, expected it once");
  EXPECT_EQ(errorIn("x,y,z,\n"), "f.csv:1: column 4 of the header has no name");
  EXPECT_EQ(errorIn("qx,qy,qw\n"), "f.csv:1: qz is missing, expected all of qx,qy,qz,qw");
  EXPECT_EQ(errorIn("tx,qx,qy,qz,qw\n"), "f.csv:1: ty,tz are missing, expected all of tx,ty,tz");
  EXPECT_EQ(errorIn("tx,ty,tz\n"),
            "f.csv:1: tx,ty,tz without a rotation, expected a rotation beside it, or x,y,z if these are points");
  EXPECT_EQ(errorIn("x,y,z,dx,dy,dz\n"), "f.csv:1: the columns x,y,z and dx,dy,dz, expected one of them");
  EXPECT_EQ(errorIn("x,y,z,tx,ty,tz\n"), "f.csv:1: tx,ty,tz beside x,y,z, expected one of them");
  EXPECT_EQ(errorIn("qx,qy,qz,qw,rx,ry,rz\n"), "f.csv:1: the columns qx,qy,qz,qw and rx,ry,rz, expected one of them");
  EXPECT_EQ(errorIn("t,weight\n").substr(0, 35), "f.csv:1: no columns of a feature, e");
  EXPECT_EQ(errorIn("1,2,3\n4,5,6\n").substr(0, 42), "f.csv:1: numbers where the header should b");
  EXPECT_EQ(errorIn("# x,y,z\n1,2,3\n"),
            "f.csv:2: numbers where the header should be, expected the header without a '#' before it");
  EXPECT_EQ(errorIn("1 2 3\n").substr(0, 36), "f.csv:1: 3 numbers without a header,");
}

TEST(Reading, CovarianceColumnsThatDoNotFit) {
  EXPECT_EQ(errorIn("x,y,z,cov_00,cov_01,cov_02,cov_11,cov_12\n"),
            "f.csv:1: cov_22 is missing, expected the upper triangle cov_00 ... cov_22 of a point");
  EXPECT_EQ(
      errorIn("qx,qy,qz,qw,cov_00,cov_33\n"),
      "f.csv:1: column 'cov_33' in a file of rotations, expected the upper triangle cov_00 ... cov_22 of a rotation");
  EXPECT_EQ(errorIn("x,y,z,cov_10\n").substr(0, 55), "f.csv:1: unknown column 'cov_10' (is it 'cov_00'?), exp");
}

TEST(Reading, RowsOfAnotherLength) {
  EXPECT_EQ(errorIn("x,y,z\n1,2,3\n1,2\n"), "f.csv:3: 2 fields, expected 3 as in the header");
  EXPECT_EQ(errorIn("x,y,z\n1,2,3,\n"), "f.csv:2: 4 fields, expected 3 as in the header");
  EXPECT_EQ(errorIn("x,y,z\n1 2 3\n"), "f.csv:2: 1 field, expected 3 as in the header");
  EXPECT_EQ(errorIn("1 1 2 3 0 0 0 1\n1 1 2 3 0 0 0\n"), "f.csv:2: 7 fields, expected 8 (t tx ty tz qx qy qz qw)");
}

TEST(Reading, FieldsThatAreNoNumbers) {
  EXPECT_EQ(errorIn("x,y,z\n1,2,3\n1,abc,3\n"), "f.csv:3: y is 'abc', expected a number");
  EXPECT_EQ(errorIn("x,y,z\n1,,3\n"), "f.csv:2: y is empty, expected a number");
  EXPECT_EQ(errorIn("x,y,z\n1,2,3m\n"), "f.csv:2: z is '3m', expected a number");
  EXPECT_EQ(errorIn("x,y,z\n1,2,0x10\n"), "f.csv:2: z is '0x10', expected a number");
  EXPECT_EQ(errorIn("x,y,z\n1,2,+-3\n"), "f.csv:2: z is '+-3', expected a number");
  EXPECT_EQ(errorIn("x,y,z\nnan,2,3\n"), "f.csv:2: x is 'nan', expected a finite number");
  EXPECT_EQ(errorIn("x,y,z\n-inf,2,3\n"), "f.csv:2: x is '-inf', expected a finite number");
  EXPECT_EQ(errorIn("x,y,z\n1e999,2,3\n"), "f.csv:2: x is '1e999', expected a finite number");
  EXPECT_EQ(errorIn("x,y,z,t\n1,2,3,NaN\n"), "f.csv:2: t is 'NaN', expected a finite number");
  EXPECT_EQ(read("x,y,z\n1e-999,2,3\n").positions[0].x(), 0) << "too small is zero";
  EXPECT_EQ(errorIn("1 1 2 3 0 0 zero 1\n", {.format = "tum"}), "f.csv:1: qz is 'zero', expected a number");
}

TEST(Reading, MessagesStayOnOneLineWhateverTheTextHolds) {
  const std::string message = errorIn("x,y,z\n1,\x1b[31m\x07,3\n");
  EXPECT_EQ(message, "f.csv:2: y is '?[31m?', expected a number");
  EXPECT_EQ(errorIn("x,y,z\n1,2," + std::string(1000, 'a') + "\n"),
            "f.csv:2: z is '" + std::string(40, 'a') + "...', expected a number");
}

TEST(Reading, WeightsAreNotNegative) {
  EXPECT_EQ(read("x,y,z,weight\n1,2,3,1\n1,2,3,0\n").weights, (std::vector<double>{1, 0}));
  EXPECT_EQ(errorIn("x,y,z,weight\n1,2,3,-2.5\n"), "f.csv:2: weight is -2.5, expected 0 or more");
  EXPECT_EQ(errorIn("x,y,z,weight\n1,2,3,0\n1,2,3,0\n"), "f.csv:2: every weight is 0, expected one above 0");
}

TEST(Reading, CovariancesArePositiveDefinite) {
  const std::string header = "x,y,z,cov_00,cov_01,cov_02,cov_11,cov_12,cov_22\n";
  EXPECT_EQ(errorIn(header + "0,0,0,1,0,0,1,0,1\n0,0,0,1,2,0,1,0,1\n"),
            "f.csv:3: the covariance is not positive definite (smallest eigenvalue -1, largest 3), expected positive "
            "eigenvalues");
  EXPECT_FALSE(errorIn(header + "0,0,0,1,1,0,1,0,1\n").empty()) << "singular";
  EXPECT_FALSE(errorIn(header + "0,0,0,0,0,0,0,0,0\n").empty()) << "zero";
  EXPECT_EQ(errorIn(header + "0,0,0,1e-20,0,0,1e-4,0,1e6\n"), "") << "units do not matter";
}

TEST(Reading, AMillionLinesInAboutASecond) {
  std::string text = "tx,ty,tz,qx,qy,qz,qw\n";
  constexpr std::size_t n = 1000000;
  for (std::size_t i = 0; i < n; ++i) text += "1.234567,-2.345678,3.456789,0.182574,0.365148,0.547723,0.730297\n";
  const auto start = std::chrono::steady_clock::now();
  const FeatureFile file = read(text);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  EXPECT_EQ(file.size(), n);
  EXPECT_EQ(file.lines.back(), n + 1);
  RecordProperty("seconds", std::to_string(seconds));
#ifdef NDEBUG
  EXPECT_LT(seconds, 5) << "a machine at rest takes half a second";
#endif
}

TEST(Reading, RealGroundTruth) {
  const char* data = std::getenv("LIESTAT_DATA");
  if (data == nullptr) GTEST_SKIP() << "skipped: LIESTAT_DATA does not name the directory of the real measurements";
  const FeatureFile file = readFeatureFile(std::string(data) + "/vi/euroc/V1_02_medium_gt.csv");
  EXPECT_EQ(file.format, "euroc");
  EXPECT_EQ(file.kind, Feature::frame);
  EXPECT_EQ(file.size(), 16702U);
  EXPECT_EQ(file.positions[0], Eigen::Vector3d(0.515356, 1.996773, 0.971104));
  EXPECT_NEAR(file.rotations[0].w(), 0.161996, 2e-6);
  EXPECT_NEAR(file.rotations[0].z(), 0.554528, 2e-6);
  EXPECT_GT(file.n_normalised, 0U);
  EXPECT_NEAR(file.largest_norm_error, 1.525e-4, 1e-6);
}

TEST(NumericTable, ReadsWhatIsAskedFor) {
  const NumericTable table = parseTable("b,note,a\n1,hello,2\n\n3,x,4\n", "t.csv", {"a", "b"}, {"c"});
  EXPECT_EQ(table.columns(), (std::vector<std::string>{"a", "b"}));
  EXPECT_FALSE(table.has("c"));
  ASSERT_EQ(table.rows(), 2U);
  EXPECT_EQ(table(1, table.column("a")), 4);
  EXPECT_EQ(table.line(1), 4U);
  EXPECT_EQ(parseTable("a,c\n1,2\n", "t.csv", {"a"}, {"b", "c"}).columns(), (std::vector<std::string>{"a", "c"}));
}

TEST(NumericTable, Errors) {
  const auto errorInTable = [](const std::string& text) {
    return errorOf([&] { parseTable(text, "t.csv", {"frame", "u"}); });
  };
  EXPECT_EQ(errorInTable("Frame,u\n1,2\n"),
            "t.csv:1: there is no column 'frame' (is it 'Frame'?), expected the columns frame,u");
  EXPECT_EQ(errorInTable("1,2\n"), "t.csv:1: numbers where the header should be, expected the columns frame,u");
  EXPECT_EQ(errorInTable("frame,u\n1,x\n"), "t.csv:2: u is 'x', expected a number");
  EXPECT_EQ(errorInTable("frame,u\n1\n"), "t.csv:2: 1 field, expected 2 as in the header");
  EXPECT_EQ(errorInTable("frame,u\n"), "t.csv:1: there is a header but no data, expected at least one row after it");
  EXPECT_EQ(errorInTable(""), "t.csv: the file is empty");
  const NumericTable table = parseTable("frame,u\n1.5,2\n", "t.csv", {"frame", "u"});
  EXPECT_EQ(errorOf([&] { (void)table.index(0, 0); }), "t.csv:2: frame is 1.5, expected a whole number of 0 or more");
  EXPECT_EQ(table.index(0, 1), 2U);
}

}  // namespace
}  // namespace liestat
