// The measurements of one kind in a constrained estimate: each measurement's equations linearised, its own correction
// eliminated (Viéville, Lingrand and Gaspard 2000, appendix A, corrected). Definitions of
// stats/detail/constrained_core.hpp. What the front does not call is inline, so that position-independent code calls none of
// it through a table.
#pragma once

#include <stats/detail/tangent_system.hpp>

#include <lie/detail/small_orthogonal.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace liestat::detail {

// ------------------------------------------------------------------------------------------------------------ noises

inline std::size_t NoiseTable::stride() const {
  return number(form == Form::isotropic ? 1 : form == Form::diagonal ? dimension : dimension * dimension);
}
inline double NoiseTable::squaredNorm(std::size_t i, const double* e) const {
  const double* Q = information.data() + index(i) * stride();
  double sum = 0;
  switch (form) {
    case Form::isotropic:
      return dot(e, e, dimension) * Q[0];
    case Form::diagonal:
      for (int k = 0; k < dimension; ++k) sum += e[k] * e[k] * Q[k];
      return sum;
    default:
      for (int k = 0; k < dimension; ++k) sum += e[k] * dot(Q + k * dimension, e, dimension);
      return sum;
  }
}
inline void NoiseTable::spread(std::size_t i, const double* D, int rows, double* result) const {
  const double* V = covariance.data() + index(i) * stride();
  for (int p = 0; p < rows; ++p, D += dimension, result += dimension) {
    for (int k = 0; k < dimension; ++k) {
      result[k] = form == Form::full ? dot(V + k * dimension, D, dimension) : V[form == Form::isotropic ? 0 : k] * D[k];
    }
  }
}
inline void NoiseTable::matrix(const Numbers& list, std::size_t i, double* result) const {
  const double* values = list.data() + index(i) * stride();
  for (int k = 0; k < dimension; ++k) {
    for (int l = 0; l < dimension; ++l, ++result) {
      *result = form == Form::full ? values[k * dimension + l] : k != l ? 0 : values[form == Form::isotropic ? 0 : k];
    }
  }
}
inline double NoiseTable::typicalDeviation(std::size_t i) const {
  const double* V = covariance.data() + index(i) * stride();
  double trace = 0;
  for (int k = 0; k < dimension; ++k) {
    trace += V[form == Form::full ? k * (dimension + 1) : form == Form::diagonal ? k : 0];
  }
  return std::sqrt(trace / dimension);
}

// ----------------------------------------------------------------------------------------------------- small factors

/// The reduced root of a symmetric P×P matrix S, which is used up (ReducedRoot of lie/detail/small_reduced.hpp, with
/// Pivoting::largest). Row k of `kept` holds the k-th row of L that is kept, 1/L_kk in place of L_kk; `order` says which
/// that is. `half` holds P² numbers.
inline int reducedRoot(double* S, int P, int max_rank, double* kept, int* order, double* half) {
  const double least = 10 * P * std::numeric_limits<double>::epsilon();
  const auto isLeft = [&](int k, int rank) { return std::find(order, order + rank, k) == order + rank; };
  double* original = half + P * P;
  for (int k = 0; k < P; ++k) original[k] = S[k * P + k];
  int rank = 0;
  while (rank < max_rank) {
    int best = -1;
    double largest = 0;
    for (int k = 0; k < P; ++k) {
      const double pivot = S[k * P + k];
      // Written so that NaN is left out.
      if (!isLeft(k, rank) || !(pivot > least * original[k]) || !(pivot > largest)) continue;
      best = k, largest = pivot;
    }
    if (best < 0) break;
    const double inverse = 1 / std::sqrt(largest);
    std::copy(half + best * P, half + best * P + rank, kept + rank * P);
    kept[rank * P + rank] = inverse;
    order[rank] = best;
    for (int i = 0; i < P; ++i) {
      if (isLeft(i, rank + 1)) half[i * P + rank] = S[i * P + best] * inverse;
    }
    for (int i = 0; i < P; ++i) {
      if (!isLeft(i, rank + 1)) continue;
      for (int j = 0; j < P; ++j) S[i * P + j] -= half[i * P + rank] * half[j * P + rank];
    }
    ++rank;
  }
  return rank;
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
/// A⁻¹ B in the place of B, n×m, from the factor.
inline void choleskySolve(const double* L, int n, double* B, int m) {
  const auto divide = [&](int i) {
    for (int c = 0; c < m; ++c) B[i * m + c] /= L[i * n + i];
  };
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < i; ++k) addScaled(B + i * m, -L[i * n + k], B + k * m, m);
    divide(i);
  }
  for (int i = n - 1; i >= 0; --i) {
    for (int k = i + 1; k < n; ++k) addScaled(B + i * m, -L[k * n + i], B + k * m, m);
    divide(i);
  }
}
/// C = A B, A n×m and B m×k.
inline void multiply(const double* A, const double* B, int n, int m, int k, double* C) {
  std::fill(C, C + n * k, 0.);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < m; ++j) addScaled(C + i * k, A[i * m + j], B + j * k, k);
  }
}

