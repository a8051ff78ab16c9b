// A row of `liestat validate vi-init` from the values of its trials.
#pragma once

#include <experiments/vi_init_validation.hpp>

#include <vector>

namespace liestat::experiments {

/// The values of one row: one a trial, NaN or infinite where it was lost.
struct ViInitValues {
  std::vector<double> value;
  std::vector<double> dof;  ///< degrees of freedom of each χ²; empty for other quantities
};

/// Fills in a row from the values of its trials, and judges it if anything is promised. `dof`: of a distance.
void evaluate(ViInitRow& row, const ViInitValues& values, int dof, double false_alarm);

}  // namespace liestat::experiments
