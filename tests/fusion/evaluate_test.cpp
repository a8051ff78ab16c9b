// A trajectory against a reference in one call: verdicts, association, thinning and projection as evo has them, units,
// figures, and what the data do not allow.

#include <experiments/trajectory_scene.hpp>
#include <fusion/evaluate.hpp>
#include <stats/quantile.hpp>
#include <report/describe.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <string>
#include <array>
#include <vector>

namespace liestat {
namespace {

using experiments::TrajectoryScene;
using experiments::TrajectorySceneOptions;

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

PoseTrajectory trajectory(std::vector<double> times, std::vector<Gaussian<SE3d>> poses, bool has_covariances = false) {
  return {.times = std::move(times), .poses = std::move(poses), .has_covariances = has_covariances};
}

/// Calls change(Gaussian<SE3d>&) for each pose.
template <class Change>
void changeAll(NoisyPoses& poses, const Change& change) {
  NoisyPoses changed;
  for (Gaussian<SE3d> g : poses) change(g), changed.push_back(g);
  poses = changed;
}

/// A scene whose estimate is in a world of its own, with covariances times a factor; `scale` of its lengths.
struct Scene {
  PoseTrajectory reference, estimate;

  explicit Scene(std::size_t n = 100, double covariance = 1, double scale = 1, bool turned = true,
                 bool dead_reckoning = false) {
    CounterRng rng(3);
    TrajectorySceneOptions options{.n = n};
    if (dead_reckoning) options.sigma_translation = 0.01, options.sigma_rotation = 0.002;
    const TrajectoryScene scene =
        dead_reckoning ? experiments::deadReckoningScene(options, rng) : experiments::independentScene(options, rng);
    reference = trajectory(scene.times, scene.reference());
    estimate = trajectory(scene.times, scene.estimate, true);
    changeAll(estimate.poses, [&](Gaussian<SE3d>& g) {
      if (turned) g.mean = SE3d(SO3d::rotZ(0.7), Eigen::Vector3d(3, -2, 1)) * g.mean;
      g.mean = SE3d(g.mean.so3(), Eigen::Vector3d(scale * g.mean.translation()));
      g.covariance *= covariance;
      g.covariance.topRows<3>() *= scale, g.covariance.leftCols<3>() *= scale;
    });
  }
  TrajectoryEvaluation evaluate(const EvaluationOptions& options = {.alignment = AlignmentModel::se3}) const {
    return evaluateTrajectory(reference, estimate, options);
  }
};

/// Poses along x, half a metre and ten degrees apart.
PoseTrajectory line(std::size_t n, double step = 0.5, double degrees = 10) {
  PoseTrajectory t;
  for (std::size_t i = 0; i < n; ++i) {
    const auto k = static_cast<double>(i);
    t.times.push_back(k);
    t.poses.push_back({SE3d(SO3d::rotZ(degrees * k / 57.29577951308232), Eigen::Vector3d(step * k, 0, 0))});
  }
  return t;
}

// One run for each verdict, with a fixed seed: a verdict "yes" of right covariances is false in one of a hundred.
TEST(EvaluateTrajectory, VerdictsAreYesNoOrNone) {
  const TrajectoryEvaluation right = Scene().evaluate();
  ASSERT_TRUE(right.ok()) << right.reason;
  EXPECT_TRUE(right.verdict().isYes()) << right.verdict().text;
  EXPECT_EQ(right.verdict().text.rfind("consistent: NEES is ", 0), 0u) << right.verdict().text;
  EXPECT_TRUE(contains(right.verdict().text, "594 degrees of freedom")) << right.verdict().text;
  EXPECT_EQ(right.weighted.model, AlignmentModel::se3);

  const Verdict small = Scene(100, 0.25).evaluate().verdict();
  EXPECT_TRUE(small.isNo());
  EXPECT_EQ(small.text.rfind("OVERCONFIDENT: NEES is ", 0), 0u) << small.text;
  ASSERT_FALSE(small.causes.empty());
  EXPECT_EQ(small.causes.front().rfind("joint_nees: errors are larger than the covariances say", 0), 0u);
  EXPECT_EQ(Scene(100, 4).evaluate().verdict().text.rfind("UNDERCONFIDENT", 0), 0u);

  Scene bare;
  bare.estimate.has_covariances = false;
  const TrajectoryEvaluation without = bare.evaluate();
  EXPECT_TRUE(without.verdict().isNone());
  EXPECT_EQ(without.verdict().text, "no verdict: the estimate has no covariances");
  EXPECT_EQ(without.ape_statistics.rmse, right.ape_statistics.rmse);

  Scene broken;
  NoisyPoses::Covariance bad = broken.estimate.poses.covariance(7);
  bad(0, 0) = -1;
  broken.estimate.poses.setCovariance(7, bad);
  const TrajectoryEvaluation none = broken.evaluate();
  EXPECT_TRUE(none.verdict().isNone());
  EXPECT_EQ(none.consistency.indefinite, std::vector<std::size_t>{7});
  EXPECT_EQ(none.notes.front(), "1 of 100 covariances are not positive definite or not known (pose 7): no NEES");
  broken.estimate.lines.assign(100, 42);
  EXPECT_TRUE(contains(broken.evaluate().notes.front(), "(line 42)"));

  // Errors that are correlated in time need a model of the pairs.
  const Scene drift(200, 1, 1, true, true);
  EXPECT_TRUE(drift.evaluate().verdict().isNone());
  EXPECT_TRUE(contains(drift.evaluate().verdict().text, "correlated in time")) << drift.evaluate().verdict().text;
  const TrajectoryEvaluation chain =
      drift.evaluate({.alignment = AlignmentModel::se3, .pairs_model = PairsModel::chain});
  EXPECT_TRUE(chain.verdict().isYes()) << chain.verdict().text;
}

TEST(EvaluateTrajectory, SeveralVerdictsTogether) {
  const Verdict yes = Verdict::yes(""), no = Verdict::no(""), none = Verdict::none("");
  EXPECT_EQ(answerOf({}), Verdict::Answer::none);
  EXPECT_EQ(answerOf({yes, yes}), Verdict::Answer::yes);
  EXPECT_EQ(answerOf({yes, none}), Verdict::Answer::none);
  EXPECT_EQ(answerOf({none, no, yes}), Verdict::Answer::no);
}

// Lengths of the estimate are four fifths of the reference's. A scale has no weighted alignment of its own; judged by
// se3 the right covariances would be called overconfident.
TEST(EvaluateTrajectory, ScaleAloneIsJudgedBySim3) {
  const Scene scene(100, 1, 0.8, false);
  const TrajectoryEvaluation e = scene.evaluate({.alignment = AlignmentModel::scale});
  EXPECT_EQ(e.alignment.model, AlignmentModel::scale);
  EXPECT_NEAR(e.alignment.scale, 1.25, 0.02);
  EXPECT_EQ(e.weighted.model, AlignmentModel::sim3);
  EXPECT_NEAR(e.weighted.scale, 1.25, 5 * 1.25 * std::sqrt(e.weighted.covariance(6, 6)));
  EXPECT_EQ(e.consistency.joint.dof, 6 * 100 - 7);
  EXPECT_TRUE(e.verdict().isYes()) << e.verdict().text;
  const TrajectoryEvaluation rigid =
      scene.evaluate({.alignment = AlignmentModel::scale, .verdict_alignment = AlignmentModel::se3});
  EXPECT_FALSE(rigid.verdict().isYes());
  EXPECT_GT(rigid.consistency.joint.ratio(), 10);
  // The scale by its name is not another rule.
  EXPECT_EQ((EvaluationOptions{.verdict_alignment = AlignmentModel::scale}.verdictAlignment()), AlignmentModel::sim3);
}

TEST(EvaluateTrajectory, AssociationByTime) {
  EXPECT_EQ(medianStep({}), 0);
  EXPECT_EQ(medianStep(std::vector<double>{7}), 0);
  EXPECT_EQ(medianStep(std::vector<double>{0, 1, 2, 10}), 1);
  EXPECT_EQ(medianStep(std::vector<double>{0, 1, 3}), 2);
  PoseTrajectory reference = line(20), estimate;
  // Gaps of 4.5 and of 5.5 median steps: across the first one the reference is interpolated.
  for (std::size_t i = 10; i < 20; ++i) reference.times[i] += 3.5;
  for (std::size_t i = 15; i < 20; ++i) reference.times[i] += 4.5;
  estimate = line(3);
  estimate.times = {9.5, 11, 20};
  const TrajectoryEvaluation e = evaluateTrajectory(reference, estimate);
  EXPECT_EQ(e.rows, (std::vector<std::size_t>{0, 1}));
  EXPECT_TRUE(e.by_time);
  EXPECT_EQ(e.association, "reference interpolated (cubic)");
  EXPECT_EQ(evaluateTrajectory(reference, estimate, {.association = {.max_gap = 6}}).matched.size(), 3u);
  const AssociationOptions late{.offset = 0.5, .start = 3, .end = 8};
  const TrajectoryEvaluation part = evaluateTrajectory(line(20), line(20), {.association = late});
  EXPECT_EQ(part.rows, (std::vector<std::size_t>{3, 4, 5, 6, 7}));
  EXPECT_EQ(part.reference_poses, 20u);

  const AssociationOptions nearest{.rule = AssociationRule::nearest, .max_difference = 0.6};
  estimate.times = {9.4, 11, 17.9};
  const TrajectoryEvaluation near = evaluateTrajectory(reference, estimate, {.association = nearest});
  EXPECT_EQ(near.rows, (std::vector<std::size_t>{0, 2}));
  EXPECT_EQ(near.association, "nearest stamps within 0.6 s");
  // Without times row belongs to row.
  PoseTrajectory rows = line(20);
  rows.times.clear();
  const TrajectoryEvaluation by_row = evaluateTrajectory(rows, rows);
  EXPECT_FALSE(by_row.by_time);
  EXPECT_EQ(by_row.matched.size(), 20u);
  EXPECT_EQ(by_row.ape_statistics.max, 0);
}

TEST(EvaluateTrajectory, WhatTheDataDoNotAllow) {
  const PoseTrajectory reference = line(10);
  const auto status = [&](const PoseTrajectory& estimate, const EvaluationOptions& options = {}) {
    const TrajectoryEvaluation e = evaluateTrajectory(reference, estimate, options);
    EXPECT_EQ(e.reason.empty(), e.ok());
    if (!e.ok()) {
      EXPECT_EQ(e.verdict().text, "no verdict: " + e.reason);
      EXPECT_TRUE(e.verdict().isNone());
    }
    return e.status;
  };
  PoseTrajectory late = line(5), untimed = line(10), few = line(5), back = line(5), single = line(1), off = line(5);
  for (double& t : late.times) t += 100;
  for (double& t : off.times) t += 0.3;
  untimed.times.clear(), few.times.clear();
  std::swap(back.times[2], back.times[3]);
  EXPECT_EQ(status(line(10)), EvaluationStatus::ok);
  EXPECT_EQ(status(late), EvaluationStatus::no_overlap);
  EXPECT_EQ(status(late, {.association = {.offset = -100}}), EvaluationStatus::ok);
  EXPECT_EQ(status(off, {.association = {.max_gap = 0.5}}), EvaluationStatus::no_match);
  EXPECT_EQ(status(off, {.association = {.rule = AssociationRule::nearest}}), EvaluationStatus::no_match);
  EXPECT_EQ(status(untimed), EvaluationStatus::times_missing);
  EXPECT_EQ(status(back), EvaluationStatus::bad_times);
  EXPECT_EQ(status(single), EvaluationStatus::too_few);
  EXPECT_EQ(status({}), EvaluationStatus::times_missing);
  EXPECT_EQ(status(line(10), {.association = {.start = 20}}), EvaluationStatus::empty_interval);
  EXPECT_EQ(status(line(10), {.relative = {.delta = 0.5}}), EvaluationStatus::bad_options);
  EXPECT_EQ(status(line(10), {.relative = {.delta = -1, .unit = DeltaUnit::meters}}), EvaluationStatus::bad_options);
  EXPECT_EQ(status(line(10), {.change_unit = ErrorUnit::deg}), EvaluationStatus::other_unit);
  EXPECT_EQ(status(line(10), {.alignment = AlignmentModel::se3}), EvaluationStatus::not_aligned);  // collinear
  EXPECT_EQ(evaluateTrajectory(untimed, few).status, EvaluationStatus::unequal_rows);
  EXPECT_EQ(evaluateTrajectory(untimed, line(10)).status, EvaluationStatus::times_missing);
  EXPECT_EQ(evaluateTrajectory(untimed, untimed, {.association = {.end = 3}}).status, EvaluationStatus::times_missing);
  PoseTrajectory many = line(10);
  many.times.resize(4);
  EXPECT_EQ(status(many), EvaluationStatus::bad_times);
  EXPECT_EQ(Scene()
                .evaluate({.alignment = AlignmentModel::se3,
                           .relative = {.all_pairs = true},
                           .pairs_model = PairsModel::independent})
                .status,
            EvaluationStatus::overlapping_pairs);
}

// The even spacing is evo's: numpy.linspace(0, n - 1, count, dtype=int). The path is summed from pose to pose since the
// last one that was kept, the angle is that to its pose.
TEST(EvaluateTrajectory, ThinsOut) {
  const auto rows = [](std::size_t n, const EvaluationOptions& options) {
    return evaluateTrajectory(line(n), line(n), options).rows;
  };
  EXPECT_EQ(rows(10, {.downsample = 4}), (std::vector<std::size_t>{0, 3, 6, 9}));
  EXPECT_EQ(rows(11, {.downsample = 4}), (std::vector<std::size_t>{0, 3, 6, 10}));
  EXPECT_EQ(rows(3, {.downsample = 4}), (std::vector<std::size_t>{0, 1, 2}));
  EXPECT_EQ(rows(10, {.motion_filter = MotionThinning{1.4, 1000}}), (std::vector<std::size_t>{0, 3, 6, 9}));
  EXPECT_EQ(rows(10, {.motion_filter = MotionThinning{1000, 39}}), (std::vector<std::size_t>{0, 4, 8}));
  // Turned to and fro by 30 degrees, the body is never more than 30 from where it was, however far it has turned.
  PoseTrajectory swaying = line(10, 0.5, 0);
  for (std::size_t i = 1; i < 10; i += 2)
    swaying.poses.mean(i) = swaying.poses.mean(i) * SE3d(SO3d::rotZ(0.5), {0, 0, 0});
  EXPECT_EQ(evaluateTrajectory(swaying, swaying, {.motion_filter = MotionThinning{1.9, 35}}).rows,
            (std::vector<std::size_t>{0, 4, 8}));
  // The filter follows the path of the poses that are left.
  EXPECT_EQ(rows(11, {.downsample = 6, .motion_filter = MotionThinning{1.9, 1000}}),
            (std::vector<std::size_t>{0, 4, 8}));
  const TrajectoryEvaluation e = evaluateTrajectory(line(10), line(10), {.downsample = 4});
  EXPECT_EQ(e.poses, 10u);
  EXPECT_EQ(e.times, (std::vector<double>{0, 3, 6, 9}));
}

// Positions at rest do not determine a rotation, poses with covariances do: the verdict stands, APE says what it is of.
TEST(EvaluateTrajectory, RobotsAtRestHaveAVerdict) {
  CounterRng rng(14);
  PoseTrajectory reference = line(60, 0, 0), estimate = reference;
  estimate.has_covariances = true;
  const SE3d world(SO3d::rotZ(0.7), Eigen::Vector3d(3, -2, 1));
  changeAll(estimate.poses, [&](Gaussian<SE3d>& g) {
    g.covariance = experiments::sceneCovariance({}, rng);
    g.mean = world * g.mean * sample(Gaussian<SE3d>{SE3d(), g.covariance}, rng).inverse();
  });
  const TrajectoryEvaluation e = evaluateTrajectory(reference, estimate, {.alignment = AlignmentModel::se3});
  ASSERT_TRUE(e.ok()) << e.reason;
  EXPECT_TRUE(e.verdict().isYes()) << e.verdict().text;
  EXPECT_EQ(e.alignment.model, AlignmentModel::origin);
  EXPECT_LT(e.position_errors[0], 1e-12);
  ASSERT_EQ(e.notes.size(), 1u);
  EXPECT_TRUE(contains(e.notes[0], "APE and RPE are aligned by the first poses: the positions are collinear"))
      << e.notes[0];
  estimate.has_covariances = false;
  EXPECT_EQ(evaluateTrajectory(reference, estimate, {.alignment = AlignmentModel::se3}).status,
            EvaluationStatus::not_aligned);
}

// Correlated errors ten times too large are overconfident whatever their correlation; right ones have no verdict.
TEST(EvaluateTrajectory, GrossOverconfidenceHasAVerdict) {
  Scene drift(200, 0.01, 1, true, true);
  const Verdict verdict = drift.evaluate().verdict();
  EXPECT_TRUE(verdict.isNo());
  EXPECT_EQ(
      verdict.text.rfind("OVERCONFIDENT: errors are correlated in time, but a fifth of the poses has a NEES above", 0),
      0u)
      << verdict.text;
  EXPECT_TRUE(Scene(200, 1, 1, true, true).evaluate().verdict().isNone());
}

TEST(EvaluateTrajectory, ProjectsIntoAPlane) {
  const PoseTrajectory reference = line(10);
  PoseTrajectory estimate = reference;
  changeAll(estimate.poses, [&](Gaussian<SE3d>& g) {
    g.mean = SE3d(SO3d::rotZ(0.3), Eigen::Vector3d(0, 3, 4)) * g.mean * SE3d(SO3d::rotX(0.2), Eigen::Vector3d::Zero());
    g.mean = SE3d(g.mean.so3(), Eigen::Vector3d(reference.poses.mean(0).translation() + Eigen::Vector3d(0, 3, 4)));
  });
  estimate.poses = estimate.poses.rows(std::array<std::size_t, 1>{0}), estimate.times.resize(1);
  estimate.poses.push_back(reference.poses[1]), estimate.times.push_back(1);
  const auto first = [&](std::optional<CoordinatePlane> plane) {
    const TrajectoryEvaluation e = evaluateTrajectory(reference, estimate, {.project_to_plane = plane});
    return std::pair(e.position_errors[0], e.rotation_errors[0]);
  };
  // Without a projection 5 m, and a rotation that is neither of the two about the axes.
  EXPECT_NEAR(first(std::nullopt).first, 5, 1e-12);
  EXPECT_GT(first(std::nullopt).second, 0.35);
  EXPECT_NEAR(first(CoordinatePlane::xy).first, 3, 1e-12);
  EXPECT_NEAR(first(CoordinatePlane::xy).second, 0.3, 1e-12);
  EXPECT_NEAR(first(CoordinatePlane::xz).first, 4, 1e-12);
  EXPECT_NEAR(first(CoordinatePlane::xz).second, 0, 1e-12);
  EXPECT_NEAR(first(CoordinatePlane::yz).first, 5, 1e-12);
  EXPECT_NEAR(first(CoordinatePlane::yz).second, 0.2, 1e-12);
}

/// Every list of describeSeries has a row for each matched pose, or for each pair.
struct SizesOfSeries {
  std::size_t poses, pairs;
  int count = 0;

