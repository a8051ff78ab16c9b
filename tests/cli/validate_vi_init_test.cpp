// `liestat validate vi-init`: each check, what it can't pass, the paper's table and figures, and what the program
// writes.

#include <cli/show/vi_init_validation.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <experiments/closed_form_cases.hpp>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <cli/io/run_program.hpp>
#include <cli/temporary_directory.hpp>
#include <experiments/two_solutions.hpp>
#include <cli/show/table1.hpp>
#include <experiments/vi_init_trials.hpp>

namespace liestat::cli {
using namespace experiments;
namespace {

using Json = nlohmann::json;

ViInitValidation small(std::vector<ViInitCheck> checks, std::size_t trials) {
  ViInitValidation validation;
  validation.checks = std::move(checks);
  validation.trials = trials;
  return validation;
}

const ViInitRow& find(const std::vector<ViInitRow>& rows, ViInitEstimator estimator, ViInitQuantity quantity,
                      double window = 2) {
  for (const ViInitRow& row : rows) {
    if (row.estimator == estimator && row.quantity == quantity && row.window.seconds == window) return row;
  }
  throw std::out_of_range("no such row");
}

bool allPassed(const std::vector<ViInitRow>& rows) {
  return std::all_of(rows.begin(), rows.end(), [](const ViInitRow& row) { return row.passed.value_or(true); });
}

TEST(ValidateViInit, eachCheckRunsAndKeepsItsPromises) {
  // Rows a kind of window: 9 of the refinement; 2, and 3 with the bias; 6 of each accuracy; 5; 10.
  const std::pair<ViInitCheck, std::size_t> expected[] = {{ViInitCheck::consistency, 5 * 9},
                                                          {ViInitCheck::closed_form, 3 * 2 + 3 * 3},
                                                          {ViInitCheck::accuracy, 4 * 6},
                                                          {ViInitCheck::gyroscope_bias, 5},
                                                          {ViInitCheck::drift, 10}};
  for (const auto& [check, count] : expected) {
    const auto rows = validateViInit(small({check}, 24));
    EXPECT_EQ(rows.size(), count) << name(check);
    for (const ViInitRow& row : rows) {
      EXPECT_EQ(row.check, check);
      EXPECT_EQ(row.trials, 24U);
      EXPECT_EQ(row.passed.has_value(), row.promise.has_value());
      EXPECT_TRUE(row.passed.value_or(true)) << name(row.quantity) << ": " << reason(row.verdict);
      // Each row has its one kind of number.
      EXPECT_EQ(row.report.has_value() + std::isfinite(row.median) + std::isfinite(row.value), 1)
          << name(row.estimator) << " " << name(row.quantity);
    }
  }
}

TEST(ValidateViInit, whatIsNotPromisedIsNotJudged) {
  const auto rows = validateViInit(small({ViInitCheck::gyroscope_bias, ViInitCheck::drift}, 24));
  EXPECT_FALSE(find(rows, ViInitEstimator::bias_ignored, ViInitQuantity::scale).passed);
  EXPECT_FALSE(find(rows, ViInitEstimator::no_selection, ViInitQuantity::speed).passed);
  // What is estimated or selected is worth it: the factors measured are 20 and 100.
  EXPECT_GT(find(rows, ViInitEstimator::bias_ignored, ViInitQuantity::gravity).median,
            5 * find(rows, ViInitEstimator::bias_estimated, ViInitQuantity::gravity).median);
  EXPECT_GT(find(rows, ViInitEstimator::no_selection, ViInitQuantity::speed).median,
            10 * find(rows, ViInitEstimator::robust, ViInitQuantity::speed).median);
}

TEST(ValidateViInit, noiseThatNobodyToldFails) {
  for (const ViInitCheck check : all_vi_init_checks) {
    ViInitValidation wrong = small({check}, 60);
    wrong.noise = 2;
    wrong.windows = {2};
    const auto rows = validateViInit(wrong);
    EXPECT_FALSE(allPassed(rows)) << name(check);
    if (check == ViInitCheck::consistency) {
      // Four times the variance, of which the priors' part is told right from wrong too.
      const ViInitRow& row = find(rows, ViInitEstimator::refinement, ViInitQuantity::nees_v_g);
      EXPECT_NEAR(row.report->index, 20, 6);
      EXPECT_EQ(*row.passed, false);
    }
    const std::string text = formatViInitTables(rows);
    EXPECT_NE(text.find("\nFAILED\n"), std::string::npos) << text;
    EXPECT_NE(text.find("FAILED " + name(check)), std::string::npos) << text;
  }
}

// What can't be solved has no distance, and errors without bound: nothing of it is dropped.
TEST(ValidateViInit, lostWindowsAreMarked) {
  const ViInitWindow two_images{2, 2, 20};
  CounterRng rng(1);
  const double infinite = std::numeric_limits<double>::infinity();
  const auto expectNone = [](std::initializer_list<double> distances) {
    for (const double distance : distances) EXPECT_TRUE(std::isnan(distance));
  };
  const auto expectLost = [&](const ViErrors& errors) {
    for (const double error : {errors.speed, errors.gravity, errors.scale}) EXPECT_EQ(error, infinite);
  };
  for (const ViInitTrial<ClosedFormOutcome> trial : {closedFormNeesTrial, closedFormBiasNeesTrial}) {
    const ClosedFormOutcome closed = trial(two_images, 1, rng);
    expectNone({closed.nees_v_g, closed.nees_all, closed.chi2.cost, closed.chi2.degrees_of_freedom});
  }
  const RefinementOutcome refined = refinementTrial(two_images, 1, rng);
  expectNone({refined.nees_v, refined.nees_v_g, refined.nees_all, refined.nees_last_state, refined.chi2.cost,
              refined.chi2.degrees_of_freedom});
  expectLost(refined.errors);
  EXPECT_EQ(refined.scale_of_features, infinite);
  const AccuracyOutcome accuracy = closedFormErrorsTrial(two_images, 1, rng);
  expectLost(accuracy.closed_form);
  expectLost(accuracy.least_squares);
  const GyroscopeBiasOutcome gyroscope = gyroscopeBiasTrial(two_images, 1, rng);
  EXPECT_EQ(gyroscope.bias, infinite);
  expectLost(gyroscope.estimated);
  expectLost(gyroscope.ignored);
  const DriftOutcome drift = driftTrial(two_images, 1, rng);
  EXPECT_FALSE(drift.exact_selection);
  expectLost(drift.robust);
  expectLost(drift.oracle);
  expectLost(drift.no_selection);
}

TEST(ValidateViInit, doesNotDependOnThreads) {
  ViInitValidation validation = small({ViInitCheck::accuracy, ViInitCheck::drift}, 20);
  validation.windows = {2};
  validation.threads = 1;
  const auto one = validateViInit(validation);
  validation.threads = 3;
  const auto three = validateViInit(validation);
  ASSERT_EQ(one.size(), three.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    if (std::isfinite(one[i].median)) {
      EXPECT_EQ(one[i].median, three[i].median);
      EXPECT_EQ(one[i].p95, three[i].p95);
    }
  }
}

TEST(ValidateViInit, tablesAreNoWiderThanATerminal) {
  std::istringstream lines(
      formatViInitTables(validateViInit(small({all_vi_init_checks.begin(), all_vi_init_checks.end()}, 4))));
  for (std::string line; std::getline(lines, line);) {
    // Bytes: of the few letters beyond ASCII, some have two and three.
    EXPECT_LE(line.size(), 110U) << line;
  }
}

TEST(Table1, hasEveryCaseOnce) {
  std::multiset<std::string> exact, noisy;
  std::set<char> letters;
  for (const Table1Correction& c : table1Corrections()) letters.insert(c.letter);
  std::set<char> used;
  for (const Table1Entry& entry : table1Entries()) {
    for (const auto& [case_name, corrections] : entry.exact) {
      exact.insert(case_name);
      for (const char letter : std::string(corrections)) used.insert(letter);
    }
    for (const auto& [case_name, corrections] : entry.noisy) {
      noisy.insert(case_name);
      for (const char letter : std::string(corrections)) used.insert(letter);
    }
  }
  EXPECT_EQ(used, letters);
  EXPECT_EQ(exact.size(), closedFormCases().size());
  EXPECT_EQ(noisy.size(), noisyClosedFormCases().size());
  for (const ClosedFormCase& c : closedFormCases()) EXPECT_EQ(exact.count(c.name), 1U) << c.name;
  for (const NoisyClosedFormCase& c : noisyClosedFormCases()) EXPECT_EQ(noisy.count(c.name), 1U) << c.name;
}

TEST(Table1, isRecognisedAsCorrected) {
  const auto rows = recogniseTable1(16, 3, 0);
  EXPECT_EQ(rows.size(), closedFormCases().size() + noisyClosedFormCases().size());
  for (const Table1Row& row : rows) {
    EXPECT_TRUE(*row.passed) << row.name;
    EXPECT_EQ(row.solutions[0] + row.solutions[1] + row.solutions[2], 16U);
    if (!row.noisy) {
      EXPECT_EQ(row.null_right, 16U) << row.name;
    }
  }
  const std::string text = formatTable1(rows);
  EXPECT_NE(text.find("PASSED"), std::string::npos);
  EXPECT_NE(text.find("paper: infinite"), std::string::npos);
  // Where the paper says two, there are scenes with one.
  const auto constant =
      std::find_if(rows.begin(), rows.end(), [](const Table1Row& row) { return row.name == "constant acceleration"; });
  EXPECT_GT(constant->solutions[0], 0U);
  EXPECT_GT(constant->solutions[1], 0U);
}

TEST(Scene, hasTwoSolutions) {
  for (const std::uint64_t seed : {1U, 77U}) {
    const auto first = twoSolutions(1, seed), second = twoSolutions(2, seed);
    ASSERT_TRUE(first && second);
    EXPECT_EQ(first->scene.times.size(), 4U);
    EXPECT_EQ(first->scene.features.size(), 1U);
    EXPECT_EQ(second->scene.times.size(), 7U);
    EXPECT_EQ(second->scene.features.size(), 3U);
    for (const TwoSolutions* found : {&*first, &*second}) {
      EXPECT_EQ(found->result.solutions.size(), 2U);
      const ClosedFormSolution& truth = found->result.solutions[found->truth];
      EXPECT_LE((truth.velocity - found->scene.velocity).norm(), 1e-7);
      // The feature's first bearing is that of both.
      const auto &a = found->result.solutions[0].features[0], &b = found->result.solutions[1].features[0];
      EXPECT_LE(a.cross(b).norm(), 1e-7 * a.norm() * b.norm());
      EXPECT_GT(a.dot(b), 0);
    }
    // All features of the second figure by the same factor.
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(second->result.solutions[1].features[i].norm() / second->result.solutions[0].features[i].norm(),
                  measuredScale(*second), 1e-7);
    }
  }
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
      run({"--table1", "--trials", "8", "--json", "table1.json", "--report", "table1"}, directory.path().string());
  ASSERT_EQ(result.status, 0) << result.errors;
  const Json json = Json::parse(contentOf(directory / "table1.json"));
  ASSERT_EQ(json["rows"].size(), closedFormCases().size() + noisyClosedFormCases().size());
  for (const Json& row : json["rows"]) {
    EXPECT_EQ(row["one_solution"].get<int>() + row["two_solutions"].get<int>() + row["infinite_solutions"].get<int>(),
              8);
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
