// How often something happens in a validation's trials, and the bounds that are promised of it.
#pragma once

#include <experiments/judgement.hpp>
#include <stats/laws.hpp>

#include <fmt/format.h>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat::experiments {

/// A count among trials; it is judged where bounds are promised of its probability.
struct Rate {
  std::string name;
  std::size_t count = 0, of = 0;
  double low = 0, high = 1;  ///< bounds that are promised; 0 and 1: none
  std::optional<bool> passed = {};

  void add(bool happened) { count += happened ? 1U : 0U, ++of; }
  bool promised() const { return (low > 0 || high < 1) && of > 0; }
  double percent() const { return 100.0 * static_cast<double>(count) / static_cast<double>(of); }
  /// Passed, unless the count has less than this probability at the bound that it is beyond.
  void judge(double false_alarm) {
    if (!promised()) return;
    passed = !(high < 1 && binomialSurvival(count, of, high) < false_alarm) &&
             !(low > 0 && binomialSurvival(of - count, of, 1 - low) < false_alarm);
  }
};
template <class V>
void describe(V& v, const Rate& rate) {
  v("rate", rate.name)("count", rate.count)("of", rate.of, "trials")("low", rate.low, "promised");
  v("high", rate.high, "promised")("passed", rate.passed, "null: not judged");
}

/// Judges the rates of all rows, and lists the promises; row.title() names one, row.rates are its rates.
template <class Row>
void judgeRates(std::vector<Row>& rows) {
  double judged = 0;
  for (const Row& row : rows) {
    for (const Rate& rate : row.rates) judged += rate.promised() ? 2 : 0;
  }
  for (Row& row : rows) {
    for (Rate& rate : row.rates) rate.judge(run_false_alarm / judged);
  }
}
template <class Row>
Judgement judgementOfRates(const std::vector<Row>& rows) {
  Judgement judgement;
  for (const Row& row : rows) {
    for (const Rate& rate : row.rates) {
      if (!rate.promised()) continue;
      judgement.promises.push_back({row.title() + ": " + rate.name, rate.passed,
                                    fmt::format("{:.2f} % of {} trials, {:g} to {:g} % are promised", rate.percent(),
                                                rate.of, 100 * rate.low, 100 * rate.high),
                                    0.01 * rate.percent(), rate.high < 1 ? rate.high : rate.low});
    }
  }
  return judgement;
}
/// False if a promise of the row is broken; none without one.
template <class Row>
std::optional<bool> answerOf(const Row& row) {
  std::optional<bool> answer;
  for (const Rate& rate : row.rates) {
    if (rate.passed) answer = answer.value_or(true) && *rate.passed;
  }
  return answer;
}

}  // namespace liestat::experiments
