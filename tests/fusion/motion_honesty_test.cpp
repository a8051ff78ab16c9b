// The motion filters claim no direction that the data refute, and carry no infinity from frame to frame. Seeds are fixed;
// bounds are those of more than one seed in ten thousand failing, unless they say otherwise.
#include <experiments/motion_scene.hpp>
#include <fusion/motion/motion_filter.hpp>
#include <lie/units.hpp>
#include <stats/random.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat::experiments;

MotionFilterOptions among(bool outliers) {
  MotionFilterOptions options;
  options.outliers = outliers;
  return options;
}

/// A scene that stands still from frame 30 of 40 on: the pairs of such a frame have the same points twice, each time
/// with new errors.
std::vector<PointPair> atRest(const MotionScene& scene, CounterRng& rng) {
  std::vector<PointPair> pairs;
  for (const MotionTrack& track : scene.observed) {
    const Eigen::Vector2d at = track.position.head<2>() / track.position.z();
    const Eigen::Vector2d first = rng.normalVector<2>(), second = rng.normalVector<2>();
    pairs.push_back({at + scene.sigma() * first, at + scene.sigma() * second, scene.sigma()});
  }
  return pairs;
}

TEST(MotionHonesty, StopsAreRecognisedAmongOutliersToo) {
  for (const bool outliers : {false, true}) {
    std::size_t still = 0, recognised = 0, moving = 0, false_stops = 0;
    for (std::uint64_t trial = 0; trial < 15; ++trial) {
      MotionScene scene({.world = MotionWorld::general}, 71, trial);
      CounterRng rng(72, trial);
      MotionFilter filter(among(outliers));
      for (std::size_t k = 1; k <= 120; ++k) {
        if (k % 40 < 30) {
          scene.advance();
          false_stops += filter.update(scene.pairs).flags.standstill ? 1U : 0U, ++moving;
          continue;
        }
        const MotionEstimate& e = filter.update(atRest(scene, rng));
        recognised += e.flags.standstill ? 1U : 0U, ++still;
        EXPECT_TRUE(!e.flags.standstill || !e.ok());
      }
    }
    EXPECT_GE(recognised, still * 95 / 100 - 12) << outliers;  // of 450, three standard errors
    EXPECT_LE(false_stops, moving / 100) << outliers;
  }
}

// Empty frames, single points, wild coordinates and sigmas, stops and identical frames in any order: what is published
// is finite, and the filter comes back. (Debug builds check the invariant of the states after each frame.)
TEST(MotionHonesty, NoInfinityInARecursiveState) {
  for (std::uint64_t trial = 0; trial < 24; ++trial) {
    const bool inertial = trial % 3 == 2;
    MotionScene scene({.world = MotionWorld::general, .gyroscope_sigma = inertial ? 0.1 : 0.}, 73, trial);
    CounterRng rng(74, trial);
    MotionFilter filter(among(trial % 2 == 1));
    for (std::size_t k = 1; k <= 120; ++k) {
      scene.advance();
      std::vector<PointPair> pairs = scene.pairs;
      GyroscopeRotation gyroscope = scene.gyroscope;
      const double kind = k < 80 ? rng.uniform(0, 10) : 10;
      const double huge = std::pow(10., rng.uniform(0, 308));
      const auto any = static_cast<std::size_t>(rng.uniform(0, static_cast<double>(pairs.size())));
      if (kind < 1) {
        pairs.clear();
      } else if (kind < 2) {
        for (PointPair& pair : pairs) pair.second = pair.first;
      } else if (kind < 3) {
        pairs[any].second *= huge;
      } else if (kind < 4) {
        pairs[any].sigma /= huge;
      } else if (kind < 5) {
        pairs.resize(1 + any / 2);
      } else if (kind < 5.5) {
        pairs.assign(20, pairs[any]);
      } else if (kind < 6) {
        pairs[any].sigma *= huge, gyroscope.rotation *= huge;
      }
      const MotionEstimate& e = inertial ? filter.update(pairs, gyroscope) : filter.update(pairs);
      ASSERT_TRUE(e.direction.mean.unit_vector().allFinite() && e.direction.covariance.allFinite())
          << trial << " " << k;
      ASSERT_TRUE(e.rotation.mean.params().allFinite() && std::isfinite(e.sign_evidence)) << trial << " " << k;
      ASSERT_GT(e.direction.covariance.determinant(), 0) << trial << " " << k;
    }
    const Eigen::Vector3d truth =
        filter.estimate().meaning == DirectionMeaning::velocity ? scene.velocity : scene.translation;
    EXPECT_LT(distance(filter.estimate().direction.mean, S2d(truth)), 0.25) << trial;
  }
}

