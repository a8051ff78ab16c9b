// An ellipse among points of which half lie anywhere: robust search (docs/robust.md), and the covariance of what it
// finds (docs/constrained.md).
#include <stats/auto_diff.hpp>
#include <stats/constrained.hpp>
#include <stats/measurement_error.hpp>
#include <stats/robust_search.hpp>

#include <Eigen/LU>

#include <cmath>
#include <cstdio>
#include <optional>
#include <span>
#include <vector>

namespace {

using namespace liestat;
using Conic = Eigen::Matrix<double, 6, 1>;

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

/// The model that the search is given: how many points determine a conic, which one they determine, and how far points
/// are from it.
struct ConicModel {
  using Parameter = Conic;
  static constexpr std::size_t sample_size = 5;
  std::vector<Eigen::Vector2d> points;
  IsotropicNoise<2> noise;

  std::size_t size() const { return points.size(); }
  void solve(std::span<const std::size_t> sample, std::vector<Conic>& solutions) const {
    Eigen::Matrix<double, 5, 6> rows;
    for (int k = 0; k < 5; ++k) {
      const Eigen::Vector2d& p = points[sample[static_cast<std::size_t>(k)]];
      rows.row(k) << p.x() * p.x(), p.x() * p.y(), p.y() * p.y(), p.x(), p.y(), 1;
    }
    const Eigen::FullPivLU<Eigen::Matrix<double, 5, 6>> lu(rows);
    if (lu.rank() == 5) solutions.push_back(Conic(lu.kernel().col(0).normalized()));
  }
  void errors(const Conic& q, std::span<double> out) const {
    const auto equation = autoDiff(OnConic{});
    for (std::size_t i = 0; i < points.size(); ++i) out[i] = measurementError(q, points[i], noise, equation).squared;
  }
  auto estimate(const Conic& q, std::span<const std::size_t> inliers) const {
    std::vector<Eigen::Vector2d> chosen;
    for (const std::size_t i : inliers) chosen.push_back(points[i]);
    return constrainedEstimate(q, measurements(chosen, noise, autoDiff(OnConic{})), autoDiff(UnitLength{}));
  }
  std::optional<Conic> refine(const Conic& q, std::span<const std::size_t> inliers) const {
    const auto result = estimate(q, inliers);
    return result.ok() ? std::optional<Conic>(result.parameter) : std::nullopt;
  }
};

}  // namespace

int main() {
  CounterRng rng(1);
  ConicModel model{{}, IsotropicNoise<2>(0.01)};
  for (int i = 0; i < 120; ++i) {
    const double angle = 0.1 * i;
    const Eigen::Vector2d on(2 * std::cos(angle), std::sin(angle)), anywhere(rng.uniform(-3, 3), rng.uniform(-2, 2));
    model.points.push_back(i % 2 == 0 ? on + 0.01 * rng.normalVector<2>() : anywhere);
  }

  constexpr double threshold = 6.6349;  // χ²_{0.99} of one equation
  RobustSearch search(model, Relevance{2 * threshold}, {.inlier_threshold = threshold});
  const auto stop = anyOf(NoGainFor{500}, DrawsReached{5000});
  while (!search.confidenceReached(0.999) && !stop(search.history(), search.draws())) search.iterate();
  for (const auto& entry : search.history().entries())
    std::printf("draw %4zu  relevance %.3f\n", entry.draw, entry.score);
  const auto found = search.refined();
  if (!found.parameter) return 1;
  const auto result = model.estimate(*found.parameter, found.inliers);
  std::printf("%zu inliers after %zu draws, chi2 %.1f for %d degrees of freedom\n", found.inliers.size(),
              search.draws(), result.chi2, result.degrees_of_freedom);
  for (int k = 0; k < 6; ++k) std::printf(" %8.4f ± %.4f", result.parameter[k], std::sqrt(result.covariance(k, k)));
  std::printf("\n");

  Conic truth;  // x²/4 + y² = 1, of the sign of the estimate
  truth << 0.25, 0, 1, 0, 0, -1;
  truth *= (truth.dot(result.parameter) > 0 ? 1 : -1) / truth.norm();
  const bool near = (result.parameter - truth).cwiseAbs().maxCoeff() < 5 * std::sqrt(result.covariance.trace());
  return near && found.inliers.size() >= 55 && found.inliers.size() <= 70 ? 0 : 1;
}
