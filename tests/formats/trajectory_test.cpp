// Trajectories with covariances for programs in C++: what a file means, and that writing it keeps the meaning.
#include <formats/trajectory.hpp>

#include <formats/input_error.hpp>
#include <stats/convention_presets.hpp>
#include <stats/random.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include <support/temporary_directory.hpp>

namespace liestat {
namespace {

/// A message of ROS at a pose that is turned by 90° about z, with the variances 4 and 1 m² along the world's x and y.
constexpr std::string_view ros_message =
    R"({"header": {"stamp": {"sec": 7, "nanosec": 5}}, "pose": {"pose": {"position": {"x": 1, "y": 2, "z": 3},)"
    R"( "orientation": {"x": 0, "y": 0, "z": 0.7071067811865476, "w": 0.7071067811865476}}, "covariance":)"
    R"( [4,0,0,0,0,0, 0,1,0,0,0,0, 0,0,9,0,0,0, 0,0,0,0.04,0,0, 0,0,0,0,0.01,0, 0,0,0,0,0,0.09]}})";

/// Poses of any rotation a tenth of a second apart, with full covariances.
std::vector<Gaussian<SE3d>> somePoses(int n) {
  CounterRng rng(3, 0);
  std::vector<Gaussian<SE3d>> poses;
  for (int k = 0; k < n; ++k) {
    Matrix6d C = 1e-4 * Matrix6d::Identity();
    for (int m = 0; m < 3; ++m) {
      const Eigen::Matrix<double, 6, 1> u = rng.normalVector<6>();
      C += 1e-4 * u * u.transpose();
    }
    poses.push_back({SE3d(rng.unitQuaternion(), 3 * rng.unitVector<3>()), C});
  }
  return poses;
}

TEST(Trajectories, ANamedConventionIsThatOfTheGaussians) {
  const Trajectory file = parseTrajectory(ros_message, "odometry.json");
  EXPECT_EQ(file.format, "ros-json");
  const auto poses = gaussiansOf(file, "ros-fixed");
  ASSERT_EQ(poses.size(), 1u);
  // The body's x axis is the world's y, its y axis the world's -x.
  const Eigen::Matrix<double, 6, 1> expected{1, 4, 9, 0.01, 0.04, 0.09};
  EXPECT_LE((poses[0].covariance.diagonal() - expected).cwiseAbs().maxCoeff(), 1e-14)
      << poses[0].covariance.diagonal().transpose();
  EXPECT_EQ(errorOf([&] { (void)gaussiansOf(file); }).substr(0, 60),
            "odometry.json: the format ros-json does not say what its cov");
  EXPECT_NE(errorOf([&] { (void)gaussiansOf(file, "rosfixed"); }).find("is it 'ros-fixed'"), std::string::npos);
}
TEST(Trajectories, AnIndefiniteMatrixIsNoGaussian) {
  Trajectory file = parseTrajectory(ros_message, "odometry.json");
  file.covariances[0](0, 1) = file.covariances[0](1, 0) = 3;  // of variances 1 and 4
  EXPECT_NE(errorOf([&] { (void)gaussiansOf(file, "ros-fixed"); }).find("the matrix of pose 0 is indefinite"),
            std::string::npos);
  file.covariances[0](0, 1) = file.covariances[0](1, 0) = 2;
  EXPECT_EQ(errorOf([&] { (void)gaussiansOf(file, "ros-fixed"); }), "");
}

TEST(Trajectories, WithoutCovariancesNothingIsKnown) {
  const auto poses = gaussiansOf(parseTrajectory("0 1 2 3 0 0 0 1\n", "a.tum"));
  EXPECT_TRUE(poses.at(0).covariance.array().isNaN().all());
  EXPECT_EQ(poses[0].mean.translation(), Eigen::Vector3d(1, 2, 3));
}

// Each row of the table of formats, from Gaussians to a file and back.
TEST(Trajectories, EveryFormatKeepsWhatItIsGiven) {
  const TemporaryDirectory directory;
  const auto poses = somePoses(5);
  const std::vector<double> times{1.7e9, 1.7e9 + 0.125, 1.7e9 + 0.25, 1.7e9 + 0.5, 1.7e9 + 2};
  const Trajectory given = trajectoryOf(poses, times);
  for (const std::string& format : trajectoryFormatNames(false)) {
    if (format == "auto") continue;
    const std::string path = directory / ("file." + format);
    const Convention convention = *parseConvention("g2o-full,content=covariance");
    const auto notes = writeTrajectory(path, given, {format, convention});
    EXPECT_EQ(notes.size(), format == "openvins" ? 1u : 0u) << format;
    const Trajectory file = readTrajectory(path);
    EXPECT_EQ(file.format, format);
    if (format != "kitti") {
      EXPECT_EQ(file.times, times) << format;
    }
    const auto read = gaussiansOf(file, "g2o-full,content=covariance");
    ASSERT_EQ(read.size(), poses.size()) << format;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      EXPECT_LE((read[i].mean.matrix() - poses[i].mean.matrix()).cwiseAbs().maxCoeff(), 1e-14) << format;
      // OpenVINS has no place for the cross block.
      const bool blocks = format == "openvins";
      const Matrix6d gap = (read[i].covariance - poses[i].covariance).cwiseAbs();
      EXPECT_LE((blocks ? gap.topLeftCorner<3, 3>().maxCoeff() : gap.maxCoeff()), 1e-15) << format;
      EXPECT_LE((gap.bottomRightCorner<3, 3>().maxCoeff()), 1e-15) << format;
      EXPECT_EQ((gap.topRightCorner<3, 3>().array().isNaN().all()), blocks) << format;
    }
  }
}

TEST(Trajectories, WritingConvertsToTheConvention) {
  const TemporaryDirectory directory;
  Trajectory file = parseTrajectory(ros_message, "odometry.json");
  // Nothing says what the matrices are.
  EXPECT_NE(errorOf([&] { writeTrajectory(directory / "a.csv", file, {.format = "csv"}); }), "");
  file.stated_convention = *parseConvention("ros-fixed");
  writeTrajectory(directory / "a.csv", file, {.format = "csv"});
  const Trajectory csv = readTrajectory(directory / "a.csv");
  EXPECT_NEAR(csv.covariances.at(0)(0, 0), 1, 1e-14);
  EXPECT_EQ(csv.stated_convention, Convention{});
  // In the convention of the file every digit stays.
  writeTrajectory(directory / "b.json", file, {.format = "ros-json", .convention = file.stated_convention});
  EXPECT_EQ(readTrajectory(directory / "b.json").covariances.at(0), file.covariances.at(0));
  EXPECT_NE(errorOf([&] { writeTrajectory(directory / "c.json", file, {.format = "ros-json"}); }), "");
  EXPECT_NE(errorOf([&] { writeTrajectory(directory / "c", file, {.format = "rosjson"}); }).find("ros-json"),
            std::string::npos);
  const Trajectory timeless = trajectoryOf(somePoses(1));
  EXPECT_NE(errorOf([&] { writeTrajectory(directory / "d.tum", timeless, {.format = "tum"}); }).find("no times"),
            std::string::npos);
}

}  // namespace
}  // namespace liestat