TEST(MotionHonesty, InformationOfAFrameIsNeitherNegativeNorMoreThanGaussNewtons) {
  CounterRng rng(75);
  for (int k = 0; k < 200; ++k) {
    Eigen::Matrix2d A;
    for (int i = 0; i < 4; ++i) A(i / 2, i % 2) = rng.normal();
    const Eigen::Matrix2d S = A * A.transpose() + 1e-3 * Eigen::Matrix2d::Identity();
    const double a = rng.normal(), b = rng.normal(), c = rng.normal();
    Eigen::Matrix2d C;
    C << a, b, b, c;
    FrameInformation<double, 2> frame{S, C, Eigen::Vector2d::Zero()};
    FilterCovariance<double, 2> P;
    updateCovariance(P, frame, 0.5);
    // Without any information the gain's own noise is all that is added, J⁻¹ S J⁻¹ ≤ I/4 for P = I; uncut this is up to
    // 20.
    const SymmetricPair pair(P.reported);
    EXPECT_LE(pair.values[0], 4);
    EXPECT_GT(pair.values[1], 0);
  }
}

/// Frames from 20 on that are called usable, and those of them that are more than 10° off.
struct Usable {
  std::size_t frames = 0, usable = 0, wrong = 0;
};

/// before(scene, frame) may change the scene before a frame, after(scene, pairs, gyroscope) what it shows.
template <class Before, class After>
Usable usableOf(MotionSceneOptions options, std::uint64_t seed, const Before& before, const After& after) {
  Usable sum;
  for (std::uint64_t trial = 0; trial < 20; ++trial) {
    MotionScene scene(options, seed, trial);
    MotionFilterOptions settings;
    if (scene.hasGyroscope()) settings.flow = Flow::discrete;
    MotionFilter filter(settings);
    for (int k = 1; k <= 100; ++k) {
      before(scene, k);
      scene.advance();
      GyroscopeRotation gyroscope = scene.gyroscope;
      after(scene, gyroscope);
      const MotionEstimate& e =
          scene.hasGyroscope() ? filter.update(scene.pairs, gyroscope) : filter.update(scene.pairs);
      if (k < 20) continue;
      const S2d truth(e.meaning == DirectionMeaning::velocity ? scene.velocity : scene.translation);
      ++sum.frames, sum.usable += e.ok() ? 1U : 0U;
      sum.wrong += e.ok() && distance(e.direction.mean, truth) > 10 * units::degree ? 1U : 0U;
    }
  }
  return sum;
}
constexpr auto nothing_before = [](MotionScene&, int) {};
constexpr auto nothing_after = [](MotionScene&, GyroscopeRotation&) {};

TEST(MotionHonesty, NoDirectionThatItsOwnChiSquaredRefutes) {
  const Usable wrong_tracks =
      usableOf({.world = MotionWorld::general, .outliers = 0.1}, 76, nothing_before, nothing_after);
  EXPECT_LE(wrong_tracks.wrong, wrong_tracks.frames / 200);
  const Usable right = usableOf({.world = MotionWorld::general}, 77, nothing_before, nothing_after);
  EXPECT_GE(right.usable, right.frames * 97 / 100);
  EXPECT_LE(right.wrong, right.frames / 200);
}

TEST(MotionHonesty, GyroscopeIsTestedAgainstTheImages) {
  const MotionSceneOptions inertial{.world = MotionWorld::general, .gyroscope_sigma = 0.1};
  const Usable sign = usableOf(inertial, 78, nothing_before, [](MotionScene&, auto& g) { g.rotation = -g.rotation; });
  const Usable dead = usableOf(inertial, 79, nothing_before, [](MotionScene&, auto& g) { g.rotation.setZero(); });
  const Usable right = usableOf(inertial, 80, nothing_before, nothing_after);
  EXPECT_LE(sign.wrong, sign.frames / 200);
  EXPECT_LE(dead.wrong, dead.frames / 200);
  EXPECT_GE(right.usable, right.frames * 97 / 100);
}

