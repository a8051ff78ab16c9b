// A user's unit of fusion/motion/ that takes liestat through -I, not -isystem, and has warnings on: none may come from the
// headers, which it instantiates with Eigen alone.
#include <fusion/motion/gyroscope.hpp>
#include <fusion/motion/motion_filter.hpp>
#include <fusion/motion/search.hpp>
#include <fusion/motion/sequence.hpp>
#include <fusion/motion/structure.hpp>
#include <fusion/motion/study.hpp>
#include <fusion/motion/track_pairs.hpp>

#include <vector>

using namespace liestat;

namespace {

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
  MotionResult result = estimateMotion({{0, seen}, {1, seen}}, {.frames_apart = 2}, gyroscopeOfRotations({}));
  compareWithTruth(result, {});
  MotionWindow window;
  if (window.has_looked_at() && !studyFrame(window, result).hasMaps()) return false;
  return motion.ok() && result.verdict().isYes() && SphereSearch().update(pairs).allFinite() && rigidity.spread() > 0 &&
         structure.inFront().empty() && filter.essential().essential().covariance.allFinite() &&
         filter.subspace().hypotheses().empty() && translationDirection(motion).covariance.allFinite();
}

}  // namespace

int main() { return follows() ? 0 : 1; }
