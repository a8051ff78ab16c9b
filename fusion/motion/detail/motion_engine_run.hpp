// Definitions of fusion/motion/detail/motion_engine.hpp.
#pragma once

#include <fusion/motion/detail/motion_engine.hpp>
#include <fusion/motion/detail/motion_statistics.hpp>
#include <fusion/motion/search.hpp>
#include <lie/detail/small_orthogonal.hpp>
#include <lie/manifold.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace liestat::detail {

LIESTAT_FUSION_INLINE MotionEngine::MotionEngine(const MotionFilterOptions& options, MotionState state)
    : options_(options), state_(state), standstill_quantile_(normalThreshold(options.standstill_probability)) {
  if (keepsTheRotation(state)) options_.flow = Flow::discrete;
  reset();
}

LIESTAT_FUSION_INLINE void MotionEngine::reset() {
  startAnew();
  usual_signal_ = still_sum_ = still_dof_ = 0, moving_frames_ = 0;
  updated_ = false;
  estimate_ = MotionEstimate{};
  estimate_.meaning = options_.flow == Flow::discrete ? DirectionMeaning::translation : DirectionMeaning::velocity;
}

LIESTAT_FUSION_INLINE void MotionEngine::start(const DirectionCandidate& candidate) {
  candidates_.assign(1, candidate);
  best_ = 0, kept_ = options_.linear_frames, innovation_count_ = 0, innovation_sum_ = 0;
  updates_ = 0;
  estimate_.direction.mean = candidate.direction;
  estimate_.rotation.mean = candidate.rotation;
}

LIESTAT_FUSION_INLINE std::size_t MotionEngine::leastPairs() const {
  return frame_.has_gyroscope ? options_.min_pairs_gyroscope : options_.min_pairs;
}

/// Takes over what is usable of a frame; false where something was not.
LIESTAT_FUSION_INLINE bool MotionEngine::readFrame(std::span<const PointPair> pairs,
                                                   const GyroscopeRotation* gyroscope) {
  pairs_.clear(), index_.clear();
  given_ = pairs.size();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const PointPair& p = pairs[i];
    const double sum = p.first.sum() + p.second.sum() + p.sigma + p.frames;
    if (!std::isfinite(sum) || !(p.sigma > 0) || !(p.frames > 0)) continue;
    pairs_.push_back(p), index_.push_back(i);
  }
  bool good = pairs_.size() == pairs.size();
  frame_ = Frame{};
  if (gyroscope != nullptr) {
    const Cholesky<double, 3> factor(gyroscope->covariance);
    frame_.has_gyroscope = factor.ok() && gyroscope->rotation.allFinite();
    if (frame_.has_gyroscope) {
      frame_.gyroscope = gyroscope->rotation;
      frame_.information = factor.inverse();
    }
    good = good && frame_.has_gyroscope;
  }
  resize(pairs_.size());
  return good;
}

LIESTAT_FUSION_INLINE void MotionEngine::resize(std::size_t n) {
  points_.resize(n), rows_.resize(n), weights_.resize(n), squared_.resize(n);
}

LIESTAT_FUSION_INLINE const MotionEstimate& MotionEngine::update(std::span<const PointPair> pairs,
                                                                 const GyroscopeRotation* gyroscope) {
  ++estimate_.frame;
  estimate_.flags = MotionFlags{};
  estimate_.flags.bad_input = !readFrame(pairs, gyroscope);
  estimate_.pairs = pairs_.size(), estimate_.inliers = 0;
  for (DirectionCandidate& c : candidates_) predict(c);
  updated_ = false;
  if (pairs_.size() < leastPairs()) {
    estimate_.flags.too_few = true;
  } else if (!atStandstill()) {
    updated_ = true;
    const bool linear = !keepsTheRotation(state_) && options_.linear_start && frame_.has_gyroscope &&
                        !options_.outliers && kept_ < options_.linear_frames && updates_ == kept_ &&
                        (kept_ > 0 || pairs_.size() >= options_.min_pairs);
    if (linear) {
      startLinearly();
    } else {
      if (candidates_.empty()) spreadStarts();
      prepareSharedFlows();
      advanceAll();
    }
  }
  publish();
  return estimate_;
}

/// One set of points serves all hypotheses unless each turns them by a rotation of its own.
LIESTAT_FUSION_INLINE bool MotionEngine::turnedPerCandidate() const {
  if (options_.flow != Flow::discrete) return false;
  return state_ != MotionState::direction || !frame_.has_gyroscope;
}

