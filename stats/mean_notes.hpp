// Notes on a mean, in sentences. Needs Eigen alone.
#pragma once

#include <stats/covariance.hpp>
#include <stats/mean_summary.hpp>
#include <stats/words.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

namespace liestat {

/// Adds the notes to the mean of so many measurements: which of them do not count, that all are equal, that their
/// covariance is singular, that they scatter more than their covariances say.
inline void addMeanNotes(MeanSummary& mean, std::size_t measurements) {
  // A note that speaks against the covariance; the first of the worst ones is the verdict's.
  const auto addDoubt = [&](Verdict::Answer answer, std::string note) {
    const bool worse = answer == Verdict::Answer::no ? !mean.doubt.isNo() : mean.doubt.isYes();
    if (worse && mean.hasCovariance()) mean.doubt = {answer, note, {}};
    mean.notes.push_back(std::move(note));
  };
  using enum Verdict::Answer;
  if (const std::size_t without = measurements - std::min(mean.n, measurements); without > 0) {
    mean.notes.push_back(std::to_string(without) + (without == 1 ? " measurement has" : " measurements have") +
                         " no weight beside the others and " + (without == 1 ? "is" : "are") + " not counted");
  }
  // Weights hide differences in the dispersion, so the distances themselves are looked at.
  const bool all_equal =
      !mean.farthest.empty() && std::all_of(mean.farthest.begin(), mean.farthest.end(),
                                            [](const FarthestMeasurement& f) { return !(f.distance > 1e-14); });
  if (mean.n == 1) {
    mean.notes.emplace_back("one measurement is its own mean");
  } else if (all_equal) {
    if (mean.fromResiduals()) {
      addDoubt(none,
               "all measurements are equal: a covariance from the residuals is zero, which says nothing about an error "
               "that they share");
    } else {
      mean.notes.emplace_back("all measurements are equal");
    }
  } else if (mean.fromResiduals() && isSingular(mean.covariance)) {
    addDoubt(none, "the measurements do not vary in every direction: the covariance from the residuals is singular");
  }
  if (mean.region_factor > 1 && mean.hasCovariance()) {
    mean.notes.push_back("the region is widened by " + significant(mean.region_factor, 3) +
                         ", because the features that explain the measurements as well form a ring or a valley: " +
                         mean.valleyInWords());
  }
  if (mean.order.weightsAreNoPrecisions() && mean.weighted && mean.fromResiduals() &&
      mean.weights_are == ResidualNoise::precision) {
    addDoubt(no, "p r^2 depends on the weights p (" + significant(mean.order.weight_z, 2) +
                     " standard deviations): they are no inverse variances, and the covariance supposes that they "
                     "are; importance has a covariance without that");
  }
  if (isRobust(mean.criterion) && !mean.outliers.empty()) {
    std::string note = std::to_string(mean.outliers.size()) +
                       (mean.outliers.size() == 1 ? " measurement is an outlier" : " outliers are named");
    const NamedOutlier& surest = mean.outliers.front();
    note += ", the surest " + significant(surest.shown(), 3) + " " + unitOf(surest.part).name +
            " from the mean (p = " + significant(surest.p, 2) + ")";
    mean.notes.push_back(std::move(note));
  }
  // Outliers skew the sample; whether they lie on one side is a test of the mean itself.
  if (mean.skewness.matters() && !isRobust(mean.criterion) && mean.fromResiduals() && mean.region == MeanRegion::law) {
    addDoubt(none, "the errors are skewed or have heavy tails (Mardia's skewness " + significant(mean.skewness.b, 2) +
                       ", p = " + significant(mean.skewness.p, 1) +
                       "): the 95 % region is that of symmetric noise, and too small for so few skewed errors; region "
                       "bootstrap has one without that");
  }
  if (mean.skew_factor > 1 && mean.hasCovariance()) {
    mean.notes.push_back("the region is widened by " + significant(mean.skew_factor, 3) +
                         " by a bootstrap, for the skewness of the errors");
  }
  if (mean.repeated.matters && mean.hasCovariance()) {
    addDoubt(no, mean.repeated.inWords() + ": the covariance takes them for independent measurements");
  }
  const bool in_time = mean.dependence.dependent();
  if (in_time && mean.hasCovariance() && !mean.inflated) {
    addDoubt(no, "the errors of successive rows are not independent: " + mean.dependence.inWords() +
                     ", so the standard deviations of the mean are about " +
                     significant(std::sqrt(mean.dependence.correlation_factor), 2) +
                     " times too small (inflate widens them)");
  }
  if (mean.order.dependent() && !in_time && mean.hasCovariance()) {
    addDoubt(no, "successive measurements err alike (correlation " + significant(mean.order.correlation, 2) + ", " +
                     significant(mean.order.z, 2) +
                     " standard deviations): the covariance supposes independent errors; if these fade from row to "
                     "row it is about " +
                     significant(mean.order.varianceFactor(), 2) + " times too small");
  }
  if (mean.fit.p < doubtful_fit) {
    std::string note = "the measurements scatter more than their covariances say: " +
                       significant(mean.fit.chi2 / mean.fit.degrees_of_freedom, 4) +
                       " times the expected squared distance (p = " + significant(mean.fit.p, 2) + ")";
    const std::string factor = significant(std::sqrt(mean.fit.factor()), 3);
    note += mean.fromResiduals() ? "; the covariance is that of the residuals"
            : mean.noise_scaled  ? "; the covariance is multiplied by that (Birge's factor)"
            : mean.status == Status::inconsistent
                ? "; if all are too small by one factor, their deviations are " + factor + " times as large"
                : "; Birge's factor would make the deviations " + factor + " times as large";
    // The covariance of the residuals, or one that has the factor, has the scatter in it.
    if (mean.fromResiduals() || mean.noise_scaled) {
      mean.notes.push_back(std::move(note));
    } else {
      addDoubt(none, std::move(note));
    }
  }
}

}  // namespace liestat
