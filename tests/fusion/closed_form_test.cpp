// The closed form on exact data: every case of docs/theory/visual_inertial.md, section 4, the second solution, bad
// input.

#include <fusion/init/closed_form.hpp>
#include <experiments/closed_form_cases.hpp>
#include <fusion/init/detail/closed_form_input.hpp>
#include <fusion/init/detail/closed_form_solver.hpp>
#include <lie/so3.hpp>
#include <support/vi_scene.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat::experiments;
using namespace liestat_test;
using Status = FusionStatus;
using Motion = SceneMotion;
using Turn = SceneTurn;
using Layout = SceneLayout;
using Vector3 = Eigen::Vector3d;

/// The whole scaled system, dense, in the rows of the paper (two across each bearing).
Eigen::MatrixXd denseSystem(const ClosedFormWindow& window, bool bias) {
  const double T = window.images.back().time;
  Eigen::Index rows = 0;
  for (const FeatureTrack& track : window.features) rows += 2 * static_cast<Eigen::Index>(track.size());
  const Eigen::Index features = 3 * static_cast<Eigen::Index>(window.features.size());
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(rows, features + (bias ? 9 : 6));
  Eigen::Index row = 0;
  for (std::size_t i = 0; i < window.features.size(); ++i) {
    for (const TrackedBearing& seen : window.features[i]) {
      const WindowImage& image = window.images[seen.image];
      const Eigen::Matrix<double, 2, 3> N = detail::tangentRows(image.rotation * seen.bearing);
      const double tau = image.time / T;
      A.block<2, 3>(row, 3 * static_cast<Eigen::Index>(i)) = N;
      A.block<2, 3>(row, features) = -tau * N;
      A.block<2, 3>(row, features + 3) = -tau * tau * N;
      if (bias) A.block<2, 3>(row, features + 6) = -2 / (T * T) * N * image.displacement_by_bias;
      row += 2;
    }
  }
  return A;
}

/// Descending, by Hestenes' rotations of columns: Eigen's decompositions of dynamic size cost a compiler 15 s.
Eigen::VectorXd singularValues(Eigen::MatrixXd A) {
  if (A.rows() < A.cols()) A.transposeInPlace();
  for (bool turned = true; turned;) {
    turned = false;
    for (Eigen::Index p = 0; p < A.cols(); ++p) {
      for (Eigen::Index q = p + 1; q < A.cols(); ++q) {
        const double a = A.col(p).squaredNorm(), b = A.col(q).squaredNorm(), c = A.col(p).dot(A.col(q));
        if (std::abs(c) <= 1e-15 * std::sqrt(a * b) || std::abs(c) < 1e-30) continue;
        const double angle = 0.5 * std::atan2(2 * c, a - b), cosine = std::cos(angle), sine = std::sin(angle);
        const Eigen::VectorXd old = A.col(p);
        A.col(p) = cosine * old + sine * A.col(q);
        A.col(q) = cosine * A.col(q) - sine * old;
        turned = true;
      }
    }
  }
  Eigen::VectorXd values = A.colwise().norm();
  std::sort(values.data(), values.data() + values.size(), std::greater<>());
  return values;
}

double relativeError(const ClosedFormSolution& s, const Scene& scene) {
  double error = (s.velocity - scene.velocity).norm() / std::max(1., scene.velocity.norm());
  error = std::max(error, (s.gravity - scene.gravity).norm() / Scene::g);
  return error;
}

double featureError(const ClosedFormSolution& s, const Scene& scene) {
  double error = 0;
  for (std::size_t i = 0; i < scene.features.size(); ++i) {
    error = std::max(error, (s.features[i] - scene.features[i]).norm() / scene.features[i].norm());
  }
  return error;
}

double bestError(const ClosedFormResult& result, const Scene& scene) {
  double best = std::numeric_limits<double>::infinity();
  for (const ClosedFormSolution& s : result.solutions) best = std::min(best, relativeError(s, scene));
  return best;
}

