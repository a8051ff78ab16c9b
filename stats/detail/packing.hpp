// Sums as lists of doubles and back, bit for bit, for executors that send them to other machines (Packable in
// stats/compat/mpi.hpp). Scalars of up to 53 bits.
#pragma once

#include <Eigen/Core>

#include <cstddef>
#include <span>
#include <type_traits>
#include <vector>

namespace liestat::detail {

inline void appendTo(std::vector<double>& list, double x) { list.push_back(x); }
template <class D>
void appendTo(std::vector<double>& list, const Eigen::PlainObjectBase<D>& m) {
  for (Eigen::Index i = 0; i < m.size(); ++i) list.push_back(static_cast<double>(m.data()[i]));
}
/// The numbers of several numbers and matrices of fixed size, one after the other.
template <class... T>
std::vector<double> packed(const T&... values) {
  std::vector<double> list;
  (appendTo(list, values), ...);
  return list;
}

template <class S>
  requires std::is_arithmetic_v<S>
void takeFrom(std::span<const double>& list, S& x) {
  x = static_cast<S>(list[0]);
  list = list.subspan(1);
}
template <class D>
void takeFrom(std::span<const double>& list, Eigen::PlainObjectBase<D>& m) {
  for (Eigen::Index i = 0; i < m.size(); ++i) {
    m.data()[i] = static_cast<typename D::Scalar>(list[static_cast<std::size_t>(i)]);
  }
  list = list.subspan(static_cast<std::size_t>(m.size()));
}
/// Unpacks a list that packed() made, into the same values.
template <class... T>
void unpackInto(std::span<const double> list, T&... values) {
  (takeFrom(list, values), ...);
}

}  // namespace liestat::detail
