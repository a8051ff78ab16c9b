#pragma once

// The trials behind `liestat validate vi-init`, each in a unit of its own: they are what costs a compiler time. A trial
// draws a scene and its measurements, estimates, and compares with the truth. What could not be estimated has NaN
// distances and infinite errors.

#include <stats/random.hpp>

#include <cstddef>
#include <limits>

namespace liestat::experiments {

/// A window: its length, images at about equal distances, and features that all of them see.
struct ViInitWindow {
  double seconds = 2;
  std::size_t images = 21, features = 20;

  friend bool operator==(const ViInitWindow&, const ViInitWindow&) = default;
};

/// Bearings: one pixel of a camera with a focal length of 450.
inline constexpr double vi_init_bearing_noise = 1. / 450;

/// Errors of a solution. Infinite for a window without one.
struct ViErrors {
  double speed = std::numeric_limits<double>::infinity();    ///< m/s: length of the error of V
  double gravity = std::numeric_limits<double>::infinity();  ///< degrees: angle to the true one
  double scale = std::numeric_limits<double>::infinity();    ///< %: length of V over the true one, off 1
};

/// A sum of squared residuals and its degrees of freedom; NaN for a window without a solution.
struct ViChiSquared {
  double cost = std::numeric_limits<double>::quiet_NaN();
  double degrees_of_freedom = std::numeric_limits<double>::quiet_NaN();
};

/// One trial. `noise` multiplies the noise that is simulated, not the one that the estimators are told.
template <class Outcome>
using ViInitTrial = Outcome (*)(const ViInitWindow& window, double noise, CounterRng& rng);

/// A refined window: squared Mahalanobis distances of the truth, and errors.
struct RefinementOutcome {
  double nees_v = std::numeric_limits<double>::quiet_NaN();           ///< V, 3 degrees of freedom
  double nees_v_g = std::numeric_limits<double>::quiet_NaN();         ///< V and gravity, 5
  double nees_all = std::numeric_limits<double>::quiet_NaN();         ///< V, gravity and both biases, 11
  double nees_last_state = std::numeric_limits<double>::quiet_NaN();  ///< state at the last image, 9
  double nees_at_last = std::numeric_limits<double>::quiet_NaN();     ///< that state, gravity and the biases there, 17
  double nees_filter_start = std::numeric_limits<double>::quiet_NaN();  ///< the start of a filter there, 15
  ViChiSquared chi2;
  ViErrors errors;
  double scale_of_features = std::numeric_limits<double>::infinity();  ///< %: median of their distances, off 1
};
/// The refinement, biases drawn from their priors, started at the closed form for biases of zero.
RefinementOutcome refinementTrial(const ViInitWindow& window, double noise, CounterRng& rng);
/// The same with biases that walk as those of an ADIS16448 do.
RefinementOutcome walkTrial(const ViInitWindow& window, double noise, CounterRng& rng);

/// A window solved in closed form, under its covariance.
struct ClosedFormOutcome {
  double nees_v_g = std::numeric_limits<double>::quiet_NaN();  ///< V and gravity, 5 degrees of freedom
  double nees_all = std::numeric_limits<double>::quiet_NaN();  ///< with the accelerometer's bias, 8; NaN without it
  ViChiSquared chi2;
};
/// The closed form with image noise only.
ClosedFormOutcome closedFormNeesTrial(const ViInitWindow& window, double noise, CounterRng& rng);
/// The same with the accelerometer's bias.
ClosedFormOutcome closedFormBiasNeesTrial(const ViInitWindow& window, double noise, CounterRng& rng);

/// Image and sensor noise, biases known: the closed form, and weighted least squares alone.
struct AccuracyOutcome {
  ViErrors closed_form, least_squares;
};
AccuracyOutcome closedFormErrorsTrial(const ViInitWindow& window, double noise, CounterRng& rng);

/// A gyroscope's bias of 0.05 rad/s, estimated, and taken for zero.
struct GyroscopeBiasOutcome {
  double bias = std::numeric_limits<double>::infinity();  ///< rad/s: length of the error of the estimated one
  ViErrors estimated, ignored;
};
GyroscopeBiasOutcome gyroscopeBiasTrial(const ViInitWindow& window, double noise, CounterRng& rng);

/// At rest, without turns, biases drawn from their priors.
struct RestOutcome {
  bool stationary = false;                                 ///< verdict of the estimator: right
  double nees = std::numeric_limits<double>::quiet_NaN();  ///< gravity and both biases, 8 degrees of freedom
  double nees_filter_start = std::numeric_limits<double>::quiet_NaN();  ///< the start of a filter, 15
};
RestOutcome restTrial(const ViInitWindow& window, double noise, CounterRng& rng);
/// A uniform motion, which to an inertial sensor is rest.
struct SlowOutcome {
  bool stationary = false;  ///< verdict of the estimator: wrong
  bool excluded = false;    ///< it was, and the result says that so fast a motion would have been seen
};
/// At 1 m/s among features this many times 2 to 8 m away: to images that is one as much slower among features 2 to 8 m
/// away.
template <int far>
SlowOutcome slowTrial(const ViInitWindow& window, double noise, CounterRng& rng);

/// The calibration of the sensor's noise: whether the 95 % intervals hold the factors.
struct NoiseOutcome {
  bool gyroscope = false, accelerometer = false, common = false;
};
/// A recording of twenty seconds whose gyroscope and accelerometer are so many times as noisy as the calibration is told.
template <int gyroscope, int accelerometer>
NoiseOutcome noiseTrial(const ViInitWindow& window, double noise, CounterRng& rng);

/// 40 % of the tracks drift by a random walk of 8 pixels an image.
struct DriftOutcome {
  bool exact_selection = false;           ///< exactly the other tracks were kept
  ViErrors robust, oracle, no_selection;  ///< with those that were kept, with the right ones, with all
};
DriftOutcome driftTrial(const ViInitWindow& window, double noise, CounterRng& rng);

}  // namespace liestat::experiments
