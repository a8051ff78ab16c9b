#include <experiments/simulate_vi.hpp>

#include <experiments/simulated_images.hpp>
#include <stats/random.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace liestat::experiments {
namespace {

/// The nearest time that a file can say: whole nanoseconds.
double rounded(double seconds) { return 1e-9 * static_cast<double>(std::llround(1e9 * seconds)); }

void checkInterval(double begin, double end, double first, double last) {
  // Not by less than a nanosecond: times in files are rounded.
  if (begin >= first - 1e-9 && end <= last + 1e-9 && begin < end) return;
  throw ImpossibleMotion(fmt::format("the interval is from {:.10g} to {:.10g} s", begin, end),
                         fmt::format("one within {:.10g} to {:.10g} s", first, last));
}

SE3d poseOf(const SE23d& state) { return SE3d(state.so3(), state.translation()); }

}  // namespace

ImuNoise<double> scaled(const ImuNoise<double>& noise, double factor) {
  return {.gyroscope = factor * noise.gyroscope,
          .accelerometer = factor * noise.accelerometer,
          .gyroscope_walk = factor * noise.gyroscope_walk,
          .accelerometer_walk = factor * noise.accelerometer_walk};
}

ImuBias<double> calibratedBias(std::uint64_t seed) {
  CounterRng rng(seed, 1);
  ImuBias<double> bias;
  bias.gyroscope = 0.01 * rng.normalVector<3>();
  bias.accelerometer = 0.05 * rng.normalVector<3>();
  return bias;
}

SplineTrajectory builtInTrajectory(double duration, std::uint64_t seed) {
  struct Wave {
    Eigen::Vector3d amplitude;
    double rate, phase;
  };
  CounterRng rng(seed, 0, motion_stream);
  // Sines whose second (or first) derivatives have this RMS on each axis in the mean.
  const auto waves = [&](int count, double rms, double highest, int derivatives) {
    std::vector<Wave> list;
    for (int i = 0; i < count; ++i) {
      const double rate = 2 * EIGEN_PI * (0.2 + (highest - 0.2) * rng.uniform());
      const double phase = 2 * EIGEN_PI * rng.uniform();
      list.push_back({rms * std::sqrt(2.0 / count) / std::pow(rate, derivatives) * rng.normalVector<3>(), rate, phase});
    }
    return list;
  };
  const std::vector<Wave> moves = waves(4, 1.5, 1, 2), turns = waves(3, 0.5, 0.8, 1);
  const auto sum = [](const std::vector<Wave>& list, double t) {
    Eigen::Vector3d total = Eigen::Vector3d::Zero();
    for (const Wave& w : list) total += w.amplitude * std::sin(w.rate * t + w.phase);
    return total;
  };
  constexpr double spacing = 0.05, turning = 0.2;
  const double first = -2 * spacing;
  std::vector<SE3d> poses;
  for (double t = first; t < duration + 4 * spacing; t = first + spacing * static_cast<double>(poses.size())) {
    const SO3d heading = SO3d::exp(turning * t * Eigen::Vector3d::UnitZ());
    poses.emplace_back(heading * SO3d::exp(sum(turns, t)), sum(moves, t));
  }
  return SplineTrajectory(first, spacing, std::move(poses));
}

SplineTrajectory trajectoryAlong(const std::vector<GroundTruth>& truth, double spacing) {
  const double first = truth.front().time, duration = truth.back().time - first;
  const double fit = duration / spacing * (1 + 1e-12);
  if (!(fit >= SplineTrajectory::degree && fit < 1e7)) {
    throw ImpossibleMotion(
        fmt::format("the truth is {:.6g} s long", duration),
        fmt::format("{:g} s at least, for control points every {:g} s", spacing * SplineTrajectory::degree, spacing));
  }
  std::vector<SE3d> poses;
  for (std::size_t i = 0; i <= static_cast<std::size_t>(fit); ++i) {
    const double time = std::min(first + spacing * static_cast<double>(i), truth.back().time);
    const auto at = truthAt(truth, time);
    if (!at) {
      throw ImpossibleMotion(fmt::format("there is a gap of more than 0.1 s around {:.6g} s", time - first),
                             "the truth without gaps");
    }
    poses.push_back(poseOf(at->state));
  }
  return SplineTrajectory(first, spacing, std::move(poses));
}

