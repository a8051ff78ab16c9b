#include <cli/io/reading.hpp>

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include <cli/io/input_error.hpp>
#include <cli/io/text.hpp>

namespace liestat::cli {

using experiments::Feature;
using experiments::Part;

namespace {

constexpr double rounding = 1e-12;
constexpr int absent = -1;

constexpr std::string_view known_columns_text =
    "t; tx,ty,tz; qx,qy,qz,qw or rx,ry,rz or r00 ... r22; x,y,z; dx,dy,dz; weight; cov_00 ... cov_55";
constexpr std::string_view groups_text =
    "qx,qy,qz,qw or rx,ry,rz or r00 ... r22 (with tx,ty,tz for frames), or x,y,z, or dx,dy,dz";

std::string covarianceColumn(int row, int column) { return fmt::format("cov_{}{}", row, column); }

bool looksNumeric(const std::vector<std::string_view>& fields) {
  double value = 0;
  return !fields.empty() && std::all_of(fields.begin(), fields.end(), [&](std::string_view field) {
    return field.empty() || parseNumber(field, value) != NumberKind::no_number;
  });
}

/// The names of a header; duplicates and empty names are errors.
std::vector<std::string> readHeader(const std::vector<std::string_view>& fields, const std::string& file,
                                    std::size_t line) {
  std::vector<std::string> names(fields.begin(), fields.end());
  std::vector<std::string> sorted = names;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i].empty()) throw InputError(file, line, fmt::format("column {} of the header has no name", i + 1));
  }
  std::sort(sorted.begin(), sorted.end());
  const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
  if (twice != sorted.end())
    throw InputError(file, line, "column '" + printable(*twice) + "' appears twice", "it once");
  return names;
}

[[noreturn]] void throwWrongWidth(std::size_t found, std::size_t expected, std::string_view why,
                                  const std::string& file, std::size_t line) {
  throw InputError(file, line, fmt::format("{} {}", found, found == 1 ? "field" : "fields"),
                   fmt::format("{} {}", expected, why));
}

void requireText(std::string_view text, const std::string& file) {
  if (text.empty()) throw InputError(file, 0, "the file is empty");
  if (text.substr(0, 2) == "\xFF\xFE" || text.substr(0, 2) == "\xFE\xFF") {
    throw InputError(file, 1, "the text is encoded as UTF-16", "UTF-8");
  }
  const std::size_t nul = text.find('\0');
  if (nul != std::string_view::npos) {
    const auto line =
        static_cast<std::size_t>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(nul), '\n'));
    throw InputError(file, line + 1, "this is not text (it contains a zero byte)", "a text file");
  }
}

/// At most that many rows fit into a text: a row has a digit and a separator for each field.
std::size_t mostRows(std::string_view text, std::size_t columns) {
  const auto newlines = static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
  return std::min(newlines + 1, text.size() / (2 * columns) + 1);
}

/// Where the parts of a feature stand in a row.
struct Layout {
  Feature kind = Feature::point;
  std::array<int, 4> quaternion{absent, absent, absent, absent};  // x y z w
  std::array<int, 3> rotation_vector{absent, absent, absent};
  std::array<int, 9> matrix{absent, absent, absent, absent, absent, absent, absent, absent, absent};
  std::array<int, 3> vector{absent, absent, absent};
  int weight = absent;
  int time = absent;
  int dimension = 0;            // of the covariance, 0 without one
  std::vector<int> covariance;  // upper triangle, row by row
};

/// Reads one text in one of the formats. They differ in names, separators and units of time only.
class FeatureReader {
 public:
  FeatureReader(std::string_view text, std::string file, const ReadingOptions& options)
      : text_(text), reader_(text), name_(std::move(file)), options_(options) {}

  FeatureFile read() {
    requireText(text_, name_);
    if (!reader_.next()) throw InputError(name_, 0, "the file has no data, only blank lines and comments");
    const Format format = options_.format == Format::automatic ? detectFormat() : options_.format;
    file_.format = std::string(name(format));
    const std::size_t first_line = reader_.number();
    bool more = true;
    switch (format) {
      case Format::tum:
        useColumns({"t", "tx", "ty", "tz", "qx", "qy", "qz", "qw"}, Separator::comma_or_blanks,
                   "(t tx ty tz qx qy qz qw)");
        break;
      case Format::kitti:
        useColumns({"r00", "r01", "r02", "tx", "r10", "r11", "r12", "ty", "r20", "r21", "r22", "tz"},
                   Separator::comma_or_blanks, "(a 3x4 matrix row by row)");
        break;
      case Format::euroc:
        useEuroc();
        break;
      default:
        more = useHeader();
        break;
    }
    if (!more) throw InputError(name_, first_line, "there is a header but no data", "at least one row after it");
    readRows();
    return std::move(file_);
  }

