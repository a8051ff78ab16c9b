// Features and weights as the kernels read them: where they are if memory holds them at equal distances, else copied a
// block at a time.
#pragma once

#include <lie/detail/columns.hpp>
#include <lie/detail/kernel.hpp>
#include <lie/detail/pack.hpp>
#include <lie/manifold.hpp>

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <memory>
#include <ranges>
#include <type_traits>

namespace liestat::detail {

template <class M>
concept TellsParameters = requires(const M& x) {
  ManifoldTraits<M>::parameters(x);
};
/// The numbers of a feature in memory, one after the other.
template <class M>
const auto* parametersOf(const M& x) requires(TellsParameters<M> || requires { x.data(); }) {
  if constexpr (TellsParameters<M>) {
    return ManifoldTraits<M>::parameters(x);
  } else {
    return x.data();
  }
}
/// Features of double or float that have them.
template <class M>
concept HasParameterMemory = PackScalar<typename ManifoldTraits<M>::Scalar> && requires(const M& x) {
  { parametersOf(x) } -> std::convertible_to<const typename ManifoldTraits<M>::Scalar*>;
};

/// A range of M in one piece of memory.
template <class R, class M>
concept ContiguousFeatures = std::ranges::contiguous_range<const R> &&
    std::is_same_v<std::remove_cvref_t<std::ranges::range_reference_t<const R>>, M>;

/// Parameters of at most `size` features, `numbers` each.
template <class M, std::size_t numbers, std::size_t size>
class FeatureBlock {
  using T = ManifoldTraits<M>;
  using S = typename T::Scalar;

 public:
  /// The features begin … begin + count - 1; valid until the next call.
  template <class R>
  Layout<const S> layout(const R& samples, std::size_t begin, std::size_t count) {
    if constexpr (requires { samples.layout(); }) {
      Layout<const S> features = samples.layout();
      features.data = features.at(begin, 0);
      return features;
    } else if constexpr (ContiguousFeatures<R, M> && sizeof(M) % sizeof(S) == 0) {
      const M* const first = std::to_address(std::ranges::begin(samples)) + begin;
      constexpr std::size_t element = sizeof(M) / sizeof(S);
      return {parametersOf(*first), element, 1, readAhead<S>(std::ranges::size(samples) * element)};
    } else {
      if constexpr (requires { samples.layoutFrom(begin); }) {
        const Layout<const S> features = samples.layoutFrom(begin);
        if (features.data != nullptr) return features;
      }
      for (std::size_t i = 0; i < count; ++i) {
        const M& x = samples[begin + i];
        const S* const p = parametersOf(x);
        for (std::size_t c = 0; c < numbers; ++c) copies_[i * numbers + c] = p[c];
      }
      return {copies_, numbers, 1, 0};
    }
  }

 private:
  S copies_[numbers * size];
};

/// At most `size` weights.
template <class S, std::size_t size>
class WeightBlock {
 public:
  /// The weights begin … begin + count - 1; valid until the next call.
  template <class W>
  const S* weights(const W& weights, std::size_t begin, std::size_t count) {
    if constexpr (ContiguousFeatures<W, S>) {
      return std::to_address(std::ranges::begin(weights)) + begin;
    } else {
      for (std::size_t i = 0; i < count; ++i) copies_[i] = static_cast<S>(weights[begin + i]);
      return copies_;
    }
  }

 private:
  S copies_[size];
};

/// Runs a kernel on the features begin … end - 1, `numbers` parameters each, as many at a time as it takes, and calls
/// each(begin of these) after every run, until that is false. The kernel's arguments are features, weights and count.
template <class Kernel, class M, std::size_t numbers, bool Weighted, class R, class W, class Each>
bool runOnFeatures(InstructionSet set, const R& samples, const W& weights, std::size_t begin, std::size_t end,
                   typename Kernel::Arguments& arguments, const Each& each) {
  using S = typename ManifoldTraits<M>::Scalar;
  FeatureBlock<M, numbers, Kernel::max_count> features;
  WeightBlock<S, Weighted ? Kernel::max_count : 1> values;
  for (std::size_t i = begin; i < end; i += Kernel::max_count) {
    arguments.count = std::min(end - i, Kernel::max_count);
    arguments.features = features.layout(samples, i, arguments.count);
    if constexpr (Weighted) arguments.weights = values.weights(weights, i, arguments.count);
    runKernel<Kernel>(set, arguments);
    if (!each(i)) return false;
  }
  return true;
}

/// The excess of a unit vector's squared length up to which unitScale holds.
template <class S>
inline constexpr S largest_excess = std::same_as<S, float> ? S(1e-3) : S(1e-5);

}  // namespace liestat::detail
