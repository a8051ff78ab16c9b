#include <experiments/vi_init_errors.hpp>
#include <experiments/vi_init_trials.hpp>
#include <fusion/init/consensus.hpp>
#include <fusion/init/gyroscope_bias.hpp>
#include <experiments/scene_readings.hpp>

namespace liestat::experiments {

std::vector<double> gyroscopeBiasTrial(const ViInitWindow& size, double noise, CounterRng& rng) {
  InertialScene scene({.images = size.images, .features = size.features, .window = size.seconds}, rng());
  SceneRandom random(rng());
  const Eigen::Vector3d bias = 0.05 * random.unit();
  const ImuNoise<double> simulated{.gyroscope = noise * vi_init_imu.gyroscope,
                                   .accelerometer = noise * vi_init_imu.accelerometer};
  const auto readings = readingsOf(scene, simulated, random, bias);
  scene.addNoise(noise * vi_init_bearing_noise, random);
  const InertialWindow window = windowOf(scene, readings);
  const InitialisationOptions options{.bearing_noise = vi_init_bearing_noise,
                                      .closed_form = {.singular_values = false}};
  const GyroscopeBiasResult found = estimateGyroscopeBias(window, options);
  ViErrors with;
  double error = std::numeric_limits<double>::infinity();
  if (found.status == FusionStatus::ok) {
    with = viErrors(found.result, scene);
    error = (found.bias - bias).norm();
  }
  const ViErrors without = viErrors(solveClosedForm(closedFormWindow(window, {}), options), scene);
  return {error, with.gravity, with.scale, without.gravity, without.scale};
}

std::vector<double> driftTrial(const ViInitWindow& size, double noise, CounterRng& rng) {
  InertialScene scene({.images = size.images, .features = size.features, .window = size.seconds}, rng());
  SceneRandom random(rng());
  measure(scene, {.gyroscope = noise * vi_init_imu.gyroscope, .accelerometer = noise * vi_init_imu.accelerometer},
          random);
  scene.addNoise(noise * vi_init_bearing_noise, random);
  const std::size_t wrong = size.features * 2 / 5;
  scene.addDrift(wrong, 8 * vi_init_bearing_noise, random);
  const InitialisationOptions options{
      .bearing_noise = vi_init_bearing_noise, .closed_form = {.singular_values = false}, .consensus = {.seed = rng()}};
  const ConsensusResult robust = solveClosedFormRobustly(scene.window, options);
  bool exact = robust.inliers.size() == size.features - wrong;
  for (const std::size_t i : robust.inliers) exact = exact && i >= wrong;
  const ViErrors all = viErrors(solveClosedForm(scene.window, options), scene);
  ClosedFormWindow right = scene.window;
  for (std::size_t i = 0; i < wrong; ++i) right.features[i].clear();
  const ViErrors oracle = viErrors(solveClosedForm(right, options), scene);
  // No consensus is no answer.
  const ViErrors kept = robust.inliers.empty() ? ViErrors{} : viErrors(robust.result, scene);
  return {exact ? 1. : 0., kept.speed,   kept.gravity, kept.scale,  oracle.speed,
          oracle.gravity,  oracle.scale, all.speed,    all.gravity, all.scale};
}

}  // namespace liestat::experiments
