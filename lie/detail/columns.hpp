// Arrays of elements in memory, and their way to columns, a block or a register of elements at a time, inside kernels.
#pragma once

#include <lie/detail/always_inline.hpp>
#include <lie/detail/pack.hpp>
#include <lie/detail/transpose.hpp>
#include <lie/instruction_set.hpp>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace liestat::detail {

/// Number c of element i is data[i element + c component]: component is 1 in an array of elements, element is 1 in a
/// structure of arrays. T is S to write to, const S to read.
template <class T>
struct Layout {
  T* data = nullptr;
  std::ptrdiff_t element = 0, component = 1;
  std::ptrdiff_t ahead = 0;  ///< by how many numbers kernels ask for elements before they read them

  LIESTAT_ALWAYS_INLINE T* at(std::size_t i, std::size_t c) const {
    return data + static_cast<std::ptrdiff_t>(i) * element + static_cast<std::ptrdiff_t>(c) * component;
  }
};

/// True if loadRows serves registers of this kind.
template <class P>
inline constexpr bool loads_rows = LIESTAT_HAS_SHUFFLES&& P::set != InstructionSet::baseline;

/// How far ahead kernels ask for the elements of an array of so many numbers, in numbers: the processor by itself reads
/// ahead too little for kernels that take less time than their data take from memory. Not of small arrays: to look for a
/// page beyond their end that is not there takes longer than they do.
template <class S>
constexpr std::ptrdiff_t readAhead(std::size_t numbers) {
  return numbers * sizeof(S) < 65536 ? 0 : static_cast<std::ptrdiff_t>(4096 / sizeof(S));
}
template <class S>
LIESTAT_ALWAYS_INLINE void prefetch([[maybe_unused]] const S* p, [[maybe_unused]] std::ptrdiff_t ahead) {
#if defined(__GNUC__)
  // No pointer beyond the array: an address is not one.
  const std::uintptr_t address =
      reinterpret_cast<std::uintptr_t>(p) + static_cast<std::uintptr_t>(ahead * static_cast<std::ptrdiff_t>(sizeof(S)));
  __builtin_prefetch(reinterpret_cast<const void*>(address));  // NOLINT(performance-no-int-to-ptr)
#endif
}

/// Components first … first + 3 of the element `begin` and those after it, of which there are `left`, in one register each,
/// from an array of elements (component is 1); the lanes beyond the last are filled up with the numbers `fill`. Rows are
/// transposed in registers: one that is read back just after its numbers have been stored one by one would wait for them.
template <class P, class S>
LIESTAT_ALWAYS_INLINE void loadRows(const Layout<const S>& from, std::size_t first, std::size_t begin, std::size_t left,
                                    const S* fill, P (&columns)[4]) {
  if constexpr (LIESTAT_HAS_SHUFFLES && P::size >= 4) {
    const S *const start = from.at(begin, first), *row[P::size];
    if (left >= P::size && from.element == 4) [[likely]] {
      LIESTAT_UNROLL for (std::size_t k = 0; k < P::size; k += 16 / sizeof(S)) prefetch(start + 4 * k, from.ahead);
      transposeRows(start, columns);
      return;
    }
    if (left >= P::size) [[likely]] {
      LIESTAT_UNROLL for (std::size_t k = 0; k < P::size; ++k) {
        row[k] = start + static_cast<std::ptrdiff_t>(k) * from.element;
        if (first == 0) prefetch(row[k], from.ahead);
      }
    } else {
      LIESTAT_UNROLL for (std::size_t k = 0; k < P::size; ++k) {
        row[k] = k < left ? start + static_cast<std::ptrdiff_t>(k) * from.element : fill;
      }
    }
    transposeRows(row, columns);
  }
}

/// Components first … first + N - 1 of the elements begin … begin + count - 1 into N columns of B numbers.
template <InstructionSet Set, std::size_t N, class S, std::size_t B>
LIESTAT_ALWAYS_INLINE void loadColumns(const Layout<const S>& from, std::size_t first, std::size_t begin,
                                       std::size_t count, S (*columns)[B]) {
  if (from.element == 1) {
    for (std::size_t c = 0; c < N; ++c) std::memcpy(columns[c], from.at(begin, first + c), count * sizeof(S));
    return;
  }
  std::size_t j = 0;
#if LIESTAT_HAS_SHUFFLES
  using P = Pack<Set, S>;
  if constexpr (loads_rows<P> && N <= 4) {
    const bool rows = from.component == 1 && (N == 4 || from.element == N);
    for (; rows && j + P::size <= count; j += P::size) {
      P x[N];
      if constexpr (N == 4) {
        loadRows(from, first, begin + j, P::size, static_cast<const S*>(nullptr), x);
      } else {
        const S* const numbers = from.at(begin + j, first);
        LIESTAT_UNROLL for (std::size_t k = 0; k < N * P::size; k += 64 / sizeof(S)) prefetch(numbers + k, from.ahead);
        if constexpr (N > 1) {
          loadDense(numbers, x);
        } else {
          x[0] = P::load(numbers);
        }
      }
      LIESTAT_UNROLL for (std::size_t c = 0; c < N; ++c) x[c].store(columns[c] + j);
    }
  }
#endif
  for (; j < count; ++j) {
    for (std::size_t c = 0; c < N; ++c) columns[c][j] = *from.at(begin + j, first + c);
  }
}

/// As loadColumns, and fills the last register of each column up with the numbers `fill`.
template <class P, std::size_t N, class S, std::size_t B>
LIESTAT_ALWAYS_INLINE void loadFilled(const Layout<const S>& from, std::size_t first, std::size_t begin,
                                      std::size_t count, const S* fill, S (*columns)[B]) {
  loadColumns<P::set, N>(from, first, begin, count, columns);
  for (std::size_t j = count; j % P::size != 0; ++j) {
    for (std::size_t c = 0; c < N; ++c) columns[c][j] = fill[c];
  }
}

}  // namespace liestat::detail
