#include <formats/detail/feature_columns.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include <formats/input_error.hpp>
#include <formats/features.hpp>
#include <formats/text.hpp>

namespace liestat::detail {
namespace {

constexpr std::string_view covariance_prefix = "cov_", factor_prefix = "factor_", deviation_prefix = "sd_";

std::string covarianceColumn(int row, int column) { return fmt::format("{}{}{}", covariance_prefix, row, column); }
std::string factorColumn(int row, int column) { return fmt::format("{}{}{}", factor_prefix, row, column); }
std::string deviationColumn(int row) { return fmt::format("{}{}", deviation_prefix, row); }

/// Finds columns by their names.
struct Header {
  const std::vector<std::string>& columns;
  const std::string& file;
  std::size_t line;

  [[noreturn]] void complain(const std::string& found, const std::string& expected) const {
    throw InputError(file, line, found, expected);
  }
  [[noreturn]] void complainMissing(const std::vector<std::string>& missing, const std::string& expected) const {
    complain(fmt::format("{} {} missing", joined(missing, ","), missing.size() == 1 ? "is" : "are"), expected);
  }
  int find(std::string_view column) const {
    const auto found = std::find(columns.begin(), columns.end(), column);
    return found == columns.end() ? absent : static_cast<int>(found - columns.begin());
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
    complainMissing(missing, fmt::format("all of {}", fmt::join(names, ",")));
  }
};

/// The first feature that has exactly these parts.
std::optional<Feature> featureOf(const FeatureParts& parts) {
  for (const FeatureInfo& feature : feature_rows) {
    if (feature.parts == parts) return feature.kind;
  }
  return std::nullopt;
}

void findParts(const Header& header, FeatureColumns& found) {
  std::array<int, 3> translation{}, point{};
  const bool has_quaternion = header.findGroup<4>({"qx", "qy", "qz", "qw"}, found.quaternion);
  const bool has_rotation_vector = header.findGroup<3>({"rx", "ry", "rz"}, found.rotation_vector);
  const bool has_euler = header.findGroup<3>({"roll", "pitch", "yaw"}, found.euler);
  const bool has_matrix =
      header.findGroup<9>({"r00", "r01", "r02", "r10", "r11", "r12", "r20", "r21", "r22"}, found.matrix);
  const bool has_translation = header.findGroup<3>({"tx", "ty", "tz"}, translation);
  const bool has_point = header.findGroup<3>({"x", "y", "z"}, point);
  const bool has_direction = header.findGroup<3>({"dx", "dy", "dz"}, found.direction);
  found.heading = header.find("heading_deg");
  const bool has_heading = found.heading != absent;
  const bool has_rotation = has_quaternion || has_rotation_vector || has_euler || has_matrix;

  std::vector<std::string> groups;  // those that may be a feature by themselves
  if (has_quaternion) groups.emplace_back("qx,qy,qz,qw");
  if (has_rotation_vector) groups.emplace_back("rx,ry,rz");
  if (has_euler) groups.emplace_back("roll,pitch,yaw");
  if (has_matrix) groups.emplace_back("r00 ... r22");
  if (has_point) groups.emplace_back("x,y,z");
  if (has_direction) groups.emplace_back("dx,dy,dz");
  if (has_heading) groups.emplace_back("heading_deg");
  if (groups.empty() && has_translation) {
    header.complain("tx,ty,tz without a rotation", "a rotation beside it, or x,y,z if these are points");
  }
  if (groups.empty()) header.complain("no columns of a feature", std::string(feature_columns_text));
  const std::optional<Feature> pair = has_point && has_direction && !has_rotation && !has_heading
                                          ? featureOf({FeaturePart::position, FeaturePart::direction})
                                          : std::nullopt;
  if (groups.size() > 1 && !pair) header.complain("the columns " + joined(groups, " and "), "one of them");
  if (has_translation && !has_rotation) {
    header.complain("tx,ty,tz beside " + joined(groups, " and "), "one of them");
  }
  found.position = has_point ? point : translation;
  if (pair) {
    found.kind = *pair;
  } else if (has_rotation) {
    found.kind = *featureOf(has_translation ? FeatureParts(FeaturePart::rotation, FeaturePart::position)
                                            : FeatureParts(FeaturePart::rotation));
  } else {
    found.kind = *featureOf(FeatureParts(has_point     ? FeaturePart::position
                                         : has_heading ? FeaturePart::heading
                                                       : FeaturePart::direction));
  }
}

void findCovariance(const Header& header, FeatureColumns& found) {
  const FeatureInfo& feature = info(found.kind);
  const int n = feature.dof;
  std::vector<std::string> upper, square, diagonal;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      if (j >= i) upper.push_back(covarianceColumn(i, j));
      square.push_back(factorColumn(i, j));
    }
    diagonal.push_back(deviationColumn(i));
  }
  struct Form {
    std::string_view prefix;
    const std::vector<std::string>& names;
    std::vector<int>& places;
    std::string_view what;
  };
  const Form forms[] = {{covariance_prefix, upper, found.covariance, "the upper triangle"},
                        {factor_prefix, square, found.factor, "the square matrix"},
                        {deviation_prefix, diagonal, found.deviations, "the standard deviations"}};
  std::string_view first;
  for (const Form& form : forms) {
    const auto isOne = [&](const std::string& column) { return column.rfind(form.prefix, 0) == 0; };
    if (std::none_of(header.columns.begin(), header.columns.end(), isOne)) continue;
    const std::string expected =
        fmt::format("{} {} ... {} of a {}", form.what, form.names.front(), form.names.back(), feature.name);
    if (!first.empty()) {
      header.complain(fmt::format("the columns {}.. beside {}..", form.prefix, first), "one form of a covariance");
    }
    first = form.prefix;
    std::vector<std::string> missing;
    for (const std::string& name : form.names) {
      form.places.push_back(header.find(name));
      if (form.places.back() == absent) missing.push_back(name);
    }
    for (const std::string& column : header.columns) {
      const auto last = static_cast<char>('0' + n);
      if (isOne(column) && (column[form.prefix.size()] >= last || column.back() >= last)) {
        header.complain(fmt::format("column '{}' in a file of {}", column, feature.plural), expected);
      }
    }
    if (!missing.empty()) header.complainMissing(missing, expected);
    found.dimension = n;
  }
}

}  // namespace

