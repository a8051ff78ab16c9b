// One pass of the Fréchet mean over the data: the sums at a candidate mean, in chunks combined in order.
#pragma once

#include <lie/manifold.hpp>
#include <stats/detail/compact_part.hpp>
#include <stats/detail/factor_range.hpp>
#include <stats/detail/kernel_sums.hpp>
#include <stats/detail/mean_sums.hpp>
#include <stats/detail/scatter_kernel.hpp>
#include <stats/detail/weights_of_one.hpp>
#include <stats/executor.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <ranges>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat::detail {

/// True if there is a weight for every datum.
template <class R, class W>
bool haveOneSize(const R& samples, const W& weights) {
  if constexpr (std::is_same_v<W, UnitWeights>) {
    return true;
  } else {
    return std::ranges::size(samples) == std::ranges::size(weights);
  }
}

/// Σ over the data in fixed chunks combined in order: same bits on any executor.
template <class Sums, Executor E, class Term>
Sums sumOverData(const E& executor, std::size_t n, const Term& term) {
  const std::size_t chunks = chunkCount(n);
  return executor.reduce(
      chunks,
      [&](std::size_t chunk) {
        Sums sums;
        const ChunkRange range = chunkRange(n, chunks, chunk);
        for (std::size_t i = range.begin; i < range.end; ++i) term(i, sums);
        return sums;
      },
      [](Sums& a, const Sums& b) { a += b; });
}

struct IgnoreTerm {
  template <class... T>
  void operator()(const T&...) const {}
};

/// The terms of the features in a range of indices, by the manifold's own operations. Calls each(index, feature in the
/// frame of y, its log).
template <bool Scatter, Metric M, class R, class W, class Each = IgnoreTerm>
void addTerms(const R& samples, const W& weights, const M& y, const ChunkRange& range, MeanPass<M>& pass,
              const Each& each = {}) {
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  using std::sqrt;
  constexpr bool weighted = !std::is_same_v<W, UnitWeights>;
  const typename T::Group to_mean = T::placement(y).inverse();
  const TangentOf<M> metric = T::metricWeights();
  for (std::size_t i = range.begin; i < range.end; ++i) {
    const S p = S(weights[i]);
    const M at_mean = T::act(to_mean, M(samples[i]));
    const TangentOf<M> z = T::logOrigin(at_mean);
    const TangentOf<M> wz = metric.cwiseProduct(z);
    const S squared_distance = z.dot(wz);
    pass.sums.cost += S(0.5) * p * squared_distance;
    // An inverse tangent makes a finite angle of infinite numbers.
    if constexpr (requires { at_mean.params().allFinite(); }) {
      if (!at_mean.params().allFinite()) pass.sums.cost = std::numeric_limits<S>::quiet_NaN();
    }
    pass.sums.gradient += p * wz;
    pass.sums.hessian += p * T::hessianHalfSquaredDistance(z);
    pass.sums.weight += weights[i];
    each(i, at_mean, z);
    if constexpr (Scatter) {
      const SquareOf<M> outer = p * z * z.transpose();
      pass.scatter.scatter += outer;
      if constexpr (weighted) pass.scatter.squared += p * outer;
      pass.scatter.largest = std::max(pass.scatter.largest, S(sqrt(squared_distance)));
      if constexpr (has_compact_factor<M>) {
        const S angle2 = z.template segment<compact_dimension<M>>(T::compact_begin).squaredNorm();
        pass.scatter.largest_angle = std::max(pass.scatter.largest_angle, S(sqrt(angle2)));
        pass.scatter.fourth += weights[i] * static_cast<double>(angle2) * static_cast<double>(angle2);
      }
      if constexpr (Quotient<M>) {
        pass.scatter.smallest_gap = std::min(pass.scatter.smallest_gap, T::nearestRepresentative(at_mean).gap());
      }
    }
  }
  if constexpr (Scatter && !weighted) pass.scatter.squared = pass.scatter.scatter;
}

template <KernelPass Pass, Metric M, class R, class W>
bool addTermsByPacks(InstructionSet set, const R& samples, const W& weights, const M& y, const ChunkRange& range,
                     MeanPass<M>& pass, ResidualColumns<ScalarOf<M>> residuals = nullptr);

/// Called by addTerms, stores the residuals of features from `begin` on and the smallest gap; without columns nothing.
template <Metric Factor>
struct StoreResiduals {
  ResidualColumns<ScalarOf<Factor>> columns;
  std::size_t begin;
  ScalarOf<Factor>& smallest_gap;

