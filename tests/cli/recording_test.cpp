// `liestat vi-init RECORDING` and `liestat two-view` from rendered images: a room with boxes, written as EuRoC lies on disk.

#include <experiments/recording_files.hpp>
#include <experiments/simulate_vi.hpp>
#include <formats/output_file.hpp>
#include <formats/tracks.hpp>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <sys/resource.h>

#include <cli/program_output.hpp>
#include <support/rendered_room.hpp>

namespace liestat::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using testing::RenderedRoom;
using testing::TexturedBox;
using testing::writePgm;

#define EXPECT_SAYS(text, part) EXPECT_TRUE(contains(text, part)) << (text)

bool isFull() { return std::getenv("LIESTAT_FULL") != nullptr; }

/// CPU time of this process and of those that it has waited for, s.
double cpuTime() {
  double seconds = 0;
  for (const int who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage usage{};
    getrusage(who, &usage);
    for (const timeval& t : {usage.ru_utime, usage.ru_stime}) {
      seconds += static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
    }
  }
  return seconds;
}

constexpr ImuNoise<double> sensor = {
    .gyroscope = 8e-4, .accelerometer = 8e-3, .gyroscope_walk = 2e-5, .accelerometer_walk = 3e-4};

CameraCalibration roomCamera() {
  CameraCalibration camera = experiments::defaultCamera();
  camera.camera = {.fu = 420, .fv = 420, .cu = 319.5, .cv = 239.5, .width = 640, .height = 480};
  return camera;
}

const char* camera_yaml =
    "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n"
    "  data: [0, 0, 1, 0.05, -1, 0, 0, 0.02, 0, -1, 0, 0.01, 0, 0, 0, 1]\nrate_hz: 10\nresolution: [640, 480]\n"
    "camera_model: pinhole\nintrinsics: [420, 420, 319.5, 239.5]\ndistortion_model: radial-tangential\n"
    "distortion_coefficients: [0, 0, 0, 0]\n";
const char* imu_yaml =
    "sensor_type: imu\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n"
    "rate_hz: 200\ngyroscope_noise_density: 8e-4\ngyroscope_random_walk: 2e-5\naccelerometer_noise_density: 8e-3\n"
    "accelerometer_random_walk: 3e-4\n";

/// Readings, truth and times of `images` images at 10 Hz as EuRoC has them, without the images.
experiments::SimulatedRecording writeSensors(const std::string& folder, std::uint64_t seed, std::size_t images) {
  experiments::SyntheticImuOptions imu;
  imu.noise = sensor;
  imu.bias = experiments::calibratedBias(seed);
  experiments::ViSceneOptions scene;
  scene.landmarks = 100;
  scene.seed = seed;
  const double end = 0.1 * static_cast<double>(images) - 0.06;
  const auto motion = experiments::builtInTrajectory(end + 1, seed);
  experiments::SimulatedRecording recording = experiments::simulateMotion(motion, 0, end, roomCamera(), imu, scene);
  recording.start_ns = 1600000000000000000;
  experiments::writeRecording(recording, folder + "/flat");
  const std::string root = folder + "/mav0/";
  for (const char* place : {"cam0/data", "imu0", "state_groundtruth_estimate0"}) fs::create_directories(root + place);
  fs::rename(folder + "/flat/imu.csv", root + "imu0/data.csv");
  fs::rename(folder + "/flat/truth.csv", root + "state_groundtruth_estimate0/data.csv");
  fs::rename(folder + "/flat/images.csv", root + "cam0/data.csv");
  fs::remove_all(folder + "/flat");
  writeOutput(root + "cam0/sensor.yaml", camera_yaml);
  writeOutput(root + "imu0/sensor.yaml", imu_yaml);
  return recording;
}

std::string imageName(const experiments::SimulatedRecording& recording, std::size_t image) {
  return std::to_string(recording.start_ns + std::llround(1e9 * recording.image_times[image])) + ".png";
}

