// Confidence regions of means from residuals: by Hotelling's law, or by a bootstrap where the noise is skewed.
// (Needs the standard library alone.)
#pragma once

#include <cstddef>
#include <cstdint>

namespace liestat {

/// The 95 % region of a mean whose covariance is from residuals. Hotelling's law is that of normal noise; it holds for
/// symmetric noise, while of skewed noise the regions of few measurements are too small.
enum class MeanRegion {
  law,       ///< Hotelling's
  bootstrap  ///< bootstrap-t: the covariance is widened until Hotelling's quantile gives a region that holds
};

/// The name used in options and fields.
constexpr const char* name(MeanRegion region) { return region == MeanRegion::bootstrap ? "bootstrap" : "law"; }

/// The draws of MeanRegion::bootstrap. The same measurements and options give the same bits.
struct BootstrapOptions {
  std::size_t draws = 1999;
  std::uint64_t seed = 1;
};

}  // namespace liestat
