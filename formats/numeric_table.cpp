#include <formats/numeric_table.hpp>

#include <formats/detail/rows.hpp>
#include <formats/input_error.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <utility>

namespace liestat {
namespace {

/// The whole number that a field writes without point or exponent, if it is so large that a double may be another.
std::optional<std::uint64_t> beyondDoubles(double value, std::string_view field) {
  if (!(value >= 9007199254740992.0)) return std::nullopt;
  if (field.front() == '+') field.remove_prefix(1);
  std::uint64_t whole = 0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), whole);
  if (error != std::errc() || end != field.data() + field.size()) return std::nullopt;
  return whole;
}

}  // namespace

NumericTable::NumericTable(std::string file, std::vector<std::string> columns)
    : file_(std::move(file)), columns_(std::move(columns)) {}

bool NumericTable::has(std::string_view column) const {
  return std::find(columns_.begin(), columns_.end(), column) != columns_.end();
}

std::size_t NumericTable::column(std::string_view column) const {
  return static_cast<std::size_t>(std::find(columns_.begin(), columns_.end(), column) - columns_.begin());
}

std::size_t NumericTable::index(std::size_t row, std::size_t column) const {
  const double value = (*this)(row, column);
  if (const auto exact = exact_.find(row * columns_.size() + column); exact != exact_.end()) {
    if (exact->second <= std::uint64_t{1} << 63U) return exact->second;
    throw InputError(file_, lines_[row], fmt::format("{} is {}", columns_[column], exact->second),
                     "a whole number of 0 or more, up to 2^63");
  }
  // 2^53: up to there every whole number is a double.
  if (value >= 0 && value <= 9007199254740992.0 && value == std::floor(value)) return static_cast<std::size_t>(value);
  throw InputError(file_, lines_[row], fmt::format("{} is {}", columns_[column], value), "a whole number of 0 or more");
}

void NumericTable::append(const double* values, std::size_t line) {
  values_.insert(values_.end(), values, values + columns_.size());
  lines_.push_back(line);
}

void NumericTable::keepExactly(std::size_t column, std::uint64_t value) {
  exact_[values_.size() - columns_.size() + column] = value;
}

NumericTable readTable(const std::string& path, const std::vector<std::string>& required,
                       const std::vector<std::string>& optional) {
  const TextFile file = loadText(path);
  return parseTable(file.text, file.name, required, optional);
}

NumericTable parseTable(std::string_view text, std::string name, const std::vector<std::string>& required,
                        const std::vector<std::string>& optional) {
  requireText(text, name);
  LineReader reader(text);
  const std::string header = joined(required, ",");
  if (!reader.next())
    throw InputError(name, 0, "the file has no data, only blank lines and comments", "the columns " + header);
  std::vector<std::string_view> fields;
  splitFields(reader.line(), Separator::comma, fields);
  if (detail::looksNumeric(fields))
    throw InputError(name, reader.number(), "numbers where the header should be", "the columns " + header);
  const std::vector<std::string> names = readHeader(fields, name, reader.number());

  std::vector<std::string> columns;
  std::vector<std::size_t> places;
  for (const auto* list : {&required, &optional}) {
    for (const std::string& column : *list) {
      const auto found = std::find(names.begin(), names.end(), column);
      if (found != names.end()) {
        columns.push_back(column);
        places.push_back(static_cast<std::size_t>(found - names.begin()));
      } else if (list == &required) {
        const std::string near = nearestName(column, names);
        throw InputError(
            name, reader.number(),
            "there is no column '" + column + "'" + (near.empty() ? "" : " (is it '" + printable(near) + "'?)"),
            "the columns " + header);
      }
    }
  }

  const std::size_t header_line = reader.number();
  NumericTable table(std::move(name), columns);
  std::vector<double> values(columns.size());
  while (reader.next()) {
    splitFields(reader.line(), Separator::comma, fields);
    if (fields.size() != names.size())
      throwWrongWidth(fields.size(), names.size(), "as in the header", table.file(), reader.number());
    for (std::size_t i = 0; i < columns.size(); ++i) {
      values[i] = numberField(fields[places[i]], columns[i], table.file(), reader.number());
    }
    table.append(values.data(), reader.number());
    for (std::size_t i = 0; i < columns.size(); ++i) {
      if (const auto whole = beyondDoubles(values[i], fields[places[i]])) table.keepExactly(i, *whole);
    }
  }
  if (table.rows() == 0)
    throw InputError(table.file(), header_line, "there is a header but no data", "at least one row after it");
  return table;
}

void requireText(std::string_view text, const std::string& file) {
  if (text.empty()) throw InputError(file, 0, "the file is empty");
  if (text.substr(0, 2) == "\xFF\xFE" || text.substr(0, 2) == "\xFE\xFF") {
    throw InputError(file, 1, "the text is encoded as UTF-16", "UTF-8");
  }
  const std::size_t nul = text.find('\0');
  if (nul != std::string_view::npos) {
    const auto line =
        static_cast<std::size_t>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(nul), '\n'));
    throw InputError(file, line + 1, "this is not text (it contains a zero byte)", "a text file");
  }
}

std::vector<std::string> readHeader(const std::vector<std::string_view>& fields, const std::string& file,
                                    std::size_t line) {
  if (fields.size() > most_columns) {
    throw InputError(file, line, fmt::format("{} columns", fields.size()), fmt::format("at most {}", most_columns));
  }
  std::vector<std::string> names(fields.begin(), fields.end());
  std::vector<std::string> sorted = names;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i].empty()) throw InputError(file, line, fmt::format("column {} of the header has no name", i + 1));
  }
  std::sort(sorted.begin(), sorted.end());
  const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
  if (twice != sorted.end())
    throw InputError(file, line, "column '" + printable(*twice) + "' appears twice", "it once");
  return names;
}

void throwWrongWidth(std::size_t found, std::size_t expected, std::string_view why, const std::string& file,
                     std::size_t line) {
  throw InputError(file, line, fmt::format("{} {}", found, found == 1 ? "field" : "fields"),
                   fmt::format("{} {}", expected, why));
}

}  // namespace liestat
