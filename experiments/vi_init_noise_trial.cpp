#include <experiments/recording.hpp>
#include <experiments/simulate_vi.hpp>
#include <experiments/vi_init_trials.hpp>
#include <fusion/noise_calibration.hpp>

#include <cstdint>
#include <span>
#include <vector>

namespace liestat::experiments {
namespace {

constexpr double recording_seconds = 20;

bool holds(const NoiseFactor& interval, double factor) { return interval.low <= factor && factor <= interval.high; }

NoiseOutcome calibrated(const ViInitWindow& window, double noise, double gyroscope, double accelerometer,
                        CounterRng& rng) {
  // A seed for each of what is drawn.
  const std::uint64_t seed = rng();
  SyntheticImuOptions sensor;
  sensor.bias = calibratedBias(seed);
  sensor.noise = {.gyroscope = noise * gyroscope * adis16448.gyroscope,
                  .accelerometer = noise * accelerometer * adis16448.accelerometer,
                  .gyroscope_walk = noise * gyroscope * adis16448.gyroscope_walk,
                  .accelerometer_walk = noise * accelerometer * adis16448.accelerometer_walk};
  ViSceneOptions scene;
  scene.image_rate = static_cast<double>(window.images - 1) / window.seconds;
  scene.features = window.features;
  scene.pixel_noise = noise;
  scene.seed = seed;
  const SimulatedRecording recording =
      simulateMotion(builtInTrajectory(recording_seconds, seed), 0, recording_seconds, defaultCamera(), sensor, scene);
  std::vector<PixelMeasurement> pixels;
  for (const PixelObservation& seen : recording.observations) {
    pixels.push_back({.image = seen.image, .track = seen.track, .pixel = {seen.u, seen.v}});
  }
  const NoiseCalibration found =
      calibrateNoise({.readings = recording.imu,
                      .noise = adis16448,
                      .image_times = recording.image_times,
                      .cameras = {recording.camera.imu_T_cam},
                      .observations = bearingsOf(pixels, std::span(&recording.camera.camera, 1), 1)},
                     {.window = window.seconds});
  if (found.status != FusionStatus::ok) return {};
  return {holds(found.gyroscope, gyroscope), holds(found.accelerometer, accelerometer), holds(found.common, gyroscope)};
}

}  // namespace

template <int gyroscope, int accelerometer>
NoiseOutcome noiseTrial(const ViInitWindow& window, double noise, CounterRng& rng) {
  return calibrated(window, noise, gyroscope, accelerometer, rng);
}

template NoiseOutcome noiseTrial<1, 1>(const ViInitWindow&, double, CounterRng&);
template NoiseOutcome noiseTrial<4, 4>(const ViInitWindow&, double, CounterRng&);
template NoiseOutcome noiseTrial<16, 16>(const ViInitWindow&, double, CounterRng&);
template NoiseOutcome noiseTrial<16, 1>(const ViInitWindow&, double, CounterRng&);
template NoiseOutcome noiseTrial<1, 16>(const ViInitWindow&, double, CounterRng&);
template NoiseOutcome noiseTrial<4, 1>(const ViInitWindow&, double, CounterRng&);
template NoiseOutcome noiseTrial<1, 4>(const ViInitWindow&, double, CounterRng&);

}  // namespace liestat::experiments
