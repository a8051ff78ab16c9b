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

ClosedFormOutcome closedFormNeesTrial(const ViInitWindow& size, double noise, CounterRng& rng) {
  InertialScene scene = sceneOf(size, Eigen::Vector3d::Zero(), rng());
  scene.addNoise(noise * vi_init_bearing_noise, rng);
  const auto r = solveClosedForm(scene.window,
                                 {.bearing_noise = vi_init_bearing_noise, .closed_form = {.singular_values = false}});
  // A window without a single consistent answer makes no claim. With the wrong noise χ² would say so first, and hide
  // the distances.
  if (r.status != FusionStatus::ok || (noise == 1 && !r.consistent) ||
      r.covariance_content != ClosedFormCovarianceContent::image_noise) {
    return {};
  }
  const ClosedFormSolution& s = r.solutions[0];
  Eigen::Matrix<double, 6, 1> error;
  error << s.velocity - scene.velocity, s.gravity - scene.gravity;
  return {.nees_v_g = neesOnSphere<5>(error, r.covariance, s.gravity),
          .chi2 = {s.cost, static_cast<double>(r.degrees_of_freedom)}};
}

ClosedFormOutcome closedFormBiasNeesTrial(const ViInitWindow& size, double noise, CounterRng& rng) {
  const InitialisationOptions options{.bearing_noise = vi_init_bearing_noise,
                                      .prior = {.accelerometer_sigma = 0.1},
                                      .closed_form = {.estimate_bias = true, .singular_values = false}};
  const std::uint64_t seed = rng();
  const Eigen::Vector3d bias = noise * options.prior.accelerometer_sigma * rng.normalVector<3>();
  InertialScene scene = sceneOf(size, bias, seed);
  scene.addNoise(noise * vi_init_bearing_noise, rng);
  const auto r = solveClosedForm(scene.window, options);
  if (r.status != FusionStatus::ok || (noise == 1 && !r.consistent) ||
      r.covariance_content != ClosedFormCovarianceContent::image_noise_bias_prior) {
    return {};
  }
  const ClosedFormSolution& s = r.solutions[0];
  Eigen::Matrix<double, 9, 1> error;
  error << s.velocity - scene.velocity, s.gravity - scene.gravity, s.accelerometer_bias - bias;
  return {.nees_v_g = neesOnSphere<5>(Eigen::Matrix<double, 6, 1>(error.head<6>()), r.covariance, s.gravity),
          .nees_all = neesOnSphere<8>(error, r.covariance, s.gravity),
          .chi2 = {s.cost, static_cast<double>(r.degrees_of_freedom)}};
}

AccuracyOutcome closedFormErrorsTrial(const ViInitWindow& size, double noise, CounterRng& rng) {
  InertialScene scene = sceneOf(size, Eigen::Vector3d::Zero(), rng());
  measure(scene, {.gyroscope = noise * vi_init_imu.gyroscope, .accelerometer = noise * vi_init_imu.accelerometer}, rng);
  scene.addNoise(noise * vi_init_bearing_noise, rng);
  const auto errors = [&](bool remove_noise_bias) {
    return viErrors(solveClosedForm(scene.window, {.bearing_noise = vi_init_bearing_noise,
                                                   .closed_form = {.singular_values = false,
                                                                   .remove_noise_bias = remove_noise_bias}}),
                    scene);
  };
  return {.closed_form = errors(true), .least_squares = errors(false)};
}

}  // namespace liestat::experiments
