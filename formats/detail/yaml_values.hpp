// Named values of YAML files, with the line in every message.
#pragma once

#include <lie/se3.hpp>

#include <yaml-cpp/yaml.h>

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <formats/input_error.hpp>

namespace liestat::detail {

inline std::size_t lineOf(const YAML::Node& node) { return static_cast<std::size_t>(node.Mark().line + 1); }

/// A node as messages show it.
std::string shown(const YAML::Node& node);

/// A value and what messages call it by.
struct NamedNode {
  YAML::Node node;
  const std::string& file;
  std::string name;

  std::size_t line() const { return lineOf(node); }
  [[noreturn]] void complain(const std::string& found, const std::string& expected) const {
    throw InputError(file, line(), name + " " + found, expected);
  }
  /// A finite number; throws InputError otherwise.
  double number(const std::string& expected) const;
};

/// A map whose keys appear once: of two, one would be lost.
struct Section {
  YAML::Node node;
  const std::string& file;
  std::string name;  ///< cam0; empty for the file as a whole

  Section(const YAML::Node& map, const std::string& file_name, std::string section);
  std::string nameOf(const char* key) const { return name.empty() ? key : name + "'s " + key; }
  std::size_t line() const { return name.empty() ? 0 : lineOf(node); }
  bool has(const char* key) const { return node[key].IsDefined(); }
  std::optional<NamedNode> find(const char* key) const;
  [[noreturn]] void complainMissing(const std::string& what, const std::string& expected) const {
    throw InputError(file, line(), name.empty() ? "there is no " + what : name + " has no " + what, expected);
  }
};

/// A list of numbers.
std::vector<double> numbers(const NamedNode& list, const std::string& expected);

/// A rigid motion as rows (4x4, or 3x4), as 16 or 12 numbers in a row, or as OpenCV's map of rows, cols and data.
SE3d rigidMotion(const NamedNode& matrix);

/// Throws InputError where a YAML text has an alias: a few bytes of them stand for gigabytes, and no file here needs one.
/// Throws YAML::Exception where it is no YAML. The text begins in that line of the file.
void refuseAliases(const std::string& yaml, const std::string& file, std::size_t first_line = 1);

/// The size of a calibration, bytes; yaml-cpp would take minutes for what is larger.
inline constexpr std::size_t max_yaml = 1000000;

/// Calls a function with the file's root; what yaml-cpp throws becomes an InputError.
template <class Function>
auto withRoot(std::string_view text, const std::string& name, Function&& function) {
  if (text.size() > max_yaml) {
    throw InputError(name, 0, "this YAML file has " + std::to_string(text.size()) + " bytes",
                     "a calibration, of at most " + std::to_string(max_yaml));
  }
  // OpenCV's directive is none of YAML's; as a comment it keeps the numbers of the lines.
  std::string yaml(text);
  if (yaml.rfind("%YAML:", 0) == 0) yaml[0] = '#';
  try {
    refuseAliases(yaml, name);
    const YAML::Node root = YAML::Load(yaml);
    if (!root.IsMap()) throw InputError(name, 0, "this is no YAML file of named values");
    return function(Section(root, name, ""));
  } catch (const YAML::Exception& error) {
    throw InputError(name, static_cast<std::size_t>(error.mark.line + 1), "YAML: " + printable(error.msg, 200));
  }
}

}  // namespace liestat::detail
