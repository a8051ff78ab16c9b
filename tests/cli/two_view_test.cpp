// `liestat two-view` and `liestat simulate two-view`: files in, answer, JSON and page out.

#include <gtest/gtest.h>

#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include <cli/program_output.hpp>
#include <support/temporary_directory.hpp>

namespace liestat::cli {
namespace {

using Json = nlohmann::json;

std::string simulate(const TemporaryDirectory& directory, const std::string& motion, const Words& more = {}) {
  const ProgramOutput made =
      run(Words{"simulate", "two-view", "--output", directory / (motion + ".csv"), "--motion", motion} + more);
  EXPECT_EQ(made.exit_code, 0) << made.error;
  return directory / (motion + ".csv");
}
const Words known_camera = {"--intrinsics", "600,600,320,240", "--image-size", "640,480", "--sigma", "0.5"};
Words asked(const std::string& file, const Words& more = known_camera) { return Words{"two-view", file} + more; }

TEST(TwoViewCommand, answersWhatWasSimulated) {
  const TemporaryDirectory directory;
  const std::string file = simulate(directory, "essential", {"--truth", directory / "truth.json", "--seed", "3"});
  const ProgramOutput out = run(asked(file) + Words{"--json", directory / "out.json"});
  ASSERT_EQ(out.exit_code, 0) << out.error;
  EXPECT_NE(out.output.find("essential: "), std::string::npos) << out.output;
  std::istringstream lines(out.output);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 120U) << line;

