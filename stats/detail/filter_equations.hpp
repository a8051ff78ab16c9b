// The parts that both forms of the implicit filter's update share: memory, the state that is moved, the equations linearised.
#pragma once

#include <stats/detail/filter_core.hpp>
#include <stats/detail/measurement_rows.hpp>
#include <stats/detail/row_factors.hpp>

#include <algorithm>
#include <cmath>

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

}  // namespace liestat::detail
