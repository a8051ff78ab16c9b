// A user's unit with warnings on, see warnings_stats.cpp: constrained estimation on vectors and rotations, with each
// kind of noise and with constraints.
#include <lie/so3.hpp>
#include <stats/constrained.hpp>
#include <stats/implicit_ekf.hpp>
#include <stats/measurement_error.hpp>
#include <stats/measurement_noise.hpp>

#include <tuple>
#include <vector>

using namespace liestat;

namespace {

using Vector2 = Eigen::Vector2d;

/// A point on a line through the origin.
struct OnLine {
  Eigen::Matrix<double, 1, 1> operator()(const Vector2& q, const Vector2& m) const {
    return Eigen::Matrix<double, 1, 1>(q.dot(m));
  }
  EquationDerivatives<1, 2, 2> linearize(const Vector2& q, const Vector2& m) const {
    return {(*this)(q, m), m.transpose(), q.transpose()};
  }
};
struct Turned {
  Eigen::Vector3d operator()(const SO3d& q, const SO3d& m) const { return log(q, m); }
  EquationDerivatives<3, 3, 3> linearize(const SO3d& q, const SO3d& m) const {
    const auto error = errorVector(q, m);
    return {error.z, error.by_base, error.by_feature};
  }
};

template <class Noise>
bool fits(const Noise& noise) {
  const std::vector<Vector2> points(4, Vector2(1, 2));
  const LinearConstraint<1, 2> constraint{Eigen::RowVector2d(1, 1), Eigen::Matrix<double, 1, 1>(1.0)};
  const auto channel = measurements(points, noise, OnLine{});
  return constrainedEstimate(Vector2(1, 0), channel, constraint).ok() &&
         measurementError(Vector2(1, 0), points[0], noise, OnLine{}).equations == 1;
}

}  // namespace

int main() {
  const std::vector<Gaussian<SO3d>> rotations(3);
  const auto turned = measurements(rotations, Turned{});
  ConstrainedEstimator estimator(SO3d(), NoConstraint{}, ConstrainedOptions<SO3d>{}, turned);
  while (estimator.iterate()) {
  }
  const bool fine = fits(IsotropicNoise<2>(1)) && fits(DiagonalNoise<2>(Vector2(1, 2))) &&
                    fits(CovarianceNoise<2>(Eigen::Matrix2d::Identity())) &&
                    fits(InformationNoise<2>(Eigen::Matrix2d::Identity()));
  const auto several = constrainedEstimate(SO3d(), std::tuple(turned, turned), NoConstraint{});
  ImplicitEkf filter(Gaussian<SO3d>{});
  const bool filtered = filter.update(SO3d(), IsotropicNoise<3>(1), Turned{}).ok() &&
                        filter.updateAll([](auto& sums) { sums.add(SO3d(), IsotropicNoise<3>(1), Turned{}); }).ok();
  return fine && filtered && several.ok() && estimator.corrected().size() == 3 ? 0 : 1;
}
