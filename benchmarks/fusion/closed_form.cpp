// The closed form of visual-inertial initialisation: one pass of elimination, minimisers and back-substitution; whole
// solves; consensus over features; the gyroscope's bias, with the motion and from rotations; the whole initialisation
// with wrong tracks; the refinement; and the dense normal equations that a straightforward program sets up.
#include "../inputs.hpp"

#include <fusion/imu/window.hpp>
#include <fusion/init/epipolar_gyroscope_bias.hpp>
#include <fusion/init/closed_form.hpp>
#include <fusion/init/consensus.hpp>
#include <fusion/init/gyroscope_bias.hpp>
#include <fusion/init/refinement.hpp>
#include <fusion/init/robust_initialisation.hpp>
#include <lie/so3.hpp>

#include <Eigen/Cholesky>
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstddef>
#include <random>
#include <span>
#include <vector>

namespace liestat::bench {
namespace {

constexpr double noise = 1. / 450;

/// Two seconds of a body that swings and turns among features some five metres ahead.
ClosedFormWindow makeWindow(std::size_t images, std::size_t features, double sigma) {
  Inputs random;
  const Eigen::Vector3d velocity(0.8, -0.5, 0.2), gravity(1, 2, -9.5);
  const auto moved = [&](double t) {
    return Eigen::Vector3d(t * velocity +
                           0.3 * Eigen::Vector3d(std::sin(3 * t), 1 - std::cos(2.5 * t), std::sin(2 * t)));
  };
  ClosedFormWindow window;
  for (std::size_t j = 0; j < images; ++j) {
    const double t = 2. * static_cast<double>(j) / static_cast<double>(images - 1);
    // V is the derivative at the start.
    const Eigen::Vector3d V = velocity + Eigen::Vector3d(0.9, 0, 0.6);
    window.images.push_back({t, SO3d::exp(0.4 * Eigen::Vector3d(std::sin(t), std::sin(2 * t), t)).matrix(),
                             moved(t) - t * V - 0.5 * t * t * gravity});
  }
  for (std::size_t i = 0; i < features; ++i) {
    const Eigen::Vector3d P = Eigen::Vector3d(0, 0, 5) + 1.5 * random.normal<3>();
    FeatureTrack track;
    for (std::size_t j = 0; j < images; ++j) {
      const Eigen::Vector3d mu =
          window.images[j].rotation.transpose() * (P - moved(window.images[j].time)).normalized();
      track.push_back({j, mu + sigma * random.normal<3>()});
    }
    window.features.push_back(track);
  }
  return window;
}

ClosedFormWindow makeWindow(const benchmark::State& state, double sigma) {
  return makeWindow(static_cast<std::size_t>(state.range(0)), static_cast<std::size_t>(state.range(1)), sigma);
}

void pass(benchmark::State& state) {
  const ClosedFormWindow window = makeWindow(state, noise);
  const InitialisationOptions options{.bearing_noise = noise, .gravity = Eigen::Vector3d(1, 2, -9.5).norm()};
  ClosedFormResult result;
  detail::RayTable table = detail::rayTable(window, result);
  detail::ClosedFormSolver solver(table, options);
  solver.resetWeights();
  for (auto _ : state) {
    auto found = solver.minimise(detail::Triangle::cholesky(solver.eliminate().Q), 1e-12);
    for (std::size_t i = 0; i < table.features(); ++i) found[0].P.push_back(solver.feature(i, found[0].y));
    solver.evaluate(found[0]);
    benchmark::DoNotOptimize(found);
  }
  state.SetComplexityN(state.range(0) * state.range(1));
}

void solve(benchmark::State& state, const InitialisationOptions& options, double sigma) {
  const ClosedFormWindow window = makeWindow(state, sigma);
  for (auto _ : state) {
    auto result = solveClosedForm(window, options);
    if (!result.ok()) state.SkipWithError(describe(result.status));
    benchmark::DoNotOptimize(result);
  }
  state.SetComplexityN(state.range(0) * state.range(1));
}

const double gravity_length = Eigen::Vector3d(1, 2, -9.5).norm();

void noisy(benchmark::State& state) {
  solve(state, {.bearing_noise = noise, .gravity = gravity_length, .closed_form = {.singular_values = false}}, noise);
}
void exact(benchmark::State& state) { solve(state, {.gravity = gravity_length}, 0); }
void bias(benchmark::State& state) {
  // The prior decides: only the time is of interest.
  const ClosedFormWindow window = makeWindow(state, noise);
  const InitialisationOptions options{.bearing_noise = noise,
                                      .gravity = gravity_length,
                                      .closed_form = {.estimate_bias = true, .singular_values = false}};
  for (auto _ : state) {
    auto result = solveClosedForm(window, options);
    benchmark::DoNotOptimize(result);
  }
}

/// Fifty hypotheses where four tracks of ten drift, with the solve of those that stay.
void ransac(benchmark::State& state) {
  ClosedFormWindow window = makeWindow(state, noise);
  Inputs random;
  for (std::size_t i = 0; i < window.features.size() * 2 / 5; ++i) {
    Eigen::Vector3d walk = Eigen::Vector3d::Zero();
    for (TrackedBearing& seen : window.features[i]) seen.bearing += walk += 8 * noise * random.normal<3>();
  }
  // A confidence that is never reached: all hypotheses are tried.
  const InitialisationOptions options{.bearing_noise = noise,
                                      .gravity = gravity_length,
                                      .closed_form = {.singular_values = false},
                                      .consensus = {.max_hypotheses = 50, .confidence = 1 - 1e-16}};
  for (auto _ : state) {
    auto robust = solveClosedFormRobustly(window, options);
    if (robust.hypotheses != 50) state.SkipWithError("not fifty hypotheses");
    benchmark::DoNotOptimize(robust);
  }
}

/// The same two seconds with an inertial sensor at 200 Hz, its gyroscope off by 0.01 rad/s.
struct Measured {
  Eigen::Vector3d velocity{1.7, -0.5, 0.8}, gravity{1, 2, -9.5};
  InertialWindow window;

