// Parts of a robust estimation (Viéville, Lingrand and Gaspard 2000, section 4; docs/robust.md): how a hypothesis is
// scored by the errors of all measurements, how the best score rose and when that is enough, how many random samples
// are needed, and where the errors of inliers end (stats/error_scale.hpp). The search itself is
// stats/robust_search.hpp. Needs the standard library alone.
//
// An error is the squared distance of a measurement from the model in units of its noise (measurementError() of
// stats/measurement_error.hpp): of an inlier of the true model χ² with as many degrees of freedom as the measurement
// has equations. An error that is NaN belongs to an outlier, here and everywhere below.
#pragma once

#include <stats/error_scale.hpp>

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

namespace liestat {

/// Judges a hypothesis by the errors of all measurements; larger is better.
template <class R>
concept ScoringRule = requires(const R& rule, std::span<const double> errors) {
  { rule(errors) } -> std::convertible_to<double>;
};

/// A rule that can tell before all errors are known that a hypothesis is not better than `best`: it is better only if
/// the sum of what measurements contribute, each between `lowest` and 1, is at least required(measurements, best).
template <class R>
concept BoundedRule = ScoringRule<R> && requires(const R& rule, double number, std::size_t measurements) {
  { R::lowest } -> std::convertible_to<double>;
  { rule.contribution(number, number) } -> std::convertible_to<double>;
  { rule.required(measurements, number) } -> std::convertible_to<double>;
};

/// The relevance (29): R = 1/M Σ_{e < T} (1 - 2e/T), at most 1. It counts inliers and prefers small errors; a constant
/// background of outliers contributes nothing on average. Weights are negative above T/2: T is twice the largest error
/// that is expected of an inlier, 2 χ²_{0.99}.
struct Relevance {
  double T;
  static constexpr double lowest = -1;

  double contribution(double error, double /*best*/ = 0) const { return error < T ? 1 - 2 * error / T : 0; }
  double required(std::size_t measurements, double best) const { return best * static_cast<double>(measurements); }
  double operator()(std::span<const double> errors) const {
    double sum = 0;
    for (const double e : errors) sum += contribution(e);
    return errors.empty() ? 0 : sum / static_cast<double>(errors.size());
  }
};

/// The number of errors below a threshold: the report's S_A, the score of RANSAC.
struct InlierCount {
  double threshold;
  static constexpr double lowest = 0;

  double contribution(double error, double /*best*/ = 0) const { return error < threshold ? 1 : 0; }
  double required(std::size_t /*measurements*/, double best) const { return best; }
  double operator()(std::span<const double> errors) const {
    double sum = 0;
    for (const double e : errors) sum += contribution(e);
    return sum;
  }
};

/// The truncated cost Σ min(e, T) as a score, Σ max(0, 1 - e/T) (MSAC: P. Torr and A. Zisserman, MLESAC, 2000).
struct TruncatedCost {
  double threshold;
  static constexpr double lowest = 0;

  double contribution(double error, double /*best*/ = 0) const { return error < threshold ? 1 - error / threshold : 0; }
  double required(std::size_t /*measurements*/, double best) const { return best; }
  double operator()(std::span<const double> errors) const {
    double sum = 0;
    for (const double e : errors) sum += contribution(e);
    return sum;
  }
};

/// The error that a fraction of all measurements does not exceed, negative: the report's S_B, for 0.5 the least median
/// of squares. Half the share of inliers is what the report takes. -∞ where fewer measurements have a number.
struct TrimmedQuantile {
  double fraction = 0.5;
  static constexpr double lowest = 0;

  double contribution(double error, double best) const { return error < -best ? 1 : 0; }
  double required(std::size_t measurements, double /*best*/) const { return static_cast<double>(rank(measurements)); }
  double operator()(std::span<const double> errors) const {
    std::vector<double> scratch;
    return (*this)(errors, scratch);
  }
  /// The same without an allocation where the scratch is large enough.
  double operator()(std::span<const double> errors, std::vector<double>& scratch) const {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    if (errors.empty()) return -infinity;
    scratch.resize(errors.size());
    std::transform(errors.begin(), errors.end(), scratch.begin(), [](double e) { return e < infinity ? e : infinity; });
    const auto nth = scratch.begin() + static_cast<std::ptrdiff_t>(rank(errors.size()) - 1);
    std::nth_element(scratch.begin(), nth, scratch.end());
    return -*nth;
  }