SimulatedRecording simulateMotion(const SplineTrajectory& motion, double begin, double end,
                                  const CameraCalibration& camera, const SyntheticImuOptions& imu,
                                  const ViSceneOptions& scene) {
  checkInterval(begin, end, motion.begin(), motion.end());
  const double step = 1 / imu.rate;
  SimulatedRecording recording;
  recording.camera = camera;
  recording.noise = imu.noise;

  CounterRng rng(scene.seed, 0, imu_stream);
  std::vector<ImuBias<double>> biases;
  ImuBias<double> bias = imu.bias;
  const auto add = [&](Eigen::Vector3d& v, double deviation) { v += deviation * rng.normalVector<3>(); };
  for (std::size_t k = 0; begin + step * static_cast<double>(k) <= end + 1e-9; ++k) {
    if (k > 0) {
      add(bias.gyroscope, imu.noise.gyroscope_walk * std::sqrt(step));
      add(bias.accelerometer, imu.noise.accelerometer_walk * std::sqrt(step));
    }
    const double time = rounded(begin + step * static_cast<double>(k));
    const Kinematics at = motion.at(time);
    ImuSample<double> reading{
        time, at.angular_rate + bias.gyroscope,
        at.world_R_body.inverse() * Eigen::Vector3d(at.acceleration - imu.gravity) + bias.accelerometer};
    add(reading.angular_rate, imu.noise.gyroscope / std::sqrt(step));
    add(reading.specific_force, imu.noise.accelerometer / std::sqrt(step));
    recording.imu.push_back(reading);
    biases.push_back(bias);
  }

  // The image that ends a window needs a reading on either side.
  std::vector<SE3d> poses;
  for (std::size_t j = 0;; ++j) {
    const double time = rounded(begin + step + static_cast<double>(j) / scene.image_rate);
    if (recording.imu.size() < 3 || time > recording.imu[recording.imu.size() - 2].time + 1e-9) break;
    const Kinematics at = motion.at(time);
    recording.image_times.push_back(time);
    poses.emplace_back(at.world_R_body, at.position);
  }

  std::vector<double> times = recording.image_times;
  for (const ImuSample<double>& reading : recording.imu) times.push_back(reading.time);
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  std::size_t k = 0;
  for (const double time : times) {
    while (k + 2 < recording.imu.size() && recording.imu[k + 1].time <= time) ++k;
    const Kinematics at = motion.at(time);
    GroundTruth row{.time = time, .state = SE23d(at.world_R_body, at.position, at.velocity), .bias = biases[k]};
    if (k + 1 < biases.size()) {
      const double s = (time - recording.imu[k].time) / (recording.imu[k + 1].time - recording.imu[k].time);
      row.bias.gyroscope += s * (biases[k + 1].gyroscope - biases[k].gyroscope);
      row.bias.accelerometer += s * (biases[k + 1].accelerometer - biases[k].accelerometer);
    }
    recording.truth.push_back(row);
  }
  addImages(poses, scene, recording);
  return recording;
}

SimulatedRecording simulateImages(const std::vector<ImuSample<double>>& imu, const std::vector<GroundTruth>& truth,
                                  double begin, double end, const CameraCalibration& camera,
                                  const ViSceneOptions& scene) {
  const double first = std::max(imu.front().time, truth.front().time);
  const double last = std::min(imu.back().time, truth.back().time);
  if (!(first < last)) {
    throw ImpossibleMotion(
        fmt::format("the truth is from {:.10g} to {:.10g} s of the readings' time, which end at {:.10g} s",
                    truth.front().time, truth.back().time, imu.back().time),
        "files of one recording");
  }
  checkInterval(begin, end, first, last);
  SimulatedRecording recording;
  recording.camera = camera;

  const auto before = [](const auto& row, double time) { return row.time < time; };
  const auto within = [&](const auto& list, double from, double to) {
    const auto head = std::lower_bound(list.begin(), list.end(), from, before);
    return std::pair(head, std::lower_bound(head, list.end(), to + 1e-9, before));
  };
  // A reading more on either side: images at the very ends need both neighbours.
  auto [head, tail] = within(imu, begin, end);
  if (head != imu.begin()) --head;
  if (tail != imu.end()) ++tail;
  recording.imu.assign(head, tail);
  const auto rows = within(truth, begin - 1e-9, end);
  recording.truth.assign(rows.first, rows.second);

  std::vector<SE3d> poses;
  const double step = 1 / scene.image_rate;
  std::size_t row = 0, used = recording.truth.size();
  for (std::size_t j = 0; !recording.truth.empty(); ++j) {
    const double wanted = begin + step * static_cast<double>(j);
    if (wanted > end + 1e-9) break;
    const auto off = [&](std::size_t i) { return std::abs(recording.truth[i].time - wanted); };
    while (row + 1 < recording.truth.size() && off(row + 1) <= off(row)) ++row;
    // None in a gap of the truth.
    if (row == used || off(row) > 0.5 * step) continue;
    used = row;
    recording.image_times.push_back(recording.truth[row].time);
    poses.push_back(poseOf(recording.truth[row].state));
  }
  addImages(poses, scene, recording);
  return recording;
}

}  // namespace liestat::experiments