 private:
  Format detectFormat() {
    const std::string_view line = reader_.line();
    const std::string_view comment = reader_.comment();
    splitFields(line, Separator::comma, fields_);
    if (fields_.size() > 1) {
      const bool numeric = looksNumeric(fields_);
      const bool nanoseconds =
          fields_[0].size() >= 15 && fields_[0].find_first_not_of("0123456789") == std::string_view::npos;
      if (numeric && fields_.size() >= 8 && (nanoseconds || comment.substr(0, 9) == "timestamp")) return Format::euroc;
      return Format::csv;
    }
    splitFields(line, Separator::blanks, fields_);
    if (fields_.size() > 1 && looksNumeric(fields_)) {
      if (fields_.size() == 8) return Format::tum;
      if (fields_.size() == 12) return Format::kitti;
      throw InputError(
          name_, reader_.number(), fmt::format("{} numbers without a header", fields_.size()),
          "8 (TUM: t tx ty tz qx qy qz qw), 12 (KITTI: a 3x4 matrix), or a CSV header that names the columns");
    }
    return Format::csv;
  }

  /// A format without a header: the columns are given, the current line is the first row.
  void useColumns(std::vector<std::string> columns, Separator separator, std::string_view description) {
    columns_ = std::move(columns);
    separator_ = separator;
    description_ = description;
    findLayout();
  }

  void useEuroc() {
    const std::vector<std::string> leading = {"t", "tx", "ty", "tz", "qw", "qx", "qy", "qz"};
    checkEurocHeader();
    splitFields(reader_.line(), Separator::comma, fields_);
    if (fields_.size() < leading.size()) {
      throwWrongWidth(fields_.size(), leading.size(), "or more (timestamp, p x y z, q w x y z)", name_,
                      reader_.number());
    }
    time_unit_ = 1e-9;
    const std::size_t width = fields_.size();
    useColumns(leading, Separator::comma, "as in the first row");
    // Velocities and biases follow; they have no name here and are passed over.
    columns_.resize(width);
  }

  /// Programs disagree about the order of a quaternion: where a header says it, it must be ours.
  void checkEurocHeader() {
    if (reader_.comment().substr(0, 9) != "timestamp") return;
    splitFields(reader_.comment(), Separator::comma, fields_);
    const std::string_view axes = "xyzwxyz";
    for (std::size_t i = 0; i < axes.size() && i + 1 < fields_.size(); ++i) {
      const std::string_view column = fields_[i + 1].substr(0, fields_[i + 1].find_first_of(" ["));
      if (column.empty() || column.back() != axes[i]) {
        throw InputError(name_, reader_.comment_number(),
                         fmt::format("column {} of the header is '{}'", i + 2, printable(fields_[i + 1])),
                         "EuRoC's order: timestamp, p x y z, q w x y z");
      }
    }
  }

  /// CSV: the current line is the header. False if nothing follows it.
  bool useHeader() {
    const std::size_t line = reader_.number();
    splitFields(reader_.line(), Separator::comma, fields_);
    if (looksNumeric(fields_)) {
      std::vector<std::string_view> hidden;
      splitFields(reader_.comment(), Separator::comma, hidden);
      const auto known =
          std::count_if(hidden.begin(), hidden.end(), [](std::string_view column) { return isKnown(column); });
      throw InputError(name_, line, "numbers where the header should be",
                       known >= 3 ? "the header without a '#' before it"
                                  : fmt::format("a line that names the columns: {}", groups_text));
    }
    columns_ = readHeader(fields_, name_, line);
    separator_ = Separator::comma;
    description_ = "as in the header";
    for (const std::string& column : columns_) {
      if (!isKnown(column)) throwUnknown(column, line);
    }
    findLayout();
    return reader_.next();
  }

  static bool isKnown(std::string_view column) {
    const std::vector<std::string>& known = knownColumns();
    return std::find(known.begin(), known.end(), column) != known.end();
  }

