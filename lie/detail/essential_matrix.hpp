// From an essential matrix back to rotation and direction, in closed form, and the depths of a point in two views.
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <lie/detail/trig.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace liestat::detail {

/// Direction and the two rotations of an essential matrix ±E = [d] R; rotations to the accuracy to which E is
/// essential.
template <class S>
struct EssentialParts {
  Eigen::Matrix<S, 3, 1> direction;
  Eigen::Matrix<S, 3, 3> rotation;  ///< E = |E| [d] R
  Eigen::Matrix<S, 3, 3> twisted;   ///< E = |E| [-d] R', R' = Exp(pi d) R
};

/// Horn 1990 ("Recovering baseline and orientation from essential matrix"): for E = [b] R the matrix of cofactors is
/// b bᵀ R, so its columns are multiples of b, of which the longest is taken; and |b|² R = cof(E) - [b] E. Twice |b|² is
/// the squared norm of E.
template <class S>
EssentialParts<S> essentialParts(const Eigen::Matrix<S, 3, 3>& E) {
  using std::sqrt;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;
  // The Frobenius norm becomes √2, that of [d] R.
  const Matrix3 unit = E * (S(1) / sqrt(S(0.5) * E.squaredNorm()));
  const Matrix3 cofactors = detail::cofactors(unit);
  Vector3 longest = cofactors.col(0);
  S length = longest.squaredNorm();
  for (int k = 1; k < 3; ++k) {
    const S other = cofactors.col(k).squaredNorm();
    for (int i = 0; i < 3; ++i) longest[i] = select(other > length, S(cofactors(i, k)), longest[i]);
    length = select(other > length, other, length);
  }
  EssentialParts<S> parts;
  parts.direction = longest / sqrt(length);
  const Matrix3 turned = skew(parts.direction) * unit;
  parts.rotation = cofactors - turned;
  parts.twisted = cofactors + turned;
  return parts;
}

/// True if the point that a relative pose triangulates from two bearing vectors lies in front of both views: the depths
/// in λ_a x_a = λ_b R x_b + d are (d × y)·(x_a × y) and (d × x_a)·(x_a × y) over |x_a × y|², y = R x_b.
template <class Pose, class A, class B>
bool isInFront(const Pose& pose, const Eigen::MatrixBase<A>& x_a, const Eigen::MatrixBase<B>& x_b) {
  using S = typename Pose::Scalar;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const Vector3 x = x_a, d = pose.direction().unit_vector(), y = pose.so3() * Vector3(x_b), n = x.cross(y);
  return d.cross(y).dot(n) > S(0) && d.cross(x).dot(n) > S(0);
}

}  // namespace liestat::detail
