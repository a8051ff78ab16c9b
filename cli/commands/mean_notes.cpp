// Apart from the estimators, which cost a compiler enough without the laws of Boost.
#include <cli/commands/mean_analysis.hpp>

#include <stats/covariance.hpp>
#include <stats/laws.hpp>

#include <fmt/format.h>

namespace liestat::cli {

void explain(MeanAnalysis& analysis, std::size_t n) {
  if (n == 1) {
    analysis.notes.emplace_back("one measurement is its own mean");
  } else if (analysis.dispersion.isZero(0) || !(analysis.dispersion.diagonal().maxCoeff() > 1e-28)) {
    analysis.notes.emplace_back(analysis.covariance_from == "residuals"
                                    ? "all measurements are equal: a covariance from the residuals is zero, which says "
                                      "nothing about an error that they share"
                                    : "all measurements are equal");
  } else if (analysis.covariance_from == "residuals" && isSingular(analysis.covariance)) {
    analysis.notes.emplace_back(
        "the measurements do not vary in every direction: the covariance from the residuals is singular");
  }
  if (analysis.fit_dof > 0) {
    analysis.fit_p = chiSquaredSurvival(analysis.fit, analysis.fit_dof);
    if (analysis.fit_p < 1e-3) {
      analysis.notes.push_back(
          fmt::format("the measurements scatter more than their covariances say: {:.4g} times the expected squared "
                      "distance (p = {:.2g})",
                      analysis.fit / analysis.fit_dof, analysis.fit_p));
    }
  }
}

}  // namespace liestat::cli
