// `liestat motion` and `liestat simulate motion`: tracks in, directions and rotations out; simulated and real tracks;
// gyroscopes; its report; bad input.

#include <experiments/motion_recording.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fmt/format.h>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <report/run_program.hpp>
#include <cli/words.hpp>
#include <support/temporary_directory.hpp>
#include <experiments/motion_scene.hpp>

namespace liestat::cli {
namespace {

using Json = nlohmann::json;

ProgramResult run(Words words) {
  words.insert(words.begin(), {"sh", "-c", "\"$0\" \"$@\" > /dev/null", LIESTAT_PROGRAM, "motion"});
  return runProgram(words, ".");
}

Json runOnKitti(const std::string& directory, const std::string& sequence, const Words& more) {
  const TemporaryDirectory out;
  const std::string stem = directory + "/tracks/kitti_2011_09_26_" + sequence;
  const ProgramResult result =
      run(wordsOf(fmt::format("{0}_tracks.csv --intrinsics 721.5377,721.5377,609.5593,172.854 --truth {0}_poses.csv "
                              "--process-noise 1e-4 --outliers --filter subspace --json {1}",
                              stem, out / "out.json")) +
          more);
  EXPECT_EQ(result.status, 0) << result.errors;
  return Json::parse(contentOf(out / "out.json"));
}

TEST(MotionCommand, realTracksAndTheVehiclesRates) {
  const char* directory = std::getenv("LIESTAT_DATA");
  if (directory == nullptr) GTEST_SKIP() << "LIESTAT_DATA is not set";
  for (const std::string sequence : {"0051", "0095"}) {
    const Json alone = runOnKitti(directory, sequence, {});
    EXPECT_LE(alone["median_direction_error_deg"].get<double>(), 1.25) << sequence;
    EXPECT_LE(alone["median_rotation_error_deg"].get<double>(), 0.07) << sequence;
    EXPECT_GT(alone["frames_usable"].get<int>(), 60) << sequence;
    const std::string rates = std::string(directory) + "/tracks/kitti_2011_09_26_" + sequence + "_poses.csv";
    const Json with =
        runOnKitti(directory, sequence, {"--rates", rates, "--rates-axes", "vehicle", "--rates-sigma", "0.05"});
    EXPECT_TRUE(with["with_gyroscope"].get<bool>());
    EXPECT_LE(with["median_direction_error_deg"].get<double>(), alone["median_direction_error_deg"].get<double>());
    EXPECT_LE(with["median_rotation_error_deg"].get<double>(), 0.07);
    EXPECT_EQ(with["frames"][0]["direction_covariance"].size(), 2U);
  }
}

/// Twenty landmarks, three of which two frames share in the median: too few for images alone, enough beside a gyroscope.
TEST(MotionCommand, realGyroscopeWithFewTracks) {
  const char* directory = std::getenv("LIESTAT_DATA");
  if (directory == nullptr) GTEST_SKIP() << "LIESTAT_DATA is not set";
  const TemporaryDirectory out;
  const std::string stem = std::string(directory) + "/tracks/starry_night";
  const ProgramResult result = run(wordsOf(
      fmt::format("{0}_tracks.csv --intrinsics 484.49985,484.49985,321.68048,247.48145 --truth {0}_poses.csv "
                  "--min-motion 0.01 --rates {0}_poses.csv "
                  "--rates-rotation=0.50420466,-0.49921739,-0.49953699,-0.49701353 --rates-sigma 0.1 --sigma 1.5 "
                  "--process-noise 1e-2 --frames-apart 10 --json {1}",
                  stem, out / "out.json")));
  ASSERT_EQ(result.status, 0) << result.errors;
  const Json json = Json::parse(contentOf(out / "out.json"));
  EXPECT_GT(json["frames_usable"].get<int>(), 800);
  EXPECT_LE(json["median_direction_error_deg"].get<double>(), 6);
  EXPECT_LE(json["median_rotation_error_deg"].get<double>(), 0.25);
}

/// Real frames in a second run from the end of the first: none is left without a direction (the report's fig. 14).
TEST(MotionCommand, realTracksInTwoPasses) {
  const char* directory = std::getenv("LIESTAT_DATA");
  if (directory == nullptr) GTEST_SKIP() << "LIESTAT_DATA is not set";
  const Json once = runOnKitti(directory, "0051", {}), twice = runOnKitti(directory, "0051", {"--passes", "2"});
  EXPECT_EQ(twice["passes"], 2);
  EXPECT_FALSE(once["frames"][0]["usable"].get<bool>());
  EXPECT_TRUE(twice["frames"][0]["usable"].get<bool>());
  EXPECT_GT(twice["frames_usable"].get<int>(), once["frames_usable"].get<int>());
  EXPECT_LE(twice["median_direction_error_deg"].get<double>(), 1.1);
  for (int k = 0; k < 10; ++k) {
    const Json& error = twice["frames"][k]["direction_error_deg"];
    if (error.is_null()) continue;
    EXPECT_LE(error.get<double>(), 5) << k;
  }
}

/// A simulated recording in a directory of its own.
class Simulated {
 public:
  explicit Simulated(Words options) {
    options.insert(options.begin(), {"sh", "-c", "\"$0\" \"$@\" > /dev/null", LIESTAT_PROGRAM, "simulate", "motion",
                                     "--output", directory_.path().string()});
    const ProgramResult result = runProgram(options, ".");
    EXPECT_EQ(result.status, 0) << result.errors;
  }
  std::string operator/(const std::string& name) const { return directory_ / name; }
  std::string content(const std::string& name) const { return contentOf(directory_ / name); }
  void write(const std::string& name, const std::string& text) const { directory_.write(name, text); }

