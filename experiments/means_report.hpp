// The numbers that the trials of the simulated experiments report besides the squared distances.
#pragma once

#include <stats/validation_report.hpp>

#include <array>
#include <limits>

namespace liestat::experiments {

/// An outcome with the logarithms of the ratio of the method's errors to those of MAHA in the same trial.
struct MeansOutcome : TrialOutcome {
  double log_ratio_rotation = std::numeric_limits<double>::quiet_NaN();
  double log_ratio_translation = std::numeric_limits<double>::quiet_NaN();
  static constexpr std::array statistics = {&MeansOutcome::log_ratio_rotation, &MeansOutcome::log_ratio_translation};
};

/// One of these ratios.
using ErrorRatio = double MeansOutcome::*;
inline constexpr ErrorRatio log_ratio_rotation = &MeansOutcome::log_ratio_rotation;
inline constexpr ErrorRatio log_ratio_translation = &MeansOutcome::log_ratio_translation;

using MeansReport = ValidationReportOf<MeansOutcome>;

}  // namespace liestat::experiments
