#include <experiments/means_trial.hpp>
#include <experiments/means_validation.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace liestat::experiments {
namespace {

bool listed(const std::vector<Criterion>& criteria, Criterion criterion) {
  return std::find(criteria.begin(), criteria.end(), criterion) != criteria.end();
}

/// Noise that is Gaussian in the measurements' frames leaves LSQ and WLSQ without a V_i in the estimate's frame.
bool hasLeastSquaresNoise(const MeansExperiment& experiment) {
  return !info(experiment.feature).frameMatters() || experiment.covariance_at == CovarianceAt::estimated;
}

/// Logarithm of the ratio of two errors.
double logRatio(double error, double reference) { return std::log(error / reference); }

/// The outcomes of which the reports are made, in the order of the methods that are wanted.
std::vector<MeansOutcome> wantedOutcomes(const MeansExperiment& experiment, const MethodOutcomes& outcomes) {
  std::vector<MeansOutcome> list;
  for (std::size_t m = 0; m < methods.size(); ++m) {
    if (!experiment.wanted[m]) continue;
    const MethodOutcome& o = outcomes[m];
    const bool is_maha = methods[m].criterion == Criterion::maha;
    const MethodOutcome& reference = outcomes[methodIndex({Criterion::maha, methods[m].corrected || is_maha, true})];
    MeansOutcome outcome;
    outcome.mu2 = o.mahalanobis_squared;
    outcome.iterations = o.iterations;
    outcome.log_ratio_rotation = logRatio(o.rotation_error, reference.rotation_error);
    outcome.log_ratio_translation = logRatio(o.translation_error, reference.translation_error);
    list.push_back(outcome);
  }
  return list;
}

/// The next cell: a report for each of the methods that are wanted, in their order.
std::vector<MeansReport> runCell(const MeansExperiment& experiment, CellRun& run) {
  const int k = degreesOfFreedom(experiment.feature);
  std::vector<ReferenceLaw> laws;
  for (std::size_t m = 0; m < methods.size(); ++m) {
    if (!experiment.wanted[m]) continue;
    laws.push_back(methods[m].known_noise ? ReferenceLaw::chiSquared(k)
                                          : ReferenceLaw::hotelling(k, static_cast<int>(experiment.n)));
  }
  return run.reports(16, laws, [&](CounterRng& rng, std::uint64_t) {
    return wantedOutcomes(experiment, meansTrial(experiment, rng));
  });
}

}  // namespace

std::size_t methodIndex(const Method& method) {
  std::size_t i = 0;
  while (i + 1 < methods.size() &&
         !(methods[i].criterion == method.criterion && methods[i].corrected == method.corrected &&
           methods[i].known_noise == method.known_noise)) {
    ++i;
  }
  return i;
}

std::vector<MeansReport> run(const MeansExperiment& experiment, int threads) {
  CellRun alone({experiment.trials, experiment.seed, threads}, {{experiment.trials, 1}}, {});
  return runCell(experiment, alone);
}

double MeansRow::ratio(ErrorRatio of) const {
  return std::exp((of == log_ratio_rotation ? rotation_ratio : translation_ratio).mean);
}
double MeansRow::logDeviation(ErrorRatio of) const {
  return (of == log_ratio_rotation ? rotation_ratio : translation_ratio).standard_deviation;
}

std::vector<MeansRow> validateMeans(const MeansValidation& validation, const RunProgress& progress) {
  struct Cell {
    MeansExperiment experiment;
    MethodMask keep;
  };
  std::vector<Cell> cells;
  std::vector<CellSize> sizes;
  const auto addCell = [&](const MeansExperiment& experiment, const MethodMask& keep) {
    cells.push_back({experiment, keep});
    sizes.push_back({experiment.trials, static_cast<double>(experiment.n * experiment.trials)});
  };
  const std::size_t printed_maha = methodIndex({Criterion::maha, false, true});
  for (const Feature feature : validation.features) {
    std::vector<double> spreads = validation.spreads;
    if (spreads.empty()) spreads = {info(feature).frameMatters() ? 1.0 / 3 : 1.0};
    for (const double spread : spreads) {
      for (const Noise noise : validation.noises) {
        for (const std::size_t n : validation.n) {
          MeansExperiment experiment{.feature = feature,
                                     .noise = noise,
                                     .n = n,
                                     .spread = spread,
                                     .covariance_at = validation.covariance_at,
                                     .trials = validation.run.trials,
                                     .seed = validation.run.seed,
                                     .certify = validation.certify};
          MethodMask keep{};
          for (std::size_t m = 0; m < methods.size(); ++m) {
            keep[m] = listed(validation.criteria, methods[m].criterion) &&
                      (methods[m].criterion == Criterion::maha || hasLeastSquaresNoise(experiment));
          }
          const bool rare = info(feature).frameMatters() && !validation.all_printed && keep[printed_maha];
          MethodMask frequent = keep;
          if (rare) frequent[printed_maha] = false;
          experiment.wanted = frequent;
          // The ratios want MAHA in the same trials.
          if (listed(validation.criteria, Criterion::maha)) {
            experiment.wanted[methodIndex({Criterion::maha, true, true})] = true;
          }
          addCell(experiment, frequent);
          if (rare) {
            MeansExperiment printed = experiment;
            printed.trials = std::max<std::size_t>(1, experiment.trials / 10);
            printed.wanted = {};
            printed.wanted[printed_maha] = printed.wanted[methodIndex({Criterion::maha, true, true})] = true;
            MethodMask only{};
            only[printed_maha] = true;
            addCell(printed, only);
          }
        }
      }
    }
  }

  CellRun run(validation.run, sizes, progress);
  std::vector<MeansRow> rows;
  for (const Cell& r : cells) {
    auto reports = runCell(r.experiment, run);
    if (run.ended()) continue;
    std::size_t next = 0;
    for (std::size_t m = 0; m < methods.size(); ++m) {
      if (!r.experiment.wanted[m]) continue;
      MeansReport& report = reports[next++];
      if (!r.keep[m]) continue;
      MeansRow& row = rows.emplace_back();
      row.experiment = r.experiment;
      row.method = methods[m];
      row.rotation_ratio = report.of(log_ratio_rotation);
      row.translation_ratio = report.of(log_ratio_translation);
      row.setReport(std::move(report));
      if (methods[m].corrected) row.promise = promisedTolerance(r.experiment, methods[m]);
    }
  }
  const auto judged = static_cast<double>(
      std::count_if(rows.begin(), rows.end(), [](const MeansRow& row) { return row.promise.has_value(); }));
  for (MeansRow& row : rows) row.judge(run_false_alarm / judged);
  return rows;
}

