// The whole study behind docs/theory/trajectories.md, sections 6 and 7: fifteen conventions in six scenes, a hundred
// trials each, and six hundred runs of dead reckoning. Prints the shares; convention_diagnosis_test has excerpts.

#include <experiments/trajectory_scene.hpp>
#include <fusion/convention_diagnosis.hpp>
#include <stats/convention_charts.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <vector>

namespace liestat {
namespace {

using experiments::SceneMotion;
using experiments::SceneNoise;
using experiments::TrajectoryScene;
using P = Perturbation;
using U = RotationUnit;
using C = CovarianceContent;

std::vector<DiagnosedPose> written(const TrajectoryScene& scene, const Convention& c) {
  std::vector<DiagnosedPose> poses;
  for (std::size_t i = 0; i < scene.truth.size(); ++i) {
    poses.push_back({scene.estimate[i].mean, toConvention(c, scene.estimate[i]), scene.truth[i]});
  }
  return poses;
}

struct Planted {
  const char* name;
  Convention convention;
};
Convention made(P perturbation, U unit = U::radian, C content = C::covariance, bool rotation_first_order = false) {
  Convention c;
  c.perturbation = perturbation, c.unit = unit, c.content = content;
  if (rotation_first_order) c.order = CovarianceOrder::rotation_translation;
  return c;
}
const std::vector<Planted>& planted() {
  static const std::vector<Planted> list = {
      {"right", made(P::right)},
      {"left", made(P::left)},
      {"fixed axes", made(P::world_axes)},
      {"body orientation", made(P::world_body_axes)},
      {"roll-pitch-yaw", made(P::roll_pitch_yaw)},
      {"yaw-pitch-roll", made(P::yaw_pitch_roll)},
      {"transposed axes", made(P::transposed_axes)},
      {"half angles", made(P::right, U::half_angle)},
      {"double angles", made(P::right, U::double_angle)},
      {"degrees", made(P::right, U::degree)},
      {"information", made(P::right, U::radian, C::information)},
      {"half angles' information", made(P::right, U::half_angle, C::information)},
      {"sigmas", made(P::right, U::radian, C::sigmas)},
      {"right, rotation first", made(P::right, U::radian, C::covariance, true)},
      {"fixed, rotation first", made(P::world_axes, U::radian, C::covariance, true)}};
  return list;
}

struct Scene {
  const char* name;
  SceneMotion motion;
  SceneNoise noise;
  bool rich;  ///< every convention is told apart from 200 poses
};
constexpr Scene scenes[] = {{"3-D, full", SceneMotion::space, SceneNoise::full, true},
                            {"3-D, isotropic", SceneMotion::space, SceneNoise::isotropic, false},
                            {"yaw, diagonal", SceneMotion::yaw, SceneNoise::diagonal, false},
                            {"planar car", SceneMotion::planar, SceneNoise::planar, false},
                            {"small, full", SceneMotion::small, SceneNoise::full, false},
                            {"small, diagonal", SceneMotion::small, SceneNoise::diagonal, false}};

class ConventionStudy : public testing::TestWithParam<std::size_t> {};

TEST_P(ConventionStudy, NoVerdictIsWrong) {
  const std::size_t n = GetParam();
  constexpr int trials = 100;
  std::printf("n = %zu: share identified\n%-26s", n, "");
  for (const Scene& s : scenes) std::printf("%16s", s.name);
  std::printf("\n");
  int wrong = 0, rejected = 0;
  for (const Planted& truth : planted()) {
    std::printf("%-26s", truth.name);
    for (const Scene& s : scenes) {
      int identified = 0;
      for (int trial = 0; trial < trials; ++trial) {
        CounterRng rng(77, static_cast<std::uint64_t>(trial), static_cast<std::uint32_t>(n));
        const TrajectoryScene scene =
            experiments::independentScene({.motion = s.motion, .noise = s.noise, .n = n}, rng);
        const ConventionDiagnosis d = diagnoseConventions(written(scene, truth.convention));
        const bool in = std::find(d.accepted.begin(), d.accepted.end(), truth.convention) != d.accepted.end();
        identified += d.verdict == DiagnosisVerdict::identified && in;
        wrong += d.verdict == DiagnosisVerdict::identified && !in;
        rejected += d.verdict == DiagnosisVerdict::undecidable && !in && !d.correlated;
      }
      std::printf("%16.2f", static_cast<double>(identified) / trials);
      if (s.rich && n >= 200) {
        EXPECT_GE(identified, 97) << truth.name;
      }
    }
    std::printf("\n");
    std::fflush(stdout);
  }
  std::printf("%d wrong verdicts, %d times the truth was not among the accepted, of 9000\n", wrong, rejected);
  EXPECT_EQ(wrong, 0);
  // The margin's bound, 0.001 a run, and three standard errors of it.
  EXPECT_LE(rejected, 9 + 9);
}
INSTANTIATE_TEST_SUITE_P(Poses, ConventionStudy, testing::Values(50, 200));

TEST(ConventionStudy, DeadReckoningHasNoVerdictOnAbsoluteErrors) {
  int runs = 0, ranked = 0, right = 0, chains = 0;
  for (const P p : {P::right, P::world_axes, P::world_body_axes}) {
    const Convention c = made(p);
    for (const SceneMotion motion : {SceneMotion::space, SceneMotion::yaw}) {
      for (std::uint64_t trial = 0; trial < 100; ++trial) {
        CounterRng rng(909, trial);
        const TrajectoryScene scene = experiments::deadReckoningScene(
            {.motion = motion, .n = 200, .sigma_translation = 0.01, .sigma_rotation = 0.002}, rng);
        const ConventionDiagnosis d = diagnoseConventions(written(scene, c));
        ++runs;
        ranked += !d.correlated || !d.fits.empty();
        const ChainDiagnosis chain = diagnoseChain(written(scene, c));
        ++chains;
        right += chain.is_chain && chain.accepted.size() == 1 && chain.accepted.front() == c;
      }
    }
  }
  std::printf("%d runs of dead reckoning: %d ranked on absolute errors; the chain names the convention in %d of %d\n",
              runs, ranked, right, chains);
  EXPECT_EQ(ranked, 0);
  EXPECT_GE(right, 0.99 * chains);
}

}  // namespace
}  // namespace liestat
