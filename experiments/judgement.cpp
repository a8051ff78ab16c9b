#include <experiments/judgement.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace liestat::experiments {

std::size_t Judgement::judged() const {
  return static_cast<std::size_t>(
      std::count_if(promises.begin(), promises.end(), [](const Promise& p) { return p.passed.has_value(); }));
}
std::size_t Judgement::failed() const {
  return static_cast<std::size_t>(
      std::count_if(promises.begin(), promises.end(), [](const Promise& p) { return !p.passed.value_or(true); }));
}

bool Judgement::passed() const {
  return failed() == 0 && (judged() > 0 || false_alarm == 0) && !trials_of_run.incomplete();
}

std::string Judgement::sentence() const {
  const std::size_t kept = judged() - failed();
  if (trials_of_run.incomplete()) {
    return interruptedSentence(fmt::format(", and {} of {} rows {} pass so far", kept, judged(), where));
  }
  if (false_alarm == 0) return fmt::format("{} of {} promises are kept", kept, judged());
  if (judged() == 0) return fmt::format("no row is {}: nothing was judged", where);
  return fmt::format("{} of {} rows {} pass; false alarms: one in {:g} runs", kept, judged(), where, 1 / false_alarm);
}

Verdict Judgement::verdict() const {
  if (trials_of_run.incomplete()) return Verdict::none("INTERRUPTED: " + sentence());
  if (!passed()) return Verdict::no("FAILED: " + sentence());
  return judged() > 0 ? Verdict::yes("PASSED: " + sentence()) : Verdict::none("nothing was promised: " + sentence());
}

std::string Judgement::failures() const {
  std::string text;
  for (const Promise& p : promises) {
    if (!p.passed.value_or(true) && !p.failure.empty()) text += fmt::format("FAILED {}: {}\n", p.text, p.failure);
  }
  return text;
}

std::string interruptedSentence(const std::string& so_far) {
  return fmt::format("partial: {} of {} trials were done{}", trials_of_run.done.load(), trials_of_run.planned.load(),
                     so_far);
}

}  // namespace liestat::experiments
