#pragma once

#include <experiments/cell_run.hpp>
#include <experiments/judged_report.hpp>
#include <stats/validation_report.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace liestat::experiments {

/// The structures that `liestat validate robust` hides among outliers.
enum class RobustStructure {
  conic,      ///< an ellipse, samples of five points, one equation each; 100 points with σ = 0.005
  homography  ///< a plane in two images, samples of four matches, two equations each; 100 matches with σ = 0.5 px
};
inline constexpr std::array all_robust_structures = {RobustStructure::conic, RobustStructure::homography};
std::string name(RobustStructure structure);

/// The scores of stats/robust.hpp.
enum class RobustScore { relevance, truncated_cost, inlier_count, trimmed_quantile };
inline constexpr std::array all_robust_scores = {RobustScore::relevance, RobustScore::truncated_cost,
                                                 RobustScore::inlier_count, RobustScore::trimmed_quantile};
std::string name(RobustScore score);

struct RobustValidation {
  std::vector<RobustStructure> structures{all_robust_structures.begin(), all_robust_structures.end()};
  std::vector<RobustScore> scores{all_robust_scores.begin(), all_robust_scores.end()};
  std::vector<double> outliers{0, 0.3, 0.5, 0.7};  ///< shares of the measurements
  std::size_t measurements = 100;
  RunSize run{.trials = 100};  ///< trials of a row
  double confidence = 0.99;    ///< that one of the draws was of inliers alone: the search's stop rule
  double draw_factor = 1;      ///< so many times the draws that the rule asks for
  bool figures = false;        ///< those of the report, too
  /// Standard deviation of the noise that is drawn over that which the search is told.
  double noise_factor = 1;
};

/// The largest share of outliers at which a row is judged.
inline constexpr double robust_promise = 0.5;

/// Searches for one structure with one score. The distances are the squared ones of the true parameter from the refined
/// estimate, divided by `cut_factor`, of trials in which the structure was found.
struct RobustRow : JudgedReport {
  RobustStructure structure = RobustStructure::conic;
  RobustScore score = RobustScore::relevance;
  double outliers = 0;
  std::size_t trials = 0, found = 0;  ///< found: nine tenths of the inliers and more are inliers of the estimate
  double confidence = 0;              ///< that was asked for
  /// Factor of the distances if inliers' errors are cut at a threshold t, to first order: P(χ²_p < t)/P(χ²_{p+2} < t)
  /// with p equations a measurement.
  double cut_factor = 1;
  std::optional<bool>
      found_passed;        ///< true if so many are likely where each is found with that probability; if judged
  double right = 0;        ///< share of the inliers that the estimate has as inliers
  double wrong = 0;        ///< share of the outliers that it has; NaN without any
  double draws = 0;        ///< mean number of them
  std::size_t needed = 0;  ///< sampleCount() for the true number of inliers

  /// No where fewer structures were found than is likely, else what the distances say.
  std::optional<bool> answer() const { return found_passed.value_or(true) ? passed : std::optional<bool>(false); }
};

/// The thresholds that are found in the errors under the refined estimate, where noise is not known: lengths in standard
/// deviations. Of structures with one equation a measurement.
struct ThresholdRow {
  RobustStructure structure = RobustStructure::conic;
  double outliers = 0;
  std::size_t trials = 0;
  double histogram_found = 0;                    ///< share of the trials in which the histogram had a minimum
  double histogram_mean = 0, histogram_sd = 0;   ///< mean and standard deviation of √threshold in these
  double moments_found = 0;                      ///< share of the trials with a root
  double moments_median = 0, moments_tenth = 0;  ///< median and tenth of √T; 4.42 expected
};

template <class V>
void describe(V& v, const RobustRow& row) {
  v("structure", name(row.structure))("score", name(row.score))("outliers", row.outliers, "share");
  describeReport(v, row.report);
  v("cut_factor", row.cut_factor, "of the distances, as inliers' errors are cut")("tail", row.tail);
  v("in_domain", row.promise.has_value())("found", row.found, "trials")("confidence", row.confidence);
  v("found_passed", row.found_passed)("inliers_right", row.right)("outliers_wrong", row.wrong);
  v("draws", row.draws)("draws_needed", row.needed)("passed", row.passed);
}
template <class V>
void describe(V& v, const ThresholdRow& row) {
  v("structure", name(row.structure))("outliers", row.outliers, "share")("trials", row.trials);
  v("histogram_found", row.histogram_found)("histogram_mean", row.histogram_mean)("histogram_sd", row.histogram_sd);
  v("moments_found", row.moments_found)("moments_median", row.moments_median)("moments_tenth", row.moments_tenth);
}

/// The biases of a score on Stewart's distribution, fig. 8 of the report, over samples of 1000.
struct StewartRow {
  double e0 = 0, e1 = 1, delta = 0;  ///< shares of outliers, and of the first mode among the others; distance of modes
  std::string score;
  int printed = 0;                 ///< the report's figure
  double mean = 0, deviation = 0;  ///< of the biases
};
/// A curve of a figure.
struct FigureCurve {
  std::string name;
  std::vector<double> x, y;
};
/// Figures 7, 8, 9 and 18 of Viéville, Lingrand and Gaspard 2000.
struct VievilleFigures {
  std::vector<FigureCurve> densities;  ///< 7: of errors |x - v| under Stewart's distribution, v its values
  std::vector<StewartRow> biases;      ///< 8
  std::vector<FigureCurve> relevance;  ///< 9: the best one over the draws of searches, of a conic among outliers
  std::vector<FigureCurve> phi;        ///< 18: Φ_P(d' + 1, d'), by P
};
/// Computes all but 9, which are a validation's searches.
VievilleFigures vievilleFigures(std::uint64_t seed);

struct RobustValidationResult {
  std::vector<RobustRow> rows;
  std::vector<ThresholdRow> thresholds;
  VievilleFigures figures = {};
};
template <class V>
void describe(V& v, const RobustValidationResult& result) {
  v("rows", result.rows)("thresholds", result.thresholds);
}

/// Runs everything; rows in the order of structures, outliers, scores.
RobustValidationResult validateRobust(const RobustValidation& validation, const RunProgress& progress = {});

/// The promises on the rows: whether enough structures were found, and the distances.
Judgement judgementOf(const RobustValidationResult& result);

}  // namespace liestat::experiments
