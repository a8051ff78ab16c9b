// A window of a recording: the images of one or several cameras with the readings of the inertial sensor between them.
//
//   liestat::InertialWindow window(readings, times, {.preintegration = {.noise = noise}}, tracks, {body_T_camera});
//   const auto images = liestat::biasedImages(window.motions(), bias);
//
// A window knows its readings, so that every estimator integrates them anew where its biases have gone too far for a
// first-order update. A window made of motions alone has none and updates to first order whatever the change.
//
// The closed form needs C_j and S_j from the first image on. Put together from motions between neighbours they may be
// moved to other biases without integrating anew: a first-order update over a tenth of a second is good to 3e-7 rad for
// 0.01 rad/s, over two seconds it is not (design note on visual-inertial initialisation, 2.2 and 3.6).
#pragma once

#include <fusion/imu/preintegrate.hpp>
#include <fusion/imu/preintegration.hpp>
#include <fusion/init/closed_form_types.hpp>
#include <fusion/status.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace liestat {

/// All that was measured from the first of n images to the last. The working frame is the body's at the first image.
class InertialWindow {
 public:
  std::vector<FeatureTrack> features;    ///< what was seen of each feature, in the axes of its camera
  std::vector<SE3d> cameras = {SE3d()};  ///< body_T_camera of each camera (m)

  /// A window without images.
  InertialWindow() = default;
  /// From motions alone: n - 1 of them, from each image to the next, all integrated with the same bias.
  explicit InertialWindow(std::vector<Preintegration<double>> motions, std::vector<FeatureTrack> tracks = {},
                          std::vector<SE3d> body_T_cameras = {SE3d()})
      : features(std::move(tracks)), cameras(std::move(body_T_cameras)), motions_(std::move(motions)) {}
  /// From readings in the order of time, which may be those of a whole recording (those that the window needs are
  /// copied), and the times of the n images on their clock (s). Readings that do not serve leave a fault().
  InertialWindow(std::span<const ImuSample<double>> readings, std::vector<double> times,
                 const RecordingOptions<double>& how = {}, std::vector<FeatureTrack> tracks = {},
                 std::vector<SE3d> body_T_cameras = {SE3d()})
      : features(std::move(tracks)), cameras(std::move(body_T_cameras)), times_(std::move(times)), how_(how) {
    if (times_.size() < 2) return;
    // The cubic scheme needs one reading more than the interval at each end.
    const auto at = [&](double time) {
      const auto first = std::partition_point(readings.begin(), readings.end(),
                                              [&](const ImuSample<double>& s) { return s.time < time; });
      return static_cast<std::size_t>(first - readings.begin());
    };
    const std::size_t begin = at(times_.front()), end = std::max(begin, at(times_.back()));
    first_reading_ = begin - std::min<std::size_t>(begin, 3);
    const std::span<const ImuSample<double>> used =
        readings.subspan(first_reading_, std::min(end + 3, readings.size()) - first_reading_);
    readings_.assign(used.begin(), used.end());
    fault_ = integrate(how_.preintegration.bias);
  }

  /// From each image to the next, all with bias(); empty where there is a fault.
  const std::vector<Preintegration<double>>& motions() const { return motions_; }
  /// Images.
  std::size_t size() const { return motions_.empty() ? 0 : motions_.size() + 1; }
  /// The biases that the motions were integrated with.
  ImuBias<double> bias() const { return motions_.empty() ? ImuBias<double>{} : motions_.front().options().bias; }
  /// Why there are no motions; its index is that of a reading among those that were given.
  const Fault& fault() const { return fault_; }
  bool hasReadings() const { return !readings_.empty(); }

  /// Whether other biases are so far that a first-order update of a motion will not do.
  bool isFar(const ImuBias<double>& bias) const {
    return std::any_of(motions_.begin(), motions_.end(),
                       [&](const Preintegration<double>& motion) { return motion.mustReintegrate(bias); });
  }
  /// The motions integrated anew with other biases. A window without readings stays as it is, and so does one whose
  /// readings have a fault, which is returned.
  Fault integrate(const ImuBias<double>& bias) {
    if (readings_.empty()) return motions_.empty() ? Fault(FaultKind::not_covered) : Fault();
    RecordingOptions<double> how = how_;
    how.preintegration.bias = bias;
    std::vector<Preintegration<double>> motions;
    for (std::size_t j = 1; j < times_.size(); ++j) {
      const auto step = preintegrate<double>(readings_, times_[j - 1], times_[j], how);
      if (!step.ok()) return {step.fault.kind, step.fault.index + first_reading_};
      motions.push_back(step.motion);
    }
    motions_ = std::move(motions);
    return {};
  }
  /// The same where the biases are far; whether it was done.
  bool integrateIfFar(const ImuBias<double>& bias) { return hasReadings() && isFar(bias) && !integrate(bias); }

