#include <experiments/vi_init_validation.hpp>

#include <experiments/parallel.hpp>
#include <stats/executor.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

namespace liestat::experiments {
namespace {

using Check = ViInitCheck;
using Estimator = ViInitEstimator;
using Quantity = ViInitQuantity;

/// What is known of a quantity, in the order of the enumerators.
struct QuantityEntry {
  const char* name;
  const char* unit;
  ViInitStatistic statistic;
};
constexpr std::array<QuantityEntry, 11> quantities = {{
    {"nees_v", "", ViInitStatistic::distance},
    {"nees_v_g", "", ViInitStatistic::distance},
    {"nees_all", "", ViInitStatistic::distance},
    {"nees_last_state", "", ViInitStatistic::distance},
    {"chi2_per_dof", "", ViInitStatistic::chi_squared},
    {"speed", "m/s", ViInitStatistic::error},
    {"gravity", "deg", ViInitStatistic::error},
    {"scale", "%", ViInitStatistic::error},
    {"scale_of_features", "%", ViInitStatistic::error},
    {"bias", "rad/s", ViInitStatistic::error},
    {"selection", "", ViInitStatistic::fraction},
}};
static_assert(static_cast<std::size_t>(Quantity::selection) + 1 == quantities.size());
constexpr std::array estimators = {"refinement",    "closed_form",    "closed_form_with_bias",
                                   "least_squares", "bias_estimated", "bias_ignored",
                                   "robust",        "oracle",         "no_selection"};
static_assert(static_cast<std::size_t>(Estimator::no_selection) + 1 == estimators.size());
constexpr std::array checks = {"consistency", "closed_form", "accuracy", "gyroscope_bias", "drift"};
static_assert(all_vi_init_checks.size() == checks.size());

const QuantityEntry& entry(Quantity quantity) { return quantities.at(static_cast<std::size_t>(quantity)); }

/// The values of one row: one a trial.
struct Values {
  std::vector<double> value;
  std::vector<double> dof;  ///< of χ²; else empty
};

/// A row of an experiment: who estimated what, and where an outcome has it.
template <class Outcome>
struct Column {
  Estimator estimator;
  Quantity quantity;
  double (*value)(const Outcome&);
  int dof = 0;                                   ///< of a distance
  double (*chi2_dof)(const Outcome&) = nullptr;  ///< degrees of freedom of a χ²
};

/// A kind of window and the rows that its trials give.
struct Experiment {
  Check check;
  ViInitWindow window;
  /// A row without results.
  struct Row {
    Estimator estimator;
    Quantity quantity;
    int dof = 0;  ///< of a distance
  };
  std::vector<Row> rows;
  /// All trials: the values of each row.
  std::function<std::vector<Values>(const ViInitValidation&, const std::function<void(std::size_t)>& progress)> run;

