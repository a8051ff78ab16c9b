// Results as lists of fields. A result type has one function template beside it,
//
//   template <class V>
//   void describe(V& v, const ResidualTest& t) {
//     v("statistic", t.statistic)("degrees_of_freedom", t.dof, "of chi-squared")("p", t.p);
//   }
//
// which names each field once: v(name, value, meaning = "", unit = ""). It needs no include of this header. Views are
// visitors: JSON (report/json.hpp), Python's dictionaries (python/src/described.hpp), and those below. A value is a
// number, a word, a matrix or vector of Eigen, a list of values, another described result, or an optional of one of these.
// Numbers that belong to single poses, frames or windows in long series are described apart, by describeSeries(v, result).
#pragma once

#include <concepts>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
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

/// A field of a result, for tables of fields: `path` joins the names of nested results by dots, and ends in `[]` where there
/// is a list of them.
struct FieldDescription {
  std::string path, meaning, unit;
};

/// Lists the fields of a result; those of an empty optional or list of results are taken from a default-constructed one.
class FieldNames {
 public:
  explicit FieldNames(std::string prefix = {}) : prefix_(std::move(prefix)) {}

  template <class T>
  FieldNames& operator()(const char* name, const T& value, const char* meaning = "", const char* unit = "") {
    add(prefix_ + name, value, meaning, unit);
    return *this;
  }
  const std::vector<FieldDescription>& fields() const { return fields_; }

 private:
  template <class T>
  void add(std::string path, const T& value, const char* meaning, const char* unit) {
    if constexpr (Described<T>) {
      fields_.push_back({path, meaning, unit});
      FieldNames inner(path + ".");
      describe(inner, value);
      fields_.insert(fields_.end(), inner.fields_.begin(), inner.fields_.end());
    } else if constexpr (requires { requires Described<typename T::value_type>; }) {
      using Inner = typename T::value_type;
      if constexpr (requires { value.has_value(); }) {
        add(std::move(path), value.value_or(Inner{}), meaning, unit);
      } else {
        add(path + "[]", value.empty() ? Inner{} : value[0], meaning, unit);
      }
    } else {
      fields_.push_back({std::move(path), meaning, unit});
    }
  }

  std::string prefix_;
  std::vector<FieldDescription> fields_;
};

/// The fields of a result type, in order.
template <Described T>
std::vector<FieldDescription> fieldsOf(const T& result = {}) {
  FieldNames names;
  describe(names, result);
  return names.fields();
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
