#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace liestat {

/// A number for people: so many significant digits, `n/a` for what is not finite.
std::string number(double value, int digits = 4);

/// Rows of cells below headers, for the terminal (Table) and for a page (Report::table).
struct TableRows {
  std::vector<std::string> headers;
  std::vector<std::vector<std::string>> rows = {};
};

/// A table for the terminal, at most 80 columns wide. Columns of numbers are aligned at the decimal point, others to
/// the left. What does not fit is set as a second table below with the first column repeated; long texts are shortened,
/// numbers never.
class Table {
 public:
  explicit Table(std::vector<std::string> headers);
  explicit Table(const TableRows& table) : Table(table.headers) {
    for (const auto& cells : table.rows) row(cells);
  }

  /// Adds a row; missing cells are empty, more than there are headers are misuse.
  void row(std::vector<std::string> cells);

  /// The table as lines, each ended by a newline.
  std::string str(std::size_t width = 80) const;

 private:
  std::vector<std::string> headers_;
  std::vector<std::vector<std::string>> rows_;
};

/// A text in lines of at most so many columns, those after the first indented, each ended by a newline. Longer words keep
/// a line of their own.
std::string wrapped(std::string_view text, std::size_t width = 80, std::size_t indent = 0);

/// Columns that a text takes on the terminal, for UTF-8 without wide or combining characters.
std::size_t displayWidth(std::string_view text);

}  // namespace liestat
