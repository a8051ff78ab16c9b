#include <report/table.hpp>
#include <cli/show/validation.hpp>
#include <cli/show/vi_init_validation.hpp>
#include <cli/show/vi_init_validation_groups.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

using Check = ViInitCheck;
using Quantity = ViInitQuantity;
using Group = ViInitGroup;

std::string index(const ViInitRow* row) { return row == nullptr ? "" : fmt::format("{:.2f}", row->report->index); }
std::string ratio(const ViInitRow* row) { return row == nullptr ? "" : fmt::format("{:.3f}", row->value); }
std::string covered(const ViInitRow* row) {
  return row == nullptr ? "" : fmt::format("{:.1f}", 100 * row->report->coverage[2].observed);
}
std::string both(double median, double p95) { return number(median, 2) + " / " + number(p95, 2); }
std::string errors(const ViInitRow* row) { return row == nullptr ? "" : both(row->median, row->p95); }

bool isOfRefinement(Check check) { return check == Check::consistency || check == Check::walk; }
bool hasDistances(Check check) { return isOfRefinement(check) || check == Check::closed_form; }

Table distancesTable(const std::vector<Group>& list) {
  const Check check = list.front().first().check;
  const bool refined = isOfRefinement(check), walks = check == Check::walk;
  std::vector<std::string> headers{"T, n, N"};
  if (refined) {
    if (!walks) headers.push_back("V (3)");
    headers.insert(headers.end(), {"V,G (5)", "all (11)", "last (9)"});
    if (walks) headers.push_back("last, G, biases (17)");
  } else {
    headers.insert(headers.end(), {"V,G (5)", "with bias (8)"});
  }
  headers.insert(headers.end(), {"χ²/dof", "95 %", "lost", "verdict"});
  Table table(headers);
  for (const Group& g : list) {
    std::vector<std::string> cells{g.window()};
    if (refined && !walks) cells.push_back(index(g.of(Quantity::nees_v)));
    cells.push_back(index(g.of(Quantity::nees_v_g)));
    cells.push_back(index(g.of(Quantity::nees_all)));
    if (refined) cells.push_back(index(g.of(Quantity::nees_last_state)));
    if (walks) cells.push_back(index(g.of(Quantity::nees_at_last)));
    cells.push_back(ratio(g.of(Quantity::chi2_per_dof)));
    cells.push_back(covered(g.of(Quantity::nees_v_g)));
    cells.push_back(fmt::format("{}", g.of(Quantity::nees_v_g)->failures));
    cells.push_back(g.verdict());
    table.row(cells);
  }
  return table;
}

/// The errors of a refinement stand below its distances.
Table errorsTable(const std::vector<Group>& list) {
  const Check check = list.front().first().check;
  std::vector<std::string> headers{"estimator", "T, n, N", "speed m/s", "gravity deg", "scale %"};
  if (check == Check::gyroscope_bias) headers[2] = "bias rad/s";
  if (check == Check::consistency) headers.push_back("of features");
  if (check == Check::drift) headers.push_back("selection");
  Table table(headers);
  for (const Group& g : list) {
    const Quantity leading = check == Check::gyroscope_bias ? Quantity::bias : Quantity::speed;
    std::vector<std::string> cells{name(g.first().estimator), g.window(), errors(g.of(leading)),
                                   errors(g.of(Quantity::gravity)), errors(g.of(Quantity::scale))};
    if (check == Check::consistency) cells.push_back(errors(g.of(Quantity::scale_of_features)));
    if (check == Check::drift) cells.push_back(ratio(g.of(Quantity::selection)));
    table.row(cells);
    // The reference figures, beside the first estimator of a window.
    const auto noted = [&](Quantity quantity) {
      const ViInitRow* row = g.of(quantity);
      if (row == nullptr || !row->promise || !std::isfinite(row->promise->note_median)) return std::string();
      return std::isfinite(row->promise->note_p95) ? both(row->promise->note_median, row->promise->note_p95)
                                                   : number(row->promise->note_median, 2);
    };
    const std::vector<std::string> note{"  (prototype)", "", noted(leading), noted(Quantity::gravity),
                                        noted(Quantity::scale)};
    if (std::any_of(note.begin() + 2, note.end(), [](const std::string& s) { return !s.empty(); })) table.row(note);
  }
  return table;
}

