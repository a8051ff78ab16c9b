// Quantities per frame whatever the interval of the pairs: MotionFilter over frames of tracks, estimateMotion() over a
// sequence, the plan that the options come to, gyroscopes beside a sequence, the comparison with a truth, and the
// verdict.
#include <experiments/motion_scene.hpp>
#include <fusion/motion/gyroscope.hpp>
#include <fusion/motion/motion_filter.hpp>
#include <fusion/motion/plan.hpp>
#include <fusion/motion/results.hpp>
#include <fusion/motion/sequence.hpp>
#include <fusion/motion/study.hpp>
#include <report/describe.hpp>
#include <support/motion_runs.hpp>

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat::tests;

std::vector<TrackObservation> observationsOf(const MotionScene& scene) {
  std::vector<TrackObservation> seen;
  for (const auto& track : scene.observed) seen.push_back({track.track, track.at, scene.sigma()});
  return seen;
}

/// Squared Mahalanobis distances from the truth, one mean of the usable frames of each trial.
struct Consistency {
  std::vector<double> rotation, direction;
  std::size_t usable = 0;

  static double mean(const std::vector<double>& values) {
    double sum = 0;
    for (const double value : values) sum += value;
    return sum / static_cast<double>(values.size());
  }
};

constexpr MotionSceneOptions images{.points = 40, .sigma = 1, .rotation = 3};
constexpr MotionSceneOptions inertial{.points = 40, .sigma = 1, .rotation = 3, .gyroscope_sigma = 0.05};

/// The simulated orbit of 150 frames, 40 points, 1 px, 3° per frame, in so many trials: run(scene, frame) gives the
/// motion per frame after each frame, of which those from 30 on count. A translation is that over the last `apart`
/// frames.
template <class Make>
Consistency consistencyOf(const MotionSceneOptions& scenes, std::size_t apart, std::size_t trials, const Make& make) {
  Consistency result;
  for (std::uint64_t trial = 0; trial < trials; ++trial) {
    MotionScene scene(scenes, 61, trial);
    auto filter = make();
    filter(scene);
    double rotation = 0, direction = 0;
    std::size_t usable = 0;
    for (int k = 1; k < 150; ++k) {
      scene.advance();
      const MotionEstimate& motion = filter(scene);
      if (k < 30 || !motion.ok()) continue;
      ++usable;
      const SO3d R = SO3d::exp(scene.rotation);
      rotation += mahalanobisSquared(motion.rotation, R);
      const Eigen::Vector3d over = static_cast<double>(apart) * scene.rotation;
      const Eigen::Vector3d V = scene.velocity, T = SO3d::leftJacobian(over) * V;
      direction += mahalanobisSquared(motion.direction, S2d(motion.meaning == DirectionMeaning::velocity ? V : T));
    }
    result.usable += usable;
    if (usable == 0) continue;
    result.rotation.push_back(rotation / static_cast<double>(usable));
    result.direction.push_back(direction / static_cast<double>(usable));
  }
  return result;
}

/// A filter of frames of tracks.
auto tracksFilter(const MotionOptions& options, bool gyroscope) {
  return [=] {
    return [filter = MotionFilter(planOf(options, {gyroscope, 1, 0})),
            gyroscope](const MotionScene& scene) mutable -> const MotionEstimate& {
      const auto seen = observationsOf(scene);
      return gyroscope ? filter.update(seen, scene.gyroscope) : filter.update(seen);
    };
  };
}

/// The same fed with pairs.
auto pairsFilter(const MotionFilterOptions& options, std::size_t apart, bool shorter) {
  return [=] {
    return [filter = MotionFilter(options), tracks = TrackPairs({.frames = apart, .shorter = shorter})](
               const MotionScene& scene) mutable -> const MotionEstimate& {
      const auto seen = observationsOf(scene);
      const MotionEstimate& motion = filter.update(tracks.add(seen));
      EXPECT_EQ(filter.hand_overs(), 0U) << "the essential filter knows one interval";
      return motion;
    };
  };
}