LIESTAT_FUSION_INLINE void MotionEngine::flowsAfter(const SO3d& R) {
  const Eigen::Matrix3d matrix = R.matrix();
  for (std::size_t i = 0; i < pairs_.size(); ++i) {
    points_[i] = flowAfter(matrix, pairs_[i]);
    // A point that the rotation turns out of sight takes no part.
    if (!std::isfinite(points_[i].x)) {
      points_[i] = FlowPoint<double>{};
      points_[i].variance = std::numeric_limits<double>::infinity();
    }
  }
}

LIESTAT_FUSION_INLINE void MotionEngine::prepareSharedFlows() {
  if (turnedPerCandidate()) return;
  if (options_.flow == Flow::discrete) {
    flowsAfter(SO3d::exp(frame_.gyroscope));
  } else {
    for (std::size_t i = 0; i < pairs_.size(); ++i) points_[i] = flowOf(pairs_[i], options_.flow);
  }
}

/// True if the frame says nothing of the direction. Where noise drowns the motion of one frame, many frames together do
/// say something, though each of them looks like standstill: a frame is left out only if others have shown a clear motion.
/// If none has, hypotheses are updated, and start anew with the first clear motion after frames without any.
LIESTAT_FUSION_INLINE bool MotionEngine::atStandstill() {
  double statistic = 0;
  const double dof = fitRotationAlone(statistic);
  estimate_.signal = dof > 0 ? statistic / dof : std::numeric_limits<double>::quiet_NaN();
  if (!(dof > 0)) return false;
  const double bound = chiSquaredBound(dof, standstill_quantile_) / dof;
  const bool still = estimate_.signal <= bound;
  const bool clear_before = usual_signal_ > 1.5 * bound;
  if (!clear_before) still_sum_ += statistic, still_dof_ += dof;
  if (!still) {
    ++moving_frames_;
    usual_signal_ +=
        (estimate_.signal - usual_signal_) / static_cast<double>(std::min<std::size_t>(moving_frames_, 10));
    if (!clear_before && usual_signal_ > 1.5 * bound) {
      const double rest = still_dof_ - dof;
      if (rest > 0 && still_sum_ - statistic <= chiSquaredBound(rest, standstill_quantile_)) startAnew();
    }
    return false;
  }
  estimate_.flags.standstill = clear_before || still_sum_ <= chiSquaredBound(still_dof_, standstill_quantile_);
  if (clear_before) updateRotationAlone();
  return clear_before;
}

LIESTAT_FUSION_INLINE void MotionEngine::startAnew() {
  candidates_.clear();
  best_ = updates_ = kept_ = innovation_count_ = 0, innovation_sum_ = 0;
  linear_moments_.setZero(), linear_noise_.setZero();
}

