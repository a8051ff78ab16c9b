// Random numbers of the library for Python: functions of a counter.
#include <python/src/binding.hpp>
#include <python/src/executor.hpp>
#include <stats/random.hpp>

#include <cstdint>

namespace liestat::python {
namespace {

/// Row i has the first `columns` numbers of CounterRng(seed, first_trial + i, stream), drawn by `draw`.
template <class Draw>
DoubleArray rowsOfNumbers(std::uint64_t seed, std::uint64_t first_trial, std::uint32_t stream, py::ssize_t rows,
                          py::ssize_t columns, Draw draw) {
  DoubleArray result({rows, columns});
  double* out = result.mutable_data();
  const py::gil_scoped_release released;
  SignalWatch signals;
  for (py::ssize_t i = 0; i < rows; ++i) {
    CounterRng rng(seed, first_trial + static_cast<std::uint64_t>(i), stream);
    for (py::ssize_t j = 0; j < columns; ++j) *out++ = draw(rng);
    if (i % 1024 == 0) signals.look();
  }
  return result;
}

}  // namespace

void bindSampling(py::module_& module) {
  module.def("counter_normals",
             [](std::uint64_t seed, std::uint64_t trial, std::uint32_t stream, py::ssize_t rows, py::ssize_t columns) {
               return rowsOfNumbers(seed, trial, stream, rows, columns, [](CounterRng& rng) { return rng.normal(); });
             });
  module.def("counter_uniforms",
             [](std::uint64_t seed, std::uint64_t trial, std::uint32_t stream, py::ssize_t rows, py::ssize_t columns) {
               return rowsOfNumbers(seed, trial, stream, rows, columns, [](CounterRng& rng) { return rng.uniform(); });
             });
}

}  // namespace liestat::python
