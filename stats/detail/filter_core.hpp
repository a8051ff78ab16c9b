// The core of the implicit filter, which is no template: sizes are run-time numbers, matrices row-major rows of numbers, and
// the memory is the front's (stats/implicit_ekf.hpp), which knows how much is needed, so that nothing is allocated.
#pragma once

#include <stats/detail/compiled.hpp>
#include <stats/implicit_ekf_types.hpp>
#include <stats/measurement_noise.hpp>

#include <cstddef>

namespace liestat::detail {

/// The state before the update. `move` keeps exp(x, step) in the front and writes the derivative of exp by the step.
struct FilterState {
  int dimension;
  bool is_vector;            ///< that derivative is the identity, and is not written
  const double* covariance;  ///< symmetric
  void* front;
  void (*move)(void* front, const double* step, double* by_step);
};

/// A measurement y with its noise and equations. `linearize` writes values of the equations at exp(y, step), or at y where
/// `step` is null, and their derivatives by local steps there; and, unless y is a vector, the derivative of exp(y, step) by
/// the step. The state is the one before the update, or the one that was moved last.
struct FilterMeasurement {
  int equations, rank, dimension;  ///< P, how many of them are independent, K
  bool is_vector, valid_noise;
  NoiseForm form;
  const double* covariance;  ///< as many numbers as the form has
  int free;                  ///< directions in which the noise has no information: a basis of them
  const double* free_basis;
  const void* front;
  void (*linearize)(const void* front, bool moved, const double* step, double* values, double* by_state,
                    double* by_measurement, double* by_step);
};

/// Memory for one update with N, P, K as above: numbers, and P indices of rows.
struct FilterMemory {
  double* numbers;
  int* rows;
};
constexpr std::size_t filterNumbers(int N, int P, int K) {
  const auto n = static_cast<std::size_t>(N), p = static_cast<std::size_t>(P), k = static_cast<std::size_t>(K);
  return p * (5 * p + 6 * n + 8 * k + 5) + n * (5 * n + 3 * k + 2) + k * (k + 1);
}

/// The findings of an update: the members of FilterUpdate and DenseFilterUpdate that depend on no type.
struct FilterOutcome {
  FilterStatus status = FilterStatus::ok;
  bool moved = false;  ///< there is a new state: the step and its covariance are set
  double nis = 0, inconsistency = 0;
  int degrees_of_freedom = 0, iterations = 0;
  std::size_t measurements = 0, gated = 0;
};
/// Where the front wants them: N, N×N (in the frame at the new state); dense form: P, P×P.
struct FilterRows {
  double *step, *covariance, *innovation = nullptr, *innovation_covariance = nullptr;
};

/// The update by one measurement, in dense form.
LIESTAT_ESTIMATION_API FilterOutcome updateDense(const FilterState& state, const FilterMeasurement& y,
                                                 const ImplicitEkfOptions& options, double gate, const FilterRows& rows,
                                                 const FilterMemory& memory);

/// Sums over independent measurements, with the step where the equations are linearised. Matrices are N×N.
struct FilterSums {
  FilterState state;
  double *step, *by_step, *A, *b;
  bool moved = false;
  double squared = 0;
  int pass = 0, equations = 0;
  std::size_t measurements = 0, gated = 0;
  FilterStatus status = FilterStatus::ok;
};
LIESTAT_ESTIMATION_API void addToSums(FilterSums& sums, const FilterMeasurement& y, double gate,
                                      const FilterMemory& memory);
/// The update by the sums that `visit` adds up. `memory`: filterNumbers(N, 0, 0).
LIESTAT_ESTIMATION_API FilterOutcome updateSums(FilterSums& sums, const ImplicitEkfOptions& options,
                                                const FilterRows& rows, const FilterMemory& memory,
                                                void (*visit)(void* front), void* front);

}  // namespace liestat::detail

#ifdef LIESTAT_HEADER_ONLY
#include <stats/detail/filter_dense.hpp>
#include <stats/detail/filter_sums.hpp>
#endif
