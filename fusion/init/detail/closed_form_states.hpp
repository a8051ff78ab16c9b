// The states at all images of a window by the closed form; see fusion/visual_inertial_types.hpp.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/visual_inertial_types.hpp>

#include <Eigen/Core>

#include <vector>

namespace liestat {

LIESTAT_FUSION_INLINE std::vector<SE23d> InitialisedWindow::closedFormStates() const {
  std::vector<SE23d> list;
  if (closedForm().solutions.empty()) return list;
  const ClosedFormSolution& s = closedForm().solutions[0];
  ImuBias<double> used = measured.bias();
  used.accelerometer += s.accelerometer_bias;
  for (const BiasedImage& b : biasedImages(measured.motions(), used)) {
    const double t = b.image.time;
    list.emplace_back(SO3d(b.image.rotation),
                      Eigen::Vector3d(t * s.velocity + (0.5 * t * t) * s.gravity + b.image.displacement),
                      Eigen::Vector3d(s.velocity + t * s.gravity + b.speed));
  }
  return list;
}

}  // namespace liestat
