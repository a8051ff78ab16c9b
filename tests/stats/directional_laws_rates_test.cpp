// How often fits of simulated laws are ok, with the true location in the region and the true κ within 1.96 standard
// deviations: the table of docs/laws.md.
#include <stats/directional_laws.hpp>
#include <stats/random.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

using namespace liestat;

namespace {

int trialsOf() {
  const char* const given = std::getenv("LIESTAT_TRIALS");
  return given == nullptr ? 400 : std::atoi(given);
}

/// All κ equal, where sorting biases them most.
void judge(LawModel model, double kappa, int n) {
  const int trials = model == LawModel::wrapped_normal ? trialsOf() / 4 : trialsOf(), p = parametersOf(model);
  const int q = model == LawModel::bingham ? 2 : p == 4 ? 3 : 1, axes = model == LawModel::bingham ? 3 : dofOf(model);
  DirectionalLaw law{model, Eigen::VectorXd::Unit(p, p - 1), Eigen::MatrixXd::Identity(axes, axes),
                     Eigen::VectorXd::Constant(q, kappa)};
  int ok = 0, outside = 0, within = 0, refuted = 0, asymmetric = 0;
  for (int trial = 0; trial < trials; ++trial) {
    CounterRng rng(static_cast<std::uint64_t>(trial), 7001);
    Eigen::MatrixXd rows(n, p);
    for (int i = 0; i < n; ++i) rows.row(i) = law.sample(rng).transpose();
    const LawFit fit = fitLaw(model, rows);
    refuted += fit.status == Status::inconsistent ? 1 : 0, asymmetric += fit.symmetry.p < 0.05 ? 1 : 0;
    if (!fit.ok()) continue;
    ++ok;
    const double cosine = fit.law.location.dot(fit.girdle ? Eigen::VectorXd::Unit(3, 0) : law.location);
    const double angle = model == LawModel::vmf || model == LawModel::von_mises
                             ? std::acos(std::min(1.0, cosine))
                             : (p == 4 ? 2 : 1) * std::acos(std::min(1.0, std::abs(cosine)));
    outside += angle < fit.alpha95() ? 0 : 1;
    within += std::abs(fit.law.kappa[0] - kappa) < 1.96 * fit.kappaDeviation(0) ? 1 : 0;
  }
  const auto percent = [](int count, int of) { return of > 0 ? 100.0 * count / of : 0.0; };
  std::printf("| `%s` | %g | %d | %.0f | %.1f | %.1f | %.1f | %.1f |\n", name(model), kappa, n, percent(ok, trials),
              percent(outside, trials), percent(within, ok), percent(refuted, trials), percent(asymmetric, trials));
  std::fflush(stdout);
  // 5 % and four standard errors.
  const double error = 400 * std::sqrt(0.05 * 0.95 / trials);
  EXPECT_LE(percent(outside, trials), 5 + error) << name(model) << ", " << kappa << ", " << n;
  EXPECT_LE(percent(refuted, trials), 0.1 + 400 * std::sqrt(0.001 / trials))
      << name(model) << ", " << kappa << ", " << n;
  if (ok > trials / 2) {
    EXPECT_GE(percent(within, ok), 93 - error) << name(model) << ", " << kappa << ", " << n;
  }
}

TEST(DirectionalLawsRates, okIsRight) {
  for (const int n : {10, 20, 50}) {
    for (const double kappa : {1.0, 2.0, 5.0, 50.0}) {
      judge(LawModel::vmf, kappa, n);
      judge(LawModel::von_mises, kappa, n);
      if (kappa > 2) judge(LawModel::bingham, kappa, n);
      if (kappa > 2 && n > 10) judge(LawModel::matrix_fisher, kappa, n);
    }
    if (n > 10) judge(LawModel::wrapped_normal, 50, n);
  }
}

}  // namespace
