// Fusion of the windows of a recording: the direction of gravity, the velocity and the biases. Each window's estimate
// meets the fusion of the windows before it, carried to its first image by the inertial sensor, in a Mahalanobis mean
// of stats/; χ² says whether the two agree.
//
//   liestat::WindowFusion fusion(9.81);  // |G|
//   for (…) {  // disjoint windows, in the order of time, refined withSharedPrior(options, n)
//     const auto meeting = fusion.add(liestat::windowStates(refined), integrate_gap);  // meeting.chi2 ~ χ²(11)
//   }
//   if (fusion.ok()) … fusion.state(): at the last image of the last window, with its covariance
//
// Nothing counts twice. A reading serves one window or one gap between two: from the first image of a window to its
// last, what came from before is carried by the window's own estimate (its joint covariance of both ends), not by the
// readings that this was made of. And the prior of the biases, which is the same for all windows, is divided among
// them. Derivation: docs/theory/visual_inertial.md, section 5; X. Pennec, "Computing the mean of geometric
// features", 1998, section 4.2 (the mean) and 5.2 (the test).
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/imu/preintegration.hpp>
#include <fusion/imu/window.hpp>
#include <fusion/init/inertial_state.hpp>
#include <fusion/init/results.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/gaussian.hpp>
#include <stats/status.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cstddef>

namespace liestat {

namespace detail {

using Matrix11 = Eigen::Matrix<double, 11, 11>;

}  // namespace detail

/// The state at the end of a motion that begins where the state is: gravity and velocity by the inertial sensor, with
/// its noise, the biases with their random walk. Gravity's length in m/s². The motion is updated to the state's biases
/// to first order: over seconds it should have been integrated with them.
LIESTAT_FUSION_API Gaussian<InertialState> carried(const Gaussian<InertialState>& state,
                                                   const Preintegration<double>& motion, double gravity);

/// A window's estimate of the states at its first and its last image, with the covariance of both.
struct WindowStates {
  Gaussian<InertialState> first, last;
  /// The last state's error is by_first times the first one's, and what is independent of it.
  detail::Matrix11 by_first = detail::Matrix11::Zero(), independent = detail::Matrix11::Zero();

  /// False where the refinement gave no covariance.
  bool ok() const { return first.covariance.allFinite() && independent.allFinite(); }
};

/// The states at the ends of a refined window, each with its own biases where these walk. Not ok() where the refinement
/// did not succeed.
LIESTAT_FUSION_API WindowStates windowStates(const RefinementResult& refined);

/// Collects windows in the order of time; see the header comment.
class WindowFusion {
 public:
  /// The outcome for a window that was added.
  struct Meeting {
    Status status = Status::too_few;
    /// Squared distance of the window from all before it, under both covariances: χ² of 11 degrees of freedom where
    /// both are true (somewhat less where the prior says more than the windows, because it is common to both). 0 for
    /// the first window.
    double chi2 = 0;
    int degrees_of_freedom = 0;
    /// Prediction of the windows before minus the window's estimate, in the tangent space at the latter (to first
    /// order; chi2 is exact), and the covariance that both together expect of it.
    Eigen::Matrix<double, 11, 1> difference = Eigen::Matrix<double, 11, 1>::Zero();
    detail::Matrix11 difference_covariance = detail::Matrix11::Zero();
  };

  /// Gravity's length in m/s².
  explicit WindowFusion(double gravity) : gravity_(gravity) {}

  /// Adds a window that begins at or after the end of the one before. integrate(bias) returns the motion from the last
  /// image of the one before to the first of this, integrated with that bias; of no duration where they are the same;
  /// it is not called for the first window. Status as of maha(): ill_defined where a window has no covariance, and then
  /// it is left out.
  template <class Integrate>
  Meeting add(const WindowStates& window, const Integrate& integrate) {
    if (windows_ == 0 || !window.ok()) return begin(window);
    return meet(window, integrate({state_.mean.get<2>(), accelerometerBias(state_.mean, gravity_)}));
  }

  /// True if there is a state.
  bool hasState() const { return windows_ > 0; }
  /// True if there is one and the windows do not contradict each other.
  bool ok() const { return hasState() && p() >= min_p_of_fusion; }
  /// The state at the last image of the last window.
  const Gaussian<InertialState>& state() const { return state_; }
  std::size_t windows() const { return windows_; }
  /// The sum over all meetings: larger than χ² of so many degrees of freedom says that windows contradict each other,
  /// or are noisier than their covariances say.
  double chi2() const { return chi2_; }
  std::size_t degrees_of_freedom() const { return degrees_of_freedom_; }
  /// The probability of so large a sum where they do not.
  double p() const { return detail::chiSquaredTail(chi2_, degrees_of_freedom_); }
  /// The factor of the covariances at which windows would be as far apart as these are; at least 1.
  double inflation() const {
    return degrees_of_freedom_ == 0 ? 1 : std::max(1., chi2_ / static_cast<double>(degrees_of_freedom_));
  }

 private:
  /// The first window, or one without covariance.
  Meeting begin(const WindowStates& window);
  /// A later one, and the motion since the last.
  Meeting meet(const WindowStates& window, const Preintegration<double>& since);
  /// From the first image to the last by the window's own estimate.
  static Gaussian<InertialState> through(const WindowStates& window, const Gaussian<InertialState>& at_first);

  double gravity_;
  Gaussian<InertialState> state_;
  std::size_t windows_ = 0, degrees_of_freedom_ = 0;
  double chi2_ = 0;
};

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/init/detail/fuse_windows.hpp>
#endif
