#include <formats/detail/trajectory_rows.hpp>

#include <formats/detail/rotation_matrix.hpp>
#include <formats/input_error.hpp>
#include <formats/numeric_table.hpp>
#include <formats/text.hpp>
#include <stats/convention_layouts.hpp>
#include <stats/convention_presets.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <unordered_map>
#include <utility>

namespace liestat::detail {
namespace {

constexpr std::string_view side_file_title = "liestat-covariance";

/// A whole number without sign, leading zeros removed.
std::string_view withoutLeadingZeros(std::string_view digits) {
  while (digits.size() > 1 && digits.front() == '0') digits.remove_prefix(1);
  return digits;
}

/// The lines of a text that are comments as a whole, without their `#`, each with its number.
template <class Take>
void forEachComment(std::string_view text, Take&& take) {
  std::size_t number = 0;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    ++number;
    while (!line.empty() && (line.back() == '\r' || line.back() == ' ' || line.back() == '\t')) line.remove_suffix(1);
    if (line.empty()) continue;
    if (line.front() != '#') return;
    line.remove_prefix(1);
    while (!line.empty() && line.front() == ' ') line.remove_prefix(1);
    take(line, number);
  }
}

}  // namespace

SE3d poseOf(const Eigen::Vector3d& position, const Eigen::Vector4d& xyzw, double norm_tolerance, Trajectory& trajectory,
            std::size_t line) {
  const double norm = xyzw.stableNorm(), error = std::abs(norm - 1);
  if (norm == 0) throw InputError(trajectory.name, line, "the quaternion is zero", "a unit quaternion");
  if (!(error <= norm_tolerance)) {
    throw InputError(trajectory.name, line, fmt::format("the norm of the quaternion is {:.6g}", norm),
                     fmt::format("1 within {:g}{}", norm_tolerance, norm_remedy));
  }
  if (error > 1e-12) {
    ++trajectory.n_normalised;
    trajectory.largest_norm_error = std::max(trajectory.largest_norm_error, error);
  }
  return SE3d(Eigen::Quaterniond(xyzw), position);
}

double numberOrUnknown(std::string_view field, std::string_view column, const std::string& file, std::size_t line) {
  double value = 0;
  const NumberKind kind = parseNumber(field, value);
  if (kind == NumberKind::finite || (kind == NumberKind::not_finite && std::isnan(value))) return value;
  throw InputError(file, line, fmt::format("{} is {}", column, field.empty() ? "empty" : "'" + printable(field) + "'"),
                   "a finite number, or nan for what is unknown");
}

void appendCovariance(Trajectory& trajectory, const Convention& layout, std::span<const double> numbers,
                      std::size_t line) {
  const auto matrix = unpackCovariance(layout, numbers);
  if (!matrix) {
    throw InputError(trajectory.name, line, fmt::format("a covariance of {} numbers", numbers.size()),
                     fmt::format("{} ({})", layoutSize(layout.layout), name(layout.layout)));
  }
  if (layout.layout == CovarianceLayout::full36) {
    // Files of six digits have triangles that agree to six digits; transposed parts or rows of a wrong length do not.
    const double gap = asymmetry(std::span<const double, 36>(numbers.data(), 36));
    if (!(gap <= 1e-3)) {
      throw InputError(trajectory.name, line,
                       fmt::format("the covariance is not symmetric (by {:.2g} of the variances)", gap),
                       "a symmetric matrix of 36 numbers");
    }
  }
  for (int i = 0; i < 6; ++i) {
    if ((*matrix)(i, i) < 0) {
      throw InputError(trajectory.name, line, fmt::format("diagonal entry {} of the matrix is {}", i, (*matrix)(i, i)),
                       "0 or more");
    }
  }
  trajectory.covariances.push_back(*matrix);
}

void applySentinels(std::vector<double>& numbers, CovarianceLayout layout, double unmeasured, Trajectory& trajectory) {
  if (numbers.empty()) return;
  const bool zero = std::all_of(numbers.begin(), numbers.end(), [](double v) { return v == 0; });
  if (zero || std::isnan(numbers[0]) || numbers[0] == -1) {
    std::fill(numbers.begin(), numbers.end(), unknown_entry);
    return;
  }
  const auto list = layoutEntries({.layout = layout});
  bool absent[6] = {}, any = false;
  for (std::size_t k = 0; k < list.size; ++k) {
    const auto [i, j] = list[k];
    if (i == j && numbers[k] >= unmeasured) absent[i] = any = true;
  }
  if (!any) return;
  ++trajectory.n_unmeasured;
  for (std::size_t k = 0; k < list.size; ++k) {
    if (absent[list[k].row] || absent[list[k].column]) numbers[k] = unknown_entry;
  }
}

