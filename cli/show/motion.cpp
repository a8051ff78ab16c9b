#include <cli/show/motion.hpp>

#include <cli/show/table.hpp>
#include <cli/show/units.hpp>
#include <stats/quantile.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace liestat::cli {
namespace {

const char* nameOf(DirectionMeaning meaning) {
  return meaning == DirectionMeaning::velocity ? "velocity" : "translation";
}

std::vector<std::string> flagsOf(const MotionFrame& frame) {
  const MotionFlags& flags = frame.motion.flags;
  std::vector<std::string> names;
  if (flags.bad_input) names.emplace_back("bad_input");
  if (flags.too_few) names.emplace_back("too_few");
  if (flags.standstill) names.emplace_back("standstill");
  if (flags.degenerate) names.emplace_back("degenerate");
  if (flags.ambiguous) names.emplace_back("ambiguous");
  if (flags.undecided_sign) names.emplace_back("undecided_sign");
  if (flags.lost) names.emplace_back("lost");
  if (flags.outliers) names.emplace_back("outliers");
  if (!frame.no_gyroscope.empty()) names.emplace_back("no_gyroscope");
  return names;
}

/// The larger standard deviation of the direction, degrees.
double directionSigma(const MotionEstimate& motion) {
  const Eigen::Matrix2d& P = motion.direction.covariance;
  const double half = 0.5 * (P(0, 0) + P(1, 1)), difference = 0.5 * (P(0, 0) - P(1, 1));
  return degrees * std::sqrt(half + std::hypot(difference, P(0, 1)));
}
double rotationSigma(const MotionEstimate& motion) {
  return degrees * std::sqrt(motion.rotation.covariance.diagonal().maxCoeff());
}
double biasSigma(const MotionFrame& frame) { return std::sqrt(frame.gyroscope_bias.covariance.diagonal().maxCoeff()); }
Eigen::Vector3d rotationVector(const MotionEstimate& motion) { return motion.rotation.mean.log(); }

/// Numbers in ascending order as ranges: 1-3, 7.
std::string ranges(const std::vector<std::size_t>& numbers) {
  std::string text;
  for (std::size_t i = 0; i < numbers.size();) {
    std::size_t last = i;
    while (last + 1 < numbers.size() && numbers[last + 1] == numbers[last] + 1) ++last;
    if (!text.empty()) text += ", ";
    if (text.size() > 50) return text + "...";
    text += last > i ? fmt::format("{}-{}", numbers[i], numbers[last]) : fmt::format("{}", numbers[i]);
    i = last + 1;
  }
  return text;
}

/// Each flag that was raised, and at which frames.
std::string flagLines(const MotionResult& result) {
  std::map<std::string, std::vector<std::size_t>> frames;
  for (const MotionFrame& frame : result.frames) {
    for (const std::string& flag : flagsOf(frame)) frames[flag].push_back(frame.frame);
  }
  std::string text;
  for (const auto& [flag, list] : frames) text += fmt::format("{:<15}{:>5}  {}\n", flag, list.size(), ranges(list));
  return text.empty() ? text : fmt::format("\n{:<15}{:>5}  {}\n", "flag", "", "frames") + text;
}

std::vector<double> errorsOf(const MotionResult& result, std::optional<double> MotionFrame::*error) {
  std::vector<double> values;
  for (const MotionFrame& frame : result.frames) {
    if (frame.motion.ok() && frame.*error) values.push_back(*(frame.*error));
  }
  return values;
}

}  // namespace

std::size_t MotionResult::usable() const {
  return static_cast<std::size_t>(
      std::count_if(frames.begin(), frames.end(), [](const MotionFrame& frame) { return frame.motion.ok(); }));
}

std::size_t MotionResult::withoutGyroscope() const {
  return static_cast<std::size_t>(std::count_if(frames.begin(), frames.end(),
                                                [](const MotionFrame& frame) { return !frame.no_gyroscope.empty(); }));
}

