// Eigenvalues of small symmetric matrices. One of the headers of small matrices, which lie/detail/small_matrix.hpp lists:
// Eigen's solver reduces to a tridiagonal matrix by blocked reflections, which costs a compiler seconds for each size.
#pragma once

#include <Eigen/Core>

#include <cmath>
#include <limits>
#include <utility>

namespace liestat::detail {

/// The eigenvalues of a symmetric matrix, ascending, and its orthonormal eigenvectors in columns, by Jacobi's rotations:
/// of a positive definite matrix each value is accurate to what its scaled diagonal allows. The lower triangle is read;
/// sizes may be run-time numbers, up to some tens. NaN and infinite entries give NaN.
template <class Matrix>
struct SymmetricEigen {
  using S = typename Matrix::Scalar;
  Eigen::Matrix<S, Matrix::RowsAtCompileTime, 1, 0, Matrix::MaxRowsAtCompileTime> values;
  Matrix vectors;

  explicit SymmetricEigen(Matrix A) : values(A.rows()), vectors(A.rows(), A.rows()) {
    const Eigen::Index n = A.rows();
    S nan_or_zero(0);
    for (Eigen::Index j = 0; j < n; ++j) {
      for (Eigen::Index i = 0; i < n; ++i) vectors(i, j) = S(i == j);
      for (Eigen::Index i = j; i < n; ++i) nan_or_zero += S(0) * A(i, j);
    }
    bool turned = nan_or_zero == S(0);
    for (int sweeps = 0; turned && sweeps < 40; ++sweeps) {
      turned = false;
      for (Eigen::Index p = 0; p < n; ++p) {
        for (Eigen::Index q = p + 1; q < n; ++q) turned = rotate(A, p, q) || turned;
      }
    }
    for (Eigen::Index i = 0; i < n; ++i) values[i] = A(i, i) + nan_or_zero;
    sort();
  }

 private:
  /// The rotation of the axes p < q after which A(q, p) is zero.
  bool rotate(Matrix& A, Eigen::Index p, Eigen::Index q) {
    using std::abs, std::sqrt;
    const S a = A(p, p), b = A(q, q), c = A(q, p);
    if (abs(c) <= std::numeric_limits<S>::epsilon() * sqrt(abs(a)) * sqrt(abs(b))) return false;
    // An element too small to change either diagonal element is gone.
    if (abs(a) + abs(c) == abs(a) && abs(b) + abs(c) == abs(b)) {
      A(q, p) = 0;
      return false;
    }
    const S zeta = (b - a) / (2 * c), t = (zeta < 0 ? S(-1) : S(1)) / (abs(zeta) + sqrt(1 + zeta * zeta));
    const S k = 1 / sqrt(1 + t * t), s = t * k;
    A(p, p) = a - t * c, A(q, q) = b + t * c, A(q, p) = 0;
    const Eigen::Index n = A.rows();
    const auto turn = [&](S& x, S& y) {
      const S before = x;
      x = k * before - s * y;
      y = s * before + k * y;
    };
    for (Eigen::Index i = 0; i < n; ++i) {
      if (i != p && i != q) turn(i < p ? A(p, i) : A(i, p), i < q ? A(q, i) : A(i, q));
      turn(vectors(i, p), vectors(i, q));
    }
    return true;
  }
  void sort() {
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      Eigen::Index least = i;
      for (Eigen::Index k = i + 1; k < values.size(); ++k) least = values[k] < values[least] ? k : least;
      if (least == i) continue;
      std::swap(values[i], values[least]);
      for (Eigen::Index j = 0; j < values.size(); ++j) std::swap(vectors(j, i), vectors(j, least));
    }
  }
};

}  // namespace liestat::detail
