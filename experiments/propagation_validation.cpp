#include <experiments/interruption.hpp>
#include <experiments/propagation_validation.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace liestat::experiments {

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

std::vector<PropagationRow> validatePropagation(const PropagationValidation& validation,
                                                const std::function<void(std::uint64_t, std::uint64_t)>& progress) {
  std::vector<double> spreads = validation.spreads;
  std::sort(spreads.begin(), spreads.end());
  spreads.erase(std::unique(spreads.begin(), spreads.end()), spreads.end());
  std::vector<PropagationMethod> methods;
  for (const PropagationMethod& method : propagation_methods) {
    const auto& wanted = validation.operations;
    if (std::find(wanted.begin(), wanted.end(), method.operation) != wanted.end()) methods.push_back(method);
  }

  double judged = 0;
  for (const Propagated feature : validation.features) {
    for (const PropagationMethod& method : methods) {
      for (const double spread : spreads) judged += propagationPromise(feature, method).at(spread).has_value();
    }
  }

  const std::uint64_t all = validation.trials * spreads.size() * validation.features.size();
  trials_of_run.planned += all;
  std::uint64_t before = 0;
  std::vector<PropagationRow> rows;
  for (const Propagated feature : validation.features) {
    const std::size_t first = rows.size();
    rows.resize(first + methods.size() * spreads.size());
    for (std::size_t s = 0; s < spreads.size(); ++s) {
      const PropagationExperiment experiment{.feature = feature,
                                             .spread = spreads[s],
                                             .trials = validation.trials,
                                             .seed = validation.seed,
                                             .methods = methods};
      auto reports = run(experiment, validation.threads, [&](std::size_t done, std::size_t) {
        if (progress) progress(before + done, all);
      });
      before += validation.trials;
      if (!countTrials(reports.empty() ? validation.trials : reports[0].trials)) break;
      for (std::size_t m = 0; m < methods.size(); ++m) {
        PropagationRow& row = rows[first + m * spreads.size() + s];
        row.experiment = experiment;
        row.method = methods[m];
        row.setReport(std::move(reports[m]));
        row.promise = propagationPromise(feature, methods[m]).at(spreads[s]);
        row.judge(run_false_alarm / judged);
        row.forgetDistances();
      }
    }
  }
  // Rows have their places beforehand; those that an interrupt left without a trial are no rows.
  std::erase_if(rows, [](const PropagationRow& row) { return row.report.trials == 0; });
  return rows;
}

}  // namespace liestat::experiments
