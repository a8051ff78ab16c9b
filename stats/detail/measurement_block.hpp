// One measurement of fixed size, P equations, N parameters, K coordinates: its equations linearised, its own correction
// eliminated (Viéville, Lingrand and Gaspard 2000, appendix A, corrected). The errors of single measurements use it;
// constrained estimates and the implicit filter do the same with sizes at run time (stats/detail/measurement_rows.hpp).
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_orthogonal.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/detail/small_reduced.hpp>
#include <stats/measurement_noise.hpp>

#include <Eigen/Core>

#include <cmath>

namespace liestat::detail {

/// With ε the correction of the measurement in the tangent space at what was observed and δ the step of the parameter,
/// the equations are value + C δ + D (ε − ε₀) = 0. Whitened by the root L of S = D V Dᵀ they become Ĉ δ + λ̂ = r̂, where
/// ε = G λ̂ is the shortest correction and ‖λ̂‖² its squared length.
template <int P, int N, int K>
struct MeasurementBlock {
  using Values = Eigen::Matrix<double, P, 1>;
  using Correction = Eigen::Matrix<double, K, 1>;
  using Step = Eigen::Matrix<double, N, 1>;
  using ByParameter = Eigen::Matrix<double, P, N>;
  using ByMeasurement = Eigen::Matrix<double, P, K>;

  ByParameter C;    ///< Ĉ
  ByMeasurement D;  ///< L⁻¹ D
  Values r, value;  ///< r̂; L⁻¹ value
  Eigen::Matrix<double, K, P> G;
  ReducedRoot<double, P> root;
  bool finite = true;  ///< true if the input was finite

  /// Where the information is singular: directions N_i of the measurement are free. Zᵀ D N_i = 0 selects the equations
  /// that do not depend on them; `recovery` is N_i (D N_i)⁺.
  struct Free {
    int dimension = 0;
    Eigen::Matrix<double, P, P> selection;
    Eigen::Matrix<double, K, P> recovery;
    ByParameter C;
    ByMeasurement D;
    Values r;
  } free;

  template <NoiseModel Noise>
  void build(const Noise& noise, Values values, ByParameter by_parameter, ByMeasurement by_measurement,
             const Correction& at, int max_rank) {
    Values observed = product(by_measurement, at) - values;
    finite = observed.allFinite() && by_parameter.allFinite();
    free.dimension = 0;
    if constexpr (HasFreeDirections<Noise>) {
      if (noise.freeDimension() > 0) {
        free.dimension = noise.freeDimension();
        free.C = by_parameter, free.D = by_measurement, free.r = observed;
        eliminateFree(noise.freeBasis());
        by_parameter = product(free.selection, by_parameter);
        by_measurement = product(free.selection, by_measurement);
        observed = product(free.selection, observed);
        values = product(free.selection, values);
      }
    }
    const Eigen::Matrix<double, K, P> spread = noise.template spread<P>(by_measurement);
    root = ReducedRoot<double, P>(product(by_measurement, spread), Pivoting::largest, max_rank);
    C = root.template halfSolve<N>(by_parameter);
    D = root.template halfSolve<K>(by_measurement);
    r = root.template halfSolve<1>(observed);
    value = root.template halfSolve<1>(values);
    G = root.template halfSolve<K>(spread.transpose()).transpose();
  }

  /// λ̂ for a step of the parameter.
  Values multipliers(const Step& step) const { return r - product(C, step); }
  /// ε for a step of the parameter.
  Correction correction(const Step& step) const { return recovered(product(G, multipliers(step)), free.r, step); }
  /// Values of the equations in units of the noise.
  Values whitened(const Values& values) const {
    return root.template halfSolve<1>(free.dimension > 0 ? Values(product(free.selection, values)) : values);
  }

 private:
  void eliminateFree(const Eigen::Matrix<double, K, K>& basis) {
    Eigen::Matrix<double, K, K> used = Eigen::Matrix<double, K, K>::Zero();
    used.leftCols(free.dimension) = basis.leftCols(free.dimension);
    const Eigen::Matrix<double, P, K> moved = product(free.D, used);
    // Singular vectors of the transpose, filled up to a square; the zeros that fill it up are never mixed with the rest.
    constexpr int size = P > K ? P : K;
    BasicSmallMatrix<size> transposed(size, size);
    for (int i = 0; i < K; ++i) {
      for (int j = 0; j < P; ++j) transposed(i, j) = moved(j, i);
    }
    const SmallSvd svd(transposed);
    Eigen::Matrix<double, K, P> inverse = Eigen::Matrix<double, K, P>::Zero();
    free.selection.setZero();
    int row = 0;
    for (int k = 0; k < size; ++k) {
      if (svd.value(k) > 1e-12 * svd.value(0)) {
        for (int i = 0; i < K; ++i) {
          for (int j = 0; j < P; ++j) inverse(i, j) += svd.u(k, i) * svd.v(k, j) / svd.value(k);
        }
        continue;
      }
      double inside = 0;
      for (int j = 0; j < P; ++j) inside += svd.v(k, j) * svd.v(k, j);
      if (inside < 0.5) continue;
      for (int j = 0; j < P; ++j) free.selection(row, j) = svd.v(k, j);
      ++row;
    }
    free.recovery = product(used, inverse);
  }
  Correction recovered(const Correction& weighed, const Values& observed, const Step& step) const {
    if (free.dimension == 0) return weighed;
    const Values open = observed - product(free.C, step) - product(free.D, weighed);
    return weighed + product(free.recovery, open);
  }
};

/// How many of the equations that the root left out do not hold, although they depend on the measurement: the coordinates
/// that they depend on are exact, so that no correction takes them to zero. Redundant ones hold with the others.
/// `deviation` is a standard deviation of the measurement's coordinates.
template <int P, int K>
int unmetEquations(const ReducedRoot<double, P>& root, const Eigen::Matrix<double, P, 1>& values,
                   const Eigen::Matrix<double, P, K>& by_measurement, double deviation) {
  int sum = 0;
  for (int k = 0; k < P; ++k) {
    bool kept = false;
    for (int j = 0; j < root.rank(); ++j) kept = kept || root.row(j) == k;
    if (kept) continue;
    const double spread = by_measurement.row(k).norm() * deviation;
    sum += spread > 0 && std::abs(values[k]) > 1e-3 * spread ? 1 : 0;
  }
  return sum;
}
/// A standard deviation of the coordinates.
template <class Noise>
double typicalDeviation(const Noise& noise) {
  return std::sqrt(noise.covariance().trace() / Noise::dimension);
}

}  // namespace liestat::detail
