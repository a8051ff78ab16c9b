#include <formats/text.hpp>

#include <fmt/format.h>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <numeric>
#include <utility>

#include <formats/detail/gzip.hpp>
#include <formats/input_error.hpp>

namespace liestat {
namespace {

// Comparisons, not a search in a list of characters, which takes a quarter of the time of reading a file.
bool isBlank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }
bool isMark(char c) { return c == ',' || c == ';'; }

}  // namespace

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && isBlank(text.front())) text.remove_prefix(1);
  while (!text.empty() && isBlank(text.back())) text.remove_suffix(1);
  return text;
}

namespace {

std::string_view unquoted(std::string_view field) {
  field = trimmed(field);
  if (field.size() >= 2 && field.front() == '"' && field.back() == '"')
    field = trimmed(field.substr(1, field.size() - 2));
  return field;
}

/// Closes the descriptor on every way out.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ > STDERR_FILENO) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }

 private:
  int fd_;
};

std::string systemMessage(int error) {
  if (error == ENOENT) return "no such file";
  if (error == EISDIR) return "this is a directory";
  return std::string("cannot be read: ") + std::strerror(error);
}

[[noreturn]] void throwTooLarge(const std::string& file, std::string_view what, std::size_t limit, bool has_option) {
  throw InputError(file, 0, std::string(what),
                   fmt::format("at most {:g} GB{}", 1e-9 * static_cast<double>(limit),
                               has_option ? ", or --largest-file with more" : ""));
}

std::size_t editDistance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0U : 1U)});
      diagonal = above;
    }
  }
  return row.back();
}

std::string folded(std::string_view name) {
  std::string result;
  for (const char c : name) {
    if (c != '_' && c != '.' && c != ' ' && c != '-')
      result += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return result;
}

}  // namespace

namespace {

/// The length of the UTF-8 sequence at the beginning of a text, 0 if there is none; `code` is its character.
std::size_t sequenceLength(std::string_view text, std::uint32_t& code) {
  const auto first = static_cast<unsigned char>(text.front());
  const std::size_t length = first < 0x80   ? 1
                             : first < 0xC2 ? 0
                             : first < 0xE0 ? 2
                             : first < 0xF0 ? 3
                             : first < 0xF5 ? 4
                                            : 0;
  if (length == 0 || length > text.size()) return 0;
  code = length == 1 ? first : first & (0x7FU >> length);
  for (std::size_t i = 1; i < length; ++i) {
    const auto next = static_cast<unsigned char>(text[i]);
    if ((next & 0xC0U) != 0x80U) return 0;
    code = code << 6U | (next & 0x3FU);
  }
  // Longer than it need be, half of a pair of UTF-16, or beyond the last character.
  const bool wrong = (length == 3 && code < 0x800) || (length == 4 && code < 0x10000) ||
                     (code >= 0xD800 && code < 0xE000) || code > 0x10FFFF;
  return wrong ? 0 : length;
}

bool controls(std::uint32_t code) {
  return code < 0x20 || (code >= 0x7F && code < 0xA0) || code == 0x200E || code == 0x200F ||
         (code >= 0x2028 && code <= 0x202E) || (code >= 0x2066 && code <= 0x2069);
}

std::string withoutControls(std::string_view text, bool keep_newlines) {
  std::string result;
  result.reserve(text.size());
  while (!text.empty()) {
    std::uint32_t code = 0;
    const std::size_t length = sequenceLength(text, code);
    const bool kept = length > 0 && (!controls(code) || (keep_newlines && code == '\n'));
    if (kept) {
      result += text.substr(0, length);
    } else {
      result += '?';
    }
    text.remove_prefix(std::max<std::size_t>(length, 1));
  }
  return result;
}

}  // namespace

std::string errorLine(std::string_view file, std::size_t line, std::string_view found, std::string_view expected) {
  std::string text(file);
  if (line > 0) text += ":" + std::to_string(line);
  text += ": ";
  text += found;
  if (!expected.empty()) (text += ", expected ") += expected;
  return printable(text, text.size());
}

std::string printable(std::string_view text, std::size_t limit) {
  const bool cut = text.size() > limit;
  std::size_t end = cut ? limit : text.size();
  // Never end in the middle of a UTF-8 sequence.
  while (cut && end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) --end;
  return withoutControls(text.substr(0, end), false) + (cut ? "..." : "");
}

std::string printableLines(std::string_view text) { return withoutControls(text, true); }

std::string sourceName(const std::string& path) {
  return path == "-" ? "standard input" : printable(path, path.size());
}