std::string formatMotion(const MotionResult& result) {
  std::vector<std::string> headers = {"frame", "x", "y", "z", "sd", "turn", "sd turn", "pairs", "use"};
  if (result.with_truth) {
    headers.insert(headers.begin() + 5, "error");
    headers[7] = "error turn";
  }
  Table table(headers);
  const std::size_t n = result.frames.size(), shown = std::min<std::size_t>(n, 20);
  const auto error = [](const std::optional<double>& value) { return value ? number(*value, 3) : std::string(); };
  for (std::size_t i = 0; i < shown; ++i) {
    const MotionFrame& frame = result.frames[shown < 2 ? 0 : i * (n - 1) / (shown - 1)];
    const MotionEstimate& motion = frame.motion;
    const auto d = motion.direction.mean.unit_vector();
    std::vector<std::string> cells = {fmt::format("{}", frame.frame)};
    for (int k = 0; k < 3; ++k) cells.push_back(fmt::format("{:.3f}", d[k]));
    cells.push_back(number(directionSigma(motion), 3));
    if (result.with_truth) cells.push_back(error(frame.direction_error));
    cells.push_back(number(degrees * rotationVector(motion).norm(), 3));
    cells.push_back(result.with_truth ? error(frame.rotation_error) : number(rotationSigma(motion), 3));
    cells.push_back(fmt::format("{}/{}", motion.inliers, motion.pairs));
    cells.emplace_back(motion.ok() ? "" : "no");
    table.row(cells);
  }
  std::string text = table.str();
  text += "\ndirection of the points' motion (x right, y down, z forward); sd, turn and errors in deg, per frame\n";
  text += flagLines(result);
  if (result.with_truth) {
    const auto direction = errorsOf(result, &MotionFrame::direction_error);
    const auto rotation = errorsOf(result, &MotionFrame::rotation_error);
    text += direction.empty()
                ? "\nagainst the truth: no frame that may be used\n"
                : fmt::format(
                      "\nagainst the truth, {} frames: median direction {:.3g} deg, rotation {:.3g} deg per frame\n",
                      direction.size(), liestat::quantile(direction, 0.5), liestat::quantile(rotation, 0.5));
  }
  if (result.with_bias && n > 0) {
    const Gaussian<Eigen::Vector3d>& bias = result.frames.back().gyroscope_bias;
    text += fmt::format("\ngyroscope's bias at the end {:.3g}, {:.3g}, {:.3g} rad/s, sd {:.2g}\n", bias.mean.x(),
                        bias.mean.y(), bias.mean.z(), biasSigma(result.frames.back()));
  }
  if (const std::size_t without = result.withoutGyroscope(); without > 0) {
    const auto first = std::find_if(result.frames.begin(), result.frames.end(),
                                    [](const MotionFrame& frame) { return !frame.no_gyroscope.empty(); });
    text += fmt::format("\n{} of {} frames without the gyroscope, the first of them {}: {}\n", without, n, first->frame,
                        first->no_gyroscope);
  }
  if (result.outside > 0) text += fmt::format("\n{} observations lie where the camera sees nothing\n", result.outside);
  const std::size_t usable = result.usable();
  text += usable > 0
              ? fmt::format("\n{} of {} frames have a direction of motion that may be used\n", usable, n)
              : fmt::format("\nNOT TO BE TRUSTED: none of {} frames has a direction of motion that may be used\n", n);
  return text;
}

