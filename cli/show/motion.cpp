#include <cli/show/motion.hpp>

#include <report/table.hpp>
#include <cli/show/units.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace liestat::cli {
namespace {

double directionSigma(const MotionFrame& frame) { return degrees * frame.direction_sigma(); }
double rotationSigma(const MotionFrame& frame) { return degrees * frame.rotation_sigma(); }
double biasSigma(const MotionFrame& frame) { return std::sqrt(frame.gyroscope_bias->covariance.diagonal().maxCoeff()); }
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
    for (const std::string& flag : frame.flags()) frames[flag].push_back(frame.frame);
  }
  std::string text;
  for (const auto& [flag, list] : frames) text += fmt::format("{:<15}{:>5}  {}\n", flag, list.size(), ranges(list));
  return text.empty() ? text : fmt::format("\n{:<15}{:>5}  {}\n", "flag", "", "frames") + text;
}

}  // namespace

std::string formatMotion(const MotionResult& result) {
  std::vector<std::string> headers = {"frame", "x", "y", "z", "sd", "turn", "sd turn", "pairs", "use"};
  if (result.with_truth) {
    headers.insert(headers.begin() + 5, "error");
    headers[7] = "error turn";
  }
  Table table(headers);
  const std::size_t n = result.frames.size(), shown = std::min<std::size_t>(n, 20);
  const auto error = [](const std::optional<double>& value) {
    return value ? number(degrees * *value, 3) : std::string();
  };
  for (std::size_t i = 0; i < shown; ++i) {
    const MotionFrame& frame = result.frames[shown < 2 ? 0 : i * (n - 1) / (shown - 1)];
    const MotionEstimate& motion = frame.motion;
    const auto d = motion.direction.mean.unit_vector();
    std::vector<std::string> cells = {fmt::format("{}", frame.frame)};
    for (int k = 0; k < 3; ++k) cells.push_back(fmt::format("{:.3f}", d[k]));
    cells.push_back(number(directionSigma(frame), 3));
    if (result.with_truth) cells.push_back(error(frame.direction_error));
    cells.push_back(number(degrees * rotationVector(motion).norm(), 3));
    cells.push_back(result.with_truth ? error(frame.rotation_error) : number(rotationSigma(frame), 3));
    cells.push_back(fmt::format("{}/{}", motion.inliers, motion.pairs));
    cells.emplace_back(motion.ok() ? "" : "no");
    table.row(cells);
  }
  std::string text = table.str();
  text += "\ndirection of the points' motion (x right, y down, z forward); sd, turn and errors in deg, per frame\n";
  text += flagLines(result);
  if (result.with_truth) {
    const std::size_t compared = result.errors(&MotionFrame::direction_error).size();
    text += compared == 0
                ? "\nagainst the truth: no frame that may be used\n"
                : fmt::format(
                      "\nagainst the truth, {} frames: median direction {:.3g} deg, rotation {:.3g} deg per frame\n",
                      compared, degrees * result.medianError(&MotionFrame::direction_error),
                      degrees * result.medianError(&MotionFrame::rotation_error));
  }
  if (result.with_bias && n > 0) {
    const Gaussian<Eigen::Vector3d>& bias = *result.frames.back().gyroscope_bias;
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
  return text + "\n" + result.verdict().text + "\n";
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
    text +=
        fmt::format("{},{},{},{:.9g},{:.9g},{:.9g},{:.6g},{:.9g},{:.9g},{:.9g},{:.6g},{:.6g},{},{},{}", frame.frame,
                    m.ok() ? 1 : 0, inWords(m.meaning), d.x(), d.y(), d.z(), directionSigma(frame), w.x(), w.y(), w.z(),
                    rotationSigma(frame), m.mean_inverse_depth, m.pairs, m.inliers, fmt::join(frame.flags(), " "));
    if (result.with_bias) {
      const Eigen::Vector3d& b = frame.gyroscope_bias->mean;
      text += fmt::format(",{:.9g},{:.9g},{:.9g},{:.6g}", b.x(), b.y(), b.z(), biasSigma(frame));
    }
    text += "\n";
  }
  return text;
}

}  // namespace liestat::cli
