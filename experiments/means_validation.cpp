#include <experiments/interruption.hpp>
#include <experiments/means_validation.hpp>

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

}  // namespace

double MeansRow::ratio(ErrorRatio of) const {
  return std::exp((of == log_ratio_rotation ? rotation_ratio : translation_ratio).mean);
}
double MeansRow::logDeviation(ErrorRatio of) const {
  return (of == log_ratio_rotation ? rotation_ratio : translation_ratio).standard_deviation;
}

std::vector<MeansRow> validateMeans(const MeansValidation& validation,
                                    const std::function<void(std::uint64_t, std::uint64_t)>& progress) {
  struct Run {
    MeansExperiment experiment;
    MethodMask keep;
  };
  std::vector<Run> runs;
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
                                     .trials = validation.trials,
                                     .seed = validation.seed,
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
          runs.push_back({experiment, frequent});
          if (rare) {
            MeansExperiment printed = experiment;
            printed.trials = std::max<std::size_t>(1, validation.trials / 10);
            printed.wanted = {};
            printed.wanted[printed_maha] = printed.wanted[methodIndex({Criterion::maha, true, true})] = true;
            MethodMask only{};
            only[printed_maha] = true;
            runs.push_back({printed, only});
          }
        }
      }
    }
  }

  // Work goes with the number of measurements.
  const auto work = [](const MeansExperiment& e) { return static_cast<std::uint64_t>(e.n); };
  std::uint64_t all = 0, before = 0;
  for (const Run& r : runs) {
    all += work(r.experiment) * r.experiment.trials;
    trials_of_run.planned += r.experiment.trials;
  }

  std::vector<MeansRow> rows;
  for (const Run& r : runs) {
    auto reports = run(r.experiment, validation.threads, [&](std::size_t done, std::size_t) {
      if (progress) progress(before + work(r.experiment) * done, all);
    });
    before += work(r.experiment) * r.experiment.trials;
    if (!countTrials(reports.empty() ? r.experiment.trials : reports[0].trials)) break;
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
