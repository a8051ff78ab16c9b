// The front door: a recording in, windows and what they say together out; several cameras; what can't be used.

#include <fusion/init/closed_form.hpp>
#include <fusion/visual_inertial.hpp>
#include <fusion/visual_inertial_truth.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/quantile.hpp>
#include <support/vi_measurements.hpp>
#include <support/vi_scene.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat_test;

constexpr double pixel = 1. / 450;
const ImuNoise<double> imu{1.7e-4, 2e-3};

/// Seven seconds at ten images a second.
struct Flight {
  ImuBias<double> bias{{0.02, -0.01, 0.015}, {0.05, -0.04, 0.03}};
  Scene scene{{.images = 71, .features = 25, .window = 7, .bias = bias.accelerometer}, 7};
  std::vector<ImuSample<double>> readings;
  VisualInertialRecording recording;

  Flight() {
    CounterRng random(3);
    readings = readingsOf(scene, imu, random, bias.gyroscope);
    scene.addNoise(pixel, random);
    recording = {.readings = readings,
                 .noise = imu,
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

TEST(VisualInertial, InitialisesARecording) {
  const Flight flight;
  std::size_t progress = 0;
  // The times of the images jitter by 0.02 s: three windows of two seconds need some room in seven.
  const VisualInertialOptions options{.stride = 2.2};
  const auto result = initialiseRecording(flight.recording, options, [&](std::size_t done, std::size_t all) {
    if (done < all) ++progress;  // and then, once more for each pass of the calibration of noise
  });
  EXPECT_FALSE(result.fault) << describe(result.fault);
  ASSERT_EQ(result.windows.size(), 3u);
  EXPECT_EQ(progress, 3u);
  EXPECT_NEAR(result.bearing_noise, pixel, 1e-15);
  for (const InitialisedWindow& w : result.windows) {
    EXPECT_TRUE(w.ok()) << describe(w.verdict());
    ASSERT_TRUE(w.isRefined());
    const SO3d back = flight.scene.attitude(w.begin).inverse();
    // Far beyond the standard deviations of a window of two seconds (0.02 m/s, 0.3 deg).
    EXPECT_LE((w.refined->velocity() - back * flight.scene.speed(w.begin)).norm(), 0.15);
    EXPECT_LE((w.refined->gravity - back * Eigen::Vector3d(0, 0, -Scene::g)).norm(), 0.3);
    EXPECT_EQ(w.states().size(), w.images.size());
    // A window is integrated with the gyroscope's bias that it found.
    EXPECT_EQ(w.measured.bias().gyroscope, w.found.gyroscope_bias);
  }
  ASSERT_EQ(result.stretches.size(), 1u);
  const FusedStretch& all = result.stretches[0];
  ASSERT_TRUE(all.has_state);
  EXPECT_EQ(all.windows.size(), 3u);
  EXPECT_EQ(all.degrees_of_freedom, 22u);
  EXPECT_LE(all.chi2, 22 + 5 * std::sqrt(44.));
  EXPECT_LE((all.state.mean.get<2>() - flight.bias.gyroscope).norm(), 0.003);
  // The same seed gives the same result.
  const auto again = initialiseRecording(flight.recording, options);
  EXPECT_EQ(again.windows[1].refined->cost, result.windows[1].refined->cost);
  EXPECT_EQ(again.stretches[0].chi2, all.chi2);
}

TEST(VisualInertial, StopsBetweenWindows) {
  const Flight flight;
  VisualInertialOptions options{.stride = 2.2, .stretch = 0};
  const auto all = initialiseRecording(flight.recording, options);
  ASSERT_EQ(all.windows.size(), 3u);
  EXPECT_EQ(all.windows_left, 0u);
  for (const std::size_t most : {0u, 1u, 2u}) {
    std::size_t asked = 0;
    options.stop = [&] { return asked++ >= most; };
    const auto part = initialiseRecording(flight.recording, options);
    EXPECT_FALSE(part.fault);
    ASSERT_EQ(part.windows.size(), most);
    EXPECT_EQ(part.windows_left, 3 - most);
    for (std::size_t i = 0; i < most; ++i) EXPECT_EQ(part.windows[i].refined->cost, all.windows[i].refined->cost);
  }
}

TEST(VisualInertial, KnownBiasesAreNotEstimated) {
  const Flight flight;
  VisualInertialOptions options{.window = 2, .end = 2.05};
  options.known_bias = [&](double) { return std::optional(flight.bias); };
  const auto result = initialiseRecording(flight.recording, options);
  ASSERT_EQ(result.windows.size(), 1u);
  EXPECT_TRUE(result.windows[0].ok());
  EXPECT_TRUE(result.windows[0].known_biases);
  EXPECT_LE((result.windows[0].bias().gyroscope - flight.bias.gyroscope).norm(), 1e-5);
}

TEST(VisualInertial, SaysWhatCannotBeUsed) {
  Flight flight;
  VisualInertialRecording bad = flight.recording;
  bad.observations[5].image = 200;
  EXPECT_EQ(initialiseRecording(bad, {}).fault, Fault(FaultKind::wrong_index, 5));
  bad = flight.recording;
  bad.observations[9].camera = 1;
  EXPECT_EQ(initialiseRecording(bad, {}).fault, Fault(FaultKind::wrong_index, 9));
  bad = flight.recording;
  bad.noise = {};
  EXPECT_EQ(initialiseRecording(bad, {}).fault, FaultKind::bad_option);
  bad = flight.recording;
  std::swap(bad.image_times[3], bad.image_times[4]);
  EXPECT_EQ(initialiseRecording(bad, {}).fault, FaultKind::bad_option);
  EXPECT_EQ(initialiseRecording(flight.recording, {.window = 30}).fault, FaultKind::too_few_images);
  EXPECT_EQ(initialiseRecording(flight.recording, {.stride = 0.1, .max_windows = 10}).fault, FaultKind::bad_option);
  EXPECT_EQ(initialiseRecording({}, {}).fault, FaultKind::bad_option);
  // A gap in the readings is the window's.
  flight.readings.erase(flight.readings.begin() + 500, flight.readings.begin() + 540);
  bad = flight.recording;
  bad.readings = flight.readings;
  const auto gap = initialiseRecording(bad, {});
  EXPECT_FALSE(gap.fault);
  ASSERT_EQ(gap.windows.size(), 3u);
  EXPECT_TRUE(gap.windows[0].ok());
  EXPECT_EQ(gap.windows[1].verdict(), FusionStatus::gap);
  EXPECT_EQ(gap.windows[1].fault, Fault(FaultKind::gap, 500));
  EXPECT_NEAR(gap.windows[1].fault_time, 2.7, 1e-9);
  // Bearings at times of their own are for later.
  bad = flight.recording;
  for (BearingMeasurement& seen : bad.observations) seen.time = bad.image_times[seen.image] + 0.01;
  EXPECT_EQ(initialiseRecording(bad, {.end = 2.05}).windows.at(0).found.result.fault, FaultKind::bearing_time);
}

// Two cameras that look elsewhere from other places: exact bearings give the exact motion, features that only one of
// them sees included.
TEST(SeveralCameras, SolveTheClosedForm) {
  for (std::uint64_t seed = 1; seed < 6; ++seed) {
    const Scene scene({.images = 8, .features = 8}, seed);
    ClosedFormWindow window = scene.window;
    window.cameras = {SE3d(SO3d::exp(Eigen::Vector3d(0.1, -0.2, 0.3)), Eigen::Vector3d(0.1, 0, 0.05)),
                      SE3d(SO3d::exp(Eigen::Vector3d(-0.3, 0.1, 1)), Eigen::Vector3d(-0.1, 0.2, 0))};
    for (std::size_t i = 0; i < window.features.size(); ++i) {
      FeatureTrack track;
      for (const TrackedBearing& seen : window.features[i]) {
        const double t = window.images[seen.image].time;
        const Eigen::Vector3d moved =
            scene.attitude(0).inverse() * Eigen::Vector3d(scene.position(t) - scene.position(0));
        const Eigen::Vector3d d =
            window.images[seen.image].rotation.transpose() * Eigen::Vector3d(scene.features[i] - moved);
        for (std::size_t c = 0; c < 2; ++c) {
          if (i % 3 == c) continue;
          const Eigen::Vector3d bearing = window.cameras[c].inverse() * d;
          track.push_back({.image = seen.image, .bearing = bearing, .camera = c, .time = t});
        }
      }
      window.features[i] = track;
    }
    const auto result = solveClosedForm(window);
    ASSERT_EQ(result.status, FusionStatus::ok) << seed;
    EXPECT_LE((result.solutions[0].velocity - scene.velocity).norm(), 1e-8) << seed;
    EXPECT_LE((result.solutions[0].gravity - scene.gravity).norm(), 1e-8) << seed;
    EXPECT_EQ(result.images_used, 8u);
    window.features[2][0].camera = 2;
    EXPECT_EQ(solveClosedForm(window).fault, Fault(FaultKind::wrong_index, 2));
  }
}

ComparedWindow okWindow() {
  ComparedWindow w;
  w.tracks = {0};
  w.found.result.status = FusionStatus::ok;
  w.found.result.consistent = true;
  w.found.inliers = {0};
  return w;
}

TEST(VisualInertialVerdict, OneWindowIsOkAndNoStretchContradictsAll) {
  ComparedRecording r;
  const auto text = [&](Verdict::Answer answer) {
    EXPECT_EQ(r.verdict(), answer) << r.verdict().text;
    return r.verdict().text;
  };
  EXPECT_EQ(text(Verdict::Answer::no), "Not to be trusted: none of 0 windows is ok.");
  r.windows.resize(2);
  EXPECT_EQ(text(Verdict::Answer::no), "Not to be trusted: none of 2 windows is ok.");
  r.windows[1] = okWindow();
  // No stretches, and stretches of a single window, are not tested and have not passed.
  const auto untested = [&] { return text(Verdict::Answer::no).find("Not tested: 1 of 2 windows are ok, but") == 0; };
  EXPECT_TRUE(untested());
  r.stretches.resize(2);
  for (ComparedStretch& f : r.stretches) f.has_state = true;
  EXPECT_TRUE(untested());
  EXPECT_FALSE(r.stretches[0].ok());
  EXPECT_STREQ(r.stretches[0].word(), "untested");
  // Stretches that contradict each other: p below the bound.
  for (ComparedStretch& f : r.stretches) f.degrees_of_freedom = 11, f.p = 1e-6;
  EXPECT_STREQ(r.stretches[0].word(), "inconsistent");
  EXPECT_EQ(text(Verdict::Answer::no), "Not to be trusted: the windows contradict each other in every stretch.");
  r.stretches[1].inflated = true;
  EXPECT_EQ(text(Verdict::Answer::yes), "1 of 2 windows are ok.");
  r.windows_left = 3;
  EXPECT_EQ(text(Verdict::Answer::no), "Interrupted: 2 of 5 windows.");
}

/// Windows that are ok and a stretch of them, with these NEES.
ComparedRecording withNees(std::size_t n, double window, double stretch) {
  ComparedRecording r;
  r.windows.assign(n, okWindow());
  for (std::size_t i = 0; i < n; ++i) {
    r.windows[i].begin = static_cast<double>(i);
    r.windows[i].nees = window, r.windows[i].velocity_nees = window - 2, r.windows[i].gravity_nees = 2;
  }
  r.stretches.resize(1);
  r.stretches[0].has_state = true, r.stretches[0].degrees_of_freedom = 11, r.stretches[0].nees = stretch;
  return r;
}

TEST(VisualInertialVerdict, ErrorsAgainstTheTruthAreJudged) {
  const ComparedRecording fine = withNees(20, 6, 14);
  EXPECT_TRUE(fine.againstTruth().isYes()) << fine.againstTruth().text;
  EXPECT_TRUE(fine.verdict().isYes());
  EXPECT_EQ(fine.windowTest().n, 20U);
  EXPECT_DOUBLE_EQ(fine.windowTest().nees, 6);
  // Windows share their biases: a mean of 25 may be the misfortune of a single draw, one of 60 is none.
  EXPECT_TRUE(withNees(20, 25, 14).againstTruth().isYes());
  const ComparedRecording off = withNees(20, 60, 14);
  const Verdict errors = off.againstTruth();
  EXPECT_TRUE(errors.isNo()) << errors.text;
  EXPECT_EQ(errors.text.find("INCONSISTENT with the truth: 20 windows: NEES 60 in the mean, 5 expected (p "), 0U);
  ASSERT_EQ(errors.causes.size(), 1U) << "gravity and the stretch are fine, and the windows are not a few";
  EXPECT_EQ(errors.causes[0].find("velocity of windows: NEES 58 in the mean, 3 expected"), 0U) << errors.causes[0];
  EXPECT_TRUE(off.verdict().isNo());
  EXPECT_EQ(off.verdict().text, "Not to be trusted: 20 of 20 windows are ok, but " + errors.text + ".");
  EXPECT_EQ(off.verdict().causes, errors.causes);
  const Verdict stretch = withNees(20, 5, 90).againstTruth();
  EXPECT_TRUE(stretch.isNo());
  ASSERT_EQ(stretch.causes.size(), 1U);
  EXPECT_EQ(stretch.causes[0].find("states of stretches: NEES 90, 11 expected"), 0U) << stretch.causes[0];
  // One window of twenty.
  ComparedRecording one = withNees(20, 5, 14);
  one.windows[3].nees = 4000;
  ASSERT_TRUE(one.againstTruth().isNo());
  EXPECT_EQ(one.againstTruth().causes.back().find("1 of 20 windows alone, the first from 3 s"), 0U);
  // A window that is not ok claims nothing; without a truth there is no verdict on errors.
  one.windows[3].found.result.consistent = false;
  EXPECT_TRUE(one.againstTruth().isYes());
  ComparedRecording unknown = fine;
  for (ComparedWindow& w : unknown.windows) w.nees.reset();
  unknown.stretches[0].nees.reset();
  EXPECT_TRUE(unknown.againstTruth().isNone());
  EXPECT_TRUE(unknown.verdict().isYes());
}

TEST(VisualInertialVerdict, MeansOfDependentNumbersHaveABound) {
  // The bound is the tail itself for one number. For more it holds for equal ones, whose mean has that tail, and is not
  // above e times it by more than a fifth.
  for (const std::size_t k : {2U, 5U, 11U}) {
    for (const double x : {8., 15., 30., 60.}) {
      const double tail = detail::chiSquaredTail(x, k);
      EXPECT_EQ(detail::dependentMeanTail(x, k, 1), tail);
      EXPECT_GE(detail::dependentMeanTail(x, k, 9), tail);
      if (x >= 2 * static_cast<double>(k)) {
        EXPECT_LE(detail::dependentMeanTail(x, k, 9), 1.2 * std::exp(1.) * tail);
      }
    }
  }
  EXPECT_EQ(detail::dependentMeanTail(3, 5, 0), 1);
  EXPECT_TRUE(std::isnan(detail::dependentMeanTail(std::numeric_limits<double>::quiet_NaN(), 5, 4)));
}

TEST(VisualInertialVerdict, ErrorsAreThoseOfWindowsThatClaimAScale) {
  ComparedRecording r;
  r.windows = {okWindow(), okWindow(), okWindow()};
  r.windows[0].closed_form_error = InitialisationError{1, 0.1, -0.5};
  r.windows[1].closed_form_error = InitialisationError{3, 0.1, 0.1};
  r.windows[1].found.result.consistent = false;
  r.windows[2].closed_form_error = InitialisationError{9, 0.1, 0.1};
  r.windows[2].found.result.status = FusionStatus::stationary;
  const InitialisationSummary s = r.summary();
  EXPECT_EQ(s.closed_form.size(), 2U);
  EXPECT_EQ(s.compared, 2U);
  EXPECT_EQ(s.compared_not_ok, 1U);
  EXPECT_EQ(s.closed_form.scale[0], 50) << "percent, without sign";
  EXPECT_EQ(s.statuses.at("stationary"), 1U);
  EXPECT_EQ(quantile(s.closed_form.speed, 0.5), 3) << "the upper of two";
}

TEST(VisualInertialTruth, TheErrorOfAnExactEstimateIsZero) {
  VisualInertialResult found;
  found.windows.resize(1);
  InitialisedWindow& w = found.windows[0];
  w.images = {0, 1};
  w.tracks = {7};
  w.found.result.status = FusionStatus::ok;
  RefinementResult refined;
  refined.status = FusionStatus::ok;
  std::vector<GroundTruth> truth(2);
  const SO3d R = SO3d::exp(Eigen::Vector3d(0.1, 0.2, -0.3));
  const Eigen::Vector3d v(1, 2, 3), step(0.1, 0.2, 0.3);
  truth[0] = {0, SE23d(R, Eigen::Vector3d(4, 5, 6), v), {}};
  truth[1] = {0.1, SE23d(R, Eigen::Vector3d(4, 5, 6) + step, v), {}};
  const SO3d back = R.inverse();
  refined.gravity = back * Eigen::Vector3d(0, 0, -9.81);
  refined.states = {SE23d(SO3d(), Eigen::Vector3d::Zero(), back * v), SE23d(SO3d(), back * step, back * v)};
  refined.covariance.joint.setIdentity();
  w.refined = refined;
  const std::vector<double> times{0, 0.1};
  ComparedRecording exact = compareWithTruth(found, times, truth, 9.81);
  ASSERT_TRUE(exact.windows[0].refined_error.has_value());
  EXPECT_LT(exact.windows[0].refined_error->speed, 1e-12);
  EXPECT_LT(exact.windows[0].refined_error->gravity, 1e-12);
  EXPECT_NEAR(exact.windows[0].refined_error->scale, 0, 1e-12);
  EXPECT_NEAR(exact.windows[0].nees.value_or(-1), 0, 1e-12);
  EXPECT_EQ(exact.windows[0].track_names, std::vector<std::uint64_t>{7});
  // A speed that is off by 2 m/s with variances of one: NEES 4. A trajectory twice as long: scale 1.
  found.windows[0].refined->states[0] = SE23d(SO3d(), Eigen::Vector3d::Zero(), back * v + Eigen::Vector3d(2, 0, 0));
  found.windows[0].refined->states[1] = SE23d(SO3d(), 2 * (back * step), back * v);
  const ComparedRecording off = compareWithTruth(found, times, truth, 9.81);
  EXPECT_NEAR(off.windows[0].refined_error->speed, 2, 1e-12);
  EXPECT_NEAR(off.windows[0].refined_error->scale, 1, 1e-12);
  EXPECT_NEAR(off.windows[0].nees.value_or(0), 4, 1e-12);
  EXPECT_NEAR(off.windows[0].velocity_nees.value_or(0), 4, 1e-12);
  EXPECT_NEAR(off.windows[0].gravity_nees.value_or(-1), 0, 1e-12);
  // Without a truth at all images there is nothing to compare.
  EXPECT_FALSE(compareWithTruth(found, times, std::span(truth).first(1), 9.81).windows[0].nees.has_value());
}

}  // namespace
