#pragma once

#include <fusion/visual_inertial_truth_types.hpp>

#include <algorithm>
#include <cmath>

namespace liestat {

LIESTAT_FUSION_INLINE void InitialisationErrors::add(const InitialisationError& e) {
  constexpr double degrees = 180 / static_cast<double>(EIGEN_PI);
  speed.push_back(e.speed), gravity.push_back(degrees * e.gravity), scale.push_back(100 * std::abs(e.scale));
}

LIESTAT_FUSION_INLINE std::size_t ComparedRecording::okWindows() const {
  return static_cast<std::size_t>(
      std::count_if(windows.begin(), windows.end(), [](const ComparedWindow& w) { return w.ok(); }));
}

LIESTAT_FUSION_INLINE Verdict ComparedRecording::verdict() const {
  const std::string n = std::to_string(windows.size());
  if (windows_left > 0) {
    return Verdict::no("Interrupted: " + n + " of " + std::to_string(windows.size() + windows_left) + " windows.");
  }
  const std::size_t ok = okWindows();
  if (ok == 0) return Verdict::no("Not to be trusted: none of " + n + " windows is ok.");
  // Stretches without a second window have nothing to contradict.
  if (!stretches.empty() &&
      std::none_of(stretches.begin(), stretches.end(), [](const ComparedStretch& f) { return f.ok(); })) {
    return Verdict::no("Not to be trusted: the windows contradict each other in every stretch.");
  }
  return Verdict::yes(std::to_string(ok) + " of " + n + " windows are ok.");
}

LIESTAT_FUSION_INLINE InitialisationSummary ComparedRecording::summary() const {
  InitialisationSummary s;
  for (const ComparedWindow& w : windows) {
    ++s.statuses[name(w.verdict())];
    const FusionStatus status = w.closedForm().status;
    if (status == FusionStatus::scale_unobservable || status == FusionStatus::stationary) continue;
    if (w.closed_form_error) {
      s.closed_form.add(*w.closed_form_error);
      ++s.compared;
      s.compared_not_ok += !w.ok();
    }
    if (w.refined_error) s.refined.add(*w.refined_error);
    if (w.refined_error && w.gyroscope_error) s.gyroscope.push_back(*w.gyroscope_error);
    if (w.nees) s.nees += *w.nees, ++s.with_nees;
    if (w.isRefined()) s.cost += w.refined->cost, s.degrees_of_freedom += w.refined->degrees_of_freedom;
  }
  return s;
}

}  // namespace liestat