  [[noreturn]] void throwUnknown(const std::string& column, std::size_t line) const {
    std::string found = "unknown column '" + printable(column) + "'";
    if (columns_.size() == 1 && column.find_first_of(" ;\t") != std::string::npos) {
      throw InputError(name_, line, found, fmt::format("columns separated by commas: {}", known_columns_text));
    }
    const std::string suggestion =
        column.substr(0, 4) == "time" || column.substr(0, 4) == "Time" ? "t" : nearestName(column, knownColumns());
    if (!suggestion.empty()) found += " (is it '" + suggestion + "'?)";
    throw InputError(name_, line, found, std::string(known_columns_text));
  }

  int find(std::string_view column) const {
    const auto found = std::find(columns_.begin(), columns_.end(), column);
    return found == columns_.end() ? absent : static_cast<int>(found - columns_.begin());
  }

  /// Columns that only make sense together. True if they are there, an error if only some are.
  template <std::size_t N>
  bool findGroup(const std::array<std::string_view, N>& names, std::array<int, N>& places) const {
    std::vector<std::string> missing;
    for (std::size_t i = 0; i < N; ++i) {
      places[i] = find(names[i]);
      if (places[i] == absent) missing.emplace_back(names[i]);
    }
    if (missing.size() == N) return false;
    if (missing.empty()) return true;
    throw InputError(name_, reader_.number(),
                     fmt::format("{} {} missing", joined(missing, ","), missing.size() == 1 ? "is" : "are"),
                     fmt::format("all of {}", fmt::join(names, ",")));
  }

  void findLayout() {
    std::array<int, 3> translation{};
    std::array<int, 3> point{};
    std::array<int, 3> direction{};
    const bool has_quaternion = findGroup<4>({"qx", "qy", "qz", "qw"}, layout_.quaternion);
    const bool has_rotation_vector = findGroup<3>({"rx", "ry", "rz"}, layout_.rotation_vector);
    const bool has_matrix =
        findGroup<9>({"r00", "r01", "r02", "r10", "r11", "r12", "r20", "r21", "r22"}, layout_.matrix);
    const bool has_translation = findGroup<3>({"tx", "ty", "tz"}, translation);
    const bool has_point = findGroup<3>({"x", "y", "z"}, point);
    const bool has_direction = findGroup<3>({"dx", "dy", "dz"}, direction);

    const auto add = [](std::string& list, std::string_view columns) {
      (list += list.empty() ? "" : " and ") += columns;
    };
    std::string rotations;
    if (has_quaternion) add(rotations, "qx,qy,qz,qw");
    if (has_rotation_vector) add(rotations, "rx,ry,rz");
    if (has_matrix) add(rotations, "r00 ... r22");
    std::string features = rotations;
    if (has_point) add(features, "x,y,z");
    if (has_direction) add(features, "dx,dy,dz");
    const int n_features =
        int{has_quaternion} + int{has_rotation_vector} + int{has_matrix} + int{has_point} + int{has_direction};
    if (n_features == 0) {
      throw InputError(
          name_, reader_.number(), has_translation ? "tx,ty,tz without a rotation" : "no columns of a feature",
          has_translation ? "a rotation beside it, or x,y,z if these are points" : std::string(groups_text));
    }
    if (n_features > 1) throw InputError(name_, reader_.number(), "the columns " + features, "one of them");
    if (has_translation && rotations.empty()) {
      throw InputError(name_, reader_.number(), "tx,ty,tz beside " + features, "one of them");
    }

    if (has_point) {
      layout_.kind = Feature::point;
      layout_.vector = point;
    } else if (has_direction) {
      layout_.kind = Feature::direction;
      layout_.vector = direction;
    } else {
      layout_.kind = has_translation ? Feature::frame : Feature::rotation;
      layout_.vector = translation;
    }
    layout_.weight = find("weight");
    layout_.time = find("t");
    findCovariance();
  }

  void findCovariance() {
    const bool any = std::any_of(columns_.begin(), columns_.end(),
                                 [](const std::string& column) { return column.rfind("cov_", 0) == 0; });
    if (!any) return;
    const int n = experiments::info(layout_.kind).dof;
    const std::string expected =
        fmt::format("the upper triangle cov_00 ... cov_{0}{0} of a {1}", n - 1, name(layout_.kind));
    std::vector<std::string> missing;
    for (int i = 0; i < n; ++i) {
      for (int j = i; j < n; ++j) {
        layout_.covariance.push_back(find(covarianceColumn(i, j)));
        if (layout_.covariance.back() == absent) missing.push_back(covarianceColumn(i, j));
      }
    }
    for (const std::string& column : columns_) {
      if (column.rfind("cov_", 0) == 0 && column[5] >= '0' + n) {
        throw InputError(name_, reader_.number(),
                         fmt::format("column '{}' in a file of {}s", column, name(layout_.kind)), expected);
      }
    }
    if (!missing.empty()) {
      throw InputError(name_, reader_.number(),
                       fmt::format("{} {} missing", joined(missing, ","), missing.size() == 1 ? "is" : "are"),
                       expected);
    }
    layout_.dimension = n;
  }

