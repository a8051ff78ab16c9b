#include <formats/detail/rows.hpp>

#include <formats/input_error.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

namespace liestat::detail {

std::size_t mostRows(std::string_view text, std::size_t columns) {
  const auto newlines = static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
  return std::min(newlines + 1, text.size() / (2 * columns) + 1);
}

bool looksNumeric(const std::vector<std::string_view>& fields) {
  double value = 0;
  return !fields.empty() && std::all_of(fields.begin(), fields.end(), [&](std::string_view field) {
    return field.empty() || parseNumber(field, value) != NumberKind::no_number;
  });
}

bool isNanoseconds(std::string_view field) {
  return field.size() >= 15 && field.find_first_not_of("0123456789") == std::string_view::npos;
}

void requireAscending(double before, std::size_t line_before, double time, const std::string& file, std::size_t line) {
  const double step = time - before;
  if (step > 0) return;
  throw InputError(file, line,
                   step < 0 ? fmt::format("the time is {:.6g} s before that of line {}", -step, line_before)
                            : fmt::format("the time is that of line {} again", line_before),
                   "times that ascend");
}

bool StampedRows::next() {
  if (!reader_.next()) return false;
  splitFields(reader_.line(), Separator::comma, fields_);
  if (fields_.size() < columns_.size() + 1) {
    throw InputError(file_, reader_.number(), fmt::format("{} fields", fields_.size()),
                     fmt::format("{} (timestamp [ns], {})", columns_.size() + 1, fmt::join(columns_, ", ")));
  }
  return true;
}

std::int64_t StampedRows::stamp() const {
  const std::string_view field = fields_[0];
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error != std::errc() || end != field.data() + field.size() || value < 0) {
    throw InputError(file_, reader_.number(), "timestamp is '" + printable(field) + "'",
                     "a whole number of nanoseconds");
  }
  return value;
}

Eigen::Vector3d StampedRows::vector(std::size_t column) const {
  Eigen::Vector3d v;
  for (std::size_t i = 0; i < 3; ++i) {
    v[static_cast<Eigen::Index>(i)] =
        number(column + i, column + i < columns_.size() ? columns_[column + i] : "a bias");
  }
  return v;
}

}  // namespace liestat::detail
