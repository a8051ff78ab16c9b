#include <experiments/vi_init_validation.hpp>

#include <experiments/parallel.hpp>
#include <stats/executor.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace liestat::experiments {
namespace {

using Check = ViInitCheck;
using Estimator = ViInitEstimator;
using Quantity = ViInitQuantity;

/// A kind of window and what each of its trials gives. A column of χ² per degree of freedom takes two numbers.
struct Experiment {
  Check check;
  ViInitTrial trial;
  ViInitWindow window;
  std::vector<std::pair<Estimator, Quantity>> columns;

  /// Milliseconds of a trial, about: for the progress bar.
  double work() const {
    const double observations = static_cast<double>(window.images * window.features);
    return (check == Check::consistency ? 0.018 : 0.004) * observations;
  }
};

std::vector<Experiment> experiments(const ViInitValidation& validation) {
  using Q = Quantity;
  const auto errorsOf = [](std::vector<Estimator> estimators) {
    std::vector<std::pair<Estimator, Quantity>> columns;
    for (const Estimator e : estimators) {
      for (const Q q : {Q::speed, Q::gravity, Q::scale}) columns.emplace_back(e, q);
    }
    return columns;
  };
  std::vector<Experiment> list;
  const Estimator refinement = Estimator::refinement;
  for (const ViInitWindow& window : {ViInitWindow{1, 11, 20}, ViInitWindow{2, 11, 20}, ViInitWindow{2, 21, 20},
                                     ViInitWindow{3, 16, 20}, ViInitWindow{2, 21, 50}}) {
    list.push_back({Check::consistency,
                    refinementTrial,
                    window,
                    {{refinement, Q::nees_v},
                     {refinement, Q::nees_v_g},
                     {refinement, Q::nees_all},
                     {refinement, Q::nees_last_state},
                     {refinement, Q::chi2_per_dof},
                     {refinement, Q::speed},
                     {refinement, Q::gravity},
                     {refinement, Q::scale},
                     {refinement, Q::scale_of_features}}});
  }
  const Estimator plain = Estimator::closed_form, with_bias = Estimator::closed_form_with_bias;
  for (const ViInitWindow& window : {ViInitWindow{1, 11, 20}, ViInitWindow{2, 21, 20}, ViInitWindow{4, 41, 20}}) {
    list.push_back({Check::closed_form, closedFormNeesTrial, window, {{plain, Q::nees_v_g}, {plain, Q::chi2_per_dof}}});
  }
  for (const ViInitWindow& window : {ViInitWindow{2, 21, 20}, ViInitWindow{3, 31, 20}, ViInitWindow{4, 41, 20}}) {
    list.push_back({Check::closed_form,
                    closedFormBiasNeesTrial,
                    window,
                    {{with_bias, Q::nees_v_g}, {with_bias, Q::nees_all}, {with_bias, Q::chi2_per_dof}}});
  }
  for (const ViInitWindow& window :
       {ViInitWindow{1, 11, 20}, ViInitWindow{2, 21, 20}, ViInitWindow{3, 31, 20}, ViInitWindow{4, 41, 20}}) {
    list.push_back({Check::accuracy, closedFormErrorsTrial, window, errorsOf({plain, Estimator::least_squares})});
  }
  const Estimator estimated = Estimator::bias_estimated, ignored = Estimator::bias_ignored;
  list.push_back({Check::gyroscope_bias,
                  gyroscopeBiasTrial,
                  {2, 21, 20},
                  {{estimated, Q::bias},
                   {estimated, Q::gravity},
                   {estimated, Q::scale},
                   {ignored, Q::gravity},
                   {ignored, Q::scale}}});
  Experiment drift{
      Check::drift, driftTrial, {2, 21, 40}, errorsOf({Estimator::robust, Estimator::oracle, Estimator::no_selection})};
  drift.columns.insert(drift.columns.begin(), {Estimator::robust, Q::selection});
  list.push_back(std::move(drift));

  const auto unwanted = [&](const Experiment& e) {
    return std::find(validation.checks.begin(), validation.checks.end(), e.check) == validation.checks.end() ||
           (!validation.windows.empty() && std::find(validation.windows.begin(), validation.windows.end(),
                                                     e.window.seconds) == validation.windows.end());
  };
  list.erase(std::remove_if(list.begin(), list.end(), unwanted), list.end());
  return list;
}

/// All trials, one after the other.
std::vector<std::vector<double>> run(const Experiment& e, const ViInitValidation& validation,
                                     const std::function<void(std::size_t)>& progress) {
  using Trials = std::vector<std::vector<double>>;
  const std::size_t n_chunks = chunkCount(validation.trials, 8);
  return ProgramExecutor{validation.threads}.reduce(
      n_chunks,
      [&](std::size_t chunk) {
        Trials part;
        const ChunkRange range = chunkRange(validation.trials, n_chunks, chunk);
        for (std::size_t i = range.begin; i < range.end; ++i) {
          CounterRng rng(validation.seed, i);
          part.push_back(e.trial(e.window, validation.noise, rng));
        }
        return part;
      },
      [&](Trials& done, const Trials& next) {
        done.insert(done.end(), next.begin(), next.end());
        progress(done.size());
      });
}

int degreesOfFreedom(Estimator estimator, Quantity quantity) {
  switch (quantity) {
    case Quantity::nees_v:
      return 3;
    case Quantity::nees_v_g:
      return 5;
    case Quantity::nees_all:
      return estimator == Estimator::refinement ? 11 : 8;
    case Quantity::nees_last_state:
      return 9;
    default:
      return 0;
  }
}

ValidationReport reportOf(const std::vector<double>& distances, int dof) {
  return validate(SerialExecutor{}, {.trials = distances.size()}, ReferenceLaw::chiSquared(dof),
                  [&](CounterRng&, std::uint64_t i) {
                    TrialOutcome outcome;
                    outcome.mu2 = distances[static_cast<std::size_t>(i)];
                    return outcome;
                  });
}

/// The value that a share p of the windows is below; lost ones count as infinite.
double quantile(const std::vector<double>& sorted, double p) {
  if (sorted.empty()) return std::numeric_limits<double>::quiet_NaN();
  return sorted[static_cast<std::size_t>(p * static_cast<double>(sorted.size() - 1))];
}

/// Whether more windows are beyond a bound than a probability of that explains.
bool exceeds(const std::vector<double>& sorted, double bound, double probability, double false_alarm) {
  const auto beyond = static_cast<std::size_t>(sorted.end() - std::upper_bound(sorted.begin(), sorted.end(), bound));
  return !(binomialSurvival(beyond, sorted.size(), std::min(1., probability)) >= false_alarm);
}

std::string judgeErrors(const std::vector<double>& sorted, const ViInitPromise& promise, double false_alarm) {
  const double share = false_alarm / 4, n = static_cast<double>(promise.note_windows);
  if (exceeds(sorted, promise.median, 0.5, share)) return "the median is above the promised one";
  if (exceeds(sorted, promise.p95, 0.05, share)) return "the 95 % quantile is above the promised one";
  // The note's figures are those of some windows themselves: four standard errors of their ranks.
  if (exceeds(sorted, promise.note_median, 0.5 + 4 * std::sqrt(0.25 / n), share)) {
    return "the median is above the design note's";
  }
  if (exceeds(sorted, promise.note_p95, 0.05 + 4 * std::sqrt(0.05 * 0.95 / n), share)) {
    return "the 95 % quantile is above the design note's";
  }
  return {};
}

bool isError(Quantity quantity) {
  switch (quantity) {
    case Quantity::speed:
    case Quantity::gravity:
    case Quantity::scale:
    case Quantity::scale_of_features:
    case Quantity::bias:
      return true;
    default:
      return false;
  }
}

/// Fills in a row from its column, and judges it if `false_alarm` is given.
void evaluate(ViInitRow& row, std::vector<double> values, const std::vector<double>& dofs, double false_alarm) {
  row.trials = values.size();
  row.failures =
      static_cast<std::size_t>(std::count_if(values.begin(), values.end(), [](double x) { return !std::isfinite(x); }));
  const bool judged = row.promise.has_value();
  const ViInitPromise promise = row.promise.value_or(ViInitPromise{});
  if (isError(row.quantity)) {
    std::sort(values.begin(), values.end());
    row.median = quantile(values, 0.5);
    row.p95 = quantile(values, 0.95);
    if (judged) row.reason = judgeErrors(values, promise, false_alarm);
  } else if (const int dof = degreesOfFreedom(row.estimator, row.quantity); dof > 0) {
    row.report = reportOf(values, dof);
    if (judged) row.reason = row.report->reasonToFail(false_alarm, promise.tolerance);
    row.report->mu2 = {};
  } else if (row.quantity == Quantity::chi2_per_dof) {
    double cost = 0, all = 0;
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (!std::isfinite(values[i])) continue;
      cost += values[i];
      all += dofs[i];
    }
    row.value = cost / all;
    row.value_se = std::sqrt(2 / all);
    if (judged && !(chiSquaredSurvival(cost / (1 + promise.deviation), all) >= false_alarm / 2)) {
      row.reason = "χ² is too large for its degrees of freedom";
    } else if (judged && !(chiSquaredCdf(cost / (1 - promise.deviation), all) >= false_alarm / 2)) {
      row.reason = "χ² is too small for its degrees of freedom";
    }
  } else {
    const auto n = static_cast<double>(values.size());
    const auto exact = static_cast<double>(std::count(values.begin(), values.end(), 1.));
    row.value = exact / n;
    row.value_se = std::sqrt(promise.fraction * (1 - promise.fraction) / n);
    const std::size_t wrong = values.size() - static_cast<std::size_t>(exact);
    if (judged && !(binomialSurvival(wrong, values.size(), 1 - promise.fraction) >= false_alarm)) {
      row.reason = "the right tracks were kept too seldom";
    }
  }
  if (judged) row.passed = row.reason.empty();
}

}  // namespace

