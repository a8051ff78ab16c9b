// The definitions of fusion/imu/window.hpp.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/imu/window.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace liestat {

LIESTAT_FUSION_INLINE InertialWindow::InertialWindow(std::span<const ImuSample<double>> readings,
                                                     std::vector<double> times, const RecordingOptions<double>& how,
                                                     std::vector<FeatureTrack> tracks, std::vector<SE3d> body_T_cameras)
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
  if (!(how_.preintegration.rate > 0)) how_.preintegration.rate = readingRate<double>(readings_, how_.max_gap);
  how_.chained = true;
  fault_ = integrate(how_.preintegration.bias);
}

LIESTAT_FUSION_INLINE bool InertialWindow::isFar(const ImuBias<double>& bias) const {
  return std::any_of(motions_.begin(), motions_.end(),
                     [&](const Preintegration<double>& motion) { return motion.mustReintegrate(bias); });
}

LIESTAT_FUSION_INLINE Fault InertialWindow::integrate(const ImuBias<double>& bias) {
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

LIESTAT_FUSION_INLINE std::vector<BiasedImage> biasedImages(const std::vector<Preintegration<double>>& motions,
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

LIESTAT_FUSION_INLINE ClosedFormWindow closedFormWindow(const InertialWindow& window, const ImuBias<double>& bias) {
  ClosedFormWindow result{{}, window.features, window.cameras};
  for (const BiasedImage& image : biasedImages(window.motions(), bias)) result.images.push_back(image.image);
  return result;
}

}  // namespace liestat
