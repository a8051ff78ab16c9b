// `liestat motion`: tracks in, directions and rotations out; real tracks; its report; bad input.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <cli/io/run_program.hpp>
#include <cli/temporary_directory.hpp>
#include <experiments/motion_scene.hpp>

namespace liestat::cli {
namespace {

using Json = nlohmann::json;

ProgramResult run(std::vector<std::string> words) {
  words.insert(words.begin(), {"sh", "-c", "\"$0\" \"$@\" > /dev/null", LIESTAT_PROGRAM, "motion"});
  return runProgram(words, ".");
}

Json runOnKitti(const std::string& directory, const std::string& sequence, const std::vector<std::string>& more) {
  const TemporaryDirectory out;
  const std::string stem = directory + "/tracks/kitti_2011_09_26_" + sequence;
  std::vector<std::string> words{stem + "_tracks.csv",
                                 "--intrinsics",
                                 "721.5377,721.5377,609.5593,172.854",
                                 "--truth",
                                 stem + "_poses.csv",
                                 "--process-noise",
                                 "1e-4",
                                 "--outliers",
                                 "--filter",
                                 "subspace",
                                 "--json",
                                 out / "out.json"};
  words.insert(words.end(), more.begin(), more.end());
  const ProgramResult result = run(words);
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

TEST(MotionCommand, badInputIsNamed) {
  const TemporaryDirectory directory;
  const auto error = [&](const std::string& content, const std::vector<std::string>& more) {
    std::vector<std::string> words{directory.write("t.csv", content)};
    words.insert(words.end(), more.begin(), more.end());
    const ProgramResult result = run(words);
    EXPECT_EQ(result.status, 2) << content;
    return result.errors;
  };
  const std::vector<std::string> camera{"--intrinsics", "500,500,256,256"};
  const std::string fine = "frame,track,u,v\n0,0,1,2\n1,0,2,2\n";
  EXPECT_NE(error(fine, {}).find("--intrinsics"), std::string::npos);
  EXPECT_NE(error("frame,track,u\n0,0,1\n", camera).find("columns u and v"), std::string::npos);
  EXPECT_NE(error("frame,track,u,v\n0,0,1,nan\n", camera).find("t.csv:2"), std::string::npos);
  EXPECT_NE(error(fine + "1,0,2,2\n", camera).find("t.csv:4: track 0 again in frame 1"), std::string::npos);
  EXPECT_NE(error("frame,track,u,v\n3,0,1,2\n", camera).find("there is one frame"), std::string::npos);
  EXPECT_NE(error(fine, {"--intrinsics", "-500,500,256,256"}).find("positive"), std::string::npos);
  EXPECT_NE(error(fine, {"--intrinsics", "500,500,256,256", "--sigma", "0"}).find("sigma"), std::string::npos);
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
  std::vector<std::string> words(const std::vector<std::string>& more) const {
    std::vector<std::string> all{tracks, "--intrinsics", "500,500,256,256", "--truth", poses};
    all.insert(all.end(), more.begin(), more.end());
    return all;
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
    std::vector<std::string> cells{""};
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

/// Whether a point is inside of a closed line about a centre, by its angles.
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
  // What the page links to is there.
  const std::regex link("href=\"([A-Za-z_]+\\.[a-z]+)\"");
  std::set<std::string> linked;
  for (std::sregex_iterator at(html.begin(), html.end(), link), end; at != end; ++at) linked.insert((*at)[1]);
  const bool drawn = runProgram({"gnuplot", "--version"}, ".").found;
  const std::vector<std::string> plots{"estimates", "errors",    "residual",  "contours", "convergence",
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
      run(scene.words({"--report", page, "--report-frame", "25", "--sigma", "0.3", "--least-motion", "0.01"}));
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
