#include <cli/vi_fusion.hpp>

#include <fusion/init/window_fusion.hpp>
#include <stats/inference.hpp>

#include <cmath>
#include <limits>

namespace liestat::cli {
namespace {

/// The fields that say what was found.
void setState(ViFusion& stretch, const Gaussian<InertialState>& found, double gravity) {
  const auto& [down, velocity, gyroscope, resting_force] = found.mean.parts();
  const auto accelerometer = accelerometerBias(found, gravity);
  stretch.down = down.unit_vector();
  stretch.velocity = velocity;
  stretch.gyroscope_bias = gyroscope;
  stretch.accelerometer_bias = accelerometer.mean;
  stretch.covariance = found.covariance;
  const auto deviation = [&](int first, int n) {
    return std::sqrt(found.covariance.diagonal().segment(first, n).mean());
  };
  stretch.down_deviation = deviation(0, 2);
  stretch.velocity_deviation = deviation(2, 3);
  stretch.gyroscope_deviation = deviation(5, 3);
  stretch.accelerometer_deviation = std::sqrt(accelerometer.covariance.diagonal().mean());
}

void compare(ViFusion& stretch, const Gaussian<InertialState>& found, const GroundTruth& truth, double gravity) {
  const SO3d back = SO3d(truth.state.so3()).inverse();
  const Eigen::Vector3d down = back * Eigen::Vector3d(0, 0, -1);
  const InertialState state(S2d(down), Eigen::Vector3d(back * Eigen::Vector3d(truth.state.velocity())),
                            truth.bias.gyroscope, Eigen::Vector3d(truth.bias.accelerometer - gravity * down));
  stretch.gravity_error = distance(found.mean.get<0>(), state.get<0>());
  stretch.speed_error = (stretch.velocity - state.get<1>()).norm();
  stretch.gyroscope_error = (stretch.gyroscope_bias - truth.bias.gyroscope).norm();
  stretch.accelerometer_error = (stretch.accelerometer_bias - truth.bias.accelerometer).norm();
  stretch.nees = mahalanobisSquared(found, state);
}

}  // namespace

std::vector<ViFusion> fuseStretches(const std::vector<ViWindow>& windows, const ViRecording& recording,
                                    const ViInitOptions& options, const ViFusionTools& tools) {
  std::vector<ViFusion> stretches;
  double free_from = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < windows.size(); ++i) {
    const ViWindow& w = windows[i];
    if (!w.ok() || !w.refined || w.begin < free_from) continue;
    const bool begins = stretches.empty() || w.end > stretches.back().begin + options.stretch * (1 + 1e-9) ||
                        !tools.has_readings(stretches.back().end, w.begin);
    if (begins) stretches.emplace_back().begin = w.begin;
    stretches.back().windows.push_back(i);
    stretches.back().end = free_from = w.end;
  }
  for (ViFusion& stretch : stretches) {
    const std::size_t n = stretch.windows.size();
    const double gravity = options.gravity.value_or(windows[stretch.windows.front()].refined->gravity.norm());
    WindowFusion fusion(gravity);
    double end = 0;
    std::vector<std::size_t> used;
    for (const std::size_t i : stretch.windows) {
      const ViWindow& w = windows[i];
      const std::optional<RefinementResult> refined = n == 1 ? w.refined : tools.refine(w, n);
      if (!refined) continue;
      const auto meeting = fusion.add(windowStates(*refined, w.measured),
                                      [&](const ImuBias<double>& bias) { return tools.motion(end, w.begin, bias); });
      if (meeting.status != Status::ok) continue;
      used.push_back(i);
      stretch.end = end = w.end;
    }
    stretch.windows = used;
    stretch.ok = fusion.ok();
    if (!stretch.ok) continue;
    stretch.chi2 = fusion.chi2();
    stretch.degrees_of_freedom = fusion.degrees_of_freedom();
    if (stretch.degrees_of_freedom > 0) {
      stretch.p_value = chiSquaredSurvival(stretch.chi2, static_cast<double>(stretch.degrees_of_freedom));
    }
    setState(stretch, fusion.state(), gravity);
    const std::optional<GroundTruth> truth = truthAt(recording.truth, stretch.end);
    if (truth) compare(stretch, fusion.state(), *truth, gravity);
  }
  return stretches;
}

}  // namespace liestat::cli
