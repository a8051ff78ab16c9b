// Recursive motion: one update of the direction in compact and in dense form, a whole frame of the filters, and the search
// over the sphere. N points of an orbit at 1 px.
#include <experiments/motion_scene.hpp>
#include <fusion/motion/motion_filter.hpp>
#include <fusion/motion/search.hpp>
#include <fusion/motion/subspace_filter.hpp>

#include <benchmark/benchmark.h>

#include <Eigen/Cholesky>
#include <Eigen/QR>

#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat::bench {
namespace {

using experiments::MotionScene;

MotionScene sceneOf(std::int64_t n, double gyroscope = 0) {
  experiments::MotionSceneOptions options;
  options.points = static_cast<std::size_t>(n), options.gyroscope_sigma = gyroscope;
  return MotionScene(options, 1);
}
std::vector<FlowPoint<double>> flowsOf(const MotionScene& scene) {
  std::vector<FlowPoint<double>> points;
  for (const PointPair& pair : scene.pairs) points.push_back(flowOf(pair, Flow::midpoint));
  return points;
}

void compactUpdate(benchmark::State& state) {
  MotionScene scene = sceneOf(state.range(0));
  scene.advance();
  const auto points = flowsOf(scene);
  std::vector<FlowRow<double>> rows(points.size());
  const S2d direction(scene.velocity);
  for (auto _ : state) {
    FilterCovariance<double, 2> P{1e-3 * Eigen::Matrix2d::Identity(), 1e-3 * Eigen::Matrix2d::Identity()};
    const Eigen::Matrix3d frame = ManifoldTraits<S2d>::placement(direction).matrix();
    flowRows<double>(points, direction.unit_vector(), rows);
    const FlowRotationSums<double> rotation = rotationSums<double>(rows);
    const Eigen::Vector3d Omega = rotation.solve({});
    const SubspaceSums<double> sums = subspaceSums<double>(points, rows, frame.leftCols<2>(), Omega, rotation.M);
    auto step = updateCovariance(P, eliminateRotation(sums, Omega, {}), 0.5);
    benchmark::DoNotOptimize(step);
  }
}

/// The printed form with matrices of 2N rows; the innovation's pseudo-inverse by Cholesky's factor of Λ + C C⁺.
void denseUpdate(benchmark::State& state) {
  MotionScene scene = sceneOf(state.range(0));
  scene.advance();
  const auto points = flowsOf(scene);
  const S2d direction(scene.velocity);
  const auto n = static_cast<Eigen::Index>(points.size());
  const Eigen::Matrix2d P = 1e-3 * Eigen::Matrix2d::Identity();
  for (auto _ : state) {
    const Eigen::Vector3d V = direction.unit_vector();
    const Eigen::Matrix<double, 3, 2> E = ManifoldTraits<S2d>::placement(direction).matrix().leftCols<2>();
    Eigen::MatrixXd C = Eigen::MatrixXd::Zero(2 * n, n + 3);
    Eigen::VectorXd flow(2 * n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const FlowPoint<double>& p = points[static_cast<std::size_t>(i)];
      const double w = 1 / std::sqrt(p.variance);
      C.block<2, 1>(2 * i, i) = w * (flowByVelocity(p.x, p.y) * V);
      C.block<2, 3>(2 * i, n) = w * flowByRotation(p.x, p.y);
      flow.segment<2>(2 * i) << w * p.u, w * p.v;
    }
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(C);
    const Eigen::MatrixXd Q = qr.householderQ() * Eigen::MatrixXd::Identity(2 * n, n + 3);
    const Eigen::MatrixXd across = Eigen::MatrixXd::Identity(2 * n, 2 * n) - Q * Q.transpose();
    const Eigen::VectorXd p = qr.solve(flow);
    Eigen::MatrixXd moved(2 * n, 2);
    for (Eigen::Index i = 0; i < n; ++i) {
      const FlowPoint<double>& point = points[static_cast<std::size_t>(i)];
      moved.middleRows<2>(2 * i) = p[i] / std::sqrt(point.variance) * (flowByVelocity(point.x, point.y) * E);
    }
    const Eigen::MatrixXd J = -(across * moved);
    // Λ = J P Jᵀ + D R Dᵀ, D R Dᵀ = I - C C⁺; C C⁺ completes its rank.
    const Eigen::MatrixXd Lambda = J * P * J.transpose() + Eigen::MatrixXd::Identity(2 * n, 2 * n);
    const Eigen::LLT<Eigen::MatrixXd> factor(Lambda);
    const Eigen::MatrixXd solved = factor.solve(J);
    Eigen::Vector2d step = -(P * solved.transpose() * (across * flow));
    Eigen::Matrix2d covariance = P - P * solved.transpose() * J * P;
    benchmark::DoNotOptimize(step);
    benchmark::DoNotOptimize(covariance);
  }
}

void costOnly(benchmark::State& state) {
  MotionScene scene = sceneOf(state.range(0));
  scene.advance();
  const auto points = flowsOf(scene);
  std::vector<FlowRow<double>> rows(points.size());
  const Eigen::Vector3d V = scene.velocity.normalized();
  for (auto _ : state) {
    double cost = subspaceCost(points, V, rows);
    benchmark::DoNotOptimize(cost);
  }
}

/// Frames of a filter, from its start (all hypotheses at work) or after it has settled.
template <class Filter>
void frames(benchmark::State& state, const MotionFilterOptions& options, bool settled, double gyroscope = 0) {
  std::vector<MotionScene> recorded;
  MotionScene scene = sceneOf(state.range(0), gyroscope);
  for (int k = 0; k < 60; ++k) {
    scene.advance();
    recorded.push_back(scene);
  }
  const auto update = [&](Filter& filter, const MotionScene& frame) {
    auto direction =
        (gyroscope > 0 ? filter.update(frame.pairs, frame.gyroscope) : filter.update(frame.pairs)).direction.mean;
    benchmark::DoNotOptimize(direction);
  };
  Filter filter(options);
  if (settled) {
    for (const MotionScene& frame : recorded) update(filter, frame);
  }
  std::size_t k = 0;
  for (auto _ : state) {
    // Five frames come before the first hypothesis may be dropped.
    if (!settled && k % 5 == 0) filter.reset();
    update(filter, recorded[settled ? k % 60 : k % 5]);
    ++k;
  }
}

void allStarts(benchmark::State& state) { frames<SubspaceFilter>(state, {}, false); }
void settled(benchmark::State& state) { frames<SubspaceFilter>(state, {}, true); }
void composition(benchmark::State& state) { frames<MotionFilter>(state, {}, true); }
void withGyroscope(benchmark::State& state) {
  MotionFilterOptions options;
  options.flow = Flow::discrete;
  frames<SubspaceFilter>(state, options, true, 0.1);
}
void withBias(benchmark::State& state) {
  MotionFilterOptions options;
  options.flow = Flow::discrete, options.estimate_bias = true;
  frames<SubspaceFilter>(state, options, true, 0.1);
}
void withOutliers(benchmark::State& state) {
  MotionFilterOptions options;
  options.outliers = true;
  frames<SubspaceFilter>(state, options, true);
}
void search(benchmark::State& state) {
  MotionScene scene = sceneOf(state.range(0));
  scene.advance();
  SphereSearch sphere;
  for (auto _ : state) {
    auto best = sphere.update(scene.pairs);
    benchmark::DoNotOptimize(best);
  }
}

BENCHMARK(compactUpdate)->Name("Motion/compact update")->Arg(20)->Arg(100)->Arg(200)->Arg(1000);
BENCHMARK(denseUpdate)->Name("Motion/dense update")->Arg(20)->Arg(100)->Arg(200);
// A second and a half each.
BENCHMARK(denseUpdate)->Name("Motion/dense update")->Arg(1000)->Iterations(1);
BENCHMARK(costOnly)->Name("Motion/cost")->Arg(20)->Arg(100)->Arg(200)->Arg(1000);
BENCHMARK(allStarts)->Name("Motion/frame of 32 starts")->Arg(20)->Arg(100)->Arg(200)->Arg(1000);
BENCHMARK(settled)->Name("Motion/frame of one hypothesis")->Arg(20)->Arg(100)->Arg(200)->Arg(1000);
BENCHMARK(withGyroscope)->Name("Motion/frame with gyroscope")->Arg(20)->Arg(100);
BENCHMARK(withBias)->Name("Motion/frame with gyroscope and bias")->Arg(20)->Arg(100);
BENCHMARK(withOutliers)->Name("Motion/frame among outliers")->Arg(20)->Arg(100);
BENCHMARK(composition)->Name("Motion/frame of the composition")->Arg(20)->Arg(100);
BENCHMARK(search)->Name("Motion/search of 300 directions")->Arg(20)->Arg(100);

}  // namespace
}  // namespace liestat::bench
