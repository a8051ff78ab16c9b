// The gyroscope's bias out of a window of which up to half of the tracks are wrong, without a first guess and without
// the accelerometer: from the rotations between images alone. Where solveClosedFormRobustly begins when the bias is
// unknown: consensus on the motion fails from 0.05 rad/s on.
//
//   const auto start = liestat::estimateEpipolarGyroscopeBias(window, {.bearing_noise = 1. / 450});
//   if (start.ok()) … start.bias, start.covariance, start.inliers
//
// The directions u and u' of a feature from two images and the translation between these lie in a plane: for the right
// rotation all normals u × u' are orthogonal to one vector, whatever depths and speeds are. The bias is what makes them
// so for pairs of images 1, 2, 4 … steps apart, each with a translation of its own, in least squares of angles.
// Sources: L. Kneip and S. Lynen, "Direct optimization of frame-to-frame rotation", ICCV 2013; Y. He et al., "A
// rotation-translation-decoupled solution for robust and efficient visual-inertial initialization", CVPR 2023; here
// normals are weighted by their noise, translations are unknowns of the least squares (variable projection) instead of
// eigenvectors, whose eigenvalues noise shifts, and tracks have the weights of Geman and McClure until they are
// accepted or rejected.
//
// Without parallax normals are pure noise and do not constrain the rotation. Two rules keep that out: a window whose
// directions all stay where they are, after rotations that the bias explains, is solved for that, without translations
// (without_parallax: at rest, pure rotation); in others a pair of images counts only if its directions have moved,
// beyond what any rotation explains, by `min_parallax` sigmas. What both leave out, hardly
// any parallax, is `undetermined`. Several rotations may then explain the normals: a minimum must have its features in
// front of the camera, and no mean parallax far beyond the differences between parallaxes; `others` are those next to
// it. A lever arm of the camera only changes the translations. Residuals are weighted by the noise of bearings alone:
// the gyroscope's must be smaller over the window (3e-4 rad in two seconds of an ADIS16448, where a pixel is 2e-3).
#pragma once

#include <fusion/detail/closed_form_input.hpp>
#include <fusion/detail/epipolar_search.hpp>
#include <fusion/imu/window.hpp>
#include <fusion/init/results.hpp>

#include <Eigen/Core>

#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat {

/// The bias that the rotations between images say. The window is integrated anew where first order will not do.
inline EpipolarBiasResult estimateEpipolarGyroscopeBias(const InertialWindow& window,
                                                        const InitialisationOptions& options) {
  EpipolarBiasResult found;
  const BiasPrior& prior = options.prior;
  const EpipolarBiasOptions& own = options.epipolar;
  found.bias = prior.mean.gyroscope;
  const auto positive = [](double x) { return x > 0 && std::isfinite(x); };
  found.fault = window.fault();
  if (!found.fault && (!positive(options.bearing_noise) || !prior.mean.gyroscope.allFinite() ||
                       !positive(prior.gyroscope_sigma) || !(own.min_parallax > 0) || !(own.misfit_sigmas > 0) ||
                       !(own.max_sigma > 0) || !(own.min_consensus > 0 && own.min_consensus <= 1))) {
    found.fault = FaultKind::bad_option;
  }
  if (!found.fault && window.size() == 0) found.fault = FaultKind::too_few_images;
  if (found.fault) return found;
  const Eigen::Vector3d accelerometer = window.bias().accelerometer;
  found.fault = detail::faultOf(closedFormWindow(window, {prior.mean.gyroscope, accelerometer}), options);
  if (found.fault) return found;

  detail::EpipolarSearch search(window, options);
  detail::EpipolarFit& fit = search.fit();
  found.without_parallax = search.searchRotation();
  bool settled = found.without_parallax || search.searchEpipolar();
  // Motions for the bias that was found, where the change was large.
  InertialWindow anew;
  const ImuBias<double> bias{fit.bias(), accelerometer};
  if (fit.pairs() > 0 && window.hasReadings() && window.isFar(bias)) {
    anew = window;
    if (anew.integrateIfFar(bias)) {
      ++found.integrations;
      fit.setWindow(anew);
      settled = fit.settle();
    }
  }
  if (fit.pairs() == 0) search.giveUp();
  found.bias = fit.bias();
  found.others = search.others(8);
  found.starts = search.starts();
  found.iterations = fit.iterations();
  found.pairs_used = fit.pairs();
  const bool regular = fit.covariance(found.covariance);
  found.consistent = fit.isConsistent();
  for (std::size_t i = 0; i < window.features.size(); ++i) {
    found.residuals.push_back(std::sqrt(fit.meanSquare(i)));
    if (std::isfinite(found.residuals.back())) (fit.isIn(i) ? found.inliers : found.outliers).push_back(i);
  }
  const auto tracks = static_cast<double>(found.inliers.size() + found.outliers.size());
  if (found.pairs_used == 0 || !regular) {
    found.status = FusionStatus::undetermined;
  } else if (static_cast<double>(found.inliers.size()) < own.min_consensus * tracks) {
    found.status = FusionStatus::no_consensus;
  } else if (!settled) {
    found.status = FusionStatus::not_converged;
  } else {
    const detail::SmallSvd svd(detail::SmallMatrix::of<3, 3>(found.covariance));
    const bool known = std::sqrt(svd.value(0)) <= own.max_sigma;
    found.status = known ? FusionStatus::ok : FusionStatus::undetermined;
  }
  return found;
}

}  // namespace liestat
