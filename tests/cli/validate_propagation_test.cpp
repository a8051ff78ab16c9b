// `liestat validate propagation`: what is run, what is judged, and what the program writes.

#include <experiments/propagation_validation.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include <cli/show/plots.hpp>
#include <cli/temporary_directory.hpp>

namespace liestat::cli {
using namespace experiments;
namespace {

using Json = nlohmann::json;

PropagationValidation small(std::size_t trials) {
  PropagationValidation validation;
  validation.trials = trials;
  return validation;
}

const PropagationRow& find(const std::vector<PropagationRow>& rows, Propagated feature, Operation operation,
                           bool fourth_order, double spread) {
  for (const PropagationRow* row : rowsOf(rows, feature, {operation, fourth_order})) {
    if (row->experiment.spread == spread) return *row;
  }
  throw std::out_of_range("no such row");
}

TEST(ValidatePropagation, everyRowIsRunAndPromisesAreJudged) {
  PropagationValidation validation = small(400);
  validation.spreads = {1.0, 0.1, 0.1};
  const std::vector<PropagationRow> rows = validatePropagation(validation);
  ASSERT_EQ(rows.size(), all_propagated.size() * propagation_methods.size() * 2) << "a spread is run once";
  for (const PropagationRow& row : rows) {
    EXPECT_EQ(row.report.trials, 400U);
    EXPECT_EQ(row.report.failures, 0U);
    EXPECT_EQ(row.report.dof, degreesOfFreedom(row.experiment.feature, row.method.operation));
    EXPECT_EQ(row.passed.has_value(), row.experiment.spread == 0.1);
    EXPECT_TRUE(row.passed.value_or(true)) << row.reason;
    EXPECT_EQ(row.histogram.size(), 30U);
  }
}

TEST(ValidatePropagation, anyNumberOfTrialsPasses) {
  for (const std::size_t trials : {1U, 3U, 10U, 100U}) {
    const std::string text = formatPropagationTables(validatePropagation(small(trials)));
    EXPECT_EQ(text.find("FAILED"), std::string::npos) << text;
  }
}

TEST(ValidatePropagation, firstOrderEndsSomewhere) {
  // With 4000 trials the standard error of the index of a pose is 0.9 % of it; what is asked for is seven of them away.
  PropagationValidation validation = small(4000);
  validation.features = {Propagated::pose};
  validation.spreads = {0.01, 1.0};
  const std::vector<PropagationRow> rows = validatePropagation(validation);
  const auto index = [&](Operation operation, bool fourth_order, double spread) {
    return find(rows, Propagated::pose, operation, fourth_order, spread).relativeIndex();
  };
  EXPECT_NEAR(index(Operation::compose, false, 0.01), 1, 0.045);
  EXPECT_GT(index(Operation::compose, false, 1.0), 1.15);
  EXPECT_LT(std::abs(index(Operation::compose, true, 1.0) - 1), 0.06) << "the fourth order goes further";
  EXPECT_NEAR(index(Operation::inverse, false, 1.0), 1, 0.06) << "the inverse is exact";
  EXPECT_EQ(consistentUpTo(rows, Propagated::pose, {Operation::compose, false}), 0.01);
  EXPECT_EQ(consistentUpTo(rows, Propagated::pose, {Operation::inverse, false}), 1.0);
  EXPECT_EQ(consistentUpTo(rows, Propagated::rotation, {Operation::inverse, false}), std::nullopt) << "was not run";
}

TEST(ValidatePropagation, aBrokenPromiseIsSeen) {
  // Judged at the largest spread by what is promised at the largest promised.
  PropagationExperiment experiment{.feature = Propagated::pose, .spread = 1.0, .trials = 2000};
  const auto reports = run(experiment, 1);
  for (std::size_t m = 0; m < experiment.methods.size(); ++m) {
    const Operation operation = experiment.methods[m].operation;
    // The inverse is exact, the fourth order still right, and so many trials do not refute a point moved by a pose.
    if (operation == Operation::inverse || operation == Operation::act || experiment.methods[m].fourth_order) continue;
    const PropagationPromise promise = propagationPromise(experiment.feature, experiment.methods[m]);
    EXPECT_FALSE(reports[m].passed(propagation_false_alarm, *promise.at(promise.spread)))
        << label(experiment.methods[m]);
  }

  PropagationRow row;
  row.experiment = experiment;
  row.method = experiment.methods[0];
  row.report = reports[0];
  row.passed = false;
  row.reason = "the index is too large";
  const std::string text = formatPropagationTables({row});
  EXPECT_NE(text.find("FAILED pose compose spread 1: the index is too large"), std::string::npos) << text;
  EXPECT_NE(text.find(" !\n"), std::string::npos) << text;
}

TEST(ValidatePropagation, tablesAreNoWiderThanATerminal) {
  std::istringstream lines(formatPropagationTables(validatePropagation(small(50))));
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 80U) << line;
}

TEST(ValidatePropagation, anOperationsDrawsAreItsOwn) {
  PropagationValidation validation = small(100);
  validation.spreads = {0.1};
  const std::vector<PropagationRow> all = validatePropagation(validation);
  validation.operations = {Operation::act};
  validation.threads = 1;
  for (const PropagationRow& row : validatePropagation(validation)) {
    EXPECT_EQ(row.report.index, find(all, row.experiment.feature, Operation::act, false, 0.1).report.index)
        << "whatever else is run, on any number of threads";
  }
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
