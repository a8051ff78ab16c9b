// The motion of a camera through a sequence of frames: what estimateMotion() (fusion/motion/sequence.hpp) gives, with
// its verdict, and the errors against a truth.
#pragma once

#include <fusion/motion/plan.hpp>
#include <fusion/motion/types.hpp>
#include <lie/units.hpp>
#include <stats/shown.hpp>
#include <stats/verdict.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace liestat {

/// The word for what a direction is that of.
constexpr const char* inWords(DirectionMeaning meaning) {
  return meaning == DirectionMeaning::velocity ? "velocity" : "translation";
}

/// The flags of an estimate by name.
inline constexpr std::array<std::pair<const char*, bool MotionFlags::*>, 10> motion_flags{{
    {"bad_input", &MotionFlags::bad_input},
    {"too_few", &MotionFlags::too_few},
    {"standstill", &MotionFlags::standstill},
    {"degenerate", &MotionFlags::degenerate},
    {"ambiguous", &MotionFlags::ambiguous},
    {"undecided_sign", &MotionFlags::undecided_sign},
    {"lost", &MotionFlags::lost},
    {"misfit", &MotionFlags::misfit},
    {"gyroscope_refuted", &MotionFlags::gyroscope_refuted},
    {"outliers", &MotionFlags::outliers},
}};

/// The motion that is constant over an interval and makes its pose, per frame: dX/dt = Ω × X + V in the camera's axes.
struct TrueMotion {
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  ///< Ω, rad
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< V, m
  /// T of X₂ = R X₁ + T over one frame.
  Eigen::Vector3d translation() const { return SO3d::leftJacobian(rotation) * velocity; }
};

/// The motion from the frame before to this one.
struct MotionFrame {
  std::size_t frame = 0;  ///< its number
  /// Quantities of one frame. A direction that is one of a translation is that over the interval of the pairs.
  MotionEstimate motion;
  bool essential = false;          ///< the essential filter was in charge
  bool covariance_judged = false;  ///< the covariance claims to bound the error; not in later passes over the same data
  std::string no_gyroscope = {};   ///< why this frame has none, where there is one
  /// rad/s, in the sensor's axes, measured minus true; where it is a state.
  std::optional<Gaussian<Eigen::Vector3d>> gyroscope_bias = {};
  bool with_truth = false;  ///< the sequence is compared with a truth: these are then given, where they are known
  std::optional<double> direction_error = {};  ///< rad; where the camera moves enough
  std::optional<double> rotation_error = {};   ///< rad per frame
  std::optional<TrueMotion> truth = {};

  /// The larger standard deviation of the direction, rad.
  double direction_sigma() const {
    const Eigen::Matrix2d& P = motion.direction.covariance;
    const double half = 0.5 * (P(0, 0) + P(1, 1)), difference = 0.5 * (P(0, 0) - P(1, 1));
    return std::sqrt(half + std::hypot(difference, P(0, 1)));
  }
  /// The largest of the standard deviations of the rotation's components, rad per frame.
  double rotation_sigma() const { return std::sqrt(motion.rotation.covariance.diagonal().maxCoeff()); }
  /// The names of the flags that are raised; no_gyroscope is one of them.
  std::vector<std::string> flags() const {
    std::vector<std::string> names;
    for (const auto& [name, flag] : motion_flags) {
      if (motion.flags.*flag) names.emplace_back(name);
    }
    if (!no_gyroscope.empty()) names.emplace_back("no_gyroscope");
    return names;
  }
};

/// The motions of a sequence, or a fault of the options.
struct MotionResult {
  MotionFault fault = MotionFault::none;  ///< with one there are no frames
  std::size_t first_frame = 0;            ///< the number of the one before the first motion
  std::vector<MotionFrame> frames;
  bool with_gyroscope = false, with_bias = false, with_truth = false;
  std::size_t passes = 1, hand_overs = 0, fall_backs = 0;
  std::size_t frames_apart = 1;  ///< longest interval of a pair
  std::size_t outside = 0;       ///< observations without a ray ahead of the camera, which took no part
  MotionFilterOptions settings;  ///< those that the filter ran with

