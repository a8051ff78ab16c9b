// States that merge for Python (stats/liestat_state.h): the functions behind liestat.State, on its bytearray.
#include <python/src/binding.hpp>
#include <stats/liestat_state.h>

#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat::python {
namespace {

using Rows = py::array_t<double>;

void require(int code) {
  if (code != LIESTAT_STATE_OK) throw py::value_error(std::string("State: ") + liestat_state_error(code));
}
unsigned char* memoryOf(const py::bytearray& state) {
  return reinterpret_cast<unsigned char*>(PyByteArray_AS_STRING(state.ptr()));
}
std::size_t sizeOf(const unsigned char* state) { return liestat_state_kind_of(state).size; }

py::bytearray readState(const py::bytes& bytes) {
  const std::string text = bytes;
  unsigned char state[LIESTAT_STATE_LARGEST];
  require(liestat_state_read(state, text.data(), text.size()));
  return py::bytearray(reinterpret_cast<const char*>(state), text.size());
}

py::bytearray emptyState(int manifold, int kind, const std::optional<DoubleArray>& reference, double largest_weight,
                         int pass) {
  unsigned char state[LIESTAT_STATE_LARGEST];
  int exponent = 0;
  if (!(largest_weight > 0) || !std::isfinite(largest_weight)) require(LIESTAT_STATE_BAD_WEIGHT);
  if (std::frexp(largest_weight, &exponent) == 0.5) --exponent;
  require(liestat_state_init(state, manifold, kind, reference ? reference->data() : nullptr, exponent, pass));
  return py::bytearray(reinterpret_cast<const char*>(state), sizeOf(state));
}

/// Rows whose numbers lie one behind the other.
void addRows(const py::bytearray& state, const Rows& rows, const std::optional<DoubleArray>& weights) {
  const auto n = static_cast<std::size_t>(rows.shape(0));
  const auto stride = static_cast<std::size_t>(rows.strides(0)) / sizeof(double);
  const unsigned char* const memory = memoryOf(state);
  const double* const data = rows.data();
  const double* const p = weights ? weights->data() : nullptr;
  // To a copy, so that other threads see the state before or after.
  std::vector<unsigned char> own(memory, memory + sizeOf(memory));
  int code = LIESTAT_STATE_OK;
  {
    const py::gil_scoped_release release;
    code = liestat_state_add(own.data(), data, n, stride, p);
  }
  require(code);
  std::copy(own.begin(), own.end(), memoryOf(state));
}

DoubleArray headings(const DoubleArray& degrees) {
  DoubleArray rows({degrees.size(), py::ssize_t{2}});
  for (py::ssize_t i = 0; i < degrees.size(); ++i) liestat_heading(degrees.data()[i], rows.mutable_data() + 2 * i);
  return rows;
}

py::dict finishState(const py::bytearray& state) {
  liestat_mean mean;
  require(liestat_state_finish(memoryOf(state), &mean));
  const py::ssize_t k = liestat_state_kind_of(memoryOf(state)).manifold;
  py::dict result;
  result["mean"] = arrayOf({mean.mean, mean.mean + k + 1}, {k + 1});
  result["covariance"] = arrayOf({mean.covariance, mean.covariance + k * k}, {k, k});
  result["resultant"] = mean.resultant;
  result["step"] = mean.step;
  result["another_pass"] = mean.another_pass != 0;
  result["n"] = mean.n;
  result["left_out"] = mean.left_out;
  result["status"] = mean.status;
  result["reason"] = mean.reason;
  return result;
}

}  // namespace

void bindState(py::module_& module) {
  module.def("state_empty", &emptyState);
  module.def("state_read", &readState);
  module.def("state_add", &addRows);
  module.def("state_merge", [](const py::bytearray& state, const py::bytearray& other) {
    require(liestat_state_merge(memoryOf(state), memoryOf(other)));
  });
  module.def("state_finish", &finishState);
  module.def("state_headings", &headings);
}

}  // namespace liestat::python
