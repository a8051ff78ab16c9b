// Where means serve sensors: a visual-inertial recording, initialised window by window without a first guess, and its
// windows averaged.
//
// A body flies for twelve seconds, with biases that nobody told. Each window of two seconds says gravity, velocity and
// biases with a covariance; what disjoint windows say together is a Mahalanobis mean, carried from one to the next by
// the inertial sensor. Their distance from each other is χ² if the covariances are true, and that is the only thing to
// look at on a real recording, where the truth is not known: a sensor five times as noisy as its data sheet says is not
// seen in the cost of any window, which is ruled by its bearings. What the noise is, the windows' distances tell. At last
// a filter starts there.
#include <fusion/visual_inertial.hpp>
#include <stats/random.hpp>

#include <cmath>
#include <cstddef>
#include <cstdio>
#include <vector>

namespace {

using namespace liestat;
using Eigen::Vector3d;

constexpr double duration = 12.5, pixel = 1. / 450;
const ImuNoise<double> data_sheet{.gyroscope = 1.7e-4, .accelerometer = 2e-3};
const ImuBias<double> bias{{0.008, -0.012, 0.005}, {0.06, -0.03, 0.04}};

/// Sums of sines, with their derivatives: the body's position (m) and rotation vector (rad) in a world with z upwards.
struct Flight {
  static Vector3d sines(double t, double a, double b, double c, int derivative) {
    const auto wave = [&](double rate) {
      return std::pow(rate, derivative) * std::sin(rate * t + 1.5707963 * derivative);
    };
    return {0.5 * wave(a), 0.4 * wave(b), 0.3 * wave(c)};
  }
  static Vector3d position(double t, int derivative = 0) { return sines(t, 2.1, 1.7, 2.6, derivative); }
  static Vector3d angle(double t, int derivative = 0) { return sines(t, 1.1, 1.5, 0.9, derivative); }
  static SO3d attitude(double t) { return SO3d::exp(angle(t)); }
  static ImuSample<double> reading(double t) {
    return {t, SO3d::rightJacobian(angle(t)) * angle(t, 1),
            attitude(t).inverse() * Vector3d(position(t, 2) + Vector3d(0, 0, 9.81))};
  }
};

void fly(double noise_factor) {
  CounterRng random(5);
  std::vector<ImuSample<double>> readings;
  const double step = 0.005, size = noise_factor / std::sqrt(step);
  for (int k = 0; k * step < duration; ++k) {
    readings.push_back(Flight::reading(k * step));
    readings.back().angular_rate += bias.gyroscope + size * data_sheet.gyroscope * random.normalVector<3>();
    readings.back().specific_force += bias.accelerometer + size * data_sheet.accelerometer * random.normalVector<3>();
  }
  // A camera that looks along the body's x axis at thirty points, which it tracks ten times a second.
  VisualInertialRecording recording{.readings = readings, .noise = data_sheet};
  std::vector<Vector3d> points;
  for (int i = 0; i < 30; ++i) {
    points.emplace_back(3 + 3 * random.uniform(), 4 * random.uniform() - 2, 4 * random.uniform() - 2);
  }
  for (int j = 0; j < 122; ++j) {
    const double t = 0.1 * j;
    recording.image_times.push_back(t);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vector3d seen = Flight::attitude(t).inverse() * Vector3d(points[i] - Flight::position(t));
      recording.observations.push_back({.image = static_cast<std::size_t>(j),
                                        .track = i,
                                        .bearing = seen.normalized() + pixel * random.normalVector<3>(),
                                        .sigma = pixel});
    }
  }

  const VisualInertialResult result = initialiseRecording(recording, {.stride = 2.5, .calibrate_noise = false});
  std::printf("a sensor with %g times the noise of its data sheet\n", noise_factor);
  std::printf("  window       chi2/dof   gravity deg   gyroscope rad/s   accelerometer m/s2\n");
  const auto off = [&](double t, const Vector3d& down, const ImuBias<double>& b) {
    const Vector3d truth = Flight::attitude(t).inverse() * Vector3d(0, 0, -1);
    std::printf("   %10.3f   %15.5f   %18.4f\n", 57.3 * distance(S2d(truth), S2d(down)),
                (b.gyroscope - bias.gyroscope).norm(), (b.accelerometer - bias.accelerometer).norm());
  };
  for (const InitialisedWindow& w : result.windows) {
    std::printf("  from %4.1f s ", w.begin);
    if (!w.isRefined()) {
      std::printf(" %s\n", describe(w.verdict()));
      continue;
    }
    std::printf("%9.3f", w.refined->cost / static_cast<double>(w.refined->degrees_of_freedom));
    off(w.begin, w.refined->gravity, w.refined->bias);
  }
  for (const FusedStretch& s : result.stretches) {
    if (!s.has_state) continue;
    std::printf("  all %zu, where they meet chi2 %.1f of %zu\n  at %6.1f s           ", s.windows.size(), s.chi2,
                s.degrees_of_freedom, s.end);
    const InertialState& x = s.state.mean;
    off(s.end, x.get<0>().unit_vector(), {x.get<2>(), accelerometerBias(x, s.gravity)});
  }
  // Unless it is told not to, the library tests the densities by these distances, and uses those with which windows agree.
  const VisualInertialResult tested = initialiseRecording(recording, {.stride = 2.5});
  const NoiseCalibration& noise = *tested.noise_calibration;
  std::printf("  the data sheet is %s: densities times %.1f (95 %%: %.1f to %.1f)\n", name(noise.evidence),
              noise.common.factor, noise.common.low, noise.common.high);
  // A filter starts at the end of the last stretch that is ok, in a world with z upwards. Position and heading are free.
  if (const FilterStart& start = tested.filter_start; start.ok()) {
    const auto sigma = start.covarianceAs(FilterConvention::openvins).diagonal().cwiseSqrt().eval();
    std::printf("  a filter starts at %.1f s, standard deviations in OpenVINS' order:\n ", start.time);
    for (const double x : sigma) std::printf(" %.2g", x);
    std::printf("\n");
  }
  std::printf("\n");
}

}  // namespace

int main() {
  fly(1);
  fly(5);
}
