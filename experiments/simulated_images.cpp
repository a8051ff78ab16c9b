#include <experiments/simulated_images.hpp>

#include <stats/random.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <utility>

namespace liestat::experiments {
namespace {

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
    if (!(p.z() > options_.min_depth)) return std::nullopt;
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
  std::vector<State> states_;  // one a track
};

}  // namespace

void addImages(const std::vector<SE3d>& world_T_body, const ViSceneOptions& options, SimulatedRecording& recording) {
  if (world_T_body.size() < 2) {
    throw ImpossibleMotion(fmt::format("there {} at {:g} Hz",
                                       world_T_body.size() == 1 ? "is one image" : "are no images", options.image_rate),
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
  const Eigen::Vector3d least = extent + Eigen::Vector3d::Constant(2 * options.min_depth);
  if (!((recording.box - least).minCoeff() >= 0)) {
    throw ImpossibleMotion(fmt::format("the box of {:g} x {:g} x {:g} m has no room for the motion", recording.box.x(),
                                       recording.box.y(), recording.box.z()),
                           fmt::format("{:.3g} x {:.3g} x {:.3g} m at least", least.x(), least.y(), least.z()));
  }
  Tracker(world_T_cam, options, recording).run();
}

}  // namespace liestat::experiments
