#include <formats/tracks.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include <support/temporary_directory.hpp>

namespace liestat {
namespace {

TEST(Tracks, StereoObservations) {
  const TemporaryDirectory directory;
  const auto tracks = readStereoTracks(directory.write("t.csv", "frame,track,uL,vL,uR,vR\n3,7,1.5,2,3,4\n"));
  ASSERT_EQ(tracks.size(), 1U);
  EXPECT_EQ(tracks[0].frame, 3U);
  EXPECT_EQ(tracks[0].track, 7U);
  EXPECT_EQ(tracks[0].uL, 1.5);
  EXPECT_EQ(tracks[0].vR, 4);
  const std::string path = directory.write("bad.csv", "frame,track,uL,vL,uR,vR\n0,-1,1,2,3,4\n");
  EXPECT_EQ(errorOf([&] { readStereoTracks(path); }), path + ":2: track is -1, expected a whole number of 0 or more");
}

const std::string pose_header = "frame,t_s,R00,R01,R02,R10,R11,R12,R20,R21,R22,cx,cy,cz,wx\n";

TEST(Tracks, CameraPoses) {
  const TemporaryDirectory directory;
  const auto poses = readCameraPoses(directory.write("p.csv", pose_header + "4,0.5,0,-1,0,1,0,0,0,0,1,1,2,3,9\n"));
  ASSERT_EQ(poses.size(), 1U);
  EXPECT_EQ(poses[0].frame, 4U);
  EXPECT_EQ(poses[0].t, 0.5);
  EXPECT_EQ(poses[0].R_camera_world(1, 0), 1);
  EXPECT_EQ(poses[0].c, Eigen::Vector3d(1, 2, 3));
}

TEST(Tracks, CameraPosesThatAreNone) {
  const TemporaryDirectory directory;
  const std::string twice =
      directory.write("twice.csv", pose_header + "0,0,1,0,0,0,1,0,0,0,1,0,0,0,0\n0,0,1,0,0,0,1,0,0,0,1,0,0,0,0\n");
  EXPECT_EQ(errorOf([&] { readCameraPoses(twice); }), twice + ":3: frame 0 again, as in line 2, expected it once");
  const std::string skew = directory.write("skew.csv", pose_header + "0,0,1,0,0,0,1,0,0,0,-1,0,0,0,0\n");
  EXPECT_EQ(errorOf([&] { readCameraPoses(skew); }),
            skew + ":2: the rotation matrix has determinant -1, it is a reflection, expected determinant 1");
}

TEST(Tracks, Camera) {
  const TemporaryDirectory directory;
  const std::string text = "name,value\nfu,500\nfv,501\ncu,320\ncv,240\nb,0.25\nother,-1\n";
  const StereoCamera plain = readStereoCamera(directory.write("c.csv", text));
  EXPECT_EQ(plain.fv, 501);
  EXPECT_EQ(plain.b, 0.25);
  EXPECT_FALSE(plain.pixel_variance.has_value());
  const StereoCamera noisy =
      readStereoCamera(directory.write("n.csv", text + "y_var0,1\ny_var1,2\ny_var2,3\ny_var3,4\n"));
  ASSERT_TRUE(noisy.pixel_variance.has_value());
  EXPECT_EQ(*noisy.pixel_variance, Eigen::Vector4d(1, 2, 3, 4));
}

TEST(Tracks, CamerasThatAreNone) {
  const TemporaryDirectory directory;
  const auto errorIn = [&](const std::string& text) {
    const std::string message = errorOf([&] { readStereoCamera(directory.write("c.csv", text)); });
    return message.substr(std::min(message.size(), (directory / "c.csv").size()));
  };
  const std::string good = "name,value\nfu,500\nfv,501\ncu,320\ncv,240\n";
  EXPECT_EQ(errorIn(good), ": there is no row 'b', expected rows fu, fv, cu, cv and b");
  EXPECT_EQ(errorIn(good + "b,0\n"), ":6: b is 0, expected a positive number");
  EXPECT_EQ(errorIn(good + "b,wide\n"), ":6: b is 'wide', expected a number");
  EXPECT_EQ(errorIn(good + "b,1\nb,1\n"), ":7: 'b' appears twice, expected it once");
  EXPECT_EQ(errorIn(good + "b\n"), ":6: 1 field, expected name,value");
  EXPECT_EQ(errorIn(good + "b,1\ny_var0,1\n"), ": there is no row 'y_var1', expected all of y_var0 to y_var3 or none");
  EXPECT_EQ(errorIn("fu,500\n"), ":1: the header is 'fu,500', expected name,value");
}

TEST(Tracks, StarryNight) {
  const char* data = std::getenv("LIESTAT_DATA");
  if (data == nullptr) GTEST_SKIP() << "skipped: LIESTAT_DATA does not name the directory of the real measurements";
  const std::string prefix = std::string(data) + "/tracks/starry_night_";
  const auto observations = readStereoTracks(prefix + "tracks.csv");
  const auto poses = readCameraPoses(prefix + "poses.csv");
  const auto camera = readStereoCamera(prefix + "camera.csv");
  const auto landmarks = readLandmarks(prefix + "landmarks.csv");
  EXPECT_EQ(observations.size(), 9410U);
  EXPECT_EQ(poses.size(), 1900U);
  ASSERT_EQ(landmarks.size(), 20U);
  ASSERT_TRUE(camera.pixel_variance.has_value());
  EXPECT_EQ((*camera.pixel_variance)(1), 129.83557);

  // The surveyed landmarks project to where they were seen: conventions and columns are right.
  std::vector<double> errors;
  for (const StereoObservation& seen : observations) {
    const CameraPose& pose = poses[seen.frame];
    ASSERT_EQ(pose.frame, seen.frame);
    const Eigen::Vector3d p = pose.R_camera_world * (landmarks[seen.track] - pose.c);
    errors.push_back(std::hypot(camera.fu * p.x() / p.z() + camera.cu - seen.uL,
                                camera.fv * p.y() / p.z() + camera.cv - seen.vL,
                                camera.fu * (p.x() - camera.b) / p.z() + camera.cu - seen.uR));
  }
  std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2), errors.end());
  // The median of a norm stays below its root mean square, and that the file's own variances foretell: 14.5 pixels. A
  // wrong axis or an inverted rotation gives hundreds.
  EXPECT_LT(errors[errors.size() / 2], std::sqrt(camera.pixel_variance->head<3>().sum()));
}

}  // namespace
}  // namespace liestat
