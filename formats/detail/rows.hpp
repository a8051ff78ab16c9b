// Helpers that the readers of rows share: headers, time stamps, and EuRoC's rows that begin with one.
#pragma once

#include <formats/text.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace liestat::detail {

/// At most that many rows of so many columns fit into a text: a row has a digit and a separator for each field.
std::size_t mostRows(std::string_view text, std::size_t columns);

/// True if all fields are numbers or empty, so that they cannot be a header.
bool looksNumeric(const std::vector<std::string_view>& fields);

/// True if a field looks like a time stamp in nanoseconds since 1970. EuRoC's files have no header but a comment, so
/// this is how they are told from CSV.
bool isNanoseconds(std::string_view field);

/// Throws InputError where a time is not after the one of the line before it.
void requireAscending(double before, std::size_t line_before, double time, const std::string& file, std::size_t line);

/// The rows of EuRoC's files: a time stamp in nanoseconds, the columns named here, and what else there may be.
class StampedRows {
 public:
  StampedRows(std::string_view text, const std::string& file, std::span<const char* const> columns)
      : reader_(text), file_(file), columns_(columns) {}

  /// Goes to the next row; false at the end.
  bool next();
  /// Throws InputError unless it is a whole number of zero or more.
  std::int64_t stamp() const;
  std::size_t line() const { return reader_.number(); }
  /// Columns count from 0, after the time stamp.
  bool has(std::size_t column) const { return column + 1 < fields_.size(); }
  double number(std::size_t column, std::string_view name) const {
    return numberField(fields_[column + 1], name, file_, reader_.number());
  }
  Eigen::Vector3d vector(std::size_t column) const;

 private:
  LineReader reader_;
  const std::string& file_;
  std::span<const char* const> columns_;
  std::vector<std::string_view> fields_;
};

}  // namespace liestat::detail
