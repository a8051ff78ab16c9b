// Fusion of windows: consistent where their covariances are, and the prior of the biases counted once.

#include <fusion/imu/window.hpp>
#include <fusion/init/closed_form.hpp>
#include <fusion/init/refinement.hpp>
#include <fusion/init/window_fusion.hpp>
#include <support/vi_measurements.hpp>
#include <support/vi_scene.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat_test;

constexpr double pixel = 1. / 450;
const ImuNoise<double> imu{1.7e-4, 2e-3};
const InitialisationOptions options{.bearing_noise = pixel,
                                    .prior = {.gyroscope_sigma = 0.01, .accelerometer_sigma = 0.05}};
using Vector11 = Eigen::Matrix<double, 11, 1>;

/// A recording of seven seconds at ten images a second, with biases out of their priors.
struct Recording {
  Scene scene;
  ImuBias<double> bias;
  std::vector<ImuSample<double>> readings;

  explicit Recording(std::uint64_t seed) : Recording(seed, CounterRng(seed, 0, 1)) {}

  Preintegration<double> motion(double from, double to, const ImuBias<double>& integrated = {}) const {
    return preintegrate<double>(readings, from, to, {.preintegration = {.noise = imu, .bias = integrated}}).motion;
  }
  /// The images from one to another.
  InertialWindow window(std::size_t first, std::size_t last) const {
    const auto time = scene.times.begin();
    InertialWindow w(readings,
                     {time + static_cast<std::ptrdiff_t>(first), time + static_cast<std::ptrdiff_t>(last) + 1},
                     {.preintegration = {.noise = imu}});
    for (const FeatureTrack& track : scene.window.features) {
      w.features.emplace_back();
      for (const TrackedBearing& seen : track) {
        if (seen.image >= first && seen.image <= last) w.features.back().push_back({seen.image - first, seen.bearing});
      }
    }
    return w;
  }
  InertialState truth(double t) const {
    const SO3d back = scene.attitude(t).inverse();
    return {S2d(Eigen::Vector3d(back * Eigen::Vector3d(0, 0, -1))), Eigen::Vector3d(back * scene.speed(t)),
            bias.gyroscope, Eigen::Vector3d(bias.accelerometer - back * Eigen::Vector3d(0, 0, -Scene::g))};
  }

 private:
  Recording(std::uint64_t seed, CounterRng random)
      : scene({.images = 71,
               .features = 20,
               .window = 7,
               .bias = options.prior.accelerometer_sigma * random.normalVector<3>()},
              seed),
        bias{options.prior.gyroscope_sigma * random.normalVector<3>(), scene.options().bias} {
    readings = readingsOf(scene, imu, random, bias.gyroscope);
    scene.addNoise(pixel, random);
  }
};

RefinementResult refined(const InertialWindow& window, std::size_t n = 3) {
  const auto start = solveClosedForm(closedFormWindow(window, {}),
                                     {.bearing_noise = pixel, .closed_form = {.singular_values = false}});
  return start.solutions.empty() ? RefinementResult{}
                                 : refine(window, start.solutions[0], {}, withSharedPrior(options, n));
}

/// All windows of two seconds, from images 0, 25 and 50 on.
struct Fused {
  WindowFusion fusion{Scene::g};
  std::vector<WindowFusion::Meeting> meetings;
  RefinementResult last;
  WindowStates states;
  double single = 0;  ///< NEES of the windows' last states, mean
  bool ok = true;

  explicit Fused(const Recording& recording, std::size_t wrong = 9) {
    double end = 0;
    for (const std::size_t k : {0, 1, 2}) {
      const InertialWindow window = recording.window(25 * k, 25 * k + 20);
      last = refined(window);
      ok = ok && last.ok();
      states = windowStates(last);
      if (k == wrong) {
        // Ten deviations of the gyroscope's bias.
        states.first.mean.get<2>().x() += 10 * std::sqrt(states.first.covariance(5, 5));
      }
      const double begin = recording.scene.times[25 * k];
      meetings.push_back(
          fusion.add(states, [&](const ImuBias<double>& bias) { return recording.motion(end, begin, bias); }));
      end = recording.scene.times[25 * k + 20];
      single += mahalanobisSquared(states.last, recording.truth(end)) / 3;
    }
  }
};

