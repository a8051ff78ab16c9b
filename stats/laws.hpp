#pragma once

// The laws of squared Mahalanobis distances, and what follows from them (needs Boost.Math, Debian: libboost-dev).
//
// Source: X. Pennec, "Computing the mean of geometric features", INRIA RR-3371, 1998, section 5.2 (validation index);
// T. W. Anderson, "An introduction to multivariate statistical analysis", section 5.2 (Hotelling's T²).
//
// Nothing here throws: arguments outside a function's domain, and NaN, give NaN.

// g++ cannot follow Boost's ibetac_inv to the end and warns, at -O1 and above, about a result that is always set.
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/special_functions/beta.hpp>
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic pop
#endif

#include <cmath>
#include <cstddef>
#include <limits>

namespace liestat {

namespace detail {

/// Boost's distributions with errors as return values (NaN, infinity) and in double throughout.
using QuietPolicy = boost::math::policies::policy<
    boost::math::policies::domain_error<boost::math::policies::ignore_error>,
    boost::math::policies::pole_error<boost::math::policies::ignore_error>,
    boost::math::policies::overflow_error<boost::math::policies::ignore_error>,
    boost::math::policies::underflow_error<boost::math::policies::ignore_error>,
    boost::math::policies::denorm_error<boost::math::policies::ignore_error>,
    boost::math::policies::rounding_error<boost::math::policies::ignore_error>,
    boost::math::policies::evaluation_error<boost::math::policies::ignore_error>,
    boost::math::policies::indeterminate_result_error<boost::math::policies::ignore_error>,
    boost::math::policies::promote_double<false>>;

inline constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
inline constexpr double infinity = std::numeric_limits<double>::infinity();

using ChiSquaredLaw = boost::math::chi_squared_distribution<double, QuietPolicy>;
using FisherLaw = boost::math::fisher_f_distribution<double, QuietPolicy>;

// Boost refuses the ends of the half line and of [0, 1], where the answers are plain: these serve both laws.

template <class Law>
double lawCdf(const Law& law, double x) {
  if (!(x >= 0)) return not_a_number;
  return std::isinf(x) ? 1 : boost::math::cdf(law, x);
}

template <class Law>
double lawSurvival(const Law& law, double x) {
  if (!(x >= 0)) return not_a_number;
  return std::isinf(x) ? 0 : boost::math::cdf(boost::math::complement(law, x));
}

template <class Law>
double lawPdf(const Law& law, double x) {
  if (!(x >= 0)) return not_a_number;
  return std::isinf(x) ? 0 : boost::math::pdf(law, x);
}

template <class Law>
double lawQuantile(const Law& law, double probability) {
  if (!(probability >= 0 && probability <= 1)) return not_a_number;
  if (probability == 0) return 0;
  return probability == 1 ? infinity : boost::math::quantile(law, probability);
}

template <class Law>
double lawThreshold(const Law& law, double tail) {
  if (!(tail >= 0 && tail <= 1)) return not_a_number;
  if (tail == 0) return infinity;
  return tail == 1 ? 0 : boost::math::quantile(boost::math::complement(law, tail));
}

}  // namespace detail

/// P(χ²_k ≤ mu2). NaN for k ≤ 0 or mu2 < 0.
inline double chiSquaredCdf(double mu2, double k) {
  return k > 0 ? detail::lawCdf(detail::ChiSquaredLaw(k), mu2) : detail::not_a_number;
}

/// P(χ²_k > mu2), accurate to relative precision also where it is tiny. NaN for k ≤ 0 or mu2 < 0.
inline double chiSquaredSurvival(double mu2, double k) {
  return k > 0 ? detail::lawSurvival(detail::ChiSquaredLaw(k), mu2) : detail::not_a_number;
}

/// Density of χ²_k. NaN for k ≤ 0 or mu2 < 0.
inline double chiSquaredPdf(double mu2, double k) {
  return k > 0 ? detail::lawPdf(detail::ChiSquaredLaw(k), mu2) : detail::not_a_number;
}

/// The mu2 below which χ²_k is with the given probability; 0 and infinity at the ends. NaN outside [0, 1] or for k ≤ 0.
inline double chiSquaredQuantile(double probability, double k) {
  return k > 0 ? detail::lawQuantile(detail::ChiSquaredLaw(k), probability) : detail::not_a_number;
}

/// The mu2 that χ²_k exceeds with probability `tail`: a gate for outliers. chiSquaredQuantile(1 - tail, k) without the
/// rounding of 1 - tail. NaN outside [0, 1] or for k ≤ 0.
inline double chiSquaredThreshold(double tail, double k) {
  return k > 0 ? detail::lawThreshold(detail::ChiSquaredLaw(k), tail) : detail::not_a_number;
}

/// P(of n independent events of the given probability at least `count` happen), exact. NaN for a probability outside
/// [0, 1].
inline double binomialSurvival(std::size_t count, std::size_t n, double probability) {
  if (!(probability >= 0 && probability <= 1)) return detail::not_a_number;
  if (count == 0) return 1;
  if (count > n) return 0;
  return boost::math::ibeta(static_cast<double>(count), static_cast<double>(n - count + 1), probability,
                            detail::QuietPolicy());
}

/// The number of standard errors that a standard normal variable exceeds, on either side, with the given probability:
/// 1.96 for 0.05, 4.42 for 1e-5.
inline double twoSidedNormalQuantile(double probability) { return std::sqrt(chiSquaredThreshold(probability, 1)); }

/// Hotelling's T²: the law of a squared Mahalanobis distance in k dimensions when the covariance was estimated from the
/// residuals of the same n Gaussian samples: mu2·(n - k) / (k·(n - 1)) ~ F(k, n - k).
///
/// It is not χ²_k: its mean is k(n - 1)/(n - k - 2), for k = 3 and n = 30 larger by 16 %. All members give NaN for k <
/// 1 or n ≤ k (no covariance of full rank exists), and for negative mu2.
struct Hotelling {
  int k = 0;  ///< dimension
  int n = 0;  ///< number of samples

