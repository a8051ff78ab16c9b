// The definition of fusion/init/closed_form.hpp.
#pragma once

#include <fusion/init/detail/closed_form_input.hpp>
#include <fusion/init/detail/closed_form_run.hpp>
#include <fusion/detail/compiled.hpp>
#include <fusion/init/closed_form.hpp>

namespace liestat {

LIESTAT_FUSION_INLINE ClosedFormResult solveClosedForm(const ClosedFormWindow& window,
                                                       const InitialisationOptions& options) {
  ClosedFormResult result;
  result.fault = detail::faultOf(window, options);
  if (result.fault) return result;
  detail::RayTable table = detail::rayTable(window, result);
  if (table.features() == 0) {
    result.fault = FaultKind::no_feature;
    return result;
  }
  detail::ClosedFormRun(table, options, result).run();
  return result;
}

}  // namespace liestat
