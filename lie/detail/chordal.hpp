// Averages in the linear spaces that manifolds are embedded in: the ChordalMoments of the library's ManifoldTraits
// (lie/concepts.hpp), where the iterations for means start.
#pragma once

#include <lie/concepts.hpp>

#include <Eigen/Core>

#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

namespace liestat::detail {

/// A symmetric 4×4 matrix by its lower triangle, row by row, as kernels make it: number by number, for which nothing waits
/// that has been stored so.
template <class S>
struct Symmetric4 {
  static constexpr std::size_t entries = 10;
  S lower[entries] = {};

  static constexpr std::size_t entry(std::size_t i, std::size_t j) { return i < j ? entry(j, i) : i * (i + 1) / 2 + j; }
  S trace() const { return (lower[0] + lower[2]) + (lower[5] + lower[9]); }
  /// scale A².
  EIGEN_ALWAYS_INLINE Symmetric4 square(const S& scale) const {
    Symmetric4 result;
#pragma GCC unroll 4
    for (std::size_t i = 0; i < 4; ++i) {
#pragma GCC unroll 4
      for (std::size_t j = 0; j <= i; ++j) {
        result.lower[entry(i, j)] =
            scale * ((lower[entry(i, 0)] * lower[entry(0, j)] + lower[entry(i, 1)] * lower[entry(1, j)]) +
                     (lower[entry(i, 2)] * lower[entry(2, j)] + lower[entry(i, 3)] * lower[entry(3, j)]));
      }
    }
    return result;
  }
  EIGEN_ALWAYS_INLINE Eigen::Matrix<S, 4, 1> operator*(const Eigen::Matrix<S, 4, 1>& v) const {
    const auto row = [&](std::size_t i) -> S {
      return (lower[entry(i, 0)] * v[0] + lower[entry(i, 1)] * v[1]) +
             (lower[entry(i, 2)] * v[2] + lower[entry(i, 3)] * v[3]);
    };
    return Eigen::Matrix<S, 4, 1>(row(0), row(1), row(2), row(3));
  }
};

/// Unit eigenvector of the largest eigenvalue of a symmetric positive semi-definite 4×4 matrix, by repeated squaring of
/// the normalised matrix: its powers tend to the projector on the dominant eigenvectors. Ties give one of them.
template <class S>
Eigen::Matrix<S, 4, 1> dominantEigenvector(Symmetric4<S> A) {
  using std::sqrt;
  S trace = A.trace();
  for (int i = 0; i < 24 && trace > S(0); ++i) {
    const S scale = S(1) / trace;
    A = A.square(S(scale * scale));
    trace = A.trace();
    // The trace of the square of a matrix of trace one is one minus twice the share of the other eigenvalues. The square
    // has squared that share, and the products below leave its sixth power.
    if (S(1) - trace < S(0.004)) break;
  }
  std::size_t largest = 0;
  for (std::size_t i = 1; i < 4; ++i) {
    if (A.lower[A.entry(i, i)] > A.lower[A.entry(largest, largest)]) largest = i;
  }
  const Eigen::Matrix<S, 4, 1> column(A.lower[A.entry(largest, 0)], A.lower[A.entry(largest, 1)],
                                      A.lower[A.entry(largest, 2)], A.lower[A.entry(largest, 3)]);
  const Eigen::Matrix<S, 4, 1> v = A * (A * column);
  const S scale = S(1) / sqrt((v[0] * v[0] + v[1] * v[1]) + (v[2] * v[2] + v[3] * v[3]));
  return Eigen::Matrix<S, 4, 1>(scale * v[0], scale * v[1], scale * v[2], scale * v[3]);
}

/// Sums over many features that kernels make of their parameters c: Σ p c cᵀ of the first `outer` of them, as a lower
/// triangle row by row, and Σ p c of the `linear` next.
template <class S, std::size_t Outer, std::size_t Linear>
struct ParameterSums {
  static constexpr std::size_t outer = Outer, linear = Linear, entries = Outer * (Outer + 1) / 2;
  S product[entries > 0 ? entries : 1] = {}, sum[Linear > 0 ? Linear : 1] = {}, weight = 0, count = 0;

