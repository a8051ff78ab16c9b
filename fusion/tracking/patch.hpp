// A patch of an image found again in others, with the covariance of its place from the two images alone: nobody says what
// noise they have.
//
// The patch is T, 21 × 21 pixels round a whole pixel of the image in which a track begins, and stays the track's template:
// matches do not drift. An image I is fitted by I(p + A x) = g T(x) + b + c : T''(x), least squares over the place p, the
// affine A, gain g, offset b, and c, a difference of blur to second order (that of bilinear interpolation too). Both
// images are smoothed by (1 2 1)/4 in u and v first. With J the 441 × 11 derivatives, H = JᵀJ, and R the correlation that
// the smoothing gives white noise, the noise of both images follows from the residual,
//
//   s² = |r|² / ((κ N − tr H⁻¹JᵀRJ) (v + g²)),    κ = 36/256, v = what interpolation leaves of the image's variance,
//
// and the covariance is the sandwich (S + Λ)⁻¹ (s² M + Λ P Λ) (S + Λ)⁻¹ with M = JᵀRJ, S = H without the share of T's own
// noise, Λ and P the prior of A: that of the image before, widened. The template's noise is common to all matches of a track.
// It is the covariance of the first observation, and no other has it, so the errors of a track's observations are
// independent. Nine blocks of 7 × 7 pixels must agree on the shift: their scores, against what noise would give, see what
// no affine map explains (occlusion, depth, perspective); the covariance is widened by the ratio, or the match refused.
#pragma once

#include <fusion/tracking/images.hpp>

#include <Eigen/Core>

#include <array>
#include <optional>
#include <vector>

namespace liestat {

/// An image smoothed by (1 2 1)/4 in u and v; borders are repeated.
class SmoothImage {
 public:
  /// Takes an image of any size, in the storage of the one before.
  void take(const GreyView& image);
  int width() const { return width_; }
  int height() const { return height_; }
  float operator()(int u, int v) const { return pixels_[static_cast<std::size_t>(v) * width_ + u]; }
  const float* row(int v) const { return pixels_.data() + static_cast<std::size_t>(v) * width_; }

 private:
  int width_ = 0, height_ = 0;
  std::vector<std::uint16_t> columns_;
  std::vector<float> pixels_;
};

/// A patch as another image shows it.
struct PatchMatch {
  Eigen::Vector2d at = Eigen::Vector2d::Zero();                 ///< px: the place of the template's central pixel
  Eigen::Matrix2d affine = Eigen::Matrix2d::Identity();         ///< image offsets of template offsets
  Eigen::Matrix4d affine_covariance = Eigen::Matrix4d::Zero();  ///< of the affine's rows, one after the other
  double gain = 1;
  double noise = 0;   ///< grey values: of a pixel of this image, as taken
  double misfit = 1;  ///< the blocks' disagreement over that of noise; above 1 where it is significant
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();  ///< px², of `at`, without the template's noise
};

/// Why a patch was not found.
enum class PatchFault { none, outside, no_convergence, not_alike, scale, misfit, uncertain };

class Patch {
 public:
  static constexpr int half = 10, side = 2 * half + 1, pixels = side * side, columns = 11;
  /// Pixels that a template needs round its centre: the patch, its derivatives, and the smoothing.
  static constexpr int margin = half + 3;

  /// The template round a pixel at least `margin` from the border; nothing where it has no corner's structure.
  static std::optional<Patch> at(const SmoothImage& image, const Eigen::Vector2i& pixel);

  /// Looks for the patch from a first place (to about a pixel or two) and the match in the image before. `fault` says
  /// why there is none.
  std::optional<PatchMatch> find(const SmoothImage& image, const Eigen::Vector2d& near, const PatchMatch& before,
                                 PatchFault& fault);

  /// Covariance of the first observation, px²: the template's noise, by the matches so far.
  Eigen::Matrix2d templateCovariance() const;
  const Eigen::Vector2i& pixel() const { return pixel_; }

 private:
  using Design = Eigen::Matrix<float, pixels, columns>;
  using Normal = Eigen::Matrix<double, columns, columns>;

  double slopesWithoutNoise(double variance) const;
  double slopeRatio(const Eigen::Matrix<float, pixels, 1>& values, double gain) const;

  Eigen::Vector2i pixel_ = Eigen::Vector2i::Zero();
  Design design_;
  Normal normal_, noise_;                        // H, M
  double fitted_ = 0;                            // tr H⁻¹ M
  double correlation_ = 0;                       // of neighbours in the smoothed slopes
  std::array<Eigen::Matrix2d, 9> block_weight_;  // of the blocks' scores
  double block_mean_ = 0, block_freedom_ = 0;    // of their weighted square under unit noise
  double variance_sum_ = 0, variance_count_ = 0, misfit_ = 1;
};

}  // namespace liestat
