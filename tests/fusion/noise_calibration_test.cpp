// The calibration of the sensor's noise: factors that are recovered with their intervals, what is not told, and what
// can't be used. `liestat validate vi-init --check noise` counts the intervals.

#include <fusion/noise_calibration.hpp>
#include <fusion/visual_inertial.hpp>
#include <support/vi_measurements.hpp>
#include <support/vi_scene.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat_test;

constexpr double pixel = 1. / 450;
const ImuNoise<double> nominal{1.7e-4, 2e-3};

/// Five images a second; the sensor is so many times as noisy as it is said to be.
struct Flight {
  Scene scene;
  std::vector<ImuSample<double>> readings;
  VisualInertialRecording recording;

  Flight(double gyroscope, double accelerometer, double seconds)
      : scene({.images = static_cast<std::size_t>(5 * seconds) + 1, .features = 25, .window = seconds}, 7) {
    CounterRng random(3);
    readings = readingsOf(scene, {gyroscope * nominal.gyroscope, accelerometer * nominal.accelerometer}, random);
    scene.addNoise(pixel, random);
    recording = {.readings = readings,
                 .noise = nominal,
                 .image_times = scene.times,
                 .cameras = scene.window.cameras,
                 .observations = {}};
    for (std::size_t i = 0; i < scene.window.features.size(); ++i) {
      for (const TrackedBearing& seen : scene.window.features[i]) {
        recording.observations.push_back({.image = seen.image, .track = i, .bearing = seen.bearing, .sigma = pixel});
      }
    }
  }
};

/// 99.99 % of an interval that is symmetrical in its logarithm.
void expectNear(const NoiseFactor& found, double factor) {
  const double sigma = std::log(found.high / found.low) / (2 * 1.96);
  EXPECT_LE(std::abs(std::log(found.factor / factor)), 3.9 * sigma) << found.low << " " << found.high;
}

TEST(NoiseCalibration, FindsTheFactorOfBoth) {
  const Flight flight(8, 8, 20);
  std::size_t last = 0, all = 0;
  const NoiseCalibration found = calibrateNoise(flight.recording, {}, [&](std::size_t done, std::size_t of) {
    EXPECT_GE(done, last);
    EXPECT_LE(done, of);
    last = done, all = of;
  });
  EXPECT_GT(last, 0u);
  EXPECT_GT(all, last / 2);
  ASSERT_EQ(found.status, FusionStatus::ok) << describe(found.fault);
  ASSERT_GE(found.meetings, 5u);
  EXPECT_EQ(found.degrees_of_freedom, 11 * found.meetings);
  EXPECT_TRUE(found.common.isTold());
  expectNear(found.common, 8);
  EXPECT_GE(found.common_p, 1e-4);
  // Densities that explain the meetings: χ² of 11 a meeting, and much more with the given ones.
  const auto dof = static_cast<double>(found.degrees_of_freedom);
  EXPECT_NEAR(found.calibrated_chi2 / dof, 1, 4 * std::sqrt(2 / dof));
  EXPECT_GE(found.chi2, 2 * found.calibrated_chi2);
  EXPECT_NEAR(std::log(found.noise.gyroscope / nominal.gyroscope), std::log(8), std::log(3));

  // With them windows agree.
  VisualInertialRecording recording = flight.recording;
  EXPECT_LT(initialiseRecording(recording, {}).stretches[0].p, 1e-6);
  recording.noise = found.noise;
  EXPECT_TRUE(initialiseRecording(recording, {}).stretches[0].ok());
  // And a second calibration has nothing to add.
  const NoiseCalibration again = calibrateNoise(recording, {});
  ASSERT_EQ(again.status, FusionStatus::ok);
  EXPECT_LE(again.common.low, 1);
  EXPECT_GE(again.common.high, 1);
}

TEST(NoiseCalibration, TellsAGyroscopeFromAnAccelerometer) {
  for (const bool gyroscope : {true, false}) {
    const Flight flight(gyroscope ? 16 : 1, gyroscope ? 1 : 16, 20);
    const NoiseCalibration found = calibrateNoise(flight.recording, {});
    ASSERT_EQ(found.status, FusionStatus::ok);
    EXPECT_LT(found.common_p, 0.05);
    const NoiseFactor& noisy = gyroscope ? found.gyroscope : found.accelerometer;
    const NoiseFactor& other = gyroscope ? found.accelerometer : found.gyroscope;
    EXPECT_TRUE(noisy.isTold());
    expectNear(noisy, 16);
    EXPECT_LT(other.high, noisy.low);
    // A factor that is not told stays as it was given.
    if (!other.isTold() && other.low <= 1 && other.high >= 1) {
      EXPECT_EQ(gyroscope ? found.noise.accelerometer : found.noise.gyroscope,
                gyroscope ? nominal.accelerometer : nominal.gyroscope);
    }
    EXPECT_DOUBLE_EQ(found.noise.gyroscope, found.gyroscope.factor * nominal.gyroscope);
    EXPECT_DOUBLE_EQ(found.noise.accelerometer, found.accelerometer.factor * nominal.accelerometer);
  }
}

TEST(NoiseCalibration, WithoutMeetingsNothingIsTold) {
  const Flight flight(4, 4, 3);
  const NoiseCalibration found = calibrateNoise(flight.recording, {.window = 2});
  EXPECT_EQ(found.status, FusionStatus::undetermined);
  EXPECT_EQ(found.meetings, 0u);
  EXPECT_EQ(found.noise.gyroscope, nominal.gyroscope);
  EXPECT_EQ(found.noise.accelerometer, nominal.accelerometer);
}

TEST(NoiseCalibration, RefusesWhatInitialiseRecordingRefuses) {
  const Flight flight(1, 1, 4);
  VisualInertialRecording recording = flight.recording;
  recording.observations[5].image = 1000;
  EXPECT_EQ(calibrateNoise(recording, {}).fault.kind, FaultKind::wrong_index);
  recording = flight.recording;
  recording.noise.gyroscope = std::numeric_limits<double>::quiet_NaN();
  const NoiseCalibration found = calibrateNoise(recording, {});
  EXPECT_TRUE(found.fault);
  EXPECT_EQ(found.status, FusionStatus::bad_input);
}

}  // namespace
