// Viéville, Lingrand and Gaspard 2000, fig. 16: residuals of nested models on the same measurements. The figure has the
// general model's larger than the specific one's, which no minimum allows. What holds:
//
// - L²(general) ≤ L²(specific) at the minima, whatever is true;
// - where the specific model is true, σ̂ = σ √(2L²/r) agrees, r the residual degrees of freedom;
// - where it is false, σ̂ of the specific model is far larger.
//
// The models are those of the hierarchy of two-view motion (fusion/two_view/models.hpp).

#include <experiments/two_view_scene.hpp>
#include <fusion/two_view/models.hpp>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace {

using namespace liestat;
using experiments::TwoViewMotion;
using experiments::TwoViewScene;
using Estimate = ModelEstimate<TwoViewMotionModel>;

TwoViewImages imagesOf(const TwoViewScene& scene) {
  const auto& o = scene.options;
  return {{o.sigma / o.focal_length, o.sigma / o.focal_length}, Eigen::Vector2d(o.width, o.height) / o.focal_length};
}
std::shared_ptr<const TwoViewModel> modelOf(const TwoViewScene& scene, TwoViewMotion motion) {
  for (const auto& model : twoViewModels(imagesOf(scene))) {
    if (model->name() == nameOf(motion)) return model;
  }
  return nullptr;
}

/// The lowest of the minima that are reached from several parameters.
Estimate lowest(const TwoViewModel& model, const std::vector<TwoViewMotionModel>& starts,
                std::span<const Eigen::Vector4d> matches) {
  Estimate best;
  for (const TwoViewMotionModel& start : starts) {
    const Estimate found = model.estimate(start, matches, {});
    if (found.usable() && !(found.chi2 >= best.chi2)) best = found;
  }
  return best;
}

/// The solutions of a model that a more specific one's is among: as H, as [e']× H for epipoles in the image and on its
/// three axes, or as F.
std::vector<TwoViewMotionModel> containing(const Eigen::Matrix3d& specific, bool specific_is_h, bool general_is_h) {
  std::vector<TwoViewMotionModel> starts(1);
  starts[0].matrix = specific;
  if (!specific_is_h || general_is_h) return starts;
  starts.clear();
  for (const Eigen::Vector3d& e : {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(0, 0, 1),
                                   Eigen::Vector3d(0.3, 0.2, 1), Eigen::Vector3d(-0.3, 0.2, 1)}) {
    Eigen::Matrix3d cross;
    cross << 0, -e.z(), e.y(), e.z(), 0, -e.x(), -e.y(), e.x(), 0;
    starts.emplace_back().matrix = cross * specific;
  }
  return starts;
}

struct Pair {
  TwoViewMotion specific, general;
};
constexpr Pair pairs[] = {{TwoViewMotion::retinal_translation, TwoViewMotion::fundamental},
                          {TwoViewMotion::rotation, TwoViewMotion::homography},
                          {TwoViewMotion::translation, TwoViewMotion::essential}};

struct Residuals {
  double specific = 0, general = 0;               ///< 2L²
  int specific_freedom = 0, general_freedom = 0;  ///< r
  double sigma() const { return std::sqrt(specific / specific_freedom); }
  double generalSigma() const { return std::sqrt(general / general_freedom); }
};

