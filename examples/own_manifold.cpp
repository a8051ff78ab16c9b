// A type of your own as a manifold: a robot's planar pose, as some driver delivers it, which cannot be changed.
// ManifoldTraits is specialised for it; means, covariances, fusion and sampling then work on it.
// docs/adding_a_manifold.md goes through this file.
#include <lie/se2.hpp>
#include <lie/testing.hpp>
#include <lie/units.hpp>
#include <stats/covariance.hpp>
#include <stats/maha.hpp>

#include <iostream>
#include <vector>

// ---- somebody else's type -----------------------------------------------------------------------------------------
struct RobotPose {
  double x = 0, y = 0;         // m
  double heading_degrees = 0;  // counter-clockwise from the x axis
};

// ---- what makes it a manifold -------------------------------------------------------------------------------------
// Rigid motions SE(2) act on it. In the metric two metres weigh like a radian, for this robot's size: that is why it is
// not simply the library's Frame2, where one metre does.
template <>
struct liestat::ManifoldTraits<RobotPose> : liestat::TrivialIsotropy<RobotPose, liestat::SE2d> {
  static RobotPose fromGroup(const SE2d& g) {
    return {g.translation().x(), g.translation().y(), g.so2().log()[0] / liestat::units::degree};
  }
  static SE2d toGroup(const RobotPose& p) { return SE2d(p.heading_degrees * liestat::units::degree, {p.x, p.y}); }
  static Square diagonal(const Eigen::Matrix2d& translation) {
    Square m = Square::Identity();
    m.topLeftCorner<2, 2>() = translation;
    return m;
  }

  // The atomic operations: action, placement, exponential map at the origin and its inverse.
  static RobotPose act(const SE2d& f, const RobotPose& p) { return fromGroup(f * toGroup(p)); }
  static SE2d placement(const RobotPose& p) { return toGroup(p); }
  static RobotPose expOrigin(const Tangent& v) { return {v[0], v[1], v[2] / liestat::units::degree}; }
  static Tangent logOrigin(const RobotPose& p) { return {p.x, p.y, toGroup(p).so2().log()[0]}; }
  // Their derivatives, local frames at both ends: a step at expOrigin(v) is seen from a frame turned by v[2].
  static Square dexpOrigin(const Tangent& v) { return diagonal(SO2d(v[2]).matrix().transpose()); }
  static Square dlogOrigin(const RobotPose& p) { return diagonal(toGroup(p).so2().matrix()); }

  // The metric: geodesics are straight in x, y and turn evenly, so it is flat; half a turn away lies the cut locus.
  // Weights of 1 for angles make distances radians, which is what the injectivity radius is given in.
  static Tangent metricWeights() { return {0.25, 0.25, 1}; }
  static double injectivityRadius() { return static_cast<double>(EIGEN_PI); }
  static double maxSectionalCurvature() { return 0; }
  static Square hessianHalfSquaredDistance(const Tangent&) { return metricWeights().asDiagonal(); }
};

static_assert(liestat::Metric<RobotPose>);

// ---- it is used like any other ------------------------------------------------------------------------------------
int main() {
  const liestat::ContractReport contract = liestat::checkContract<RobotPose>();
  if (!contract.ok()) std::cout << contract;

  const std::vector<RobotPose> poses = {{1.0, 2.0, 178}, {1.1, 2.1, -179}, {0.9, 2.0, 179}, {1.0, 1.9, -178}};
  const auto result = liestat::mean(poses);
  std::cout << contract.checks().size() << " invariants " << (contract.ok() ? "hold" : "do not all hold") << "\n"
            << "mean        " << result.mean.x << " m, " << result.mean.y << " m, " << result.mean.heading_degrees
            << " deg\n"
            << "deviations  " << covarianceFromResiduals(result).diagonal().cwiseSqrt().transpose()
            << " (forward m, left m, rad)\n";
  return contract.ok() && converged(result.status) ? 0 : 1;
}
