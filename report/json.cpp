#include <report/json.hpp>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include <formats/output_file.hpp>

namespace liestat {
namespace {

using Json = nlohmann::ordered_json;

Json finiteOrNull(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

bool isPlain(const Json& value) { return !value.is_structured(); }

bool isFlat(const Json& value) { return std::all_of(value.begin(), value.end(), isPlain); }

/// A command line may hold bytes that are no UTF-8; JSON may not.
std::string compact(const Json& value) { return value.dump(-1, ' ', false, Json::error_handler_t::replace); }

void appendInline(std::string& text, const Json& value) {
  if (!value.is_structured() || value.empty()) {
    text += compact(value);
    return;
  }
  text += value.is_array() ? "[" : "{";
  bool first = true;
  for (const auto& [key, element] : value.items()) {
    if (!first) text += ", ";
    first = false;
    if (value.is_object()) text += compact(Json(key)) + ": ";
    appendInline(text, element);
  }
  text += value.is_array() ? "]" : "}";
}

void append(std::string& text, const Json& value, std::size_t indent) {
  const bool on_one_line = value.is_array() ? isFlat(value) : !value.is_object() || value.empty();
  if (on_one_line) return appendInline(text, value);
  text += value.is_array() ? "[" : "{";
  bool first = true;
  for (const auto& [key, element] : value.items()) {
    text += first ? "\n" : ",\n";
    first = false;
    text.append(indent + 2, ' ');
    if (value.is_object()) text += compact(Json(key)) + ": ";
    if (value.is_array() && isFlat(element)) {
      appendInline(text, element);
    } else {
      append(text, element, indent + 2);
    }
  }
  text += "\n" + std::string(indent, ' ') + (value.is_array() ? "]" : "}");
}

/// Quotes an argument unless a shell takes it as it is.
std::string shellWord(std::string_view argument) {
  constexpr std::string_view harmless = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./=:,+@%";
  if (!argument.empty() && argument.find_first_not_of(harmless) == std::string_view::npos) return std::string(argument);
  std::string word = "'";
  for (const char c : argument) {
    if (c == '\'') {
      word += "'\\''";
    } else {
      word += c;
    }
  }
  return word + "'";
}

}  // namespace

JsonObject::JsonObject() : json_(std::make_unique<Json>(Json::object())) {}
JsonObject::JsonObject(const JsonObject& other) : json_(std::make_unique<Json>(*other.json_)) {}
JsonObject::JsonObject(JsonObject&& other) noexcept = default;
JsonObject& JsonObject::operator=(const JsonObject& other) {
  json_ = std::make_unique<Json>(*other.json_);
  return *this;
}
JsonObject& JsonObject::operator=(JsonObject&& other) noexcept = default;
JsonObject::~JsonObject() = default;

JsonObject& JsonObject::set(std::string_view key, std::nullptr_t) {
  (*json_)[std::string(key)] = nullptr;
  return *this;
}

JsonObject& JsonObject::set(std::string_view key, double value) {
  (*json_)[std::string(key)] = finiteOrNull(value);
  return *this;
}

JsonObject& JsonObject::set(std::string_view key, std::string_view value) {
  (*json_)[std::string(key)] = std::string(value);
  return *this;
}

JsonObject& JsonObject::set(std::string_view key, const std::vector<double>& values) {
  Json list = Json::array();
  for (const double value : values) list.push_back(finiteOrNull(value));
  (*json_)[std::string(key)] = std::move(list);
  return *this;
}

JsonObject& JsonObject::set(std::string_view key, const std::vector<std::string>& values) {
  (*json_)[std::string(key)] = values;
  return *this;
}

JsonObject& JsonObject::set(std::string_view key, const JsonObject& value) {
  Json copy = *value.json_;
  (*json_)[std::string(key)] = std::move(copy);
  return *this;
}

JsonObject& JsonObject::set(std::string_view key, const std::vector<JsonObject>& values) {
  Json list = Json::array();
  for (const JsonObject& value : values) list.push_back(*value.json_);
  (*json_)[std::string(key)] = std::move(list);
  return *this;
}

JsonObject& JsonObject::setBool(std::string_view key, bool value) {
  (*json_)[std::string(key)] = value;
  return *this;
}

JsonObject& JsonObject::setSigned(std::string_view key, std::int64_t value) {
  (*json_)[std::string(key)] = value;
  return *this;
}

JsonObject& JsonObject::setUnsigned(std::string_view key, std::uint64_t value) {
  (*json_)[std::string(key)] = value;
  return *this;
}

JsonObject& JsonObject::setMatrix(std::string_view key, const Eigen::Ref<const Eigen::MatrixXd>& value,
                                  bool is_vector) {
  Json list = Json::array();
  for (Eigen::Index i = 0; i < value.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < value.cols(); ++j) row.push_back(finiteOrNull(value(i, j)));
    list.push_back(is_vector ? row[0] : row);
  }
  (*json_)[std::string(key)] = std::move(list);
  return *this;
}

std::string JsonObject::str() const {
  std::string text;
  append(text, *json_, 0);
  return text + "\n";
}

JsonObject jsonEnvelope(std::string_view command_line, std::optional<std::uint64_t> seed) {
  JsonObject object;
  object.set("schema_version", schema_version)
      .set("program", "liestat")
      .set("version", programVersion())
      .set("command_line", command_line);
  if (seed) object.set("seed", *seed);
  return object;
}

std::string commandLine(int argc, const char* const* argv) {
  return commandLine(std::vector<std::string>(argv, argv + argc));
}
std::string commandLine(const std::vector<std::string>& words) {
  std::string line;
  for (const std::string& word : words) line += (line.empty() ? "" : " ") + shellWord(word);
  return line;
}

void writeJson(const std::string& path, const JsonObject& object) { writeOutput(path, object.str()); }

std::string_view programVersion() { return LIESTAT_VERSION; }

}  // namespace liestat