/// The same with images: walls round the motion, and four boxes in front of them.
experiments::SimulatedRecording writeRendered(const std::string& folder, std::uint64_t seed, std::size_t images) {
  experiments::SimulatedRecording recording = writeSensors(folder, seed, images);
  const Eigen::Vector3d low = recording.box_centre - recording.box / 2, high = recording.box_centre + recording.box / 2;
  RenderedRoom room({low, high}, roomCamera().camera, 3, static_cast<std::uint32_t>(seed));
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector3d corner(i % 2 == 0 ? low.x() : high.x() - 1.4, i < 2 ? low.y() + 0.8 : high.y() - 2, low.z());
    room.boxes.emplace_back(corner, corner + Eigen::Vector3d(1.4, 1.2, 0.3 * recording.box.z() * (1 + i % 3)));
  }
  for (std::size_t i = 0; i < recording.image_times.size(); ++i) {
    const auto state = truthAt(recording.truth, recording.image_times[i]);
    const SE3d world_T_body(state->state.so3(), state->state.translation());
    // Names end in .png as EuRoC's; what a file is its first bytes say.
    writePgm(folder + "/mav0/cam0/data/" + imageName(recording, i),
             room.render(world_T_body * recording.camera.imu_T_cam));
  }
  return recording;
}

TEST(Recording, renderedImagesAreInitialised) {
  const bool full = isFull();
  double of_windows = 0, windows = 0, of_stretches = 0, stretches = 0, all = 0, tested = 0;
  for (std::uint64_t seed = full ? 100 : 7, end = full ? 120 : 8; seed < end; ++seed) {
    const TemporaryDirectory directory;
    const double begin = cpuTime();
    const auto recording = writeRendered(directory / "room", seed, 60);
    ASSERT_EQ(recording.image_times.size(), 60U);
    const double rendered = cpuTime();
    const ProgramOutput out = run({"vi-init", directory / "room", "--json", directory / "out.json"});
    const double seconds = cpuTime() - rendered;
    ASSERT_TRUE(fs::exists(directory / "out.json")) << out.error;
    const Json json = Json::parse(contentOf(directory / "out.json"));
    double nees = 0, ok = 0, fused = 0, fusions = 0;
    for (const Json& w : json.at("windows")) {
      ++all;
      if (!w.at("ok").get<bool>()) continue;
      nees += w.at("nees").get<double>(), ++ok;
    }
    for (const Json& f : json.at("fusions")) {
      if (f.at("nees").is_number()) fused += f.at("nees").get<double>(), ++fusions;
    }
    tested += out.exit_code == 0;
    if (full) {
      std::printf("| %d | %.1f + %.1f s | exit %d | %.0f | %.2f | %.2f |\n", static_cast<int>(seed), rendered - begin,
                  seconds, out.exit_code, ok, nees / ok, fused / fusions);
      std::fflush(stdout);
    }
    of_windows += nees, windows += ok, of_stretches += fused, stretches += fusions;
    EXPECT_LT(seconds, 20) << seed;
  }
  if (full) {
    std::printf("%.0f of %.0f windows ok, %.0f recordings exit 0, NEES of windows %.2f of 5, of stretches %.2f of 11\n",
                windows, all, tested, of_windows / windows, of_stretches / stretches);
  }
  ASSERT_GT(windows, 0);
  ASSERT_GT(stretches, 0);
  EXPECT_GE(windows, 0.9 * all);
  // Over the seeds within a factor of two; of one recording what p > 0.001 allows (two windows that share biases).
  EXPECT_LT(of_windows / windows, full ? 10 : 20.5);
  EXPECT_GT(of_windows / windows, full ? 2.5 : 0.2);
  EXPECT_LT(of_stretches / stretches, full ? 22 : 31.3);
  EXPECT_GT(of_stretches / stretches, full ? 5.5 : 1.5);
}

