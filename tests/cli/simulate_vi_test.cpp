// `liestat simulate vi`: readings that are those of the written truth, tracks that point at the written landmarks, and
// noise of the size asked for, all of it read back from the files.

#include <formats/calibration.hpp>
#include <formats/tracks.hpp>
#include <formats/imu.hpp>
#include <experiments/recording_files.hpp>
#include <experiments/simulate_vi.hpp>

#include <fusion/imu/preintegrate.hpp>
#include <fusion/imu/factor.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include <report/run_program.hpp>
#include <support/temporary_directory.hpp>

namespace liestat::cli {
using namespace experiments;
namespace {

using Eigen::Vector3d;

const std::vector<std::string> file_names = {"calibration.yaml", "images.csv", "imu.csv",
                                             "landmarks.csv",    "tracks.csv", "truth.csv"};

CameraCalibration someCamera(Distortion distortion = Distortion::radtan) {
  CameraCalibration camera;
  camera.name = "cam0";
  camera.camera = {.fu = 458, .fv = 457, .cu = 367, .cv = 248, .distortion = distortion, .width = 752, .height = 480};
  if (distortion == Distortion::radtan) camera.camera.coefficients = {-0.28, 0.07, 2e-4, 2e-5};
  if (distortion == Distortion::equidistant) {
    camera.camera = {.fu = 190, .fv = 191, .cu = 255, .cv = 257, .distortion = distortion, .width = 512, .height = 512};
    camera.camera.coefficients = {3e-3, 7e-4, -2e-3, 2e-4};
  }
  if (distortion == Distortion::omni)
    camera.camera.coefficients = {-0.1, 0.02, 1e-4, -2e-4}, camera.camera.mirror = 0.9;
  if (distortion == Distortion::double_sphere) camera.camera.coefficients = {-0.2, 0.6, 0, 0};
  if (distortion == Distortion::eucm) camera.camera.coefficients = {0.6, 1.1, 0, 0};
  camera.imu_T_cam = SE3d(SO3d::exp(Vector3d(1.2, -1.1, 1.3)), Vector3d(0.05, -0.02, 0.01));
  camera.timeshift_cam_imu = 0.0131;
  return camera;
}

constexpr ImuNoise<double> adis{
    .gyroscope = 1.6968e-4, .accelerometer = 2e-3, .gyroscope_walk = 1.9393e-5, .accelerometer_walk = 3e-3};

/// A recording as its files say.
struct Files {
  explicit Files(const std::string& folder)
      : imu(readImu(folder + "/imu.csv")),
        truth(readGroundTruth(folder + "/truth.csv", imu.start_ns)),
        tracks(readImageTracks(folder + "/tracks.csv", folder + "/images.csv", imu.start_ns)),
        calibration(readCalibration({folder + "/calibration.yaml"})),
        landmarks(readLandmarks(folder + "/landmarks.csv")) {}
  ImuFile imu;
  std::vector<GroundTruth> truth;
  ImageTracks tracks;
  Calibration calibration;
  std::vector<Vector3d> landmarks;

