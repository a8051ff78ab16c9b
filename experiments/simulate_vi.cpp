#include <experiments/simulate_vi.hpp>

#include <stats/random.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include <cli/io/input_error.hpp>
#include <cli/show/json.hpp>
#include <cli/io/output_file.hpp>

namespace liestat::experiments {
using namespace cli;
namespace {

constexpr const char* command_name = "liestat simulate vi";

/// The uses of random numbers. Each has its own stream, so that more of one leaves the others as they are.
enum Stream : std::uint32_t { landmark_stream, choice_stream, pixel_stream, outlier_stream, imu_stream, motion_stream };

std::int64_t nanoseconds(double seconds) { return std::llround(1e9 * seconds); }
/// The nearest time that a file can say.
double rounded(double seconds) { return 1e-9 * static_cast<double>(nanoseconds(seconds)); }

[[noreturn]] void complain(const std::string& found, const std::string& expected) {
  throw InputError(command_name, 0, found, expected);
}

void checkInterval(double begin, double end, double first, double last) {
  // Not by less than a nanosecond: times in files are rounded.
  if (begin >= first - 1e-9 && end <= last + 1e-9 && begin < end) return;
  complain(fmt::format("the interval is from {:.10g} to {:.10g} s", begin, end),
           fmt::format("one within {:.10g} to {:.10g} s", first, last));
}

/// Follows landmarks from image to image.
class Tracker {
 public:
  Tracker(const std::vector<SE3d>& world_T_cam, const ViSceneOptions& options, SimulatedRecording& recording)
      : poses_(world_T_cam), options_(options), recording_(recording), camera_(recording.camera.camera) {
    drawLandmarks();
  }

  void run() {
    std::vector<std::size_t> active;  // tracks
    for (std::size_t image = 0; image < poses_.size(); ++image) {
      std::vector<std::size_t> lasting;
      for (const std::size_t track : active) {
        if (observe(image, track)) {
          lasting.push_back(track);
        } else {
          is_tracked_[states_[track].landmark] = false;
        }
      }
      active = std::move(lasting);
      lookAhead(image);
      takeUp(image, active);
    }
  }

 private:
  struct State {
    std::size_t landmark;
    Eigen::Vector2d drift;
    CounterRng noise, walk;
  };

  void drawLandmarks() {
    CounterRng rng(options_.seed, 0, landmark_stream);
    const Eigen::Vector3d& box = recording_.box;
    const Eigen::Vector3d area(box.y() * box.z(), box.x() * box.z(), box.x() * box.y());
    for (std::size_t i = 0; i < options_.landmarks; ++i) {
      // Two faces at right angles to each axis.
      const double place = rng.uniform() * area.sum();
      const int axis = place < area[0] ? 0 : place < area[0] + area[1] ? 1 : 2;
      Eigen::Vector3d p;
      for (int k = 0; k < 3; ++k) p[k] = box[k] * (rng.uniform() - 0.5);
      p[axis] = std::copysign(0.5 * box[axis], p[axis]);
      landmarks_.emplace_back(recording_.box_centre + p);
    }
    is_tracked_.assign(landmarks_.size(), false);
    seen_in_a_row_.assign(landmarks_.size(), 0);
  }

  std::optional<Eigen::Vector2d> pixelOf(const SE3d& cam_T_world, const Eigen::Vector3d& landmark) const {
    const Eigen::Vector3d p = cam_T_world * landmark;
    if (!(p.z() > options_.least_depth)) return std::nullopt;
    const auto pixel = camera_.project(p);
    return pixel && camera_.sees(*pixel) ? pixel : std::nullopt;
  }

