// `liestat motion`: tracks in, directions and rotations out; real tracks; bad input.

#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include <cli/io/run_program.hpp>
#include <cli/temporary_directory.hpp>

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

}  // namespace
}  // namespace liestat::cli