/// Covariances that are upper bounds and not without meaning. Of twelve trials the standard error of a mean is below a
/// tenth of its distance from each bound (measured: rotation 0.6 to 2.4, direction 0.16 to 0.9), so that the
/// probability of a false alarm is below 1e-5.
void expectConsistent(const Consistency& c, const char* name) {
  ASSERT_EQ(c.rotation.size(), 12U) << name;
  EXPECT_GT(c.usable, 12U * 110) << name;
  EXPECT_LT(Consistency::mean(c.rotation), 3) << name;
  EXPECT_GT(Consistency::mean(c.rotation), 0.1) << name;
  EXPECT_LT(Consistency::mean(c.direction), 2) << name;
  EXPECT_GT(Consistency::mean(c.direction), 0.03) << name;
}

TEST(MotionSequence, CovariancesPerFrameAreConsistentForAnyInterval) {
  struct Row {
    const char* name;
    MotionOptions options;
    bool gyroscope;
  };
  for (const Row& row :
       {Row{"successive frames", {}, false}, Row{"four frames", {.frames_apart = 4}, false},
        Row{"four frames, essential", {.filter = FilterChoice::essential, .frames_apart = 4}, false},
        Row{"gyroscope", {}, true}, Row{"gyroscope, four frames", {.frames_apart = 4}, true},
        Row{"gyroscope, midpoint, four frames", {.flow = FlowChoice::midpoint, .frames_apart = 4}, true}}) {
    expectConsistent(consistencyOf(row.gyroscope ? inertial : images, row.options.frames_apart, 12,
                                   tracksFilter(row.options, row.gyroscope)),
                     row.name);
  }
}

TEST(MotionSequence, PairsOverSeveralFramesNeverComeToAHandOver) {
  expectConsistent(consistencyOf(images, 4, 12, pairsFilter({}, 4, true)), "pairs of up to four frames");
  // The discrete flow takes pairs of one interval alone: here those of successive frames, of which there are none.
  MotionFilterOptions discrete;
  discrete.flow = Flow::discrete;
  MotionFilter filter(discrete);
  MotionScene scene(images, 62);
  TrackPairs tracks({.frames = 4, .shorter = false});
  for (int k = 0; k < 20; ++k) {
    scene.advance();
    filter.update(tracks.add(observationsOf(scene)));
  }
  EXPECT_TRUE(filter.estimate().flags.bad_input);
  EXPECT_TRUE(filter.estimate().flags.too_few);
  EXPECT_FALSE(filter.estimate().ok());
}

TEST(MotionPlan, FollowsFromTheOptions) {
  const GyroscopeClock clock{true, 0.1, 1e-3};
  EXPECT_EQ(planOf({}).filter, FilterChoice::composition);
  EXPECT_EQ(planOf({}).settings.flow, Flow::midpoint);
  EXPECT_EQ(planOf({}, clock).settings.flow, Flow::discrete);
  EXPECT_EQ(planOf({.frames_apart = 4}).filter, FilterChoice::subspace);
  EXPECT_FALSE(planOf({.frames_apart = 4}).whole_intervals);
  EXPECT_TRUE(planOf({.flow = FlowChoice::discrete, .frames_apart = 4}).whole_intervals);
  EXPECT_TRUE(planOf({.filter = FilterChoice::essential, .frames_apart = 4}).whole_intervals);
  const MotionPlan refused = planOf({.filter = FilterChoice::composition, .frames_apart = 4});
  EXPECT_EQ(refused.fault, MotionFault::composition_over_intervals);
  EXPECT_EQ(planOf({.bias = true}).fault, MotionFault::bias_without_gyroscope);
  EXPECT_EQ(planOf({.bias = true}, {true, 0, 0}).fault, MotionFault::no_time);
  // rad/s over the 0.4 s of a step.
  const MotionPlan bias = planOf({.frames_apart = 4, .bias = true, .bias_sigma = 0.01}, clock);
  EXPECT_NEAR(bias.settings.bias_sigma, 0.004, 1e-15);
  EXPECT_NEAR(bias.settings.bias_noise, 0.4e-3 * 0.4e-3 * 0.1, 1e-20);
  // A filter that is made of it all the same gives nothing that may be used.
  MotionFilter filter(refused);
  MotionScene scene(images, 63);
  for (int k = 0; k < 40; ++k) {
    scene.advance();
    EXPECT_FALSE(filter.update(observationsOf(scene)).ok());
  }
  const MotionResult none =
      estimateMotion({{0, {}}, {1, {}}}, {.filter = FilterChoice::composition, .frames_apart = 2});
  EXPECT_EQ(none.fault, MotionFault::composition_over_intervals);
  EXPECT_TRUE(none.frames.empty());
  EXPECT_TRUE(none.verdict().isNone());
  EXPECT_NE(none.verdict().text.find(inWords(none.fault)), std::string::npos);
}