/// The least Σ |ẋ - BΩ|²/variance, and its degrees of freedom; none where it can't be had, or where it leaves a third of
/// the points to outliers. With the rotation so found points are turned and the rest is fitted again, so that large
/// rotations are no signal.
LIESTAT_FUSION_INLINE double MotionEngine::fitRotationAlone(double& statistic) {
  rotation_prior_ = priorWithoutBias();
  const RotationPrior<double>& prior = rotation_prior_;
  Eigen::Vector3d Omega = prior.mean;
  const double limit = 11.8;  // χ² of two degrees of freedom, as likely as 3 standard deviations
  const bool robust = options_.outliers;
  const std::size_t n = pairs_.size();
  std::fill(weights_.begin(), weights_.end(), 1.0);
  std::size_t used = n;
  Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
  const int passes = robust ? 8 : 2;
  for (int pass = 0; pass < passes; ++pass) {
    Eigen::Matrix3d R = SO3d::exp(Omega).matrix();
    double frames = 1;
    M = prior.information;
    Eigen::Vector3d b = prior.information * (prior.mean - Omega);
    for (std::size_t i = 0; i < n; ++i) {
      if (pairs_[i].frames != frames) {
        frames = pairs_[i].frames;
        R = SO3d::exp(Eigen::Vector3d(frames * Omega)).matrix();
      }
      FlowPoint<double>& p = points_[i] = flowAfter(R, pairs_[i]);
      if (!std::isfinite(p.x)) return 0;
      const double k = 1 / frames;
      p.u *= k, p.v *= k, p.variance *= k * k;
      const Eigen::Matrix<double, 2, 3> B = flowByRotation(p.x, p.y);
      const double w = weights_[i] / p.variance;
      M += w * B.transpose() * B;
      b += w * B.transpose() * Eigen::Vector2d(p.u, p.v);
    }
    const Eigen::Vector3d d = Cholesky<double, 3>(M).solve<1>(b);
    if (!d.allFinite()) return 0;
    const Eigen::Vector3d from_gyroscope = Omega + d - prior.mean;
    statistic = from_gyroscope.dot(prior.information * from_gyroscope), used = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const FlowPoint<double>& p = points_[i];
      const Eigen::Vector2d rest = Eigen::Vector2d(p.u, p.v) - flowByRotation(p.x, p.y) * d;
      const double squared = rest.squaredNorm() / p.variance;
      if (!robust) {
        statistic += squared, ++used;
        continue;
      }
      // Geman and McClure while the inliers are sought, then all or none.
      const double f = 1 / (1 + squared / limit);
      weights_[i] = pass + 3 < passes ? f * f : squared < limit ? 1 : 0;
      if (squared < limit) statistic += squared, ++used;
    }
    Omega += d;
  }
  rotation_alone_ = SO3d::exp(Omega), rotation_information_ = M, rotation_inliers_ = used;
  const double dof = 2 * static_cast<double>(used) - (frame_.has_gyroscope ? 0 : 3);
  if (used * 3 >= n * 2) return dof;
  statistic = std::numeric_limits<double>::infinity();
  return dof;
}

/// The gyroscope's rotation as far as its bias is known, without that.
LIESTAT_FUSION_INLINE RotationPrior<double> MotionEngine::priorWithoutBias() const {
  RotationPrior<double> prior{frame_.gyroscope, frame_.information};
  if (!frame_.has_gyroscope || !keepsTheBias(state_)) return prior;
  Eigen::Matrix3d covariance = Cholesky<double, 3>(frame_.information).inverse();
  if (const DirectionCandidate* c = best()) {
    prior.mean -= c->bias;
    covariance += c->biasCovariance(state_);
  } else {
    covariance.diagonal().array() += options_.bias_sigma * options_.bias_sigma;
  }
  prior.information = Cholesky<double, 3>(covariance).inverse();
  return prior;
}

/// A hypothesis at standstill: what the flow says of the rotation, and with it of the gyroscope's bias.
LIESTAT_FUSION_INLINE void MotionEngine::updateRotationOf(DirectionCandidate& c) {
  if (!keepsTheRotation(state_)) c.rotation = rotation_alone_;
  if (state_ == MotionState::direction) return;
  const auto fromState = [&](const SO3d& R) { return (R * c.rotation.inverse()).log(); };
  const Eigen::Vector3d pull = rotation_information_ * fromState(rotation_alone_);
  if (state_ == MotionState::rotation) {
    FrameInformation<double, 5> frame;
    frame.gauss_newton.setZero();
    frame.gauss_newton.bottomRightCorner<3, 3>() = rotation_information_;
    frame.corrected = frame.gauss_newton;
    frame.gradient << 0, 0, -pull;
    const FilterStep<double, 5> s = updateCovariance(c.wide, frame, options_.max_step);
    c.rotation = SO3d::exp(Eigen::Vector3d(s.step.tail<3>())) * c.rotation;
    return;
  }
  // The flow by itself, without the gyroscope's share, and the gyroscope as a measurement of rotation and bias.
  SubspaceSums<double> flow;
  flow.Hxx.setZero(), flow.Cxx.setZero(), flow.Hox.setZero(), flow.Cox.setZero(), flow.bx.setZero();
  flow.M = rotation_information_ - rotation_prior_.information;
  flow.bo = rotation_prior_.information * fromState(SO3d::exp(rotation_prior_.mean)) - pull;
  const Eigen::Vector3d gyroscope = frame_.gyroscope - c.bias, here = Eigen::Vector3d::Zero();
  RotationPrior<double> prior{Eigen::Vector3d::Zero(), frame_.information};
  if (frame_.has_gyroscope) prior.mean = fromState(SO3d::exp(gyroscope));
  if (state_ == MotionState::gyroscope_bias) {
    if (!frame_.has_gyroscope) return;
    const FilterStep<double, 5> s =
        updateCovariance(c.wide, eliminateRotationWithBias(flow, here, prior, frame_.information), options_.max_step);
    c.bias += s.step.tail<3>();
    return;
  }
  const Eigen::Matrix3d turn = SO3d::leftJacobian(gyroscope);
  const FilterStep<double, 8> s =
      updateCovariance(c.whole, keepRotationAndBias(flow, here, prior, turn, frame_.information), options_.max_step);
  c.rotation = SO3d::exp(Eigen::Vector3d(s.step.segment<3>(2))) * c.rotation;
  c.bias += s.step.tail<3>();
  c.copyFromWhole();
}

