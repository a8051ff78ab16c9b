// Faults of whole trajectories, planted into noisy ones, and clean trajectories in which there are none.

#include <experiments/trajectory_scene.hpp>
#include <fusion/trajectory_misfit.hpp>

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

namespace liestat {
namespace {

using experiments::SceneMotion;

struct Scene {
  std::vector<double> times;
  std::vector<SE3d> truth, estimate;
  PoseStream stream;

  MisfitSearch search(AlignmentModel alignment = AlignmentModel::none) const {
    return findMisfit(estimate, truth, times, stream, alignment);
  }
};

/// Ten poses a second for 30 s with errors of 2 cm and 5 mrad; the estimate's are late by `late` s and then spoiled.
Scene sceneOf(SceneMotion motion, CounterRng& rng, double late = 0,
              const std::function<SE3d(const SE3d&)>& spoil = {}) {
  Eigen::Matrix<double, 12, 1> phase;
  for (int k = 0; k < 12; ++k) phase[k] = 6.28 * rng.uniform();
  Scene s;
  std::vector<TimedPose> stream;
  for (int i = 0; i < 1500; ++i) stream.push_back({0.02 * i, experiments::scenePose(motion, phase, 0.02 * i)});
  s.stream = PoseStream(stream);
  for (int i = 3; i < 297; ++i) {
    const double t = 0.1 * i;
    s.times.push_back(t);
    s.truth.push_back(experiments::scenePose(motion, phase, t));
    const SE3d T = experiments::scenePose(motion, phase, t - late);
    Eigen::Matrix<double, 6, 1> e = rng.normalVector<6>();
    e.head<3>() *= 0.02, e.tail<3>() *= 0.005;
    s.estimate.push_back((spoil ? spoil(T) : T) * SE3d::exp(e));
  }
  return s;
}

bool names(const MisfitSearch& m, const std::vector<Misfit>& faults) {
  for (const MisfitExplanation& e : m.explanations) {
    if (e.faults == faults) return true;
  }
  return false;
}

TEST(TrajectoryMisfit, FaultsAreNamed) {
  const SE3d X(SO3d::exp(Eigen::Vector3d(.1, -.2, .15)), Eigen::Vector3d(.1, -.05, .2));
  const auto scaled = [](const SE3d& T) { return SE3d(SO3d(T.so3()), Eigen::Vector3d(1.05 * T.translation())); };
  const auto w_first = [](const SE3d& T) {
    const Eigen::Vector4d q = T.so3().params();
    return SE3d(Eigen::Quaterniond(q[2], q[3], q[0], q[1]), Eigen::Vector3d(T.translation()));
  };
  const SE3d ned(SO3d::exp(Eigen::Vector3d(1, 1, 0).normalized() * 3.141592653589793), Eigen::Vector3d::Zero());
  struct Case {
    double late;
    std::function<SE3d(const SE3d&)> spoil;
    std::vector<Misfit> faults;
  };
  const std::vector<Case> cases{
      {.02, {}, {Misfit::clock}},
      {.15, {}, {Misfit::clock}},
      {0, scaled, {Misfit::scale}},
      {0, [&](const SE3d& T) { return T * X; }, {Misfit::body}},
      {0, [](const SE3d& T) { return T.inverse(); }, {Misfit::inverse}},
      {0, w_first, {Misfit::w_first}},
      {0, [&](const SE3d& T) { return ned * T * ned.inverse(); }, {Misfit::axes}},
      {.02, scaled, {Misfit::clock, Misfit::scale}},
      {.15, [](const SE3d& T) { return T.inverse(); }, {Misfit::inverse, Misfit::clock}},
  };
  for (const SceneMotion motion : {SceneMotion::space, SceneMotion::planar}) {
    for (std::size_t k = 0; k < cases.size(); ++k) {
      CounterRng rng(100 + k);
      const MisfitSearch m = sceneOf(motion, rng, cases[k].late, cases[k].spoil).search();
      EXPECT_TRUE(names(m, cases[k].faults)) << "case " << k << ": " << m.sentence();
      if (m.found() && cases[k].late > 0) {
        const MisfitExplanation& e = m.explanations[0];
        EXPECT_NEAR(e.delay, -cases[k].late, 5 * e.delay_sigma) << m.sentence();
      }
    }
  }
}

TEST(TrajectoryMisfit, CleanTrajectoriesHaveNone) {
  for (std::uint64_t run = 0; run < 8; ++run) {
    CounterRng rng(300 + run);
    const Scene s = sceneOf(run % 2 ? SceneMotion::planar : SceneMotion::space, rng);
    const MisfitSearch m = s.search(run % 4 < 2 ? AlignmentModel::none : AlignmentModel::se3);
    EXPECT_TRUE(m.searched) << m.reason;
    EXPECT_FALSE(m.found()) << m.sentence();
  }
}

/// The estimate with its times divided by a factor and moved.
PoseStream timed(const Scene& s, double factor, double zero = 0) {
  std::vector<TimedPose> poses;
  for (std::size_t i = 0; i < s.times.size(); ++i) poses.push_back({(s.times[i] - zero) / factor, s.estimate[i]});
  return PoseStream(poses);
}

TEST(TrajectoryMisfit, UnitsAndSpeedsOfTimesAreNamed) {
  const SE3d X(SO3d::exp(Eigen::Vector3d(.1, -.2, .15)), Eigen::Vector3d(.1, -.05, .2));
  for (std::uint64_t seed = 500; seed < 508; ++seed) {
    CounterRng rng(seed);
    // In another world, of another frame on the body: the motion alone tells the times.
    const Scene s = sceneOf(seed % 2 ? SceneMotion::planar : SceneMotion::space, rng, 0,
                            [&](const SE3d& T) { return X.inverse() * T * X; });
    EXPECT_FALSE(findTimeScale(timed(s, 1), s.stream).found());
    for (const double unit : {1e-3, 1e-6, 1e-9, 1e3}) {
      const MisfitSearch m = findTimeScale(timed(s, unit), s.stream);
      ASSERT_TRUE(names(m, {Misfit::time_scale})) << seed << ' ' << unit;
      EXPECT_DOUBLE_EQ(m.explanations[0].time_factor, unit);
      EXPECT_NEAR(m.explanations[0].delay, 0, 0.05) << m.sentence();
    }
    EXPECT_NE(findTimeScale(timed(s, 1e-3), s.stream).sentence().find("(--time-unit ms)"), std::string::npos);
    // Their own zero, at the reference's beginning.
    Scene begun = s;
    begun.stream = PoseStream(std::vector<TimedPose>(s.stream.poses().begin() + 15, s.stream.poses().end()));
    EXPECT_NE(findTimeScale(timed(begun, 1e-3, 1e6), begun.stream).sentence().find("begin elsewhere"),
              std::string::npos);
    const MisfitSearch fast = findTimeScale(timed(s, 1.25), s.stream);
    ASSERT_TRUE(names(fast, {Misfit::time_scale})) << seed;
    EXPECT_NEAR(fast.explanations[0].time_factor, 1.25, 0.005) << fast.sentence();
    // Another run is no fault of the clock.
    CounterRng other(seed + 50);
    const Scene stranger = sceneOf(SceneMotion::space, other);
    const MisfitSearch m = findTimeScale(timed(stranger, 1), s.stream);
    EXPECT_FALSE(m.found()) << m.sentence();
  }
}

TEST(TrajectoryMisfit, FewPosesAreNotSearched) {
  CounterRng rng(1);
  Scene s = sceneOf(SceneMotion::space, rng);
  s.estimate.resize(19), s.truth.resize(19), s.times.resize(19);
  EXPECT_FALSE(s.search().searched);
  s.truth.pop_back();
  EXPECT_EQ(s.search().reason, "not as many poses in both");
}

}  // namespace
}  // namespace liestat
