// `liestat tag-pose` and `hand-eye --images` on rendered tags: poses, calibrations, what is said of bad input.

#include <formats/calibration.hpp>
#include <formats/images.hpp>
#include <formats/input_error.hpp>
#include <fusion/targets/target_pose.hpp>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include <cli/program_output.hpp>
#include <support/rendered_target.hpp>

namespace liestat::cli {
namespace {

using testing::RenderedImage;
using testing::RenderedSheet;

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

void write(const std::string& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }

void writePgm(const std::string& path, const RenderedImage& image) {
  write(path, fmt::format("P5\n{} {}\n255\n", image.width, image.height) +
                  std::string(image.pixels.begin(), image.pixels.end()));
}

constexpr const char* storage =
    "%YAML:1.0\n---\nimage_width: 240\nimage_height: 200\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   "
    "dt: d\n"
    "   data: [ 300., 0., 119.5, 0., 300., 99.5, 0., 0., 1. ]\ndistortion_coefficients: !!opencv-matrix\n   rows: 1\n"
    "   cols: 5\n   dt: d\n   data: [ -0.1, 0.02, 0.001, -0.0005, 0.01 ]\n";

class TagPose : public ::testing::Test {
 protected:
  TagPose() {
    camera = parseCameras(storage, "camera.yaml")[0].camera;
    write(directory / "camera.yaml", storage);
  }
  /// The cells of tag 36h11 of id 0 (black border of 8 cells, bits row by row from its code d7e00984b), white rim.
  static RenderedSheet tag(double cell = 0.01) {
    const char* rows[] = {"1111111111", "1000000001", "1011010101", "1001110101", "1001100001",
                          "1010100001", "1001011001", "1000010001", "1000000001", "1111111111"};
    RenderedSheet sheet{10, 10, {}, cell, {5, 5}};
    for (const char* row : rows) {
      for (int x = 0; x < 10; ++x) sheet.white.push_back(row[x] == '1');
    }
    return sheet;
  }
  std::string image(const std::string& name, const std::vector<std::pair<RenderedSheet, SE3d>>& sheets) {
    writePgm(directory / name, testing::renderSheets(sheets, camera, 3, 0.6, rng));
    return directory / name;
  }
  ProgramOutput tagPose(std::vector<std::string> more, const std::string& target = "april:36h11:0.08") {
    more.insert(more.begin(), "tag-pose");
    more.insert(more.end(), {"--calibration", directory / "camera.yaml", "--target", target});
    return run(more);
  }
  static SE3d at(double x, double y, double z, double rx, double ry, double rz) {
    return SE3d::fromParams((SE3d::Params() << SO3d::exp({rx, ry, rz}).params(), x, y, z).finished());
  }

