// How far a model is from its linearisation on the scale of the noise, and what this does to a covariance of first
// order.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace liestat {

/// How far the model is from its linearisation at the estimate, on the scale of the noise. The first two are root mean
/// squares over all directions of second derivatives times the radius of the 95 % region, the relative curvatures of
/// D. Bates and D. Watts, "Relative curvature measures of nonlinearity", 1980. NaN: untested.
struct RelativeCurvature {
  double intrinsic = std::numeric_limits<double>::quiet_NaN();  ///< across the model, whatever its parameters
  double parameter = intrinsic;                                 ///< along it: of the coordinates
  /// The part of the information, along the parameter where it is largest, that is noise of the corrected measurements
  /// along the model. It looks like information and is none: a line whose points spread by their noise alone has 1.
  double noise_share = intrinsic;
  double bias = intrinsic;  ///< second-order bias of the estimate, in standard deviations
  /// A covariance that would be widened by more is believed no longer.
  double max_widening = std::numeric_limits<double>::infinity();

  bool tested() const { return !std::isnan(parameter); }
  /// The curvature under noise that is larger by a factor than stated.
  RelativeCurvature at(double scale) const {
    return {scale * intrinsic, scale * parameter, scale * scale * noise_share, scale * bias, max_widening};
  }
  /// Regions of first order were seen to hold below these bounds, in all kinds of docs/constrained.md.
  bool small() const { return parameter <= 0.13 && intrinsic <= 0.08 && noise_share <= 0.05 && bias <= 0.25; }
  /// Widened regions were seen to hold up to these, and are worth little beyond.
  bool large() const {
    return parameter > 0.8 || intrinsic > 0.6 || noise_share > 0.5 || bias > 0.6 || widening() > max_widening;
  }
  /// Between the two: covariances are widened.
  bool widens() const { return tested() && !small() && !large(); }
  /// The factor of a covariance whose region holds between the two. The edge of the region is off by the relative
  /// curvatures of its radius, or all of it by the bias; the curvature at the truth may be larger than at the estimate,
  /// by a multiple of its square; and what is noise of the information is none.
  double widening() const {
    if (!tested() || small()) return 1;
    // The radius is at least two standard deviations.
    const double edge = std::max(parameter + intrinsic, bias / 2);
    const double radius = (1 + edge + 2 * edge * edge) / (1 - std::min(noise_share, 0.9));
    return radius * radius;
  }
  const char* word() const { return !tested() ? "untested" : small() ? "small" : large() ? "large" : "widened"; }
};

}  // namespace liestat
