// Patches and their covariance on rendered images, without a library of images: places are looked for from near the truth.

#include <fusion/tracking/patch.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <support/rendered_scene.hpp>

namespace liestat {
namespace {

using testing::RenderedKind;
using testing::RenderedScene;

std::vector<Eigen::Vector2i> grid() {
  std::vector<Eigen::Vector2i> pixels;
  for (int v = 40; v <= 200; v += 20) {
    for (int u = 40; u <= 280; u += 20) pixels.emplace_back(u, v);
  }
  return pixels;
}

PatchMatch beginning(const Eigen::Vector2i& pixel) {
  PatchMatch match;
  match.at = pixel.cast<double>();
  return match;
}

TEST(Patch, findsTheNoiseAndTheCovarianceThatNobodyTold) {
  for (const double noise : {2., 8.}) {
    RenderedScene scene(RenderedKind::still_light, noise, 5);
    SmoothImage image;
    image.take(scene.render(0));
    struct Followed {
      Patch patch;
      PatchMatch match;
    };
    std::vector<Followed> followed;
    for (const Eigen::Vector2i& pixel : grid()) {
      if (auto patch = Patch::at(image, pixel)) followed.push_back({std::move(*patch), beginning(pixel)});
    }
    ASSERT_GT(followed.size(), 60U);
    double total = 0, count = 0, noises = 0;
    for (std::size_t i = 1; i <= 3; ++i) {
      image.take(scene.render(i));
      for (Followed& f : followed) {
        const Eigen::Vector2d truth = scene.follow(f.patch.pixel().cast<double>(), 0, i);
        PatchFault fault;
        const auto match = f.patch.find(image, truth + Eigen::Vector2d(0.4, -0.3), f.match, fault);
        if (!match) continue;
        f.match = *match;
        const Eigen::Vector2d error = match->at - truth;
        total += error.dot((match->covariance + f.patch.templateCovariance()).inverse() * error) / 2;
        noises += match->noise;
        ++count;
      }
    }
    ASSERT_GT(count, 3 * 0.7 * static_cast<double>(followed.size()));
    // Matches of one template share its error: about 150 that are independent, two coordinates each, a standard error
    // of 0.08.
    EXPECT_NEAR(total / count, 1, 0.25) << noise;
    EXPECT_NEAR(noises / count, noise, 0.2 * noise);
  }
}

TEST(Patch, endsAtWhatIsNoLongerTheSame) {
  RenderedScene scene(RenderedKind::still_light, 2, 6), other(RenderedKind::still_light, 2, 7);
  SmoothImage image, strange, black;
  image.take(scene.render(0));
  strange.take(other.render(0));
  const std::vector<std::uint8_t> zeros(320 * 240, 0);
  black.take({zeros.data(), 320, 240, 320});
  std::size_t found = 0, tried = 0;
  for (const Eigen::Vector2i& pixel : grid()) {
    auto patch = Patch::at(image, pixel);
    if (!patch) continue;
    ++tried;
    PatchFault fault;
    found += patch->find(strange, pixel.cast<double>(), beginning(pixel), fault).has_value();
    EXPECT_FALSE(patch->find(black, pixel.cast<double>(), beginning(pixel), fault));
    EXPECT_NE(fault, PatchFault::none);
    EXPECT_FALSE(patch->find(image, Eigen::Vector2d(3, 100), beginning(pixel), fault));
    EXPECT_FALSE(patch->find(image, Eigen::Vector2d(NAN, 100), beginning(pixel), fault));
  }
  EXPECT_GT(tried, 60U);
  EXPECT_LE(found, tried / 20);
  EXPECT_FALSE(Patch::at(black, {100, 100}));
  EXPECT_FALSE(Patch::at(image, {Patch::margin - 1, 100}));
  EXPECT_FALSE(Patch::at(image, {100, 240 - Patch::margin}));
}

TEST(Patch, blocksThatMoveApartDisagree) {
  // Strips as wide as a block stay and move by a pixel in turn: no affine map does that.
  const testing::RenderedTexture texture(3, 1024);
  std::mt19937 rng(4);
  std::normal_distribution<double> noise(0, 3);
  std::vector<std::uint8_t> pixels(320 * 240);
  const auto image = [&](double shift) {
    for (int v = 0; v < 240; ++v) {
      for (int u = 0; u < 320; ++u) {
        const double value = texture(2 * u - (u % 14 < 7 ? 2 * shift : 0), 2 * v) + noise(rng);
        pixels[static_cast<std::size_t>(v * 320 + u)] = static_cast<std::uint8_t>(std::clamp(value, 0., 255.));
      }
    }
    SmoothImage smooth;
    smooth.take({pixels.data(), 320, 240, 320});
    return smooth;
  };
  const SmoothImage before = image(0), again = image(0), after = image(1);
  std::size_t wrong = 0, tried = 0;
  for (int v = 40; v <= 200; v += 10) {
    for (int u = 59; u <= 260; u += 14) {
      auto patch = Patch::at(before, {u, v});
      if (!patch) continue;
      PatchFault fault;
      // The noise is known from a match that fits.
      const auto first = patch->find(again, Eigen::Vector2d(u, v), beginning({u, v}), fault);
      if (!first) continue;
      ++tried;
      const auto match = patch->find(after, Eigen::Vector2d(u, v), *first, fault);
      // Near one of the two answers, or a covariance that says so.
      const auto near = [&](double shift) {
        const Eigen::Vector2d error = match->at - Eigen::Vector2d(u + shift, v);
        return error.dot((match->covariance + patch->templateCovariance()).inverse() * error) < 25;
      };
      wrong += match && !near(0) && !near(1);
    }
  }
  EXPECT_GT(tried, 100U);
  EXPECT_LE(wrong, tried / 20);
}

}  // namespace
}  // namespace liestat
