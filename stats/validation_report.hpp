// Report of a Monte-Carlo validation: the distances with their statistics, and the verdict on the covariance (needs
// Boost.Math). stats/validation.hpp makes such reports.
//
// Source: X. Pennec, "Computing the mean of geometric features", INRIA RR-3371, 1998, section 5.2 (validation index).
#pragma once

#include <stats/kolmogorov.hpp>
#include <stats/laws.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <iosfwd>
#include <limits>
#include <string>
#include <vector>

namespace liestat {

/// The outcome of one trial. A trial has failed if it says so, or if mu2 is not a finite number ≥ 0.
///
/// Further numbers of which the report shall give mean and standard deviation (norms of errors, logarithms of ratios)
/// are members of a type derived from this, which lists them. Not finite: absent in this trial. Failed trials: ignored.
///
///   struct Outcome : TrialOutcome {
///     double position_error = 0;  // m
///     static constexpr std::array statistics = {&Outcome::position_error};
///   };
///   …
///   report.of(&Outcome::position_error).mean
struct TrialOutcome {
  /// Squared Mahalanobis distance of the truth from the estimate under the estimate's covariance.
  double mu2 = std::numeric_limits<double>::quiet_NaN();
  /// Iterations of the estimator; counted for failed trials too.
  int iterations = 0;
  /// The estimator says itself that this is not to be used: not converged, ambiguous, withdrawn.
  bool failed = false;
};

/// Mean and standard deviation of a number over the trials that gave it; NaN where there are none.
struct TrialStatistic {
  std::size_t count = 0;
  double mean = std::numeric_limits<double>::quiet_NaN();
  double standard_deviation = std::numeric_limits<double>::quiet_NaN();
};

/// How far from perfect an estimator may be and still pass. Zero asks for the law itself, which a covariance of first
/// order in the noise can only satisfy up to a certain number of trials.
struct ValidationTolerance {
  double index = 0;             ///< relative error of the validation index
  double ks = 0;                ///< Kolmogorov-Smirnov distance between the true law of mu2 and the reference law
  double failure_fraction = 0;  ///< probability that a trial fails
  /// How much more often than due, 0.1 %, mu2 may exceed the 99.9 % quantile of the law. A covariance of first order is
  /// far too small now and then, where the second order exceeds the least noise of a datum; where that noise can be as
  /// small as it likes, P(mu2 > m) falls as slowly as 1/m and mu2 has no mean that an index could be compared with. So
  /// with a tolerance here a distance beyond the quantile counts in the index as the law's mean of those, however far
  /// off it is, and it is the number of them that is judged. Zero: none of this, all distances count as they are.
  double tail = 0;
};

/// Level of the quantile that ValidationTolerance::tail refers to.
inline constexpr double tail_level = 0.999;

/// Observed frequency of mu2 ≤ the quantile of the reference law at `level`.
struct Coverage {
  double level = 0;
  double observed = 0;
  double standard_error = 0;  ///< binomial standard error of `observed` under the reference law
};

/// Verdict on an estimator.
enum class ValidationVerdict {
  passed,
  no_trial_succeeded,
  too_many_failures,
  index_too_large,  ///< covariances are too small
  index_too_small,  ///< covariances are too large
  wrong_law,        ///< the Kolmogorov-Smirnov distance is too large
  heavy_tail,       ///< too many distances beyond the law's 99.9 % quantile
  // Bounds on errors, which follow no law.
  median_too_large,
  quantile_too_large,  ///< the 95 % quantile
  success_too_seldom   ///< the right answer was not found often enough
};

/// The name used in files and messages.
constexpr const char* name(ValidationVerdict verdict) {
  switch (verdict) {
    case ValidationVerdict::passed:
      return "passed";
    case ValidationVerdict::no_trial_succeeded:
      return "no_trial_succeeded";
    case ValidationVerdict::too_many_failures:
      return "too_many_failures";
    case ValidationVerdict::index_too_large:
      return "index_too_large";
    case ValidationVerdict::index_too_small:
      return "index_too_small";
    case ValidationVerdict::wrong_law:
      return "wrong_law";
    case ValidationVerdict::heavy_tail:
      return "heavy_tail";
    case ValidationVerdict::median_too_large:
      return "median_too_large";
    case ValidationVerdict::quantile_too_large:
      return "quantile_too_large";
    case ValidationVerdict::success_too_seldom:
      return "success_too_seldom";
  }
  return "unknown";
}

/// Why an estimator did not pass, in a few words; empty for one that passed.
constexpr const char* reason(ValidationVerdict verdict) {
  switch (verdict) {
    case ValidationVerdict::passed:
      return "";
    case ValidationVerdict::no_trial_succeeded:
      return "no trial succeeded";
    case ValidationVerdict::too_many_failures:
      return "too many trials failed";
    case ValidationVerdict::index_too_large:
      return "the index is too large: covariances are too small";
    case ValidationVerdict::index_too_small:
      return "the index is too small: covariances are too large";
    case ValidationVerdict::wrong_law:
      return "the distances do not follow the law";
    case ValidationVerdict::heavy_tail:
      return "too many distances are far beyond the law";
    case ValidationVerdict::median_too_large:
      return "the median of the errors is larger than promised";
    case ValidationVerdict::quantile_too_large:
      return "the 95 % quantile of the errors is larger than promised";
    case ValidationVerdict::success_too_seldom:
      return "the right answer was found too seldom";
  }
  return "unknown";
}

/// A bin of a histogram of mu2, with densities to be drawn over each other.
struct HistogramBin {
  double lower = 0, upper = 0;
  std::size_t count = 0;
  double density = 0;   ///< observed: count/(number of distances · width)
  double expected = 0;  ///< the mean density of the reference law over the bin
};

/// The result of a validation run. Numbers that cannot be computed (no trial succeeded; a law without variance) are NaN
/// or infinite.
struct ValidationReport {
  ReferenceLaw law = ReferenceLaw::chiSquared(0);   ///< expected law of mu2
  int dof = 0;                                      ///< the law's dimension k
  std::size_t trials = 0;                           ///< all
  std::size_t failures = 0;                         ///< those among them that gave no distance
  std::size_t exceptions = 0;                       ///< those among the failures that ended in an exception
  double index = detail::not_a_number;              ///< validation index I: mean of mu2; law.mean() is expected
  double index_se = detail::not_a_number;           ///< standard error of I, from the sample
  double index_se_expected = detail::not_a_number;  ///< the same from the law; √(2k/N) for χ²
  double index_p_value = detail::not_a_number;      ///< two-sided, exact, see passed()
  double variance = detail::not_a_number;           ///< variance of mu2; law.variance() is expected
  double ks_statistic = detail::not_a_number;       ///< Kolmogorov-Smirnov distance of the sample from the law
  double ks_p_value = detail::not_a_number;         ///< its p-value
  std::array<Coverage, 4> coverage = {};            ///< at 50, 90, 95 and 99 %
  double mean_iterations = detail::not_a_number;    ///< over all trials
  int max_iterations = 0;
  std::vector<double> mu2;         ///< the distances of the trials that did not fail, ascending
  double equivalent_chi2_sum = 0;  ///< sum of ReferenceLaw::equivalentChiSquared over mu2

