#pragma once

// The view of a validation: terminal, JSON and page are made of one description.

#include <report/json.hpp>
#include <report/page.hpp>
#include <report/table.hpp>
#include <experiments/judged_report.hpp>

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace liestat::cli {

/// A table of a validation. On the terminal title and caption stand above it; the page has a section of that title.
struct ValidationTable {
  std::string title = {}, caption = {};
  BothTables table = {};         ///< without rows: the table is not shown
  std::vector<Plot> above = {};  ///< on the page, above the table
  std::vector<Plot> plots = {};  ///< on the page, below the table
  std::string below = {};        ///< on the terminal, a line below the table
  /// On the page, in place of title and caption.
  std::optional<std::string> page_title = {}, page_caption = {};
  std::size_t width = 80;  ///< columns on the terminal
};

/// A validation as it is shown. The page may refer to the rows of which the view was made.
struct ValidationView {
  std::string title, introduction;                       ///< the page's; a line of the latter is a paragraph
  std::optional<experiments::Judgement> judgement = {};  ///< none: nothing is promised
  std::function<void(JsonObject&)> fields = {};          ///< adds those of JSON to the verdict
  std::string head = {};                                 ///< lines on the terminal above the tables
  std::vector<ValidationTable> tables = {};
  std::string legend = {};                 ///< lines on the terminal below the tables
  std::function<void(Report&)> page = {};  ///< draws the page, in place of the tables
  std::optional<Verdict> verdict = {};     ///< the page's, where nothing is promised

  /// The lines for the terminal, the verdict last.
  std::string text() const;
  /// The object written by `--json`.
  JsonObject json(const std::string& command_line, std::uint64_t seed) const;
  /// Writes the page with its plots.
  void writePage(const std::string& directory, const std::string& command_line) const;
};

/// A cell of a table: pass, FAIL, or empty where nothing was judged.
std::string verdictCell(const std::optional<bool>& passed);

/// Values of a row that is a judged report, for columns.
struct Judged {
  using Row = experiments::JudgedReport;
  static std::size_t trials(const Row& row) { return row.report.trials; }
  static int dof(const Row& row) { return row.report.dof; }
  static double index(const Row& row) { return row.report.index; }
  static double indexError(const Row& row) { return row.report.index_se; }
  static double expected(const Row& row) { return row.report.law.mean(); }
  static double kolmogorov(const Row& row) { return row.report.ks_p_value; }
  /// Per cent of the truths inside the 95 % region.
  static double covered(const Row& row) { return 100 * row.report.coverage[2].observed; }
  static std::string verdict(const Row& row) { return verdictCell(row.passed); }
};

/// The rows for which keep(row) holds.
template <class Row, class Keep>
std::vector<std::reference_wrapper<const Row>> selected(const std::vector<Row>& rows, const Keep& keep) {
  std::vector<std::reference_wrapper<const Row>> list;
  for (const Row& row : rows) {
    if (keep(row)) list.emplace_back(row);
  }
  return list;
}

/// Histogram of the squared distances with the density that they should have.
Panel histogramPanel(const experiments::JudgedReport& row, const std::string& title);

/// The histograms of some rows; titleOf(row) names each.
template <class List, class Title>
Plot histogramPlot(std::string name, const List& rows, const Title& titleOf,
                   std::string caption = "Distances of the trials with the density that they should have.") {
  Plot plot{.name = std::move(name), .caption = std::move(caption), .columns = 4};
  for (const auto& row : rows) plot.panels.push_back(histogramPanel(row, titleOf(row)));
  return plot;
}

}  // namespace liestat::cli
