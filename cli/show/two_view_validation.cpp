#include <cli/show/two_view_validation.hpp>

#include <report/page.hpp>
#include <report/table.hpp>
#include <cli/show/validation.hpp>

#include <fmt/format.h>

#include <cstddef>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

constexpr const char* short_names[] = {"none", "rtrans", "zoom", "rdisp", "rot", "homog", "trans", "ess", "fund"};
static_assert(std::size(short_names) == default_two_view_motions.size());

std::vector<std::string> choiceHeaders() {
  std::vector<std::string> headers{"truth"};
  headers.insert(headers.end(), std::begin(short_names), std::end(short_names));
  return headers;
}
std::string percent(std::size_t count, const TwoViewChoice& choice) {
  return fmt::format("{:.1f}", 100 * static_cast<double>(count) / static_cast<double>(choice.trials));
}
/// Shares of the chosen models in per cent.
std::vector<std::string> choiceCells(const TwoViewChoice& choice) {
  std::vector<std::string> cells{short_names[static_cast<std::size_t>(choice.truth)]};
  for (std::size_t m = 0; m < default_two_view_motions.size(); ++m) cells.push_back(percent(choice.chosen[m], choice));
  return cells;
}
const std::vector<std::string> optional_headers{"truth", "chosen, %", "others, %"};
/// The share of the optional model of a motion, and what was chosen instead of it.
std::vector<std::string> optionalCells(const TwoViewChoice& choice) {
  std::string others;
  for (std::size_t m = 0; m < default_two_view_motions.size(); ++m) {
    if (choice.chosen[m] == 0) continue;
    others += fmt::format("{}{} {}", others.empty() ? "" : ", ", short_names[m], percent(choice.chosen[m], choice));
  }
  return {nameOf(choice.truth), percent(choice.right(), choice), others};
}
struct ChoiceTables {
  std::vector<std::vector<std::string>> nine, optional;
};
ChoiceTables choiceTables(const TwoViewValidationResult& result) {
  ChoiceTables tables;
  for (const TwoViewChoice& choice : result.choices) {
    if (choice.optional()) {
      tables.optional.push_back(optionalCells(choice));
    } else {
      tables.nine.push_back(choiceCells(choice));
    }
  }
  return tables;
}
std::string tableText(const std::vector<std::string>& headers, const std::vector<std::vector<std::string>>& rows) {
  Table table(headers);
  for (const auto& row : rows) table.row(row);
  return table.str();
}
const std::vector<std::string> distance_headers{"model", "k", "index", "SE", "95 % covers", "K-S p", "verdict"};
std::vector<std::string> distanceCells(const TwoViewRow& row) {
  const ValidationReport& r = row.report;
  return {name(row.motion),
          fmt::format("{}", r.dof),
          number(r.index),
          number(r.index_se, 2),
          number(100 * r.coverage[2].observed),
          number(r.ks_p_value, 2),
          verdictCell(row.passed)};
}

}  // namespace

std::string formatTwoViewTables(const TwoViewValidationResult& result) {
  Table distances(distance_headers);
  for (const TwoViewRow& row : result.rows) distances.row(distanceCells(row));
  const ChoiceTables choices = choiceTables(result);
  std::string text;
  if (!choices.nine.empty()) {
    text += fmt::format("\nModels that were chosen, %\n{}mean of the diagonal: {:.1f} %\n",
                        tableText(choiceHeaders(), choices.nine), 100 * result.average());
  }
  if (!choices.optional.empty()) {
    text += "\nOptional models, each beside the default lattice\n" + tableText(optional_headers, choices.optional);
  }
  if (!result.rows.empty()) {
    text += fmt::format("\nSquared distance of the truth from the true model's estimate; index k expected\n{}",
                        distances.str());
  }
  for (const TwoViewRow& row : result.rows) {
    if (!row.passed.value_or(true)) text += fmt::format("\nFAILED {}: {}", name(row.motion), reason(row.verdict));
  }
  for (const TwoViewChoice& choice : result.choices) {
    if (!choice.passed.value_or(true)) {
      text += fmt::format("\nFAILED {}: chosen in {} of {} trials, {:.0f} % are promised", name(choice.truth),
                          choice.right(), choice.trials, 100 * promised_row);
    }
  }
  if (!result.average_passed.value_or(true)) {
    text += fmt::format("\nFAILED mean of the diagonal: {:.0f} % are promised", 100 * promised_average);
  }
  const Tally count = tally(result.rows) + result.tally();
  if (count.failed > 0) text += "\n";
  return text + "\n" + verdictLines(count, "of distances and choices");
}

JsonObject toJson(const TwoViewRow& row) {
  JsonObject o;
  o.set("motion", name(row.motion));
  setStatistics(o, row.report);
  o.set("tail", row.tail).set("failures", row.report.failures).set("passed", row.passed);
  return o;
}

JsonObject toJson(const TwoViewChoice& choice) {
  JsonObject o, chosen;
  for (std::size_t m = 0; m < choice.chosen.size(); ++m) {
    // The default lattice, and the model that this motion is tried with.
    if (m >= default_two_view_motions.size() && all_two_view_motions[m] != choice.truth) continue;
    chosen.set(name(all_two_view_motions[m]), choice.chosen[m]);
  }
  o.set("motion", name(choice.truth)).set("trials", choice.trials).set("chosen", chosen).set("passed", choice.passed);
  return o;
}

void writeTwoViewReport(const std::string& directory, const std::string& command_line,
                        const TwoViewValidationResult& result) {
  Report report(directory, "Two-view motion: is the right model chosen, and is its covariance true?");
  showVerdict(report, formatTwoViewTables(result));
  report.paragraph(
      "Each trial moves a camera by one motion, takes matches with noise and outliers, and runs the hierarchy of "
      "models over them. The table has the models that were chosen. For the true model's estimate the squared "
      "Mahalanobis "
      "distance of the true parameter follows a chi-square law if the covariance is true; its mean, the index, is then "
      "the number k of free parameters.");
  report.code(command_line);
  report.section("Models that were chosen");
  std::vector<std::vector<std::string>> distances;
  const ChoiceTables choices = choiceTables(result);
  if (!choices.nine.empty()) {
    report.table(choiceHeaders(), choices.nine,
                 fmt::format("Per cent of the trials; mean of the diagonal {:.1f} %.", 100 * result.average()));
  }
  if (!choices.optional.empty()) {
    report.table(optional_headers, choices.optional, "Optional models, each beside the default lattice.");
  }
  if (!result.rows.empty()) {
    report.section("Distances of the truth");
    std::vector<Panel> histograms;
    for (const TwoViewRow& row : result.rows) {
      distances.push_back(distanceCells(row));
      histograms.push_back(histogramPanel(row, name(row.motion)));
    }
    report.table(distance_headers, distances);
    report.plot({.name = "distances",
                 .caption = "Squared distances with the density that they should have.",
                 .panels = histograms,
                 .columns = 4});
  }
  report.write();
}

}  // namespace liestat::cli
