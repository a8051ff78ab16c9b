// Accuracy of the manifolds made of several parts, at every decade of the angle, against references in 50 digits. The
// measure and the bar are those of accuracy_test.cpp, with every vector of the tangent that is not a rotation of norm
// one.

#include <support/high_precision.hpp>

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

}  // namespace
