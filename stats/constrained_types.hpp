// Options and results of constrained estimation. The estimator is in stats/constrained.hpp; readers of results need
// this header alone.
#pragma once

#include <lie/manifold.hpp>
#include <stats/noise_fit.hpp>
#include <stats/relative_curvature.hpp>
#include <stats/status.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

namespace liestat {

/// How the iteration of a constrained estimate ended.
enum class ConstrainedEnd {
  running,        ///< it did not end yet
  converged,      ///< the step and the equations are small against the noise
  capped,         ///< no iterations left
  stalled,        ///< no step along the direction that was found improves estimate or equations
  stopped,        ///< asked to
  saddle,         ///< a stationary point that is no minimum, and no way down from it was found
  inconsistent,   ///< converged, but χ² refutes the stated noise: no covariance follows from it
  curved,         ///< converged, but the model is curved on the scale of the noise: first order gives no covariance
  unobservable,   ///< converged, but the measurements leave directions of the parameter open
  contradictory,  ///< constraints that cannot be met together, or not from here, or an equation of exact coordinates
  too_few,        ///< no equation is left
  bad_input       ///< a number that is not finite, or a noise that is not positive
};

/// The name used in files and messages.
constexpr const char* name(ConstrainedEnd end) {
  switch (end) {
    case ConstrainedEnd::running:
      return "running";
    case ConstrainedEnd::converged:
      return "converged";
    case ConstrainedEnd::capped:
      return "capped";
    case ConstrainedEnd::stalled:
      return "stalled";
    case ConstrainedEnd::stopped:
      return "stopped";
    case ConstrainedEnd::saddle:
      return "saddle";
    case ConstrainedEnd::inconsistent:
      return "inconsistent";
    case ConstrainedEnd::curved:
      return "curved";
    case ConstrainedEnd::unobservable:
      return "unobservable";
    case ConstrainedEnd::contradictory:
      return "contradictory";
    case ConstrainedEnd::too_few:
      return "too_few";
    case ConstrainedEnd::bad_input:
      return "bad_input";
  }
  return "unknown";
}

/// The status that says the same in the library's terms.
constexpr Status statusOf(ConstrainedEnd end) {
  switch (end) {
    case ConstrainedEnd::converged:
      return Status::ok;
    case ConstrainedEnd::inconsistent:
      return Status::inconsistent;
    case ConstrainedEnd::curved:
    case ConstrainedEnd::unobservable:
    case ConstrainedEnd::contradictory:
      return Status::ill_defined;
    case ConstrainedEnd::too_few:
      return Status::too_few;
    case ConstrainedEnd::bad_input:
      return Status::not_applicable;
    default:
      return Status::not_converged;
  }
}

/// The values of P equations with their derivatives: value(exp(q, a), exp(m, b)) = value + by_parameter a +
/// by_measurement b to first order.
template <int P, int N, int K>
struct EquationDerivatives {
  Eigen::Matrix<double, P, 1> value;
  Eigen::Matrix<double, P, N> by_parameter;
  Eigen::Matrix<double, P, K> by_measurement;
};

/// The same for constraints of the parameter.
template <int P, int N>
struct ConstraintDerivatives {
  Eigen::Matrix<double, P, 1> value;
  Eigen::Matrix<double, P, N> by_parameter;
};

/// Prior of the parameter: its value and the information matrix of its error in the local frame, positive
/// semi-definite.
template <Homogeneous Q>
struct ParameterPrior {
  Q mean = ManifoldTraits<Q>::origin();
  SquareOf<Q> information = SquareOf<Q>::Zero();
};

/// The role of the noise that was stated, which the χ² of an estimate tests.
enum class StatedNoise {
  tested,  ///< where χ² refutes it at refutation_level the estimate is `inconsistent`, without a covariance
  scaled,  ///< covariances are multiplied by max(1, χ²/r), after R. Birge (1932)
  trusted  ///< nothing: whoever called looks at χ² himself
};

template <Homogeneous Q>
struct ConstrainedOptions {
  std::optional<ParameterPrior<Q>> prior = {};
  int max_iterations = 100;
  /// The iteration ends when the next step is that long, in standard deviations.
  double tolerance = 1e-9;
  /// The curvature of the equations joins the Hessian after three steps of slow convergence, which are those of large
  /// residuals. `false`: Gauss–Newton steps alone, as in the report.
  bool curvature = true;
  /// Second derivatives, by differences of the first, are looked at where the iteration converged: whether it is a
  /// minimum, which bounds are active, how curved the model is. It costs two linearisations for each coordinate of
  /// parameter and measurement. Without it, or without `curvature`, none of this is known.
  bool second_order = true;
  StatedNoise noise = StatedNoise::tested;
};

/// A constrained estimate. All distances and covariances are in local frames, in the tangent order of Q.
template <Homogeneous Q>
struct ConstrainedResult {
  ConstrainedEnd end = ConstrainedEnd::running;
  Q parameter = ManifoldTraits<Q>::origin();
  /// Information on the parameter, (6) of the report: before the constraints.
  SquareOf<Q> information = SquareOf<Q>::Zero();
  /// Z (Zᵀ A Z)⁻¹ Zᵀ, A the information and Z a basis of what the constraints leave free: of that rank. First order.
  /// NaN in rows and columns of coordinates that are open, and everywhere of `inconsistent` and `curved` ends. Active
  /// bounds do not make it smaller: the true parameter may be inside of them.
  SquareOf<Q> covariance = SquareOf<Q>::Constant(std::numeric_limits<double>::quiet_NaN());
  /// D² of section 3.7: 2 L², the squared distance from the measurements and the prior to what was estimated. It
  /// follows χ² with `degrees_of_freedom`.
  double chi2 = std::numeric_limits<double>::quiet_NaN();
  int degrees_of_freedom = 0;
  /// The probability of a larger χ² where the stated noise is right; NaN without degrees of freedom: untested.
  double fit_p = std::numeric_limits<double>::quiet_NaN();
  /// E² of (13) and (17): the squared distance from what was estimated to the equations linearised there.
  double equation_error = std::numeric_limits<double>::quiet_NaN();
  int free_parameters = 0;                          ///< dimension of what the constraints leave free
  int equations = 0;                                ///< independent equations of the measurements
  int dropped_equations = 0;                        ///< redundant without having said so, or with a gradient of zero
  int constraints = 0;                              ///< independent constraints of the parameter
  int dropped_constraints = 0;                      ///< redundant, or with a gradient of zero
  std::size_t measurements = 0, uninformative = 0;  ///< all; those whose free directions take up all their equations
  int iterations = 0;
  bool used_curvature = false;
  /// A basis of the directions that neither measurements nor constraints determine, in the first `unobservable`
  /// columns.
  int unobservable = 0;
  SquareOf<Q> unobservable_basis = SquareOf<Q>::Zero();
  /// The covariance of the error's part across these directions, whatever its part along them; NaN as `covariance` is
  /// where it is withheld. Without open directions it is `covariance`.
  SquareOf<Q> determined_covariance = covariance;
  /// Inequalities that hold with equality: directions, such as a slack variable, that second derivatives alone
  /// determine.
  int active_bounds = 0;
  /// Where it is large the estimate is `curved`, without a covariance; where it is not small the covariance is
  /// multiplied by `widening`.
  RelativeCurvature relative_curvature = {};
  double widening = 1;
  bool minimum_checked = false;  ///< that the end is a minimum was seen in its second derivatives

  Status status() const { return statusOf(end); }
  bool ok() const { return end == ConstrainedEnd::converged; }
  /// The variance factor 2 L² / r, by which covariances are multiplied where the scale of the noise is not known.
  double varianceFactor() const {
    return degrees_of_freedom > 0 ? chi2 / degrees_of_freedom : std::numeric_limits<double>::quiet_NaN();
  }
  /// √(2 L² / r), by which the stated standard deviations are too small if the model is right.
  double noiseFactor() const { return std::sqrt(varianceFactor()); }
  /// The verdict of χ² on the stated noise, in a word.
  const char* fit() const {
    return std::isnan(fit_p) ? "untested" : fit_p < refutation_level ? "inconsistent" : "consistent";
  }
};

}  // namespace liestat
