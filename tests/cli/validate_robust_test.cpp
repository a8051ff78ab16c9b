// `liestat validate robust`: its tables, and what the program writes.

#include <cli/show/robust_validation.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include <report/run_program.hpp>
#include <support/temporary_directory.hpp>

namespace liestat::cli {
using namespace experiments;
namespace {

using Json = nlohmann::json;

TEST(ValidateRobust, tablesFitTheTerminalAndEndInTheVerdict) {
  RobustValidation validation;
  validation.trials = 4;
  validation.outliers = {0, 0.3};
  RobustValidationResult result = validateRobust(validation);
  std::string text = formatRobustTables(result);
  EXPECT_NE(text.find("\nPASSED\n"), std::string::npos) << text;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 80U) << line;
  result.rows[1].found_passed = false;
  result.rows[2].passed = false;
  result.rows[2].verdict = ValidationVerdict::heavy_tail;
  text = formatRobustTables(result);
  EXPECT_NE(text.find("FAILED conic, 0 % outliers, truncated_cost: found in 4 of 4 trials, 99 % are promised"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("FAILED conic, 0 % outliers, inlier_count: too many distances"), std::string::npos) << text;
  EXPECT_EQ(text.find("PASSED"), std::string::npos);
}

TEST(ValidateRobustProgram, writesRowsAndAReport) {
  const TemporaryDirectory directory;
  const ProgramResult result =
      runProgram({LIESTAT_PROGRAM, "validate", "robust", "--trials", "5", "--outliers", "0.2,0.6", "--score",
                  "relevance,inlier_count", "--json", "out.json", "--report", "report"},
                 directory.path().string());
  ASSERT_EQ(result.status, 0) << result.errors;
  const Json json = Json::parse(contentOf(directory / "out.json"));
  ASSERT_EQ(json["rows"].size(), 8U);
  for (const Json& row : json["rows"]) {
    for (const char* field :
         {"structure",    "score",         "outliers",       "trials", "dof",          "law",   "index",
          "ks_p",         "coverage95",    "cut_factor",     "tail",   "in_domain",    "found", "confidence",
          "found_passed", "inliers_right", "outliers_wrong", "draws",  "draws_needed", "passed"}) {
      EXPECT_TRUE(row.contains(field)) << field;
    }
  }
  EXPECT_EQ(json["rows"][0]["structure"], "conic");
  EXPECT_EQ(json["rows"][1]["score"], "inlier_count");
  EXPECT_TRUE(json["rows"][2]["passed"].is_null()) << "60 % of outliers are shown";
  EXPECT_EQ(json["rows"][4]["dof"], 8);
  ASSERT_EQ(json["thresholds"].size(), 2U);
  EXPECT_TRUE(json["thresholds"][0].contains("moments_median"));
  EXPECT_NE(contentOf(directory / "report/index.html").find("</html>"), std::string::npos);
}

TEST(ValidateRobustProgram, failsWhereTheNoiseIsWrong) {
  const TemporaryDirectory directory;
  const ProgramResult result =
      runProgram({LIESTAT_PROGRAM, "validate", "robust", "--trials", "40", "--outliers", "0.2", "--structure", "conic",
                  "--score", "relevance", "--noise-factor", "2", "--json", "out.json"},
                 directory.path().string());
  EXPECT_EQ(result.status, 1) << result.errors;
  const Json rows = Json::parse(contentOf(directory / "out.json"))["rows"];
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_EQ(rows[0]["found_passed"], false);
}

TEST(ValidateRobustProgram, refusesWhatItDoesNotKnow) {
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{"--structure", "spiral"},
                                                    {"--score", "luck"},
                                                    {"--outliers", "1"},
                                                    {"--measurements", "3"},
                                                    {"--confidence", "1"},
                                                    {"--trials", "0"}}) {
    std::vector<std::string> command{LIESTAT_PROGRAM, "validate", "robust"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    const ProgramResult result = runProgram(command, ".");
    EXPECT_EQ(result.status, 2) << arguments[0];
    EXPECT_EQ(std::count(result.errors.begin(), result.errors.end(), '\n'), 1) << result.errors;
  }
}

}  // namespace
}  // namespace liestat::cli
