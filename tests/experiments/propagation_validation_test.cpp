// The simulated propagation of covariances: what is run, what is judged.

#include <experiments/propagation_validation.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <vector>

namespace liestat::experiments {
namespace {

PropagationValidation small(std::size_t trials) {
  PropagationValidation validation;
  validation.run.trials = trials;
  return validation;
}

const PropagationRow& find(const std::vector<PropagationRow>& rows, Propagated feature, Operation operation,
                           bool fourth_order, double spread) {
  for (const PropagationRow* row : rowsOf(rows, feature, {operation, fourth_order})) {
    if (row->experiment.spread == spread) return *row;
  }
  throw std::out_of_range("no such row");
}

TEST(PropagationValidation, everyRowIsRunAndPromisesAreJudged) {
  PropagationValidation validation = small(400);
  validation.spreads = {1.0, 0.1, 0.1};
  const std::vector<PropagationRow> rows = validatePropagation(validation);
  ASSERT_EQ(rows.size(), all_propagated.size() * propagation_methods.size() * 2) << "a spread is run once";
  for (const PropagationRow& row : rows) {
    EXPECT_EQ(row.report.trials, 400U);
    EXPECT_EQ(row.report.failures, 0U);
    EXPECT_EQ(row.report.dof, degreesOfFreedom(row.experiment.feature, row.method.operation));
    EXPECT_EQ(row.passed.has_value(), row.experiment.spread == 0.1);
    EXPECT_TRUE(row.passed.value_or(true)) << name(row.verdict);
    EXPECT_EQ(row.histogram.size(), 30U);
  }
}

TEST(PropagationValidation, firstOrderEndsSomewhere) {
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

TEST(PropagationValidation, anOperationsDrawsAreItsOwn) {
  PropagationValidation validation = small(100);
  validation.spreads = {0.1};
  const std::vector<PropagationRow> all = validatePropagation(validation);
  validation.operations = {Operation::act};
  validation.run.threads = 1;
  for (const PropagationRow& row : validatePropagation(validation)) {
    EXPECT_EQ(row.report.index, find(all, row.experiment.feature, Operation::act, false, 0.1).report.index)
        << "whatever else is run, on any number of threads";
  }
}

TEST(PropagationValidation, aBrokenPromiseIsSeen) {
  // Judged at the largest spread by what is promised at the largest promised.
  const PropagationExperiment experiment{.feature = Propagated::pose, .spread = 1.0};
  std::vector<ReferenceLaw> laws;
  for (const PropagationMethod& method : experiment.methods) {
    laws.push_back(ReferenceLaw::chiSquared(degreesOfFreedom(experiment.feature, method.operation)));
  }
  CellRun run({.threads = 1}, {{2000, 1}}, {});
  const auto reports =
      run.reports(256, laws, [&](CounterRng& rng, std::uint64_t) { return propagationTrial(experiment, rng); });
  for (std::size_t m = 0; m < experiment.methods.size(); ++m) {
    const Operation operation = experiment.methods[m].operation;
    // The inverse is exact, the fourth order still right, and so many trials do not refute a point moved by a pose.
    if (operation == Operation::inverse || operation == Operation::act || experiment.methods[m].fourth_order) continue;
    const PropagationPromise promise = propagationPromise(experiment.feature, experiment.methods[m]);
    EXPECT_FALSE(reports[m].passed(run_false_alarm, *promise.at(promise.spread))) << label(experiment.methods[m]);
  }
}

}  // namespace
}  // namespace liestat::experiments
