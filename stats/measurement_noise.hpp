// How much a measurement with N coordinates may be corrected: the semi-distance ‖e‖²_Q of Viéville, Lingrand and Gaspard
// 2000, equation (1). Q is the information matrix of the measurement's error e in its local frame, V = Q⁺ its covariance.
//
//   IsotropicNoise<2> pixel(0.5);                    // one standard deviation for both coordinates
//   DiagonalNoise<4>({0.5, 0.5, 0.7, 0.7});          // standard deviations
//   CovarianceNoise<6>(covariance);                  // may be singular: what it does not move is exact
//   InformationNoise<3>(information);                // may be singular: what it does not weigh is free
//
// The first two cost what their number of coordinates costs.
#pragma once

#include <lie/detail/small_orthogonal.hpp>
#include <lie/detail/small_products.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>

namespace liestat {

/// The same standard deviation in all coordinates.
template <int N>
class IsotropicNoise {
 public:
  static constexpr int dimension = N;
  explicit IsotropicNoise(double sigma) : variance_(sigma * sigma) {}
  /// True if the variance is a positive finite number.
  bool valid() const { return variance_ > 0 && std::isfinite(variance_); }
  double variance() const { return variance_; }
  /// V Dᵀ.
  template <int P>
  Eigen::Matrix<double, N, P> spread(const Eigen::Matrix<double, P, N>& D) const {
    return variance_ * D.transpose();
  }
  /// eᵀ Q e.
  double squaredNorm(const Eigen::Matrix<double, N, 1>& e) const { return e.squaredNorm() / variance_; }
  Eigen::Matrix<double, N, N> covariance() const { return variance_ * Eigen::Matrix<double, N, N>::Identity(); }
  Eigen::Matrix<double, N, N> information() const { return Eigen::Matrix<double, N, N>::Identity() / variance_; }

 private:
  double variance_;
};

/// A standard deviation for each coordinate.
template <int N>
class DiagonalNoise {
 public:
  static constexpr int dimension = N;
  explicit DiagonalNoise(const Eigen::Matrix<double, N, 1>& sigmas) : variances_(sigmas.cwiseAbs2()) {}
  bool valid() const {
    bool valid = true;
    for (int i = 0; i < N; ++i) valid = valid && variances_[i] > 0 && std::isfinite(variances_[i]);
    return valid;
  }
  const Eigen::Matrix<double, N, 1>& variances() const { return variances_; }
  template <int P>
  Eigen::Matrix<double, N, P> spread(const Eigen::Matrix<double, P, N>& D) const {
    Eigen::Matrix<double, N, P> result;
    for (int j = 0; j < P; ++j) {
      for (int i = 0; i < N; ++i) result(i, j) = variances_[i] * D(j, i);
    }
    return result;
  }
  double squaredNorm(const Eigen::Matrix<double, N, 1>& e) const {
    double sum = 0;
    for (int i = 0; i < N; ++i) sum += e[i] * e[i] / variances_[i];
    return sum;
  }
  Eigen::Matrix<double, N, N> covariance() const { return variances_.asDiagonal(); }
  Eigen::Matrix<double, N, N> information() const { return variances_.cwiseInverse().asDiagonal(); }

 private:
  Eigen::Matrix<double, N, 1> variances_;
};

namespace detail {

/// A symmetric semi-definite matrix taken apart: its pseudo-inverse and a basis of its null space in the last
/// `null_dimension` columns of `vectors`. Scales of the coordinates do not matter.
template <int N>
struct SemidefiniteParts {
  Eigen::Matrix<double, N, N> inverse = Eigen::Matrix<double, N, N>::Zero();
  Eigen::Matrix<double, N, N> null_basis = Eigen::Matrix<double, N, N>::Zero();
  int null_dimension = 0;
  bool valid = false;  ///< finite, symmetric but for rounding, no negative eigenvalue

  explicit SemidefiniteParts(const Eigen::Matrix<double, N, N>& A) {
    Eigen::Matrix<double, N, 1> scale;
    for (int i = 0; i < N; ++i) scale[i] = A(i, i) > 0 ? std::sqrt(A(i, i)) : 1;
    Eigen::Matrix<double, N, N> scaled;
    double skewed = 0;
    for (int j = 0; j < N; ++j) {
      for (int i = 0; i < N; ++i) {
        scaled(i, j) = 0.5 * (A(i, j) + A(j, i)) / (scale[i] * scale[j]);
        skewed = std::max(skewed, std::abs(A(i, j) - A(j, i)) / (scale[i] * scale[j]));
      }
    }
    for (int i = 0; i < N * N; ++i) {
      if (!std::isfinite(scaled(i / N, i % N))) return;
    }
    if (skewed > 1e-6) return;
    // Singular vectors of a symmetric matrix are eigenvectors, with u = -v where the eigenvalue is negative.
    const SmallSvd svd(BasicSmallMatrix<N>::template of<N, N>(scaled));
    const double least = 10 * N * std::numeric_limits<double>::epsilon() * svd.value(0);
    valid = true;
    for (int k = 0; k < N; ++k) {
      std::array<double, static_cast<std::size_t>(N)> v{};
      double sign = 0;
      for (int i = 0; i < N; ++i)
        v[static_cast<std::size_t>(i)] = svd.v(k, i) / scale[i], sign += svd.u(k, i) * svd.v(k, i);
      if (svd.value(k) > least) {
        if (sign < 0 && svd.value(k) > 10 * least) valid = false;
        for (int i = 0; i < N; ++i) {
          for (int j = 0; j < N; ++j)
            inverse(i, j) += v[static_cast<std::size_t>(i)] * v[static_cast<std::size_t>(j)] / svd.value(k);
        }
      } else {
        // A v = 0; orthonormal by Gram and Schmidt.
        normalise(v);
        for (int j = 0; j < null_dimension; ++j) {
          double along = 0;
          for (int i = 0; i < N; ++i) along += null_basis(i, j) * v[static_cast<std::size_t>(i)];
          for (int i = 0; i < N; ++i) v[static_cast<std::size_t>(i)] -= along * null_basis(i, j);
        }
        normalise(v);
        for (int i = 0; i < N; ++i) null_basis(i, null_dimension) = v[static_cast<std::size_t>(i)];
        ++null_dimension;
      }
    }
    // The sum is a generalised inverse. Without its part along the null space it is Moore and Penrose's.
    for (int k = 0; k < null_dimension; ++k) {
      std::array<double, static_cast<std::size_t>(N)> along{};
      double both = 0;
      for (int i = 0; i < N; ++i) {
        along[static_cast<std::size_t>(i)] = 0;
        for (int j = 0; j < N; ++j) along[static_cast<std::size_t>(i)] += inverse(i, j) * null_basis(j, k);
        both += null_basis(i, k) * along[static_cast<std::size_t>(i)];
      }
      for (int i = 0; i < N; ++i) {
        const double w = null_basis(i, k);
        for (int j = 0; j < N; ++j) {
          inverse(i, j) += both * w * null_basis(j, k) - w * along[static_cast<std::size_t>(j)] -
                           along[static_cast<std::size_t>(i)] * null_basis(j, k);
        }
      }
    }
  }

