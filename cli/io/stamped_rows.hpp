#pragma once

#include <fmt/format.h>

#include <Eigen/Core>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <cli/io/input_error.hpp>
#include <cli/io/text.hpp>

namespace liestat::cli {

/// Does a field look like a time stamp in nanoseconds since 1970? EuRoC's files have no header but a comment, so this
/// is how they are told from CSV.
inline bool isNanoseconds(std::string_view field) {
  return field.size() >= 15 && field.find_first_not_of("0123456789") == std::string_view::npos;
}

/// A time stamp that has to be a whole number of zero or more; throws InputError otherwise.
inline std::int64_t nanosecondsField(std::string_view field, const std::string& file, std::size_t line) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error != std::errc() || end != field.data() + field.size() || value < 0) {
    throw InputError(file, line, "timestamp is '" + printable(field) + "'", "a whole number of nanoseconds");
  }
  return value;
}

/// Throws InputError where a time is not after the one of the line before it.
inline void requireAscending(double before, std::size_t line_before, double time, const std::string& file,
                             std::size_t line) {
  const double step = time - before;
  if (step > 0) return;
  throw InputError(file, line,
                   step < 0 ? fmt::format("the time is {:.6g} s before that of line {}", -step, line_before)
                            : fmt::format("the time is that of line {} again", line_before),
                   "times that ascend");
}

/// The rows of EuRoC's files: a time stamp in nanoseconds, the columns named here, and what else there may be.
class StampedRows {
 public:
  StampedRows(std::string_view text, const std::string& file, std::span<const char* const> columns)
      : reader_(text), file_(file), columns_(columns) {}

  /// Goes to the next row; false at the end.
  bool next() {
    if (!reader_.next()) return false;
    splitFields(reader_.line(), Separator::comma, fields_);
    if (fields_.size() < columns_.size() + 1) {
      throw InputError(file_, reader_.number(), fmt::format("{} fields", fields_.size()),
                       fmt::format("{} (timestamp [ns], {})", columns_.size() + 1, fmt::join(columns_, ", ")));
    }
    return true;
  }
  std::int64_t stamp() const { return nanosecondsField(fields_[0], file_, reader_.number()); }
  std::size_t line() const { return reader_.number(); }
  /// Columns count from 0, after the time stamp.
  bool has(std::size_t column) const { return column + 1 < fields_.size(); }
  double number(std::size_t column, std::string_view name) const {
    return numberField(fields_[column + 1], name, file_, reader_.number());
  }
  Eigen::Vector3d vector(std::size_t column) const {
    Eigen::Vector3d v;
    for (std::size_t i = 0; i < 3; ++i) {
      v[static_cast<Eigen::Index>(i)] =
          number(column + i, column + i < columns_.size() ? columns_[column + i] : "a bias");
    }
    return v;
  }

 private:
  LineReader reader_;
  const std::string& file_;
  std::span<const char* const> columns_;
  std::vector<std::string_view> fields_;
};

}  // namespace liestat::cli