  void operator()(std::size_t i, const Factor& at_mean, const TangentOf<Factor>& z) const {
    if (columns == nullptr) return;
    for (Eigen::Index c = 0; c < z.size(); ++c) columns[c][i - begin] = z[c];
    if constexpr (Quotient<Factor>) {
      smallest_gap =
          std::min(smallest_gap, ScalarOf<Factor>(ManifoldTraits<Factor>::nearestRepresentative(at_mean).gap()));
    }
  }
};

/// The terms of the I-th factors of products: cost, gradient and Hessian are those of the factors. The scatter is not: it
/// has blocks of two factors.
template <KernelPass Pass, std::size_t I, Metric M, class R, class W>
void addTermsOfFactor(InstructionSet set, const R& samples, const W& weights, const M& y, const ChunkRange& range,
                      MeanPass<M>& pass, ResidualColumns<ScalarOf<M>> residuals) {
  using Factor = std::tuple_element_t<I, FactorsOf<M>>;
  constexpr int k = ManifoldTraits<Factor>::DoF, begin = factorOffset<I, M>();
  const FactorRange<I, M, R> factors{samples};
  const Factor at = std::get<I>(ManifoldTraits<M>::factors(y));
  MeanPass<Factor> part;
  const ResidualColumns<ScalarOf<M>> columns = Pass == KernelPass::residuals ? residuals + begin : nullptr;
  if (!addTermsByPacks<Pass>(set, factors, weights, at, range, part, columns)) {
    part = {};
    addTerms<false>(factors, weights, at, range, part,
                    StoreResiduals<Factor>{columns, range.begin, part.scatter.smallest_gap});
    if constexpr (Pass == KernelPass::residuals) {
      for (std::size_t j = range.size(); j % largest_pack != 0; ++j) {
        for (int c = 0; c < k; ++c) columns[c][j] = 0;
      }
    }
  }
  pass.sums.cost += part.sums.cost;
  pass.sums.gradient.template segment<k>(begin) += part.sums.gradient;
  pass.sums.hessian.template block<k, k>(begin, begin) += part.sums.hessian;
  if constexpr (I == 0) pass.sums.weight += part.sums.weight;
  pass.scatter.smallest_gap = std::min(pass.scatter.smallest_gap, part.scatter.smallest_gap);
}
template <KernelPass Pass, Metric M, class R, class W>
void addTermsOfFactors(InstructionSet set, const R& samples, const W& weights, const M& y, const ChunkRange& range,
                       MeanPass<M>& pass, ResidualColumns<ScalarOf<M>> residuals) {
  [&]<std::size_t... I>(std::index_sequence<I...>) {
    (addTermsOfFactor<Pass, I>(set, samples, weights, y, range, pass, residuals), ...);
  }
  (std::make_index_sequence<std::tuple_size_v<FactorsOf<M>>>{});
}

/// A product's last pass: a block of features at a time, first its factors, then the scatter of their residuals.
template <Metric M, class R, class W>
void addTermsWithScatter(InstructionSet set, const R& samples, const W& weights, const M& y, const ChunkRange& range,
                         MeanPass<M>& pass) {
  using S = ScalarOf<M>;
  using Kernel = ScatterKernel<S, !std::is_same_v<W, UnitWeights>>;
  constexpr auto k = static_cast<std::size_t>(ManifoldTraits<M>::DoF),
                 columns = (k + scatter_tile - 1) / scatter_tile * scatter_tile;
  alignas(64) S residuals[columns][residual_block];
  alignas(64) S weight[residual_block];
  S metric[columns] = {}, scatter[columns * columns], squared[columns * columns];
  const TangentOf<M> metric_weights = ManifoldTraits<M>::metricWeights();
  std::copy_n(metric_weights.data(), k, metric);
  for (std::size_t c = k; c < columns; ++c) std::fill_n(residuals[c], residual_block, S(0));
  typename Kernel::Arguments arguments;
  arguments.residuals = residuals, arguments.weights = weight, arguments.metric = metric, arguments.columns = columns;
  arguments.scatter = scatter, arguments.squared = squared;
  for (std::size_t i = range.begin; i < range.end; i += residual_block) {
    const ChunkRange block{i, std::min(i + residual_block, range.end)};
    addTermsOfFactors<KernelPass::residuals>(set, samples, weights, y, block, pass, residuals);
    arguments.count = block.size();
    if constexpr (!std::is_same_v<W, UnitWeights>) {
      for (std::size_t j = 0; j < arguments.count; ++j) weight[j] = static_cast<S>(weights[i + j]);
      for (std::size_t j = arguments.count; j % largest_pack != 0; ++j) weight[j] = 0;
    }
    runKernel<Kernel>(set, arguments);
    const auto add = [](SquareOf<M>& sum, const S* entries) {
      for (std::size_t a = 0; a < k; ++a) {
        for (std::size_t b = 0; b <= a; ++b) {
          sum(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b)) += entries[a * columns + b];
        }
      }
    };
    add(pass.scatter.scatter, scatter);
    if constexpr (!std::is_same_v<W, UnitWeights>) add(pass.scatter.squared, squared);
    pass.scatter.largest = std::max(pass.scatter.largest, static_cast<S>(std::sqrt(arguments.largest)));
    if constexpr (has_compact_factor<M>) {
      constexpr int begin = ManifoldTraits<M>::compact_begin;
      for (std::size_t j = 0; j < arguments.count; ++j) {
        S angle2 = 0;
        for (int c = begin; c < begin + compact_dimension<M>; ++c) angle2 += residuals[c][j] * residuals[c][j];
        pass.scatter.largest_angle = std::max(pass.scatter.largest_angle, static_cast<S>(std::sqrt(angle2)));
        pass.scatter.fourth +=
            static_cast<double>(weights[i + j]) * static_cast<double>(angle2) * static_cast<double>(angle2);
      }
    }
  }
  if constexpr (std::is_same_v<W, UnitWeights>) pass.scatter.squared = pass.scatter.scatter;
  for (SquareOf<M>* m : {&pass.scatter.scatter, &pass.scatter.squared}) {
    m->template triangularView<Eigen::StrictlyUpper>() = m->transpose();
  }
}

