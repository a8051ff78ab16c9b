// Dependence of successive measurements, where nothing but the order of rows is known of their times. dispersionAbout()
// of stats/dispersion.hpp computes it. (Needs the standard library alone.)
#pragma once

#include <cstddef>
#include <limits>

namespace liestat {

/// A test for errors that resemble those of the row before: the covariance of a mean supposes that they do not. u_i are
/// the features' tangent vectors at the mean, whitened; T = Σ u_i·u_{i+1} is compared with its own scatter, whatever
/// the law of the noise, which may differ from row to row.
struct RowOrder {
  /// T over Σ|u_i|²: the correlation of successive errors; NaN where nothing was tested.
  double correlation = std::numeric_limits<double>::quiet_NaN();
  double z = std::numeric_limits<double>::quiet_NaN();  ///< T in standard deviations
  /// Correlation of log p_i with p_i |z_i|², whitened, times √n: zero but for chance where the weights are inverse
  /// variances. NaN where they are all equal.
  double weight_z = std::numeric_limits<double>::quiet_NaN();

  /// z that independent rows exceed in 7 of 1000 cases.
  static constexpr double dependent_z = 2.45;
  /// Fewer rows are not tested: T is not normal yet (of ten rows 1 to 2 of 100 would be called dependent).
  static constexpr std::size_t min_rows = 25;
  /// |weight_z| that inverse variances exceed in 1 of 1000 cases.
  static constexpr double no_precisions_z = 3.3;
  bool weightsTested() const { return weight_z == weight_z; }
  bool weightsAreNoPrecisions() const { return weight_z > no_precisions_z || weight_z < -no_precisions_z; }
  bool tested() const { return z == z; }
  bool dependent() const { return z > dependent_z; }
  /// How many times too small the covariance of a mean is, if errors fade by the same factor from row to row.
  double varianceFactor() const { return (1 + correlation) / (1 - correlation); }
};

}  // namespace liestat
