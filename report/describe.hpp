// Results as lists of fields. A result type has one function template beside it,
//
//   template <class V>
//   void describe(V& v, const ResidualTest& t) {
//     v("statistic", t.statistic)("degrees_of_freedom", t.dof, "of chi-squared")("p", t.p);
//   }
//
// which names each field once: v(name, value, meaning = "", unit = ""); fields that a result may lack: stats/shown.hpp. It
// needs no include of this header. Views are
// visitors: JSON (report/json.hpp), Python's dictionaries (python/src/described.hpp), and those below. A value is a
// number, a word, a matrix or vector of Eigen, a list of values, another described result, or an optional of one of these.
// Numbers that belong to single poses, frames or windows in long series are described apart, by describeSeries(v, result).
#pragma once

#include <algorithm>
#include <limits>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {

/// A visitor that takes every field.
struct AnyVisitor {
  template <class T>
  AnyVisitor& operator()(const char*, const T&, const char* = "", const char* = "") {
    return *this;
  }
};

/// A type whose fields describe() lists.
template <class T>
concept Described = requires(AnyVisitor& v, const T& x) {
  describe(v, x);
};

/// A field of a result type, for tables of fields and the declarations of other languages.
struct FieldDescription {
  enum class Kind { number, integer, boolean, text, array, result };
  std::string name, meaning, unit;
  Kind kind = Kind::number;
  bool list = false, optional = false;
  int rows = 0, columns = 0;  ///< an array's sizes: 0 if any number, a vector has one column
  std::string result = {};    ///< name of the type of a result, its fields are:
  std::vector<FieldDescription> fields = {};
};

/// The name of a type, without namespaces and arguments.
template <class T>
std::string nameOfType() {
  const std::string_view function = __PRETTY_FUNCTION__;
  std::string_view type = function.substr(function.find("T = ") + 4);
  type = type.substr(0, type.find_first_of("<;]"));
  return std::string(type.substr(type.rfind(':') + 1));
}

/// Lists the fields that results of a type may have, each once.
class FieldList {
 public:
  static constexpr bool every_field = true;  ///< see stats/shown.hpp

  template <class T>
  FieldList& operator()(const char* name, const T&, const char* meaning = "", const char* unit = "") {
    for (const FieldDescription& field : fields_) {
      if (field.name == name) return *this;
    }
    FieldDescription field{name, meaning, unit};
    setType<T>(field);
    fields_.push_back(std::move(field));
    return *this;
  }
  const std::vector<FieldDescription>& fields() const { return fields_; }

 private:
  template <class T>
  static void setType(FieldDescription& field) {
    using Kind = FieldDescription::Kind;
    if constexpr (Described<T>) {
      FieldList inner;
      describe(inner, T());
      field.kind = Kind::result, field.result = nameOfType<T>(), field.fields = inner.fields_;
    } else if constexpr (std::is_same_v<T, bool>) {
      field.kind = Kind::boolean;
    } else if constexpr (std::is_integral_v<T>) {
      field.kind = Kind::integer;
    } else if constexpr (std::is_convertible_v<const T&, std::string_view>) {
      field.kind = Kind::text;
    } else if constexpr (requires { T::RowsAtCompileTime; }) {
      field.kind = Kind::array;
      field.rows = std::max<int>(0, T::RowsAtCompileTime), field.columns = std::max<int>(0, T::ColsAtCompileTime);
    } else if constexpr (requires(const T& value) { value.has_value(); }) {
      setType<typename T::value_type>(field);
      field.optional = true;
    } else if constexpr (requires { typename T::value_type; }) {
      setType<typename T::value_type>(field);
      field.list = true;
    }
  }

  std::vector<FieldDescription> fields_;
};

/// The fields of a result type, in order.
template <Described T>
std::vector<FieldDescription> fieldsOf() {
  FieldList list;
  describe(list, T());
  return list.fields();
}

/// The numbers of a result by name, those of nested results as outer_inner: what `--fail-if` knows. Yes and no are 1 and
/// 0, an empty optional is NaN. Lists have no name.
class NamedFigures {
 public:
  explicit NamedFigures(std::string prefix = {}) : prefix_(std::move(prefix)) {}

  template <class T>
  NamedFigures& operator()(const char* name, const T& value, const char* = "", const char* = "") {
    add(prefix_ + name, value);
    return *this;
  }
  const std::vector<std::pair<std::string, double>>& figures() const { return figures_; }

 private:
  template <class T>
  void add(std::string name, const T& value) {
    if constexpr (Described<T>) {
      NamedFigures inner(std::move(name) + "_");
      describe(inner, value);
      figures_.insert(figures_.end(), inner.figures_.begin(), inner.figures_.end());
    } else if constexpr (std::is_arithmetic_v<T>) {
      figures_.emplace_back(std::move(name), static_cast<double>(value));
    } else if constexpr (requires {
                           value.has_value();
                           *value;
                         }) {
      using Inner = std::remove_cvref_t<decltype(*value)>;
      if (value) {
        add(std::move(name), *value);
      } else if constexpr (std::is_arithmetic_v<Inner>) {
        figures_.emplace_back(std::move(name), std::numeric_limits<double>::quiet_NaN());
      } else if constexpr (Described<Inner>) {
        add(std::move(name), Inner{});
      }
    }
  }

  std::string prefix_;
  std::vector<std::pair<std::string, double>> figures_;
};

}  // namespace liestat
