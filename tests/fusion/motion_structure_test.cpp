// The structure behind a motion filter, rigid and "rubbery".
#include <experiments/motion_scene.hpp>
#include <fusion/motion/structure.hpp>
#include <fusion/motion/subspace_filter.hpp>
#include <support/motion_runs.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat::tests;

/// A filter with its structure over 60 frames of an orbit, and what is seen of the last fifteen.
struct Seen {
  MotionScene scene;
  SubspaceFilter filter;
  MotionStructure structure;
  RigidityTest rigidity;
  std::size_t behind = 0;  // frames with the mean behind the camera

  Seen(std::uint64_t trial, bool positive_depth)
      : scene({.sigma = 0.5}, 50, trial), filter({.positive_depth = positive_depth}) {
    std::vector<std::uint64_t> tracks;
    std::vector<Eigen::Vector3d> positions;
    for (int k = 0; k < 60; ++k) {
      scene.advance();
      const MotionEstimate& motion = filter.update(scene.pairs);
      tracks.assign(scene.pair_tracks.begin(), scene.pair_tracks.end());
      structure.update(tracks, scene.pairs, filter.inverse_depths(), motion);
      if (k < 45) continue;
      behind += structure.meanInverseDepth() < 0 ? 1U : 0U;
      positions.clear();
      for (const StructurePoint& p : structure.inFront()) positions.push_back(p.position());
      rigidity.add(positions);
    }
  }
};

TEST(MotionStructure, IsAccurateAndRigid) {
  double error = 0, single = 0;
  std::size_t n = 0;
  for (std::uint64_t trial = 0; trial < 20; ++trial) {
    Seen seen(trial, true);
    const auto points = seen.structure.points();
    ASSERT_EQ(points.size(), 20U);
    const auto depths = seen.filter.inverse_depths();
    for (std::size_t i = 0; i < points.size(); ++i) {
      EXPECT_EQ(points[i].track, seen.scene.pair_tracks[i]);
      const SO3d half = SO3d::exp(Eigen::Vector3d(-0.5 * seen.scene.rotation));
      const Eigen::Vector3d now = half * Eigen::Vector3d(seen.scene.tracks[i].position);
      const Eigen::Vector3d back =
          SO3d::leftJacobian(Eigen::Vector3d(-0.5 * seen.scene.rotation)) * seen.scene.velocity;
      const double truth = seen.scene.velocity.norm() / (now - 0.5 * back).z();
      error += std::pow(points[i].inverse_depth - truth, 2), single += std::pow(depths[i].value - truth, 2);
      ++n;
    }
    EXPECT_EQ(seen.behind, 0U) << trial;
  }
  // Many frames know more than one.
  EXPECT_LT(std::sqrt(error / static_cast<double>(n)), 0.7 * std::sqrt(single / static_cast<double>(n)));
}

TEST(MotionStructure, RubberyInterpretationIsToldFromTheRigidOne) {
  // Positive depths not enforced: half of the runs end at the antipode. What is seen in front of the camera there does not
  // keep its distances, and turns the other way.
  std::vector<double> rigid, rubbery;
  std::size_t rigid_turns = 0, rubbery_turns = 0;
  for (std::uint64_t trial = 0; trial < 40; ++trial) {
    const Seen seen(trial, false);
    if (seen.behind != 0 && seen.behind != 15) continue;
    const bool turned_round = seen.behind == 15;
    (turned_round ? rubbery : rigid).push_back(seen.rigidity.spread());
    // Fourteen frames of 5°: 70°.
    const double along = seen.rigidity.rotation().dot(seen.scene.rotation.normalized());
    if (turned_round) {
      rubbery_turns += along < 0 ? 1U : 0U;
    } else {
      rigid_turns += along > 0 ? 1U : 0U;
    }
  }
  ASSERT_GE(rigid.size(), 8U);
  ASSERT_GE(rubbery.size(), 8U);
  std::sort(rigid.begin(), rigid.end()), std::sort(rubbery.begin(), rubbery.end());
  // 0.03 to 0.06 and 0.09 to 0.17 in 40 trials.
  EXPECT_LT(rigid[rigid.size() / 2], 0.05);
  EXPECT_GT(rubbery[rubbery.size() / 2], 0.07);
  EXPECT_LE(std::count_if(rigid.begin(), rigid.end(), [](double s) { return s > 0.065; }), 1);
  EXPECT_LE(std::count_if(rubbery.begin(), rubbery.end(), [](double s) { return s < 0.065; }), 1);
  EXPECT_EQ(rigid_turns, rigid.size());
  EXPECT_GE(rubbery_turns + 2, rubbery.size());
}

}  // namespace
