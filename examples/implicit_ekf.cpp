// A filter without a measurement function: the direction of motion of a camera that does not turn, from the normals of the
// planes in which points are seen to move. Each normal n is orthogonal to the direction x, n·x = 0: an equation between
// state and measurement, which nobody can solve for n.

#include <lie/s2.hpp>
#include <lie/units.hpp>
#include <stats/implicit_ekf.hpp>
#include <stats/random.hpp>

#include <cmath>
#include <cstdio>

namespace {

using namespace liestat;

/// n·x = 0 with its derivatives in local frames: x moves by the axes of its placement.
struct Orthogonal {
  EquationDerivatives<1, 2, 3> linearize(const S2d& x, const Eigen::Vector3d& n) const {
    const Eigen::Matrix<double, 3, 2> axes = ManifoldTraits<S2d>::placement(x).matrix().leftCols<2>();
    const Eigen::Vector3d d = x.unit_vector();
    return {Eigen::Matrix<double, 1, 1>(d.dot(n)), n.transpose() * axes, d.transpose()};
  }
};

}  // namespace

int main() {
  using units::degree;
  const double sigma = 0.02;
  CounterRng random(1);
  Eigen::Vector3d truth = Eigen::Vector3d(0.2, -0.1, 1).normalized();

  // Twenty degrees off, and known to be.
  const S2d start(Eigen::Vector3d(truth + Eigen::Vector3d(0.3, 0.2, 0)).normalized());
  ImplicitEkf filter(Gaussian<S2d>{start, std::pow(20 * degree, 2) * Eigen::Matrix2d::Identity()});
  double nis = 0, degrees_of_freedom = 0;
  for (int frame = 0; frame < 20; ++frame) {
    // The direction wanders by a tenth of a degree.
    truth = (truth + 0.1 * degree * random.normalVector<3>()).normalized();
    filter.predict(std::pow(0.1 * degree, 2) * Eigen::Matrix2d::Identity());
    Eigen::Matrix<double, 3, 10> normals;
    for (int i = 0; i < 10; ++i) {
      const Eigen::Vector3d seen = random.unitVector<3>();
      const Eigen::Vector3d noise = sigma * random.normalVector<3>();
      normals.col(i) = truth.cross(seen).normalized() + noise;
    }
    const auto update = filter.updateAll([&](auto& sums) {
      for (int i = 0; i < 10; ++i) {
        sums.add(Eigen::Vector3d(normals.col(i)), IsotropicNoise<3>(sigma), Orthogonal{});
      }
    });
    if (!update.ok()) return 1;
    if (frame > 0) nis += update.nis, degrees_of_freedom += update.degrees_of_freedom;
  }
  const Gaussian<S2d>& state = filter.state();
  const double squared = mahalanobisSquared(state, S2d(truth));
  std::printf("off by %.2f degrees, standard deviations %.2f and %.2f; squared distance %.2f, 2 expected\n",
              std::acos(state.mean.unit_vector().dot(truth)) / degree, std::sqrt(state.covariance(0, 0)) / degree,
              std::sqrt(state.covariance(1, 1)) / degree, squared);
  std::printf("innovations: %.1f with %.0f degrees of freedom\n", nis, degrees_of_freedom);
  // Exceeded once in a thousand times, and four standard deviations of χ².
  return squared < 13.8 && std::abs(nis - degrees_of_freedom) < 4 * std::sqrt(2 * degrees_of_freedom) ? 0 : 1;
}
