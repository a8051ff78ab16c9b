// Texts of files: loading, lines, fields, numbers, misspelt names.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace liestat {

/// A whole input in memory and the name that messages call it by.
struct TextFile {
  std::string name;
  std::string text;
};

/// The name of an input in messages: `-` is standard input, and control characters never reach a terminal.
std::string sourceName(const std::string& path);

/// The size of a text that is read unless the caller says otherwise, GB: of a file, of what a pipe delivers, and of what a
/// gzip file expands to.
inline constexpr double largest_text = 1;

/// Reads a file in one go, and once, so that a pipe is as good as a file; decompressed if it is a gzip file; `-` is
/// standard input. Throws InputError where that is not possible, and for a text of more than `largest` GB (nothing:
/// largest_text; a caller who gives it has the option --largest-file, which the message then names).
TextFile loadText(const std::string& path, std::optional<double> largest = {});

/// Walks over the lines of a text that carry data: comments (from `#` to the end of the line), blank lines, a byte
/// order mark and carriage returns are passed over, and the numbers of the lines are those that an editor shows.
class LineReader {
 public:
  explicit LineReader(std::string_view text);

  /// Goes to the next line with content; false at the end.
  bool next();

  /// The line without its comment and the blanks around it.
  std::string_view line() const { return line_; }
  /// Its number, from 1.
  std::size_t number() const { return number_; }
  /// The last line before this one that is a comment as a whole, without its `#`. Some formats hide their header there.
  std::string_view comment() const { return comment_; }
  /// The number of that line.
  std::size_t comment_number() const { return comment_number_; }

 private:
  std::string_view rest_;
  char line_end_ = '\n';  ///< '\r' where no line ends otherwise
  std::string_view line_;
  std::string_view comment_;
  std::size_t number_ = 0;
  std::size_t comment_number_ = 0;
};

/// The separator of a line's fields. comma: that of CSV files, a semicolon if the line has one, else a comma, else a tab.
enum class Separator { comma, blanks, comma_or_blanks };

/// Without the blanks at its ends.
std::string_view trimmed(std::string_view text);

/// Splits a line into fields without the blanks and the double quotes around them. `fields` is overwritten.
void splitFields(std::string_view line, Separator separator, std::vector<std::string_view>& fields);

/// The outcome of reading a field.
enum class NumberKind { finite, not_finite, no_number };

/// Reads a decimal number that takes up the whole field. Independent of the locale.
NumberKind parseNumber(std::string_view field, double& value);

/// As parseNumber, but anything except a finite number is an InputError that names the column.
double numberField(std::string_view field, std::string_view column, const std::string& file, std::size_t line);

/// The candidate nearest to a misspelt name, empty if none is near.
std::string nearestName(std::string_view name, const std::vector<std::string>& candidates);

/// The most columns that a row may have.
inline constexpr std::size_t most_columns = 10000;

/// Short texts one after the other, in a third of the memory of as many strings.
class TextList {
 public:
  std::size_t size() const { return ends_.size(); }
  bool empty() const { return ends_.empty(); }
  std::string operator[](std::size_t i) const { return characters_.substr(begin(i), ends_[i] - begin(i)); }
  std::string front() const { return (*this)[0]; }
  std::string back() const { return (*this)[size() - 1]; }
  void push_back(std::string_view text) {
    characters_ += text;
    ends_.push_back(characters_.size());
  }
  void reserve(std::size_t texts, std::size_t characters) { ends_.reserve(texts), characters_.reserve(characters); }

 private:
  std::size_t begin(std::size_t i) const { return i == 0 ? 0 : ends_[i - 1]; }
  std::string characters_;
  std::vector<std::size_t> ends_;
};

/// Names joined by a separator.
std::string joined(const std::vector<std::string>& names, std::string_view separator);

}  // namespace liestat
