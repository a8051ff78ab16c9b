// Trajectories against a reference: association, alignments and their covariance, NEES with the right degrees of
// freedom, absolute and relative errors beside an independent computation, bad input.

#include <experiments/trajectory_scene.hpp>
#include <fusion/nearest_in_time.hpp>
#include <fusion/trajectories.hpp>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

namespace liestat {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector7 = Eigen::Matrix<double, 7, 1>;
using experiments::SceneMotion;
using experiments::SceneNoise;
using experiments::TrajectoryScene;
using experiments::TrajectorySceneOptions;

SE3d randomPose(CounterRng& rng, double size = 5) {
  return SE3d(SO3d(rng.unitQuaternion()), Eigen::Vector3d(size * rng.normalVector<3>()));
}

/// Pairs of a scene whose estimate is written in another world: T̂ ↦ A⁻¹ T̂, for posyaw with a yaw only.
struct Moved {
  std::vector<MatchedPose> poses;
  SE3d A;
  double scale = 1;
};
Moved moved(const TrajectoryScene& scene, AlignmentModel model, CounterRng& rng) {
  Moved m;
  if (model == AlignmentModel::posyaw) {
    m.A = SE3d(SO3d::rotZ(6 * rng.uniform()), Eigen::Vector3d(5 * rng.normalVector<3>()));
  } else if (model != AlignmentModel::none) {
    m.A = randomPose(rng);
  }
  if (model == AlignmentModel::sim3) m.scale = std::exp(rng.uniform(-1, 1));
  for (std::size_t i = 0; i < scene.truth.size(); ++i) {
    Gaussian<SE3d> g = scene.estimate[i];
    const SO3d Rt = m.A.so3().inverse();
    g.mean = SE3d(Rt * g.mean.so3(), Eigen::Vector3d(Rt * (g.mean.translation() - m.A.translation()) / m.scale));
    g.covariance.topRows<3>() /= m.scale, g.covariance.leftCols<3>() /= m.scale;
    m.poses.push_back({{scene.truth[i], Matrix6::Zero()}, g});
  }
  return m;
}

TEST(Trajectories, AssociationByInterpolation) {
  const std::vector<double> reference{0, 1, 2, 5, 6}, estimate{-0.5, 0, 0.25, 2, 3, 5.5, 6, 6.5};
  const auto matches = associateByInterpolation(reference, estimate, 1.5);
  ASSERT_EQ(matches.size(), 5u);  // -0.5 and 6.5 are outside, 3 lies in a gap of 3 s
  const std::vector<std::size_t> rows{1, 2, 3, 5, 6}, at{0, 0, 2, 3, 4};
  const std::vector<double> fractions{0, 0.25, 0, 0.5, 0};
  for (std::size_t k = 0; k < 5; ++k) {
    EXPECT_EQ(matches[k].estimate, rows[k]);
    EXPECT_EQ(matches[k].reference, at[k]);
    EXPECT_DOUBLE_EQ(matches[k].fraction, fractions[k]);
  }
  EXPECT_EQ(associateByInterpolation(reference, estimate).size(), 6u);
  EXPECT_EQ(associateByInterpolation(reference, std::vector<double>{10}, 9, -9.5).size(), 1u);
  EXPECT_TRUE(associateByInterpolation({}, estimate).empty());
  EXPECT_TRUE(associateByInterpolation(reference, {}).empty());

  // On a screw motion the geodesic is exact; SLERP is off by the sagitta of the position.
  const Vector6 twist = (Vector6() << 1, 0, 0.2, 0, 0, 0.8).finished();
  std::vector<SE3d> curve;
  for (const double t : reference) curve.push_back(SE3d::exp(Vector6(t * twist)));
  const auto exact = exactPoses(curve);
  std::vector<Gaussian<SE3d>> there(estimate.size());
  for (std::size_t i = 0; i < estimate.size(); ++i) there[i].mean = SE3d::exp(Vector6(estimate[i] * twist));
  const auto geodesic = matchedPoses(matches, exact, there, PoseInterpolation::geodesic);
  const auto slerp = matchedPoses(matches, exact, there, PoseInterpolation::slerp);
  double off = 0;
  for (std::size_t k = 0; k < 5; ++k) {
    EXPECT_LT((geodesic[k].reference.mean.inverse() * geodesic[k].estimate.mean).log().norm(), 1e-13);
    EXPECT_LT((slerp[k].reference.mean.so3().inverse() * slerp[k].estimate.mean.so3()).log().norm(), 1e-13);
    off = std::max(off, (slerp[k].reference.mean.translation() - slerp[k].estimate.mean.translation()).norm());
  }
  EXPECT_GT(off, 0.05);
  EXPECT_LT(off, 0.2);
}

TEST(Trajectories, AssociationAsEvo) {
  // By its definition, in O(n²).
  const auto slow = [](const std::vector<double>& ref, const std::vector<double>& est, double max_diff, double offset) {
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    const bool longer = est.size() > ref.size();
    const auto &a = longer ? ref : est, &b = longer ? est : ref;
    for (std::size_t i = 0; i < a.size(); ++i) {
      std::size_t best = 0;
      const auto d = [&](std::size_t j) { return std::abs(b[j] + (longer ? offset : -offset) - a[i]); };
      for (std::size_t j = 1; j < b.size(); ++j) {
        if (d(j) < d(best)) best = j;
      }
      if (d(best) <= max_diff) pairs.emplace_back(longer ? i : best, longer ? best : i);
    }
    return pairs;
  };
  for (std::uint64_t trial = 0; trial < 40; ++trial) {
    CounterRng rng(8, trial);
    std::vector<double> ref(3 + trial), est(30);
    for (double& t : ref) t = 0.01 * std::floor(300 * rng.uniform());
    for (double& t : est) t = 0.01 * std::floor(300 * rng.uniform());
    std::sort(ref.begin(), ref.end()), std::sort(est.begin(), est.end());
    const double offset = trial % 3 == 0 ? 0.02 : 0;
    const auto expected = slow(ref, est, 0.05, offset);
    const auto matches = associateNearest(ref, est, 0.05, offset);
    ASSERT_EQ(matches.size(), expected.size()) << trial;
    for (std::size_t k = 0; k < matches.size(); ++k) {
      EXPECT_EQ(matches[k].reference, expected[k].first) << trial;
      EXPECT_EQ(matches[k].estimate, expected[k].second) << trial;
    }
  }
}

TEST(Trajectories, TheNearestTimeIsTheEarlierOfTwo) {
  const std::vector<double> times{0, 1, 1, 2, 4};
  EXPECT_EQ(nearestInTime(times, -5), 0U);
  EXPECT_EQ(nearestInTime(times, 1.2), 1U) << "the first of equal ones";
  EXPECT_EQ(nearestInTime(times, 3), 3U) << "the earlier of two as near";
  EXPECT_EQ(nearestInTime(times, 3.1), 4U);
  EXPECT_EQ(nearestInTime(times, 9), 4U);
  EXPECT_EQ(nearestInTime(times, 11.9, 10), 3U) << "shifted";
  EXPECT_EQ(nearestInTime({}, 1), 0U);
}

TEST(Trajectories, ExactPosesAreAlignedExactly) {
  for (const AlignmentModel model :
       {AlignmentModel::origin, AlignmentModel::posyaw, AlignmentModel::se3, AlignmentModel::sim3}) {
    CounterRng rng(4);
    TrajectoryScene scene = experiments::independentScene({.n = 20}, rng);
    for (std::size_t i = 0; i < 20; ++i) scene.estimate[i].mean = scene.truth[i];
    const Moved m = moved(scene, model, rng);
    for (const Alignment& a : {alignWeighted(m.poses, model), alignUmeyama(m.poses, model)}) {
      ASSERT_TRUE(a.ok) << name(model) << ": " << a.fault;
      EXPECT_NEAR(a.scale, m.scale, 1e-12);
      EXPECT_LT((a.transform.inverse() * m.A).log().norm(), 1e-11) << name(model);
      for (const double e : absoluteErrors(m.poses, a, PoseRelation::full)) EXPECT_LT(e, 1e-11);
    }
  }
}

struct AlignmentTrials {
  double mean = 0;      ///< mean NEES over its degrees of freedom
  double rejected = 0;  ///< at 5 %, two-sided
  double covered = 0;   ///< share of trials with the alignment's error inside its 95 % ellipsoid
  double position = 0, rotation = 0;
  double log_scale_bias = 0;  ///< bias of the weighted scale, in its own sigmas
  double umeyama_bias = 0;    ///< bias of the least-squares scale, in the same
  double dof = 0;
};
AlignmentTrials run(AlignmentModel model, std::size_t n, int trials, std::size_t n_to_align = 0, double wrong = 1) {
  AlignmentTrials t;
  for (int trial = 0; trial < trials; ++trial) {
    CounterRng rng(21, static_cast<std::uint64_t>(trial), static_cast<std::uint32_t>(n));
    TrajectorySceneOptions options{.motion = model == AlignmentModel::posyaw ? SceneMotion::yaw : SceneMotion::space,
                                   .n = n};
    options.step = 20. / static_cast<double>(n);
    TrajectoryScene scene = experiments::independentScene(options, rng);
    Moved m = moved(scene, model, rng);
    for (MatchedPose& p : m.poses) p.estimate.covariance *= wrong;
    const Alignment a = alignWeighted(m.poses, model, n_to_align);
    EXPECT_TRUE(a.ok) << name(model) << ' ' << a.fault;
    const Consistency c = evaluateConsistency(m.poses, a);
    EXPECT_TRUE(c.ok) << c.fault;
    t.mean += c.joint.ratio(), t.position += c.position.ratio(), t.rotation += c.rotation.ratio();
    t.rejected += c.joint.p < 0.05;
    t.dof = c.joint.dof;
    if (a.parameters == 0) continue;
    // δ = (δt, δφ, δσ) from the estimate to the truth, of the free parameters.
    Vector7 delta;
    delta << m.A.translation() - a.transform.translation(), (m.A.so3() * a.transform.so3().inverse()).log(),
        std::log(m.scale / a.scale);
    Eigen::VectorXd d(a.parameters);
    Eigen::MatrixXd C(a.parameters, a.parameters);
    std::vector<int> free;
    for (int k = 0; k < 7; ++k) {
      if (a.covariance(k, k) > 0) free.push_back(k);
    }
    EXPECT_EQ(static_cast<int>(free.size()), a.parameters);
    for (int i = 0; i < a.parameters; ++i) {
      d[i] = delta[free[static_cast<std::size_t>(i)]];
      for (int j = 0; j < a.parameters; ++j) {
        C(i, j) = a.covariance(free[static_cast<std::size_t>(i)], free[static_cast<std::size_t>(j)]);
      }
    }
    t.covered += d.dot(C.llt().solve(d)) < chiSquaredQuantile(0.95, a.parameters);
    if (model == AlignmentModel::sim3) {
      const double sigma = std::sqrt(a.covariance(6, 6));
      t.log_scale_bias -= delta[6] / sigma;
      t.umeyama_bias += std::log(alignUmeyama(m.poses, model).scale / m.scale) / sigma;
    }
  }
  for (double* x : {&t.mean, &t.rejected, &t.covered, &t.position, &t.rotation, &t.log_scale_bias, &t.umeyama_bias}) {
    *x /= trials;
  }
  return t;
}

TEST(Trajectories, NeesHasItsDegreesOfFreedom) {
  const struct {
    AlignmentModel model;
    int taken;
  } cases[] = {
      {AlignmentModel::none, 0}, {AlignmentModel::posyaw, 4}, {AlignmentModel::se3, 6}, {AlignmentModel::sim3, 7}};
  for (const auto& c : cases) {
    for (const std::size_t n : {std::size_t{5}, std::size_t{20}, std::size_t{100}}) {
      const int trials = n == 100 ? 100 : 400;
      const AlignmentTrials t = run(c.model, n, trials);
      const std::string what = std::string(name(c.model)) + ", n = " + std::to_string(n);
      EXPECT_EQ(t.dof, 6. * static_cast<double>(n) - c.taken) << what;
      // Four standard errors of the mean of χ²/dof; 1 % for the second order of the errors.
      EXPECT_NEAR(t.mean, 1, 4 * std::sqrt(2 / (t.dof * trials)) + 0.01) << what;
      EXPECT_NEAR(t.position, 1, 4 * std::sqrt(4 / (t.dof * trials)) + 0.01) << what;
      EXPECT_NEAR(t.rotation, 1, 4 * std::sqrt(4 / (t.dof * trials)) + 0.01) << what;
      EXPECT_NEAR(t.rejected, 0.05, 4 * std::sqrt(0.05 * 0.95 / trials)) << what;
      if (c.taken > 0) {
        EXPECT_NEAR(t.covered, 0.95, 3 * std::sqrt(0.05 * 0.95 / trials)) << what;
      }
    }
  }
}

TEST(Trajectories, PosesBesideTheAlignedOnesShareItsCovariance) {
  for (const std::size_t m : {std::size_t{1}, std::size_t{5}}) {
    const AlignmentTrials t = run(AlignmentModel::se3, 40, 300, m);
    EXPECT_EQ(t.dof, 6. * static_cast<double>(40 - m));
    EXPECT_NEAR(t.mean, 1, 4 * std::sqrt(2 / (t.dof * 300)) + 0.01) << m;
    EXPECT_NEAR(t.position, 1, 0.1) << m;
    EXPECT_NEAR(t.rejected, 0.05, 0.05) << m;
  }
}

/// Trials of evaluateConsistency on clean runs in which any test, and each by itself, fires.
std::array<int, 8> fired(AlignmentModel model, std::size_t n, std::size_t n_to_align, int trials, double wrong = 1,
                         SceneMotion motion = SceneMotion::space) {
  std::array<int, 8> count{};
  for (int trial = 0; trial < trials; ++trial) {
    CounterRng rng(27, static_cast<std::uint64_t>(trial), static_cast<std::uint32_t>(100 * n + n_to_align));
    Moved m = moved(experiments::independentScene({.motion = motion, .n = n}, rng), model, rng);
    for (MatchedPose& p : m.poses) p.estimate.covariance *= wrong;
    const Consistency c = evaluateConsistency(m.poses, alignWeighted(m.poses, model, n_to_align));
    EXPECT_TRUE(c.ok) << c.fault;
    const auto all = c.tests.all();
    for (std::size_t k = 0; k < 7; ++k) count[k] += all[k].fires();
    count[7] += c.tests.anyFires();
  }
  return count;
}

// An alignment from a few poses is an error that all others share. Whitened one by one they fail the tests of mean,
// covariance and lag in a third to all of clean runs. Rates of 0.001 and 0.007: 5 and 18 of 1000 are four standard
// errors above.
TEST(Trajectories, SharedAlignmentKeepsTheLevelOfAllSevenTests) {
  const struct {
    AlignmentModel model;
    std::size_t n, aligned;
    SceneMotion motion;
  } cases[] = {{AlignmentModel::origin, 40, 1, SceneMotion::space}, {AlignmentModel::se3, 60, 10, SceneMotion::space},
               {AlignmentModel::se3, 40, 20, SceneMotion::small},   {AlignmentModel::sim3, 60, 20, SceneMotion::space},
               {AlignmentModel::posyaw, 40, 10, SceneMotion::yaw},  {AlignmentModel::se3, 20, 0, SceneMotion::small}};
  for (const auto& c : cases) {
    const std::string what = std::string(name(c.model)) + ", aligned by " + std::to_string(c.aligned);
    const auto count = fired(c.model, c.n, c.aligned, 1000, 1, c.motion);
    for (std::size_t k = 0; k < 7; ++k) {
      EXPECT_LE(count[k], 5) << what << ": " << name(static_cast<ResidualTestKind>(k));
    }
    EXPECT_LE(count[7], 18) << what;
  }
  // Covariances × 0.8, 200 poses that are tested: 95 of 100 at least; 90 are 2.3 standard errors below.
  for (const std::size_t aligned : {std::size_t{10}, std::size_t{50}}) {
    EXPECT_GE(fired(AlignmentModel::se3, 200 + aligned, aligned, 100, 0.8)[7], 90) << aligned;
  }
}

/// A robot in the plane: right covariances in x, y and yaw times `factor`, and in the others what `fill` makes.
std::vector<MatchedPose> planar(CounterRng& rng, std::size_t n, double factor, bool moved,
                                const std::function<void(Vector6&, Matrix6&)>& fill) {
  const TrajectoryScene scene = experiments::emptyScene({.motion = SceneMotion::planar, .n = n}, rng);
  std::vector<MatchedPose> poses;
  const SE3d world = moved ? SE3d(SO3d::rotZ(1.1), Eigen::Vector3d(3, -2, 0.5)) : SE3d();
  for (const SE3d& T : scene.truth) {
    const double g = std::exp(0.5 * (2 * rng.uniform() - 1));
    const Eigen::Matrix3d L = g * (Eigen::Matrix3d() << 0.05, 0, 0, 0.01, 0.03, 0, 0.002, 0.004, 0.01).finished();
    const Eigen::Vector3d e = L * rng.normalVector<3>();
    const Eigen::Matrix3d C = factor * L * L.transpose();
    Vector6 error = Vector6::Zero();
    Matrix6 covariance = Matrix6::Zero();
    const std::array<int, 3> at{0, 1, 5};
    for (int i = 0; i < 3; ++i) {
      error[at[i]] = e[i];
      for (int j = 0; j < 3; ++j) covariance(at[i], at[j]) = C(i, j);
    }
    fill(error, covariance);
    poses.push_back({{T, Matrix6::Zero()}, {world * T * SE3d::exp(error).inverse(), covariance}});
  }
  return poses;
}

TEST(Trajectories, PlanarRobotsAreJudgedByWhatCarriesNoise) {
  for (const AlignmentModel model :
       {AlignmentModel::none, AlignmentModel::origin, AlignmentModel::posyaw, AlignmentModel::se3}) {
    for (const double filler : {0.0, 1e-9, 1e-6, 99999.0, 1e308}) {
      CounterRng rng(33);
      const auto fill = [&](Vector6&, Matrix6& C) { C(2, 2) = C(3, 3) = C(4, 4) = filler; };
      const auto poses = planar(rng, 350, 1, model != AlignmentModel::none, fill);
      const Consistency c = evaluateConsistency(poses, alignWeighted(poses, model));
      ASSERT_TRUE(c.ok) << c.fault;
      EXPECT_EQ(c.tests.components.judged(), "x, y, rotation z");
      EXPECT_EQ(c.joint.dof, 3 * 350 - (model == AlignmentModel::none ? 0 : 3)) << name(model);
      EXPECT_TRUE(c.tests.consistent()) << name(model) << ' ' << filler << ' ' << c.joint.ratio();
    }
  }
  // Level and power: 5 of 200 are seven standard errors above 0.007; 95 of 100 are expected, 90 are 2.3 below.
  int alarms = 0, found = 0, small = 0, unlevel = 0;
  for (std::uint64_t trial = 0; trial < 200; ++trial) {
    CounterRng rng(34, trial);
    const auto judged = [&](double factor, const std::function<void(Vector6&, Matrix6&)>& fill) {
      const auto poses = planar(rng, 350, factor, true, fill);
      return evaluateConsistency(poses, alignWeighted(poses, AlignmentModel::se3)).tests;
    };
    const auto filler = [](Vector6&, Matrix6& C) { C(2, 2) = C(3, 3) = C(4, 4) = 1e-6; };
    alarms += !judged(1, filler).consistent();
    if (trial >= 100) continue;
    found += !judged(0.8, filler).consistent();
    // A truth in space and fillers: z has an error that is no statement of the file, but not one that exceeds it.
    small += judged(1, [&](Vector6& e, Matrix6& C) {
               for (const int k : {2, 3, 4}) C(k, k) = 1e-3, e[k] = 0.005 * rng.normalVector<1>()[0];
             }).consistent();
    const auto tests = judged(1, [&](Vector6& e, Matrix6& C) {
      C(2, 2) = 1e-4, e[2] = 0.03 * rng.normalVector<1>()[0];
      C(3, 3) = C(4, 4) = C(5, 5);
      for (const int k : {3, 4}) e[k] = std::sqrt(C(k, k)) * rng.normalVector<1>()[0];
    });
    unlevel += tests.joint.fires() && tests.joint.ratio() > 1;
  }
  EXPECT_LE(alarms, 5);
  EXPECT_GE(found, 90);
  EXPECT_GE(small, 96);
  EXPECT_EQ(unlevel, 100) << "a constant z variance a third of the right sigma is overconfident";
}

/// Errors of correlation rho from pose to pose, with sigmas stated as 1/over of the right ones.
int grossOf(double rho, double over, int trials, AlignmentModel model) {
  int gross = 0;
  for (int trial = 0; trial < trials; ++trial) {
    CounterRng rng(37, static_cast<std::uint64_t>(trial));
    TrajectoryScene scene = experiments::emptyScene({}, rng);
    Vector6 w = rng.normalVector<6>();
    for (const SE3d& T : scene.truth) {
      const Matrix6 C = experiments::sceneCovariance({}, rng), L = C.llt().matrixL();
      scene.estimate.push_back({T * SE3d::exp(Vector6(L * w)).inverse(), C / (over * over)});
      w = rho * w + std::sqrt(1 - rho * rho) * rng.normalVector<6>();
    }
    const Moved m = moved(scene, model, rng);
    const auto tests = evaluateConsistency(m.poses, alignWeighted(m.poses, model)).tests;
    EXPECT_TRUE(tests.lag.fires());
    gross += tests.gross.fires();
  }
  return gross;
}

// False ones of 1200 runs: none; of sigmas three times too small 60 of 60. Docs: theory/trajectories.md, 4.2.
TEST(Trajectories, GrossOverconfidenceIsProvedUnderAnyDependence) {
  for (const AlignmentModel model : {AlignmentModel::none, AlignmentModel::se3}) {
    for (const double rho : {0.6, 0.9, 0.99}) EXPECT_EQ(grossOf(rho, 1, 200, model), 0) << rho;
    EXPECT_GE(grossOf(0.9, 3, 60, model), 57);
  }
}

// The error of interpolation is measured from the reference alone: not less than half of it, and not more than three
// times, which at five stamps a period it is.
TEST(Trajectories, InterpolationErrorOfACoarseReference) {
  const auto curve = [](double t) {
    return SE3d(SO3d::exp(Eigen::Vector3d(0.5 * std::sin(2 * t), 0.4 * std::cos(2.6 * t), 0.3 * std::sin(1.4 * t))),
                Eigen::Vector3d(std::sin(1.8 * t), std::cos(2 * t), 0.1 * t));
  };
  for (const PoseInterpolation rule :
       {PoseInterpolation::cubic, PoseInterpolation::geodesic, PoseInterpolation::slerp}) {
    for (const double step : {0.5, 0.2, 0.1}) {
      std::vector<double> stamps, times;
      std::vector<SE3d> poses;
      for (int k = 0; k * step < 20; ++k) stamps.push_back(k * step), poses.push_back(curve(k * step));
      for (double t = 0.05; t < 19; t += 0.07) times.push_back(t);
      std::vector<Gaussian<SE3d>> there(times.size());
      for (std::size_t i = 0; i < times.size(); ++i) there[i].mean = curve(times[i]);
      const auto reference = exactPoses(poses);
      const auto matches = associateByInterpolation(stamps, times);
      auto matched = matchedPoses(matches, reference, there, rule, stamps);
      const InterpolationError error = addInterpolationError(matches, reference, stamps, rule, matched);
      double position = 0, rotation = 0, stated = 0;
      for (const MatchedPose& p : matched) {
        const Vector6 e = (p.reference.mean.inverse() * p.estimate.mean).log();
        position += e.head<3>().squaredNorm(), rotation += e.tail<3>().squaredNorm();
        stated += p.reference.covariance.topLeftCorner<3, 3>().trace();
      }
      const auto n = static_cast<double>(matched.size());
      EXPECT_TRUE(error.known);
      for (const double ratio : {error.position / std::sqrt(position / n), error.rotation / std::sqrt(rotation / n)}) {
        EXPECT_GT(ratio, 0.5) << name(rule) << ' ' << step;
        EXPECT_LT(ratio, step < 0.3 ? 2 : 3) << name(rule) << ' ' << step;
      }
      EXPECT_NEAR(stated / n, error.position * error.position, 1e-12);
    }
  }
  // At the stamps nothing is interpolated; three stamps show nothing.
  const std::vector<double> stamps{0, 1, 2};
  const auto reference = exactPoses(std::vector<SE3d>{curve(0), curve(1), curve(2)});
  auto matched = matchedPoses(associateByInterpolation(stamps, stamps), reference, reference);
  EXPECT_TRUE(addInterpolationError(associateByInterpolation(stamps, stamps), reference, stamps,
                                    PoseInterpolation::cubic, matched)
                  .known);
  const std::vector<double> between{0.5};
  const auto one = associateByInterpolation(stamps, between);
  matched = matchedPoses(one, reference, reference);
  EXPECT_FALSE(addInterpolationError(one, reference, stamps, PoseInterpolation::cubic, matched).known);
}

TEST(Trajectories, ScaleIsUnbiased) {
  const AlignmentTrials t = run(AlignmentModel::sim3, 1000, 60);
  // The mean of 60 has a standard error of 0.13 sigma; the least-squares scale is 2 to 4 sigma too small.
  EXPECT_LT(std::abs(t.log_scale_bias), 0.45);
  EXPECT_LT(t.umeyama_bias, -1);
}

TEST(Trajectories, AWrongScaleOfTheCovarianceIsSeen) {
  const AlignmentTrials t = run(AlignmentModel::se3, 100, 50, 0, 0.5);
  EXPECT_NEAR(t.mean, 2, 0.1);
  EXPECT_EQ(t.rejected, 1);
}

TEST(Trajectories, LeveragesAddUpToTheParameters) {
  for (const AlignmentModel model : {AlignmentModel::posyaw, AlignmentModel::se3, AlignmentModel::sim3}) {
    CounterRng rng(6);
    const TrajectoryScene scene = experiments::independentScene({.motion = SceneMotion::yaw, .n = 20}, rng);
    const Moved m = moved(scene, model, rng);
    const Alignment a = alignWeighted(m.poses, model);
    ASSERT_TRUE(a.ok);
    const Consistency c = evaluateConsistency(m.poses, a);
    double sum = 0;
    for (const PoseError& e : c.errors) sum += e.leverage;
    EXPECT_NEAR(sum, a.parameters, 1e-9);
  }
}

// Four poses at one place, errors of ±1 along x and ±0.5 about z, covariances I: with a free transformation the mean
// takes a quarter of each covariance, and three degrees of freedom off each part.
TEST(Trajectories, FourEqualPosesByHand) {
  std::vector<MatchedPose> poses;
  for (const double sign : {1.0, -1.0, 1.0, -1.0}) {
    const SE3d truth(SO3d::rotZ(poses.size() < 2 ? 0.5 * sign : -0.5 * sign), Eigen::Vector3d(0, 0, 0));
    const SE3d along(SO3d(), Eigen::Vector3d(sign, 0, 0));
    poses.push_back({{poses.size() < 2 ? along : truth, Matrix6::Zero()}, {SE3d(), Matrix6::Identity()}});
  }
  const Consistency all = evaluateConsistency(poses, alignWeighted(poses, AlignmentModel::se3));
  ASSERT_TRUE(all.ok) << all.fault;
  constexpr double eps = 1e-12;  // that of the alignment, which ends below 1e-6 standard deviations, squared
  for (const PoseError& e : all.errors) {
    EXPECT_LT((e.covariance - 0.75 * Matrix6::Identity()).norm(), eps);
    EXPECT_NEAR(e.leverage, 6.0 / 4, eps);
  }
  EXPECT_EQ(all.joint.dof, 6 * 4 - 6);
  EXPECT_NEAR(all.position.dof, 3 * 4 - 3, eps);
  EXPECT_NEAR(all.rotation.dof, 3 * 4 - 3, eps);
  EXPECT_NEAR(all.joint.statistic, 2.5, eps);
  EXPECT_NEAR(all.position.statistic, 2, eps);
  EXPECT_NEAR(all.rotation.statistic, 0.5, eps);
  // Aligned by the first two, the others have that mean's covariance I/2 besides, and share it: by Woodbury's identity
  // their sum of squares loses |Σ e|²/(2 + 2), and keeps all of its degrees of freedom.
  const Consistency rest = evaluateConsistency(poses, alignWeighted(poses, AlignmentModel::se3, 2));
  ASSERT_TRUE(rest.ok) << rest.fault;
  EXPECT_LT((rest.errors[0].covariance - 0.5 * Matrix6::Identity()).norm(), eps);
  EXPECT_LT((rest.errors[2].covariance - 1.5 * Matrix6::Identity()).norm(), eps);
  const Vector6 one = rest.errors[2].error, other = rest.errors[3].error;
  EXPECT_EQ(rest.position.dof, 3 * 2);
  EXPECT_NEAR(rest.position.statistic,
              one.head<3>().squaredNorm() + other.head<3>().squaredNorm() - (one + other).head<3>().squaredNorm() / 4,
              eps);
  EXPECT_NEAR(rest.joint.statistic, one.squaredNorm() + other.squaredNorm() - (one + other).squaredNorm() / 4, eps);
}

// Leverage is what the alignment takes off each covariance, relatively.
TEST(Trajectories, CovariancesAfterTheAlignmentAreSmallerByTheLeverage) {
  for (const AlignmentModel model : {AlignmentModel::posyaw, AlignmentModel::se3, AlignmentModel::sim3}) {
    CounterRng rng(23);
    const Moved m = moved(experiments::independentScene({.n = 12}, rng), model, rng);
    const Consistency c = evaluateConsistency(m.poses, alignWeighted(m.poses, model));
    ASSERT_TRUE(c.ok) << c.fault;
    for (std::size_t i = 0; i < m.poses.size(); ++i) {
      const double left = m.poses[i].estimate.covariance.llt().solve(c.errors[i].covariance).trace();
      EXPECT_NEAR(left, 6 - c.errors[i].leverage, 1e-9) << name(model);
    }
  }
}

// The mirror image of a cross of positions ±3, ±2, ±1: no rotation is better than none, with the scale that remains.
TEST(Trajectories, MirrorImagesAreNotAlignedByAReflection) {
  std::vector<MatchedPose> poses;
  for (const Eigen::Vector3d& x : {Eigen::Vector3d(3, 0, 0), Eigen::Vector3d(0, 2, 0), Eigen::Vector3d(0, 0, 1)}) {
    for (const double sign : {1.0, -1.0}) {
      const SE3d at(SO3d(), Eigen::Vector3d(sign * x)),
          mirrored(SO3d(), Eigen::Vector3d(sign * x.x(), sign * x.y(), -sign * x.z()));
      poses.push_back({{mirrored, Matrix6::Zero()}, {at, Matrix6::Identity()}});
    }
  }
  const Alignment a = alignUmeyama(poses, AlignmentModel::sim3);
  ASSERT_TRUE(a.ok);
  EXPECT_LT(a.transform.so3().log().norm(), 1e-14);
  EXPECT_NEAR(a.scale, (9 + 4 - 1) / (9.0 + 4 + 1), 1e-14);
}

TEST(Trajectories, FarOriginsLoseNothing) {
  CounterRng rng(7);
  const TrajectoryScene scene = experiments::independentScene({.n = 50}, rng);
  Moved m = moved(scene, AlignmentModel::se3, rng);
  const double near = evaluateConsistency(m.poses, alignWeighted(m.poses, AlignmentModel::se3)).joint.statistic;
  const SE3d far = SE3d(SO3d(), Eigen::Vector3d(4.5e5, 5.4e6, 120));
  for (MatchedPose& p : m.poses) p.reference.mean = far * p.reference.mean, p.estimate.mean = far * p.estimate.mean;
  const Alignment a = alignWeighted(m.poses, AlignmentModel::se3);
  ASSERT_TRUE(a.ok) << a.fault;
  EXPECT_NEAR(evaluateConsistency(m.poses, a).joint.statistic, near, 1e-4 * near);
}

TEST(Trajectories, StatisticsAreThoseOfTheirDefinitions) {
  CounterRng rng(9);
  const TrajectoryScene scene = experiments::independentScene({.n = 101}, rng);
  const Moved m = moved(scene, AlignmentModel::se3, rng);
  const Alignment a = alignUmeyama(m.poses, AlignmentModel::se3);
  ASSERT_TRUE(a.ok);
  // Independent computation: homogeneous 4×4 matrices in long double.
  using Matrix4 = Eigen::Matrix<long double, 4, 4>;
  const auto matrixOf = [](const SE3d& T) {
    Matrix4 M = Matrix4::Identity();
    const Eigen::Quaterniond q = T.unit_quaternion();
    M.topLeftCorner<3, 3>() = q.cast<long double>().normalized().toRotationMatrix();
    M.topRightCorner<3, 1>() = T.translation().cast<long double>();
    return M;
  };
  const auto angleOf = [](const Matrix4& E) {
    const Eigen::Matrix<long double, 3, 3> R = E.topLeftCorner<3, 3>();
    const long double s =
        std::sqrt((R(2, 1) - R(1, 2)) * (R(2, 1) - R(1, 2)) + (R(0, 2) - R(2, 0)) * (R(0, 2) - R(2, 0)) +
                  (R(1, 0) - R(0, 1)) * (R(1, 0) - R(0, 1)));
    return std::atan2(s, R.trace() - 1);
  };
  const auto number = [&](const Matrix4& E, PoseRelation relation) -> long double {
    switch (relation) {
      case PoseRelation::full:
        return (E - Matrix4::Identity()).norm();
      case PoseRelation::rot_part:
        return (E - Matrix4::Identity()).topLeftCorner<3, 3>().norm();
      case PoseRelation::angle_rad:
        return angleOf(E);
      case PoseRelation::angle_deg:
        return angleOf(E) * 180 / std::acos(-1.0L);
      default:
        return E.topRightCorner<3, 1>().norm();
    }
  };
  const auto check = [&](const std::vector<double>& errors, const std::vector<long double>& expected,
                         const char* what) {
    ASSERT_EQ(errors.size(), expected.size());
    long double sse = 0, sum = 0, squares = 0;
    for (const long double e : expected) sse += e * e, sum += e;
    const long double n = expected.size(), mean = sum / n;
    for (const long double e : expected) squares += (e - mean) * (e - mean);
    std::vector<long double> sorted = expected;
    std::sort(sorted.begin(), sorted.end());
    const std::size_t h = sorted.size() / 2;
    const long double median = sorted.size() % 2 ? sorted[h] : (sorted[h - 1] + sorted[h]) / 2;
    const ErrorStatistics s = errorStatistics(errors);
    const double tolerance = 1e-12;
    EXPECT_NEAR(s.rmse, double(std::sqrt(sse / n)), tolerance) << what;
    EXPECT_NEAR(s.mean, double(mean), tolerance) << what;
    EXPECT_NEAR(s.median, double(median), tolerance) << what;
    EXPECT_NEAR(s.std, double(std::sqrt(squares / n)), tolerance) << what;
    EXPECT_NEAR(s.min, double(sorted.front()), tolerance) << what;
    EXPECT_NEAR(s.max, double(sorted.back()), tolerance) << what;
    EXPECT_NEAR(s.sse, double(sse), tolerance * double(n)) << what;
  };
  std::vector<Matrix4> ref, est;
  for (const MatchedPose& p : m.poses)
    ref.push_back(matrixOf(p.reference.mean)), est.push_back(matrixOf(a(p.estimate.mean)));
  for (const PoseRelation relation : {PoseRelation::full, PoseRelation::trans_part, PoseRelation::rot_part,
                                      PoseRelation::angle_deg, PoseRelation::angle_rad, PoseRelation::point_distance}) {
    std::vector<long double> ape, rpe;
    for (std::size_t i = 0; i < ref.size(); ++i) ape.push_back(number(est[i].inverse() * ref[i], relation));
    check(absoluteErrors(m.poses, a, relation), ape, "ape");
    auto pairs = posePairs(m.poses, a, {.delta = 3});
    ASSERT_EQ(pairs.size(), 33u);
    for (const auto& pair : pairs) {
      const std::size_t i = pair.first, j = pair.second;
      if (relation == PoseRelation::point_distance) {
        const auto length = [&](const std::vector<Matrix4>& T) {
          return (T[i].topRightCorner<3, 1>() - T[j].topRightCorner<3, 1>()).norm();
        };
        rpe.push_back(std::abs(length(ref) - length(est)));
      } else {
        rpe.push_back(number((ref[i].inverse() * ref[j]).inverse() * (est[i].inverse() * est[j]), relation));
      }
    }
    check(relativeErrors(m.poses, a, pairs, relation), rpe, "rpe");
  }
  // By hand.
  const std::vector<double> by_hand{3, 1, 2, 6};
  const ErrorStatistics s = errorStatistics(by_hand);
  EXPECT_DOUBLE_EQ(s.rmse, std::sqrt(12.5));
  EXPECT_DOUBLE_EQ(s.mean, 3);
  EXPECT_DOUBLE_EQ(s.median, 2.5);
  EXPECT_DOUBLE_EQ(s.std, std::sqrt(3.5));
  EXPECT_DOUBLE_EQ(s.sse, 50);
  EXPECT_TRUE(std::isnan(errorStatistics({}).rmse));
}

TEST(Trajectories, PairsAsEvo) {
  // A path along x with steps 1, 1, 2, 0, 1, 3 and yaws of 10 degrees each.
  std::vector<MatchedPose> poses;
  double x = 0;
  const std::vector<double> steps{0, 1, 1, 2, 0, 1, 3};
  for (std::size_t i = 0; i < steps.size(); ++i) {
    x += steps[i];
    const SE3d T(SO3d::rotZ(0.174532925199432957 * double(i)), Eigen::Vector3d(x, 0, 0));
    poses.push_back({{T, Matrix6::Zero()}, {T, Matrix6::Identity()}});
  }
  using Pairs = std::vector<std::pair<std::size_t, std::size_t>>;
  const Alignment none{.ok = true};
  EXPECT_EQ(posePairs(poses, none, {.delta = 2}), (Pairs{{0, 2}, {2, 4}, {4, 6}}));
  EXPECT_EQ(posePairs(poses, none, {.delta = 5, .all_pairs = true}), (Pairs{{0, 5}, {1, 6}}));
  EXPECT_EQ(posePairs(poses, none, {.delta = 2, .unit = DeltaUnit::meters}), (Pairs{{2, 3}, {3, 6}}));
  EXPECT_EQ(posePairs(poses, none, {.delta = 2, .unit = DeltaUnit::meters, .all_pairs = true}),
            (Pairs{{0, 2}, {2, 3}}));
  EXPECT_EQ(posePairs(poses, none, {.delta = 19.9, .unit = DeltaUnit::degrees}), (Pairs{{0, 2}, {2, 4}, {4, 6}}));
  EXPECT_EQ(
      posePairs(poses, none, {.delta = 50, .unit = DeltaUnit::degrees, .relative_tolerance = 0.01, .all_pairs = true}),
      (Pairs{{0, 5}, {1, 6}}));
  EXPECT_TRUE(posePairs(poses, none, {.delta = 0}).empty());
  EXPECT_TRUE(posePairs(poses, none, {.delta = 100}).empty());
  Pairs pairs{{2, 3}, {3, 4}};
  const auto ratios = relativeErrors(poses, none, pairs, PoseRelation::point_distance_error_ratio);
  EXPECT_EQ(ratios.size(), 1u);  // the reference does not move from 3 to 4
  EXPECT_EQ(pairs, (Pairs{{2, 3}}));
}

TEST(Trajectories, RelativeNeesKnowsTheModelOfItsPairs) {
  double chain = 0, independent = 0, of_independent = 0;
  const int trials = 40;
  for (int trial = 0; trial < trials; ++trial) {
    CounterRng rng(31, static_cast<std::uint64_t>(trial));
    const TrajectorySceneOptions options{.n = 100, .sigma_translation = 0.01, .sigma_rotation = 0.002};
    Moved m = moved(experiments::deadReckoningScene(options, rng), AlignmentModel::se3, rng);
    const auto pairs = posePairs(m.poses, {.ok = true}, {.delta = 10});
    chain += relativeConsistency(m.poses, pairs, PairsModel::chain).joint.ratio() / trials;
    independent += relativeConsistency(m.poses, pairs, PairsModel::independent).joint.ratio() / trials;
    m = moved(experiments::independentScene({.n = 100}, rng), AlignmentModel::se3, rng);
    std::vector<std::pair<std::size_t, std::size_t>> apart;
    for (std::size_t i = 0; i + 1 < 100; i += 2) apart.emplace_back(i, i + 1);
    of_independent += relativeConsistency(m.poses, apart, PairsModel::independent).joint.ratio() / trials;
  }
  // 40 runs of 9 pairs have a standard error of 0.03, of 50 pairs 0.013.
  EXPECT_NEAR(chain, 1, 0.12);
  EXPECT_LT(independent, 0.5);
  EXPECT_NEAR(of_independent, 1, 0.05);
}

TEST(Trajectories, TruthWithCovarianceIsAdded) {
  double mean = 0;
  for (std::uint64_t trial = 0; trial < 100; ++trial) {
    CounterRng rng(41, trial);
    TrajectoryScene scene = experiments::independentScene({.n = 30}, rng);
    Moved m = moved(scene, AlignmentModel::se3, rng);
    for (MatchedPose& p : m.poses) {
      p.reference.covariance = experiments::sceneCovariance({}, rng);
      p.reference.mean = p.reference.mean * sample(Gaussian<SE3d>{SE3d(), p.reference.covariance}, rng);
    }
    mean += evaluateConsistency(m.poses, alignWeighted(m.poses, AlignmentModel::se3)).joint.ratio() / 100;
  }
  EXPECT_NEAR(mean, 1, 0.05);
}

TEST(Trajectories, DegenerateInputIsSaid) {
  CounterRng rng(10);
  EXPECT_FALSE(alignWeighted(MatchedPoses{}, AlignmentModel::se3).ok);
  EXPECT_FALSE(alignUmeyama(MatchedPoses{}, AlignmentModel::se3).ok);
  // Collinear positions leave the rotation open in least squares, but not in poses.
  TrajectoryScene scene = experiments::independentScene({.n = 10}, rng);
  for (std::size_t i = 0; i < 10; ++i) {
    scene.truth[i] = SE3d(SO3d(rng.unitQuaternion()), Eigen::Vector3d(double(i), 0, 0));
    scene.estimate[i].mean = scene.truth[i];
  }
  Moved m = moved(scene, AlignmentModel::se3, rng);
  EXPECT_FALSE(alignUmeyama(m.poses, AlignmentModel::se3).ok);
  EXPECT_TRUE(alignWeighted(m.poses, AlignmentModel::se3).ok);
  // One pose: nothing is left to test. One position for a scale: nothing to determine it.
  const std::span<const MatchedPose> one(m.poses.data(), 1);
  const Alignment a = alignWeighted(one, AlignmentModel::se3);
  EXPECT_TRUE(a.ok) << a.fault;
  EXPECT_FALSE(evaluateConsistency(one, a).ok);
  EXPECT_FALSE(alignWeighted(one, AlignmentModel::sim3).ok);
  for (MatchedPose& p : m.poses) p.estimate.mean = SE3d(p.estimate.mean.so3(), Eigen::Vector3d(1, 2, 3));
  EXPECT_FALSE(alignWeighted(m.poses, AlignmentModel::sim3).ok);
  // Least squares are not judged, indefinite covariances are listed.
  m = moved(experiments::independentScene({.n = 10}, rng), AlignmentModel::se3, rng);
  EXPECT_FALSE(evaluateConsistency(m.poses, alignUmeyama(m.poses, AlignmentModel::se3)).ok);
  m.poses[4].estimate.covariance(0, 0) = -1;
  EXPECT_FALSE(alignWeighted(m.poses, AlignmentModel::se3).ok);
  const Consistency c = evaluateConsistency(m.poses, {.ok = true});
  EXPECT_EQ(c.indefinite, (std::vector<std::size_t>{4}));
  EXPECT_FALSE(c.ok);
}

TEST(Trajectories, AHundredThousandPosesTakeASecond) {
  CounterRng rng(12);
  TrajectorySceneOptions options{.n = 100000};
  options.step = 1e-3;
  const TrajectoryScene scene = experiments::independentScene(options, rng);
  const auto start = std::chrono::steady_clock::now();
  const auto matches = associateByInterpolation(scene.times, scene.times);
  const auto poses = matchedPoses(matches, scene.reference(), scene.estimate);
  const Alignment a = alignWeighted(poses, AlignmentModel::se3);
  const Consistency c = evaluateConsistency(poses, a);
  const auto ape =
      errorStatistics(absoluteErrors(poses, alignUmeyama(poses, AlignmentModel::se3), PoseRelation::trans_part));
  auto pairs = posePairs(poses, a, {});
  const auto rpe = errorStatistics(relativeErrors(poses, a, pairs, PoseRelation::trans_part));
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  EXPECT_TRUE(c.ok && c.tests.consistent(1e-4)) << c.fault;
  EXPECT_GT(ape.rmse, 0.05);
  EXPECT_GT(rpe.rmse, 0.05);
  RecordProperty("seconds", std::to_string(seconds));
#ifndef LIESTAT_SANITIZED
  EXPECT_LT(seconds, 3);  // a third of it on an idle core; machines that build at the same time are slower
#endif
  std::printf("100000 poses in %.2f s\n", seconds);
}

}  // namespace
}  // namespace liestat