  /// Number of distances N.
  std::size_t size() const { return mu2.size(); }

  /// Number of distances beyond the law's quantile at tail_level.
  std::size_t tailCount() const {
    return static_cast<std::size_t>(mu2.end() - std::upper_bound(mu2.begin(), mu2.end(), law.quantile(tail_level)));
  }

  /// The verdict. With probability 1 - false_alarm at least, an estimator passes whose distances follow the reference
  /// law up to the tolerance. It fails if none of the trials succeeded, or at an equal share of false_alarm each if
  /// - more trials failed than a probability tolerance.failure_fraction of failing explains (zero: none may);
  /// - the index is out of bounds. The bound is exact, not a normal approximation: N·I is χ² with kN degrees of
  ///   freedom. Distances that should follow Hotelling's law are first carried over to χ²_k, rank by rank, because
  ///   their own mean may have no variance;
  /// - the Kolmogorov-Smirnov statistic is out of bounds;
  /// - more distances are beyond the law's 99.9 % quantile than 0.1 % + tolerance.tail explains, if tail is not zero.
  ValidationVerdict verdict(double false_alarm = 1e-5, const ValidationTolerance& tolerance = {}) const {
    if (size() == 0) return ValidationVerdict::no_trial_succeeded;
    const double share = false_alarm / (2 + (tolerance.failure_fraction > 0) + (tolerance.tail > 0));
    // Written so that NaN (a law that does not exist) fails.
    if (!(binomialSurvival(failures, trials, std::min(1., tolerance.failure_fraction)) >= share)) {
      return ValidationVerdict::too_many_failures;
    }
    const bool bounded = tolerance.tail > 0;
    if (!(indexPValue(tolerance.index, bounded) >= share)) {
      return chi2Sum(bounded) > static_cast<double>(dof) * static_cast<double>(size())
                 ? ValidationVerdict::index_too_large
                 : ValidationVerdict::index_too_small;
    }
    if (!(kolmogorovPValue(size(), std::max(0., ks_statistic - tolerance.ks)) >= share))
      return ValidationVerdict::wrong_law;
    if (bounded && !(binomialSurvival(tailCount(), size(), std::min(1., 1 - tail_level + tolerance.tail)) >= share)) {
      return ValidationVerdict::heavy_tail;
    }
    return ValidationVerdict::passed;
  }
  /// True if verdict() is ValidationVerdict::passed.
  bool passed(double false_alarm = 1e-5, const ValidationTolerance& tolerance = {}) const {
    return verdict(false_alarm, tolerance) == ValidationVerdict::passed;
  }

