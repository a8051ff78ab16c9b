// Robust estimation of one model of two views: a homography, a fundamental matrix or a calibrated pose, from matches of
// which a part is wrong. Which of several models holds is the business of fusion/two_view/models.hpp.
//
//   const auto found = robustEssential(matches, {sigma / f, sigma / f}, {.seed = 1});
//   if (found.ok()) use(found.pose.mean, found.pose.covariance, found.inliers);
//
// Random minimal samples give hypotheses (stats/robust_search.hpp), whose samples must lie in front of both views; the
// noise is known, so that most wrong ones are given up after a few dozen matches. The best is estimated once more from
// all matches, each with the probability that it is right: normal errors among matches that lie anywhere in the image.
//
// A match is (x, y, x', y'), ũ = (x, y, 1); standard deviations are those of the coordinates in each image, in the unit
// of the matches. Each match counts as a measurement of its own: who has equal ones takes independentMatches()
// (fusion/two_view/contradictions.hpp) before, or the covariance is too small. docs/two_view.md has the figures.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/two_view/errors.hpp>
#include <lie/essential.hpp>
#include <stats/gaussian.hpp>
#include <stats/status.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace liestat {

struct TwoViewRobustOptions {
  /// The search ends when with this probability a sample of right matches alone was drawn. Right matches of the best are
  /// as many as have errors below χ²_{0.999}, less those that do by chance.
  double confidence = 0.9999;
  /// A match is an inlier if its squared error is below this, in units of the noise. 0: χ²_{0.99} of its equations, 9.21
  /// for a homography, 6.63 for an epipolar geometry.
  double threshold = 0;
  std::size_t max_draws = 100000;
  std::uint64_t seed = 1;  ///< the same seed gives the same result
};

/// The part that all three estimates have in common. Statuses:
///   ok              a model that the matches agree on better than by chance
///   too_few         no more matches than a minimal sample has
///   not_applicable  a match that is not finite, or a noise or an option out of range
///   ill_defined     no such model: the samples are degenerate (identical or collinear points, for a pose also no motion
///                   or no translation), or no more matches agree than would by chance
///   not_converged   the matches that agree do not determine the model
struct TwoViewRobustResult {
  Status status = Status::ill_defined;
  std::vector<std::size_t> inliers;  ///< ascending
  double score = 0;                  ///< Σ max(0, 1 - e/threshold) over all matches, e their squared errors
  double chi2 = std::numeric_limits<double>::quiet_NaN();  ///< sum of the squared errors of the inliers
  double confidence = 0;  ///< probability that right matches alone were drawn once; below the option's if draws ran out
  std::size_t draws = 0;

  bool ok() const { return status == Status::ok; }
};

/// ũ' ~ H ũ.
struct RobustHomography : TwoViewRobustResult {
  Eigen::Matrix3d H = Eigen::Matrix3d::Identity();  ///< ‖H‖² = 3; the third coordinate of H ũ is positive
  /// Covariance of the entries of H, column after column; rank 8.
  Eigen::Matrix<double, 9, 9> covariance =
      Eigen::Matrix<double, 9, 9>::Constant(std::numeric_limits<double>::quiet_NaN());
};

/// ũ'ᵀ F ũ = 0.
struct RobustFundamental : TwoViewRobustResult {
  Eigen::Matrix3d F = Eigen::Matrix3d::Zero();  ///< det F = 0, ‖F‖² = 2, of either sign
  /// Covariance of the entries of F, column after column; rank 7.
  Eigen::Matrix<double, 9, 9> covariance =
      Eigen::Matrix<double, 9, 9>::Constant(std::numeric_limits<double>::quiet_NaN());
};

/// ũ'ᵀ [t]× R ũ = 0, |t| = 1; points are taken to the second camera's frame by x' = R x + t.
struct RobustEssential : TwoViewRobustResult {
  /// second_T_first up to scale, with the inliers in front of both views; covariance in its tangent, direction and
  /// rotation (rad).
  Gaussian<Essentiald> pose = {Essentiald(),
                               Eigen::Matrix<double, 5, 5>::Constant(std::numeric_limits<double>::quiet_NaN())};
  Eigen::Matrix3d E = Eigen::Matrix3d::Zero();  ///< [t]× R
};

/// In any coordinates. Matches on the wrong side of the plane's horizon are outliers.
LIESTAT_FUSION_API RobustHomography robustHomography(std::span<const Eigen::Vector4d> matches, const MatchNoise& noise,
                                                     const TwoViewRobustOptions& options = {});
/// In any coordinates. Where all points lie in a plane any of the geometries that agree with its homography may be found:
/// the covariance then says so, in two directions.
LIESTAT_FUSION_API RobustFundamental robustFundamental(std::span<const Eigen::Vector4d> matches,
                                                       const MatchNoise& noise,
                                                       const TwoViewRobustOptions& options = {});
/// In normalised coordinates, u = (p - c)/f. Inliers lie in front of both views.
LIESTAT_FUSION_API RobustEssential robustEssential(std::span<const Eigen::Vector4d> matches, const MatchNoise& noise,
                                                   const TwoViewRobustOptions& options = {});

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/two_view/detail/robust_two_view.hpp>
#endif
