// MotionEngine: what a frame says of one hypothesis: robust weights, sums, the step.
#pragma once

#include <fusion/motion/detail/motion_engine.hpp>
#include <lie/manifold.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace liestat::detail {

/// Weights of a forward difference, which depend on the depth and the rotation.
LIESTAT_FUSION_INLINE void MotionEngine::weighForward(const Eigen::Vector3d& V, Evaluation& e) {
  const Eigen::Vector3d Omega = rotationSums<double>(rows_).solve(e.prior);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const double rho = flowResidual(points_[i], rows_[i], Omega).rho;
    const double variance = forwardVariance(points_[i], rows_[i], rho, V, Omega);
    if (variance > 0) rows_[i].weight = 1 / variance;
  }
}

/// Sets the weights of outliers to zero: first a robust rotation, by reweighting (Huber 1981, then Geman and McClure),
/// then a threshold, or a gate where the direction is known well enough to predict the error.
LIESTAT_FUSION_INLINE void MotionEngine::rejectOutliers(const DirectionCandidate& c, Evaluation& e) {
  const std::size_t n = points_.size();
  RotationPrior<double> prior = e.prior;
  if (keepsTheBias(state_)) prior.information = e.marginal;
  if (keepsTheRotation(state_)) {
    // Knowledge of the increment in the state, besides the gyroscope.
    const Eigen::Matrix3d own = Cholesky<double, 3>(Eigen::Matrix3d(c.wide.gain.bottomRightCorner<3, 3>())).inverse();
    const Eigen::Vector3d pull = prior.information * prior.mean;
    prior.information += own;
    prior.mean = Cholesky<double, 3>(prior.information).solve<1>(pull);
  }
  for (std::size_t i = 0; i < n; ++i) weights_[i] = rows_[i].weight;
  const auto squared = [&](std::size_t i, const Eigen::Vector3d& Omega) {
    const FlowRow<double>& row = rows_[i];
    const double error = row.q - (row.h0 * Omega[0] + row.h1 * Omega[1] + row.h2 * Omega[2]);
    return weights_[i] * error * error;
  };
  Eigen::Vector3d Omega = rotationSums<double>(rows_).solve(prior);
  // With a gyroscope the rotation cannot give way: far from the truth all errors are large, and the smaller ones among
  // them still show where to go. Errors then count in units of their median, 0.455 for χ² of one degree of freedom. (A
  // free rotation fits the inliers at any direction, and this would only let outliers in.)
  double scale = 1;
  const auto rescale = [&] {
    if (!frame_.has_gyroscope) return;
    for (std::size_t i = 0; i < n; ++i) squared_[i] = squared(i, Omega);
    const auto middle = squared_.begin() + static_cast<std::ptrdiff_t>(n / 2);
    std::nth_element(squared_.begin(), middle, squared_.end());
    scale = std::max(1.0, *middle / 0.455);
  };
  for (int pass = 0; pass < 12; ++pass) {
    if (pass % 3 == 0) rescale();
    for (std::size_t i = 0; i < n; ++i) {
      const double z2 = squared(i, Omega) / scale, f = 1 / (1 + z2 / 9);
      rows_[i].weight = weights_[i] * (pass < 6 ? 1 / std::max(1.0, std::sqrt(z2)) : f * f);
    }
    Omega = rotationSums<double>(rows_).solve(prior);
  }
  rescale();
  const Eigen::Matrix2d known =
      state_ == MotionState::direction ? c.narrow.reported : Eigen::Matrix2d(c.wide.reported.topLeftCorner<2, 2>());
  const bool gate = candidates_.size() == 1 && updates_ >= options_.first_pruning && known.trace() < 0.01;
  const double limit = options_.outlier_threshold * options_.outlier_threshold * scale;
  for (std::size_t i = 0; i < n; ++i) rows_[i].weight = squared(i, Omega) <= limit ? weights_[i] : 0;
  if (gate) {
    // e² ≤ gate² (variance + G P Gᵀ + hᵀ M⁻¹ h), with M without the pair itself.
    const FlowRotationSums<double> sums = rotationSums<double>(rows_);
    const Cholesky<double, 3> ML(Eigen::Matrix3d(sums.M + prior.information));
    const bool turns = keepsTheRotation(state_);
    if (!turns) Omega = sums.solve(prior);
    for (std::size_t i = 0; i < n; ++i) {
      const Eigen::Vector3d h(rows_[i].h0, rows_[i].h1, rows_[i].h2);
      const double variance = 1 / weights_[i], leverage = rows_[i].weight * h.dot(ML.solve<1>(h));
      const FlowResidual<double> r = flowResidual(points_[i], rows_[i], turns ? Eigen::Vector3d::Zero().eval() : Omega);
      const Eigen::RowVector2d G = -r.along * flowTurn(points_[i], rows_[i], e.basis);
      double predicted = variance, error = r.e;
      if (turns) {
        Eigen::Matrix<double, 1, 5> g;
        g << G, -h.transpose();
        predicted += g.dot(g * c.wide.reported);
      } else {
        const double rest = std::max(1e-9, 1 - leverage);
        error /= rest;
        predicted += G.dot(G * known) + (rows_[i].weight > 0 ? leverage / rest * variance : h.dot(ML.solve<1>(h)));
      }
      rows_[i].weight = error * error <= options_.gate * options_.gate * predicted ? weights_[i] : 0;
    }
  }
  if (gate) gateDepths(c, Omega);
  if (keepsTheRotation(state_)) {
    Omega.setZero();
  } else {
    Omega = rotationSums<double>(rows_).solve(prior);
  }
  e.capped_cost = 0, e.inliers = 0;
  for (std::size_t i = 0; i < n; ++i) {
    e.capped_cost += std::min(squared(i, Omega), 9.0);
    e.inliers += rows_[i].weight > 0 ? 1U : 0U;
  }
}

