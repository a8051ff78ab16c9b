// Points of manifolds, matrices, noises and values of equations as rows of numbers, which the compiled cores of
// constrained estimation and of the implicit filter read. Element by element, which costs a compiler nothing.
#pragma once

#include <lie/manifold.hpp>
#include <lie/rn.hpp>
#include <stats/measurement_noise.hpp>

#include <Eigen/Core>

#include <cmath>
#include <cstddef>
#include <type_traits>

namespace liestat::detail {

/// Fixed-size vectors: exp and log are sums and differences.
template <class M>
constexpr bool is_vector = std::is_base_of_v<Eigen::MatrixBase<M>, M>;

/// How many equations are independent: all of them, unless they say how many.
template <class Equation, int P>
constexpr int equationRank() {
  if constexpr (requires { Equation::rank; }) {
    static_assert(Equation::rank > 0 && Equation::rank <= P, "between one and the number of equations");
    return Equation::rank;
  } else {
    return P;
  }
}

/// A matrix as rows of numbers, and back.
template <int Rows_, int Cols, class Matrix>
void toRows(const Matrix& m, double* rows) {
  for (int i = 0; i < Rows_; ++i) {
    for (int j = 0; j < Cols; ++j) *rows++ = static_cast<double>(m(i, j));
  }
}
template <int Rows_, int Cols>
Eigen::Matrix<double, Rows_, Cols> fromRows(const double* rows) {
  Eigen::Matrix<double, Rows_, Cols> m;
  for (int i = 0; i < Rows_; ++i) {
    for (int j = 0; j < Cols; ++j) m(i, j) = *rows++;
  }
  return m;
}
/// Values of equations: a vector, or a number.
template <int P, class Values>
void toValues(const Values& values, double* rows) {
  if constexpr (std::is_arithmetic_v<Values>) {
    *rows = static_cast<double>(values);
  } else {
    for (int k = 0; k < P; ++k) rows[k] = static_cast<double>(values[k]);
  }
}
/// exp(x, step).
template <Homogeneous M>
M movedBy(const M& x, const double* step) {
  TangentOf<M> v;
  for (int k = 0; k < ManifoldTraits<M>::DoF; ++k) v[k] = static_cast<ScalarOf<M>>(step[k]);
  if constexpr (is_vector<M>) {
    for (int k = 0; k < ManifoldTraits<M>::DoF; ++k) v[k] += x[k];
    return v;
  } else {
    return exp(x, v);
  }
}
/// The coordinates of x as seen from the origin.
template <Homogeneous M>
void toCoordinates(const M& x, double* rows) {
  if constexpr (is_vector<M>) {
    toRows<ManifoldTraits<M>::DoF, 1>(x, rows);
  } else {
    toRows<ManifoldTraits<M>::DoF, 1>(log(ManifoldTraits<M>::origin(), x), rows);
  }
}
inline bool areFinite(const double* values, int n) {
  bool finite = true;
  for (int k = 0; k < n; ++k) finite = finite && std::isfinite(values[k]);
  return finite;
}

/// The numbers of a noise: a variance, a variance for each coordinate, or a matrix.
template <NoiseModel Noise>
struct NoiseNumbers {
  static constexpr int K = Noise::dimension;
  static constexpr NoiseForm form = NoiseForm::full;
  static constexpr std::size_t count = std::size_t{K} * K;
  static void covariance(const Noise& noise, double* values) { toRows<K, K>(noise.covariance(), values); }
  static void information(const Noise& noise, double* values) { toRows<K, K>(noise.information(), values); }
};
template <int K>
struct NoiseNumbers<IsotropicNoise<K>> {
  static constexpr NoiseForm form = NoiseForm::isotropic;
  static constexpr std::size_t count = 1;
  static void covariance(const IsotropicNoise<K>& noise, double* value) { *value = noise.variance(); }
  static void information(const IsotropicNoise<K>& noise, double* value) { *value = 1 / noise.variance(); }
};
template <int K>
struct NoiseNumbers<DiagonalNoise<K>> {
  static constexpr NoiseForm form = NoiseForm::diagonal;
  static constexpr std::size_t count = K;
  static void covariance(const DiagonalNoise<K>& noise, double* values) {
    for (int k = 0; k < K; ++k) values[k] = noise.variances()[k];
  }
  static void information(const DiagonalNoise<K>& noise, double* values) {
    for (int k = 0; k < K; ++k) values[k] = 1 / noise.variances()[k];
  }
};

}  // namespace liestat::detail
