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

/// An error in an input (or an output path) that the user named. `what()` is one line that begins
/// with `file:line: `, or `file: ` where no line is to blame.
class InputError : public std::runtime_error {
 public:
  /// `line` counts from 1, 0 means none; `expected` may be empty where `found` says it all.
  InputError(std::string file, std::size_t line, std::string found, std::string expected = {})
      : std::runtime_error(message(file, line, found, expected)),
        file_(std::move(file)),
        line_(line),
        found_(std::move(found)),
        expected_(std::move(expected)) {}

  const std::string& file() const { return file_; }
  std::size_t line() const { return line_; }
  const std::string& found() const { return found_; }
  const std::string& expected() const { return expected_; }

 private:
  static std::string message(std::string_view file, std::size_t line, std::string_view found,
                             std::string_view expected) {
    std::string text(file);
    if (line > 0) text += ":" + std::to_string(line);
    text += ": ";
    text += found;
    if (!expected.empty()) (text += ", expected ") += expected;
    return printable(text, text.size());
  }

  std::string file_;
  std::size_t line_;
  std::string found_;
  std::string expected_;
};

}  // namespace liestat
