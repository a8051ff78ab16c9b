// Where the errors of inliers end, from the errors themselves (Viéville, Lingrand and Gaspard 2000, section 4): the
// first minimum of their histogram, and the scale from their moments. Needs the standard library alone.
//
// Errors are squared distances in units of the noise, or in any other unit; what is returned is squared in the same
// unit. Both look at the density of the distances |e|, which for one equation a measurement is flat at zero; that of e²
// is not. Errors that are no numbers are left out.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

namespace liestat {

/// A threshold between inliers and outliers.
struct ErrorThreshold {
  double squared;
  bool found;  ///< false: the histogram had no usable minimum, and this is the fallback
};

/// The first local minimum or saddle of the histogram of |e| on [0, 2√T], smoothed over √T/2, that lies below half of
/// its highest level before: there inliers end and outliers begin. T is that of Relevance, twice the largest error
/// expected of an inlier. Without a minimum, or with one that is implausible (|e| below 0.58 or above 1.94 times that
/// of the fallback, which for one equation is 1.5 and 5 standard deviations) the fallback: χ²_{0.99} of the equations
/// of one measurement.
inline ErrorThreshold histogramThreshold(std::span<const double> errors, double T, double fallback = 6.6349) {
  constexpr std::size_t bins = 80, reach = 10;  // a bin is √T/40, the window 2·10 + 1 of them
  const ErrorThreshold none{fallback, false};
  const double width = std::sqrt(T) / 40;
  if (!(width > 0) || !(T < std::numeric_limits<double>::infinity())) return none;
  std::array<double, bins + 1> below{};  // errors below each edge
  for (const double e : errors) {
    const double bin = std::sqrt(e) / width;
    if (bin < double(bins)) ++below[static_cast<std::size_t>(bin) + 1];
  }
  for (std::size_t k = 0; k < bins; ++k) below[k + 1] += below[k];
  std::array<double, bins> level{};  // a box, reflected at 0 and cut at the end
  for (std::size_t k = 0; k < bins; ++k) {
    const std::size_t end = std::min(k + reach + 1, bins);
    const double reflected = k < reach ? below[reach - k] : 0;
    const double counted = below[end] - below[k < reach ? 0 : k - reach] + reflected;
    level[k] = counted / static_cast<double>(reach + end - k);
  }
  double highest = level[0];
  for (std::size_t k = 1; k + 1 < bins; ++k) {
    if (level[k] < highest / 2 && level[k] <= level[k - 1] && level[k] <= level[k + 1]) {
      const double e = (static_cast<double>(k) + 0.5) * width, expected = std::sqrt(fallback);
      return e >= 1.5 / 2.5758 * expected && e <= 5 / 2.5758 * expected ? ErrorThreshold{e * e, true} : none;
    }
    highest = std::max(highest, level[k]);
  }
  return none;
}

/// The result of scaleFromMoments(). Without a root T is NaN.
struct MomentScale {
  double T = std::numeric_limits<double>::quiet_NaN();  ///< squared, as that of Relevance
  std::size_t kept = 0;                                 ///< errors below it
  std::size_t roots = 0;                                ///< how many were passed, this one with them

