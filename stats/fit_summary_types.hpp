// A fit of stats/fits.hpp by its model's name: what programs and pages read. The fit itself: stats/fit_summary.hpp.
#pragma once

#include <stats/constrained_types.hpp>
#include <stats/detail/compiled.hpp>
#include <stats/verdict.hpp>
#include <stats/words.hpp>

#include <Eigen/Core>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

namespace liestat {

/// The models of stats/fits.hpp.
enum class FitModel { circle, sphere, line, plane, line3, conic, ellipse, homography, fundamental };
constexpr auto words(FitModel) {
  return std::array{"circle", "sphere", "line", "plane", "line3", "conic", "ellipse", "homography", "fundamental"};
}
/// The names of the coordinates of one point: x y, x y z, or x1 y1 x2 y2 of a match.
LIESTAT_ESTIMATION_API std::vector<std::string> coordinateNames(FitModel model);

/// The signed distance of a point from a curve of the plane, to first order, and its standard deviation by the
/// covariance of the curve. NaN for other models; the deviation also where there is no covariance.
struct CurveDistance {
  double value = std::numeric_limits<double>::quiet_NaN();
  double deviation = value;
};

/// A fit and what its numbers are.
struct FitSummary {
  FitModel model = FitModel::line;
  std::size_t points = 0;
  ConstrainedEnd end = ConstrainedEnd::too_few;
  std::vector<std::string> names = {};  ///< of the parameters, in their order; `angle` is in rad
  Eigen::VectorXd parameter = {};
  Eigen::MatrixXd covariance = {};  ///< NaN where there is none
  double sigma = 0;                 ///< of a coordinate: the stated one, or that of the residuals
  bool stated = false;              ///< sigma was stated, and χ² tests it
  double chi2 = std::numeric_limits<double>::quiet_NaN();
  int degrees_of_freedom = 0;
  double fit_p = std::numeric_limits<double>::quiet_NaN();
  double birge_factor = 1;  ///< of the variances, in `covariance`, where the stated noise was to be scaled
  RelativeCurvature relative_curvature = {};
  double widening = 1;
  int iterations = 0;
  std::vector<double> distances = {};  ///< of the points from the model, in their order

  Status status() const { return statusOf(end); }
  bool ok() const { return end == ConstrainedEnd::converged; }
  /// Yes where a stated sigma was tested and the points follow the model; none where the residuals gave sigma.
  Verdict verdict() const;
  /// Standard deviation of a parameter; NaN where there is none.
  double deviation(std::size_t i) const {
    const auto k = static_cast<Eigen::Index>(i);
    return std::sqrt(covariance(k, k) < 0 ? 0 : covariance(k, k));
  }
  /// The distance of a point from a circle, line, conic or ellipse.
  CurveDistance distanceOf(const Eigen::Vector2d& point) const;
};

template <class V>
void describe(V& v, const FitSummary& fit) {
  v("model", name(fit.model))("points", fit.points)("status", name(fit.status()), "the status");
  v("end", name(fit.end), "how the iteration ended");
  describe(v, fit.verdict());
  v("names", fit.names, "of the parameters")("parameter", fit.parameter)("covariance", fit.covariance);
  v("sigma", fit.sigma, "standard deviation of a coordinate: stated, or that of the residuals");
  v("sigma_stated", fit.stated, "sigma was stated, and chi-squared tests it");
  v("chi2", fit.chi2)("degrees_of_freedom", fit.degrees_of_freedom);
  v("fit_p", fit.fit_p, "probability of a larger chi-squared; null: no sigma was stated");
  v("birge_factor", fit.birge_factor, "of the variances, where refuted noise is scaled");
  v("curvature", fit.relative_curvature.word(), "untested, small, widened or large");
  v("widening", fit.widening, "factor of the covariance that the curvature asks for");
  v("iterations", fit.iterations);
}
/// The distances of the points.
template <class V>
void describeSeries(V& v, const FitSummary& fit) {
  v("distances", fit.distances, "of the points from the model, in their order");
}

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <stats/detail/fit_summary.hpp>
#endif