  /// Frames whose direction may be used.
  std::size_t usable() const {
    return static_cast<std::size_t>(
        std::count_if(frames.begin(), frames.end(), [](const MotionFrame& frame) { return frame.motion.ok(); }));
  }
  /// Frames without the gyroscope's rotation, where there is a gyroscope.
  std::size_t withoutGyroscope() const {
    return static_cast<std::size_t>(std::count_if(
        frames.begin(), frames.end(), [](const MotionFrame& frame) { return !frame.no_gyroscope.empty(); }));
  }
  /// The errors against the truth of the frames whose direction may be used, and their median (the upper one; NaN of
  /// none).
  std::vector<double> errors(std::optional<double> MotionFrame::*error) const {
    std::vector<double> values;
    for (const MotionFrame& frame : frames) {
      if (frame.motion.ok() && frame.*error) values.push_back(*(frame.*error));
    }
    return values;
  }
  double medianError(std::optional<double> MotionFrame::*error) const {
    std::vector<double> values = errors(error);
    if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  }
  /// Verdict: may any frame's direction of motion be used? The causes count the flags that forbid the others.
  Verdict verdict() const {
    if (fault != MotionFault::none) return Verdict::none(std::string("NO MOTION: ") + inWords(fault));
    if (frames.empty()) return Verdict::none("NO MOTION: there are fewer than two frames");
    const std::size_t n = frames.size(), used = usable();
    std::vector<std::string> causes;
    for (const auto& [name, flag] : motion_flags) {
      const auto count = std::count_if(frames.begin(), frames.end(), [flag = flag](const MotionFrame& frame) {
        return !frame.motion.ok() && frame.motion.flags.*flag;
      });
      if (count > 0)
        causes.push_back(std::string(name) + " in " + std::to_string(count) + " of the frames not to be used");
    }
    if (used == 0) {
      return Verdict::no(
          "NOT TO BE TRUSTED: none of " + std::to_string(n) + " frames has a direction of motion that may be used",
          std::move(causes));
    }
    Verdict verdict = Verdict::yes(std::to_string(used) + " of " + std::to_string(n) +
                                   " frames have a direction of motion that may be used");
    verdict.causes = std::move(causes);
    return verdict;
  }
};

/// The fields of one frame; see report/describe.hpp.
template <class V>
void describe(V& v, const MotionFrame& x) {
  const MotionEstimate& m = x.motion;
  v("frame", x.frame, "its number")("usable", m.ok(), "the direction may be used");
  v("meaning", inWords(m.meaning),
    "velocity: in the axes half-way; translation: over the interval, in the axes at its end");
  v("filter", x.essential ? "essential" : "subspace", "in charge");
  v("direction", Eigen::Vector3d(m.direction.mean.unit_vector()), "unit vector of the points' motion");
  v("direction_covariance", m.direction.covariance, "local frame of S2 at the estimate", "rad^2");
  v("rotation_vector", m.rotation.mean.log(), "over one frame", "rad");
  v("rotation_covariance", m.rotation.covariance, "along the first frame's camera axes", "rad^2");
  v("mean_inverse_depth", m.mean_inverse_depth, "|V|/Z, per frame");
  v("sign_evidence", m.sign_evidence, "for positive depths, in its standard deviations; above 2 it is decided");
  v("innovation", m.innovation, "cost before the update over its degrees of freedom: 1 expected");
  v("pairs", m.pairs, "usable pairs of points")("inliers", m.inliers, "those that the update used");
  v("covariance_judged", x.covariance_judged, "the covariance claims to bound the error");
  v("flags", x.flags(), "that are raised");
  if (shown(v, !x.no_gyroscope.empty())) {
    v("no_gyroscope", x.no_gyroscope, "why there is no rotation of the gyroscope, if there is none");
  }
  if (shown(v, x.gyroscope_bias.has_value())) {
    const auto bias = x.gyroscope_bias.value_or(Gaussian<Eigen::Vector3d>());
    v("gyroscope_bias", bias.mean, "if it is estimated: measured minus true, in the sensor's axes", "rad/s");
    v("gyroscope_bias_covariance", bias.covariance, "", "rad^2/s^2");
  }
  if (shown(v, x.with_truth)) {
    const auto degrees = [](std::optional<double> angle) {
      return angle ? std::optional<double>(*angle / units::degree) : std::nullopt;
    };
    v("direction_error_deg", degrees(x.direction_error), "with a truth; null: unknown, or hardly any motion", "deg");
    v("rotation_error_deg", degrees(x.rotation_error), "with a truth, per frame", "deg");
  }
}

