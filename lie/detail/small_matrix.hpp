// The one house of small matrices. Here: factors by plain loops over a fixed size (Cholesky's, the pivoted one for
// matrices that may be singular, an inverse) and cofactors. Eigen's own are made for large matrices too: for each size
// they bring dozens of types of expressions and the blocked kernels of its products with them, which are never run here
// and cost a compiler seconds. Apart, so that users of a Cholesky factor do not compile them:
//
//   small_orthogonal.hpp   singular values, triangular factors: nothing is squared; run-time sizes up to a maximum
//   small_eigen.hpp        eigenvalues and eigenvectors of symmetric matrices
//   small_factors.hpp      A Aᵀ as a covariance, factors along principal axes
//   small_reduced.hpp      square roots of semi-definite matrices: closest, and reduced to independent rows
//   small_columns.hpp      3×3 blocks in vector registers
//   small_products.hpp     products of more rows than that, and A C Aᵀ; small_solve.hpp: equations of run-time sizes
//   nearest_rotation.hpp   the rotation nearest to a 3×3 matrix
//   trig.hpp               cross-product matrices, beside the coefficients that they are multiplied with
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstddef>
#include <cmath>
#include <limits>
#include <utility>

namespace liestat::detail {

/// Cholesky's factor A = L Lᵀ of a symmetric matrix, of which the lower triangle is read. Where that is not positive
/// definite, ok() is false and all results are NaN.
template <class S, int N>
class Cholesky {
 public:
  using Matrix = Eigen::Matrix<S, N, N>;

  explicit Cholesky(const Matrix& A) {
    using std::sqrt;
    for (int j = 0; j < N; ++j) {
      S pivot = A(j, j);
      for (int k = 0; k < j; ++k) pivot -= L_(j, k) * L_(j, k);
      // Written so that NaN is no success either.
      if (!(pivot > S(0))) {
        fail();
        return;
      }
      L_(j, j) = sqrt(pivot);
      inverse_pivots_[j] = S(1) / L_(j, j);
      for (int i = j + 1; i < N; ++i) {
        S sum = A(i, j);
        for (int k = 0; k < j; ++k) sum -= L_(i, k) * L_(j, k);
        L_(i, j) = sum * inverse_pivots_[j];
      }
    }
    ok_ = true;
  }

  bool ok() const { return ok_; }
  /// L⁻¹ B.
  template <int K>
  Eigen::Matrix<S, N, K> halfSolve(Eigen::Matrix<S, N, K> B) const {
    for (int c = 0; c < K; ++c) {
      for (int i = 0; i < N; ++i) {
        S sum = B(i, c);
        for (int k = 0; k < i; ++k) sum -= L_(i, k) * B(k, c);
        B(i, c) = sum * inverse_pivots_[i];
      }
    }
    return B;
  }
  /// A⁻¹ B.
  template <int K>
  Eigen::Matrix<S, N, K> solve(const Eigen::Matrix<S, N, K>& B) const {
    Eigen::Matrix<S, N, K> X = halfSolve<K>(B);
    for (int c = 0; c < K; ++c) {
      for (int i = N - 1; i >= 0; --i) {
        S sum = X(i, c);
        for (int k = i + 1; k < N; ++k) sum -= L_(k, i) * X(k, c);
        X(i, c) = sum * inverse_pivots_[i];
      }
    }
    return X;
  }
  /// A⁻¹, symmetric to the last bit.
  Matrix inverse() const {
    const Matrix half = halfSolve<N>(Matrix::Identity());
    Matrix X;
    for (int j = 0; j < N; ++j) {
      for (int i = j; i < N; ++i) {
        S sum(0);
        for (int k = i; k < N; ++k) sum += half(k, i) * half(k, j);
        X(i, j) = X(j, i) = sum;
      }
    }
    return X;
  }
  /// The j-th pivot: what the rows before j leave of A_jj.
  S pivot(int j) const { return L_(j, j) * L_(j, j); }
  /// L, zero above its diagonal.
  Matrix lower() const {
    Matrix L = L_;
    for (int j = 1; j < N && ok_; ++j) {
      for (int i = 0; i < j; ++i) L(i, j) = S(0);
    }
    return L;
  }
  /// log det A.
  S logDeterminant() const {
    using std::log;
    S sum(0);
    for (int i = 0; i < N; ++i) sum += log(L_(i, i));
    return S(2) * sum;
  }