TEST(MotionPlan, AnIntervalAsOneFrame) {
  // The covariance by differences: rotation = Exp(Log(R)/n) along the first frame's axes.
  MotionEstimate motion;
  const Eigen::Vector3d turn(0.4, -0.3, 0.5);
  motion.rotation.mean = SO3d::exp(turn);
  motion.rotation.covariance = Eigen::Vector3d(1e-4, 4e-4, 9e-4).asDiagonal();
  motion.mean_inverse_depth = 0.6, motion.mean_inverse_depth_variance = 0.09;
  const MotionEstimate one = perFrame(motion, 3);
  Eigen::Matrix3d J;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d e = 1e-6 * Eigen::Vector3d::Unit(i);
    const auto frameOf = [&](const Eigen::Vector3d& v) {
      return SO3d::exp(Eigen::Vector3d((motion.rotation.mean * SO3d::exp(v)).log() / 3));
    };
    J.col(i) = (frameOf(-e).inverse() * frameOf(e)).log() / 2e-6;
  }
  EXPECT_LT((one.rotation.mean.log() - turn / 3).norm(), 1e-14);
  EXPECT_LT((one.rotation.covariance - J * motion.rotation.covariance * J.transpose()).norm(), 1e-12);
  EXPECT_NEAR(one.mean_inverse_depth, 0.2, 1e-15);
  EXPECT_NEAR(one.mean_inverse_depth_variance, 0.01, 1e-15);
}

TEST(MotionGyroscope, IntervalsAreComposed) {
  const SO3d camera_R_sensor = SO3d::exp(Eigen::Vector3d(0.3, -1, 0.5));
  const Eigen::Vector3d rate(0.3, -0.5, 0.4), bias(0.01, 0.02, -0.03);
  std::map<std::size_t, FrameRate> rates;
  std::vector<GyroscopeRotation> rotations;
  for (std::size_t k = 0; k < 6; ++k) {
    rates[k] = {0.1 * static_cast<double>(k), rate + bias};
    rotations.push_back(gyroscopeRotation(rate, 0.1, 0.02, camera_R_sensor));
  }
  rates.erase(5);
  const MotionGyroscope of_rates = gyroscopeOfRates(rates, 0.002, camera_R_sensor, bias);
  const MotionGyroscope of_rotations = gyroscopeOfRotations(rotations, 0.1);
  EXPECT_NEAR(of_rates.seconds, 0.1, 1e-15);
  for (const MotionGyroscope* gyroscope : {&of_rates, &of_rotations}) {
    const auto between = gyroscope->between(1, 4);
    ASSERT_TRUE(between.rotation);
    // A constant rate: three times the rotation and the variance of one frame.
    EXPECT_LT((between.rotation->rotation - 3 * rotations[0].rotation).norm(), 1e-14);
    EXPECT_LT((between.rotation->covariance - 3 * rotations[0].covariance).norm(), 1e-18);
  }
  EXPECT_EQ(of_rates.between(2, 5).why, "no rate at frame 5");
  EXPECT_EQ(of_rotations.between(2, 6).why, "no rotation of frame 6");
  EXPECT_EQ(reasonWithoutCover(of_rates, {{0, 0.}, {1, 0.1}}), "");
  EXPECT_EQ(reasonWithoutCover(of_rates, {{7, 0.7}, {8, 0.8}}), "frame 8: no rate at frame 7");
  // Two turns about different axes, errors on the left.
  const GyroscopeRotation first{{0.1, 0, 0}, Eigen::Vector3d(1, 4, 9).asDiagonal()};
  const GyroscopeRotation second{{0, 0, 1.5707963267948966}, Eigen::Matrix3d::Zero()};
  const GyroscopeRotation both = composed(first, second);
  EXPECT_LT(distance(SO3d::exp(both.rotation), SO3d::exp(second.rotation) * SO3d::exp(first.rotation)), 1e-14);
  EXPECT_LT((both.covariance - Eigen::Matrix3d(Eigen::Vector3d(4, 1, 9).asDiagonal())).norm(), 1e-14);
  // Four overlapping intervals of four frames claim no more than one.
  const GyroscopeRotation over{{0.4, 0, 0}, 4 * Eigen::Matrix3d::Identity()};
  EXPECT_NEAR(priorOfInterval(over, 4, true).covariance(0, 0), 16, 1e-14);
  EXPECT_NEAR(priorOfInterval(over, 4, false).covariance(0, 0), 1, 1e-14);
  EXPECT_NEAR(priorOfInterval(over, 4, false).rotation.x(), 0.1, 1e-15);
}

