// The dense part of a constrained step: n unknowns, a quadratic criterion, linear constraints that may be redundant.
// Definitions of stats/detail/constrained_core.hpp.
#pragma once

#include <lie/detail/small_orthogonal.hpp>
#include <stats/detail/constrained_core.hpp>
#include <stats/detail/row_factors.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace liestat::detail {

inline double norm(const Numbers& a) { return norm(a.data(), static_cast<int>(a.size())); }
inline double dot(const Numbers& a, const Numbers& b) { return dot(a.data(), b.data(), static_cast<int>(a.size())); }
inline bool allFinite(const Numbers& a) { return allFinite(a.data(), a.size()); }
inline bool allFinite(const Rows& A) {
  return allFinite(A.data(), static_cast<std::size_t>(A.rows()) * static_cast<std::size_t>(A.cols()));
}
inline void multiply(const Rows& A, const Numbers& x, Numbers& result) {
  for (int i = 0; i < A.rows(); ++i) result[number(i)] = dot(A[i], x.data(), A.cols());
}

inline ConstraintBasis::ConstraintBasis(int unknowns, int equations)
    : n_(unknowns),
      p_(equations),
      Z_(n_, n_),
      Y_(std::max(n_, p_), n_),
      U_(std::max(n_, p_), p_),
      values_(number(std::max(n_, p_))),
      scale_(number(p_)) {
  for (int k = 0; k < n_; ++k) Z_[k][k] = 1;
}
inline void ConstraintBasis::compute(const Rows& C) {
  const int size = std::max(n_, p_);
  Z_.setZero();
  rank_ = 0;
  // Transposed: its columns, which are rotated, are the constraints, fewer than the coordinates. Filled up to a square;
  // the zeros that fill it up are never mixed with the rest.
  BasicSmallMatrix<Eigen::Dynamic> columns(size, size);
  for (int k = 0; k < p_; ++k) {
    const double length = norm(C[k], n_);
    scale_[number(k)] = length > 0 && std::isfinite(length) ? 1 / length : 0;
    for (int j = 0; j < n_; ++j) columns(j, k) = scale_[number(k)] * C[k][j];
  }
  const SmallSvd svd(columns);
  int free = 0;
  for (int k = 0; k < size; ++k) {
    const double* direction = svd.u.row(k);
    if (svd.value(k) > 5e-8) {
      values_[number(rank_)] = svd.value(k);
      std::copy(direction, direction + n_, Y_[rank_]);
      std::copy(svd.v.row(k), svd.v.row(k) + p_, U_[rank_]);
      ++rank_;
    } else if (dot(direction, direction, n_) > 0.5) {
      std::copy(direction, direction + n_, Z_[free++]);
    }
  }
}
inline void ConstraintBasis::shortest(const Numbers& d, double factor, Numbers& step) const {
  std::fill(step.begin(), step.end(), 0.);
  for (int k = 0; k < rank_; ++k) addScaled(step.data(), factor * fixedCoordinate(k, d), Y_[k], n_);
}
inline double ConstraintBasis::shortestLength(const Numbers& d) const {
  double sum = 0;
  for (int k = 0; k < rank_; ++k) sum += std::pow(fixedCoordinate(k, d), 2);
  return std::sqrt(sum);
}
inline double ConstraintBasis::fixedLength(const Numbers& g) const {
  double sum = 0;
  for (int k = 0; k < rank_; ++k) sum += std::pow(along(k, g), 2);
  return std::sqrt(sum);
}
inline void ConstraintBasis::multipliers(const Numbers& g, Numbers& lambda) const {
  std::fill(lambda.begin(), lambda.end(), 0.);
  for (int k = 0; k < rank_; ++k) {
    const double coordinate = -along(k, g) / values_[number(k)];
    for (int j = 0; j < p_; ++j) lambda[number(j)] += scale_[number(j)] * U_[k][j] * coordinate;
  }
}
inline double ConstraintBasis::largest(const Numbers& c) const {
  double most = 0;
  for (std::size_t k = 0; k < c.size(); ++k) most = std::max(most, std::abs(c[k]) * (scale_[k] > 0 ? scale_[k] : 1));
  return most;
}
inline double ConstraintBasis::along(int k, const Numbers& g) const { return dot(Y_[k], g.data(), n_); }
inline double ConstraintBasis::fixedCoordinate(int k, const Numbers& d) const {
  double sum = 0;
  for (int j = 0; j < p_; ++j) sum += U_[k][j] * scale_[number(j)] * d[number(j)];
  return sum / values_[number(k)];
}

