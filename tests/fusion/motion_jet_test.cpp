// The compact update of recursive motion through ceres::Jet: derivatives of the frame's cost by the direction are those
// that it computes itself.
#include <fusion/motion/subspace_update.hpp>

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace {

using namespace liestat;
using Jet = ceres::Jet<double, 2>;

TEST(SubspaceUpdate, GradientByJets) {
  const S2d direction(0.5, -0.3, 0.9);
  const Eigen::Vector3d V = direction.unit_vector();
  const Eigen::Matrix<double, 3, 2> E = ManifoldTraits<S2d>::placement(direction).matrix().leftCols<2>();
  std::vector<FlowPoint<double>> points;
  std::vector<FlowPoint<Jet>> jets;
  for (int i = 0; i < 12; ++i) {
    FlowPoint<double> p;
    p.x = 0.4 * std::cos(1.7 * i), p.y = 0.4 * std::sin(2.3 * i), p.variance = 1e-5 * (1 + i % 3);
    p.u = 0.1 * std::cos(0.7 * i) + 0.02 * p.x, p.v = 0.05 * std::sin(1.1 * i) - 0.03 * p.y;
    points.push_back(p);
    FlowPoint<Jet> q;
    q.x = Jet(p.x), q.y = Jet(p.y), q.u = Jet(p.u), q.v = Jet(p.v), q.variance = Jet(p.variance);
    jets.push_back(q);
  }
  const RotationPrior<double> prior{{0.01, 0.02, -0.01}, 1e3 * Eigen::Matrix3d::Identity()};
  std::vector<FlowRow<double>> rows(points.size());
  flowRows<double>(points, V, rows);
  const FlowRotationSums<double> sums = rotationSums<double>(rows);
  const Eigen::Vector3d Omega = sums.solve(prior);
  const FrameInformation<double, 2> f =
      eliminateRotation(subspaceSums<double>(points, rows, E, Omega, sums.M), Omega, prior);

  // V + E ξ has the derivatives of Exp_V(E ξ) at zero, and its length changes nothing in first order.
  Eigen::Matrix<Jet, 3, 1> W;
  for (int i = 0; i < 3; ++i) W[i] = Jet(V[i], Eigen::Vector2d(E.row(i).transpose()));
  RotationPrior<Jet> jet_prior;
  for (int i = 0; i < 3; ++i) jet_prior.mean[i] = Jet(prior.mean[i]), jet_prior.information(i, i) = Jet(1e3);
  std::vector<FlowRow<Jet>> jet_rows(jets.size());
  flowRows<Jet>(jets, W, jet_rows);
  const FlowRotationSums<Jet> jet_sums = rotationSums<Jet>(jet_rows);
  const Eigen::Matrix<Jet, 3, 1> jet_Omega = jet_sums.solve(jet_prior);
  const Eigen::Matrix<Jet, 3, 2> jet_E = E.cast<Jet>();
  const FrameInformation<Jet, 2> g =
      eliminateRotation(subspaceSums<Jet>(jets, jet_rows, jet_E, jet_Omega, jet_sums.M), jet_Omega, jet_prior);
  EXPECT_NEAR(g.cost.a, f.cost, 1e-10 * f.cost);
  EXPECT_LE((0.5 * g.cost.v - f.gradient).norm(), 1e-9 * (1 + f.gradient.norm()));
  FilterCovariance<Jet, 2> P;
  EXPECT_TRUE(std::isfinite(updateCovariance(P, g, Jet(0.5)).step[0].a));
}

}  // namespace
