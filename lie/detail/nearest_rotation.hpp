// Rotation matrices that are not: the quaternion of a rotation matrix by its largest pivot, and the rotation that is
// nearest to any matrix, without singular values. Nearly every unit of fusion/ needs it: written element by element, for
// its expressions of Eigen took a compiler two seconds in each of them.
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <lie/detail/trig.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>
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
  const S rows[4][4] = {
      {xx - yy - zz, xy, xz, xw}, {xy, yy - xx - zz, yz, yw}, {xz, yz, zz - xx - yy, zw}, {xw, yw, zw, xx + yy + zz}};
  Eigen::Matrix<S, 4, 4> K;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) K(i, j) = rows[i][j];
  }
  return K;
}

/// The column of a symmetric matrix whose diagonal entry is the largest.
template <class S>
Eigen::Matrix<S, 4, 1> largestColumn(const Eigen::Matrix<S, 4, 4>& A) {
  Eigen::Matrix<S, 4, 1> best(A(0, 0), A(1, 0), A(2, 0), A(3, 0));
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
  for (int k = 0; k < 4; ++k) K(k, k) += S(1);
  return largestColumn(K);
}

/// The determinant of a 3×3 matrix.
template <class S>
S determinantOf(const Eigen::Matrix<S, 3, 3>& M) {
  return M(0, 0) * (M(1, 1) * M(2, 2) - M(2, 1) * M(1, 2)) + M(1, 0) * (M(2, 1) * M(0, 2) - M(0, 1) * M(2, 2)) +
         M(2, 0) * (M(0, 1) * M(1, 2) - M(1, 1) * M(0, 2));
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
      const S cofactor = determinantOf(minor);
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
  S squared(0);
  for (int i = 0; i < 9; ++i) squared += matrix(i / 3, i % 3) * matrix(i / 3, i % 3);
  const S size = sqrt(select(squared > S(0), squared, S(1)));
  Eigen::Matrix<S, 3, 3> M;
  for (int i = 0; i < 9; ++i) M(i / 3, i % 3) = matrix(i / 3, i % 3) / size;
  const Eigen::Matrix<S, 4, 4> K = rotationForm(M);
  // The largest root of det(λ - K) = λ⁴ - 2 |M|² λ² - 8 det(M) λ + det(K). All roots are real, so Newton's iteration
  // from an upper bound decreases to it; √3 |M| is that bound, and the root itself where M is a multiple of a rotation.
  const S linear = S(-8) * determinantOf(M);
  const Eigen::Matrix<S, 4, 4> adjugate_of_K = symmetricAdjugate(K);
  S constant = K(0, 0) * adjugate_of_K(0, 0);
  for (int i = 1; i < 4; ++i) constant += K(i, 0) * adjugate_of_K(i, 0);
  S lambda = static_cast<S>(std::sqrt(3.));
  for (int i = 0; i < 24; ++i) {
    const S l2 = lambda * lambda;
    const S value = (l2 - S(2)) * l2 + linear * lambda + constant, slope = S(4) * (l2 - S(1)) * lambda + linear;
    const S step = value / select(slope > S(0), slope, S(1));
    lambda -= select(step > S(0), step, S(0));
  }
  // The eigenvector: adj(λ - K) is a multiple of v vᵀ.
  Eigen::Matrix<S, 4, 4> shifted;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) shifted(i, j) = i == j ? S(lambda - K(i, j)) : S(-K(i, j));
  }
  const Eigen::Matrix<S, 4, 1> v = largestColumn(symmetricAdjugate(shifted));
  const S v2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + v[3] * v[3], length = sqrt(select(v2 > S(0), v2, S(1)));
  Eigen::Matrix<S, 4, 1> q;
  for (int i = 0; i < 4; ++i) q[i] = select(v2 > S(0), S(v[i] / length), S(i == 3 ? 1 : 0));
  // Newton's step on the rotation itself removes what the root of a polynomial leaves. P = R(q)ᵀ M is symmetric at the
  // solution; Exp(δ)ᵀ P is so to first order if (tr P - sym P) δ = vee(P - Pᵀ).
  const Eigen::Matrix<S, 3, 3> R = Eigen::Map<const Eigen::Quaternion<S>>(q.data()).toRotationMatrix();
  Eigen::Matrix<S, 3, 3> P, H;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) P(i, j) = R(0, i) * M(0, j) + R(1, i) * M(1, j) + R(2, i) * M(2, j);
  }
  const S trace = P(0, 0) + P(1, 1) + P(2, 2);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) H(i, j) = S(-0.5) * (P(i, j) + P(j, i)) + (i == j ? trace : S(0));
  }
  const Eigen::Matrix<S, 3, 1> g(P(2, 1) - P(1, 2), P(0, 2) - P(2, 0), P(1, 0) - P(0, 1));
  // H is symmetric, and so are its cofactors.
  Eigen::Matrix<S, 3, 3> cofactor;
  for (int i = 0; i < 3; ++i) {
    const int a = (i + 1) % 3, b = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      const int c = (j + 1) % 3, d = (j + 2) % 3;
      cofactor(i, j) = H(a, c) * H(b, d) - H(a, d) * H(b, c);
    }
  }
  const S determinant = H(0, 0) * cofactor(0, 0) + H(1, 0) * cofactor(1, 0) + H(2, 0) * cofactor(2, 0);
  const auto regular = determinant > S(1e-6);
  const S inverse = select(regular, S(1), S(0)) / select(regular, determinant, S(1));
  S delta[3], squared_delta(0);
  for (int i = 0; i < 3; ++i) {
    delta[i] = inverse * (cofactor(0, i) * g[0] + cofactor(1, i) * g[1] + cofactor(2, i) * g[2]);
    squared_delta += delta[i] * delta[i];
  }
  // q · Exp(δ).
  const HalfAngle<S> h = halfAngle(squared_delta);
  const S half = S(0.5) * h.sinc, x = half * delta[0], y = half * delta[1], z = half * delta[2], w = h.cos;
  const S turned[4] = {q[3] * x + q[0] * w + q[1] * z - q[2] * y, q[3] * y + q[1] * w + q[2] * x - q[0] * z,
                       q[3] * z + q[2] * w + q[0] * y - q[1] * x, q[3] * w - q[0] * x - q[1] * y - q[2] * z};
  const S norm = sqrt(S(turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2] + turned[3] * turned[3]));
  return Eigen::Matrix<S, 4, 1>(turned[0] / norm, turned[1] / norm, turned[2] / norm, turned[3] / norm);
}

}  // namespace liestat::detail