 private:
  void fail() {
    const S nan = std::numeric_limits<S>::quiet_NaN();
    for (int j = 0; j < N; ++j) {
      inverse_pivots_[j] = nan;
      for (int i = 0; i < N; ++i) L_(i, j) = nan;
    }
  }

  Matrix L_;
  Eigen::Matrix<S, N, 1> inverse_pivots_;
  bool ok_ = false;
};

/// The factors A = L D Lᵀ of a symmetric matrix, of which the lower triangle is read: without the square roots of
/// Cholesky's, which wait for each other. Where A is not positive definite, ok() is false and all results are NaN.
template <class S, int N>
class DiagonalCholesky {
 public:
  using Matrix = Eigen::Matrix<S, N, N>;

  explicit DiagonalCholesky(const Matrix& A) {
    S scaled[static_cast<std::size_t>(N)];  // row i of L D
    for (int i = 0; i < N; ++i) {
      for (int j = 0; j < i; ++j) {
        scaled[j] = A(i, j);
        for (int k = 0; k < j; ++k) scaled[j] -= scaled[k] * L_(j, k);
      }
      S pivot = A(i, i);
      for (int j = 0; j < i; ++j) {
        L_(i, j) = scaled[j] * inverse_pivots_[j];
        pivot -= scaled[j] * L_(i, j);
      }
      // Written so that NaN is no success either.
      ok_ = ok_ && pivot > S(0);
      inverse_pivots_[i] = ok_ ? S(1) / pivot : std::numeric_limits<S>::quiet_NaN();
    }
  }

  bool ok() const { return ok_; }
  /// A⁻¹ B.
  template <int K>
  Eigen::Matrix<S, N, K> solve(Eigen::Matrix<S, N, K> X) const {
    for (int c = 0; c < K; ++c) {
      for (int i = 1; i < N; ++i) {
        for (int k = 0; k < i; ++k) X(i, c) -= L_(i, k) * X(k, c);
      }
      for (int i = N - 1; i >= 0; --i) {
        X(i, c) *= inverse_pivots_[i];
        for (int k = i + 1; k < N; ++k) X(i, c) -= L_(k, i) * X(k, c);
      }
    }
    return X;
  }

 private:
  Matrix L_;
  Eigen::Matrix<S, N, 1> inverse_pivots_;
  bool ok_ = true;
};

/// A square root B of a symmetric matrix that may be singular, B Bᵀ = A: Pᵀ L √D by LDLᵀ with the largest pivot first.
/// Pivots below zero, which rounding makes, count as zero. The lower triangle is read.
template <class S, int N>
class SemidefiniteRoot {
 public:
  explicit SemidefiniteRoot(Eigen::Matrix<S, N, N> A) {
    using std::sqrt;
    for (int j = 0; j < N; ++j) {
      for (int i = j + 1; i < N; ++i) A(j, i) = A(i, j);
    }
    for (int i = 0; i < N; ++i) order_[i] = i;
    for (int j = 0; j < N; ++j) {
      // The largest of the diagonal that is left, moved to the front.
      int pivot = j;
      for (int i = j + 1; i < N; ++i) {
        if (A(i, i) > A(pivot, pivot)) pivot = i;
      }
      if (pivot != j) {
        for (int k = 0; k < N; ++k) std::swap(A(j, k), A(pivot, k));
        for (int k = 0; k < N; ++k) std::swap(A(k, j), A(k, pivot));
        std::swap(order_[j], order_[pivot]);
      }
      const S d = A(j, j);
      scale_[j] = d > S(0) ? sqrt(d) : S(0);
      const S inverse = d > S(0) ? S(1) / d : S(0);
      for (int i = j + 1; i < N; ++i) {
        const S l = A(i, j) * inverse;
        for (int k = j + 1; k <= i; ++k) {
          A(i, k) -= l * A(k, j);
          A(k, i) = A(i, k);
        }
        A(j, i) = l;  // the row above the diagonal is not read again
      }
    }
    L_ = A;
  }

