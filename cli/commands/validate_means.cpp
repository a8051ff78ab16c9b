#include <cli/commands/validation_command.hpp>
#include <experiments/means_validation.hpp>
#include <report/table.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

std::string verdictTable(const std::vector<VerdictRow>& verdicts) {
  std::string text =
      "\nVerdicts of certifiedMean and of robust means, % of the trials: ok, of these outside of the\n"
      "95 % region (miss), on the wrong side (wrong); coverage of what is ok (cover) and of first-order covariances\n"
      "never withheld (plain); what is missing refutes the covariances that are stated\n";
  Table table({"feature, law", "n", "ok", "ambig", "ill", "miss", "wrong", "cover", "plain", ""});
  for (const VerdictRow& row : verdicts) {
    const auto percent = [&](double rate) { return fmt::format("{:.1f}", 100 * rate); };
    table.row({fmt::format("{} {} {:.3g}", row.cell.what().substr(0, 13), name(row.cell.law), row.cell.parameter),
               fmt::format("{}", row.cell.n), percent(row.rate(row.ok)), percent(row.rate(row.ambiguous)),
               percent(row.rate(row.ill_defined)), percent(row.rate(row.outside)), percent(row.rate(row.wrong)),
               row.ok > 0 ? percent(row.coverage()) : "-", percent(1 - row.rate(row.plain_outside)),
               verdictCell(row.passed)});
  }
  return text + table.str();
}

/// Features with their spreads, in the order of the rows.
std::vector<std::pair<Feature, double>> groupsOf(const std::vector<MeansRow>& rows) {
  std::vector<std::pair<Feature, double>> groups;
  for (const MeansRow& row : rows) {
    const std::pair group{row.experiment.feature, row.experiment.spread};
    if (std::find(groups.begin(), groups.end(), group) == groups.end()) groups.push_back(group);
  }
  return groups;
}

std::string meansTables(const std::vector<MeansRow>& rows) {
  // One line of each table for a feature, spread, noise and n.
  using Key = std::tuple<Feature, double, Noise, std::size_t>;
  std::vector<Key> order;
  std::map<Key, std::map<std::size_t, const MeansRow*>> cells;
  for (const MeansRow& row : rows) {
    const Key key{row.experiment.feature, row.experiment.spread, row.experiment.noise, row.experiment.n};
    if (!cells.contains(key)) order.push_back(key);
    cells[key][methodIndex(row.method)] = &row;
  }
  const auto cell = [&](const Key& key, const Method& method) -> const MeansRow* {
    const auto& line = cells[key];
    const auto found = line.find(methodIndex(method));
    return found == line.end() ? nullptr : found->second;
  };
  const auto any = [&](const Method& method) {
    return std::any_of(rows.begin(), rows.end(),
                       [&](const MeansRow& row) { return methodIndex(row.method) == methodIndex(method); });
  };
  const auto mark = [](const MeansRow* row, double value) {
    if (row == nullptr) return std::string("-");
    if (!std::isfinite(value)) return std::string("n/a");
    return fmt::format("{:.2f}{}", value, !row->passed ? "" : *row->passed ? "" : " !");
  };

  std::string text;
  // The features in turn, so that no line is wider than a terminal.
  for (const auto& [feature, spread] : groupsOf(rows)) {
    const int k = degreesOfFreedom(feature);
    text += fmt::format("\n{}, spread {:.3g}\n", name(feature), spread);

    Table known({"noise", "n", "LSQ print", "corr", "WLSQ print", "corr", "MAHA print", "corr", "K-S p"});
    Table residual({"noise", "n", "LSQ print", "corr", "K-S p", "WLSQ print", "corr", "K-S p"});
    Table accuracy({"noise", "n", "LSQ/MAHA rot", "trans", "WLSQ/MAHA rot", "trans", "it LSQ", "it MAHA"});
    for (const Key& key : order) {
      if (std::get<0>(key) != feature || std::get<1>(key) != spread) continue;
      const std::string noise = name(std::get<2>(key)), n = fmt::format("{}", std::get<3>(key));
      std::vector<std::string> known_cells{noise, n}, residual_cells{noise, n}, accuracy_cells{noise, n};
      for (const Criterion criterion : all_criteria) {
        for (const bool corrected : {false, true}) {
          const MeansRow* row = cell(key, {criterion, corrected, true});
          known_cells.push_back(mark(row, row ? row->report.index : 0));
        }
        if (criterion == Criterion::maha) break;
        for (const bool corrected : {false, true}) {
          const MeansRow* row = cell(key, {criterion, corrected, false});
          residual_cells.push_back(mark(row, row ? row->relativeIndex() : 0));
        }
        const MeansRow* row = cell(key, {criterion, true, false});
        residual_cells.push_back(row ? number(row->report.ks_p_value, 2) : "-");
        const MeansRow* exact = cell(key, {criterion, true, true});
        for (const ErrorRatio index : {log_ratio_rotation, log_ratio_translation}) {
          accuracy_cells.push_back(
              exact && std::isfinite(exact->ratio(index)) ? fmt::format("{:.3f}", exact->ratio(index)) : "-");
        }
      }
      const MeansRow* maha = cell(key, {Criterion::maha, true, true});
      const MeansRow* lsq = cell(key, {Criterion::lsq, true, true});
      const MeansRow* last = maha ? maha : lsq;
      known_cells.push_back(last ? number(last->report.ks_p_value, 2) : "-");
      accuracy_cells.push_back(lsq ? fmt::format("{:.1f}", lsq->report.mean_iterations) : "-");
      accuracy_cells.push_back(maha ? fmt::format("{:.1f}", maha->report.mean_iterations) : "-");
      known.row(known_cells);
      residual.row(residual_cells);
      accuracy.row(accuracy_cells);
    }
    text +=
        fmt::format("\nKnown noise: validation index, {} expected (printed | corrected formula; K-S of the last)\n{}",
                    k, known.str());
    if (any({Criterion::lsq, true, false}) || any({Criterion::wlsq, true, false})) {
      text +=
          fmt::format("\nNoise from residuals: index over the mean of Hotelling's law, 1 expected\n{}", residual.str());
    }
    if (any({Criterion::maha, true, true})) {
      text += fmt::format("\nErrors over MAHA's (geometric mean), iterations from the first measurement\n{}",
                          accuracy.str());
    }
  }
  return text;
}