TEST(WindowFusion, OfOneWindowIsItsPosterior) {
  const Recording recording(3);
  const InertialWindow window = recording.window(0, 20);
  const RefinementResult one = refined(window, 1);
  ASSERT_TRUE(one.ok());
  WindowFusion fusion(Scene::g);
  EXPECT_FALSE(fusion.hasState());
  const WindowStates states = windowStates(one);
  const auto none = [](const ImuBias<double>&) { return Preintegration<double>(); };
  EXPECT_EQ(fusion.add(states, none).status, liestat::Status::ok);
  ASSERT_TRUE(fusion.ok());
  EXPECT_EQ(fusion.degrees_of_freedom(), 0u);
  const Gaussian<InertialState>& x = fusion.state();
  const Eigen::Matrix3d gyroscope = one.covariance.of<InitialCovariance::gyroscope_bias>(),
                        accelerometer = one.covariance.of<InitialCovariance::accelerometer_bias>();
  EXPECT_LE((x.covariance.block<3, 3>(5, 5) - gyroscope).norm(), 1e-6 * gyroscope.norm());
  EXPECT_LE((accelerometerBias(x, Scene::g).covariance - accelerometer).norm(), 1e-6 * accelerometer.norm());
  const SE23d& last = one.states.back();
  const Eigen::Vector3d down = last.so3().inverse() * one.gravity,
                        v = last.so3().inverse() * Eigen::Vector3d(last.velocity());
  EXPECT_LE(distance(S2d(down), x.mean.get<0>()), 1e-9);
  EXPECT_LE((x.mean.get<1>() - v).norm(), 1e-9);
  EXPECT_LE((x.mean.get<2>() - one.bias.gyroscope).norm(), 1e-9);
  EXPECT_LE((accelerometerBias(x.mean, Scene::g) - one.bias.accelerometer).norm(), 1e-9);
  // The last state given the first: the two parts make its covariance.
  const Eigen::Matrix<double, 11, 11> whole =
      states.by_first * states.first.covariance * states.by_first.transpose() + states.independent;
  EXPECT_LE((whole - states.last.covariance).norm(), 1e-9 * whole.norm());
  // An exact first state leaves the noise of what lies between, and the last state's own of the images.
  for (int i = 0; i < 11; ++i) {
    EXPECT_LE(states.independent(i, i), states.last.covariance(i, i) * (1 + 1e-9));
    EXPECT_GE(states.independent(i, i), -1e-9 * states.last.covariance(i, i));
  }
}

TEST(WindowFusion, CarriesTheTruthAndItsErrors) {
  for (std::uint64_t seed = 1; seed < 4; ++seed) {
    Recording recording(seed);
    CounterRng random(seed, 0, 2);
    recording.readings = readingsOf(recording.scene, {}, random, recording.bias.gyroscope);
    const Preintegration<double> motion = recording.motion(1.5, 2.5, recording.bias);
    Gaussian<InertialState> state{recording.truth(1.5), 1e-12 * Eigen::Matrix<double, 11, 11>::Identity()};
    const Gaussian<InertialState> after = carried(state, motion, Scene::g);
    // The scheme's own error: 5e-6 rad and 5e-5 m/s in a second.
    EXPECT_LE(log(after.mean, recording.truth(2.5)).norm(), 2e-3);
    // Its covariance is that of the motion and of all that is uncertain before: by differences.
    Eigen::Matrix<double, 11, 11> F;
    constexpr double h = 1e-6;
    for (int k = 0; k < 11; ++k) {
      Gaussian<InertialState> ahead = state, behind = state;
      ahead.mean = exp(state.mean, Vector11(h * Vector11::Unit(k)));
      behind.mean = exp(state.mean, Vector11(-h * Vector11::Unit(k)));
      F.col(k) = (log(after.mean, carried(ahead, motion, Scene::g).mean) -
                  log(after.mean, carried(behind, motion, Scene::g).mean)) /
                 (2 * h);
    }
    Gaussian<InertialState> certain = state, spread = state;
    certain.covariance.setZero();
    for (int i = 0; i < 11; ++i) {
      for (int j = 0; j < 11; ++j) spread.covariance(i, j) = i == j ? 1 + 0.1 * i : 0.05 * (i + j);
    }
    const Eigen::Matrix<double, 11, 11> expected =
        F * spread.covariance * F.transpose() + carried(certain, motion, Scene::g).covariance;
    EXPECT_LE((carried(spread, motion, Scene::g).covariance - expected).norm(), 1e-7 * expected.norm());
  }
}

