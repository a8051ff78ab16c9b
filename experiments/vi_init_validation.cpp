#include <experiments/vi_init_validation.hpp>

#include <experiments/vi_init_evaluation.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <functional>
#include <utility>

namespace liestat::experiments {
namespace {

using Check = ViInitCheck;
using Estimator = ViInitEstimator;
using Quantity = ViInitQuantity;

/// Name, unit and kind of each quantity, in the order of the enumerators.
struct QuantityEntry {
  const char* name;
  const char* unit;
  ViInitStatistic statistic;
};
constexpr std::array<QuantityEntry, 19> quantities = {{
    {"nees_v", "", ViInitStatistic::distance},
    {"nees_v_g", "", ViInitStatistic::distance},
    {"nees_all", "", ViInitStatistic::distance},
    {"nees_last_state", "", ViInitStatistic::distance},
    {"nees_at_last", "", ViInitStatistic::distance},
    {"nees_at_rest", "", ViInitStatistic::distance},
    {"nees_filter_start", "", ViInitStatistic::distance},
    {"chi2_per_dof", "", ViInitStatistic::chi_squared},
    {"speed", "m/s", ViInitStatistic::error},
    {"gravity", "deg", ViInitStatistic::error},
    {"scale", "%", ViInitStatistic::error},
    {"scale_of_features", "%", ViInitStatistic::error},
    {"bias", "rad/s", ViInitStatistic::error},
    {"selection", "", ViInitStatistic::fraction},
    {"told", "", ViInitStatistic::fraction},
    {"moving", "", ViInitStatistic::fraction},
    {"gyroscope_interval", "", ViInitStatistic::fraction},
    {"accelerometer_interval", "", ViInitStatistic::fraction},
    {"common_interval", "", ViInitStatistic::fraction},
}};
static_assert(static_cast<std::size_t>(Quantity::common_interval) + 1 == quantities.size());
constexpr std::array estimators = {"refinement",    "closed_form",    "closed_form_with_bias",
                                   "least_squares", "bias_estimated", "bias_ignored",
                                   "robust",        "oracle",         "no_selection",
                                   "at_rest",       "speed_250_mm",   "speed_50_mm",
                                   "speed_12_mm",   "speed_2_mm",     "noise_1_1",
                                   "noise_4_4",     "noise_16_16",    "noise_4_1",
                                   "noise_1_4",     "noise_16_1",     "noise_1_16"};
static_assert(static_cast<std::size_t>(Estimator::noise_1_16) + 1 == estimators.size());
constexpr std::array checks = {"consistency",    "walk",  "closed_form", "accuracy",
                               "gyroscope_bias", "noise", "rest",        "drift"};
static_assert(all_vi_init_checks.size() == checks.size());

const QuantityEntry& entry(Quantity quantity) { return quantities.at(static_cast<std::size_t>(quantity)); }

/// A row of an experiment: who estimated what, and where an outcome has it.
template <class Outcome>
struct Column {
  Estimator estimator;
  Quantity quantity;
  double (*value)(const Outcome&);
  int dof = 0;                                   ///< degrees of freedom of a distance
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
    int dof = 0;  ///< degrees of freedom of a distance
  };
  std::vector<Row> rows;
  std::size_t share = 1;  ///< it has only one trial of so many
  /// The trials of the next cell: the values of each row.
  std::function<std::vector<ViInitValues>(const ViInitValidation&, CellRun&)> run = {};

