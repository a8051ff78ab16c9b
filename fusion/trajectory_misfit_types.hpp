// The result of the search for deterministic misfit (fusion/trajectory_misfit.hpp). (Needs Boost.Math.)
#pragma once

#include <fusion/detail/compiled.hpp>
#include <lie/se3.hpp>
#include <stats/words.hpp>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace liestat {

/// A fault of a whole trajectory that is no noise.
enum class Misfit {
  clock,               ///< its times are late or early
  scale,               ///< its positions are too small or too large
  body,                ///< its poses are those of another frame on the same body (extrinsic)
  world,               ///< its world is another one
  inverse,             ///< its poses are inverted
  rotation_inverse,    ///< its rotations alone are
  position_inverse,    ///< its positions are those of the inverted poses
  w_first,             ///< its quaternions have w first
  reference_w_first,   ///< those of the reference have
  axes,                ///< the axes of world and body are exchanged
  body_axes,           ///< the axes of the body are
  world_axes,          ///< the axes of the world are
  position_axes,       ///< the axes of the positions alone are
  rotation_axes,       ///< the axes of the rotations alone are
  mirrored,            ///< the axes of world and body are mirrored: a left-handed frame
  mirrored_positions,  ///< the axes of the positions alone are
  time_scale,          ///< its times are in another unit, or run at another speed
};
constexpr auto words(Misfit) {
  return std::array{"clock",
                    "scale",
                    "body",
                    "world",
                    "inverse",
                    "rotation_inverse",
                    "position_inverse",
                    "w_first",
                    "reference_w_first",
                    "axes",
                    "body_axes",
                    "world_axes",
                    "position_axes",
                    "rotation_axes",
                    "mirrored",
                    "mirrored_positions",
                    "time_scale"};
}

/// Faults that together explain errors. A pose (R̂, p̂) of the estimate, read anew as its faults ask for, belongs to the
/// reference's pose world · (A R̂ B, scale · C p̂) · body at its time + delay; A, B, C are signed permutations.
struct MisfitExplanation {
  std::vector<Misfit> faults = {};
  double delay = 0, delay_sigma = 0;  ///< s, to be added to the estimate's times
  double offset = 0;                  ///< s, the delay and the offset that was added before
  double time_factor = 1;             ///< of the estimate's times, where their unit or speed is another one
  double scale = 1, scale_sigma = 0;
  SE3d body = {}, world = {};
  Eigen::Matrix3d rotation_axes_left = Eigen::Matrix3d::Identity(), rotation_axes_right = rotation_axes_left,
                  position_axes = rotation_axes_left;  ///< A, B, C
  double explained = 0;                                ///< share of the squared errors, in units of those that remain
  double position_rmse = 0, rotation_rmse = 0;         ///< that remain, m and rad

  /// The faults in words, each with what undoes it.
  std::string text() const;
};

/// Deterministic misfit of a trajectory. Several explanations cannot be told apart by its motion.
struct MisfitSearch {
  bool searched = false;
  std::string reason = "there was no search";   ///< why there was none
  std::size_t poses = 0;                        ///< evenly spaced, from which faults were told
  double position_rmse = 0, rotation_rmse = 0;  ///< of the estimate as it is, m and rad
  std::vector<MisfitExplanation> explanations = {};

  bool found() const { return !explanations.empty(); }
  /// "explained 99.6 % of the error: the clock is …"; empty if nothing was found.
  std::string sentence() const;
};

// Descriptions (report/describe.hpp).

template <class V>
void describe(V& v, const MisfitExplanation& e) {
  std::vector<std::string> faults;
  for (const Misfit f : e.faults) faults.push_back(name(f));
  v("faults", faults, "that hold together")("text", e.text(), "in words, with what undoes them");
  v("explained", e.explained, "share of the squared errors");
  v("delay", e.delay, "to be added to the estimate's times", "s")("delay_sigma", e.delay_sigma, "its sd", "s");
  v("time_factor", e.time_factor, "of the estimate's times");
  v("scale", e.scale, "of the estimate's positions")("scale_sigma", e.scale_sigma, "its sd");
  v("body_translation", Eigen::Vector3d(e.body.translation()), "estimate's body to the reference's", "m");
  v("body_quaternion_xyzw", Eigen::Vector4d(e.body.so3().params()), "likewise");
  v("world_translation", Eigen::Vector3d(e.world.translation()), "the estimate's world in the reference's", "m");
  v("world_quaternion_xyzw", Eigen::Vector4d(e.world.so3().params()), "likewise");
  v("position_rmse", e.position_rmse, "that remains", "m")("rotation_rmse", e.rotation_rmse, "that remains", "rad");
}

template <class V>
void describe(V& v, const MisfitSearch& m) {
  v("searched", m.searched, "faults of the whole trajectory were looked for")("reason", m.reason, "why not");
  v("sentence", m.sentence(), "what explains the errors; empty: nothing");
  v("position_rmse", m.position_rmse, "before", "m")("rotation_rmse", m.rotation_rmse, "before", "rad");
  v("explanations", m.explanations, "several cannot be told apart by the motion");
}

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/trajectories/detail/misfit_words.hpp>
#endif
