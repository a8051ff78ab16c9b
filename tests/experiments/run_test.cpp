// The parts of every validation: the executor (the order of the chunks, the same bits for any number of threads,
// exceptions), the cells of a run, the judgement.

#include <experiments/cell_run.hpp>
#include <experiments/judged_report.hpp>
#include <experiments/parallel.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace liestat::experiments {
namespace {

TEST(ProgramExecutor, combinesInTheOrderOfTheChunks) {
  const auto map = [](std::size_t chunk) { return std::to_string(chunk) + " "; };
  const auto append = [](std::string& left, const std::string& right) { left += right; };
  // More chunks than can be under way at the same time.
  for (const std::size_t n_chunks : {0U, 1U, 2U, 3U, 9U, 10U, 1000U}) {
    const std::string expected = SerialExecutor{}.reduce(n_chunks, map, append);
    for (const int threads : {0, 1, 2, 5}) {
      EXPECT_EQ(ProgramExecutor{threads}.reduce(n_chunks, map, append), expected) << n_chunks << ' ' << threads;
    }
  }
}

TEST(ProgramExecutor, givesTheSameBitsOnAnyNumberOfThreads) {
  const auto map = [](std::size_t chunk) { return 1 / (1 + static_cast<double>(chunk)); };
  const auto add = [](double a, double b) { return a + b; };
  const double serial = SerialExecutor{}.reduce(5000, map, add);
  for (const int threads : {0, 1, 3, 8}) EXPECT_EQ(ProgramExecutor{threads}.reduce(5000, map, add), serial);
}

TEST(ProgramExecutor, takesResultsThatCanOnlyBeMoved) {
  const auto sum = ProgramExecutor{3}.reduce(
      100, [](std::size_t chunk) { return std::make_unique<std::size_t>(chunk); },
      [](std::unique_ptr<std::size_t>& left, const std::unique_ptr<std::size_t>& right) { *left += *right; });
  EXPECT_EQ(*sum, 4950U);
}

TEST(ProgramExecutor, letsExceptionsThrough) {
  const auto add = [](int a, int b) { return a + b; };
  for (const int threads : {1, 4}) {
    EXPECT_THROW(ProgramExecutor{threads}.reduce(
                     50,
                     [](std::size_t chunk) {
                       if (chunk == 17) throw std::runtime_error("17");
                       return 1;
                     },
                     add),
                 std::runtime_error);
  }
}

/// No interrupt, before and after.
struct Trials {
  Trials() { reset(); }
  ~Trials() { reset(); }
  static void reset() { trials_of_run.stop = false, trials_of_run.planned = 0, trials_of_run.done = 0; }
};

TrialOutcome chiSquared3(CounterRng& rng) {
  TrialOutcome outcome;
  outcome.mu2 = rng.normalVector<3>().squaredNorm();
  return outcome;
}

TEST(CellRun, TrialsAreTheSameByNumberOnAnyThreads) {
  const Trials reset;
  std::vector<double> all;
  for (const int threads : {1, 3}) {
    CellRun run({.trials = 50, .seed = 7, .threads = threads}, {{50, 1}, {20, 3}}, {});
    const auto reports = run.reports(4, {ReferenceLaw::chiSquared(3)},
                                     [](CounterRng& rng, std::uint64_t) { return std::vector{chiSquared3(rng)}; });
    const auto drawn = run.outcomes([](std::uint64_t number) {
      CounterRng rng(7, number);
      return chiSquared3(rng).mu2;
    });
    ASSERT_EQ(reports[0].trials, 50U);
    ASSERT_EQ(drawn.size(), 20U);
    // The cells have the same draws: trial number i is that of the seed, whatever runs it.
    for (const double x : drawn) EXPECT_EQ(std::count(reports[0].mu2.begin(), reports[0].mu2.end(), x), 1);
    if (all.empty()) all = drawn;
    EXPECT_EQ(drawn, all);
  }
  EXPECT_EQ(trials_of_run.planned, 140U);
  EXPECT_EQ(trials_of_run.done, 140U);
}

TEST(CellRun, ProgressIsThatOfTheWorkAndEndsAtAllOfIt) {
  const Trials reset;
  std::uint64_t last = 0, after_first = 0;
  CellRun run({.threads = 1}, {{10, 1}, {10, 3}}, [&](std::uint64_t done, std::uint64_t all) {
    EXPECT_GE(done, last);
    last = done;
    EXPECT_EQ(all, 1000000U);
  });
  run.outcomes([](std::uint64_t) { return 0; });
  after_first = last;
  run.outcomes([](std::uint64_t) { return 0; });
  EXPECT_EQ(after_first, 250000U);
  EXPECT_EQ(last, 1000000U);
}

TEST(CellRun, AnInterruptLeavesTheFirstTrials) {
  const Trials reset;
  const auto trial = [](std::uint64_t number) {
    trials_of_run.stop = number == 2;
    return number;
  };
  CellRun run({.threads = 1}, {{10, 1}, {10, 1}, {10, 1}}, {});
  EXPECT_EQ(run.outcomes([](std::uint64_t number) { return number; }).size(), 10U);
  const std::vector<std::uint64_t> cut = run.outcomes(trial);
  EXPECT_EQ(cut, (std::vector<std::uint64_t>{0, 1, 2}));
  EXPECT_FALSE(run.ended());
  EXPECT_EQ(trials_of_run.done, 13U);
  EXPECT_TRUE(trials_of_run.incomplete());
  EXPECT_TRUE(run.outcomes(trial).empty());
  EXPECT_TRUE(run.ended());
  EXPECT_EQ(trials_of_run.planned, 30U);

  Trials::reset();
  CellRun whole({.threads = 1}, {{10, 1}}, {});
  EXPECT_TRUE(whole.outcomes(trial, true).empty()) << "all or nothing";
  EXPECT_TRUE(whole.ended());
  EXPECT_EQ(trials_of_run.done, 0U);
}

TEST(Judgement, OneBrokenPromiseFailsTheRun) {
  const Trials reset;
  Judgement judgement{.promises = {{"a", true}, {"b", {}}, {"c", true}}, .where = "with a promise"};
  EXPECT_TRUE(judgement.passed());
  EXPECT_EQ(judgement.verdict().text, "PASSED: 2 of 2 rows with a promise pass; false alarms: one in 100000 runs");
  EXPECT_TRUE(judgement.verdict().isYes());
  EXPECT_EQ(judgement.failures(), "");
  judgement.promises.push_back({"d 2 s", false, "the index is too large"});
  EXPECT_FALSE(judgement.passed());
  EXPECT_TRUE(judgement.verdict().isNo());
  EXPECT_EQ(judgement.failures(), "FAILED d 2 s: the index is too large\n");
  EXPECT_TRUE(judgement.sentence().starts_with("2 of 3 rows")) << judgement.sentence();

  // A run that an interrupt ended is neither passed nor failed.
  trials_of_run.stop = true, trials_of_run.planned = 8, trials_of_run.done = 5;
  EXPECT_FALSE(judgement.passed());
  EXPECT_TRUE(judgement.verdict().isNone());
  EXPECT_EQ(judgement.verdict().text,
            "INTERRUPTED: partial: 5 of 8 trials were done, and 2 of 3 rows with a promise pass so far");
  // One that came after the last trial interrupted nothing.
  trials_of_run.done = 8;
  EXPECT_TRUE(judgement.verdict().isNo());
}

TEST(Judgement, NothingJudgedHasNotPassed) {
  const Trials reset;
  Judgement judgement{.promises = {{"a", {}}}, .where = "in the promised domain"};
  EXPECT_FALSE(judgement.passed());
  EXPECT_EQ(judgement.verdict().text, "FAILED: no row is in the promised domain: nothing was judged");
  // Bounds that the data do not reach are no failure.
  judgement.false_alarm = 0;
  EXPECT_TRUE(judgement.passed());
  EXPECT_TRUE(judgement.verdict().isNone());
  judgement.promises[0].passed = true;
  EXPECT_EQ(judgement.verdict().text, "PASSED: 1 of 1 promises are kept");
}

TEST(JudgedReport, ConcludesWithVerdictHistogramAndTail) {
  const Trials reset;
  CellRun run({.trials = 400, .seed = 1}, {{400, 1}, {400, 1}}, {});
  for (const double factor : {1.0, 1.5}) {
    auto reports = run.reports(16, {ReferenceLaw::chiSquared(3)}, [&](CounterRng& rng, std::uint64_t) {
      TrialOutcome outcome = chiSquared3(rng);
      outcome.mu2 *= factor;
      return std::vector{outcome};
    });
    JudgedReport row;
    row.conclude(std::move(reports[0]), ValidationTolerance{}, run_false_alarm);
    EXPECT_EQ(row.passed, factor == 1);
    EXPECT_EQ(promiseAbout(row, "row").failure, factor == 1 ? "" : reason(ValidationVerdict::index_too_large));
    EXPECT_EQ(row.histogram.size(), 30U);
    EXPECT_TRUE(row.report.mu2.empty());
    EXPECT_NEAR(row.relativeIndex(), factor, 4 * factor * std::sqrt(2. / 3 / 400));
  }
}

}  // namespace
}  // namespace liestat::experiments