// A ground plane ahead has two solutions that no number of frames tells apart: the points of each frame are new ones.
TEST(MotionHonesty, SecondSolutionOfAGroundPlaneIsNotForgotten) {
  std::size_t frames = 0, wrong = 0;
  for (std::uint64_t trial = 0; trial < 40; ++trial) {
    CounterRng rng(85, trial);
    const double sigma = 1. / 500;
    const Eigen::Vector3d velocity = 0.1 * Eigen::Vector3d(0.1 * rng.normal(), 0.02 * rng.normal(), -1).normalized();
    const Eigen::Vector3d axis = rng.unitVector<3>(), rotation = 0.5 * units::degree * axis;
    const Eigen::Vector3d translation = SO3d::leftJacobian(rotation) * velocity;
    MotionFilter filter;
    for (int k = 1; k <= 100; ++k) {
      std::vector<PointPair> pairs;
      while (pairs.size() < 20) {
        const double x = rng.uniform(-0.5, 0.5), y = rng.uniform(0.05, 0.5);
        const Eigen::Vector3d first = 0.5 / y * Eigen::Vector3d(x, y, 1);
        const Eigen::Vector3d second = SO3d::exp(rotation) * first + translation;
        const Eigen::Vector2d a = rng.normalVector<2>(), b = rng.normalVector<2>();
        if (second.z() < 0.5) continue;
        pairs.push_back({first.head<2>() / first.z() + sigma * a, second.head<2>() / second.z() + sigma * b, sigma});
      }
      const MotionEstimate& e = filter.update(pairs);
      if (k < 20) continue;
      const S2d truth(e.meaning == DirectionMeaning::velocity ? velocity : translation);
      ++frames, wrong += e.ok() && distance(e.direction.mean, truth) > 10 * units::degree ? 1U : 0U;
    }
  }
  EXPECT_LE(wrong, frames / 100);
}

TEST(MotionHonesty, ReversalAndTurnAreNoticed) {
  const MotionSceneOptions general{.world = MotionWorld::general};
  const Usable reversal = usableOf(
      general, 81,
      [](MotionScene& scene, int k) {
        if (k == 50) scene.velocity = -scene.velocity;
      },
      nothing_after);
  // The very first frame after it cannot know: 1 of 81.
  EXPECT_LE(reversal.wrong, reversal.frames / 60);
  EXPECT_GE(reversal.usable, reversal.frames * 88 / 100);
  const Usable turning = usableOf(
      general, 82,
      [](MotionScene& scene, int) {
        const Eigen::Vector3d axis = scene.velocity.unitOrthogonal();
        scene.velocity = SO3d::exp(Eigen::Vector3d(0.3 * units::degree * axis)) * scene.velocity;
      },
      nothing_after);
  EXPECT_LE(turning.wrong, turning.frames / 100);
}

// On a road faster cars near by outweigh the far scene in the mean depth: their motion, opposite to the camera's, would
// pass for it with all the scene behind the camera. Tracks have a fifth of the noise that is stated.
TEST(MotionHonesty, SceneBehindTheCameraDecidesNoSign) {
  std::size_t frames = 0, usable = 0, wrong = 0;
  for (const std::size_t cars : {0U, 16U}) {
    for (std::uint64_t trial = 0; trial < 20; ++trial) {
      CounterRng rng(86, trial);
      const double sigma = 0.1 / 700;
      const Eigen::Vector3d velocity(0.02 * rng.normal(), 0, -1), of_cars(0.05 * rng.normal(), 0, 0.7);
      MotionFilter filter;
      for (int k = 1; k <= 60; ++k) {
        const Eigen::Vector3d turn = 0.1 * units::degree * rng.normalVector<3>();
        std::vector<PointPair> pairs;
        while (pairs.size() < 40 + cars) {
          const bool moves = pairs.size() >= 40;
          const double depth = moves ? rng.uniform(6, 12) : rng.uniform(15, 60);
          const double x = rng.uniform(-0.8, 0.8), y = rng.uniform(-0.2, 0.2);
          const Eigen::Vector3d first = depth * Eigen::Vector3d(x, y, 1);
          const Eigen::Vector3d second = SO3d::exp(turn) * first + (moves ? of_cars : velocity);
          const Eigen::Vector2d a = rng.normalVector<2>(), b = rng.normalVector<2>();
          pairs.push_back(
              {first.head<2>() / first.z() + sigma * a, second.head<2>() / second.z() + sigma * b, 5 * sigma});
        }
        const MotionEstimate& e = filter.update(pairs);
        if (k < 20) continue;
        if (cars > 0) ++frames, wrong += e.ok() && e.direction.mean.unit_vector().z() > 0 ? 1U : 0U;
        if (cars == 0) usable += e.ok() ? 1U : 0U;
      }
    }
  }
  EXPECT_LE(wrong, frames / 200);
  EXPECT_GE(usable, frames * 97 / 100);
}

}  // namespace
