// `liestat validate two-view`: what it judges, its tables, and what the program writes.

#include <cli/show/two_view_rules.hpp>
#include <cli/show/two_view_validation.hpp>
#include <experiments/interruption.hpp>
#include <experiments/two_view_rules.hpp>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
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

TwoViewValidation small(std::size_t trials) {
  TwoViewValidation validation;
  validation.trials = trials;
  return validation;
}

TEST(ValidateTwoView, everyMotionIsJudged) {
  const TwoViewValidationResult result = validateTwoView(small(4));
  EXPECT_EQ(result.choices.size(), 9U);
  EXPECT_EQ(result.rows.size(), 8U) << "no motion has no parameter";
  for (const TwoViewChoice& choice : result.choices) {
    std::size_t sum = 0;
    for (const std::size_t count : choice.chosen) sum += count;
    EXPECT_EQ(sum, 4U);
    EXPECT_TRUE(choice.passed.value_or(false)) << name(choice.truth);
  }
  EXPECT_TRUE(result.average_passed.value_or(false));
  const std::string text = formatTwoViewTables(result);
  EXPECT_NE(text.find("PASSED"), std::string::npos) << text;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 80U) << line;
}

TEST(ValidateTwoView, optionalModelsAreRowsOfTheirOwn) {
  TwoViewValidation validation = small(4);
  validation.motions = {TwoViewMotion::retinal_translation, TwoViewMotion::affine, TwoViewMotion::rotation_zoom};
  const TwoViewValidationResult result = validateTwoView(validation);
  ASSERT_EQ(result.choices.size(), 3U);
  EXPECT_EQ(result.rows.size(), 3U);
  EXPECT_EQ(result.average(), 1) << "of the default lattice's motions alone";
  EXPECT_FALSE(result.average_passed.has_value());
  const std::string text = formatTwoViewTables(result);
  for (const char* line : {"affine                 100.0", "rotation and zoom      100.0"}) {
    EXPECT_NE(text.find(line), std::string::npos) << text;
  }
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 80U) << line;
  TwoViewChoice mistaken = result.choices[1];
  mistaken.chosen[static_cast<std::size_t>(TwoViewMotion::affine)] = 3;
  mistaken.chosen[static_cast<std::size_t>(TwoViewMotion::homography)] = 1;
  TwoViewValidationResult alone;
  alone.choices = {mistaken};
  const std::string others = formatTwoViewTables(alone);
  EXPECT_NE(others.find("75.0  homog 25.0"), std::string::npos) << others;
  EXPECT_EQ(others.find("mean of the diagonal"), std::string::npos) << others;
}

TEST(ValidateTwoView, isTheSameForAnyNumberOfThreads) {
  TwoViewValidation validation = small(6);
  validation.motions = {TwoViewMotion::essential};
  validation.threads = 1;
  const TwoViewValidationResult one = validateTwoView(validation);
  validation.threads = 2;
  const TwoViewValidationResult two = validateTwoView(validation);
  EXPECT_EQ(one.rows[0].report.index, two.rows[0].report.index);
  EXPECT_EQ(one.choices[0].chosen, two.choices[0].chosen);
}

TEST(ValidateTwoView, aFailureIsShown) {
  // Six inliers do not determine a fundamental matrix: the most general model fits what else there is, and its estimate is
  // far off.
  TwoViewValidation validation = small(20);
  validation.motions = {TwoViewMotion::fundamental};
  validation.matches = 60;
  validation.outliers = 0.9;
  TwoViewValidationResult result = validateTwoView(validation);
  EXPECT_FALSE(result.rows[0].passed.value_or(true));
  EXPECT_FALSE(result.average_passed.has_value()) << "an average of one motion is none";
  result.choices[0].passed = false;
  const std::string text = formatTwoViewTables(result);
  EXPECT_NE(text.find("FAILED fundamental: the index is too large"), std::string::npos) << text;
  EXPECT_NE(text.find("FAILED fundamental: chosen in "), std::string::npos) << text;
  EXPECT_EQ(text.find("PASSED"), std::string::npos);
}

TEST(ValidateTwoViewProgram, writesRowsAndAReport) {
  const TemporaryDirectory directory;
  const ProgramResult result = runProgram({LIESTAT_PROGRAM, "validate", "two-view", "--trials", "5", "--motion",
                                           "rotation,translation", "--json", "out.json", "--report", "report"},
                                          directory.path().string());
  ASSERT_EQ(result.status, 0) << result.errors;
  const Json json = Json::parse(contentOf(directory / "out.json"));
  ASSERT_EQ(json["rows"].size(), 2U);
  for (const Json& row : json["rows"]) {
    for (const char* field : {"motion", "trials", "dof", "law", "index", "ks_p", "coverage95", "tail", "passed"}) {
      EXPECT_TRUE(row.contains(field)) << field;
    }
  }
  EXPECT_EQ(json["rows"][0]["motion"], "rotation");
  EXPECT_EQ(json["rows"][0]["dof"], 3);
  EXPECT_EQ(json["choices"][1]["chosen"]["translation"].get<int>(), 5);
  EXPECT_NE(contentOf(directory / "report/index.html").find("</html>"), std::string::npos);
}

