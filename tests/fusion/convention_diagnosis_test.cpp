// Conventions found from errors: planted ones in scenes of different richness, classes that are equal, the bound of the
// margin, correlated errors, scales, faults, plan, bad input.

#include <experiments/trajectory_scene.hpp>
#include <fusion/convention_diagnosis.hpp>
#include <fusion/trajectories.hpp>
#include <stats/convention_charts.hpp>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

namespace liestat {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using experiments::SceneMotion;
using experiments::SceneNoise;
using experiments::TrajectoryScene;
using experiments::TrajectorySceneOptions;

/// The scene as a file in a convention.
std::vector<DiagnosedPose> written(const TrajectoryScene& scene, const Convention& c) {
  std::vector<DiagnosedPose> poses;
  for (std::size_t i = 0; i < scene.truth.size(); ++i) {
    poses.push_back({scene.estimate[i].mean, toConvention(c, scene.estimate[i]), scene.truth[i]});
  }
  return poses;
}
bool contains(const std::vector<Convention>& list, const Convention& c) {
  return std::find(list.begin(), list.end(), c) != list.end();
}

using P = Perturbation;
using U = RotationUnit;
Convention convention(P perturbation, U unit = U::radian, CovarianceContent content = CovarianceContent::covariance,
                      CovarianceOrder order = CovarianceOrder::translation_rotation) {
  Convention c;
  c.order = order, c.perturbation = perturbation, c.unit = unit, c.content = content;
  return c;
}

/// The fifteen conventions that are planted.
std::vector<Convention> planted() {
  using C = CovarianceContent;
  const auto rt = CovarianceOrder::rotation_translation;
  return {convention(P::right),
          convention(P::left),
          convention(P::world_axes),
          convention(P::world_body_axes),
          convention(P::roll_pitch_yaw),
          convention(P::yaw_pitch_roll),
          convention(P::transposed_axes),
          convention(P::right, U::half_angle),
          convention(P::right, U::double_angle),
          convention(P::right, U::degree),
          convention(P::right, U::radian, C::information),
          convention(P::right, U::half_angle, C::information),
          convention(P::right, U::radian, C::sigmas),
          convention(P::right, U::radian, C::covariance, rt),
          convention(P::world_axes, U::radian, C::covariance, rt)};
}

struct Shares {
  double identified = 0, wrong = 0, fired = 0;
};
Shares shares(SceneMotion motion, SceneNoise noise, const Convention& c, std::size_t n, int trials,
              const DiagnosisOptions& options = {}) {
  Shares s;
  for (int trial = 0; trial < trials; ++trial) {
    CounterRng rng(77, static_cast<std::uint64_t>(trial), static_cast<std::uint32_t>(n));
    const TrajectoryScene scene = experiments::independentScene({.motion = motion, .noise = noise, .n = n}, rng);
    const ConventionDiagnosis d = diagnoseConventions(written(scene, c), options);
    const bool single = d.accepted.size() == 1;
    s.identified += d.verdict == DiagnosisVerdict::identified && contains(d.accepted, c);
    s.wrong += (single || d.verdict == DiagnosisVerdict::undecidable) && !contains(d.accepted, c) && !d.correlated;
    s.fired += d.verdict == DiagnosisVerdict::inconsistent || d.verdict == DiagnosisVerdict::none || d.correlated;
  }
  s.identified /= trials, s.wrong /= trials, s.fired /= trials;
  return s;
}

TEST(ConventionDiagnosis, RichMotionIdentifiesAllFifteen) {
  double fired = 0;
  for (const Convention& c : planted()) {
    const Shares s = shares(SceneMotion::space, SceneNoise::full, c, 50, 12);
    EXPECT_GE(s.identified, 11. / 12) << describe(c);
    EXPECT_EQ(s.wrong, 0) << describe(c);
    fired += s.fired / 15;
  }
  EXPECT_LT(fired, 0.03);  // 0.7 % of 180 on average
}

TEST(ConventionDiagnosis, ClassesThatAreEqualStayTogether) {
  // A planar motion with decoupled roll and pitch: three perturbations write the same file.
  CounterRng rng(3);
  const TrajectoryScene scene =
      experiments::independentScene({.motion = SceneMotion::planar, .noise = SceneNoise::planar, .n = 200}, rng);
  // The estimate is planar too.
  TrajectoryScene flat = scene;
  for (std::size_t i = 0; i < 200; ++i) flat.estimate[i].mean = scene.truth[i];
  for (std::size_t i = 0; i < 200; ++i) {
    flat.truth[i] = flat.estimate[i].mean * (scene.estimate[i].mean.inverse() * scene.truth[i]);
  }
  const ConventionDiagnosis d = diagnoseConventions(written(flat, convention(P::world_axes)));
  EXPECT_EQ(d.verdict, DiagnosisVerdict::undecidable) << d.reason;
  EXPECT_EQ(d.accepted.size(), 3u);
  EXPECT_TRUE(contains(d.accepted, convention(P::roll_pitch_yaw)));
  EXPECT_NE(d.reason.find("planar"), std::string::npos) << d.reason;
  // Isotropic blocks say nothing about axes.
  const TrajectoryScene round = experiments::independentScene({.noise = SceneNoise::isotropic, .n = 200}, rng);
  const ConventionDiagnosis same = diagnoseConventions(written(round, convention(P::right)));
  EXPECT_EQ(same.verdict, DiagnosisVerdict::undecidable);
  EXPECT_EQ(same.accepted.size(), 4u);
  EXPECT_NE(same.reason.find("s^2 I"), std::string::npos) << same.reason;
}

TEST(ConventionDiagnosis, SmallRotationsAreUndecidableAndThePlanSaysSo) {
  const Shares few = shares(SceneMotion::small, SceneNoise::full, convention(P::world_axes), 50, 20);
  EXPECT_LT(few.identified, 0.2);
  EXPECT_EQ(few.wrong, 0);
  const Shares left = shares(SceneMotion::small, SceneNoise::full, convention(P::left), 50, 20);
  EXPECT_GT(left.identified, 0.9);
  CounterRng rng(4);
  const TrajectoryScene scene = experiments::independentScene({.motion = SceneMotion::small, .n = 100}, rng);
  const std::vector<Convention> of{convention(P::right), convention(P::world_axes)};
  const std::vector<PlanRow> plan = planDiagnosis(written(scene, convention(P::right)), of);
  ASSERT_EQ(plan.size(), 2u);
  EXPECT_GT(plan[0].poses, 100);
  EXPECT_LT(plan[0].poses, 3000);
  EXPECT_GT(plan[0].divergence, 0);
}

TEST(ConventionDiagnosis, MarginIsABound) {
  // The true hypothesis is rejected with probability alpha at most: 200 trials at 0.05 have 4 rejections in a thousand
  // cases more than 20.
  int rejected = 0;
  for (int trial = 0; trial < 200; ++trial) {
    CounterRng rng(5, static_cast<std::uint64_t>(trial));
    const TrajectoryScene scene =
        experiments::independentScene({.motion = SceneMotion::yaw, .noise = SceneNoise::diagonal, .n = 20}, rng);
    const Convention c = planted()[static_cast<std::size_t>(trial) % 7];
    const ConventionDiagnosis d = diagnoseConventions(written(scene, c), {.alpha = 0.05});
    double own = -1e9;
    for (const HypothesisFit& f : d.fits) {
      if (f.convention == c) own = f.log_likelihood;
    }
    rejected += !d.correlated && !(own > -d.margin);
  }
  EXPECT_LE(rejected, 10);
}

TEST(ConventionDiagnosis, AnUnknownWorldIsAligned) {
  CounterRng rng(6);
  const TrajectoryScene scene = experiments::independentScene({.n = 60}, rng);
  const SE3d A(SO3d(rng.unitQuaternion()), Eigen::Vector3d(20, -10, 5));
  for (const Convention& c : {convention(P::right), convention(P::left), convention(P::world_axes),
                              convention(P::world_body_axes, U::half_angle)}) {
    std::vector<DiagnosedPose> poses = written(scene, c);
    for (DiagnosedPose& p : poses) p.truth = A * p.truth;
    const ConventionDiagnosis d = diagnoseConventions(poses, {.alignment = AlignmentModel::se3});
    EXPECT_EQ(d.verdict, DiagnosisVerdict::identified) << d.reason;
    EXPECT_TRUE(contains(d.accepted, c)) << describe(c) << ": " << d.reason;
    EXPECT_NE(diagnoseConventions(poses).verdict, DiagnosisVerdict::identified);
    // The ratio of the best fit is that of its consistency after the same alignment, which takes six degrees of
    // freedom.
    const auto reading = readInConvention(poses, d.fits.front().convention, AlignmentModel::se3);
    ASSERT_TRUE(reading.consistency.ok);
    EXPECT_EQ(reading.consistency.joint.dof, 6 * 60 - 6);
    EXPECT_NEAR(d.fits.front().nees_ratio, reading.consistency.joint.ratio(), 1e-9);
  }
}

TEST(ConventionDiagnosis, LargeErrorsKeepTheirOwnCoordinates) {
  for (const Convention& c : {convention(P::world_axes), convention(P::roll_pitch_yaw)}) {
    CounterRng rng(8);
    TrajectoryScene scene = experiments::independentScene({.motion = SceneMotion::yaw, .n = 200}, rng);
    std::vector<DiagnosedPose> poses;
    for (std::size_t i = 0; i < 200; ++i) {
      // Errors of 0.3 rad, normal in the coordinates of the convention itself.
      const Eigen::Matrix<double, 6, 1> unit = (Eigen::Matrix<double, 6, 1>() << 1, 1, 1, 30, 30, 30).finished();
      const Matrix6 C = unit.asDiagonal() * scene.estimate[i].covariance * unit.asDiagonal();
      const Eigen::Matrix<double, 6, 1> x = detail::SemidefiniteRoot<double, 6>(C) * rng.normalVector<6>();
      const SE3d truth = conventionExp(c, scene.truth[i], x);
      poses.push_back({scene.truth[i], C, truth});
    }
    const ConventionDiagnosis d = diagnoseConventions(poses);
    EXPECT_TRUE(d.exact_coordinates);
    EXPECT_TRUE(contains(d.accepted, c)) << d.reason;
    EXPECT_TRUE(d.tests.consistent()) << d.reason;
  }
}

TEST(ConventionDiagnosis, DeadReckoningIsDecidedByItsChain) {
  const TrajectorySceneOptions options{.n = 200, .sigma_translation = 0.01, .sigma_rotation = 0.002};
  for (const P p : {P::right, P::world_axes, P::world_body_axes, P::roll_pitch_yaw}) {
    for (const SceneMotion motion : {SceneMotion::space, SceneMotion::yaw}) {
      for (std::uint64_t trial = 0; trial < 3; ++trial) {
        CounterRng rng(9, trial);
        TrajectorySceneOptions o = options;
        o.motion = motion;
        const TrajectoryScene scene = experiments::deadReckoningScene(o, rng);
        const ConventionDiagnosis d = diagnoseConventions(written(scene, convention(p)));
        EXPECT_TRUE(d.correlated);
        EXPECT_TRUE(d.fits.empty());  // no ranking on absolute errors
        EXPECT_EQ(d.verdict, DiagnosisVerdict::identified) << describe(convention(p)) << ": " << d.reason;
        EXPECT_TRUE(contains(d.accepted, convention(p))) << d.reason;
        // Without truth.
        std::vector<DiagnosedPose> blind = written(scene, convention(p));
        for (DiagnosedPose& pose : blind) pose.truth = SE3d();
        const ChainDiagnosis chain = diagnoseChain(blind);
        EXPECT_TRUE(chain.is_chain);
        EXPECT_TRUE(contains(chain.accepted, convention(p)));
        EXPECT_EQ(chain.accepted.size(), 1u) << describe(convention(p)) << chain.fits[1].indefinite;
      }
    }
  }
}

TEST(ConventionDiagnosis, StepsFusedAsAbsoluteAreNamed) {
  CounterRng rng(10);
  const TrajectorySceneOptions o{.n = 200, .sigma_translation = 0.01, .sigma_rotation = 0.002};
  TrajectoryScene scene = experiments::deadReckoningScene(o, rng);
  for (std::size_t i = 199; i > 0; --i) {
    const Matrix6 A = (scene.estimate[i].mean.inverse() * scene.estimate[i - 1].mean).Adj();
    scene.estimate[i].covariance -= A * scene.estimate[i - 1].covariance * A.transpose();
  }
  const ConventionDiagnosis d = diagnoseConventions(written(scene, convention(P::right)));
  EXPECT_TRUE(d.increments_as_absolute) << d.reason;
  EXPECT_EQ(d.verdict, DiagnosisVerdict::inconsistent);
  EXPECT_GT(d.growth, 2);
}

TEST(ConventionDiagnosis, ScalesAreNamed) {
  CounterRng rng(11);
  const TrajectoryScene scene = experiments::independentScene({.n = 300}, rng);
  std::vector<DiagnosedPose> poses = written(scene, convention(P::world_axes));
  const auto scaled = [&](double k_t, double k_r) {
    std::vector<DiagnosedPose> all = poses;
    for (DiagnosedPose& p : all) {
      p.matrix.topRows<3>() *= std::sqrt(k_t), p.matrix.leftCols<3>() *= std::sqrt(k_t);
      p.matrix.bottomRows<3>() *= std::sqrt(k_r), p.matrix.rightCols<3>() *= std::sqrt(k_r);
    }
    return diagnoseConventions(all);
  };
  const ConventionDiagnosis overconfident = scaled(0.5, 0.5);
  EXPECT_EQ(overconfident.verdict, DiagnosisVerdict::inconsistent);
  ASSERT_TRUE(overconfident.scale);
  EXPECT_TRUE(contains(overconfident.accepted, convention(P::world_axes)));
  EXPECT_EQ(overconfident.accepted.size(), 1u);
  EXPECT_NE(overconfident.reason.find("overconfident"), std::string::npos) << overconfident.reason;
  const ConventionDiagnosis millimetres = scaled(1e6, 1);
  EXPECT_NE(millimetres.reason.find("millimetres"), std::string::npos) << millimetres.reason;
  const ConventionDiagnosis both = scaled(0.4, 0.25);
  ASSERT_TRUE(both.scale);
  EXPECT_NEAR(both.scale->translation, 0.4, 0.1);
  EXPECT_NEAR(both.scale->rotation, 0.25, 0.06);
}

TEST(ConventionDiagnosis, FaultsAreRepaired) {
  // Each repair undoes what its words say, on one matrix.
  CounterRng rng(12);
  const TrajectoryScene scene = experiments::independentScene({.n = 200}, rng);
  const auto spoiled = [&](auto&& spoil) {
    std::vector<DiagnosedPose> poses = written(scene, convention(P::right));
    for (DiagnosedPose& p : poses) p.matrix = spoil(p.matrix, p.estimate);
    return diagnoseConventions(poses);
  };
  const ConventionDiagnosis sign = spoiled([](Matrix6 M, const SE3d&) {
    M.topRightCorner<3, 3>() *= -1, M.bottomLeftCorner<3, 3>() *= -1;
    return M;
  });
  EXPECT_EQ(sign.fault, MatrixFault::cross_sign) << sign.reason;
  EXPECT_EQ(sign.verdict, DiagnosisVerdict::inconsistent);
  const ConventionDiagnosis factor = spoiled([](const Matrix6& M, const SE3d&) {
    const Matrix6 L = M.llt().matrixL();
    return Matrix6(L.transpose() * L);
  });
  EXPECT_EQ(factor.fault, MatrixFault::factor_transposed) << factor.reason;
  const ConventionDiagnosis arm = spoiled([](const Matrix6& M, const SE3d& T) {
    Matrix6 J = T.Adj();
    J.topRightCorner<3, 3>() *= -1;
    return Matrix6(J * M * J.transpose());
  });
  EXPECT_EQ(arm.fault, MatrixFault::lever_arm_sign) << arm.reason;
  const ConventionDiagnosis transposed = spoiled([](const Matrix6& M, const SE3d& T) {
    const Matrix6 J = T.Adj().transpose();
    return Matrix6(J * M * J.transpose());
  });
  EXPECT_EQ(transposed.fault, MatrixFault::adjoint_transposed) << transposed.reason;
}

TEST(ConventionDiagnosis, UnknownCrossBlocksAreNotZero) {
  CounterRng rng(13);
  const TrajectoryScene scene = experiments::independentScene({.n = 300}, rng);
  std::vector<DiagnosedPose> poses = written(scene, convention(P::world_body_axes));
  for (DiagnosedPose& p : poses) {
    p.matrix.topRightCorner<3, 3>().setConstant(std::numeric_limits<double>::quiet_NaN());
    p.matrix.bottomLeftCorner<3, 3>().setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  const ConventionDiagnosis d = diagnoseConventions(poses);
  EXPECT_TRUE(d.structure.blocks_only);
  EXPECT_TRUE(contains(d.accepted, convention(P::world_body_axes))) << d.reason;
  EXPECT_EQ(d.accepted.size(), 1u) << d.reason;
  for (const HypothesisFit& f : d.fits) EXPECT_NE(f.convention.perturbation, P::left);
}

TEST(ConventionDiagnosis, BadInputIsSaid) {
  EXPECT_EQ(diagnoseConventions({}).verdict, DiagnosisVerdict::undecidable);
  CounterRng rng(14);
  const TrajectoryScene scene = experiments::independentScene({.n = 30}, rng);
  std::vector<DiagnosedPose> poses = written(scene, convention(P::right));
  EXPECT_EQ(diagnoseConventions(std::span(poses).first(5)).verdict, DiagnosisVerdict::undecidable);
  poses[3].matrix.setConstant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(diagnoseConventions(poses).skipped, 1u);
  for (DiagnosedPose& p : poses) p.matrix(2, 2) = -1;
  const ConventionDiagnosis d = diagnoseConventions(poses);
  EXPECT_EQ(d.verdict, DiagnosisVerdict::none);
  EXPECT_GT(d.structure.indefinite, 0u);
  EXPECT_FALSE(d.notes.empty());
  EXPECT_FALSE(diagnoseChain({}).is_chain);
  EXPECT_TRUE(planDiagnosis({}).empty());
}

// --- Whole files -----------------------------------------------------------------------------------------------------

CovarianceDiagnosis diagnosed(const DiagnosedRun& run, const CovarianceDiagnosisOptions& options = {}) {
  return diagnoseCovariances(std::span(&run, 1), options);
}

TEST(CovarianceDiagnosis, VerdictsAreYesNoAndNone) {
  CounterRng rng(21);
  TrajectoryScene scene = experiments::independentScene({.n = 60}, rng);
  const DiagnosedRun right{written(scene, convention(P::world_axes)), scene.times};
  const CovarianceDiagnosis yes = diagnosed(right);
  EXPECT_TRUE(yes.verdict().isYes()) << yes.verdict().text;
  EXPECT_EQ(yes.verdict().text, "identified: " + describe(convention(P::world_axes)));
  EXPECT_EQ(yes.best(), convention(P::world_axes));
  EXPECT_EQ(yes.assumed, Convention{});
  EXPECT_EQ(yes.times, scene.times);
  EXPECT_EQ(yes.what, "poses");
  const CovarianceDiagnosis few = diagnosed({{right.poses.begin(), right.poses.begin() + 5}, {}});
  EXPECT_TRUE(few.verdict().isNone());
  EXPECT_EQ(few.verdict().text.rfind("UNDECIDABLE: 5 poses", 0), 0U) << few.verdict().text;
  EXPECT_FALSE(few.best());
  for (auto& g : scene.estimate) g.covariance *= 0.25;
  const CovarianceDiagnosis no = diagnosed({written(scene, convention(P::right)), {}});
  EXPECT_TRUE(no.verdict().isNo());
  EXPECT_EQ(no.verdict().text.rfind("INCONSISTENT: ", 0), 0U) << no.verdict().text;
  EXPECT_EQ(no.verdict().causes, no.diagnosis->notes);
  DiagnosedRun broken{written(scene, convention(P::right)), {}};
  for (DiagnosedPose& p : broken.poses) p.matrix(2, 2) = -1;
  EXPECT_TRUE(diagnosed(broken).verdict().isNo());
  EXPECT_EQ(diagnosed(broken).verdict().text.rfind("NONE: ", 0), 0U);
  EXPECT_TRUE(diagnoseCovariances({}).verdict().isNone());
}

TEST(CovarianceDiagnosis, ChainAndPlan) {
  CounterRng rng(22);
  const TrajectoryScene scene =
      experiments::deadReckoningScene({.n = 200, .sigma_translation = 0.01, .sigma_rotation = 0.002}, rng);
  const DiagnosedRun run{written(scene, convention(P::right)), {}};
  const CovarianceDiagnosis chain = diagnosed(run, {.mode = DiagnosisMode::chain});
  EXPECT_FALSE(chain.diagnosis);
  EXPECT_EQ(chain.verdict().text, "identified: " + describe(convention(P::right)));
  EXPECT_EQ(chain.accepted(), std::vector{convention(P::right)});
  // Independent of each other: no convention lets it grow.
  const TrajectoryScene corrected = experiments::independentScene({.n = 60}, rng);
  const CovarianceDiagnosis none =
      diagnosed({written(corrected, convention(P::right)), {}}, {.mode = DiagnosisMode::chain});
  EXPECT_FALSE(none.chain->is_chain);
  EXPECT_TRUE(none.verdict().isNone());
  EXPECT_EQ(none.verdict().text, "UNDECIDABLE: " + none.chain->reason);
  // A plan always has an answer; contents are told apart at once.
  const CovarianceDiagnosis plan = diagnosed(run, {.mode = DiagnosisMode::plan});
  EXPECT_TRUE(plan.verdict().isYes());
  ASSERT_EQ(plan.plan.size(), 18U);
  for (const PlanRow& row : plan.plan) EXPECT_EQ(row.convention.unit, U::radian);
  EXPECT_EQ(diagnosed(run, {.mode = DiagnosisMode::plan, .all_units = true}).plan.size(), 72U);
  const auto decided = std::count_if(plan.plan.begin(), plan.plan.end(), [](const PlanRow& row) {
    return row.equal.empty() && row.poses > 0 && row.poses <= 200;
  });
  EXPECT_EQ(plan.verdict().text,
            "With its 200 poses this file tells " + std::to_string(decided) + " of 18 conventions from all others.");
}

TEST(CovarianceDiagnosis, FormatsAndEdgesLeaveFewerHypotheses) {
  CounterRng rng(23);
  const TrajectoryScene scene = experiments::independentScene({.n = 60}, rng);
  const auto rt = CovarianceOrder::rotation_translation;
  const DiagnosedRun run{written(scene, convention(P::right, U::half_angle, CovarianceContent::information, rt)),
                         scene.times};
  const CovarianceDiagnosis d = diagnosed(
      run, {.alignment = AlignmentModel::se3, .order = rt, .content = CovarianceContent::information, .edges = true});
  EXPECT_EQ(d.diagnosis->fits.size(), 36U);
  EXPECT_EQ(d.accepted(), std::vector{convention(P::right, U::half_angle, CovarianceContent::information, rt)});
  EXPECT_EQ(d.assumed, convention(P::right, U::radian, CovarianceContent::information, rt));
  EXPECT_EQ(d.what, "edges");
  EXPECT_EQ(d.alignment, AlignmentModel::none) << "edges have no world";
}

TEST(CovarianceDiagnosis, PosesMeetTheTruthAtTheirTimes) {
  CounterRng rng(26);
  const TrajectoryScene scene = experiments::independentScene({.n = 60}, rng);
  const PoseTrajectory estimate{.times = scene.times, .poses = scene.estimate, .has_covariances = true, .name = "a"};
  PoseTrajectory truth{.times = scene.times, .poses = exactPoses(scene.truth), .name = "b"};
  const RunAgainstTruth all = runAgainstTruth(truth, estimate);
  ASSERT_TRUE(all.ok()) << all.reason;
  ASSERT_EQ(all.run.poses.size(), 60U);
  EXPECT_EQ(all.run.poses[7].truth.params(), scene.truth[7].params());
  EXPECT_EQ(all.run.poses[7].matrix, scene.estimate[7].covariance);
  EXPECT_EQ(all.run.times, scene.times);
  EXPECT_TRUE(all.run.notes.empty());
  // A part of the truth; quaternions of the truth with w first.
  for (std::size_t i = 0; i < truth.poses.size(); ++i) {
    SE3d& pose = truth.poses.mean(i);
    const Eigen::Vector4d q = pose.so3().params();
    pose = SE3d(SO3d(Eigen::Quaterniond(q[2], q[3], q[0], q[1])), Eigen::Vector3d(pose.translation()));
  }
  const RunAgainstTruth part = runAgainstTruth(truth, estimate, {.start = scene.times[10], .end = scene.times[40]});
  ASSERT_EQ(part.run.poses.size(), 31U);
  EXPECT_EQ(part.run.times.front(), scene.times[10]);
  ASSERT_EQ(part.run.notes.size(), 2U);
  EXPECT_NE(part.run.notes[0].find("quaternions of b look as if w came first"), std::string::npos);
  EXPECT_EQ(part.run.notes[1], "31 of 60 poses of a have a partner in b");
  EXPECT_EQ(diagnosed(part.run).file_notes, part.run.notes);
  EXPECT_EQ(runAgainstTruth(truth, estimate, {.start = 1e6}).status, EvaluationStatus::empty_interval);
  truth.times.clear();
  EXPECT_EQ(runAgainstTruth(truth, estimate, {.start = 0}).status, EvaluationStatus::times_missing);
  EXPECT_EQ(runAgainstTruth(truth, estimate).status, EvaluationStatus::times_missing);
}

TEST(CovarianceDiagnosis, SeveralRunsGiveOneResidualEach) {
  const TrajectorySceneOptions options{.n = 10, .sigma_translation = 0.01, .sigma_rotation = 0.002};
  std::vector<DiagnosedRun> runs;
  for (std::uint64_t r = 0; r < 40; ++r) {
    CounterRng rng(24, r);
    const TrajectoryScene scene = experiments::deadReckoningScene(options, rng);
    runs.push_back({written(scene, convention(P::left)), scene.times});
  }
  // One run ends before the others: the last common time is its end.
  runs[7].poses.pop_back(), runs[7].times.pop_back();
  const CovarianceDiagnosis last = diagnoseCovariances(runs);
  ASSERT_EQ(last.poses.size(), 40U);
  EXPECT_EQ(last.poses[0].truth.params(), runs[0].poses[8].truth.params());
  EXPECT_FALSE(last.diagnosis->correlated);
  EXPECT_TRUE(contains(last.accepted(), convention(P::left))) << last.verdict().text;
  const CovarianceDiagnosis at =
      diagnoseCovariances(runs, {.at = runs[0].times[3] + 0.2 * (runs[0].times[4] - runs[0].times[3])});
  EXPECT_EQ(at.poses[5].truth.params(), runs[5].poses[3].truth.params());
  // Without times the rows count.
  for (DiagnosedRun& run : runs) run.times.clear();
  EXPECT_EQ(diagnoseCovariances(runs, {.at = 2}).poses[1].truth.params(), runs[1].poses[2].truth.params());
  EXPECT_EQ(diagnoseCovariances(runs, {.at = 2}).what, "runs at 2 s");
}

TEST(CovarianceDiagnosis, AReadingShowsTheErrorsOfOneConvention) {
  CounterRng rng(25);
  const TrajectoryScene scene = experiments::independentScene({.n = 60}, rng);
  std::vector<DiagnosedPose> poses = written(scene, convention(P::left));
  const ConventionReading right = readInConvention(poses, convention(P::left), AlignmentModel::none);
  EXPECT_TRUE(right.consistency.tests.consistent());
  EXPECT_LT((right.poses[3].covariance - scene.estimate[3].covariance).norm(), 1e-12);
  EXPECT_FALSE(readInConvention(poses, convention(P::right), AlignmentModel::none).consistency.tests.consistent());
  EXPECT_TRUE(readInConvention(poses, convention(P::left), std::nullopt).consistency.errors.empty());
  // An unknown cross block counts as zero.
  poses[0].matrix(0, 4) = poses[0].matrix(4, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(readInConvention(poses, convention(P::right), std::nullopt).poses[0].covariance.allFinite());
}

// A robot in the plane: its file is right in x, y and yaw, and has fillers in the others. With all six judged none of
// these was identified: they were called inflated, or indefinite.
TEST(ConventionDiagnosis, PlanarRobotsAreJudgedByWhatCarriesNoise) {
  const auto rt = CovarianceOrder::rotation_translation;
  const auto covariance = CovarianceContent::covariance;
  for (const AlignmentModel model : {AlignmentModel::none, AlignmentModel::se3}) {
    const SE3d world = model == AlignmentModel::none ? SE3d() : SE3d(SO3d::rotZ(1.1), Eigen::Vector3d(3, -2, 0));
    for (const Convention& c : {convention(P::right), convention(P::world_axes), convention(P::left),
                                convention(P::right, U::half_angle), convention(P::right, U::radian, covariance, rt)}) {
      for (const double filler : {0.0, 1e-6, 1e6}) {
        CounterRng rng(91);
        const TrajectoryScene scene = experiments::emptyScene({.motion = SceneMotion::planar, .n = 300}, rng);
        std::vector<DiagnosedPose> poses;
        for (const SE3d& T : scene.truth) {
          Matrix6 L = Matrix6::Zero();
          L(0, 0) = 0.05, L(1, 0) = 0.01, L(1, 1) = 0.03, L(5, 0) = 0.002, L(5, 1) = 0.004, L(5, 5) = 0.01;
          L *= std::exp(rng.uniform() - 0.5);
          const Eigen::Matrix<double, 6, 1> error = L * rng.normalVector<6>();
          const SE3d at = world * T * SE3d::exp(error).inverse();
          const Matrix6 J = conventionJacobian(convention(c.perturbation, c.unit), at);
          Matrix6 M = J * (L * L.transpose()) * J.transpose();
          for (const int k : {2, 3, 4}) M(k, k) = filler;
          if (c.order == rt) {
            Matrix6 exchanged;
            for (int k = 0; k < 36; ++k) exchanged(k / 6, k % 6) = M((k / 6 + 3) % 6, (k % 6 + 3) % 6);
            M = exchanged;
          }
          poses.push_back({at, M, T});
        }
        const ConventionDiagnosis d = diagnoseConventions(poses, {.alignment = model});
        const std::string what = conventionName(c, false) + ", filler " + std::to_string(filler) + ": " + d.reason;
        EXPECT_TRUE(contains(d.accepted, c)) << what;
        // Fixed axes, body orientation and roll-pitch-yaw are one in the plane.
        EXPECT_EQ(d.verdict,
                  c.perturbation == P::world_axes ? DiagnosisVerdict::undecidable : DiagnosisVerdict::identified)
            << what;
        EXPECT_TRUE(d.tests.consistent()) << what;
        EXPECT_NE(std::find(d.notes.begin(), d.notes.end(),
                            "not judged: z, rotation x, rotation y (errors are zero in every row)"),
                  d.notes.end())
            << what;
      }
    }
  }
}

bool anySays(const std::vector<std::string>& sentences, const std::string& words) {
  return std::any_of(sentences.begin(), sentences.end(),
                     [&](const std::string& s) { return s.find(words) != std::string::npos; });
}

TEST(ConventionDiagnosis, SentencesOnMatricesAreTrue) {
  CounterRng rng(31);
  const TrajectoryScene scene = experiments::independentScene({.n = 30}, rng);
  const double unknown = std::nan("");
  // Unknown cross blocks: the matrices differ all the same.
  std::vector<DiagnosedPose> poses = written(scene, convention(P::right));
  for (DiagnosedPose& p : poses)
    p.matrix.topRightCorner<3, 3>().fill(unknown), p.matrix.bottomLeftCorner<3, 3>().fill(unknown);
  EXPECT_FALSE(anySays(matrixStructure(poses).words(), "are the same"));
  for (DiagnosedPose& p : poses) p.matrix = poses[0].matrix;
  EXPECT_TRUE(anySays(matrixStructure(poses).words(), "are the same"));
  // Nothing known is not zero.
  for (DiagnosedPose& p : poses) p.matrix.fill(unknown);
  EXPECT_EQ(matrixStructure(poses).unknown, poses.size());
  EXPECT_TRUE(matrixStructure(poses).words().empty());
  // Zeros of a robot in the plane make nothing indefinite.
  poses = written(scene, convention(P::right));
  for (DiagnosedPose& p : poses) {
    for (const int k : {2, 3, 4}) p.matrix.row(k).setZero(), p.matrix.col(k).setZero();
  }
  EXPECT_EQ(matrixStructure(poses).indefinite, 0U);
  EXPECT_TRUE(anySays(matrixStructure(poses).words(), "3, 4, 5 are zero in every row"));
}

TEST(ConventionDiagnosis, AConstantCovarianceIsNoDeadReckoning) {
  CounterRng rng(32);
  std::vector<DiagnosedPose> poses = written(experiments::independentScene({.n = 60}, rng), convention(P::right));
  for (DiagnosedPose& p : poses) p.matrix = poses[0].matrix;
  EXPECT_FALSE(diagnoseChain(poses).is_chain);
}

TEST(ConventionDiagnosis, ScalesThatAreRightAreNotListed) {
  const ScaleProfile of_translation{.translation = 4, .rotation = 1.02, .relative_sigma = 0.05};
  ASSERT_EQ(of_translation.words().size(), 1U);
  EXPECT_EQ(of_translation.words()[0].rfind("translation block: inflated", 0), 0U);
  EXPECT_TRUE((ScaleProfile{.translation = 0.98, .rotation = 1.02, .relative_sigma = 0.05}).words().empty());
}

TEST(ConventionDiagnosis, NoConventionExplainsErrorsOfAnUnknownCause) {
  CounterRng rng(33);
  std::vector<DiagnosedPose> poses = written(experiments::independentScene({.n = 200}, rng), convention(P::right));
  for (DiagnosedPose& p : poses) p.truth = p.truth * SE3d::trans(0.03, 0, 0);
  const ConventionDiagnosis d = diagnoseConventions(poses);
  EXPECT_EQ(d.verdict, DiagnosisVerdict::inconsistent);
  EXPECT_TRUE(d.accepted.empty());
  EXPECT_NE(d.reason.find("the cause is unknown"), std::string::npos) << d.reason;
}

}  // namespace
}  // namespace liestat
