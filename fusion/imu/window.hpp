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
// 0.01 rad/s, over two seconds it is not (docs/theory/visual_inertial.md, sections 2.2 and 3.6).
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/imu/preintegrate.hpp>
#include <fusion/imu/preintegration.hpp>
#include <fusion/init/closed_form_types.hpp>
#include <fusion/status.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace liestat {

/// All that was measured from the first of n images to the last. The working frame is the body's at the first image.
class InertialWindow {
 public:
  std::vector<FeatureTrack> features;    ///< observations of each feature, in the axes of its camera
  std::vector<SE3d> cameras = {SE3d()};  ///< body_T_camera of each camera (m)

  /// A window without images.
  InertialWindow() = default;
  /// From motions alone: n - 1 of them, from each image to the next, all integrated with the same bias.
  explicit InertialWindow(std::vector<Preintegration<double>> motions, std::vector<FeatureTrack> tracks = {},
                          std::vector<SE3d> body_T_cameras = {SE3d()})
      : features(std::move(tracks)), cameras(std::move(body_T_cameras)), motions_(std::move(motions)) {}
  /// From readings in the order of time, which may be those of a whole recording (those that the window needs are
  /// copied), and the times of the n images on their clock (s). Readings that do not serve leave a fault().
  LIESTAT_FUSION_API InertialWindow(std::span<const ImuSample<double>> readings, std::vector<double> times,
                                    const RecordingOptions<double>& how = {}, std::vector<FeatureTrack> tracks = {},
                                    std::vector<SE3d> body_T_cameras = {SE3d()});

  /// From each image to the next, all with bias(); empty where there is a fault.
  const std::vector<Preintegration<double>>& motions() const { return motions_; }
  /// Images.
  std::size_t size() const { return motions_.empty() ? 0 : motions_.size() + 1; }
  /// The biases that the motions were integrated with.
  ImuBias<double> bias() const { return motions_.empty() ? ImuBias<double>{} : motions_.front().options().bias; }
  /// Why there are no motions; its index is that of a reading among those that were given.
  const Fault& fault() const { return fault_; }
  bool hasReadings() const { return !readings_.empty(); }

  /// True if other biases are so far that a first-order update of a motion will not do.
  bool isFar(const ImuBias<double>& bias) const;
  /// The motions integrated anew with other biases. A window without readings stays as it is, and so does one whose
  /// readings have a fault, which is returned.
  Fault integrate(const ImuBias<double>& bias);
  /// The same where the biases are far; whether it was done.
  bool integrateIfFar(const ImuBias<double>& bias) { return hasReadings() && isFar(bias) && !integrate(bias); }

  /// The window with readings of another noise; without readings it stays as it is.
  InertialWindow withNoise(const ImuNoise<double>& noise) const {
    InertialWindow other = *this;
    other.how_.preintegration.noise = noise;
    other.integrate(bias());
    return other;
  }
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
LIESTAT_FUSION_API std::vector<BiasedImage> biasedImages(const std::vector<Preintegration<double>>& motions,
                                                         const ImuBias<double>& bias);

/// The window of the closed form for given biases.
LIESTAT_FUSION_API ClosedFormWindow closedFormWindow(const InertialWindow& window, const ImuBias<double>& bias);
/// The same for the biases that its motions were integrated with.
LIESTAT_FUSION_API inline ClosedFormWindow closedFormWindow(const InertialWindow& window) {
  return closedFormWindow(window, window.bias());
}

namespace detail {

/// A bearing of a window as a unit vector in the body's axes.
inline Eigen::Vector3d bearingInBody(const std::vector<SE3d>& cameras, const TrackedBearing& seen) {
  return cameras[seen.camera].so3().matrix() * seen.bearing.normalized();
}

}  // namespace detail

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/imu/detail/inertial_window.hpp>
#endif
