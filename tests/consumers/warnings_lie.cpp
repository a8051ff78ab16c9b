// A user's unit, compiled without -isystem by run.sh: no header of lie/ may warn in it, whatever it instantiates.
#include <lie/lie.hpp>
#include <lie/testing.hpp>

#include <iostream>
#include <random>

namespace {

template <class M>
double useManifold() {
  using T = liestat::ManifoldTraits<M>;
  using Scalar = liestat::ScalarOf<M>;
  const M x = T::expOrigin(liestat::TangentOf<M>::Constant(Scalar(0.2))), y = T::origin();
  const auto e = liestat::errorVector(x, y);
  Scalar sum = e.z.sum() + e.by_feature.sum() + e.by_base.sum() + liestat::frameTransport(x, y).sum() +
               liestat::actionTransformationJacobian(T::placement(x), y).sum() +
               liestat::log(x, liestat::interpolate(x, y, Scalar(0.5))).sum();
  if constexpr (liestat::Metric<M>) {
    sum += liestat::distance(x, y) + T::hessianHalfSquaredDistance(e.z).sum() + T::injectivityRadius() +
           T::maxSectionalCurvature();
  }
  if constexpr (requires { T::logVolume(e.z); }) sum += T::logVolume(e.z).value;
  return static_cast<double>(sum);
}

template <class G>
double useGroup() {
  using Scalar = typename G::Scalar;
  std::mt19937 generator(1);
  const typename G::Tangent v = G::Tangent::Constant(Scalar(0.2));
  const G x = G::exp(v), y = G::sampleUniform(generator);
  G z = x * y.inverse();
  z *= y;
  z.normalize();
  std::cout << z;
  const auto other = z.template cast<float>();
  return static_cast<double>(x.log().sum() + x.matrix().sum() + x.Adj().sum() + G::ad(v).sum() +
                             G::leftJacobian(v).sum() + G::leftJacobianInverse(v).sum() + G::rightJacobian(v).sum() +
                             G::rightJacobianInverse(v).sum() + G::hat(v).sum() + G::Dx_exp_x(v).sum() +
                             (x * G::Point::Zero().eval()).sum()) +
         static_cast<double>(other.params().sum()) + useManifold<G>();
}

template <class S>
double useAll() {
  using namespace liestat;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const SO3<S> R = SO3<S>::fitToSO3(Eigen::Matrix<S, 3, 3>::Identity());
  const Eigen::Map<const SO3<S>> view(R.data());
  double sum = static_cast<double>((view * Vector3(1, 2, 3)).sum());
  sum += useGroup<SO2<S>>() + useGroup<SO3<S>>() + useGroup<SE2<S>>() + useGroup<SE3<S>>() + useGroup<RxSO2<S>>() +
         useGroup<RxSO3<S>>() + useGroup<Sim2<S>>() + useGroup<Sim3<S>>();
  sum += useManifold<SE23<S>>() + useManifold<Vector3>() + useManifold<S2<S>>() + useManifold<Frame2<S>>() +
         useManifold<Frame3<S>>() + useManifold<SemiOrientedFrame3<S>>() + useManifold<NonOrientedFrame3<S>>() +
         useManifold<OrientedPoint<S>>() + useManifold<Essential<S>>() + useManifold<Product<SO3<S>, Vector3>>();
  return sum;
}

}  // namespace

int main() {
  const liestat::ContractReport report = liestat::checkContract<liestat::SE2d>();
  std::cout << report << useAll<double>() + useAll<float>() << "\n";
  return report.ok() ? 0 : 1;
}
