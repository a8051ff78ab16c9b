#include <experiments/scene_readings.hpp>
#include <experiments/vi_init_errors.hpp>
#include <experiments/vi_init_trials.hpp>
#include <fusion/init/robust_initialisation.hpp>
#include <fusion/init/window_fusion.hpp>

namespace liestat::experiments {
namespace {

const InitialisationOptions rest_options{
    .bearing_noise = vi_init_bearing_noise,
    .prior = {.gyroscope_sigma = 0.01, .accelerometer_sigma = 0.05},
    .closed_form = {.singular_values = false},
};

/// A scene without turns, measured with biases out of their priors.
struct Measured {
  ImuBias<double> bias;
  InertialScene scene;
  InertialWindow window;

  Measured(const ViInitWindow& size, SceneMotion motion, double far, double noise, CounterRng& rng)
      : bias{noise * rest_options.prior.gyroscope_sigma * rng.normalVector<3>(),
             noise * rest_options.prior.accelerometer_sigma * rng.normalVector<3>()},
        scene({.images = size.images,
               .features = size.features,
               .motion = motion,
               .turn = SceneTurn::none,
               .window = size.seconds,
               .far = far,
               .bias = bias.accelerometer},
              rng()) {
    const ImuNoise<double> simulated{.gyroscope = noise * vi_init_imu.gyroscope,
                                     .accelerometer = noise * vi_init_imu.accelerometer};
    const auto readings = readingsOf(scene, simulated, rng, bias.gyroscope);
    scene.addNoise(noise * vi_init_bearing_noise, rng);
    window = windowOf(scene, readings, {.preintegration = {.noise = vi_init_imu}});
  }
};

}  // namespace

RestOutcome restTrial(const ViInitWindow& size, double noise, CounterRng& rng) {
  const Measured measured(size, SceneMotion::stationary, 1, noise, rng);
  const RobustInitialisation found = initialiseRobustly(measured.window, rest_options);
  RestOutcome outcome;
  outcome.stationary = found.result.status == FusionStatus::stationary && found.rest;
  if (!outcome.stationary || (noise == 1 && !found.result.consistent)) return outcome;
  const RefinementResult& rest = *found.rest;
  // A velocity of zero with a variance of one takes no part.
  Eigen::Matrix<double, 12, 1> error;
  error << Eigen::Vector3d::Zero(), rest.gravity - measured.scene.gravity,
      rest.bias.gyroscope - measured.bias.gyroscope, rest.bias.accelerometer - measured.bias.accelerometer;
  Eigen::Matrix<double, 12, 12> covariance = rest.covariance.atFirst();
  covariance.topRows<3>().setZero();
  covariance.leftCols<3>().setZero();
  covariance.topLeftCorner<3, 3>().setIdentity();
  outcome.nees = neesOnSphere<11>(error, covariance, rest.gravity);
  outcome.nees_filter_start =
      neesOfFilterStart(windowStates(rest).last, true, measured.scene, measured.scene.times.back(), measured.bias, rng);
  return outcome;
}

template <int far>
SlowOutcome slowTrial(const ViInitWindow& size, double noise, CounterRng& rng) {
  const Measured measured(size, SceneMotion::constant_velocity, far, noise, rng);
  const ClosedFormResult found = initialiseRobustly(measured.window, rest_options).result;
  if (found.status != FusionStatus::stationary) return {};
  double per_depth = 0;
  for (const Eigen::Vector3d& P : measured.scene.features) {
    per_depth += measured.scene.speed(0).norm() / (P.norm() * static_cast<double>(size.features));
  }
  return {true, per_depth > found.unseen_speed_per_depth};
}
template SlowOutcome slowTrial<4>(const ViInitWindow&, double, CounterRng&);
template SlowOutcome slowTrial<20>(const ViInitWindow&, double, CounterRng&);
template SlowOutcome slowTrial<80>(const ViInitWindow&, double, CounterRng&);
template SlowOutcome slowTrial<400>(const ViInitWindow&, double, CounterRng&);

}  // namespace liestat::experiments
