#include <cli/mean_analysis.hpp>

#include <lie/lie.hpp>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>
#include <stats/inference.hpp>

namespace liestat::cli {
namespace detail {

template <class M>
MeanAnalysis analyse(const Measures&, const AnalysisOptions&);

}  // namespace detail

namespace {

MeanAnalysis dispatch(const Measures& measures, const AnalysisOptions& options) {
  switch (measures.feature) {
    case Feature::point:
      return detail::analyse<Eigen::Vector3d>(measures, options);
    case Feature::rotation:
      return detail::analyse<SO3d>(measures, options);
    case Feature::semi_oriented_frame:
      return detail::analyse<SemiOrientedFrame3d>(measures, options);
    case Feature::non_oriented_frame:
      return detail::analyse<NonOrientedFrame3d>(measures, options);
    case Feature::se3:
      return detail::analyse<SE3d>(measures, options);
    case Feature::direction:
      return detail::analyse<S2d>(measures, options);
    case Feature::frame:
      break;
  }
  return detail::analyse<Frame3d>(measures, options);
}

/// Whether the measures leave some direction without any error, whatever the units.
bool isSingular(const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd sd = covariance.diagonal().cwiseSqrt();
  if (!(sd.minCoeff() > 0)) return true;
  const Eigen::MatrixXd correlation = sd.cwiseInverse().asDiagonal() * covariance * sd.cwiseInverse().asDiagonal();
  return !(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(correlation, Eigen::EigenvaluesOnly).eigenvalues()[0] >
           1e-10);
}

}  // namespace

MeanAnalysis analyseMean(const Measures& measures, const AnalysisOptions& options) {
  AnalysisOptions how = options;
  if (how.budget == 0) how.budget = measures.size() > 100000 ? 2000 : 1000000;
  MeanAnalysis analysis = dispatch(measures, how);
  if (measures.size() == 1) {
    analysis.notes.emplace_back("one measure is its own mean");
  } else if (analysis.dispersion.isZero(0) || !(analysis.dispersion.diagonal().maxCoeff() > 1e-28)) {
    analysis.notes.emplace_back(analysis.covariance_from == "residuals"
                                    ? "all measures are equal: a covariance from the residuals is zero, which says "
                                      "nothing about an error that they share"
                                    : "all measures are equal");
  } else if (analysis.covariance_from == "residuals" && isSingular(analysis.covariance)) {
    analysis.notes.emplace_back(
        "the measures do not vary in every direction: the covariance from the residuals is singular");
  }
  if (analysis.fit_dof > 0) {
    analysis.fit_p = chiSquaredSurvival(analysis.fit, analysis.fit_dof);
    if (analysis.fit_p < 1e-3) {
      analysis.notes.push_back(
          fmt::format("the measures scatter more than their covariances say: {:.4g} times the expected squared "
                      "distance (p = {:.2g})",
                      analysis.fit / analysis.fit_dof, analysis.fit_p));
    }
  }
  return analysis;
}

}  // namespace liestat::cli
