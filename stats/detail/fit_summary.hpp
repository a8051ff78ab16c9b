// The fits by name: stats/fit_summary.hpp.
#pragma once

#include <lie/jet.hpp>
#include <stats/detail/fits.hpp>
#include <stats/fit_models.hpp>
#include <stats/fit_summary.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

namespace liestat {
namespace detail {

inline std::vector<std::string> parameterNames(FitModel model) {
  const auto matrix = [](char letter) {
    std::vector<std::string> list;
    list.reserve(9);
    for (int k = 0; k < 9; ++k)
      list.push_back({letter, static_cast<char>('1' + k / 3), static_cast<char>('1' + k % 3)});
    return list;
  };
  switch (model) {
    case FitModel::circle:
      return {"centre_x", "centre_y", "radius"};
    case FitModel::sphere:
      return {"centre_x", "centre_y", "centre_z", "radius"};
    case FitModel::line:
      return {"normal_x", "normal_y", "offset"};
    case FitModel::plane:
      return {"normal_x", "normal_y", "normal_z", "offset"};
    case FitModel::line3:
      return {"point_x", "point_y", "point_z", "direction_x", "direction_y", "direction_z"};
    case FitModel::conic:
      return {"a", "b", "c", "d", "e", "f"};
    case FitModel::ellipse:
      return {"centre_x", "centre_y", "semi_major", "semi_minor", "angle"};
    case FitModel::homography:
      return matrix('h');
    case FitModel::fundamental:
      return matrix('f');
  }
  return {};
}

/// The reason of an end without a covariance.
inline std::string reasonOf(ConstrainedEnd end, FitModel model) {
  switch (end) {
    case ConstrainedEnd::inconsistent:
      return "the points refute the stated sigma: it is too small, or they follow another model";
    case ConstrainedEnd::curved:
      return model == FitModel::ellipse
                 ? "a circle explains the points as well, or the model is curved on the scale of the noise"
                 : "the model is curved on the scale of the noise, and first order gives no covariance";
    case ConstrainedEnd::unobservable:
      return "the points leave a direction of the parameters open";
    case ConstrainedEnd::contradictory:
      return model == FitModel::ellipse ? "the conic through the points is no ellipse" : "the equations contradict";
    case ConstrainedEnd::too_few:
      return "there are too few points";
    case ConstrainedEnd::bad_input:
      return "a coordinate is not finite, or sigma is not positive";
    case ConstrainedEnd::saddle:
      return "the iteration ended at a saddle";
    default:
      return "the iteration did not converge";
  }
}

template <int D>
std::vector<FitVector<D>> rowsOf(const Eigen::Ref<const Eigen::MatrixXd>& points) {
  std::vector<FitVector<D>> list;
  for (Eigen::Index i = 0; i < points.rows(); ++i) list.push_back(points.row(i).transpose().head<D>());
  return list;
}

template <int N>
void takeFit(const Fit<N>& fit, StatedNoise noise, FitSummary& summary) {
  summary.end = fit.end;
  summary.parameter = fit.parameter, summary.covariance = fit.covariance;
  summary.chi2 = fit.chi2, summary.degrees_of_freedom = fit.degrees_of_freedom, summary.fit_p = fit.fit_p;
  if (summary.stated && noise == StatedNoise::scaled && fit.degrees_of_freedom > 0) {
    summary.birge_factor = std::max(1.0, fit.chi2 / fit.degrees_of_freedom);
  }
  summary.sigma = fit.sigma, summary.iterations = fit.iterations;
  summary.relative_curvature = fit.relative_curvature, summary.widening = fit.widening;
  summary.distances = fit.distances;
}

/// F/‖∂F/∂m‖ and √(∂F/∂q Λ ∂F/∂qᵀ)/‖∂F/∂m‖ of a curve F(q, m) = 0.
template <int N, class Equation>
CurveDistance curveDistance(const Equation& equation, const FitSummary& fit, const Eigen::Vector2d& point) {
  using J = Jet<double, N + 2>;
  Eigen::Matrix<J, N, 1> q;
  for (int i = 0; i < N; ++i) q[i] = J(fit.parameter[i], i);
  const Eigen::Matrix<J, 2, 1> m(J(point.x(), N), J(point.y(), N + 1));
  const J value = equation(q, m)[0];
  const FitVector<N> by_parameter = value.v.template head<N>();
  const double length = value.v.template tail<2>().norm();
  const double variance = by_parameter.dot(fit.covariance.topLeftCorner<N, N>() * by_parameter);
  return {value.a / length, std::sqrt(variance) / length};
}

}  // namespace detail

LIESTAT_ESTIMATION_INLINE std::vector<std::string> coordinateNames(FitModel model) {
  switch (model) {
    case FitModel::sphere:
    case FitModel::plane:
    case FitModel::line3:
      return {"x", "y", "z"};
    case FitModel::homography:
    case FitModel::fundamental:
      return {"x1", "y1", "x2", "y2"};
    default:
      return {"x", "y"};
  }
}

LIESTAT_ESTIMATION_INLINE Verdict FitSummary::verdict() const {
  const std::string what = name(model);
  const std::string chi2_in_words = "chi2 " + significant(chi2, 3) + " of " + std::to_string(degrees_of_freedom) +
                                    " degrees of freedom, p " + significant(fit_p, 2);
  if (!ok()) {
    const std::string tested = end == ConstrainedEnd::inconsistent ? " (" + chi2_in_words + ")" : "";
    return Verdict::no("no " + what + " with a covariance: " + detail::reasonOf(end, model) + tested);
  }
  if (stated && std::isnan(fit_p)) {
    return Verdict::none("as many points as the " + what + " has parameters: nothing tests the stated sigma");
  }
  if (stated && birge_factor > 1 && fit_p < refutation_level) {
    return Verdict::none("the points refute the stated sigma (" + chi2_in_words +
                         "), and the covariance is scaled to their residuals");
  }
  if (stated) return Verdict::yes("the points follow the " + what + ": " + chi2_in_words);
  return Verdict::none("sigma is that of the residuals: nothing tests whether the points follow the " + what);
}

LIESTAT_ESTIMATION_INLINE CurveDistance FitSummary::distanceOf(const Eigen::Vector2d& point) const {
  switch (model) {
    case FitModel::circle:
      return detail::curveDistance<3>(SphereEquation<2>{}, *this, point);
    case FitModel::line:
      return detail::curveDistance<3>(HyperplaneEquation<2>{}, *this, point);
    case FitModel::conic:
      return detail::curveDistance<6>(ConicEquation{}, *this, point);
    case FitModel::ellipse:
      return detail::curveDistance<5>(EllipseEquation{}, *this, point);
    default:
      return {};
  }
}

LIESTAT_ESTIMATION_INLINE FitSummary summarizedFit(FitModel model, const Eigen::Ref<const Eigen::MatrixXd>& points,
                                                   std::optional<double> sigma, const FitOptions& options) {
  FitSummary summary;
  summary.model = model, summary.points = static_cast<std::size_t>(points.rows());
  summary.stated = sigma.has_value();
  summary.names = detail::parameterNames(model);
  const auto n = static_cast<Eigen::Index>(summary.names.size());
  summary.parameter.setZero(n);
  summary.covariance.setConstant(n, n, std::numeric_limits<double>::quiet_NaN());
  if (points.cols() != static_cast<Eigen::Index>(coordinateNames(model).size()) || !points.allFinite() ||
      (sigma && !(*sigma > 0 && std::isfinite(*sigma)))) {
    summary.end = ConstrainedEnd::bad_input;
    return summary;
  }
  const auto take = [&](const auto& fit) { detail::takeFit(fit, options.noise, summary); };
  switch (model) {
    case FitModel::circle:
      take(fitCircle(detail::rowsOf<2>(points), sigma, options));
      break;
    case FitModel::sphere:
      take(fitSphere(detail::rowsOf<3>(points), sigma, options));
      break;
    case FitModel::line:
      take(fitLine(detail::rowsOf<2>(points), sigma, options));
      break;
    case FitModel::plane:
      take(fitPlane(detail::rowsOf<3>(points), sigma, options));
      break;
    case FitModel::line3:
      take(fitLine3(detail::rowsOf<3>(points), sigma, options));
      break;
    case FitModel::conic:
      take(fitConic(detail::rowsOf<2>(points), sigma, options));
      break;
    case FitModel::ellipse:
      take(fitEllipse(detail::rowsOf<2>(points), sigma, options));
      break;
    case FitModel::homography:
      take(fitHomography(detail::rowsOf<4>(points), sigma, options));
      break;
    case FitModel::fundamental:
      take(fitFundamental(detail::rowsOf<4>(points), sigma, options));
      break;
  }
  return summary;
}

}  // namespace liestat
