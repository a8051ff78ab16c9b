#include <cli/commands/vi_init_result.hpp>

#include <cli/io/input_error.hpp>
#include <experiments/vi_init_errors.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <span>
#include <utility>

namespace liestat::cli {
namespace {

/// The angle between two directions.
double angleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

/// The NEES of V and G, G on its sphere.
double neesOf(const RefinementResult& refined, const Eigen::Vector3d& V, const Eigen::Vector3d& G) {
  Eigen::Matrix<double, 6, 1> error;
  error << refined.velocity() - V, refined.gravity - G;
  return experiments::neesOnSphere<5>(error, refined.covariance.atFirst(), refined.gravity);
}

void compare(ViWindow& w, const ViRecording& recording, std::optional<double> gravity) {
  if (w.fault) return;
  std::vector<GroundTruth> truth;
  for (const std::size_t j : w.images) {
    const double time = recording.tracks.times[j] + recording.camera.timeshift_cam_imu;
    const std::optional<GroundTruth> at = truthAt(recording.truth, time);
    if (!at) return;
    truth.push_back(*at);
  }
  const SO3d back = SO3d(truth[0].state.so3()).inverse();
  const Eigen::Vector3d V = back * Eigen::Vector3d(truth[0].state.velocity());
  const Eigen::Vector3d G = back * Eigen::Vector3d(0, 0, -gravity.value_or(9.81));
  const auto errorOf = [&](const Eigen::Vector3d& velocity, const Eigen::Vector3d& found,
                           const std::vector<SE23d>& states) {
    double both = 0, own = 0;
    for (std::size_t j = 0; j < states.size(); ++j) {
      const Eigen::Vector3d p = back * Eigen::Vector3d(truth[j].state.translation() - truth[0].state.translation());
      both += p.dot(states[j].translation());
      own += p.squaredNorm();
    }
    return ViError{(velocity - V).norm(), angleBetween(found, G), both / own - 1};
  };
  if (!w.closedForm().solutions.empty()) {
    const ClosedFormSolution& s = w.closedForm().solutions[0];
    w.closed_form_error = errorOf(s.velocity, s.gravity, w.closedFormStates());
  }
  w.gyroscope_error = (w.bias().gyroscope - truth[0].bias.gyroscope).norm();
  if (!w.isRefined()) return;
  w.refined_error = errorOf(w.refined->velocity(), w.refined->gravity, w.refined->states);
  if (gravity && w.closedForm().status != FusionStatus::stationary) w.nees = neesOf(*w.refined, V, G);
}

/// The fields that say what was found.
void setState(ViFusion& stretch) {
  const auto& [down, velocity, gyroscope, resting_force] = stretch.state.mean.parts();
  const auto accelerometer = accelerometerBias(stretch.state, stretch.gravity);
  stretch.down = down.unit_vector();
  stretch.velocity = velocity;
  stretch.gyroscope_bias = gyroscope;
  stretch.accelerometer_bias = accelerometer.mean;
  const auto sigma = [&](int first, int n) {
    return std::sqrt(stretch.state.covariance.diagonal().segment(first, n).mean());
  };
  stretch.down_sigma = sigma(0, 2);
  stretch.velocity_sigma = sigma(2, 3);
  stretch.gyroscope_sigma = sigma(5, 3);
  stretch.accelerometer_sigma = std::sqrt(accelerometer.covariance.diagonal().mean());
}

void compare(ViFusion& stretch, const GroundTruth& truth) {
  const SO3d back = SO3d(truth.state.so3()).inverse();
  const Eigen::Vector3d down = back * Eigen::Vector3d(0, 0, -1);
  const InertialState state(S2d(down), Eigen::Vector3d(back * Eigen::Vector3d(truth.state.velocity())),
                            truth.bias.gyroscope, Eigen::Vector3d(truth.bias.accelerometer - stretch.gravity * down));
  stretch.gravity_error = distance(stretch.state.mean.get<0>(), state.get<0>());
  stretch.speed_error = (stretch.velocity - state.get<1>()).norm();
  stretch.gyroscope_error = (stretch.gyroscope_bias - truth.bias.gyroscope).norm();
  stretch.accelerometer_error = (stretch.accelerometer_bias - truth.bias.accelerometer).norm();
  stretch.nees = mahalanobisSquared(stretch.state, state);
}

}  // namespace

std::size_t ViInitResult::okWindows() const {
  return static_cast<std::size_t>(
      std::count_if(windows.begin(), windows.end(), [](const ViWindow& w) { return w.ok(); }));
}

bool ViInitResult::trusted() const {
  // Stretches without a second window have nothing to contradict.
  const bool fused =
      fusions.empty() || std::any_of(fusions.begin(), fusions.end(), [](const ViFusion& f) { return f.ok(); });
  return windows_left == 0 && okWindows() > 0 && fused;
}

ViInitResult compareWithTruth(VisualInertialResult found, const ViRecording& recording, std::optional<double> gravity) {
  ViInitResult result;
  result.gravity = gravity;
  result.bearing_noise = found.bearing_noise;
  result.images_outside = found.images_outside;
  result.windows_left = found.windows_left;
  for (InitialisedWindow& window : found.windows) {
    ViWindow& w = result.windows.emplace_back();
    static_cast<InitialisedWindow&>(w) = std::move(window);
    compare(w, recording, gravity);
  }
  for (FusedStretch& stretch : found.stretches) {
    ViFusion& f = result.fusions.emplace_back();
    static_cast<FusedStretch&>(f) = std::move(stretch);
    if (!f.has_state) continue;
    setState(f);
    if (const auto truth = truthAt(recording.truth, f.end)) compare(f, *truth);
  }
  return result;
}

void refuseFault(const VisualInertialResult& found, const VisualInertialRecording& measured, std::int64_t start_ns,
                 const VisualInertialOptions& how, const char* command) {
  if (!found.fault) return;
  const std::vector<double>& times = measured.image_times;
  const std::span<const ImuSample<double>> readings = measured.readings;
  if (times.empty() || readings.empty()) {
    throw InputError(command, 0, times.empty() ? "there are no images" : "there are no readings",
                     "a recording of both");
  }
  const double begin = how.begin.value_or(times.front()), end = how.end.value_or(times.back());
  if (found.fault != FaultKind::too_few_images) {
    const double windows = (end - begin) / (how.stride > 0 ? how.stride : how.window);
    throw InputError(command, 0, fmt::format("{:.3g} windows from {:.3f} to {:.3f} s", windows, begin, end),
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
  throw InputError(
      command, 0,
      fmt::format("no window of {} s fits: {} images from {:.{}f} to {:.{}f} s, {} of them outside of the "
                  "readings' {:.{}f} to {:.{}f} s{}",
                  how.window, times.size(), times.front(), decimals, times.back(), decimals, found.images_outside,
                  readings.front().time, decimals, readings.back().time, decimals, suspicion),
      "images that the readings cover, on the same clock");
}

}  // namespace liestat::cli
