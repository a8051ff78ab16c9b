// Calibration files of the programs that write them, and what is wrong with bad ones.

#include <formats/calibration.hpp>

#include <gtest/gtest.h>

#include <cstdlib>
#include <regex>
#include <string>
#include <vector>

#include <support/temporary_directory.hpp>

namespace liestat {
namespace {

/// A quarter turn about z and a shift.
const std::string pose = "[[0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]]";
const std::string inverse_pose = "[[0, 1, 0, -0.2], [-1, 0, 0, 0.1], [0, 0, 1, -0.3], [0, 0, 0, 1]]";
const std::string lens =
    "  camera_model: pinhole\n  distortion_coeffs: [-0.3, 0.1, 1e-4, 2e-4]\n  distortion_model: radtan\n"
    "  intrinsics: [458, 457, 367, 248]\n";
const std::string chain = "cam0:\n  T_imu_cam: " + pose + "\n" + lens + "  resolution: [752, 480]\n";

void expectPose(const SE3d& imu_T_cam) {
  EXPECT_LT((imu_T_cam * Eigen::Vector3d(1, 2, 3) - Eigen::Vector3d(-1.9, 1.2, 3.3)).norm(), 1e-12);
}

TEST(CalibrationFiles, ThePosesKeysAreEachOthersInverse) {
  for (const std::string& key : {"T_imu_cam: " + pose, "T_cam_imu: " + inverse_pose, "T_BS: " + pose,
                                 "T_imu_cam: " + pose + "\n  T_cam_imu: " + inverse_pose}) {
    const Calibration calibration =
        parseCalibration("cam0:\n  " + key + "\n" + lens + "  timeshift_cam_imu: -0.0125\n", "f");
    ASSERT_EQ(calibration.cameras.size(), 1U);
    EXPECT_FALSE(calibration.imu);
    const CameraCalibration& cam = calibration.cameras[0];
    expectPose(cam.imu_T_cam);
    EXPECT_EQ(cam.name, "cam0");
    EXPECT_EQ(cam.timeshift_cam_imu, -0.0125);
    EXPECT_EQ(cam.camera.fu, 458);
    EXPECT_EQ(cam.camera.cv, 248);
    EXPECT_EQ(cam.camera.distortion, Distortion::radtan);
    EXPECT_EQ(cam.camera.coefficients, Eigen::Vector4d(-0.3, 0.1, 1e-4, 2e-4));
    EXPECT_EQ(cam.camera.width, 0) << "no resolution is known";
  }
}

TEST(CalibrationFiles, BlocksFlowsAndOpenCV) {
  const std::string block =
      "%YAML:1.0\n\ncam0:\n  T_imu_cam: # camera to IMU\n    - [0.0, -1.0, 0.0, 0.1]\n    - [1.0, 0.0, 0.0, 0.2]\n"
      "    - [0.0, 0.0, 1.0, 0.3]\n    - [0.0, 0.0, 0.0, 1.0]\n" +
      lens;
  expectPose(parseCalibration(block, "f").cameras.at(0).imu_T_cam);
  const std::string nested =
      "cam0:\n  T_cam_imu:\n  - - 0\n    - 1\n    - 0\n    - -0.2\n  - [-1, 0, 0, 0.1]\n  - [0, 0, 1, -0.3]\n"
      "  - [0, 0, 0, 1]\n" +
      lens;
  expectPose(parseCalibration(nested, "f").cameras.at(0).imu_T_cam);
  const std::string opencv =
      "%YAML:1.0\n---\ncam0:\n  T_imu_cam: !!opencv-matrix\n    rows: 4\n    cols: 4\n    dt: d\n"
      "    data: [0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1]\n" +
      lens;
  expectPose(parseCalibration(opencv, "f").cameras.at(0).imu_T_cam);
}

TEST(CalibrationFiles, Distortions) {
  const auto lensOf = [](const std::string& model, const std::string& coefficients) {
    return parseCalibration("cam0:\n  T_imu_cam: " + pose +
                                "\n  intrinsics: [1, 1, 0, 0]\n  distortion_model: " + model + "\n" + coefficients,
                            "f")
        .cameras.at(0)
        .camera;
  };
  EXPECT_EQ(lensOf("radial-tangential", "  distortion_coefficients: [1, 2, 3, 4]\n").coefficients,
            Eigen::Vector4d(1, 2, 3, 4));
  EXPECT_EQ(lensOf("equidistant", "  distortion_coeffs: [1, 2, 3, 4]\n").distortion, Distortion::equidistant);
  EXPECT_EQ(lensOf("none", "  distortion_coeffs: []\n").distortion, Distortion::none);
  EXPECT_EQ(lensOf("none", "").distortion, Distortion::none);
}

TEST(CalibrationFiles, KalibrsCameraModels) {
  const auto cameraOf = [](const std::string& lines) {
    return parseCalibration("cam0:\n  T_imu_cam: " + pose + "\n" + lines, "f").cameras.at(0).camera;
  };
  const Camera omni = cameraOf(
      "  camera_model: omni\n  intrinsics: [1.5, 800, 801, 376, 240]\n  distortion_model: radtan\n"
      "  distortion_coeffs: [1, 2, 3, 4]\n");
  EXPECT_EQ(omni.distortion, Distortion::omni);
  EXPECT_EQ(omni.mirror, 1.5);
  EXPECT_EQ(omni.fv, 801);
  EXPECT_EQ(omni.coefficients, Eigen::Vector4d(1, 2, 3, 4));
  const std::string none = "  distortion_model: none\n  distortion_coeffs: []\n";
  const Camera spheres = cameraOf("  camera_model: ds\n  intrinsics: [-0.2, 0.6, 158, 159, 255, 256]\n" + none);
  EXPECT_EQ(spheres.distortion, Distortion::double_sphere);
  EXPECT_EQ(spheres.coefficients, Eigen::Vector4d(-0.2, 0.6, 0, 0));
  EXPECT_EQ(spheres.cu, 255);
  const Camera eucm = cameraOf("  camera_model: eucm\n  intrinsics: [0.6, 1.1, 158, 159, 255, 256]\n" + none);
  EXPECT_EQ(eucm.distortion, Distortion::eucm);
  EXPECT_EQ(eucm.coefficients, Eigen::Vector4d(0.6, 1.1, 0, 0));
  for (const std::string& wrong :
       {"  camera_model: ds\n  intrinsics: [158, 159, 255, 256]\n" + none,
        "  camera_model: ds\n  intrinsics: [0, 1.1, 158, 159, 255, 256]\n" + none,
        "  camera_model: eucm\n  intrinsics: [0.5, 0, 158, 159, 255, 256]\n" + none,
        "  camera_model: omni\n  intrinsics: [-1, 158, 159, 255, 256]\n" + none,
        "  camera_model: ds\n  intrinsics: [0, 0.5, 158, 159, 255, 256]\n  distortion_model: radtan\n"
        "  distortion_coeffs: [1, 2, 3, 4]\n" +
            std::string(),
        "  camera_model: sphere\n  intrinsics: [158, 159, 255, 256]\n" + none}) {
    EXPECT_THROW(cameraOf(wrong), InputError) << wrong;
  }
}

TEST(CalibrationFiles, FilesThatBelongTogether) {
  const TemporaryDirectory directory;
  const std::string densities =
      "gyroscope_noise_density: 1e-4\ngyroscope_random_walk: 2e-5\naccelerometer_noise_density: 2e-3\n"
      "accelerometer_random_walk: 3e-3\n";
  const std::string cameras =
      directory.write("chain.yaml", chain + std::regex_replace(chain, std::regex("cam0"), "cam1"));
  // The sensor half a turn about z from the body: EuRoC's way to say where things are.
  std::filesystem::create_directories(directory.path() / "cam0");
  std::filesystem::create_directories(directory.path() / "imu0");
  const std::string sensor = directory.write(
      "imu0/sensor.yaml",
      "sensor_type: imu\nT_BS:\n  cols: 4\n  rows: 4\n  data: [-1, 0, 0, 1,  0, -1, 0, 0,  0, 0, 1, 0,  0, 0, 0, 1]\n" +
          densities);
  const std::string camera = directory.write(
      "cam0/sensor.yaml",
      "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, "
      "1]\n"
      "rate_hz: 20\nresolution: [752, 480]\ncamera_model: pinhole\nintrinsics: [458, 457, 367, 248] #fu, fv, cu, cv\n"
      "distortion_model: radial-tangential\ndistortion_coefficients: [-0.3, 0.1, 1e-4, 2e-4]\n");

  const Calibration chains = readCalibration({cameras, sensor});
  ASSERT_EQ(chains.cameras.size(), 2U);
  ASSERT_TRUE(chains.imu);
  EXPECT_EQ(chains.imu->accelerometer_walk, 3e-3);
  expectPose(chains.cameras[1].imu_T_cam);
  EXPECT_EQ(chains.cameras[1].name, "cam1");
  EXPECT_EQ(chains.cameras[0].camera.height, 480);

  for (const auto& order : {std::vector{camera, sensor}, std::vector{sensor, camera}}) {
    const Calibration euroc = readCalibration(order);
    ASSERT_EQ(euroc.cameras.size(), 1U);
    EXPECT_EQ(euroc.cameras[0].name, "cam0");
    // Body to sensor: x ↦ 1 - x, y ↦ -y.
    EXPECT_LT((euroc.cameras[0].imu_T_cam * Eigen::Vector3d(1, 2, 3) - Eigen::Vector3d(2.9, -1.2, 3.3)).norm(), 1e-12);
  }
  expectPose(readCalibration({camera}).cameras.at(0).imu_T_cam);

  EXPECT_EQ(errorOf([&] {
              readCalibration({cameras, camera});
            }),
            camera + ": it has cam0, as has " + cameras + ", expected each camera once");
  EXPECT_EQ(errorOf([&] {
              readCalibration({sensor, sensor});
            }),
            sensor + ": it has an IMU, as has " + sensor + ", expected one in all files");
}

// A large file that is no calibration is refused before it costs minutes.
TEST(CalibrationFiles, LargeOnesAreRefusedAtOnce) {
  std::string text;
  for (int i = 0; text.size() <= 20000000; ++i) text += "key" + std::to_string(i) + ": 1\n";
  const std::string message = errorOf([&] { parseCalibration(text, "f"); });
  EXPECT_NE(message.find("expected a calibration, of at most 1000000"), std::string::npos) << message;
}

TEST(CalibrationFiles, BadOnesAreNamed) {
  const auto message = [](const std::string& text) { return errorOf([&] { parseCalibration(text, "f"); }); };
  /// The chain above with one thing changed.
  const auto changed = [&](const std::string& what, const std::string& by) {
    const std::size_t place = chain.find(what);
    EXPECT_NE(place, std::string::npos) << what;
    return message(std::string(chain).replace(place, what.size(), by));
  };
  EXPECT_EQ(message(chain), "");
  EXPECT_EQ(changed("T_imu_cam", "T_cn_cnm1"),
            "f:2: cam0 has no pose on the IMU, expected T_cam_imu (takes the IMU's coordinates to the camera's) or "
            "T_imu_cam (its inverse), or EuRoC's T_BS");
  EXPECT_EQ(
      changed("  camera_model", "  T_cam_imu: " + pose + "\n  camera_model"),
      "f:3: cam0's T_cam_imu is not the inverse of T_imu_cam in line 2: 3.14 rad and 0.678 m from it, expected one "
      "of the two, or both agreeing");
  EXPECT_EQ(
      changed("[[0, -1,", "[[0, 1,"),
      "f:2: cam0's T_imu_cam: the rotation matrix has determinant -1, it is a reflection, expected determinant 1");
  EXPECT_EQ(
      changed("[[0, -1,", "[[0, -1.01,"),
      "f:2: cam0's T_imu_cam: the rotation matrix is not orthogonal (error 0.01005), expected an error within 0.001");
  EXPECT_EQ(changed("0, 1]]", "0, 2]]"), "f:2: the last row of cam0's T_imu_cam is 0 0 0 2, expected 0 0 0 1");
  EXPECT_EQ(changed(", [0, 0, 0, 1]]", "]"), "") << "the last row says nothing";
  EXPECT_EQ(changed("0.1], [", "0.1, 5], ["),
            "f:2: a row of cam0's T_imu_cam has 5 numbers, expected 4 rows of 4 numbers, the last 0 0 0 1");
  EXPECT_EQ(changed(", [0, 0, 1, 0.3], [0, 0, 0, 1]]", "]"),
            "f:2: cam0's T_imu_cam has 2 rows, expected 4 rows of 4 numbers, the last 0 0 0 1");
  EXPECT_EQ(changed("0.1]", ".nan]").substr(0, 4), "f:2:");
  EXPECT_EQ(changed("[458,", "[0,"), "f:6: cam0's intrinsics have the focal length 0, expected a positive one");
  EXPECT_EQ(changed("[458,", "[nan,"), "f:6: cam0's intrinsics is 'nan', expected four numbers, fu fv cu cv in pixels");
  EXPECT_EQ(changed(", 248]", "]"), "f:6: cam0's intrinsics are 3, expected four numbers, fu fv cu cv in pixels");
  EXPECT_EQ(changed("pinhole", "scaramuzza"),
            "f:3: cam0's camera_model is 'scaramuzza', expected pinhole, omni, ds or eucm; others are not supported");
  EXPECT_EQ(changed("pinhole", "omni"), "f:6: cam0's intrinsics are 4, expected five numbers, xi fu fv cu cv");
  EXPECT_EQ(
      changed("radtan", "fov"),
      "f:5: cam0's distortion_model is 'fov', expected radtan (radial-tangential), equidistant or none; others are "
      "not supported");
  EXPECT_EQ(changed("-0.3, 0.1, 1e-4, 2e-4", "-0.3, 0.1, 1e-4, 2e-4, 0.1"),
            "f:4: cam0's distortion_coeffs are 5, expected four numbers, k1 k2 p1 p2");
  EXPECT_EQ(changed("radtan", "none"),
            "f:4: cam0's distortion_coeffs are not zero, expected none for the distortion_model none");
  EXPECT_EQ(changed("[752, 480]", "[752]"),
            "f:7: cam0's resolution is 752, expected two whole numbers, width and height in pixels");
  EXPECT_EQ(changed("  camera_model", "  intrinsics: [1, 1, 1, 1]\n  camera_model"),
            "f:7: 'intrinsics' appears twice, expected it once");
  EXPECT_EQ(message(chain + "  timeshift_cam_imu: soon\n"),
            "f:8: cam0's timeshift_cam_imu is 'soon', expected seconds");
  EXPECT_EQ(
      message("cameras: 3\n"),
      "f: there is neither a camera nor an IMU, expected cam0 or imu0 of Kalibr's and OpenVINS' chains, or EuRoC's "
      "sensor.yaml");
  EXPECT_EQ(message("imu0:\n  update_rate: 200\n"),
            "f: there is no gyroscope_noise_density, expected the densities of noise and walk of an IMU");
  EXPECT_EQ(message("cam0: [1, 2\n").substr(0, 2), "f:");
  EXPECT_EQ(message(""), "f: this is no YAML file of named values");
}

TEST(CalibrationFiles, RealOnes) {
  const char* data = std::getenv("LIESTAT_DATA");
  if (data == nullptr) GTEST_SKIP() << "LIESTAT_DATA is not set";
  const std::string folder = std::string(data) + "/vi/euroc/";
  const Calibration calibration =
      readCalibration({folder + "kalibr_imucam_chain.yaml", folder + "kalibr_imu_chain.yaml"});
  ASSERT_EQ(calibration.cameras.size(), 2U);
  ASSERT_TRUE(calibration.imu);
  EXPECT_EQ(calibration.imu->gyroscope, 1.6968e-4);
  const CameraCalibration& left = calibration.cameras[0];
  const CameraCalibration& right = calibration.cameras[1];
  EXPECT_EQ(left.camera.fu, 458.654);
  EXPECT_EQ(left.camera.width, 752);
  EXPECT_EQ(left.imu_T_cam.translation(), Eigen::Vector3d(-0.0216401454975, -0.064676986768, 0.00981073058949));
  // The data set's documentation has a baseline of 11 cm.
  EXPECT_NEAR((left.imu_T_cam.inverse() * right.imu_T_cam).translation().norm(), 0.11, 5e-4);
  EXPECT_EQ(readCalibration({folder + "adis16448_sensor.yaml"}).imu->accelerometer, 2e-3);
}

}  // namespace
}  // namespace liestat
