// The dense core of a constrained step: n unknowns, a quadratic criterion, linear constraints that may be redundant.
#pragma once

#include <lie/detail/small_orthogonal.hpp>
#include <lie/detail/small_products.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>

namespace liestat::detail {

/// The null space and solution of P linear equations C δ = d in N unknowns. Singular values of C with unit rows that are
/// below 5e-8 count as zero, so the scale of an equation does not matter; redundant ones are met in least squares.
template <int N, int P>
class ConstraintBasis {
 public:
  static constexpr int size = N > P ? N : P;
  using Step = Eigen::Matrix<double, N, 1>;
  using Values = Eigen::Matrix<double, P, 1>;

  /// No equations.
  ConstraintBasis() {
    for (int k = 0; k < N; ++k) Z_.row(k) = Step::Unit(k).transpose();
  }
  explicit ConstraintBasis(const Eigen::Matrix<double, P, N>& C) {
    // Filled up to a square; the zeros that fill it up are never mixed with the rest.
    BasicSmallMatrix<size> rows(size, size);
    for (int k = 0; k < P; ++k) {
      const double length = C.row(k).norm();
      scale_[k] = length > 0 && std::isfinite(length) ? 1 / length : 0;
      for (int j = 0; j < N; ++j) rows(k, j) = scale_[k] * C(k, j);
    }
    const SmallSvd svd(rows);
    int free = 0;
    for (int k = 0; k < size; ++k) {
      Step v;
      for (int j = 0; j < N; ++j) v[j] = svd.v(k, j);
      if (svd.value(k) > 5e-8) {
        values_[rank_] = svd.value(k);
        Y_.row(rank_) = v.transpose();
        for (int j = 0; j < P; ++j) U_(rank_, j) = svd.u(k, j);
        ++rank_;
      } else if (v.squaredNorm() > 0.5) {
        Z_.row(free++) = v.transpose();
      }
    }
  }

  int rank() const { return rank_; }
  /// Rows: an orthonormal basis of what is free, N - rank() of them.
  const Eigen::Matrix<double, N, N>& freeBasis() const { return Z_; }
  /// The shortest solution of C δ = d; its length is that of fixedCoordinates().
  Step shortest(const Values& d) const {
    Step sum = Step::Zero();
    for (int k = 0; k < rank_; ++k) sum += fixedCoordinate(k, d) * Y_.row(k).transpose();
    return sum;
  }
  double shortestLength(const Values& d) const {
    double sum = 0;
    for (int k = 0; k < rank_; ++k) sum += fixedCoordinate(k, d) * fixedCoordinate(k, d);
    return std::sqrt(sum);
  }
  /// The length of the part of g that the equations fix.
  double fixedLength(const Step& g) const {
    double sum = 0;
    for (int k = 0; k < rank_; ++k) sum += along(k, g) * along(k, g);
    return std::sqrt(sum);
  }
  /// The shortest λ with Cᵀ λ = g on that part.
  Values multipliers(const Step& g) const {
    Values lambda = Values::Zero();
    for (int k = 0; k < rank_; ++k) {
      for (int j = 0; j < P; ++j) lambda[j] += scale_[j] * U_(k, j) * along(k, g) / values_[k];
    }
    return lambda;
  }
  /// The largest |c_k| over the length of its gradient, those left out included; where there is no gradient, |c_k|: nothing
  /// will ever meet that equation.
  double largest(const Values& c) const {
    double most = 0;
    for (int k = 0; k < P; ++k) most = std::max(most, std::abs(c[k]) * (scale_[k] > 0 ? scale_[k] : 1));
    return most;
  }

 private:
  double along(int k, const Step& g) const {
    double sum = 0;
    for (int j = 0; j < N; ++j) sum += Y_(k, j) * g[j];
    return sum;
  }
  double fixedCoordinate(int k, const Values& d) const {
    double sum = 0;
    for (int j = 0; j < P; ++j) sum += U_(k, j) * scale_[j] * d[j];
    return sum / values_[k];
  }

