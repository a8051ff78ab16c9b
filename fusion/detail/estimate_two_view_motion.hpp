// The definition of estimateTwoViewMotion().
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/detail/two_view_estimate.hpp>
#include <fusion/two_view/two_view.hpp>
#include <stats/hierarchy.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace liestat {
namespace detail {

/// How the pixels of an image become the coordinates of the models: u = (p - centre)/focal.
struct TwoViewCoordinates {
  std::optional<Camera> camera;
  Eigen::Vector2d focal = Eigen::Vector2d::Ones(), centre = Eigen::Vector2d::Zero();

  double focalLength() const { return std::sqrt(focal.x() * focal.y()); }
  Eigen::Vector2d operator()(const Eigen::Vector2d& pixel) const {
    if (!camera || camera->distortion == Distortion::none) return (pixel - centre).cwiseQuotient(focal);
    const std::optional<Eigen::Vector3d> bearing = camera->bearing(pixel);
    if (!bearing || !(bearing->z() > 0)) return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
    return bearing->hnormalized();
  }
  /// K: pixels without distortion from the coordinates.
  Eigen::Matrix3d pixels() const {
    Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
    K.diagonal().head<2>() = focal, K.topRightCorner<2, 1>() = centre;
    return K;
  }
};

inline TwoViewCoordinates coordinatesOf(const std::optional<Camera>& camera, const Eigen::Vector2d& size,
                                        const Eigen::Vector2d& corner) {
  if (camera) return {camera, {camera->fu, camera->fv}, {camera->cu, camera->cv}};
  return {std::nullopt, Eigen::Vector2d::Constant(0.5 * size.norm()), corner + 0.5 * size};
}

/// The covariance of A M B/‖A M B‖, entries column after column.
inline Eigen::MatrixXd covarianceInPixels(const ModelEstimate<TwoViewMotionModel>& estimate, const Eigen::Matrix3d& A,
                                          const Eigen::Matrix3d& B) {
  Eigen::MatrixXd covariance = estimate.covariance;
  if (covariance.rows() == 5) {
    const Eigen::Matrix<double, 9, 5> J = estimate.parameter.pose.essentialMatrixJacobian();
    covariance = J * covariance * J.transpose();
  }
  if (covariance.rows() != 9) return {};
  const Eigen::Matrix3d M = A * estimate.parameter.matrix * B;
  const Entries unit = entriesFrom(M / M.norm());
  Eigen::Matrix<double, 9, 9> J;
  for (int k = 0; k < 9; ++k) J.col(k) = entriesFrom(A * matrixFrom(Entries(Entries::Unit(k))) * B) / M.norm();
  J -= unit * (unit.transpose() * J).eval();
  return J * covariance * J.transpose();
}

inline TwoViewModelRow rowOf(const Hierarchy<Eigen::Vector4d, TwoViewMotionModel>& search, std::size_t m,
                             double sigma) {
  const TwoViewModel& model = *search.models()[m];
  const ModelState<TwoViewMotionModel>& state = search.state(m);
  TwoViewModelRow row;
  row.name = model.name(), row.parents = model.parents();
  row.free_parameters = model.freeParameters(), row.equations = model.equations();
  row.evaluated = state.progress == ModelState<TwoViewMotionModel>::Progress::evaluated;
  row.draws = state.draws;
  if (!state.hasEstimate()) return row;
  row.status = state.estimate.status;
  row.inliers = state.inliers.size();
  row.relevance = state.relevance;
  row.chi2 = state.fit.chi2, row.degrees_of_freedom = state.fit.degreesOfFreedom();
  row.rms = sigma * std::sqrt(state.fit.normalised());
  row.unsupported = state.unsupported;
  row.rejection = state.rejection;
  if (state.rejected_by) row.rejected_by = search.models()[*state.rejected_by]->name();
  return row;
}

}  // namespace detail

