// The calibration of the sensor's noise: factors that are recovered with their intervals, what is not told, and what
// can't be used. `liestat validate vi-init --check noise` counts the intervals.

#include <fusion/noise_calibration.hpp>
#include <fusion/visual_inertial.hpp>
#include <fusion/visual_inertial_truth.hpp>
#include <support/vi_measurements.hpp>
#include <support/vi_scene.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
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

  EXPECT_EQ(found.evidence, NoiseEvidence::calibrated);

  // With them windows agree, which initialiseRecording() finds out by itself.
  VisualInertialRecording recording = flight.recording;
  EXPECT_LT(initialiseRecording(recording, {.calibrate_noise = false}).stretches[0].p, 1e-6);
  const VisualInertialResult by_itself = initialiseRecording(recording, {});
  ASSERT_TRUE(by_itself.noise_calibration.has_value());
  EXPECT_EQ(by_itself.noise_calibration->evidence, NoiseEvidence::calibrated);
  EXPECT_EQ(by_itself.noise_calibration->noise.gyroscope, found.noise.gyroscope);
  EXPECT_TRUE(by_itself.stretches[0].ok());
  // It is that of windows that were estimated with these densities from the beginning: iterated to the same minimum from
  // elsewhere until a step lowers the cost by less than 1e-3, which leaves some hundredths of a standard deviation.
  recording.noise = found.noise;
  const VisualInertialResult afresh = initialiseRecording(recording, {.calibrate_noise = false});
  EXPECT_TRUE(afresh.stretches[0].ok());
  ASSERT_EQ(afresh.windows.size(), by_itself.windows.size());
  for (std::size_t i = 0; i < afresh.windows.size(); ++i) {
    ASSERT_TRUE(afresh.windows[i].isRefined() && by_itself.windows[i].isRefined());
    const RefinementResult &a = *afresh.windows[i].refined, &b = *by_itself.windows[i].refined;
    const double sigma = std::sqrt(a.covariance.of<InitialCovariance::first_velocity>().trace());
    EXPECT_LE((a.velocity() - b.velocity()).norm(), 0.15 * sigma) << i;
    EXPECT_NEAR(b.covariance.of<InitialCovariance::first_velocity>().trace(), sigma * sigma, 0.02 * sigma * sigma) << i;
  }
  // And a second calibration has nothing to add: it keeps what it was given.
  const NoiseCalibration again = calibrateNoise(recording, {});
  ASSERT_EQ(again.status, FusionStatus::ok);
  EXPECT_LE(again.common.low, 1);
  EXPECT_GE(again.common.high, 1);
  EXPECT_EQ(again.evidence, NoiseEvidence::confirmed);
  EXPECT_EQ(again.noise.gyroscope, recording.noise.gyroscope);
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
  EXPECT_EQ(found.evidence, NoiseEvidence::unverified_noise);
  EXPECT_EQ(found.noise.gyroscope, nominal.gyroscope);
  EXPECT_EQ(found.noise.accelerometer, nominal.accelerometer);
}

// One meeting refutes densities that are a hundred times too small, but does not tell the factor: the most likely one is
// used, and said to be no more than that.
TEST(NoiseCalibration, OneMeetingVerifiesNothing) {
  for (const double factor : {1., 100.}) {
    const Flight flight(factor, factor, 5);
    const VisualInertialResult result = initialiseRecording(flight.recording, {.stride = 2.4});
    ASSERT_TRUE(result.noise_calibration.has_value());
    const NoiseCalibration& found = *result.noise_calibration;
    ASSERT_EQ(found.meetings, 1u);
    EXPECT_EQ(found.evidence, NoiseEvidence::unverified_noise);
    if (factor == 1) {
      EXPECT_EQ(found.noise.gyroscope, nominal.gyroscope);
    } else {
      // Eleven degrees of freedom tell a common factor to a fifth; five times that.
      EXPECT_NEAR(std::log(found.common.factor), std::log(factor), std::log(2.5));
      EXPECT_LT(found.calibrated_chi2, 40);
    }
    const ComparedRecording compared = compareWithTruth(result, flight.scene.times, {}, 9.81);
    if (compared.okWindows() == 0) continue;
    ASSERT_EQ(compared.notes().size(), 1u);
    EXPECT_EQ(compared.notes()[0].find("unverified_noise: "), 0u) << compared.notes()[0];
  }
}

// Nothing to test where biases are given, nothing was refined, or no stretch is wanted.
TEST(NoiseCalibration, IsLeftOutWhereNothingCanMeet) {
  const Flight flight(1, 1, 4.5);
  EXPECT_FALSE(initialiseRecording(flight.recording, {.refinement = false}).noise_calibration.has_value());
  EXPECT_FALSE(initialiseRecording(flight.recording, {.stretch = 0}).noise_calibration.has_value());
  VisualInertialOptions options;
  options.known_bias = [](double) { return std::optional(ImuBias<double>{}); };
  EXPECT_FALSE(initialiseRecording(flight.recording, options).noise_calibration.has_value());
  options = {};
  std::size_t asked = 0;
  options.stop = [&] { return ++asked > 2; };  // the windows are estimated, the calibration is not
  const VisualInertialResult stopped = initialiseRecording(flight.recording, options);
  EXPECT_EQ(stopped.windows_left, 0u);
  ASSERT_TRUE(stopped.noise_calibration.has_value());
  EXPECT_EQ(stopped.noise_calibration->evidence, NoiseEvidence::unverified_noise);
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
