// Described results (report/describe.hpp) as Python's objects: dictionaries of floats, ints, bools, words, arrays, lists and
// dictionaries. None is an empty optional; numbers that are not finite stay what they are.
#pragma once

#include <python/src/binding.hpp>
#include <report/describe.hpp>

#include <Eigen/Core>

#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace liestat::python {

class DictView {
 public:
  template <class T>
  DictView& operator()(const char* name, const T& value, const char* = "", const char* = "") {
    dict[name] = of(value);
    return *this;
  }

  /// A value of describe(); vectors of numbers become arrays.
  template <class T>
  static py::object of(const T& value) {
    if constexpr (Described<T>) {
      DictView view;
      describe(view, value);
      return view.dict;
    } else if constexpr (requires { value.has_value(); }) {
      return value ? of(*value) : py::none();
    } else if constexpr (std::is_convertible_v<T, std::string_view>) {
      return text(value);
    } else if constexpr (std::is_same_v<T, bool>) {
      return py::bool_(value);
    } else if constexpr (std::is_integral_v<T>) {
      return py::int_(value);
    } else if constexpr (std::is_floating_point_v<T>) {
      return py::float_(value);
    } else if constexpr (requires { value.rows(); }) {
      return matrix(value);
    } else if constexpr (requires {
                           requires std::is_arithmetic_v<typename T::value_type>;
                           value.size();
                         }) {
      using Number =
          std::conditional_t<std::is_same_v<typename T::value_type, bool>, bool,
                             std::conditional_t<std::is_integral_v<typename T::value_type>, py::ssize_t, double>>;
      py::array_t<Number> array(static_cast<py::ssize_t>(value.size()));
      Number* out = array.mutable_data();
      for (const auto& element : value) *out++ = static_cast<Number>(element);
      return array;
    } else {
      py::list list;
      for (const auto& element : value) list.append(of(element));
      return list;
    }
  }

  py::dict dict;

 private:
  template <class Derived>
  static py::object matrix(const Eigen::MatrixBase<Derived>& value) {
    const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows = value.template cast<double>();
    std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(rows.rows())};
    if constexpr (Derived::ColsAtCompileTime != 1) shape.push_back(static_cast<py::ssize_t>(rows.cols()));
    DoubleArray array(shape);
    std::copy(rows.data(), rows.data() + rows.size(), array.mutable_data());
    return array;
  }
};

/// The fields of a described result.
template <Described T>
py::dict dictOf(const T& result) {
  DictView view;
  describe(view, result);
  return view.dict;
}

/// The fields of a described result, and its series: one number, vector or matrix for each pose, frame or window.
template <Described T>
py::dict dictWithSeries(const T& result) {
  DictView view;
  describe(view, result);
  describeSeries(view, result);
  return view.dict;
}

}  // namespace liestat::python
