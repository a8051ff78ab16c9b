// Rotation matrices that are not: the quaternion of a rotation matrix by its largest pivot, and the rotation that is
// nearest to any matrix, without singular values.
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <lie/detail/trig.hpp>

#include <Eigen/LU>

namespace liestat::detail {

/// The symmetric K with qᵀ K q = tr(R(q)ᵀ M) for unit quaternions q = (x, y, z, w). For a rotation M = R(p),
/// K = 4 p pᵀ - I. (Davenport's matrix; B. K. P. Horn, "Closed-form solution of absolute orientation using unit
/// quaternions", JOSA A 4, 1987, section 4.)
template <class S>
Eigen::Matrix<S, 4, 4> rotationForm(const Eigen::Matrix<S, 3, 3>& M) {
  const S xx = M(0, 0), yy = M(1, 1), zz = M(2, 2);
  const S xy = M(0, 1) + M(1, 0), xz = M(0, 2) + M(2, 0), yz = M(1, 2) + M(2, 1);
  const S xw = M(2, 1) - M(1, 2), yw = M(0, 2) - M(2, 0), zw = M(1, 0) - M(0, 1);
  Eigen::Matrix<S, 4, 4> K;
  K << xx - yy - zz, xy, xz, xw,  //
      xy, yy - xx - zz, yz, yw,   //
      xz, yz, zz - xx - yy, zw,   //
      xw, yw, zw, xx + yy + zz;
  return K;
}

/// The column of a symmetric matrix whose diagonal entry is the largest.
template <class S>
Eigen::Matrix<S, 4, 1> largestColumn(const Eigen::Matrix<S, 4, 4>& A) {
  Eigen::Matrix<S, 4, 1> best = A.col(0);
  S pivot = A(0, 0);
  for (int k = 1; k < 4; ++k) {
    const auto larger = A(k, k) > pivot;
    for (int i = 0; i < 4; ++i) best[i] = select(larger, S(A(i, k)), best[i]);
    pivot = select(larger, S(A(k, k)), pivot);
  }
  return best;
}

/// A quaternion, not normalised, of a matrix that is a rotation up to rounding. Exact near half-turns, where the
/// trace says nothing of the axis.
template <class S>
Eigen::Matrix<S, 4, 1> quaternionOf(const Eigen::Matrix<S, 3, 3>& R) {
  Eigen::Matrix<S, 4, 4> K = rotationForm(R);
  K.diagonal().array() += S(1);
  return largestColumn(K);
}

/// adj(A) of a symmetric 4×4 matrix.
template <class S>
Eigen::Matrix<S, 4, 4> symmetricAdjugate(const Eigen::Matrix<S, 4, 4>& A) {
  Eigen::Matrix<S, 4, 4> adjugate;
  for (int i = 0; i < 4; ++i) {
    for (int j = i; j < 4; ++j) {
      Eigen::Matrix<S, 3, 3> minor;
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) minor(r, c) = A(r < i ? r : r + 1, c < j ? c : c + 1);
      }
      const S cofactor = minor.col(0).dot(minor.col(1).cross(minor.col(2)));
      adjugate(i, j) = adjugate(j, i) = (i + j) % 2 == 0 ? cofactor : S(-cofactor);
    }
  }
  return adjugate;
}

/// The unit quaternion of the rotation nearest to M in the Frobenius norm: R with the largest tr(Rᵀ M), also where
/// det M < 0. Rotation matrices that have drifted come back to rounding. Not unique, and arbitrary, where the two
/// smallest singular values are equal and det M < 0, or both zero.
template <class S>
Eigen::Matrix<S, 4, 1> nearestQuaternion(const Eigen::Matrix<S, 3, 3>& matrix) {
  using std::sqrt;
  const S squared = matrix.squaredNorm();
  const S size = sqrt(select(squared > S(0), squared, S(1)));
  const Eigen::Matrix<S, 3, 3> M = matrix / size;
  const Eigen::Matrix<S, 4, 4> K = rotationForm(M);
  // The largest root of det(λ - K) = λ⁴ - 2 |M|² λ² - 8 det(M) λ + det(K). All roots are real, so Newton's iteration
  // from an upper bound decreases to it; √3 |M| is that bound, and the root itself where M is a multiple of a rotation.
  const S linear = S(-8) * M.col(0).dot(M.col(1).cross(M.col(2)));
  const Eigen::Matrix<S, 4, 4> adjugate_of_K = symmetricAdjugate(K);
  const S constant = K.col(0).dot(adjugate_of_K.col(0));
  S lambda = static_cast<S>(std::sqrt(3.));
  for (int i = 0; i < 24; ++i) {
    const S l2 = lambda * lambda;
    const S value = (l2 - S(2)) * l2 + linear * lambda + constant, slope = S(4) * (l2 - S(1)) * lambda + linear;
    const S step = value / select(slope > S(0), slope, S(1));
    lambda -= select(step > S(0), step, S(0));
  }
  // The eigenvector: adj(λ - K) is a multiple of v vᵀ.
  const Eigen::Matrix<S, 4, 1> v =
      largestColumn(symmetricAdjugate(Eigen::Matrix<S, 4, 4>(lambda * Eigen::Matrix<S, 4, 4>::Identity() - K)));
  const S v2 = v.dot(v);
  const Eigen::Matrix<S, 4, 1> unit = v / sqrt(select(v2 > S(0), v2, S(1)));
  const Eigen::Matrix<S, 4, 1> q =
      select(v2 > S(0), S(1), S(0)) * unit + select(v2 > S(0), S(0), S(1)) * Eigen::Matrix<S, 4, 1>::Unit(3);
  // Newton's step on the rotation itself removes what the root of a polynomial leaves. P = R(q)ᵀ M is symmetric at the
  // solution; Exp(δ)ᵀ P is so to first order if (tr P - sym P) δ = vee(P - Pᵀ).
  const Eigen::Matrix<S, 3, 3> P = Eigen::Map<const Eigen::Quaternion<S>>(q.data()).toRotationMatrix().transpose() * M;
  Eigen::Matrix<S, 3, 3> H = S(-0.5) * (P + P.transpose());
  H.diagonal().array() += P.trace();
  const Eigen::Matrix<S, 3, 1> g(P(2, 1) - P(1, 2), P(0, 2) - P(2, 0), P(1, 0) - P(0, 1));
  const Eigen::Matrix<S, 3, 3> H_adjugate = cofactors(H);
  const S determinant = H.col(0).dot(H_adjugate.col(0));
  const auto regular = determinant > S(1e-6);
  const Eigen::Matrix<S, 3, 1> delta =
      (select(regular, S(1), S(0)) / select(regular, determinant, S(1))) * (H_adjugate.transpose() * g);
  const HalfAngle<S> h = halfAngle(S(delta.dot(delta)));
  const Eigen::Matrix<S, 3, 1> u = S(0.5) * h.sinc * delta;
  const Eigen::Quaternion<S> turned =
      Eigen::Map<const Eigen::Quaternion<S>>(q.data()) * Eigen::Quaternion<S>(h.cos, u[0], u[1], u[2]);
  return turned.coeffs() / sqrt(turned.coeffs().dot(turned.coeffs()));
}

}  // namespace liestat::detail