inline void TangentSystem::compute(const Rows& A, const Rows& basis, int free, bool indefinite) {
  // Information is a sum of squares: what is a smaller part of it is rounding.
  constexpr double min_ratio = 1e-13;
  const int n = A.rows();
  A_ = A, free_ = free, null_dimension_ = 0;
  axes_.setZero();
  BasicSmallMatrix<Eigen::Dynamic> reduced(free, free);
  Numbers half(number(n)), scale(number(n), 1.);
  double largest = 0;
  for (int i = 0; i < free; ++i) {
    std::fill(half.begin(), half.end(), 0.);
    for (int k = 0; k < n; ++k) addScaled(half.data(), basis[i][k], A[k], n);
    for (int j = 0; j < free; ++j) reduced(i, j) = dot(half.data(), basis[j], n);
    largest = std::max(largest, std::abs(reduced(i, i)));
  }
  // Coordinates of one scale, so that the rank does not depend on units; rounding is not blown up.
  for (int i = 0; i < free; ++i) {
    const double d = std::max(std::abs(reduced(i, i)), 1e-14 * largest);
    if (d > 0) scale[number(i)] = 1 / std::sqrt(d);
  }
  for (int i = 0; i < free; ++i) {
    for (int j = 0; j < free; ++j) reduced(i, j) *= scale[number(i)] * scale[number(j)];
  }
  const SmallSvd svd(reduced);
  for (int k = 0; k < free; ++k) {
    double& value = values_[number(k)];
    value = svd.value(k);
    if (indefinite) value = std::max(value, 1e-6 * svd.value(0));
    if (!(value > min_ratio * svd.value(0))) value = 0, ++null_dimension_;
    for (int i = 0; i < free; ++i) addScaled(axes_[k], svd.v(k, i) * scale[number(i)], basis[i], n);
  }
}
inline void TangentSystem::solve(const Numbers& b, Numbers& step) const {
  Numbers rest(b.size());
  multiply(A_, step, rest);
  for (std::size_t i = 0; i < b.size(); ++i) rest[i] = b[i] - rest[i];
  for (int k = 0; k < free_; ++k) {
    const double value = values_[number(k)];
    if (value > 0) addScaled(step.data(), dot(axes_[k], rest.data(), A_.rows()) / value, axes_[k], A_.rows());
  }
}
inline Rows TangentSystem::nullBasis() const {
  const int n = A_.rows();
  Rows found(null_dimension_, n);
  const auto normalise = [n](double* v) {
    const double length = norm(v, n);
    for (int i = 0; i < n && length > 0; ++i) v[i] /= length;
  };
  int next = 0;
  for (int k = 0; k < free_; ++k) {
    if (values_[number(k)] > 0) continue;
    double* v = found[next];
    std::copy(axes_[k], axes_[k] + n, v);
    normalise(v);
    for (int j = 0; j < next; ++j) addScaled(v, -dot(found[j], v, n), found[j], n);
    normalise(v);
    ++next;
  }
  return found;
}
inline Rows TangentSystem::determinedBasis() const {
  const int n = A_.rows();
  Rows basis(free_ - null_dimension_, n);
  for (int k = 0, next = 0; k < free_; ++k) {
    if (values_[number(k)] > 0) addScaled(basis[next++], 1 / std::sqrt(values_[number(k)]), axes_[k], n);
  }
  return basis;
}
inline Rows TangentSystem::covariance() const {
  const int n = A_.rows();
  Rows sum(n, n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      for (int k = 0; k < free_; ++k) {
        if (values_[number(k)] > 0) sum[i][j] += axes_[k][i] * axes_[k][j] / values_[number(k)];
      }
    }
  }
  return sum;
}

}  // namespace liestat::detail
