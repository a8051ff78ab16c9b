#pragma once

#include <experiments/cell_run.hpp>
#include <experiments/judged_report.hpp>
#include <stats/validation_report.hpp>

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace liestat::experiments {

/// The problems that `liestat validate estimator` gives the constrained estimator (stats/constrained.hpp).
enum class EstimatorExperiment {
  conic,             ///< six coefficients with ‖q‖ = 1 from 30 points on an ellipse
  corrected_points,  ///< the same from 12 points, which are what is looked at
  rotation_numbers,  ///< nine numbers with R Rᵀ = I from 5 pairs of points
  rotation,          ///< the same as a point of SO(3)
  prior_numbers,     ///< nine numbers from 20 pairs and a prior of information 10⁴ I
  prior,             ///< a point of SO(3) from 20 pairs and a prior of information 10⁴ I
  homography,        ///< nine numbers with ‖H‖² = 3 from 60 matches, two equations each
  fundamental        ///< nine numbers with det F = 0 and ‖F‖² = 2 from 60 matches
};
inline constexpr std::array all_estimator_experiments = {
    EstimatorExperiment::conic,      EstimatorExperiment::corrected_points, EstimatorExperiment::rotation_numbers,
    EstimatorExperiment::rotation,   EstimatorExperiment::prior_numbers,    EstimatorExperiment::prior,
    EstimatorExperiment::homography, EstimatorExperiment::fundamental};
/// The name in options, tables and JSON fields.
std::string name(EstimatorExperiment experiment);

/// The quantities that are compared with a law.
enum class EstimatorQuantity {
  criterion,        ///< 2L²: χ² with r degrees of freedom
  parameter,        ///< squared distance of the true parameter under the estimate's covariance
  correction,       ///< squared correction of one measurement over its expectation
  corrected_point,  ///< squared distance of one true measurement under the covariance of the corrected one
};
std::string name(EstimatorQuantity quantity);

struct EstimatorValidation {
  std::vector<EstimatorExperiment> experiments{all_estimator_experiments.begin(), all_estimator_experiments.end()};
  RunSize run{.trials = 2000};  ///< trials of a row
  /// Standard deviation of the noise that is drawn over that which the estimator is told.
  double noise_factor = 1;
};

struct EstimatorRow : JudgedReport {
  EstimatorExperiment experiment = EstimatorExperiment::conic;
  EstimatorQuantity quantity = EstimatorQuantity::criterion;
  double sigma = 0;  ///< that the estimator is told, in the unit of the scene; of matches px
  bool has_iterations = true;
  /// Mean and 95 % coverage of an independent prototype; NaN where it gives none.
  double note_index = std::numeric_limits<double>::quiet_NaN();
  double note_coverage = std::numeric_limits<double>::quiet_NaN();
  /// ‖mean of e eᵀ - mean of the covariances‖ over the norm of the latter, of corrected points; else NaN.
  double covariance_deviation = std::numeric_limits<double>::quiet_NaN();
};

template <class V>
void describe(V& v, const EstimatorRow& row) {
  v("experiment", name(row.experiment))("quantity", name(row.quantity))("sigma", row.sigma, "that is told");
  v("in_domain", row.promise.has_value());
  describeReport(v, row.report);
  v("tail", row.tail)("failures", row.report.failures);
  const auto iterations = [&](auto value) { return row.has_iterations ? std::optional(value) : std::nullopt; };
  v("iterations", iterations(row.report.mean_iterations));
  v("max_iterations", iterations(static_cast<double>(row.report.max_iterations)));
  v("note_index", row.note_index, "of an independent prototype")("note_coverage95", row.note_coverage);
  v("covariance_deviation", row.covariance_deviation)("passed", row.passed);
}

/// Runs everything; rows in the order of the experiments.
std::vector<EstimatorRow> validateEstimator(const EstimatorValidation& validation, const RunProgress& progress = {});

/// The promises on the rows.
Judgement judgementOf(const std::vector<EstimatorRow>& rows);

}  // namespace liestat::experiments
