// Shared by the units of the extension module. Arrays arrive as the package's Python side prepares them: float64, aligned,
// rows contiguous in their last axis; it also words the messages, since it alone knows the caller's names and shapes.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace liestat::python {

namespace py = pybind11;

using DoubleArray = py::array_t<double, py::array::c_style>;

/// The numbers of a contiguous array of float64.
inline std::span<const double> numbers(const DoubleArray& array) {
  return {array.data(), static_cast<std::size_t>(array.size())};
}

/// A new array that owns a copy of numbers.
inline DoubleArray arrayOf(const std::vector<double>& values, std::vector<py::ssize_t> shape) {
  DoubleArray array(std::move(shape));
  std::copy(values.begin(), values.end(), array.mutable_data());
  return array;
}

inline py::str text(std::string_view words) { return py::str(words.data(), words.size()); }

void bindArrays(py::module_& module);
void bindLaws(py::module_& module);
void bindSampling(py::module_& module);
void bindValidation(py::module_& module);
void bindPreintegration(py::module_& module);
void bindHandEye(py::module_& module);
void bindMotion(py::module_& module);
void bindFits(py::module_& module);
void bindComparisons(py::module_& module);
void bindTwoView(py::module_& module);
void bindViInit(py::module_& module);
void bindReaders(py::module_& module);
void bindTrajectories(py::module_& module);
void bindConversions(py::module_& module);
void bindTrajectoryFiles(py::module_& module);
void bindMeans(py::module_& module);

}  // namespace liestat::python
