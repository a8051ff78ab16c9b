// `liestat validate estimator`: its tables, and what the program writes.

#include <cli/show/estimator_validation.hpp>

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

TEST(ValidateEstimator, tablesFitTheTerminalAndEndInTheVerdict) {
  EstimatorValidation validation;
  validation.trials = 20;
  std::vector<EstimatorRow> rows = validateEstimator(validation);
  std::string text = formatEstimatorTables(rows);
  EXPECT_NE(text.find("\nPASSED\n"), std::string::npos) << text;
  EXPECT_NE(text.find("5.28"), std::string::npos) << "the prototype's figure for a noise that is not judged";
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 80U) << line;
  rows[0].passed = false;
  rows[0].verdict = ValidationVerdict::index_too_small;
  text = formatEstimatorTables(rows);
  EXPECT_NE(text.find("FAILED conic criterion: the index is too small"), std::string::npos) << text;
  EXPECT_EQ(text.find("PASSED"), std::string::npos);
}

TEST(ValidateEstimatorProgram, writesRowsAndAReport) {
  const TemporaryDirectory directory;
  const ProgramResult result = runProgram({LIESTAT_PROGRAM, "validate", "estimator", "--trials", "30", "--experiment",
                                           "rotation,conic", "--json", "out.json", "--report", "report"},
                                          directory.path().string());
  ASSERT_EQ(result.status, 0) << result.errors;
  const Json json = Json::parse(contentOf(directory / "out.json"));
  ASSERT_EQ(json["rows"].size(), 8U);
  for (const Json& row : json["rows"]) {
    for (const char* field :
         {"experiment", "quantity", "sigma", "in_domain", "trials", "dof", "law", "index", "ks_p", "coverage95", "tail",
          "failures", "iterations", "note_index", "note_coverage95", "covariance_deviation", "passed"}) {
      EXPECT_TRUE(row.contains(field)) << field;
    }
  }
  EXPECT_EQ(json["rows"][1]["quantity"], "parameter");
  EXPECT_EQ(json["rows"][1]["dof"], 5);
  EXPECT_EQ(json["rows"][3]["note_index"], 5.12);
  EXPECT_TRUE(json["rows"][3]["passed"].is_null());
  EXPECT_EQ(json["rows"][6]["experiment"], "rotation");
  const std::string page = contentOf(directory / "report/index.html");
  EXPECT_NE(page.find("</html>"), std::string::npos);
  EXPECT_NE(page.find("</h1>\n<p class=\"verdict good\">✓ PASSED: "), std::string::npos) << "the verdict comes first";
}

TEST(ValidateEstimatorProgram, failsWhereTheNoiseIsWrong) {
  const TemporaryDirectory directory;
  const ProgramResult result = runProgram({LIESTAT_PROGRAM, "validate", "estimator", "--trials", "200", "--experiment",
                                           "rotation", "--noise-factor", "1.3", "--json", "out.json"},
                                          directory.path().string());
  EXPECT_EQ(result.status, 1) << result.errors;
  const Json rows = Json::parse(contentOf(directory / "out.json"))["rows"];
  ASSERT_EQ(rows.size(), 2U);
  for (const Json& row : rows) EXPECT_EQ(row["passed"], false);
}

TEST(ValidateEstimatorProgram, refusesWhatItDoesNotKnow) {
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"--experiment", "circle"}, {"--noise-factor", "0"}, {"--trials", "0"}}) {
    std::vector<std::string> command{LIESTAT_PROGRAM, "validate", "estimator"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    const ProgramResult result = runProgram(command, ".");
    EXPECT_EQ(result.status, 2) << arguments[0];
    EXPECT_EQ(std::count(result.errors.begin(), result.errors.end(), '\n'), 1) << result.errors;
  }
}

}  // namespace
}  // namespace liestat::cli