 private:
  static void normalise(std::array<double, static_cast<std::size_t>(N)>& v) {
    double squared = 0;
    for (const double x : v) squared += x * x;
    if (!(squared > 0)) return;
    for (double& x : v) x /= std::sqrt(squared);
  }
};

}  // namespace detail

/// A covariance matrix. Directions in which it is singular are exact: the measurement is not corrected along them.
template <int N>
class CovarianceNoise {
 public:
  static constexpr int dimension = N;
  explicit CovarianceNoise(const Eigen::Matrix<double, N, N>& covariance) : V_(covariance) {
    const detail::SemidefiniteParts<N> parts(covariance);
    valid_ = parts.valid && parts.null_dimension < N;
    Q_ = parts.inverse;
  }
  /// Finite, symmetric, no negative eigenvalue, not zero.
  bool valid() const { return valid_; }
  template <int P>
  Eigen::Matrix<double, N, P> spread(const Eigen::Matrix<double, P, N>& D) const {
    return detail::productTransposed(V_, D);
  }
  double squaredNorm(const Eigen::Matrix<double, N, 1>& e) const { return e.dot(detail::product(Q_, e)); }
  const Eigen::Matrix<double, N, N>& covariance() const { return V_; }
  const Eigen::Matrix<double, N, N>& information() const { return Q_; }

 private:
  Eigen::Matrix<double, N, N> V_, Q_;
  bool valid_ = false;
};

/// An information matrix. Directions in which it is singular are free: the equations determine them, and if they can't,
/// they stay.
template <int N>
class InformationNoise {
 public:
  static constexpr int dimension = N;
  static constexpr bool can_be_free = true;
  explicit InformationNoise(const Eigen::Matrix<double, N, N>& information) : Q_(information), parts_(information) {}
  /// Finite, symmetric, no negative eigenvalue.
  bool valid() const { return parts_.valid; }
  template <int P>
  Eigen::Matrix<double, N, P> spread(const Eigen::Matrix<double, P, N>& D) const {
    return detail::productTransposed(parts_.inverse, D);
  }
  double squaredNorm(const Eigen::Matrix<double, N, 1>& e) const { return e.dot(detail::product(Q_, e)); }
  const Eigen::Matrix<double, N, N>& covariance() const { return parts_.inverse; }
  const Eigen::Matrix<double, N, N>& information() const { return Q_; }
  /// The number of free directions, and a basis of them in the first columns.
  int freeDimension() const { return parts_.null_dimension; }
  const Eigen::Matrix<double, N, N>& freeBasis() const { return parts_.null_basis; }

 private:
  Eigen::Matrix<double, N, N> Q_;
  detail::SemidefiniteParts<N> parts_;
};

/// One of the four, or a type of your own with their members.
template <class T>
concept NoiseModel = requires(const T& noise, const Eigen::Matrix<double, T::dimension, 1>& e,
                              const Eigen::Matrix<double, 1, T::dimension>& D) {
  { T::dimension } -> std::convertible_to<int>;
  { noise.valid() } -> std::convertible_to<bool>;
  noise.spread(D);
  { noise.squaredNorm(e) } -> std::convertible_to<double>;
  { noise.covariance() } -> std::convertible_to<Eigen::Matrix<double, T::dimension, T::dimension>>;
  { noise.information() } -> std::convertible_to<Eigen::Matrix<double, T::dimension, T::dimension>>;
};

namespace detail {

/// How the numbers of a noise are given: a variance, variances of the coordinates, or a matrix.
enum class NoiseForm { isotropic, diagonal, full };

/// A model whose information may be singular.
template <class T>
concept HasFreeDirections = NoiseModel<T> && requires(const T& noise) {
  requires T::can_be_free;
  { noise.freeDimension() } -> std::convertible_to<int>;
  { noise.freeBasis() } -> std::convertible_to<Eigen::Matrix<double, T::dimension, T::dimension>>;
};

}  // namespace detail
}  // namespace liestat
