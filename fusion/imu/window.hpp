// A window of images with the inertial sensor's motion between consecutive ones, as functions of the biases.
//
// The closed form needs C_j and S_j from the first image on. Put together from motions between neighbours they may be
// moved to other biases without integrating anew: a first-order update over a tenth of a second is good to 3e-7 rad for
// 0.01 rad/s, over two seconds it is not (design note on visual-inertial initialisation, 2.2 and 3.6).
#pragma once

#include <fusion/init/closed_form_types.hpp>
#include <fusion/imu/preintegration.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat {

/// What was measured between the first and the last of n images. The working frame is the body's at the first image.
struct InertialWindow {
  std::vector<Preintegration<double>> motions;       ///< n - 1: from each image to the next, all with the same bias
  std::vector<FeatureTrack> features;                ///< bearings in the body's axes at their image
  Eigen::Vector3d camera = Eigen::Vector3d::Zero();  ///< p_c: the camera's centre in the body (m)
};

/// What the inertial sensor says about one image, with derivatives by the biases: C_j(b + δ) = Exp(rotation_by_bias δ)
/// C_j, and of S_j by both.
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
  ClosedFormWindow result{{}, window.features, window.camera};
  for (const BiasedImage& image : biasedImages(window.motions, bias)) result.images.push_back(image.image);
  return result;
}

}  // namespace liestat