/// The fields of a sequence, its frames one by one in `frames`.
template <class V>
void describe(V& v, const MotionResult& x) {
  const Verdict verdict = x.verdict();
  const std::size_t usable = x.usable();
  v("status", usable > 0 ? "ok" : "ill_defined", "ok if any frame may be used");
  v("verdict", verdict.text, "how many frames may be used")("causes", verdict.causes, "flags that forbid the others");
  v("frames_usable", usable, "their number")("passes", x.passes, "over the sequence");
  v("with_gyroscope", x.with_gyroscope, "rotations of a gyroscope were given");
  v("frames_apart", x.frames_apart, "longest interval of a pair");
  v("observations_outside", x.outside, "without a ray ahead of the camera");
  if (shown(v, x.with_gyroscope)) {
    v("frames_without_gyroscope", x.withoutGyroscope(), "with a gyroscope: frames that have no rotation of it");
  }
  v("hand_overs", x.hand_overs, "to the essential filter")("fall_backs", x.fall_backs, "to the subspace filter");
  v("motion_of",
    "the points in the camera's axes (x right, y down, z forward), X2 = R X1 + T; one frame is the unit of time, the "
    "camera moves against it",
    "in words");
  v("covariance_order", "direction: two coordinates; rotation: x y z", "in words");
  v("covariance_side", "right", "on which errors are applied");
  v("covariance_frame",
    "direction: local frame of S2 at the estimate, rad; rotation: the first frame's camera axes, rad", "in words");
  if (shown(v, x.with_bias)) {
    v("gyroscope_bias_of", "the readings, measured minus true, rad/s in the sensor's axes",
      "if it is estimated, in words");
  }
  v("frames", x.frames, "the motion of each");
  if (shown(v, x.with_truth)) {
    v("median_direction_error_deg", x.medianError(&MotionFrame::direction_error) / units::degree, "with a truth",
      "deg");
    v("median_rotation_error_deg", x.medianError(&MotionFrame::rotation_error) / units::degree,
      "with a truth, per frame", "deg");
  }
}

/// A row for each of the frames: their fields as arrays, and the flags each as an array of yes and no.
template <class V>
void describeSeries(V& v, const MotionResult& x) {
  const auto column = [&](const char* name, auto of) {
    std::vector<decltype(of(x.frames.front()))> values;
    values.reserve(x.frames.size());
    for (const MotionFrame& frame : x.frames) values.push_back(of(frame));
    v(name, values);
  };
  column("frame", [](const MotionFrame& f) { return f.frame; });
  column("usable", [](const MotionFrame& f) { return f.motion.ok(); });
  column("meaning", [](const MotionFrame& f) { return std::string(inWords(f.motion.meaning)); });
  column("filter", [](const MotionFrame& f) { return std::string(f.essential ? "essential" : "subspace"); });
  column("direction", [](const MotionFrame& f) { return Eigen::Vector3d(f.motion.direction.mean.unit_vector()); });
  column("direction_covariance", [](const MotionFrame& f) { return f.motion.direction.covariance; });
  column("rotation", [](const MotionFrame& f) { return Eigen::Vector4d(f.motion.rotation.mean.params()); });
  column("rotation_covariance", [](const MotionFrame& f) { return f.motion.rotation.covariance; });
  column("mean_inverse_depth", [](const MotionFrame& f) { return f.motion.mean_inverse_depth; });
  column("sign_evidence", [](const MotionFrame& f) { return f.motion.sign_evidence; });
  column("innovation", [](const MotionFrame& f) { return f.motion.innovation; });
  column("pairs", [](const MotionFrame& f) { return f.motion.pairs; });
  column("inliers", [](const MotionFrame& f) { return f.motion.inliers; });
  column("covariance_judged", [](const MotionFrame& f) { return f.covariance_judged; });
  for (const auto& [name, flag] : motion_flags) {
    column(name, [flag = flag](const MotionFrame& f) { return f.motion.flags.*flag; });
  }
}

}  // namespace liestat
