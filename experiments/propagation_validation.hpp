#pragma once

#include <experiments/propagation_experiment.hpp>
#include <stats/validation.hpp>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace liestat::experiments {

/// What `liestat validate propagation` runs: the product of the lists.
struct PropagationValidation {
  std::vector<Propagated> features{all_propagated.begin(), all_propagated.end()};
  std::vector<Operation> operations{all_operations.begin(), all_operations.end()};
  std::vector<double> spreads{0.01, 0.03, 0.1, 0.2, 0.3, 0.5, 1.0};
  std::size_t trials = 20000;
  std::uint64_t seed = 1;
  int threads = 0;
};

/// What the documentation promises of a propagated covariance (docs/propagation.md).
struct PropagationPromise {
  double spread = 0;  ///< up to here
  /// Tolerances over the square of the spread.
  double index = 0, ks = 0, tail = 0;

  /// Absent outside the domain.
  std::optional<ValidationTolerance> at(double noise) const;
};
PropagationPromise propagationPromise(Propagated feature, const PropagationMethod& method);

/// One line of the JSON. The distances themselves are not kept.
struct PropagationRow {
  PropagationExperiment experiment;
  PropagationMethod method{};
  ValidationReport report;
  std::vector<HistogramBin> histogram;
  double tail = 0;                             ///< fraction of distances beyond the law's 99.9 % quantile
  std::optional<ValidationTolerance> promise;  ///< absent outside the domain
  std::optional<bool> passed;                  ///< the verdict, where there is a promise
  std::string reason;                          ///< why it failed

  /// The index over its expectation.
  double relativeIndex() const { return report.index / report.law.mean(); }
};

/// False-alarm probability of a whole run, shared by the rows that are judged.
inline constexpr double propagation_false_alarm = 1e-5;

/// An index that is off by less is called consistent.
inline constexpr double consistent_deviation = 0.05;

/// The largest of the rows' spreads up to which a method's index is consistent at all of them; none if it is at none.
std::optional<double> consistentUpTo(const std::vector<PropagationRow>& rows, Propagated feature,
                                     const PropagationMethod& method);

/// Runs everything; rows in the order of features, methods and spreads (ascending).
std::vector<PropagationRow> validatePropagation(
    const PropagationValidation& validation,
    const std::function<void(std::uint64_t done, std::uint64_t all)>& progress = {});

/// The tables for the terminal, the verdict last.
std::string formatPropagationTables(const std::vector<PropagationRow>& rows);

/// The report's page.
void writePropagationReport(const std::string& directory, const std::string& command_line,
                            const std::vector<PropagationRow>& rows);

/// compose, or compose 4th for the fourth order.
std::string label(const PropagationMethod& method);

/// The rows of one feature and method, ascending in spread.
std::vector<const PropagationRow*> rowsOf(const std::vector<PropagationRow>& rows, Propagated feature,
                                          const PropagationMethod& method);

}  // namespace liestat::experiments
