// The dependence of errors on time as rows with times show it; the test is in stats/time_dependence.hpp. (Needs the
// standard library alone.)
#pragma once

#include <stats/words.hpp>

#include <limits>
#include <string>

namespace liestat {

/// The dependence of errors on time, as rows with times show it: a Gauss–Markov process and white noise
/// (stats/time_dependence.hpp).
struct TimeDependence {
  bool tested = false;  ///< false: too few rows, no times, or columns that leave a parameter open
  double white = std::numeric_limits<double>::quiet_NaN();  ///< probability that the errors are independent
  /// Means under the weights of the other cells: share of the variance that depends on time, and its time constant (s).
  double share = white, time_constant = white;
  /// The residuals refute the ratios of the axes' variances that noise known up to a factor states; their own are used.
  bool unequal_axes = false;
  /// Mean factor of the variances, at least 1.
  double correlation_factor = 1;

  /// Independent errors are called dependent below this probability in less than 1 of 100 cases from 50 rows on.
  static constexpr double max_independence = 0.25;
  bool dependent() const { return tested && white < max_independence; }

  /// In a sentence.
  std::string inWords() const {
    std::string text = "the dependence of errors on time was not tested";
    if (tested && white > 0.5) {
      text = "errors are independent in time (probability " + significant(white, 2) + ")";
    } else if (tested) {
      text = "errors depend on time, " + significant(100 * share, 3) + " % of them with a time constant of " +
             significant(time_constant, 3) + " s";
    }
    if (unequal_axes) text += "; their sizes are not in the stated ratios";
    if (tested || unequal_axes) text += ": variances times " + significant(correlation_factor, 3);
    return text;
  }
};

template <class V>
void describe(V& v, const TimeDependence& x) {
  v("time_dependence", x.inWords(), "in words")("time_dependence_tested", x.tested, "whether");
  v("independence", x.white, "probability that the errors are independent in time; null: untested");
  v("correlated_share", x.share, "of the variance, where they are not")("correlation_time", x.time_constant, "", "s");
  v("unequal_axes", x.unequal_axes, "the errors' sizes are not in the stated ratios");
  v("correlation_factor", x.correlation_factor, "mean factor of the variances that dependence and sizes ask for");
}

}  // namespace liestat
