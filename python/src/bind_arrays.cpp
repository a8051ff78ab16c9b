// The operations on arrays for Python: objects that are called with arrays, by type and name.
#include <python/src/array_operations.hpp>
#include <python/src/binding.hpp>
#include <python/src/executor.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

namespace liestat::python {
namespace {

/// Rows in a task of an array call: enough to hide its overhead, few enough to stay in a core's cache between the check
/// for numbers that are not finite and the kernel.
constexpr std::size_t rows_per_chunk = 1024;

/// A row of an operand that is not finite.
struct NotFinite : std::exception {
  std::size_t operand = 0, row = 0;
};

/// The first row of [begin, end) that is not finite.
std::optional<std::size_t> firstNotFinite(const Rows& rows, std::size_t columns, std::size_t begin, std::size_t end) {
  const auto rowOf = [&](std::size_t i) { return rows.data + static_cast<std::ptrdiff_t>(i) * rows.step; };
  if (begin < end && rows.step == 0) end = begin + 1;
  // Zero times a finite number is zero: one test for all of them.
  double sum = 0;
  if (rows.step == static_cast<std::ptrdiff_t>(columns)) {
    const double* p = rowOf(begin);
    const std::size_t n = (end - begin) * columns;
    double lanes[4] = {0, 0, 0, 0};
    std::size_t i = 0;
    for (; i + 4 <= n; i += 4) {
      for (std::size_t j = 0; j < 4; ++j) lanes[j] += 0 * p[i + j];
    }
    for (; i < n; ++i) lanes[0] += 0 * p[i];
    sum = lanes[0] + lanes[1] + lanes[2] + lanes[3];
  } else {
    for (std::size_t i = begin; i < end; ++i) {
      for (std::size_t j = 0; j < columns; ++j) sum += 0 * rowOf(i)[j];
    }
  }
  if (sum == 0) return std::nullopt;
  for (std::size_t i = begin; i < end; ++i) {
    for (std::size_t j = 0; j < columns; ++j) {
      if (!std::isfinite(rowOf(i)[j])) return i;
    }
  }
  return std::nullopt;
}

struct BoundOperation {
  ArrayOperation operation;

  py::array_t<double> call(const py::args& arguments, std::size_t n, int threads) const {
    if (arguments.size() != operation.operands) {
      throw py::type_error(std::string(operation.name) + " takes " + std::to_string(operation.operands) + " arrays");
    }
    std::array<Rows, max_operands> rows;
    std::array<py::array_t<double>, max_operands> alive;
    for (std::size_t i = 0; i < operation.operands; ++i) {
      if (!py::isinstance<py::array_t<double>>(arguments[i])) throw py::type_error("the arrays are of float64");
      alive[i] = py::reinterpret_borrow<py::array_t<double>>(arguments[i]);
      const auto& a = alive[i];
      const auto columns = static_cast<py::ssize_t>(operation.columns[i]);
      constexpr auto number = static_cast<py::ssize_t>(sizeof(double));
      const bool fits =
          a.ndim() == 2 && a.shape(1) == columns && (a.shape(0) == static_cast<py::ssize_t>(n) || a.shape(0) == 1);
      const bool readable = n == 0 || ((columns == 1 || a.strides(1) == number) && a.strides(0) % number == 0 &&
                                       reinterpret_cast<std::uintptr_t>(a.data()) % alignof(double) == 0);
      if (!fits || !readable) throw py::value_error("an array has the wrong layout");
      rows[i] = {a.data(), a.shape(0) == 1 ? 0 : a.strides(0) / number};
    }
    py::array_t<double> result({static_cast<py::ssize_t>(n), static_cast<py::ssize_t>(operation.result)});
    double* const out = result.mutable_data();
    if (n == 0) return result;
    if (n == 1) {  // at once: no thread, no signal
      check(rows, 0, 1);
      operation.kernel(rows, out, 1);
      return result;
    }
    {
      const py::gil_scoped_release released;
      SignalWatch signals;
      const PythonExecutor executor{threads, &signals};
      const std::size_t n_chunks = chunkCount(n, rows_per_chunk);
      executor.reduce(
          n_chunks,
          [&](std::size_t chunk) {
            const ChunkRange range = chunkRange(n, n_chunks, chunk);
            check(rows, range.begin, range.end);
            std::array<Rows, max_operands> part = rows;
            for (Rows& r : part) {
              if (r.data != nullptr) r.data += static_cast<std::ptrdiff_t>(range.begin) * r.step;
            }
            operation.kernel(part, out + range.begin * operation.result, range.size());
            return 0;
          },
          [](int&, const int&) {});
    }
    return result;
  }

 private:
  void check(const std::array<Rows, max_operands>& rows, std::size_t begin, std::size_t end) const {
    for (std::size_t i = 0; i < operation.operands; ++i) {
      if (const auto row = firstNotFinite(rows[i], operation.columns[i], begin, end)) {
        NotFinite error;
        error.operand = i;
        error.row = *row;
        throw error;
      }
    }
  }
};

py::dict operationsOf(const ArrayType& type) {
  py::dict operations;
  for (const ArrayOperation& operation : type.operations) operations[text(operation.name)] = BoundOperation{operation};
  return operations;
}

}  // namespace

void bindArrays(py::module_& module) {
  static py::exception<NotFinite> not_finite(module, "NotFinite", PyExc_ValueError);
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const NotFinite& error) {
      PyErr_SetObject(not_finite.ptr(), py::make_tuple(error.operand, error.row).ptr());
    }
  });

  py::class_<BoundOperation>(module, "ArrayOperation")
      .def("__call__", &BoundOperation::call, py::arg("n"), py::arg("threads") = 1)
      .def_property_readonly("operands",
                             [](const BoundOperation& self) {
                               py::list list;
                               for (std::size_t i = 0; i < self.operation.operands; ++i) {
                                 list.append(py::make_tuple(text(self.operation.names[i]), self.operation.columns[i]));
                               }
                               return py::tuple(list);
                             })
      .def_property_readonly("result", [](const BoundOperation& self) { return self.operation.result; });

  py::dict types;
  for (const ArrayType& type : {rotationOperations(), directionOperations(), pointOperations(), so2Operations(),
                                se2Operations(), se3Operations(), se23Operations(), frameOperations(),
                                semiOrientedFrameOperations(), nonOrientedFrameOperations()}) {
    types[text(type.name)] = py::make_tuple(type.parameters, type.dof, operationsOf(type));
  }
  module.attr("types") = types;
}

}  // namespace liestat::python
