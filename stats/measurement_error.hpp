// The error of a measurement under a given parameter: the size of the smallest correction after which the measurement
// satisfies its equations (Viéville, Lingrand and Gaspard 2000, (22) to (24), with derivatives with respect to the
// measurement). Robust search classifies inliers and outliers by this error.
#pragma once

#include <stats/constrained_types.hpp>
#include <stats/detail/constrained_problem.hpp>
#include <stats/detail/measurement_block.hpp>
#include <stats/measurement_noise.hpp>

#include <limits>
#include <type_traits>

namespace liestat {

/// The result of measurementError().
template <Homogeneous M>
struct MeasurementError {
  double squared = 0;  ///< ‖m̃ - m‖²_Q; χ² with `equations` degrees of freedom for an inlier of the true parameter
  double remaining = 0;  ///< ‖c(m̃)‖² in units of the noise, second term of (24): zero once the steps have converged
  int equations = 0;     ///< number of independent equations
  M corrected = ManifoldTraits<M>::origin();  ///< m̃

  /// Squared error per equation, (24).
  double normalised() const { return equations > 0 ? squared / equations : 0; }
};

/// The error of m under q. One step gives Sampson's error cᵀ (D V Dᵀ)⁻ c, which is accurate enough for a search; strongly
/// curved equations need two or three steps. The error of a measurement without equations (zero gradients, or free in
/// all of them) is zero. NaN for input that is not finite and for invalid noise; infinite if an equation is violated and
/// all coordinates that it depends on are exact.
template <Homogeneous Q, Homogeneous M, NoiseModel Noise, class Equation>
MeasurementError<M> measurementError(const Q& q, const M& m, const Noise& noise, const Equation& equation,
                                     int steps = 1) {
  constexpr int N = ManifoldTraits<Q>::DoF, K = ManifoldTraits<M>::DoF;
  constexpr int P = std::remove_cvref_t<decltype(equation.linearize(q, m).value)>::RowsAtCompileTime;
  using Block = detail::MeasurementBlock<P, N, K>;
  Block block;
  typename Block::Correction at = Block::Correction::Zero();
  MeasurementError<M> error{.corrected = m};
  for (int step = 0; step < steps; ++step) {
    const auto J = equation.linearize(q, error.corrected);
    block.build(noise, J.value.template cast<double>(), J.by_parameter.template cast<double>(),
                detail::inCoordinatesAt<M, P>(m, error.corrected, J.by_measurement.template cast<double>()), at,
                detail::equationRank<Equation, P>());
    if (!block.finite || !noise.valid()) {
      error.squared = error.remaining = std::numeric_limits<double>::quiet_NaN();
      return error;
    }
    at = block.correction(Block::Step::Zero());
    error.corrected = exp(m, TangentOf<M>(at.template cast<ScalarOf<M>>()));
  }
  error.squared = noise.squaredNorm(at);
  error.equations = block.root.rank();
  const typename Block::Values left = equation(q, error.corrected).template cast<double>();
  error.remaining = block.whitened(left).squaredNorm();
  if (block.free.dimension == 0 && error.equations < detail::equationRank<Equation, P>()) {
    const auto D = detail::inCoordinatesAt<M, P>(
        m, error.corrected, equation.linearize(q, error.corrected).by_measurement.template cast<double>());
    if (detail::unmetEquations<P, K>(block.root, left, D, detail::typicalDeviation(noise)) > 0) {
      error.squared = std::numeric_limits<double>::infinity();
    }
  }
  return error;
}

}  // namespace liestat
