// Averages in an embedding space, a register of features at a time: Σ p c cᵀ and Σ p c of their parameters c.
#pragma once

#include <lie/detail/chordal.hpp>
#include <lie/detail/columns.hpp>
#include <lie/detail/kernel.hpp>
#include <lie/detail/pack.hpp>
#include <stats/detail/feature_layout.hpp>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <utility>

namespace liestat::detail {

/// Row and column of an entry of a lower triangle, row by row.
constexpr std::size_t triangleRow(std::size_t entry) {
  std::size_t i = 0;
  while ((i + 1) * (i + 2) / 2 <= entry) ++i;
  return i;
}
constexpr std::size_t triangleColumn(std::size_t entry) {
  return entry - triangleRow(entry) * (triangleRow(entry) + 1) / 2;
}
/// sums += the lower triangle of a bᵀ.
template <class P, std::size_t N, std::size_t K, std::size_t... Entry>
LIESTAT_ALWAYS_INLINE void addOuter(P (&sums)[N], const P (&a)[K], const P (&b)[K], std::index_sequence<Entry...>) {
  ((sums[Entry] += a[triangleRow(Entry)] * b[triangleColumn(Entry)]), ...);
}

/// 1/√(1 + excess), to second order.
template <class P>
LIESTAT_ALWAYS_INLINE P unitScale(const P& excess) {
  using S = typename P::Scalar;
  return S(1) - excess * (S(0.5) - S(0.375) * excess);
}

/// The sums that every mean makes of its residuals v: Σ p |v|², Σ p v, and with Scatter the largest |v|², Σ p v vᵀ and
/// Σ p² v vᵀ, these by their lower triangles, and of the angles θ the largest θ² and Σ p θ⁴. Without Weighted all p are
/// one.
template <class P, std::size_t K, bool Weighted, bool Scatter>
struct ResidualSums {
  using S = typename P::Scalar;
  static constexpr std::size_t entries = K * (K + 1) / 2;
  P cost = P::zero(), largest = P::zero(), weight = P::zero(), gradient[K], scatter[entries], squared[entries];
  P largest_angle = P::zero(), fourth = P::zero();

  LIESTAT_ALWAYS_INLINE ResidualSums() {
    LIESTAT_UNROLL for (P& x : gradient) x = P::zero();
    LIESTAT_UNROLL for (P& x : scatter) x = P::zero();
    LIESTAT_UNROLL for (P& x : squared) x = P::zero();
  }
  LIESTAT_ALWAYS_INLINE void addAngle(const P& angle2, const P& p) {
    if constexpr (Scatter) {
      largest_angle = larger(angle2, largest_angle);
      if constexpr (Weighted) {
        fourth += angle2 * angle2 * p;
      } else {
        fourth += angle2 * angle2;
      }
    }
  }
  LIESTAT_ALWAYS_INLINE void add(const P (&v)[K], const P& length2, const P& p) {
    P weighted[K], weighted_length2 = length2;
    LIESTAT_UNROLL for (std::size_t a = 0; a < K; ++a) weighted[a] = v[a];
    if constexpr (Weighted) {
      weight += p;
      weighted_length2 *= p;
      LIESTAT_UNROLL for (std::size_t a = 0; a < K; ++a) weighted[a] *= p;
    }
    cost += weighted_length2;
    LIESTAT_UNROLL for (std::size_t a = 0; a < K; ++a) gradient[a] += weighted[a];
    if constexpr (Scatter) {
      largest = larger(length2, largest);
      addOuter(scatter, v, weighted, std::make_index_sequence<entries>());
      if constexpr (Weighted) addOuter(squared, weighted, weighted, std::make_index_sequence<entries>());
    }
  }
  /// Over the lanes; the cost is half of Σ p |v|².
  template <class Arguments>
  LIESTAT_ALWAYS_INLINE void finish(Arguments& arguments) const {
    arguments.weight = Weighted ? sumOf(weight) : static_cast<S>(arguments.count);
    arguments.cost = S(0.5) * sumOf(cost);
    arguments.largest = largestOf(largest);
    arguments.largest_angle = largestOf(largest_angle);
    arguments.fourth = sumOf(fourth);
    LIESTAT_UNROLL for (std::size_t a = 0; a < K; ++a) arguments.gradient[a] = sumOf(gradient[a]);
    LIESTAT_UNROLL for (std::size_t a = 0; a < entries; ++a) {
      arguments.scatter[a] = sumOf(scatter[a]);
      arguments.squared[a] = Weighted ? sumOf(squared[a]) : arguments.scatter[a];
    }
  }
};

/// Σ p c cᵀ and Σ p c; Sums a ParameterSums.
template <class S, class Sums, bool Weighted>
struct MomentKernel {
  static constexpr std::size_t max_count = 1024;
  struct Arguments {
    Layout<const S> features;
    const S* weights = nullptr;
    std::size_t count = 0;
    S product[Sums::entries > 0 ? Sums::entries : 1], sum[Sums::linear > 0 ? Sums::linear : 1], weight;

