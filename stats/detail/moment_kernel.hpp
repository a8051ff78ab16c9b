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

/// The sums that a kernel collects besides cost, gradient and Hessian.
enum class KernelPass {
  step,      ///< nothing; the Hessian is good to eight digits, as Newton's method needs it
  last,      ///< the scatter; the Hessian is exact
  residuals  ///< the residuals of a factor of a product, for the scatter of the product; the Hessian is exact
};
/// Features per call, at most, whose residuals are stored: one column for each coordinate of the tangent space.
inline constexpr std::size_t residual_block = 256;
template <class S>
using ResidualColumns = S (*)[residual_block];

template <class P, std::size_t K>
LIESTAT_ALWAYS_INLINE void storeResiduals(const P (&z)[K], ResidualColumns<typename P::Scalar> columns,
                                          std::size_t feature) {
  LIESTAT_UNROLL for (std::size_t c = 0; c < K; ++c) z[c].store(columns[c] + feature);
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
    Run<P> sums;
    alignas(64) S data[numbers + 1][block];
    for (std::size_t i = 0; i < arguments.count; i += block) {
      const std::size_t count = std::min(arguments.count - i, block);
      if constexpr (Weighted) {
        std::memcpy(data[numbers], arguments.weights + i, count * sizeof(S));
        for (std::size_t j = count; j % P::size != 0; ++j) data[numbers][j] = 0;
      }
      if constexpr (loads_rows<P> && numbers >= 4) {
        if (arguments.features.component == 1) {
          sums.template addAll<true>(data, arguments.features, i, count);
          continue;
        }
      }
      sums.template addAll<false>(data, arguments.features, i, count);
    }
    LIESTAT_UNROLL for (std::size_t a = 0; a < entries; ++a) arguments.product[a] = sumOf(sums.product[a]);
    LIESTAT_UNROLL for (std::size_t a = 0; a < linear; ++a) arguments.sum[a] = sumOf(sums.sum[a]);
    arguments.weight = Weighted ? sumOf(sums.weight) : static_cast<S>(arguments.count);
  }

 private:
  static constexpr std::size_t outer = Sums::outer, linear = Sums::linear, numbers = outer + linear,
                               entries = Sums::entries, block = 64;

  template <class P>
  struct Run {
    P product[entries > 0 ? entries : 1], sum[linear > 0 ? linear : 1], weight = P::zero();

    LIESTAT_ALWAYS_INLINE Run() {
      LIESTAT_UNROLL for (P& x : product) x = P::zero();
      LIESTAT_UNROLL for (P& x : sum) x = P::zero();
    }
    /// Features i …: by rows of four numbers, the last four of them again where they are not a multiple of four, else by
    /// way of columns. The lanes beyond the last feature are zero.
    template <bool ByRows>
    LIESTAT_ALWAYS_INLINE void addAll(S (&data)[numbers + 1][block], const Layout<const S>& features, std::size_t i,
                                      std::size_t count) {
      const S zeros[numbers] = {};
      if constexpr (!ByRows) loadFilled<P, numbers>(features, 0, i, count, zeros, data);
      for (std::size_t j = 0; j < count; j += P::size) {
        P c[numbers], weighted[numbers];
        if constexpr (ByRows) {
          P last[4], four[4];
          loadRows(features, numbers - 4, i + j, count - j, zeros, last);
          LIESTAT_UNROLL for (std::size_t first = 0; first + 4 < numbers; first += 4) {
            loadRows(features, first, i + j, count - j, zeros, four);
            LIESTAT_UNROLL for (std::size_t a = 0; a < 4; ++a) c[first + a] = four[a];
          }
          LIESTAT_UNROLL for (std::size_t a = 0; a < 4; ++a) c[numbers - 4 + a] = last[a];
        } else {
          LIESTAT_UNROLL for (std::size_t a = 0; a < numbers; ++a) c[a] = P::load(data[a] + j);
        }
        LIESTAT_UNROLL for (std::size_t a = 0; a < numbers; ++a) weighted[a] = c[a];
        if constexpr (Weighted) {
          const P p = P::load(data[numbers] + j);
          weight += p;
          LIESTAT_UNROLL for (std::size_t a = 0; a < numbers; ++a) weighted[a] *= p;
        }
        addOuter(product, c, weighted, std::make_index_sequence<entries>());
        LIESTAT_UNROLL for (std::size_t a = 0; a < linear; ++a) sum[a] += weighted[outer + a];
      }
    }
  };
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