/// An outlier along the flow passes every gate across it: pairs far nearer than the others, or behind the camera where
/// the sign is certain, are left out. Where most are behind it is the sign that is wrong.
LIESTAT_FUSION_INLINE void MotionEngine::gateDepths(const DirectionCandidate& c, const Eigen::Vector3d& Omega) {
  const std::size_t n = points_.size();
  const Eigen::Vector3d at = keepsTheRotation(state_) ? Eigen::Vector3d(Eigen::Vector3d::Zero()) : Omega;
  std::size_t used = 0, behind = 0;
  const auto depthOf = [&](std::size_t i) { return flowResidual(points_[i], rows_[i], at).rho; };
  const auto deviationOf = [&](std::size_t i) { return std::sqrt(points_[i].variance) * rows_[i].inverse_length; };
  for (std::size_t i = 0; i < n; ++i) {
    if (!(rows_[i].weight > 0)) continue;
    const double rho = depthOf(i);
    behind += rho < -4 * deviationOf(i) ? 1U : 0U;
    squared_[used++] = std::abs(rho);
  }
  if (used < 5) return;
  const auto middle = squared_.begin() + static_cast<std::ptrdiff_t>(used / 2);
  std::nth_element(squared_.begin(), middle, squared_.begin() + static_cast<std::ptrdiff_t>(used));
  const double largest = 6 * *middle;
  const bool certain = options_.positive_depth && c.evidence > 4 * std::sqrt(c.evidence_variance) && 2 * behind < used;
  for (std::size_t i = 0; i < n; ++i) {
    if (!(rows_[i].weight > 0)) continue;
    const double rho = depthOf(i), margin = 4 * deviationOf(i);
    if (std::abs(rho) > largest + margin || (certain && rho < -margin)) rows_[i].weight = 0;
  }
}

LIESTAT_FUSION_INLINE bool MotionEngine::evaluate(const DirectionCandidate& c, Evaluation& e) {
  const Eigen::Vector3d V = c.direction.unit_vector();
  e.basis = ManifoldTraits<S2d>::placement(c.direction).matrix().leftCols<2>();
  e.prior.information = e.marginal = frame_.information;
  e.prior.mean.setZero();
  e.base = SO3d();
  int passes = 1;
  const Eigen::Vector3d gyroscope = frame_.gyroscope - c.bias;
  if (keepsTheRotation(state_)) {
    e.base = c.rotation;
    if (frame_.has_gyroscope) e.prior.mean = (SO3d::exp(gyroscope) * c.rotation.inverse()).log();
  } else if (options_.flow == Flow::discrete) {
    e.base = frame_.has_gyroscope ? SO3d::exp(gyroscope) : c.rotation;
    if (!frame_.has_gyroscope) passes = updates_ == 0 ? 4 : 2;
  } else if (frame_.has_gyroscope) {
    e.prior.mean = gyroscope;
  }
  if (keepsTheBias(state_) && frame_.has_gyroscope) {
    const Eigen::Matrix3d covariance = Cholesky<double, 3>(frame_.information).inverse();
    e.marginal = Cholesky<double, 3>(Eigen::Matrix3d(covariance + c.biasCovariance(state_))).inverse();
  }
  for (int pass = 0; pass < passes; ++pass) {
    if (turnedPerCandidate()) flowsAfter(e.base);
    flowRows<double>(points_, V, rows_);
    if (options_.flow == Flow::forward) weighForward(V, e);
    e.inliers = points_.size();
    if (options_.outliers) rejectOutliers(c, e);
    const FlowRotationSums<double> sums = rotationSums<double>(rows_);
    if (keepsTheRotation(state_)) {
      e.Omega.setZero();
    } else {
      e.Omega = sums.solve({e.prior.mean, e.marginal});
    }
    if (!e.Omega.allFinite()) return false;
    if (pass + 1 < passes) {
      e.base = SO3d::exp(e.Omega) * e.base;
      continue;
    }
    e.sums = subspaceSums<double>(points_, rows_, e.basis, e.Omega, sums.M);
  }
  return e.inliers >= std::min<std::size_t>(leastPairs(), 5) && std::isfinite(e.sums.cost);
}

