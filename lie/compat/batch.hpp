// Several elements of a manifold at a time, one in each lane of the processor's vector registers: SO3<Batch<double>>
// and the others, from the same source as their scalars (needs xsimd 8.1 or newer).
//
//   using liestat::Batch;
//   const auto pose = liestat::loadBatch(poses.data());   // SE3<Batch<double>>, from Batch<double>::size poses
//   liestat::storeBatch(pose.inverse(), inverses.data());
//
// expAll and logAll go over ranges of any length. How many lanes there are follows from the flags of the compiler: two
// doubles by default on x86-64, four with -mavx2 -mfma. The header has to come before whatever instantiates a type of
// the library over batches.
//
// Where a formula has two ranges, a batch whose lanes are all in one takes that one alone; a mixed one computes both.
#pragma once

#include <lie/detail/trig.hpp>
#include <lie/manifold.hpp>

#include <xsimd/xsimd.hpp>

#include <array>
#include <bit>
#include <cstddef>
#include <span>
#include <type_traits>
#include <utility>

namespace liestat {

/// As many numbers as a vector register of the target holds.
template <class S>
using Batch = xsimd::batch<S>;

}  // namespace liestat

// Doxygen knows no templates of other namespaces.
/// @cond
/// A batch is a real number to Eigen.
template <class T, class A>
struct Eigen::NumTraits<xsimd::batch<T, A>> : Eigen::GenericNumTraits<T> {
  using Real = xsimd::batch<T, A>;
  using NonInteger = Real;
  using Nested = Real;
  using Literal = Real;
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 1,
    ReadCost = 1,
    AddCost = 1,
    MulCost = 1
  };
};
/// @endcond

