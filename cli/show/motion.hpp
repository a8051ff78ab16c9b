// The view of `liestat motion`: the motion of each frame, its standard deviations, flags, and errors against a truth.
#pragma once

#include <cli/show/json.hpp>
#include <fusion/motion/types.hpp>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {

/// The motion that is constant over an interval and makes its pose, per frame: dX/dt = Ω × X + V in the camera's axes.
struct TrueMotion {
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  ///< Ω, rad
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< V, m
  /// T of X₂ = R X₁ + T over one frame.
  Eigen::Vector3d translation() const { return SO3d::leftJacobian(rotation) * velocity; }
};

/// The motion from the frame before to this one.
struct MotionFrame {
  std::size_t frame = 0;  ///< as in the file
  MotionEstimate motion;
  bool essential = false;                    ///< the essential filter was in charge
  std::string no_gyroscope;                  ///< why this frame has none, where there is one
  Gaussian<Eigen::Vector3d> gyroscope_bias;  ///< rad/s, in the sensor's axes; where it is a state
  /// Degrees: of the translation's direction and of the rotation, where the truth is known and moves enough.
  std::optional<double> direction_error = {}, rotation_error = {};
  std::optional<TrueMotion> truth = {};  ///< where it is known
};

struct MotionResult {
  std::vector<MotionFrame> frames;
  bool with_gyroscope = false, with_bias = false, with_truth = false;
  std::size_t passes = 1, hand_overs = 0, fall_backs = 0;
  std::size_t frames_apart = 1;  ///< longest interval of a pair
  std::size_t outside = 0;       ///< observations without a ray ahead of the camera
  /// Frames whose direction may be used.
  std::size_t usable() const;
  /// Frames without the gyroscope's rotation, where there is a gyroscope.
  std::size_t withoutGyroscope() const;
};

/// Verdict, a table of at most twenty frames, and the medians of the errors where the truth is known.
std::string formatMotion(const MotionResult& result);

/// A line per frame.
std::string motionCsv(const MotionResult& result);

/// The fields of `--json`.
void setMotion(JsonObject& object, const MotionResult& result);

}  // namespace liestat::cli
