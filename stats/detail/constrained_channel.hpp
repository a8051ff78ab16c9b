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
inline bool NoiseTable::movingDirections(std::size_t i, const double* Q, double* projection, double* work) const {
  if (form != NoiseForm::full || can_be_free) return false;
  matrix(covariance, i, work);
  multiply(work, Q, dimension, dimension, dimension, projection);
  double trace = 0;
  for (int k = 0; k < dimension; ++k) trace += projection[k * (dimension + 1)];
  return trace < dimension - 0.5;
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

}  // namespace liestat::detail
