#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

namespace liestat::cli {

/// Text from outside made fit for a message: one line, no control characters, at most `limit` bytes.
inline std::string printable(std::string_view text, std::size_t limit = 40) {
  const bool cut = text.size() > limit;
  std::size_t end = cut ? limit : text.size();
  // Never end in the middle of a UTF-8 sequence: the terminal would show garbage.
  while (cut && end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) --end;
  std::string result;
  result.reserve(end + 3);
  for (const char c : text.substr(0, end)) {
    const auto code = static_cast<unsigned char>(c);
    result += (code < 0x20U || code == 0x7FU) ? '?' : c;
  }
  if (cut) result += "...";
  return result;
}

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

}  // namespace liestat::cli