  /// The window with the tracks of some features left out; the others keep their places.
  InertialWindow without(std::span<const std::size_t> left_out) const {
    InertialWindow kept = *this;
    for (const std::size_t i : left_out) kept.features[i].clear();
    return kept;
  }

 private:
  std::vector<Preintegration<double>> motions_;
  std::vector<ImuSample<double>> readings_;
  std::vector<double> times_;
  RecordingOptions<double> how_;
  std::size_t first_reading_ = 0;
  Fault fault_;
};

/// One image as the inertial sensor predicts it, with derivatives by the biases: C_j(b + δ) =
/// Exp(rotation_by_gyroscope δ) C_j, and of S_j by both.
struct BiasedImage {
  WindowImage image;
  Eigen::Vector3d speed = Eigen::Vector3d::Zero();  ///< once integrated specific force (m/s)
  Eigen::Matrix3d rotation_by_gyroscope = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d displacement_by_gyroscope = Eigen::Matrix3d::Zero();
};

/// All images for given biases, motions updated to first order. The derivative by the accelerometer's bias is in each
/// WindowImage.
inline std::vector<BiasedImage> biasedImages(const std::vector<Preintegration<double>>& motions,
                                             const ImuBias<double>& bias) {
  using Matrix3 = Eigen::Matrix3d;
  using Vector3 = Eigen::Vector3d;
  std::vector<BiasedImage> images(motions.size() + 1);
  Matrix3 speed_by_gyroscope = Matrix3::Zero(), speed_by_accelerometer = Matrix3::Zero();
  for (std::size_t k = 0; k < motions.size(); ++k) {
    const Preintegration<double>& motion = motions[k];
    const SE23d step = motion.increment(bias);
    const Matrix3 turn = step.so3().matrix();
    // From the library's right tangent (position, rotation, velocity) to the axes of the step's start.
    const Eigen::Matrix<double, 9, 6> by_bias = motion.biasJacobian(bias);
    const auto block = [&](int row, int column) { return Matrix3(turn * by_bias.block<3, 3>(row, column)); };
    const BiasedImage& from = images[k];
    BiasedImage& to = images[k + 1];
    const double t = motion.duration();
    const Matrix3& C = from.image.rotation;
    const Vector3 moved = C * Vector3(step.translation()), gained = C * Vector3(step.velocity());
    to.image.time = from.image.time + t;
    to.image.rotation = C * turn;
    to.image.displacement = from.image.displacement + t * from.speed + moved;
    to.image.displacement_by_bias = from.image.displacement_by_bias + t * speed_by_accelerometer + C * block(0, 3);
    to.rotation_by_gyroscope = from.rotation_by_gyroscope + C * block(3, 0);
    // d(C x) = (A δ)×(C x) where C turns by A δ.
    to.displacement_by_gyroscope = from.displacement_by_gyroscope + t * speed_by_gyroscope + C * block(0, 0) -
                                   detail::skew(moved) * from.rotation_by_gyroscope;
    speed_by_gyroscope += C * block(6, 0) - detail::skew(gained) * from.rotation_by_gyroscope;
    speed_by_accelerometer += C * block(6, 3);
    to.speed = from.speed + gained;
  }
  return images;
}

/// The window of the closed form for given biases.
inline ClosedFormWindow closedFormWindow(const InertialWindow& window, const ImuBias<double>& bias) {
  ClosedFormWindow result{{}, window.features, window.cameras};
  for (const BiasedImage& image : biasedImages(window.motions(), bias)) result.images.push_back(image.image);
  return result;
}
/// The same for the biases that its motions were integrated with.
inline ClosedFormWindow closedFormWindow(const InertialWindow& window) {
  return closedFormWindow(window, window.bias());
}

namespace detail {

/// A bearing of a window as a unit vector in the body's axes.
inline Eigen::Vector3d bearingInBody(const std::vector<SE3d>& cameras, const TrackedBearing& seen) {
  return cameras[seen.camera].so3().matrix() * seen.bearing.normalized();
}

}  // namespace detail

}  // namespace liestat
