#pragma once

#include <fusion/imu/recording_windows_types.hpp>
#include <fusion/status.hpp>
#include <stats/laws.hpp>
#include <stats/words.hpp>

#include <algorithm>
#include <cmath>
#include <string>

namespace liestat {

LIESTAT_FUSION_INLINE const char* RecordingWindow::status() const {
  switch (result.fault.kind) {
    case FaultKind::none:
      return "ok";
    case FaultKind::bad_interval:
      return "bad interval";
    case FaultKind::not_covered:
      return "not covered";
    case FaultKind::not_ascending:
      return "times not ascending";
    case FaultKind::not_finite:
      return "not finite";
    case FaultKind::gap:
      return "gap";
    default:
      return "unknown";
  }
}

LIESTAT_FUSION_INLINE IncrementSigmas incrementSigmas(const Preintegration<double>& motion) {
  const Eigen::Matrix<double, 9, 1> sigma = motion.gaussian().covariance.diagonal().cwiseSqrt();
  return {motion.duration(), sigma.segment<3>(3).maxCoeff(), sigma.tail<3>().maxCoeff(), sigma.head<3>().maxCoeff()};
}

LIESTAT_FUSION_INLINE std::size_t RecordingWindows::okWindows() const {
  return static_cast<std::size_t>(
      std::count_if(windows.begin(), windows.end(), [](const RecordingWindow& w) { return w.ok(); }));
}

LIESTAT_FUSION_INLINE std::optional<IncrementTest> RecordingWindows::test() const {
  IncrementTest test;
  for (const RecordingWindow& w : windows) {
    if (w.squared_distance) test.squared_distance += *w.squared_distance, ++test.windows;
  }
  if (test.windows == 0) return std::nullopt;
  test.degrees_of_freedom = 9 * static_cast<double>(test.windows);
  test.p = chiSquaredSurvival(test.squared_distance, test.degrees_of_freedom);
  return test;
}

namespace detail {

/// The parts of an increment whose errors alone are beyond their covariances, each with what is likely to be off.
inline std::vector<std::string> causesOfErrors(const std::vector<RecordingWindow>& windows, double false_alarm) {
  struct Part {
    const char *name, *cause;
    int first;
  };
  constexpr Part parts[] = {
      {"rotation", "the gyroscope's noise or bias, its axes, or the truth's orientation and clock", 3},
      {"velocity", "the accelerometer's noise or bias, gravity, or the truth's velocity and tilt", 6},
      {"position", "the accelerometer's noise or bias, gravity, or the truth's position and velocity", 0}};
  std::vector<std::string> causes;
  for (const Part& part : parts) {
    double sum = 0, n = 0;
    for (const RecordingWindow& w : windows) {
      if (!w.squared_distance) continue;
      const Eigen::Matrix<double, 9, 9> covariance = w.result.motion.gaussian().covariance;
      sum += mahalanobisSquared<double, 3>(w.error->segment<3>(part.first),
                                           covariance.block<3, 3>(part.first, part.first));
      ++n;
    }
    if (!(chiSquaredSurvival(sum, 3 * n) < false_alarm)) continue;
    causes.push_back(std::string(part.name) + ": squared distance " + significant(sum / n) +
                     " in the mean, 3 expected: " + part.cause);
  }
  // A few windows that are far off: an error of the recording there, not of the noise.
  std::size_t far = 0, n = 0;
  const RecordingWindow* first = nullptr;
  for (const RecordingWindow& w : windows) {
    if (!w.squared_distance) continue;
    ++n;
    if (chiSquaredSurvival(*w.squared_distance, 9) < false_alarm) {
      if (far++ == 0) first = &w;
    }
  }
  if (far > 0 && 10 * far <= n) {
    causes.push_back(std::to_string(far) + " of " + std::to_string(n) + " windows alone, the first from " +
                     significant(first->begin, 9) + " s: readings or truth may be wrong there");
  }
  return causes;
}

}  // namespace detail

LIESTAT_FUSION_INLINE Verdict RecordingWindows::verdict(double false_alarm) const {
  if (okWindows() == 0) return Verdict::none("no verdict: no window has an increment, as the readings have faults");
  if (!with_truth) return Verdict::none("no verdict: there is no truth to compare with");
  if (!with_noise) return Verdict::none("no verdict: the sensor's noise is not known, so there are no covariances");
  const std::optional<IncrementTest> found = test();
  if (!found) return Verdict::none("no verdict: no window with an increment is covered by the truth");
  const std::string figures = "squared distance to the truth " + significant(found->ratio() * 9) +
                              " in the mean, 9 expected (" + std::to_string(found->windows) +
                              (found->windows == 1 ? " window" : " windows") + ", p " + significant(found->p, 2) + ")";
  if (!std::isfinite(found->p)) return Verdict::none("no verdict: a covariance is singular, or an error not finite");
  if (found->p < false_alarm) {
    return Verdict::no("INCONSISTENT with the truth: " + figures, detail::causesOfErrors(windows, false_alarm));
  }
  return Verdict::yes("consistent with the truth: " + figures);
}

LIESTAT_FUSION_INLINE std::vector<std::string> RecordingWindows::notes() const {
  struct Kind {
    ImuSampling sampling;
    const char* text;
  };
  constexpr Kind kinds[] = {
      {ImuSampling::bunched, "bunched: readings come in bunches, and their times may be those of arrival"},
      {ImuSampling::undersampled,
       "undersampled: rate and force vary so much between readings that the integration scheme's error, as it is in "
       "the "
       "covariance, may be off; the cubic scheme or more readings per second help"},
      {ImuSampling::rough,
       "rough: readings differ from their neighbours by more than the stated noise: vibration, wrong times, or "
       "densities "
       "too low"},
      {ImuSampling::untested, "untested: too few readings to see how rate and force vary between them"}};
  std::vector<std::string> notes;
  const std::string of_all = " of " + std::to_string(okWindows()) + " windows ";
  for (const Kind& kind : kinds) {
    const auto n = std::count_if(windows.begin(), windows.end(), [&](const RecordingWindow& w) {
      return w.ok() && w.result.sampling == kind.sampling;
    });
    if (n > 0) notes.push_back(std::to_string(n) + of_all + kind.text);
  }
  double earth = 0;
  for (const RecordingWindow& w : windows) earth = std::max(earth, w.earth_rotation);
  // An error of one standard deviation raises the expected squared distance from 9 to 10.
  if (earth > 1) {
    notes.push_back("the Earth's rotation is worth up to " + significant(earth, 2) +
                    " standard deviations of the noise: state it (world rate)");
  }
  return notes;
}

LIESTAT_FUSION_INLINE Verdict RecordingWindows::outcome() const {
  const std::size_t ok = okWindows(), all = windows.size();
  if (ok == 0) return Verdict::no("NOT TO BE TRUSTED: no window has an increment, as the readings have faults.");
  std::string text = ok < all ? "INCOMPLETE: " + std::to_string(all - ok) + " of " + std::to_string(all) +
                                    " windows have no increment, as the readings have faults."
                     : all == 1 ? "ok: the window has an increment."
                                : "ok: all of the " + std::to_string(all) + " windows have an increment.";
  Verdict result = with_truth ? verdict() : Verdict::yes("");
  if (with_truth) {
    text = result.isNo() ? result.text + "." + (ok < all ? " " + text : "") : text + " " + result.text + ".";
    for (const std::string& cause : result.causes) text += " " + cause + ".";
  }
  return {ok < all ? Verdict::Answer::no : result.answer, text, result.causes};
}

}  // namespace liestat