// Three disjoint windows of two seconds with gaps of half a second.
TEST(WindowFusion, IsConsistent) {
  constexpr int trials = 100;
  double single = 0, index = 0, chi2 = 0, degrees = 0;
  double gyroscope[2] = {}, accelerometer[2] = {}, tilts[2] = {}, speeds[2] = {};
  int n = 0;
  for (int trial = 0; trial < trials; ++trial) {
    const Recording recording(500 + static_cast<std::uint64_t>(trial));
    const Fused fused(recording);
    if (!fused.ok) continue;
    ASSERT_EQ(fused.fusion.windows(), 3u);
    ++n;
    const InertialState truth = recording.truth(recording.scene.times[70]);
    single += fused.single;
    index += mahalanobisSquared(fused.fusion.state(), truth);
    chi2 += fused.fusion.chi2();
    degrees += static_cast<double>(fused.fusion.degrees_of_freedom());
    const InertialWindow last = recording.window(50, 70);
    const RefinementResult alone = refined(last, 1);
    for (const int k : {0, 1}) {
      const InertialState x = k == 0 ? windowStates(alone).last.mean : fused.fusion.state().mean;
      gyroscope[k] += (x.get<2>() - recording.bias.gyroscope).squaredNorm();
      accelerometer[k] += (accelerometerBias(x, Scene::g) - recording.bias.accelerometer).squaredNorm();
      tilts[k] += std::pow(distance(x.get<0>(), truth.get<0>()), 2);
      speeds[k] += (x.get<1>() - truth.get<1>()).squaredNorm();
    }
  }
  EXPECT_GE(n, trials - 3);
  const auto rms = [n](double sum) { return std::sqrt(sum / n); };
  std::printf(
      "  NEES of a window %.2f, of three fused %.2f, of 11; compatibility %.3f a degree of freedom\n"
      "  RMS of the last window and of all: gyroscope %.5f, %.5f rad/s; accelerometer %.4f, %.4f m/s^2; gravity "
      "%.3f, %.3f deg; speed %.4f, %.4f m/s\n",
      single / n, index / n, chi2 / degrees, rms(gyroscope[0]), rms(gyroscope[1]), rms(accelerometer[0]),
      rms(accelerometer[1]), 57.3 * rms(tilts[0]), 57.3 * rms(tilts[1]), rms(speeds[0]), rms(speeds[1]));
  // Means of χ² of 11: a standard error of √(22/n).
  EXPECT_NEAR(single / n, 11, 4 * std::sqrt(22. / n));
  EXPECT_NEAR(index / n, 11, 4 * std::sqrt(22. / n));
  // The prior, which is common to the windows, takes some off what they may differ by: at most its six degrees of 22.
  EXPECT_LE(chi2 / degrees, 1 + 4 * std::sqrt(2 / degrees));
  EXPECT_GE(chi2 / degrees, 16. / 22 - 4 * std::sqrt(2 / degrees));
  // Averaging pays.
  EXPECT_LT(gyroscope[1], 0.5 * gyroscope[0]);
  EXPECT_LT(accelerometer[1], 0.7 * accelerometer[0]);
  EXPECT_LT(tilts[1], 0.7 * tilts[0]);
  EXPECT_LT(speeds[1], speeds[0]);
}

// A window that is wrong is seen where it meets the others.
TEST(WindowFusion, SeesAContradiction) {
  const Recording recording(41);
  const double limit = 11 + 5 * std::sqrt(22.);
  const Fused right(recording);
  ASSERT_TRUE(right.ok);
  EXPECT_EQ(right.meetings[0].degrees_of_freedom, 0);
  EXPECT_EQ(right.meetings[1].degrees_of_freedom, ManifoldTraits<InertialState>::DoF);
  EXPECT_EQ(right.fusion.degrees_of_freedom(), 2U * 11);
  EXPECT_LT(right.meetings[1].chi2, limit);
  EXPECT_LT(right.meetings[2].chi2, limit);
  const Fused wrong(recording, 1);
  EXPECT_GT(wrong.meetings[1].chi2, limit);
  EXPECT_GT(wrong.fusion.inflation(), 1);
}

TEST(WindowFusion, LeavesOutWhatHasNoCovariance) {
  EXPECT_FALSE(windowStates({}).ok());
  WindowFusion fusion(Scene::g);
  const auto none = [](const ImuBias<double>&) { return Preintegration<double>(); };
  EXPECT_EQ(fusion.add(windowStates({}), none).status, liestat::Status::ill_defined);
  EXPECT_FALSE(fusion.ok());
  EXPECT_EQ(fusion.inflation(), 1);
}

}  // namespace