// ------------------------------------------------------------------------------------------------------ the channel

/// Measurements that the front linearises in one call.
inline constexpr std::size_t channel_batch = 32;
/// Step of the differences by which curvatures are found, for coordinates of size one.
inline constexpr double curvature_step = 6e-6;

/// The largest coordinate's size, or one where all are zero.
inline double differenceScale(const double* x, int n) {
  double size = 0;
  for (int k = 0; k < n; ++k) size = std::max(size, std::abs(x[k]));
  return size > 0 ? size : 1;
}

inline ConstrainedChannel::ConstrainedChannel(ChannelRecord record, int parameters)
    : record_(std::move(record)),
      N(parameters),
      P(record_.functions->equations),
      K(record_.functions->dimension),
      n_(record_.size) {
  const std::size_t p = number(P), k = number(K), n = number(N);
  at_ = record_.start;
  at_.resize(n_ * k);
  next_ = trial_ = at_;
  values_.resize(n_ * p), multipliers_.resize(n_ * p), r_.resize(n_ * p), value_.resize(n_ * p);
  C_.resize(n_ * p * n), D_.resize(n_ * p * k), G_.resize(n_ * p * k), root_.resize(n_ * p * p);
  ranks_.resize(n_), order_.resize(n_ * p);
  if (record_.noise.can_be_free) {
    selection_.resize(n_ * p * p), recovery_.resize(n_ * k * p);
    free_C_.resize(n_ * p * n), free_D_.resize(n_ * p * k), free_r_.resize(n_ * p);
  }
  raw_values_.resize(channel_batch * p), raw_C_.resize(channel_batch * p * n), raw_D_.resize(channel_batch * p * k);
  const std::size_t most = p + k + n + 1;
  scratch_.resize(8 * most * most);
  Numbers rounded(k, std::numeric_limits<double>::epsilon());
  for (std::size_t i = 0; i < n_; ++i) {
    for (std::size_t j = 0; j < k && record_.functions->is_vector; ++j) {
      rounded[j] = std::numeric_limits<double>::epsilon() * record_.coordinates[i * k + j];
    }
    rounding_ += record_.noise.squaredNorm(i, rounded.data());
  }
}

inline double* ConstrainedChannel::block(Numbers& list, std::size_t i, int size) const {
  return list.data() + i * number(size);
}
inline const double* ConstrainedChannel::block(const Numbers& list, std::size_t i, int size) const {
  return list.data() + i * number(size);
}
inline int ConstrainedChannel::freeOf(std::size_t i) const {
  return record_.noise.can_be_free ? record_.noise.null_dimension[record_.noise.index(i)] : 0;
}

/// L⁻¹ B of the rows that are kept, in the first of P rows; the others are zero.
inline void ConstrainedChannel::halfSolve(std::size_t i, const double* B, int cols, double* X) const {
  const double* root = block(root_, i, P * P);
  const int *order = order_.data() + i * number(P), rank = ranks_[i];
  for (int k = 0; k < rank; ++k, root += P) {
    const double *row = B + order[k] * cols, inverse = root[k];
    double* x = X + k * cols;
    if (k == 0) {
      for (int c = 0; c < cols; ++c) x[c] = row[c] * inverse;
      continue;
    }
    std::copy(row, row + cols, x);
    for (int l = 0; l < k; ++l) addScaled(x, -root[l], X + l * cols, cols);
    for (int c = 0; c < cols; ++c) x[c] *= inverse;
  }
  std::fill(X + rank * cols, X + P * cols, 0.);
}
/// Values of the equations in units of the noise.
inline void ConstrainedChannel::whitened(std::size_t i, const double* values, double* result) const {
  if (freeOf(i) == 0) return halfSolve(i, values, 1, result);
  double* selected = scratch_.data();
  multiply(block(selection_, i, P * P), values, P, P, 1, selected);
  halfSolve(i, selected, 1, result);
}
inline int ConstrainedChannel::selected(std::size_t i) const {
  const double* selection = block(selection_, i, P * P);
  int rows = 0;
  for (int k = 0; k < P; ++k) rows += dot(selection + k * P, selection + k * P, P) > 0;
  return rows;
}

