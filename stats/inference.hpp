#pragma once

// Confidence ellipsoids of a covariance, and with stats/laws.hpp the laws of squared Mahalanobis distances (needs
// Boost.Math, Debian: libboost-dev).
//
// Nothing here throws: arguments outside a function's domain, and NaN, give NaN.

#include <lie/detail/small_eigen.hpp>
#include <stats/laws.hpp>

#include <Eigen/Core>

#include <cmath>
#include <limits>

namespace liestat {

/// The set of points whose squared Mahalanobis distance from the centre is at most `threshold`.
template <class Matrix>
struct ConfidenceEllipsoid {
  using Vector = Eigen::Matrix<typename Matrix::Scalar, Matrix::RowsAtCompileTime, 1>;

  Vector semi_axes;      ///< lengths, the longest first
  Matrix directions;     ///< unit vectors in the columns, in the order of the lengths; the largest coefficient positive
  double threshold = 0;  ///< squared Mahalanobis distance of the surface
  bool valid = false;    ///< false: not a covariance or not a probability, everything is NaN
};

/// The ellipsoid (k = 2: ellipse) with squared Mahalanobis distance `threshold` ≥ 0 of a k×k covariance (symmetric; the
/// lower triangle is read). A semi-definite covariance gives axes of length zero; eigenvalues below zero by no more
/// than rounding are taken as zero, otherwise the result is not valid.
template <class Derived>
ConfidenceEllipsoid<typename Derived::PlainObject> ellipsoid(const Eigen::MatrixBase<Derived>& covariance,
                                                             double threshold) {
  using Matrix = typename Derived::PlainObject;
  using Scalar = typename Matrix::Scalar;
  eigen_assert(covariance.rows() == covariance.cols());
  const Eigen::Index k = covariance.rows();
  ConfidenceEllipsoid<Matrix> result;
  result.semi_axes.setConstant(k, std::numeric_limits<Scalar>::quiet_NaN());
  result.directions.setConstant(k, k, std::numeric_limits<Scalar>::quiet_NaN());
  result.threshold = detail::not_a_number;
  if (!(threshold >= 0) || k == 0 || !covariance.derived().allFinite()) return result;

  const detail::SymmetricEigen<Matrix> eigen(covariance);
  const Scalar largest = eigen.values[k - 1];
  const Scalar rounding = Scalar(4 * k) * std::numeric_limits<Scalar>::epsilon() * largest;
  if (!(largest >= 0) || eigen.values[0] < -rounding) return result;

  for (Eigen::Index i = 0; i < k; ++i) {
    using std::sqrt;
    const Eigen::Index from = k - 1 - i;  // ascending order
    const Scalar eigenvalue = eigen.values[from];
    result.semi_axes[i] = eigenvalue > 0 ? sqrt(eigenvalue * static_cast<Scalar>(threshold)) : Scalar(0);
    Eigen::Index at = 0;
    eigen.vectors.col(from).cwiseAbs().maxCoeff(&at);
    const Scalar sign = eigen.vectors(at, from) < 0 ? Scalar(-1) : Scalar(1);
    result.directions.col(i) = sign * eigen.vectors.col(from);
  }
  result.threshold = threshold;
  result.valid = true;
  return result;
}

/// The ellipsoid that covers the truth with the given probability under a law of the right dimension.
template <class Derived>
ConfidenceEllipsoid<typename Derived::PlainObject> confidenceEllipsoid(const Eigen::MatrixBase<Derived>& covariance,
                                                                       double probability, const ReferenceLaw& law) {
  const bool fits = law.dof() == covariance.rows();
  return ellipsoid(covariance, fits && probability < 1 ? law.quantile(probability) : detail::not_a_number);
}

/// The same for a known covariance: χ²_k.
template <class Derived>
ConfidenceEllipsoid<typename Derived::PlainObject> confidenceEllipsoid(const Eigen::MatrixBase<Derived>& covariance,
                                                                       double probability) {
  return confidenceEllipsoid(covariance, probability, ReferenceLaw::chiSquared(static_cast<int>(covariance.rows())));
}

}  // namespace liestat