  void operator+=(const ParameterSums& other) {
    for (std::size_t i = 0; i < entries; ++i) product[i] += other.product[i];
    for (std::size_t i = 0; i < Linear; ++i) sum[i] += other.sum[i];
    weight += other.weight, count += other.count;
  }
};

/// R^n: the mean itself.
template <class M>
struct FlatMoments {
  using T = ManifoldTraits<M>;
  using S = typename T::Scalar;
  using Sums = ParameterSums<S, 0, static_cast<std::size_t>(T::DoF)>;
  typename T::Tangent sum = T::Tangent::Zero();
  S weight = S(0);

  void add(const M& x, const S& p) { sum += p * T::logOrigin(x), weight += p; }
  void add(const Sums& s) { sum += Eigen::Map<const typename T::Tangent>(s.sum), weight += s.weight; }
  M mean() const { return T::expOrigin(typename T::Tangent(sum / weight)); }
};

/// Types whose parameters are a unit quaternion followed by vectors (translation, velocity): the dominant eigenvector
/// of Σ p q qᵀ, which is the rotation nearest to the average of the matrices, and the averages of the vectors.
template <class M>
struct QuaternionMoments {
  using S = typename M::Scalar;
  static constexpr int vectors = M::num_parameters - 4;
  using Sums = ParameterSums<S, 4, static_cast<std::size_t>(vectors)>;
  Symmetric4<S> rotation;
  Eigen::Matrix<S, vectors, 1> vector = Eigen::Matrix<S, vectors, 1>::Zero();
  S weight = S(0);

  void add(const M& x, const S& p) {
    const Eigen::Matrix<S, 4, 1> q = x.params().template head<4>();
    for (int i = 0, e = 0; i < 4; ++i) {
      for (int j = 0; j <= i; ++j, ++e) rotation.lower[e] += p * q[i] * q[j];
    }
    weight += p;
    vector += p * x.params().template tail<vectors>();
  }
  void add(const Sums& s) {
    for (std::size_t e = 0; e < Sums::entries; ++e) rotation.lower[e] += s.product[e];
    for (int i = 0; i < vectors; ++i) vector[i] += s.sum[i];
    weight += s.weight;
  }
  M mean() const {
    typename M::Params params;
    params.template head<4>() = dominantEigenvector<S>(rotation);
    if constexpr (vectors > 0) params.template tail<vectors>() = vector / weight;
    return M::fromParams(params);
  }
};

/// Types whose parameters are (cos, sin) followed by vectors: all averaged. Angles that cancel have no mean.
template <class M>
struct ComplexMoments {
  using S = typename M::Scalar;
  using Sums = ParameterSums<S, 0, static_cast<std::size_t>(M::num_parameters)>;
  typename M::Params sum = M::Params::Zero();
  S weight = S(0);

  void add(const M& x, const S& p) { sum += p * x.params(), weight += p; }
  void add(const Sums& s) { sum += Eigen::Map<const typename M::Params>(s.sum), weight += s.weight; }
  std::optional<M> mean() const {
    if (!(sum.template head<2>().norm() > S(0))) return std::nullopt;
    typename M::Params params = sum / weight;
    params.template head<2>().normalize();
    return M::fromParams(params);
  }
};

/// Directions: the average of the vectors. Those that cancel have no mean.
template <class M>
struct DirectionMoments {
  using S = typename M::Scalar;
  using Sums = ParameterSums<S, 0, 3>;
  Eigen::Matrix<S, 3, 1> sum = Eigen::Matrix<S, 3, 1>::Zero();
  S count = S(0);

  void add(const M& x, const S& p) { sum += p * x.params(), count += S(1); }
  void add(const Sums& s) { sum += Eigen::Map<const Eigen::Matrix<S, 3, 1>>(s.sum), count += s.count; }
  std::optional<M> mean() const {
    if (!(sum.norm() > S(1e-6) * count)) return std::nullopt;
    return M(sum);
  }
};

}  // namespace liestat::detail