  void readRows() {
    const std::size_t rows = mostRows(text_, columns_.size());
    file_.kind = layout_.kind;
    file_.lines.reserve(rows);
    if (layout_.kind == Feature::rotation || layout_.kind == Feature::frame) file_.rotations.reserve(rows);
    if (layout_.kind != Feature::rotation) file_.vectors.reserve(rows);
    if (layout_.weight != absent) file_.weights.reserve(rows);
    if (layout_.time != absent) file_.times.reserve(rows);
    values_.resize(columns_.size());
    do {
      line_ = reader_.number();
      splitFields(reader_.line(), separator_, fields_);
      if (fields_.size() != columns_.size())
        throwWrongWidth(fields_.size(), columns_.size(), description_, name_, line_);
      for (std::size_t i = 0; i < columns_.size(); ++i) {
        if (!columns_[i].empty()) values_[i] = numberField(fields_[i], columns_[i], name_, line_);
      }
      addRow();
    } while (reader_.next());
    // A text may have far more characters than its shortest rows would need.
    file_.lines.shrink_to_fit();
    file_.rotations.shrink_to_fit();
    file_.vectors.shrink_to_fit();
    file_.weights.shrink_to_fit();
    file_.times.shrink_to_fit();
  }

  double value(int place) const { return values_[static_cast<std::size_t>(place)]; }

  void addRow() {
    const experiments::Parts& parts = experiments::info(layout_.kind).parts;
    if (parts.contains(Part::rotation)) file_.rotations.push_back(readRotation());
    if (parts.contains(Part::position)) file_.vectors.push_back(readVector());
    if (parts.contains(Part::direction)) file_.vectors.push_back(readDirection());
    if (layout_.weight != absent) {
      const double weight = value(layout_.weight);
      if (!(weight > 0)) throw InputError(name_, line_, fmt::format("weight is {}", weight), "a positive number");
      file_.weights.push_back(weight);
    }
    if (layout_.time != absent) file_.times.push_back(value(layout_.time) * time_unit_);
    if (layout_.dimension > 0) file_.covariances.push_back(readCovariance());
    file_.lines.push_back(line_);
  }

  Eigen::Vector3d readVector() const {
    return {value(layout_.vector[0]), value(layout_.vector[1]), value(layout_.vector[2])};
  }

  /// Rows as the file rounds them pass silently; what was changed beyond that is counted.
  void countNormalised(double error) {
    if (error <= rounding) return;
    ++file_.n_normalised;
    file_.largest_norm_error = std::max(file_.largest_norm_error, error);
  }

  /// The norm, if it is one within the tolerance.
  template <class Vector>
  double checkedNorm(const Vector& vector, std::string_view what) {
    const double squared = vector.squaredNorm();
    // Squares of very large and very small numbers are lost, the message shall show the norm all the same.
    const bool regular = squared > 1e-200 && squared < 1e200;
    const double norm = regular ? std::sqrt(squared) : vector.stableNorm();
    const double error = std::abs(norm - 1);
    if (norm == 0) throw InputError(name_, line_, fmt::format("the {} is zero", what), "a unit vector");
    if (!(error <= options_.norm_tolerance) || !regular) {
      throw InputError(name_, line_, fmt::format("the norm of the {} is {:.6g}", what, norm),
                       fmt::format("1 within {:g}", options_.norm_tolerance));
    }
    countNormalised(error);
    return norm;
  }

  Eigen::Vector3d readDirection() {
    const Eigen::Vector3d direction = readVector();
    return direction / checkedNorm(direction, "direction");
  }

