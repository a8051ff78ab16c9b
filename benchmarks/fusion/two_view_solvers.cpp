// The closed-form solvers of two-view motion: one solve of a minimal sample, or of more matches, averaged over samples
// of many scenes with half a pixel of noise. `solutions` is their mean number.
#include <experiments/two_view_scene.hpp>
#include <fusion/two_view/focal_lengths.hpp>
#include <fusion/two_view/pose.hpp>
#include <fusion/two_view/solvers.hpp>

#include <benchmark/benchmark.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace liestat::bench {
namespace {

using experiments::TwoViewMotion;
using experiments::TwoViewScene;
using Matches = std::span<const Eigen::Vector4d>;

template <class Solve>
void add(const std::string& name, TwoViewMotion motion, std::size_t n, const Solve& solve) {
  benchmark::RegisterBenchmark(("TwoView/" + name + "/" + std::to_string(n)).c_str(), [=](benchmark::State& state) {
    std::vector<Eigen::Vector4d> all;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const TwoViewScene scene({.motion = motion, .outliers = 0}, seed);
      all.insert(all.end(), scene.matches.begin(), scene.matches.end());
    }
    const std::size_t samples = all.size() / n;
    std::size_t i = 0, found = 0;
    for (auto _ : state) {
      const auto solutions = solve(Matches(all).subspan(n * i, n));
      benchmark::DoNotOptimize(solutions);
      found += solutions.size();
      i = i + 1 == samples ? 0 : i + 1;
    }
    state.counters["solutions"] = static_cast<double>(found) / static_cast<double>(state.iterations());
  });
}

void poseByCheirality(benchmark::State& state) {
  const TwoViewScene scene({.outliers = 0}, 1);
  for (auto _ : state) {
    auto chosen = liestat::poseByCheirality(scene.F, scene.matches);
    benchmark::DoNotOptimize(chosen);
  }
}
void posesOfHomography(benchmark::State& state) {
  const TwoViewScene scene({.motion = TwoViewMotion::homography, .outliers = 0}, 1);
  for (auto _ : state) {
    auto found = liestat::posesOfHomography(scene.H, scene.matches);
    benchmark::DoNotOptimize(found);
  }
}
void focalLengths(benchmark::State& state) {
  const TwoViewScene scene({.motion = TwoViewMotion::fundamental, .outliers = 0}, 1);
  for (auto _ : state) {
    auto found = liestat::focalLengths(scene.F);
    benchmark::DoNotOptimize(found);
  }
}

const bool registered = [] {
  using M = TwoViewMotion;
  add("retinal translation", M::retinal_translation, 1, [](Matches m) { return solveRetinalTranslation(m); });
  add("zoom", M::zoom, 1, [](Matches m) { return solveZoom(m); });
  add("retinal displacement", M::retinal_displacement, 2, [](Matches m) { return solveRetinalDisplacement(m); });
  add("similarity", M::similarity, 2, [](Matches m) { return solveSimilarity(m); });
  add("affine", M::affine, 3, [](Matches m) { return solveAffine(m); });
  for (const std::size_t n : {2U, 50U}) {
    add("rotation", M::rotation, n, [](Matches m) { return solveRotation(m); });
    add("translation", M::translation, n, [](Matches m) { return solveTranslation(m); });
  }
  add("rotation and zoom", M::rotation_zoom, 2, [](Matches m) { return solveRotationZoom(m); });
  for (const std::size_t n : {4U, 50U}) {
    add("homography", M::homography, n, [](Matches m) { return solveHomography(m); });
    add("affine epipolar", M::affine_epipolar, n, [](Matches m) { return solveAffineEpipolar(m); });
  }
  for (const std::size_t n : {7U, 8U, 50U}) {
    add("fundamental", M::fundamental, n, [](Matches m) { return solveFundamental(m); });
  }
  add("essential", M::essential, 5, [](Matches m) { return solveEssential(m); });
  return true;
}();
BENCHMARK(poseByCheirality)->Name("TwoView/pose by cheirality/100");
BENCHMARK(posesOfHomography)->Name("TwoView/poses of a homography/100");
BENCHMARK(focalLengths)->Name("TwoView/focal lengths");

}  // namespace
}  // namespace liestat::bench
