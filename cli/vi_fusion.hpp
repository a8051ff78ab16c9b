#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include <cli/vi_init.hpp>

namespace liestat::cli {

/// What fusing needs of whoever made the windows.
struct ViFusionTools {
  /// A window refined again with the n-th part of the information of the prior of the biases; empty: it failed.
  std::function<std::optional<RefinementResult>(const ViWindow& window, std::size_t n)> refine;
  /// The motion between two times, integrated with a bias.
  std::function<Preintegration<double>(double from, double to, const ImuBias<double>& bias)> motion;
  std::function<bool(double from, double to)> has_readings;
};

/// Disjoint windows that are ok, in stretches of options.stretch seconds, each as one.
std::vector<ViFusion> fuseStretches(const std::vector<ViWindow>& windows, const ViRecording& recording,
                                    const ViInitOptions& options, const ViFusionTools& tools);

}  // namespace liestat::cli
