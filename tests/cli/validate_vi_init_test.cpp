// `liestat validate vi-init`: what it shows and writes. What it finds: tests/experiments/.

#include <report/run_program.hpp>
#include <cli/show/table1.hpp>
#include <cli/show/vi_init_validation.hpp>
#include <support/temporary_directory.hpp>
#include <experiments/closed_form_cases.hpp>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <filesystem>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

using Json = nlohmann::json;

ViInitValidation small(std::vector<ViInitCheck> checks, std::size_t trials) {
  ViInitValidation validation;
  validation.checks = std::move(checks);
  validation.trials = trials;
  validation.recordings = 1;  // a second each
  return validation;
}

TEST(ValidateViInit, tablesAreNoWiderThanATerminal) {
  std::istringstream lines(
      formatViInitTables(validateViInit(small({all_vi_init_checks.begin(), all_vi_init_checks.end()}, 4))));
  for (std::string line; std::getline(lines, line);) {
    // Bytes: of the few letters beyond ASCII, some have two and three.
    EXPECT_LE(line.size(), 110U) << line;
  }
}

TEST(ValidateViInit, aTableNamesWhatFailed) {
  for (const ViInitCheck check : all_vi_init_checks) {
    auto rows = validateViInit(small({check}, 4));
    for (ViInitRow& row : rows) {
      if (!row.promise) continue;
      row.passed = false;
      row.verdict = ValidationVerdict::too_many_failures;
    }
    const std::string text = formatViInitTables(rows);
    EXPECT_NE(text.find("\nFAILED\n"), std::string::npos) << text;
    EXPECT_NE(text.find("FAILED " + name(check)), std::string::npos) << text;
    EXPECT_NE(text.find(reason(ValidationVerdict::too_many_failures)), std::string::npos) << text;
  }
}

TEST(Table1, saysWhatThePaperSays) {
  const std::string text = formatTable1(recogniseTable1(16, 3, 0));
  EXPECT_NE(text.find("PASSED"), std::string::npos);
  EXPECT_NE(text.find("paper: infinite"), std::string::npos);
}

ProgramResult run(std::vector<std::string> arguments, const std::string& directory) {
  arguments.insert(arguments.begin(), {LIESTAT_PROGRAM, "validate", "vi-init"});
  return runProgram(arguments, directory);
}

TEST(ValidateViInitProgram, writesRowsAndAReport) {
  const TemporaryDirectory directory;
  const ProgramResult result = run({"--trials", "20", "--check", "consistency,accuracy", "--window", "1", "--json",
                                    "out.json", "--report", "report"},
                                   directory.path().string());
  ASSERT_EQ(result.status, 0) << result.errors;
  const Json json = Json::parse(contentOf(directory / "out.json"));
  ASSERT_EQ(json["rows"].size(), 9U + 6U);
  for (const Json& row : json["rows"]) {
    for (const char* field :
         {"check",        "estimator",      "quantity", "unit",         "window",   "images",
          "features",     "in_domain",      "trials",   "dof",          "law",      "index",
          "index_se",     "index_expected", "variance", "ks_statistic", "ks_p",     "coverage95",
          "failures",     "median",         "p95",      "value",        "value_se", "promised_median",
          "promised_p95", "note_median",    "note_p95", "passed"}) {
      EXPECT_TRUE(row.contains(field)) << field;
    }
    EXPECT_EQ(row["window"], 1);
    EXPECT_EQ(row["median"].is_null(), row["unit"] == "");
  }
  EXPECT_EQ(json["false_alarm"], 1e-5);
  EXPECT_NE(contentOf(directory / "report/index.html").find("</html>"), std::string::npos);
  for (const char* file : {"report/consistency.csv", "report/errors.csv"}) {
    EXPECT_TRUE(std::filesystem::exists(directory / file)) << file;
  }
}

TEST(ValidateViInitProgram, aBrokenPromiseIsItsExitCode) {
  const ProgramResult result = run({"--trials", "40", "--check", "closed_form", "--window", "2", "--noise", "3"}, ".");
  EXPECT_EQ(result.status, 1) << result.errors;
}

TEST(ValidateViInitProgram, drawsThePapersFiguresAndPrintsItsTable) {
  const TemporaryDirectory directory;
  for (const std::string figure : {"fig1", "fig2"}) {
    const ProgramResult result =
        run({"--scene", figure, "--report", figure, "--json", figure + ".json"}, directory.path().string());
    ASSERT_EQ(result.status, 0) << result.errors;
    EXPECT_NE(contentOf(directory / (figure + "/" + figure + ".csv")).find("solution 2: features"), std::string::npos);
    const Json json = Json::parse(contentOf(directory / (figure + ".json")));
    EXPECT_EQ(json["status"], "ambiguous");
    ASSERT_EQ(json["solutions"].size(), 2U);
    EXPECT_EQ(json["solutions"][0]["features"].size(), figure == "fig1" ? 1U : 3U);
    EXPECT_NE(json["solutions"][0]["truth"], json["solutions"][1]["truth"]);
  }
  const ProgramResult result =
      run({"--table1", "--trials", "3", "--json", "table1.json", "--report", "table1"}, directory.path().string());
  ASSERT_EQ(result.status, 0) << result.errors;
  const Json json = Json::parse(contentOf(directory / "table1.json"));
  ASSERT_EQ(json["rows"].size(), closedFormCases().size() + noisyClosedFormCases().size());
  for (const Json& row : json["rows"]) {
    EXPECT_EQ(row["one_solution"].get<int>() + row["two_solutions"].get<int>() + row["infinite_solutions"].get<int>(),
              3);
    EXPECT_EQ(row["passed"], true);
    EXPECT_EQ(row["null"].is_null(), row["data"] == "noise");
  }
  EXPECT_NE(contentOf(directory / "table1/index.html").find("Corrections"), std::string::npos);
}

TEST(ValidateViInitProgram, refusesWhatItDoesNotKnow) {
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{"--check", "speed"},
                                                    {"--window", "1.5"},
                                                    {"--noise", "0"},
                                                    {"--trials", "0"},
                                                    {"--scene", "fig3", "--report", "x"},
                                                    {"--scene", "fig1"},
                                                    {"--table1", "--check", "drift"},
                                                    {"--check", "drift", "--window", "1"}}) {
    const ProgramResult result = run(arguments, ".");
    EXPECT_EQ(result.status, 2) << arguments[0] << ' ' << arguments.back();
    EXPECT_EQ(std::count(result.errors.begin(), result.errors.end(), '\n'), 1) << result.errors;
  }
}

}  // namespace
}  // namespace liestat::cli
