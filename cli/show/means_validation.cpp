#include <cli/show/means_validation.hpp>

#include <report/table.hpp>
#include <cli/show/validation.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <tuple>
#include <utility>

namespace liestat::cli {

using namespace experiments;

namespace {

std::string verdictTable(const std::vector<VerdictRow>& verdicts) {
  std::string text =
      "\nVerdicts of certifiedMean, % of the trials: ok, of these outside of the 95 % region (miss), on the wrong\n"
      "side (wrong); coverage of what is ok (cover) and of first-order covariances never withheld (plain)\n";
  Table table({"feature, law", "n", "ok", "ambig", "ill", "miss", "wrong", "cover", "plain", ""});
  for (const VerdictRow& row : verdicts) {
    const auto percent = [&](double rate) { return fmt::format("{:.1f}", 100 * rate); };
    table.row(
        {fmt::format("{} {} {:.3g}", name(row.cell.feature).substr(0, 13), name(row.cell.law), row.cell.parameter),
         fmt::format("{}", row.cell.n), percent(row.rate(row.ok)), percent(row.rate(row.ambiguous)),
         percent(row.rate(row.ill_defined)), percent(row.rate(row.outside)), percent(row.rate(row.wrong)),
         row.ok > 0 ? percent(row.coverage()) : "-", percent(1 - row.rate(row.plain_outside)),
         verdictCell(row.passed)});
  }
  text += table.str();
  for (const VerdictRow& row : verdicts) {
    if (row.passed.value_or(true)) continue;
    text += fmt::format("FAILED {} {} {:.3g} n={}: {}\n", name(row.cell.feature), name(row.cell.law),
                        row.cell.parameter, row.cell.n, row.failure);
  }
  return text;
}

}  // namespace

std::string formatMeansTables(const std::vector<MeansRow>& rows, const std::vector<VerdictRow>& verdicts) {
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
  std::vector<std::pair<Feature, double>> groups;
  for (const Key& key : order) {
    const std::pair group{std::get<0>(key), std::get<1>(key)};
    if (std::find(groups.begin(), groups.end(), group) == groups.end()) groups.push_back(group);
  }
  for (const auto& [feature, spread] : groups) {
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

  for (const MeansRow& row : rows) {
    if (row.passed.value_or(true)) continue;
    text += fmt::format("\nFAILED {} {} n={} spread {:.3g} {} {}: {}", name(row.experiment.feature),
                        name(row.experiment.noise), row.experiment.n, row.experiment.spread, name(row.method.criterion),
                        row.method.known_noise ? "known noise" : "residuals", reason(row.verdict));
  }
  if (!verdicts.empty()) text += verdictTable(verdicts);
  return text + "\n" + verdictLines(tally(rows) + tally(verdicts), "in the promised domain");
}

JsonObject toJson(const VerdictRow& row) {
  JsonObject o;
  o.set("feature", name(row.cell.feature)).set("law", name(row.cell.law)).set("parameter", row.cell.parameter);
  o.set("n", row.cell.n).set("trials", row.cell.trials);
  o.set("ok", row.rate(row.ok)).set("ambiguous", row.rate(row.ambiguous)).set("ill_defined", row.rate(row.ill_defined));
  o.set("ok_but_outside", row.rate(row.outside)).set("coverage", row.coverage());
  o.set("ok_on_the_wrong_side", row.rate(row.wrong)).set("first_order_coverage", 1 - row.rate(row.plain_outside));
  o.set("passed", row.passed);
  return o;
}

JsonObject toJson(const MeansRow& row) {
  const MeansExperiment& e = row.experiment;
  const ValidationReport& r = row.report;
  JsonObject o;
  o.set("feature", name(e.feature)).set("noise", name(e.noise)).set("criterion", name(row.method.criterion));
  if (info(e.feature).frameMatters() && row.method.criterion == Criterion::maha) {
    o.set("covariance_at", name(e.covariance_at));
  } else {
    o.set("covariance_at", nullptr);
  }
  o.set("formula", row.method.corrected ? "corrected" : "printed").set("known_noise", row.method.known_noise);
  o.set("in_domain", row.promise.has_value());
  o.set("n", e.n).set("spread", e.spread);
  setStatistics(o, r);
  o.set("tail", row.tail);
  o.set("iterations", r.mean_iterations).set("failures", r.failures);
  o.set("ratio_rotation", row.ratio(log_ratio_rotation))
      .set("ratio_rotation_logsd", row.logDeviation(log_ratio_rotation));
  o.set("ratio_translation", row.ratio(log_ratio_translation));
  o.set("ratio_translation_logsd", row.logDeviation(log_ratio_translation));
  o.set("passed", row.passed);
  return o;
}

}  // namespace liestat::cli
