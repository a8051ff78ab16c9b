// The refinement (docs/theory/visual_inertial.md, section 3.7) against an independent prototype's tables of accuracy
// and consistency.

#include <fusion/init/detail/reduced_system.hpp>
#include <fusion/init/detail/refinement_problem.hpp>
#include <fusion/imu/window.hpp>
#include <fusion/init/closed_form.hpp>
#include <fusion/init/refinement.hpp>
#include <lie/detail/small_orthogonal.hpp>
#include <support/small_mahalanobis.hpp>
#include <support/vi_measurements.hpp>
#include <support/vi_scene.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat_test;
using Status = FusionStatus;

constexpr double pixel = 1. / 450;
const ImuNoise<double> imu{1.7e-4, 2e-3};
const InitialisationOptions options{.bearing_noise = pixel,
                                    .prior = {.gyroscope_sigma = 0.01, .accelerometer_sigma = 0.05}};

/// A window with biases out of their priors, and the closed form for biases of zero.
struct Recorded {
  Scene scene;
  ImuBias<double> bias;
  std::vector<ImuSample<double>> readings;
  InertialWindow window;
  ClosedFormResult start;

  Recorded(SceneOptions scene_options, std::uint64_t seed, const ImuNoise<double>& noise = imu, double sigma = pixel)
      : Recorded(scene_options, seed, noise, sigma, CounterRng(seed, 0, 1)) {}

  /// The state at the last image, in t0's frame.
  SE23d last() const {
    const SO3d body_R_world = scene.attitude(0).inverse();
    const double t = scene.times.back();
    return {body_R_world * scene.attitude(t), Eigen::Vector3d(body_R_world * (scene.position(t) - scene.position(0))),
            Eigen::Vector3d(body_R_world * scene.speed(t))};
  }

 private:
  Recorded(SceneOptions scene_options, std::uint64_t seed, const ImuNoise<double>& noise, double sigma,
           CounterRng random)
      : scene((scene_options.bias = options.prior.accelerometer_sigma * random.normalVector<3>(), scene_options),
              seed) {
    bias = {options.prior.gyroscope_sigma * random.normalVector<3>(), scene.options().bias};
    readings = readingsOf(scene, noise, random, bias.gyroscope);
    scene.addNoise(sigma, random);
    window = InertialWindow(motionsOf(scene, readings, {.preintegration = {.noise = imu}}), scene.window.features,
                            scene.window.cameras);
    start = solveClosedForm(closedFormWindow(window, {}),
                            {.bearing_noise = pixel, .closed_form = {.singular_values = false}});
  }
};

/// eᵀ C⁻¹ e of the first n unknowns.
double normalised(const detail::SmallMatrix& covariance, const std::vector<double>& error, int n) {
  return liestat_test::mahalanobisSquared(covariance.block(0, 0, n, n), {error.begin(), error.begin() + n});
}
void append(std::vector<double>& to, const Eigen::Vector3d& x) { to.insert(to.end(), x.data(), x.data() + 3); }

/// NEES of V (3 degrees of freedom), (V, G) (5), all (11) and the last state (9).
struct Consistency {
  double of[4];

  Consistency(const RefinementResult& r, const Recorded& truth) {
    // The covariance has no part along G, nor has the error to first order: give both one.
    const Eigen::Vector3d along = r.gravity.normalized();
    Eigen::Vector3d gravity = r.gravity - truth.scene.gravity;
    gravity -= along.dot(gravity) * along;
    std::vector<double> error;
    append(error, r.velocity() - truth.scene.velocity);
    append(error, gravity);
    append(error, r.bias.gyroscope - truth.bias.gyroscope);
    append(error, r.bias.accelerometer - truth.bias.accelerometer);
    detail::SmallMatrix covariance = detail::SmallMatrix::of<12, 12>(r.covariance.atFirst());
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) covariance(3 + i, 3 + j) += along[i] * along[j];
    }
    of[0] = normalised(covariance, error, 3);
    of[1] = normalised(covariance, error, 6);
    of[2] = normalised(covariance, error, 12);
    const Eigen::Matrix<double, 9, 1> last = (truth.last().inverse() * r.states.back()).log();
    detail::SmallMatrix of_last(9, 9);
    for (int i = 0; i < 9; ++i) {
      for (int j = 0; j < 9; ++j) of_last(i, j) = r.covariance.atLast()(i, j);
    }
    of[3] = normalised(of_last, std::vector<double>(last.data(), last.data() + 9), 9);
  }
};

