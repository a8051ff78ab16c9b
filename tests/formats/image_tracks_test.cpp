// Tracks of features over images, good and bad.

#include <formats/tracks.hpp>

#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include <support/temporary_directory.hpp>
#include <formats/text.hpp>

namespace liestat {
namespace {

ImageTracks parse(const std::string& tracks, const std::string& times = "", std::int64_t start_ns = 0) {
  return parseImageTracks(tracks, "f", times, times.empty() ? "" : "t", start_ns);
}

const std::string header = "frame,track,u,v\n";

TEST(ImageTrackFiles, WithTheirOwnTimes) {
  // Frames neither from zero nor without holes, columns in another order, comments.
  const ImageTracks tracks = parse("# by hand\nt_s,v,u,track,frame\n2.5,4,3,70,12\n2.5,6,5,9,12\n1.5,2,1,70,10\n");
  EXPECT_EQ(tracks.times, (std::vector<double>{1.5, 2.5}));
  EXPECT_EQ(tracks.frames, (std::vector<std::size_t>{10, 12}));
  EXPECT_EQ(tracks.track_ids, (std::vector<std::size_t>{9, 70}));
  EXPECT_EQ(tracks.seen_once, 1U);
  EXPECT_EQ(tracks.format, "t_s");
  ASSERT_EQ(tracks.observations.size(), 3U);
  const PixelObservation& first = tracks.observations[0];
  EXPECT_EQ(first.image, 0U);
  EXPECT_EQ(first.track, 1U);
  EXPECT_EQ(first.u, 1);
  EXPECT_EQ(first.v, 2);
  EXPECT_EQ(first.line, 5U);
  EXPECT_EQ(tracks.observations[1].track, 0U) << "by images, then by tracks";
  EXPECT_EQ(tracks.observations[1].u, 5);
}

TEST(ImageTrackFiles, WithAFileOfTimes) {
  const std::string rows = header + "7,1,10,20\n9,1,11,21\n9,3,12,22\n";
  const ImageTracks csv = parse(rows, "frame,t_s\n7,0.25\n8,0.5\n9,0.75\n");
  EXPECT_EQ(csv.times, (std::vector<double>{0.25, 0.5, 0.75})) << "an image that nothing was seen in is one too";
  EXPECT_EQ(csv.format, "csv");
  EXPECT_EQ(csv.observations[1].image, 2U);

  // EuRoC: the row is the frame, and nanoseconds are subtracted as whole numbers.
  std::string euroc = "#timestamp [ns],filename\n";
  for (int i = 0; i < 10; ++i) euroc += "14037155239121431" + std::to_string(10 + i) + ",x.png\n";
  const ImageTracks stamped = parse(rows, euroc, 1403715523912143100);
  EXPECT_EQ(stamped.format, "euroc");
  ASSERT_EQ(stamped.times.size(), 10U);
  EXPECT_EQ(stamped.times[7], 17e-9);
  EXPECT_EQ(stamped.observations[2].image, 9U);

  // Seconds are of the same clock.
  const ImageTracks seconds = parse(rows, "frame,t_s\n7,1403715524\n9,1403715524.5\n", 1403715523500000000);
  EXPECT_EQ(seconds.times[0], 0.5);
  EXPECT_EQ(seconds.times[1], 1);
}

TEST(ImageTrackFiles, TheLeftOfAStereoPair) {
  const ImageTracks tracks = parse("frame,track,uL,vL,uR,vR,t_s\n0,0,1,2,3,4,0\n1,0,5,6,7,8,0.1\n");
  EXPECT_EQ(tracks.observations[1].u, 5);
  EXPECT_EQ(tracks.observations[1].v, 6);
  EXPECT_EQ(tracks.seen_once, 0U);
}

// Hashes and addresses serve as track numbers, too; a double has 53 bits.
TEST(ImageTrackFiles, NumbersOfTracksUpTo2To63) {
  const ImageTracks tracks = parse(
      "frame,track,t_s,u,v\n0,9223372036854775807,0,1,2\n0,9223372036854775806,0,3,4\n"
      "1,9223372036854775808,1,1,2\n1,9223372036854775807,1,1,2\n");
  EXPECT_EQ(tracks.track_ids,
            (std::vector<std::size_t>{9223372036854775806U, 9223372036854775807U, 9223372036854775808U}));
  EXPECT_NE(errorOf([] { parse("frame,track,t_s,u,v\n0,9223372036854775809,0,1,2\n"); }).find("up to 2^63"),
            std::string::npos);
}

TEST(ImageTrackFiles, TheUnitOfAClockIsSuspected) {
  const std::int64_t now = 1600000000000000000;
  // Images of the same day in microseconds, milliseconds and seconds, as seconds on the readings' clock.
  for (const auto& [per_ns, unit] : {std::pair{1e3, "microseconds"}, {1e6, "milliseconds"}, {1e9, "seconds"}}) {
    const double stamp = 1.6e18 / per_ns;
    const std::string said = suspectedUnit(now, 1e-9 * (stamp - static_cast<double>(now)));
    EXPECT_NE(said.find(std::string("images' times in ") + unit), std::string::npos) << said;
    const std::string other = suspectedUnit(static_cast<std::int64_t>(stamp), 1e-9 * (1.6e18 - stamp));
    EXPECT_NE(other.find(std::string("readings' times in ") + unit), std::string::npos) << other;
  }
  EXPECT_EQ(suspectedUnit(now, 3600), "");
  EXPECT_EQ(suspectedUnit(0, 1000), "");
}

TEST(ImageTrackFiles, BadOnesAreNamed) {
  const auto message = [](const std::string& tracks, const std::string& times = "", std::int64_t start_ns = 0) {
    return errorOf([&] { parse(tracks, times, start_ns); });
  };
  const std::string timed = "frame,track,u,v,t_s\n";
  EXPECT_EQ(message(timed + "0,1,2,3,0\n1,1,2,3,0.1\n0,1,2,4,0\n"),
            "f:4: frame 0 and track 1 again, as in line 2, expected them once");
  EXPECT_EQ(message(timed + "0,1,2,3,0\n1,1,2,3,0.1\n0,2,2,4,0.01\n"),
            "f:4: frame 0 is at t_s 0.01, 0.01 s from its time in an earlier line, expected one time for a frame");
  EXPECT_EQ(message(timed + "0,1,2,3,0.1\n1,1,2,3,0\n"),
            "f:3: the time is 0.1 s before that of line 2, expected times that ascend");
  EXPECT_EQ(message(timed + "0,1,2,3,0.1\n1,1,2,3,0.1\n"),
            "f:3: the time is that of line 2 again, expected times that ascend");
  EXPECT_EQ(message(timed + "0,1,nan,3,0.1\n"), "f:2: u is 'nan', expected a finite number");
  EXPECT_EQ(message(timed + "-1,1,2,3,0.1\n"), "f:2: frame is -1, expected a whole number of 0 or more");
  EXPECT_EQ(message(timed + "0,1.5,2,3,0.1\n"), "f:2: track is 1.5, expected a whole number of 0 or more");
  EXPECT_EQ(message(timed + "0,1,2\n"), "f:2: 3 fields, expected 5 as in the header");
  EXPECT_EQ(message(header + "0,1,2,3\n"),
            "f: there is no column 't_s', and no file of the images' times, expected one of them");
  EXPECT_EQ(message("frame,track,x,y\n0,1,2,3\n").substr(0, 29), "f:1: there is no column 'u', ");
  EXPECT_EQ(message("0,1,2,3\n").substr(0, 42), "f:1: numbers where the header should be, e");
  EXPECT_EQ(message(header), "f:1: there is a header but no data, expected at least one row after it");
  EXPECT_EQ(message(""), "f: the file is empty");

  const std::string rows = header + "0,1,2,3\n5,1,2,3\n";
  EXPECT_EQ(message(rows, "frame,t_s\n0,0\n1,0.1\n"), "f:3: frame 5 has no time in t, expected a frame of its 2 rows");
  EXPECT_EQ(message(rows, "frame,t_s\n0,0\n5,0.1\n0,0.2\n"), "t:4: frame 0 again, as in line 2, expected it once");
  EXPECT_EQ(message(rows, "frame,t_s\n0,0.2\n5,0.1\n"),
            "t:3: the time is 0.1 s before that of line 2, expected times that ascend");
  EXPECT_EQ(message(rows, "frame,t_s\n0,0.2\n5,inf\n"), "t:3: t_s is 'inf', expected a finite number");
  EXPECT_EQ(message(rows, "1403715523912143104,a.png\n1403715523912143104,b.png\n"),
            "t:2: the time is that of line 1 again, expected times that ascend");
  EXPECT_EQ(message(rows, "1403715523912143104,a.png\nlater,b.png\n"),
            "t:2: timestamp is 'later', expected a whole number of nanoseconds");
  EXPECT_EQ(message(rows, "1403715523912143104,a.png\n"),
            "f:3: frame 5 has no time in t, expected a frame of its 1 rows");
  EXPECT_EQ(message(timed + "0,1,2,3,0.5\n", "frame,t_s\n0,0.2\n"),
            "f:2: frame 0 is at t_s 0.5, 0.3 s from its time in t, expected one time for a frame");
}

// Real tracks by a KLT tracker on KITTI: 10501 observations of 707 features. The file's header is a comment and calls
// things otherwise, which is put right here, and said by the reader.
TEST(ImageTrackFiles, Kitti) {
  const char* data = std::getenv("LIESTAT_DATA");
  if (data == nullptr) GTEST_SKIP() << "LIESTAT_DATA is not set";
  const std::string folder = std::string(data) + "/vi/kitti/";
  EXPECT_NE(errorOf([&] { readImageTracks(folder + "drive_0001_tracks.csv", folder + "drive_0001_motion.csv", 0); }),
            "");

  const TemporaryDirectory directory;
  const TextFile file = loadText(folder + "drive_0001_tracks.csv");
  const std::string tracks =
      directory.write("tracks.csv", "frame,track,uL,vL,uR,vR\n" + file.text.substr(file.text.find('\n') + 1));
  std::string times = "frame,t_s\n";
  const TextFile motion_file = loadText(folder + "drive_0001_motion.csv");
  LineReader lines(motion_file.text);
  while (lines.next())
    times += std::string(lines.line().substr(0, lines.line().find(',', lines.line().find(',') + 1))) + "\n";
  const ImageTracks read = readImageTracks(tracks, directory.write("times.csv", times), 1317042145000000000);
  EXPECT_EQ(read.observations.size(), 10501U);
  EXPECT_EQ(read.track_ids.size(), 707U);
  EXPECT_EQ(read.times.size(), 108U);
  EXPECT_NEAR(read.times[0], 0.967803, 1e-6);
  EXPECT_EQ(read.observations[0].u, 343.4486);
}

}  // namespace
}  // namespace liestat