/// While hypotheses compete: what it costs to have all depths on one side of the camera, the cheaper one. A point on
/// the other side adds its χ² at infinity, no more than an outlier's.
LIESTAT_FUSION_INLINE double MotionEngine::mixedDepths(const Evaluation& e) const {
  if (candidates_.size() < 2) return 0;
  double ahead = 0, behind = 0;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (!(rows_[i].weight > 0)) continue;
    const double along = flowResidual(points_[i], rows_[i], e.Omega).along;
    (along > 0 ? ahead : behind) += std::min(rows_[i].weight * along * along, 9.0);
  }
  return std::min(ahead, behind);
}

/// While hypotheses compete: χ² of inverse depths that are linear in the image, over its degrees of freedom. Points of
/// a plane have such depths under both of its solutions.
LIESTAT_FUSION_INLINE double MotionEngine::planeMisfit(const Evaluation& e) const {
  if (candidates_.size() < 2) return 0;
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  double squares = 0;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const FlowRow<double>& row = rows_[i];
    if (!(row.weight > 0) || !(row.inverse_length > 0)) continue;
    const double along = flowResidual(points_[i], row, e.Omega).along, length = 1 / row.inverse_length;
    const Eigen::Vector3d a = length * Eigen::Vector3d(points_[i].x, points_[i].y, 1);
    A += row.weight * a * a.transpose(), b += row.weight * along * a, squares += row.weight * along * along;
  }
  const double rest = squares - b.dot(Cholesky<double, 3>(A).solve<1>(b));
  const double degrees = static_cast<double>(e.inliers) - 3;
  return degrees > 0 && std::isfinite(rest) ? rest / degrees : std::numeric_limits<double>::infinity();
}

/// Share of the points that the direction of the best hypothesis puts behind the camera, each by four standard
/// deviations of the noise that the last frames show, where that is less than the stated one. They are tracks of things
/// that move, or of the scene where the direction is that of such things; the mean depth, which near points decide, does
/// not show them.
LIESTAT_FUSION_INLINE double MotionEngine::behindTheCamera(const Evaluation& e) const {
  if (candidates_.size() > 1 || !options_.positive_depth || options_.outliers) return 0;
  std::array<double, fit_frames> fits;
  std::size_t frames = 0;
  for (const FrameFit& fit : fits_) {
    if (fit.degrees > 0) fits[frames++] = fit.chi_squared / fit.degrees;
  }
  std::nth_element(fits.begin(), fits.begin() + frames / 2, fits.begin() + frames);
  const double scale = frames > 0 ? std::min(fits[frames / 2], 1.0) : 1;
  std::size_t behind = 0;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (!(rows_[i].weight > 0)) continue;
    const double along = flowResidual(points_[i], rows_[i], e.Omega).along;
    behind += along < 0 && rows_[i].weight * along * along > 16 * scale ? 1U : 0U;
  }
  return behind > 2 ? static_cast<double>(behind) / static_cast<double>(e.inliers) : 0;
}

/// The rotation that the images alone say, direction and rotation both free, minus the gyroscope's.
LIESTAT_FUSION_INLINE void MotionEngine::compareWithGyroscope(DirectionCandidate& c, const Evaluation& e) const {
  c.gyroscope_information.setZero();
  if (!frame_.has_gyroscope || e.inliers < options_.min_pairs) return;
  const Cholesky<double, 2> xx(e.sums.Hxx);
  const Eigen::Matrix<double, 2, 3> by_direction = xx.solve<3>(Eigen::Matrix<double, 2, 3>(e.sums.Hox.transpose()));
  const Cholesky<double, 3> images(Eigen::Matrix3d(e.sums.M - e.sums.Hox * by_direction));
  const Cholesky<double, 3> gyroscope(e.marginal);
  if (!xx.ok() || !images.ok() || !gyroscope.ok()) return;
  const Eigen::Vector3d rest = e.sums.bo - by_direction.transpose() * e.sums.bx;
  c.from_gyroscope = e.Omega - images.solve<1>(rest) - e.prior.mean;
  const Eigen::Matrix3d covariance = images.inverse() + gyroscope.inverse();
  c.gyroscope_information = Cholesky<double, 3>(covariance).inverse();
  if (!c.gyroscope_information.allFinite() || !c.from_gyroscope.allFinite()) c.gyroscope_information.setZero();
}

