// Tables of numbers: CSV files whose header names the columns.
#pragma once

#include <cstddef>
#include <cstdint>
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

/// The names of a header; throws InputError where one is empty or appears twice.
std::vector<std::string> readHeader(const std::vector<std::string_view>& fields, const std::string& file,
                                    std::size_t line);

/// A row with too few or too many fields: throws InputError "2 fields, expected 3 <why>".
[[noreturn]] void throwWrongWidth(std::size_t found, std::size_t expected, std::string_view why,
                                  const std::string& file, std::size_t line);

}  // namespace liestat
