// Squared errors of matches under a homography or an epipolar geometry, in units of their noise (Viéville, Lingrand and
// Gaspard 2000, (22) to (24), one step: Sampson's error; for epipolar geometry P. Sampson 1982). Needs Eigen alone.
//
// A match is (x, y, x', y'); ũ' ~ H ũ, ũ'ᵀ F ũ = 0, ũ = (x, y, 1). The points of an image have independent errors of one
// standard deviation in both coordinates.
#pragma once

#include <Eigen/Core>

#include <cstddef>
#include <limits>
#include <span>

namespace liestat {

/// Standard deviations of the coordinates in the first and in the second image, in the unit of the matches.
struct MatchNoise {
  double first = 1, second = 1;
};

/// cᵀ (D V Dᵀ)⁻¹ c, c = (h₃·ũ) u' - (h₁·ũ, h₂·ũ): χ² with two degrees of freedom for an inlier, to first order in the
/// noise. Infinite where the first point is mapped to infinity, or H turns it round.
inline double homographyError(const Eigen::Matrix3d& H, const Eigen::Vector4d& m, const MatchNoise& noise) {
  const double x = m[0], y = m[1], u = m[2], v = m[3];
  const double w = H(2, 0) * x + H(2, 1) * y + H(2, 2);
  const double c0 = w * u - (H(0, 0) * x + H(0, 1) * y + H(0, 2));
  const double c1 = w * v - (H(1, 0) * x + H(1, 1) * y + H(1, 2));
  const double d00 = u * H(2, 0) - H(0, 0), d01 = u * H(2, 1) - H(0, 1);
  const double d10 = v * H(2, 0) - H(1, 0), d11 = v * H(2, 1) - H(1, 1);
  const double v1 = noise.first * noise.first, v2 = noise.second * noise.second * w * w;
  const double s00 = v1 * (d00 * d00 + d01 * d01) + v2, s11 = v1 * (d10 * d10 + d11 * d11) + v2;
  const double s01 = v1 * (d00 * d10 + d01 * d11);
  const double error = (s11 * c0 * c0 - 2 * s01 * c0 * c1 + s00 * c1 * c1) / (s00 * s11 - s01 * s01);
  return w > 0 ? error : (w <= 0 ? std::numeric_limits<double>::infinity() : w);
}

/// (ũ'ᵀ F ũ)²/(D V Dᵀ): χ² with one degree of freedom for an inlier, to first order in the noise. 0 where the match lies
/// on both epipoles.
inline double epipolarError(const Eigen::Matrix3d& F, const Eigen::Vector4d& m, const MatchNoise& noise) {
  const double x = m[0], y = m[1], u = m[2], v = m[3];
  const double a = F(0, 0) * x + F(0, 1) * y + F(0, 2), b = F(1, 0) * x + F(1, 1) * y + F(1, 2);
  const double c = u * a + v * b + F(2, 0) * x + F(2, 1) * y + F(2, 2);
  const double d = F(0, 0) * u + F(1, 0) * v + F(2, 0), e = F(0, 1) * u + F(1, 1) * v + F(2, 1);
  const double S = noise.first * noise.first * (d * d + e * e) + noise.second * noise.second * (a * a + b * b);
  return S > 0 ? c * c / S : c * c;
}

inline void homographyErrors(const Eigen::Matrix3d& H, std::span<const Eigen::Vector4d> matches,
                             const MatchNoise& noise, std::span<double> squared) {
  for (std::size_t i = 0; i < matches.size(); ++i) squared[i] = homographyError(H, matches[i], noise);
}
inline void epipolarErrors(const Eigen::Matrix3d& F, std::span<const Eigen::Vector4d> matches, const MatchNoise& noise,
                           std::span<double> squared) {
  for (std::size_t i = 0; i < matches.size(); ++i) squared[i] = epipolarError(F, matches[i], noise);
}

}  // namespace liestat
