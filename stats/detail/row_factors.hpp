// Products and factors of small matrices whose sizes are run-time numbers, by plain loops over rows of numbers.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace liestat::detail {

/// Row vectors of n numbers.
inline double dot(const double* a, const double* b, int n) {
  double sum = 0;
  for (int i = 0; i < n; ++i) sum += a[i] * b[i];
  return sum;
}
inline void addScaled(double* __restrict sum, double factor, const double* __restrict a, int n) {
  for (int i = 0; i < n; ++i) sum[i] += factor * a[i];
}
inline void copyRow(const double* __restrict a, int n, double* __restrict to) {
  for (int i = 0; i < n; ++i) to[i] = a[i];
}
inline double norm(const double* a, int n) { return std::sqrt(dot(a, a, n)); }
inline bool allFinite(const double* a, std::size_t n) {
  double zero = 0;  // NaN where one of them is not finite
  for (std::size_t i = 0; i < n; ++i) zero += 0 * a[i];
  return zero == 0;
}
inline std::size_t number(int n) { return static_cast<std::size_t>(n); }

/// C = A B, A n×m and B m×k, or C += A B; a row of known length is summed up in registers.
template <int k, bool add>
void multiplyRows(const double* __restrict A, const double* __restrict B, int n, int m, double* __restrict C) {
  for (int i = 0; i < n; ++i, A += m, C += k) {
    double sum[static_cast<std::size_t>(k)];
#pragma GCC unroll 6
    for (int c = 0; c < k; ++c) sum[c] = add ? C[c] : 0;
    for (int j = 0; j < m; ++j) {
#pragma GCC unroll 6
      for (int c = 0; c < k; ++c) sum[c] += A[j] * B[j * k + c];
    }
#pragma GCC unroll 6
    for (int c = 0; c < k; ++c) C[c] = sum[c];
  }
}
template <bool add>
void multiplyBy(const double* A, const double* B, int n, int m, int k, double* C) {
  switch (k) {
    case 1:
      return multiplyRows<1, add>(A, B, n, m, C);
    case 2:
      return multiplyRows<2, add>(A, B, n, m, C);
    case 3:
      return multiplyRows<3, add>(A, B, n, m, C);
    case 4:
      return multiplyRows<4, add>(A, B, n, m, C);
    case 5:
      return multiplyRows<5, add>(A, B, n, m, C);
    case 6:
      return multiplyRows<6, add>(A, B, n, m, C);
    default:
      if (!add) std::fill(C, C + n * k, 0.);
      for (int i = 0; i < n; ++i) {
        for (int j = 0; j < m; ++j) addScaled(C + i * k, A[i * m + j], B + j * k, k);
      }
  }
}
inline void multiply(const double* A, const double* B, int n, int m, int k, double* C) {
  multiplyBy<false>(A, B, n, m, k, C);
}
/// B = Aᵀ, A n×m.
inline void transpose(const double* __restrict A, int n, int m, double* __restrict B) {
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < m; ++j) B[j * n + i] = A[i * m + j];
  }
}
/// C = A Bᵀ, A n×m and B k×m, or C += A Bᵀ. `scratch` holds k m numbers. As products of rows, which a compiler makes
/// vector instructions of; of dot products it may not.
template <bool add = false>
void multiplyTransposed(const double* A, const double* B, int n, int m, int k, double* C, double* scratch) {
  transpose(B, k, m, scratch);
  multiplyBy<add>(A, scratch, n, m, k, C);
}

