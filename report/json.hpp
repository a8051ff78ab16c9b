#pragma once

#include <report/describe.hpp>

#include <Eigen/Core>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace liestat {

/// A JSON object that is filled field by field, in the order in which the fields are set. What is not finite becomes
/// null. The library behind it is compiled in one unit only.
class JsonObject {
 public:
  JsonObject();
  JsonObject(const JsonObject& other);
  JsonObject(JsonObject&& other) noexcept;
  JsonObject& operator=(const JsonObject& other);
  JsonObject& operator=(JsonObject&& other) noexcept;
  ~JsonObject();

  JsonObject& set(std::string_view key, std::nullptr_t);
  JsonObject& set(std::string_view key, double value);
  JsonObject& set(std::string_view key, std::string_view value);
  JsonObject& set(std::string_view key, const char* value) { return set(key, std::string_view(value)); }
  JsonObject& set(std::string_view key, const std::string& value) { return set(key, std::string_view(value)); }
  /// A column vector becomes a list, any other matrix a list of its rows.
  template <class Derived>
  JsonObject& set(std::string_view key, const Eigen::MatrixBase<Derived>& value) {
    return setMatrix(key, value.template cast<double>(), Derived::ColsAtCompileTime == 1);
  }
  JsonObject& set(std::string_view key, const std::vector<double>& values);
  JsonObject& set(std::string_view key, const std::vector<std::string>& values);
  JsonObject& set(std::string_view key, const JsonObject& value);
  JsonObject& set(std::string_view key, const std::vector<JsonObject>& values);
  /// bool and the integers; a template, because a conversion among them would be ambiguous.
  template <class T>
  requires std::integral<T> JsonObject& set(std::string_view key, T value) {
    if constexpr (std::same_as<T, bool>) {
      return setBool(key, value);
    } else if constexpr (std::unsigned_integral<T>) {
      return setUnsigned(key, value);
    } else {
      return setSigned(key, value);
    }
  }
  /// A value or null.
  template <class T>
  JsonObject& set(std::string_view key, const std::optional<T>& value) {
    return value ? set(key, *value) : set(key, nullptr);
  }

  /// Sets the fields of a described result, beside those that are set already.
  template <Described T>
  JsonObject& fieldsOf(const T& result) {
    describe(*this, result);
    return *this;
  }
  /// A field of describe(): this is a visitor.
  template <class T>
  JsonObject& operator()(const char* key, const T& value, const char* = "", const char* = "") {
    if constexpr (Described<T>) {
      return set(key, JsonObject().fieldsOf(value));
    } else if constexpr (requires { value.has_value(); }) {
      return value ? (*this)(key, *value) : set(key, nullptr);
    } else if constexpr (requires { requires Described<typename T::value_type>; }) {
      std::vector<JsonObject> list;
      for (const auto& element : value) list.push_back(JsonObject().fieldsOf(element));
      return set(key, list);
    } else if constexpr (requires {
                           requires std::integral<typename T::value_type> &&
                               !std::same_as<typename T::value_type, char>;
                           value.size();
                           value.begin();
                         }) {
      return set(key, std::vector<double>(value.begin(), value.end()));
    } else {
      return set(key, value);
    }
  }

  /// The object as text, one field a line; lists of plain values and flat objects inside lists stand on one line.
  std::string str() const;

  /// For what the above cannot say.
  const nlohmann::ordered_json& json() const { return *json_; }

 private:
  JsonObject& setBool(std::string_view key, bool value);
  JsonObject& setSigned(std::string_view key, std::int64_t value);
  JsonObject& setUnsigned(std::string_view key, std::uint64_t value);
  JsonObject& setMatrix(std::string_view key, const Eigen::Ref<const Eigen::MatrixXd>& value, bool is_vector);

  std::unique_ptr<nlohmann::ordered_json> json_;
};

/// The version of the fields' names and meanings; grows when one of them changes.
inline constexpr int schema_version = 2;

/// The first fields of every JSON file of the program: schema_version, program, version, command_line, and the seed if
/// there is one.
JsonObject jsonEnvelope(std::string_view command_line, std::optional<std::uint64_t> seed = std::nullopt);

/// The command line as one could type it again in a shell.
std::string commandLine(int argc, const char* const* argv);
std::string commandLine(const std::vector<std::string>& words);

/// Writes the object to a file, as writeOutput does. Throws InputError.
void writeJson(const std::string& path, const JsonObject& object);

/// The program's version.
std::string_view programVersion();

}  // namespace liestat
