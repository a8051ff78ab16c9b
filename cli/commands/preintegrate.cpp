#include <cli/io/calibration.hpp>
#include <cli/commands/commands.hpp>
#include <cli/io/imu_file.hpp>
#include <cli/commands/imu_options.hpp>
#include <cli/io/input_error.hpp>
#include <cli/io/output_file.hpp>
#include <cli/show/json.hpp>
#include <cli/show/preintegration.hpp>
#include <fusion/imu/preintegrate.hpp>
#include <fusion/imu/factor.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <optional>

namespace liestat::cli {
using namespace experiments;
namespace {

constexpr const char* command_name = "liestat preintegrate";
constexpr double most_windows = 1e6;

struct Options {
  ImuOptions imu;
  std::string calibration, truth, json, report;
  std::optional<double> begin, end, window;
  double gravity = 9.81;
};

/// The growth of the standard deviations from the beginning of the first window with a result.
void followGrowth(PreintegratedReadings& readings, const PreintegrationResult& result, RecordingOptions<double> how) {
  constexpr std::size_t steps = 50;
  const auto first = std::find_if(result.windows.begin(), result.windows.end(),
                                  [](const PreintegratedWindow& w) { return w.result.ok(); });
  if (first == result.windows.end() || !result.with_noise) return;
  readings.growth_begin = first->begin;
  how.preintegration.bias = first->bias;
  for (std::size_t i = 1; i <= steps; ++i) {
    const double duration = first->result.motion.duration() * static_cast<double>(i) / steps;
    const auto part = preintegrate<double>(readings.imu.samples, first->begin, first->begin + duration, how);
    if (part.ok()) readings.growth.push_back(deviationsOf(part.motion));
  }
}

int runCommand(const Options& options, const Invocation& invocation) {
  const ImuFile imu = readImu(options.imu.file);
  RecordingOptions<double> how;
  how.scheme = options.imu.scheme;
  how.max_gap = options.imu.largest_gap;
  ImuNoise<double>& noise = how.preintegration.noise;
  noise = options.imu.noiseOver(options.calibration.empty() ? ImuNoise<double>{} : readImuNoise(options.calibration));
  const bool with_noise = noise.gyroscope > 0 && noise.accelerometer > 0;
  how.preintegration.bias = options.imu.bias();
  std::vector<GroundTruth> truth;
  if (!options.truth.empty()) truth = readGroundTruth(options.truth, imu.start_ns);

  const double begin = options.begin.value_or(imu.samples.front().time);
  const double end = options.end.value_or(imu.samples.back().time);
  if (!(end > begin)) {
    throw InputError(command_name, 0, fmt::format("the interval is from {} to {} s", begin, end),
                     "an end after the beginning");
  }
  const double length = options.window.value_or(end - begin);
  // The last window is a whole one; rounding must not take it away.
  const double fit = (end - begin) / length * (1 + 1e-12);
  if (!(fit >= 1 && fit <= most_windows)) {
    throw InputError(command_name, 0,
                     fmt::format("windows of {} s fit {:.4g} times into {} s", length, fit, end - begin),
                     fmt::format("once to {:g} times", most_windows));
  }
  const auto count = static_cast<std::size_t>(fit);
  const Eigen::Vector3d gravity(0, 0, -options.gravity);
  PreintegrationResult result;
  result.with_noise = with_noise;
  result.with_truth = !truth.empty();
  std::vector<PreintegratedWindow>& windows = result.windows;
  for (std::size_t i = 0; i < count; ++i) {
    PreintegratedWindow w;
    w.begin = begin + static_cast<double>(i) * length;
    const double until = i + 1 == count && !options.window ? end : w.begin + length;
    const auto first = truthAt(truth, w.begin), last = truthAt(truth, until);
    if (!options.imu.hasBias()) how.preintegration.bias = first ? first->bias : ImuBias<double>{};
    w.bias = how.preintegration.bias;
    w.result = preintegrate<double>(imu.samples, w.begin, until, how);
    if (const Fault& fault = w.result.fault; fault && fault.index < imu.samples.size()) {
      w.fault_end = imu.samples[fault.index].time;
      if (fault.index > 0) w.fault_begin = imu.samples[fault.index - 1].time;
    }
    if (w.result.ok() && first && last) {
      w.error =
          preintegrationError<double>(w.result.motion, first->state, last->state, how.preintegration.bias, gravity);
      if (with_noise)
        w.squared_distance = mahalanobisSquared<double, 9>(*w.error, w.result.motion.gaussian().covariance);
    }
    windows.push_back(w);
  }
  if (options.json != "-") {
    printLines(formatPreintegration(result));
  }
  if (!options.json.empty()) {
    JsonObject object = jsonEnvelope(invocation.command_line);
    object.set("file", options.imu.file).set("format", imu.format).set("readings", imu.samples.size());
    object.set("start_ns", imu.start_ns);
    setPreintegration(object, result);
    writeJson(options.json, object);
  }
  if (!options.report.empty()) {
    PreintegratedReadings readings{imu, options.imu.file, begin, end, options.imu.largest_gap, noise};
    followGrowth(readings, result, how);
    writePreintegrationReport(options.report, invocation.command_line, result, readings);
  }
  const bool any =
      std::any_of(windows.begin(), windows.end(), [](const PreintegratedWindow& w) { return w.result.ok(); });
  return any ? exit_fine : exit_not_trusted;
}

}  // namespace

void addPreintegrateCommand(const CommandList& app) {
  auto options = std::make_shared<Options>();
  const Command command = app.add(
      "preintegrate", "Relative motion, covariance and bias derivatives from the readings of an inertial sensor");
  addImuOptions(command, options->imu, " (default 0, or the truth's)");
  command.option("--calibration", options->calibration, "YAML with the densities of noise (EuRoC, Kalibr, OpenVINS)");
  command.option("--begin", options->begin, "s since the first reading, or the file's seconds (default: the first)");
  command.option("--end", options->end, "The same (default: the last)");
  command.option("--window", options->window, "s: one after the other, a line each (default: one, from begin to end)")
      .positive();
  command.option("--truth", options->truth, "EuRoC's ground truth, to compare with; its biases are used");
  command.option("--gravity", options->gravity, "m/s^2, downwards in the truth's world (default 9.81)");
  command.option("--json", options->json, "Write the result to a JSON file ('-': standard output)");
  command.option("--report", options->report, "Write a page with plots into this directory");
  command.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
