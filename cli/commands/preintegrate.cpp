#include <cli/io/calibration.hpp>
#include <cli/commands/commands.hpp>
#include <cli/io/imu_file.hpp>
#include <cli/commands/imu_options.hpp>
#include <cli/io/input_error.hpp>
#include <cli/show/json.hpp>
#include <experiments/summary.hpp>
#include <cli/show/table.hpp>
#include <fusion/imu/preintegrate.hpp>
#include <fusion/imu/factor.hpp>

#include <CLI/App.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
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
  std::string calibration, truth, json;
  std::optional<double> begin, end, window;
  double gravity = 9.81;
};

/// One interval, and how far it is from the truth where that is known.
struct Window {
  double begin = 0;
  RecordingResult<double> result;
  std::optional<Eigen::Matrix<double, 9, 1>> error;  ///< position, rotation, velocity
  double squared_distance = 0;                       ///< of the error under the covariance
};

std::string statusOf(const Fault& fault) {
  switch (fault.kind) {
    case FaultKind::none:
      return "ok";
    case FaultKind::bad_interval:
      return "bad interval";
    case FaultKind::not_covered:
      return "not covered";
    case FaultKind::not_ascending:
      return "times not ascending";
    case FaultKind::not_finite:
      return "not finite";
    case FaultKind::gap:
      return "gap";
    default:
      break;
  }
  return "unknown";
}

Eigen::Vector3d deviations(const Window& w, int block) {
  return w.result.motion.gaussian().covariance.diagonal().segment<3>(3 * block).cwiseSqrt();
}
double largest(const Eigen::Vector3d& v) { return v.maxCoeff(); }

JsonObject toJson(const Window& w, bool with_noise) {
  JsonObject o;
  o.set("begin", w.begin).set("status", statusOf(w.result.fault)).set("duration", w.result.motion.duration());
  o.set("largest_gap", w.result.max_gap);
  if (!w.result.ok()) return o;
  const SE23d& x = w.result.motion.increment();
  o.set("quaternion_xyzw", Eigen::Vector4d(x.so3().params())).set("rotation_vector", Eigen::Vector3d(x.so3().log()));
  o.set("position", Eigen::Vector3d(x.translation())).set("velocity", Eigen::Vector3d(x.velocity()));
  if (with_noise) {
    o.set("covariance", w.result.motion.gaussian().covariance);
  } else {
    o.set("covariance", nullptr);
  }
  o.set("bias_jacobian", w.result.motion.biasJacobian());
  if (w.error) {
    o.set("error", *w.error);
    if (with_noise) o.set("squared_distance", w.squared_distance);
  }
  return o;
}

void print(const std::vector<Window>& windows, bool with_noise, bool with_truth) {
  std::vector<std::string> headers = {"begin s", "duration", "turn deg", "velocity m/s", "position m"};
  if (with_noise) headers.insert(headers.end(), {"sd turn deg", "sd velocity", "sd position"});
  if (with_truth) headers.insert(headers.end(), {"error deg", "error m/s", "error m"});
  Table table(headers);
  const double degrees = 180 / EIGEN_PI;
  for (const Window& w : windows) {
    const SE23d& x = w.result.motion.increment();
    if (!w.result.ok()) {
      table.row({number(w.begin), statusOf(w.result.fault)});
      continue;
    }
    std::vector<std::string> cells = {number(w.begin), number(w.result.motion.duration()),
                                      number(degrees * x.so3().log().norm()), number(x.velocity().norm()),
                                      number(x.translation().norm())};
    if (with_noise) {
      for (const double sd :
           {degrees * largest(deviations(w, 1)), largest(deviations(w, 2)), largest(deviations(w, 0))}) {
        cells.push_back(number(sd, 3));
      }
    }
    if (with_truth && w.error) {
      for (const double e :
           {degrees * w.error->segment<3>(3).norm(), w.error->tail<3>().norm(), w.error->head<3>().norm()})
        cells.push_back(number(e, 3));
    }
    table.row(cells);
  }
  std::fputs(table.str().c_str(), stdout);
}

