#pragma once

#include <experiments/judged_report.hpp>
#include <experiments/means_experiment.hpp>
#include <experiments/means_report.hpp>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace liestat::experiments {

/// The rows of `liestat validate means`: the product of the lists.
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

/// The tolerances that docs/validation.md promises of an estimate's covariance: how far the law of the squared
/// distances may be from the reference law. Absent: outside the domain, shown but not judged.
std::optional<ValidationTolerance> promisedTolerance(const MeansExperiment& experiment, const Method& method);

/// One line of the table. There is no promise for the report's formulas.
struct MeansRow : JudgedReport {
  MeansExperiment experiment;
  Method method{};

  /// exp of the mean and standard deviation of the logarithm of the error's ratio to MAHA's.
  double ratio(ErrorRatio of) const;
  double logDeviation(ErrorRatio of) const;

  TrialStatistic rotation_ratio, translation_ratio;  ///< the logarithms
};

/// Runs everything; rows in the order of the lists.
std::vector<MeansRow> validateMeans(const MeansValidation& validation,
                                    const std::function<void(std::uint64_t done, std::uint64_t all)>& progress = {});

}  // namespace liestat::experiments