  /// B v.
  Eigen::Matrix<S, N, 1> operator*(const Eigen::Matrix<S, N, 1>& v) const {
    Eigen::Matrix<S, N, 1> result;
    for (int i = 0; i < N; ++i) {
      S sum = scale_[i] * v[i];
      for (int k = 0; k < i; ++k) sum += L_(k, i) * scale_[k] * v[k];
      result[order_[i]] = sum;
    }
    return result;
  }

 private:
  Eigen::Matrix<S, N, N> L_;  // its transpose, above the diagonal
  Eigen::Matrix<S, N, 1> scale_;
  Eigen::Matrix<int, N, 1> order_;
};

/// The matrix of cofactors, det(M) M⁻ᵀ: the cross products of M's columns. Also of singular matrices.
template <class S>
EIGEN_ALWAYS_INLINE Eigen::Matrix<S, 3, 3> cofactors(const Eigen::Matrix<S, 3, 3>& M) {
  Eigen::Matrix<S, 3, 3> result;
  result << M.col(1).cross(M.col(2)), M.col(2).cross(M.col(0)), M.col(0).cross(M.col(1));
  return result;
}

/// x = A⁻¹ b, false if A is not positive definite; for iterations that correct the rounding of their steps. The lower
/// triangle is read. Three equations by cofactors, whose one division makes them the fastest to finish.
template <class S, int N>
bool solveStep(const Eigen::Matrix<S, N, N>& A, const Eigen::Matrix<S, N, 1>& b, Eigen::Matrix<S, N, 1>& x) {
  if constexpr (N == 3) {
    const S a = A(0, 0), d = A(1, 1), f = A(2, 2), l = A(1, 0), m = A(2, 0), n = A(2, 1);
    const S c00 = d * f - n * n, c10 = m * n - l * f, c20 = l * n - m * d;
    const S c11 = a * f - m * m, c21 = l * m - a * n, c22 = a * d - l * l;
    const S determinant = a * c00 + (l * c10 + m * c20);
    if (!(a > S(0) && c22 > S(0) && determinant > S(0))) return false;
    const S scale = S(1) / determinant;
    x[0] = (c00 * b[0] + (c10 * b[1] + c20 * b[2])) * scale;
    x[1] = (c11 * b[1] + (c10 * b[0] + c21 * b[2])) * scale;
    x[2] = (c22 * b[2] + (c20 * b[0] + c21 * b[1])) * scale;
    return true;
  } else {
    const DiagonalCholesky<S, N> factor(A);
    if (factor.ok()) x = factor.template solve<1>(b);
    return factor.ok();
  }
}

/// A⁻¹ by Gauss' and Jordan's elimination with row pivots; infinite or NaN where A is singular.
template <class S, int N>
Eigen::Matrix<S, N, N> inverse(Eigen::Matrix<S, N, N> A) {
  using std::abs;
  Eigen::Matrix<S, N, N> X = Eigen::Matrix<S, N, N>::Identity();
  for (int j = 0; j < N; ++j) {
    int pivot = j;
    for (int i = j + 1; i < N; ++i) {
      if (abs(A(i, j)) > abs(A(pivot, j))) pivot = i;
    }
    for (int k = 0; k < N; ++k) {
      std::swap(A(j, k), A(pivot, k));
      std::swap(X(j, k), X(pivot, k));
    }
    const S scale = S(1) / A(j, j);
    for (int k = 0; k < N; ++k) A(j, k) *= scale, X(j, k) *= scale;
    for (int i = 0; i < N; ++i) {
      if (i == j) continue;
      const S factor = A(i, j);
      for (int k = 0; k < N; ++k) A(i, k) -= factor * A(j, k), X(i, k) -= factor * X(j, k);
    }
  }
  return X;
}

}  // namespace liestat::detail
