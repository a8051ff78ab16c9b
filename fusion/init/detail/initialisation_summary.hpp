#pragma once

#include <fusion/visual_inertial_truth_types.hpp>
#include <lie/units.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/words.hpp>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

namespace liestat {

LIESTAT_FUSION_INLINE void InitialisationErrors::add(const InitialisationError& e) {
  speed.push_back(e.speed), gravity.push_back(e.gravity / units::degree), scale.push_back(100 * std::abs(e.scale));
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
  const std::string text = std::to_string(ok) + " of " + n + " windows are ok";
  const auto none = [&](const auto& property) { return std::none_of(stretches.begin(), stretches.end(), property); };
  if (none([](const ComparedStretch& f) { return f.tested(); })) {
    return Verdict::no("Not tested: " + text +
                       ", but no two of a stretch met, so that nothing could contradict the densities of the inertial "
                       "sensor's noise: a longer recording, shorter windows or a longer stretch is needed.");
  }
  if (none([](const ComparedStretch& f) { return f.ok(); })) {
    return Verdict::no("Not to be trusted: the windows contradict each other in every stretch.");
  }
  const Verdict errors = againstTruth();
  if (errors.isNo()) return Verdict::no("Not to be trusted: " + text + ", but " + errors.text + ".", errors.causes);
  return Verdict::yes(text + ".");
}

LIESTAT_FUSION_INLINE std::vector<std::string> ComparedRecording::notes() const {
  std::vector<std::string> notes;
  if (noiseIsVerified() || okWindows() == 0) return notes;
  std::string note = "unverified_noise: the given densities of the inertial sensor's noise ";
  if (!noise_calibration) {
    note += "were not tested, and the covariances rest on them";
  } else if (noise_calibration->meetings == 0) {
    note += "were not contradicted, because no windows met, and the covariances rest on them";
  } else {
    const std::size_t n = noise_calibration->meetings;
    const bool refuted = noise_calibration->calibrated_chi2 != noise_calibration->chi2;
    note += std::string(refuted ? "are refuted by " : "are not told by ") + std::to_string(n) +
            (n == 1 ? " meeting" : " meetings") + " of windows" +
            (refuted ? ", but not by how much: the covariances rest on the most likely ones"
                     : ", and the covariances rest on them");
  }
  if (noise_calibration && std::isfinite(noise_calibration->common.high)) {
    const NoiseFactor& common = noise_calibration->common;
    note += " (95 %: factors from " + significant(common.low, 2) + " to " + significant(common.high, 2) + ")";
  }
  notes.push_back(note);
  return notes;
}

namespace detail {

/// The mean of these NEES with a part, where it is known.
template <class List, class Part>
InitialisationTest testOf(const List& list, int dof, const Part& part) {
  InitialisationTest test{.expected = dof};
  for (const auto& x : list) {
    if (const std::optional<double> nees = part(x); x.ok() && nees) test.nees += *nees, ++test.n;
  }
  if (test.n > 0) test.nees /= static_cast<double>(test.n);
  test.p = dependentMeanTail(test.nees, static_cast<std::size_t>(dof), test.n);
  return test;
}

inline std::string inWords(const InitialisationTest& t) {
  return "NEES " + significant(t.nees, 3) + (t.n == 1 ? ", " : " in the mean, ") + std::to_string(t.expected) +
         " expected";
}

inline std::string countOf(std::size_t n, const std::string& things) {
  return std::to_string(n) + " " + things + (n == 1 ? "" : things == "stretch" ? "es" : "s");
}

/// The parts whose errors are beyond their covariances, each with what is likely to be off.
inline std::vector<std::string> causesOfErrors(const ComparedRecording& r, double false_alarm) {
  std::vector<std::string> causes;
  const auto add = [&](const char* part, const InitialisationTest& test, const char* cause) {
    if (test.p < false_alarm) causes.push_back(part + inWords(test) + ": " + cause);
  };
  add("velocity of windows: ", testOf(r.windows, 3, [](const ComparedWindow& w) { return w.velocity_nees; }),
      "the sensor's noise in motion, the camera's calibration or clock, or the truth's velocity");
  add("gravity of windows: ", testOf(r.windows, 2, [](const ComparedWindow& w) { return w.gravity_nees; }),
      "the accelerometer's bias and its prior, or the truth's orientation");
  add("states of stretches: ", r.stretchTest(),
      "the sensor's noise in motion, the biases' walks, or the truth's biases");
  // A few windows that are far off: an error of the recording there, not of the noise.
  std::size_t far = 0;
  const std::size_t n = r.windowTest().n;
  const ComparedWindow* first = nullptr;
  for (const ComparedWindow& w : r.windows) {
    if (w.ok() && w.nees && chiSquaredTail(*w.nees, 5) < false_alarm && far++ == 0) first = &w;
  }
  if (far > 0 && 10 * far <= n) {
    causes.push_back(std::to_string(far) + " of " + std::to_string(n) + " windows alone, the first from " +
                     significant(first->begin, 9) + " s: readings, tracks or truth may be wrong there");
  }
  return causes;
}

}  // namespace detail

LIESTAT_FUSION_INLINE InitialisationTest ComparedRecording::windowTest() const {
  return detail::testOf(windows, 5, [](const ComparedWindow& w) { return w.nees; });
}
LIESTAT_FUSION_INLINE InitialisationTest ComparedRecording::stretchTest() const {
  return detail::testOf(stretches, 11, [](const ComparedStretch& f) { return f.nees; });
}

LIESTAT_FUSION_INLINE Verdict ComparedRecording::againstTruth(double false_alarm) const {
  const InitialisationTest of_windows = windowTest(), of_stretches = stretchTest();
  if (of_windows.n + of_stretches.n == 0) {
    return Verdict::none("no verdict: no window that is ok is covered by the truth");
  }
  const bool windows_fit = !(of_windows.p < false_alarm), stretches_fit = !(of_stretches.p < false_alarm);
  std::string text;
  for (const auto& [test, thing] : {std::pair(&of_windows, "window"), std::pair(&of_stretches, "stretch")}) {
    if (test->n == 0) continue;
    text += (text.empty() ? "" : "; ") + detail::countOf(test->n, thing) + ": " + detail::inWords(*test) + " (p " +
            significant(test->p, 2) + ")";
  }
  if (!std::isfinite(of_windows.nees + of_stretches.nees)) {
    return Verdict::none("no verdict: a covariance is singular, or an error not finite");
  }
  if (windows_fit && stretches_fit) return Verdict::yes("consistent with the truth: " + text);
  return Verdict::no("INCONSISTENT with the truth: " + text, detail::causesOfErrors(*this, false_alarm));
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