void appendTime(Trajectory& trajectory, std::string_view seconds, std::size_t line) {
  trajectory.times.push_back(numberField(seconds, "the time", trajectory.name, line));
  trajectory.time_texts.push_back(seconds);
}

std::string secondsOfTicks(std::string_view ticks, std::size_t decimals) {
  const std::string sign = !ticks.empty() && ticks[0] == '-' ? "-" : "";
  if (!ticks.empty() && (ticks[0] == '-' || ticks[0] == '+')) ticks.remove_prefix(1);
  const std::size_t e = ticks.find_first_of("eE");
  int exponent = 0;
  if (e != std::string_view::npos) {
    const std::size_t begin = e + (ticks.substr(e + 1, 1) == "+" ? 2 : 1);
    std::from_chars(ticks.data() + begin, ticks.data() + ticks.size(), exponent);
  }
  std::string digits(ticks.substr(0, e));
  const std::size_t point = std::min(digits.find('.'), digits.size());
  if (point < digits.size()) digits.erase(point, 1);
  // Digits before the point of the seconds. A double has no more than 309 of them, and below 1e-40 s there is nothing.
  const auto before = static_cast<std::ptrdiff_t>(point) + exponent - static_cast<std::ptrdiff_t>(decimals);
  if (before < -40) return "0";
  if (before <= 0) digits.insert(0, static_cast<std::size_t>(1 - before), '0');
  const auto place = static_cast<std::size_t>(std::max<std::ptrdiff_t>(before, 1));
  if (place > digits.size()) digits.append(place - digits.size(), '0');
  const std::string fraction = digits.substr(place);
  return sign + std::string(withoutLeadingZeros(digits.substr(0, place))) + (fraction.empty() ? "" : ".") + fraction;
}

std::string ticksOfSeconds(std::string_view seconds, std::size_t decimals, bool& exact) {
  exact = true;
  if (seconds.find_first_not_of("0123456789.") != std::string_view::npos) {
    // A sign or an exponent: as a number.
    double value = 0;
    parseNumber(seconds, value);
    value *= std::pow(10.0, static_cast<double>(decimals));
    exact = std::abs(value) < 9007199254740992.0 && value == std::floor(value);
    return fmt::format("{:.0f}", value);
  }
  const std::size_t point = seconds.find('.');
  std::string digits(seconds.substr(0, point));
  std::string fraction(point == std::string_view::npos ? "" : seconds.substr(point + 1));
  if (fraction.size() > decimals) {
    exact = fraction.find_first_not_of('0', decimals) == std::string::npos;
    fraction.resize(decimals);
  }
  fraction.append(decimals - fraction.size(), '0');
  return std::string(withoutLeadingZeros(digits + fraction));
}

bool isWhole(std::string_view field) {
  return !field.empty() && field.find_first_not_of("0123456789") == std::string_view::npos;
}

void appendTicks(Trajectory& trajectory, std::string_view ticks, std::size_t decimals, std::size_t line) {
  if (!isWhole(ticks)) {
    throw InputError(trajectory.name, line, fmt::format("the time is '{}'", printable(ticks)),
                     fmt::format("a whole number of {}", decimals == 9 ? "nanoseconds" : "microseconds"));
  }
  appendTime(trajectory, secondsOfTicks(ticks, decimals), line);
}

std::optional<Convention> statedConvention(std::string_view text, const std::string& file) {
  constexpr std::string_view fields[] = {"order", "perturbation", "unit", "content", "layout"};
  bool found = false, seen[5] = {};
  std::size_t title_line = 0;
  Convention convention;
  forEachComment(text, [&](std::string_view comment, std::size_t line) {
    if (comment.substr(0, side_file_title.size()) == side_file_title) {
      const std::string version(comment.substr(std::min(comment.size(), side_file_title.size() + 1)));
      if (version != "1") throw InputError(file, line, "version '" + printable(version) + "' of the header", "1");
      found = true;
      title_line = line;
      return;
    }
    const std::size_t colon = comment.find(':');
    if (!found || colon == std::string_view::npos) return;
    const std::string_view key = comment.substr(0, colon);
    std::string_view value = comment.substr(colon + 1);
    while (!value.empty() && value.front() == ' ') value.remove_prefix(1);
    const auto* const place = std::find(std::begin(fields), std::end(fields), key);
    if (place == std::end(fields)) return;
    if (!setConventionField(convention, key, value)) {
      throw InputError(file, line, fmt::format("{} is '{}'", key, printable(value)),
                       "one of the values of docs/program.md");
    }
    seen[place - std::begin(fields)] = true;
  });
  if (!found) return std::nullopt;
  for (std::size_t k = 0; k < 5; ++k) {
    if (!seen[k])
      throw InputError(file, title_line, fmt::format("the header does not say the {}", fields[k]),
                       fmt::format("a line '# {}: ...'", fields[k]));
  }
  return convention;
}