inline void ConstrainedChannel::eliminateFree(std::size_t i) {
  const int free = freeOf(i), size = std::max(P, K);
  const double *D = block(free_D_, i, P * K),
               *basis = record_.noise.null_basis.data() + record_.noise.index(i) * number(K * K);
  // Singular vectors of the transpose of D N_i N_iᵀ's part N_i, filled up to a square; the zeros that fill it up are
  // never mixed with the rest.
  BasicSmallMatrix<Eigen::Dynamic> transposed(size, size);
  for (int f = 0; f < free; ++f) {
    for (int j = 0; j < P; ++j) {
      for (int k = 0; k < K; ++k) transposed(f, j) += D[j * K + k] * basis[k * K + f];
    }
  }
  const SmallSvd svd(transposed);
  double *selection = block(selection_, i, P * P), *recovery = block(recovery_, i, K * P);
  std::fill(selection, selection + P * P, 0.);
  std::fill(recovery, recovery + K * P, 0.);
  int row = 0;
  for (int k = 0; k < size; ++k) {
    const double* v = svd.v.row(k);
    if (svd.value(k) > 1e-12 * svd.value(0)) {
      for (int a = 0; a < K; ++a) {
        const double along = dot(basis + a * K, svd.u.row(k), free) / svd.value(k);
        addScaled(recovery + a * P, along, v, P);
      }
    } else if (dot(v, v, P) >= 0.5) {
      std::copy(v, v + P, selection + P * row++);
    }
  }
}

/// The block of a measurement from its derivatives. False if something is not finite.
inline bool ConstrainedChannel::build(std::size_t i, const double* values, const double* by_parameter,
                                      const double* by_measurement) {
  double *observed = scratch_.data(), *S = observed + P, *spread = S + P * P, *work = spread + P * K;
  const double* at = block(at_, i, K);
  for (int p = 0; p < P; ++p) observed[p] = dot(by_measurement + p * K, at, K) - values[p];
  const bool finite = allFinite(observed, number(P)) && allFinite(by_parameter, number(P * N));
  if (freeOf(i) > 0) {
    double *C = block(free_C_, i, P * N), *D = block(free_D_, i, P * K), *r = block(free_r_, i, P);
    std::copy(by_parameter, by_parameter + P * N, C);
    std::copy(by_measurement, by_measurement + P * K, D);
    std::copy(observed, observed + P, r);
    eliminateFree(i);
    const double* selection = block(selection_, i, P * P);
    double *selected_C = work + 2 * P * P, *selected_D = selected_C + P * N, *selected_values = selected_D + P * K;
    multiply(selection, C, P, P, N, selected_C);
    multiply(selection, D, P, P, K, selected_D);
    multiply(selection, values, P, P, 1, selected_values);
    multiply(selection, r, P, P, 1, observed);
    by_parameter = selected_C, by_measurement = selected_D, values = selected_values;
  }
  record_.noise.spread(i, by_measurement, P, spread);
  for (int p = 0; p < P; ++p) {
    for (int q = 0; q < P; ++q) S[p * P + q] = dot(by_measurement + p * K, spread + q * K, K);
  }
  ranks_[i] = reducedRoot(S, P, record_.functions->rank, block(root_, i, P * P), order_.data() + i * number(P), work);
  halfSolve(i, by_parameter, N, block(C_, i, P * N));
  halfSolve(i, by_measurement, K, block(D_, i, P * K));
  halfSolve(i, observed, 1, block(r_, i, P));
  halfSolve(i, values, 1, block(value_, i, P));
  halfSolve(i, spread, K, block(G_, i, P * K));
  return finite;
}

