#pragma once

#include <experiments/cell_run.hpp>
#include <experiments/judged_report.hpp>
#include <experiments/propagation_experiment.hpp>

#include <optional>
#include <string>
#include <vector>

namespace liestat::experiments {

/// The rows of `liestat validate propagation`: the product of the lists.
struct PropagationValidation {
  std::vector<Propagated> features{all_propagated.begin(), all_propagated.end()};
  std::vector<Operation> operations{all_operations.begin(), all_operations.end()};
  std::vector<double> spreads{0.01, 0.03, 0.1, 0.2, 0.3, 0.5, 1.0};
  RunSize run{.trials = 20000};  ///< trials of a spread of a feature
};

/// The tolerances that docs/propagation.md promises of a propagated covariance.
struct PropagationPromise {
  double spread = 0;  ///< up to here
  /// Tolerances over the square of the spread.
  double index = 0, ks = 0, tail = 0;

  /// Absent outside the domain.
  std::optional<ValidationTolerance> at(double noise) const;
};
PropagationPromise propagationPromise(Propagated feature, const PropagationMethod& method);

/// One row. The distances themselves are not kept.
struct PropagationRow : JudgedReport {
  PropagationExperiment experiment;
  PropagationMethod method{};
};

template <class V>
void describe(V& v, const PropagationRow& row) {
  v("feature", name(row.experiment.feature))("operation", name(row.method.operation));
  v("order", row.method.fourth_order ? 4 : 1)("in_domain", row.promise.has_value());
  v("spread", row.experiment.spread, "largest standard deviation", "rad, m");
  describeReport(v, row.report);
  v("tail", row.tail)("failures", row.report.failures)("passed", row.passed);
}

/// An index that is off by less is called consistent.
inline constexpr double consistent_deviation = 0.05;

/// The largest of the rows' spreads up to which a method's index is consistent at all of them; none if it is at none.
std::optional<double> consistentUpTo(const std::vector<PropagationRow>& rows, Propagated feature,
                                     const PropagationMethod& method);

/// Runs everything; rows in the order of features, methods and spreads (ascending).
std::vector<PropagationRow> validatePropagation(const PropagationValidation& validation,
                                                const RunProgress& progress = {});

/// The promises on the rows.
Judgement judgementOf(const std::vector<PropagationRow>& rows);

/// compose, or compose 4th for the fourth order.
std::string label(const PropagationMethod& method);

/// The rows of one feature and method, ascending in spread.
std::vector<const PropagationRow*> rowsOf(const std::vector<PropagationRow>& rows, Propagated feature,
                                          const PropagationMethod& method);

}  // namespace liestat::experiments
