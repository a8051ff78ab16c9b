// The implicit filter's update in dense form (docs/theory/motion.md, 2.1 and 2.2). Definitions of
// stats/detail/filter_core.hpp.
#pragma once

#include <stats/detail/filter_equations.hpp>

#include <algorithm>
#include <cmath>

namespace liestat::detail {

/// How far the rows that were left out are from what those that were kept say of them, in standard deviations.
inline double inconsistency(const double* root, const int* order, int rank, const double* S, const double* r,
                            const double* whitened, int P, double* scratch) {
  halfSolve(root, order, rank, P, S, P, scratch);
  double largest = 0;
  for (int i = 0; i < P; ++i) {
    if (std::find(order, order + rank, i) != order + rank) continue;
    double left = r[i], scale = 0;
    for (int k = 0; k < rank; ++k) {
      left -= scratch[k * P + i] * whitened[k];
      scale += std::abs(scratch[k * P + i] * whitened[k]);
    }
    // Rounding alone is no contradiction, however small the deviation.
    if (!(std::abs(left) > 1e-10 * (std::abs(r[i]) + scale))) continue;
    largest = std::max(largest, std::abs(left) / std::sqrt(S[i * (P + 1)]));
  }
  return largest;
}

LIESTAT_ESTIMATION_INLINE FilterOutcome updateDense(const FilterState& state, const FilterMeasurement& y,
                                                    const ImplicitEkfOptions& options, double gate,
                                                    const FilterRows& rows, const FilterMemory& memory) {
  const int N = state.dimension, P = y.equations, K = y.dimension;
  const double* prior = state.covariance;
  const NoiseRows noise = noiseOf(y);
  FilterOutcome outcome;
  const auto ended = [&](FilterStatus status) {
    outcome.status = status, outcome.moved = false;
    return outcome;
  };
  if (!y.valid_noise) return ended(FilterStatus::singular);

  FilterScratch scratch{memory.numbers};
  FilterEquations at(scratch, N, P, K);
  int* order = memory.rows;
  double *v = scratch(N), *next = scratch(N), *w = scratch(K), *by_v = scratch(N * N), *r = scratch(P),
         *CP = scratch(P * N), *RD = scratch(P * K), *S = scratch(P * P), *root = scratch(P * P),
         *whitened = scratch(P), *multipliers = scratch(P), *left = scratch(N * N), *gain = scratch(P * N),
         *minus_gain = scratch(P * N), *by_noise = scratch(N * K),
         *work = scratch(std::max({2 * P * P + P, 3 * N * N, P * N, N * (N + K)}));
  std::fill(v, v + N, 0.), std::fill(w, w + K, 0.);
  bool moved = false;
  const int passes = std::max(1, options.max_iterations);
  outcome.status = passes > 1 ? FilterStatus::not_converged : FilterStatus::ok;
  while (outcome.iterations < passes) {
    const bool first = outcome.iterations == 0;
    if (outcome.iterations > 1) moved = moveState(state, v, by_v);
    at.linearize(state, y, moved ? by_v : nullptr, w);
    for (int p = 0; p < P; ++p) r[p] = at.h[p] - dot(at.C + p * N, v, N) - dot(at.D + p * K, w, K);
    multiply(at.C, prior, P, N, N, CP);
    noise.spread(at.D, P, RD);
    for (int p = 0; p < P; ++p) {
      for (int q = 0; q < P; ++q) S[p * P + q] = dot(at.C + p * N, CP + q * N, N) + dot(at.D + p * K, RD + q * K, K);
    }
    if (!allFinite(r, number(P)) || !allFinite(S, number(P * P))) {
      if (first) return ended(FilterStatus::not_finite);
      break;
    }
    copyRow(S, P * P, work);
    const int rank = reducedRoot(work, P, y.rank, root, order, work + P * P);
    halfSolve(root, order, rank, P, r, 1, whitened);
    if (first) {
      copyRow(r, P, rows.innovation);
      copyRow(S, P * P, rows.innovation_covariance);
      outcome.nis = dot(whitened, whitened, P);
      outcome.degrees_of_freedom = rank;
      if (rank < y.rank) outcome.inconsistency = inconsistency(root, order, rank, S, r, whitened, P, work);
      if (rank == 0 || !(outcome.inconsistency <= options.max_inconsistency)) return ended(FilterStatus::singular);
    } else if (rank == 0) {
      break;
    }
    halfSolveTransposed(root, order, rank, P, whitened, 1, multipliers);
    std::fill(next, next + N, 0.);
    for (int p = 0; p < P; ++p) addScaled(next, -multipliers[p], CP + p * N, N);
    if (passes > 1) {
      std::fill(w, w + K, 0.);
      for (int p = 0; p < P; ++p) addScaled(w, -multipliers[p], RD + p * K, K);
    }
    const double change = first ? 0 : changeInDeviations(next, v, prior, N);
    copyRow(next, N, v);
    ++outcome.iterations;
    if (first) {
      copyRow(v, N, rows.step);
      if (!(outcome.nis <= gate)) {
        outcome.gated = 1;
        return ended(FilterStatus::gated);
      }
    }
    const bool settled = !first && change <= options.tolerance;
    if (first || settled) {
      // Joseph's form in the frame at the new state, to which J leads: (J - J L C) P (J - J L C)ᵀ + (J L D) R (J L D)ᵀ. Of
      // the gain J L the sign does not matter in the second term.
      moved = moveState(state, v, by_v);
      setDerivative(state, by_v, moved, left);
      halfSolve(root, order, rank, P, CP, N, work);
      halfSolveTransposed(root, order, rank, P, work, N, gain);
      for (int p = 0; p < P; ++p) {
        for (int i = 0; i < N; ++i) minus_gain[i * P + p] = -gain[p * N + i];
      }
      if (moved && !state.is_vector) {
        multiply(left, minus_gain, N, N, P, work);
        copyRow(work, N * P, minus_gain);
      }
      multiplyBy<true>(minus_gain, at.C, N, P, N, left);
      multiply(minus_gain, at.D, N, P, K, by_noise);
      multiply(left, prior, N, N, N, work);
      multiplyTransposed(work, left, N, N, N, rows.covariance, work + N * N);
      noise.spread(by_noise, N, work);
      multiplyTransposed<true>(work, by_noise, N, K, N, rows.covariance, work + N * K);
      mirror(rows.covariance, N);
      copyRow(v, N, rows.step);
      outcome.moved = true;
    }
    if (settled) {
      outcome.status = FilterStatus::ok;
      break;
    }
  }
  outcome.measurements = 1;
  if (outcome.iterations > 1 && outcome.status != FilterStatus::ok) moveState(state, rows.step, by_v);
  return outcome;
}

}  // namespace liestat::detail