  Eigen::Quaterniond readRotation() {
    if (layout_.quaternion[0] != absent) {
      const Eigen::Vector4d q(value(layout_.quaternion[0]), value(layout_.quaternion[1]), value(layout_.quaternion[2]),
                              value(layout_.quaternion[3]));
      const double norm = checkedNorm(q, "quaternion");
      return Eigen::Quaterniond(Eigen::Vector4d(q / norm));
    }
    if (layout_.rotation_vector[0] != absent) {
      const Eigen::Vector3d r(value(layout_.rotation_vector[0]), value(layout_.rotation_vector[1]),
                              value(layout_.rotation_vector[2]));
      const double angle = r.stableNorm();
      // Beyond this the angle modulo a turn is rounding, not data.
      if (!(angle < 1e6))
        throw InputError(name_, line_, fmt::format("the rotation vector has length {:.6g}", angle),
                         "an angle in radians");
      const double scale = angle > 1e-150 ? std::sin(angle / 2) / angle : 0.5;
      Eigen::Quaterniond q;
      q.w() = std::cos(angle / 2);
      q.vec() = scale * r;
      return q;
    }
    Eigen::Matrix3d matrix;
    for (int i = 0; i < 9; ++i) matrix(i / 3, i % 3) = value(layout_.matrix[static_cast<std::size_t>(i)]);
    const NearestRotation nearest = nearestRotation(matrix, options_.norm_tolerance, name_, line_);
    countNormalised(nearest.error);
    return Eigen::Quaterniond(nearest.rotation).normalized();
  }

  Covariance readCovariance() const {
    const int n = layout_.dimension;
    Covariance covariance(n, n);
    std::size_t next = 0;
    for (int i = 0; i < n; ++i) {
      for (int j = i; j < n; ++j) covariance(i, j) = covariance(j, i) = value(layout_.covariance[next++]);
    }
    // The share of each variance that the components before it leave: the test does not depend on units.
    const Eigen::LLT<Covariance> factor(covariance);
    bool positive = factor.info() == Eigen::Success;
    for (int i = 0; positive && i < n; ++i) {
      const double pivot = factor.matrixLLT()(i, i);
      positive = pivot * pivot > n * std::numeric_limits<double>::epsilon() * covariance(i, i);
    }
    if (positive) return covariance;
    const Eigen::SelfAdjointEigenSolver<Covariance> solver(covariance, Eigen::EigenvaluesOnly);
    throw InputError(name_, line_,
                     fmt::format("the covariance is not positive definite (smallest eigenvalue {:.3g}, largest {:.3g})",
                                 solver.eigenvalues()(0), solver.eigenvalues()(n - 1)),
                     "positive eigenvalues");
  }

  std::string_view text_;
  LineReader reader_;
  std::string name_;
  ReadingOptions options_;
  std::vector<std::string> columns_;  // in the order of the file; those without a name are not read
  std::string_view description_;
  Separator separator_ = Separator::comma;
  double time_unit_ = 1;
  Layout layout_;
  FeatureFile file_;
  std::size_t line_ = 0;
  std::vector<std::string_view> fields_;
  std::vector<double> values_;
};

}  // namespace

std::string_view name(Format format) {
  switch (format) {
    case Format::automatic:
      return "auto";
    case Format::csv:
      return "csv";
    case Format::tum:
      return "tum";
    case Format::euroc:
      return "euroc";
    case Format::kitti:
      return "kitti";
  }
  return "";
}

std::optional<Format> formatFromName(std::string_view text) {
  for (const Format format : {Format::automatic, Format::csv, Format::tum, Format::euroc, Format::kitti}) {
    if (text == name(format)) return format;
  }
  return std::nullopt;
}

const std::vector<std::string>& knownColumns() {
  static const std::vector<std::string> columns = [] {
    std::vector<std::string> result = {"t", "tx", "ty", "tz", "qx", "qy", "qz", "qw", "rx", "ry", "rz"};
    for (int i = 0; i < 9; ++i) result.push_back(fmt::format("r{}{}", i / 3, i % 3));
    for (const char* column : {"x", "y", "z", "dx", "dy", "dz", "weight"}) result.emplace_back(column);
    for (int i = 0; i < 6; ++i) {
      for (int j = i; j < 6; ++j) result.push_back(covarianceColumn(i, j));
    }
    return result;
  }();
  return columns;
}

FeatureFile readFeatureFile(const std::string& path, const ReadingOptions& options) {
  const TextFile file = loadText(path);
  return readFeatures(file.text, file.name, options);
}

FeatureFile readFeatures(std::string_view text, std::string file, const ReadingOptions& options) {
  return FeatureReader(text, std::move(file), options).read();
}