TEST(ClosedFormCases, EveryRowOfTheTable) {
  for (const ClosedFormCase& row : closedFormCases()) {
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
      SCOPED_TRACE(std::string(row.name) + ", scene " + std::to_string(seed));
      const Scene scene(row.scene, seed);
      const ClosedFormResult result = solveClosedForm(scene.window, {.closed_form = {.estimate_bias = row.bias}});
      EXPECT_EQ(result.fault, FaultKind::none);
      EXPECT_EQ(result.null_dimension, row.null);
      EXPECT_TRUE(result.status == row.status || result.status == row.or_status) << describe(result.status);
      EXPECT_EQ(result.solutions.empty(), !row.solved && row.status != Status::scale_unobservable);
      EXPECT_EQ(result.consistent, !result.solutions.empty());
      if (row.solved) {
        EXPECT_LE(bestError(result, scene), 1e-9);
      }
      if (row.null == 0) {
        EXPECT_EQ(result.status, Status::ok);
        EXPECT_LE(relativeError(result.solutions.at(0), scene), 1e-9);
        EXPECT_LE(featureError(result.solutions[0], scene), 1e-9);
        EXPECT_LE((result.solutions[0].accelerometer_bias - row.scene.bias).norm(), 1e-9);
        EXPECT_EQ(result.solutions[0].negative_depths, 0u);
      }
      if (result.status == Status::ambiguous) {
        ASSERT_EQ(result.solutions.size(), 2u);
        EXPECT_EQ(result.solutions[1].negative_depths, 0u);
      }

      // The dense system agrees.
      const Eigen::VectorXd dense = singularValues(denseSystem(scene.window, row.bias));
      const Eigen::Index unknowns = 3 * static_cast<Eigen::Index>(row.scene.features) + (row.bias ? 9 : 6);
      const double threshold = dense[0] * (row.bias ? 1e-12 : 1e-10);
      EXPECT_EQ(unknowns - (dense.array() > threshold).count(), row.null);
      EXPECT_LE(result.largest_singular_value, dense[0] * (1 + 1e-12));
      EXPECT_GE(result.largest_singular_value, dense[0] * 0.9);
      // By Courant and Fischer each of the restricted values bounds one of the whole system's from above.
      ASSERT_EQ(result.singular_values.size(), row.bias ? 9u : 6u);
      const double smallest = result.singular_values.back();
      if (dense.size() == unknowns) {
        EXPECT_GE(smallest, dense[unknowns - 1] * (1 - 1e-6) - 1e-14 * dense[0]);
      }
    }
  }
}

TEST(ClosedFormCases, ConstantVelocityLeavesGravityAndTheDirectionOfMotion) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Scene scene({.images = 5, .features = 4, .motion = Motion::constant_velocity}, seed);
    const auto result = solveClosedForm(scene.window);
    ASSERT_EQ(result.status, Status::scale_unobservable);
    const ClosedFormSolution& s = result.solutions.at(0);
    EXPECT_LE((s.gravity - scene.gravity).norm(), 1e-9 * Scene::g);
    EXPECT_LE((s.velocity.normalized() - scene.velocity.normalized()).norm(), 1e-9);
    EXPECT_EQ(s.negative_depths, 0u);
    // All lengths by one factor, and a median distance of one.
    const double factor = s.velocity.norm() / scene.velocity.norm();
    std::vector<double> distances;
    for (std::size_t i = 0; i < s.features.size(); ++i) {
      EXPECT_LE((s.features[i] - factor * scene.features[i]).norm(), 1e-9 * s.features[i].norm());
      EXPECT_FALSE(result.features[i].depth_determined);
      distances.push_back(s.features[i].norm());
    }
    EXPECT_NEAR(detail::median(distances), 1, 1e-12);
    // A camera away from the axis of rotation moves by a known length: the scale is there again.
    const Scene lever({.images = 5, .features = 4, .motion = Motion::constant_velocity, .camera = Vector3(0.2, 0, 0.1)},
                      seed);
    const auto with_lever = solveClosedForm(lever.window);
    EXPECT_EQ(with_lever.null_dimension, 0);
    EXPECT_LE(bestError(with_lever, lever), 1e-9);
  }
}