std::string name(ViInitCheck check) {
  switch (check) {
    case Check::consistency:
      return "consistency";
    case Check::closed_form:
      return "closed_form";
    case Check::accuracy:
      return "accuracy";
    case Check::gyroscope_bias:
      return "gyroscope_bias";
    case Check::drift:
      return "drift";
  }
  return "";
}

std::string name(ViInitEstimator estimator) {
  switch (estimator) {
    case Estimator::refinement:
      return "refinement";
    case Estimator::closed_form:
      return "closed_form";
    case Estimator::closed_form_with_bias:
      return "closed_form_with_bias";
    case Estimator::least_squares:
      return "least_squares";
    case Estimator::bias_estimated:
      return "bias_estimated";
    case Estimator::bias_ignored:
      return "bias_ignored";
    case Estimator::robust:
      return "robust";
    case Estimator::oracle:
      return "oracle";
    case Estimator::no_selection:
      return "no_selection";
  }
  return "";
}

std::string name(ViInitQuantity quantity) {
  switch (quantity) {
    case Quantity::nees_v:
      return "nees_v";
    case Quantity::nees_v_g:
      return "nees_v_g";
    case Quantity::nees_all:
      return "nees_all";
    case Quantity::nees_last_state:
      return "nees_last_state";
    case Quantity::chi2_per_dof:
      return "chi2_per_dof";
    case Quantity::speed:
      return "speed";
    case Quantity::gravity:
      return "gravity";
    case Quantity::scale:
      return "scale";
    case Quantity::scale_of_features:
      return "scale_of_features";
    case Quantity::bias:
      return "bias";
    case Quantity::selection:
      return "selection";
  }
  return "";
}

