// The promises of a validation and what became of them, as data. The verdict is made here once; terminal, page, JSON
// and exit code show it.
#pragma once

#include <experiments/interruption.hpp>
#include <stats/verdict.hpp>

#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace liestat::experiments {

/// False-alarm probability of a whole run, shared evenly by the rows that are judged.
inline constexpr double run_false_alarm = 1e-5;

/// A promise about a row or about several, and whether it was kept.
struct Promise {
  std::string text;            ///< its subject in words
  std::optional<bool> passed;  ///< absent: shown, not judged
  std::string failure = {};    ///< why it is broken, in words; empty: a table shows it
  /// The number that was measured, and its bound; NaN where the promise is not about one number.
  double value = std::numeric_limits<double>::quiet_NaN(), bound = std::numeric_limits<double>::quiet_NaN();
};

template <class V>
void describe(V& v, const Promise& p) {
  v("promise", p.text)("measured", p.value)("bound", p.bound)("passed", p.passed, "null: not judged");
}

/// The promises of a run of a validation, each judged, and the verdict on all of them.
struct Judgement {
  std::vector<Promise> promises;
  std::string where = {};                ///< the rows that are judged: "in the promised domain"
  double false_alarm = run_false_alarm;  ///< all promises together; 0: they are bounds, not tests

  std::size_t judged() const;
  std::size_t failed() const;
  /// True if no promise is broken. A run of tests that judged nothing has not passed, nor has one that an interrupt
  /// left incomplete.
  bool passed() const;
  /// The last line but one of the terminal: how many promises are kept, and the false alarm.
  std::string sentence() const;
  /// Yes (PASSED), no (FAILED), or none (INTERRUPTED, or nothing was promised): that word, and the sentence.
  Verdict verdict() const;
  /// A line for each promise that is broken.
  std::string failures() const;
};

template <class V>
void describe(V& v, const Judgement& j) {
  if (j.false_alarm > 0) v("false_alarm", j.false_alarm, "probability that a run of right estimators fails");
  v("passed", j.passed());
  describe(v, trials_of_run);
}

/// The sentence on a run that an interrupt left incomplete: how many trials were done, and what they say `so_far`.
std::string interruptedSentence(const std::string& so_far = {});

}  // namespace liestat::experiments