  const Json json = Json::parse(contentOf(directory / "out.json")),
             truth = Json::parse(contentOf(directory / "truth.json"));
  EXPECT_EQ(json["model"], "essential");
  EXPECT_EQ(json["status"], "ok");
  EXPECT_TRUE(json["reason"].is_null());
  EXPECT_EQ(json["lattice"].size(), 9U);
  EXPECT_EQ(json["inlier"].size(), 100U);
  EXPECT_EQ(json["second_T_first"]["covariance"].size(), 5U);
  const Json& parameters = json["parameters"][0];
  ASSERT_EQ(parameters["names"].size(), 6U);
  for (std::size_t i = 0; i < 3; ++i) {
    const double error = parameters["values"][i].get<double>() - truth["rotation_vector"][i].get<double>();
    EXPECT_LT(std::abs(error), 5 * parameters["deviations"][i].get<double>() + 1e-9);
  }
}

TEST(TwoViewCommand, sameSeedSameFile) {
  const TemporaryDirectory directory;
  const std::string first = contentOf(simulate(directory, "zoom"));
  EXPECT_EQ(run({"simulate", "two-view", "--output", directory / "zoom.csv", "--motion", "zoom"}).exit_code, 2)
      << "a file is not replaced";
  EXPECT_EQ(contentOf(simulate(directory, "zoom", {"--overwrite"})), first);
  EXPECT_NE(contentOf(simulate(directory, "zoom", {"--overwrite", "--seed", "2"})), first);
  EXPECT_EQ(run({"simulate", "two-view", "--output", "-", "--motion", "zoom"}).output, first);
}

TEST(TwoViewCommand, withoutIntrinsicsAndSizeItSaysSo) {
  const TemporaryDirectory directory;
  const std::string file = simulate(directory, "homography");
  const ProgramOutput out = run(asked(file, {"--sigma", "0.5"}));
  EXPECT_EQ(out.exit_code, 0) << out.error << out.output;
  EXPECT_NE(out.output.find("bounding box of the matches"), std::string::npos);
  EXPECT_NE(out.output.find("without intrinsics"), std::string::npos);
  EXPECT_EQ(out.output.find("\nessential"), std::string::npos) << "no such row";
}

TEST(TwoViewCommand, thePageHasMatchesErrorsAndLattice) {
  const TemporaryDirectory directory;
  Words words = asked(simulate(directory, "homography"));
  words.insert(words.end(), {"--report", directory / "page"});
  const ProgramOutput out = run(words);
  ASSERT_EQ(out.exit_code, 0) << out.error;
  const std::string page = contentOf(directory / "page/index.html");
  for (const char* part : {"matches.csv", "errors.csv", "lattice.csv", "the other one"}) {
    EXPECT_NE(page.find(part), std::string::npos) << part;
  }
  if (std::filesystem::exists(directory / "page/lattice.svg")) {
    EXPECT_NE(contentOf(directory / "page/lattice.svg").find("homography: "), std::string::npos) << "the names";
  }
}

TEST(TwoViewCommand, severalMotionsAreListed) {
  const TemporaryDirectory directory;
  std::string both = contentOf(simulate(directory, "homography", {"--outliers", "0"}));
  const std::string second = contentOf(simulate(directory, "zoom", {"--outliers", "0", "--matches", "60"}));
  both += second.substr(second.find('\n') + 1);
  Words words = asked(directory.write("both.csv", both));
  words.insert(words.end(), {"--motions", "5", "--json", directory / "out.json", "--report", directory / "page"});
  const ProgramOutput out = run(words);
  ASSERT_EQ(out.exit_code, 0) << out.error << out.output;
  const Json json = Json::parse(contentOf(directory / "out.json"));
  ASSERT_EQ(json["motions"].size(), 2U);
  EXPECT_EQ(json["motions"][0]["model"], "homography");
  EXPECT_EQ(json["motions"][1]["model"], "zoom");
  ASSERT_EQ(json["motion"].size(), 160U);
  std::size_t right = 0;
  for (std::size_t i = 0; i < 160; ++i) right += json["motion"][i] == (i < 100 ? 1 : 2) ? 1 : 0;
  EXPECT_GE(right, 150U);
  EXPECT_NE(contentOf(directory / "page/index.html").find("matches of none"), std::string::npos);
}

TEST(TwoViewCommand, answersThatAreNotTrustedExitWith3) {
  const TemporaryDirectory directory;
  const std::string file = simulate(directory, "none", {"--outliers", "1", "--matches", "40"});
  const ProgramOutput out = run(asked(file));
  EXPECT_EQ(out.exit_code, 3);
  EXPECT_NE(out.output.find("NOT TO BE TRUSTED"), std::string::npos) << out.output;
}

TEST(TwoViewCommand, aMotionThatLeavesTheImagesIsSaid) {
  // Rotations by four degrees and more of an image that is a hundredth of a degree wide.
  for (const char* matches : {"10", "100000"}) {
    const ProgramOutput out = run({"simulate", "two-view", "--output", "-", "--motion", "rotation", "--focal-length",
                                   "1e6", "--matches", matches});
    EXPECT_EQ(out.exit_code, 2);
    EXPECT_NE(out.error.find("takes all points out of images of 640 x 480 px"), std::string::npos) << out.error;
  }
}

TEST(TwoViewCommand, repeatedAndContradictingMatchesAreCounted) {
  const TemporaryDirectory directory;
  std::string text = contentOf(simulate(directory, "homography", {"--outliers", "0"}));
  text += text.substr(text.find('\n') + 1);  // each match twice
  for (int i = 0; i < 20; ++i) text += "100,100," + std::to_string(20 * i) + ",50,0\n";
  const std::string file = directory.write("twice.csv", text);
  for (const Words& more : {Words{}, {"--motions", "3"}}) {
    Words words = asked(file, more);
    words.insert(words.end(), {"--json", directory / "out.json"});
    const ProgramOutput out = run(words);
    ASSERT_EQ(out.exit_code, 0) << out.error << out.output;
    EXPECT_NE(out.output.find("100 repeat another one"), std::string::npos) << out.output;
    EXPECT_NE(out.output.find("20 contradict each other"), std::string::npos) << out.output;
    const Json json = Json::parse(contentOf(directory / "out.json"));
    EXPECT_EQ(json["repeated"], 100);
    EXPECT_EQ(json["contradicted"], 20);
  }
}

TEST(TwoViewCommand, badInputIsNamed) {
  const TemporaryDirectory directory;
  const auto error = [&](const std::string& content, const Words& more = {}) {
    const ProgramOutput out = run(asked(directory.write("m.csv", content), more));
    EXPECT_EQ(out.exit_code, 2) << content;
    return out.error;
  };
  EXPECT_NE(error("x1,y1,x2\n1,2,3\n").find("y2"), std::string::npos);
  EXPECT_NE(error("x1,y1,x2,y2\n1,2,3,4\n1,2,nan,4\n").find("m.csv:3: x2"), std::string::npos);
  EXPECT_NE(error("").find("m.csv"), std::string::npos);
  const std::string fine = "x1,y1,x2,y2\n1,2,3,4\n";
  EXPECT_NE(error(fine, {"--intrinsics", "0,600,320,240"}).find("intrinsics"), std::string::npos);
  EXPECT_NE(error(fine, {"--second-intrinsics", "600,600,320,240"}).find("--intrinsics"), std::string::npos);
  EXPECT_NE(error(fine, {"--sigma", "0"}).find("sigma"), std::string::npos);
  EXPECT_NE(error(fine, {"--image-size=-640,480"}).find("-640 is not a finite positive number"), std::string::npos);
  EXPECT_NE(error(fine, {"--image-size", "640,inf"}).find("inf is not a finite positive number"), std::string::npos);
  EXPECT_EQ(run(asked(directory / "none.csv", {})).exit_code, 2);
}

}  // namespace
}  // namespace liestat::cli