void printSummary(const std::vector<Window>& windows, bool with_noise) {
  std::vector<double> rotation, velocity, position;
  double index = 0;
  for (const Window& w : windows) {
    if (!w.error) continue;
    rotation.push_back(w.error->segment<3>(3).norm());
    velocity.push_back(w.error->tail<3>().norm());
    position.push_back(w.error->head<3>().norm());
    index += w.squared_distance;
  }
  if (rotation.empty()) return;
  std::fputs(fmt::format("\nagainst the truth, {} windows: medians {:.3g} rad, {:.3g} m/s, {:.3g} m\n", rotation.size(),
                         quantile(rotation, 0.5), quantile(velocity, 0.5), quantile(position, 0.5))
                 .c_str(),
             stdout);
  if (!with_noise) return;
  const double mean = index / static_cast<double>(rotation.size());
  std::fputs(fmt::format("squared distance under the covariance: {:.4g} in the mean, 9 expected\n", mean).c_str(),
             stdout);
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
  std::vector<Window> windows;
  for (std::size_t i = 0; i < count; ++i) {
    Window w;
    w.begin = begin + static_cast<double>(i) * length;
    const double until = i + 1 == count && !options.window ? end : w.begin + length;
    const auto first = truthAt(truth, w.begin), last = truthAt(truth, until);
    if (!options.imu.hasBias()) how.preintegration.bias = first ? first->bias : ImuBias<double>{};
    w.result = preintegrate<double>(imu.samples, w.begin, until, how);
    if (w.result.ok() && first && last) {
      w.error =
          preintegrationError<double>(w.result.motion, first->state, last->state, how.preintegration.bias, gravity);
      if (with_noise)
        w.squared_distance = mahalanobisSquared<double, 9>(*w.error, w.result.motion.gaussian().covariance);
    }
    windows.push_back(w);
  }
  if (options.json != "-") {
    print(windows, with_noise, !truth.empty());
    printSummary(windows, with_noise);
  }
  if (!options.json.empty()) {
    JsonObject object = jsonEnvelope(invocation.command_line);
    object.set("file", options.imu.file).set("format", imu.format).set("readings", imu.samples.size());
    object.set("start_ns", imu.start_ns);
    object.set("covariance_order", "position rotation velocity").set("covariance_side", "right");
    object.set("covariance_frame", "axes of the body at the end of the window, m rad m/s");
    std::vector<JsonObject> list;
    for (const Window& w : windows) list.push_back(toJson(w, with_noise));
    object.set("windows", list);
    writeJson(options.json, object);
  }
  const bool any = std::any_of(windows.begin(), windows.end(), [](const Window& w) { return w.result.ok(); });
  return any ? exit_fine : exit_not_trusted;
}

}  // namespace

void addPreintegrateCommand(CLI::App& app, Invocation& invocation) {
  auto options = std::make_shared<Options>();
  CLI::App* command = addCommand(
      app, "preintegrate", "Relative motion, covariance and bias derivatives from the readings of an inertial sensor");
  addImuOptions(*command, options->imu, " (default 0, or the truth's)");
  command->add_option("--calibration", options->calibration,
                      "YAML with the densities of noise (EuRoC, Kalibr, OpenVINS)");
  command->add_option("--begin", options->begin,
                      "s since the first reading, or the file's seconds (default: the first)");
  command->add_option("--end", options->end, "The same (default: the last)");
  command
      ->add_option("--window", options->window, "s: one after the other, a line each (default: one, from begin to end)")
      ->check(CLI::PositiveNumber);
  command->add_option("--truth", options->truth, "EuRoC's ground truth, to compare with; its biases are used");
  command->add_option("--gravity", options->gravity, "m/s^2, downwards in the truth's world (default 9.81)");
  command->add_option("--json", options->json, "Write the result to a JSON file ('-': standard output)");
  command->callback(
      [options, &invocation] { invocation.run = [options, &invocation] { return runCommand(*options, invocation); }; });
}

}  // namespace liestat::cli