    void addTo(Sums& sums) const {
      for (std::size_t i = 0; i < Sums::entries; ++i) sums.product[i] += product[i];
      for (std::size_t i = 0; i < Sums::linear; ++i) sums.sum[i] += sum[i];
      sums.weight += weight, sums.count += static_cast<S>(count);
    }
  };

  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(Arguments& arguments) {
    using P = Pack<Set, S>;
    constexpr std::size_t outer = Sums::outer, linear = Sums::linear, entries = Sums::entries, block = 64;
    constexpr std::size_t columns = (outer + linear + 3) / 4 * 4 + 1;
    alignas(64) S data[columns][block];
    P product[entries > 0 ? entries : 1], sum[linear > 0 ? linear : 1];
    LIESTAT_UNROLL for (P& x : product) x = P::zero();
    LIESTAT_UNROLL for (P& x : sum) x = P::zero();
    S weight = 0;
    for (std::size_t i = 0; i < arguments.count; i += block) {
      const std::size_t count = std::min(arguments.count - i, block);
      loadAll<P, 0>(arguments.features, i, count, data);
      if constexpr (Weighted) {
        std::memcpy(data[columns - 1], arguments.weights + i, count * sizeof(S));
        for (std::size_t j = 0; j < count; ++j) weight += data[columns - 1][j];
      }
      if constexpr (Weighted) {
        for (std::size_t j = count; j % P::size != 0; ++j) data[columns - 1][j] = 0;
      }
      for (std::size_t j = 0; j < count; j += P::size) {
        P c[outer + linear], weighted[outer + linear];
        LIESTAT_UNROLL for (std::size_t a = 0; a < outer + linear; ++a) {
          c[a] = P::load(data[a] + j);
          weighted[a] = c[a];
          if constexpr (Weighted) weighted[a] *= P::load(data[columns - 1] + j);
        }
        addOuter(product, c, weighted, std::make_index_sequence<entries>());
        LIESTAT_UNROLL for (std::size_t a = 0; a < linear; ++a) sum[a] += weighted[outer + a];
      }
    }
    LIESTAT_UNROLL for (std::size_t a = 0; a < entries; ++a) arguments.product[a] = sumOf(product[a]);
    LIESTAT_UNROLL for (std::size_t a = 0; a < linear; ++a) arguments.sum[a] = sumOf(sum[a]);
    arguments.weight = Weighted ? weight : static_cast<S>(arguments.count);
  }

 private:
  /// Four columns at a time while there are four, then the rest.
  template <class P, std::size_t first, std::size_t columns, std::size_t block>
  LIESTAT_ALWAYS_INLINE static void loadAll(const Layout<const S>& from, std::size_t begin, std::size_t count,
                                            S (&data)[columns][block]) {
    constexpr std::size_t left = Sums::outer + Sums::linear - first;
    const S zeros[4] = {};
    if constexpr (left >= 4) {
      loadFilled<P, 4>(from, first, begin, count, zeros, data + first);
      loadAll<P, first + 4>(from, begin, count, data);
    } else if constexpr (left > 0) {
      loadFilled<P, left>(from, first, begin, count, zeros, data + first);
    }
  }
};

/// Chordal moments that kernels can make.
template <class M>
concept HasParameterSums = HasChordalMoments<M> && HasParameterMemory<M> &&
    requires(typename ManifoldTraits<M>::ChordalMoments moments,
             const typename ManifoldTraits<M>::ChordalMoments::Sums& sums) {
  moments.add(sums);
};

/// The parameters' sums over the features begin … end-1; Weighted false takes all weights as one.
template <HasParameterSums M, bool Weighted, class R, class W>
auto parameterSums(InstructionSet set, const R& samples, const W& weights, std::size_t begin, std::size_t end) {
  using S = typename ManifoldTraits<M>::Scalar;
  using Sums = typename ManifoldTraits<M>::ChordalMoments::Sums;
  using Kernel = MomentKernel<S, Sums, Weighted>;
  Sums sums;
  typename Kernel::Arguments arguments;
  runOnFeatures<Kernel, M, Sums::outer + Sums::linear, Weighted>(set, samples, weights, begin, end, arguments,
                                                                 [&](std::size_t) {
                                                                   arguments.addTo(sums);
                                                                   return true;
                                                                 });
  return sums;
}

}  // namespace liestat::detail
