#pragma once

#include <cli/commands/measurements.hpp>
#include <lie/point_group.hpp>
#include <stats/charts.hpp>
#include <stats/mean_summary.hpp>

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>

namespace liestat::cli {

/// A mean, and what its report shows.
struct MeanAnalysis : MeanSummary {
  std::optional<ChartScatter> charts = {};
  /// Rivals and near ties in the two charts, columns; or empty.
  Eigen::MatrixXd rivals_principal = {}, rivals_centred = {};
  std::string symmetry_in_words = {};  ///< of orientations of crystals
};

/// Options of analyseMean().
struct AnalysisOptions {
  bool certify = true;                                  ///< branch and bound where the cheap certificates fail
  std::size_t budget = UniquenessOptions{}.budget;      ///< limit of the search's looks at measurements or bins of them
  int threads = 0;                                      ///< 0: all
  bool charts = false;                                  ///< for a report
  std::function<void(double)> progress = {};            ///< is told which part of that budget is spent
  std::function<bool()> stop = {};                      ///< ends that search once it says true
  RefutedNoise refuted_noise = RefutedNoise::withheld;  ///< what becomes of the file's covariances once refuted
  ResidualNoise weights_are = ResidualNoise::precision;  ///< for a covariance from residuals
  MeanRegion region = MeanRegion::law;                   ///< of a covariance from residuals
  bool birge = false;                                    ///< multiply the covariance by fit_factor
  bool inflate = false;                                  ///< widen the covariance by the dependence of errors on time
  std::optional<PointGroup> symmetry = {};               ///< rotations are orientations of crystals of this group
};

/// Mean, covariance, dispersion and uniqueness of the measurements, with notes. The same bits for any number of
/// threads.
MeanAnalysis analyseMean(const Measurements& measurements, const AnalysisOptions& options);
/// The same without notes.
MeanAnalysis estimateMean(const Measurements& measurements, const AnalysisOptions& options);

}  // namespace liestat::cli