/// A pair of images of a plane, of boxes at many depths, or from one place.
std::vector<SE3d> pairOf(const std::string& kind, std::mt19937& rng, RenderedRoom& room) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto vector = [&] { return Eigen::Vector3d(uniform(rng), uniform(rng), uniform(rng)); };
  // The wall at z = 3 fills the view; the other walls are far off.
  const SE3d first(SO3d::exp(0.1 * vector()), 0.3 * vector());
  if (kind == "depth") {
    for (int i = 0; i < 12; ++i) {
      const Eigen::Vector3d corner(1.6 * uniform(rng) - 0.2, 1.2 * uniform(rng) - 0.2, 2 + 0.6 * uniform(rng));
      room.boxes.emplace_back(corner, corner + Eigen::Vector3d(0.6, 0.5, 1));
    }
  }
  const double baseline = kind == "rotation" ? 0 : 0.05 + 0.05 * std::abs(uniform(rng));
  const SE3d motion(SO3d::exp(0.03 * vector().normalized()), baseline * vector().normalized());
  return {first, first * motion};
}

// Two images, tracked, and read by `two-view` with the tracks' own sigma.
TEST(Recording, renderedPairsHaveTheirModel) {
  const std::vector<std::pair<std::string, std::string>> kinds = {
      {"plane", "homography"}, {"depth", "essential"}, {"rotation", "rotation"}};
  const Camera camera = roomCamera().camera;
  for (const auto& [kind, model] : kinds) {
    int right = 0, wrong_and_ok = 0, trusted = 0;
    const int pairs = isFull() ? 40 : 3;
    for (int pair = 0; pair < pairs; ++pair) {
      const TemporaryDirectory directory;
      const std::uint32_t seed = (isFull() ? 6000 : 40) + static_cast<std::uint32_t>(pair);
      std::mt19937 rng(seed);
      RenderedRoom room({Eigen::Vector3d(-20, -20, -20), Eigen::Vector3d(20, 20, 3)}, camera, 3, seed);
      int image = 0;
      for (const SE3d& pose : pairOf(kind, rng, room))
        writePgm(directory / fmt::format("{}.pgm", image++), room.render(pose));
      const ProgramOutput tracked =
          run({"track", directory / "0.pgm", directory / "1.pgm", "--output", directory / "t.csv"});
      ASSERT_EQ(tracked.exit_code, 0) << tracked.error;
      const ProgramOutput found = run({"two-view", directory / "t.csv", "--intrinsics", "420,420,319.5,239.5",
                                       "--image-size", "640,480", "--json", directory / "out.json"});
      ASSERT_LE(found.exit_code, 3) << found.error;
      const Json json = Json::parse(contentOf(directory / "out.json"));
      right += json.at("model") == model;
      trusted += found.exit_code == 0;
      wrong_and_ok += found.exit_code == 0 && json.at("model") != model;
      if (isFull() && (json.at("model") != model || found.exit_code != 0)) {
        std::printf("%s %u: %s\n", kind.c_str(), seed, found.output.c_str());
      }
    }
    if (isFull()) std::printf("| %s | %d | %d | %d | %d |\n", kind.c_str(), pairs, right, trusted, wrong_and_ok);
    EXPECT_GE(right, 0.95 * pairs) << kind;
    EXPECT_LE(wrong_and_ok, 0.05 * pairs) << kind;
  }
}