Judgement judgementOf(const MeansValidationResult& result) {
  Judgement judgement{.promises = {}, .where = "in the promised domain"};
  for (const MeansRow& row : result.rows) {
    judgement.promises.push_back(promiseAbout(
        row, fmt::format("{} {} n={} spread {:.3g} {} {}", name(row.experiment.feature), name(row.experiment.noise),
                         row.experiment.n, row.experiment.spread, name(row.method.criterion),
                         row.method.known_noise ? "known noise" : "residuals")));
  }
  for (const VerdictRow& row : result.verdicts) {
    judgement.promises.push_back(
        {fmt::format("{} {} {:.3g} n={}", name(row.cell.feature), name(row.cell.law), row.cell.parameter, row.cell.n),
         row.passed, row.failure});
  }
  return judgement;
}

// The tolerances are twice the differences from the law that runs of 4000 trials and more show, which are of second
// order in the noise: docs/validation.md has the table. Where they are not zero, the tail has one too: under noise of
// which a variance may be as small as it likes (idd) the distances of any estimator of first order have no mean.
std::optional<ValidationTolerance> promisedTolerance(const MeansExperiment& experiment, const Method& method) {
  const Feature feature = experiment.feature;
  const std::size_t n = experiment.n;
  const bool maha = method.criterion == Criterion::maha;
  const bool flat = feature == Feature::point;
  // The rotation's spread; beyond these the covariance is not of first order in the noise any more.
  if (!flat && experiment.spread > (info(feature).frameMatters() ? 0.34 : 1.0)) return std::nullopt;

  if (method.known_noise) {
    if (flat) return ValidationTolerance{};
    if (feature == Feature::rotation) {
      // At two, the covariance at the mean is a sixth too small.
      if (n < 5) return std::nullopt;
      return ValidationTolerance{.index = 0.06, .ks = 0.03, .failure_fraction = maha ? 0.002 : 0, .tail = 0.004};
    }
    if (feature == Feature::direction) {
      return maha ? ValidationTolerance{.index = 0.16, .ks = 0.08, .failure_fraction = 0.002, .tail = 0.002}
                  : ValidationTolerance{.index = 0.08, .ks = 0.03, .tail = 0.002};
    }
    // Below, the error of the estimated orientation tilts the noise of ten to one between the axes.
    if (n < (maha ? 10U : 20U)) return std::nullopt;
    return maha ? ValidationTolerance{.index = 0.06, .ks = 0.03, .failure_fraction = 0.002, .tail = 0.006}
                : ValidationTolerance{.index = 0.10, .ks = 0.04, .tail = 0.012};
  }

  // Hotelling's law asks for n > k, and for a variance at least two more.
  if (n < static_cast<std::size_t>(degreesOfFreedom(feature)) + 2) return std::nullopt;
  const bool scaled = experiment.noise == Noise::iid || experiment.noise == Noise::isd;
  // WLSQ takes its weights for the truth: the covariances must be one Σ over them.
  if (method.criterion == Criterion::wlsq && !scaled) return std::nullopt;
  const bool exact = experiment.noise == Noise::iid || method.criterion == Criterion::wlsq;
  if (flat && exact) return ValidationTolerance{};
  if (feature == Feature::direction) return ValidationTolerance{.index = 0.14, .ks = 0.07, .tail = 0.002};
  if (info(feature).frameMatters()) return ValidationTolerance{.index = 0.12, .ks = 0.07, .tail = 0.004};
  return exact ? ValidationTolerance{.index = 0.06, .ks = 0.04, .tail = 0.002}
               : ValidationTolerance{.index = 0.10, .ks = 0.07, .tail = 0.002};
}

}  // namespace liestat::experiments