  ProgramResult motion(const Words& more) const {
    return run(wordsOf(fmt::format("{0}/tracks.csv --calibration {0}/calibration.yaml --truth {0}/truth.csv "
                                   "--min-motion 0 --json {0}/out.json",
                                   directory_.path().string())) +
               more);
  }
  Json json(const Words& more) const {
    const ProgramResult result = motion(more);
    EXPECT_EQ(result.status, 0) << result.errors;
    return Json::parse(content("out.json"));
  }
  Words imu(const Words& more = {}) const { return Words{"--imu", *this / "imu.csv"} + more; }
  Words rates(const Words& more = {}) const {
    return Words{"--rates", *this / "rates.csv", "--rates-axes", "vehicle"} + more;
  }

 private:
  TemporaryDirectory directory_;
};

double directionError(const Json& json) { return json["median_direction_error_deg"].get<double>(); }
double rotationError(const Json& json) { return json["median_rotation_error_deg"].get<double>(); }
std::vector<double> numbers(const Json& list) { return list.get<std::vector<double>>(); }
Words flags(const Json& frame) { return frame["flags"].get<Words>(); }
bool hasFlag(const Json& frame, const std::string& flag) {
  const auto all = flags(frame);
  return std::find(all.begin(), all.end(), flag) != all.end();
}

// Without noise only the filter's own noise model is left: axes, signs, times and units of all files agree.
TEST(SimulateMotion, ExactFilesGiveTheExactMotion) {
  for (const std::string scene : {"orbit", "general", "plane", "narrow", "turning"}) {
    const Simulated files({"--scene", scene, "--sigma", "0", "--gyroscope-sigma", "1e-5", "--frames", "40"});
    const Words noise{"--sigma", "0.01", "--filter", "subspace"};
    // The direction of the translation turns with the rotation, which the filter takes for noise.
    const double bound = scene == "turning" ? 1.5 : 0.01;
    const Json inertial = files.json(files.imu(noise));
    EXPECT_LT(directionError(inertial), bound) << scene;
    EXPECT_LT(rotationError(inertial), scene == "turning" ? 0.01 : 0.001) << scene;
    Words more = noise;
    more.insert(more.end(), {"--rates-sigma", "0.02"});
    const Json rates = files.json(files.rates(more));
    EXPECT_LT(directionError(rates), bound) << scene;
    EXPECT_LT(rotationError(rates), scene == "turning" ? 0.02 : 0.001) << scene;
    EXPECT_EQ(inertial["frames"].size(), 39U);
    EXPECT_EQ(inertial["frames_without_gyroscope"], 0);
  }
}

// Errors of docs/motion.md (orbit, 1 px): 0.28° by frame 20 and 0.25° later with 0.1° per frame, 0.2 to 0.4° without.
TEST(SimulateMotion, ErrorsHaveTheExpectedSize) {
  const Simulated files({"--seed", "4"});
  const Words noise{"--sigma", "1"};
  const Json images = files.json(noise), inertial = files.json(files.imu(noise)),
             rates = files.json(files.rates(noise));
  for (const Json* json : {&images, &inertial, &rates}) {
    EXPECT_GT(directionError(*json), 0.05);
    EXPECT_LT(directionError(*json), 0.8);
  }
  EXPECT_GT(images["frames_usable"].get<int>(), 50) << "the first frames alone say little";
  EXPECT_GT(inertial["frames_usable"].get<int>(), 90);
  EXPECT_GT(rates["frames_usable"].get<int>(), 90);
  EXPECT_LT(rotationError(inertial), rotationError(images) + 0.05);
  EXPECT_LT(rotationError(inertial), 0.15);
  EXPECT_LT(rotationError(rates), 0.15);
  // The standard deviations are those of the errors, or above: medians of errors of two coordinates.
  const Json& last = inertial["frames"].back();
  const double variance =
      last["direction_covariance"][0][0].get<double>() + last["direction_covariance"][1][1].get<double>();
  EXPECT_LT(last["direction_error_deg"].get<double>(), 4 * std::sqrt(variance) * 57.3);
}

TEST(SimulateMotion, NoiseHasTheSizeAskedFor) {
  using namespace experiments;
  MotionRecordingOptions how;
  how.scene.world = MotionWorld::general;
  how.scene.gyroscope_sigma = 0.2, how.scene.outliers = 0.1;
  how.gyroscope_bias << 0.01, -0.02, 0.03;
  how.frames = 400, how.seed = 6;
  const MotionRecording r = recordMotion(how);
  double wrong = 0, flows = 0, rates = 0, readings = 0;
  std::map<std::size_t, std::size_t> lengths;
  for (const auto& o : r.observations) {
    wrong += o.inlier ? 0 : 1;
    flows += lengths[o.track]++ > 0 ? 1 : 0;
  }
  EXPECT_EQ(flows, 20 * 399.) << "as many flows in each interval as there are points";
  EXPECT_NEAR(wrong / flows, 0.1, 5 * std::sqrt(0.09 / flows));
  for (const auto& frame : r.frames) rates += (frame.rate - frame.true_rate - how.gyroscope_bias).squaredNorm();
  const double n = 3. * 400, sigma = 0.2 * std::numbers::pi / 180 / 0.1;
  EXPECT_NEAR(rates / n / (2 * sigma * sigma), 1, 5 * std::sqrt(2 / n)) << "the mean of two has 0.2 degrees per frame";
  for (const auto& reading : r.imu) {
    readings += (reading.angular_rate - r.frames[0].true_rate - how.gyroscope_bias).squaredNorm();
  }
  const double m = 3. * static_cast<double>(r.imu.size());
  EXPECT_NEAR(readings / m / (0.1 * sigma * sigma * 200), 1, 5 * std::sqrt(2 / m)) << "20 readings in a frame";
  // A recording at rest on average feels gravity upwards.
  EXPECT_NEAR(r.imu.front().specific_force.norm(), 9.81, 0.5);
}

TEST(SimulateMotion, FilesAreTheSameForASeedAndNotReplaced) {
  const Simulated a({"--seed", "9", "--frames", "5"}), b({"--seed", "9", "--frames", "5"}), c({"--frames", "5"});
  for (const std::string name : {"tracks.csv", "truth.csv", "rates.csv", "imu.csv", "calibration.yaml"}) {
    EXPECT_EQ(a.content(name), b.content(name)) << name;
    EXPECT_EQ(a.content(name) == c.content(name), name == "calibration.yaml") << name;
  }
  const auto again = [&](const Words& more) {
    return runProgram(Words{LIESTAT_PROGRAM, "simulate", "motion", "--output", a / ""} + more, ".");
  };
  EXPECT_EQ(again({}).status, 2);
  EXPECT_NE(again({}).errors.find("tracks.csv: the file is there"), std::string::npos);
  EXPECT_EQ(again({"--overwrite"}).status, 0);
  EXPECT_EQ(again({"--overwrite", "--outliers", "2"}).status, 2);
  EXPECT_NE(again({"--overwrite", "--frames", "1000000", "--points", "100000"}).errors.find("at most"),
            std::string::npos);
}

TEST(MotionCommand, BiasOfTheGyroscopeIsFound) {
  const std::vector<double> bias{0.02, -0.03, 0.01};
  const Simulated files({"--seed", "3", "--frames", "120", "--gyroscope-bias", "0.02,-0.03,0.01"});
  const Words noise{"--sigma", "1"};
  const Json ignored = files.json(files.imu(noise));
  const Json given = files.json(files.imu({"--sigma", "1", "--gyroscope-bias", "0.02,-0.03,0.01"}));
  EXPECT_GT(directionError(ignored), 2 * directionError(given));
  for (const std::string filter : {"composition", "subspace", "essential"}) {
    const Json found = files.json(files.imu({"--sigma", "1", "--bias", "--bias-sigma", "0.03", "--filter", filter}));
    EXPECT_LT(directionError(found), 0.6) << filter;
    const Json& last = found["frames"].back();
    const std::vector<double> b = numbers(last["gyroscope_bias"]);
    for (std::size_t k = 0; k < 3; ++k) {
      const double sigma = std::sqrt(last["gyroscope_bias_covariance"][k][k].get<double>());
      EXPECT_LT(sigma, 0.025) << filter;
      EXPECT_NEAR(b[k], bias[k], 3 * sigma) << filter << " " << k;
    }
  }
  const Json rates = files.json(files.rates({"--sigma", "1", "--bias", "--bias-sigma", "0.03"}));
  EXPECT_NEAR(numbers(rates["frames"].back()["gyroscope_bias"])[1], -0.03, 0.03);
  const ProgramResult result = files.motion(files.imu({"--sigma", "1", "--bias", "--output", files / "out.csv"}));
  EXPECT_EQ(result.status, 0);
  EXPECT_NE(files.content("out.csv").find("flags,bias_x,bias_y,bias_z,bias_sigma\n"), std::string::npos);
}

TEST(MotionCommand, FiltersAndIntervals) {
  const Simulated files({"--seed", "2", "--sigma", "8"});
  const ProgramResult successive = files.motion({"--sigma", "8"});
  EXPECT_EQ(successive.status, 3) << "8 px drown the motion of one frame";
  const Json apart = files.json({"--sigma", "8", "--frames-apart", "6"});
  EXPECT_EQ(apart["frames_apart"], 6);
  EXPECT_EQ(apart["frames"].back()["filter"], "subspace");
  EXPECT_EQ(apart["frames"].back()["meaning"], "velocity");
  EXPECT_LT(directionError(apart), 2);
  EXPECT_GT(apart["frames_usable"].get<int>(), 70);
  const Json discrete = files.json({"--sigma", "8", "--frames-apart", "6", "--flow", "discrete"});
  EXPECT_LT(directionError(discrete), 3);
  const Json prior = files.json(files.imu({"--sigma", "8", "--frames-apart", "6"}));
  EXPECT_LT(directionError(prior), 1.5);
  EXPECT_LT(rotationError(prior), 0.3);

  const Simulated quiet({"--seed", "2", "--scene", "general"});
  const Json essential = quiet.json({"--sigma", "1", "--filter", "essential"});
  EXPECT_EQ(essential["frames"][0]["filter"], "essential");
  EXPECT_EQ(essential["frames"].back()["meaning"], "translation");
  EXPECT_LT(directionError(essential), 1.5);
  const Json longer = quiet.json({"--sigma", "1", "--filter", "essential", "--frames-apart", "3"});
  EXPECT_LT(directionError(longer), 1.5);
  EXPECT_LT(rotationError(longer), 0.3);
  const ProgramResult refused = quiet.motion({"--filter", "composition", "--frames-apart", "3"});
  EXPECT_EQ(refused.status, 2);
  EXPECT_NE(refused.errors.find("expected --filter subspace or essential"), std::string::npos);
}

/// The rates of a file turned by a rotation.
std::string turnedRates(const std::string& text, const SO3d& R) {
  std::istringstream lines(text);
  std::string line, out;
  std::getline(lines, line);
  out = line + "\n";
  while (std::getline(lines, line)) {
    double frame = 0, t = 0, x = 0, y = 0, z = 0;
    EXPECT_EQ(std::sscanf(line.c_str(), "%lf,%lf,%lf,%lf,%lf", &frame, &t, &x, &y, &z), 5);
    const Eigen::Vector3d w = R * Eigen::Vector3d(x, y, z);
    out += fmt::format("{},{},{},{},{}\n", frame, t, w.x(), w.y(), w.z());
  }
  return out;
}

TEST(MotionCommand, AxesOfTheRates) {
  const Simulated files({"--scene", "general", "--sigma", "0", "--gyroscope-sigma", "1e-5", "--frames", "30"});
  const Words noise{"--sigma", "0.01", "--rates-sigma", "0.02"};
  // A camera that looks down by 10°, and is turned by 5° about its own axis, 3° to the left: the vehicle's rates are
  // those of the sensor turned by the tilt, yaw · pitch · roll.
  const double d = std::numbers::pi / 180;
  const SO3d tilt = SO3d::exp(Eigen::Vector3d(0, 0, 3 * d)) * SO3d::exp(Eigen::Vector3d(0, 10 * d, 0)) *
                    SO3d::exp(Eigen::Vector3d(5 * d, 0, 0));
  files.write("tilted.csv", turnedRates(files.content("rates.csv"), tilt));
  const auto with = [&](const Words& more) { return Words{"--rates", files / "tilted.csv"} + more + noise; };
  EXPECT_LT(rotationError(files.json(with({"--rates-axes", "vehicle", "--camera-tilt", "5,10,3"}))), 0.001);
  // Without the tilt the rates are those of another camera: the images refute them.
  EXPECT_EQ(files.motion(with({"--rates-axes", "vehicle"})).status, 3);
  const Json untilted = Json::parse(files.content("out.json"));
  EXPECT_TRUE(hasFlag(untilted["frames"].back(), "gyroscope_refuted"));
  Eigen::Matrix3d camera_R_ahead;
  camera_R_ahead << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  const SO3d R = SO3d::fitToSO3(camera_R_ahead) * tilt.inverse();
  const Eigen::Vector4d q = R.params();
  const std::string xyzw = fmt::format("--rates-rotation={},{},{},{}", q[0], q[1], q[2], q[3]);
  EXPECT_LT(rotationError(files.json(with({xyzw}))), 0.001);
  EXPECT_NE(files.motion(with({"--rates-rotation", "1,1,0,0"})).errors.find("unit quaternion"), std::string::npos);
  EXPECT_NE(files.motion(with({"--camera-tilt", "1,1,0"})).errors.find("--rates-axes vehicle"), std::string::npos);
}

/// The lines of a file without those that begin with a time in an interval.
std::string without(const std::string& text, double begin, double end) {
  std::istringstream lines(text);
  std::string line, out;
  while (std::getline(lines, line)) {
    double t = 0;
    if (std::sscanf(line.c_str(), "%lf", &t) == 1 && t > begin && t < end) continue;
    out += line + "\n";
  }
  return out;
}

TEST(MotionCommand, ReadingsWithAGap) {
  const Simulated files({"--frames", "60"});
  files.write("gap.csv", without(files.content("imu.csv"), 3.02, 3.49));
  const Json gap = files.json({"--imu", files / "gap.csv", "--sigma", "1"});
  // From 3.02 to 3.49 s: the intervals that end in frames 31 to 35.
  EXPECT_EQ(gap["frames_without_gyroscope"], 5);
  for (std::size_t k = 28; k < 38; ++k) {
    EXPECT_EQ(hasFlag(gap["frames"][k - 1], "no_gyroscope"), k > 30 && k < 36) << k;
  }
  EXPECT_NE(gap["frames"][30]["no_gyroscope"].get<std::string>().find("no reading from 3.020000 to 3.490000 s"),
            std::string::npos);
  EXPECT_LT(directionError(gap), 0.8);
  EXPECT_EQ(files.json({"--imu", files / "gap.csv", "--sigma", "1", "--max-gap", "0.6"})["frames_without_gyroscope"],
            0);
  // An end before that of the images.
  files.write("short.csv", without(files.content("imu.csv"), 4.01, 100));
  const Json early = files.json({"--imu", files / "short.csv", "--sigma", "1"});
  EXPECT_EQ(early["frames_without_gyroscope"], 19);
  EXPECT_NE(early["frames"].back()["no_gyroscope"].get<std::string>().find("the readings from -0.005"),
            std::string::npos);
  // No interval at all.
  std::string times = "frame,t_s\n";
  for (int k = 0; k < 60; ++k) times += fmt::format("{},{}\n", k, 100 + 0.1 * k);
  files.write("times.csv", times);
  std::string tracks = files.content("tracks.csv");
  tracks.replace(tracks.find("t_s"), 3, "old");
  files.write("untimed.csv", tracks);
  const auto errors = [&](Words words) {
    words.insert(words.begin(), files / "untimed.csv");
    const ProgramResult result = run(words);
    EXPECT_EQ(result.status, 2);
    return result.errors;
  };
  const std::string calibration = files / "calibration.yaml", imu = files / "imu.csv";
  EXPECT_NE(errors({"--calibration", calibration, "--imu", imu, "--image-times", files / "times.csv"})
                .find("the readings cover no interval between two frames; frame 1: it lasts from 100.000000"),
            std::string::npos);
  EXPECT_NE(errors({"--calibration", calibration, "--imu", imu}).find("no column 't_s'"), std::string::npos);
  EXPECT_NE(errors({"--intrinsics", "500,500,256,256", "--imu", imu}).find("expected --calibration with T_cam_imu"),
            std::string::npos);
  EXPECT_NE(errors({"--calibration", calibration, "--imu", imu, "--rates", files / "rates.csv"}).find("--rates"),
            std::string::npos);
  EXPECT_NE(errors({"--calibration", calibration, "--bias"}).find("--rates or --imu"), std::string::npos);
  std::string camera = files.content("calibration.yaml");
  files.write("camera.yaml", camera.substr(0, camera.find("imu0:")));
  EXPECT_NE(errors({"--calibration", files / "camera.yaml", "--imu", imu, "--image-times", files / "times.csv"})
                .find("density of noise is not known"),
            std::string::npos);
}

TEST(MotionCommand, SecondPassStartsFromTheEndOfTheFirst) {
  const Simulated files({"--scene", "general", "--frames", "20", "--seed", "5", "--sigma", "0.5"});
  const Json once = files.json({"--sigma", "0.5"}), twice = files.json({"--sigma", "0.5", "--passes", "2"});
  EXPECT_EQ(twice["frames"].size(), once["frames"].size());
  EXPECT_FALSE(once["frames"][0]["usable"].get<bool>());
  EXPECT_GT(twice["frames_usable"].get<int>(), once["frames_usable"].get<int>());
  EXPECT_TRUE(twice["frames"][0]["usable"].get<bool>());
  EXPECT_LT(twice["frames"][0]["direction_error_deg"].get<double>(),
            once["frames"][0]["direction_error_deg"].get<double>());
  EXPECT_LT(directionError(twice), directionError(once));
  EXPECT_LT(directionError(twice), 2);
  EXPECT_TRUE(once["frames"].back()["covariance_judged"].get<bool>());
  EXPECT_FALSE(twice["frames"].back()["covariance_judged"].get<bool>()) << "the same data count twice";
}

TEST(MotionCommand, badInputIsNamed) {
  const TemporaryDirectory directory;
  const auto error = [&](const std::string& content, const Words& more) {
    const ProgramResult result = run(Words{directory.write("t.csv", content)} + more);
    EXPECT_EQ(result.status, 2) << content;
    return result.errors;
  };
  const Words camera{"--intrinsics", "500,500,256,256"};
  const std::string fine = "frame,track,u,v\n0,0,1,2\n1,0,2,2\n";
  EXPECT_NE(error(fine, {}).find("--intrinsics"), std::string::npos);
  EXPECT_NE(error("frame,track,u\n0,0,1\n", camera).find("columns u and v"), std::string::npos);
  EXPECT_NE(error("frame,track,u,v\n0,0,1,nan\n", camera).find("t.csv:2"), std::string::npos);
  EXPECT_NE(error(fine + "1,0,2,2\n", camera).find("t.csv:4: track 0 again in frame 1"), std::string::npos);
  EXPECT_NE(error("frame,track,u,v\n3,0,1,2\n", camera).find("there is one frame"), std::string::npos);
  EXPECT_NE(error(fine, {"--intrinsics", "-500,500,256,256"}).find("positive"), std::string::npos);
  EXPECT_NE(error(fine, {"--intrinsics", "500,500,256,256", "--sigma", "0"}).find("sigma"), std::string::npos);
  // Truncated: in the middle of a row, after the header, at the beginning.
  EXPECT_NE(error(fine + "2,0", camera).find("t.csv:4: 2 fields, expected 4"), std::string::npos);
  EXPECT_NE(error("frame,track,u,v\n", camera).find("t.csv"), std::string::npos);
  EXPECT_NE(error("", camera).find("t.csv: the file is empty"), std::string::npos);
  EXPECT_NE(error("frame,track,u,v\n0,0,1,2\n3000000,0,1,2\n", camera).find("at most 1000000"), std::string::npos);
}

/// A square of tracks in pixels, 25 of them, which moves by (du, dv) in each frame.
std::string grid(std::size_t frames, double focal, double du, double offset = 256) {
  std::string text = "frame,track,u,v\n";
  for (std::size_t k = 0; k < frames; ++k) {
    for (int i = 0; i < 25; ++i) {
      const double depth = 1 + 0.13 * (i % 7), x = (i % 5 - 2) * 0.2 * depth + du * static_cast<double>(k);
      text += fmt::format("{},{},{},{}\n", k, i, offset + focal * x / depth, offset + focal * (i / 5 - 2) * 0.2);
    }
  }
  return text;
}

TEST(MotionCommand, UnitsOfTheIntrinsics) {
  const TemporaryDirectory directory;
  const auto result = [&](const std::string& content, const std::string& intrinsics, const std::string& sigma) {
    return run({directory.write("t.csv", content), "--intrinsics", intrinsics, "--sigma", sigma});
  };
  EXPECT_EQ(result(grid(20, 500, 0.05), "500,500,256,256", "0.5").status, 0);
  EXPECT_EQ(result(grid(20, 1, 0.05, 0), "1,1,0,0", "0.001").status, 0) << "all normalised";
  const ProgramResult normalised_focal = result(grid(20, 500, 0.05), "0.98,0.98,0.5,0.5", "0.01");
  EXPECT_EQ(normalised_focal.status, 2);
  EXPECT_NE(normalised_focal.errors.find("focal lengths from the principal point"), std::string::npos);
  const ProgramResult normalised_points = result(grid(20, 1, 0.05, 0), "500,500,256,256", "0.5");
  EXPECT_EQ(normalised_points.status, 2);
  EXPECT_NE(normalised_points.errors.find("no image coordinate is larger than 1"), std::string::npos);
  const ProgramResult sigma = result(grid(20, 1, 0.05, 0), "1,1,0,0", "0.5");
  EXPECT_EQ(sigma.status, 2);
  EXPECT_NE(sigma.errors.find("--sigma 0.5 is 0.5 of the focal length 1"), std::string::npos);
}

TEST(MotionCommand, IdenticalFramesAndTracksThatVanish) {
  const TemporaryDirectory directory;
  const auto json = [&](const std::string& content, int status, const Words& more = {}) {
    const ProgramResult result = run(
        Words{directory.write("t.csv", content), "--intrinsics", "500,500,256,256", "--json", directory / "out.json"} +
        more);
    EXPECT_EQ(result.status, status) << result.errors;
    return Json::parse(contentOf(directory / "out.json"));
  };
  const Json still = json(grid(10, 500, 0), 3);
  EXPECT_EQ(still["status"], "ill_defined");
  for (const Json& frame : still["frames"]) EXPECT_TRUE(hasFlag(frame, "standstill"));

  // Frames 20 to 24 have no tracks, frame 30 one, and what comes after are other tracks: the state is kept.
  const Simulated files({"--frames", "60"});
  std::istringstream lines(files.content("tracks.csv"));
  std::string line, gone;
  std::getline(lines, line);
  gone = line + "\n";
  bool first_of_30 = true;
  while (std::getline(lines, line)) {
    int frame = 0, track = 0;
    double t = 0;
    ASSERT_EQ(std::sscanf(line.c_str(), "%d,%lf,%d", &frame, &t, &track), 3);
    if (frame >= 20 && frame < 25) continue;
    if (frame == 30 && !first_of_30) continue;
    first_of_30 = first_of_30 && frame != 30;
    gone += line + "\n";
  }
  files.write("tracks.csv", gone);
  const Json kept = files.json({"--sigma", "1"});
  ASSERT_EQ(kept["frames"].size(), 59U);
  for (std::size_t k = 18; k < 34; ++k) {
    // The frame after a gap has no pair either.
    const bool missing = (k >= 20 && k <= 25) || k == 30 || k == 31;
    const Json& frame = kept["frames"][k - 1];
    EXPECT_EQ(hasFlag(frame, "too_few"), missing) << k;
    EXPECT_TRUE(frame["usable"].get<bool>()) << k;
    EXPECT_LT(frame["direction_error_deg"].get<double>(), 3) << k;
  }
  // A frame that is seen twice is no motion, and is told from the others.
  std::istringstream again(files.content("tracks.csv"));
  std::string repeated;
  std::map<int, std::string> rows;
  std::getline(again, repeated);
  while (std::getline(again, line)) rows[std::atoi(line.c_str())] += line.substr(line.find(',')) + "\n";
  repeated = "frame,t_s,track,u,v,inlier\n";
  for (int k = 0; k < 19; ++k) {
    std::istringstream of_frame(rows[k < 15 ? k : k - 1]);
    while (std::getline(of_frame, line)) repeated += fmt::format("{}{}\n", k, line);
  }
  files.write("tracks.csv", repeated);
  const Json twice = files.json({"--sigma", "1"});
  for (std::size_t k = 8; k < 19; ++k) {
    const Json& frame = twice["frames"][k - 1];
    EXPECT_EQ(hasFlag(frame, "standstill"), k == 15) << k;
    // At rest there is no direction; after it the sign may have to be found again.
    EXPECT_EQ(frame["usable"].get<bool>(), k != 15 && !hasFlag(frame, "undecided_sign")) << k;
    if (k < 15) {
      EXPECT_TRUE(frame["usable"].get<bool>()) << k;
    }
  }
}

TEST(MotionCommand, TwoTracksWithAGyroscope) {
  const Simulated files({"--points", "3", "--gyroscope-sigma", "0.05", "--seed", "8"});
  const ProgramResult images = files.motion({"--sigma", "1"});
  EXPECT_EQ(images.status, 3);
  EXPECT_TRUE(hasFlag(Json::parse(files.content("out.json"))["frames"][50], "too_few"));
  const Json with = files.json(files.imu({"--sigma", "1"}));
  EXPECT_FALSE(hasFlag(with["frames"][50], "too_few"));
  EXPECT_GT(with["frames_usable"].get<int>(), 70);
  EXPECT_LT(directionError(with), 3);
}

TEST(MotionCommand, tooFewTracksAreNotTrusted) {
  const TemporaryDirectory directory;
  const std::string file = directory.write("t.csv", "frame,track,u,v\n0,0,100,200\n1,0,101,200\n2,0,102,200\n");
  const ProgramResult result = run(
      {file, "--intrinsics", "500,500,256,256", "--json", directory / "out.json", "--output", directory / "out.csv"});
  EXPECT_EQ(result.status, 3) << result.errors;
  const Json json = Json::parse(contentOf(directory / "out.json"));
  EXPECT_EQ(json["status"], "ill_defined");
  ASSERT_EQ(json["frames"].size(), 2U);
  EXPECT_EQ(json["frames"][0]["flags"][0], "too_few");
  EXPECT_NE(contentOf(directory / "out.csv").find("too_few"), std::string::npos);
}

/// The tracks and the poses of a simulated camera, f = 500 px.
struct SimulatedTracks {
  TemporaryDirectory directory;
  std::string tracks, poses;

