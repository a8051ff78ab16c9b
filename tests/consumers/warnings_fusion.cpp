// A user's unit of fusion/ that takes liestat through -I, not -isystem, and has warnings on: none may come from the
// headers, which it instantiates with what they need, Eigen alone. Those that draw random numbers are in
// warnings_visual_inertial.cpp.
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
#include <fusion/motion/gyroscope.hpp>
#include <fusion/motion/motion_filter.hpp>
#include <fusion/motion/search.hpp>
#include <fusion/motion/structure.hpp>
#include <fusion/motion/track_pairs.hpp>
#include <fusion/status.hpp>
#include <fusion/two_view/focal_lengths.hpp>
#include <fusion/two_view/pose.hpp>
#include <fusion/two_view/solvers.hpp>
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

bool movesBetweenTwoViews() {
  const std::vector<Eigen::Vector4d> m(9, Eigen::Vector4d::Zero());
  const Eigen::Vector3d up = Eigen::Vector3d::UnitY();
  const bool plane = !solveRetinalTranslation(m).empty() && solveZoom(m).empty() &&
                     solveRetinalDisplacement(m).empty() && solveFreeZoom(m).empty() && solveSimilarity(m).empty() &&
                     solveAffine(m).empty() && solveRotation(m).empty() && solveRotationZoom(m).empty() &&
                     solveHomography(m).empty() && !keepsOrientation(m);
  const bool epipolar = solveTranslation(m).empty() && solveAffineEpipolar(m).empty() && solveFundamental(m).empty() &&
                        solveEssential(m).empty() && solveEssentialUpright(m, up, up).empty() &&
                        !isOriented(Eigen::Matrix3d::Identity(), m);
  const CheiralPose chosen = poseByCheirality(essentialFromPose({Eigen::Matrix3d::Identity(), up}), m);
  return plane && epipolar && toPose(toEssential(chosen.pose)).t.allFinite() &&
         posesOfHomography(Eigen::Matrix3d::Identity(), m).size() == 1 &&
         !motionFromFundamental(fundamentalFromMotion({{}, chosen.pose}), m);
}

bool follows() {
  TrackPairs tracks;
  MotionFilter filter;
  MotionStructure structure;
  RigidityTest rigidity;
  const std::vector<TrackObservation> seen(9);
  tracks.add(seen);
  const auto pairs = tracks.add(seen);
  const MotionEstimate& motion = filter.update(pairs, gyroscopeRotation(Eigen::Vector3d::UnitX(), 0.1, 1e-3, {}));
  structure.update(tracks.tracks(), pairs, filter.inverse_depths(), motion);
  rigidity.add({});
  return motion.ok() && SphereSearch().update(pairs).allFinite() && rigidity.spread() > 0 &&
         structure.inFront().empty() && filter.essential().essential().covariance.allFinite() &&
         filter.subspace().hypotheses().empty() && translationDirection(motion).covariance.allFinite();
}

bool sees() {
  const Camera camera{.fu = 450, .fv = 450, .cu = 320, .cv = 240, .distortion = Distortion::radtan};
  const auto bearing = camera.bearingWithSigma({100, 100});
  return bearing && camera.project(bearing->direction) && camera.sees({100, 100});
}

}  // namespace

int main() {
  return preintegrates<double>() && preintegrates<float>() && initialises() && movesBetweenTwoViews() && follows() &&
                 sees()
             ? 0
             : 1;
}