double quantile(std::vector<double> values, double p) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(p * static_cast<double>(values.size() - 1))];
}
double tilt(const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

// Exact motion and bearings: the start is pulled to the truth, from whatever biases.
TEST(Refinement, FindsExactMotion) {
  for (std::uint64_t seed = 1; seed < 6; ++seed) {
    Recorded recorded({.images = 11, .features = 12, .camera = {0.05, -0.1, 0.02}}, 400 + seed, {}, 0);
    // The scheme that is good to 1e-6 m/s and 6e-7 m in a second, at the true biases: an update of first order from
    // those of zero, where the refinement starts, leaves 1e-5 rad.
    recorded.window = windowOf(recorded.scene, recorded.readings,
                               {.preintegration = {.noise = imu, .bias = recorded.bias}, .scheme = ImuScheme::cubic});
    ASSERT_FALSE(recorded.start.solutions.empty());
    InitialisationOptions exact = options;
    // Priors at the truth do not pull.
    exact.prior.mean = recorded.bias;
    exact.refinement.min_decrease = 1e-9;
    const auto refined = refine(recorded.window, recorded.start.solutions[0], {}, exact);
    EXPECT_EQ(refined.status, Status::ok);
    EXPECT_TRUE(refined.ok());
    EXPECT_LE(refined.cost, 1e-6);
    double far = (recorded.last().inverse() * refined.states.back()).log().norm();
    for (std::size_t i = 0; i < refined.features.size(); ++i) {
      if (refined.features[i].allFinite())
        far = std::max(far, (refined.features[i] - recorded.scene.features[i]).norm());
    }
    far = std::max({far, (refined.velocity() - recorded.scene.velocity).norm(),
                    (refined.gravity - recorded.scene.gravity).norm(),
                    (refined.bias.gyroscope - recorded.bias.gyroscope).norm(),
                    (refined.bias.accelerometer - recorded.bias.accelerometer).norm()});
    EXPECT_LE(far, 1e-6) << seed;
    // With |G| unknown it is found.
    exact.gravity = std::nullopt;
    const auto free = refine(recorded.window, recorded.start.solutions[0], {}, exact);
    EXPECT_EQ(free.status, Status::ok);
    EXPECT_EQ(free.degrees_of_freedom + 1, refined.degrees_of_freedom);
    EXPECT_NEAR(free.gravity.norm(), Scene::g, 1e-3);
    EXPECT_GT(free.gravity.dot(free.covariance.of<InitialCovariance::gravity>() * free.gravity),
              100 * refined.gravity.dot(refined.covariance.of<InitialCovariance::gravity>() * refined.gravity));
  }
}

TEST(Refinement, CovariancesBelongTogether) {
  const Recorded recorded({.images = 6, .features = 10, .window = 1}, 77);
  ASSERT_FALSE(recorded.start.solutions.empty());
  const auto refined = refine(recorded.window, recorded.start.solutions[0], {}, options);
  ASSERT_EQ(refined.status, Status::ok);
  const Eigen::Matrix<double, 12, 12> at_first = refined.covariance.atFirst();
  const Eigen::Matrix<double, 18, 18> at_last = refined.covariance.atLast();
  double symmetric = 0, same = 0;
  for (int i = 0; i < 9; ++i) {
    for (int j = 0; j < 9; ++j) {
      same = std::max(same, std::abs(at_first(3 + i, 3 + j) - at_last(9 + i, 9 + j)));
      symmetric = std::max(symmetric, std::abs(at_last(i, j) - at_last(j, i)));
    }
  }
  EXPECT_LE(same, 1e-14);
  EXPECT_LE(symmetric, 1e-12);
  // Noise that is called larger is: biases alone keep their priors.
  InitialisationOptions rough = options;
  rough.inertial_noise_factor = 10;
  const auto inflated = refine(recorded.window, recorded.start.solutions[0], {}, rough);
  EXPECT_EQ(inflated.status, Status::ok);
  EXPECT_GT(inflated.covariance.joint(0, 0), refined.covariance.joint(0, 0));
  EXPECT_LE(inflated.covariance.atFirst()(9, 9), std::pow(options.prior.accelerometer_sigma, 2));
  // Too few iterations are said to be.
  InitialisationOptions hasty = options;
  hasty.refinement.max_iterations = 1;
  EXPECT_EQ(refine(recorded.window, recorded.start.solutions[0], {}, hasty).status, Status::not_converged);
}

// With walks the biases at both ends are unknowns of their own: the walk between them is what the densities allow.
TEST(Refinement, BiasesWalk) {
  const Recorded recorded({.images = 9, .features = 15, .window = 2}, 91);
  ASSERT_FALSE(recorded.start.solutions.empty());
  const auto refined = [&](double gyroscope_walk, double accelerometer_walk) {
    const ImuNoise<double> noise{imu.gyroscope, imu.accelerometer, gyroscope_walk, accelerometer_walk};
    InitialisationOptions close = options;
    close.refinement.min_decrease = 1e-9;
    const auto r = refine(windowOf(recorded.scene, recorded.readings, {.preintegration = {.noise = noise}}),
                          recorded.start.solutions[0], {}, close);
    EXPECT_TRUE(r.ok());
    return r;
  };
  // The variance of the walk of an axis from the first image to the last.
  const auto walked = [](const RefinementResult& r, InitialCovariance::Block first, InitialCovariance::Block last) {
    return Eigen::Vector3d((r.covariance.block(first, first) + r.covariance.block(last, last) -
                            r.covariance.block(first, last) - r.covariance.block(last, first))
                               .diagonal());
  };
  using Block = InitialCovariance::Block;
  const auto still = refined(0, 0), both = refined(1e-3, 1e-2), gyroscope = refined(1e-3, 0),
             accelerometer = refined(0, 1e-2);
  for (const RefinementResult* r : {&still, &accelerometer}) {
    EXPECT_EQ(r->bias.gyroscope, r->last_bias.gyroscope);
    EXPECT_LE(walked(*r, Block::gyroscope_bias, Block::last_gyroscope_bias).maxCoeff(), 1e-18);
  }
  for (const RefinementResult* r : {&still, &gyroscope}) {
    EXPECT_EQ(r->bias.accelerometer, r->last_bias.accelerometer);
    EXPECT_LE(walked(*r, Block::accelerometer_bias, Block::last_accelerometer_bias).maxCoeff(), 1e-15);
  }
  for (const RefinementResult* r : {&both, &gyroscope}) {
    EXPECT_GT((r->bias.gyroscope - r->last_bias.gyroscope).norm(), 1e-6);
    const Eigen::Vector3d variance = walked(*r, Block::gyroscope_bias, Block::last_gyroscope_bias);
    EXPECT_GT(variance.minCoeff(), 0);
    EXPECT_LE(variance.maxCoeff(), 1e-6 * 2);
  }
  for (const RefinementResult* r : {&both, &accelerometer}) {
    EXPECT_GT((r->bias.accelerometer - r->last_bias.accelerometer).norm(), 1e-6);
    const Eigen::Vector3d variance = walked(*r, Block::accelerometer_bias, Block::last_accelerometer_bias);
    EXPECT_GT(variance.minCoeff(), 0);
    EXPECT_LE(variance.maxCoeff(), 1e-4 * 2);
  }
  // A walk makes nothing better known; one that goes to zero goes to none.
  for (int i = 0; i < 18; ++i) {
    EXPECT_GE(both.covariance.atLast()(i, i), still.covariance.atLast()(i, i) * (1 - 1e-9)) << i;
  }
  const auto hardly = refined(1e-4 * imu.gyroscope, 1e-4 * imu.accelerometer);
  EXPECT_NE(hardly.last_bias.gyroscope, hardly.bias.gyroscope);
  EXPECT_LE((hardly.covariance.joint - still.covariance.joint).norm(), 1e-6 * still.covariance.joint.norm());
  EXPECT_LE((hardly.velocity() - still.velocity()).norm(), 1e-7);
  EXPECT_NEAR(hardly.cost, still.cost, 1e-6 * still.cost);
}

// With right derivatives an undamped step of Gauss and Newton leaves to the next what the residuals' curvature makes of it.
TEST(Refinement, StepsWithWalkingBiasesLeaveLittle) {
  const Recorded recorded({.images = 9, .features = 15, .window = 2}, 91);
  ASSERT_FALSE(recorded.start.solutions.empty());
  const ImuNoise<double> noise{imu.gyroscope, imu.accelerometer, 0.02, 0.2};
  const InertialWindow window = windowOf(recorded.scene, recorded.readings, {.preintegration = {.noise = noise}});
  detail::RefinementProblem problem(window, options);
  ASSERT_TRUE(problem.setWeights());
  problem.start(recorded.start.solutions[0], {}, nullptr);
  detail::ReducedSystem system(problem.blocks(), problem.features().size());
  std::vector<double> costs;
  for (int k = 0; k < 8; ++k) {
    costs.push_back(problem.linearise(system));
    ASSERT_TRUE(system.factor(0));
    system.solve();
    problem.costAfter(system);
    problem.accept();
  }
  const auto left = [&](std::size_t k) { return costs[k] - costs.back(); };
  // Measured: 0.006, 7e-5 and 6e-4, then rounding of a cost of 220.
  EXPECT_LT(left(1), 0.02 * left(0));
  EXPECT_LT(left(2), 1e-3 * left(1));
  EXPECT_LT(left(3), 1e-2 * left(2));
  EXPECT_LT(std::abs(left(4)), 1e-9);
}

/// The scale of a trajectory against the true one, less 1.
double scaleError(const RefinementResult& r, const Scene& scene) {
  const SO3d back = scene.attitude(0).inverse();
  double both = 0, own = 0;
  for (std::size_t j = 1; j < r.states.size(); ++j) {
    const Eigen::Vector3d p = back * Eigen::Vector3d(scene.position(scene.times[j]) - scene.position(0));
    both += p.dot(r.states[j].translation());
    own += p.squaredNorm();
  }
  return both / own - 1;
}

// The standard deviation of the scale is true, and so is the probability of the biases under their prior.
TEST(Refinement, JudgesItsResult) {
  constexpr int trials = 150;
  double scale = 0;
  int improbable = 0;
  for (int trial = 0; trial < trials; ++trial) {
    const Recorded recorded({.images = 11, .features = 15, .window = 2}, 300000 + static_cast<std::uint64_t>(trial));
    ASSERT_FALSE(recorded.start.solutions.empty());
    const auto refined = refine(recorded.window, recorded.start.solutions[0], {}, options);
    ASSERT_TRUE(refined.converged());
    EXPECT_TRUE(refined.ok());
    scale += std::pow(scaleError(refined, recorded.scene) / refined.scale_sigma, 2);
    improbable += refined.prior_p < 0.1;
    // The larger axis of the vertical is that of the bias that the prior leaves, in the first place.
    EXPECT_GT(refined.tilt_sigma, 0.1 * options.prior.accelerometer_sigma / Scene::g);
    EXPECT_LT(refined.tilt_sigma, 1.5 * options.prior.accelerometer_sigma / Scene::g);
  }
  std::printf("scale: squared errors over predicted variances %.3f; %d of %d biases with p < 0.1\n", scale / trials,
              improbable, trials);
  EXPECT_NEAR(scale / trials, 1, 4 * std::sqrt(2. / trials));
  EXPECT_LE(improbable, 0.1 * trials + 4 * std::sqrt(0.09 * trials));
}

// A converged estimate that is too vague, or against the prior, is not ok, and the status says why.
TEST(Refinement, WithdrawsWhatIsTooVague) {
  const Recorded recorded({.images = 11, .features = 15, .window = 2}, 92);
  ASSERT_FALSE(recorded.start.solutions.empty());
  const auto refined = [&](const InitialisationOptions& o) {
    return refine(recorded.window, recorded.start.solutions[0], {}, o);
  };
  const auto good = refined(options);
  EXPECT_TRUE(good.ok());
  for (const double factor : {1e3, 3e4}) {
    InitialisationOptions noisy = options;
    noisy.inertial_noise_factor = factor;
    const auto vague = refined(noisy);
    EXPECT_FALSE(vague.ok());
    EXPECT_TRUE(vague.converged());
    EXPECT_TRUE(vague.scale_sigma > 0.3 || vague.tilt_sigma > 0.2);
    EXPECT_EQ(vague.status, vague.tilt_sigma > 0.2 ? Status::gravity_undetermined : Status::scale_unobservable);
    EXPECT_GT(vague.covariance.joint(0, 0), good.covariance.joint(0, 0));
  }
  InitialisationOptions strict = options;
  strict.closed_form.max_scale_sigma = 0.99 * good.scale_sigma;
  EXPECT_EQ(refined(strict).status, Status::scale_unobservable);
  strict.closed_form.max_tilt_sigma = 0.99 * good.tilt_sigma;
  EXPECT_EQ(refined(strict).status, Status::gravity_undetermined);
  // A bias ten prior sigmas away hardly shows in the cost of the bearings.
  for (const bool gyroscope : {false, true}) {
    InitialisationOptions wrong = options;
    if (gyroscope) {
      wrong.prior.mean.gyroscope = recorded.bias.gyroscope + Eigen::Vector3d(0.1, 0, 0);
    } else {
      wrong.prior.mean.accelerometer = recorded.bias.accelerometer + Eigen::Vector3d(0.3, 0.3, 0.3);
    }
    const auto far = refined(wrong);
    EXPECT_EQ(far.status, Status::ok);
    EXPECT_LT(far.prior_p, 1e-4);
    EXPECT_FALSE(far.ok());
  }
}

TEST(Refinement, RefusesBadInput) {
  const Recorded recorded({.images = 6, .features = 10, .window = 1}, 78);
  ASSERT_FALSE(recorded.start.solutions.empty());
  const ClosedFormSolution& start = recorded.start.solutions[0];
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto fault = [&](const InertialWindow& w, const ClosedFormSolution& s, const InitialisationOptions& o) {
    const auto refined = refine(w, s, {}, o);
    EXPECT_EQ(refined.status, Status::bad_input);
    EXPECT_FALSE(refined.ok());
    return refined.fault;
  };
  EXPECT_EQ(fault(recorded.window, start, {}), FaultKind::bad_option);
  InitialisationOptions bad = options;
  bad.prior.gyroscope_sigma = 0;
  EXPECT_EQ(fault(recorded.window, start, bad), FaultKind::bad_option);
  bad = options;
  bad.inertial_noise_factor = nan;
  EXPECT_EQ(fault(recorded.window, start, bad), FaultKind::bad_option);
  bad = options;
  bad.gravity = -9.81;
  EXPECT_EQ(fault(recorded.window, start, bad), FaultKind::bad_option);
  ClosedFormSolution wrong = start;
  wrong.velocity[1] = nan;
  EXPECT_EQ(fault(recorded.window, wrong, options), FaultKind::bad_option);
  EXPECT_EQ(fault({}, start, options), FaultKind::too_few_images);
  InertialWindow window = recorded.window;
  window.features[3][1].image = 60;
  EXPECT_EQ(fault(window, start, options), FaultKind::wrong_index);
  // No noise was given for the motions.
  window = recorded.window;
  window = windowOf(recorded.scene, recorded.readings);
  EXPECT_EQ(refine(window, start, {}, options).status, Status::bad_motion);
  // Features behind the camera are no start.
  wrong = start;
  for (Eigen::Vector3d& P : wrong.features) P *= -1;
  EXPECT_EQ(refine(recorded.window, wrong, {}, options).status, Status::no_start);
  wrong.features.clear();
  EXPECT_EQ(refine(recorded.window, wrong, {}, options).status, Status::no_start);
  // Biases that are far from those of the readings.
  bad = options;
  bad.prior.mean.gyroscope = Eigen::Vector3d(0.2, 0, 0);
  bad.prior.gyroscope_sigma = 1e-4;
  EXPECT_TRUE(refine(recorded.window, start, {}, bad).must_reintegrate);
}

// The readings are integrated anew when the estimate of the bias leaves the region where a first-order update is good:
// the result is that of readings which were integrated with the true biases from the beginning.
TEST(Refinement, IntegratesAnewWhereTheBiasHasGone) {
  for (std::uint64_t seed = 1; seed < 4; ++seed) {
    Scene scene({.images = 9, .features = 20}, 600 + seed);
    CounterRng random(600 + seed, 0, 1);
    // Beyond the 0.05 rad/s of Preintegration::mustReintegrate.
    const ImuBias<double> truth{0.12 * random.unitVector<3>(), Eigen::Vector3d::Zero()};
    const auto readings = readingsOf(scene, imu, random, truth.gyroscope);
    scene.addNoise(pixel, random);
    const InertialWindow from_zero = windowOf(scene, readings, {.preintegration = {.noise = imu}});
    const InertialWindow from_truth = windowOf(scene, readings, {.preintegration = {.noise = imu, .bias = truth}});
    InitialisationOptions wide = options;
    wide.prior.gyroscope_sigma = 0.2;
    wide.refinement.min_decrease = 1e-9;
    const ClosedFormSolution start{.velocity = scene.velocity, .gravity = scene.gravity, .features = scene.features};
    const RefinementResult expected = refine(from_truth, start, truth, wide);
    ASSERT_TRUE(expected.ok());
    EXPECT_EQ(expected.integrations, 0);
    const RefinementResult found = refine(from_zero, start, {}, wide);
    EXPECT_TRUE(found.ok());
    EXPECT_GE(found.integrations, 1);
    // The remaining difference is that of first-order updates over the start's error, 3e-3 rad/s.
    const Eigen::Matrix<double, 12, 12> covariance = expected.covariance.atFirst();
    const auto sigma = [&](int first) { return std::sqrt(covariance.diagonal().segment<3>(first).mean()); };
    EXPECT_LE((found.velocity() - expected.velocity()).norm(), 0.01 * sigma(0)) << seed;
    EXPECT_LE((found.gravity - expected.gravity).norm(), 0.01 * sigma(3)) << seed;
    EXPECT_LE((found.bias.gyroscope - expected.bias.gyroscope).norm(), 0.01 * sigma(6)) << seed;
    EXPECT_LE((found.covariance.joint - expected.covariance.joint).norm(), 0.01 * expected.covariance.joint.norm());
    // Without leave to integrate, or without readings, it says that it should have.
    InitialisationOptions never = wide;
    never.refinement.max_integrations = 0;
    for (const InertialWindow& window : {from_zero, InertialWindow(from_zero.motions(), from_zero.features)}) {
      const RefinementResult kept = refine(window, start, {}, never);
      EXPECT_EQ(kept.integrations, 0);
      EXPECT_TRUE(kept.must_reintegrate);
      EXPECT_FALSE(kept.ok());
      // The update of first order over the whole bias is what that spares.
      EXPECT_GT((kept.bias.gyroscope - expected.bias.gyroscope).norm(),
                10 * (found.bias.gyroscope - expected.bias.gyroscope).norm());
    }
  }
}

TEST(Refinement, MeetsTheTables) {
  struct Row {
    double window;
    std::size_t images, features;
    int trials;
    double speed[2], degrees[2], scale[2];  ///< median and 95 % of an independent prototype
  };
  const double none = std::numeric_limits<double>::infinity();
  const Row rows[] = {
      {1, 11, 20, 200, {0.041, 0.13}, {0.52, 1.0}, {1.9, 6}},
      {2, 11, 20, 200, {none, none}, {none, none}, {none, none}},
      {2, 21, 20, 100, {0.016, 0.05}, {0.27, 0.6}, {0.7, 2}},
      {3, 16, 20, 100, {none, none}, {none, none}, {none, none}},
      {2, 21, 50, 60, {none, none}, {none, none}, {none, none}},
  };
  std::printf(
      "  T  n  Nf  NEES of 3, 5, 11, last 9    chi2   95 %%  speed m/s       gravity deg   scale of V %%  of features  "
      "ok, "
      "iterations\n");
  for (const Row& row : rows) {
    std::vector<double> speed, degrees, scale, size;
    double index[4] = {}, cost = 0, dof = 0;
    int inside = 0, counted = 0, iterations = 0, ok = 0;
    for (int trial = 0; trial < row.trials; ++trial) {
      const Recorded recorded({.images = row.images, .features = row.features, .window = row.window},
                              200000 + static_cast<std::uint64_t>(trial));
      if (recorded.start.solutions.empty()) continue;
      const auto refined = refine(recorded.window, recorded.start.solutions[0], {}, options);
      ok += refined.ok();
      ASSERT_NE(refined.status, Status::bad_input);
      const Consistency nees(refined, recorded);
      for (int k = 0; k < 4; ++k) index[k] += nees.of[k];
      // χ²₅ at 0.95.
      inside += nees.of[1] <= 11.0705;
      ++counted;
      cost += refined.cost;
      dof += static_cast<double>(refined.degrees_of_freedom);
      iterations += refined.iterations;
      const Eigen::Vector3d& V = recorded.scene.velocity;
      speed.push_back((refined.velocity() - V).norm());
      degrees.push_back(tilt(refined.gravity, recorded.scene.gravity) * 180 / M_PI);
      scale.push_back(100 * std::abs(refined.velocity().norm() / V.norm() - 1));
      std::vector<double> ratio;
      for (std::size_t i = 0; i < row.features; ++i) {
        if (refined.features[i].allFinite()) {
          ratio.push_back(refined.features[i].norm() / recorded.scene.features[i].norm());
        }
      }
      size.push_back(100 * std::abs(quantile(ratio, 0.5) - 1));
    }
    std::printf(
        "%3.0f %2zu %3zu  %5.2f %5.2f %5.2f  %5.2f   %.3f  %3.0f   %.4f / %.3f  %.3f / %.2f  %.2f / %4.1f   %.2f / "
        "%.1f   %d of %d, %.1f\n",
        row.window, row.images, row.features, index[0] / counted, index[1] / counted, index[2] / counted,
        index[3] / counted, cost / dof, 100. * inside / counted, quantile(speed, 0.5), quantile(speed, 0.95),
        quantile(degrees, 0.5), quantile(degrees, 0.95), quantile(scale, 0.5), quantile(scale, 0.95),
        quantile(size, 0.5), quantile(size, 0.95), ok, row.trials, 1. * iterations / counted);
    EXPECT_GE(ok, row.trials * 98 / 100);
    const double expected[] = {3, 5, 11, 9};
    for (int k = 0; k < 4; ++k) {
      EXPECT_NEAR(index[k] / counted, expected[k], 4 * std::sqrt(2 * expected[k] / counted)) << k;
    }
    EXPECT_NEAR(cost / dof, 1, 0.02);
    EXPECT_NEAR(1. * inside / counted, 0.95, 4 * std::sqrt(0.05 * 0.95 / counted));
    // Quantiles within four standard errors of their ranks: of this run, and of the 50 trials of the targets.
    const auto meets = [&](std::vector<double> values, const double* target) {
      for (const int k : {0, 1}) {
        const double p = k == 0 ? 0.5 : 0.95, error = std::sqrt(p * (1 - p) * (1. / counted + 1. / 50));
        EXPECT_LE(quantile(values, std::max(0., p - 4 * error)), target[k]) << p;
      }
    };
    meets(speed, row.speed);
    meets(degrees, row.degrees);
    meets(scale, row.scale);
  }
}

}  // namespace
