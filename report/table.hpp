#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {

/// A number for people: so many significant digits, `n/a` for what is not finite.
std::string number(double value, int digits = 4);

/// Rows of cells below headers, for the terminal (Table) and for a page (Report::table).
struct TableRows {
  std::vector<std::string> headers = {};
  std::vector<std::vector<std::string>> rows = {};
};

/// The way of a column's numbers: significant digits, or decimals.
struct Digits {
  int count = 4;
  bool decimals = false;
  Digits(int significant = 4) : count(significant) {}
};
inline Digits fixed(int decimals) {
  Digits digits(decimals);
  digits.decimals = true;
  return digits;
}

/// A value as a cell: numbers with these digits, whole ones as they are, nothing for an empty optional.
std::string cell(double value, Digits digits = {});
template <class T>
std::string cell(const T& value, Digits digits = {}) {
  if constexpr (requires { value.has_value(); }) {
    return value ? cell(*value, digits) : std::string();
  } else if constexpr (std::is_integral_v<T>) {
    return std::to_string(value);
  } else {
    return value;
  }
}

/// Where a column is shown; a page has room for more of them than a terminal.
enum class ShownOn { both, terminal, page };

/// A column of a table over rows of a type.
template <class Row>
struct Column {
  std::string heading;
  std::function<std::string(const Row&)> cell;
  ShownOn where = ShownOn::both;

  /// `value`: a member of the row or a function of it, a number, a word, or an optional one.
  template <class Value>
  Column(std::string name, Value value, Digits digits = {}, ShownOn on = ShownOn::both)
      : heading(std::move(name)),
        cell([value, digits](const Row& row) { return liestat::cell(std::invoke(value, row), digits); }),
        where(on) {}
  template <class Value>
  Column(std::string name, Value value, ShownOn on) : Column(std::move(name), value, Digits{}, on) {}
};
/// The description of a table, of which its views are made.
template <class Row>
using Columns = std::vector<Column<Row>>;

/// The table of some rows on the terminal or on a page.
template <class Row, class List>
TableRows tableOf(const Columns<Row>& columns, const List& rows, ShownOn view = ShownOn::terminal) {
  TableRows table;
  for (const Column<Row>& column : columns) {
    if (column.where == ShownOn::both || column.where == view) table.headers.push_back(column.heading);
  }
  for (const Row& row : rows) {
    std::vector<std::string>& cells = table.rows.emplace_back();
    for (const Column<Row>& column : columns) {
      if (column.where == ShownOn::both || column.where == view) cells.push_back(column.cell(row));
    }
  }
  return table;
}

/// A table as the terminal and as a page show it.
struct BothTables {
  TableRows terminal, page;
};
template <class Row, class List>
BothTables tablesOf(const Columns<Row>& columns, const List& rows) {
  return {tableOf(columns, rows, ShownOn::terminal), tableOf(columns, rows, ShownOn::page)};
}

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