inline bool ConstrainedChannel::linearize(const void* q, Rows& A, Numbers& b) {
  bool finite = true;
  for (std::size_t first = 0; first < n_; first += channel_batch) {
    const std::size_t count = std::min(channel_batch, n_ - first);
    record_.functions->linearize(record_.channel, q, first, count, block(at_, first, K), raw_values_.data(),
                                 raw_C_.data(), raw_D_.data());
    for (std::size_t i = first; i < first + count; ++i) {
      finite = build(i, block(raw_values_, i - first, P), block(raw_C_, i - first, P * N),
                     block(raw_D_, i - first, P * K)) &&
               finite;
      const double *C = block(C_, i, P * N), *r = block(r_, i, P);
      for (int k = 0; k < ranks_[i]; ++k, C += N) {
        addScaled(b.data(), r[k], C, N);
        for (int j = 0; j < N; ++j) addScaled(A[j] + j, C[j], C + j, N - j);
      }
    }
  }
  return finite;
}

/// The multipliers of the equations as they were given; with the sign of ½ ‖ε‖² + λᵀ c.
inline void ConstrainedChannel::lagrange(std::size_t i, double* lambda) const {
  double *y = scratch_.data(), *x = y + P;
  const double *given = block(multipliers_, i, P), *root = block(root_, i, P * P);
  std::copy(given, given + P, y);
  std::fill(x, x + P, 0.);
  for (int k = ranks_[i] - 1; k >= 0; --k) {
    const double value = -y[k] * root[k * P + k];
    x[order_[i * number(P) + number(k)]] = value;
    for (int l = 0; l < k; ++l) y[l] += root[k * P + l] * value;
  }
  if (freeOf(i) == 0) {
    std::copy(x, x + P, lambda);
    return;
  }
  const double* selection = block(selection_, i, P * P);
  std::fill(lambda, lambda + P, 0.);
  for (int k = 0; k < P; ++k) addScaled(lambda, x[k], selection + k * P, P);
}

inline void ConstrainedChannel::linearizeCurved(const ParameterFunctions& parameter, void* problem,
                                                double parameter_step, Rows& A, Numbers& b) {
  const int size = N + K;
  base_.resize(n_ * number(K)), slope_.resize(n_ * number(K * N)), curved_.assign(n_, 0);
  // Second derivatives of λᵀ c with respect to parameter and measurement, by central differences of the first.
  Numbers H(channel_batch * number(size * size)), lambda(channel_batch * number(P)), shift(number(N)),
      at(channel_batch * number(K)), steps(channel_batch, curvature_step), gradient(number(N)), moved(number(N));
  Rows transport(N, N);
  for (std::size_t first = 0; first < n_; first += channel_batch) {
    const std::size_t count = std::min(channel_batch, n_ - first);
    for (std::size_t i = 0; i < count; ++i) {
      lagrange(first + i, block(lambda, i, P));
      if (!record_.functions->is_vector) continue;
      steps[i] = curvature_step * differenceScale(block(record_.coordinates, first + i, K), K);
    }
    std::fill(H.begin(), H.end(), 0.);
    for (int column = 0; column < size; ++column) {
      for (const double sign : {1., -1.}) {
        std::copy_n(block(at_, first, K), count * number(K), at.data());
        std::fill(shift.begin(), shift.end(), 0.);
        if (column < N) {
          shift[number(column)] = sign * parameter_step;
        } else {
          for (std::size_t i = 0; i < count; ++i) at[i * number(K) + number(column - N)] += sign * steps[i];
        }
        parameter.move(problem, ParameterPoint::current, ParameterPoint::shifted, shift.data());
        if (!parameter.is_vector) parameter.transport(problem, transport.data());
        record_.functions->linearize(record_.channel, parameter.point(problem, ParameterPoint::shifted), first, count,
                                     at.data(), raw_values_.data(), raw_C_.data(), raw_D_.data());
        for (std::size_t i = 0; i < count; ++i) {
          const double *l = block(lambda, i, P), *C = block(raw_C_, i, P * N), *D = block(raw_D_, i, P * K);
          double* h = block(H, i, size * size) + column * size;
          const double factor = sign / (2 * (column < N ? parameter_step : steps[i]));
          std::fill(gradient.begin(), gradient.end(), 0.);
          for (int p = 0; p < P; ++p) addScaled(gradient.data(), factor * l[p], C + p * N, N);
          if (!parameter.is_vector) {
            moved = gradient;
            std::fill(gradient.begin(), gradient.end(), 0.);
            for (int k = 0; k < N; ++k) addScaled(gradient.data(), moved[number(k)], transport[k], N);
          }
          addScaled(h, 1, gradient.data(), N);
          for (int p = 0; p < P; ++p) addScaled(h + N, factor * l[p], D + p * K, K);
        }
      }
    }
    for (std::size_t i = 0; i < count; ++i) addCurved(first + i, block(H, i, size * size), A, b);
  }
}

