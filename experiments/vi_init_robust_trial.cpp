#include <experiments/vi_init_errors.hpp>
#include <experiments/vi_init_trials.hpp>
#include <fusion/init/consensus.hpp>
#include <fusion/init/gyroscope_bias.hpp>
#include <experiments/scene_readings.hpp>

namespace liestat::experiments {

GyroscopeBiasOutcome gyroscopeBiasTrial(const ViInitWindow& size, double noise, CounterRng& rng) {
  InertialScene scene({.images = size.images, .features = size.features, .window = size.seconds}, rng());
  const Eigen::Vector3d bias = 0.05 * rng.unitVector<3>();
  const ImuNoise<double> simulated{.gyroscope = noise * vi_init_imu.gyroscope,
                                   .accelerometer = noise * vi_init_imu.accelerometer};
  const auto readings = readingsOf(scene, simulated, rng, bias);
  scene.addNoise(noise * vi_init_bearing_noise, rng);
  const auto integrate = [&](const ImuBias<double>& b) {
    return motionsOf(scene, readings, {.preintegration = {.bias = b}});
  };
  const InertialWindow window{integrate({}), scene.window.features, scene.options().camera};
  const GyroscopeBiasOptions options{.closed_form = {.bearing_noise = vi_init_bearing_noise, .singular_values = false}};
  const GyroscopeBiasResult found = estimateGyroscopeBias(window, options, integrate);
  GyroscopeBiasOutcome outcome;
  if (found.status == GyroscopeBiasStatus::ok) {
    outcome.estimated = viErrors(found.result, scene);
    outcome.bias = (found.bias - bias).norm();
  }
  outcome.ignored = viErrors(solveClosedForm(closedFormWindow(window, {}), options.closed_form), scene);
  return outcome;
}

DriftOutcome driftTrial(const ViInitWindow& size, double noise, CounterRng& rng) {
  InertialScene scene({.images = size.images, .features = size.features, .window = size.seconds}, rng());
  measure(scene, {.gyroscope = noise * vi_init_imu.gyroscope, .accelerometer = noise * vi_init_imu.accelerometer}, rng);
  scene.addNoise(noise * vi_init_bearing_noise, rng);
  const std::size_t wrong = size.features * 2 / 5;
  scene.addDrift(wrong, 8 * vi_init_bearing_noise, rng);
  const RansacOptions options{.closed_form = {.bearing_noise = vi_init_bearing_noise, .singular_values = false}};
  const ClosedFormRansacResult robust = solveClosedFormRobustly(scene.window, rng, options);
  DriftOutcome outcome;
  outcome.exact_selection = robust.inliers.size() == size.features - wrong;
  for (const std::size_t i : robust.inliers) outcome.exact_selection = outcome.exact_selection && i >= wrong;
  outcome.no_selection = viErrors(solveClosedForm(scene.window, options.closed_form), scene);
  ClosedFormWindow right = scene.window;
  for (std::size_t i = 0; i < wrong; ++i) right.features[i].clear();
  outcome.oracle = viErrors(solveClosedForm(right, options.closed_form), scene);
  // No consensus is no answer.
  if (!robust.inliers.empty()) outcome.robust = viErrors(robust.result, scene);
  return outcome;
}

}  // namespace liestat::experiments
