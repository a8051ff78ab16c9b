#include <experiments/vi_init_evaluation.hpp>

#include <stats/quantile.hpp>
#include <stats/executor.hpp>
#include <stats/inference.hpp>
#include <stats/validation.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace liestat::experiments {
namespace {

ValidationReport reportOf(const std::vector<double>& distances, int dof) {
  return validate(SerialExecutor{}, {.trials = distances.size()}, ReferenceLaw::chiSquared(dof),
                  [&](CounterRng&, std::uint64_t i) {
                    TrialOutcome outcome;
                    outcome.mu2 = distances[static_cast<std::size_t>(i)];
                    return outcome;
                  });
}

/// True if more windows are beyond a bound than a probability of that explains.
bool exceeds(const std::vector<double>& sorted, double bound, double probability, double false_alarm) {
  const auto beyond = static_cast<std::size_t>(sorted.end() - std::upper_bound(sorted.begin(), sorted.end(), bound));
  return !(binomialSurvival(beyond, sorted.size(), std::min(1., probability)) >= false_alarm);
}

ValidationVerdict judgeErrors(const std::vector<double>& sorted, const ViInitPromise& promise, double false_alarm) {
  const double share = false_alarm / 4, n = static_cast<double>(promise.note_windows);
  if (exceeds(sorted, promise.median, 0.5, share)) return ValidationVerdict::median_too_large;
  if (exceeds(sorted, promise.p95, 0.05, share)) return ValidationVerdict::quantile_too_large;
  // The prototype's figures are those of some windows themselves: four standard errors of their ranks.
  if (exceeds(sorted, promise.note_median, 0.5 + 4 * std::sqrt(0.25 / n), share)) {
    return ValidationVerdict::median_too_large;
  }
  if (exceeds(sorted, promise.note_p95, 0.05 + 4 * std::sqrt(0.05 * 0.95 / n), share)) {
    return ValidationVerdict::quantile_too_large;
  }
  return ValidationVerdict::passed;
}

void evaluateErrors(ViInitRow& row, std::vector<double> values, double false_alarm) {
  std::sort(values.begin(), values.end());
  row.median = quantile(values, 0.5);
  row.p95 = quantile(values, 0.95);
  if (row.promise) row.verdict = judgeErrors(values, *row.promise, false_alarm);
}

void evaluateDistances(ViInitRow& row, const std::vector<double>& values, int dof, double false_alarm) {
  row.report = reportOf(values, dof);
  if (row.promise) row.verdict = row.report->verdict(false_alarm, row.promise->tolerance);
  row.report->mu2 = {};
}

void evaluateChiSquared(ViInitRow& row, const ViInitValues& values, double false_alarm) {
  double cost = 0, all = 0;
  for (std::size_t i = 0; i < values.value.size(); ++i) {
    if (!std::isfinite(values.value[i])) continue;
    cost += values.value[i];
    all += values.dof[i];
  }
  row.value = cost / all;
  row.value_se = std::sqrt(2 / all);
  if (!row.promise) return;
  if (!(chiSquaredSurvival(cost / (1 + row.promise->deviation), all) >= false_alarm / 2)) {
    row.verdict = ValidationVerdict::index_too_large;
  } else if (!(chiSquaredCdf(cost / (1 - row.promise->deviation), all) >= false_alarm / 2)) {
    row.verdict = ValidationVerdict::index_too_small;
  }
}

void evaluateFraction(ViInitRow& row, const std::vector<double>& values, double false_alarm) {
  const double promised = row.promise.value_or(ViInitPromise{}).fraction;
  const auto n = static_cast<double>(values.size());
  const auto exact = static_cast<double>(std::count(values.begin(), values.end(), 1.));
  row.value = exact / n;
  row.value_se = std::sqrt(promised * (1 - promised) / n);
  const std::size_t wrong = values.size() - static_cast<std::size_t>(exact);
  if (row.promise && !(binomialSurvival(wrong, values.size(), 1 - promised) >= false_alarm)) {
    row.verdict = ValidationVerdict::success_too_seldom;
  }
}

}  // namespace

void evaluate(ViInitRow& row, const ViInitValues& values, int dof, double false_alarm) {
  row.trials = values.value.size();
  row.failures = static_cast<std::size_t>(
      std::count_if(values.value.begin(), values.value.end(), [](double x) { return !std::isfinite(x); }));
  switch (statistic(row.quantity)) {
    case ViInitStatistic::distance:
      evaluateDistances(row, values.value, dof, false_alarm);
      break;
    case ViInitStatistic::chi_squared:
      evaluateChiSquared(row, values, false_alarm);
      break;
    case ViInitStatistic::error:
      evaluateErrors(row, values.value, false_alarm);
      break;
    case ViInitStatistic::fraction:
      evaluateFraction(row, values.value, false_alarm);
      break;
  }
  if (row.promise) row.passed = row.verdict == ValidationVerdict::passed;
}

}  // namespace liestat::experiments