namespace liestat {
namespace detail {

/// @cond
template <class A>
inline constexpr bool is_single_precision<xsimd::batch<float, A>> = true;
/// @endcond

/// Lane by lane, a where the mask holds, else b: of batches, of Eigen's matrices of them, and of structures that hold
/// nothing else.
template <class T, class A>
xsimd::batch<T, A> blend(const xsimd::batch_bool<T, A>& mask, const xsimd::batch<T, A>& a,
                         const xsimd::batch<T, A>& b) {
  return xsimd::select(mask, a, b);
}
template <class T, class A, int R, int C, int O>
Eigen::Matrix<xsimd::batch<T, A>, R, C, O> blend(const xsimd::batch_bool<T, A>& mask,
                                                 const Eigen::Matrix<xsimd::batch<T, A>, R, C, O>& a,
                                                 const Eigen::Matrix<xsimd::batch<T, A>, R, C, O>& b) {
  Eigen::Matrix<xsimd::batch<T, A>, R, C, O> result;
  for (int i = 0; i < R * C; ++i) result(i) = xsimd::select(mask, a(i), b(i));
  return result;
}
template <class T, class A, class Aggregate>
  requires std::is_aggregate_v<Aggregate> Aggregate blend(const xsimd::batch_bool<T, A>& mask, const Aggregate& a,
                                                          const Aggregate& b) {
    using Batches = std::array<xsimd::batch<T, A>, sizeof(Aggregate) / sizeof(xsimd::batch<T, A>)>;
    const auto x = std::bit_cast<Batches>(a), y = std::bit_cast<Batches>(b);
    Batches result;
    for (std::size_t i = 0; i < result.size(); ++i) result[i] = xsimd::select(mask, x[i], y[i]);
    return std::bit_cast<Aggregate>(result);
  }

/// Found through the closures, which are of this namespace, where a template calls branch() with a mask of lanes.
template <class T, class A, class F, class G>
auto branch(const xsimd::batch_bool<T, A>& mask, F&& f, G&& g) {
  if (xsimd::all(mask)) return f();
  if (!xsimd::any(mask)) return g();
  return blend(mask, f(), g());
}

/// The type over batches of S.
template <class M>
struct OverBatches {
  using Scalar = typename ManifoldTraits<M>::Scalar;
  using type = std::remove_cvref_t<decltype(std::declval<const M&>().template cast<Batch<Scalar>>())>;
  static constexpr std::size_t lanes = Batch<Scalar>::size;
};

/// Rows of numbers, one row an element, into one batch a column, and back.
template <class S, int N>
void loadRows(const S* rows, Batch<S>* columns, std::size_t count) {
  constexpr std::size_t lanes = Batch<S>::size;
  alignas(Batch<S>) std::array<S, lanes> column;
  for (std::size_t c = 0; c < N; ++c) {
    for (std::size_t i = 0; i < lanes; ++i) column[i] = rows[(i < count ? i : count - 1) * N + c];
    columns[c] = Batch<S>::load_aligned(column.data());
  }
}
template <class S, int N>
void storeRows(const Batch<S>* columns, S* rows, std::size_t count) {
  constexpr std::size_t lanes = Batch<S>::size;
  alignas(Batch<S>) std::array<S, lanes> column;
  for (std::size_t c = 0; c < N; ++c) {
    columns[c].store_aligned(column.data());
    for (std::size_t i = 0; i < count; ++i) rows[i * N + c] = column[i];
  }
}

}  // namespace detail

/// M over batches, for a type M over numbers with parameters: SO3<double> gives SO3<Batch<double>>.
template <class M>
using BatchOf = typename detail::OverBatches<M>::type;
/// How many elements of M are in it.
template <class M>
inline constexpr std::size_t batch_size = detail::OverBatches<M>::lanes;

/// The next batch_size elements. With a count below that, the last element fills the rest.
template <class M>
BatchOf<M> loadBatch(const M* elements, std::size_t count = batch_size<M>) {
  using S = typename M::Scalar;
  typename BatchOf<M>::Params params;
  static_assert(sizeof(M) == M::num_parameters * sizeof(S), "elements lie one behind the other");
  detail::loadRows<S, M::num_parameters>(elements->data(), params.data(), count);
  return BatchOf<M>::fromParams(params);
}
/// Writes the first `count` lanes to as many elements.
template <class M>
void storeBatch(const BatchOf<M>& batch, M* elements, std::size_t count = batch_size<M>) {
  using S = typename M::Scalar;
  detail::storeRows<S, M::num_parameters>(batch.data(), elements->data(), count);
}

namespace detail {

/// out[i] = f(in[i]) for rows of In and Out numbers, f of a column of batches. Rows are turned into columns a block at
/// a time: a vector that is read right after its lanes were stored one by one would wait for them.
template <class S, int In, int Out, class F>
void overBatches(const S* in, S* out, std::size_t n, const F& f) {
  constexpr std::size_t lanes = Batch<S>::size, block = lanes * 8;
  alignas(Batch<S>) std::array<std::array<S, block>, In> source;
  alignas(Batch<S>) std::array<std::array<S, block>, Out> target;
  for (std::size_t begin = 0; begin < n; begin += block) {
    const std::size_t count = n - begin < block ? n - begin : block;
    for (std::size_t i = 0; i < block; ++i) {
      // The last element fills the rest.
      const S* row = in + (begin + (i < count ? i : count - 1)) * In;
      for (std::size_t c = 0; c < In; ++c) source[c][i] = row[c];
    }
    for (std::size_t i = 0; i < count; i += lanes) {
      Eigen::Matrix<Batch<S>, In, 1> x;
      for (std::size_t c = 0; c < In; ++c) x[static_cast<int>(c)] = Batch<S>::load_aligned(&source[c][i]);
      const Eigen::Matrix<Batch<S>, Out, 1> y = f(x);
      for (std::size_t c = 0; c < Out; ++c) y[static_cast<int>(c)].store_aligned(&target[c][i]);
    }
    for (std::size_t i = 0; i < count; ++i) {
      S* row = out + (begin + i) * Out;
      for (std::size_t c = 0; c < Out; ++c) row[c] = target[c][i];
    }
  }
}

}  // namespace detail

/// elements[i] = expOrigin(tangents[i]), the exponential of a group. As many as the shorter range holds.
template <class M>
void expAll(std::span<const typename ManifoldTraits<M>::Tangent> tangents, std::span<M> elements) {
  using S = typename M::Scalar;
  using Traits = ManifoldTraits<BatchOf<M>>;
  const std::size_t n = tangents.size() < elements.size() ? tangents.size() : elements.size();
  if (n == 0) return;
  detail::overBatches<S, Traits::DoF, M::num_parameters>(
      tangents[0].data(), elements[0].data(), n,
      [](const typename Traits::Tangent& v) { return Traits::expOrigin(v).params(); });
}

/// tangents[i] = logOrigin(elements[i]), the logarithm of a group. As many as the shorter range holds.
template <class M>
void logAll(std::span<const M> elements, std::span<typename ManifoldTraits<M>::Tangent> tangents) {
  using S = typename M::Scalar;
  using Traits = ManifoldTraits<BatchOf<M>>;
  const std::size_t n = tangents.size() < elements.size() ? tangents.size() : elements.size();
  if (n == 0) return;
  detail::overBatches<S, M::num_parameters, Traits::DoF>(
      elements[0].data(), tangents[0].data(), n,
      [](const auto& params) { return Traits::logOrigin(BatchOf<M>::fromParams(params)); });
}

}  // namespace liestat
