// `liestat track` on rendered images: errors against their sigmas for each kind of scene, what is written, bad input.

#include <formats/images.hpp>
#include <formats/tracks.hpp>
#include <fusion/tracking/tracker.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include <cli/program_output.hpp>
#include <support/rendered_room.hpp>

namespace liestat::cli {
namespace {

using testing::rendered_kinds;
using testing::RenderedKind;
using testing::RenderedScene;
using testing::writePgm;

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

void write(const std::string& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }

/// Squares of errors over variances: against the truth of a track's first pixel, and of steps from image to image.
struct Errors {
  double life = 0, bulk = 0, step = 0, far = 0, count = 0, tracks = 0;

  void add(const RenderedScene& scene, const std::vector<TrackedPoint>& track) {
    const TrackedPoint& first = track.front();
    const Eigen::Vector2d pixel(first.u, first.v);
    Eigen::Vector2d error_before = Eigen::Vector2d::Zero();
    for (std::size_t i = 1; i < track.size(); ++i) {
      const TrackedPoint& p = track[i];
      const Eigen::Vector2d truth = scene.follow(pixel, first.image, p.image),
                            error = Eigen::Vector2d(p.u, p.v) - truth;
      // The first observation's error, as this image shows it.
      double scale = 0;
      for (const Eigen::Vector2d& e : {Eigen::Vector2d(0.01, 0), Eigen::Vector2d(0, 0.01)}) {
        scale += (scene.follow(pixel + e, first.image, p.image) - truth).squaredNorm() / 2e-4;
      }
      const double square =
          error.squaredNorm() / 2 / (p.sigma * p.sigma + std::min(scale, 4.) * first.sigma * first.sigma);
      const double before = i == 1 ? first.sigma : track[i - 1].sigma;
      life += square;
      step += (error - error_before).squaredNorm() / 2 / (p.sigma * p.sigma + before * before);
      (square > 12.5 ? far : bulk) += square > 12.5 ? 1 : square;
      ++count;
      error_before = error;
    }
    ++tracks;
  }
};

Errors errorsOf(RenderedKind kind, double noise, std::uint32_t first_seed, std::uint32_t seeds, std::size_t images) {
  Errors errors;
  for (std::uint32_t seed = first_seed; seed < first_seed + seeds; ++seed) {
    RenderedScene scene(kind, noise, seed);
    const auto flow = imageLibrary("test").pointFlow();
    Tracker tracker(*flow, {.tracks = 120});
    for (std::size_t i = 0; i < images; ++i) tracker.take(scene.render(i));
    std::map<std::size_t, std::vector<TrackedPoint>> tracks;
    for (const TrackedPoint& p : tracker.finish()) tracks[p.track].push_back(p);
    for (const auto& [number, track] : tracks) errors.add(scene, track);
  }
  return errors;
}

TEST(Track, errorsAreAsLargeAsTheirSigmas) {
  const bool full = std::getenv("LIESTAT_FULL") != nullptr;
  if (full) std::puts("| scene | noise | tracks | observations | life | step | beyond 5 sigma |"), std::fflush(stdout);
  for (std::size_t kind = 0; kind < rendered_kinds.size(); ++kind) {
    for (const double noise : full ? std::vector<double>{2, 4, 8} : std::vector<double>{4}) {
      const Errors e = errorsOf(static_cast<RenderedKind>(kind), noise, full ? 500 : 30, full ? 2 : 1, full ? 40 : 12);
      if (full) {
        std::printf("| %s | %g | %.0f | %.0f | %.2f | %.2f | %.2f %% |\n", rendered_kinds[kind], noise, e.tracks,
                    e.count, e.life / e.count, e.step / e.count, 100 * e.far / e.count);
        std::fflush(stdout);
      }
      ASSERT_GT(e.count, 100);
      // Some 60 tracks in the short run, each with one error of its template: a standard error of 0.1. Corners where an
      // edge crosses the texture behind it follow neither; they are few.
      EXPECT_NEAR(std::log(e.bulk / (e.count - e.far)), 0, full ? std::log(1.25) : 0.5)
          << rendered_kinds[kind] << noise;
      EXPECT_NEAR(std::log(e.step / e.count), 0, 0.35) << rendered_kinds[kind] << " " << noise;
      EXPECT_LE(e.far, 0.01 * e.count) << rendered_kinds[kind] << " " << noise;
    }
  }
}

class TrackFiles : public ::testing::Test {
 protected:
  /// Images 7.pgm, 8.pgm, …, so that 10 follows 9.
  std::string folder(std::size_t images) {
    RenderedScene scene(RenderedKind::still_light, 3, 11, 160, 120);
    const std::string name = directory / "images";
    std::filesystem::create_directory(name);
    for (std::size_t i = 0; i < images; ++i) writePgm(name + "/" + std::to_string(7 + i) + ".pgm", scene.render(i));
    return name;
  }
  ProgramOutput refused(const std::vector<std::string>& paths, const std::vector<std::string>& more = {}) {
    std::vector<std::string> command{"track"};
    command.insert(command.end(), paths.begin(), paths.end());
    command.insert(command.end(), {"--output", directory / "out.csv"});
    command.insert(command.end(), more.begin(), more.end());
    ProgramOutput result = run(command);
    EXPECT_EQ(result.exit_code, 2) << result.error;
    EXPECT_FALSE(std::filesystem::exists(directory / "out.csv"));
    return result;
  }
  const TemporaryDirectory directory;
};

TEST_F(TrackFiles, areReadByMotionAndViInit) {
  const std::string images = folder(12), out = directory / "tracks.csv", times = directory / "times.csv";
  std::string rows = "frame,t_s\n";
  for (int i = 0; i < 12; ++i) rows += std::to_string(i) + "," + std::to_string(100 + 0.05 * i) + "\n";
  write(times, rows);
  const ProgramOutput result =
      run({"track", images, "--output", out, "--times", times, "--every", "2", "--tracks", "60"});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_TRUE(contains(result.output, "6 images of 160 x 120")) << result.output;
  const ImageTracks tracks = readImageTracks(out, "", 0);
  ASSERT_EQ(tracks.times.size(), 6U);
  EXPECT_EQ(tracks.frames.back(), 5U);
  EXPECT_NEAR(tracks.times.back(), 100.5, 1e-9);
  EXPECT_TRUE(tracks.has_sigmas);
  EXPECT_GT(tracks.track_ids.size(), 15U);
  for (const PixelObservation& o : tracks.observations) EXPECT_TRUE(o.sigma > 0.001 && o.sigma < 1) << o.line;
  // All tracks were seen in all six images, as --least of eight asks where there are fewer.
  std::map<std::size_t, std::size_t> seen;
  for (const PixelObservation& o : tracks.observations) ++seen[o.track];
  for (const auto& [track, images_of_it] : seen) EXPECT_GE(images_of_it, 2U) << track;
  EXPECT_GT(seen.size(), 15U);
  // The column is used unless --sigma is given.
  const auto motion = [&](const std::string& file, std::vector<std::string> more) {
    std::vector<std::string> command{"motion", file, "--intrinsics", "400,400,80,60", "--output", "-"};
    command.insert(command.end(), more.begin(), more.end());
    return run(command).output;
  };
  const std::string with = motion(out, {});
  EXPECT_TRUE(contains(with, "frame")) << with;
  EXPECT_NE(with, motion(out, {"--sigma", "2"}));
  const std::string text = contentOf(out);
  std::string wrong = text.substr(0, text.find('\n') + 1) + "0,0,50,50,0,100\n";
  write(directory / "wrong.csv", wrong);
  const ProgramOutput zero = run({"motion", directory / "wrong.csv", "--intrinsics", "400,400,80,60"});
  EXPECT_EQ(zero.exit_code, 2);
  EXPECT_TRUE(contains(zero.error, "wrong.csv:2: sigma 0")) << zero.error;
}

TEST_F(TrackFiles, areRefusedWithASentence) {
  const std::string images = folder(4);
  const auto said = [](const ProgramOutput& result, const std::string& what) {
    EXPECT_TRUE(contains(result.error, what)) << result.error;
  };
  said(refused({directory / "nowhere"}), "there is no such file");
  said(refused({images + "/7.pgm"}), "there is one image");
  const std::string before = contentOf(images + "/7.pgm");
  const ProgramOutput over = run({"track", images, "--output", images + "/7.pgm"});
  EXPECT_EQ(over.exit_code, 2);
  said(over, "which is read");
  EXPECT_EQ(contentOf(images + "/7.pgm"), before);
  said(refused({images + "/7.pgm", images + "/7.pgm"}), "given twice");
  write(directory / "times.csv", "frame,t_s\n0,1\n1,2\n2,3\n");
  said(refused({images}, {"--times", directory / "times.csv"}), "3 times of 4 images");
  write(directory / "times.csv", "frame,t_s\n0,1\n1,2\n2,2\n3,4\n");
  said(refused({images}, {"--times", directory / "times.csv"}), "times.csv:4");
  std::filesystem::rename(images + "/8.pgm", images + "/11.pgm");
  said(refused({images}), "image 8 is missing");
  std::filesystem::rename(images + "/11.pgm", images + "/8.pgm");
  write(images + "/9.pgm", "P5 no image");
  said(refused({images}), "9.pgm: it is no image");
  const std::vector<std::uint8_t> black(200 * 160, 0);
  writePgm(images + "/9.pgm", {black.data(), 200, 160, 200});
  said(refused({images}), "9.pgm: it has 200 x 160 pixels, expected 160 x 120");
  for (const char* name : {"/7.pgm", "/8.pgm", "/9.pgm", "/10.pgm"})
    writePgm(images + name, {black.data(), 200, 160, 200});
  said(refused({images}), "no corner");
  write(directory / "video.avi", "RIFF no video");
  said(refused({directory / "video.avi"}), "no video");
  std::filesystem::create_directory(directory / "empty");
  said(refused({directory / "empty"}), "no image in it");
}

TEST_F(TrackFiles, needAModuleThatTheProgramNames) {
  const std::string images = folder(2), alone = directory / "liestat";
  std::filesystem::copy_file(LIESTAT_PROGRAM, alone);
  const ProgramResult result = runProgram({alone, "track", images, "--output", directory / "out.csv"}, ".");
  EXPECT_EQ(result.status, 2);
  EXPECT_TRUE(contains(result.errors, "libopencv-video-dev")) << result.errors;
}

TEST_F(TrackFiles, ofColourAnd16BitsAreConverted) {
  const std::string images = folder(4);
  const std::string grey = directory / "grey.csv", colour = directory / "colour.csv", deep = directory / "deep.csv";
  ASSERT_EQ(run({"track", images, "--output", grey}).exit_code, 0);
  // PPM with equal channels, PGM of 16 bits with 257 times the value.
  std::vector<std::string> ppm, pgm;
  for (int i = 7; i < 11; ++i) {
    const std::string content = contentOf(images + "/" + std::to_string(i) + ".pgm");
    const std::string pixels = content.substr(content.find("255\n") + 4);
    std::string three = "P6\n160 120\n255\n", two = "P5\n160 120\n65535\n";
    for (const char c : pixels) three += {c, c, c}, two += {c, c};
    ppm.push_back(directory / ("c" + std::to_string(i) + ".ppm"));
    pgm.push_back(directory / ("d" + std::to_string(i) + ".pgm"));
    write(ppm.back(), three);
    write(pgm.back(), two);
  }
  const auto tracked = [&](std::vector<std::string> files, const std::string& out) {
    files.insert(files.begin(), "track");
    files.insert(files.end(), {"--output", out});
    const ProgramOutput result = run(files);
    EXPECT_EQ(result.exit_code, 0) << result.error;
    return contentOf(out);
  };
  EXPECT_EQ(tracked(ppm, colour), contentOf(grey));
  EXPECT_GT(tracked(pgm, deep).size(), contentOf(grey).size() / 2);
}

}  // namespace
}  // namespace liestat::cli
