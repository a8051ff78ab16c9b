#pragma once

#include <experiments/cell_run.hpp>
#include <experiments/judged_report.hpp>
#include <experiments/means_experiment.hpp>
#include <experiments/means_report.hpp>
#include <experiments/means_verdicts.hpp>

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
  RunSize run{.trials = 1000};  ///< trials of a row
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

template <class V>
void describe(V& v, const MeansRow& row) {
  const MeansExperiment& e = row.experiment;
  const bool frame = info(e.feature).frameMatters() && row.method.criterion == Criterion::maha;
  v("feature", name(e.feature))("noise", name(e.noise))("criterion", name(row.method.criterion));
  v("covariance_at", frame ? std::optional(std::string(name(e.covariance_at))) : std::nullopt);
  v("formula", row.method.corrected ? "corrected" : "printed")("known_noise", row.method.known_noise);
  v("in_domain", row.promise.has_value())("n", e.n)("spread", e.spread, "over the report's");
  describeReport(v, row.report);
  v("tail", row.tail)("iterations", row.report.mean_iterations)("failures", row.report.failures);
  v("ratio_rotation", row.ratio(log_ratio_rotation), "of the error to that of MAHA, geometric mean");
  v("ratio_rotation_logsd", row.logDeviation(log_ratio_rotation));
  v("ratio_translation", row.ratio(log_ratio_translation));
  v("ratio_translation_logsd", row.logDeviation(log_ratio_translation))("passed", row.passed);
}

struct MeansValidationResult {
  std::vector<MeansRow> rows;        ///< in the order of the lists
  std::vector<VerdictRow> verdicts;  ///< certifiedMean's
};
template <class V>
void describe(V& v, const MeansValidationResult& result) {
  v("rows", result.rows)("verdicts", result.verdicts);
}

/// Runs everything; rows in the order of the lists.
std::vector<MeansRow> validateMeans(const MeansValidation& validation, const RunProgress& progress = {});

/// The promises on the rows and on the verdicts.
Judgement judgementOf(const MeansValidationResult& result);

}  // namespace liestat::experiments