TEST(ClosedFormCases, AFeatureStraightAheadIsTheOnlyOneWithoutDepth) {
  const Scene scene({.images = 5, .features = 4, .motion = Motion::straight, .layout = Layout::ahead}, 3);
  const auto result = solveClosedForm(scene.window);
  ASSERT_TRUE(result.ok());
  EXPECT_FALSE(result.features[0].depth_determined);
  for (std::size_t i = 1; i < 4; ++i) {
    EXPECT_TRUE(result.features[i].depth_determined);
    EXPECT_LE((result.solutions[0].features[i] - scene.features[i]).norm(), 1e-9 * scene.features[i].norm());
  }
}

TEST(ClosedFormCases, FeaturesFarAwayKeepTheRank) {
  // The metric part is nine digits down: exact data have them, a noise does not (closed_form_noise_test).
  const Scene scene({.images = 6, .features = 8, .far = 1e6}, 1);
  const auto result = solveClosedForm(scene.window);
  EXPECT_EQ(result.null_dimension, 0);
  EXPECT_LT(result.singular_values.back(), 1e-6 * result.largest_singular_value);
  EXPECT_LE(bestError(result, scene), 1e-7);
}

// The paper's two solutions are the two minima on the sphere, and the second is the first one's scene scaled.
TEST(SecondSolution, IsAScaledCopyForConstantAccelerationAndForThreeImages) {
  int in_front = 0, trials = 0;
  for (const bool constant : {true, false}) {
    for (std::uint64_t seed = 1; seed <= 150; ++seed, ++trials) {
      const Scene scene({.images = constant ? std::size_t{6} : std::size_t{3},
                         .features = 4,
                         .motion = constant ? Motion::constant_acceleration : Motion::varying,
                         .acceleration = 3},
                        seed);
      const auto& images = scene.window.images;
      const std::size_t last = images.size() - 1;
      const Vector3 A = meanSpecificForce(images[last / 2], images[last]);
      const double gamma = secondSolutionScale(A, scene.gravity), G = scene.gravity.dot(A + scene.gravity);
      // The two forms of docs/theory/visual_inertial.md, (3.5).
      EXPECT_NEAR(gamma, 1 - 2 * G / (A + scene.gravity).squaredNorm(), 1e-9 * std::max(1., std::abs(gamma)));
      const auto result = solveClosedForm(scene.window);
      SCOPED_TRACE(seed);
      EXPECT_EQ(result.null_dimension, 1);
      ASSERT_EQ(result.solutions.size(), 2u);
      const bool first = relativeError(result.solutions[0], scene) < relativeError(result.solutions[1], scene);
      const ClosedFormSolution &truth = result.solutions[first ? 0 : 1], &other = result.solutions[first ? 1 : 0];
      EXPECT_LE(relativeError(truth, scene), 1e-9);
      // The difference of the two is as small as 1 - γ: their accuracy is the better the further they are apart.
      const double bar = 1e-10 * std::max(1., std::abs(gamma)) / std::min(1., std::abs(1 - gamma));
      // Three images cannot tell a varying force from a constant one and a velocity that it adds.
      const Vector3 added = images[last / 2].displacement / images[last / 2].time - 0.5 * images[last / 2].time * A;
      EXPECT_LE((other.velocity - (gamma * (scene.velocity + added) - added)).norm(), bar);
      EXPECT_LE((other.gravity - (gamma * (A + scene.gravity) - A)).norm(), 10 * bar);
      for (std::size_t i = 0; i < other.features.size(); ++i) {
        EXPECT_LE((other.features[i] - gamma * scene.features[i]).norm(), 10 * bar);
      }
      EXPECT_EQ(result.status, gamma > 0 ? Status::ambiguous : Status::ok);
      EXPECT_EQ(other.negative_depths, gamma > 0 ? 0u : 4u);
      EXPECT_EQ(gamma > 0, A.norm() > Scene::g);
      in_front += gamma > 0;
    }
  }
  EXPECT_GT(in_front, trials / 5);
  EXPECT_LT(in_front, trials * 4 / 5);
}

