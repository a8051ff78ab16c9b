#include <fusion/init/closed_form.hpp>
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
  const InertialWindow window = windowOf(scene, readings);
  const InitialisationOptions options{.bearing_noise = vi_init_bearing_noise,
                                      .closed_form = {.singular_values = false}};
  const GyroscopeBiasResult found = estimateGyroscopeBias(window, options);
  GyroscopeBiasOutcome outcome;
  if (found.status == FusionStatus::ok) {
    outcome.estimated = viErrors(found.result, scene);
    outcome.bias = (found.bias - bias).norm();
  }
  outcome.ignored = viErrors(solveClosedForm(closedFormWindow(window, {}), options), scene);
  return outcome;
}

DriftOutcome driftTrial(const ViInitWindow& size, double noise, CounterRng& rng) {
  InertialScene scene({.images = size.images, .features = size.features, .window = size.seconds}, rng());
  measure(scene, {.gyroscope = noise * vi_init_imu.gyroscope, .accelerometer = noise * vi_init_imu.accelerometer}, rng);
  scene.addNoise(noise * vi_init_bearing_noise, rng);
  const std::size_t wrong = size.features * 2 / 5;
  scene.addDrift(wrong, 8 * vi_init_bearing_noise, rng);
  const InitialisationOptions options{
      .bearing_noise = vi_init_bearing_noise, .closed_form = {.singular_values = false}, .consensus = {.seed = rng()}};
  const ConsensusResult robust = solveClosedFormRobustly(scene.window, options);
  DriftOutcome outcome;
  outcome.exact_selection = robust.inliers.size() == size.features - wrong;
  for (const std::size_t i : robust.inliers) outcome.exact_selection = outcome.exact_selection && i >= wrong;
  outcome.no_selection = viErrors(solveClosedForm(scene.window, options), scene);
  ClosedFormWindow right = scene.window;
  for (std::size_t i = 0; i < wrong; ++i) right.features[i].clear();
  outcome.oracle = viErrors(solveClosedForm(right, options), scene);
  // No consensus is no answer.
  if (!robust.inliers.empty()) outcome.robust = viErrors(robust.result, scene);
  return outcome;
}

}  // namespace liestat::experiments
