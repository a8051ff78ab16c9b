// A whole lattice of two-view models: every model is searched for, estimated and compared, and one is chosen. Matches
// of a moving camera, half a pixel of noise, 20 scenes; the time is that of one answer. `right` is the share of the
// scenes whose own model was chosen, `inliers` their mean number.
#include <experiments/two_view_scene.hpp>
#include <fusion/two_view/two_view.hpp>

#include <benchmark/benchmark.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace liestat::bench {
namespace {

using experiments::TwoViewMotion;
using experiments::TwoViewScene;
using experiments::TwoViewSceneOptions;

void add(TwoViewMotion motion, std::size_t matches, double outliers) {
  const std::string name = std::string("TwoViewLattice/") + nameOf(motion) + "/" + std::to_string(matches) + "/" +
                           std::to_string(static_cast<int>(100 * outliers)) + " % outliers";
  benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) {
    std::vector<TwoViewScene> scenes;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      scenes.emplace_back(TwoViewSceneOptions{.motion = motion, .matches = matches, .outliers = outliers}, seed);
    }
    std::size_t next = 0;
    double right = 0, inliers = 0;
    for (auto _ : state) {
      const TwoViewScene& scene = scenes[next];
      next = (next + 1) % scenes.size();
      TwoViewMotionOptions options;
      options.sigma = scene.options.sigma;
      Camera camera;
      camera.fu = camera.fv = scene.options.focal_length;
      camera.cu = 0.5 * scene.options.width, camera.cv = 0.5 * scene.options.height;
      options.first = camera;
      options.image_size = Eigen::Vector2d(scene.options.width, scene.options.height);
      const TwoViewMotionEstimate found = estimateTwoViewMotion(scene.pixels, options);
      right += found.chosenModel().name == nameOf(motion) ? 1 : 0;
      inliers += static_cast<double>(found.inliers);
    }
    state.counters["right"] = right / static_cast<double>(state.iterations());
    state.counters["inliers"] = inliers / static_cast<double>(state.iterations());
  })->Unit(benchmark::kMillisecond);
}

}  // namespace
}  // namespace liestat::bench

int main(int argc, char** argv) {
  using namespace liestat::bench;
  for (const TwoViewMotion motion : {TwoViewMotion::rotation, TwoViewMotion::homography, TwoViewMotion::essential}) {
    for (const double outliers : {0.2, 0.5}) add(motion, 100, outliers);
  }
  add(TwoViewMotion::essential, 1000, 0.2);
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