/// With W = Q + Σ λ_k ∂²c_k/∂m², H_qm = Σ λ_k ∂²c_k/∂q∂m, the criterion gains ½ δᵀ A δ − bᵀ δ. H is made symmetric.
inline void ConstrainedChannel::addCurved(std::size_t i, double* H, Rows& A, Numbers& b) {
  const int size = N + K, cols = N + 1;
  for (int k = 0; k < size; ++k) {
    for (int l = 0; l < k; ++l) H[k * size + l] = H[l * size + k] = 0.5 * (H[k * size + l] + H[l * size + k]);
  }
  const double *C = block(C_, i, P * N), *D = block(D_, i, P * K), *r = block(r_, i, P), *value = block(value_, i, P);
  const auto addPlain = [&] {
    for (int k = 0; k < ranks_[i]; ++k) {
      addScaled(b.data(), r[k], C + k * N, N);
      for (int j = 0; j < N; ++j) addScaled(A[j], C[k * N + j], C + k * N, N);
    }
  };
  if (freeOf(i) > 0) return addPlain();
  const double* at = block(at_, i, K);
  double *Q = scratch_.data(), *W = Q + K * K, *first = W + K * K, *response = first + K * cols, *S = response + K * P,
         *lambda = S + P * P;
  record_.noise.matrix(record_.noise.information, i, Q);
  for (int k = 0; k < K; ++k) {
    for (int l = 0; l < K; ++l) W[k * K + l] = Q[k * K + l] + H[(N + k) * size + N + l];
  }
  if (!choleskyFactor(W, K)) return addPlain();
  // Δε = W⁻¹ (first - D̂ᵀ λ), D̂ Δε = second; columns: δ, and 1.
  for (int k = 0; k < K; ++k) {
    for (int j = 0; j < N; ++j) first[k * cols + j] = -H[(N + k) * size + j];
    first[k * cols + N] = -dot(Q + k * K, at, K);
    for (int p = 0; p < P; ++p) response[k * P + p] = D[p * K + k];
  }
  choleskySolve(W, K, first, cols);
  choleskySolve(W, K, response, P);
  multiply(D, response, P, K, P, S);
  for (int k = ranks_[i]; k < P; ++k) S[k * P + k] = 1;  // equations that were left out
  if (!choleskyFactor(S, P)) return addPlain();
  multiply(D, first, P, K, cols, lambda);
  for (int p = 0; p < P; ++p) {
    addScaled(lambda + p * cols, 1, C + p * N, N);
    lambda[p * cols + N] += value[p];
  }
  choleskySolve(S, P, lambda, cols);
  for (int k = 0; k < K; ++k) {
    for (int p = 0; p < P; ++p) addScaled(first + k * cols, -response[k * P + p], lambda + p * cols, cols);
  }
  // H_qq δ + H_qm Δε + Ĉᵀ λ = A δ - b.
  for (int j = 0; j < N; ++j) {
    const auto add = [&](double factor, const double* row) {
      addScaled(A[j], factor, row, N);
      b[number(j)] -= factor * row[N];
    };
    addScaled(A[j], 1, H + j * size, N);
    for (int k = 0; k < K; ++k) add(H[j * size + N + k], first + k * cols);
    for (int p = 0; p < P; ++p) add(C[p * N + j], lambda + p * cols);
  }
  double *slope = block(slope_, i, K * N), *base = block(base_, i, K);
  for (int k = 0; k < K; ++k) {
    std::copy_n(first + k * cols, N, slope + k * N);
    base[k] = at[k] + first[k * cols + N];
  }
  curved_[i] = 1;
}

