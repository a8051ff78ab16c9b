#pragma once

// The view of a validation: terminal, JSON and page are made of one description.

#include <report/json.hpp>
#include <report/page.hpp>
#include <experiments/judged_report.hpp>

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {

/// A table of a validation. On the terminal title and caption stand above it; the page has a section of that title.
struct ValidationTable {
  std::string title = {}, caption = {};
  std::vector<std::string> headers = {};
  std::vector<std::vector<std::string>> rows = {};  ///< none: the table is not shown
  std::vector<Plot> plots = {};                     ///< on the page, below the table
  std::string below = {};                           ///< on the terminal, a line below the table
  /// On the page, in place of title and caption.
  std::optional<std::string> page_title = {}, page_caption = {};
  std::size_t width = 80;  ///< columns on the terminal
};

/// A validation as it is shown. The page may refer to the rows of which the view was made.
struct ValidationView {
  std::string title, introduction;                       ///< of the page; a line of the latter is a paragraph
  std::optional<experiments::Judgement> judgement = {};  ///< none: nothing is promised
  std::function<void(JsonObject&)> fields = {};          ///< adds those of JSON to the verdict
  std::string head = {};                                 ///< lines on the terminal above the tables
  std::vector<ValidationTable> tables = {};
  std::string legend = {};                 ///< lines on the terminal below the tables
  std::function<void(Report&)> page = {};  ///< draws the page, in place of the tables
  std::optional<Verdict> verdict = {};     ///< of the page, where nothing is promised

  /// The lines for the terminal, the verdict last.
  std::string text() const;
  /// The object written by `--json`.
  JsonObject json(const std::string& command_line, std::uint64_t seed) const;
  /// Writes the page with its plots.
  void writePage(const std::string& directory, const std::string& command_line) const;
};

/// A cell of a table: pass, FAIL, or empty where nothing was judged.
std::string verdictCell(const std::optional<bool>& passed);

/// Histogram of the squared distances with the density that they should have.
Panel histogramPanel(const experiments::JudgedReport& row, const std::string& title);

}  // namespace liestat::cli
