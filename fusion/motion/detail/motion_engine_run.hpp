// Definitions of fusion/motion/detail/motion_engine.hpp: what comes in and goes out with a frame.
#pragma once

#include <fusion/motion/detail/motion_engine.hpp>
#include <fusion/motion/detail/motion_engine_hypotheses.hpp>
#include <fusion/motion/detail/motion_engine_standstill.hpp>
#include <fusion/motion/detail/motion_engine_update.hpp>
#include <fusion/motion/detail/motion_statistics.hpp>
#include <lie/manifold.hpp>

#include <algorithm>
#include <cassert>
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
  was_still_ = false;
  fit_count_ = gyroscope_count_ = 0, gyroscope_chi_ = 0;
  gyroscope_pull_.setZero(), gyroscope_weight_.setZero();
  usual_signal_ = still_sum_ = still_dof_ = outlier_share_ = 0, moving_frames_ = 0;
  updated_ = false;
  estimate_ = MotionEstimate{};
  estimate_.meaning = options_.flow == Flow::discrete ? DirectionMeaning::translation : DirectionMeaning::velocity;
}

LIESTAT_FUSION_INLINE void MotionEngine::start(const DirectionCandidate& candidate) {
  candidates_.assign(1, candidate);
  fit_count_ = fit_since_start_ = way_count_ = 0, process_noise_ = 0;
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
    // Far beyond any image squares of coordinates in units of their sigma overflow.
    const double largest = std::max(p.first.cwiseAbs().maxCoeff(), p.second.cwiseAbs().maxCoeff());
    const double sum = p.first.sum() + p.second.sum() + p.sigma + p.frames;
    if (!std::isfinite(sum) || !(p.sigma > 1e-12) || !(p.frames > 0) || !(largest < max_coordinate)) continue;
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
  assert(consistent());
  return estimate_;
}

