#include <formats/detail/feature_formats.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>

#include <formats/detail/feature_columns.hpp>
#include <formats/input_error.hpp>
#include <formats/detail/rows.hpp>
#include <formats/numeric_table.hpp>

namespace liestat::detail {
namespace {

constexpr std::string_view known_columns_text =
    "t; tx,ty,tz; qx,qy,qz,qw or rx,ry,rz or roll,pitch,yaw or r00 ... r22; x,y,z; dx,dy,dz; heading_deg; weight; "
    "cov_00 ... cov_55 "
    "or "
    "factor_00 ... factor_55 or sd_0 ... sd_5";

bool isKnown(std::string_view column) {
  const std::vector<std::string>& known = knownColumns();
  return std::find(known.begin(), known.end(), column) != known.end();
}

/// True if the column is the time under a name that other programs give it.
bool isTime(std::string_view column) { return column == "t" || column == "time" || column == "timestamp"; }

// TUM: t tx ty tz qx qy qz qw, separated by blanks. Some programs put these names into a first line, or a comment.
constexpr std::array<std::string_view, 8> tum_columns{"t", "tx", "ty", "tz", "qx", "qy", "qz", "qw"};

bool isTumHeader(const std::vector<std::string_view>& words) {
  return words.size() == tum_columns.size() && isTime(words[0]) &&
         std::equal(words.begin() + 1, words.end(), tum_columns.begin() + 1);
}
bool isTum(const FirstLine& first) { return first.numbers.size() == 8 || isTumHeader(first.words); }

/// Programs disagree about the order of a quaternion: where a comment names TUM's columns, the order must be TUM's.
void checkTumComment(const LineReader& reader, const std::string& file) {
  std::vector<std::string_view> words;
  splitFields(reader.comment(), Separator::comma_or_blanks, words);
  if (words.size() != tum_columns.size() || isTumHeader(words)) return;
  std::vector<std::string_view> sorted = words;
  std::array<std::string_view, 8> expected = tum_columns;
  sorted[0] = isTime(sorted[0]) ? "t" : sorted[0];
  std::sort(sorted.begin(), sorted.end());
  std::sort(expected.begin(), expected.end());
  if (!std::equal(sorted.begin(), sorted.end(), expected.begin())) return;
  throw InputError(file, reader.comment_number(),
                   fmt::format("the comment names the columns {}", printable(reader.comment(), 60)),
                   "TUM's order t tx ty tz qx qy qz qw, or the header without a '#' before it");
}

RowLayout readTum(const LineReader& reader, const std::string& file, const ReadingOptions&) {
  checkTumComment(reader, file);
  std::vector<std::string_view> fields;
  splitFields(reader.line(), Separator::comma_or_blanks, fields);
  return {.columns = {tum_columns.begin(), tum_columns.end()},
          .separator = Separator::comma_or_blanks,
          .description = "(t tx ty tz qx qy qz qw)",
          .has_header = isTumHeader(fields)};
}

// KITTI: the upper 3x4 of a pose matrix, row by row.
bool isKitti(const FirstLine& first) { return first.numbers.size() == 12; }
RowLayout readKitti(const LineReader&, const std::string&, const ReadingOptions&) {
  return {{"r00", "r01", "r02", "tx", "r10", "r11", "r12", "ty", "r20", "r21", "r22", "tz"},
          Separator::comma_or_blanks,
          "(a 3x4 matrix row by row)"};
}

// EuRoC: #timestamp [ns], p x y z, q w x y z, and more columns that are passed over.
bool isEuroc(const FirstLine& first) {
  return first.commas.size() >= 8 && looksNumeric(first.commas) &&
         (isNanoseconds(first.commas[0]) || first.comment.substr(0, 9) == "timestamp");
}

/// Programs disagree about the order of a quaternion: where a header says it, it must be ours.
void checkEurocHeader(const LineReader& reader, const std::string& file) {
  if (reader.comment().substr(0, 9) != "timestamp") return;
  std::vector<std::string_view> fields;
  splitFields(reader.comment(), Separator::comma, fields);
  const std::string_view axes = "xyzwxyz";
  for (std::size_t i = 0; i < axes.size() && i + 1 < fields.size(); ++i) {
    const std::string_view column = fields[i + 1].substr(0, fields[i + 1].find_first_of(" ["));
    if (column.empty() || column.back() != axes[i]) {
      throw InputError(file, reader.comment_number(),
                       fmt::format("column {} of the header is '{}'", i + 2, printable(fields[i + 1])),
                       "EuRoC's order: timestamp, p x y z, q w x y z");
    }
  }
}

RowLayout readEuroc(const LineReader& reader, const std::string& file, const ReadingOptions&) {
  checkEurocHeader(reader, file);
  std::vector<std::string> columns = {"t", "tx", "ty", "tz", "qw", "qx", "qy", "qz"};
  std::vector<std::string_view> fields;
  splitFields(reader.line(), Separator::comma, fields);
  if (fields.size() < columns.size()) {
    throwWrongWidth(fields.size(), columns.size(), "or more (timestamp, p x y z, q w x y z)", file, reader.number());
  }
  if (fields.size() > most_columns) throwWrongWidth(fields.size(), most_columns, "at most", file, reader.number());
  // Velocities and biases follow; they have no name here and are passed over.
  columns.resize(fields.size());
  return {std::move(columns), Separator::comma, "as in the first row", 1e-9};
}

// CSV: a header names the columns.
bool isCsv(const FirstLine& first) { return first.numbers.empty(); }

[[noreturn]] void throwUnknown(const std::string& column, std::size_t n_columns, const std::string& file,
                               std::size_t line) {
  std::string found = "unknown column '" + printable(column) + "'";
  if (n_columns == 1 && column.find_first_of(" ;\t") != std::string::npos) {
    throw InputError(file, line, found, fmt::format("columns separated by commas: {}", known_columns_text));
  }
  const std::string suggestion =
      column.substr(0, 4) == "time" || column.substr(0, 4) == "Time" ? "t" : nearestName(column, knownColumns());
  if (!suggestion.empty()) found += " (is it '" + suggestion + "'?)";
  throw InputError(file, line, found,
                   fmt::format("{} (--ignore-unknown passes over others, --columns maps names)", known_columns_text));
}

/// Gives columns our names where the user says which they are, as "ours=theirs".
void rename(RowLayout& layout, const std::vector<std::string>& wishes, const std::string& file, std::size_t line) {
  const std::vector<std::string> theirs = layout.columns;
  std::vector<bool> renamed(theirs.size(), false);
  for (const std::string& wish : wishes) {
    const std::size_t sign = wish.find('=');
    const std::string to = wish.substr(0, sign), from = sign == std::string::npos ? "" : wish.substr(sign + 1);
    const auto complain = [&](const std::string& what, const std::string& expected) {
      throw InputError(file, line, "--columns " + printable(wish) + ": " + what, expected);
    };
    if (from.empty() || !isKnown(to)) {
      complain(from.empty() ? "no '='" : "there is no column '" + printable(to) + "' of features",
               fmt::format("our name = the file's; ours are {}", known_columns_text));
    }
    const auto found = std::find(theirs.begin(), theirs.end(), from);
    if (found == theirs.end()) {
      const std::string near = nearestName(from, theirs);
      complain("the file has no column '" + printable(from) + "'" +
                   (near.empty() ? "" : " (is it '" + printable(near) + "'?)"),
               "one of its header");
    }
    const auto place = static_cast<std::size_t>(found - theirs.begin());
    if (renamed[place]) complain("the column '" + printable(from) + "' has another name already", "one name for each");
    renamed[place] = true;
    layout.columns[place] = to;
  }
  // The file may have a column of that name already.
  for (std::size_t i = 0; i < theirs.size(); ++i) {
    if (renamed[i] && std::count(layout.columns.begin(), layout.columns.end(), layout.columns[i]) > 1) {
      throw InputError(file, line, "two columns are '" + layout.columns[i] + "' after --columns", "one");
    }
  }
}

/// Columns by their numbers from 1, which the user gives as "ours=1"; the others are passed over.
RowLayout readNumberedColumns(const LineReader& reader, const std::string& file, const ReadingOptions& options) {
  std::vector<std::string_view> fields;
  splitFields(reader.line(), Separator::comma_or_blanks, fields);
  if (fields.size() > most_columns) {
    throw InputError(file, reader.number(), fmt::format("{} columns", fields.size()),
                     fmt::format("at most {}", most_columns));
  }
  RowLayout layout{.columns = std::vector<std::string>(fields.size()),
                   .separator = Separator::comma_or_blanks,
                   .description = "as in the first row",
                   .has_header = !looksNumeric(fields)};
  for (const std::string& wish : options.columns) {
    const std::size_t sign = wish.find('='), number = std::stoul(wish.substr(sign + 1));
    const std::string ours = wish.substr(0, sign);
    const auto complain = [&](const std::string& what, const std::string& expected) {
      throw InputError(file, reader.number(), "--columns " + printable(wish) + ": " + what, expected);
    };
    if (!isKnown(ours))
      complain("there is no column '" + printable(ours) + "' of features", std::string(known_columns_text));
    if (number < 1 || number > fields.size()) {
      complain(fmt::format("the row has {} columns", fields.size()), fmt::format("1 to {}", fields.size()));
    }
    const bool twice = std::find(layout.columns.begin(), layout.columns.end(), ours) != layout.columns.end();
    if (twice || !layout.columns[number - 1].empty()) complain("it is there already", "each name and each column once");
    layout.columns[number - 1] = ours;
  }
  return layout;
}

/// The names of a header that is parted by blanks, if it is one: each of them known. Otherwise empty.
std::vector<std::string> namesBetweenBlanks(const std::vector<std::string_view>& words) {
  if (words.size() < 2) return {};
  std::vector<std::string> names(words.begin(), words.end());
  if (isTime(names[0])) names[0] = "t";
  return std::all_of(names.begin(), names.end(), isKnown) ? names : std::vector<std::string>();
}

RowLayout readCsv(const LineReader& reader, const std::string& file, const ReadingOptions& options) {
  if (columnsByNumber(options.columns)) return readNumberedColumns(reader, file, options);
  const std::size_t line = reader.number();
  std::vector<std::string_view> fields;
  splitFields(reader.line(), Separator::blanks, fields);
  if (std::vector<std::string> names = namesBetweenBlanks(fields); !names.empty()) {
    const std::vector<std::string_view> views(names.begin(), names.end());
    return {.columns = readHeader(views, file, line),
            .separator = Separator::blanks,
            .description = "as in the header",
            .has_header = true};
  }
  splitFields(reader.line(), Separator::comma, fields);
  if (looksNumeric(fields)) {
    std::vector<std::string_view> hidden;
    splitFields(reader.comment(), Separator::comma, hidden);
    throw InputError(file, line, "numbers where the header should be",
                     std::count_if(hidden.begin(), hidden.end(), isKnown) >= 3
                         ? "the header without a '#' before it"
                         : fmt::format("a line that names the columns: {}; or --columns tx=1,ty=2,... by their numbers",
                                       feature_columns_text));
  }
  RowLayout layout{.columns = readHeader(fields, file, line), .description = "as in the header", .has_header = true};
  // With a column w beside them x, y and z are a quaternion's, whichever comes first.
  const auto has = [&](std::string_view column) {
    return std::find(layout.columns.begin(), layout.columns.end(), column) != layout.columns.end();
  };
  if (has("w") && has("x") && has("y") && has("z") && !has("qw")) {
    for (std::string& column : layout.columns) {
      if (column == "w" || column == "x" || column == "y" || column == "z") column.insert(0, 1, 'q');
    }
  }
  rename(layout, options.columns, file, line);
  for (std::string& column : layout.columns) {
    if (isKnown(column)) continue;
    if (!options.ignore_unknown) throwUnknown(column, layout.columns.size(), file, line);
    column.clear();
  }
  return layout;
}

constexpr std::array formats{
    FeatureFormat{"tum", "8 (TUM: t tx ty tz qx qy qz qw)", isTum, readTum},
    FeatureFormat{"euroc", "", isEuroc, readEuroc},
    FeatureFormat{"kitti", "12 (KITTI: a 3x4 matrix)", isKitti, readKitti},
    FeatureFormat{"csv", "", isCsv, readCsv, true},
};

}  // namespace

bool columnsByNumber(const std::vector<std::string>& wishes) {
  const auto is_number = [](const std::string& wish) {
    const std::size_t sign = wish.find('=');
    const std::string_view theirs = sign == std::string::npos ? "" : std::string_view(wish).substr(sign + 1);
    return !theirs.empty() && theirs.size() < 6 && theirs.find_first_not_of("0123456789") == std::string_view::npos;
  };
  return !wishes.empty() && std::all_of(wishes.begin(), wishes.end(), is_number);
}

std::span<const FeatureFormat> featureFormats() { return formats; }

const FeatureFormat& featureFormat(const ReadingOptions& options, const LineReader& reader, const std::string& file) {
  const bool by_number = columnsByNumber(options.columns);
  const std::string_view name = by_number && options.format == "auto" ? "csv" : std::string_view(options.format);
  FirstLine first{.comment = reader.comment(), .words = {}, .commas = {}, .numbers = {}};
  splitFields(reader.line(), Separator::comma, first.commas);
  if (reader.line().find_first_of(",;") == std::string_view::npos) {
    splitFields(reader.line(), Separator::blanks, first.words);
  }
  if (first.words.size() > 1 && looksNumeric(first.words)) first.numbers = first.words;
  std::vector<std::string> without_header;
  for (const FeatureFormat& format : formats) {
    if (name == "auto" ? format.recognises(first) : name == format.name) return format;
    if (!format.without_header.empty()) without_header.emplace_back(format.without_header);
  }
  if (name != "auto") throw std::invalid_argument("there is no format of files called " + std::string(name));
  throw InputError(file, reader.number(), fmt::format("{} numbers without a header", first.numbers.size()),
                   joined(without_header, ", ") + ", a CSV header that names the columns, or --columns tx=1,ty=2,...");
}

}  // namespace liestat::detail