TEST(SecondSolution, MeetsTheFirstWhereAccelerationIsLevel) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const Scene scene({.images = 6, .features = 5, .motion = Motion::constant_acceleration, .level_acceleration = true},
                      seed);
    const auto result = solveClosedForm(scene.window);
    EXPECT_EQ(result.status, Status::double_root) << seed;
    // Half the digits: the solution is a double root.
    EXPECT_LE(bestError(result, scene), 1e-5) << seed;
  }
}

TEST(Gravity, OfUnknownLengthIsFoundWhereTheDataHaveIt) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Scene scene({.images = 6, .features = 6}, seed);
    const auto result = solveClosedForm(scene.window, {.gravity = std::nullopt});
    ASSERT_TRUE(result.ok());
    EXPECT_EQ(result.solutions.size(), 1u);
    EXPECT_LE(relativeError(result.solutions[0], scene), 1e-9);
    // One direction of the null space can't be cut by a sphere of unknown size.
    const Scene constant({.images = 6, .features = 6, .motion = Motion::constant_acceleration}, seed);
    const auto undetermined = solveClosedForm(constant.window, {.gravity = std::nullopt});
    EXPECT_EQ(undetermined.status, Status::gravity_undetermined);
    EXPECT_TRUE(undetermined.solutions.empty());
    const Scene uniform({.images = 6, .features = 6, .motion = Motion::constant_velocity}, seed);
    const auto scale = solveClosedForm(uniform.window, {.gravity = std::nullopt});
    EXPECT_EQ(scale.status, Status::scale_unobservable);
    EXPECT_LE((scale.solutions.at(0).gravity - scene.gravity.norm() * uniform.gravity.normalized()).norm(), 1e-8);
  }
}

TEST(Gravity, GivesRollAndPitch) {
  const double roll = 0.4, pitch = -0.7;
  const SO3d world_R_body = SO3d::exp({0, 0, 2}) * SO3d::exp({0, pitch, 0}) * SO3d::exp({roll, 0, 0});
  ClosedFormSolution s;
  s.gravity = world_R_body.inverse() * Vector3(0, 0, -9.81);
  EXPECT_NEAR(s.roll(), roll, 1e-14);
  EXPECT_NEAR(s.pitch(), pitch, 1e-14);
}

TEST(Bias, TurnsGravityIntoItsMirrorImageAboutOneAxis) {
  int decided = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Scene scene({.images = 6, .features = 4, .turn = Turn::fixed_axis, .bias = Vector3(0.03, 0.02, -0.01)}, seed);
    const Vector3 axis = (scene.attitude(0).inverse() * scene.attitude(scene.times[3])).log().normalized();
    const Vector3 mirrored = scene.gravity - 2 * scene.gravity.dot(axis) * axis;
    const double infinite = std::numeric_limits<double>::infinity();
    const auto open = solveClosedForm(
        scene.window, {.prior = {.accelerometer_sigma = infinite}, .closed_form = {.estimate_bias = true}});
    EXPECT_EQ(open.null_dimension, 1);
    ASSERT_EQ(open.status, Status::mirror_gravity) << seed;
    ASSERT_EQ(open.solutions.size(), 2u);
    const bool first = relativeError(open.solutions[0], scene) < relativeError(open.solutions[1], scene);
    const ClosedFormSolution &truth = open.solutions[first ? 0 : 1], &other = open.solutions[first ? 1 : 0];
    EXPECT_LE(relativeError(truth, scene), 1e-8);
    EXPECT_LE((other.gravity - mirrored).norm(), 1e-7);
    EXPECT_LE((other.gravity - truth.gravity - (other.accelerometer_bias - truth.accelerometer_bias)).norm(), 1e-7);
    // A bias of 2 |G·u| is one that a prior refuses, unless the axis is level.
    const auto closed = solveClosedForm(scene.window, {.closed_form = {.estimate_bias = true}});
    if (std::abs(2 * scene.gravity.dot(axis)) < 0.5) continue;
    ++decided;
    EXPECT_TRUE(closed.ok());
    EXPECT_LE(relativeError(closed.solutions.at(0), scene), 1e-8);
  }
  EXPECT_GE(decided, 10);
}

