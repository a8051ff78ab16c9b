// Skewness of measurements about their mean. dispersionAbout() of stats/dispersion.hpp computes it. (Needs the standard
// library alone.)
#pragma once

#include <stats/noise_fit.hpp>

#include <cstddef>
#include <limits>

namespace liestat {

/// Mardia's test for skewed errors: the 95 % region of a mean supposes that they are not, and is too small for few
/// measurements if they are. Errors with heavy tails raise it, too.
struct Skewness {
  /// b = Σ_ij (u_i·u_j)³/n², u_i the errors about their mean, whitened by their scatter; of one coordinate the square
  /// of its skewness. NaN where nothing was tested.
  double b = std::numeric_limits<double>::quiet_NaN();
  double p = std::numeric_limits<double>::quiet_NaN();  ///< probability of so large a b if the errors are normal
  std::size_t n = 0;                                    ///< how many errors it is of

  /// Fewer measurements are not tested, for want of power, and more are not, because their number makes up for it.
  static constexpr std::size_t min_rows = 20, max_rows = 10'000;
  /// The 95 % region of skewed errors leaves about 5 + 13 b/n percent outside.
  static constexpr double min_effect = 0.02;
  bool tested() const { return p == p; }
  /// The errors are skewed, and so few that it matters.
  bool matters() const { return p < refutation_level && b > min_effect * static_cast<double>(n); }
};

}  // namespace liestat
