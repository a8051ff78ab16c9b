// The same as warnings_fusion.cpp for the headers of fusion/ that draw random numbers, with Random123.
#include <fusion/hand_eye.hpp>
#include <fusion/init/consensus.hpp>
#include <fusion/init/robust_initialisation.hpp>
#include <fusion/noise_calibration.hpp>
#include <fusion/visual_inertial.hpp>
#include <fusion/visual_inertial_types.hpp>

#include <vector>

using namespace liestat;

int main() {
  const InitialisationOptions options{.bearing_noise = 1. / 450};
  const std::vector<Camera> cameras{{.fu = 450, .fv = 450, .cu = 320, .cv = 240}};
  const std::vector<PixelMeasurement> pixels{{.image = 0, .track = 0, .pixel = {100, 100}}};
  VisualInertialRecording recording;
  recording.noise = {1e-4, 2e-3};
  recording.image_times = {0, 0.1, 0.2};
  recording.observations = bearingsOf(pixels, cameras, 1);
  const VisualInertialResult result = initialiseRecording(recording, {.initialisation = options});
  const RobustInitialisation robust = initialiseRobustly(InertialWindow(), options);
  const ConsensusResult consensus = solveClosedFormRobustly(ClosedFormWindow(), options);
  const HandEyeResult hand_eye = estimateRobotWorld(std::vector<PosePair>(3));
  return result.fault && !robust.ok() && !consensus.ok() && !hand_eye.ok() ? 0 : 1;
}
