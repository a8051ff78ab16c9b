// The implicit filter's update in information form (docs/theory/motion.md, 2.3). Definitions of
// stats/detail/filter_core.hpp.
#pragma once

#include <stats/detail/filter_equations.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace liestat::detail {

/// A measurement's equations linearised and whitened.
struct FilterBlock {
  const FilterMeasurement& y;
  FilterSums& sums;
  FilterEquations at;
  MeasurementRows rows;
  double* work;

  FilterBlock(FilterSums& all, const FilterMeasurement& measurement, FilterScratch scratch, int* order, int N, int P,
              int K)
      : y(measurement),
        sums(all),
        at(scratch, N, P, K),
        rows{N,
             P,
             K,
             scratch(P * N),
             nullptr,
             scratch(P),
             nullptr,
             sums.pass > 0 ? scratch(P * K) : nullptr,
             scratch(P * P),
             order,
             scratch(P * P),
             scratch(K * P),
             scratch(P * N),
             scratch(P * K),
             scratch(P)},
        work(scratch(MeasurementRows::scratchSize(N, P, K))) {}

  void fail(FilterStatus status) {
    if (sums.status == FilterStatus::ok) sums.status = status;
  }
  /// At the state, where `by_v` is not null the one that was moved, and at the correction w.
  bool build(const double* by_v, const double* w) {
    const int N = rows.N, P = rows.P, K = rows.K;
    at.linearize(sums.state, y, by_v, w);
    const NoiseRows noise = noiseOf(y);
    if (!rows.whiten(noise, y.rank, w, at.h, at.C, at.D, work) || !allFinite(rows.C, number(P * N)) ||
        !allFinite(at.D, number(P * K))) {
      fail(FilterStatus::not_finite);
      return false;
    }
    if (y.free > 0 || rows.rank >= y.rank) return true;
    // An exact constraint of the state has no finite information: a row without noise that is not made of others.
    double *spread = work, *S = spread + P * K, *half = S + P * P;
    noise.spread(at.D, P, spread);
    for (int p = 0; p < P; ++p) {
      for (int q = 0; q < P; ++q) S[p * P + q] = dot(at.D + p * K, spread + q * K, K);
    }
    rows.solve(S, P, half);
    for (int i = 0; i < P; ++i) {
      if (std::find(rows.order, rows.order + rows.rank, i) != rows.order + rows.rank) continue;
      double* rest = half + P * P;
      std::copy(at.C + i * N, at.C + (i + 1) * N, rest);
      for (int k = 0; k < rows.rank; ++k) addScaled(rest, -half[k * P + i], rows.C + k * N, N);
      if (!(norm(rest, N) > 1e-6 * norm(at.C + i * N, N))) continue;
      fail(FilterStatus::singular);
      return false;
    }
    return true;
  }
  /// r̂ᵀ (I + Ĉ P Ĉᵀ)⁻¹ r̂ of the equations that are kept.
  double distance() const {
    const int N = rows.N, n = rows.rank;
    double *CP = work, *S = CP + n * N, *e = S + n * n;
    multiply(rows.C, sums.state.covariance, n, N, N, CP);
    for (int p = 0; p < n; ++p) {
      for (int q = 0; q <= p; ++q) S[p * n + q] = (p == q) + dot(rows.C + p * N, CP + q * N, N);
    }
    if (!choleskyFactor(S, n)) return std::numeric_limits<double>::quiet_NaN();
    for (int p = 0; p < n; ++p) e[p] = (rows.r[p] - dot(S + p * n, e, p)) / S[p * (n + 1)];
    return dot(e, e, n);
  }
  /// The correction with which the equations hold at the state at hand; its change, and its size.
  void correct(double* w, double& change, double& size) const {
    const int P = rows.P, K = rows.K;
    double *next = work, *open = next + K;
    std::fill(next, next + K, 0.);
    for (int p = 0; p < rows.rank; ++p) addScaled(next, rows.r[p], rows.G + p * K, K);
    if (y.free > 0) {
      for (int p = 0; p < P; ++p) open[p] = rows.free_r[p] - dot(rows.free_D + p * K, next, K);
      for (int k = 0; k < K; ++k) next[k] += dot(rows.recovery + k * P, open, P);
    }
    size = norm(next, K);
    for (int k = 0; k < K; ++k) open[k] = next[k] - w[k];
    change = norm(open, K);
    copyRow(next, K, w);
  }
};