 private:
  std::size_t rank(std::size_t n) const {
    const double exact = std::ceil(fraction * static_cast<double>(n));
    return exact >= 1 ? std::min(static_cast<std::size_t>(exact), n) : 1;
  }
};

/// The draws in which the best hypothesis changed, and its scores: fig. 9.
class BestHistory {
 public:
  struct Entry {
    std::size_t draw;
    double score;
  };
  /// Scores that are not higher than the last, and NaN, are left out.
  void add(std::size_t draw, double score) {
    if (entries_.empty() ? score == score : score > entries_.back().score) entries_.push_back({draw, score});
  }
  void reserve(std::size_t entries) { entries_.reserve(entries); }
  std::span<const Entry> entries() const { return entries_; }
  bool empty() const { return entries_.empty(); }
  /// By how much the k-th entry raised the score; the first is compared with `baseline`.
  double gain(std::size_t k, double baseline = 0) const {
    return entries_[k].score - (k == 0 ? baseline : entries_[k - 1].score);
  }
  /// The entry with the largest gain, the jump of fig. 9; of none 0.
  std::size_t largestJump(double baseline = 0) const {
    std::size_t largest = 0;
    for (std::size_t k = 1; k < entries_.size(); ++k) {
      if (gain(k, baseline) > gain(largest, baseline)) largest = k;
    }
    return largest;
  }

 private:
  std::vector<Entry> entries_;
};

/// Says after `draws` draws whether a search may end. The search itself never does (section 4).
template <class S>
concept StopRule = requires(const S& stop, const BestHistory& history, std::size_t draws) {
  { stop(history, draws) } -> std::convertible_to<bool>;
};

/// So many draws are done.
struct DrawsReached {
  std::size_t draws;
  bool operator()(const BestHistory&, std::size_t done) const { return done >= draws; }
};
/// Nothing was gained in the last so many draws.
struct NoGainFor {
  std::size_t draws;
  bool operator()(const BestHistory& history, std::size_t done) const {
    const std::size_t last = history.empty() ? 0 : history.entries().back().draw;
    return done >= last && done - last >= draws;
  }
};
/// The best score jumped by so much at once: a set of inliers was found (fig. 9). The first hypothesis is compared with
/// `baseline`, which for the relevance is 0, that of outliers alone.
struct Jump {
  double height;
  double baseline = 0;
  bool operator()(const BestHistory& history, std::size_t) const {
    return !history.empty() && history.gain(history.largestJump(baseline), baseline) >= height;
  }
};
/// The best score, or cost with the other sign, is so good.
struct ScoreReached {
  double score;
  bool operator()(const BestHistory& history, std::size_t) const {
    return !history.empty() && history.entries().back().score >= score;
  }
};
/// One of several rules holds, or each of them.
template <StopRule... Stops>
auto anyOf(Stops... stops) {
  return [=](const BestHistory& history, std::size_t draws) { return (stops(history, draws) || ...); };
}
template <StopRule... Stops>
auto allOf(Stops... stops) {
  return [=](const BestHistory& history, std::size_t draws) { return (stops(history, draws) && ...); };
}

namespace detail {
/// The smallest T with 1 - (1 - p)^T ≥ confidence.
inline std::size_t trialsUntil(double p, double confidence) {
  constexpr std::size_t never = std::numeric_limits<std::size_t>::max();
  if (confidence <= 0) return 0;
  if (!(p > 0) || !(confidence < 1)) return never;
  if (p >= 1) return 1;
  const double trials = std::ceil(std::log1p(-confidence) / std::log1p(-p) * (1 - 1e-12));
  return trials < 1e18 ? static_cast<std::size_t>(trials) : never;
}
}  // namespace detail

/// How many random samples hold with probability `confidence` one of inliers alone, (25) with the share w of inliers
/// where the report has that of outliers: 1 - (1 - w^s)^T. The largest number where no number is enough.
inline std::size_t sampleCount(double inlier_share, std::size_t sample_size, double confidence) {
  return detail::trialsUntil(std::pow(inlier_share, static_cast<double>(sample_size)), confidence);
}
/// The same for samples of distinct measurements: fewer inliers are left after each draw.
inline std::size_t sampleCount(std::size_t inliers, std::size_t measurements, std::size_t sample_size,
                               double confidence) {
  double p = 1;
  for (std::size_t k = 0; k < sample_size; ++k) {
    p *= inliers > k && measurements > k ? static_cast<double>(inliers - k) / static_cast<double>(measurements - k) : 0;
  }
  return detail::trialsUntil(p, confidence);
}

}  // namespace liestat
