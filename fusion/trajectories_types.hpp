// Results and options of fusion/trajectories.hpp. (Needs Boost.Math.)
#pragma once

#include <fusion/noisy_poses.hpp>
#include <fusion/pose_stream.hpp>
#include <lie/se3.hpp>
#include <stats/gaussian.hpp>
#include <stats/whitened_residuals.hpp>
#include <stats/words.hpp>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace liestat {

/// The pose of the reference that belongs to a pose of the estimate: at `fraction` of the way from the reference's pose
/// `reference` to the next one.
struct TimeMatch {
  std::size_t estimate = 0, reference = 0;
  double fraction = 0;
  double gap = 0;  ///< s, between the two stamps of the reference, or to the nearest one
};

/// An estimated pose and the pose of the reference at its time. A reference without covariances has zeros.
struct MatchedPose {
  Gaussian<SE3d> reference, estimate;
};

/// Matched poses in little memory.
struct MatchedPoses {
  NoisyPoses reference, estimate;

  std::size_t size() const { return estimate.size(); }
  void push_back(const MatchedPose& p) { reference.push_back(p.reference), estimate.push_back(p.estimate); }
  MatchedPose operator[](std::size_t i) const { return {reference[i], estimate[i]}; }
  IndexIterator<MatchedPoses> begin() const { return {this, 0}; }
  IndexIterator<MatchedPoses> end() const { return {this, size()}; }
};

/// Matched poses of either kind, or the first of them; it refers to them.
class MatchedRange {
 public:
  MatchedRange(std::span<const MatchedPose> poses) : poses_(poses.data()), size_(poses.size()) {}
  MatchedRange(const std::vector<MatchedPose>& poses) : MatchedRange(std::span<const MatchedPose>(poses)) {}
  MatchedRange(const MatchedPoses& poses) : list_(&poses), size_(poses.size()) {}

  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  const SE3d& reference(std::size_t i) const { return list_ ? list_->reference.mean(i) : poses_[i].reference.mean; }
  const SE3d& estimate(std::size_t i) const { return list_ ? list_->estimate.mean(i) : poses_[i].estimate.mean; }
  MatchedPose operator[](std::size_t i) const { return list_ ? (*list_)[i] : poses_[i]; }
  MatchedRange first(std::size_t n) const {
    MatchedRange some = *this;
    some.size_ = n;
    return some;
  }
  IndexIterator<MatchedRange> begin() const { return {this, 0}; }
  IndexIterator<MatchedRange> end() const { return {this, size_}; }

 private:
  const MatchedPose* poses_ = nullptr;
  const MatchedPoses* list_ = nullptr;
  std::size_t size_ = 0;
};

/// The error of an interpolated reference, root mean squares over all matched poses.
struct InterpolationError {
  double position = 0, rotation = 0;  ///< m, rad
  bool known = true;                  ///< false: the reference has too few stamps to leave some out
  /// The square of the error is known to a factor of four, or may be far too large: the factor of the verdict.
  double factor = 1;
};

/// The transformations that an alignment chooses from.
enum class AlignmentModel {
  none,
  origin,  ///< the first poses are made to agree
  posyaw,  ///< translation and rotation about the vertical z axis
  se3,
  sim3,
  scale  ///< scale of the positions about the origin of the world, alone (evo's -s without -a)
};
constexpr auto words(AlignmentModel) { return std::array{"none", "origin", "posyaw", "se3", "sim3", "scale"}; }

/// A similarity x ↦ s R x + t of the world: a pose (R̂, p̂) becomes (R R̂, s R p̂ + t). `covariance` is of δ = (δt, δφ,
/// δσ) with t ← t + δt, R ← Exp(δφ) R, s ← s exp(δσ), along the world's axes; rows of fixed parameters are zero.
struct Alignment {
  AlignmentModel model = AlignmentModel::none;
  bool ok = false;        ///< false: degenerate, not converged, or a covariance that is not positive definite
  bool weighted = false;  ///< by the covariances; otherwise least squares of positions, or the first pose
  SE3d transform = {};    ///< R and t
  double scale = 1;
  Eigen::Matrix<double, 7, 7> covariance = Eigen::Matrix<double, 7, 7>::Zero();
  int parameters = 0;     ///< that were estimated: 0, 4, 6 or 7, or fewer where components of the errors are left out
  std::size_t poses = 0;  ///< the first poses, from which it was estimated
  int iterations = 0;
  double condition =
      1;  ///< condition of the information matrix, in units of its diagonal; large: a direction is hardly determined
  std::string fault = {};           ///< why it is not ok
  NoiseComponents components = {};  ///< of the errors, that weight it and are to be judged