TEST(TwoViewRules, anInterruptLeavesTheFirstTrials) {
  TrialsOfRun& run = trials_of_run;
  run.stop = false, run.planned = 0, run.done = 0;
  TwoViewRuleComparison comparison;
  comparison.trials = 40, comparison.matches = 40, comparison.threads = 1;
  // Among the trials of the first motion, a few of which are under way together.
  const std::vector<TwoViewRuleRow> rows =
      compareTwoViewRules(comparison, [&](std::uint64_t, std::uint64_t) { run.stop = true; });
  ASSERT_TRUE(run.incomplete());
  const std::size_t done = run.done;
  EXPECT_EQ(run.planned, 360U);
  EXPECT_GE(done, 8U);
  EXPECT_LT(done, 40U);
  const std::string text = formatTwoViewRules(rows);
  EXPECT_TRUE(text.ends_with(fmt::format("\npartial: {} of 360 trials were done\nINTERRUPTED\n", done))) << text;
  // The same as those of a shorter run, which is stopped after its first motion.
  run.stop = false, comparison.trials = done, comparison.threads = 2;
  const std::vector<TwoViewRuleRow> shorter =
      compareTwoViewRules(comparison, [&](std::uint64_t now, std::uint64_t) { run.stop = now >= done; });
  ASSERT_EQ(rows.size(), shorter.size());
  for (std::size_t r = 0; r < rows.size(); ++r) {
    EXPECT_EQ(rows[r].trials, TwoViewRuleRow::OfMotions{done});
    EXPECT_EQ(rows[r].trials, shorter[r].trials);
    EXPECT_EQ(rows[r].right, shorter[r].right) << rows[r].rule;
    EXPECT_EQ(rows[r].worst(), 0U);
  }
  run.stop = true, run.planned = 0, run.done = 0;
  EXPECT_TRUE(compareTwoViewRules(comparison).empty());
  run.stop = false;
}

TEST(ValidateTwoViewProgram, comparesRules) {
  const TemporaryDirectory directory;
  const ProgramResult result = runProgram(
      {LIESTAT_PROGRAM, "validate", "two-view", "--rules", "--trials", "2", "--json", "out.json", "--report", "report"},
      directory.path().string());
  ASSERT_EQ(result.status, 0) << result.errors;
  const Json json = Json::parse(contentOf(directory / "out.json"));
  ASSERT_EQ(json["rules"].size(), 11U);
  EXPECT_EQ(json["rules"][0]["trials"], 2);
  EXPECT_EQ(json["rules"][0]["right"].size(), 9U);
  EXPECT_FALSE(json.contains("interrupted"));
  const std::string page = contentOf(directory / "report/index.html");
  EXPECT_NE(page.find("✓ The default rule chooses the right model in "), std::string::npos);
  EXPECT_TRUE(std::filesystem::exists(directory / "report/rules.csv"));
}

TEST(ValidateTwoViewProgram, anInterruptLeavesWhatWasCompared) {
  const TemporaryDirectory directory;
  // As in validate_propagation_test.cpp.
  const ProgramResult result =
      runProgram({"env", "--default-signal=INT", "timeout", "--preserve-status", "-s", "INT", "1.5", LIESTAT_PROGRAM,
                  "validate", "two-view", "--rules", "--trials", "100000", "--json", "out.json", "--report", "report"},
                 directory.path().string());
  EXPECT_EQ(result.status, 130) << result.errors;
  EXPECT_NE(result.errors.find("liestat: interrupted"), std::string::npos) << result.errors;
  if (result.errors.find("nothing to write") != std::string::npos) return;
  const Json json = Json::parse(contentOf(directory / "out.json"));
  EXPECT_EQ(json["interrupted"], true);
  EXPECT_EQ(json["trials_planned"], 900000U);
  EXPECT_EQ(json["trials_done"], json["rules"][0]["trials"]);
  EXPECT_NE(contentOf(directory / "report/index.html").find("<p class=\"verdict none\">– INTERRUPTED: partial: "),
            std::string::npos);
}

TEST(ValidateTwoViewProgram, refusesWhatItDoesNotKnow) {
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{"--motion", "dolly"},
                                                    {"--outliers", "1"},
                                                    {"--sigma", "0"},
                                                    {"--matches", "3"},
                                                    {"--trials", "0"}}) {
    std::vector<std::string> command{LIESTAT_PROGRAM, "validate", "two-view"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    const ProgramResult result = runProgram(command, ".");
    EXPECT_EQ(result.status, 2) << arguments[0];
    EXPECT_EQ(std::count(result.errors.begin(), result.errors.end(), '\n'), 1) << result.errors;
  }
}

}  // namespace
}  // namespace liestat::cli
