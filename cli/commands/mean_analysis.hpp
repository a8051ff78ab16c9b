#pragma once

#include <cli/io/feature_values.hpp>
#include <cli/io/measurements.hpp>
#include <stats/charts.hpp>
#include <stats/status.hpp>
#include <stats/uniqueness_types.hpp>

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {

/// The measurement farthest from the mean in one part of the tangent vector.
struct LargestResidual {
  double value = 0;  ///< rad or m
  std::size_t line = 0;
};

/// Rows with times: do halves made of blocks of time agree as well as the covariance says (stats/split_validation.hpp)?
struct TimeBlocks {
  std::size_t blocks = 0, splits = 0;
  double factor = 1, low = 1, high = 1;  ///< of the squared distances to what is expected, with its 95 % interval
  double p = 1;                          ///< probability of so large a factor, if rows are independent
  bool applied = false;                  ///< the covariance was multiplied by the factor, where it is above one
};

/// Below this p the errors of successive rows are called dependent.
inline constexpr double dependent_rows = 1e-3;

/// Another feature that the measurements do not exclude, and by how many standard deviations it is the worse.
struct NearRival {
  FeatureValue feature;
  double z = 0;
};

/// All that is known about a mean.
struct MeanAnalysis {
  FeatureValue mean;
  std::size_t n = 0;  ///< measurements that count: those of weight zero do not
  /// The status of the mean with its covariance: not_applicable if there is a mean but no covariance can be computed.
  Status status = Status::ok;
  std::string reason = {};  ///< in words, where status is not ok
  bool converged = false;
  int iterations = 0;
  double residual = 0;  ///< norm of the last step
  double tolerance = 0;

  Eigen::MatrixXd covariance;  ///< in the local frame at the mean, rad and m; empty if there is none
  Status covariance_status = Status::ok;
  std::string covariance_from = {};                               ///< residuals or noise
  Eigen::MatrixXd dispersion;                                     ///< the measurements' covariance about the mean
  std::vector<LargestResidual> largest = {};                      ///< one for each part of the tangent vector
  std::optional<Eigen::Matrix<double, 3, 2>> tangent_basis = {};  ///< directions: the axes of the coordinates

  Uniqueness unique = Uniqueness::not_certified;
  std::string proof = {};  ///< in words
  std::vector<FeatureValue> rivals = {};
  bool more_rivals = false;  ///< these are not all
  double r_star = 0;
  std::size_t cells = 0;
  std::vector<NearRival> near_ties = {};
  double cut_locus_mass = 0;  ///< fraction of the measurements near the cut locus of the mean
  /// By how much the Hessian averaged over the confidence region is lower than at the mean, relative.
  double hessian_change = 0;

  /// Sum of the measurements' squared Mahalanobis distances, where their noise is known, and what is expected.
  double fit = 0;
  double fit_dof = 0;  ///< 0: there is none
  double fit_p = 1;    ///< probability of so large a sum

  std::optional<TimeBlocks> time_blocks = {};  ///< rows with times that can be split
  std::optional<ChartScatter> charts = {};
  Eigen::MatrixXd rivals_principal, rivals_centred;  ///< rivals and near ties in the two charts, columns; or empty
  std::vector<std::string> notes = {};
};

/// Options of analyseMean().
struct AnalysisOptions {
  bool certify = true;                              ///< branch and bound where the cheap certificates fail
  std::size_t budget = UniquenessOptions{}.budget;  ///< of its looks at measurements or bins of them
  int threads = 0;                                  ///< 0: all
  bool charts = false;                              ///< for a report
  std::function<void(double)> progress = {};        ///< is told which part of that budget is spent
  std::function<bool()> stop = {};                  ///< ends that search once it says true
  bool inflate = false;                             ///< multiply the covariance by the factor of compareBlocks()
};

/// Mean, covariance, dispersion and uniqueness of the measurements. The same bits for any number of threads.
MeanAnalysis analyseMean(const Measurements& measurements, const AnalysisOptions& options);

/// Compares blocks of time where the measurements have times and there is a covariance, adds a note where they disagree,
/// and multiplies the covariance by the factor where the options ask for it. Files of more than 200 000 rows are left to
/// `validate split`.
void compareBlocks(MeanAnalysis& analysis, const Measurements& measurements, const AnalysisOptions& options);

/// Adds the p-value of the fit, and notes on what is remarkable about the result, to the analysis of so many
/// measurements.
void explain(MeanAnalysis& analysis, std::size_t measurements);

}  // namespace liestat::cli
