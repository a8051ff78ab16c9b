#pragma once

#include <experiments/means_experiment.hpp>
#include <stats/validation.hpp>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace liestat::experiments {

/// What `liestat validate means` runs: the product of the lists.
struct MeansValidation {
  std::vector<Feature> features{all_features.begin(), all_features.end()};
  std::vector<Noise> noises{all_noises.begin(), all_noises.end()};
  std::vector<Criterion> criteria{all_criteria.begin(), all_criteria.end()};
  std::vector<std::size_t> n{5, 10, 20, 30, 50, 100};
  /// Empty: the report's spread for points, rotations and directions, a third of it for frames.
  std::vector<double> spreads;
  CovarianceAt covariance_at = CovarianceAt::estimated;
  std::size_t trials = 1000;
  std::uint64_t seed = 1;
  int threads = 0;
  bool certify = false;
  /// Every trial also for the report's MAHA on frames, which takes most of the time; else one in ten.
  bool all_printed = false;
};

/// What the documentation promises of an estimate's covariance (docs/validation.md): how far the law of the squared
/// distances may be from the reference law. Absent: outside the domain, shown but not judged.
std::optional<ValidationTolerance> promisedTolerance(const MeansExperiment& experiment, const Method& method);

/// One line of the table.
struct MeansRow {
  MeansExperiment experiment;
  Method method;
  ValidationReport report;
  std::optional<ValidationTolerance> promise;  ///< absent for the report's formulas, too
  std::optional<bool> passed;                  ///< the verdict, where there is a promise

  /// The index over the mean of its law; NaN where the law has none.
  double relativeIndex() const;
  /// exp of the mean and deviation of the logarithm of the error's ratio to MAHA's.
  double ratio(ExtraIndex index) const;
  double logDeviation(ExtraIndex index) const;
};

/// False-alarm probability of a whole run, shared by the rows that are judged.
inline constexpr double run_false_alarm = 1e-5;

/// Runs everything; rows in the order of the lists.
std::vector<MeansRow> validateMeans(const MeansValidation& validation,
                                    const std::function<void(std::uint64_t done, std::uint64_t all)>& progress = {});

/// The tables for the terminal, the verdict last.
std::string formatMeansTables(const std::vector<MeansRow>& rows);

/// The report's page.
void writeMeansReport(const std::string& directory, const std::string& command_line, const std::vector<MeansRow>& rows);

}  // namespace liestat::experiments