LIESTAT_ESTIMATION_INLINE void addToSums(FilterSums& sums, const FilterMeasurement& y, double gate,
                                         const FilterMemory& memory) {
  const int N = sums.state.dimension, P = y.equations, K = y.dimension;
  FilterScratch scratch{memory.numbers};
  double* w = scratch(K);
  FilterBlock block(sums, y, scratch, memory.rows, N, P, K);
  if (!y.valid_noise) return block.fail(FilterStatus::singular);
  std::fill(w, w + K, 0.);
  const bool first = sums.pass == 0;
  if (first || std::isfinite(gate)) {
    if (!block.build(nullptr, w)) return;
    if (std::isfinite(gate) && !(block.distance() <= gate)) {
      sums.gated += first;
      return;
    }
  }
  if (!first) {
    // The correction that the state at hand asks for: the equations hold at (state, exp(y, w)).
    const double* by_v = sums.moved ? sums.by_step : nullptr;
    for (int i = 0; i < 10; ++i) {
      double change = 0, size = 0;
      if (!block.build(by_v, w)) return;
      block.correct(w, change, size);
      if (!(change > 1e-10 * size)) break;
    }
    if (!block.build(by_v, w)) return;
  }
  for (int p = 0; p < block.rows.rank; ++p) {
    const double *C = block.rows.C + p * N, r = block.rows.r[p];
    addScaled(sums.b, r + dot(C, sums.step, N), C, N);
    for (int i = 0; i < N; ++i) addScaled(sums.A + i * N, C[i], C, N);
    sums.squared += r * r;
  }
  sums.equations += block.rows.rank;
  ++sums.measurements;
}

/// A⁻¹ of a positive definite matrix, N×N; false where it is none. The factor takes the place of A.
inline bool invert(double* A, int N, double* inverse) {
  if (!choleskyFactor(A, N)) return false;
  std::fill(inverse, inverse + N * N, 0.);
  for (int i = 0; i < N; ++i) inverse[i * (N + 1)] = 1;
  choleskySolve(A, N, inverse, N);
  return true;
}

LIESTAT_ESTIMATION_INLINE FilterOutcome updateSums(FilterSums& sums, const ImplicitEkfOptions& options,
                                                   const FilterRows& rows, const FilterMemory& memory,
                                                   void (*visit)(void* front), void* front) {
  const int N = sums.state.dimension;
  FilterScratch scratch{memory.numbers};
  double *prior_information = scratch(N * N), *information = scratch(N * N), *half = scratch(N * N), *next = scratch(N);
  const double* prior = sums.state.covariance;
  FilterOutcome outcome;
  const auto ended = [&](FilterStatus status) {
    outcome.status = status, outcome.moved = false;
    return outcome;
  };
  copyRow(prior, N * N, information);
  if (!allFinite(prior, number(N * N))) return ended(FilterStatus::not_finite);
  if (!invert(information, N, prior_information)) return ended(FilterStatus::singular);

  std::fill(sums.step, sums.step + N, 0.);
  const int passes = std::max(1, options.max_iterations);
  outcome.status = passes > 1 ? FilterStatus::not_converged : FilterStatus::ok;
  while (outcome.iterations < passes) {
    const bool first = outcome.iterations == 0;
    sums.pass = outcome.iterations;
    if (sums.pass > 1) sums.moved = moveState(sums.state, sums.step, sums.by_step);
    std::fill(sums.A, sums.A + N * N, 0.), std::fill(sums.b, sums.b + N, 0.);
    sums.squared = 0, sums.equations = 0, sums.measurements = 0;
    visit(front);
    if (first) {
      if (sums.status != FilterStatus::ok) return ended(sums.status);
      outcome.measurements = sums.measurements, outcome.gated = sums.gated;
      outcome.degrees_of_freedom = sums.equations;
      if (sums.measurements == 0) return ended(sums.gated > 0 ? FilterStatus::gated : FilterStatus::ok);
    }
    for (int i = 0; i < N * N; ++i) information[i] = prior_information[i] + sums.A[i];
    if (sums.status != FilterStatus::ok || !choleskyFactor(information, N)) {
      if (first) return ended(allFinite(sums.A, number(N * N)) ? FilterStatus::singular : FilterStatus::not_finite);
      break;
    }
    copyRow(sums.b, N, next);
    choleskySolve(information, N, next, 1);
    const double change = first ? 0 : changeInDeviations(next, sums.step, prior, N);
    copyRow(next, N, sums.step);
    ++outcome.iterations;
    const bool settled = !first && change <= options.tolerance;
    if (first || settled) {
      // J Λ⁻¹ Jᵀ in the frame at the new state, by the factor of Λ.
      sums.moved = moveState(sums.state, next, sums.by_step);
      setDerivative(sums.state, sums.by_step, sums.moved, half);
      transpose(half, N, N, rows.covariance);
      choleskyHalfSolve(information, N, rows.covariance, N);
      transpose(rows.covariance, N, N, half);
      multiply(half, rows.covariance, N, N, N, information);
      copyRow(information, N * N, rows.covariance);
      mirror(rows.covariance, N);
      copyRow(next, N, rows.step);
      outcome.moved = true;
    }
    // Woodbury's identity: hᵀ (C P Cᵀ + R)⁻¹ h = hᵀ R⁻¹ h - bᵀ (P⁻¹ + A)⁻¹ b.
    if (first) outcome.nis = std::max(0.0, sums.squared - dot(sums.b, next, N));
    if (settled) {
      outcome.status = FilterStatus::ok;
      break;
    }
  }
  if (outcome.iterations > 1 && outcome.status != FilterStatus::ok) moveState(sums.state, rows.step, sums.by_step);
  return outcome;
}

}  // namespace liestat::detail