/// The reduced root of a symmetric P×P matrix S, which is used up (ReducedRoot of lie/detail/small_reduced.hpp, with
/// Pivoting::largest). Row k of `kept` holds the k-th row of L that is kept, 1/L_kk in place of L_kk; `order` says which
/// that is. `half` holds P² numbers.
inline int reducedRoot(double* S, int P, int max_rank, double* kept, int* order, double* half) {
  const double least = 10 * P * std::numeric_limits<double>::epsilon();
  // The bound that a pivot must exceed; infinite in rows that are kept.
  constexpr double kept_row = std::numeric_limits<double>::infinity();
  double* bound = half + P * P;
  for (int k = 0; k < P; ++k) bound[k] = least * S[k * P + k];
  int rank = 0;
  while (rank < max_rank) {
    int best = -1;
    double largest = 0;
    for (int k = 0; k < P; ++k) {
      const double pivot = S[k * P + k];
      // Written so that NaN is left out.
      if (!(pivot > bound[k]) || !(pivot > largest)) continue;
      best = k, largest = pivot;
    }
    if (best < 0) break;
    const double inverse = 1 / std::sqrt(largest);
    copyRow(half + best * P, rank, kept + rank * P);
    kept[rank * P + rank] = inverse;
    order[rank] = best, bound[best] = kept_row;
    if (++rank == max_rank) break;
    for (int i = 0; i < P; ++i) half[i * P + rank - 1] = S[i * P + best] * inverse;
    for (int i = 0; i < P; ++i) {
      for (int j = 0; j < P; ++j) S[i * P + j] -= half[i * P + rank - 1] * half[j * P + rank - 1];
    }
  }
  return rank;
}
/// L⁻¹ B of the rows that are kept, P×cols, in the first of P rows; the others are zero.
inline void halfSolve(const double* kept, const int* order, int rank, int P, const double* B, int cols, double* X) {
  for (int k = 0; k < rank; ++k, kept += P) {
    const double *row = B + order[k] * cols, inverse = kept[k];
    double* x = X + k * cols;
    if (k == 0) {
      for (int c = 0; c < cols; ++c) x[c] = row[c] * inverse;
      continue;
    }
    copyRow(row, cols, x);
    for (int l = 0; l < k; ++l) addScaled(x, -kept[l], X + l * cols, cols);
    for (int c = 0; c < cols; ++c) x[c] *= inverse;
  }
  std::fill(X + rank * cols, X + P * cols, 0.);
}
/// L⁻ᵀ Y, P×cols, back in the rows of the matrix; zero in those that are left out. Y is used up.
inline void halfSolveTransposed(const double* kept, const int* order, int rank, int P, double* Y, int cols, double* X) {
  std::fill(X, X + P * cols, 0.);
  for (int k = rank - 1; k >= 0; --k) {
    double* x = X + order[k] * cols;
    for (int c = 0; c < cols; ++c) x[c] = Y[k * cols + c] * kept[k * P + k];
    for (int l = 0; l < k; ++l) addScaled(Y + l * cols, -kept[k * P + l], x, cols);
  }
}

/// Cholesky's factor of a symmetric n×n matrix in its lower triangle; false where that is not positive definite.
inline bool choleskyFactor(double* A, int n) {
  for (int j = 0; j < n; ++j) {
    const double pivot = A[j * n + j] - dot(A + j * n, A + j * n, j);
    if (!(pivot > 0)) return false;
    A[j * n + j] = std::sqrt(pivot);
    for (int i = j + 1; i < n; ++i) A[i * n + j] = (A[i * n + j] - dot(A + i * n, A + j * n, j)) / A[j * n + j];
  }
  return true;
}
/// L⁻¹ B and A⁻¹ B in the place of B, n×m, from the factor.
inline void choleskyHalfSolve(const double* L, int n, double* B, int m) {
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < i; ++k) addScaled(B + i * m, -L[i * n + k], B + k * m, m);
    for (int c = 0; c < m; ++c) B[i * m + c] /= L[i * n + i];
  }
}
inline void choleskySolve(const double* L, int n, double* B, int m) {
  choleskyHalfSolve(L, n, B, m);
  for (int i = n - 1; i >= 0; --i) {
    for (int k = i + 1; k < n; ++k) addScaled(B + i * m, -L[k * n + i], B + k * m, m);
    for (int c = 0; c < m; ++c) B[i * m + c] /= L[i * n + i];
  }
}

}  // namespace liestat::detail