/// Products one of whose factors has a kernel. Oriented points and essential matrices are none: their positions and
/// rotations turn with their directions.
template <class M>
constexpr bool hasFactorSums() {
  if constexpr (HasFramesOfFactors<M> && !HasKernelSums<M>) {
    return []<class... Factor>(std::type_identity<std::tuple<Factor...>>) {
      return ((HasKernelSums<Factor> || hasFactorSums<Factor>()) || ...);
    }(std::type_identity<FactorsOf<M>>());
  } else {
    return false;
  }
}

/// The same several features at a time, to the sums of an empty pass, for the manifolds that have it. False, and nothing
/// of value in the pass, where that does not apply to the data; never of a product one of whose factors has a kernel.
template <KernelPass Pass, Metric M, class R, class W>
bool addTermsByPacks(InstructionSet set, const R& samples, const W& weights, const M& y, const ChunkRange& range,
                     MeanPass<M>& pass, [[maybe_unused]] ResidualColumns<ScalarOf<M>> residuals) {
  if constexpr (HasKernelSums<M>) {
    constexpr bool weighted = !std::is_same_v<W, UnitWeights>;
    return KernelSumsOf<M>::type::template add<weighted, Pass>(set, samples, weights, range.begin, range.end, y, pass,
                                                               residuals);
  } else if constexpr (hasFactorSums<M>()) {
    if constexpr (Pass == KernelPass::last) {
      addTermsWithScatter(set, samples, weights, y, range, pass);
    } else {
      addTermsOfFactors<Pass>(set, samples, weights, y, range, pass, residuals);
    }
    return true;
  } else {
    return false;
  }
}

template <bool Scatter, Metric M, Executor E, class R, class W>
MeanPass<M> meanPass(const E& executor, const R& samples, const W& weights, const M& y) {
  const std::size_t n = std::ranges::size(samples), chunks = chunkCount(n);
  const InstructionSet set = instructionSetOf(executor);
  MeanPass<M> pass = executor.reduce(
      chunks,
      [&](std::size_t chunk) {
        MeanPass<M> part;
        const ChunkRange range = chunkRange(n, chunks, chunk);
        if (!addTermsByPacks < Scatter ? KernelPass::last
                                       : KernelPass::step > (set, samples, weights, y, range, part)) {
          if constexpr (!hasFactorSums<M>()) {
            part = {};
            addTerms<Scatter>(samples, weights, y, range, part);
          }
        }
        return part;
      },
      [](MeanPass<M>& a, const MeanPass<M>& b) { a += b; });
  pass.has_scatter = Scatter;
  return pass;
}

/// One pass at a candidate mean. The one that is expected to be the last collects the scatter too.
template <Metric M, Executor E, class R, class W>
MeanPass<M> meanPass(const E& executor, const R& samples, const W& weights, const M& y, bool with_scatter) {
  return with_scatter ? meanPass<true>(executor, samples, weights, y) : meanPass<false>(executor, samples, weights, y);
}

}  // namespace liestat::detail
