// The updates of the implicit filter (docs/theory/motion.md, section 2). Definitions of stats/detail/filter_core.hpp.
#pragma once

#include <stats/detail/filter_core.hpp>
#include <stats/detail/measurement_rows.hpp>
#include <stats/detail/row_factors.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace liestat::detail {

/// Hands out parts of the front's memory.
struct FilterScratch {
  double* next;

  double* operator()(int n) {
    double* part = next;
    next += n;
    return part;
  }
};

/// The step unless it is zero: then nothing is moved, not even by rounding.
inline const double* unlessZero(const double* step, int n) {
  return std::all_of(step, step + n, [](double x) { return x == 0; }) ? nullptr : step;
}
/// Moves the state; true if it is elsewhere than before the update.
inline bool moveState(const FilterState& state, const double* step, double* by_step) {
  state.move(state.front, step, by_step);
  return unlessZero(step, state.dimension) != nullptr;
}
/// The derivative of exp at the step; the identity of vectors, and where nothing was moved.
inline void setDerivative(const FilterState& state, const double* by_step, bool moved, double* J) {
  const int N = state.dimension;
  if (moved && !state.is_vector) {
    copyRow(by_step, N * N, J);
    return;
  }
  std::fill(J, J + N * N, 0.);
  for (int i = 0; i < N; ++i) J[i * (N + 1)] = 1;
}
/// M × J in the place of M, n×m.
inline void multiplyInPlace(double* M, const double* J, int n, int m, double* scratch) {
  multiply(M, J, n, m, m, scratch);
  copyRow(scratch, n * m, M);
}

/// Equations at exp(x, v) and exp(y, w), with derivatives by v and w: values, P×N and P×K.
struct FilterEquations {
  double *h, *C, *D, *by_w, *product;

  FilterEquations(FilterScratch& scratch, int N, int P, int K)
      : h(scratch(P)),
        C(scratch(P * N)),
        D(scratch(P * K)),
        by_w(scratch(K * K)),
        product(scratch(P * std::max(N, K))) {}
  /// `by_v` is the derivative of exp(x, v), null where the state was not moved.
  void linearize(const FilterState& state, const FilterMeasurement& y, const double* by_v, const double* w) {
    const double* step = unlessZero(w, y.dimension);
    y.linearize(y.front, by_v != nullptr, step, h, C, D, by_w);
    if (by_v && !state.is_vector) multiplyInPlace(C, by_v, y.equations, state.dimension, product);
    if (step && !y.is_vector) multiplyInPlace(D, by_w, y.equations, y.dimension, product);
  }
};
inline NoiseRows noiseOf(const FilterMeasurement& y) {
  return {y.form, y.dimension, y.covariance, y.free, y.free_basis};
}

/// The largest change of a coordinate in standard deviations of P, N×N; along exact directions there is none.
inline double changeInDeviations(const double* next, const double* v, const double* P, int N) {
  double largest = 0;
  for (int i = 0; i < N; ++i) {
    const double variance = P[i * (N + 1)];
    if (variance > 0) largest = std::max(largest, std::abs(next[i] - v[i]) / std::sqrt(variance));
  }
  return largest;
}
/// Copies the lower triangle to the upper one.
inline void mirror(double* A, int n) {
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < i; ++j) A[j * n + i] = A[i * n + j];
  }
}

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