TEST(MotionGyroscope, ReadingsSayWhyTheyDoNotServe) {
  GyroscopeReadings readings;
  for (int k = 0; k <= 100; ++k) {
    if (k > 40 && k < 60) continue;
    readings.samples.push_back({0.01 * k, Eigen::Vector3d(0, 0, 0.5), Eigen::Vector3d(0, 0, 9.8)});
  }
  readings.times = {{0, 0.1}, {1, 0.3}, {2, 0.5}, {3, 0.7}, {4, 1.5}};
  readings.how.preintegration.noise = {.gyroscope = 1e-3, .accelerometer = 1e-2};
  const MotionGyroscope gyroscope = gyroscopeOfReadings(readings, {});
  ASSERT_TRUE(gyroscope.between(0, 1).rotation);
  EXPECT_LT((gyroscope.between(0, 1).rotation->rotation - Eigen::Vector3d(0, 0, -0.1)).norm(), 1e-12);
  EXPECT_EQ(gyroscope.between(1, 2).why, "no reading from 0.400000 to 0.600000 s (reading 41)");
  EXPECT_NE(gyroscope.between(3, 4).why.find("the readings from 0.000000 to 1.000000 s"), std::string::npos);
  EXPECT_EQ(gyroscope.between(4, 7).why, "frame 7 has no time");
}

/// An orbit with its true poses, the camera at rest in the first frame's axes.
struct Recording {
  TrackFrames frames;
  std::map<std::size_t, TrueCamera> truth;
  std::vector<GyroscopeRotation> rotations;
};
Recording recordingOf(const MotionSceneOptions& scenes, std::uint64_t seed, std::size_t n, std::size_t begin) {
  Recording recording;
  MotionScene scene(scenes, seed);
  TrueCamera camera;
  recording.rotations.resize(begin + n);
  for (std::size_t k = 0; k < n; ++k) {
    if (k > 0) {
      scene.advance();
      // X₂ = R X₁ + T for X = R_camera_world (P - c).
      const Eigen::Matrix3d R = SO3d::exp(scene.rotation).matrix() * camera.R_camera_world;
      camera.centre -= R.transpose() * scene.translation;
      camera.R_camera_world = R;
      recording.rotations[begin + k] = scene.gyroscope;
    }
    recording.frames[begin + k] = observationsOf(scene);
    recording.truth[begin + k] = camera;
  }
  return recording;
}

TEST(MotionSequence, ErrorsAgainstTheTruth) {
  // Without noise to speak of the errors are those of the flow: none of the discrete one.
  MotionSceneOptions exact = inertial;
  exact.sigma = 1e-3, exact.gyroscope_sigma = 1e-3;
  const Recording recording = recordingOf(exact, 64, 40, 3);
  for (const std::size_t apart : {1U, 4U}) {
    for (const FlowChoice flow : {FlowChoice::midpoint, FlowChoice::discrete}) {
      MotionResult result = estimateMotion(recording.frames, {.flow = flow, .frames_apart = apart},
                                           gyroscopeOfRotations(recording.rotations));
      compareWithTruth(result, recording.truth, 0.01);
      ASSERT_EQ(result.frames.size(), 39U);
      EXPECT_EQ(result.frames.front().frame, 4U);
      EXPECT_TRUE(result.verdict().isYes());
      // (Without noise that would hide it, χ² refutes the midpoint flow.)
      if (flow == FlowChoice::discrete) {
        EXPECT_GT(result.usable(), 30U);
      }
      // The midpoint flow of an orbit is right to second order of an interval of 12°.
      const double bound = flow == FlowChoice::discrete ? 1e-4 : 1e-3;
      EXPECT_LT(result.medianError(&MotionFrame::rotation_error), bound) << apart;
      EXPECT_LT(result.medianError(&MotionFrame::direction_error), 10 * bound) << apart;
    }
  }
  MotionResult still = estimateMotion(recording.frames);
  compareWithTruth(still, recording.truth, 10);
  EXPECT_TRUE(still.errors(&MotionFrame::direction_error).empty());
  EXPECT_FALSE(still.errors(&MotionFrame::rotation_error).empty());
}