  /// Looks at the images up to shortest_track from this one, each once: a landmark that is seen in so many in a row up
  /// to the last of them will last.
  void lookAhead(std::size_t image) {
    for (; looked_at_ < std::min(image + shortest(), poses_.size()); ++looked_at_) {
      const SE3d cam_T_world = poses_[looked_at_].inverse();
      for (std::size_t i = 0; i < landmarks_.size(); ++i)
        seen_in_a_row_[i] = pixelOf(cam_T_world, landmarks_[i]) ? seen_in_a_row_[i] + 1 : 0;
    }
  }
  std::size_t shortest() const { return std::clamp<std::size_t>(options_.shortest_track, 1, poses_.size()); }

  /// Fills the tracks of an image up with landmarks drawn from those that last.
  void takeUp(std::size_t image, std::vector<std::size_t>& active) {
    if (image + shortest() > poses_.size()) return;
    std::vector<std::size_t> candidates;
    for (std::size_t i = 0; i < landmarks_.size(); ++i) {
      if (!is_tracked_[i] && seen_in_a_row_[i] >= shortest()) candidates.push_back(i);
    }
    CounterRng rng(options_.seed, image, choice_stream);
    for (std::size_t next = 0; next < candidates.size() && active.size() < options_.features; ++next) {
      const double left = static_cast<double>(candidates.size() - next);
      std::swap(candidates[next], candidates[next + static_cast<std::size_t>(rng.uniform() * left)]);
      const std::size_t landmark = candidates[next], track = states_.size();
      CounterRng walk(options_.seed, track, outlier_stream);
      const bool outlier = walk.uniform() < options_.outliers;
      recording_.tracks.push_back({.landmark = landmarks_[landmark], .outlier = outlier});
      states_.push_back({landmark, Eigen::Vector2d::Zero(), CounterRng(options_.seed, track, pixel_stream), walk});
      is_tracked_[landmark] = observe(image, track);
      if (is_tracked_[landmark]) active.push_back(track);
    }
  }

  /// False where the track is lost.
  bool observe(std::size_t image, std::size_t track) {
    State& state = states_[track];
    SimulatedTrack& shown = recording_.tracks[track];
    auto pixel = pixelOf(poses_[image].inverse(), shown.landmark);
    if (!pixel) return false;
    if (shown.outlier) {
      if (shown.images > 0) state.drift += options_.drift * state.walk.normalVector<2>();
      *pixel += state.drift;
      if (!camera_.sees(*pixel)) return false;
    }
    ++shown.images;
    *pixel += options_.pixel_noise * state.noise.normalVector<2>();
    recording_.observations.push_back({image, track, pixel->x(), pixel->y(), 0});
    return true;
  }