/// Moves a hypothesis by what its frame says; false, and unchanged, where that is not finite.
template <int D>
bool MotionEngine::step(DirectionCandidate& c, FilterCovariance<double, D>& P, const Evaluation& e,
                        const FrameInformation<double, D>& frame) {
  FilterCovariance<double, D> next = P;
  const FilterStep<double, D> s = updateCovariance(next, frame, options_.max_step, options_.second_derivatives);
  if (!s.step.allFinite() || !next.reported.allFinite()) return false;
  boundDirection(next);
  const S2d moved = exp(c.direction, Eigen::Vector2d(s.step.template head<2>()));
  const Eigen::Matrix2d T = frameTransport(c.direction, moved);
  turnDirection<D>(next.gain, T), turnDirection<D>(next.reported, T);
  const Eigen::Matrix<double, D, D> CP = frame.corrected * P.reported;
  const Eigen::Matrix2d spread =
      frame.gauss_newton.template topLeftCorner<2, 2>() + (CP * frame.corrected).template topLeftCorner<2, 2>();
  const Eigen::Vector2d pull = frame.gradient.template head<2>();
  c.direction_score = pull.dot(Cholesky<double, 2>(spread).template solve<1>(pull));
  P = next;
  c.direction = moved;
  const int equations = static_cast<int>(e.inliers) - (keepsTheRotation(state_) || frame_.has_gyroscope ? 0 : 3);
  c.innovation = (frame.start - s.reduction) / std::max(equations, 1);
  c.cost = frame.cost;
  compareWithGyroscope(c, e);
  c.plane_misfit = planeMisfit(e);
  c.inliers = e.inliers, c.behind = behindTheCamera(e);
  c.usually_behind += 0.25 * (c.behind - c.usually_behind);
  const double cost = (options_.outliers ? e.capped_cost : frame.cost) + mixedDepths(e);
  c.score += cost;
  c.costs[updates_ % DirectionCandidate::remembered] = cost;

  const Cholesky<double, 3> ML(Eigen::Matrix3d(e.sums.M + e.marginal));
  const Eigen::Vector3d lever = e.sums.depth_lever / e.sums.depth_weight;
  c.depth = e.sums.meanInverseDepth();
  if constexpr (D > 2) {
    if (keepsTheRotation(state_)) {
      const Eigen::Vector3d turn = s.step.template segment<3>(2);
      c.rotation = SO3d::exp(turn) * c.rotation;
      c.Omega = c.rotation.log();
      c.rotation_covariance = P.reported.template block<3, 3>(2, 2);
      c.depth -= lever.dot(turn);
      c.depth_variance = 1 / e.sums.depth_weight + lever.dot(P.gain.template block<3, 3>(2, 2) * lever);
      if constexpr (D == 8) {
        c.bias += s.step.template tail<3>();
        c.copyFromWhole();
      }
      return true;
    }
  }
  c.depth_variance = e.sums.meanInverseDepthVariance(ML);
  // The rotation at the new direction, to first order: δ = -ML⁻¹ (bo + Hox ξ + pull of the bias).
  const Eigen::Vector2d xi = s.step.template head<2>();
  Eigen::Vector3d right = e.sums.Hox * xi;
  if constexpr (D == 5) {
    const Eigen::Vector3d bias = s.step.template tail<3>();
    c.bias += bias;
  }
  const Eigen::Vector3d delta = -ML.solve<1>(right);
  const Eigen::Matrix<double, 3, 2> K = ML.solve<2>(e.sums.Hox);
  c.rotation_covariance = ML.inverse() + K * Eigen::Matrix2d(P.reported.template topLeftCorner<2, 2>()) * K.transpose();
  c.Omega = e.Omega + delta;
  c.rotation = SO3d::exp(c.Omega) * e.base;
  return true;
}

LIESTAT_FUSION_INLINE bool MotionEngine::advance(DirectionCandidate& c) {
  Evaluation e;
  if (!evaluate(c, e)) return false;
  bool moved = false;
  if (state_ == MotionState::direction) {
    moved = step<2>(c, c.narrow, e, eliminateRotation(e.sums, e.Omega, e.prior));
  } else if (state_ == MotionState::rotation) {
    moved = step<5>(c, c.wide, e, keepRotation(e.sums, e.Omega, e.prior));
  } else if (state_ == MotionState::rotation_and_bias) {
    const Eigen::Matrix3d turn = SO3d::leftJacobian(Eigen::Vector3d(frame_.gyroscope - c.bias));
    moved = step<8>(c, c.whole, e, keepRotationAndBias(e.sums, e.Omega, e.prior, turn, e.marginal));
  } else {
    moved = step<5>(c, c.wide, e, eliminateRotationWithBias(e.sums, e.Omega, e.prior, e.marginal));
  }
  if (moved) weighSign(c);
  return moved;
}

}  // namespace liestat::detail