  bool valid() const { return k >= 1 && n > k; }

  double cdf(double mu2) const { return valid() ? detail::lawCdf(fisher(), mu2 / scale()) : detail::not_a_number; }
  double survival(double mu2) const {
    return valid() ? detail::lawSurvival(fisher(), mu2 / scale()) : detail::not_a_number;
  }
  double pdf(double mu2) const {
    return valid() ? detail::lawPdf(fisher(), mu2 / scale()) / scale() : detail::not_a_number;
  }
  /// The mu2 that is not exceeded with the given probability.
  double quantile(double probability) const {
    return valid() ? detail::lawQuantile(fisher(), probability) * scale() : detail::not_a_number;
  }
  /// The mu2 that is exceeded with probability `tail`.
  double threshold(double tail) const {
    return valid() ? detail::lawThreshold(fisher(), tail) * scale() : detail::not_a_number;
  }
  /// Infinite for n ≤ k + 2.
  double mean() const {
    if (!valid()) return detail::not_a_number;
    return n > k + 2 ? double(k) * (n - 1.) / (n - k - 2.) : detail::infinity;
  }
  /// Infinite for n ≤ k + 4.
  double variance() const {
    if (!valid()) return detail::not_a_number;
    if (n <= k + 4) return detail::infinity;
    const double m = mean();
    return 2 * m * m * (n - 2.) / (k * (n - k - 4.));
  }

 private:
  double scale() const { return k * (n - 1.) / (n - double(k)); }
  detail::FisherLaw fisher() const { return detail::FisherLaw(k, double(n) - k); }
};

/// The law that a squared Mahalanobis distance is expected to follow: χ²_k where the noise was known, Hotelling's T²
/// where the covariance came from the residuals. A small value, trivially copyable.
class ReferenceLaw {
 public:
  /// χ² with k degrees of freedom (k < 1: all functions give NaN).
  static ReferenceLaw chiSquared(int k) { return ReferenceLaw({k, 0}, false); }
  /// Hotelling's T² in k dimensions from n samples (n ≤ k: all functions give NaN).
  static ReferenceLaw hotelling(int k, int n) { return ReferenceLaw({k, n}, true); }

  bool is_hotelling() const { return is_hotelling_; }
  /// "chi2" or "hotelling", as in the program's JSON.
  const char* name() const { return is_hotelling_ ? "hotelling" : "chi2"; }
  /// The dimension k.
  int dof() const { return parameters_.k; }
  /// The number of samples of Hotelling's law; 0 for χ².
  int samples() const { return parameters_.n; }

  double cdf(double mu2) const { return is_hotelling_ ? parameters_.cdf(mu2) : chiSquaredCdf(mu2, dof()); }
  double survival(double mu2) const {
    return is_hotelling_ ? parameters_.survival(mu2) : chiSquaredSurvival(mu2, dof());
  }
  double pdf(double mu2) const { return is_hotelling_ ? parameters_.pdf(mu2) : chiSquaredPdf(mu2, dof()); }
  double quantile(double probability) const {
    return is_hotelling_ ? parameters_.quantile(probability) : chiSquaredQuantile(probability, dof());
  }
  double threshold(double tail) const {
    return is_hotelling_ ? parameters_.threshold(tail) : chiSquaredThreshold(tail, dof());
  }
  /// May be infinite for Hotelling's law, see there.
  double mean() const {
    if (is_hotelling_) return parameters_.mean();
    return dof() >= 1 ? dof() : detail::not_a_number;
  }
  double variance() const {
    if (is_hotelling_) return parameters_.variance();
    return dof() >= 1 ? 2. * dof() : detail::not_a_number;
  }

  /// The χ²_k variable that has the same rank under its law as mu2 has under this one: mu2 itself for χ². Sums of it
  /// have an exact law (χ² with the degrees of freedom added) where sums of Hotelling's T² have none, not even a
  /// variance.
  double equivalentChiSquared(double mu2) const {
    if (!is_hotelling_) return mu2 >= 0 && dof() >= 1 ? mu2 : detail::not_a_number;
    const double p = cdf(mu2);
    // From the nearer end: both tails keep their relative precision.
    return p < 0.5 ? chiSquaredQuantile(p, dof()) : chiSquaredThreshold(survival(mu2), dof());
  }

 private:
  ReferenceLaw(Hotelling parameters, bool is_hotelling) : parameters_(parameters), is_hotelling_(is_hotelling) {}

  Hotelling parameters_;
  bool is_hotelling_;
};

}  // namespace liestat