/// At standstill the flow says the rotation, better than the filter does.
LIESTAT_FUSION_INLINE void MotionEngine::updateRotationAlone() {
  estimate_.rotation.mean = rotation_alone_;
  const Eigen::Matrix3d R = rotation_alone_.matrix();
  estimate_.rotation.covariance = R.transpose() * Cholesky<double, 3>(rotation_information_).inverse() * R;
  estimate_.inliers = rotation_inliers_;
  for (DirectionCandidate& c : candidates_) updateRotationOf(c);
}

/// Directions of a spherical Fibonacci lattice on the hemisphere z > 0: costs do not tell V from -V.
LIESTAT_FUSION_INLINE void MotionEngine::spreadStarts() {
  const std::size_t n = std::max<std::size_t>(options_.starts, 1);
  const std::vector<Eigen::Vector3d> lattice = hemisphereLattice(n);
  candidates_.assign(n, DirectionCandidate{});
  best_ = updates_ = innovation_count_ = 0, innovation_sum_ = 0;
  for (std::size_t i = 0; i < n; ++i) {
    DirectionCandidate& c = candidates_[i];
    c.direction = S2d(lattice[i]), c.start = i;
    if (keepsTheRotation(state_)) {
      // The rotation that the frame says at this direction, with little trust in it.
      c.wide.gain.bottomRightCorner<3, 3>() *= 0.09;
      c.rotation = SO3d::exp(frame_.gyroscope);
      for (int k = 0; k < 3; ++k) {
        flowsAfter(c.rotation);
        flowRows<double>(points_, c.direction.unit_vector(), rows_);
        const Eigen::Vector3d Omega =
            rotationSums<double>(rows_).solve({Eigen::Vector3d::Zero(), rotation_prior_.information});
        if (Omega.allFinite()) c.rotation = SO3d::exp(Omega) * c.rotation;
      }
    }
    c.wide.reported = c.wide.gain;
    spreadBias(c);
  }
}

/// The bias of a new hypothesis, as it is expected.
LIESTAT_FUSION_INLINE void MotionEngine::spreadBias(DirectionCandidate& c) const {
  const Eigen::Matrix3d bias = options_.bias_sigma * options_.bias_sigma * Eigen::Matrix3d::Identity();
  if (state_ == MotionState::gyroscope_bias) {
    c.wide.gain.bottomRightCorner<3, 3>() = bias;
    c.wide.reported = c.wide.gain;
  } else if (state_ == MotionState::rotation_and_bias) {
    c.whole.gain.setZero();
    c.whole.gain.topLeftCorner<5, 5>() = c.wide.gain;
    c.whole.gain.bottomRightCorner<3, 3>() = bias;
    c.whole.reported = c.whole.gain;
    c.whole.reported.topLeftCorner<5, 5>() = c.wide.reported;
  }
}

LIESTAT_FUSION_INLINE void MotionEngine::predict(DirectionCandidate& c) const {
  const double q = options_.process_noise;
  if (state_ == MotionState::direction) {
    for (Eigen::Matrix2d* P : {&c.narrow.gain, &c.narrow.reported}) P->diagonal().array() += q;
    return;
  }
  if (state_ == MotionState::rotation_and_bias) {
    for (Eigen::Matrix<double, 8, 8>* P : {&c.whole.gain, &c.whole.reported}) {
      P->diagonal().head<2>().array() += q;
      P->diagonal().segment<3>(2).array() += options_.rotation_noise;
      P->diagonal().tail<3>().array() += options_.bias_noise;
    }
    c.copyFromWhole();
    return;
  }
  const double other = state_ == MotionState::rotation ? options_.rotation_noise : options_.bias_noise;
  for (Eigen::Matrix<double, 5, 5>* P : {&c.wide.gain, &c.wide.reported}) {
    P->diagonal().head<2>().array() += q;
    P->diagonal().tail<3>().array() += other;
  }
}

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
  P = next;
  c.direction = moved;
  const int equations = static_cast<int>(e.inliers) - (keepsTheRotation(state_) || frame_.has_gyroscope ? 0 : 3);
  c.innovation = (frame.start - s.reduction) / std::max(equations, 1);
  c.cost = frame.cost;
  c.inliers = e.inliers;
  const double cost = options_.outliers ? e.capped_cost : frame.cost;
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

