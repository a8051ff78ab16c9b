// Definitions of fusion/trajectory_misfit_types.hpp: sentences.
#pragma once

#include <fusion/trajectory_misfit_types.hpp>
#include <lie/units.hpp>

#include <cmath>
#include <utility>

namespace liestat {

namespace detail {

inline std::string listed(const Eigen::Vector3d& x) {
  return significant(x[0], 3) + " " + significant(x[1], 3) + " " + significant(x[2], 3);
}
/// "1.3 m and 2.5 deg".
inline std::string sizesOf(double position, double rotation) {
  return significant(position, 3) + " m and " + significant(rotation / units::degree, 3) + " deg";
}
/// "the times are in ms (--time-unit ms)".
inline std::string timesInWords(double factor, double zero) {
  std::string text;
  for (const auto& [name, seconds] : {std::pair("ms", 1e-3), std::pair("us", 1e-6), std::pair("ns", 1e-9)}) {
    const bool reference = std::abs(factor * seconds - 1) < 0.02;
    if (!reference && !(std::abs(factor / seconds - 1) < 0.02)) continue;
    text = std::string(reference ? "the times of the reference" : "the times") + " are in " + name + " (" +
           (reference ? "--ref-time-unit " : "--time-unit ") + name + ")";
    if (reference) zero *= seconds;
  }
  if (text.empty()) {
    return "the times run " + significant(factor > 1 ? factor : 1 / factor, 4) + " times too " +
           (factor > 1 ? "slowly" : "fast") + " (the reference's are theirs times " + significant(factor, 4) +
           ", plus " + significant(zero, 4) + " s)";
  }
  return std::abs(zero) > 1e-3 ? text + " and begin elsewhere (about --t_offset " + significant(zero, 6) + ")" : text;
}
inline std::string poseInWords(const SE3d& T) {
  return "moved by " + listed(T.translation()) + " m and turned by " + listed(T.so3().log() / units::degree) + " deg";
}
/// "-y x z": the coordinates that rows of a signed permutation take.
inline std::string axesInWords(const Eigen::Matrix3d& P) {
  std::string text;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      if (P(i, j) != 0) text += std::string(i > 0 ? " " : "") + (P(i, j) < 0 ? "-" : "") + "xyz"[j];
    }
  }
  return text;
}

}  // namespace detail

LIESTAT_FUSION_INLINE std::string MisfitExplanation::text() const {
  using namespace detail;
  std::string all;
  for (const Misfit f : faults) {
    all += all.empty() ? "" : ", and ";
    switch (f) {
      case Misfit::clock:
        all += "the clock is " + significant(1e3 * std::abs(delay), 4) + " +- " + significant(1e3 * delay_sigma, 2) +
               " ms " + (delay < 0 ? "late" : "early") + " (--t_offset " + significant(offset, 6) + ")";
        break;
      case Misfit::scale:
        all += "positions are " + significant(100 * std::abs(1 / scale - 1), 4) + " +- " +
               significant(100 * scale_sigma / (scale * scale), 2) + " % too " + (scale < 1 ? "large" : "small") +
               " (times " + significant(scale, 6) + "; --align with --correct_scale)";
        break;
      case Misfit::body:
        all += "the poses are those of another frame of the body (the reference's is " + poseInWords(body) + ")";
        break;
      case Misfit::world:
        all += "the world is another one (" + poseInWords(world) + "; --align)";
        break;
      case Misfit::inverse:
        all += "the poses are inverted (body_T_world instead of world_T_body)";
        break;
      case Misfit::rotation_inverse:
        all += "the rotations are inverted, the positions are not";
        break;
      case Misfit::position_inverse:
        all += "the positions are those of the inverted poses, the rotations are not";
        break;
      case Misfit::w_first:
        all += "the quaternions have w first";
        break;
      case Misfit::reference_w_first:
        all += "the quaternions of the reference have w first";
        break;
      case Misfit::axes:
        all += "the axes of world and body are exchanged (x y z of the reference are " + axesInWords(position_axes) +
               " of the estimate)";
        break;
      case Misfit::body_axes:
        all += "the axes of the body are exchanged (x y z of the reference's body are " +
               axesInWords(rotation_axes_right.transpose()) + " of the estimate's)";
        break;
      case Misfit::world_axes:
        all += "the axes of the world are exchanged (x y z of the reference are " + axesInWords(rotation_axes_left) +
               " of the estimate)";
        break;
      case Misfit::position_axes:
        all += "the axes of the positions are exchanged, those of the rotations are not (x y z of the reference are " +
               axesInWords(position_axes) + " of the estimate)";
        break;
      case Misfit::rotation_axes:
        all += "the axes of the rotations are exchanged, those of the positions are not (x y z of the reference are " +
               axesInWords(rotation_axes_left) + " of the estimate)";
        break;
      case Misfit::mirrored:
        all += "the axes are mirrored: a left-handed frame (x y z of the reference are " + axesInWords(position_axes) +
               " of the estimate)";
        break;
      case Misfit::time_scale:
        all += timesInWords(time_factor, offset);
        break;
      case Misfit::mirrored_positions:
        all += "the axes of the positions are mirrored, the rotations are not (x y z of the reference are " +
               axesInWords(position_axes) + " of the estimate)";
        break;
    }
  }
  return all;
}

LIESTAT_FUSION_INLINE std::string MisfitSearch::sentence() const {
  if (!found()) return {};
  const MisfitExplanation& first = explanations.front();
  if (first.faults.front() == Misfit::time_scale) {
    return first.text() + ": the motion then agrees with the reference's (correlation " +
           significant(std::sqrt(first.explained), 3) + ")";
  }
  std::string all = "explained " + significant(100 * first.explained, 4) + " % of the error (" +
                    detail::sizesOf(position_rmse, rotation_rmse) + " become " +
                    detail::sizesOf(first.position_rmse, first.rotation_rmse) + "): " + first.text();
  for (std::size_t k = 1; k < explanations.size(); ++k) {
    all += std::string(k == 1 ? "; this motion cannot tell it from: " : "; or: ") + explanations[k].text();
  }
  return all;
}

}  // namespace liestat
