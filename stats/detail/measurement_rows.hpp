// One measurement with P equations, N parameters, K coordinates: its equations linearised, its own correction eliminated
// (Viéville, Lingrand and Gaspard 2000, appendix A, corrected). Sizes are run-time numbers, matrices row-major, the memory
// is the caller's. Constrained estimates and the implicit filter use it.
#pragma once

#include <lie/detail/small_orthogonal.hpp>
#include <stats/detail/row_factors.hpp>
#include <stats/measurement_noise.hpp>

#include <algorithm>

namespace liestat::detail {

/// A noise as numbers: its covariance in its form; where its information is singular, a basis of the directions that are
/// free in the first columns of K×K.
struct NoiseRows {
  NoiseForm form = NoiseForm::isotropic;
  int dimension = 0;
  const double* covariance = nullptr;
  int free = 0;
  const double* free_basis = nullptr;

  /// D V, D of `rows` rows.
  void spread(const double* __restrict D, int rows, double* __restrict result) const {
    const double* V = covariance;
    switch (form) {
      case NoiseForm::isotropic:
        for (int i = 0; i < rows * dimension; ++i) result[i] = V[0] * D[i];
        return;
      case NoiseForm::diagonal:
        for (int p = 0; p < rows; ++p, D += dimension, result += dimension) {
          for (int k = 0; k < dimension; ++k) result[k] = V[k] * D[k];
        }
        return;
      default:
        return multiply(D, V, rows, dimension, dimension, result);
    }
  }
};

/// With ε the correction of the measurement in the tangent space at what was observed and δ the step of the parameter,
/// the equations are value + C δ + D (ε − ε₀) = 0. Whitened by the root L of S = D V Dᵀ they become Ĉ δ + λ̂ = r̂, where
/// ε = G λ̂ is the shortest correction and ‖λ̂‖² its squared length. Null is what is not wanted of D, value and G.
struct MeasurementRows {
  int N, P, K;
  double *C, *D, *r, *value, *G;  ///< Ĉ, L⁻¹ D, r̂, L⁻¹ value, Gᵀ
  double* root;                   ///< rows of L that were kept, inverse pivots (reducedRoot)
  int* order;                     ///< which these are
  /// Where directions N_i of the measurement are free: Zᵀ D N_i = 0 selects the equations that do not depend on them,
  /// `recovery` is N_i (D N_i)⁺. C, D and r as they were before.
  double *selection, *recovery, *free_C, *free_D, *free_r;
  int rank = 0;

  /// From values and derivatives where the correction is `at`. False if something is not finite. `scratch` holds
  /// scratchSize() numbers.
  bool whiten(const NoiseRows& noise, int max_rank, const double* at, const double* values, const double* by_parameter,
              const double* by_measurement, double* scratch) {
    double *observed = scratch, *S = observed + P, *spread = S + P * P, *work = spread + P * K;
    for (int p = 0; p < P; ++p) observed[p] = dot(by_measurement + p * K, at, K) - values[p];
    const bool finite = allFinite(observed, number(P)) && allFinite(by_parameter, number(P * N));
    if (noise.free > 0) {
      copyRow(by_parameter, P * N, free_C);
      copyRow(by_measurement, P * K, free_D);
      copyRow(observed, P, free_r);
      eliminateFree(noise);
      double *selected_C = work + 2 * P * P, *selected_D = selected_C + P * N, *selected_values = selected_D + P * K;
      multiply(selection, free_C, P, P, N, selected_C);
      multiply(selection, free_D, P, P, K, selected_D);
      multiply(selection, values, P, P, 1, selected_values);
      multiply(selection, free_r, P, P, 1, observed);
      by_parameter = selected_C, by_measurement = selected_D, values = selected_values;
    }
    noise.spread(by_measurement, P, spread);
    for (int p = 0; p < P; ++p) {
      for (int q = 0; q < P; ++q) S[p * P + q] = dot(by_measurement + p * K, spread + q * K, K);
    }
    rank = reducedRoot(S, P, max_rank, root, order, work);
    solve(by_parameter, N, C);
    solve(observed, 1, r);
    if (D) solve(by_measurement, K, D);
    if (value) solve(values, 1, value);
    if (G) solve(spread, K, G);
    return finite;
  }
  static constexpr int scratchSize(int N, int P, int K) { return P * (3 * P + 2 * K + N + 2); }
  /// L⁻¹ B.
  void solve(const double* B, int cols, double* X) const { halfSolve(root, order, rank, P, B, cols, X); }

 private:
  void eliminateFree(const NoiseRows& noise) {
    const int free = noise.free, size = std::max(P, K);
    const double *by_measurement = free_D, *basis = noise.free_basis;
    // Singular vectors of the transpose of D N_i N_iᵀ's part N_i, filled up to a square; the zeros that fill it up are
    // never mixed with the rest.
    BasicSmallMatrix<Eigen::Dynamic> transposed(size, size);
    for (int f = 0; f < free; ++f) {
      for (int j = 0; j < P; ++j) {
        for (int k = 0; k < K; ++k) transposed(f, j) += by_measurement[j * K + k] * basis[k * K + f];
      }
    }
    const SmallSvd svd(transposed);
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
        copyRow(v, P, selection + P * row++);
      }
    }
  }
};

}  // namespace liestat::detail