/// V and -V have the same cost: the sign is a state of its own, told by the depths over several frames.
LIESTAT_FUSION_INLINE void MotionEngine::weighSign(DirectionCandidate& c) const {
  if (!(c.depth_variance > 0) || !std::isfinite(c.depth)) return;
  const double decay = options_.evidence_decay;
  c.evidence = decay * c.evidence + c.depth / c.depth_variance;
  c.evidence_variance = decay * decay * c.evidence_variance + 1 / c.depth_variance;
  c.evidence_weight = decay * c.evidence_weight + 1 / c.depth_variance;
  if (!options_.positive_depth || !(c.evidence < 0)) return;
  const Eigen::Vector3d V = c.direction.unit_vector();
  const S2d opposite(Eigen::Vector3d(-V));
  // E becomes -E: the coordinates of the error stay, up to the axes that the placement has at -V.
  const Eigen::Matrix<double, 3, 2> from = ManifoldTraits<S2d>::placement(c.direction).matrix().leftCols<2>();
  const Eigen::Matrix<double, 3, 2> to = ManifoldTraits<S2d>::placement(opposite).matrix().leftCols<2>();
  const Eigen::Matrix2d T = -(to.transpose() * from);
  turnDirection<2>(c.narrow.gain, T), turnDirection<2>(c.narrow.reported, T);
  turnDirection<5>(c.wide.gain, T), turnDirection<5>(c.wide.reported, T);
  turnDirection<8>(c.whole.gain, T), turnDirection<8>(c.whole.reported, T);
  c.direction = opposite;
  c.evidence = -c.evidence, c.depth = -c.depth;
}

LIESTAT_FUSION_INLINE void MotionEngine::advanceAll() {
  bool any = false;
  for (DirectionCandidate& c : candidates_) {
    if (advance(c)) {
      any = true;
    } else {
      // One to which the frame says nothing must not gain by it.
      c.score += options_.outliers ? 9 * static_cast<double>(pairs_.size()) : c.cost;
    }
  }
  if (!any) {
    estimate_.flags.degenerate = true;
    updated_ = false;
    return;
  }
  ++updates_;
  prune();
}

/// How far the scores of two equally good hypotheses may part: costs at different directions are χ² of different
/// projections of the flow, so their differences are a random walk.
LIESTAT_FUSION_INLINE double MotionEngine::gapOfChance(const DirectionCandidate& c,
                                                       const DirectionCandidate& best) const {
  const std::size_t n = std::min(updates_, DirectionCandidate::remembered);
  if (n < 2) return std::numeric_limits<double>::infinity();
  double sum = 0, squares = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const double d = c.costs[k] - best.costs[k];
    sum += d, squares += d * d;
  }
  const auto count = static_cast<double>(n);
  // No more than that of independent χ²: costs that fall as a hypothesis converges are no chance.
  const double variance = std::min((squares - sum * sum / count) / (count - 1), 4 * static_cast<double>(best.inliers));
  return options_.rival_sigmas * std::sqrt(std::max(variance, 0.0) * static_cast<double>(updates_));
}

/// Drops hypotheses far worse than the best, and those that have come to the same place as a better one.
LIESTAT_FUSION_INLINE void MotionEngine::prune() {
  best_ = 0;
  for (std::size_t i = 1; i < candidates_.size(); ++i) {
    if (candidates_[i].score < candidates_[best_].score) best_ = i;
  }
  if (updates_ < options_.first_pruning || candidates_.size() == 1) return;
  std::sort(candidates_.begin(), candidates_.end(),
            [](const DirectionCandidate& a, const DirectionCandidate& b) { return a.score < b.score; });
  best_ = 0;
  const double nearest = std::cos(options_.merge_angle);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    const double gap = candidates_[i].score - candidates_[0].score;
    if (gap > options_.prune_gap && gap > gapOfChance(candidates_[i], candidates_[0])) continue;
    bool own = true;
    for (std::size_t k = 0; k < kept && own; ++k) {
      own = std::abs(candidates_[k].direction.unit_vector().dot(candidates_[i].direction.unit_vector())) < nearest;
    }
    if (!own) continue;
    if (kept != i) candidates_[kept] = candidates_[i];
    ++kept;
  }
  candidates_.resize(kept);
}