  /// Two-sided p-value of the index when its expectation is anywhere within law.mean()·(1 ± tolerance) (for Hotelling's
  /// law: of the equivalent χ² index). tolerance ≥ 0. `bounded`: a distance beyond the law's quantile at tail_level
  /// counts as the law's mean of those. Under the law that leaves the index its expectation and takes away variance, so
  /// the p-value errs to the careful side.
  double indexPValue(double tolerance = 0, bool bounded = false) const {
    if (size() == 0 || !(tolerance >= 0)) return detail::not_a_number;
    const double sum = chi2Sum(bounded), sum_dof = static_cast<double>(dof) * static_cast<double>(size());
    const double above = chiSquaredSurvival(sum / (1 + tolerance), sum_dof);
    const double below = tolerance < 1 ? chiSquaredCdf(sum / (1 - tolerance), sum_dof) : 1;
    if (std::isnan(above) || std::isnan(below)) return detail::not_a_number;
    return std::min(1., 2 * std::min(above, below));
  }

  /// Equal bins over [0, quantile of the law at 0.999], or up to `upper` if it is given (> 0). Larger distances are in
  /// no bin, but in the number that the densities are divided by. Empty for bins < 1 or a law that does not exist.
  std::vector<HistogramBin> histogram(int bins, double upper = 0) const {
    std::vector<HistogramBin> result;
    const double end = upper > 0 ? upper : law.quantile(0.999);
    if (bins < 1 || !std::isfinite(end)) return result;
    const double width = end / bins;
    auto first = mu2.begin();
    for (int i = 0; i < bins; ++i) {
      HistogramBin bin;
      bin.lower = i * width;
      bin.upper = i + 1 == bins ? end : (i + 1) * width;
      const auto last = std::upper_bound(first, mu2.end(), bin.upper);
      bin.count = static_cast<std::size_t>(last - first);
      first = last;
      if (size() > 0) bin.density = static_cast<double>(bin.count) / (static_cast<double>(size()) * width);
      bin.expected = (law.cdf(bin.upper) - law.cdf(bin.lower)) / width;
      result.push_back(bin);
    }
    return result;
  }

