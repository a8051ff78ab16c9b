#include <cli/commands/vi_init_result.hpp>

#include <formats/input_error.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <span>

namespace liestat::cli {
void refuseFault(const VisualInertialResult& found, const VisualInertialRecording& measured, std::int64_t start_ns,
                 const VisualInertialOptions& how, const char* command) {
  if (!found.fault) return;
  const std::vector<double>& times = measured.image_times;
  const std::span<const ImuSample<double>> readings = measured.readings;
  if (times.empty() || readings.empty()) {
    throw OptionError(command, times.empty() ? "there are no images" : "there are no readings", "a recording of both");
  }
  const double begin = how.begin.value_or(times.front()), end = how.end.value_or(times.back());
  if (found.fault != FaultKind::too_few_images) {
    const double windows = (end - begin) / (how.stride > 0 ? how.stride : how.window);
    throw OptionError(command, fmt::format("{:.3g} windows from {:.3f} to {:.3f} s", windows, begin, end),
                      fmt::format("at most {}", how.max_windows));
  }
  const double images_last = times.back() - times.front(), readings_last = readings.back().time - readings.front().time;
  // As many decimals as tell the ends apart.
  const double apart = std::max(std::min(images_last, readings_last), 1e-9);
  const int decimals = std::clamp(2 - static_cast<int>(std::floor(std::log10(apart))), 3, 9);
  // The clocks themselves tell more than how long they ran, if they count from 1970.
  std::string suspicion = suspectedUnit(start_ns, times.front());
  const double ratio = images_last / readings_last;
  // A thousand apart, as µs and ns are, or ms and µs.
  const bool unit = (ratio > 300 && ratio < 3000) || (1 / ratio > 300 && 1 / ratio < 3000);
  if (suspicion.empty() && unit) suspicion = "; does one clock count in µs where the other counts in ns?";
  throw OptionError(
      command,
      fmt::format("no window of {} s fits: {} images from {:.{}f} to {:.{}f} s, {} of them outside of the "
                  "readings' {:.{}f} to {:.{}f} s{}",
                  how.window, times.size(), times.front(), decimals, times.back(), decimals, found.images_outside,
                  readings.front().time, decimals, readings.back().time, decimals, suspicion),
      "images that the readings cover, on the same clock");
}

}  // namespace liestat::cli
