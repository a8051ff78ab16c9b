// Runs of the means' validation that several tests judge.
#pragma once

#include <experiments/means_validation.hpp>

namespace liestat_test {

/// MAHA of ten quotient frames with anisotropic noise, 200 trials.
inline liestat::experiments::MeansValidation mahaOnFrames() {
  using namespace liestat;
  using namespace liestat::experiments;
  MeansValidation validation;
  validation.features = {Feature::semi_oriented_frame, Feature::non_oriented_frame};
  validation.noises = {Noise::idd};
  validation.criteria = {Criterion::maha};
  validation.n = {10};
  validation.run.trials = 200;
  return validation;
}

}  // namespace liestat_test