  SimulatedTracks(const experiments::MotionSceneOptions& options, int frames, std::uint64_t seed) {
    experiments::MotionScene scene(options, seed);
    std::string rows = "frame,track,u,v\n", motion = "frame,t_s,R00,R01,R02,R10,R11,R12,R20,R21,R22,cx,cy,cz\n";
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    Eigen::Vector3d t = Eigen::Vector3d::Zero();
    for (int k = 0; k <= frames; ++k) {
      if (k > 0) {
        scene.advance();
        const Eigen::Matrix3d turn = SO3d::exp(scene.rotation).matrix();
        R = turn * R, t = turn * t + scene.translation;
      }
      motion += std::to_string(k) + "," + std::to_string(0.1 * k);
      for (int i = 0; i < 9; ++i) motion += "," + std::to_string(R(i / 3, i % 3));
      const Eigen::Vector3d centre = -R.transpose() * t;
      for (int i = 0; i < 3; ++i) motion += "," + std::to_string(centre[i]);
      motion += "\n";
      for (const experiments::MotionTrack& track : scene.observed) {
        rows += std::to_string(k) + "," + std::to_string(track.track);
        for (int i = 0; i < 2; ++i) rows += "," + std::to_string(256 + 500 * track.at[i]);
        rows += "\n";
      }
    }
    tracks = directory.write("tracks.csv", rows), poses = directory.write("poses.csv", motion);
  }
  Words words(const Words& more) const {
    return Words{tracks, "--intrinsics", "500,500,256,256", "--truth", poses} + more;
  }
};

/// The rows of a plot's CSV by panel and series: x, y, low, high, value.
using Rows = std::map<std::pair<std::string, std::string>, std::vector<std::array<double, 5>>>;
Rows rowsOf(const std::string& csv) {
  std::istringstream lines(csv);
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line.substr(0, 31), "panel,series,x,y,low,high,width");
  Rows rows;
  while (std::getline(lines, line)) {
    if (line.empty()) continue;
    Words cells{""};
    bool quoted = false;
    for (const char c : line) {
      if (c == '"') {
        quoted = !quoted;
      } else if (c == ',' && !quoted) {
        cells.emplace_back();
      } else {
        cells.back() += c;
      }
    }
    cells.resize(8);
    const auto value = [&](std::size_t i) { return cells[i].empty() ? std::nan("") : std::stod(cells[i]); };
    rows[{cells[0], cells[1]}].push_back({value(2), value(3), value(4), value(5), value(7)});
  }
  return rows;
}

/// True for a point inside of a closed line about a centre, by its angles.
bool isInside(const std::vector<std::array<double, 5>>& line, double x, double y) {
  double turns = 0;
  for (std::size_t i = 1; i < line.size(); ++i) {
    const double ax = line[i - 1][0] - x, ay = line[i - 1][1] - y, bx = line[i][0] - x, by = line[i][1] - y;
    turns += std::atan2(ax * by - ay * bx, ax * bx + ay * by);
  }
  return std::abs(turns) > 3;
}

TEST(MotionCommand, ReportShowsTheFiguresWithTheirData) {
  const SimulatedTracks scene({.sigma = 1}, 60, 1);
  const std::string page = scene.directory / "deep/page";
  const ProgramResult result =
      run(scene.words({"--sigma", "1", "--report", page, "--json", scene.directory / "out.json"}));
  ASSERT_EQ(result.status, 0) << result.errors;
  const std::string html = contentOf(page + "/index.html");
  EXPECT_NE(html.find("</html>"), std::string::npos);
  // The files that the page links to are there.
  const std::regex link("href=\"([A-Za-z_]+\\.[a-z]+)\"");
  std::set<std::string> linked;
  for (std::sregex_iterator at(html.begin(), html.end(), link), end; at != end; ++at) linked.insert((*at)[1]);
  const bool drawn = runProgram({"gnuplot", "--version"}, ".").found;
  const Words plots{"estimates", "errors",    "residual",  "contours", "convergence",
                    "sign",      "essential", "structure", "distances"};
  EXPECT_EQ(linked.size(), plots.size() * (drawn ? 3 : 1));
  for (const std::string& file : linked) EXPECT_TRUE(std::filesystem::exists(page + "/" + file)) << file;
  EXPECT_EQ(html.find("could not draw"), std::string::npos);
  std::map<std::string, Rows> data;
  for (const std::string& plot : plots) {
    ASSERT_TRUE(linked.count(plot + ".csv") == 1) << plot;
    data[plot] = rowsOf(contentOf(page + "/" + plot + ".csv"));
  }

  // Estimates and errors: a row per frame; the truth is within the bands where the estimate may be used.
  const Json frames = Json::parse(contentOf(scene.directory / "out.json"))["frames"];
  for (const std::string axis : {"x", "y", "z"}) {
    ASSERT_EQ(data["estimates"].at({"direction", axis}).size(), 60U);
    ASSERT_EQ(data["estimates"].at({"rotation", axis}).size(), 60U);
    ASSERT_EQ(data["errors"].at({"error of the rotation", axis}).size(), 60U);
  }
  ASSERT_EQ(data["errors"].at({"error of the direction", ""}).size(), 120U);
  for (int k = 0; k < 3; ++k) {
    const auto& row = data["estimates"].at({"direction", std::string(1, static_cast<char>('x' + k))}).back();
    EXPECT_EQ(row[0], 60);
    EXPECT_NEAR(row[1], frames[59]["direction"][static_cast<std::size_t>(k)].get<double>(), 1e-9);
  }
  // Two components' bands, one after the other: nine frames in ten that may be used have no error, zero, within both.
  const auto& bands = data["errors"].at({"error of the direction", ""});
  int usable = 0, within = 0;
  for (std::size_t k = 0; k < 60; ++k) {
    if (!frames[k]["usable"].get<bool>()) continue;
    ++usable;
    within += bands[k][2] < 0 && bands[k][3] > 0 && bands[60 + k][2] < 0 && bands[60 + k][3] > 0 ? 1 : 0;
  }
  EXPECT_GT(usable, 40);
  EXPECT_GE(10 * within, 9 * usable);

  // The minimum of each flow: the estimate at the origin is in its 95 % region (χ² 5.99), for this seed of all three.
  for (const std::string flow : {"forward", "midpoint", "discrete"}) {
    const auto& map = data["residual"].at({flow, "residual"});
    ASSERT_EQ(map.size(), 63U * 63U) << flow;
    const auto least = data["residual"].at({flow, "minimum"}).at(0);
    EXPECT_EQ(data["residual"].at({flow, "estimate"}).at(0)[0], 0);
    EXPECT_LT(std::hypot(least[0], least[1]), 5) << flow;
    double lowest = 1e9, here = 1e9;
    for (const auto& cell : map) {
      if (!(cell[4] < lowest)) continue;
      lowest = cell[4], here = std::hypot(cell[0] - least[0], cell[1] - least[1]);
    }
    EXPECT_LT(here, 3) << "beside the lowest cell of the map";
    EXPECT_EQ(
        std::count_if(map.begin(), map.end(),
                      [](const auto& cell) { return std::isfinite(cell[4]) != (std::hypot(cell[0], cell[1]) < 90); }),
        0);
  }
  const auto& regions = data["residual"].at({"near the estimate", ""});
  ASSERT_EQ(regions.size(), 4U * 97U);
  for (std::size_t k = 0; k < 3; ++k) {
    const std::vector<std::array<double, 5>> region(regions.begin() + static_cast<std::ptrdiff_t>(97 * k),
                                                    regions.begin() + static_cast<std::ptrdiff_t>(97 * (k + 1)));
    EXPECT_TRUE(isInside(region, 0, 0)) << k;
  }

  // Convergence: sixty frames and the start; the winner ends at the estimate, the released filter at the antipode.
  const auto& winner = data["convergence"].at({"about the estimate", "winning start"}).back();
  const auto& released = data["convergence"].at({"about the antipode: depths negative", "sign released"}).back();
  EXPECT_LT(std::hypot(winner[0], winner[1]), 2);
  EXPECT_LT(std::hypot(released[0], released[1]), 2);
  for (const std::string plot : {"sign", "essential"}) {
    const auto& held = data[plot].at({"angle from the estimate", "held"});
    const auto& free = data[plot].at({"angle from the estimate", "released"});
    ASSERT_EQ(held.size(), 61U);
    ASSERT_EQ(free.size(), 61U);
    EXPECT_EQ(held.front()[1], free.front()[1]);
    EXPECT_LT(held.back()[1], 5) << plot;
    EXPECT_GT(free.back()[1], 175) << plot;
    EXPECT_EQ(data[plot].at({"evidence for positive depths", "held"}).size(), 60U);
  }
  EXPECT_GT(data["contours"].at({"subspace filter", "residual"}).size(), 500U);
  EXPECT_GT(data["contours"].at({"essential filter, rotation of the estimate", "residual"}).size(), 500U);

  // Structure: twenty points with bars, and ten distances over 25 frames that stay, or do not.
  for (const std::string view :
       {"rigid, from above", "rubbery, from above", "rigid, from the side", "rubbery, from the side"}) {
    const auto& points = data["structure"].at({view, "last position"});
    ASSERT_EQ(points.size(), 20U) << view;
    for (const auto& p : points) EXPECT_TRUE(p[2] < p[1] && p[1] < p[3]) << view;
    EXPECT_EQ(data["structure"].at({view, "last frames"}).size(), 20U * 26U);
  }
  std::map<std::string, double> largest;
  for (const std::string which : {"rigid", "rubbery"}) {
    const auto& changes = data["distances"].at({which, "distances"});
    ASSERT_EQ(changes.size(), 10U * 26U);
    for (std::size_t i = 24; i < changes.size(); i += 26)
      largest[which] = std::max(largest[which], std::abs(changes[i][1]));
  }
  EXPECT_LT(largest["rigid"], 25);
  EXPECT_GT(largest["rubbery"], 50);
  EXPECT_TRUE(std::regex_search(html, std::regex("Flag: RIGID\\. (9|10) of 10 ")));
}

TEST(MotionCommand, ReportOfLargeRotationShowsTheDisplacedMinimum) {
  // The report's figure 5: at 10 degrees per frame the minimum of the forward difference leaves the truth, those of the
  // other two flows do not. (At 1 px the standard deviation of one frame is some 3 degrees.)
  const SimulatedTracks scene({.world = experiments::MotionWorld::general, .points = 60, .sigma = 0.3, .rotation = 10},
                              30, 3);
  const std::string page = scene.directory / "page";
  const ProgramResult result =
      run(scene.words({"--report", page, "--report-frame", "25", "--sigma", "0.3", "--min-motion", "0.01"}));
  ASSERT_EQ(result.status, 0) << result.errors;
  Rows rows = rowsOf(contentOf(page + "/residual.csv"));
  const auto offset = [&](const std::string& flow) {
    const auto least = rows.at({flow, "minimum"}).at(0), truth = rows.at({flow, "truth"}).at(0);
    return std::hypot(least[0] - truth[0], least[1] - truth[1]);
  };
  EXPECT_GT(offset("forward"), 4);
  EXPECT_LT(offset("midpoint"), 2);
  EXPECT_LT(offset("discrete"), 2);
  EXPECT_NE(contentOf(page + "/index.html").find("The residual of frame 25"), std::string::npos);
  // The figures of the convergence are of the frames up to that one.
  EXPECT_EQ(rowsOf(contentOf(page + "/sign.csv")).at({"angle from the estimate", "held"}).size(), 26U);
}

TEST(MotionCommand, ReportsOfLittleAreShort) {
  const TemporaryDirectory directory;
  const std::string file = directory.write("t.csv", "frame,track,u,v\n0,0,100,200\n1,0,101,200\n2,0,102,200\n");
  const ProgramResult few = run({file, "--intrinsics", "500,500,256,256", "--report", directory / "page"});
  EXPECT_EQ(few.status, 3) << few.errors;
  const std::string page = contentOf(directory / "page/index.html");
  EXPECT_NE(page.find("Not to be trusted"), std::string::npos);
  EXPECT_NE(page.find("This frame has 0 usable pairs of points, and its figures need 8."), std::string::npos);

  const ProgramResult beyond =
      run({file, "--intrinsics", "500,500,256,256", "--report", directory / "other", "--report-frame", "3"});
  EXPECT_EQ(beyond.status, 2);
  EXPECT_NE(beyond.errors.find("--report-frame 3: there is no such frame with one before it, expected one of 1 to 2"),
            std::string::npos)
      << beyond.errors;
  EXPECT_FALSE(std::filesystem::exists(directory / "other"));
  // As the other commands say it of a path that cannot be made.
  const ProgramResult blocked = run({file, "--intrinsics", "500,500,256,256", "--report", file + "/page"});
  EXPECT_EQ(blocked.status, 2);
  EXPECT_NE(blocked.errors.find("t.csv/page: the directory cannot be made"), std::string::npos) << blocked.errors;
}

}  // namespace
}  // namespace liestat::cli
