// The closed form of visual-inertial initialisation on tracks of which many are wrong: consensus over features.
//
//   const auto robust = liestat::solveClosedFormRobustly(window, {.bearing_noise = 1. / 450});
//   if (robust.ok()) … robust.result.solutions[0], robust.outliers
//
// A feature enters the problem of the motion as a 7×7 block (10×10 with the accelerometer's bias), and blocks add up:
// a hypothesis is the sum of those of a few features drawn at random, and costs no elimination. Derivation:
// docs/theory/visual_inertial.md, section 3.8; M. Fischler and R. Bolles, "Random sample consensus", 1981; the
// truncated cost and the local optimisation of hypotheses are P. Torr and A. Zisserman's (MLESAC, 2000) and O. Chum, J.
// Matas and J. Kittler's (LO-RANSAC, 2003).
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/init/closed_form.hpp>

#include <cstddef>
#include <vector>

namespace liestat {

/// Indices are the window's. Features that fewer than two images have seen are in neither list.
struct ConsensusResult {
  ClosedFormResult result;                     ///< from the inliers; from all features where there is no consensus
  std::vector<std::size_t> inliers, outliers;  ///< ascending; no inliers: no consensus
  std::size_t hypotheses = 0;                  ///< hypotheses tried; 0: too few features to choose from, all are taken

  /// Exactly one answer, which explains the data of the inliers.
  bool ok() const { return !inliers.empty() && result.ok(); }
};

/// Velocity, gravity and features of a window of which up to half of the tracks, and more with more hypotheses, are
/// wrong. Bad input: see result.fault; options that make no sense, such as no noise, are bad_option.
LIESTAT_FUSION_API ConsensusResult solveClosedFormRobustly(const ClosedFormWindow& window,
                                                           const InitialisationOptions& options);

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/init/detail/solve_closed_form_robustly.hpp>
#endif