  const std::vector<SE3d>& poses_;
  const ViSceneOptions& options_;
  SimulatedRecording& recording_;
  const Camera& camera_;
  std::vector<Eigen::Vector3d> landmarks_;
  std::vector<bool> is_tracked_;
  std::vector<std::size_t> seen_in_a_row_;  // up to the last image looked at
  std::size_t looked_at_ = 0;
  std::vector<State> states_;  // of the tracks
};

/// Images at image_times from these poses of the body.
void addImages(const std::vector<SE3d>& world_T_body, const ViSceneOptions& options, SimulatedRecording& recording) {
  if (world_T_body.size() < 2) {
    complain(fmt::format("there {} at {:g} Hz", world_T_body.size() == 1 ? "is one image" : "are no images",
                         options.image_rate),
             "two at least");
  }
  Camera& camera = recording.camera.camera;
  if (camera.width <= 0 || camera.height <= 0) {
    camera.width = std::max(1, static_cast<int>(std::lround(std::clamp(2 * camera.cu, 1.0, 1e6))));
    camera.height = std::max(1, static_cast<int>(std::lround(std::clamp(2 * camera.cv, 1.0, 1e6))));
  }
  std::vector<SE3d> world_T_cam;
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const SE3d& pose : world_T_body) {
    world_T_cam.push_back(pose * recording.camera.imu_T_cam);
    low = low.cwiseMin(world_T_cam.back().translation());
    high = high.cwiseMax(world_T_cam.back().translation());
  }
  const Eigen::Vector3d extent = high - low;
  recording.box_centre = 0.5 * (low + high);
  recording.box = options.box.value_or(Eigen::Vector3d(10, 10, 4).cwiseMax(extent + Eigen::Vector3d::Constant(2)));
  const Eigen::Vector3d least = extent + Eigen::Vector3d::Constant(2 * options.least_depth);
  if (!((recording.box - least).minCoeff() >= 0)) {
    complain(fmt::format("the box of {:g} x {:g} x {:g} m has no room for the motion", recording.box.x(),
                         recording.box.y(), recording.box.z()),
             fmt::format("{:.3g} x {:.3g} x {:.3g} m at least", least.x(), least.y(), least.z()));
  }
  Tracker(world_T_cam, options, recording).run();
}

/// Kalibr's chain of one camera, and its sensor.
std::string calibrationText(const SimulatedRecording& recording) {
  const Camera& camera = recording.camera.camera;
  std::string text = "%YAML:1.0\n\ncam0:\n  T_imu_cam: # takes the camera's coordinates to the IMU's\n";
  const Eigen::Matrix4d T = recording.camera.imu_T_cam.matrix();
  for (int i = 0; i < 4; ++i) text += fmt::format("    - [{}, {}, {}, {}]\n", T(i, 0), T(i, 1), T(i, 2), T(i, 3));
  const Eigen::Vector4d& c = camera.coefficients;
  const char* models[] = {"none", "radtan", "equidistant"};
  text += "  camera_model: pinhole\n";
  text += fmt::format("  distortion_model: {}\n", models[static_cast<int>(camera.distortion)]);
  text += fmt::format("  distortion_coeffs: [{}, {}, {}, {}]\n", c[0], c[1], c[2], c[3]);
  text += fmt::format("  intrinsics: [{}, {}, {}, {}] # fu, fv, cu, cv\n", camera.fu, camera.fv, camera.cu, camera.cv);
  text += fmt::format("  resolution: [{}, {}]\n", camera.width, camera.height);
  text += fmt::format("  timeshift_cam_imu: {} # t_imu = t_cam + this\n", recording.camera.timeshift_cam_imu);
  if (!recording.noise) return text;
  const ImuNoise<double>& noise = *recording.noise;
  text += fmt::format("\nimu0:\n  gyroscope_noise_density: {}\n  gyroscope_random_walk: {}\n", noise.gyroscope,
                      noise.gyroscope_walk);
  text += fmt::format("  accelerometer_noise_density: {}\n  accelerometer_random_walk: {}\n", noise.accelerometer,
                      noise.accelerometer_walk);
  return text;
}

SE3d poseOf(const SE23d& state) { return SE3d(state.so3(), state.translation()); }

}  // namespace

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

