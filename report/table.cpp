#include <report/table.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include <formats/text.hpp>

namespace liestat {
namespace {

constexpr std::size_t gap = 2;
/// Texts are not shortened below this.
constexpr std::size_t shortest_text = 12;

bool isContinuation(char c) { return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U; }

bool isNumber(std::string_view cell) {
  double value = 0;
  return parseNumber(cell, value) != NumberKind::no_number;
}

/// Stands where a number could be.
bool isGap(std::string_view cell) { return cell.empty() || cell == "-" || cell == "n/a"; }

std::string shortened(const std::string& text, std::size_t width) {
  if (displayWidth(text) <= width) return text;
  std::size_t end = 0;
  for (std::size_t seen = 0; end < text.size(); ++end) {
    if (!isContinuation(text[end]) && ++seen == width) break;
  }
  return text.substr(0, end) + "…";
}

std::string padded(const std::string& text, std::size_t width, bool right) {
  const std::string fill(width - std::min(width, displayWidth(text)), ' ');
  return right ? fill + text : text + fill;
}

/// One column as it is printed: cells of the same width.
struct PrintedColumn {
  bool numeric = false;
  std::size_t width = 0;
  std::vector<std::string> cells;  // the header first
};

PrintedColumn makeColumn(const std::string& header, std::vector<std::string> cells) {
  PrintedColumn column;
  const bool any = std::any_of(cells.begin(), cells.end(), isNumber);
  column.numeric = any && std::all_of(cells.begin(), cells.end(),
                                      [](const std::string& cell) { return isNumber(cell) || isGap(cell); });
  if (column.numeric) {
    // Fractions are padded with blanks, so that the points stand below each other.
    std::size_t most = 0;
    const auto fraction = [](const std::string& cell) {
      const std::size_t point = cell.find_first_of(".e");
      return !isNumber(cell) || point == std::string::npos ? std::size_t{0} : cell.size() - point;
    };
    for (const std::string& cell : cells) most = std::max(most, fraction(cell));
    for (std::string& cell : cells) {
      if (isNumber(cell)) cell.append(most - fraction(cell), ' ');
    }
  }
  column.cells.push_back(header);
  column.cells.insert(column.cells.end(), std::make_move_iterator(cells.begin()), std::make_move_iterator(cells.end()));
  for (const std::string& cell : column.cells) column.width = std::max(column.width, displayWidth(cell));
  return column;
}

void appendLine(std::string& text, const std::vector<const PrintedColumn*>& columns, std::size_t row) {
  std::string line;
  for (const PrintedColumn* column : columns) {
    if (!line.empty()) line.append(gap, ' ');
    line += padded(shortened(column->cells[row], column->width), column->width, column->numeric);
  }
  line.erase(line.find_last_not_of(' ') + 1);
  text += line + "\n";
}

}  // namespace

std::string number(double value, int digits) {
  return std::isfinite(value) ? fmt::format("{:.{}g}", value, digits) : "n/a";
}

std::string cell(double value, Digits digits) {
  return digits.decimals ? fmt::format("{:.{}f}", value, digits.count) : number(value, digits.count);
}

std::size_t displayWidth(std::string_view text) {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) { return !isContinuation(c); }));
}

Table::Table(std::vector<std::string> headers) : headers_(std::move(headers)) {}

void Table::row(std::vector<std::string> cells) {
  assert(cells.size() <= headers_.size() && "more cells than headers");
  cells.resize(headers_.size());
  rows_.push_back(std::move(cells));
}

std::string Table::str(std::size_t width) const {
  std::vector<PrintedColumn> columns;
  std::size_t total = 0;
  for (std::size_t i = 0; i < headers_.size(); ++i) {
    std::vector<std::string> cells;
    for (const auto& row : rows_) cells.push_back(row[i]);
    columns.push_back(makeColumn(headers_[i], std::move(cells)));
    total += columns.back().width + (i > 0 ? gap : 0);
  }
  // Texts give way first, the longest ones most.
  while (total > width) {
    PrintedColumn* longest = nullptr;
    for (PrintedColumn& column : columns) {
      if (!column.numeric && column.width > shortest_text && (longest == nullptr || column.width > longest->width))
        longest = &column;
    }
    if (longest == nullptr) break;
    --longest->width;
    --total;
  }

  std::string text;
  std::size_t next = 0;
  while (next < columns.size()) {
    std::vector<const PrintedColumn*> block;
    std::size_t used = 0;
    if (next > 0) {
      block.push_back(&columns[0]);
      used = columns[0].width;
      text += "\n";
    }
    const std::size_t first = next;
    for (; next < columns.size(); ++next) {
      const std::size_t more = columns[next].width + (block.empty() ? 0 : gap);
      if (next > first && used + more > width) break;
      block.push_back(&columns[next]);
      used += more;
    }
    appendLine(text, block, 0);
    std::string rule;
    for (const PrintedColumn* column : block) {
      if (!rule.empty()) rule.append(gap, ' ');
      rule.append(column->width, '-');
    }
    text += rule + "\n";
    for (std::size_t row = 1; row <= rows_.size(); ++row) appendLine(text, block, row);
  }
  return text;
}

std::string wrapped(std::string_view text, std::size_t width, std::size_t indent) {
  std::string result, line;
  bool empty = true;
  while (true) {
    const std::size_t end = std::min(text.find(' '), text.size());
    const std::string_view word = text.substr(0, end);
    if (!empty && displayWidth(line) + 1 + displayWidth(word) > width) {
      result += line + "\n";
      line = std::string(indent, ' ');
      empty = true;
    }
    if (!empty) line += ' ';
    line += word;
    empty = false;
    if (end == text.size()) return result + line + "\n";
    text.remove_prefix(end + 1);
  }
}

}  // namespace liestat
