// A user's unit of fusion/two_view/ that takes liestat through -I, not -isystem, and has warnings on: none may come from the
// headers, which it instantiates with Eigen alone.
#include <fusion/two_view/focal_lengths.hpp>
#include <fusion/two_view/pose.hpp>
#include <fusion/two_view/solvers.hpp>

#include <vector>

using namespace liestat;

namespace {

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

}  // namespace

int main() { return movesBetweenTwoViews() ? 0 : 1; }
