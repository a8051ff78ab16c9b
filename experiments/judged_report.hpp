// The part that most rows of the program's validations share: a report, what is promised of it, and the verdict.
#pragma once

#include <experiments/judgement.hpp>
#include <stats/validation_report.hpp>

#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

namespace liestat::experiments {

/// The fields of a report in the JSON of a validation; null, but for the trials, without distances.
template <class V>
void describeReport(V& v, const ValidationReport& r, bool has_distances = true) {
  const auto given = [&]<class T>(const T& value) { return has_distances ? std::optional<T>(value) : std::nullopt; };
  v("trials", r.trials)("dof", given(r.dof), "degrees of freedom of the law")("law", given(std::string(r.law.name())));
  v("index", given(r.index), "mean squared Mahalanobis distance of the truth")("index_se", given(r.index_se));
  v("index_expected", given(r.law.mean()))("variance", given(r.variance), "of the distances");
  v("ks_statistic", given(r.ks_statistic), "Kolmogorov-Smirnov distance from the law")("ks_p", given(r.ks_p_value));
  v("coverage95", given(r.coverage[2].observed), "fraction of truths inside the 95 % region");
}

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

  /// All of this, and gives back the memory of the distances: a hundred rows of a million would fill it.
  void conclude(ValidationReport of, const std::optional<ValidationTolerance>& promised, double false_alarm) {
    setReport(std::move(of));
    promise = promised;
    judge(false_alarm);
    report.mu2 = {};
  }

  /// The index over the mean of its law, 1 expected; NaN where the law has none.
  double relativeIndex() const {
    const double expected = report.law.mean();
    return std::isfinite(expected) ? report.index / expected : std::numeric_limits<double>::quiet_NaN();
  }
};

/// The promise of a row as data; `text` names the row.
template <class Row>
Promise promiseAbout(const Row& row, std::string text) {
  return {std::move(text), row.passed, reason(row.verdict)};
}

}  // namespace liestat::experiments