  /// Milliseconds of a trial, about: for the progress bar.
  double work() const {
    const double observations = static_cast<double>(window.images * window.features);
    return (check == Check::consistency ? 0.018 : 0.004) * observations;
  }
};

template <class Outcome>
std::vector<Outcome> runTrials(ViInitTrial<Outcome> trial, const ViInitWindow& window,
                               const ViInitValidation& validation, const std::function<void(std::size_t)>& progress) {
  using Outcomes = std::vector<Outcome>;
  const std::size_t n_chunks = chunkCount(validation.trials, 8);
  return ProgramExecutor{validation.threads}.reduce(
      n_chunks,
      [&](std::size_t chunk) {
        Outcomes part;
        const ChunkRange range = chunkRange(validation.trials, n_chunks, chunk);
        for (std::size_t i = range.begin; i < range.end; ++i) {
          CounterRng rng(validation.seed, i);
          part.push_back(trial(window, validation.noise, rng));
        }
        return part;
      },
      [&](Outcomes& done, const Outcomes& next) {
        done.insert(done.end(), next.begin(), next.end());
        progress(done.size());
      });
}

template <class Outcome>
Experiment experiment(Check check, ViInitTrial<Outcome> trial, const ViInitWindow& window,
                      const std::vector<Column<Outcome>>& columns) {
  Experiment e{.check = check, .window = window, .rows = {}, .run = {}};
  for (const Column<Outcome>& c : columns) e.rows.push_back({c.estimator, c.quantity, c.dof});
  e.run = [trial, window, columns](const ViInitValidation& validation,
                                   const std::function<void(std::size_t)>& progress) {
    std::vector<Values> values(columns.size());
    for (const Outcome& outcome : runTrials(trial, window, validation, progress)) {
      for (std::size_t k = 0; k < columns.size(); ++k) {
        values[k].value.push_back(columns[k].value(outcome));
        if (columns[k].chi2_dof != nullptr) values[k].dof.push_back(columns[k].chi2_dof(outcome));
      }
    }
    return values;
  };
  return e;
}

/// The rows of the errors of one estimator: speed, gravity, scale.
template <auto errors, class Outcome>
void addErrors(std::vector<Column<Outcome>>& columns, Estimator estimator) {
  columns.push_back({estimator, Quantity::speed, [](const Outcome& o) { return (o.*errors).speed; }});
  columns.push_back({estimator, Quantity::gravity, [](const Outcome& o) { return (o.*errors).gravity; }});
  columns.push_back({estimator, Quantity::scale, [](const Outcome& o) { return (o.*errors).scale; }});
}
/// The row of a distance with so many degrees of freedom.
template <auto member, class Outcome>
void addDistance(std::vector<Column<Outcome>>& columns, Estimator estimator, Quantity quantity, int dof) {
  columns.push_back({estimator, quantity, [](const Outcome& o) { return o.*member; }, dof});
}
template <class Outcome>
void addChiSquared(std::vector<Column<Outcome>>& columns, Estimator estimator) {
  columns.push_back({estimator, Quantity::chi2_per_dof, [](const Outcome& o) { return o.chi2.cost; }, 0,
                     [](const Outcome& o) { return o.chi2.degrees_of_freedom; }});
}

std::vector<Experiment> experiments(const ViInitValidation& validation) {
  std::vector<Experiment> list;

  std::vector<Column<RefinementOutcome>> refined;
  using R = RefinementOutcome;
  addDistance<&R::nees_v>(refined, Estimator::refinement, Quantity::nees_v, 3);
  addDistance<&R::nees_v_g>(refined, Estimator::refinement, Quantity::nees_v_g, 5);
  addDistance<&R::nees_all>(refined, Estimator::refinement, Quantity::nees_all, 11);
  addDistance<&R::nees_last_state>(refined, Estimator::refinement, Quantity::nees_last_state, 9);
  addChiSquared(refined, Estimator::refinement);
  addErrors<&R::errors>(refined, Estimator::refinement);
  refined.push_back(
      {Estimator::refinement, Quantity::scale_of_features, [](const R& o) { return o.scale_of_features; }});
  for (const ViInitWindow& window : {ViInitWindow{1, 11, 20}, ViInitWindow{2, 11, 20}, ViInitWindow{2, 21, 20},
                                     ViInitWindow{3, 16, 20}, ViInitWindow{2, 21, 50}}) {
    list.push_back(experiment(Check::consistency, refinementTrial, window, refined));
  }

  std::vector<Column<ClosedFormOutcome>> plain, with_bias;
  using C = ClosedFormOutcome;
  addDistance<&C::nees_v_g>(plain, Estimator::closed_form, Quantity::nees_v_g, 5);
  addChiSquared(plain, Estimator::closed_form);
  addDistance<&C::nees_v_g>(with_bias, Estimator::closed_form_with_bias, Quantity::nees_v_g, 5);
  addDistance<&C::nees_all>(with_bias, Estimator::closed_form_with_bias, Quantity::nees_all, 8);
  addChiSquared(with_bias, Estimator::closed_form_with_bias);
  for (const ViInitWindow& window : {ViInitWindow{1, 11, 20}, ViInitWindow{2, 21, 20}, ViInitWindow{4, 41, 20}}) {
    list.push_back(experiment(Check::closed_form, closedFormNeesTrial, window, plain));
  }
  for (const ViInitWindow& window : {ViInitWindow{2, 21, 20}, ViInitWindow{3, 31, 20}, ViInitWindow{4, 41, 20}}) {
    list.push_back(experiment(Check::closed_form, closedFormBiasNeesTrial, window, with_bias));
  }

  std::vector<Column<AccuracyOutcome>> accuracy;
  addErrors<&AccuracyOutcome::closed_form>(accuracy, Estimator::closed_form);
  addErrors<&AccuracyOutcome::least_squares>(accuracy, Estimator::least_squares);
  for (const ViInitWindow& window :
       {ViInitWindow{1, 11, 20}, ViInitWindow{2, 21, 20}, ViInitWindow{3, 31, 20}, ViInitWindow{4, 41, 20}}) {
    list.push_back(experiment(Check::accuracy, closedFormErrorsTrial, window, accuracy));
  }

  using G = GyroscopeBiasOutcome;
  list.push_back(
      experiment<G>(Check::gyroscope_bias, gyroscopeBiasTrial, {2, 21, 20},
                    {{Estimator::bias_estimated, Quantity::bias, [](const G& o) { return o.bias; }},
                     {Estimator::bias_estimated, Quantity::gravity, [](const G& o) { return o.estimated.gravity; }},
                     {Estimator::bias_estimated, Quantity::scale, [](const G& o) { return o.estimated.scale; }},
                     {Estimator::bias_ignored, Quantity::gravity, [](const G& o) { return o.ignored.gravity; }},
                     {Estimator::bias_ignored, Quantity::scale, [](const G& o) { return o.ignored.scale; }}}));

  using D = DriftOutcome;
  std::vector<Column<D>> drift{
      {Estimator::robust, Quantity::selection, [](const D& o) { return o.exact_selection ? 1. : 0.; }}};
  addErrors<&D::robust>(drift, Estimator::robust);
  addErrors<&D::oracle>(drift, Estimator::oracle);
  addErrors<&D::no_selection>(drift, Estimator::no_selection);
  list.push_back(experiment(Check::drift, driftTrial, {2, 21, 40}, drift));

  const auto unwanted = [&](const Experiment& e) {
    return std::find(validation.checks.begin(), validation.checks.end(), e.check) == validation.checks.end() ||
           (!validation.windows.empty() && std::find(validation.windows.begin(), validation.windows.end(),
                                                     e.window.seconds) == validation.windows.end());
  };
  list.erase(std::remove_if(list.begin(), list.end(), unwanted), list.end());
  return list;
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

void evaluateErrors(ViInitRow& row, std::vector<double> values, double false_alarm) {
  std::sort(values.begin(), values.end());
  row.median = quantile(values, 0.5);
  row.p95 = quantile(values, 0.95);
  if (row.promise) row.reason = judgeErrors(values, *row.promise, false_alarm);
}

void evaluateDistances(ViInitRow& row, const std::vector<double>& values, int dof, double false_alarm) {
  row.report = reportOf(values, dof);
  if (row.promise) row.reason = reason(row.report->verdict(false_alarm, row.promise->tolerance));
  row.report->mu2 = {};
}

void evaluateChiSquared(ViInitRow& row, const Values& values, double false_alarm) {
  double cost = 0, all = 0;
  for (std::size_t i = 0; i < values.value.size(); ++i) {
    if (!std::isfinite(values.value[i])) continue;
    cost += values.value[i];
    all += values.dof[i];
  }
  row.value = cost / all;
  row.value_se = std::sqrt(2 / all);
  if (!row.promise) return;
  if (!(chiSquaredSurvival(cost / (1 + row.promise->deviation), all) >= false_alarm / 2)) {
    row.reason = "χ² is too large for its degrees of freedom";
  } else if (!(chiSquaredCdf(cost / (1 - row.promise->deviation), all) >= false_alarm / 2)) {
    row.reason = "χ² is too small for its degrees of freedom";
  }
}

void evaluateFraction(ViInitRow& row, const std::vector<double>& values, double false_alarm) {
  const double promised = row.promise.value_or(ViInitPromise{}).fraction;
  const auto n = static_cast<double>(values.size());
  const auto exact = static_cast<double>(std::count(values.begin(), values.end(), 1.));
  row.value = exact / n;
  row.value_se = std::sqrt(promised * (1 - promised) / n);
  const std::size_t wrong = values.size() - static_cast<std::size_t>(exact);
  if (row.promise && !(binomialSurvival(wrong, values.size(), 1 - promised) >= false_alarm)) {
    row.reason = "the right tracks were kept too seldom";
  }
}

/// Fills in a row from the values of its trials, and judges it if anything is promised.
void evaluate(ViInitRow& row, const Values& values, int dof, double false_alarm) {
  row.trials = values.value.size();
  row.failures = static_cast<std::size_t>(
      std::count_if(values.value.begin(), values.value.end(), [](double x) { return !std::isfinite(x); }));
  switch (statistic(row.quantity)) {
    case ViInitStatistic::distance:
      evaluateDistances(row, values.value, dof, false_alarm);
      break;
    case ViInitStatistic::chi_squared:
      evaluateChiSquared(row, values, false_alarm);
      break;
    case ViInitStatistic::error:
      evaluateErrors(row, values.value, false_alarm);
      break;
    case ViInitStatistic::fraction:
      evaluateFraction(row, values.value, false_alarm);
      break;
  }
  if (row.promise) row.passed = row.reason.empty();
}

}  // namespace

std::string name(ViInitCheck check) { return checks.at(static_cast<std::size_t>(check)); }
std::string name(ViInitEstimator estimator) { return estimators.at(static_cast<std::size_t>(estimator)); }
std::string name(ViInitQuantity quantity) { return entry(quantity).name; }
std::string unit(ViInitQuantity quantity) { return entry(quantity).unit; }
ViInitStatistic statistic(ViInitQuantity quantity) { return entry(quantity).statistic; }

std::vector<ViInitRow> validateViInit(const ViInitValidation& validation,
                                      const std::function<void(std::uint64_t, std::uint64_t)>& progress) {
  const std::vector<Experiment> list = experiments(validation);
  std::vector<ViInitRow> rows;
  double all = 0, before = 0;
  for (const Experiment& e : list) {
    all += e.work();
    for (const Experiment::Row& of : e.rows) {
      ViInitRow row;
      row.check = e.check;
      row.estimator = of.estimator;
      row.quantity = of.quantity;
      row.window = e.window;
      row.promise = viInitPromise(row);
      rows.push_back(std::move(row));
    }
  }
  const auto judged = std::count_if(rows.begin(), rows.end(), [](const ViInitRow& row) { return row.promise; });
  const double false_alarm = run_false_alarm / static_cast<double>(std::max<std::ptrdiff_t>(1, judged));
  auto row = rows.begin();
  for (const Experiment& e : list) {
    const std::vector<Values> values = e.run(validation, [&](std::size_t done) {
      const double share = static_cast<double>(done) / static_cast<double>(validation.trials);
      if (progress) progress(static_cast<std::uint64_t>(1e6 * (before + share * e.work()) / all), 1000000);
    });
    for (std::size_t k = 0; k < e.rows.size(); ++k, ++row) evaluate(*row, values[k], e.rows[k].dof, false_alarm);
    before += e.work();
  }
  return rows;
}

}  // namespace liestat::experiments
