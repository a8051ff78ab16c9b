// The Metric manifold whose mean says what is known about another estimate of the same data: the manifold itself, or
// the twin that its traits name.
#pragma once

#include <lie/manifold.hpp>

#include <cstddef>
#include <ranges>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat::detail {

template <Homogeneous M>
inline constexpr bool has_metric_twin = Metric<M> || HasMetricTwin<M>;

template <Homogeneous M>
auto toTwin(const M& x) {
  if constexpr (Metric<M>) {
    return x;
  } else {
    return ManifoldTraits<M>::metricTwin(x);
  }
}
template <Homogeneous M>
using MetricTwinOf = std::decay_t<decltype(toTwin(std::declval<const M&>()))>;

template <Homogeneous M>
M fromTwin(const MetricTwinOf<M>& x) {
  if constexpr (Metric<M>) {
    return x;
  } else {
    return ManifoldTraits<M>::fromMetricTwin(x);
  }
}

/// The twins of a range of features.
template <Homogeneous M, class R>
std::vector<MetricTwinOf<M>> metricTwins(const R& samples) {
  std::vector<MetricTwinOf<M>> twins;
  const std::size_t n = std::ranges::size(samples);
  twins.reserve(n);
  for (std::size_t i = 0; i < n; ++i) twins.push_back(toTwin<M>(M(samples[i])));
  return twins;
}

}  // namespace liestat::detail