/// Both minima over the same matches of a motion, 2L² in units of the noise.
Residuals residuals(const Pair& pair, TwoViewMotion truth, std::uint64_t seed) {
  const TwoViewScene scene({.motion = truth, .matches = 60, .outliers = 0}, seed);
  const auto specific = modelOf(scene, pair.specific), general = modelOf(scene, pair.general);
  std::vector<TwoViewMotionModel> starts;
  specific->solve(scene.matches, starts);
  EXPECT_FALSE(starts.empty()) << nameOf(pair.specific) << " " << seed;
  const Estimate narrow = lowest(*specific, starts, scene.matches);
  const bool narrow_is_h = !isEpipolar(pair.specific), wide_is_h = !isEpipolar(pair.general);
  std::vector<TwoViewMotionModel> from = containing(narrow.parameter.matrix, narrow_is_h, wide_is_h);
  if (pair.general != TwoViewMotion::essential) general->solve(scene.matches, from);
  if (truth == pair.general) from.emplace_back().matrix = isEpipolar(truth) ? scene.F : scene.H;
  const Estimate wide = lowest(*general, from, scene.matches);
  EXPECT_TRUE(narrow.usable() && wide.usable()) << nameOf(pair.specific) << " " << seed;
  return {narrow.chi2, wide.chi2, narrow.degrees_of_freedom, wide.degrees_of_freedom};
}

constexpr std::uint64_t trials = 40;

TEST(Figure16, TheGeneralModelFitsNoWorse) {
  for (const Pair& pair : pairs) {
    for (const TwoViewMotion truth : {pair.specific, pair.general}) {
      for (std::uint64_t seed = 0; seed < trials / 4; ++seed) {
        const Residuals r = residuals(pair, truth, seed);
        // Matches of too much leverage are left out of the general estimate, which only lowers it; both end within 1e-4
        // standard deviations of their minima.
        EXPECT_LE(r.general, r.specific * (1 + 1e-6)) << nameOf(pair.specific) << " " << nameOf(truth) << " " << seed;
      }
    }
  }
}

TEST(Figure16, NormalisedResidualsAgreeWhereTheSpecificModelIsTrue) {
  for (const Pair& pair : pairs) {
    Residuals sum;
    for (std::uint64_t seed = 0; seed < trials; ++seed) {
      const Residuals r = residuals(pair, pair.specific, 100 + seed);
      sum.specific += r.specific, sum.general += r.general;
      sum.specific_freedom += r.specific_freedom, sum.general_freedom += r.general_freedom;
    }
    // 2L² is χ² with r degrees of freedom: four standard errors of its root over r.
    const auto error = [](int freedom) { return 4 / std::sqrt(2. * freedom); };
    EXPECT_NEAR(sum.sigma(), 1, error(sum.specific_freedom)) << nameOf(pair.specific);
    if (pair.general == TwoViewMotion::fundamental) {
      // Matches of a homography obey [e']× H for any epipole e', so two of the seven parameters change nothing to first
      // order: each e' has a minimum that is χ² with r + 2 degrees of freedom, and the lowest of all is taken. It lies
      // some 1.6 standard deviations below the mean of one (0.85 of these 60 matches; from one start and with 80
      // matches an independent prototype has 0.92).
      const double r = sum.general_freedom / static_cast<double>(trials);
      EXPECT_LT(sum.generalSigma(), 1);
      EXPECT_GT(sum.generalSigma(), std::sqrt((r + 2 - 2.5 * std::sqrt(2 * (r + 2))) / r));
    } else {
      EXPECT_NEAR(sum.generalSigma(), 1, error(sum.general_freedom)) << nameOf(pair.general);
    }
  }
}

TEST(Figure16, TheSpecificModelsResidualIsFarLargerWhereItIsFalse) {
  for (const Pair& pair : pairs) {
    double logarithms = 0;
    for (std::uint64_t seed = 0; seed < trials / 4; ++seed) {
      const Residuals r = residuals(pair, pair.general, 200 + seed);
      logarithms += std::log(r.sigma() / r.generalSigma());
      // A far plane has little parallax: in the worst of these scenes four times.
      EXPECT_GT(r.sigma(), 3 * r.generalSigma()) << nameOf(pair.specific) << " " << seed;
      EXPECT_NEAR(r.generalSigma(), 1, 4 / std::sqrt(2. * r.general_freedom)) << nameOf(pair.general) << " " << seed;
    }
    EXPECT_GT(std::exp(logarithms / (trials / 4)), 8) << nameOf(pair.specific);
  }
}

}  // namespace
