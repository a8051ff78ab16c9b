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
