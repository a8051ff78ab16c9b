// Tables of numbers: CSV files whose header names the columns, and EuRoC's rows that begin with a time stamp.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include <formats/text.hpp>

namespace liestat {

/// Columns of numbers by name, from a CSV file with a header.
class NumericTable {
 public:
  NumericTable(std::string file, std::vector<std::string> columns);

  const std::string& file() const { return file_; }
  /// The columns that were read: the required ones, then those of the optional ones that the file has.
  const std::vector<std::string>& columns() const { return columns_; }
  bool has(std::string_view column) const;
  /// The index of a column that `has` finds.
  std::size_t column(std::string_view column) const;

  std::size_t rows() const { return lines_.size(); }
  double operator()(std::size_t row, std::size_t column) const { return values_[row * columns_.size() + column]; }
  std::size_t line(std::size_t row) const { return lines_[row]; }
  /// A value that has to be a whole number from 0 to 2^63, exactly as the file has it; throws InputError otherwise.
  std::size_t index(std::size_t row, std::size_t column) const;

  /// Adds a row of as many values as there are columns.
  void append(const double* values, std::size_t line);
  /// Keeps a whole number of the last row that a double does not hold.
  void keepExactly(std::size_t column, std::uint64_t value);

 private:
  std::string file_;
  std::vector<std::string> columns_;
  std::vector<double> values_;
  std::vector<std::size_t> lines_;
  std::unordered_map<std::size_t, std::uint64_t> exact_;  ///< by the place in values_
};

/// Reads the required columns, and those of the optional ones that are there, in whatever order the file has them; it
/// may have others. At least one row. Throws InputError.
NumericTable readTable(const std::string& path, const std::vector<std::string>& required,
                       const std::vector<std::string>& optional = {});
/// The same from memory.
NumericTable parseTable(std::string_view text, std::string name, const std::vector<std::string>& required,
                        const std::vector<std::string>& optional = {});

/// Throws InputError where a text is empty, encoded in UTF-16 or no text at all.
void requireText(std::string_view text, const std::string& file);

/// True if all fields are numbers or empty, so that they cannot be a header.
bool looksNumeric(const std::vector<std::string_view>& fields);

/// The names of a header; throws InputError where one is empty or appears twice.
std::vector<std::string> readHeader(const std::vector<std::string_view>& fields, const std::string& file,
                                    std::size_t line);

/// A row with too few or too many fields: throws InputError "2 fields, expected 3 <why>".
[[noreturn]] void throwWrongWidth(std::size_t found, std::size_t expected, std::string_view why,
                                  const std::string& file, std::size_t line);

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

}  // namespace liestat