  explicit Measured(const benchmark::State& state) {
    const auto images = static_cast<std::size_t>(state.range(0)), features = static_cast<std::size_t>(state.range(1));
    Inputs random;
    const int readings = 400 / static_cast<int>(images - 1);
    const Eigen::Vector3d off(0.006, -0.008, 0);
    SO3d turned;
    std::vector<Preintegration<double>> truth, motions;
    for (std::size_t j = 1; j < images; ++j) {
      const PreintegrationOptions<double> options{.noise = {.gyroscope = 1.7e-4, .accelerometer = 2e-3}};
      Preintegration<double> exact(options), measured(options);
      for (int k = 0; k < readings; ++k) {
        const double h = 0.005, t = h * (static_cast<double>(j - 1) * readings + k);
        const Eigen::Vector3d rate = 0.5 * Eigen::Vector3d(std::cos(t), 2 * std::cos(2 * t), 1);
        const Eigen::Vector3d acceleration(-2.7 * std::sin(3 * t), 1.9 * std::cos(2.5 * t), -1.2 * std::sin(2 * t));
        const Eigen::Vector3d force = turned.inverse() * Eigen::Vector3d(acceleration - gravity);
        exact.add(h, rate, force);
        measured.add(h, rate + off + random.normal<3>(1.7e-4 / std::sqrt(h)),
                     force + random.normal<3>(2e-3 / std::sqrt(h)));
        turned *= SO3d::exp(h * rate);
      }
      truth.push_back(exact);
      motions.push_back(measured);
    }
    window = InertialWindow(motions);
    const auto seen_from = biasedImages(truth, {});
    for (std::size_t i = 0; i < features; ++i) {
      const Eigen::Vector3d P = Eigen::Vector3d(0, 0, 5) + 1.5 * random.normal<3>();
      FeatureTrack track;
      for (std::size_t j = 0; j < images; ++j) {
        const WindowImage& at = seen_from[j].image;
        const Eigen::Vector3d d = P - at.time * velocity - 0.5 * at.time * at.time * gravity - at.displacement;
        track.push_back({j, at.rotation.transpose() * d.normalized() + noise * random.normal<3>()});
      }
      window.features.push_back(track);
    }
  }
  InitialisationOptions options() const {
    return {.bearing_noise = noise, .gravity = gravity.norm(), .closed_form = {.singular_values = false}};
  }
};

void gyroscopeBias(benchmark::State& state) {
  const Measured measured(state);
  const InitialisationOptions options = measured.options();
  for (auto _ : state) {
    auto found = estimateGyroscopeBias(measured.window, options);
    if (found.status != FusionStatus::ok) state.SkipWithError("not found");
    benchmark::DoNotOptimize(found);
  }
}

/// Four tracks of ten drift.
InertialWindow withDrift(InertialWindow window) {
  Inputs random;
  for (std::size_t i = 0; i < window.features.size() * 2 / 5; ++i) {
    Eigen::Vector3d walk = Eigen::Vector3d::Zero();
    for (TrackedBearing& seen : window.features[i]) seen.bearing += walk += 8 * noise * random.normal<3>();
  }
  return window;
}

void epipolarBias(benchmark::State& state) {
  const InertialWindow window = withDrift(Measured(state).window);
  for (auto _ : state) {
    auto found = estimateEpipolarGyroscopeBias(window, {.bearing_noise = noise});
    if (!found.ok()) state.SkipWithError(describe(found.status));
    benchmark::DoNotOptimize(found);
  }
}

void robustInitialisation(benchmark::State& state) {
  const Measured measured(state);
  const InertialWindow window = withDrift(measured.window);
  const InitialisationOptions options = measured.options();
  for (auto _ : state) {
    auto found = initialiseRobustly(window, options);
    if (found.status != FusionStatus::ok) state.SkipWithError(describe(found.status));
    benchmark::DoNotOptimize(found);
  }
}

void refinement(benchmark::State& state) {
  const Measured measured(state);
  const auto start = solveClosedForm(closedFormWindow(measured.window, {}), measured.options());
  if (start.solutions.empty()) {
    state.SkipWithError(describe(start.status));
    return;
  }
  double iterations = 0;
  for (auto _ : state) {
    auto refined =
        refine(measured.window, start.solutions[0], {}, {.bearing_noise = noise, .gravity = measured.gravity.norm()});
    if (!refined.ok()) state.SkipWithError("not refined");
    iterations = refined.iterations;
    benchmark::DoNotOptimize(refined);
  }
  state.counters["iterations"] = iterations;
}

/// All unknowns at once, gravity's length free: what elimination saves.
void dense(benchmark::State& state) {
  const ClosedFormWindow window = makeWindow(state, noise);
  ClosedFormResult result;
  const detail::RayTable table = detail::rayTable(window, result);
  const Eigen::Index features = 3 * static_cast<Eigen::Index>(table.features());
  for (auto _ : state) {
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(2 * static_cast<Eigen::Index>(table.rays.size()), features + 6);
    Eigen::VectorXd b(A.rows());
    Eigen::Index row = 0;
    for (std::size_t i = 0; i < table.features(); ++i) {
      for (const detail::Ray& ray : table.of(i)) {
        const auto& image = table.images[ray.image];
        const Eigen::Matrix<double, 2, 3> N = detail::tangentRows(ray.u);
        A.block<2, 3>(row, 3 * static_cast<Eigen::Index>(i)) = N;
        A.block<2, 3>(row, features) = -image.tau * N;
        A.block<2, 3>(row, features + 3) = -image.tau * image.tau * N;
        b.segment<2>(row) = N * image.s;
        row += 2;
      }
    }
    Eigen::VectorXd x = (A.transpose() * A).ldlt().solve(A.transpose() * b);
    benchmark::DoNotOptimize(x);
  }
  state.SetComplexityN(state.range(0) * state.range(1));
}

BENCHMARK(pass)
    ->Name("ClosedForm/one pass")
    ->Args({21, 25})
    ->Args({21, 50})
    ->Args({21, 100})
    ->Args({21, 200})
    ->Complexity(benchmark::oN)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK(noisy)->Name("ClosedForm/noisy data, all passes")->Args({21, 50})->Unit(benchmark::kMicrosecond);
BENCHMARK(exact)->Name("ClosedForm/exact data, ranks")->Args({21, 50})->Unit(benchmark::kMicrosecond);
BENCHMARK(bias)->Name("ClosedForm/noisy data with bias")->Args({21, 50})->Unit(benchmark::kMicrosecond);
BENCHMARK(ransac)->Name("ClosedForm/50 hypotheses")->Args({21, 50})->Unit(benchmark::kMicrosecond);
BENCHMARK(gyroscopeBias)->Name("ClosedForm/gyroscope's bias")->Args({21, 50})->Unit(benchmark::kMicrosecond);
BENCHMARK(epipolarBias)
    ->Name("Initialisation/gyroscope's bias from rotations")
    ->Args({21, 50})
    ->Unit(benchmark::kMicrosecond);
BENCHMARK(robustInitialisation)
    ->Name("Initialisation/with wrong tracks and bias")
    ->Args({21, 50})
    ->Unit(benchmark::kMicrosecond);
BENCHMARK(refinement)
    ->Name("Refinement")
    ->Args({11, 50})
    ->Args({21, 25})
    ->Args({21, 50})
    ->Args({21, 100})
    ->Args({41, 50})
    ->Unit(benchmark::kMicrosecond);
BENCHMARK(dense)
    ->Name("Dense/normal equations")
    ->Args({21, 25})
    ->Args({21, 50})
    ->Args({21, 100})
    ->Complexity()
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace liestat::bench
