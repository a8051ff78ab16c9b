// The promise about scattered features for products, whose factors are judged one by one, for MAHA and for barycentres of
// groups. Seeds are fixed.

#include <stats/certified_group_mean.hpp>
#include <stats/certified_maha.hpp>

#include <support/verdicts.hpp>

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat_test;

TEST(ScatteredFeatures, products) {
  keepsThePromise<OrientedPointd>("oriented points", 0.5, 30, 200);
  keepsThePromise<OrientedPointd>("oriented points", 4, 30, 400, 0.95);
  keepsThePromise<Essentiald>("relative poses", 0.5, 30, 80);
  keepsThePromise<Essentiald>("relative poses", 2, 30, 200);
  keepsThePromise<Product<SO2d, S2d>>("angle and direction", 1, 30, 300);
}

/// MAHA with the isotropic noise of the law.
template <class M>
Verdicts scatteredMaha(double kappa, int n, std::uint64_t trials) {
  const FisherLaw<M> law(kappa);
  const M truth = ManifoldTraits<M>::origin();
  SquareOf<M> V = SquareOf<M>::Zero();
  CounterRng noise(100);
  for (int i = 0; i < 20000; ++i) {
    const TangentOf<M> z = log(truth, law.draw(noise));
    V.diagonal().array() += z.squaredNorm() / (20000 * ManifoldTraits<M>::DoF);
  }
  CertifiedMahaOptions<M> options;
  options.uniqueness.budget = 200'000;
  Verdicts verdicts;
  for (std::uint64_t t = 0; t < trials; ++t) {
    CounterRng rng(13, t);
    std::vector<Gaussian<M>> samples;
    for (int i = 0; i < n; ++i) samples.push_back({law.draw(rng), V});
    const auto result = certifiedMaha(samples, CovarianceAt::measured, options);
    verdicts.add(result.status, result.estimate && covers(*result.estimate, truth, samples.size(), true));
  }
  return verdicts;
}

TEST(ScatteredFeatures, maha) {
  scatteredMaha<S2d>(0.5, 30, 150).expectPromise("directions, maha, kappa 0.5, n = 30");
  scatteredMaha<S2d>(2, 30, 200).expectPromise("directions, maha, kappa 2, n = 30");
  scatteredMaha<SO3d>(1, 30, 100).expectPromise("rotations, maha, kappa 1, n = 30");
  const Verdicts tight = scatteredMaha<SO3d>(20, 5, 500);
  tight.expectPromise("rotations, maha, kappa 20, n = 5");
  EXPECT_GE(tight.kept, 0.95 * tight.trials);
}

TEST(ScatteredFeatures, barycentresOfPoses) {
  Verdicts scattered_poses, tight;
  const auto pose = [](const FisherLaw<Frame3d>& law, CounterRng& rng) {
    return ManifoldTraits<SE3d>::fromMetricTwin(law.draw(rng));
  };
  for (const double kappa : {0.5, 20.0}) {
    const FisherLaw<Frame3d> law(kappa);
    for (std::uint64_t t = 0; t < 200; ++t) {
      CounterRng rng(17, t);
      std::vector<SE3d> samples;
      for (int i = 0; i < 30; ++i) samples.push_back(pose(law, rng));
      CertifiedGroupMeanOptions<SE3d> options;
      options.uniqueness.budget = 200'000;
      const auto result = certifiedGroupMean(samples, options);
      const bool inside =
          result.estimate && detail::hotellingTail(mahalanobisSquared(*result.estimate, SE3d()), 6, 30) > 0.05;
      (kappa < 1 ? scattered_poses : tight).add(result.status, inside);
      // The plain barycentre has no covariance either where the rotations are as scattered as uniform ones.
      EXPECT_EQ(groupMean(samples).covarianceFromResiduals().allFinite(),
                groupMean(samples).concentration.concentrated);
    }
  }
  scattered_poses.expectPromise("poses, barycentre, kappa 0.5, n = 30");
  EXPECT_LE(scattered_poses.kept, 0.1 * scattered_poses.trials);
  tight.expectPromise("poses, barycentre, kappa 20, n = 30");
  EXPECT_GE(tight.kept, 0.95 * tight.trials);
}

/// Rotations of which three tenths are turned by half a turn about random axes, with translations.
std::vector<Frame3d> partlyTurnedFrames(std::uint64_t trial) {
  const FisherLaw<Frame3d> law(20);
  CounterRng rng(21, trial);
  std::vector<Frame3d> samples;
  for (int i = 0; i < 30; ++i) {
    const Frame3d x = law.draw(rng);
    const bool turned = rng.uniform() < 0.3;
    const Eigen::Vector3d axis = rng.unitVector<3>();
    samples.emplace_back(turned ? SO3d(x.so3() * SO3d::exp(static_cast<double>(EIGEN_PI) * axis)) : x.so3(),
                         x.translation());
  }
  return samples;
}

TEST(Rings, barycentresOfPosesHaveTheRegionOfTheirRotations) {
  int widened = 0;
  for (std::uint64_t t = 0; t < 12; ++t) {
    const std::vector<Frame3d> frames = partlyTurnedFrames(t);
    std::vector<SE3d> poses;
    for (const Frame3d& x : frames) poses.push_back(ManifoldTraits<SE3d>::fromMetricTwin(x));
    const auto twin = certifiedMean(frames);
    const auto result = certifiedGroupMean(poses);
    EXPECT_EQ(result.region_factor, twin.region_factor);
    EXPECT_EQ(result.valley.has_value(), twin.valley.has_value());
    if (twin.status == Status::ambiguous) {
      EXPECT_EQ(result.status, Status::ambiguous);
    }
    if (!result.estimate || !result.valley) continue;
    ++widened;
    // No narrower than that of the rotations, which average the same gradient.
    const SquareOf<SE3d> own = result.estimate->covariance;
    const SquareOf<Frame3d> of_twin = twin.estimate->covariance;
    const double trace = own.bottomRightCorner<3, 3>().trace(), twins = of_twin.bottomRightCorner<3, 3>().trace();
    EXPECT_GT(trace, 0.9 * twins);
  }
  EXPECT_GT(widened, 0);
}

TEST(Rings, mahalanobisMeansAskTheLikelihood) {
  // A noise that excludes all of the valley of the least-squares mean leaves none.
  for (std::uint64_t t = 0; t < 12; ++t) {
    std::vector<Gaussian<SO3d>> narrow;
    for (const Frame3d& x : partlyTurnedFrames(t)) {
      narrow.push_back({x.so3(), SquareOf<SO3d>(1e-4 * SquareOf<SO3d>::Identity())});
    }
    const auto result = certifiedMaha(narrow, CovarianceAt::measured);
    EXPECT_FALSE(result.valley);
    EXPECT_EQ(result.region_factor, 1);
  }
}

}  // namespace
