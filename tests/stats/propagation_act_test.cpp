// Uncertain transformations of uncertain features, and functions of a user's own with their Jacobians.

#include <lie/lie.hpp>
#include <stats/propagation.hpp>
#include <stats/sampling.hpp>

#include <support/propagated.hpp>

namespace liestat_test {
namespace {

using namespace liestat;

/// Every form of act on one pair; `action(f, x)` moves features.
template <class G, class M, class F>
void expectAction(const G& at_f, const M& at_x, const F& action, const char* what) {
  SCOPED_TRACE(what);
  CounterRng rng(8, 0);
  const Pair<G, M> p(at_f, at_x, rng, 1e-3);
  const auto coordinates = inCoordinates(p, act(p.a, p.b).mean, action);
  expectDerivative(coordinates, p.independent(), act(p.a, p.b).covariance, "independent");
  expectDerivative(coordinates, p.joint, act(p.a, p.b, p.cross()).covariance, "correlated");
  expectSampled(coordinates, p.joint, act(p.a, p.b, p.cross()).covariance, rng, "samples");
  expectSame(act(p.a, at_x), act(p.a, Gaussian<M>{at_x, SquareOf<M>::Zero()}), "exact feature");
  expectSame(act(at_f, p.b), act(Gaussian<G>{at_f, SquareOf<G>::Zero()}, p.b), "exact transformation");
}

TEST(Act, movesPoints) {
  CounterRng rng(9, 0);
  const Eigen::Vector3d p(0.3, -1.2, 2);
  const Eigen::Vector2d q(0.3, -1.2);
  const auto moved = [](const auto& f, const auto& x) { return (f * x).eval(); };
  expectAction(SO2d::sampleUniform(rng), q, moved, "SO2 on R^2");
  expectAction(SE2d::sampleUniform(rng), q, moved, "SE2 on R^2");
  expectAction(SO3d::sampleUniform(rng), p, moved, "SO3 on R^3");
  expectAction(SE3d::sampleUniform(rng), p, moved, "SE3 on R^3");
  expectAction(RxSO3d::sampleUniform(rng), p, moved, "RxSO3 on R^3");
  expectAction(Sim3d::sampleUniform(rng), p, moved, "Sim3 on R^3");
}

TEST(Act, movesDirectionsAndFrames) {
  CounterRng rng(10, 0);
  const auto moved = [](const auto& f, const auto& x) { return act(f, x); };
  expectAction(SO3d::sampleUniform(rng), S2d(0.3, -0.5, 0.7), moved, "SO3 on S2");
  expectAction(SE3d::sampleUniform(rng), sampleInCube<Frame3d>(rng), moved, "SE3 on Frame3");
  expectAction(SE2d::sampleUniform(rng), sampleInCube<Frame2d>(rng), moved, "SE2 on Frame2");
  expectAction(SE3d::sampleUniform(rng), sampleInCube<OrientedPointd>(rng), moved, "SE3 on oriented points");
}

TEST(Between, ofFeaturesThatAreNoGroup) {
  CounterRng rng(11, 0);
  const auto relative = [](const auto& x, const auto& y) { return between(x, y); };
  const Pair<Frame3d, Frame3d> p(sampleInCube<Frame3d>(rng), sampleInCube<Frame3d>(rng), rng, 1e-3);
  expectDerivative(inCoordinates(p, between(p.a, p.b).mean, relative), p.joint, between(p.a, p.b, p.cross()).covariance,
                   "frames");
  expectSame(between(p.a.mean, p.b), between(Gaussian<Frame3d>{p.a.mean, SquareOf<Frame3d>::Zero()}, p.b), "exact x");
  const Pair<S2d, S2d> d(S2d(0.3, -0.5, 0.7), S2d(0.8, 0.1, 0.2), rng, 1e-3);
  expectDerivative(inCoordinates(d, between(d.a, d.b).mean, relative), d.joint, between(d.a, d.b, d.cross()).covariance,
                   "directions");
  const Pair<Eigen::Vector3d, Eigen::Vector3d> q(Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(3, 2, 2), rng, 0.1);
  expectSame(between(q.a, q.b), {Eigen::Vector3d(2, 0, -1), q.a.covariance + q.b.covariance}, "points");
}

TEST(Propagate, functionsWithTheirJacobian) {
  // The range from the origin; its derivative in the body's axes is tᵀ R/|t|.
  CounterRng rng(12, 0);
  const Pair<SE3d, SO3d> p(SE3d::sampleUniform(rng), SO3d::sampleUniform(rng), rng, 1e-3);
  const auto range = [](const SE3d& x) { return x.translation().norm(); };
  const auto derivative = [](const SE3d& x) {
    JacobianOf<Eigen::Matrix<double, 1, 1>, SE3d> J = Eigen::Matrix<double, 1, 6>::Zero();
    J.leftCols<3>() = x.translation().transpose() * x.rotationMatrix() / x.translation().norm();
    return J;
  };
  const Gaussian<Eigen::Matrix<double, 1, 1>> g = propagate(p.a, range, derivative);
  EXPECT_EQ(g.mean[0], range(p.a.mean));
  expectSame(propagate(p.a, range, derivative(p.a.mean)), g, "matrix or function");
  using Line = Eigen::Matrix<double, 1, 1>;
  expectDerivative(inCoordinates(p, g.mean, [&](const SE3d& x, const SO3d&) { return Line(range(x)); }), p.joint,
                   g.covariance, "range");

  const auto turned = [](const SE3d& x, const SO3d& R) { return x.so3().inverse() * R; };
  const auto by_pose = [](const SE3d& x, const SO3d& R) {
    JacobianOf<SO3d, SE3d> J = JacobianOf<SO3d, SE3d>::Zero();
    J.rightCols<3>() = -(R.inverse() * x.so3()).matrix();
    return J;
  };
  const Eigen::Matrix3d by_rotation = Eigen::Matrix3d::Identity();
  const Gaussian<SO3d> independent = propagate(p.a, p.b, turned, by_pose, by_rotation);
  const Gaussian<SO3d> correlated = propagate(p.a, p.b, p.cross(), turned, by_pose, by_rotation);
  const auto coordinates = inCoordinates(p, independent.mean, turned);
  expectDerivative(coordinates, p.independent(), independent.covariance, "two inputs");
  expectDerivative(coordinates, p.joint, correlated.covariance, "two correlated inputs");
}

TEST(Propagate, viewsAndExpressionsAreEvaluated) {
  CounterRng rng(13, 0);
  const auto pose = randomGaussian<SE3d>(rng, 0.1);
  Eigen::Matrix<double, 3, 6> select = Eigen::Matrix<double, 3, 6>::Zero();
  select.rightCols<3>().setIdentity();
  const Gaussian<SO3d> rotation = propagate(
      pose, [](const SE3d& x) { return x.so3(); }, select);
  EXPECT_EQ(rotation.mean.params(), pose.mean.so3().params());
  EXPECT_EQ(rotation.covariance, (pose.covariance.bottomRightCorner<3, 3>()));
}

}  // namespace
}  // namespace liestat_test
