// `liestat validate propagation`: its tables, and what the program writes.

#include <cli/show/propagation_validation.hpp>
#include <experiments/interruption.hpp>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
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

PropagationValidation small(std::size_t trials) {
  PropagationValidation validation;
  validation.trials = trials;
  return validation;
}

TEST(ValidatePropagation, anyNumberOfTrialsPasses) {
  for (const std::size_t trials : {1U, 3U, 10U, 100U}) {
    const std::string text = formatPropagationTables(validatePropagation(small(trials)));
    EXPECT_EQ(text.find("FAILED"), std::string::npos) << text;
  }
}

TEST(ValidatePropagation, aFailureIsShown) {
  const PropagationExperiment experiment{.feature = Propagated::pose, .spread = 1.0, .trials = 200};
  const auto reports = run(experiment, 1);
  PropagationRow row;
  row.experiment = experiment;
  row.method = experiment.methods[0];
  row.setReport(reports[0]);
  row.passed = false;
  row.verdict = ValidationVerdict::index_too_large;
  const std::string text = formatPropagationTables({row});
  EXPECT_NE(text.find("FAILED pose compose spread 1: the index is too large"), std::string::npos) << text;
  EXPECT_NE(text.find(" !\n"), std::string::npos) << text;
}

TEST(ValidatePropagation, tablesAreNoWiderThanATerminal) {
  std::istringstream lines(formatPropagationTables(validatePropagation(small(50))));
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 80U) << line;
}

TEST(ValidatePropagation, aRunThatIsStoppedIsPartial) {
  TrialsOfRun& run = trials_of_run;
  run.stop = false, run.planned = 0, run.done = 0;
  PropagationValidation validation = small(20000);
  validation.features = {Propagated::rotation};
  validation.spreads = {0.01, 0.1};
  const std::vector<PropagationRow> rows = validatePropagation(validation, [&](std::uint64_t done, std::uint64_t all) {
    if (4 * done > 3 * all) run.stop = true;
  });
  ASSERT_TRUE(run.incomplete());
  EXPECT_EQ(run.planned, 40000U);
  EXPECT_GT(run.done, 30000U);
  const std::string text = formatPropagationTables(rows);
  const std::string last = fmt::format(
      "partial: {} of 40000 trials were done, and 14 of 14 rows in the promised domain "
      "pass so far\nINTERRUPTED\n",
      run.done.load());
  EXPECT_TRUE(text.ends_with(last)) << text;
  for (const PropagationRow& row : rows) {
    EXPECT_EQ(row.report.trials, row.experiment.spread == 0.01 ? 20000 : run.done - 20000);
  }
  // The trials that were done are the first ones of the whole run.
  run.stop = false;
  validation.trials = rows.back().report.trials;
  const std::vector<PropagationRow> shorter = validatePropagation(validation);
  EXPECT_EQ(shorter.back().report.index, rows.back().report.index);

  // Without a trial there is no row.
  run.stop = true, run.planned = 0, run.done = 0;
  EXPECT_TRUE(validatePropagation(validation).empty());
  EXPECT_EQ(run.done, 0U);
  run.stop = false;
}

TEST(ValidatePropagationProgram, anInterruptLeavesWhatWasComputed) {
  const TemporaryDirectory directory;
  // timeout sends it; hours are left. A run that takes longer to begin says that it computed nothing. Where the tests run
  // in the background interrupts are ignored, and the program would heed that.
  const ProgramResult result = runProgram({"env",         "--default-signal=INT",
                                           "timeout",     "--preserve-status",
                                           "-s",          "INT",
                                           "1.5",         LIESTAT_PROGRAM,
                                           "validate",    "propagation",
                                           "--trials",    "100000000",
                                           "--feature",   "rotation",
                                           "--operation", "inverse",
                                           "--json",      "out.json",
                                           "--report",    "report"},
                                          directory.path().string());
  EXPECT_EQ(result.status, 130) << result.errors;
  EXPECT_NE(result.errors.find("liestat: interrupted"), std::string::npos) << result.errors;
  if (result.errors.find("nothing to write") != std::string::npos) return;
  const Json json = Json::parse(contentOf(directory / "out.json"));
  EXPECT_EQ(json["passed"], false);
  EXPECT_EQ(json["interrupted"], true);
  EXPECT_EQ(json["trials_planned"], 700000000U);
  EXPECT_EQ(json["trials_done"], json["rows"][0]["trials"]);
  EXPECT_EQ(json["rows"].size(), 1U);
  EXPECT_NE(contentOf(directory / "report/index.html").find("<p class=\"verdict none\">– INTERRUPTED: partial: "),
            std::string::npos);
}

TEST(ValidatePropagationProgram, writesRowsAndAReport) {
  const TemporaryDirectory directory;
  const ProgramResult result =
      runProgram({LIESTAT_PROGRAM, "validate", "propagation", "--trials", "200", "--spread", "0.05,1", "--feature",
                  "pose", "--operation", "compose,act", "--json", "out.json", "--report", "report"},
                 directory.path().string());
  ASSERT_EQ(result.status, 0) << result.errors;
  const Json json = Json::parse(contentOf(directory / "out.json"));
  ASSERT_EQ(json["rows"].size(), 6U) << "compose to first and to fourth order and act, at two spreads";
  for (const Json& row : json["rows"]) {
    for (const char* field :
         {"feature", "operation", "order", "in_domain", "spread", "trials", "dof", "law", "index", "index_se",
          "index_expected", "variance", "ks_statistic", "ks_p", "coverage95", "tail", "failures", "passed"}) {
      EXPECT_TRUE(row.contains(field)) << field;
    }
    EXPECT_EQ(row["passed"].is_null(), row["spread"] == 1.0);
    EXPECT_EQ(row["law"], "chi2");
    EXPECT_EQ(row["index_expected"], row["operation"] == "act" ? 3 : 6);
  }
  EXPECT_EQ(json["seed"], 1);
  EXPECT_NE(contentOf(directory / "report/index.html").find("</html>"), std::string::npos);
  EXPECT_TRUE(std::filesystem::exists(directory / "report/pose_over_noise.csv"));
}

TEST(ValidatePropagationProgram, refusesWhatItDoesNotKnow) {
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{"--feature", "line"},
                                                    {"--operation", "divide"},
                                                    {"--spread", "0"},
                                                    {"--trials", "0"}}) {
    std::vector<std::string> command{LIESTAT_PROGRAM, "validate", "propagation"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    const ProgramResult result = runProgram(command, ".");
    EXPECT_EQ(result.status, 2) << arguments[0];
    EXPECT_EQ(std::count(result.errors.begin(), result.errors.end(), '\n'), 1) << result.errors;
  }
}

}  // namespace
}  // namespace liestat::cli