  const TemporaryDirectory directory;
  Camera camera;
  std::mt19937 rng{40};
};

TEST_F(TagPose, ofARenderedTag) {
  const SE3d truth = at(0.01, -0.01, 0.3, 0.5, 0.3, 0.8);
  const std::string file = image("a.pgm", {{tag(), truth}}), json = directory / "out.json";
  const ProgramOutput result = tagPose({file, "--json", json});
  ASSERT_EQ(result.exit_code, 0) << result.output << result.error;
  EXPECT_TRUE(contains(result.output, "ok: the pose is determined")) << result.output;
  const nlohmann::json pose = nlohmann::json::parse(contentOf(json)).at("images").at(0);
  EXPECT_EQ(pose.at("id"), 0);
  EXPECT_EQ(pose.at("covariance").size(), 6U);
  const auto p = pose.at("camera_T_target");
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(p.at(i).get<double>(), truth.translation()[i], 2e-3);
}

TEST_F(TagPose, isRefusedWithASentence) {
  const auto refused = [&](const ProgramOutput& result, const std::string& what) {
    EXPECT_EQ(result.exit_code, 2) << result.output;
    EXPECT_TRUE(contains(result.error, what)) << result.error;
  };
  const std::string good = image("a.pgm", {{tag(), at(0, 0, 0.35, 0.5, 0.3, 0.8)}});
  const std::string none = image("none.pgm", {});
  const std::string two =
      image("two.pgm", {{tag(), at(-0.06, 0, 0.35, 0.4, 0, 0)}, {tag(), at(0.06, 0, 0.35, -0.4, 0, 0)}});
  refused(tagPose({none}), "no tag of 36h11 is found");
  refused(tagPose({two}), "it shows the tags 0, 0");
  refused(tagPose({two}, "april:36h11:0.08:0"), "it shows the tag 0 2 times");
  refused(tagPose({good}, "april:36h11:0.08:5"), "the tag 5 is not found, but 0");
  refused(tagPose({good}, "april:25h9:0.08"), "but 0 of 36h11");
  refused(tagPose({good}, "april:99h1:0.08"), "the family 99h1 of tags is none of");
  refused(tagPose({good}, "chessboard:9x6:0.025"), "no chessboard of 9 x 6");
  refused(tagPose({good}, "chessboard:9x7:0.025"), "half a turn");
  refused(tagPose({good}, "april:36h11:0"), "more than 0 m");
  refused(tagPose({good}, "tag"), "april:36h11:0.05");
  refused(tagPose({directory / "nowhere.png"}), "there is no such file");
  write(directory / "corrupt.png", "\x89PNG\r\n no image");
  refused(tagPose({directory / "corrupt.png"}), "corrupt.png: it is no image");
  camera.width = 160;
  refused(tagPose({image("small.pgm", {})}), "it has 160 x 200 pixels, expected 240 x 200");
}

TEST_F(TagPose, ofManyImagesCalibrateAHand) {
  const SE3d X = at(0.02, -0.03, 0.05, 0.05, -0.1, 0.2), Y = at(0.5, 0.1, 0.02, 3.0, 0.1, -0.2);
  std::filesystem::create_directory(directory / "images");
  std::uniform_real_distribution<double> u(-1, 1);
  std::string rows = "qx,qy,qz,qw,tx,ty,tz\n";
  for (int i = 0; i < 14; ++i) {
    const SE3d target = at(0.03 * u(rng), 0.03 * u(rng), 0.34 + 0.04 * u(rng), 0.6 * u(rng), 0.6 * u(rng), 2 * u(rng));
    // One image shows nothing.
    image(fmt::format("images/{}.pgm", i), i == 5 ? std::vector<std::pair<RenderedSheet, SE3d>>{}
                                                  : std::vector<std::pair<RenderedSheet, SE3d>>{{tag(), target}});
    const SE3d gripper = Y * target.inverse() * X.inverse();
    const auto q = gripper.so3().params();
    const auto t = gripper.translation();
    rows += fmt::format("{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f}\n", q[0], q[1], q[2], q[3], t[0], t[1], t[2]);
  }
  write(directory / "robot.csv", rows);
  const std::string json = directory / "out.json";
  const ProgramOutput result =
      run({"hand-eye", directory / "robot.csv", "--images", directory / "images", "--target", "april:36h11:0.08",
           "--calibration", directory / "camera.yaml", "--sigma-a", "0.001,0.000002", "--json", json});
  ASSERT_EQ(result.exit_code, 0) << result.output << result.error;
  EXPECT_TRUE(contains(result.output, "images are not used")) << result.output;
  EXPECT_TRUE(contains(result.output, "5.pgm: no tag of 36h11")) << result.output;
  const auto x = nlohmann::json::parse(contentOf(json)).at("X");
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(x.at("translation").at(i).get<double>(), X.translation()[i], 3e-3);
  const ProgramOutput both =
      run({"hand-eye", directory / "robot.csv", directory / "robot.csv", "--images", directory / "images", "--target",
           "april:36h11:0.08", "--calibration", directory / "camera.yaml"});
  EXPECT_EQ(both.exit_code, 2);
  EXPECT_TRUE(contains(both.error, "one of B and --images")) << both.error;
}

TEST_F(TagPose, knowsOpenCvsStorage) {
  const std::string xml =
      "<?xml version=\"1.0\"?>\n<opencv_storage>\n<!-- a comment -->\n<image_width>240</image_width>\n"
      "<image_height>200</image_height>\n<camera_matrix type_id=\"opencv-matrix\">\n  <rows>3</rows>\n  "
      "<cols>3</cols>\n"
      "  <dt>d</dt>\n  <data>\n    300. 0. 119.5 0. 300. 99.5 0. 0. 1.</data></camera_matrix>\n"
      "<distortion_coefficients type_id=\"opencv-matrix\">\n  <rows>1</rows><cols>5</cols><dt>d</dt>\n"
      "  <data>\n    -0.1 0.02 0.001\n    -0.0005 0.01</data></distortion_coefficients>\n</opencv_storage>\n";
  const Camera other = parseCameras(xml, "camera.xml")[0].camera;
  EXPECT_EQ(other.fu, camera.fu);
  EXPECT_EQ(other.cv, camera.cv);
  EXPECT_EQ(other.coefficients, camera.coefficients);
  EXPECT_EQ(other.k3, 0.01);
  EXPECT_EQ(other.width, 240);
  // The third radial coefficient: there and back, and OpenCV's formula.
  const auto pixel = other.project({0.3, -0.2, 1});
  ASSERT_TRUE(pixel);
  const double r2 = 0.13, radial = 1 - 0.1 * r2 + 0.02 * r2 * r2 + 0.01 * r2 * r2 * r2;
  EXPECT_NEAR(pixel->x(), 119.5 + 300 * (0.3 * radial + 2 * 0.001 * -0.06 - 0.0005 * (r2 + 0.18)), 1e-9);
  EXPECT_LT((other.bearing(*pixel)->hnormalized() - Eigen::Vector2d(0.3, -0.2)).norm(), 1e-9);
  const auto refused = [](std::string text, const std::string& from, const std::string& to, const std::string& what) {
    text.replace(text.find(from), from.size(), to);
    try {
      parseCameras(text, "c");
      FAIL() << to;
    } catch (const InputError& error) {
      EXPECT_TRUE(contains(error.what(), what)) << error.what();
    }
  };
  refused(storage, "[ 300.", "[ -300.", "c:5: camera_matrix has the focal lengths -300");
  refused(storage, "0., 1. ]", "0. ]", "has 8 numbers");
  refused(storage, "0.01 ]", "0.01, 0.2 ]", "have 0.2 in place 6");
  refused(storage, "image_width: 240", "image_width: 2.5", "is 2.5");
  refused(xml, "</opencv_storage>", "", "is not closed");
  refused(xml, "</rows>", "</row>", "closes nothing");
  refused(xml, "300. 0.", "x 0.", "c:");
}

}  // namespace
}  // namespace liestat::cli
