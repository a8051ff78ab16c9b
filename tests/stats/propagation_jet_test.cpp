// Jacobians by Jets in local frames: those of the groups' own functions, of functions from and to other manifolds.

#include <lie/lie.hpp>
#include <stats/auto_diff.hpp>

#include <support/propagated.hpp>

#include <type_traits>

namespace liestat_test {
namespace {

using namespace liestat;

const auto product = [](const auto& a, const auto& b) { return a * b; };
const auto range = [](const auto& x) {
  using std::sqrt;  // for double; Jet's is found by its argument
  return sqrt(x.translation().squaredNorm());
};
const auto axis = [](const auto& R) {
  using S = typename std::decay_t<decltype(R)>::Scalar;
  return S2<S>((R * Eigen::Matrix<S, 3, 1>::UnitZ()).eval());
};

TEST(PropagateByJets, agreesWithTheAnalyticOperations) {
  CounterRng rng(1, 0);
  const Pair<SE3d, SE3d> p(SE3d::sampleUniform(rng), SE3d::sampleUniform(rng), rng, 0.1);
  expectSame(propagate(p.a, p.b, product), compose(p.a, p.b), "compose");
  expectSame(propagate(p.a, p.b, p.cross(), product), compose(p.a, p.b, p.cross()), "correlated compose");
  expectSame(propagate(p.a, [](const auto& x) { return x.inverse(); }), inverse(p.a), "inverse");
}

TEST(PropagateByJets, constantsOfTypeDoubleMayOccur) {
  CounterRng rng(2, 0);
  const auto a = randomGaussian<SE3d>(rng, 0.1);
  const SE3d b = SE3d::sampleUniform(rng);
  expectSame(propagate(a, [&](const auto& x) { return x * b; }), compose(a, b), "constant factor");
}

TEST(PropagateByJets, numbersViewsAndExpressions) {
  CounterRng rng(3, 0);
  const auto pose = randomGaussian<SE3d>(rng, 0.1);
  const Eigen::Matrix3d R = pose.mean.rotationMatrix();
  const Gaussian<Eigen::Matrix<double, 1, 1>> distance = propagate(pose, range);
  const Eigen::RowVector3d gradient = pose.mean.translation().normalized().transpose() * R;
  const double variance = gradient * pose.covariance.topLeftCorner<3, 3>() * gradient.transpose();
  EXPECT_NEAR(distance.covariance(0, 0), variance, 1e-14);
  const Gaussian<SO3d> rotation = propagate(pose, [](const auto& x) { return x.so3(); });
  EXPECT_LT((rotation.covariance - pose.covariance.bottomRightCorner<3, 3>()).norm(), 1e-14);
  const Gaussian<Eigen::Vector3d> position = propagate(pose, [](const auto& x) { return x.translation(); });
  EXPECT_LT((position.covariance - R * pose.covariance.topLeftCorner<3, 3>() * R.transpose()).norm(), 1e-14);
}

TEST(PropagateByJets, toAnotherManifoldAndInFloat) {
  CounterRng rng(4, 0);
  const auto rotation = randomGaussian<SO3d>(rng, 0.1);
  expectSame(propagate(rotation, axis), act(rotation, S2d()), "axis");
  const Eigen::Matrix<float, 2, 3> J = jacobian(axis, rotation.mean.cast<float>());
  // Some roundings of float.
  EXPECT_LT((J.cast<double>() - jacobian(axis, rotation.mean)).norm(), 2e-6);
}

TEST(JacobianByJets, ofExpAndLog) {
  // exp from R^6 to SE3 has the right Jacobian as its derivative, log its inverse: at zero, near it, and far from it.
  const auto to_group = [](const auto& v) { return SE3<typename std::decay_t<decltype(v)>::Scalar>::exp(v); };
  const auto to_vector = [](const auto& x) { return x.log(); };
  const Eigen::Matrix<double, 6, 1> direction = (Eigen::Matrix<double, 6, 1>() << 1, 2, 3, 0.3, -0.5, 0.7).finished();
  for (const double size : {0.0, 1e-9, 1.0}) {
    const Eigen::Matrix<double, 6, 1> v = size * direction;
    EXPECT_LT((jacobian(to_group, v) - SE3d::rightJacobian(v)).norm(), 1e-14) << size;
    EXPECT_LT((jacobian(to_vector, SE3d::exp(v)) - SE3d::rightJacobianInverse(v)).norm(), 1e-14) << size;
  }
}

}  // namespace
}  // namespace liestat_test
