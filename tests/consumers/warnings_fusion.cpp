// A user's unit of fusion/ that takes liestat through -I, not -isystem, and has warnings on: none may come from the
// headers, which it instantiates with what they need, Eigen alone. Those that draw random numbers are in
// warnings_visual_inertial.cpp, two views and motion in units of their own.
#include <fusion/camera.hpp>
#include <fusion/imu/factor.hpp>
#include <fusion/imu/preintegrate.hpp>
#include <fusion/imu/preintegration.hpp>
#include <fusion/imu/readings.hpp>
#include <fusion/imu/window.hpp>
#include <fusion/init/closed_form.hpp>
#include <fusion/init/closed_form_types.hpp>
#include <fusion/init/epipolar_gyroscope_bias.hpp>
#include <fusion/init/gyroscope_bias.hpp>
#include <fusion/init/inertial_state.hpp>
#include <fusion/init/options.hpp>
#include <fusion/init/refinement.hpp>
#include <fusion/init/results.hpp>
#include <fusion/init/sphere_least_squares.hpp>
#include <fusion/init/window_fusion.hpp>
#include <fusion/status.hpp>
#if __has_include(<ceres/ceres.h>)
#include <fusion/compat/ceres.hpp>
#endif

#include <vector>

using namespace liestat;

namespace {

template <class S>
bool preintegrates() {
  std::vector<ImuSample<S>> readings(3);
  for (std::size_t k = 0; k < readings.size(); ++k) readings[k].time = S(0.005) * static_cast<S>(k);
  const auto found = preintegrate<S>(readings, S(0), S(0.01), {.scheme = ImuScheme::cubic});
  const SE23<S> first, second = found.motion.increment();
  const Eigen::Matrix<S, 3, 1> gravity(S(0), S(0), S(-9.81));
  const PreintegrationResidual<S> residual = preintegrationResidual(found.motion, first, second, ImuBias<S>{}, gravity);
  return found.ok() && residual.value.allFinite() && (found.motion * found.motion).covarianceWithBias().allFinite() &&
         found.motion.gaussian().covariance.allFinite() && found.motion.additiveCovariance().allFinite();
}

bool initialises() {
  const std::vector<ImuSample<double>> readings;
  const InitialisationOptions options{.bearing_noise = 1. / 450};
  const InertialWindow window(readings, {0., 0.1, 0.2}, {.preintegration = {.noise = {1e-4, 2e-3}}}, {{{.image = 0}}});
  const EpipolarBiasResult rotations = estimateEpipolarGyroscopeBias(window, options);
  const GyroscopeBiasResult bias = estimateGyroscopeBias(window, options);
  const ClosedFormResult closed = solveClosedForm(closedFormWindow(window), options);
  const RefinementResult refined = refine(window, {}, {bias.bias, {}}, options);
  WindowFusion fusion(9.81);
  const auto between = [](const ImuBias<double>& biases) { return Preintegration<double>({.bias = biases}); };
  const WindowFusion::Meeting meeting = fusion.add(windowStates(refined), between);
  return rotations.ok() && closed.ok() && refined.ok() && meeting.status == Status::ok && fusion.ok() &&
         converged(refined.status) && accelerometerBias(fusion.state(), 9.81).covariance.allFinite() &&
         minimiseOnSphere(Eigen::Matrix3d::Identity(), Eigen::Vector3d::Ones(), 1).count > 0 &&
         describe(refined.fault).empty();
}

bool sees() {
  const Camera camera{.fu = 450, .fv = 450, .cu = 320, .cv = 240, .distortion = Distortion::radtan};
  const auto bearing = camera.bearingWithSigma({100, 100});
  return bearing && camera.project(bearing->direction) && camera.sees({100, 100});
}

}  // namespace

int main() { return preintegrates<double>() && preintegrates<float>() && initialises() && sees() ? 0 : 1; }
