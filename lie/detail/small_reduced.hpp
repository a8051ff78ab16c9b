// Square roots of symmetric matrices that are only semi-definite: the "closest" and the "reduced" root of Viéville,
// Lingrand and Gaspard 2000, section 3.3, with relative thresholds in place of the report's absolute one (at a scale of
// 1e-18 an absolute threshold replaces every pivot). One of the headers of small matrices, which
// lie/detail/small_matrix.hpp lists.
#pragma once

#include <Eigen/Core>

#include <cmath>
#include <limits>

namespace liestat::detail {

/// The closest root: L Lᵀ = S + Σ ν_k e_k e_kᵀ with small ν_k ≥ 0. A pivot of at most 10 eps N times the largest diagonal
/// element is set to that and the column below it to zero, so that L is regular unless S = 0. The lower triangle is
/// read.
template <class S, int N>
Eigen::Matrix<S, N, N> closestRoot(const Eigen::Matrix<S, N, N>& A) {
  using std::sqrt;
  const S least = S(10 * N) * std::numeric_limits<S>::epsilon() * A.diagonal().maxCoeff();
  Eigen::Matrix<S, N, N> L = Eigen::Matrix<S, N, N>::Zero();
  for (int j = 0; j < N; ++j) {
    S pivot = A(j, j);
    for (int k = 0; k < j; ++k) pivot -= L(j, k) * L(j, k);
    if (!(pivot > least)) {
      L(j, j) = sqrt(least);
      continue;
    }
    L(j, j) = sqrt(pivot);
    for (int i = j + 1; i < N; ++i) {
      S sum = A(i, j);
      for (int k = 0; k < j; ++k) sum -= L(i, k) * L(j, k);
      L(i, j) = sum / L(j, j);
    }
  }
  return L;
}

/// Which of several redundant rows a reduced root keeps.
enum class Pivoting {
  first,   ///< the first independent ones
  largest  ///< the one with the largest diagonal element that remains, again and again
};

/// The reduced root: Cholesky's factor of the rows and columns of S that are independent. Row k is left out when its
/// pivot falls to 10 eps N of S_kk: rows of a Jacobian that are closer than about 5e-8 rad count as one. The matrix is
/// read whole.
template <class S, int N>
class ReducedRoot {
 public:
  ReducedRoot() = default;
  /// Keeps at most `max_rank` rows.
  explicit ReducedRoot(Eigen::Matrix<S, N, N> A, Pivoting pivoting = Pivoting::largest, int max_rank = N) {
    using std::sqrt;
    const Eigen::Matrix<S, N, 1> original = A.diagonal();
    const S least = S(10 * N) * std::numeric_limits<S>::epsilon();
    bool left[static_cast<std::size_t>(N)];
    for (bool& l : left) l = true;
    while (rank_ < max_rank) {
      int best = -1;
      S largest(0);
      for (int k = 0; k < N; ++k) {
        // Written so that NaN is left out.
        if (!left[k] || !(A(k, k) > least * original[k]) || !(A(k, k) > largest)) continue;
        best = k;
        if (pivoting == Pivoting::first) break;
        largest = A(k, k);
      }
      if (best < 0) return;
      left[best] = false;
      order_[rank_] = best;
      const S d = sqrt(A(best, best));
      L_(best, rank_) = d;
      for (int i = 0; i < N; ++i) {
        if (left[i]) L_(i, rank_) = A(i, best) / d;
      }
      for (int j = 0; j < N; ++j) {
        if (!left[j]) continue;
        for (int i = 0; i < N; ++i) {
          if (left[i]) A(i, j) -= L_(i, rank_) * L_(j, rank_);
        }
      }
      ++rank_;
    }
  }

  /// The number of rows that are kept; row(k) is the k-th of them.
  int rank() const { return rank_; }
  int row(int k) const { return order_[k]; }

  /// L⁻¹ B of the rows that are kept, in the first rank() rows; the others are zero.
  template <int K>
  Eigen::Matrix<S, N, K> halfSolve(const Eigen::Matrix<S, N, K>& B) const {
    Eigen::Matrix<S, N, K> X = Eigen::Matrix<S, N, K>::Zero();
    for (int c = 0; c < K; ++c) {
      for (int i = 0; i < rank_; ++i) {
        S sum = B(order_[i], c);
        for (int k = 0; k < i; ++k) sum -= L_(order_[i], k) * X(k, c);
        X(i, c) = sum / L_(order_[i], i);
      }
    }
    return X;
  }
  /// L⁻ᵀ y, back in the rows of the matrix; zero in those that are left out.
  Eigen::Matrix<S, N, 1> halfSolveTransposed(Eigen::Matrix<S, N, 1> y) const {
    Eigen::Matrix<S, N, 1> x = Eigen::Matrix<S, N, 1>::Zero();
    for (int i = rank_ - 1; i >= 0; --i) {
      const S value = y[i] / L_(order_[i], i);
      x[order_[i]] = value;
      for (int k = 0; k < i; ++k) y[k] -= L_(order_[i], k) * value;
    }
    return x;
  }

 private:
  Eigen::Matrix<S, N, N> L_ = Eigen::Matrix<S, N, N>::Zero();  // rows as in the matrix, columns in the order of pivots
  int order_[static_cast<std::size_t>(N)] = {};
  int rank_ = 0;
};

}  // namespace liestat::detail