  SE3d operator()(const SE3d& pose) const {
    return SE3d(transform.so3() * pose.so3(), scale * (transform.so3() * pose.translation()) + transform.translation());
  }
};
template <class V>
void describe(V& v, const Alignment& a) {
  v("model", name(a.model), "none, origin, posyaw, se3, sim3 or scale")("weighted", a.weighted, "by the covariances");
  v("ok", a.ok, "the poses determine it")("scale", a.scale, "of the estimate");
  v("translation", Eigen::Vector3d(a.transform.translation()), "of the world", "m");
  v("quaternion_xyzw", Eigen::Vector4d(a.transform.so3().params()), "of the world");
  v("parameters", a.parameters, "that were estimated")("poses", a.poses, "from which it was estimated");
  v("condition", a.condition, "of the information matrix")("covariance", a.covariance, "", "m, rad, 1");
  v("covariance_order", "translation rotation log_scale, along the world's axes", "in words");
}

/// A pose's error after alignment, in units of the estimate, and what is known about it.
struct PoseError {
  Eigen::Matrix<double, 6, 1> error;  ///< ξ = Log((A T̂)⁻¹ T), its translation divided by the scale
  /// Covariance of the error: of the pose, less what the alignment took from it (poses that were aligned) or with the
  /// alignment's own covariance (others).
  Eigen::Matrix<double, 6, 6> covariance;
  double nees = 0;  ///< of the judged components: χ²₆ of six; NaN where the alignment leaves less than full rank
  double leverage = 0;  ///< share of the alignment's parameters that this pose determines; their sum is their number
};

/// NEES of aligned poses. With n_to_align the poses after those are tested, under the covariance of the alignment that
/// they share.
struct Consistency {
  bool ok = false;
  std::string fault;
  std::size_t n = 0;                ///< poses that were tested
  ResidualTest joint;               ///< exact χ² to first order
  ResidualTest position, rotation;  ///< where all were aligned, χ² scaled to the exact mean and variance, with its dof
  WhitenedResidualTests tests;      ///< of the errors' judged components, whitened jointly where an alignment is shared
  std::vector<PoseError> errors;    ///< errors of all poses, in their order
  std::vector<std::size_t> indefinite;  ///< poses whose covariance is not positive definite
};

/// The number that is made of an error transformation E; evo's names.
enum class PoseRelation {
  full,                        ///< ‖E - I‖ of the 4×4 matrix
  trans_part,                  ///< length of the translation, m
  rot_part,                    ///< ‖R - I‖: not an angle
  angle_deg,                   ///< rotation angle, degrees
  angle_rad,                   ///< rotation angle, rad
  point_distance,              ///< m; in relative errors the difference of lengths
  point_distance_error_ratio,  ///< the same in percent of the reference's length; relative errors only
};
constexpr auto words(PoseRelation) {
  return std::array{
      "full", "trans_part", "rot_part", "angle_deg", "angle_rad", "point_distance", "point_distance_error_ratio"};
}

/// evo's statistics of a list of numbers; the standard deviation divides by n. NaN for an empty list.
struct ErrorStatistics {
  double rmse = detail::not_a_number, mean = rmse, median = rmse, std = rmse, min = rmse, max = rmse, sse = rmse;
};
template <class V>
void describe(V& v, const ErrorStatistics& s) {
  v("rmse", s.rmse)("mean", s.mean)("median", s.median)("std", s.std);
  v("min", s.min)("max", s.max)("sse", s.sse, "sum of squares");
}

/// The unit in which the distance of the poses of a pair is counted.
enum class DeltaUnit { frames, degrees, radians, meters };
constexpr auto words(DeltaUnit) { return std::array{"f", "d", "r", "m"}; }  // evo's

struct RelativeOptions {
  double delta = 1;
  DeltaUnit unit = DeltaUnit::frames;
  double relative_tolerance = 0.1;  ///< tolerance of the distance relative to delta, for all pairs
  bool all_pairs = false;
  bool pairs_from_reference = false;
};

/// The assumption on the errors of a pair of poses. Files have covariances of single poses only, so it cannot be read
/// off.
enum class PairsModel {
  independent,  ///< independent errors: Σ_j + A Σ_i Aᵀ
  chain         ///< dead reckoning, the later error contains the earlier: Σ_j - A Σ_i Aᵀ
};
constexpr auto words(PairsModel) { return std::array{"independent", "chain"}; }

/// NEES of relative motions η = ξ_j - A ξ_i, A = Ad(T̂_rel⁻¹), under a model of the pairs. Pairs must not share a pose
/// unless they are neighbours in a chain.
struct RelativeConsistency {
  ResidualTest joint;
  std::size_t n = 0;
  std::size_t indefinite = 0;  ///< pairs whose covariance under the model is not positive definite
};

}  // namespace liestat