 private:
  /// The sum of the equivalent χ² distances that the index is judged by.
  double chi2Sum(bool bounded) const {
    if (!bounded) return equivalent_chi2_sum;
    double sum = 0;
    const std::size_t inside = size() - tailCount();
    for (std::size_t i = 0; i < inside; ++i) sum += law.equivalentChiSquared(mu2[i]);
    // E[X | X > q] of X ~ χ²_k is k P(χ²_{k+2} > q)/P(χ²_k > q).
    const double q = chiSquaredQuantile(tail_level, dof);
    const double beyond = dof * chiSquaredSurvival(q, dof + 2) / (1 - tail_level);
    return sum + beyond * static_cast<double>(size() - inside);
  }
};

/// A report with the statistics of the outcome's own members.
template <class Outcome>
struct ValidationReportOf : ValidationReport {
  std::array<TrialStatistic, Outcome::statistics.size()> statistics = {};

  /// Statistic of a member that Outcome::statistics lists; for another one, as if no trial had given it.
  TrialStatistic of(double Outcome::*member) const {
    for (std::size_t i = 0; i < statistics.size(); ++i) {
      if (Outcome::statistics[i] == member) return statistics[i];
    }
    return {};
  }
};

namespace detail {

/// A number with a few significant digits, right-aligned in a column.
inline std::string formatted(double value, int digits, int width = 0) {
  char text[64];
  std::snprintf(text, sizeof text, "%*.*g", width, digits, value);
  return text;
}

/// A line of the table of a report.
inline std::string reportLine(std::string label, double observed, double expected, const std::string& rest) {
  label.resize(18, ' ');
  return "  " + label + formatted(observed, 4, 11) + formatted(expected, 4, 11) + (rest.empty() ? "" : "   ") + rest +
         '\n';
}

}  // namespace detail

/// The report as a table of at most 80 columns, the verdict last.
inline std::string table(const ValidationReport& report, double false_alarm = 1e-5,
                         const ValidationTolerance& tolerance = {}) {
  using detail::formatted, detail::reportLine;
  std::string text = std::to_string(report.trials) + " trials, " + std::to_string(report.failures) + " failed";
  if (report.exceptions > 0) text += " (" + std::to_string(report.exceptions) + " by an exception)";
  text += std::string("\nlaw ") + report.law.name() + ", k = " + std::to_string(report.dof);
  if (report.law.is_hotelling()) text += ", n = " + std::to_string(report.law.samples());
  text += '\n' + std::string(23, ' ') + "observed   expected\n";
  text += reportLine("validation index", report.index, report.law.mean(),
                     "SE " + formatted(report.index_se, 2) + ", p = " + formatted(report.index_p_value, 2));
  text += reportLine("variance", report.variance, report.law.variance(), "");
  for (const Coverage& coverage : report.coverage) {
    text += reportLine("inside " + formatted(100 * coverage.level, 3) + " %", 100 * coverage.observed,
                       100 * coverage.level, "SE " + formatted(100 * coverage.standard_error, 2));
  }
  text += reportLine("K-S distance", report.ks_statistic, 0, "p = " + formatted(report.ks_p_value, 2));
  text += "  iterations        " + formatted(report.mean_iterations, 4, 11) + std::string(14, ' ') + "at most " +
          std::to_string(report.max_iterations) + '\n';
  const ValidationVerdict verdict = report.verdict(false_alarm, tolerance);
  return text + (verdict == ValidationVerdict::passed ? "passed" : std::string("FAILED: ") + reason(verdict)) + '\n';
}

/// Prints table() with a false-alarm probability of 1e-5 and no tolerance.
template <class Traits>
std::basic_ostream<char, Traits>& operator<<(std::basic_ostream<char, Traits>& out, const ValidationReport& report) {
  return out << table(report);
}

}  // namespace liestat
