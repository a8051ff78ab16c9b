// The closed form's predicted standard deviations and covariance, of image noise and the prior of the bias.
#pragma once

#include <fusion/init/detail/closed_form_solver.hpp>
#include <fusion/init/closed_form_types.hpp>

#include <Eigen/Core>

#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat::detail {

/// The standard deviation of the direction of G about the axis across it for which it is largest (rad), by G's covariance
/// (or that of a multiple of it, which must be the multiple of G too).
inline double tiltSigma(const Eigen::Vector3d& G, const Eigen::Matrix3d& covariance) {
  const Eigen::Matrix<double, 2, 3> across = tangentRows(G.normalized());
  const Eigen::Matrix2d tilt = across * covariance * across.transpose();
  const double half = 0.5 * (tilt(0, 0) + tilt(1, 1)), spread = std::hypot(0.5 * (tilt(0, 0) - tilt(1, 1)), tilt(0, 1));
  return std::sqrt(half + spread) / G.norm();
}

/// Predicted standard deviations and covariances at the first minimiser.
inline void predictUncertainty(ClosedFormSolver& solver, const RayTable& table, const MotionCandidate& best,
                               ClosedFormResult& result) {
  Triangle root = Triangle::cholesky(solver.eliminatePredicted(best).Q);
  if (solver.hasPrior()) solver.addPrior(root);
  SmallMatrix scaled(1, 1);
  const bool determined = solver.covariance(root, best.y, scaled);
  const int m = solver.motionSize();
  if (determined) {
    result.tilt_sigma = tiltSigma(best.y.gravity(), scaled.matrix3(m - 3, m - 3));

    // From (V', [b'], G') to (V, G, [b]).
    result.covariance.resize(m, m);
    const auto from = [m](int i) { return i < 3 ? i : i < 6 ? m - 6 + i : i - 3; };
    const auto unit = [&](int i) { return i < 3 ? 1 / table.window : solver.gravityScale(); };
    for (int i = 0; i < m; ++i) {
      for (int j = 0; j < m; ++j) result.covariance(i, j) = unit(i) * unit(j) * scaled(from(i), from(j));
    }
    result.covariance_content = solver.hasPrior() ? ClosedFormCovarianceContent::image_noise_bias_prior
                                                  : ClosedFormCovarianceContent::image_noise;
  }
  std::vector<double> relative;
  for (std::size_t i = 0; i < table.features(); ++i) {
    const EliminatedFeature& e = solver.eliminated()[i];
    ClosedFormFeature& feature = result.features[table.feature[i]];
    const Eigen::Vector3d u = table.of(i).front().u;
    if (!determined || e.rank < 3) continue;
    double variance = u.dot(e.covariance * u);
    for (int a = 0; a < m; ++a) {
      for (int b = 0; b < m; ++b) {
        variance += u.dot(e.by_motion.vector3(0, a)) * scaled(a, b) * u.dot(e.by_motion.vector3(0, b));
      }
    }
    feature.depth_sigma = std::sqrt(variance);
    feature.depth_determined = true;
    relative.push_back(feature.depth_sigma / std::abs(u.dot(best.P[i])));
  }
  if (!relative.empty()) result.scale_sigma = median(relative);
}

/// Standard deviation of a bias, relative to its prior, above which the data do not count as information on it: an
/// improvement of 2 % is no more than the prior itself (docs/closed_form.md).
inline constexpr double prior_dominates = 0.98;

/// True if it is the prior that says what the accelerometer's bias is: the data improve one of its three directions at
/// most (with |G| known one comes from its length).
inline bool biasRestsOnPrior(const ClosedFormResult& result, const InitialisationOptions& options) {
  if (!std::isfinite(options.prior.accelerometer_sigma) || result.covariance.rows() != 9) return false;
  const SmallSvd svd(SmallMatrix::of<3, 3>(Eigen::Matrix3d(result.covariance.block<3, 3>(6, 6))));
  return std::sqrt(svd.value(1)) > prior_dominates * options.prior.accelerometer_sigma;
}

}  // namespace liestat::detail
