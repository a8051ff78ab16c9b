// The errors that readers of files throw, and text from outside made fit for messages.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

namespace liestat {

/// Text from outside made fit for a terminal: one line, at most `limit` bytes. Control characters, those beyond ASCII too
/// (U+0080 to U+009F and the marks that reverse the direction of writing), and bytes that are no UTF-8 become '?'.
std::string printable(std::string_view text, std::size_t limit = 40);

/// The same of a text of several lines, uncut: newlines stay.
std::string printableLines(std::string_view text);

/// One line `file:line: found, expected …`, without the line if it is 0 and without what is empty.
std::string errorLine(std::string_view file, std::size_t line, std::string_view found, std::string_view expected);

/// An error in an input file (or an output path) that the user named. `what()` is one line that begins
/// with `file:line: `, or `file: ` where no line is to blame.
class InputError : public std::runtime_error {
 public:
  /// `line` counts from 1, 0 means none; `expected` may be empty where `found` says it all.
  InputError(std::string file, std::size_t line, std::string found, std::string expected = {})
      : std::runtime_error(errorLine(file, line, found, expected)),
        file_(std::move(file)),
        line_(line),
        found_(std::move(found)),
        expected_(std::move(expected)) {}

  const std::string& file() const { return file_; }
  std::size_t line() const { return line_; }
  const std::string& found() const { return found_; }
  const std::string& expected() const { return expected_; }

 private:
  std::string file_;
  std::size_t line_;
  std::string found_;
  std::string expected_;
};

/// An option that is misused: by itself, beside another, or with files that are in order. `what()` is one line that begins
/// with the command or the option.
class OptionError : public std::invalid_argument {
 public:
  explicit OptionError(std::string_view where, std::string_view found, std::string_view expected = {})
      : std::invalid_argument(errorLine(where, 0, found, expected)) {}
};

}  // namespace liestat