  SizesOfSeries& operator()(const char* name, const auto& value, const char* = "", const char* = "") {
    const bool of_pairs = std::string(name).starts_with("pairs") || std::string(name) == "rpe_errors";
    std::size_t n = 0;
    if constexpr (requires { value.rows(); }) {
      n = static_cast<std::size_t>(value.rows());
    } else {
      n = value.size();
    }
    EXPECT_EQ(n, of_pairs ? pairs : poses) << name;
    ++count;
    return *this;
  }
};

TEST(EvaluateTrajectory, UnitsAndFigures) {
  const Scene scene;
  const TrajectoryEvaluation m = scene.evaluate();
  EvaluationOptions in_cm{.alignment = AlignmentModel::se3, .change_unit = ErrorUnit::cm};
  const TrajectoryEvaluation cm = scene.evaluate(in_cm);
  EXPECT_EQ(m.ape_unit + cm.ape_unit + cm.rpe_unit, "mcmcm");
  EXPECT_NEAR(cm.ape_statistics.rmse, 100 * m.ape_statistics.rmse, 1e-10);
  EXPECT_NEAR(cm.rpe_statistics.rmse, 100 * m.rpe_statistics.rmse, 1e-10);
  EXPECT_EQ(cm.position_errors, m.position_errors);
  // Percent have no other unit.
  in_cm.pose_relation = PoseRelation::point_distance_error_ratio;
  const TrajectoryEvaluation ratio = scene.evaluate(in_cm);
  EXPECT_EQ(ratio.ape_unit + ratio.rpe_unit, "cm%");

  NamedFigures figures;
  describeFigures(figures, m);
  std::string names;
  for (const auto& [name, value] : figures.figures()) names += name + " ";
  EXPECT_EQ(names,
            "ape_rmse ape_mean ape_median ape_std ape_min ape_max ape_sse rpe_rmse rpe_mean rpe_median rpe_std rpe_min "
            "rpe_max rpe_sse nees nees_p position_nees rotation_nees rpe_nees rpe_nees_p consistent matched "
            "matched_share ");
  EXPECT_EQ(figures.figures()[20].second, 1);
  EXPECT_TRUE(std::isnan(figures.figures()[18].second));
  SizesOfSeries sizes{100, 99};
  describeSeries(sizes, m);
  EXPECT_EQ(sizes.count, 11);
}

TEST(EvaluateTrajectory, WordsOfOptions) {
  EXPECT_EQ(named<PoseRelation>("point_distance_error_ratio"), PoseRelation::point_distance_error_ratio);
  EXPECT_EQ(named<AlignmentModel>("umeyama"), std::nullopt);
  EXPECT_EQ(std::string(name(AlignmentModel::scale)), "scale");
  EXPECT_EQ(named<ErrorUnit>("rad"), ErrorUnit::rad);
  EXPECT_EQ(std::string(name(EvaluationStatus::overlapping_pairs)), "overlapping_pairs");
  EXPECT_EQ(std::string(name(DeltaUnit::meters)), "m");
}

}  // namespace
}  // namespace liestat
