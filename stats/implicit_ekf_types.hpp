// Options and results of the implicit extended Kalman filter (stats/implicit_ekf.hpp).
#pragma once

#include <lie/manifold.hpp>

#include <Eigen/Core>

#include <cstddef>

namespace liestat {

/// How an update or a prediction ended. Only `ok` and `not_converged` change the state.
enum class FilterStatus {
  ok,             ///< the state is updated
  gated,          ///< the innovation is too large for its covariance; for several measurements: all of them are
  not_converged,  ///< the iterations did not settle: the state is that of the first, a plain extended Kalman update
  not_finite,     ///< a number is not finite
  singular        ///< equations that say nothing, contradict each other, or a covariance that this form has to invert
};

/// The name used in files and messages.
constexpr const char* name(FilterStatus status) {
  switch (status) {
    case FilterStatus::ok:
      return "ok";
    case FilterStatus::gated:
      return "gated";
    case FilterStatus::not_converged:
      return "not_converged";
    case FilterStatus::not_finite:
      return "not_finite";
    case FilterStatus::singular:
      return "singular";
  }
  return "unknown";
}

struct ImplicitEkfOptions {
  /// Linearisations per update. One: the extended Kalman filter. More: until the most probable state is reached.
  int max_iterations = 1;
  /// Iterations end when no coordinate changes by more than this, in standard deviations of the prior.
  double tolerance = 1e-8;
  /// Redundant equations that differ from what the others say by more than this, in standard deviations, are a
  /// contradiction: status singular. Dense form.
  double max_inconsistency = 3;
};

/// The result of an update. NIS is the normalised innovation squared at the prior, hᵀ S⁻¹ h: it follows χ² with
/// `degrees_of_freedom`, the rank of S, where state and noise are what they are said to be.
template <Homogeneous X>
struct FilterUpdate {
  FilterStatus status = FilterStatus::ok;
  TangentOf<X> step = TangentOf<X>::Zero();  ///< in the frame at the prior's mean; what was or would have been applied
  double nis = 0;                            ///< NIS of all measurements that passed their gates; dense form: of any
  int degrees_of_freedom = 0;
  int iterations = 0;
  std::size_t measurements = 0;  ///< measurements used
  std::size_t gated = 0;         ///< measurements left out by their gates

  bool ok() const { return status == FilterStatus::ok; }
};

/// An update in dense form, P equations.
template <Homogeneous X, int P>
struct DenseFilterUpdate : FilterUpdate<X> {
  Eigen::Matrix<double, P, 1> innovation = Eigen::Matrix<double, P, 1>::Zero();  ///< h at the prior
  /// S at the prior; singular where equations are redundant.
  Eigen::Matrix<double, P, P> innovation_covariance = Eigen::Matrix<double, P, P>::Zero();
  double inconsistency = 0;  ///< largest contradiction of redundant equations, in standard deviations; 0 without any
};

}  // namespace liestat
