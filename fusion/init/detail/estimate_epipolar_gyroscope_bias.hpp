// The definition of fusion/init/epipolar_gyroscope_bias.hpp.
#pragma once

#include <fusion/init/detail/closed_form_input.hpp>
#include <fusion/detail/compiled.hpp>
#include <fusion/init/detail/epipolar_search.hpp>
#include <fusion/init/epipolar_gyroscope_bias.hpp>

#include <Eigen/Core>

#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat {

LIESTAT_FUSION_INLINE EpipolarBiasResult estimateEpipolarGyroscopeBias(const InertialWindow& window,
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
