#include <experiments/motion_recording.hpp>

#include <lie/units.hpp>
#include <stats/random.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

namespace liestat::experiments {
namespace {

/// Follows the points of a scene under the names that they have in a file.
class TrackNames {
 public:
  explicit TrackNames(const Camera& camera) : camera_(camera) {}

  /// The pairs from the frame before `frame` to it.
  void add(const MotionScene& scene, std::size_t frame, std::vector<MotionRecording::Observation>& out) {
    std::map<std::size_t, std::size_t> going_on;
    for (std::size_t i = 0; i < scene.pairs.size(); ++i) {
      const auto known = names_.find(scene.pair_tracks[i]);
      const bool is_new = known == names_.end();
      const std::size_t name = is_new ? next_++ : known->second;
      if (is_new) out.push_back(seen(frame - 1, name, scene.pairs[i].first, true));
      out.push_back(seen(frame, name, scene.pairs[i].second, scene.inlier[i]));
      if (scene.inlier[i]) going_on.emplace(scene.pair_tracks[i], name);
    }
    names_ = std::move(going_on);
  }

 private:
  MotionRecording::Observation seen(std::size_t frame, std::size_t name, const Eigen::Vector2d& at, bool inlier) const {
    return {frame, name, camera_.fu * at.x() + camera_.cu, camera_.fv * at.y() + camera_.cv, inlier};
  }

  const Camera& camera_;
  std::map<std::size_t, std::size_t> names_;  ///< by the scene's, of the tracks that the last frame saw
  std::size_t next_ = 0;
};

/// The motion of one interval, s seconds long.
struct Interval {
  Eigen::Vector3d rotation, velocity;  ///< velocities of the points, per second

  SE3d after(double s) const {
    const Eigen::Vector3d turned = s * rotation;
    return SE3d(SO3d::exp(turned), Eigen::Vector3d(SO3d::leftJacobian(turned) * (s * velocity)));
  }
};

}  // namespace

MotionRecording recordMotion(const MotionRecordingOptions& options) {
  MotionRecording recording;
  const MotionSceneOptions& scene_options = options.scene;
  const double dt = 1 / options.frame_rate, f = scene_options.focal_length, width = scene_options.width;
  recording.camera = defaultCamera();
  recording.camera.camera = {.fu = f, .fv = f, .cu = 0.5 * width, .cv = 0.5 * width};
  recording.camera.camera.width = recording.camera.camera.height = static_cast<int>(std::lround(width));
  recording.camera.imu_T_cam = SE3d(recording.camera.imu_T_cam.so3(), Eigen::Vector3d(Eigen::Vector3d::Zero()));
  const SO3d imu_R_camera = recording.camera.imu_T_cam.so3();
  const double sigma = scene_options.gyroscope_sigma * units::degree;
  recording.noise = adis16448;
  recording.noise.gyroscope = sigma / std::sqrt(dt);
  recording.noise.gyroscope_walk = 0;

  MotionScene scene(scene_options, options.seed, options.trial);
  TrackNames names(recording.camera.camera);
  std::vector<Interval> intervals;
  // The camera looks along the world's x axis at first, with z upwards.
  recording.frames.push_back({0, SE3d(imu_R_camera.inverse(), Eigen::Vector3d(Eigen::Vector3d::Zero())), {}, {}});
  for (std::size_t k = 1; k < options.frames; ++k) {
    scene.advance();
    names.add(scene, k, recording.observations);
    intervals.push_back({scene.rotation / dt, scene.velocity / dt});
    const SE3d pose = intervals.back().after(dt) * recording.frames.back().camera_T_world;
    recording.frames.push_back({static_cast<double>(k) * dt, pose, {}, {}});
  }
  std::sort(recording.observations.begin(), recording.observations.end(),
            [](const auto& a, const auto& b) { return std::tie(a.frame, a.track) < std::tie(b.frame, b.track); });

  // The rate of the sensor, which turns against the points; at a frame the mean of both sides.
  const auto rateAt = [&](double time) {
    const double at = time / dt, nearest = std::round(at);
    const auto interval = [&](double i) {
      const double last = static_cast<double>(intervals.size()) - 1;
      return static_cast<std::size_t>(std::clamp(i, 0.0, last));
    };
    Eigen::Vector3d points;
    if (std::abs(at - nearest) < 1e-6) {
      points = 0.5 * (intervals[interval(nearest - 1)].rotation + intervals[interval(nearest)].rotation);
    } else {
      points = intervals[interval(std::floor(at))].rotation;
    }
    return Eigen::Vector3d(-(imu_R_camera.matrix() * points));
  };
  CounterRng rates(options.seed, options.trial, 4), readings(options.seed, options.trial, 5);
  for (MotionRecording::Frame& frame : recording.frames) {
    frame.true_rate = rateAt(frame.time);
    const Eigen::Vector3d unit = rates.normalVector<3>();
    frame.rate = frame.true_rate + options.gyroscope_bias + std::sqrt(2.0) * sigma / dt * unit;
  }
  const double end = recording.frames.back().time, step = 1 / options.imu_rate;
  const double rate_sigma = recording.noise.gyroscope * std::sqrt(options.imu_rate);
  const double force_sigma = recording.noise.accelerometer * std::sqrt(options.imu_rate);
  const Eigen::Vector3d gravity(0, 0, -9.81);
  for (std::int64_t j = -1; static_cast<double>(j - 1) * step < end + 1e-9; ++j) {
    const double time = static_cast<double>(j) * step;
    const auto k =
        static_cast<std::size_t>(std::clamp(std::floor(time / dt), 0.0, static_cast<double>(intervals.size()) - 1));
    const Interval& interval = intervals[k];
    const SO3d camera_R_world =
        interval.after(time - static_cast<double>(k) * dt).so3() * recording.frames[k].camera_T_world.so3();
    const Eigen::Vector3d acceleration = interval.rotation.cross(interval.velocity);
    const Eigen::Vector3d force = acceleration - camera_R_world * gravity;
    const Eigen::Vector3d rate_noise = readings.normalVector<3>(), force_noise = readings.normalVector<3>();
    ImuSample<double> sample;
    sample.time = time;
    sample.angular_rate = rateAt(time) + options.gyroscope_bias + rate_sigma * rate_noise;
    sample.specific_force = imu_R_camera * force + force_sigma * force_noise;
    recording.imu.push_back(sample);
  }
  return recording;
}

}  // namespace liestat::experiments