TEST(Elimination, BlocksAddUpAndGiveTheBestPositions) {
  const Scene scene({.images = 7, .features = 5}, 4);
  ClosedFormResult counts;
  const detail::RayTable table = detail::rayTable(scene.window, counts);
  for (const bool bias : {false, true}) {
    CounterRng random(7);
    detail::Motion y(bias);
    for (int k = 0; k + 1 < y.size; ++k) y[k] = random.normal();
    detail::MotionBlock sum(bias), most(bias);
    double cost = 0, cost_of_most = 0;
    for (std::size_t i = 0; i < table.features(); ++i) {
      const auto e = detail::eliminateFeature(table.of(i), table.images, bias);
      EXPECT_EQ(e.rank, 3);
      sum += e.block;
      if (i != 2) most += e.block;
      const auto residual = [&](const Vector3& P) {
        double square = 0;
        for (const detail::Ray& ray : table.of(i)) {
          square += ray.u.cross(detail::relativePosition(table.images[ray.image], P, y)).squaredNorm();
        }
        return square;
      };
      const Vector3 P = detail::apply(e.by_motion, y);
      EXPECT_NEAR(e.block.cost(y), residual(P), 1e-11 * residual(Vector3::Zero()));
      for (int k = 0; k < 10; ++k) EXPECT_GE(residual(P + 0.01 * random.unitVector<3>()), residual(P));
      cost += residual(P);
      if (i != 2) cost_of_most += residual(P);
      // The orthogonal way has the same root and the same position.
      const auto o = detail::eliminateOrthogonally(table.of(i), table.images, bias, 1e-12);
      EXPECT_LE((detail::apply(o.gain, y) + P).norm(), 1e-9);
    }
    EXPECT_NEAR(sum.cost(y), cost, 1e-10 * cost);
    // Taking a feature off is a subtraction.
    sum -= detail::eliminateFeature(table.of(2), table.images, bias).block;
    EXPECT_NEAR(sum.cost(y), cost_of_most, 1e-10 * cost);
    EXPECT_NEAR(most.cost(y), cost_of_most, 1e-10 * cost);
  }
}

TEST(Elimination, NormalEquationsAgreeWithReflections) {
  // A noise is claimed that the data do not have: weights and normal equations, half the digits.
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Scene scene({.images = 8, .features = 8, .camera = Vector3(0.1, 0, 0.05)}, seed);
    const auto result = solveClosedForm(scene.window, {.bearing_noise = 1e-5});
    ASSERT_TRUE(result.ok()) << describe(result.status);
    // The correction for the claimed noise, 1e-10 of the information, is felt where the scale is weak.
    EXPECT_LE(relativeError(result.solutions[0], scene), 1e-6);
    EXPECT_LE(featureError(result.solutions[0], scene), 1e-6);
    EXPECT_EQ(result.covariance.rows(), 6);
    EXPECT_EQ(result.covariance_content, ClosedFormCovarianceContent::image_noise);
    EXPECT_EQ(result.degrees_of_freedom, 2 * 64u - 24 - 5);
    // |G| is known: nothing along it.
    Eigen::Matrix<double, 6, 1> along;
    along << Vector3::Zero(), scene.gravity.normalized();
    EXPECT_LE(along.dot(result.covariance * along), 1e-9 * result.covariance.trace());
  }
}

