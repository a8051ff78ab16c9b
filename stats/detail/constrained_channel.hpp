// The measurements of one kind in a constrained estimate: each measurement's equations linearised, its own correction
// eliminated (Viéville, Lingrand and Gaspard 2000, appendix A, corrected). Definitions of
// stats/detail/constrained_core.hpp. What the front does not call is inline, so that position-independent code calls none of
// it through a table.
#pragma once

#include <stats/detail/measurement_rows.hpp>
#include <stats/detail/tangent_system.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace liestat::detail {

// ------------------------------------------------------------------------------------------------------------ noises

inline std::size_t NoiseTable::stride() const {
  return number(form == NoiseForm::isotropic ? 1 : form == NoiseForm::diagonal ? dimension : dimension * dimension);
}
inline double NoiseTable::squaredNorm(std::size_t i, const double* e) const {
  const double* Q = information.data() + index(i) * stride();
  double sum = 0;
  switch (form) {
    case NoiseForm::isotropic:
      return dot(e, e, dimension) * Q[0];
    case NoiseForm::diagonal:
      for (int k = 0; k < dimension; ++k) sum += e[k] * e[k] * Q[k];
      return sum;
    default:
      for (int k = 0; k < dimension; ++k) sum += e[k] * dot(Q + k * dimension, e, dimension);
      return sum;
  }
}
inline NoiseRows NoiseTable::rows(std::size_t i) const {
  NoiseRows noise{form, dimension, covariance.data() + index(i) * stride()};
  if (can_be_free) {
    noise.free = null_dimension[index(i)];
    noise.free_basis = null_basis.data() + index(i) * number(dimension * dimension);
  }
  return noise;
}
inline void NoiseTable::matrix(const Numbers& list, std::size_t i, double* result) const {
  const double* values = list.data() + index(i) * stride();
  for (int k = 0; k < dimension; ++k) {
    for (int l = 0; l < dimension; ++l, ++result) {
      *result = form == NoiseForm::full ? values[k * dimension + l]
                : k != l                ? 0
                                        : values[form == NoiseForm::isotropic ? 0 : k];
    }
  }
}
inline double NoiseTable::typicalDeviation(std::size_t i) const {
  const double* V = covariance.data() + index(i) * stride();
  double trace = 0;
  for (int k = 0; k < dimension; ++k) {
    trace += V[form == NoiseForm::full ? k * (dimension + 1) : form == NoiseForm::diagonal ? k : 0];
  }
  return std::sqrt(trace / dimension);
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

inline void ConstrainedChannel::halfSolve(std::size_t i, const double* B, int cols, double* X) const {
  detail::halfSolve(block(root_, i, P * P), order_.data() + i * number(P), ranks_[i], P, B, cols, X);
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

/// The block of a measurement from its derivatives. False if something is not finite.
inline bool ConstrainedChannel::build(std::size_t i, const double* values, const double* by_parameter,
                                      const double* by_measurement) {
  const bool free = record_.noise.can_be_free;
  const auto where = [&](Numbers& list, int size) { return free ? block(list, i, size) : nullptr; };
  MeasurementRows rows{N,
                       P,
                       K,
                       block(C_, i, P * N),
                       block(D_, i, P * K),
                       block(r_, i, P),
                       block(value_, i, P),
                       block(G_, i, P * K),
                       block(root_, i, P * P),
                       order_.data() + i * number(P),
                       where(selection_, P * P),
                       where(recovery_, K * P),
                       where(free_C_, P * N),
                       where(free_D_, P * K),
                       where(free_r_, P)};
  const bool finite = rows.whiten(record_.noise.rows(i), record_.functions->rank, block(at_, i, K), values,
                                  by_parameter, by_measurement, scratch_.data());
  ranks_[i] = rows.rank;
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
  const double* given = block(multipliers_, i, P);
  for (int k = 0; k < P; ++k) y[k] = -given[k];
  halfSolveTransposed(block(root_, i, P * P), order_.data() + i * number(P), ranks_[i], P, y, 1, x);
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