TextFile loadText(const std::string& path, std::optional<double> largest) {
  const bool standard_input = path == "-";
  const auto limit = static_cast<std::size_t>(std::min(1e9 * largest.value_or(largest_text), 1e18));
  TextFile file{standard_input ? "standard input" : path, {}};
  const Descriptor descriptor(standard_input ? STDIN_FILENO : ::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (descriptor.get() < 0)
    throw InputError(file.name, 0, systemMessage(errno), errno == ENOENT ? "" : "a file that can be read");
  struct stat status {};
  if (::fstat(descriptor.get(), &status) == 0 && S_ISDIR(status.st_mode)) {
    throw InputError(file.name, 0, systemMessage(EISDIR), "a file");
  }
  // A regular file tells its size; pipes do not, and files under /proc say 0.
  std::size_t capacity = S_ISREG(status.st_mode) ? static_cast<std::size_t>(status.st_size) + 1 : 0;
  if (capacity > limit + 1) throwTooLarge(file.name, fmt::format("{} bytes", capacity - 1), limit, largest.has_value());
  capacity = std::max<std::size_t>(capacity, 65536);
  std::size_t size = 0;
  file.text.resize(capacity);
  while (true) {
    if (size > limit) throwTooLarge(file.name, "a text without an end in sight", limit, largest.has_value());
    if (size == file.text.size()) file.text.resize(2 * size);
    const ssize_t count = ::read(descriptor.get(), file.text.data() + size, file.text.size() - size);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw InputError(file.name, 0, systemMessage(errno), "a file that can be read");
    if (count == 0) break;
    size += static_cast<std::size_t>(count);
  }
  file.text.resize(size);
  if (!detail::isGzip(file.text)) return file;
  auto text = detail::decompressed(file.text, file.name, limit);
  if (!text) throwTooLarge(file.name, "the compressed data expand to a larger text", limit, largest.has_value());
  file.text = std::move(*text);
  return file;
}

LineReader::LineReader(std::string_view text) : rest_(text) {
  if (rest_.substr(0, 3) == "\xEF\xBB\xBF") rest_.remove_prefix(3);
  if (rest_.find('\n') == std::string_view::npos) line_end_ = '\r';
}

bool LineReader::next() {
  while (!rest_.empty()) {
    const std::size_t end = rest_.find(line_end_);
    const std::string_view whole = rest_.substr(0, end);
    rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
    ++number_;
    const std::size_t hash = whole.find('#');
    line_ = trimmed(whole.substr(0, hash));
    if (!line_.empty()) return true;
    if (hash != std::string_view::npos) {
      comment_ = trimmed(whole.substr(hash + 1));
      comment_number_ = number_;
    }
  }
  return false;
}

void splitFields(std::string_view line, Separator separator, std::vector<std::string_view>& fields) {
  fields.clear();
  if (separator == Separator::comma_or_blanks) {
    separator = std::none_of(line.begin(), line.end(), isMark) ? Separator::blanks : Separator::comma;
  }
  if (separator == Separator::comma) {
    // Spreadsheets of half of Europe write semicolons, others tabs; a line with either has no commas that part fields.
    const char mark = line.find(';') != std::string_view::npos    ? ';'
                      : line.find(',') != std::string_view::npos  ? ','
                      : line.find('\t') != std::string_view::npos ? '\t'
                                                                  : ',';
    std::size_t start = 0;
    while (true) {
      const std::size_t end = line.find(mark, start);
      fields.push_back(unquoted(line.substr(start, end == std::string_view::npos ? end : end - start)));
      if (end == std::string_view::npos) return;
      start = end + 1;
    }
  }
  for (const char *at = line.data(), *const end = at + line.size(); at != end;) {
    const char* const begin = std::find_if_not(at, end, isBlank);
    at = std::find_if(begin, end, isBlank);
    if (begin != end)
      fields.push_back(
          line.substr(static_cast<std::size_t>(begin - line.data()), static_cast<std::size_t>(at - begin)));
  }
}

NumberKind parseNumber(std::string_view field, double& value) {
  // from_chars takes no leading plus, which other programs like to print.
  if (field.size() > 1 && field.front() == '+' && field[1] != '-' && field[1] != '+') field.remove_prefix(1);
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (end != field.data() + field.size() || error == std::errc::invalid_argument) return NumberKind::no_number;
  if (error == std::errc::result_out_of_range) {
    // Too large is an infinity; too small is a zero or a subnormal number and as good as any other.
    value = std::strtod(std::string(field).c_str(), nullptr);
  }
  return std::isfinite(value) ? NumberKind::finite : NumberKind::not_finite;
}

double numberField(std::string_view field, std::string_view column, const std::string& file, std::size_t line) {
  double value = 0;
  const NumberKind kind = parseNumber(field, value);
  if (kind == NumberKind::finite) return value;
  std::string found(column);
  found += field.empty() ? " is empty" : " is '" + printable(field) + "'";
  throw InputError(file, line, found, kind == NumberKind::not_finite ? "a finite number" : "a number");
}

std::string nearestName(std::string_view name, const std::vector<std::string>& candidates) {
  // Longer names are no misspelling of ours, and the distance would cost their length.
  if (name.size() > 32) return {};
  const std::string wanted = folded(name);
  std::string best;
  std::size_t smallest = std::numeric_limits<std::size_t>::max();
  for (const std::string& candidate : candidates) {
    const std::size_t distance = editDistance(wanted, folded(candidate));
    // As many changes as the name has letters would suggest anything.
    if (distance < smallest && distance <= 2 && 2 * distance <= candidate.size()) {
      smallest = distance;
      best = candidate;
    }
  }
  return best;
}

std::string joined(const std::vector<std::string>& names, std::string_view separator) {
  std::string result;
  for (const std::string& name : names) {
    if (!result.empty()) result += separator;
    result += name;
  }
  return result;
}

}  // namespace liestat