const std::vector<std::string>& knownColumns() {
  static const std::vector<std::string> columns = [] {
    std::vector<std::string> result = {"t",  "tx", "ty", "tz", "qx",   "qy",    "qz",
                                       "qw", "rx", "ry", "rz", "roll", "pitch", "yaw"};
    for (int i = 0; i < 9; ++i) result.push_back(fmt::format("r{}{}", i / 3, i % 3));
    for (const char* column : {"x", "y", "z", "dx", "dy", "dz", "heading_deg", "weight"}) result.emplace_back(column);
    for (int i = 0; i < 6; ++i) {
      for (int j = i; j < 6; ++j) result.push_back(covarianceColumn(i, j));
      for (int j = 0; j < 6; ++j) result.push_back(factorColumn(i, j));
      result.push_back(deviationColumn(i));
    }
    return result;
  }();
  return columns;
}

bool isCovarianceColumn(std::string_view column) {
  for (const std::string_view prefix : {covariance_prefix, factor_prefix, deviation_prefix}) {
    if (column.substr(0, prefix.size()) == prefix) return true;
  }
  return false;
}

FeatureColumns findFeature(const std::vector<std::string>& columns, const std::string& file, std::size_t line) {
  const Header header{columns, file, line};
  FeatureColumns found;
  findParts(header, found);
  found.weight = header.find("weight");
  found.time = header.find("t");
  findCovariance(header, found);
  return found;
}

}  // namespace liestat::detail
