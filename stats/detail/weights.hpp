// Weights are relative: only their ratios mean anything. Estimators therefore see weights whose squares and products
// with the data can be represented, and only the data whose weight is not zero.
#pragma once

#include <stats/detail/mean_pass.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/status.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat::detail {

/// A result that says nothing but why there is none.
template <class Result>
Result without(Status status) {
  Result result;
  result.status = status;
  return result;
}
template <class Result>
Result without(Status status, const char* reason) {
  Result result = without<Result>(status);
  result.reason = reason;
  return result;
}

inline constexpr const char* bad_weights_reason =
    "a weight is negative or not finite, or there is none above zero for every feature";

/// As many ones. An estimator that is dear to compile and not to run takes these where it is given no weights, and so is
/// instantiated once and not twice.
inline Samples<double> ones(std::size_t n) { return Samples<double>(std::vector<double>(n, 1.0)); }

/// How weights become relative ones. Those whose largest is within 2^±30 stay as they are; others are multiplied by a
/// power of two, which rounds nothing, until the largest is in [1, 2). A weight so far below the largest that the square
/// of their ratio is no number of the scalar counts as zero.
struct WeightScale {
  bool valid = false;  ///< all are finite, none is negative, one is positive
  bool exact = false;  ///< nothing is to be scaled or left out
  std::size_t kept = 0;
  int exponent = 0;
  double least = 0;

  bool keeps(double weight) const { return weight > least; }
  double operator()(double weight) const { return keeps(weight) ? std::ldexp(weight, exponent) : 0; }
};

template <class S, class W>
WeightScale weightScale(const W& weights, std::size_t n) {
  using Real = std::conditional_t<std::is_floating_point_v<S>, S, double>;
  WeightScale scale;
  double largest = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double p = static_cast<double>(weights[i]);
    if (!(p >= 0) || !std::isfinite(p)) return scale;
    largest = std::max(largest, p);
  }
  scale.valid = n == 0 || largest > 0;
  if (!(largest > 0)) return scale;
  const int exponent = std::ilogb(largest);
  if (std::abs(exponent) > 30) scale.exponent = -exponent;
  scale.least = largest * std::sqrt(static_cast<double>(std::numeric_limits<Real>::min()));
  for (std::size_t i = 0; i < n; ++i) scale.kept += scale.keeps(static_cast<double>(weights[i])) ? 1U : 0U;
  scale.exact = scale.exponent == 0 && scale.kept == n;
  return scale;
}

/// The rows of the data that an estimator sees.
class KeptRows {
 public:
  KeptRows() = default;
  explicit KeptRows(std::vector<std::size_t> rows) : rows_(std::move(rows)), all_(false) {}

  /// The row of the i-th feature that is seen.
  std::size_t operator[](std::size_t i) const { return all_ ? i : rows_[i]; }
  /// The elements that belong to the features that are seen; one value for all, and an empty list, stay as they are.
  template <class T>
  std::vector<T> of(const std::vector<T>& list) const {
    if (all_ || list.size() < 2) return list;
    std::vector<T> some;
    some.reserve(rows_.size());
    for (const std::size_t row : rows_) some.push_back(list[row]);
    return some;
  }

 private:
  std::vector<std::size_t> rows_;
  bool all_ = true;
};

/// estimate(features, weights, rows) of the features with positive weights and these weights made relative; otherwise(),
/// which returns the same type, where the weights are bad or there is none for every feature. Nothing is copied where
/// there is nothing to do.
template <class M, class R, class W, class Estimate, class Otherwise>
auto withRelativeWeights(const R& samples, const W& weights, const Estimate& estimate, const Otherwise& otherwise) {
  eigen_assert(haveOneSize(samples, weights));
  const std::size_t n = samples.size();
  const WeightScale scale = haveOneSize(samples, weights) ? weightScale<ScalarOf<M>>(weights, n) : WeightScale{};
  if (!scale.valid) return otherwise();
  if (n == 0 || scale.exact) return estimate(samples, weights, KeptRows());
  std::vector<double> relative;
  relative.reserve(scale.kept);
  for (std::size_t i = 0; i < n; ++i) {
    const double p = static_cast<double>(weights[i]);
    if (scale.keeps(p)) relative.push_back(scale(p));
  }
  const Samples<double> numbers(std::move(relative));
  if (scale.kept == n) return estimate(samples, numbers, KeptRows());
  std::vector<M> features;
  std::vector<std::size_t> rows;
  features.reserve(scale.kept), rows.reserve(scale.kept);
  for (std::size_t i = 0; i < n; ++i) {
    if (scale.keeps(static_cast<double>(weights[i]))) features.push_back(samples[i]), rows.push_back(i);
  }
  return estimate(Samples<M>(std::move(features)), numbers, KeptRows(std::move(rows)));
}

}  // namespace liestat::detail