  const CameraCalibration& camera() const { return calibration.cameras.at(0); }
  /// The landmark of an observation in the camera's axes at the true state.
  Vector3d inCamera(const PixelObservation& o) const {
    const auto at = truthAt(truth, tracks.times[o.image] + camera().timeshift_cam_imu);
    if (!at) return Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
    const SE3d world_T_cam = SE3d(at->state.so3(), at->state.translation()) * camera().imu_T_cam;
    return world_T_cam.inverse() * landmarks.at(tracks.track_ids[o.track]);
  }
};

/// Largest errors over windows of a second of what preintegration makes of exact readings: position, rotation,
/// velocity.
std::array<double, 3> preintegrationErrors(double rate, ImuScheme scheme) {
  SyntheticImuOptions imu;
  imu.rate = rate;
  imu.bias = {Vector3d(0.01, -0.02, 0.03), Vector3d(0.1, 0.2, -0.1)};
  const SimulatedRecording r = simulateMotion(builtInTrajectory(6, 3), 0, 6, someCamera(), imu, {});
  RecordingOptions<double> how;
  how.scheme = scheme;
  how.preintegration.bias = imu.bias;
  std::array<double, 3> worst{};
  for (double t = 0.5; t < 5; t += 1) {
    const auto first = truthAt(r.truth, t), last = truthAt(r.truth, t + 1);
    const auto result = preintegrate<double>(r.imu, first->time, last->time, how);
    EXPECT_TRUE(result.ok());
    const auto error =
        preintegrationError<double>(result.motion, first->state, last->state, imu.bias, Vector3d(imu.gravity));
    for (int block = 0; block < 3; ++block) {
      double& w = worst[static_cast<std::size_t>(block)];
      w = std::max(w, error.segment<3>(3 * block).norm());
    }
  }
  return worst;
}

TEST(SimulateVi, ExactReadingsAreThoseOfTheTruth) {
  // Second order by default: half the step, a quarter of the error. The cubic scheme is of fourth order here.
  const auto coarse = preintegrationErrors(100, ImuScheme::averaged),
             fine = preintegrationErrors(200, ImuScheme::averaged);
  for (std::size_t block = 0; block < 3; ++block) EXPECT_NEAR(coarse[block] / fine[block], 4, 0.1) << block;
  for (const double error : preintegrationErrors(400, ImuScheme::cubic)) EXPECT_LT(error, 2e-9);
}

TEST(SimulateVi, TracksPointAtTheirLandmarks) {
  for (const Distortion distortion : {Distortion::none, Distortion::radtan, Distortion::equidistant, Distortion::omni,
                                      Distortion::double_sphere, Distortion::eucm}) {
    const TemporaryDirectory directory;
    ViSceneOptions scene;
    scene.pixel_noise = 0;
    scene.image_rate = 17;  // images between readings
    scene.features = 25;
    SyntheticImuOptions imu;
    imu.noise = adis;
    const CameraCalibration camera = someCamera(distortion);
    SimulatedRecording recording = simulateMotion(builtInTrajectory(5, 2), 0.5, 5, camera, imu, scene);
    recording.start_ns = 1600000000000000000;
    writeRecording(recording, directory / "out");
    const Files files(directory / "out");

    EXPECT_EQ(files.camera().camera.distortion, distortion);
    EXPECT_EQ(files.camera().camera.coefficients, camera.camera.coefficients);
    EXPECT_EQ(files.camera().camera.mirror, camera.camera.mirror);
    EXPECT_EQ(files.camera().timeshift_cam_imu, camera.timeshift_cam_imu);
    EXPECT_LT((files.camera().imu_T_cam.inverse() * camera.imu_T_cam).log().norm(), 1e-14);
    EXPECT_EQ(files.calibration.imu->gyroscope_walk, adis.gyroscope_walk);
    EXPECT_EQ(files.imu.samples.size(), 901U);
    EXPECT_EQ(files.imu.samples[17].specific_force, recording.imu[17].specific_force) << "to the last bit";
    EXPECT_EQ(files.truth.size(), recording.truth.size());
    EXPECT_EQ(files.tracks.observations.size(), recording.observations.size());
    EXPECT_EQ(files.tracks.format, "euroc");
    ASSERT_EQ(files.tracks.times.size(), 77U);

    std::vector<std::size_t> in_image(files.tracks.times.size(), 0), length(files.tracks.track_ids.size(), 0),
        last(files.tracks.track_ids.size());
    for (const PixelObservation& o : files.tracks.observations) {
      const Vector3d p = files.inCamera(o);
      EXPECT_GT(p.z(), scene.min_depth);
      const auto bearing = files.camera().camera.bearing({o.u, o.v});
      ASSERT_TRUE(bearing);
      // Half a nanosecond of the stamps' rounding turns a camera at 3 rad/s and 1 m/s by 2e-9 rad.
      EXPECT_LT((*bearing - p.normalized()).norm(), 1e-8);
      EXPECT_TRUE(files.camera().camera.sees({o.u, o.v}));
      ++in_image[o.image];
      EXPECT_TRUE(length[o.track]++ == 0 || last[o.track] + 1 == o.image) << "a track has no holes";
      last[o.track] = o.image;
    }
    // Enough landmarks are in view to have every image full, except where no track could last any more.
    for (std::size_t i = 0; i + scene.shortest_track < in_image.size(); ++i) EXPECT_EQ(in_image[i], scene.features);
    EXPECT_GE(*std::min_element(length.begin(), length.end()), scene.shortest_track);
    EXPECT_EQ(files.tracks.seen_once, 0U);
    const Vector3d half = 0.5 * recording.box;
    for (const Vector3d& landmark : files.landmarks) {
      const Vector3d inside = half - (landmark - recording.box_centre).cwiseAbs();
      EXPECT_NEAR(inside.minCoeff(), 0, 1e-12) << "on a face";
    }
  }
}

/// Is a mean square of n independent normals that of this deviation? Its standard error is √(2/n) of it; five of them
/// are exceeded once in two million times.
void expectDeviation(double sum_of_squares, double n, double deviation) {
  ASSERT_GT(n, 1000);
  EXPECT_NEAR(sum_of_squares / n / (deviation * deviation), 1, 5 * std::sqrt(2 / n));
}

TEST(SimulateVi, NoiseHasTheDeviationAskedFor) {
  ViSceneOptions scene;
  scene.pixel_noise = 0.7;
  scene.seed = 5;
  SyntheticImuOptions imu;
  imu.noise = adis;
  imu.rate = 250;
  const SplineTrajectory motion = builtInTrajectory(20, 5);
  const SimulatedRecording noisy = simulateMotion(motion, 0, 20, someCamera(), imu, scene);
  scene.pixel_noise = 0;
  const SimulatedRecording exact = simulateMotion(motion, 0, 20, someCamera(), {.rate = 250}, scene);
  ASSERT_EQ(noisy.observations.size(), exact.observations.size()) << "noise draws nothing from the scene's stream";
  double pixels = 0;
  for (std::size_t i = 0; i < noisy.observations.size(); ++i) {
    pixels += std::pow(noisy.observations[i].u - exact.observations[i].u, 2) +
              std::pow(noisy.observations[i].v - exact.observations[i].v, 2);
  }
  expectDeviation(pixels, 2.0 * static_cast<double>(noisy.observations.size()), 0.7);

  double rates = 0, forces = 0, rate_walk = 0, force_walk = 0;
  ImuBias<double> before;
  for (std::size_t k = 0; k < noisy.imu.size(); ++k) {
    const ImuBias<double> bias = truthAt(noisy.truth, noisy.imu[k].time)->bias;
    rates += (noisy.imu[k].angular_rate - exact.imu[k].angular_rate - bias.gyroscope).squaredNorm();
    forces += (noisy.imu[k].specific_force - exact.imu[k].specific_force - bias.accelerometer).squaredNorm();
    rate_walk += (bias.gyroscope - before.gyroscope).squaredNorm();
    force_walk += (bias.accelerometer - before.accelerometer).squaredNorm();
    before = bias;
  }
  const double n = 3.0 * static_cast<double>(noisy.imu.size()), root = std::sqrt(250.0);
  expectDeviation(rates, n, adis.gyroscope * root);
  expectDeviation(forces, n, adis.accelerometer * root);
  expectDeviation(rate_walk, n - 3, adis.gyroscope_walk / root);
  expectDeviation(force_walk, n - 3, adis.accelerometer_walk / root);
}

TEST(SimulateVi, OutliersDrift) {
  ViSceneOptions scene;
  scene.pixel_noise = 0;
  scene.outliers = 0.4;
  scene.drift = 3;
  scene.features = 80;
  const SplineTrajectory motion = builtInTrajectory(20, 5);
  const CameraCalibration camera = someCamera();
  const SimulatedRecording r = simulateMotion(motion, 0, 20, camera, {}, scene);
  std::map<std::size_t, Eigen::Vector2d> drift;  // drift of each track in the image before
  double steps = 0, n = 0;
  for (const PixelObservation& o : r.observations) {
    const auto at = truthAt(r.truth, r.image_times[o.image]);
    const SE3d world_T_cam = SE3d(at->state.so3(), at->state.translation()) * camera.imu_T_cam;
    const SimulatedTrack& track = r.tracks[o.track];
    const Eigen::Vector2d off =
        Eigen::Vector2d(o.u, o.v) - *r.camera.camera.project(world_T_cam.inverse() * track.landmark);
    if (!track.outlier) {
      EXPECT_LT(off.norm(), 1e-9);
      continue;
    }
    const auto before = drift.find(o.track);
    if (before == drift.end()) {
      EXPECT_LT(off.norm(), 1e-9) << "it begins where its landmark is";
    } else {
      steps += (off - before->second).squaredNorm(), n += 2;
    }
    drift[o.track] = off;
  }
  // Tracks that drift out of the image end there, which takes away some of the largest steps near the border.
  EXPECT_NEAR(std::sqrt(steps / n), 3, 0.1);
  const auto count = std::count_if(r.tracks.begin(), r.tracks.end(), [](const auto& t) { return t.outlier; });
  const auto tracks = static_cast<double>(r.tracks.size());
  ASSERT_GT(tracks, 300);
  EXPECT_NEAR(static_cast<double>(count) / tracks, 0.4, 5 * std::sqrt(0.4 * 0.6 / tracks));
}

/// The message of an ImpossibleMotion, empty if there was none.
template <class Action>
std::string complaintOf(Action&& action) {
  try {
    action();
  } catch (const ImpossibleMotion& complaint) {
    return complaint.what();
  }
  return {};
}

TEST(SimulateVi, WhatCannotBeMadeIsSaid) {
  const SplineTrajectory motion = builtInTrajectory(5, 1);
  const auto message = [&](double begin, double end, const ViSceneOptions& scene) {
    return complaintOf([&] { simulateMotion(motion, begin, end, someCamera(), {}, scene); });
  };
  EXPECT_EQ(message(-1, 3, {}), "the interval is from -1 to 3 s, expected one within 0 to 5.05 s");
  EXPECT_NE(message(3, 2, {}), "");
  EXPECT_NE(message(0, std::numeric_limits<double>::quiet_NaN(), {}), "");
  EXPECT_EQ(message(0, 0.05, {}), "there is one image at 10 Hz, expected two at least");
  ViSceneOptions small;
  small.box = Vector3d(0.1, 10, 10);
  EXPECT_EQ(message(0, 3, small).substr(0, 54), "the box of 0.1 x 10 x 10 m has no room for the motion,");
  std::vector<GroundTruth> truth(30);
  for (std::size_t i = 0; i < truth.size(); ++i) truth[i].time = 0.1 * static_cast<double>(i) + (i > 20 ? 0.5 : 0);
  EXPECT_EQ(complaintOf([&] { trajectoryAlong(truth, 0.1); }),
            "there is a gap of more than 0.1 s around 2.1 s, expected the truth without gaps");
  EXPECT_EQ(complaintOf([&] { trajectoryAlong(truth, 1); }),
            "the truth is 3.4 s long, expected 5 s at least, for control points every 1 s");
}

TEST(SimulateVi, TheProgramWritesTheSameBytesForTheSameSeed) {
  const TemporaryDirectory directory;
  const auto run = [&](std::vector<std::string> options) {
    const bool has_end = std::find(options.begin(), options.end(), "--end") != options.end();
    options.insert(options.begin(), {LIESTAT_PROGRAM, "simulate", "vi"});
    if (!has_end) options.insert(options.end(), {"--end", "3"});
    return runProgram(options, directory.path().string());
  };
  const ProgramResult first = run({"--output", "a"});
  ASSERT_EQ(first.status, 0) << first.errors;
  const std::string shell = "\"$0\" simulate vi --end 3 --output 'a dir' > out.txt";
  ASSERT_EQ(runProgram({"sh", "-c", shell, LIESTAT_PROGRAM}, directory.path().string()).status, 0);
  EXPECT_TRUE(contentOf(directory / "out.txt")
                  .ends_with("\n\nliestat vi-init --imu 'a dir/imu.csv' --tracks 'a dir/tracks.csv' --image-times "
                             "'a dir/images.csv' --calibration 'a dir/calibration.yaml' --truth 'a dir/truth.csv'\n"))
      << contentOf(directory / "out.txt");
  ASSERT_EQ(run({"--output", "b", "--seed", "1"}).status, 0);
  ASSERT_EQ(run({"--output", "c", "--seed", "2"}).status, 0);
  for (const std::string& name : file_names) {
    const std::string a = contentOf(directory / ("a/" + name));
    EXPECT_FALSE(a.empty()) << name;
    EXPECT_EQ(a, contentOf(directory / ("b/" + name))) << name;
    const bool drawn = name != "calibration.yaml" && name != "images.csv";
    EXPECT_EQ(a != contentOf(directory / ("c/" + name)), drawn) << name;
  }
  // Its own truth is a truth to move along, its own readings are readings to keep.
  ASSERT_EQ(run({"--output", "d", "--truth", "a/truth.csv", "--end", "2.5"}).status, 0)
      << "a spline ends before its control points do";
  const ProgramResult kept = run({"--output", "e", "--truth", "a/truth.csv", "--imu", "a/imu.csv"});
  ASSERT_EQ(kept.status, 0) << kept.errors;
  EXPECT_EQ(contentOf(directory / "e/imu.csv"), contentOf(directory / "a/imu.csv"));

  const auto complaint = [&](std::vector<std::string> options) {
    options.insert(options.end(), {"--output", "bad"});
    const ProgramResult result = run(options);
    EXPECT_EQ(result.status, 2);
    return result.errors;
  };
  EXPECT_EQ(complaint({"--imu", "a/imu.csv"}),
            "liestat simulate vi: there is no --truth, expected where the body was that --imu recorded\n");
  EXPECT_EQ(complaint({"--truth", "none"}), "none: no such file\n");
  EXPECT_EQ(complaint({"--drift", "nan"}),
            "liestat: --drift: nan is not a number (liestat --help explains the usage)\n");
  EXPECT_EQ(complaint({"--begin", "inf"}),
            "liestat simulate vi: an option is not a finite number, expected finite ones\n");
  EXPECT_EQ(complaint({"--begin", "4"}),
            "liestat simulate vi: the interval is from 4 to 3 s, expected an end after the beginning\n");
  EXPECT_EQ(complaint({"--box", "0.1,10,10"}).find("liestat simulate vi: the box of 0.1 x 10 x 10 m has no room"), 0U);
  EXPECT_EQ(complaint({"--truth", "a/truth.csv", "--knots", "9"}),
            "a/truth.csv: the truth is 3 s long, expected 45 s at least, for control points every 9 s\n");
  EXPECT_NE(complaint({"--outliers", "2"}), "");
  EXPECT_FALSE(std::filesystem::exists(directory / "bad"));
}

// A directory may hold files of these names that took somebody months.
TEST(SimulateVi, ReplacesOnlyItsOwnFiles) {
  const TemporaryDirectory directory;
  const auto simulate = [&](const std::vector<std::string>& options) {
    std::vector<std::string> all{LIESTAT_PROGRAM, "simulate", "vi", "--end", "2", "--output", "out"};
    all.insert(all.end(), options.begin(), options.end());
    return runProgram(all, directory.path().string());
  };
  std::filesystem::create_directory(directory / "out");
  directory.write("out/imu.csv", "mine\n");
  const ProgramResult refused = simulate({});
  EXPECT_EQ(refused.status, 2);
  EXPECT_EQ(
      refused.errors,
      "out/imu.csv: the file is there, and not as liestat simulate vi has written it, expected another directory, "
      "or --overwrite\n");
  EXPECT_EQ(contentOf(directory / "out/imu.csv"), "mine\n");
  EXPECT_FALSE(std::filesystem::exists(directory / "out/tracks.csv")) << "nothing is written before all is looked at";

  ASSERT_EQ(simulate({"--overwrite"}).status, 0);
  EXPECT_NE(contentOf(directory / "out/imu.csv"), "mine\n");
  EXPECT_EQ(simulate({"--seed", "2"}).status, 0) << "its own files may be replaced";
  directory.write("out/truth.csv", contentOf(directory / "out/truth.csv") + "# my remark\n");
  EXPECT_EQ(simulate({}).status, 2) << "but not those that were changed since";
  EXPECT_NE(contentOf(directory / "out/truth.csv").find("my remark"), std::string::npos);
  std::filesystem::remove(directory / "out/truth.csv");
  directory.write("out/liestat.txt", "a list of my own\n");
  EXPECT_EQ(simulate({}).status, 2);
}

// The data's README, "Tracks from a real trajectory and a real IMU".
TEST(SimulateVi, Euroc) {
  const char* data = std::getenv("LIESTAT_DATA");
  if (data == nullptr) GTEST_SKIP() << "LIESTAT_DATA is not set";
  const std::string folder = std::string(data) + "/vi/euroc/";
  const TemporaryDirectory directory;
  const std::vector<std::string> real = {LIESTAT_PROGRAM,
                                         "simulate",
                                         "vi",
                                         "--truth",
                                         folder + "V1_02_medium_gt.csv",
                                         "--calibration",
                                         folder + "kalibr_imucam_chain.yaml",
                                         folder + "kalibr_imu_chain.yaml"};
  std::vector<std::string> arguments = real;
  arguments.insert(arguments.end(), {"--imu", folder + "V1_02_medium_imu0.csv", "--output", "out", "--features", "30"});
  const ProgramResult result = runProgram(arguments, directory.path().string());
  ASSERT_EQ(result.status, 0) << result.errors;
  const Files files(directory / "out");
  const ImuFile original = readImu(folder + "V1_02_medium_imu0.csv");
  EXPECT_EQ(files.tracks.times.size(), 836U);
  // The readings of the truth's span, unchanged, and one before it.
  ASSERT_EQ(files.imu.samples.size(), 16703U);
  const auto offset = static_cast<std::size_t>(
      std::find_if(original.samples.begin(), original.samples.end(),
                   [&](const auto& s) { return s.angular_rate == files.imu.samples[0].angular_rate; }) -
      original.samples.begin());
  for (std::size_t k = 0; k < files.imu.samples.size(); k += 100) {
    ASSERT_EQ(files.imu.samples[k].specific_force, original.samples[k + offset].specific_force);
    const double time = 1e-9 * static_cast<double>(files.imu.start_ns - original.start_ns) + files.imu.samples[k].time;
    ASSERT_NEAR(time, original.samples[k + offset].time, 1e-9);
  }
  double squares = 0;
  for (const PixelObservation& o : files.tracks.observations) {
    const auto pixel = files.camera().camera.project(files.inCamera(o));
    ASSERT_TRUE(pixel);
    squares += (*pixel - Eigen::Vector2d(o.u, o.v)).squaredNorm();
  }
  const auto n = static_cast<double>(files.tracks.observations.size());
  EXPECT_GT(n, 0.97 * 30 * 836);
  expectDeviation(squares, 2 * n, 1);

  // The same with readings of a spline along it: a few centimetres from the file's positions.
  arguments = real;
  arguments.insert(arguments.end(), {"--output", "smooth"});
  ASSERT_EQ(runProgram(arguments, directory.path().string()).status, 0);
  const Files smooth(directory / "smooth");
  const auto rows = readGroundTruth(folder + "V1_02_medium_gt.csv", smooth.imu.start_ns);
  double farthest = 0;
  for (const GroundTruth& row : smooth.truth) {
    farthest = std::max(farthest, (truthAt(rows, row.time)->state.translation() - row.state.translation()).norm());
  }
  EXPECT_LT(farthest, 0.05);
}

}  // namespace
}  // namespace liestat::cli
