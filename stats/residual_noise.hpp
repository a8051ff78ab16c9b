// The meaning of weights for a covariance from residuals. (Needs the standard library alone.)
#pragma once

namespace liestat {

/// The meaning of weights to a covariance from residuals.
enum class ResidualNoise {
  scaled,     ///< precision: Cov(z_i) = Σ/p_i with one unknown Σ: exact small-sample law (Hotelling)
  any,        ///< importance, whatever the noise: by the jackknife, with the degrees of freedom that the weights leave
  frequency,  ///< counts: a feature of weight 3 was measured three times
  precision = scaled,
  importance = any
};

/// The name used in options and fields.
constexpr const char* name(ResidualNoise noise) {
  return noise == ResidualNoise::any ? "importance" : noise == ResidualNoise::frequency ? "frequency" : "precision";
}

}  // namespace liestat
