// `liestat validate motion`: its tables, and what the program writes.

#include <cli/show/motion_validation.hpp>

#include <gtest/gtest.h>

#include <algorithm>
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

/// Columns on the terminal: bytes that begin a character.
std::size_t widthOf(const std::string& line) {
  return static_cast<std::size_t>(std::count_if(line.begin(), line.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

TEST(ValidateMotion, tablesFitTheTerminalAndEndInTheVerdict) {
  MotionValidation validation;
  validation.methods = {MotionMethod::gyroscope_bias, MotionMethod::gyroscope_robust};
  validation.trials = 6;
  std::vector<MotionRow> rows = validateMotion(validation);
  std::string text = formatMotionTables(rows);
  EXPECT_NE(text.find("\nPASSED\n"), std::string::npos) << text;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(widthOf(line), 80U) << line;
  rows[1].passed = false, rows[1].reason = "covariance too small";
  text = formatMotionTables(rows);
  EXPECT_NE(text.find("FAILED gyroscope_bias, orbit g 0.1 b 0.115, 4 px: covariance too small"), std::string::npos)
      << text;
  EXPECT_EQ(text.find("PASSED"), std::string::npos);
}

TEST(ValidateMotionProgram, writesRowsAndAReport) {
  const TemporaryDirectory directory;
  const ProgramResult result = runProgram({LIESTAT_PROGRAM, "validate", "motion", "--trials", "5", "--method",
                                           "composition,gauss_newton", "--json", "out.json", "--report", "report"},
                                          directory.path().string());
  ASSERT_EQ(result.status, 0) << result.errors;
  const Json rows = Json::parse(contentOf(directory / "out.json"))["rows"];
  ASSERT_EQ(rows.size(), 10U);
  for (const Json& row : rows) {
    for (const char* field :
         {"method", "scene", "sigma_px", "points", "rotation_deg", "outliers", "gyroscope_sigma_deg",
          "gyroscope_bias_deg", "trials", "successes_20", "median_deg_50", "consistency_100", "coverage95",
          "convergence_frame", "usable", "usable_wrong", "in_domain", "passed"}) {
      EXPECT_TRUE(row.contains(field)) << field;
    }
  }
  EXPECT_EQ(rows[0]["method"], "gauss_newton");
  EXPECT_TRUE(rows[0]["passed"].is_null()) << "for comparison";
  EXPECT_EQ(rows[3]["passed"], true);
  EXPECT_TRUE(rows[3].contains("promised_success_20"));
  EXPECT_NE(contentOf(directory / "report/index.html").find("</html>"), std::string::npos);
}

TEST(ValidateMotionProgram, failsWhereTheNoiseIsWrongAndRefusesWhatItDoesNotKnow) {
  const TemporaryDirectory directory;
  EXPECT_EQ(runProgram({LIESTAT_PROGRAM, "validate", "motion", "--trials", "40", "--method", "gyroscope_bias",
                        "--noise-factor", "4"},
                       directory.path().string())
                .status,
            1);
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"--method", "luck"}, {"--noise-factor", "0"}, {"--trials", "0"}}) {
    std::vector<std::string> command{LIESTAT_PROGRAM, "validate", "motion"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    const ProgramResult result = runProgram(command, ".");
    EXPECT_EQ(result.status, 2) << arguments[0];
    EXPECT_EQ(std::count(result.errors.begin(), result.errors.end(), '\n'), 1) << result.errors;
  }
}

}  // namespace
}  // namespace liestat::cli