/// One curve over n of a quantity of the rows of a method.
template <class Value>
Series curve(const std::vector<const MeansRow*>& rows, const Method& method, std::string title, const Value& value) {
  Series series{.name = std::move(title), .style = Style::linespoints};
  for (const MeansRow* row : rows) {
    if (methodIndex(row->method) != methodIndex(method)) continue;
    series.add(static_cast<double>(row->experiment.n), value(*row));
  }
  return series;
}

/// The same with bars.
template <class Value, class Bar>
Series curveWithBars(const std::vector<const MeansRow*>& rows, const Method& method, std::string title,
                     const Value& value, const Bar& bar) {
  Series series{.name = std::move(title), .style = Style::errorbars};
  for (const MeansRow* row : rows) {
    if (methodIndex(row->method) != methodIndex(method)) continue;
    const auto [low, high] = bar(*row);
    if (!std::isfinite(value(*row)) || !std::isfinite(low) || !std::isfinite(high)) continue;
    series.add(static_cast<double>(row->experiment.n), value(*row));
    series.addBand(series.x.back(), low, high);
  }
  return series;
}

const Columns<MeansRow> page_columns{
    {"noise", [](const MeansRow& row) { return name(row.experiment.noise); }},
    {"n", [](const MeansRow& row) { return row.experiment.n; }},
    {"criterion", [](const MeansRow& row) { return name(row.method.criterion); }},
    {"formula", [](const MeansRow& row) { return row.method.corrected ? "corrected" : "printed"; }},
    {"noise is", [](const MeansRow& row) { return row.method.known_noise ? "known" : "residuals"; }},
    {"trials", Judged::trials},
    {"index", Judged::index},
    {"SE", Judged::indexError, 2},
    {"expected", Judged::expected},
    {"K-S p", Judged::kolmogorov, 2},
    {"95 % covers", Judged::covered},
    {"failures", [](const MeansRow& row) { return row.report.failures; }},
    {"verdict", Judged::verdict}};