LIESTAT_FUSION_INLINE TwoViewMotionEstimate estimateTwoViewMotion(std::span<const Eigen::Vector4d> matches,
                                                                  const TwoViewMotionOptions& options) {
  TwoViewMotionEstimate result;
  result.calibrated = options.first.has_value();
  const double nan = std::numeric_limits<double>::quiet_NaN();

  // The size of the images: it says how likely wrong matches fit a model, and where the centre is.
  const double infinity = std::numeric_limits<double>::infinity();
  Eigen::Vector2d low = Eigen::Vector2d::Constant(infinity), high = -low, corner = Eigen::Vector2d::Zero();
  bool any = false, differ = false;
  const Eigen::Vector4d* one = nullptr;
  for (const Eigen::Vector4d& m : matches) {
    if (!m.allFinite()) continue;
    any = true;
    if (one == nullptr) one = &m;
    differ = differ || m != *one;
    low = low.cwiseMin(m.head<2>()).cwiseMin(m.tail<2>()), high = high.cwiseMax(m.head<2>()).cwiseMax(m.tail<2>());
  }
  if (options.image_size) {
    result.image_size = *options.image_size;
  } else if (options.first && options.first->width > 0 && options.first->height > 0) {
    result.image_size = {options.first->width, options.first->height};
  } else if (any) {
    // One match alone, or several on a line, leave no area.
    result.image_size = (high - low).cwiseMax(std::max(1.0, options.sigma));
    result.size_from_matches = true;
    corner = low;
  }
  result.errors.assign(matches.size(), nan);
  result.inlier.assign(matches.size(), false);
  const bool sizes = result.image_size.allFinite() && result.image_size.minCoeff() > 0;
  if (!any || !(options.sigma > 0) || !std::isfinite(options.sigma) || !sizes) {
    result.reason = !any ? "there is no finite match" : "noise and size of the images must be finite and positive";
    result.status = any ? Status::not_applicable : Status::too_few;
  }

  const detail::TwoViewCoordinates first = detail::coordinatesOf(options.first, result.image_size, corner);
  const detail::TwoViewCoordinates second =
      detail::coordinatesOf(options.second ? options.second : options.first, result.image_size, corner);
  const TwoViewCalibration calibration =
      result.calibrated ? TwoViewCalibration::calibrated : TwoViewCalibration::uncalibrated;
  const TwoViewImages images{{options.sigma / first.focalLength(), options.sigma / second.focalLength()},
                             result.image_size.cwiseQuotient(second.focal)};
  Hierarchy<Eigen::Vector4d, TwoViewMotionModel> search(twoViewModels(images, calibration), options.search);
  std::vector<Eigen::Vector4d> normalised;
  if (result.reason.empty()) {
    for (const Eigen::Vector4d& m : matches) {
      Eigen::Vector4d& u = normalised.emplace_back();
      u << first(m.head<2>()), second(m.tail<2>());
    }
    search.add(normalised);
    while (!(options.stop && options.stop()) && search.iterate(options.stop)) {
    }
  }
  for (std::size_t m = 0; m < search.models().size(); ++m) {
    result.lattice.push_back(detail::rowOf(search, m, options.sigma));
  }
  result.chosen = search.best();
  if (!result.reason.empty()) return result;

  const ModelState<TwoViewMotionModel>& state = search.state(result.chosen);
  const TwoViewModel& model = *search.models()[result.chosen];
  if (!state.hasEstimate()) {
    result.status = Status::not_converged, result.reason = "stopped before there was an estimate";
    return result;
  }
  // Errors in the order of the matches; inliers are those of the threshold.
  model.errors(state.estimate.parameter, normalised, result.errors);
  std::vector<Eigen::Vector4d> agreeing;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    result.inlier[i] = result.errors[i] < state.threshold;
    if (result.inlier[i]) agreeing.push_back(normalised[i]);
  }
  result.inliers = agreeing.size(), result.threshold = state.threshold;
  const Eigen::Matrix3d& M = state.estimate.parameter.matrix;
  const Eigen::Matrix3d to_first = first.pixels().inverse(), K2 = second.pixels();
  const Eigen::Matrix3d to_second = model.equations() == 2 ? K2 : Eigen::Matrix3d(K2.inverse().transpose());
  const Eigen::Matrix3d in_pixels = to_second * M * to_first;
  result.matrix = in_pixels / in_pixels.norm();
  result.matrix_covariance = detail::covarianceInPixels(state.estimate, to_second, to_first);
  result.physical = physicalParameters(model.name(), state.estimate, agreeing, calibration,
                                       {first.focalLength(), second.focalLength()});
  if (model.name() == "essential" && state.estimate.covariance.rows() == 5) {
    result.relative_pose = Gaussian<Essentiald>{state.estimate.parameter.pose, state.estimate.covariance};
  }

  result.status = state.estimate.status;
  if (search.progress() != HierarchyState::terminated) {
    result.status = Status::not_converged, result.reason = "the search was stopped";
  } else if (!result.ok()) {
    result.reason = "the estimate of the chosen model did not converge";
  } else if (!differ) {
    result.status = Status::ill_defined, result.reason = "all matches are the same one";
  } else if (state.unsupported) {
    result.status = Status::ill_defined;
    result.reason = "no model is supported: the inliers of the chosen one could be chance";
  }
  return result;
}

}  // namespace liestat
