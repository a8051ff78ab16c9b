// MotionEngine: its hypotheses: where they start, how they move, and which are dropped.
#pragma once

#include <fusion/motion/detail/motion_engine.hpp>
#include <fusion/motion/search.hpp>
#include <lie/detail/small_orthogonal.hpp>
#include <lie/manifold.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace liestat::detail {

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
  const double q = std::max(options_.process_noise, process_noise_);
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

/// V and -V have the same cost: the sign is a state of its own, told by the depths over several frames.
LIESTAT_FUSION_INLINE void MotionEngine::weighSign(DirectionCandidate& c) const {
  if (!(c.depth_variance > 0) || !std::isfinite(c.depth)) return;
  const double decay = options_.evidence_decay;
  // A sign that holds must be refutable by the frames after it (E. Page, Biometrika 41, 1954): the log likelihood ratio
  // of a reversal, each frame's cut to 3 so that no single one decides.
  if (options_.positive_depth && c.evidence_weight > 0) {
    const double mean = c.evidence / c.evidence_weight;
    c.against -= std::clamp(2 * mean * c.depth / c.depth_variance, -3.0, 3.0);
    if (c.against <= 0) c.against = c.later = c.later_variance = c.later_weight = 0;
    if (c.against > 0) {
      c.later += c.depth / c.depth_variance;
      c.later_variance += 1 / c.depth_variance, c.later_weight += 1 / c.depth_variance;
    }
    // A hypothesis whose rotation is off for some frames, as after a stop, has depths of either sign, and few of them.
    const bool clear = c.later * c.later > reversal_sigmas * reversal_sigmas * c.later_variance;
    if (c.against > reversal_certain && clear) {
      c.evidence = c.later, c.evidence_variance = c.later_variance, c.evidence_weight = c.later_weight;
      c.against = c.later = c.later_variance = c.later_weight = 0;
      c.evidence -= c.depth / c.depth_variance;
      c.evidence_variance -= 1 / c.depth_variance, c.evidence_weight -= 1 / c.depth_variance;
    }
  }
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
  c.behind = std::min(c.behind, 1 - c.behind), c.usually_behind = c.behind;
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
  const double misfit = std::min(candidates_[best_].plane_misfit, 10.0);
  plane_misfit_ += (misfit - plane_misfit_) / static_cast<double>(std::min<std::size_t>(updates_, 10));
}

/// How far the scores of two equally good hypotheses may part: costs at different directions are χ² of different
/// projections of the flow, so their differences are a random walk.
LIESTAT_FUSION_INLINE double MotionEngine::gapOfChance(const DirectionCandidate& c, const DirectionCandidate& best,
                                                       double sigmas) const {
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
  return sigmas * std::sqrt(std::max(variance, 0.0) * static_cast<double>(updates_));
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
  // A hypothesis is dropped for good, and tested in each frame: a level that holds over all of them together.
  const double n = static_cast<double>(updates_), doublings = 1 + std::log2(n);
  const double sigmas = std::max(options_.rival_sigmas, std::sqrt(3 * std::log(1.64 * doublings * doublings / 1e-4)));
  const double nearest = std::cos(options_.merge_angle);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    const double gap = candidates_[i].score - candidates_[0].score;
    if (gap > options_.prune_gap && gap > gapOfChance(candidates_[i], candidates_[0], sigmas)) continue;
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

}  // namespace liestat::detail