/// Corrections from the shortest one, in place: what the free directions add. `observed` counts times `sign`.
inline void ConstrainedChannel::recover(std::size_t i, double* correction, const double* observed, double sign,
                                        const Numbers& delta) const {
  if (freeOf(i) == 0) return;
  double* open = scratch_.data() + 2 * P;
  const double *C = block(free_C_, i, P * N), *D = block(free_D_, i, P * K), *recovery = block(recovery_, i, K * P);
  for (int p = 0; p < P; ++p) {
    open[p] = sign * observed[p] - dot(C + p * N, delta.data(), N) - dot(D + p * K, correction, K);
  }
  for (int k = 0; k < K; ++k) correction[k] += dot(recovery + k * P, open, P);
}

inline double ConstrainedChannel::step(const Numbers& delta, bool curved) {
  double largest = 0;
  for (std::size_t i = 0; i < n_; ++i) {
    const double *C = block(C_, i, P * N), *r = block(r_, i, P), *G = block(G_, i, P * K);
    double *lambda = block(multipliers_, i, P), *next = block(next_, i, K);
    for (int p = 0; p < P; ++p) lambda[p] = r[p] - dot(C + p * N, delta.data(), N);
    largest = std::max(largest, dot(lambda, lambda, P));
    if (curved && curved_[i]) {
      const double *base = block(base_, i, K), *slope = block(slope_, i, K * N);
      for (int k = 0; k < K; ++k) next[k] = base[k] + dot(slope + k * N, delta.data(), N);
      continue;
    }
    std::fill(next, next + K, 0.);
    for (int p = 0; p < ranks_[i]; ++p) addScaled(next, lambda[p], G + p * K, K);
    if (freeOf(i) > 0) recover(i, next, block(free_r_, i, P), 1, delta);
  }
  return std::sqrt(largest);
}

inline void ConstrainedChannel::stepLengths(double& squared, double& slope) const {
  double* change = scratch_.data();
  for (std::size_t i = 0; i < n_; ++i) {
    const double *next = block(next_, i, K), *at = block(at_, i, K);
    for (int k = 0; k < K; ++k) change[k] = next[k] - at[k];
    const double length = record_.noise.squaredNorm(i, change);
    squared += length;
    slope += 0.5 * (record_.noise.squaredNorm(i, next) - record_.noise.squaredNorm(i, at) - length);
  }
}

inline double ConstrainedChannel::freeStep() const {
  double largest = 0;
  for (std::size_t i = 0; i < n_ && record_.noise.can_be_free; ++i) {
    if (freeOf(i) == 0) continue;
    double squared = 0;
    for (int k = 0; k < K; ++k) squared += std::pow(block(next_, i, K)[k] - block(at_, i, K)[k], 2);
    const double size = record_.functions->is_vector ? norm(block(record_.coordinates, i, K), K) : 0;
    largest = std::max(largest, std::sqrt(squared) / (1 + size));
  }
  return largest;
}

inline void ConstrainedChannel::add(std::size_t i, const double* correction, const double* whitened,
                                    ChannelMerit& sum) const {
  const double squared = dot(whitened, whitened, P);
  sum.cost += record_.noise.squaredNorm(i, correction);
  sum.violation += std::sqrt(squared);
  sum.squared_violation += squared;
}
inline void ConstrainedChannel::addMerit(ChannelMerit& sum) const {
  for (std::size_t i = 0; i < n_; ++i) add(i, block(at_, i, K), block(value_, i, P), sum);
}
inline void ConstrainedChannel::evaluate(const void* q, ChannelMerit& sum) {
  if (n_ == 0) return;
  record_.functions->evaluate(record_.channel, q, 0, n_, trial_.data(), values_.data());
  double* in_noise = scratch_.data() + P;
  for (std::size_t i = 0; i < n_; ++i) {
    whitened(i, block(values_, i, P), in_noise);
    add(i, block(trial_, i, K), in_noise, sum);
  }
}
inline void ConstrainedChannel::tryStep(const void* q, double alpha, ChannelMerit& sum) {
  for (std::size_t k = 0; k < trial_.size(); ++k) trial_[k] = at_[k] + alpha * (next_[k] - at_[k]);
  evaluate(q, sum);
}
inline void ConstrainedChannel::addCorrectionSums(Numbers& b) const {
  double* in_noise = scratch_.data() + P;
  for (std::size_t i = 0; i < n_; ++i) {
    whitened(i, block(values_, i, P), in_noise);
    for (int k = 0; k < ranks_[i]; ++k) addScaled(b.data(), -in_noise[k], block(C_, i, P * N) + k * N, N);
  }
}
/// The change of ε that takes the equations at the trial point to zero to first order.
inline void ConstrainedChannel::correctionOf(std::size_t i, const Numbers& delta, double* correction) const {
  double* lambda = scratch_.data() + P;
  const double *C = block(C_, i, P * N), *G = block(G_, i, P * K);
  whitened(i, block(values_, i, P), lambda);
  std::fill(correction, correction + K, 0.);
  for (int k = 0; k < ranks_[i]; ++k) {
    addScaled(correction, -lambda[k] - dot(C + k * N, delta.data(), N), G + k * K, K);
  }
  if (freeOf(i) > 0) recover(i, correction, block(values_, i, P), -1, delta);
}
inline double ConstrainedChannel::correctionSquared(const Numbers& delta) const {
  double sum = 0, *correction = scratch_.data() + 3 * P;
  for (std::size_t i = 0; i < n_; ++i) {
    correctionOf(i, delta, correction);
    sum += record_.noise.squaredNorm(i, correction);
  }
  return sum;
}
inline void ConstrainedChannel::tryCorrected(const void* q, const Numbers& delta, ChannelMerit& sum) {
  double* correction = scratch_.data() + 3 * P;
  for (std::size_t i = 0; i < n_; ++i) {
    correctionOf(i, delta, correction);
    addScaled(block(trial_, i, K), 1, correction, K);
  }
  evaluate(q, sum);
}

