// The parts that the program's validations share: a report, what is promised of it, and the verdict.
#pragma once

#include <stats/validation_report.hpp>

#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

namespace liestat::experiments {

/// False-alarm probability of a whole run, shared evenly by the rows that are judged.
inline constexpr double run_false_alarm = 1e-5;

/// The squared distances of one estimator in one experiment against their law, and the verdict on them. A row of a
/// validation is one of these and the experiment that it is about.
struct JudgedReport {
  ValidationReport report;
  std::optional<ValidationTolerance> promise;  ///< absent outside the domain of the documentation: shown, not judged
  std::optional<bool> passed;                  ///< true if it keeps its promise; absent without one
  ValidationVerdict verdict = ValidationVerdict::passed;  ///< the same with the reason
  std::vector<HistogramBin> histogram;                    ///< squared distances, with the law's density
  double tail = 0;                                        ///< fraction of distances beyond the law's 99.9 % quantile

  /// Takes the report over, with its histogram and tail; the verdict is left open.
  void setReport(ValidationReport of) {
    report = std::move(of);
    histogram = report.histogram(30);
    tail = static_cast<double>(report.tailCount()) / static_cast<double>(report.size());
  }

  /// The verdict, where there is a promise, at this probability of a false alarm. It needs the distances.
  void judge(double false_alarm) {
    if (!promise) return;
    verdict = report.verdict(false_alarm, *promise);
    passed = verdict == ValidationVerdict::passed;
  }

  /// Gives back the memory of the distances: a hundred rows of a million would fill it.
  void forgetDistances() { report.mu2 = {}; }

  /// The index over the mean of its law, 1 expected; NaN where the law has none.
  double relativeIndex() const {
    const double expected = report.law.mean();
    return std::isfinite(expected) ? report.index / expected : std::numeric_limits<double>::quiet_NaN();
  }
};

/// How many rows were judged, and how many of these failed.
struct Tally {
  std::size_t judged = 0, failed = 0;
  /// A run in which nothing was judged has not passed.
  bool passed() const { return judged > 0 && failed == 0; }
  Tally operator+(const Tally& other) const { return {judged + other.judged, failed + other.failed}; }
};
template <class Row>
Tally tally(const std::vector<Row>& rows) {
  Tally count;
  for (const Row& row : rows) {
    count.judged += row.passed.has_value();
    count.failed += !row.passed.value_or(true);
  }
  return count;
}

}  // namespace liestat::experiments
