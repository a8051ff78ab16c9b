// A covariance of which one part has grown: by what first order did not see of an error of rotation, or by the factor
// of a region that was widened (docs/theory/means.md, sections 7.6 and 7.7).
#pragma once

#include <lie/detail/small_eigen.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>

#include <algorithm>
#include <array>
#include <cstddef>

namespace liestat::detail {

/// A part of the trace that is added to the diagonal of scatters, which are singular where data do not vary in every
/// direction.
inline constexpr double singular_part = 1e-10;

/// The coordinates from `begin` on.
template <int K>
constexpr std::array<int, static_cast<std::size_t>(K)> coordinatesFrom(int begin) {
  std::array<int, static_cast<std::size_t>(K)> list{};
  for (int i = 0; i < K; ++i) list[static_cast<std::size_t>(i)] = begin + i;
  return list;
}

/// The block of a covariance for some of its coordinates.
template <int K, class S, int D>
Eigen::Matrix<S, K, K> partOfCovariance(const Eigen::Matrix<S, D, D>& C,
                                        const std::array<int, static_cast<std::size_t>(K)>& index) {
  Eigen::Matrix<S, K, K> part;
  for (int a = 0; a < K; ++a) {
    for (int b = 0; b < K; ++b) part(a, b) = C(index[static_cast<std::size_t>(a)], index[static_cast<std::size_t>(b)]);
  }
  return part;
}

/// [G; I]: the regression of all coordinates on some of them that a covariance says; G is zero where these do not vary.
template <int K, class S, int D>
Eigen::Matrix<S, D, K> leverOf(const Eigen::Matrix<S, D, D>& C,
                               const std::array<int, static_cast<std::size_t>(K)>& index) {
  Eigen::Matrix<S, K, K> part = partOfCovariance<K>(C, index);
  part.diagonal().array() += S(singular_part) * part.trace();
  Eigen::Matrix<S, K, D> rows;
  for (int a = 0; a < K; ++a) rows.row(a) = C.row(index[static_cast<std::size_t>(a)]);
  const Cholesky<S, K> factor(part);
  Eigen::Matrix<S, D, K> lever = Eigen::Matrix<S, D, K>::Zero();
  if (factor.ok()) lever = factor.template solve<D>(rows).transpose();
  for (int a = 0; a < K; ++a) {
    for (int b = 0; b < K; ++b) lever(index[static_cast<std::size_t>(a)], b) = S(a == b);
  }
  return lever;
}

/// L Δ Lᵀ, symmetric to the last bit.
template <class S, int D, int K>
Eigen::Matrix<S, D, D> grownBy(const Eigen::Matrix<S, D, K>& lever, const Eigen::Matrix<S, K, K>& growth) {
  Eigen::Matrix<S, D, D> sum = congruence(lever, growth);
  for (int j = 0; j < D; ++j) {
    for (int i = j + 1; i < D; ++i) sum(j, i) = sum(i, j);
  }
  return sum;
}

/// The growth of a covariance if the region of some of its coordinates is widened by a factor.
template <class S, int D, std::size_t K>
Eigen::Matrix<S, D, D> widening(const Eigen::Matrix<S, D, D>& C, const std::array<int, K>& index, double factor) {
  constexpr int k = static_cast<int>(K);
  const Eigen::Matrix<S, k, k> growth = S(factor * factor - 1) * partOfCovariance<k>(C, index);
  return grownBy(leverOf<k>(C, index), growth);
}

/// The positive part of a symmetric matrix.
template <class S, int K>
Eigen::Matrix<S, K, K> positivePart(const Eigen::Matrix<S, K, K>& A) {
  const SymmetricEigen<Eigen::Matrix<S, K, K>> eigen(A);
  Eigen::Matrix<S, K, K> part = Eigen::Matrix<S, K, K>::Zero();
  for (int k = 0; k < K; ++k) {
    const Eigen::Matrix<S, K, 1> axis = eigen.vectors.col(k);
    part += std::max(S(0), eigen.values[k]) * axis * axis.transpose();
  }
  return part;
}

/// The growth of a covariance of first order by averaging. The part of the averaged one for the coordinates that were
/// averaged over says by how much their error is larger; a lever turns it into errors of the others, whatever its size.
/// They are therefore added with the regression of first order, C + [G; I] Δ [G; I]ᵀ, Δ the positive part of the
/// growth.
template <int K, class S, int D>
Eigen::Matrix<S, D, D> averagedGrowth(const Eigen::Matrix<S, D, D>& first, const Eigen::Matrix<S, D, D>& averaged,
                                      const std::array<int, static_cast<std::size_t>(K)>& index) {
  const Eigen::Matrix<S, K, K> growth = partOfCovariance<K>(averaged, index) - partOfCovariance<K>(first, index);
  return grownBy(leverOf<K>(first, index), positivePart(growth));
}

}  // namespace liestat::detail
