// The extension module liestat._core.
#include <python/src/binding.hpp>
#include <python/src/executor.hpp>

namespace liestat::python {

void bindState(py::module_& module);

void raisePendingSignal() {
  const py::gil_scoped_acquire gil;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

}  // namespace liestat::python

PYBIND11_MODULE(_core, module) {
  module.attr("__version__") = LIESTAT_VERSION;
#ifdef LIESTAT_WITH_TBB
  module.attr("has_threads") = true;
#else
  module.attr("has_threads") = false;
#endif
  liestat::python::bindArrays(module);
  liestat::python::bindMeans(module);
  liestat::python::bindLaws(module);
  liestat::python::bindState(module);
  liestat::python::bindSampling(module);
  liestat::python::bindValidation(module);
  liestat::python::bindPreintegration(module);
  liestat::python::bindHandEye(module);
  liestat::python::bindMotion(module);
  liestat::python::bindTrajectories(module);
  liestat::python::bindConversions(module);
  liestat::python::bindFits(module);
  liestat::python::bindComparisons(module);
  liestat::python::bindTwoView(module);
  liestat::python::bindViInit(module);
#ifdef LIESTAT_PYTHON_READERS
  liestat::python::bindReaders(module);
  liestat::python::bindTrajectoryFiles(module);
#endif
}