TEST(MotionSequence, IsTheFilterFrameByFrame) {
  const Recording recording = recordingOf(inertial, 65, 60, 0);
  for (const std::size_t apart : {1U, 3U}) {
    const MotionOptions options{.frames_apart = apart};
    const MotionResult result = estimateMotion(recording.frames, options, gyroscopeOfRotations(recording.rotations));
    MotionFilter filter(planOf(options, {true, 1, 0}));
    for (std::size_t k = 0; k < 60; ++k) {
      const MotionEstimate& motion = filter.update(recording.frames.at(k), recording.rotations[k]);
      if (k == 0) continue;
      EXPECT_LT(distance(motion.direction.mean, result.frames[k - 1].motion.direction.mean), 1e-12);
      EXPECT_LT((motion.rotation.covariance - result.frames[k - 1].motion.rotation.covariance).norm(), 1e-15);
    }
  }
  const MotionResult twice = estimateMotion(recording.frames, {.passes = 2});
  EXPECT_EQ(twice.frames.size(), 59U);
  EXPECT_TRUE(twice.frames.front().motion.ok()) << "the second pass begins with what the first one found";
  EXPECT_FALSE(twice.frames.back().covariance_judged) << "the same data count twice";
}

/// Counts the rows of each field.
struct Rows {
  std::map<std::string, std::size_t> count;
  std::set<std::string> names;
  template <class T>
  Rows& operator()(const char* name, const T& value, const char* = "", const char* = "") {
    names.insert(name);
    if constexpr (requires { value.size(); }) count[name] = value.size();
    return *this;
  }
};

TEST(MotionSequence, SaysWhatItIs) {
  const Recording recording = recordingOf(images, 66, 30, 0);
  MotionResult result = estimateMotion(recording.frames);
  Rows fields;
  describe(fields, result);
  describe(fields, result.frames.front());
  for (const char* name : {"verdict", "status", "frames_usable", "meaning", "rotation_covariance"}) {
    EXPECT_TRUE(fields.names.contains(name)) << name;
  }
  EXPECT_FALSE(fields.names.contains("gyroscope_bias")) << "there is no gyroscope";
  Rows rows;
  describeSeries(rows, result);
  EXPECT_GT(rows.count.size(), 20U);
  for (const auto& [name, count] : rows.count) EXPECT_EQ(count, 29U) << name;
  for (MotionFrame& frame : result.frames) frame.motion.flags.lost = true;
  EXPECT_TRUE(result.verdict().isNo());
  EXPECT_EQ(result.verdict().text, "NOT TO BE TRUSTED: none of 29 frames has a direction of motion that may be used");
  EXPECT_NE(result.verdict().causes.back().find("lost in 29"), std::string::npos);
  EXPECT_TRUE(estimateMotion({}).verdict().isNone());
}

TEST(MotionStudy, TheMinimumIsNearTheEstimate) {
  const Recording recording = recordingOf(images, 67, 40, 0);
  MotionWindow window(30);
  MotionResult result = estimateMotion(recording.frames, {}, {}, [&](const MotionFrame& frame, const MotionFilter& f) {
    window.add(frame.frame, f.pairs(), f.tracks(), f.stepEstimate());
  });
  compareWithTruth(result, recording.truth, 0.01);
  ASSERT_TRUE(window.has_looked_at());
  const MotionFrameStudy study = studyFrame(window, result);
  EXPECT_EQ(study.frame, 30U);
  ASSERT_TRUE(study.hasMaps());
  ASSERT_TRUE(study.true_velocity);
  const HemisphereChart chart(study.velocity.mean.unit_vector());
  // Degrees; a frame of 40 points at 1 px has a standard deviation of about 2°.
  EXPECT_LT((study.midpoint.minimum - chart(*study.true_velocity)).norm(), 15);
  EXPECT_TRUE(study.midpoint.covariance);
  EXPECT_LT(study.midpoint.residual, 3);
  EXPECT_TRUE(study.runs.hasStructure());
  EXPECT_EQ(study.runs.held.frames.size(), study.runs.released.frames.size());
}

}  // namespace