std::string motionCsv(const MotionResult& result) {
  std::string text =
      "frame,usable,meaning,dx,dy,dz,direction_sigma_deg,wx,wy,wz,rotation_sigma_deg,mean_inverse_depth,pairs,inliers,"
      "flags";
  text += result.with_bias ? ",bias_x,bias_y,bias_z,bias_sigma\n" : "\n";
  for (const MotionFrame& frame : result.frames) {
    const MotionEstimate& m = frame.motion;
    const auto d = m.direction.mean.unit_vector();
    const Eigen::Vector3d w = rotationVector(m);
    text += fmt::format("{},{},{},{:.9g},{:.9g},{:.9g},{:.6g},{:.9g},{:.9g},{:.9g},{:.6g},{:.6g},{},{},{}", frame.frame,
                        m.ok() ? 1 : 0, nameOf(m.meaning), d.x(), d.y(), d.z(), directionSigma(m), w.x(), w.y(), w.z(),
                        rotationSigma(m), m.mean_inverse_depth, m.pairs, m.inliers, fmt::join(flagsOf(frame), " "));
    if (result.with_bias) {
      const Eigen::Vector3d& b = frame.gyroscope_bias.mean;
      text += fmt::format(",{:.9g},{:.9g},{:.9g},{:.6g}", b.x(), b.y(), b.z(), biasSigma(frame));
    }
    text += "\n";
  }
  return text;
}

void setMotion(JsonObject& object, const MotionResult& result) {
  const std::size_t usable = result.usable();
  object.set("status", usable > 0 ? "ok" : "ill_defined");
  object.set("frames_usable", usable).set("passes", result.passes).set("with_gyroscope", result.with_gyroscope);
  object.set("frames_apart", result.frames_apart).set("observations_outside", result.outside);
  if (result.with_gyroscope) object.set("frames_without_gyroscope", result.withoutGyroscope());
  object.set("hand_overs", result.hand_overs).set("fall_backs", result.fall_backs);
  object.set("motion_of",
             "the points in the camera's axes (x right, y down, z forward), X2 = R X1 + T; one frame is "
             "the unit of time, the camera moves against it");
  object.set("covariance_order", "direction: two coordinates; rotation: x y z").set("covariance_side", "right");
  object.set("covariance_frame",
             "direction: local frame of S2 at the estimate, rad; rotation: the first frame's camera axes, rad");
  if (result.with_bias)
    object.set("gyroscope_bias_of", "the readings, measured minus true, rad/s in the sensor's axes");
  std::vector<JsonObject> list;
  for (const MotionFrame& frame : result.frames) {
    const MotionEstimate& m = frame.motion;
    JsonObject o;
    o.set("frame", frame.frame).set("usable", m.ok()).set("meaning", nameOf(m.meaning));
    o.set("filter", frame.essential ? "essential" : "subspace");
    o.set("direction", Eigen::Vector3d(m.direction.mean.unit_vector()));
    o.set("direction_covariance", m.direction.covariance);
    o.set("rotation_vector", rotationVector(m)).set("rotation_covariance", m.rotation.covariance);
    o.set("mean_inverse_depth", m.mean_inverse_depth).set("sign_evidence", m.sign_evidence);
    o.set("innovation", m.innovation).set("pairs", m.pairs).set("inliers", m.inliers);
    // The same data in several passes count each time.
    o.set("covariance_judged", m.covariance_judged() && result.passes == 1).set("flags", flagsOf(frame));
    if (!frame.no_gyroscope.empty()) o.set("no_gyroscope", frame.no_gyroscope);
    if (result.with_bias) {
      o.set("gyroscope_bias", Eigen::Vector3d(frame.gyroscope_bias.mean));
      o.set("gyroscope_bias_covariance", frame.gyroscope_bias.covariance);
    }
    if (result.with_truth) {
      o.set("direction_error_deg", frame.direction_error).set("rotation_error_deg", frame.rotation_error);
    }
    list.push_back(o);
  }
  object.set("frames", list);
  if (result.with_truth) {
    object.set("median_direction_error_deg", liestat::quantile(errorsOf(result, &MotionFrame::direction_error), 0.5));
    object.set("median_rotation_error_deg", liestat::quantile(errorsOf(result, &MotionFrame::rotation_error), 0.5));
  }
}

}  // namespace liestat::cli
