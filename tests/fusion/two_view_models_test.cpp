// The models of two-view motion: derivatives, covariances, and what the hierarchy makes of synthetic motions.

#include <experiments/two_view_scene.hpp>
#include <fusion/two_view/models.hpp>
#include <stats/hierarchy.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

namespace {

using namespace liestat;
using experiments::TwoViewMotion;
using experiments::TwoViewScene;
using TwoViewHierarchy = Hierarchy<Eigen::Vector4d, TwoViewMotionModel>;

TwoViewImages imagesOf(const TwoViewScene& scene) {
  const auto& o = scene.options;
  return {{o.sigma / o.focal_length, o.sigma / o.focal_length},
          Eigen::Vector2d(o.width, o.height) / o.focal_length};
}

TEST(TwoViewModels, TheHierarchyFindsTheMotion) {
  constexpr std::uint64_t trials = 20;
  int all = 0, right = 0;
  for (const TwoViewMotion motion : experiments::default_two_view_motions) {
    int of_this = 0;
    for (std::uint64_t seed = 0; seed < trials; ++seed) {
      const TwoViewScene scene({.motion = motion}, seed);
      TwoViewHierarchy search(twoViewModels(imagesOf(scene)));
      ASSERT_TRUE(search.valid()) << search.fault();
      search.add(scene.matches);
      while (search.iterate()) {
      }
      const std::string found = search.models()[search.best()]->name();
      of_this += found == nameOf(motion);
      if (found != nameOf(motion)) std::printf("%s -> %s (%d)\n", nameOf(motion), found.c_str(), (int)seed);
    }
    std::printf("%s %d\n", nameOf(motion), of_this);
    right += of_this, all += trials;
  }
  std::printf("%d of %d\n", right, all);
}

}  // namespace
