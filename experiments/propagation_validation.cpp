#include <experiments/propagation_validation.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace liestat::experiments {

int degreesOfFreedom(Propagated feature, Operation operation) {
  if (operation == Operation::act || feature == Propagated::rotation) return 3;
  return feature == Propagated::pose ? 6 : 7;
}

std::optional<ValidationTolerance> PropagationPromise::at(double noise) const {
  if (!(noise <= spread)) return std::nullopt;
  const double square = noise * noise;
  return ValidationTolerance{.index = index * square, .ks = ks * square, .failure_fraction = 0, .tail = tail * square};
}

// Twice the deviations that runs of 200000 trials show; docs/propagation.md has the table.
PropagationPromise propagationPromise(Propagated feature, const PropagationMethod& method) {
  const bool rotation = feature == Propagated::rotation;
  switch (method.operation) {
    case Operation::inverse:
      return {.spread = 0.5, .index = 0, .ks = 0, .tail = 0};  // the law itself, until rotations wrap around
    case Operation::compose:
    case Operation::between:
      if (method.fourth_order) {
        return {.spread = 0.5, .index = 0.1, .ks = rotation ? 0.1 : 0.25, .tail = rotation ? 0.015 : 0.03};
      }
      if (rotation) return {.spread = 0.5, .index = 0.3, .ks = 0.1, .tail = 0.02};
      return {.spread = 0.3, .index = 0.6, .ks = 0.35, .tail = 0.05};
    case Operation::act:
      if (rotation) return {.spread = 0.2, .index = 3.0, .ks = 0.9, .tail = 0.2};
      return {.spread = 0.3, .index = 0.8, .ks = 0.3, .tail = 0.05};
    case Operation::chain:
      if (method.fourth_order) {
        return {.spread = 0.3, .index = 0.1, .ks = rotation ? 0.15 : 0.75, .tail = rotation ? 0.01 : 0.1};
      }
      if (rotation) return {.spread = 0.3, .index = 0.6, .ks = 0.4, .tail = 0.01};
      return {.spread = 0.2, .index = 1.7, .ks = 1.0, .tail = 0.15};
  }
  return {};
}

std::string label(const PropagationMethod& method) {
  return name(method.operation) + (method.fourth_order ? " 4th" : "");
}

std::vector<const PropagationRow*> rowsOf(const std::vector<PropagationRow>& rows, Propagated feature,
                                          const PropagationMethod& method) {
  std::vector<const PropagationRow*> list;
  for (const PropagationRow& row : rows) {
    if (row.experiment.feature == feature && row.method.operation == method.operation &&
        row.method.fourth_order == method.fourth_order) {
      list.push_back(&row);
    }
  }
  return list;
}

std::optional<double> consistentUpTo(const std::vector<PropagationRow>& rows, Propagated feature,
                                     const PropagationMethod& method) {
  std::optional<double> largest;
  for (const PropagationRow* row : rowsOf(rows, feature, method)) {
    if (!(std::abs(row->relativeIndex() - 1) <= consistent_deviation)) break;
    largest = row->experiment.spread;
  }
  return largest;
}

std::vector<PropagationRow> validatePropagation(const PropagationValidation& validation, const RunProgress& progress) {
  std::vector<double> spreads = validation.spreads;
  std::sort(spreads.begin(), spreads.end());
  spreads.erase(std::unique(spreads.begin(), spreads.end()), spreads.end());
  std::vector<PropagationMethod> chosen;
  for (const PropagationMethod& method : propagation_methods) {
    const auto& wanted = validation.operations;
    if (std::find(wanted.begin(), wanted.end(), method.operation) != wanted.end()) chosen.push_back(method);
  }
  double judged = 0;
  for (const Propagated feature : validation.features) {
    for (const PropagationMethod& method : chosen) {
      for (const double spread : spreads) judged += propagationPromise(feature, method).at(spread).has_value();
    }
  }

  CellRun run(validation.run,
              std::vector<CellSize>(spreads.size() * validation.features.size(), {validation.run.trials, 1}), progress);
  std::vector<PropagationRow> rows;
  for (const Propagated feature : validation.features) {
    const std::size_t first = rows.size();
    rows.resize(first + chosen.size() * spreads.size());
    for (std::size_t s = 0; s < spreads.size(); ++s) {
      const PropagationExperiment experiment{.feature = feature, .spread = spreads[s], .methods = chosen};
      std::vector<ReferenceLaw> laws;
      for (const PropagationMethod& method : chosen) {
        laws.push_back(ReferenceLaw::chiSquared(degreesOfFreedom(feature, method.operation)));
      }
      // A trial takes microseconds.
      auto reports =
          run.reports(256, laws, [&](CounterRng& rng, std::uint64_t) { return propagationTrial(experiment, rng); });
      if (run.ended()) continue;
      for (std::size_t m = 0; m < chosen.size(); ++m) {
        PropagationRow& row = rows[first + m * spreads.size() + s];
        row.experiment = experiment;
        row.method = chosen[m];
        row.conclude(std::move(reports[m]), propagationPromise(feature, chosen[m]).at(spreads[s]),
                     run_false_alarm / judged);
      }
    }
  }
  // Rows have their places beforehand; those that an interrupt left without a trial are no rows.
  std::erase_if(rows, [](const PropagationRow& row) { return row.report.trials == 0; });
  return rows;
}

Judgement judgementOf(const std::vector<PropagationRow>& rows) {
  Judgement judgement{.promises = {}, .where = "in the promised domain"};
  for (const PropagationRow& row : rows) {
    judgement.promises.push_back(promiseAbout(row, fmt::format("{} {} spread {:.3g}", name(row.experiment.feature),
                                                               label(row.method), row.experiment.spread)));
  }
  return judgement;
}

}  // namespace liestat::experiments
