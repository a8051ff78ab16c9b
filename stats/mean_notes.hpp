// Notes on a mean, in sentences, and the p-value of its fit (needs Boost.Math).
#pragma once

#include <stats/covariance.hpp>
#include <stats/laws.hpp>
#include <stats/mean_summary.hpp>
#include <stats/words.hpp>

#include <algorithm>
#include <cstddef>
#include <string>

namespace liestat {

/// Below this p measurements are said to scatter more than their covariances say.
inline constexpr double poor_fit = 1e-3;

/// Sets the p-value of the fit and adds the notes to the mean of so many measurements: which of them do not count, that
/// all are equal, that their covariance is singular, that they scatter more than their covariances say.
inline void addMeanNotes(MeanSummary& mean, std::size_t measurements) {
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
    mean.notes.emplace_back(mean.fromResiduals()
                                ? "all measurements are equal: a covariance from the residuals is zero, which says "
                                  "nothing about an error that they share"
                                : "all measurements are equal");
  } else if (mean.fromResiduals() && isSingular(mean.covariance)) {
    mean.notes.emplace_back(
        "the measurements do not vary in every direction: the covariance from the residuals is singular");
  }
  if (mean.region_factor > 1 && mean.hasCovariance()) {
    mean.notes.push_back("the region is widened by " + significant(mean.region_factor, 3) +
                         ", because the features that explain the measurements as well form a ring or a valley: " +
                         mean.valleyInWords());
  }
  if (mean.fit_dof > 0) {
    mean.fit_p = chiSquaredSurvival(mean.fit, mean.fit_dof);
    if (mean.fit_p < poor_fit) {
      mean.notes.push_back(
          "the measurements scatter more than their covariances say: " + significant(mean.fit / mean.fit_dof, 4) +
          " times the expected squared distance (p = " + significant(mean.fit_p, 2) + ")");
    }
  }
}

}  // namespace liestat