/// The page: for each feature and spread plots and a table.
void drawPage(Report& report, const std::vector<MeansRow>& rows) {
  for (const auto& group : groupsOf(rows)) {
    const auto& [feature, spread] = group;
    report.section(fmt::format("{}, spread {:.3g}", name(feature), spread));
    const double k = degreesOfFreedom(feature);
    for (const Noise noise : all_noises) {
      std::vector<const MeansRow*> cell;
      for (const MeansRow& row : rows) {
        if (row.experiment.feature == feature && row.experiment.spread == spread && row.experiment.noise == noise) {
          cell.push_back(&row);
        }
      }
      if (cell.empty()) continue;
      std::size_t largest = 0;
      for (const MeansRow* row : cell) largest = std::max(largest, row->experiment.n);

      Plot plot{
          .name = fmt::format("{}_{}_{:.3g}", name(feature), name(noise), spread),
          .caption = fmt::format("{}, noise {}: top, known noise: index with the deviation of the distances (LSQ), "
                                 "index of all criteria, confidence of the K-S test; middle, noise from residuals; "
                                 "bottom, histograms at n = {}, errors over MAHA's, iterations.",
                                 name(feature), name(noise), largest),
          .columns = 3};
      const Axis n_axis{.label = "n"}, p_value{.label = "p-value", .low = 0.0, .high = 1.0};
      const auto index_bar = [](const MeansRow& row) {
        const double sd = std::sqrt(row.report.variance);
        return std::pair(std::max(0.0, row.report.index - sd), row.report.index + sd);
      };
      Panel deviation{"LSQ, known noise", n_axis, {.label = "index, deviation", .low = 0.0}};
      deviation.add({curveWithBars(cell, {Criterion::lsq, true, true}, "corrected", Judged::index, index_bar)});
      deviation.references = {{.at = k}, {.at = k - std::sqrt(2 * k)}, {.at = k + std::sqrt(2 * k)}};

      Panel indices{"known noise", n_axis, {"index"}}, confidence{"K-S confidence, known noise", n_axis, p_value};
      Panel iterations{"iterations", n_axis, {.label = "mean", .low = 0.0}};
      for (const Criterion criterion : all_criteria) {
        const Method known{criterion, true, true};
        indices.add({curve(cell, known, name(criterion), Judged::index)});
        confidence.add({curve(cell, known, name(criterion), Judged::kolmogorov)});
        iterations.add(
            {curve(cell, known, name(criterion), [](const auto& row) { return row.report.mean_iterations; })});
      }
      indices.add({curve(cell, {Criterion::lsq, false, true}, "lsq printed", Judged::index)});
      indices.references = {{.at = k}};
      confidence.references = {{.at = 0.01}};

      Panel ratios{"noise from residuals", n_axis, {"index / Hotelling mean"}};
      Panel residual_confidence{"K-S confidence, residuals", n_axis, p_value};
      Panel accuracy{"errors over MAHA's", n_axis, {"ratio"}};
      const ErrorRatio kind = feature == Feature::point ? log_ratio_translation : log_ratio_rotation;
      const auto error = [&](const MeansRow& row) { return row.ratio(kind); };
      const auto error_bar = [&](const MeansRow& row) {
        const double factor = std::exp(row.logDeviation(kind));
        return std::pair(row.ratio(kind) / factor, row.ratio(kind) * factor);
      };
      for (const Criterion criterion : {Criterion::lsq, Criterion::wlsq}) {
        const auto ratio = [](const MeansRow& row) { return row.relativeIndex(); };
        ratios.add({curve(cell, {criterion, true, false}, name(criterion), ratio)});
        ratios.add({curve(cell, {criterion, false, false}, name(criterion) + std::string(" printed"), ratio)});
        residual_confidence.add({curve(cell, {criterion, true, false}, name(criterion), Judged::kolmogorov)});
        accuracy.add({curveWithBars(cell, {criterion, true, true}, name(criterion), error, error_bar)});
      }
      ratios.references = accuracy.references = {{.at = 1}};
      residual_confidence.references = {{.at = 0.01}};
      std::vector<Panel> candidates{deviation, indices, confidence, ratios, residual_confidence};
      for (const Method& method : {Method{Criterion::lsq, true, true}, Method{Criterion::lsq, true, false}}) {
        for (const MeansRow* row : cell) {
          if (row->experiment.n == largest && methodIndex(row->method) == methodIndex(method) &&
              row->report.size() > 0) {
            candidates.push_back(histogramPanel(
                *row, fmt::format("LSQ, {}, n = {}", method.known_noise ? "known noise" : "residuals", largest)));
          }
        }
      }
      candidates.push_back(accuracy);
      candidates.push_back(iterations);
      for (Panel& panel : candidates) {
        if (!panel.series.empty()) plot.panels.push_back(std::move(panel));
      }
      report.plot(plot);
    }

    report.table(tableOf(page_columns, selected(rows, [&](const MeansRow& row) {
                           return std::pair(row.experiment.feature, row.experiment.spread) == group;
                         })));
  }
}

