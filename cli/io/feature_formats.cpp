#include <cli/io/feature_formats.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>

#include <cli/io/feature_columns.hpp>
#include <cli/io/input_error.hpp>
#include <cli/io/numeric_table.hpp>
#include <cli/io/reading.hpp>

namespace liestat::cli {
namespace {

constexpr std::string_view known_columns_text =
    "t; tx,ty,tz; qx,qy,qz,qw or rx,ry,rz or r00 ... r22; x,y,z; dx,dy,dz; weight; cov_00 ... cov_55";

bool isKnown(std::string_view column) {
  const std::vector<std::string>& known = knownColumns();
  return std::find(known.begin(), known.end(), column) != known.end();
}

// TUM: t tx ty tz qx qy qz qw, separated by blanks.
bool isTum(const FirstLine& first) { return first.numbers.size() == 8; }
RowLayout readTum(const LineReader&, const std::string&) {
  return {{"t", "tx", "ty", "tz", "qx", "qy", "qz", "qw"}, Separator::comma_or_blanks, "(t tx ty tz qx qy qz qw)"};
}

// KITTI: the upper 3x4 of a pose matrix, row by row.
bool isKitti(const FirstLine& first) { return first.numbers.size() == 12; }
RowLayout readKitti(const LineReader&, const std::string&) {
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

RowLayout readEuroc(const LineReader& reader, const std::string& file) {
  checkEurocHeader(reader, file);
  std::vector<std::string> columns = {"t", "tx", "ty", "tz", "qw", "qx", "qy", "qz"};
  std::vector<std::string_view> fields;
  splitFields(reader.line(), Separator::comma, fields);
  if (fields.size() < columns.size()) {
    throwWrongWidth(fields.size(), columns.size(), "or more (timestamp, p x y z, q w x y z)", file, reader.number());
  }
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
  throw InputError(file, line, found, std::string(known_columns_text));
}

RowLayout readCsv(const LineReader& reader, const std::string& file) {
  const std::size_t line = reader.number();
  std::vector<std::string_view> fields;
  splitFields(reader.line(), Separator::comma, fields);
  if (looksNumeric(fields)) {
    std::vector<std::string_view> hidden;
    splitFields(reader.comment(), Separator::comma, hidden);
    throw InputError(file, line, "numbers where the header should be",
                     std::count_if(hidden.begin(), hidden.end(), isKnown) >= 3
                         ? "the header without a '#' before it"
                         : fmt::format("a line that names the columns: {}", feature_columns_text));
  }
  RowLayout layout{.columns = readHeader(fields, file, line), .description = "as in the header", .has_header = true};
  for (const std::string& column : layout.columns) {
    if (!isKnown(column)) throwUnknown(column, layout.columns.size(), file, line);
  }
  return layout;
}

constexpr std::array formats{
    FeatureFormat{"tum", "8 (TUM: t tx ty tz qx qy qz qw)", isTum, readTum},
    FeatureFormat{"euroc", "", isEuroc, readEuroc},
    FeatureFormat{"kitti", "12 (KITTI: a 3x4 matrix)", isKitti, readKitti},
    FeatureFormat{"csv", "", isCsv, readCsv},
};

}  // namespace

std::span<const FeatureFormat> featureFormats() { return formats; }

const FeatureFormat& featureFormat(std::string_view name, const LineReader& reader, const std::string& file) {
  FirstLine first{.comment = reader.comment(), .commas = {}, .numbers = {}};
  splitFields(reader.line(), Separator::comma, first.commas);
  splitFields(reader.line(), Separator::blanks, first.numbers);
  if (first.commas.size() > 1 || first.numbers.size() < 2 || !looksNumeric(first.numbers)) first.numbers.clear();
  std::vector<std::string> without_header;
  for (const FeatureFormat& format : formats) {
    if (name == "auto" ? format.recognises(first) : name == format.name) return format;
    if (!format.without_header.empty()) without_header.emplace_back(format.without_header);
  }
  if (name != "auto") throw std::invalid_argument("there is no format of files called " + std::string(name));
  throw InputError(file, reader.number(), fmt::format("{} numbers without a header", first.numbers.size()),
                   joined(without_header, ", ") + ", or a CSV header that names the columns");
}

std::vector<std::string> formatNames() {
  std::vector<std::string> names = {"auto"};
  for (const FeatureFormat& format : formats) names.emplace_back(format.name);
  return names;
}

}  // namespace liestat::cli
