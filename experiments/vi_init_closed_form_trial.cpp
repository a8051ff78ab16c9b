#include <experiments/vi_init_errors.hpp>
#include <experiments/vi_init_trials.hpp>
#include <fusion/init/closed_form.hpp>
#include <experiments/scene_readings.hpp>

namespace liestat::experiments {
namespace {

InertialScene sceneOf(const ViInitWindow& size, const Eigen::Vector3d& bias, std::uint64_t seed) {
  return InertialScene({.images = size.images, .features = size.features, .window = size.seconds, .bias = bias}, seed);
}

}  // namespace

std::vector<double> closedFormNeesTrial(const ViInitWindow& size, double noise, CounterRng& rng) {
  InertialScene scene = sceneOf(size, Eigen::Vector3d::Zero(), rng());
  SceneRandom random(rng());
  scene.addNoise(noise * vi_init_bearing_noise, random);
  const auto r = solveClosedForm(scene.window,
                                 {.bearing_noise = vi_init_bearing_noise, .closed_form = {.singular_values = false}});
  // A window of which the answer is not one, or that says so, makes no claim. With the wrong noise χ² would say so
  // first, and hide what is to be seen.
  const double none = std::numeric_limits<double>::quiet_NaN();
  if (r.status != FusionStatus::ok || (noise == 1 && !r.consistent) ||
      r.covariance_content != CovarianceContent::image_noise) {
    return {none, none, none};
  }
  const ClosedFormSolution& s = r.solutions[0];
  Eigen::Matrix<double, 6, 1> error;
  error << s.velocity - scene.velocity, s.gravity - scene.gravity;
  return {neesOnSphere<5>(error, r.covariance, s.gravity), s.cost, static_cast<double>(r.degrees_of_freedom)};
}

std::vector<double> closedFormBiasNeesTrial(const ViInitWindow& size, double noise, CounterRng& rng) {
  const InitialisationOptions options{.bearing_noise = vi_init_bearing_noise,
                                      .closed_form = {.estimate_bias = true, .singular_values = false}};
  const std::uint64_t seed = rng();
  SceneRandom random(rng());
  const Eigen::Vector3d bias = noise * options.prior.accelerometer_sigma * random.normal3();
  InertialScene scene = sceneOf(size, bias, seed);
  scene.addNoise(noise * vi_init_bearing_noise, random);
  const auto r = solveClosedForm(scene.window, options);
  const double none = std::numeric_limits<double>::quiet_NaN();
  if (r.status != FusionStatus::ok || (noise == 1 && !r.consistent) ||
      r.covariance_content != CovarianceContent::image_noise_bias_prior) {
    return {none, none, none, none};
  }
  const ClosedFormSolution& s = r.solutions[0];
  Eigen::Matrix<double, 9, 1> error;
  error << s.velocity - scene.velocity, s.gravity - scene.gravity, s.accelerometer_bias - bias;
  return {neesOnSphere<5>(Eigen::Matrix<double, 6, 1>(error.head<6>()), r.covariance, s.gravity),
          neesOnSphere<8>(error, r.covariance, s.gravity), s.cost, static_cast<double>(r.degrees_of_freedom)};
}

std::vector<double> closedFormErrorsTrial(const ViInitWindow& size, double noise, CounterRng& rng) {
  InertialScene scene = sceneOf(size, Eigen::Vector3d::Zero(), rng());
  SceneRandom random(rng());
  measure(scene, {.gyroscope = noise * vi_init_imu.gyroscope, .accelerometer = noise * vi_init_imu.accelerometer},
          random);
  scene.addNoise(noise * vi_init_bearing_noise, random);
  std::vector<double> values;
  for (const bool remove : {true, false}) {
    const ViErrors e = viErrors(
        solveClosedForm(scene.window, {.bearing_noise = vi_init_bearing_noise,
                                       .closed_form = {.singular_values = false, .remove_noise_bias = remove}}),
        scene);
    values.insert(values.end(), {e.speed, e.gravity, e.scale});
  }
  return values;
}

}  // namespace liestat::experiments
