// Steps of a channel's corrections in a constrained estimate, their criterion, and what is left at the end. Definitions of
// stats/detail/constrained_core.hpp.
#pragma once

#include <stats/detail/constrained_channel.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace liestat::detail {

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