/// Table of the check at rest: windows that were told right, and the covariance.
Table restTable(const std::vector<Group>& list) {
  Table table({"", "T, n, N", "told right", "moves", "gravity, biases (8)", "95 %", "verdict"});
  for (const Group& g : list) {
    const ViInitRow* nees = g.of(Quantity::nees_at_rest);
    table.row({name(g.first().estimator), g.window(), ratio(g.of(Quantity::told)), ratio(g.of(Quantity::moving)),
               index(nees), covered(nees), g.verdict()});
  }
  return table;
}

/// How often intervals held the factors.
Table noiseTable(const std::vector<Group>& list) {
  Table table({"factors g, a", "T, n, N", "recordings", "gyroscope's", "accelerometer's", "of both", "verdict"});
  for (const Group& g : list) {
    table.row({inWords(g.first().estimator), g.window(), fmt::format("{}", g.first().trials),
               ratio(g.of(Quantity::gyroscope_interval)), ratio(g.of(Quantity::accelerometer_interval)),
               ratio(g.of(Quantity::common_interval)), g.verdict()});
  }
  return table;
}

}  // namespace

std::string formatViInitTables(const std::vector<ViInitRow>& rows) {
  std::string text;
  for (const Check check : all_vi_init_checks) {
    const std::vector<Group> list = groups(rows, check);
    if (list.empty()) continue;
    if (text.empty()) {
      text = fmt::format("{} windows a row, of T seconds, n images and N features\n\n", list.front().first().trials);
    }
    text += fmt::format("{}\n\n", describe(check));
    if (hasDistances(check)) text += distancesTable(list).str() + "\n";
    if (check == Check::rest) {
      text += restTable(list).str() + "\n";
    } else if (check == Check::noise) {
      text += noiseTable(list).str() + "\n";
    } else if (check != Check::closed_form && check != Check::walk) {
      text += errorsTable(list).str() + "\n";
    }
  }
  for (const ViInitRow& row : rows) {
    if (row.passed.value_or(true)) continue;
    text += fmt::format("FAILED {} {} {}, {:g} s, {} images, {} features: {}\n", name(row.check), name(row.estimator),
                        name(row.quantity), row.window.seconds, row.window.images, row.window.features,
                        reason(row.verdict));
  }
  return text + verdictLines(tally(rows), "with a promise");
}

JsonObject toJson(const ViInitRow& row) {
  JsonObject o;
  o.set("check", name(row.check)).set("estimator", name(row.estimator)).set("quantity", name(row.quantity));
  o.set("unit", unit(row.quantity));
  o.set("window", row.window.seconds).set("images", row.window.images).set("features", row.window.features);
  o.set("in_domain", row.promise.has_value());
  if (row.report) {
    setStatistics(o, *row.report);
  } else {
    o.set("trials", row.trials);
    for (const char* field :
         {"dof", "law", "index", "index_se", "index_expected", "variance", "ks_statistic", "ks_p", "coverage95"}) {
      o.set(field, nullptr);
    }
  }
  o.set("failures", row.failures).set("median", row.median).set("p95", row.p95);
  o.set("value", row.value).set("value_se", row.value_se);
  const ViInitPromise promise = row.promise.value_or(ViInitPromise{});
  o.set("promised_median", promise.median).set("promised_p95", promise.p95);
  o.set("note_median", promise.note_median).set("note_p95", promise.note_p95);
  o.set("passed", row.passed);
  return o;
}

}  // namespace liestat::cli
