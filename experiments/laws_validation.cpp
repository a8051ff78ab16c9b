#include <experiments/laws_validation.hpp>

#include <stats/random.hpp>

#include <algorithm>
#include <cmath>

namespace liestat::experiments {
namespace {

struct LawTrial {
  bool ok = false, outside = false, largest = false, least = false, refuted = false, asymmetric = false;
};

LawTrial fitted(LawModel model, double kappa, std::size_t n, CounterRng& rng) {
  const int p = parametersOf(model), q = model == LawModel::bingham ? 2 : p == 4 ? 3 : 1;
  const int axes = model == LawModel::bingham ? 3 : dofOf(model);
  const DirectionalLaw law{model, Eigen::VectorXd::Unit(p, p - 1), Eigen::MatrixXd::Identity(axes, axes),
                           Eigen::VectorXd::Constant(q, kappa)};
  Eigen::MatrixXd rows(static_cast<Eigen::Index>(n), p);
  for (Eigen::Index i = 0; i < rows.rows(); ++i) rows.row(i) = law.sample(rng).transpose();
  const LawFit fit = fitLaw(model, rows);
  const bool both_signs = model != LawModel::vmf && model != LawModel::von_mises;
  const double cosine = fit.law.location.dot(fit.girdle ? Eigen::VectorXd::Unit(3, 0) : law.location);
  const double angle = (p == 4 ? 2 : 1) * std::acos(std::min(1.0, both_signs ? std::abs(cosine) : cosine));
  const auto within = [&](Eigen::Index i) {
    return i < fit.law.kappa.size() && std::abs(fit.law.kappa[i] - kappa) < 1.96 * fit.kappaDeviation(i);
  };
  return {fit.ok(),      !(angle < fit.alpha95()),           within(0),
          within(q - 1), fit.status == Status::inconsistent, fit.symmetry.p < 0.05};
}

}  // namespace

std::vector<LawRow> validateLaws(const LawsValidation& validation, const RunProgress& progress) {
  std::vector<LawRow> cells, rows;
  std::vector<CellSize> sizes;
  for (const std::size_t n : validation.sizes) {
    for (const double kappa : validation.kappas) {
      for (const LawModel law : validation.laws) {
        const bool rotations = parametersOf(law) == 4, wrapped = law == LawModel::wrapped_normal;
        if (rotations && n < 18) continue;
        cells.push_back({law, kappa, n});
        sizes.push_back({std::max<std::size_t>(1, validation.run.trials / (wrapped ? 4 : 1)), wrapped ? 40.0 : 1.0});
      }
    }
  }
  CellRun run(validation.run, sizes, progress);
  for (LawRow& cell : cells) {
    const auto stream = static_cast<std::uint32_t>(&cell - cells.data());
    const std::vector<LawTrial> trials = run.outcomes([&](std::uint64_t number) {
      CounterRng rng(validation.run.seed, number, stream);
      return fitted(cell.law, cell.kappa, cell.n, rng);
    });
    if (run.ended()) continue;
    cell.trials = trials.size();
    Rate ok{"ok"}, outside{"outside of the region", 0, 0, 0, 0.07}, largest{"largest kappa", 0, 0, 0.93, 1};
    Rate least{"least kappa", 0, 0, 0.93, 1}, refuted{"refuted", 0, 0, 0, 0.001}, asymmetric{"symmetry"};
    for (const LawTrial& trial : trials) {
      ok.add(trial.ok), refuted.add(trial.refuted);
      if (cell.law != LawModel::von_mises) asymmetric.add(trial.asymmetric);
      if (trial.ok) outside.add(trial.outside), largest.add(trial.largest), least.add(trial.least);
    }
    // Those few that pass the tests lie closer together than their law has them.
    Rate ok_and_outside{"ok and outside", outside.count, ok.of, 0, 0.07};
    if (2 * ok.count < ok.of) outside.high = 1, largest.low = least.low = 0;
    cell.rates = {ok, outside, largest, least, refuted, asymmetric, ok_and_outside};
    rows.push_back(cell);
  }
  judgeRates(rows);
  return rows;
}

}  // namespace liestat::experiments
