// Promises of certifiedMean on nearly ambiguous features and needless refusals, and the parts that it stands on.
// Thinned rows; the whole tables are `liestat validate means --full`. Bounds are four standard errors of the stated
// trials; seeds are fixed.

#include <lie/lie.hpp>
#include <stats/averaged_hessian.hpp>
#include <stats/certified_maha.hpp>
#include <stats/certified_mean.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/detail/possible_region.hpp>
#include <stats/near_ties.hpp>
#include <stats/random.hpp>

#include <support/verdicts.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <type_traits>
#include <vector>

namespace {

using namespace liestat;
using Eigen::Vector3d;
using namespace liestat_test;

constexpr double pi = static_cast<double>(EIGEN_PI);

// ------------------------------------------------------------------------------------------------------- near ties

/// Two clouds about ±half·axis, the truth between them; `fold`: the period of the space over 2π.
template <class M>
Verdicts twoClouds(double degrees, double width, int n, std::uint64_t trials, double* wrong = nullptr,
                   double fold = 1) {
  Verdicts verdicts;
  const M truth = ManifoldTraits<M>::origin();
  constexpr int last = ManifoldTraits<M>::DoF - 1;
  double unmarked = 0;
  for (std::uint64_t t = 0; t < trials; ++t) {
    CounterRng rng(19, t);
    std::vector<M> samples;
    for (int i = 0; i < n; ++i) {
      TangentOf<M> side = TangentOf<M>::Zero();
      side[last] = (i % 2 ? 0.5 : -0.5) * fold * degrees * pi / 180;
      samples.push_back(exp(exp(truth, side), TangentOf<M>(width * rng.template normalVector<last + 1>())));
    }
    const auto result = certifiedMean(samples, quick<M>());
    verdicts.add(result.status, true);
    unmarked += result.status == Status::ok && std::abs(log(truth, result.mean.mean)[last]) > 0.25 * fold * pi;
    EXPECT_EQ(result.near_ties.empty() || result.status != Status::ok, true);
    for (const NearTie<M>& tie : result.near_ties) EXPECT_GT(distance(tie.feature, result.mean.mean), 0.5 * fold);
  }
  if (wrong) *wrong = unmarked / double(trials);
  return verdicts;
}

TEST(NearTies, opposedCloudsAreNeverUnmarkedOnTheWrongSide) {
  const auto check = [](const char* what, double wrong, double trials) {
    EXPECT_LE(wrong, 0.01 + fourErrors(0.01, trials)) << what;
  };
  double wrong = 0;
  for (const double degrees : {174.0, 178.0, 180.0}) {
    twoClouds<SO3d>(degrees, 0.05, 10, 400, &wrong);
    check("rotations, n = 10", wrong, 400);
    twoClouds<SO3d>(degrees, 0.05, 40, 200, &wrong);
    check("rotations, n = 40", wrong, 200);
    twoClouds<SO2d>(degrees, 0.05, 40, 400, &wrong);
    check("circle, n = 40", wrong, 400);
    twoClouds<S2d>(degrees, 0.05, 40, 200, &wrong);
    check("directions, n = 40", wrong, 200);
    twoClouds<SemiOrientedFrame3d>(degrees, 0.05, 10, 300, &wrong, 0.5);
    check("semi-oriented, n = 10", wrong, 300);
  }
  const Verdicts opposite = twoClouds<SO3d>(180, 0.05, 1000, 20, &wrong);
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(opposite.ambiguous, 20);
  EXPECT_EQ((twoClouds<SO3d>(180, 0.3, 5000, 4).ambiguous), 4) << "wide clouds of many";
  EXPECT_EQ((twoClouds<Product<Vector3d, SO3d>>(180, 0.05, 40, 20).ambiguous), 20) << "a factor's rival";
}

TEST(NearTies, cloudsThatAreNotOpposedAreNotFlagged) {
  for (const double degrees : {120.0, 160.0}) {
    for (const int n : {10, 40}) {
      EXPECT_EQ(twoClouds<SO3d>(degrees, 0.05, n, 200).kept, 200) << degrees << " n = " << n;
    }
    EXPECT_EQ(twoClouds<SemiOrientedFrame3d>(degrees, 0.05, 40, 50, nullptr, 0.5).kept, 50) << degrees;
    EXPECT_EQ(twoClouds<SO2d>(degrees, 0.05, 1000, 20).kept, 20) << degrees;
    EXPECT_EQ(twoClouds<S2d>(degrees, 0.05, 1000, 10).kept, 10) << degrees;
  }
}

TEST(NearTies, theRivalOfTwoOppositeCloudsIsListed) {
  CounterRng rng(23);
  std::vector<SO3d> samples;
  for (int i = 0; i < 60; ++i) {
    samples.push_back(SO3d::exp(Vector3d(0, 0, i % 2 ? pi / 2 : -pi / 2)) * SO3d::exp(0.1 * rng.normalVector<3>()));
  }
  const auto result = certifiedMean(samples);
  EXPECT_EQ(result.status, Status::ambiguous);
  EXPECT_EQ(result.uniqueness.unique, Uniqueness::unique) << "the certificate speaks of the sample's criterion";
  EXPECT_FALSE(result.estimate);
  ASSERT_EQ(result.near_ties.size(), 1u);
  const NearTie<SO3d>& tie = result.near_ties[0];
  EXPECT_GT(distance(tie.feature, result.mean.mean), 2.5);
  // z, from its definition.
  double sum = 0, squares = 0;
  for (const SO3d& x : samples) {
    const double e = 0.5 * (std::pow(distance(tie.feature, x), 2) - std::pow(distance(result.mean.mean, x), 2));
    sum += e, squares += e * e;
  }
  EXPECT_NEAR(tie.z, sum / std::sqrt(60 * (squares - sum * sum / 60) / 59), 1e-9);
  EXPECT_GE(tie.z, 0);
  EXPECT_LT(tie.z, 3.3);
  // Weights that decide it leave no tie.
  std::vector<double> weights;
  for (int i = 0; i < 60; ++i) weights.push_back(log(SO3d(), samples[static_cast<std::size_t>(i)])[2] > 0 ? 4.0 : 1.0);
  EXPECT_TRUE(certifiedMean(samples, weights).near_ties.empty() ||
              certifiedMean(samples, weights).status == Status::ambiguous);
}

TEST(NearTies, knownNoiseTurnsCostsIntoLikelihoods) {
  // Two rotations 170° apart about one axis: of sd 0.05 the rival is out of the question, of sd 1 it is not. That they
  // are as far apart refutes either noise, which is not tested here.
  const CertifiedMahaOptions<SO3d> untested{.refutation_level = 0};
  const std::vector<SO3d> samples{SO3d(), SO3d::exp(Vector3d(0, 0, 170 * pi / 180))};
  // The cost at the other midpoint less that at the mean: (95² - 85²)/2 deg² for each.
  const double difference = (95.0 * 95 - 85.0 * 85) * std::pow(pi / 180, 2);
  for (const double sd : {0.05, 0.2}) {
    const std::vector<Gaussian<SO3d>> measured{{samples[0], sd * sd * SO3d::Adjoint::Identity()},
                                               {samples[1], sd * sd * SO3d::Adjoint::Identity()}};
    const auto result = certifiedMaha(measured, CovarianceAt::measured, untested);
    const double ratio = difference / (sd * sd);
    EXPECT_EQ(result.near_ties.size(), ratio < 4.5 ? 1u : 0u) << sd << ": " << ratio;
  }
  // 179.5° apart, with an sd of 0.1 rad: the costs differ by 2.7 as likelihoods.
  const std::vector<Gaussian<SO3d>> close{
      {SO3d(), 0.01 * SO3d::Adjoint::Identity()},
      {SO3d::exp(Vector3d(0, 0, 179.5 * pi / 180)), 0.01 * SO3d::Adjoint::Identity()}};
  const auto tie = certifiedMaha(close, CovarianceAt::measured, untested);
  EXPECT_EQ(tie.status, Status::ambiguous) << tie.reason;
  ASSERT_EQ(tie.near_ties.size(), 1u);
  const double expected = (90.25 * 90.25 - 89.75 * 89.75) * std::pow(pi / 180, 2) / 0.01;
  EXPECT_NEAR(tie.near_ties[0].log_likelihood_ratio, expected, 1e-6);
}

// ------------------------------------------------------------------------------------------------ needless refusals

template <class M>
Verdicts gaussian(const Vector3d& sd, int n, std::uint64_t trials) {
  Verdicts verdicts;
  constexpr int k = ManifoldTraits<M>::DoF;
  const M truth = ManifoldTraits<M>::origin();
  for (std::uint64_t t = 0; t < trials; ++t) {
    CounterRng rng(31, t);
    std::vector<M> samples;
    for (int i = 0; i < n; ++i) {
      TangentOf<M> e = rng.template normalVector<k>();
      e.template tail<3>() = e.template tail<3>().cwiseProduct(sd).eval();
      samples.push_back(exp(truth, e));
    }
    const auto result = certifiedMean(samples, quick<M>());
    verdicts.add(result.status, result.estimate && covers(*result.estimate, truth, samples.size(), false));
  }
  return verdicts;
}

TEST(Refusals, areRareAtTheReportsNoise) {
  const Vector3d report(0.3, 0.6, 0.9), half = Vector3d::Constant(0.5);
  const auto refused = [](const Verdicts& v, double most, const std::string& what) {
    v.expectPromise(what);
    EXPECT_LE(1 - v.kept / v.trials, most + fourErrors(most, v.trials)) << what;
  };
  refused(gaussian<SO3d>(report, 30, 500), 0.02, "rotations, report's noise, n = 30");
  refused(gaussian<SO3d>(report, 100, 200), 0.02, "rotations, report's noise, n = 100");
  const Verdicts ten = gaussian<SO3d>(report, 10, 1000);
  ten.expectPromise("rotations, report's noise, n = 10");
  EXPECT_LE(ten.ambiguous / ten.trials, 0.05 + fourErrors(0.05, ten.trials));
  EXPECT_LE(ten.ill_defined / ten.trials, 0.08 + fourErrors(0.08, ten.trials)) << "16 to 18 % before";
  refused(gaussian<SemiOrientedFrame3d>(half, 10, 400), 0.10, "semi-oriented, 0.5 rad, n = 10");
  refused(gaussian<SemiOrientedFrame3d>(half, 30, 200), 0.10, "semi-oriented, 0.5 rad, n = 30");
  refused(gaussian<NonOrientedFrame3d>(half, 30, 200), 0.10, "non-oriented, 0.5 rad, n = 30");
  // Beyond: every covariance used to be withdrawn, whose coverage is 0.88 without the average.
  refused(gaussian<NonOrientedFrame3d>(Vector3d::Constant(0.6), 200, 60), 0.10, "non-oriented, 0.6 rad, n = 200");
}

TEST(Refusals, oneOutlierNearTheCutLocusIsNoReason) {
  for (const double degrees : {160.0, 175.0, 179.0}) {
    CounterRng rng(37);
    std::vector<SO3d> samples;
    for (int i = 0; i < 60; ++i) samples.push_back(SO3d::exp(0.05 * rng.normalVector<3>()));
    samples.push_back(SO3d::exp(Vector3d(degrees * pi / 180, 0, 0)));
    const auto result = certifiedMean(samples);
    EXPECT_EQ(result.status, Status::ok) << degrees << ": " << result.reason;
  }
}

// --------------------------------------------------------------------------------------------- rings and valleys

/// Directions about the pole, κ = 20, thirty of which a quarter are reversed. The minima of such data form a ring 43°
/// from the axis.
const std::vector<Vector3d> flipped_directions{
    {-0.207921, -0.173811, 0.962579}, {-0.113418, 0.163833, 0.979947},  {0.497742, 0.304442, -0.812138},
    {-0.068295, -0.008369, 0.997630}, {0.450653, 0.120417, -0.884540},  {0.258794, -0.423208, 0.868286},
    {0.165484, -0.009035, 0.986171},  {0.293851, -0.084186, 0.952137},  {-0.156504, -0.004020, 0.987669},
    {-0.129401, -0.007505, 0.991564}, {0.272253, -0.099978, -0.957018}, {0.031301, 0.417347, -0.908208},
    {-0.124927, -0.147786, 0.981098}, {0.168339, -0.237696, 0.956641},  {0.008871, -0.093487, 0.995581},
    {0.139447, 0.101885, 0.984974},   {-0.284732, 0.417108, 0.863104},  {-0.397591, -0.039661, 0.916705},
    {0.045109, -0.258979, 0.964829},  {0.149651, 0.222216, 0.963444},   {-0.427685, -0.100001, 0.898379},
    {-0.221570, -0.003408, 0.975138}, {-0.319699, 0.089884, -0.943246}, {-0.213857, 0.470772, 0.855943},
    {0.169133, 0.379295, 0.909686},   {0.186479, 0.041994, 0.981561},   {0.386803, 0.098841, 0.916850},
    {0.015351, 0.067643, -0.997591},  {0.021910, -0.078170, 0.996699},  {0.110412, -0.160279, -0.980877}};

/// Draws features of Fisher's law with κ = 20, some of them turned by half a turn: directions reversed, rotations about
/// random axes.
template <class M>
M partlyTurned(const FisherLaw<M>& law, double part, CounterRng& rng) {
  const M x = law.draw(rng);
  const bool turned = rng.uniform() < part;
  const Vector3d axis = rng.unitVector<3>();
  if constexpr (std::is_same_v<M, S2d>) {
    return turned ? S2d(Vector3d(-x.unit_vector())) : x;
  } else {
    return turned ? M(x * SO3d::exp(pi * axis)) : x;
  }
}

/// `from_axis`: how far the population's minima are from the axis, degrees.
template <class M>
Verdicts ringOfMinima(double part, double from_axis, int n, std::uint64_t trials, bool weighted = false) {
  const FisherLaw<M> law(20);
  TangentOf<M> there = TangentOf<M>::Zero();
  there[0] = from_axis * pi / 180;
  const M minimum = exp(ManifoldTraits<M>::origin(), there);
  Verdicts verdicts;
  for (std::uint64_t t = 0; t < trials; ++t) {
    CounterRng rng(51, t);
    std::vector<M> samples;
    std::vector<double> weights;
    for (int i = 0; i < n; ++i) {
      samples.push_back(partlyTurned(law, part, rng));
      weights.push_back(weighted ? rng.uniform(0.5, 2) : 1.0);
    }
    CertifiedMeanOptions<M> options = quick<M>();
    // Weights that are no inverse variances.
    if (weighted) options.noise = ResidualNoise::any;
    const auto result = certifiedMean(samples, weights, options);
    verdicts.add(result.status, result.estimate && covers(*result.estimate, minimum, samples.size(), false));
    EXPECT_EQ(result.region_factor > 1, result.valley.has_value());
    EXPECT_FALSE(result.estimate && result.region_factor > detail::largest_region_factor);
  }
  return verdicts;
}

TEST(Rings, aFileOfFlippedDirectionsHasNoMean) {
  std::vector<S2d> samples;
  for (const Vector3d& v : flipped_directions) samples.emplace_back(v);
  const auto result = certifiedMean(samples);
  EXPECT_EQ(result.status, Status::ambiguous);
  EXPECT_EQ(result.uniqueness.unique, Uniqueness::unique) << "of the sample";
  EXPECT_FALSE(result.estimate);
  EXPECT_NE(std::string(result.reason).find("ring"), std::string::npos) << result.reason;
  ASSERT_TRUE(result.valley);
  EXPECT_GT(distance(result.valley->feature, result.mean.mean), 0.6 * pi);
  EXPECT_LT(result.valley->z, 3);
  EXPECT_GT(result.valley->z, 0);
}

TEST(Rings, theirPointsAreInTheRegionOrThereIsNone) {
  const auto check = [](const char* what, const Verdicts& v, double most) {
    std::printf("%-40s ok %.3f, ok but outside %.3f\n", what, v.kept / v.trials, v.outside / v.trials);
    EXPECT_LE(v.outside / v.trials, most + fourErrors(most, v.trials)) << what;
  };
  // Without the region's growth 0.33, 0.46, 0.27, 0.29 and 0.2 of the trials.
  check("directions, 15 % reversed, n = 30", ringOfMinima<S2d>(0.15, 21, 30, 500), 0.10);
  check("directions, 15 % reversed, n = 100", ringOfMinima<S2d>(0.15, 21, 100, 150), 0.07);
  check("directions, 25 % reversed, n = 30", ringOfMinima<S2d>(0.25, 43, 30, 500), 0.07);
  check("the same, weighted", ringOfMinima<S2d>(0.25, 43, 30, 300, true), 0.07);
  check("rotations, 30 % turned, n = 30", ringOfMinima<SO3d>(0.3, 24, 30, 200), 0.07);
  // So few are reversed that the axis is the only minimum, on flat ground; before 0.31.
  const Verdicts few = ringOfMinima<S2d>(0.1, 0, 300, 60);
  check("directions, 10 % reversed, n = 300", few, 0.07);
  EXPECT_GE(few.kept, 0.85 * few.trials);
}

TEST(Rings, goodDataKeepTheirMean) {
  // A fifth of uniform outliers, and a strip of a right angle to either side.
  const FisherLaw<S2d> law(20);
  double refused = 0, trials = 200;
  for (std::uint64_t t = 0; t < 200; ++t) {
    CounterRng rng(53, t);
    std::vector<S2d> outliers, strip;
    for (int i = 0; i < 30; ++i) {
      const S2d x = law.draw(rng);
      const Vector3d anywhere = rng.unitVector<3>();
      outliers.push_back(rng.uniform() < 0.2 ? S2d(anywhere) : x);
      const double along = rng.uniform(-1.4, 1.4), beside = 0.05 * rng.normalVector<1>()[0];
      strip.push_back(exp(exp(S2d(Vector3d::UnitZ()), Eigen::Vector2d(along, 0)), Eigen::Vector2d(0, beside)));
    }
    refused += certifiedMean(outliers, quick<S2d>()).status != Status::ok;
    refused += certifiedMean(strip, quick<S2d>()).status != Status::ok;
  }
  EXPECT_LE(refused / (2 * trials), 0.02 + fourErrors(0.02, 2 * trials));
}

TEST(Rings, cloudsThatSumsCertifyHaveNone) {
  // certifyBySums returns before the region is grown. On the first shell there is nothing that it could have found.
  const FisherLaw<SO3d> law(20);
  for (std::uint64_t t = 0; t < 60; ++t) {
    CounterRng rng(57, t);
    std::vector<SO3d> samples;
    const int n = t % 2 == 0 ? 8 : 40;
    for (int i = 0; i < n; ++i) samples.push_back(law.draw(rng));
    const auto result = certifiedMean(samples);
    ASSERT_EQ(result.status, Status::ok);
    const auto weights = detail::ones(samples.size());
    if (!detail::isRegionClosedBySums(result.mean, detail::weightSums(weights, samples.size()),
                                      result.estimate->covariance)) {
      continue;
    }
    EXPECT_EQ(result.region_factor, 1);
    const detail::FeatureTest<SO3d> test(samples, weights, result.mean, ResidualNoise::scaled);
    detail::ShellSearch<SO3d> search(test);
    const detail::Cholesky<double, 3> factor(result.estimate->covariance);
    EXPECT_FALSE(search(Eigen::Matrix3d(1.1 * std::sqrt(test.scoreQuantile()) * factor.lower())));
  }
}

TEST(Rings, onFlatGroundTheScoreIsTheMahalanobisDistance) {
  // A quarter of the circle: the logarithms move with the mean.
  CounterRng rng(59);
  std::vector<SO2d> samples;
  for (int i = 0; i < 20; ++i) samples.emplace_back(0.3 * rng.normalVector<1>()[0]);
  for (const ResidualNoise noise : {ResidualNoise::scaled, ResidualNoise::any}) {
    std::vector<double> weights;
    for (int i = 0; i < 20; ++i) weights.push_back(rng.uniform(0.3, 3));
    const auto at = mean(samples, weights);
    const detail::FeatureTest<SO2d> test(samples, detail::asWeights(weights), at, noise);
    const double variance = covarianceFromResiduals(at, noise)(0, 0), v = 3 * std::sqrt(variance);
    const auto result = test(Eigen::Matrix<double, 1, 1>(v));
    EXPECT_NEAR(result.level, 9 / test.scoreQuantile(), 1e-6);
    EXPECT_NEAR(detail::hotellingTail(test.scoreQuantile(), 1, 20), 0.05, 1e-9);
  }
}

TEST(Rings, manyDataAreRepresentedByEveryMth) {
  const FisherLaw<SO3d> law(8);
  CounterRng rng(61);
  std::vector<SO3d> all;
  for (int i = 0; i < 12288; ++i) all.push_back(law.draw(rng));
  const auto at = mean(all);
  const detail::FeatureTest<SO3d> test(all, detail::ones(all.size()), at, ResidualNoise::scaled);
  const detail::Cholesky<double, 3> factor(covarianceFromResiduals(at));
  for (int k = 0; k < 3; ++k) {
    const Vector3d v = 2 * factor.lower().col(k);
    const SO3d y = exp(at.mean, v);
    // T² and z of all of them, from their definitions.
    Vector3d sum = Vector3d::Zero();
    Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
    double cost = 0, cost_squares = 0;
    const double n = 12288;
    for (const SO3d& x : all) {
      const Vector3d z = log(y, x);
      const double e = 0.5 * (z.squaredNorm() - log(at.mean, x).squaredNorm());
      sum += z, squares += z * z.transpose(), cost += e, cost_squares += e * e;
    }
    const Eigen::Matrix3d scatter = (squares - sum * sum.transpose() / n) / (n - 1);
    const double t2 = sum.dot(scatter.inverse() * sum) / n;
    const auto result = test(v);
    EXPECT_NEAR(result.level * test.scoreQuantile(), t2, 0.1 * t2);
    EXPECT_NEAR(result.z, cost / std::sqrt(n * (cost_squares - cost * cost / n) / (n - 1)), 0.1);
  }
}

// ---------------------------------------------------------------------------------------------------------- levers

/// Frames whose rotations err by sd along each axis, and translations by that error times the lever.
Verdicts levers(double sd, double lever, int n, std::uint64_t trials) {
  Verdicts verdicts;
  for (std::uint64_t t = 0; t < trials; ++t) {
    CounterRng rng(63, t);
    std::vector<Frame3d> samples;
    for (int i = 0; i < n; ++i) {
      TangentOf<Frame3d> e;
      e.tail<3>() = sd * rng.normalVector<3>();
      e.head<3>() = 0.1 * rng.normalVector<3>() + lever * e.tail<3>();
      samples.push_back(exp(Frame3d(), e));
    }
    const auto result = certifiedMean(samples, quick<Frame3d>());
    verdicts.add(result.status, result.estimate && covers(*result.estimate, Frame3d(), samples.size(), false));
  }
  return verdicts;
}

TEST(Levers, averagingWidensTranslationsWithTheirRotations) {
  for (const double lever : {0.5, 2.0, 20.0}) {
    const Verdicts v = levers(0.8, lever, 30, 150);
    EXPECT_LE(v.outside / v.trials, 0.075 + fourErrors(0.075, v.trials)) << lever << ": 0.13 and 0.25 before";
  }
}

TEST(Levers, growthOfAPartIsThatOfAnExactlyDependentOther) {
  // y = G r and a part of its own: when r's covariance grows by Δ, y's grows by G Δ Gᵀ, and r's is as asked.
  CounterRng rng(67);
  Eigen::Matrix<double, 6, 6> A;
  for (int j = 0; j < 6; ++j) A.col(j) = rng.normalVector<6>();
  const Eigen::Matrix<double, 6, 6> C = A * A.transpose();
  const auto index = detail::coordinatesFrom<3>(3);
  const Eigen::Matrix<double, 6, 6> grown = C + detail::widening(C, index, 2.0);
  const Eigen::Matrix3d G = C.topRightCorner<3, 3>() * C.bottomRightCorner<3, 3>().inverse();
  EXPECT_LT((grown.bottomRightCorner<3, 3>() - 4 * C.bottomRightCorner<3, 3>()).norm(), 1e-7 * C.norm());
  EXPECT_LT((grown.topRightCorner<3, 3>() - 4 * C.topRightCorner<3, 3>()).norm(), 1e-7 * C.norm());
  EXPECT_LT(
      (grown.topLeftCorner<3, 3>() - C.topLeftCorner<3, 3>() - 3 * G * C.bottomRightCorner<3, 3>() * G.transpose())
          .norm(),
      1e-7 * C.norm());
  EXPECT_EQ(grown, grown.transpose());
  // Where the part does not vary, nothing depends on it.
  Eigen::Matrix<double, 6, 6> flat = Eigen::Matrix<double, 6, 6>::Zero();
  flat.topLeftCorner<3, 3>().setIdentity();
  EXPECT_TRUE(detail::widening(flat, index, 2.0).isZero());
}

// ------------------------------------------------------------------------------------------------------- the parts

TEST(AveragedHessian, ofACircleWithUniformDataVanishes) {
  // ½d² about any point is constant on average: the Hessian 1 of each datum and the kink's -1 cancel.
  std::vector<SO2d> samples;
  constexpr int n = 2000;
  for (int i = 0; i < n; ++i) samples.emplace_back(2 * pi * (i + 0.5) / n - pi);
  const auto at = mean(samples);
  const auto averaged = averagedHessian(samples, at, SquareOf<SO2d>(SquareOf<SO2d>::Constant(0.09)));
  EXPECT_NEAR(averaged.change, 1, 0.02);
  EXPECT_NEAR(averaged.hessian(0, 0) / n, 0, 0.02);
}

TEST(AveragedHessian, ofOneDatumNearTheCutLocusIsItsDensity) {
  // Data at 0 and one at distance s from the cut locus: the gradient jumps by 2π when the mean moves by s, and the
  // average of that jump's derivative is 2π times the normal density at s.
  std::vector<SO2d> samples(99, SO2d(0.0));
  const double sd = 0.3, s = 0.25;
  samples.emplace_back(pi - s);
  MeanResult<SO2d> at;
  at.mean = SO2d(0.0);
  at.n = 100, at.sum_of_weights = 100;
  at.hessian(0, 0) = 100;
  const double variance = sd * sd - detail::min_region_sigma * detail::min_region_sigma;
  const auto averaged = averagedHessian(samples, at, SquareOf<SO2d>(SquareOf<SO2d>::Constant(variance)));
  const double density = std::exp(-0.5 * s * s / (sd * sd)) / (sd * std::sqrt(2 * pi));
  EXPECT_TRUE(averaged.averaged);
  EXPECT_NEAR(averaged.hessian(0, 0), 100 - 2 * pi * density, 0.05 * 2 * pi * density) << "128 nodes";
}

TEST(AveragedHessian, isLeftAloneFarFromCutLoci) {
  CounterRng rng(41);
  std::vector<SO3d> samples;
  for (int i = 0; i < 20; ++i) samples.push_back(SO3d::exp(0.2 * rng.normalVector<3>()));
  const auto at = mean(samples);
  const auto averaged = averagedHessian(samples, at, covarianceFromResiduals(at));
  EXPECT_FALSE(averaged.averaged);
  EXPECT_EQ(averaged.hessian, at.hessian);
  EXPECT_EQ(averaged.change, 0);
  const auto result = certifiedMean(samples);
  ASSERT_TRUE(result.estimate);
  EXPECT_EQ(result.estimate->covariance, covarianceFromResiduals(result.mean)) << "bit by bit";
}

TEST(AveragedHessian, manyDataAreRepresentedByEveryMth) {
  const FisherLaw<SO3d> law(2);
  CounterRng rng(43);
  std::vector<SO3d> all, some;
  for (int i = 0; i < 12288; ++i) {
    all.push_back(law.draw(rng));
    if (i % 3 == 0) some.push_back(all.back());
  }
  const auto at = mean(all);
  const SquareOf<SO3d> region = SquareOf<SO3d>::Identity() * 0.04;
  const auto averaged = averagedHessian(all, at, region);
  MeanResult<SO3d> part = at;
  const auto of_part = averagedHessian(some, part, region);
  EXPECT_NEAR(averaged.change, of_part.change, 1e-9);
  EXPECT_LT((averaged.hessian - 3 * of_part.hessian).norm(), 0.1 * averaged.hessian.norm());
}

TEST(TailProbabilities, agreeWithTables) {
  // Quantiles of printed tables, to their digits.
  EXPECT_NEAR(detail::studentTail(2.262, 9), 0.025, 1e-5);
  EXPECT_NEAR(detail::studentTail(-2.262, 9), 0.975, 1e-5);
  EXPECT_NEAR(detail::studentTail(63.657, 1), 0.005, 1e-7);
  EXPECT_NEAR(detail::studentTail(3, 1e9), 0.001349898, 1e-8);
  EXPECT_NEAR(detail::chiSquaredTail(7.815, 3), 0.05, 1e-4);
  EXPECT_NEAR(detail::chiSquaredTail(12.592, 6), 0.05, 1e-4);
  EXPECT_NEAR(detail::chiSquaredTail(3.841, 1), 0.05, 1e-4);
  EXPECT_NEAR(detail::chiSquaredTail(11.070, 5), 0.05, 1e-4);
  // T² = k (n - 1)/(n - k) F: F(3, 7) has 4.347 at 0.95.
  EXPECT_NEAR(detail::hotellingTail(3 * 9 / 7. * 4.347, 3, 10), 0.05, 1e-4);
  EXPECT_TRUE(std::isnan(detail::hotellingTail(1, 3, 3)));
  EXPECT_EQ(detail::hotellingTail(0, 3, 10), 1);
}

}  // namespace
