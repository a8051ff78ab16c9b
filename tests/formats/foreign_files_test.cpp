// Files that other programs wrote: names of columns, units and headers that are not ours.
#include <formats/features.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <numbers>
#include <string>

#include <formats/imu.hpp>
#include <formats/input_error.hpp>
#include <formats/text.hpp>
#include <support/temporary_directory.hpp>

namespace liestat {

namespace {

constexpr double pi = std::numbers::pi;

FeatureFile read(const std::string& text, const ReadingOptions& options = {}) {
  return readFeatures(text, "f.csv", options);
}

std::string errorIn(const std::string& text, const ReadingOptions& options = {}) {
  return errorOf([&] { read(text, options); });
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST(ForeignColumns, AreMappedAndPassedOver) {
  const std::string text = "frame,cx,cy,cz,speed\n7,1,2,3,fast\n8,4,5,6,slow\n";
  const FeatureFile file = read(text, {.ignore_unknown = true, .columns = {"x=cx", "y=cy", "z=cz"}});
  ASSERT_EQ(file.size(), 2U);
  EXPECT_EQ(file.kind, Feature::point);
  EXPECT_EQ(file.positions[1], Eigen::Vector3d(4, 5, 6));
  const std::string unknown = errorIn(text, {.columns = {"x=cx", "y=cy", "z=cz"}});
  EXPECT_TRUE(contains(unknown, "f.csv:1: unknown column 'frame'")) << unknown;
  EXPECT_TRUE(contains(unknown, "--ignore-unknown")) << unknown;
}

TEST(ForeignColumns, WishesThatCannotBeMet) {
  const std::string text = "x,y,z,a\n1,2,3,4\n";
  EXPECT_TRUE(contains(errorIn(text, {.columns = {"x"}}), "--columns x: no '='"));
  EXPECT_TRUE(contains(errorIn(text, {.columns = {"up=a"}}), "there is no column 'up' of features"));
  EXPECT_TRUE(contains(errorIn(text, {.columns = {"t=A"}}), "the file has no column 'A' (is it 'a'?)"));
  EXPECT_TRUE(contains(errorIn(text, {.columns = {"x=a"}}), "two columns are 'x' after --columns"));
  EXPECT_TRUE(contains(errorIn(text, {.columns = {"t=a", "weight=a"}}), "has another name already"));
  EXPECT_TRUE(contains(errorIn("0 1 2 3 0 0 0 1\n", {.columns = {"x=a"}}), "--columns for a file of the format tum"));
}

TEST(ForeignColumns, PosesOfTheRealTracks) {
  const char* data = std::getenv("LIESTAT_DATA");
  if (data == nullptr) GTEST_SKIP() << "LIESTAT_DATA is not set";
  ReadingOptions how{.ignore_unknown = true, .columns = {"t=t_s", "tx=cx", "ty=cy", "tz=cz"}};
  for (int i = 0; i < 9; ++i) {
    const std::string place = std::to_string(i / 3) + std::to_string(i % 3);
    how.columns.push_back("r" + place + "=R" + place);
  }
  const FeatureFile file = readFeatureFile(std::string(data) + "/tracks/starry_night_poses.csv", how);
  EXPECT_EQ(file.kind, Feature::frame);
  ASSERT_GT(file.size(), 1000U);
  EXPECT_EQ(file.positions[0], Eigen::Vector3d(1.85701, 0.44175, 1.32206));
  EXPECT_EQ(file.times[1], 0.047);
  EXPECT_NEAR(file.rotations[0].toRotationMatrix()(1, 2), -0.999600596, 1e-8);
}

TEST(TumFiles, MayNameTheirColumns) {
  const std::string row = "0.5 1 2 3 0 0 0 1\n";
  for (const char* header :
       {"timestamp tx ty tz qx qy qz qw\n", "# timestamp tx ty tz qx qy qz qw\n", "time tx ty tz qx qy qz qw\n", ""}) {
    const FeatureFile file = read(header + row);
    ASSERT_EQ(file.size(), 1U) << header;
    EXPECT_EQ(file.format, "tum") << header;
    EXPECT_EQ(file.times[0], 0.5);
    EXPECT_EQ(file.rotations[0].w(), 1);
  }
  // The scalar first is another quaternion: as a header it is read so, as a comment it contradicts the format.
  EXPECT_EQ(read("t tx ty tz qw qx qy qz\n0.5 1 2 3 1 0 0 0\n").rotations[0].w(), 1);
  EXPECT_TRUE(contains(errorIn("# t tx ty tz qw qx qy qz\n" + row), "f.csv:1: the comment names the columns"));
}

TEST(RotationVectors, BeyondAHalfTurnAreCountedAndBeyondATurnSuspected) {
  const FeatureFile file = read("rx,ry,rz\n3.2,0,0\n0,0,1\n0,-4,0\n");
  EXPECT_EQ(file.n_beyond_half_turn, 2U);
  EXPECT_EQ(file.largest_rotation_vector, 4);
  EXPECT_NEAR(file.rotations[0].angularDistance(Eigen::Quaterniond(Eigen::AngleAxisd(3.2, Eigen::Vector3d::UnitX()))),
              0, 1e-12);
  EXPECT_EQ(read("rx,ry,rz\n" + std::to_string(pi) + ",0,0\n").n_beyond_half_turn, 0U);

  const std::string degrees = "rx,ry,rz\n1,2,1\n20,-10,5\n";
  EXPECT_EQ(errorIn(degrees),
            "f.csv:3: the rotation vector has length 22.9129, more than a turn: in degrees?, expected radians, or "
            "--degrees; --radians takes them as they are");
  const FeatureFile read_so = read(degrees, {.angles = AngleUnit::degrees});
  EXPECT_NEAR(2 * std::acos(read_so.rotations[1].w()), 22.912878474779198 * pi / 180, 1e-12);
  EXPECT_EQ(read_so.n_beyond_half_turn, 0U);
  EXPECT_EQ(read(degrees, {.angles = AngleUnit::radians}).size(), 2U);
  EXPECT_TRUE(contains(errorIn("x,y,z\n1,2,3\n", {.angles = AngleUnit::degrees}), "there are no angles"));
}

TEST(Readings, InMillimetresAreSuspected) {
  const TemporaryDirectory directory;
  const auto errorOfForce = [&](double force) {
    std::string text = "t,wx,wy,wz,ax,ay,az\n";
    for (int i = 0; i < 20; ++i) text += std::to_string(0.01 * i) + ",0,0,0,0,0," + std::to_string(force) + "\n";
    const std::string path = directory.write("imu.csv", text);
    return errorOf([&] { readImu(path); });
  };
  EXPECT_EQ(errorOfForce(9.81), "");
  EXPECT_TRUE(contains(errorOfForce(9806.65), "in mm/s^2?")) << errorOfForce(9806.65);
  EXPECT_TRUE(contains(errorOfForce(1), "in g?"));
}

TEST(Messages, KeepTheTerminalSafe) {
  EXPECT_EQ(printable("a\x1b[31mb\tc"), "a?[31mb?c");
  // A control character of the second page, one that turns the direction of writing, and bytes that are no UTF-8.
  EXPECT_EQ(printable("\xC2\x9B"
                      "31m"),
            "?31m");
  EXPECT_EQ(printable("\xE2\x80\xAE"
                      "x"),
            "?x");
  EXPECT_EQ(printable("\xFFx\xC3"), "?x?");
  EXPECT_EQ(printable("µs"), "µs");
  EXPECT_EQ(printableLines("one\ntwo\x1b\n"), "one\ntwo?\n");
  EXPECT_EQ(sourceName("-"), "standard input");
  EXPECT_EQ(sourceName("a\x1b"
                       "b.csv"),
            "a?b.csv");
}

}  // namespace
}  // namespace liestat
