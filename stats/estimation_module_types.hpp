// Inputs and outputs of an estimation module. The module is in stats/estimation_module.hpp.
#pragma once

#include <stats/hierarchy_types.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace liestat {

enum class ModuleControl {
  stopped,  ///< as it is made: step() and run() do nothing
  running,
  suspended  ///< step() does nothing, run() waits
};
constexpr const char* name(ModuleControl control) {
  return control == ModuleControl::stopped ? "stopped" : control == ModuleControl::running ? "running" : "suspended";
}

/// The answer of the module at some time, after the inputs that its last step took in.
template <class Parameter>
struct ModuleOutput {
  HierarchyState progress = HierarchyState::initial;
  std::string fault = {};        ///< why the models are invalid; nothing is then estimated
  std::size_t measurements = 0;  ///< all that were there, inliers or not
  std::string model = {};        ///< chosen, the null model while there is nothing else
  /// Status, parameter, information and covariance, D² (`chi2`), E² (`equation_error`). Empty while there is no estimate.
  std::optional<ModelEstimate<Parameter>> estimate = {};
  bool outdated = false;    ///< the estimate is of earlier measurements; inliers and criterion are of these
  bool unsupported = true;  ///< there is no estimate, or its inliers could be chance
  /// The normalised criterion 2 L²/r over the inliers: one on average for a right model.
  double criterion = std::numeric_limits<double>::quiet_NaN();
  std::vector<std::vector<std::uint64_t>> inliers = {};  ///< their names, ascending, by channel
};

/// Signals are sent by the thread that runs the module, at the end of a step, and may call anything but step() and run().
template <class Parameter>
struct ModuleOptions {
  using Signal = std::function<void(const ModuleOutput<Parameter>&)>;
  HierarchyOptions search = {};
  /// Measurements wait for so many steps after the last ones, unless nothing is left to do. They begin the walk through the
  /// models again, so that a new one with every step would keep it at the null model. 0: they are taken in at once.
  std::size_t steps_between_inputs = 0;
  Signal model_found = {};    ///< a supported model is chosen, another one than before or after a new state
  Signal terminated = {};     ///< nothing is left to do; again after new inputs
  Signal cost_below = {};     ///< the criterion of a supported model has fallen below `cost_threshold`
  double cost_threshold = 0;  ///< bound on the normalised criterion; 0: no such signal
};

}  // namespace liestat