  std::size_t trials(const ViInitValidation& validation) const {
    if (check == Check::noise) return validation.recordings;
    return std::max<std::size_t>(1, validation.run.trials / share);
  }
  /// Milliseconds of all its trials, about: for the progress bar.
  double work(const ViInitValidation& validation) const {
    return workOfATrial() * static_cast<double>(trials(validation));
  }
  double workOfATrial() const {
    const double observations = static_cast<double>(window.images * window.features);
    if (check == Check::rest) return 40;
    if (check == Check::noise) return 500;
    return (check == Check::consistency ? 0.018 : check == Check::walk ? 0.027 : 0.004) * observations;
  }
};

template <class Outcome>
Experiment experiment(Check check, ViInitTrial<Outcome> trial, const ViInitWindow& window,
                      const std::vector<Column<Outcome>>& columns) {
  Experiment e{.check = check, .window = window, .rows = {}};
  for (const Column<Outcome>& c : columns) e.rows.push_back({c.estimator, c.quantity, c.dof});
  e.run = [trial, window, columns](const ViInitValidation& validation, CellRun& run) {
    std::vector<ViInitValues> values(columns.size());
    for (const Outcome& outcome : run.outcomes([&](std::uint64_t number) {
           CounterRng rng(validation.run.seed, number);
           return trial(window, validation.noise, rng);
         })) {
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
  addDistance<&R::nees_filter_start>(refined, Estimator::refinement, Quantity::nees_filter_start, 15);
  addChiSquared(refined, Estimator::refinement);
  addErrors<&R::errors>(refined, Estimator::refinement);
  refined.push_back(
      {Estimator::refinement, Quantity::scale_of_features, [](const R& o) { return o.scale_of_features; }});
  for (const ViInitWindow& window : {ViInitWindow{1, 11, 20}, ViInitWindow{2, 11, 20}, ViInitWindow{2, 21, 20},
                                     ViInitWindow{3, 16, 20}, ViInitWindow{2, 21, 50}}) {
    list.push_back(experiment(Check::consistency, refinementTrial, window, refined));
  }

  std::vector<Column<RefinementOutcome>> walking;
  addDistance<&R::nees_v_g>(walking, Estimator::refinement, Quantity::nees_v_g, 5);
  addDistance<&R::nees_all>(walking, Estimator::refinement, Quantity::nees_all, 11);
  addDistance<&R::nees_last_state>(walking, Estimator::refinement, Quantity::nees_last_state, 9);
  addDistance<&R::nees_at_last>(walking, Estimator::refinement, Quantity::nees_at_last, 17);
  addDistance<&R::nees_filter_start>(walking, Estimator::refinement, Quantity::nees_filter_start, 15);
  addChiSquared(walking, Estimator::refinement);
  for (const ViInitWindow& window : {ViInitWindow{2, 11, 20}, ViInitWindow{3, 16, 20}, ViInitWindow{4, 21, 20}}) {
    list.push_back(experiment(Check::walk, walkTrial, window, walking));
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

  using N = NoiseOutcome;
  const auto addNoise = [&](Estimator estimator, ViInitTrial<N> trial, bool equal) {
    std::vector<Column<N>> noise{
        {estimator, Quantity::gyroscope_interval, [](const N& o) { return o.gyroscope ? 1. : 0.; }},
        {estimator, Quantity::accelerometer_interval, [](const N& o) { return o.accelerometer ? 1. : 0.; }}};
    if (equal) noise.push_back({estimator, Quantity::common_interval, [](const N& o) { return o.common ? 1. : 0.; }});
    list.push_back(experiment(Check::noise, trial, {2, 11, 40}, noise));
  };
  addNoise(Estimator::noise_1_1, noiseTrial<1, 1>, true);
  addNoise(Estimator::noise_4_4, noiseTrial<4, 4>, true);
  addNoise(Estimator::noise_16_16, noiseTrial<16, 16>, true);
  addNoise(Estimator::noise_4_1, noiseTrial<4, 1>, false);
  addNoise(Estimator::noise_1_4, noiseTrial<1, 4>, false);
  addNoise(Estimator::noise_16_1, noiseTrial<16, 1>, false);
  addNoise(Estimator::noise_1_16, noiseTrial<1, 16>, false);

  using Rest = RestOutcome;
  using Slow = SlowOutcome;
  for (const ViInitWindow& window : {ViInitWindow{1, 11, 20}, ViInitWindow{2, 21, 20}}) {
    std::vector<Column<Rest>> rest{
        {Estimator::at_rest, Quantity::told, [](const Rest& o) { return o.stationary ? 1. : 0.; }}};
    addDistance<&Rest::nees>(rest, Estimator::at_rest, Quantity::nees_at_rest, 8);
    addDistance<&Rest::nees_filter_start>(rest, Estimator::at_rest, Quantity::nees_filter_start, 15);
    list.push_back(experiment(Check::rest, restTrial, window, rest));
  }
  const auto addSlow = [&](Estimator estimator, ViInitTrial<Slow> trial) {
    for (const ViInitWindow& window : {ViInitWindow{1, 11, 20}, ViInitWindow{2, 21, 20}, ViInitWindow{4, 41, 20}}) {
      list.push_back(
          experiment<Slow>(Check::rest, trial, window,
                           {{estimator, Quantity::told, [](const Slow& o) { return o.excluded ? 0. : 1.; }},
                            {estimator, Quantity::moving, [](const Slow& o) { return o.stationary ? 0. : 1.; }}}));
      list.back().share = 10;
    }
  };
  addSlow(Estimator::speed_250_mm, slowTrial<4>);
  addSlow(Estimator::speed_50_mm, slowTrial<20>);
  addSlow(Estimator::speed_12_mm, slowTrial<80>);
  addSlow(Estimator::speed_2_mm, slowTrial<400>);

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

}  // namespace

std::string name(ViInitCheck check) { return checks.at(static_cast<std::size_t>(check)); }
std::string name(ViInitEstimator estimator) { return estimators.at(static_cast<std::size_t>(estimator)); }
std::string name(ViInitQuantity quantity) { return entry(quantity).name; }
std::string unit(ViInitQuantity quantity) { return entry(quantity).unit; }
ViInitStatistic statistic(ViInitQuantity quantity) { return entry(quantity).statistic; }

std::vector<ViInitRow> validateViInit(const ViInitValidation& validation, const RunProgress& progress) {
  const std::vector<Experiment> list = experiments(validation);
  std::vector<std::vector<ViInitRow>> cells;
  std::vector<CellSize> sizes;
  std::size_t judged = 0;
  for (const Experiment& e : list) {
    sizes.push_back({e.trials(validation), e.work(validation)});
    std::vector<ViInitRow>& cell = cells.emplace_back(e.rows.size());
    for (std::size_t k = 0; k < cell.size(); ++k) {
      cell[k].check = e.check, cell[k].window = e.window;
      cell[k].estimator = e.rows[k].estimator, cell[k].quantity = e.rows[k].quantity;
      cell[k].promise = viInitPromise(cell[k]);
      judged += cell[k].promise.has_value();
    }
  }
  const double false_alarm = run_false_alarm / static_cast<double>(std::max<std::size_t>(1, judged));
  CellRun run(validation.run, sizes, progress);
  std::vector<ViInitRow> rows;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const std::vector<ViInitValues> values = list[i].run(validation, run);
    if (run.ended()) continue;
    for (std::size_t k = 0; k < cells[i].size(); ++k) {
      evaluate(cells[i][k], values[k], list[i].rows[k].dof, false_alarm);
      rows.push_back(std::move(cells[i][k]));
    }
  }
  return rows;
}

const ViInitRow* ViInitGroup::of(ViInitQuantity quantity) const {
  const auto found =
      std::find_if(rows.begin(), rows.end(), [&](const ViInitRow* row) { return row->quantity == quantity; });
  return found == rows.end() ? nullptr : *found;
}

std::optional<bool> ViInitGroup::passed() const {
  std::optional<bool> passed;
  for (const ViInitRow* row : rows) {
    if (row->passed) passed = passed.value_or(true) && *row->passed;
  }
  return passed;
}

std::vector<ViInitGroup> groups(const std::vector<ViInitRow>& rows, ViInitCheck check) {
  std::vector<ViInitGroup> list;
  for (const ViInitRow& row : rows) {
    if (row.check != check) continue;
    auto group = std::find_if(list.begin(), list.end(), [&](const ViInitGroup& g) {
      return g.first().estimator == row.estimator && g.first().window == row.window;
    });
    if (group == list.end()) group = list.insert(list.end(), ViInitGroup{});
    group->rows.push_back(&row);
  }
  return list;
}

Judgement judgementOf(const std::vector<ViInitRow>& rows) {
  Judgement judgement{.promises = {}, .where = "with a promise"};
  for (const ViInitRow& row : rows) {
    judgement.promises.push_back(
        promiseAbout(row, fmt::format("{} {} {}, {:g} s, {} images, {} features", name(row.check), name(row.estimator),
                                      name(row.quantity), row.window.seconds, row.window.images, row.window.features)));
  }
  return judgement;
}

}  // namespace liestat::experiments
