#include <formats/detail/yaml_values.hpp>

#include <fmt/format.h>

#include <yaml-cpp/eventhandler.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>
#include <utility>

#include <formats/detail/rotation_matrix.hpp>
#include <formats/text.hpp>

namespace liestat::detail {
namespace {

/// Passes over all of a text but its aliases.
class AliasFinder : public YAML::EventHandler {
 public:
  AliasFinder(const std::string& file, std::size_t first_line) : file_(file), first_line_(first_line) {}

  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override {
    throw InputError(file_, first_line_ + static_cast<std::size_t>(std::max(mark.line, 0)), "an alias of YAML (*name)",
                     "each value where it belongs");
  }
  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t, const std::string&) override {}
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnMapEnd() override {}

 private:
  const std::string& file_;
  std::size_t first_line_;
};

}  // namespace

void refuseAliases(const std::string& yaml, const std::string& file, std::size_t first_line) {
  if (yaml.find('*') == std::string::npos) return;
  std::istringstream text(yaml);
  YAML::Parser parser(text);
  AliasFinder finder(file, first_line);
  // One document, as YAML::Load; on a document that it cannot end, yaml-cpp would be asked for the next one for ever.
  parser.HandleNextDocument(finder);
}

std::string shown(const YAML::Node& node) {
  if (node.IsScalar()) return "'" + printable(node.Scalar()) + "'";
  return node.IsSequence() ? "a list" : node.IsMap() ? "a map" : "empty";
}

double NamedNode::number(const std::string& expected) const {
  double value = 0;
  if (!node.IsScalar() || parseNumber(node.Scalar(), value) != NumberKind::finite) {
    complain("is " + shown(node), expected);
  }
  return value;
}

Section::Section(const YAML::Node& map, const std::string& file_name, std::string section)
    : node(map), file(file_name), name(std::move(section)) {
  std::set<std::string> keys;
  for (const auto& entry : node) {
    if (entry.first.IsScalar() && !keys.insert(entry.first.Scalar()).second) {
      throw InputError(file, lineOf(entry.first), "'" + printable(entry.first.Scalar()) + "' appears twice", "it once");
    }
  }
}

std::optional<NamedNode> Section::find(const char* key) const {
  const YAML::Node value = node[key];
  if (!value.IsDefined() || value.IsNull()) return std::nullopt;
  return NamedNode{value, file, nameOf(key)};
}

std::vector<double> numbers(const NamedNode& list, const std::string& expected) {
  if (!list.node.IsSequence()) list.complain("is " + shown(list.node), expected);
  std::vector<double> values;
  for (const YAML::Node& node : list.node) values.push_back(NamedNode{node, list.file, list.name}.number(expected));
  return values;
}

SE3d rigidMotion(const NamedNode& matrix) {
  const std::string expected = "4 rows of 4 numbers, the last 0 0 0 1";
  const auto complainSize = [&](const std::string& found) { matrix.complain(found, expected); };
  const YAML::Node& map = matrix.node;
  if (map.IsMap()) {
    const YAML::Node rows = map["rows"], cols = map["cols"], list = map["data"];
    if (!rows || !cols || !list || !list.IsSequence()) complainSize("is a map without rows, cols and data");
    const double r = NamedNode{rows, matrix.file, matrix.name + ": rows"}.number("4");
    const double c = NamedNode{cols, matrix.file, matrix.name + ": cols"}.number("4");
    if ((r != 3 && r != 4) || c != 4) complainSize(fmt::format("is {} by {}", r, c));
    if (list.size() != 4 * static_cast<std::size_t>(r)) complainSize(fmt::format("has {} numbers", list.size()));
  }
  const YAML::Node data = map.IsMap() ? map["data"] : map;
  if (!data.IsSequence()) complainSize("is " + shown(data));
  std::vector<std::pair<double, std::size_t>> values;  // and their lines
  const auto take = [&](const YAML::Node& node) {
    values.emplace_back(NamedNode{node, matrix.file, matrix.name}.number("numbers"), lineOf(node));
  };
  const bool in_rows = data.size() <= 4;
  for (const YAML::Node& row : data) {
    if (!in_rows) {
      take(row);
      continue;
    }
    if (!row.IsSequence() || row.size() != 4) {
      throw InputError(matrix.file, lineOf(row),
                       fmt::format("a row of {} {}", matrix.name,
                                   row.IsSequence() ? fmt::format("has {} numbers", row.size()) : "is " + shown(row)),
                       expected);
    }
    for (const YAML::Node& cell : row) take(cell);
  }
  if (values.size() != 16 && values.size() != 12) {
    complainSize(in_rows ? fmt::format("has {} rows", data.size()) : fmt::format("has {} numbers", values.size()));
  }
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  for (int k = 0; k < 12; ++k) {
    const double value = values[static_cast<std::size_t>(k)].first;
    (k % 4 == 3 ? translation[k / 4] : rotation(k / 4, k % 4)) = value;
  }
  for (std::size_t k = 12; k < values.size(); ++k) {
    if (std::abs(values[k].first - (k == 15 ? 1 : 0)) > 1e-9) {
      throw InputError(matrix.file, values[k].second,
                       fmt::format("the last row of {} is {} {} {} {}", matrix.name, values[12].first, values[13].first,
                                   values[14].first, values[15].first),
                       "0 0 0 1");
    }
  }
  try {
    return SE3d(nearestRotation(rotation, rotation_tolerance, matrix.file, matrix.line()).rotation, translation);
  } catch (const InputError& error) {
    throw InputError(matrix.file, matrix.line(), matrix.name + ": " + error.found(), error.expected());
  }
}

}  // namespace liestat::detail