/// Without hypotheses: m = ẋ~ × X̃ of turned points is orthogonal to V, so V is the direction in which Σ m mᵀ is least in
/// units of its noise. The frames so far are then filtered from there.
LIESTAT_FUSION_INLINE void MotionEngine::startLinearly() {
  if (kept_pairs_.size() < options_.linear_frames) {
    kept_pairs_.resize(options_.linear_frames), kept_frames_.resize(options_.linear_frames);
  }
  kept_pairs_[kept_] = pairs_, kept_frames_[kept_] = frame_;
  ++kept_;
  const double bias = state_ == MotionState::gyroscope_bias ? options_.bias_sigma * options_.bias_sigma : 0;
  const Eigen::Matrix3d uncertain =
      Cholesky<double, 3>(frame_.information).inverse() + bias * Eigen::Matrix3d::Identity();
  flowsAfter(SO3d::exp(frame_.gyroscope));
  for (const FlowPoint<double>& p : points_) {
    if (!(p.variance < std::numeric_limits<double>::infinity())) continue;
    const Eigen::Vector3d m(p.v, -p.u, p.u * p.y - p.v * p.x);
    Eigen::Matrix<double, 3, 2> D;
    D << 0, 1, -1, 0, p.y, -p.x;
    const Eigen::Matrix<double, 2, 3> B = flowByRotation(p.x, p.y);
    Eigen::Matrix2d noise = B * uncertain * B.transpose();
    noise.diagonal().array() += p.variance;
    linear_moments_ += m * m.transpose() / p.variance;
    linear_noise_ += D * noise * D.transpose() / p.variance;
  }
  const Cholesky<double, 3> factor(linear_noise_);
  if (!factor.ok()) {
    estimate_.flags.degenerate = true;
    updated_ = false;
    return;
  }
  // L⁻¹ Σmmᵀ L⁻ᵀ, whose least eigenvector y gives V = L⁻ᵀ y.
  const Eigen::Matrix3d half = factor.halfSolve<3>(linear_moments_), turned = half.transpose();
  const Eigen::Matrix3d normal = factor.halfSolve<3>(turned);
  const SmallSvd svd(SmallMatrix::of<3, 3>(normal));
  const Eigen::Vector3d y(svd.v(2, 0), svd.v(2, 1), svd.v(2, 2));
  const Eigen::Matrix3d inverse_factor = factor.halfSolve<3>(Eigen::Matrix3d::Identity());
  const Eigen::Vector3d V = inverse_factor.transpose() * y;
  if (!(V.norm() > 0)) {
    estimate_.flags.degenerate = true;
    updated_ = false;
    return;
  }
  DirectionCandidate c;
  c.direction = S2d(V);
  spreadBias(c);
  candidates_.assign(1, c);
  best_ = updates_ = 0;
  for (std::size_t k = 0; k < kept_; ++k) {
    pairs_ = kept_pairs_[k], frame_ = kept_frames_[k];
    resize(pairs_.size());
    if (k > 0) predict(candidates_[0]);
    prepareSharedFlows();
    advanceAll();
    updates_ = k + 1;
  }
}

