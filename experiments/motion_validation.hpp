// Monte-Carlo trials of the filters of fusion/motion/: how many find the direction, how well, and is its covariance true?
#pragma once

#include <experiments/judged_report.hpp>
#include <experiments/motion_scene.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace liestat::experiments {

/// The cells that are run.
enum class MotionMethod {
  subspace,          ///< 32 starts
  single_start,      ///< one start in a direction that is uniform on the sphere
  forward,           ///< 32 starts, the report's forward difference
  discrete,          ///< 32 starts, the exact flow
  gauss_newton,      ///< 32 starts, the covariance without second derivatives
  released,          ///< 32 starts, positive depth not enforced
  near_start,        ///< one start 10° off
  search,            ///< the residuals of 300 directions, summed over the frames (Heeger and Jepson 1992)
  essential,         ///< essential filter, 32 starts
  essential_near,    ///< the same from a direction 0.3 rad off and a rotation 30 % off
  composition,       ///< MotionFilter: subspace filter, then essential filter
  intervals,         ///< subspace filter, pairs of up to six frames (orbit) or four
  gyroscope,         ///< subspace filter with a gyroscope, discrete flow, linear start
  gyroscope_bias,    ///< the same, the gyroscope's bias a state
  gyroscope_robust,  ///< the same without the bias, expecting outliers, 32 starts
  essential_bias     ///< essential filter with a gyroscope, its bias a state
};
inline constexpr std::array all_motion_methods = {
    MotionMethod::subspace,       MotionMethod::single_start,   MotionMethod::forward,
    MotionMethod::discrete,       MotionMethod::gauss_newton,   MotionMethod::released,
    MotionMethod::near_start,     MotionMethod::search,         MotionMethod::essential,
    MotionMethod::essential_near, MotionMethod::composition,    MotionMethod::intervals,
    MotionMethod::gyroscope,      MotionMethod::gyroscope_bias, MotionMethod::gyroscope_robust,
    MotionMethod::essential_bias};
std::string name(MotionMethod method);

struct MotionValidation {
  std::vector<MotionMethod> methods{all_motion_methods.begin(), all_motion_methods.end()};
  std::size_t trials = 300;  ///< a row
  std::uint64_t seed = 1;
  int threads = 0;
  double noise_factor = 1;  ///< standard deviation of the noise that is drawn over that which the filters are told
};

/// The frames at which a run is looked at.
inline constexpr std::array<int, 3> motion_frames = {20, 50, 100};
/// An error below this (degrees) is a success.
inline constexpr double motion_success = 10;

/// The documentation's promise on a row; none: shown for comparison.
struct MotionPromise {
  std::array<double, 3> success{};  ///< probability of an error below 10°, at least; 0: nothing
  std::array<double, 3> median{};   ///< degrees, at most; 0: nothing
  double coverage = 0;  ///< probability that a successful run's error is in the 95 % region at frame 100, at least
};

/// One cell of the tables.
struct MotionRow {
  MotionMethod method = MotionMethod::subspace;
  MotionSceneOptions scene;
  std::size_t trials = 0;
  std::array<std::size_t, 3> successes{};
  std::array<double, 3> median{};       ///< degrees, over all trials
  std::array<double, 3> consistency{};  ///< mean of ξᵀ P⁻¹ ξ/2 over the successes: 1 where the covariance is right
  double coverage = 0;                  ///< share of the successes whose error is in the 95 % region, at frame 100
  double convergence =
      0;              ///< median number of the frame from which on the error stays below 10°, of those where it does
  double usable = 0;  ///< share of the trials whose last estimate is called usable
  double usable_wrong = 0;  ///< share of these with an error above 10°
  std::optional<MotionPromise> promise;
  std::optional<bool> passed;
  std::string reason;  ///< the failed criteria, in words
};

/// The cells of some methods, in their order.
std::vector<MotionRow> motionCells(const std::vector<MotionMethod>& methods);

/// Runs everything.
std::vector<MotionRow> validateMotion(const MotionValidation& validation,
                                      const std::function<void(std::uint64_t done, std::uint64_t all)>& progress = {});

}  // namespace liestat::experiments
