// Windows of a recording against a truth: the verdict is yes for noise that is as it was said, no for planted faults,
// none where nothing can be tested.

#include <fusion/imu/factor.hpp>
#include <fusion/imu/recording_windows.hpp>
#include <report/describe.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

namespace {

using namespace liestat;
using Vector3 = Eigen::Vector3d;
using Answer = Verdict::Answer;

constexpr ImuNoise<double> noise{.gyroscope = 2e-3, .accelerometer = 2e-2};
constexpr double step = 0.005;  // s
const Vector3 gravity(0, 0, -9.81);

/// A motion of piecewise constant rate and force, which `held` integrates exactly, and its noisy readings.
struct Recording {
  std::vector<ImuSample<double>> readings;
  std::vector<GroundTruth> truth;
  RecordingWindowOptions options;

  explicit Recording(std::size_t seconds, unsigned seed = 1) {
    options.integration.scheme = ImuScheme::held;
    options.integration.preintegration.noise = noise;
    const ImuBias<double> bias{Vector3(0.01, -0.02, 0.03), Vector3(0.1, 0.2, -0.1)};
    std::mt19937 generator(seed);
    std::normal_distribution<double> normal;
    const auto vector = [&](double sigma) {
      const double x = sigma * normal(generator), y = sigma * normal(generator), z = sigma * normal(generator);
      return Vector3(x, y, z);
    };
    SE23d state;
    for (std::size_t i = 0; i <= 200 * seconds; ++i) {
      const double t = static_cast<double>(i) * step;
      const Vector3 rate(std::sin(t), 0.5 * std::cos(2 * t), 0.7), force(std::cos(t), std::sin(3 * t), 9.8);
      truth.push_back({t, state, bias});
      readings.push_back({t, rate + bias.gyroscope + vector(noise.gyroscope / std::sqrt(step)),
                          force + bias.accelerometer + vector(noise.accelerometer / std::sqrt(step))});
      Preintegration<double> exact;
      exact.add(step, rate, force);
      const SE23d d = exact.increment();
      const SO3d R = state.so3();
      const Vector3 p = state.translation(), v = state.velocity();
      state = SE23d(SO3d(R * SO3d(d.so3())),
                    Vector3(p + step * v + 0.5 * step * step * gravity + R * Vector3(d.translation())),
                    Vector3(v + step * gravity + R * Vector3(d.velocity())));
    }
  }
  RecordingWindows windows(double length = 1) const {
    return preintegrateWindows(readings, consecutiveWindows(0, readings.back().time, length), truth, options);
  }
};

bool mentions(const Verdict& verdict, const std::string& word) {
  for (const std::string& cause : verdict.causes) {
    if (cause.find(word) != std::string::npos) return true;
  }
  return false;
}

TEST(RecordingWindows, ErrorsOfTheSaidNoiseAreConsistent) {
  const Recording recording(100);
  const RecordingWindows result = recording.windows();
  ASSERT_EQ(result.windows.size(), 100U);
  const auto test = result.test();
  ASSERT_TRUE(test.has_value());
  EXPECT_EQ(test->windows, 100U);
  EXPECT_EQ(test->degrees_of_freedom, 900);
  // 4 standard errors of χ² with 900 degrees of freedom.
  EXPECT_NEAR(test->ratio(), 1, 4 * std::sqrt(2. / 900));
  const Verdict verdict = result.verdict();
  EXPECT_EQ(verdict, Answer::yes) << verdict.text;
  EXPECT_EQ(verdict.text.rfind("consistent", 0), 0U) << verdict.text;
  EXPECT_TRUE(verdict.causes.empty());
  EXPECT_TRUE(result.usable());
}

// The probability of p below a level is that level: the sum of all windows is judged, at the level that was asked for.
TEST(RecordingWindows, TheLevelIsTheProbabilityOfAFalseAlarm) {
  std::size_t alarms = 0;
  constexpr std::size_t trials = 200;
  constexpr double level = 0.2;
  for (unsigned seed = 1; seed <= trials; ++seed) alarms += Recording(2, seed).windows(0.5).verdict(level).isNo();
  // 4 standard errors of 200 trials.
  EXPECT_NEAR(static_cast<double>(alarms) / trials, level, 4 * std::sqrt(level * (1 - level) / trials));
}

TEST(RecordingWindows, PlantedFaultsAreInconsistent) {
  Recording small(20);
  small.options.integration.preintegration.noise = {noise.gyroscope / 2, noise.accelerometer / 2};
  Verdict verdict = small.windows().verdict();
  EXPECT_EQ(verdict, Answer::no) << verdict.text;
  EXPECT_EQ(verdict.text.rfind("INCONSISTENT with the truth", 0), 0U) << verdict.text;
  EXPECT_TRUE(mentions(verdict, "gyroscope") && mentions(verdict, "accelerometer"));
  EXPECT_FALSE(small.windows().usable());

  Recording biased(20);
  biased.options.bias =
      ImuBias<double>{biased.truth[0].bias.gyroscope + Vector3(0.02, 0, 0), biased.truth[0].bias.accelerometer};
  verdict = biased.windows().verdict();
  EXPECT_EQ(verdict, Answer::no) << verdict.text;
  EXPECT_TRUE(mentions(verdict, "rotation: squared distance"));

  Recording heavy(20);
  heavy.options.gravity = 9.9;
  verdict = heavy.windows().verdict();
  EXPECT_EQ(verdict, Answer::no) << verdict.text;
  EXPECT_TRUE(mentions(verdict, "velocity: squared distance"));
  EXPECT_FALSE(mentions(verdict, "rotation: squared distance"));

  Recording hit(20);  // one window alone
  for (std::size_t i = 1010; i < 1020; ++i) hit.readings[i].specific_force.x() += 30;
  verdict = hit.windows().verdict();
  EXPECT_EQ(verdict, Answer::no) << verdict.text;
  EXPECT_TRUE(mentions(verdict, "1 of 20 windows alone, the first from 5 s"));
}

TEST(RecordingWindows, WhatIsNotTestedHasNoVerdict) {
  const auto reason = [](const RecordingWindows& result, bool usable) {
    const Verdict verdict = result.verdict();
    EXPECT_EQ(verdict, Answer::none);
    EXPECT_EQ(result.usable(), usable);
    EXPECT_FALSE(verdict.decided().has_value());
    return verdict.text;
  };
  Recording recording(4);
  Recording without_truth = recording;
  without_truth.truth.clear();
  EXPECT_EQ(reason(without_truth.windows(), true), "no verdict: there is no truth to compare with");
  Recording without_noise = recording;
  without_noise.options.integration.preintegration.noise = {};
  const RecordingWindows exact = without_noise.windows();
  EXPECT_EQ(reason(exact, true), "no verdict: the sensor's noise is not known, so there are no covariances");
  EXPECT_TRUE(exact.windows[0].error.has_value());
  EXPECT_FALSE(exact.windows[0].squared_distance.has_value());
  Recording elsewhere = recording;
  for (GroundTruth& truth : elsewhere.truth) truth.time += 100;
  EXPECT_EQ(reason(elsewhere.windows(), true), "no verdict: no window with an increment is covered by the truth");
  Recording broken = recording;
  for (auto& reading : broken.readings) reading.angular_rate.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(reason(broken.windows(), false), "no verdict: no window has an increment, as the readings have faults");
  EXPECT_EQ(reason(RecordingWindows{}, false).rfind("no verdict", 0), 0U);
  // The verdict is on the windows that were compared.
  Recording gap = recording;
  gap.readings.erase(gap.readings.begin() + 300, gap.readings.begin() + 330);
  const RecordingWindows some = gap.windows();
  EXPECT_EQ(some.okWindows(), 3U);
  EXPECT_EQ(some.windows[1].status(), std::string("gap"));
  EXPECT_NEAR(some.windows[1].time_before_fault.value_or(0), 1.495, 1e-12);
  EXPECT_NEAR(some.windows[1].fault_time.value_or(0), 1.65, 1e-12);
  EXPECT_EQ(some.verdict(), Answer::yes);
  // The outcome is that of all windows.
  EXPECT_EQ(some.outcome(), Answer::no);
  EXPECT_EQ(some.outcome().text.rfind("INCOMPLETE: 1 of 4 windows", 0), 0U) << some.outcome().text;
  EXPECT_EQ(recording.windows().outcome(), Answer::yes);
  EXPECT_EQ(without_truth.windows().outcome(), Answer::yes);
  EXPECT_EQ(broken.windows().outcome().text.rfind("NOT TO BE TRUSTED", 0), 0U);
}

TEST(RecordingWindows, AreWholeOnes) {
  EXPECT_EQ(consecutiveWindows(0, 1).size(), 1U);
  const auto thirds = consecutiveWindows(0, 1, 1. / 3);
  ASSERT_EQ(thirds.size(), 3U) << "rounding";
  EXPECT_EQ(thirds[2].begin, 2 * (1. / 3));
  EXPECT_EQ(consecutiveWindows(2, 4.9, 1).size(), 2U);
  for (const double length : {3., 0., -1., 1e-9, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_TRUE(consecutiveWindows(0, 2, length).empty()) << length;
  }
  EXPECT_TRUE(consecutiveWindows(2, 2).empty());
  EXPECT_TRUE(consecutiveWindows(0, std::numeric_limits<double>::infinity()).empty());
}

TEST(RecordingWindows, SigmasGrowToThoseOfTheWindow) {
  const Recording recording(2);
  const RecordingWindow window = recording.windows(2).windows[0];
  const auto growth = growthOfSigmas(recording.readings, window, recording.options.integration, 10);
  ASSERT_EQ(growth.size(), 10U);
  const IncrementSigmas all = incrementSigmas(window.result.motion);
  EXPECT_NEAR(growth.back().rotation, all.rotation, 1e-9 * all.rotation);
  for (std::size_t i = 1; i < growth.size(); ++i) EXPECT_GT(growth[i].position, growth[i - 1].position);
}

TEST(GroundTruth, IsInterpolatedBetweenItsRows) {
  std::vector<GroundTruth> truth(3);
  for (std::size_t i = 0; i < 3; ++i) {
    const double t = i == 2 ? 0.25 : 0.1 * static_cast<double>(i);
    truth[i] = {t, SE23d(SO3d::exp(Vector3(0, 0, t)), Vector3(t, 0, 0), Vector3(1, 0, 0)), {}};
  }
  const auto middle = truthAt(truth, 0.05);
  ASSERT_TRUE(middle.has_value());
  EXPECT_NEAR(middle->state.so3().log().z(), 0.05, 1e-15);
  EXPECT_NEAR(middle->state.translation().x(), 0.05, 1e-15);
  EXPECT_TRUE(truthAt(truth, 0.25).has_value()) << "a row itself";
  EXPECT_FALSE(truthAt(truth, 0.2).has_value()) << "rows 0.15 s apart";
  EXPECT_FALSE(truthAt(truth, -0.01).has_value());
  EXPECT_FALSE(truthAt(truth, 0.26).has_value());
  EXPECT_FALSE(truthAt({}, 0).has_value());
}

}  // namespace
