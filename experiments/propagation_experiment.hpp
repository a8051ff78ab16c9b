#pragma once

#include <stats/random.hpp>
#include <stats/validation_report.hpp>

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace liestat::experiments {

/// The simulated experiments of `liestat validate propagation`: features with known noise are composed, inverted,
/// compared, or move points, and the truth is looked for under the propagated covariance. All operations see the same
/// draws.

enum class Propagated { rotation, pose, similarity };
inline constexpr std::array all_propagated{Propagated::rotation, Propagated::pose, Propagated::similarity};

enum class Operation { compose, inverse, between, act, chain };
inline constexpr std::array all_operations{Operation::compose, Operation::inverse, Operation::between, Operation::act,
                                           Operation::chain};

/// Names in options and JSON fields, in the order of the enumerators.
inline constexpr std::array propagated_names{"rotation", "pose", "similarity"};
inline constexpr std::array operation_names{"compose", "inverse", "between", "act", "chain"};
inline std::string name(Propagated feature) { return propagated_names[static_cast<std::size_t>(feature)]; }
inline std::string name(Operation operation) { return operation_names[static_cast<std::size_t>(operation)]; }

/// An operation, to first or to fourth order in the noise.
struct PropagationMethod {
  Operation operation;
  bool fourth_order;
};
inline constexpr std::array propagation_methods{
    PropagationMethod{Operation::compose, false}, PropagationMethod{Operation::compose, true},
    PropagationMethod{Operation::inverse, false}, PropagationMethod{Operation::between, false},
    PropagationMethod{Operation::act, false},     PropagationMethod{Operation::chain, false},
    PropagationMethod{Operation::chain, true}};

/// Number of factors in a chain.
inline constexpr std::size_t chain_length = 10;

/// One experiment.
struct PropagationExperiment {
  Propagated feature = Propagated::pose;
  /// The largest standard deviation of a rotation (rad) and of a translation or point (m); along the other axes 2/3 and
  /// 1/3 of it, of the logarithm of a scale 1/3. Correlation 1/2 between neighbouring coordinates.
  double spread = 0.1;
  std::vector<PropagationMethod> methods{propagation_methods.begin(), propagation_methods.end()};
};

/// Degrees of freedom of an operation's result.
int degreesOfFreedom(Propagated feature, Operation operation);

/// One trial of an experiment: an outcome for each of its methods.
std::vector<TrialOutcome> propagationTrial(const PropagationExperiment& experiment, CounterRng& rng);

}  // namespace liestat::experiments