NumericTable::NumericTable(std::string file, std::vector<std::string> columns)
    : file_(std::move(file)), columns_(std::move(columns)) {}

bool NumericTable::has(std::string_view column) const {
  return std::find(columns_.begin(), columns_.end(), column) != columns_.end();
}

std::size_t NumericTable::column(std::string_view column) const {
  return static_cast<std::size_t>(std::find(columns_.begin(), columns_.end(), column) - columns_.begin());
}

std::size_t NumericTable::index(std::size_t row, std::size_t column) const {
  const double value = (*this)(row, column);
  // 2^53: up to there every whole number is a double.
  if (value >= 0 && value <= 9007199254740992.0 && value == std::floor(value)) return static_cast<std::size_t>(value);
  throw InputError(file_, lines_[row], fmt::format("{} is {}", columns_[column], value), "a whole number of 0 or more");
}

void NumericTable::append(const double* values, std::size_t line) {
  values_.insert(values_.end(), values, values + columns_.size());
  lines_.push_back(line);
}

NumericTable readTable(const std::string& path, const std::vector<std::string>& required,
                       const std::vector<std::string>& optional) {
  const TextFile file = loadText(path);
  return parseTable(file.text, file.name, required, optional);
}

NumericTable parseTable(std::string_view text, std::string name, const std::vector<std::string>& required,
                        const std::vector<std::string>& optional) {
  requireText(text, name);
  LineReader reader(text);
  const std::string header = joined(required, ",");
  if (!reader.next())
    throw InputError(name, 0, "the file has no data, only blank lines and comments", "the columns " + header);
  std::vector<std::string_view> fields;
  splitFields(reader.line(), Separator::comma, fields);
  if (looksNumeric(fields))
    throw InputError(name, reader.number(), "numbers where the header should be", "the columns " + header);
  const std::vector<std::string> names = readHeader(fields, name, reader.number());

  std::vector<std::string> columns;
  std::vector<std::size_t> places;
  for (const auto* list : {&required, &optional}) {
    for (const std::string& column : *list) {
      const auto found = std::find(names.begin(), names.end(), column);
      if (found != names.end()) {
        columns.push_back(column);
        places.push_back(static_cast<std::size_t>(found - names.begin()));
      } else if (list == &required) {
        const std::string near = nearestName(column, names);
        throw InputError(
            name, reader.number(),
            "there is no column '" + column + "'" + (near.empty() ? "" : " (is it '" + printable(near) + "'?)"),
            "the columns " + header);
      }
    }
  }

  const std::size_t header_line = reader.number();
  NumericTable table(std::move(name), columns);
  std::vector<double> values(columns.size());
  while (reader.next()) {
    splitFields(reader.line(), Separator::comma, fields);
    if (fields.size() != names.size())
      throwWrongWidth(fields.size(), names.size(), "as in the header", table.file(), reader.number());
    for (std::size_t i = 0; i < columns.size(); ++i) {
      values[i] = numberField(fields[places[i]], columns[i], table.file(), reader.number());
    }
    table.append(values.data(), reader.number());
  }
  if (table.rows() == 0)
    throw InputError(table.file(), header_line, "there is a header but no data", "at least one row after it");
  return table;
}

NearestRotation nearestRotation(const Eigen::Matrix3d& matrix, double tolerance, const std::string& file,
                                std::size_t line) {
  const double determinant = matrix.determinant();
  if (determinant < 0) {
    throw InputError(file, line,
                     fmt::format("the rotation matrix has determinant {:.6g}, it is a reflection", determinant),
                     "determinant 1");
  }
  const double error = 0.5 * (matrix.transpose() * matrix - Eigen::Matrix3d::Identity()).norm();
  // Newton's iteration for the polar factor, quadratic from anywhere near; a singular matrix ends in what is not
  // finite.
  Eigen::Matrix3d rotation = matrix;
  bool finite = error <= tolerance;
  for (int i = 0; finite && i < 60; ++i) {
    const Eigen::Matrix3d next = 0.5 * (rotation + rotation.inverse().transpose());
    const double step = (next - rotation).norm();
    rotation = next;
    finite = rotation.allFinite();
    if (step < 1e-8) break;  // the next step would be its square
  }
  if (!finite) {
    throw InputError(file, line, fmt::format("the rotation matrix is not orthogonal (error {:.6g})", error),
                     fmt::format("an error within {:g}", tolerance));
  }
  return {rotation, error};
}

}  // namespace liestat::cli