TEST(Recording, matchesAreTheTracksOfTwoImages) {
  const TemporaryDirectory directory;
  const std::string rows = "frame,track,u,v,sigma\n3,1,1,2,0.1\n3,2,3,4,0.1\n3,4,5,6,0.1\n3,6,0,0,0.1\n";
  const Matches found =
      readMatches(directory.write("t.csv", rows + "5,4,50,60,0.3\n5,2,30,40,0.1\n5,1,10,20,0.1\n5,9,1,1,0.1\n"));
  ASSERT_EQ(found.points.size(), 2U);
  EXPECT_EQ(found.points[0], Eigen::Vector4d(1, 2, 10, 20));
  EXPECT_EQ(found.points[1], Eigen::Vector4d(3, 4, 30, 40));
  EXPECT_NEAR(found.sigma, 0.1, 1e-12);
  EXPECT_EQ(found.left_out, 1U);
  const auto message = [&](const std::string& more) {
    try {
      readMatches(directory.write("t.csv", rows + more));
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_SAYS(message("5,1,1,1,0.1\n7,1,1,1,0.1\n"), "tracks of 3 images, expected two");
  EXPECT_SAYS(message("5,1,1,1,0.1\n5,1,2,2,0.1\n"), "t.csv:7: this frame and track again");
  EXPECT_SAYS(message("5,8,1,1,0.1\n"), "no track is in both images");
  EXPECT_SAYS(message("5,1,1,1,0\n"), "t.csv:6: sigma 0");
}

class RecordingFolder : public ::testing::Test {
 protected:
  RecordingFolder() {
    setenv("XDG_CACHE_HOME", (directory / "cache").c_str(), 1);
    recording = writeSensors(folder, 3, 8);
    const std::vector<std::uint8_t> pixels(640 * 480, 90);
    for (std::size_t i = 0; i < 8; ++i) writePgm(image(i), {pixels.data(), 640, 480, 640});
  }
  std::string image(std::size_t i) const { return folder + "/mav0/cam0/data/" + imageName(recording, i); }
  /// Sentences of a run that has to end with exit code 2 and leave nothing behind.
  std::string refused(const Words& more = {}) {
    const ProgramOutput out = run(Words{"vi-init", folder, "--json", directory / "out.json"} + more);
    EXPECT_EQ(out.exit_code, 2) << out.output << out.error;
    EXPECT_FALSE(fs::exists(directory / "out.json"));
    return out.error;
  }
  const TemporaryDirectory directory;
  const std::string folder = directory / "room";
  experiments::SimulatedRecording recording;
};

TEST_F(RecordingFolder, saysEachThingThatIsMissing) {
  for (const char* file : {"imu0/sensor.yaml", "imu0/data.csv", "cam0/sensor.yaml"})
    fs::remove(folder + "/mav0/" + file);
  const std::string three = refused();
  EXPECT_EQ(std::count(three.begin(), three.end(), '\n'), 3) << three;
  EXPECT_SAYS(three, "there are no readings of an inertial sensor, expected imu0/data.csv");
  EXPECT_SAYS(three, "no camera is known, expected cam0/sensor.yaml");
  EXPECT_SAYS(three, "densities of noise are not known, expected imu0/sensor.yaml");
  fs::remove_all(folder + "/mav0/cam0");
  EXPECT_SAYS(refused(), "there are no images, expected a folder of them");
  const ProgramOutput bare = run({"vi-init"});
  EXPECT_EQ(bare.exit_code, 2);
  EXPECT_SAYS(bare.error, "there are no readings");
  fs::remove_all(folder);
  EXPECT_SAYS(refused(), "there is no such folder");
  writeOutput(folder, "x");
  EXPECT_SAYS(refused(), "it is no folder");
  fs::remove(folder);
  fs::create_directory(folder);
  EXPECT_SAYS(refused(), "there are no images");
}

TEST_F(RecordingFolder, refusesImagesWithASentence) {
  EXPECT_SAYS(refused(), "no corner was found");
  const std::string before = contentOf(image(3));
  writeOutput(image(3), "no image");
  EXPECT_SAYS(refused(), imageName(recording, 3) + ": it is no image that can be read");
  const std::vector<std::uint8_t> other(320 * 240, 7);
  writePgm(image(3), {other.data(), 320, 240, 320});
  EXPECT_SAYS(refused(), "it has 320 x 240 pixels, expected 640 x 480");
  writeOutput(image(3), before);
  const std::string stray = folder + "/mav0/cam0/data/stray.png";
  writeOutput(stray, before);
  EXPECT_SAYS(refused(), "stray.png: it has no time in");
  fs::remove(stray);
  for (std::size_t i = 1; i < 8; ++i) fs::remove(image(i));
  EXPECT_SAYS(refused(), "there is one image");
}

TEST_F(RecordingFolder, refusesOtherClocksNumbersAndCameras) {
  const std::string imu = folder + "/mav0/imu0/data.csv", text = contentOf(imu);
  // A year later.
  std::string later = text;
  for (std::size_t at = later.find("\n16"); at != std::string::npos; at = later.find("\n16", at + 1))
    later[at + 2] = '7';
  writeOutput(imu, later);
  EXPECT_SAYS(refused(), "none within the readings'");
  writeOutput(imu, text);
  EXPECT_SAYS(refused({"--camera", "cam3"}), "no calibration has a camera cam3, expected one of cam0");
  writeOutput(folder + "/mav0/cam0/sensor.yaml", "sensor_type: camera\nintrinsics: [420, 420]\n");
  EXPECT_SAYS(refused(), "sensor.yaml:2");
  // A plain folder, whose images are numbered: without times, then with a gap.
  const std::string plain = directory / "plain";
  fs::create_directories(plain + "/left");
  for (std::size_t i = 0; i < 4; ++i) fs::rename(image(i), plain + fmt::format("/left/{}.png", i));
  writeOutput(plain + "/readings.csv", text);
  writeOutput(plain + "/chain.yaml", experiments::calibrationText(recording.camera, sensor));
  const auto said = [&] { return run({"vi-init", plain}).error; };
  EXPECT_SAYS(said(), "nothing says when the images were taken");
  fs::remove(plain + "/left/2.png");
  EXPECT_SAYS(said(), "image 2 is missing");
  // A file of times finds them; the camera's name is not the folder's.
  std::string times = "frame,t_s\n";
  for (std::size_t i = 0; i < 3; ++i) times += fmt::format("{},{:.6f}\n", i, 1600000000 + recording.image_times[i]);
  writeOutput(plain + "/times.csv", times);
  EXPECT_SAYS(said(), "no corner was found");
}

// Two seconds at 10 Hz, tracked once; what changes is tracked anew, and the recording stays as it is.
TEST(Recording, tracksAreKeptOutsideOfIt) {
  const TemporaryDirectory directory;
  setenv("XDG_CACHE_HOME", (directory / "cache").c_str(), 1);
  const std::string room = directory / "room";
  const auto recording = writeRendered(room, 11, 14);
  const auto filesOf = [](const std::string& folder) {
    std::vector<std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      if (entry.is_regular_file()) files.push_back(entry.path().string());
    }
    return files;
  };
  const std::size_t before = filesOf(room).size();
  const auto tracked = [&](const Words& more = {}) {
    return run(Words{"vi-init", room, "--window", "1.2", "--no-refinement"} + more).output;
  };
  EXPECT_SAYS(tracked(), ", kept in " + (directory / "cache/liestat/tracks-"));
  const std::string kept = filesOf(directory / "cache").at(0), content = contentOf(kept);
  EXPECT_SAYS(tracked(), "kept from before in");
  // A row that somebody changed, an image that is another, and the options' places.
  std::string changed = content;
  changed[changed.size() - 2] ^= 1;
  writeOutput(kept, changed);
  EXPECT_SAYS(tracked(), ", kept in ");
  EXPECT_EQ(contentOf(kept), content);
  const std::string image = room + "/mav0/cam0/data/" + imageName(recording, 13);
  fs::last_write_time(image, fs::last_write_time(image) + std::chrono::seconds(1));
  EXPECT_SAYS(tracked(), ", kept in ");
  EXPECT_SAYS(tracked({"--cache", directory / "mine"}), ", kept in " + (directory / "mine/tracks-"));
  EXPECT_SAYS(tracked({"--json", directory / "out.json"}), ", kept in " + (directory / "tracks-"));
  EXPECT_TRUE(fs::remove(kept));
  EXPECT_SAYS(tracked({"--json", room + "/out.json"}), ", kept in " + (directory / "cache/liestat/tracks-"));
  EXPECT_TRUE(fs::remove(room + "/out.json"));
  EXPECT_SAYS(run({"vi-init", room, "--cache", room + "/mav0/new"}).error, "is within the recording");
  EXPECT_EQ(filesOf(room).size(), before);
  // The options go before what is found: these tracks are none of the images'.
  writeOutput(directory / "t.csv", "frame,track,u,v,t_s\n0,0,1,1,1600000000.01\n1,0,2,2,1600000000.02\n");
  EXPECT_SAYS(run({"vi-init", room, "--tracks", directory / "t.csv"}).error, "2 images");
  EXPECT_SAYS(run({"vi-init", room, "--imu", directory / "none.csv"}).error, "none.csv: no such file");
}

}  // namespace
}  // namespace liestat::cli
