// A fit of stats/fits.hpp whose model is chosen at run time, with names, verdict and, of a curve, its distance from any
// point: for programs and pages.
//
//   const FitSummary fit = summarizedFit(FitModel::ellipse, rows, 0.02);
//   for (std::size_t i = 0; i < fit.names.size(); ++i) print(fit.names[i], fit.parameter[i], fit.deviation(i));
#pragma once

#include <stats/fit_summary_types.hpp>
#include <stats/fits.hpp>

#include <Eigen/Core>

#include <optional>

namespace liestat {

/// Fits a model to points in the rows of a matrix, which has a column for each of coordinateNames(model); with any
/// other number of columns the end is `bad_input`. A sigma that is not positive ends as `bad_input`, too.
LIESTAT_ESTIMATION_API FitSummary summarizedFit(FitModel model, const Eigen::Ref<const Eigen::MatrixXd>& points,
                                                std::optional<double> sigma = {}, const FitOptions& options = {});

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <stats/detail/fit_summary.hpp>
#endif