LIESTAT_FUSION_INLINE void MotionEngine::publish() {
  MotionEstimate& out = estimate_;
  out.hypotheses = candidates_.size();
  if (candidates_.empty()) {
    out.direction.covariance.setIdentity();
    out.flags.degenerate = out.flags.undecided_sign = true;
    return;
  }
  const DirectionCandidate& c = candidates_[best_];
  const bool narrow = state_ == MotionState::direction;
  out.direction.mean = c.direction;
  out.direction.covariance = narrow ? c.narrow.reported : Eigen::Matrix2d(c.wide.reported.topLeftCorner<2, 2>());
  if (keepsTheBias(state_)) {
    out.gyroscope_bias.mean = c.bias;
    out.gyroscope_bias.covariance = state_ == MotionState::gyroscope_bias
                                        ? Eigen::Matrix3d(c.wide.reported.bottomRightCorner<3, 3>())
                                        : Eigen::Matrix3d(c.whole.reported.bottomRightCorner<3, 3>());
  }
  const bool used = updated_;
  if (used) {
    out.rotation.mean = c.rotation;
    // From the left, or of a rotation vector, to the local frame.
    const Eigen::Matrix3d J = out.meaning == DirectionMeaning::translation
                                  ? Eigen::Matrix3d(c.rotation.matrix().transpose())
                                  : Eigen::Matrix3d(SO3d::rightJacobian(c.Omega));
    out.rotation.covariance = J * c.rotation_covariance * J.transpose();
    out.mean_inverse_depth = c.evidence / c.evidence_weight;
    out.mean_inverse_depth_variance = c.evidence_variance / (c.evidence_weight * c.evidence_weight);
    out.cost = c.cost, out.innovation = c.innovation, out.inliers = c.inliers;
    const bool free_rotation = !keepsTheRotation(state_) && !frame_.has_gyroscope;
    out.degrees_of_freedom = static_cast<int>(c.inliers) - (free_rotation ? 3 : 0);
  }
  out.sign_evidence = c.evidence_variance > 0 ? c.evidence / std::sqrt(c.evidence_variance) : 0;
  out.flags.undecided_sign = !(out.sign_evidence >= options_.min_sign_evidence);
  out.flags.outliers = used && out.inliers < out.pairs;

  // A rival is another place, not one within the noise of the best.
  out.rival_gap = std::numeric_limits<double>::infinity();
  bool by_chance = false;
  const Eigen::Vector3d V = c.direction.unit_vector();
  for (const DirectionCandidate& other : candidates_) {
    if (&other == &c) continue;
    Eigen::Vector3d direction = other.direction.unit_vector();
    if (direction.dot(V) < 0) direction = -direction;
    const Eigen::Vector2d z = log(c.direction, S2d(direction));
    if (z.norm() > options_.merge_angle && mahalanobisSquared<double, 2>(z, out.direction.covariance) > 9) {
      const double gap = other.score - c.score;
      out.rival_gap = std::min(out.rival_gap, gap);
      by_chance = by_chance || gap < std::max(options_.ambiguous_gap, gapOfChance(other, c));
    }
  }
  out.flags.ambiguous = by_chance;
  const Eigen::Matrix2d& P = out.direction.covariance;
  const double larger = 0.5 * (P(0, 0) + P(1, 1)) + std::hypot(0.5 * (P(0, 0) - P(1, 1)), P(0, 1));
  out.flags.degenerate = out.flags.degenerate || !(larger < options_.degenerate_sigma * options_.degenerate_sigma);

  if (!used || candidates_.size() > 1) return;
  const bool too_many_outliers = 5 * out.inliers < 2 * out.pairs;
  const double innovation = too_many_outliers ? 10 : out.innovation;
  ++innovation_count_;
  innovation_sum_ += (innovation - innovation_sum_) /
                     static_cast<double>(std::min(innovation_count_, std::max<std::size_t>(options_.lost_frames, 1)));
  if (innovation_count_ >= options_.lost_frames && innovation_sum_ > options_.lost_innovation) {
    out.flags.lost = true;
    startAnew();
  }
}

LIESTAT_FUSION_INLINE std::span<const InverseDepth> MotionEngine::inverseDepths() {
  depths_.assign(
      given_, InverseDepth{std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN(), false});
  if (candidates_.empty() || !updated_) return depths_;
  prepareSharedFlows();
  Evaluation e;
  if (!evaluate(candidates_[best_], e)) return depths_;
  Eigen::Matrix3d covariance;
  if (keepsTheRotation(state_)) {
    covariance = candidates_[best_].wide.reported.bottomRightCorner<3, 3>();
  } else {
    covariance = Cholesky<double, 3>(Eigen::Matrix3d(e.sums.M + e.marginal)).inverse();
  }
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const FlowResidual<double> r = flowResidual(points_[i], rows_[i], e.Omega);
    const double inverse = rows_[i].inverse_length;
    const double own = points_[i].variance * inverse * inverse;
    depths_[index_[i]] = {r.rho, own + inverse * inverse * r.tB.dot(r.tB * covariance), rows_[i].weight > 0};
  }
  return depths_;
}

}  // namespace liestat::detail