TEST(Window, FeaturesComeAndGo) {
  Scene scene({.images = 8, .features = 8}, 2);
  auto& tracks = scene.window.features;
  tracks[0].erase(tracks[0].begin(), tracks[0].begin() + 4);
  tracks[1].resize(3);
  tracks[2] = {tracks[2][5]};
  tracks[3] = {tracks[3][5], tracks[3][5]};
  tracks[4].clear();
  std::reverse(tracks[5].begin(), tracks[5].end());
  for (auto& seen : tracks[6]) seen.bearing *= 7;
  const auto result = solveClosedForm(scene.window);
  ASSERT_TRUE(result.ok());
  EXPECT_LE(relativeError(result.solutions[0], scene), 1e-9);
  EXPECT_EQ(result.features_used, 5u);
  for (const std::size_t i : {2u, 3u, 4u}) {
    EXPECT_FALSE(result.features[i].used);
    EXPECT_TRUE(result.solutions[0].features[i].hasNaN());
  }
  EXPECT_EQ(result.features[2].observations, 1u);
  EXPECT_EQ(result.images_used, 8u);
}

TEST(BadInput, IsNamed) {
  const Scene scene({.images = 5, .features = 4}, 1);
  using Fault = FaultKind;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto expectFault = [&](Fault fault, std::size_t index, auto&& spoil, InitialisationOptions options = {}) {
    ClosedFormWindow window = scene.window;
    spoil(window);
    const auto result = solveClosedForm(window, options);
    EXPECT_EQ(result.status, Status::bad_input);
    EXPECT_EQ(result.fault, fault) << describe(result.fault);
    EXPECT_EQ(result.fault.index, index) << describe(result.fault);
    EXPECT_TRUE(result.solutions.empty());
    EXPECT_FALSE(describe(result.fault).empty());
  };
  const auto nothing = [](ClosedFormWindow&) {};
  expectFault(Fault::too_few_images, 0, [](ClosedFormWindow& w) { w.images.resize(1); });
  expectFault(Fault::too_few_images, 0, [](ClosedFormWindow& w) { w = {}; });
  expectFault(Fault::image_not_finite, 2, [&](ClosedFormWindow& w) { w.images[2].time = nan; });
  expectFault(Fault::image_not_finite, 3, [&](ClosedFormWindow& w) { w.images[3].displacement[1] = nan; });
  expectFault(Fault::image_not_finite, 1, [&](ClosedFormWindow& w) { w.images[1].rotation(1, 1) = nan; });
  expectFault(Fault::image_order, 0, [](ClosedFormWindow& w) { w.images[0].time = 0.1; });
  expectFault(Fault::image_order, 3, [](ClosedFormWindow& w) { w.images[3].time = w.images[2].time; });
  expectFault(Fault::not_a_rotation, 4, [](ClosedFormWindow& w) { w.images[4].rotation *= 1.1; });
  expectFault(Fault::not_a_rotation, 4, [](ClosedFormWindow& w) { w.images[4].rotation *= -1; });
  expectFault(Fault::wrong_index, 1, [](ClosedFormWindow& w) { w.features[1][0].image = 5; });
  expectFault(Fault::bad_bearing, 3, [](ClosedFormWindow& w) { w.features[3][2].bearing.setZero(); });
  expectFault(Fault::bad_bearing, 2, [&](ClosedFormWindow& w) { w.features[2][1].bearing[0] = nan; });
  expectFault(Fault::no_feature, 0, [](ClosedFormWindow& w) { w.features.clear(); });
  expectFault(Fault::no_feature, 0, [](ClosedFormWindow& w) {
    for (auto& track : w.features) track.resize(1);
  });
  expectFault(Fault::bad_option, 0, [&](ClosedFormWindow& w) { w.cameras[0].translation()[0] = nan; });
  expectFault(Fault::bad_option, 0, nothing, {.gravity = 0.});
  expectFault(Fault::bad_option, 0, nothing, {.bearing_noise = -1});
  expectFault(Fault::bad_option, 0, nothing, {.bearing_noise = nan});
  expectFault(Fault::bad_option, 0, nothing,
              {.prior = {.accelerometer_sigma = 0}, .closed_form = {.estimate_bias = true}});
  // Everything at the origin of time: an observation in one image only.
  expectFault(Fault::no_feature, 0, [](ClosedFormWindow& w) {
    for (auto& track : w.features) track = {track[2], track[2]};
  });
}

}  // namespace