ValidationView viewOf(const MeansValidationResult& result) {
  return {.title = "Means of geometric features: are their covariances true?",
          .introduction =
              "Each trial draws a feature, measures it n times with noise, estimates the mean and its covariance, and "
              "takes the squared Mahalanobis distance of the exact feature about the estimate. If the covariance is "
              "true these distances follow a chi-square law (known noise) or Hotelling's law (noise estimated from the "
              "residuals). The validation index is their mean. Experiments of Pennec, INRIA RR-3371 (1998), section 5.",
          .judgement = judgementOf(result),
          .fields = [&result](JsonObject& object) { object.fieldsOf(result); },
          .head = meansTables(result.rows) + (result.verdicts.empty() ? "" : verdictTable(result.verdicts)),
          .page = [&result](Report& report) { drawPage(report, result.rows); }};
}

struct Options {
  std::vector<std::string> features, noises, criteria;
  std::vector<std::size_t> n;
  std::vector<double> spreads;
  std::optional<CovarianceAt> covariance_at;
  bool certify = false;
  RunOptions run;
};

/// The front door's cells of the chosen features; none where the run is about certain rows of the experiments.
std::vector<VerdictCell> chosenCells(const Options& options, const std::vector<Feature>& features) {
  const bool narrowed = !options.noises.empty() || !options.criteria.empty() || !options.n.empty() ||
                        !options.spreads.empty() || options.covariance_at == CovarianceAt::measured;
  std::vector<VerdictCell> cells;
  if (narrowed) return cells;
  for (VerdictCell cell : verdictCells(options.run.full)) {
    if (std::find(features.begin(), features.end(), cell.feature) == features.end()) continue;
    if (options.run.trials != 0) cell.trials = std::min(cell.trials, options.run.trials);
    cells.push_back(cell);
  }
  return cells;
}

int runCommand(const Options& options, const Invocation& invocation) {
  MeansValidation validation;
  validation.features = chosen(all_features, options.features);
  validation.noises = chosen(all_noises, options.noises);
  validation.criteria = chosen(all_criteria, options.criteria);
  if (!options.n.empty()) validation.n = options.n;
  validation.spreads = options.spreads;
  if (options.run.full && validation.spreads.empty()) validation.spreads = {1.0 / 3, 1.0};
  validation.covariance_at = options.covariance_at.value_or(CovarianceAt::estimated);
  validation.run = options.run.size(1000, 4000);
  validation.certify = options.certify || options.run.full;
  validation.all_printed = options.run.full;

  options.run.begin(invocation);
  MeansValidationResult result;
  result.rows = runTrials("validate means", [&](const auto& progress) { return validateMeans(validation, progress); });
  result.verdicts = runTrials("verdicts", [&](const auto& progress) {
    return judgeVerdicts(chosenCells(options, validation.features), options.run.seed, options.run.threads, progress);
  });
  return publish(options.run, invocation, viewOf(result));
}

}  // namespace

void addValidateMeansCommand(const CommandList& validate) {
  auto options = std::make_shared<Options>();
  const Command app = validate.add("means", "Means of features: Monte-Carlo validation of their covariances");
  app.option("--feature", options->features, "Features, a comma list").list().oneOf(names(all_features));
  app.option("--noise", options->noises, "Noises, a comma list").list().oneOf(names(all_noises));
  app.option("--criterion", options->criteria, "Criteria, a comma list").list().oneOf(names(all_criteria));
  app.option("--n", options->n, "Numbers of measurements, a comma list (default 5,10,20,30,50,100)")
      .list()
      .range(std::size_t{2}, std::size_t{1000000});
  app.option("--spread", options->spreads,
             "Factors of the report's standard deviations, a comma list (default 1, frames 1/3)")
      .list()
      .range(1e-9, 10.0);
  app.choice<CovarianceAt>("--covariance-at", options->covariance_at,
                           {{"estimated", CovarianceAt::estimated}, {"measured", CovarianceAt::measured}},
                           "Frame in which the noise of frames is Gaussian and MAHA takes its covariances");
  options->run.declare(app, "1000, with --full 4000");
  app.flag("--certify", options->certify, "Certify the global minimum of LSQ and WLSQ by branch and bound");
  app.flag("--full", options->run.full,
           "4000 trials, both spreads, certified minima, all printed formulas; no time limit");
  app.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
