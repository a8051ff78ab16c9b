// Accuracy of the manifolds made of several parts, at every decade of the angle, against references in 50 digits. The
// measure and the bar are those of accuracy_test.cpp, with every vector of the tangent that is not a rotation of norm
// one.

#include <support/accuracy_bar.hpp>

#include <algorithm>
#include <vector>

namespace {

using namespace liestat_test;

template <class S>
void checkSE23() {
  Table worst;
  std::vector<double> angles = sweptAngles<S>();
  angles.push_back(EIGEN_PI);
  for (const double angle : angles) {
    std::vector<typename liestat::SE23<S>::Tangent> list;
    for (const auto& pose : tangents<S, 6>(angle, 3)) {
      typename liestat::SE23<S>::Tangent v;
      // A velocity of norm one that goes with the position in none of the coordinates.
      v << pose, Eigen::Matrix<S, 3, 1>(pose[1], -pose[2], pose[0]);
      list.push_back(v);
    }
    sweepGroup<liestat::SE23<S>>(worst, angle, list);
  }
  expectWithinBar<S>("SE23", worst);
}
TEST(AccuracyFurther, SE23) { checkSE23<double>(), checkSE23<float>(); }

template <class S>
void checkPartsOfTwo() {
  Table point, essential;
  sweepManifold<liestat::OrientedPoint<S>>(point, sweptAngles<S>(), 3);
  sweepManifold<liestat::Essential<S>>(essential, sweptAngles<S>(), 0);
  for (const double angle : sweptAngles<S>()) {
    for (const auto& v : tangents<S, 5>(angle, 0)) {
      using T = liestat::ManifoldTraits<liestat::Essential<S>>;
      // The reference takes the rounded parameters: E = [d] R.
      const auto x = T::expOrigin(v);
      const Matrix p(x.params());
      const Matrix R = series(crossMatrix(quaternionLog(p)), 0), E = crossMatrix({p.a[4], p.a[5], p.a[6]}) * R;
      essential["essentialMatrix"].see(error(x.essentialMatrix(), E), angle);
      // And back: one of the four is the pose that the rounded matrix came from.
      Eigen::Matrix<S, 3, 3> rounded;
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) rounded(i, j) = static_cast<S>(E.at(i, j));
      }
      double nearest = 10;
      for (const auto& y : liestat::decomposeEssential(rounded)) {
        const double sign = y.so3().params().dot(x.so3().params()) < 0 ? -1 : 1;
        typename liestat::Essential<S>::Params params = y.params();
        params.template head<4>() *= static_cast<S>(sign);
        nearest = std::min(nearest, error(params, p));
      }
      essential["decomposeEssential"].see(nearest, angle);
    }
  }
  expectWithinBar<S>("OrientedPoint", point);
  expectWithinBar<S>("Essential", essential);
}
TEST(AccuracyFurther, OrientedPointAndEssential) { checkPartsOfTwo<double>(), checkPartsOfTwo<float>(); }

}  // namespace