std::string conventionHeader(const Convention& c) {
  return fmt::format("# {} 1\n# order: {}\n# perturbation: {}\n# unit: {}\n# content: {}\n# layout: {}\n",
                     side_file_title, name(c.order), name(c.perturbation), name(c.unit), name(c.content),
                     name(c.layout));
}

void readSideFile(const std::string& path, Trajectory& trajectory, const TrajectoryOptions& options) {
  const TextFile file = loadText(path, options.reading.largest_file);
  requireText(file.text, file.name);
  const std::optional<Convention> convention = statedConvention(file.text, file.name);
  if (!convention) {
    throw InputError(
        file.name, 1, "there is no header",
        fmt::format("'# {} 1' and the lines for order, perturbation, unit, content and layout", side_file_title));
  }
  // Rows first: a reader of its own, so that messages name the side file.
  Trajectory rows;
  rows.name = file.name;
  std::unordered_map<std::string, std::size_t> by_time;
  LineReader reader(file.text);
  std::vector<std::string_view> fields;
  std::vector<double> numbers;
  const std::size_t size = layoutSize(convention->layout);
  while (reader.next()) {
    splitFields(reader.line(), Separator::comma_or_blanks, fields);
    if (fields.size() != size + 1) {
      throwWrongWidth(fields.size(), size + 1, fmt::format("(time and {})", name(convention->layout)), file.name,
                      reader.number());
    }
    numbers.clear();
    for (std::size_t k = 1; k < fields.size(); ++k) {
      numbers.push_back(numberOrUnknown(fields[k], fmt::format("number {}", k), file.name, reader.number()));
    }
    appendCovariance(rows, *convention, numbers, reader.number());
    const auto [place, fresh] = by_time.emplace(fields[0], rows.covariances.size() - 1);
    if (fresh) continue;
    // Files whose poses repeat a stamp repeat its matrix.
    const Matrix6d &C = rows.covariances[place->second], &D = rows.covariances.back();
    if (((C.array() == D.array()) || (C.array().isNaN() && D.array().isNaN())).all()) {
      rows.covariances.pop_back();
    } else {
      throw InputError(file.name, reader.number(), fmt::format("the time {} appears twice", printable(fields[0])),
                       "each time once");
    }
  }
  std::vector<bool> used(rows.covariances.size(), false);
  trajectory.covariances.assign(trajectory.size(), Matrix6d::Constant(unknown_entry));
  const auto match = [&] {
    for (std::size_t i = 0; i < trajectory.size(); ++i) {
      const std::string key = trajectory.hasTimes()    ? trajectory.time_texts[i]
                              : trajectory.ids.empty() ? std::to_string(i)
                                                       : std::to_string(trajectory.ids[i]);
      if (const auto row = by_time.find(key); row != by_time.end()) {
        trajectory.covariances[i] = rows.covariances[row->second];
        used[row->second] = true;
      }
    }
    return static_cast<std::size_t>(std::count(used.begin(), used.end(), true));
  };
  std::size_t matched = match();
  if (matched == 0 && trajectory.stamp_decimals > 0) {
    // In the unit of the file of the poses.
    std::unordered_map<std::string, std::size_t> in_seconds;
    for (const auto& [stamp, row] : by_time) in_seconds.emplace(secondsOfTicks(stamp, trajectory.stamp_decimals), row);
    by_time = std::move(in_seconds);
    matched = match();
  }
  if (matched == 0) {
    throw InputError(
        file.name, 0,
        fmt::format("none of its {} times is that of a pose of {}", rows.covariances.size(), trajectory.name),
        trajectory.hasTimes() ? "times with the same digits as in the file of the poses"
                              : "the number of the pose, from 0, since the poses have no times");
  }
  if (matched < rows.covariances.size()) {
    throw InputError(file.name, 0,
                     fmt::format("{} of its {} times are those of no pose of {}", rows.covariances.size() - matched,
                                 rows.covariances.size(), trajectory.name),
                     "times with the same digits as in the file of the poses");
  }
  trajectory.stated_convention = convention;
  trajectory.states_convention = true;
  trajectory.covariance_source = file.name;
}

}  // namespace liestat::detail