SplineTrajectory trajectoryAlong(const std::vector<GroundTruth>& truth, double spacing, const std::string& file) {
  const double first = truth.front().time, duration = truth.back().time - first;
  const double fit = duration / spacing * (1 + 1e-12);
  if (!(fit >= SplineTrajectory::degree && fit < 1e7)) {
    throw InputError(
        file, 0, fmt::format("the truth is {:.6g} s long", duration),
        fmt::format("{:g} s at least, for control points every {:g} s", spacing * SplineTrajectory::degree, spacing));
  }
  std::vector<SE3d> poses;
  for (std::size_t i = 0; i <= static_cast<std::size_t>(fit); ++i) {
    const double time = std::min(first + spacing * static_cast<double>(i), truth.back().time);
    const auto at = truthAt(truth, time);
    if (!at) {
      throw InputError(file, 0, fmt::format("there is a gap of more than 0.1 s around {:.6g} s", time - first),
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

SimulatedRecording simulateImages(const ImuFile& imu, const std::vector<GroundTruth>& truth, double begin, double end,
                                  const CameraCalibration& camera, const ViSceneOptions& scene) {
  const double first = std::max(imu.samples.front().time, truth.front().time);
  const double last = std::min(imu.samples.back().time, truth.back().time);
  if (!(first < last)) {
    complain(fmt::format("the truth is from {:.10g} to {:.10g} s of the readings' time, which end at {:.10g} s",
                         truth.front().time, truth.back().time, imu.samples.back().time),
             "files of one recording");
  }
  checkInterval(begin, end, first, last);
  SimulatedRecording recording;
  recording.start_ns = imu.start_ns;
  recording.camera = camera;

  const auto before = [](const auto& row, double time) { return row.time < time; };
  const auto within = [&](const auto& list, double from, double to) {
    const auto head = std::lower_bound(list.begin(), list.end(), from, before);
    return std::pair(head, std::lower_bound(head, list.end(), to + 1e-9, before));
  };
  // A reading more on either side: images at the very ends need both neighbours.
  auto [head, tail] = within(imu.samples, begin, end);
  if (head != imu.samples.begin()) --head;
  if (tail != imu.samples.end()) ++tail;
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

void writeRecording(const SimulatedRecording& recording, const std::string& directory) {
  createDirectory(directory);
  const auto write = [&](const char* name, const std::string& text) { writeOutput(directory + "/" + name, text); };
  const auto stamp = [&](double time) { return recording.start_ns + nanoseconds(time); };
  std::string text;
  const auto append = [&](const Eigen::Vector3d& v) {
    fmt::format_to(std::back_inserter(text), ",{},{},{}", v.x(), v.y(), v.z());
  };

  text =
      "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m "
      "s^-2],a_RS_S_z [m s^-2]\n";
  for (const ImuSample<double>& reading : recording.imu) {
    fmt::format_to(std::back_inserter(text), "{}", stamp(reading.time));
    append(reading.angular_rate), append(reading.specific_force);
    text += '\n';
  }
  write("imu.csv", text);

  text = "#timestamp [ns],filename\n";
  for (const double time : recording.image_times) {
    const std::int64_t on_camera = stamp(time - recording.camera.timeshift_cam_imu);
    fmt::format_to(std::back_inserter(text), "{0},{0}.png\n", on_camera);
  }
  write("images.csv", text);

  text = "frame,track,u,v\n";
  for (const PixelObservation& o : recording.observations)
    fmt::format_to(std::back_inserter(text), "{},{},{},{}\n", o.image, o.track, o.u, o.v);
  write("tracks.csv", text);

  text =
      "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v_RS_R_x [m "
      "s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1], b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad "
      "s^-1], b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], b_a_RS_S_z [m s^-2]\n";
  for (const GroundTruth& row : recording.truth) {
    fmt::format_to(std::back_inserter(text), "{}", stamp(row.time));
    append(row.state.translation());
    const Eigen::Vector4d q = row.state.so3().params();
    fmt::format_to(std::back_inserter(text), ",{},{},{},{}", q[3], q[0], q[1], q[2]);
    append(row.state.velocity()), append(row.bias.gyroscope), append(row.bias.accelerometer);
    text += '\n';
  }
  write("truth.csv", text);

  text = "track,x,y,z,outlier\n";
  for (std::size_t i = 0; i < recording.tracks.size(); ++i) {
    fmt::format_to(std::back_inserter(text), "{}", i);
    append(recording.tracks[i].landmark);
    text += recording.tracks[i].outlier ? ",1\n" : ",0\n";
  }
  write("landmarks.csv", text);
  write("calibration.yaml", calibrationText(recording));
}

std::string nextCommand(const std::string& directory) {
  const std::vector<std::string> words = {"liestat",       "vi-init",
                                          "--imu",         directory + "/imu.csv",
                                          "--tracks",      directory + "/tracks.csv",
                                          "--image-times", directory + "/images.csv",
                                          "--calibration", directory + "/calibration.yaml",
                                          "--truth",       directory + "/truth.csv"};
  std::vector<const char*> pointers;
  for (const std::string& word : words) pointers.push_back(word.c_str());
  return commandLine(static_cast<int>(pointers.size()), pointers.data());
}

}  // namespace liestat::experiments
