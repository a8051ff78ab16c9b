// Where means serve sensors: the windows of a visual-inertial recording, each initialised by itself, averaged.
//
// A body flies for twelve seconds. Five windows of two seconds are initialised in closed form and refined; each knows
// gravity, velocity and the sensor's biases with a covariance. What they say together is a Mahalanobis mean, window by
// window: the direction of gravity on the sphere, velocity and biases beside it, carried from one to the next by the
// inertial sensor. Their distance from each other is χ² if the covariances are true, and that is the only thing to look
// at on a real recording, where the truth is not known: a sensor five times as noisy as its data sheet says is not
// seen in the cost of any window, which is ruled by its bearings.
#include <fusion/init/closed_form.hpp>
#include <experiments/scene_readings.hpp>
#include <fusion/init/window_fusion.hpp>

#include <cmath>
#include <cstddef>
#include <cstdio>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat::experiments;

constexpr std::size_t windows = 5, images_per_window = 20, images_between = 5;
constexpr double pixel = 1. / 450;
const ImuNoise<double> data_sheet{.gyroscope = 1.7e-4, .accelerometer = 2e-3};

/// What was measured from one image to another, with the readings integrated for a bias.
InertialWindow cut(const InertialScene& scene, const std::vector<ImuSample<double>>& readings, std::size_t first,
                   const ImuBias<double>& bias) {
  InertialWindow window;
  const RecordingOptions<double> how{.preintegration = {.noise = data_sheet, .bias = bias}};
  for (std::size_t j = first; j < first + images_per_window; ++j) {
    window.motions.push_back(preintegrate<double>(readings, scene.times[j], scene.times[j + 1], how).motion);
  }
  for (const FeatureTrack& track : scene.window.features) {
    window.features.emplace_back();
    for (const TrackedBearing& seen : track) {
      if (seen.image < first || seen.image > first + images_per_window) continue;
      window.features.back().push_back({seen.image - first, seen.bearing});
    }
  }
  return window;
}

void fly(double noise_factor) {
  SceneRandom random(5);
  const ImuBias<double> bias{{0.008, -0.012, 0.005}, {0.06, -0.03, 0.04}};
  InertialScene scene({.images = 121, .features = 20, .window = 12, .bias = bias.accelerometer}, 11);
  const ImuNoise<double> noise{noise_factor * data_sheet.gyroscope, noise_factor * data_sheet.accelerometer};
  const auto readings = readingsOf(scene, noise, random, bias.gyroscope);
  scene.addNoise(pixel, random);
  std::printf("a sensor with %g times the noise of its data sheet\n", noise_factor);
  std::printf("  window   chi2/dof   gravity deg   gyroscope rad/s   accelerometer m/s2    meeting, 11 expected\n");

  const InitialisationOptions options = withSharedPrior(
      {.bearing_noise = pixel, .prior = {.gyroscope_sigma = 0.01, .accelerometer_sigma = 0.05}}, windows);
  WindowFusion fusion(InertialScene::g);
  double end = 0;
  for (std::size_t k = 0; k < windows; ++k) {
    const std::size_t first = k * (images_per_window + images_between);
    const double begin = scene.times[first];
    const InertialWindow window = cut(scene, readings, first, {});
    const auto start = solveClosedForm(closedFormWindow(window, {}), {.bearing_noise = pixel});
    if (start.solutions.empty()) continue;
    const RefinementResult refined = refine(window, start.solutions[0], {}, options);
    const WindowFusion::Meeting meeting = fusion.add(windowStates(refined, window), [&](const ImuBias<double>& b) {
      const RecordingOptions<double> how{.preintegration = {.noise = data_sheet, .bias = b}};
      return preintegrate<double>(readings, end, begin, how).motion;
    });
    end = scene.times[first + images_per_window];
    const auto off = [&](const Eigen::Vector3d& down, const ImuBias<double>& b) {
      const Eigen::Vector3d truth = scene.attitude(end).inverse() * Eigen::Vector3d(0, 0, -1);
      std::printf("   %10.3f   %15.5f   %18.4f", 57.3 * distance(S2d(truth), S2d(down)),
                  (b.gyroscope - bias.gyroscope).norm(), (b.accelerometer - bias.accelerometer).norm());
    };
    std::printf("  %6zu   %8.3f", k + 1, refined.cost / static_cast<double>(refined.degrees_of_freedom));
    off(refined.states.back().so3().inverse() * refined.gravity, refined.bias);
    if (k > 0) std::printf("%24.1f", meeting.chi2);
    std::printf("\n");
    if (k + 1 < windows) continue;
    const InertialState& x = fusion.state().mean;
    std::printf("  all                ");
    off(x.get<0>().unit_vector(), {x.get<2>(), accelerometerBias(x, InertialScene::g)});
    std::printf("%24.1f of %zu\n\n", fusion.chi2(), fusion.degrees_of_freedom());
  }
}

}  // namespace

int main() {
  fly(1);
  fly(5);
}