std::string unit(ViInitQuantity quantity) {
  switch (quantity) {
    case Quantity::speed:
      return "m/s";
    case Quantity::gravity:
      return "deg";
    case Quantity::scale:
    case Quantity::scale_of_features:
      return "%";
    case Quantity::bias:
      return "rad/s";
    default:
      return "";
  }
}

std::vector<ViInitRow> validateViInit(const ViInitValidation& validation,
                                      const std::function<void(std::uint64_t, std::uint64_t)>& progress) {
  const std::vector<Experiment> list = experiments(validation);
  std::vector<ViInitRow> rows;
  double all = 0, before = 0;
  for (const Experiment& e : list) {
    all += e.work();
    for (const auto& [estimator, quantity] : e.columns) {
      ViInitRow row;
      row.check = e.check;
      row.estimator = estimator;
      row.quantity = quantity;
      row.window = e.window;
      row.promise = viInitPromise(row);
      rows.push_back(std::move(row));
    }
  }
  const auto judged = std::count_if(rows.begin(), rows.end(), [](const ViInitRow& row) { return row.promise; });
  const double false_alarm = vi_init_false_alarm / static_cast<double>(std::max<std::ptrdiff_t>(1, judged));
  auto row = rows.begin();
  for (const Experiment& e : list) {
    const auto trials = run(e, validation, [&](std::size_t done) {
      const double share = static_cast<double>(done) / static_cast<double>(validation.trials);
      if (progress) progress(static_cast<std::uint64_t>(1e6 * (before + share * e.work()) / all), 1000000);
    });
    const auto column = [&](std::size_t k) {
      std::vector<double> values;
      for (const auto& trial : trials) values.push_back(trial[k]);
      return values;
    };
    std::size_t k = 0;
    for (std::size_t c = 0; c < e.columns.size(); ++c, ++row) {
      const bool two = row->quantity == Quantity::chi2_per_dof;
      evaluate(*row, column(k), two ? column(k + 1) : std::vector<double>{}, false_alarm);
      k += two ? 2 : 1;
    }
    before += e.work();
  }
  return rows;
}

}  // namespace liestat::experiments
