// Remarks on a mean beside its numbers: whether errors are independent (stats/time_blocks.hpp), notes, verdicts, and
// the summaries that are the same for all types.
#include <lie/rn.hpp>
#include <lie/s2.hpp>
#include <lie/se23.hpp>
#include <lie/se3.hpp>
#include <lie/so3.hpp>
#include <report/describe.hpp>
#include <stats/mean_notes.hpp>
#include <stats/random.hpp>
#include <stats/summarized_mean.hpp>
#include <stats/summarized_mean_splits.hpp>
#include <stats/time_blocks.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <string>
#include <vector>

namespace {

using namespace liestat;
using Point = Eigen::Vector3d;

/// Errors of unit variance that keep a part `memory` from one row to the next (AR(1)).
std::vector<Point> series(std::size_t n, double memory, std::uint64_t seed) {
  CounterRng rng(seed, 7);
  std::vector<Point> list;
  Point x = rng.normalVector<3>();
  for (std::size_t i = 0; i < n; ++i) {
    list.push_back(Point(1, 2, 3) + x);
    x = memory * x + std::sqrt(1 - memory * memory) * rng.normalVector<3>();
  }
  return list;
}

TimeBlocks timeBlocksOf(const std::vector<Point>& points, const TimeBlockOptions& options = {}) {
  const MeanInput<Point> input{.features = points};
  return compareTimeBlocks(
      points.size(), 3, false,
      [&](const SplitOptions& how) { return splitMean(SerialExecutor{}, input, {}, how).by_blocks; }, options);
}

// 400 trials of 60 rows. The number of trials below a level p is binomial: 400 p expected. Bounds of 4.5 standard
// deviations, false alarm 1e-5 each; the law is approximate (the residuals' covariance is random), for which 2 % are left.
TEST(TimeBlocks, IndependentErrorsHaveTheFactorOneWithinItsRange) {
  constexpr int trials = 400;
  int below = 0, covered = 0, dependent = 0;
  for (int t = 0; t < trials; ++t) {
    const TimeBlocks found =
        timeBlocksOf(series(60, 0, static_cast<std::uint64_t>(t)), {.split = {.splits = 40}, .min_splits = 1});
    ASSERT_TRUE(found.tested());
    below += found.p < 0.05;
    covered += found.low <= 1 && 1 <= found.high;
    dependent += found.dependent();
  }
  const auto reach = [](double p) { return trials * 0.02 + 4.5 * std::sqrt(trials * p * (1 - p)); };
  EXPECT_NEAR(below, trials * 0.05, reach(0.05));
  EXPECT_NEAR(covered, trials * 0.95, reach(0.05));
  EXPECT_LE(dependent, 6) << "expected 0.4; Poisson: more than 6 once in 3e6 runs";
}

// The variance of a mean of AR(1) errors is (1 + a)/(1 - a) times that of independent ones, here 9, less 2 % by the edges
// of blocks of 200 rows. A factor has 27 degrees of freedom (10 blocks): relative standard deviation 0.27; 40 trials.
TEST(TimeBlocks, ErrorsWithMemoryHaveTheirFactor) {
  constexpr int trials = 40;
  double sum = 0;
  int covered = 0, dependent = 0;
  for (int t = 0; t < trials; ++t) {
    const TimeBlocks found = timeBlocksOf(series(2000, 0.8, static_cast<std::uint64_t>(t)), {.split = {.splits = 40}});
    sum += found.factor / trials;
    covered += found.low <= 9 && 9 <= found.high;
    dependent += found.dependent() && found.verdict().isNo();
  }
  EXPECT_NEAR(sum, 9, 4 * 0.27 * 9 / std::sqrt(trials) + 0.02 * 9);
  EXPECT_GE(covered, 31) << "expected 38, standard deviation 1.4";
  EXPECT_EQ(dependent, trials);
}

TEST(TimeBlocks, NothingIsTestedOfTooFewOrTooManyRows) {
  const auto never = [](const SplitOptions&) -> SplitSeries {
    ADD_FAILURE() << "splits";
    return {};
  };
  const TimeBlocks few = compareTimeBlocks(9, 3, false, never), many = compareTimeBlocks(200001, 3, false, never);
  for (const TimeBlocks& none : {few, many}) {
    EXPECT_FALSE(none.tested());
    EXPECT_TRUE(none.verdict().isNone());
    EXPECT_EQ(none.verdict().text, none.why_none);
    EXPECT_FALSE(none.why_none.empty());
    EXPECT_EQ(none.inflation(), 1);
    EXPECT_FALSE(none.dependent());
  }
  EXPECT_TRUE(many.too_many);
  EXPECT_FALSE(few.too_many);
  // Frames need more rows than blocks: covariances from residuals of each half.
  EXPECT_FALSE(compareTimeBlocks(13, 6, false, never).tested());
  // Between them the splits get fewer as the rows get more, and no fewer than twenty.
  std::size_t splits = 0;
  const auto count = [&](const SplitOptions& how) {
    splits = how.splits;
    return SplitSeries{{}, 3, 3, 27, 0};
  };
  EXPECT_TRUE(compareTimeBlocks(200000, 3, false, count).tested());
  EXPECT_EQ(splits, 20U);
  EXPECT_EQ(compareTimeBlocks(20000, 3, false, count).splits, 100U);
  EXPECT_EQ(compareTimeBlocks(10, 3, false, count).splits, 200U);
  const TimeBlocks failed = compareTimeBlocks(10, 3, false, [](const SplitOptions&) {
    return SplitSeries{{}, std::nan(""), 3, 27, 20};
  });
  EXPECT_FALSE(failed.tested());
}

TEST(TimeBlocks, InflationMultipliesTheCovarianceAndNeverShrinksIt) {
  const auto meanWith = [](double factor, bool inflate) {
    MeanSummary mean;
    mean.covariance = Eigen::Matrix3d::Identity();
    TimeBlocks found;
    found.blocks = 10, found.factor = factor, found.p = factor > 1 ? 1e-9 : 0.7;
    setTimeBlocks(mean, found, inflate);
    return mean;
  };
  EXPECT_EQ(meanWith(4, true).covariance(1, 1), 4);
  EXPECT_EQ(meanWith(0.5, true).covariance(1, 1), 1);
  EXPECT_EQ(meanWith(4, false).covariance(1, 1), 1);
  EXPECT_TRUE(meanWith(4, true).time_blocks->applied);
  EXPECT_TRUE(meanWith(4, true).notes.empty());
  EXPECT_TRUE(meanWith(0.5, false).notes.empty());
  ASSERT_EQ(meanWith(4, false).notes.size(), 1U);
  EXPECT_EQ(meanWith(4, false).notes[0].find("the errors of successive rows are not independent: halves made of 10"),
            0U);
}

MeanSummary noted(const std::vector<Point>& points, std::vector<double> weights = {},
                  std::vector<SquareOf<Point>> covariances = {}) {
  MeanInput<Point> input{.features = points, .weights = weights, .covariances = covariances};
  if (!covariances.empty()) input.criterion = Criterion::maha;
  MeanSummary mean = summarizedMean(SerialExecutor{}, input);
  addMeanNotes(mean, points.size());
  return mean;
}

bool says(const MeanSummary& mean, const std::string& part) {
  return std::any_of(mean.notes.begin(), mean.notes.end(),
                     [&](const std::string& note) { return note.find(part) != std::string::npos; });
}

TEST(MeanNotes, SayWhatIsRemarkable) {
  const std::vector<Point> points = series(50, 0, 3);
  EXPECT_TRUE(noted(points).notes.empty());
  std::vector<double> weights(50, 1.0);
  weights[7] = 0;
  EXPECT_TRUE(says(noted(points, weights), "1 measurement has no weight beside the others and is not counted"));
  EXPECT_EQ(noted({{1, 2, 3}}).notes, std::vector<std::string>{"one measurement is its own mean"});
  EXPECT_TRUE(says(noted(std::vector<Point>(9, Point(1, 2, 3))), "all measurements are equal: a covariance"));
  std::vector<Point> flat = points;
  for (Point& p : flat) p.z() = 1;
  EXPECT_TRUE(says(noted(flat), "do not vary in every direction"));
  // Covariances that say a quarter of the variance: four times the expected distance, p below poor_fit.
  EXPECT_TRUE(says(noted(points, {}, {50, 0.25 * SquareOf<Point>::Identity()}), "scatter more than their covariances"));
  const MeanSummary right = noted(points, {}, {50, SquareOf<Point>::Identity()});
  EXPECT_FALSE(says(right, "scatter more")) << right.fit.chi2 << " of " << right.fit.degrees_of_freedom;
  EXPECT_EQ(right.fit.degrees_of_freedom, 147);
}

TEST(SplitOutcome, VerdictHasThreeAnswers) {
  SplitOutcome outcome{.settings = {.splits = 2}, .random = {{3, 3}, 3, 3, 60, 0}, .by_blocks = {{3, 3}, 3, 3, 27, 0}};
  EXPECT_TRUE(outcome.passed());
  EXPECT_EQ(outcome.verdict().text.find("PASSED: "), 0U);
  EXPECT_TRUE(outcome.verdict().causes.empty());
  outcome.by_blocks.index = 27;
  EXPECT_FALSE(outcome.passed());
  EXPECT_TRUE(outcome.verdict().isNo());
  EXPECT_NE(outcome.verdict().text.find("which halves at random do not show"), std::string::npos);
  outcome.random.index = 27;
  EXPECT_EQ(outcome.verdict().causes.size(), 1U);
  EXPECT_EQ(outcome.verdict().text.find("which halves at random"), std::string::npos);
  outcome.by_blocks.distances.pop_back();
  EXPECT_TRUE(outcome.verdict().isNone());
  EXPECT_FALSE(outcome.passed()) << "what was not tested has not passed";
  EXPECT_EQ(outcome.verdict().text.find("INTERRUPTED: 3 of 4 splits"), 0U);
}

template <class M>
std::vector<M> features(std::size_t n) {
  CounterRng rng(5, 1);
  std::vector<M> list;
  for (std::size_t i = 0; i < n; ++i) {
    list.push_back(exp(ManifoldTraits<M>::origin(), TangentOf<M>(0.1 * rng.normalVector<ManifoldTraits<M>::DoF>())));
  }
  return list;
}

// The same bits as the function that it calls, by whichever path.
TEST(SummarizedMean, IsTheCertifiedMean) {
  const std::vector<SO3d> rotations = features<SO3d>(30);
  std::vector<double> weights(30);
  std::iota(weights.begin(), weights.end(), 1.0);
  const MeanSummary plain = summarizedMean(SerialExecutor{}, MeanInput<SO3d>{.features = rotations});
  const MeanSummary weighted =
      summarizedMean(SerialExecutor{}, MeanInput<SO3d>{.features = rotations, .weights = weights});
  EXPECT_EQ(plain.covariance, Eigen::MatrixXd(certifiedMean(rotations).estimate->covariance));
  EXPECT_EQ(weighted.covariance, Eigen::MatrixXd(certifiedMean(rotations, weights).estimate->covariance));
  EXPECT_EQ(featureOf<SO3d>(plain.mean).params(), certifiedMean(rotations).mean.mean.params());
  EXPECT_TRUE(weighted.weighted);
  EXPECT_FALSE(plain.weighted);
  const MeanSummary fast =
      summarizedMean(SerialExecutor{}, MeanInput<SO3d>{.features = rotations}, {.certificates = false});
  EXPECT_EQ(fast.mean.parameters, plain.mean.parameters);
  EXPECT_EQ(fast.unique, Uniqueness::not_certified);
  EXPECT_EQ(fast.covariance, Eigen::MatrixXd(covarianceFromResiduals(mean(rotations))));
  EXPECT_EQ(plain.verdict().text, "The mean is " + plain.uniquenessInWords() + ".");
}

TEST(SummarizedMean, SaysWhyThereIsNoCovariance) {
  const std::vector<SO3d> none, two = features<SO3d>(2), half_turns{SO3d(), SO3d::exp({0, 0, EIGEN_PI})};
  const auto of = [](const std::vector<SO3d>& list, bool certificates) {
    return summarizedMean(SerialExecutor{}, MeanInput<SO3d>{.features = list}, {.certificates = certificates});
  };
  for (const bool certificates : {true, false}) {
    EXPECT_EQ(of(none, certificates).status, Status::too_few);
    EXPECT_EQ(of(two, certificates).status, Status::not_applicable) << "there is a mean";
    EXPECT_TRUE(of(two, certificates).trusted());
    EXPECT_FALSE(of(two, certificates).hasCovariance());
  }
  EXPECT_EQ(of(half_turns, true).status, Status::ambiguous);
  EXPECT_TRUE(of(half_turns, true).verdict().isNo());
}

TEST(FeatureValue, HasThePartsOfTheType) {
  const SE3d pose(SO3d::exp({0.3, 0.2, 0.1}), Point(1, 2, 3));
  const FeatureValue value = featureValue(pose);
  EXPECT_EQ(*value.translation, Point(1, 2, 3));
  EXPECT_NEAR((*value.rotation_vector - Point(0.3, 0.2, 0.1)).norm(), 0, 1e-15);
  EXPECT_EQ(featureOf<SE3d>(value).params(), pose.params());
  // q and -q are one rotation, which is shown with w ≥ 0; the parameters keep theirs.
  const SO3d negative = SO3d::fromParams(Eigen::Vector4d(0, 0, std::sin(2.0), std::cos(2.0)));
  EXPECT_GT((*featureValue(negative).quaternion_xyzw)[3], 0);
  EXPECT_EQ(featureOf<SO3d>(featureValue(negative)).params(), negative.params());
  const FeatureValue state = featureValue(features<SE23d>(1)[0]);
  EXPECT_EQ(*state.velocity, Point(state.parameters.tail<3>()));
  EXPECT_TRUE(featureValue(Point(1, 2, 3)).point);
  EXPECT_TRUE(featureValue(S2d(Point(0, 0, 1))).direction);
}

}  // namespace