inline int ConstrainedChannel::keptEquations() const {
  int sum = 0;
  for (const int rank : ranks_) sum += rank;
  return sum;
}
inline int ConstrainedChannel::droppedEquations() const {
  const int rank = record_.functions->rank;
  int sum = 0;
  for (std::size_t i = 0; i < n_; ++i) {
    sum += rank - ranks_[i];
    // Those that find the free directions are not lost.
    if (freeOf(i) > 0) sum -= rank - std::min(rank, selected(i));
  }
  return sum;
}
inline int ConstrainedChannel::unmetEquations(const void* q) {
  int sum = 0;
  for (std::size_t i = 0; i < n_; ++i) {
    if (freeOf(i) > 0 || ranks_[i] >= record_.functions->rank) continue;
    record_.functions->linearize(record_.channel, q, i, 1, block(at_, i, K), raw_values_.data(), raw_C_.data(),
                                 raw_D_.data());
    const int* order = order_.data() + i * number(P);
    for (int k = 0; k < P; ++k) {
      if (std::find(order, order + ranks_[i], k) != order + ranks_[i]) continue;
      const double spread = norm(raw_D_.data() + k * K, K) * record_.noise.typicalDeviation(i);
      sum += spread > 0 && std::abs(raw_values_[number(k)]) > 1e-3 * spread;
    }
  }
  return sum;
}
inline std::size_t ConstrainedChannel::uninformative() const {
  std::size_t sum = 0;
  for (std::size_t i = 0; i < n_; ++i) sum += freeOf(i) > 0 && selected(i) == 0;
  return sum;
}

LIESTAT_ESTIMATION_INLINE void ConstrainedChannel::covarianceOf(std::size_t i, const Rows& parameter,
                                                                double* result) const {
  const double *C = block(C_, i, P * N), *G = block(G_, i, P * K);
  double *slope = scratch_.data(), *half = slope + K * N;
  record_.noise.matrix(record_.noise.covariance, i, result);
  std::fill(slope, slope + K * N, 0.);
  for (int p = 0; p < P; ++p) {
    for (int k = 0; k < K; ++k) {
      addScaled(result + k * K, -G[p * K + k], G + p * K, K);
      addScaled(slope + k * N, G[p * K + k], C + p * N, N);
    }
  }
  multiply(slope, parameter.data(), K, N, N, half);
  for (int k = 0; k < K; ++k) {
    for (int l = 0; l < K; ++l) result[k * K + l] += dot(half + k * N, slope + l * N, N);
  }
}
LIESTAT_ESTIMATION_INLINE double ConstrainedChannel::expectedSquare(std::size_t i, const Rows& parameter) const {
  double expected = ranks_[i];
  const double* C = block(C_, i, P * N);
  for (int p = 0; p < ranks_[i]; ++p) {
    for (int j = 0; j < N; ++j) expected -= C[p * N + j] * dot(parameter[j], C + p * N, N);
  }
  return expected;
}

}  // namespace liestat::detail
