// An ellipse through noisy points, with its covariance: constrained estimation (docs/constrained.md).
//
// A conic has six coefficients q up to scale, so ‖q‖ = 1 is a constraint, and a point m lies on it if one equation
// holds. Both coordinates of each point are noisy: neither is a function of the other.
#include <stats/auto_diff.hpp>
#include <stats/constrained.hpp>
#include <stats/random.hpp>

#include <cmath>
#include <cstdio>
#include <vector>

namespace {

struct OnConic {
  template <class S>
  Eigen::Matrix<S, 1, 1> operator()(const Eigen::Matrix<S, 6, 1>& q, const Eigen::Matrix<S, 2, 1>& m) const {
    const S x = m[0], y = m[1];
    return Eigen::Matrix<S, 1, 1>(q[0] * x * x + q[1] * x * y + q[2] * y * y + q[3] * x + q[4] * y + q[5]);
  }
};
struct UnitLength {
  template <class S>
  Eigen::Matrix<S, 1, 1> operator()(const Eigen::Matrix<S, 6, 1>& q) const {
    return Eigen::Matrix<S, 1, 1>(q.squaredNorm() - S(1));
  }
};

}  // namespace

int main() {
  using namespace liestat;
  constexpr double sigma = 0.02;
  constexpr int n = 30;
  CounterRng rng(1);
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < n; ++i) {
    const double angle = 0.2 * i;
    points.push_back(Eigen::Vector2d(2 * std::cos(angle), std::sin(angle)) + sigma * rng.normalVector<2>());
  }

  const auto on_conic = measurements(points, IsotropicNoise<2>(sigma), autoDiff(OnConic{}));
  const auto unit_length = autoDiff(UnitLength{});
  Eigen::Matrix<double, 6, 1> start;
  start << 1, 0, 1, 0, 0, -1;  // a circle
  ConstrainedEstimator estimator(start, unit_length, ConstrainedOptions<Eigen::Matrix<double, 6, 1>>{}, on_conic);
  while (estimator.iterate()) {
  }
  const auto& result = estimator.result();
  std::printf("%s after %d steps, chi2 %.1f for %d degrees of freedom\n", name(result.end), result.iterations,
              result.chi2, result.degrees_of_freedom);
  if (!result.ok()) return 1;
  std::printf("coefficients        x2       xy       y2        x        y        1\nestimate    ");
  for (int k = 0; k < 6; ++k) std::printf(" %8.4f", result.parameter[k]);
  std::printf("\nsigma       ");
  for (int k = 0; k < 6; ++k) std::printf(" %8.4f", std::sqrt(result.covariance(k, k)));
  const Eigen::Vector2d moved = estimator.correction(0);
  const auto left = estimator.correctedCovariance(0);
  std::printf("\nthe first point was moved by (%.4f, %.4f); its standard deviation fell from %.3f to (%.3f, %.3f)\n",
              moved.x(), moved.y(), sigma, std::sqrt(left(0, 0)), std::sqrt(left(1, 1)));

  // The truth is x²/4 + y² = 1, of the sign of the estimate.
  Eigen::Matrix<double, 6, 1> truth;
  truth << 0.25, 0, 1, 0, 0, -1;
  truth *= (truth.dot(result.parameter) > 0 ? 1 : -1) / truth.norm();
  const bool near = (result.parameter - truth).cwiseAbs().maxCoeff() < 5 * std::sqrt(result.covariance.trace());
  return near ? 0 : 1;
}