  bool ok() const { return kept > 0; }
};

struct MomentScaleOptions {
  std::size_t minimal_sample = 1;  ///< roots that keep fewer errors are no scale
  /// A root is believed when the polynomial rises behind it to so many standard deviations of a flat histogram of as
  /// many errors; 0 takes the first one.
  double significance = 4;
};

/// The T for which the moments μ_n of the |e| below √T meet μ_0 - 12 μ_1/√T + 30 μ_2/T - 20 μ_3/√T³ = 0: there the
/// density of |e| ends to be a parabola, which has no third Legendre coefficient. A constant background does not move
/// the root: of normal inliers it is 4.42 standard deviations, whatever the share of outliers. Samples have many roots,
/// most of them by chance: the smallest that keeps a minimal sample is the answer of the report (significance 0), the
/// last before the polynomial is positive beyond chance is nearer to the truth.
inline MomentScale scaleFromMoments(std::span<const double> errors, const MomentScaleOptions& options = {}) {
  std::vector<double> e;
  e.reserve(errors.size());
  for (const double error : errors) {
    if (error >= 0 && error < std::numeric_limits<double>::infinity()) e.push_back(std::sqrt(error));
  }
  std::sort(e.begin(), e.end());
  MomentScale found;
  double sum[4] = {};  // power sums of the errors below T, in units of the k-th
  for (std::size_t k = 0; k < e.size(); ++k) {
    const double unit = e[k], shrink = k > 0 && unit > 0 ? e[k - 1] / unit : 1;
    for (int n = 0; n < 4; ++n) sum[n] = sum[n] * std::pow(shrink, n) + 1;
    if (!(unit > 0)) {
      sum[1] = sum[2] = sum[3] = 0;
      continue;
    }
    const std::size_t kept = k + 1;
    if (kept < options.minimal_sample) continue;
    // The cubic in u = unit/T, from 1 down to the next error; between its extremes it is monotone.
    const auto f = [&](double u) { return sum[0] - u * (12 * sum[1] - u * (30 * sum[2] - u * 20 * sum[3])); };
    const double end = kept < e.size() ? unit / e[kept] : 0;
    std::array<double, 4> u{1, end, end, end};
    std::size_t edges = 1;
    if (const double D = sum[2] * sum[2] - 0.8 * sum[1] * sum[3]; D > 0) {  // f' = -12 (S₁ - 5 S₂ u + 5 S₃ u²)
      for (const double root_of_D : {std::sqrt(D), -std::sqrt(D)}) {
        const double extreme = (sum[2] + root_of_D) / (2 * sum[3]);
        if (extreme < u[edges - 1] && extreme > end) u[edges++] = extreme;
      }
    }
    u[edges] = end;
    for (std::size_t piece = 0; piece < edges; ++piece) {
      double high = u[piece], low = u[piece + 1];
      const bool rises = f(low) > 0;
      if ((f(high) > 0) == rises) continue;
      for (int step = 0; step < 60; ++step) {
        const double middle = (high + low) / 2;
        ((f(middle) > 0) == rises ? low : high) = middle;
      }
      ++found.roots;
      const double root = unit / ((high + low) / 2);
      found.T = root * root;
      found.kept = kept;
      if (!(options.significance > 0)) return found;
    }
    if (found.ok() && f(end) > options.significance * std::sqrt(static_cast<double>(kept) / 7)) return found;
  }
  return found;
}

/// √T of scaleFromMoments() for normal inliers, in standard deviations.
inline constexpr double moment_scale_of_normal_errors = 4.42;

/// A test of the noise by the errors of all measurements under an estimate, in units of that noise. Of right noise one
/// inlier in a hundred lies between the threshold and twice that distance, and outliers are as dense there as beyond;
/// noise that is larger than stated moves inliers there.
struct NoiseCheck {
  /// √T of scaleFromMoments() over what it is where the stated noise is right: by which the true standard deviation is
  /// larger. NaN without a root, or with several equations a measurement.
  double scale = std::numeric_limits<double>::quiet_NaN();
  std::size_t beyond = 0;                                      ///< errors between the threshold and twice that distance
  double expected = std::numeric_limits<double>::quiet_NaN();  ///< of them where the stated noise is right
  double p = std::numeric_limits<double>::quiet_NaN();         ///< probability of so many, or more

  /// A thousandth of searches with right noise are refuted by their number; of 100 errors, half of them outliers, 99 of
  /// 100 scales are below 1.5.
  static constexpr double level = 1e-3, max_scale = 1.6;
  bool tested() const { return !std::isnan(p); }
  bool refuted() const { return p < level || scale > max_scale; }
  const char* word() const { return !tested() ? "untested" : refuted() ? "larger than stated" : "as stated"; }
};

/// The check for an inlier threshold χ²_{0.99} of the equations of one measurement. Untested without errors below it.
inline NoiseCheck checkNoise(std::span<const double> errors, double threshold, int equations = 1) {
  NoiseCheck check;
  std::size_t inside = 0, outside = 0;
  for (const double e : errors) {
    inside += e < threshold;
    check.beyond += e >= threshold && e < 4 * threshold;
    outside += e >= 4 * threshold && e < 36 * threshold;
  }
  if (inside == 0 || !(threshold > 0)) return check;
  // Outliers of constant density in the space of the equations: their numbers are as volumes of shells.
  const double ratio = (std::pow(2, equations) - 1) / (std::pow(6, equations) - std::pow(2, equations));
  const double of_inliers = 0.01 / 0.99 * static_cast<double>(inside), shells = static_cast<double>(outside) + 1;
  check.expected = of_inliers + ratio * static_cast<double>(outside);
  // Inliers by Poisson's law; outliers by what a number of them elsewhere predicts, the negative binomial law.
  std::vector<double> background(check.beyond);
  double fewer = 0, here = std::pow(1 + ratio, -shells);
  for (std::size_t k = 0; k < check.beyond; ++k) {
    background[k] = here;
    here *= (shells + static_cast<double>(k)) / static_cast<double>(k + 1) * ratio / (1 + ratio);
  }
  double poisson = std::exp(-of_inliers);
  for (std::size_t k = 0; k < check.beyond; ++k) {
    double rest = 0;
    for (std::size_t j = 0; j + k < check.beyond; ++j) rest += background[j];
    fewer += poisson * rest;
    poisson *= of_inliers / static_cast<double>(k + 1);
  }
  check.p = std::max(0.0, 1 - fewer);
  if (equations == 1) {
    const MomentScale found = scaleFromMoments(errors);
    if (found.ok()) check.scale = std::sqrt(found.T) / moment_scale_of_normal_errors;
  }
  return check;
}

}  // namespace liestat
