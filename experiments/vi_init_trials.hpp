#pragma once

// The trials behind `liestat validate vi-init`, each in a unit of its own: they are what costs a compiler time.

#include <stats/random.hpp>

#include <cstddef>
#include <vector>

namespace liestat::experiments {

/// A window: its length, images at about equal distances, and features that all of them see.
struct ViInitWindow {
  double seconds = 2;
  std::size_t images = 21, features = 20;
};

/// Bearings: one pixel of a camera with a focal length of 450.
inline constexpr double vi_init_bearing_noise = 1. / 450;

/// One trial: the numbers of its experiment's columns in their order, NaN for what failed. `noise` multiplies the noise
/// that is simulated, not the one that the estimators are told.
using ViInitTrial = std::vector<double> (*)(const ViInitWindow& window, double noise, CounterRng& rng);

/// The refinement, biases drawn from their priors, started at the closed form for biases of zero. NEES of V, of V and
/// G, of all, of the last state; cost, its degrees of freedom; errors of speed (m/s), gravity (deg), and scale, of V
/// and of the features (%).
std::vector<double> refinementTrial(const ViInitWindow& window, double noise, CounterRng& rng);

/// The closed form with image noise only: NEES of V and G; cost, its degrees of freedom.
std::vector<double> closedFormNeesTrial(const ViInitWindow& window, double noise, CounterRng& rng);
/// The same with the accelerometer's bias: NEES of V and G, and of V, G and bias; cost, its degrees of freedom.
std::vector<double> closedFormBiasNeesTrial(const ViInitWindow& window, double noise, CounterRng& rng);

/// Image and sensor noise, biases known: speed, gravity, scale of the closed form, then of weighted least squares
/// alone.
std::vector<double> closedFormErrorsTrial(const ViInitWindow& window, double noise, CounterRng& rng);

/// A gyroscope's bias of 0.05 rad/s: error of the bias (rad/s), gravity, scale with the bias estimated; then gravity
/// and scale with it taken for zero.
std::vector<double> gyroscopeBiasTrial(const ViInitWindow& window, double noise, CounterRng& rng);

/// 40 % of the tracks drift by a random walk of 8 pixels an image: 1 where exactly the others were kept, else 0; speed,
/// gravity, scale with those that were kept, with the right ones, with all.
std::vector<double> driftTrial(const ViInitWindow& window, double noise, CounterRng& rng);

}  // namespace liestat::experiments
