// The report of a Monte-Carlo validation for Python, from the distances of its trials.
#include <python/src/binding.hpp>
#include <stats/noise_fit.hpp>
#include <stats/validation.hpp>

namespace liestat::python {
namespace {

py::dict report(const DoubleArray& distances, std::size_t exceptions, int dof, int samples, double false_alarm,
                double index_tolerance, double ks_tolerance, double failure_fraction, double tail) {
  const ReferenceLaw law = samples > 0 ? ReferenceLaw::hotelling(dof, samples) : ReferenceLaw::chiSquared(dof);
  const ValidationReport report = reportOfDistances(numbers(distances), law, exceptions);
  const ValidationTolerance tolerance{
      .index = index_tolerance, .ks = ks_tolerance, .failure_fraction = failure_fraction, .tail = tail};
  const ValidationVerdict verdict = report.verdict(false_alarm, tolerance);
  py::dict d;
  d["trials"] = report.trials;
  d["failures"] = report.failures;
  d["exceptions"] = report.exceptions;
  d["index"] = report.index;
  d["expected_index"] = law.mean();
  d["index_se"] = report.index_se;
  d["index_p_value"] = report.index_p_value;
  d["ks_statistic"] = report.ks_statistic;
  d["ks_p_value"] = report.ks_p_value;
  py::dict coverage;
  for (const Coverage& c : report.coverage) coverage[py::float_(c.level)] = c.observed;
  d["coverage"] = coverage;
  d["verdict"] = text(name(verdict));
  d["reason"] = text(reason(verdict));
  d["passed"] = verdict == ValidationVerdict::passed;
  d["table"] = table(report, false_alarm, tolerance);
  return d;
}

}  // namespace

void bindValidation(py::module_& module) {
  module.def("validation_report", &report);
  module.attr("refutation_level") = refutation_level;
}

}  // namespace liestat::python
