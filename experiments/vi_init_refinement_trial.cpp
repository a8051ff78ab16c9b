#include <stats/quantile.hpp>
#include <experiments/vi_init_errors.hpp>
#include <experiments/vi_init_trials.hpp>
#include <fusion/init/closed_form.hpp>
#include <fusion/init/refinement.hpp>
#include <fusion/init/window_fusion.hpp>
#include <experiments/scene_readings.hpp>
#include <lie/se23.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace liestat::experiments {
namespace {

/// The median of the features' distances over the true ones, away from 1, in percent.
double scaleOfFeatures(const std::vector<Eigen::Vector3d>& found, const InertialScene& scene) {
  std::vector<double> ratio;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (found[i].allFinite()) ratio.push_back(found[i].norm() / scene.features[i].norm());
  }
  if (ratio.empty()) return std::numeric_limits<double>::infinity();
  return 100 * std::abs(quantile(std::move(ratio), 0.5) - 1);
}

/// The biases to which a random walk has come at a time.
ImuBias<double> biasAt(const std::vector<ImuBias<double>>& walked, const std::vector<ImuSample<double>>& readings,
                       double time) {
  const auto next = std::find_if(readings.begin(), readings.end() - 1, [&](const auto& s) { return s.time >= time; });
  return walked[static_cast<std::size_t>(next - readings.begin())];
}

RefinementOutcome trial(const ViInitWindow& size, double noise, const ImuNoise<double>& sensor, CounterRng& rng) {
  const InitialisationOptions options{.bearing_noise = vi_init_bearing_noise,
                                      .prior = {.gyroscope_sigma = 0.01, .accelerometer_sigma = 0.05}};
  const std::uint64_t seed = rng();
  const Eigen::Vector3d accelerometer = noise * options.prior.accelerometer_sigma * rng.normalVector<3>();
  const Eigen::Vector3d gyroscope = noise * options.prior.gyroscope_sigma * rng.normalVector<3>();
  InertialScene scene({.images = size.images, .features = size.features, .window = size.seconds, .bias = accelerometer},
                      seed);
  const ImuNoise<double> simulated{.gyroscope = noise * sensor.gyroscope,
                                   .accelerometer = noise * sensor.accelerometer,
                                   .gyroscope_walk = noise * sensor.gyroscope_walk,
                                   .accelerometer_walk = noise * sensor.accelerometer_walk};
  auto readings = readingsOf(scene, simulated, rng, gyroscope);
  scene.addNoise(noise * vi_init_bearing_noise, rng);
  ImuBias<double> walked;  // to the last image
  if (sensor.gyroscope_walk > 0) walked = biasAt(addWalk(readings, simulated, rng), readings, scene.times.back());
  const InertialWindow window = windowOf(scene, readings, {.preintegration = {.noise = sensor}});

  const auto start = solveClosedForm(closedFormWindow(window, {}), {.bearing_noise = vi_init_bearing_noise,
                                                                    .closed_form = {.singular_values = false}});
  if (start.solutions.empty()) return {};
  const RefinementResult r = refine(window, start.solutions[0], {}, options);
  // A window that a user would throw away for its χ² is left out only where the noise is the one that the estimator was
  // told: else this would hide the distances.
  if (r.status != FusionStatus::ok || (noise == 1 && !r.ok())) return {};

  Eigen::Matrix<double, 12, 1> error;
  error << r.velocity() - scene.velocity, r.gravity - scene.gravity, r.bias.gyroscope - gyroscope,
      r.bias.accelerometer - accelerometer;
  const SO3d body_R_world = scene.attitude(0).inverse();
  const double end = scene.times.back();
  const SE23d last(body_R_world * scene.attitude(end),
                   Eigen::Vector3d(body_R_world * (scene.position(end) - scene.position(0))),
                   Eigen::Vector3d(body_R_world * scene.speed(end)));
  const Eigen::Matrix<double, 9, 1> last_error = (last.inverse() * r.states.back()).log();
  const Eigen::Matrix<double, 9, 9> last_covariance = r.covariance.atLast().topLeftCorner<9, 9>();
  Eigen::Matrix<double, 18, 1> at_last;
  at_last << last_error.tail<3>(), r.gravity - scene.gravity, last_error.head<6>(),
      r.last_bias.gyroscope - gyroscope - walked.gyroscope,
      r.last_bias.accelerometer - accelerometer - walked.accelerometer;
  using Block = InitialCovariance::Block;
  const Eigen::Matrix<double, 18, 18> covariance_at_last =
      r.covariance.of<Block::last_velocity, Block::gravity, Block::last_position, Block::last_rotation,
                      Block::last_gyroscope_bias, Block::last_accelerometer_bias>();
  return {
      .nees_v = mahalanobisSquared<double, 3>(Eigen::Vector3d(error.head<3>()),
                                              r.covariance.of<InitialCovariance::first_velocity>()),
      .nees_v_g = neesOnSphere<5>(Eigen::Matrix<double, 6, 1>(error.head<6>()), r.covariance.atFirst(), r.gravity),
      .nees_all = neesOnSphere<11>(error, r.covariance.atFirst(), r.gravity),
      .nees_last_state = mahalanobisSquared<double, 9>(last_error, last_covariance),
      .nees_at_last = neesOnSphere<17>(at_last, covariance_at_last, r.gravity),
      .nees_filter_start = neesOfFilterStart(windowStates(r).last, false, scene, end,
                                             {gyroscope + walked.gyroscope, accelerometer + walked.accelerometer}, rng),
      .chi2 = {r.cost, static_cast<double>(r.degrees_of_freedom)},
      .errors = viErrors(r.velocity(), r.gravity, scene),
      .scale_of_features = scaleOfFeatures(r.features, scene)};
}

}  // namespace

RefinementOutcome refinementTrial(const ViInitWindow& window, double noise, CounterRng& rng) {
  return trial(window, noise, vi_init_imu, rng);
}

RefinementOutcome walkTrial(const ViInitWindow& window, double noise, CounterRng& rng) {
  return trial(window, noise, vi_init_walking_imu, rng);
}

}  // namespace liestat::experiments