/// The invariant of what goes from frame to frame: finite, and covariances with positive diagonals. Debug builds check
/// it after each frame.
LIESTAT_FUSION_INLINE bool MotionEngine::consistent() const {
  const auto isCovariance = [](const auto& P) { return P.allFinite() && P.diagonal().minCoeff() > 0; };
  const auto areCovariances = [&](const auto& P) { return isCovariance(P.gain) && isCovariance(P.reported); };
  for (const DirectionCandidate& c : candidates_) {
    const bool numbers = c.direction.unit_vector().allFinite() && c.rotation.params().allFinite() &&
                         c.bias.allFinite() &&
                         std::isfinite(c.score + c.evidence + c.evidence_variance + c.evidence_weight);
    const bool good = state_ == MotionState::direction           ? areCovariances(c.narrow)
                      : state_ == MotionState::rotation_and_bias ? areCovariances(c.whole) && areCovariances(c.wide)
                                                                 : areCovariances(c.wide);
    if (!numbers || !good) return false;
  }
  return std::isfinite(usual_signal_ + still_sum_ + still_dof_ + outlier_share_ + innovation_sum_) &&
         linear_moments_.allFinite() && linear_noise_.allFinite();
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
  const bool many_behind = used && std::max(c.behind, c.usually_behind) > largest_share_behind;
  out.flags.undecided_sign =
      !(out.sign_evidence >= options_.min_sign_evidence) || c.against > reversal_likely || many_behind;
  out.flags.outliers = used && out.inliers < out.pairs;

  // A rival is another place, not one within the noise of the best.
  out.rival_gap = std::numeric_limits<double>::infinity();
  bool by_chance = false;
  // The two solutions of a plane are equally good for ever: their gap has as many occasions to exceed a bound as
  // frames.
  const bool plane = plane_misfit_ < largest_plane_misfit;
  const double sigmas = plane ? std::max(options_.rival_sigmas, plane_rival_sigmas) : options_.rival_sigmas;
  const Eigen::Vector3d V = c.direction.unit_vector();
  for (const DirectionCandidate& other : candidates_) {
    if (&other == &c) continue;
    Eigen::Vector3d direction = other.direction.unit_vector();
    if (direction.dot(V) < 0) direction = -direction;
    const Eigen::Vector2d z = log(c.direction, S2d(direction));
    if (z.norm() > options_.merge_angle && mahalanobisSquared<double, 2>(z, out.direction.covariance) > 9) {
      const double gap = other.score - c.score;
      out.rival_gap = std::min(out.rival_gap, gap);
      by_chance = by_chance || gap < std::max(options_.ambiguous_gap, gapOfChance(other, c, sigmas));
    }
  }
  out.flags.ambiguous = by_chance;
  const Eigen::Matrix2d& P = out.direction.covariance;
  const double larger = 0.5 * (P(0, 0) + P(1, 1)) + std::hypot(0.5 * (P(0, 0) - P(1, 1)), P(0, 1));
  out.flags.degenerate = out.flags.degenerate || !(larger < options_.degenerate_sigma * options_.degenerate_sigma);

  judgeFit();
  judgeGyroscope();
  followProcessNoise();
  if (!used || candidates_.size() > 1) return;
  outlier_share_ += 0.02 * (1 - static_cast<double>(out.inliers) / static_cast<double>(out.pairs) - outlier_share_);
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

/// χ² of the last frames together, and the direction's own score, against the stated noise. Frames before a restart
/// count until those after it fit by themselves.
LIESTAT_FUSION_INLINE void MotionEngine::judgeFit() {
  if (updated_) {
    const DirectionCandidate& c = candidates_[best_];
    const double degrees = std::max(estimate_.degrees_of_freedom, 1);
    const bool too_many_outliers = 5 * c.inliers < 2 * pairs_.size();
    fits_[fit_next_] = {too_many_outliers ? 10 * degrees : c.innovation * degrees, degrees, c.direction_score};
    fit_next_ = (fit_next_ + 1) % fit_frames;
    fit_count_ = std::min(fit_count_ + 1, fit_frames), ++fit_since_start_;
  }
  const auto last = [&](std::size_t k) -> const FrameFit& { return fits_[(fit_next_ + fit_frames - k) % fit_frames]; };
  const auto refuted = [&](std::size_t frames) {
    FrameFit sum;
    for (std::size_t k = 1; k <= frames; ++k) sum.chi_squared += last(k).chi_squared, sum.degrees += last(k).degrees;
    return frames > 0 && !(sum.chi_squared <= chiSquaredBound(sum.degrees, 4));
  };
  if (fit_since_start_ >= options_.first_pruning && fit_since_start_ < fit_count_ && !refuted(fit_since_start_)) {
    fit_count_ = fit_since_start_;
  }
  double score = 0;
  for (std::size_t k = 1; k <= std::min(fit_count_, score_frames); ++k) score += last(k).direction_score;
  const bool pulled = fit_count_ >= score_frames && score > 12 * static_cast<double>(score_frames);
  estimate_.flags.misfit = refuted(fit_count_) || pulled;
}

/// The gyroscope against the images: the mean χ² of its differences, and the mean difference itself.
LIESTAT_FUSION_INLINE void MotionEngine::judgeGyroscope() {
  const DirectionCandidate& c = candidates_[best_];
  if (updated_ && frame_.has_gyroscope && c.gyroscope_information(0, 0) > 0) {
    const Eigen::Vector3d pull = c.gyroscope_information * c.from_gyroscope;
    const double chi = std::min(c.from_gyroscope.dot(pull), 100.0);
    const auto n = static_cast<double>(std::min(++gyroscope_count_, gyroscope_frames));
    const double keep = 1 - 1 / static_cast<double>(gyroscope_frames);
    gyroscope_chi_ += (chi - gyroscope_chi_) / n;
    gyroscope_pull_ = keep * gyroscope_pull_ + pull;
    gyroscope_weight_ = keep * keep * gyroscope_weight_ + c.gyroscope_information;
  }
  if (gyroscope_count_ < 5) return;
  const auto n = static_cast<double>(std::min(gyroscope_count_, gyroscope_frames));
  const double mean = gyroscope_pull_.dot(Cholesky<double, 3>(gyroscope_weight_).solve<1>(gyroscope_pull_));
  estimate_.flags.gyroscope_refuted = gyroscope_chi_ > 3 + 6 * std::sqrt(6 / n) || mean > 40;
}

/// A direction that has gone further than its covariances and the process noise allow needs more process noise. (Among
/// outliers it may have followed those.)
LIESTAT_FUSION_INLINE void MotionEngine::followProcessNoise() {
  process_noise_ *= 0.9;
  if (!updated_ || options_.outliers) return;
  // Pairs that overlap have common errors, and those of a direction that a gyroscope determines are slow ones: they go
  // further by chance, and while hypotheses compete the best one's way is mostly that.
  const bool overlap = std::any_of(pairs_.begin(), pairs_.end(), [](const PointPair& p) { return p.frames > 1; });
  if (candidates_.size() > 1 && (overlap || frame_.has_gyroscope)) return;
  const DirectionCandidate& c = candidates_[best_];
  const Eigen::Vector3d V = c.direction.unit_vector();
  const Place& before = way_[(updates_way_ + way_frames - 1) % way_frames];
  if (way_count_ > 0 && (way_start_ != c.start || before.direction.dot(V) < 0)) way_count_ = 0;
  way_start_ = c.start;
  noise_so_far_ += std::max(options_.process_noise, process_noise_);
  const Place now{V, estimate_.direction.covariance, noise_so_far_};
  for (const std::size_t n : {std::size_t{4}, std::size_t{10}, std::size_t{22}}) {
    if (n > way_count_) break;
    const Place& then = way_[(updates_way_ + way_frames - n) % way_frames];
    const S2d from(then.direction);
    const Eigen::Vector2d out = log(from, c.direction), back = log(c.direction, from);
    const double squared = out.squaredNorm();
    if (!(squared > 0)) continue;
    const double expected = std::max((out.dot(then.covariance * out) - back.dot(now.covariance * back)) / squared, 0.0);
    if (squared > (overlap || frame_.has_gyroscope ? 9 : 4) * (expected + now.noise - then.noise)) {
      const double needed = 2 * (squared - expected) / (2 * static_cast<double>(n));
      process_noise_ = std::min(std::max(process_noise_, needed), options_.max_process_noise);
    }
  }
  way_[updates_way_ % way_frames] = now;
  ++updates_way_;
  way_count_ = std::min(way_count_ + 1, way_frames - 1);
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
