#include <formats/calibration.hpp>
#include <cli/commands/commands.hpp>
#include <formats/imu.hpp>
#include <cli/commands/imu_options.hpp>
#include <formats/input_error.hpp>
#include <report/publish.hpp>
#include <cli/show/preintegration.hpp>
#include <fusion/imu/recording_windows.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <vector>

namespace liestat::cli {
namespace {

constexpr const char* command_name = "liestat preintegrate";
constexpr double max_windows = 1e6;

struct Options {
  ImuOptions imu;
  std::string calibration, truth, json, report;
  std::optional<double> begin, end, window;
  double gravity = 9.81, rate = 0;
  std::vector<double> world_rate;
};

int runCommand(const Options& options, const Invocation& invocation) {
  const ImuFile imu = readImu(options.imu.file);
  RecordingWindowOptions how;
  how.integration.scheme = options.imu.scheme;
  how.integration.max_gap = options.imu.largest_gap;
  ImuNoise<double>& noise = how.integration.preintegration.noise;
  noise = options.imu.noiseOver(options.calibration.empty() ? ImuNoise<double>{} : readImuNoise(options.calibration));
  if (options.imu.hasBias()) how.bias = options.imu.bias();
  how.gravity = options.gravity;
  how.integration.preintegration.rate = options.rate;
  if (const std::vector<double>& w = options.world_rate; !w.empty()) how.world_rate = {w[0], w[1], w[2]};
  std::vector<GroundTruth> truth;
  if (!options.truth.empty()) truth = readGroundTruth(options.truth, imu.start_ns);

  const double begin = options.begin.value_or(imu.samples.front().time);
  const double end = options.end.value_or(imu.samples.back().time);
  if (!(end > begin)) {
    throw OptionError(command_name, fmt::format("the interval is from {} to {} s", begin, end),
                      "an end after the beginning");
  }
  const std::vector<TimeInterval> intervals = consecutiveWindows(begin, end, options.window, max_windows);
  if (intervals.empty()) {
    const double length = options.window.value_or(end - begin);
    throw OptionError(
        command_name,
        fmt::format("windows of {} s fit {:.4g} times into {} s", length, (end - begin) / length, end - begin),
        fmt::format("once to {:g} times", max_windows));
  }
  const RecordingWindows result = preintegrateWindows(imu.samples, intervals, truth, how);
  std::string text = formatPreintegration(result);
  for (const std::string& note : imu.notes) text += "note: " + note + "\n";
  publishResult(options.json, text, invocation.command_line, std::nullopt, [&](JsonObject& object) {
    object("file", options.imu.file)("format", imu.format)("readings", imu.samples.size())("start_ns", imu.start_ns);
    object("reading_notes", imu.notes);
    object.fieldsOf(result);
  });
  if (!options.report.empty()) {
    PreintegratedReadings readings{imu, options.imu.file, begin, end, options.imu.largest_gap, noise};
    const auto first = std::find_if(result.windows.begin(), result.windows.end(), [](const auto& w) { return w.ok(); });
    if (first != result.windows.end() && result.with_noise) {
      readings.growth_begin = first->begin;
      readings.growth = growthOfSigmas(imu.samples, *first, how.integration);
    }
    writePreintegrationReport(options.report, invocation.command_line, result, readings);
  }
  return result.usable() ? exit_fine : exit_not_trusted;
}

}  // namespace

void addPreintegrateCommand(const CommandList& app) {
  auto options = std::make_shared<Options>();
  const Command command = app.add(
      "preintegrate", "Relative motion, covariance and bias derivatives from the readings of an inertial sensor");
  addImuOptions(command, options->imu, " (default 0, or the truth's)").required();
  command.option("--calibration", options->calibration, "YAML with the densities of noise (EuRoC, Kalibr, OpenVINS)");
  command.option("--begin", options->begin, "s since the first reading, or the file's seconds (default: the first)");
  command.option("--end", options->end, "The same (default: the last)");
  command.option("--window", options->window, "s: one after the other, a line each (default: one, from begin to end)")
      .positive();
  command.option("--truth", options->truth, "EuRoC's ground truth, to compare with; its biases are used");
  command.option("--gravity", options->gravity, "m/s^2, downwards in the truth's world (default 9.81)");
  command
      .option("--rate", options->rate,
              "Hz, readings per second of the sensor: a reading's variance is density^2 rate (default: measured)")
      .positive();
  command
      .option("--world-rate", options->world_rate,
              "rad/s, x,y,z: rotation of the truth's world in its axes (the Earth's: 7.292e-5; default 0)")
      .list(3, 3);
  command.option("--json", options->json, "Write the result to a JSON file ('-': standard output)");
  command.option("--report", options->report, "Write a page with plots into this directory");
  command.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
