// Mardia's skewness. Needs Eigen alone.
//
// Source: K. V. Mardia, "Applications of some measures of multivariate skewness and kurtosis in testing normality and
// robustness studies", Sankhyā B 36 (1974), with its correction for few data.
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <stats/detail/part_growth.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/skewness.hpp>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <vector>

namespace liestat::detail {

/// The skewness of errors that are whitened about, so that their units do not differ.
template <int K>
Skewness mardiaSkewness(const std::vector<Eigen::Matrix<double, K, 1>>& errors) {
  using Vector = Eigen::Matrix<double, K, 1>;
  using Matrix = Eigen::Matrix<double, K, K>;
  Skewness result{.n = errors.size()};
  const double n = static_cast<double>(errors.size());
  Vector mean = Vector::Zero();
  for (const Vector& u : errors) mean += u / n;
  Matrix scatter = Matrix::Zero();
  for (const Vector& u : errors) scatter += (u - mean) * (u - mean).transpose() / n;
  scatter.diagonal().array() += singular_part * scatter.trace();
  const Cholesky<double, K> factor(scatter);
  if (!factor.ok()) return result;
  // Σ_ij (u_i·u_j)³ is the square of Σ u⊗u⊗u, whose elements of permuted indices are equal.
  constexpr std::size_t terms = static_cast<std::size_t>(K * (K + 1) * (K + 2) / 6);
  std::array<double, terms> third{};
  for (const Vector& u : errors) {
    const Vector w = factor.template halfSolve<1>(Vector(u - mean));
    std::size_t term = 0;
    for (int i = 0; i < K; ++i) {
      for (int j = i; j < K; ++j) {
        for (int k = j; k < K; ++k) third[term++] += w[i] * w[j] * w[k] / n;
      }
    }
  }
  result.b = 0;
  std::size_t term = 0;
  for (int i = 0; i < K; ++i) {
    for (int j = i; j < K; ++j) {
      for (int k = j; k < K; ++k) {
        const double permutations = i == k ? 1 : i == j || j == k ? 3 : 6;
        result.b += permutations * third[term] * third[term];
        ++term;
      }
    }
  }
  const double few = (n + 1) * (n + 3) * (K + 1) / (n * ((n + 1) * (K + 1) - 6));
  result.p = chiSquaredTail(n * result.b / 6 * few, terms);
  return result;
}

}  // namespace liestat::detail