  Eigen::Matrix<double, N, N> Z_ = Eigen::Matrix<double, N, N>::Zero();
  Eigen::Matrix<double, size, N> Y_ = Eigen::Matrix<double, size, N>::Zero();
  Eigen::Matrix<double, size, P> U_ = Eigen::Matrix<double, size, P>::Zero();
  Eigen::Matrix<double, size, 1> values_ = Eigen::Matrix<double, size, 1>::Zero();
  Values scale_ = Values::Zero();
  int rank_ = 0;
};

/// The minimum of ½ δᵀ A δ - bᵀ δ along the directions that are free. Where A does not determine δ, it stays at zero.
template <int N>
class TangentSystem {
 public:
  using Step = Eigen::Matrix<double, N, 1>;
  using Square = Eigen::Matrix<double, N, N>;

  TangentSystem() = default;
  /// `basis`: orthonormal rows, `free` of them. A may be the Hessian of a Lagrangian: eigenvalues count by their size,
  /// where `indefinite` no less than a millionth of the largest.
  TangentSystem(const Square& A, const Square& basis, int free, bool indefinite = false) : A_(A), free_(free) {
    BasicSmallMatrix<N> reduced(free, free);
    const Square half = product(basis, A);
    double largest = 0;
    for (int i = 0; i < free; ++i) {
      for (int j = 0; j < free; ++j) {
        for (int k = 0; k < N; ++k) reduced(i, j) += half(i, k) * basis(j, k);
      }
      largest = std::max(largest, std::abs(reduced(i, i)));
    }
    // Coordinates of one scale, so that the rank does not depend on units; rounding is not blown up.
    Step scale = Step::Ones();
    for (int i = 0; i < free; ++i) {
      const double d = std::max(std::abs(reduced(i, i)), 1e-14 * largest);
      if (d > 0) scale[i] = 1 / std::sqrt(d);
    }
    for (int i = 0; i < free; ++i) {
      for (int j = 0; j < free; ++j) reduced(i, j) *= scale[i] * scale[j];
    }
    const SmallSvd svd(reduced);
    for (int k = 0; k < free; ++k) {
      values_[k] = svd.value(k);
      if (indefinite) values_[k] = std::max(values_[k], 1e-6 * svd.value(0));
      if (!(values_[k] > min_ratio * svd.value(0))) values_[k] = 0, ++null_dimension_;
      for (int i = 0; i < free; ++i) axes_.row(k) += svd.v(k, i) * scale[i] * basis.row(i);
    }
  }

  /// δ, from its part that the constraints fix.
  Step solve(const Step& b, Step fixed) const {
    const Step rest = b - product(A_, fixed);
    for (int k = 0; k < free_; ++k) {
      if (values_[k] > 0) fixed += axes_.row(k).transpose() * (axes_.row(k).dot(rest) / values_[k]);
    }
    return fixed;
  }
  /// The number of directions that A leaves open, and an orthonormal basis of them in the first columns.
  int nullDimension() const { return null_dimension_; }
  Square nullBasis() const {
    Square basis = Square::Zero();
    int next = 0;
    for (int k = 0; k < free_; ++k) {
      if (values_[k] > 0) continue;
      Step v = axes_.row(k).transpose().normalized();
      for (int j = 0; j < next; ++j) v -= basis.col(j).dot(v) * basis.col(j);
      basis.col(next++) = v.normalized();
    }
    return basis;
  }
  /// Z (Zᵀ A Z)⁻¹ Zᵀ; NaN where a direction is open.
  Square covariance() const {
    if (null_dimension_ > 0) return Square::Constant(std::numeric_limits<double>::quiet_NaN());
    Square sum = Square::Zero();
    for (int k = 0; k < free_; ++k) {
      for (int i = 0; i < N; ++i) {
        for (int j = 0; j < N; ++j) sum(i, j) += axes_(k, i) * axes_(k, j) / values_[k];
      }
    }
    return sum;
  }

 private:
  /// Information is a sum of squares: what is a smaller part of it is rounding.
  static constexpr double min_ratio = 1e-13;

  Square A_ = Square::Zero(), axes_ = Square::Zero();
  Step values_ = Step::Zero();
  int free_ = 0, null_dimension_ = 0;
};

}  // namespace liestat::detail
