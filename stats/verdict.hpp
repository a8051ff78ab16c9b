// The judgement of a result. It is made once, in the library, beside the result that it judges; programs, pages and
// Python print it. (Needs the standard library alone.)
//
//   liestat::Verdict verdict = evaluation.verdict();
//   if (verdict == liestat::Verdict::Answer::no) std::cerr << verdict.text << '\n';
//
// A verdict is yes, no or none. None is no half of a yes: what was not tested has not passed.
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace liestat {

struct Verdict {
  enum class Answer {
    none,  ///< not tested, or the test says nothing: `text` says why
    no,
    yes
  };

  Answer answer = Answer::none;
  std::string text = {};                 ///< one sentence, which begins with the answer in words
  std::vector<std::string> causes = {};  ///< tests that speak against it, each with its likely cause

  static Verdict yes(std::string text) { return {Answer::yes, std::move(text), {}}; }
  static Verdict no(std::string text, std::vector<std::string> causes = {}) {
    return {Answer::no, std::move(text), std::move(causes)};
  }
  static Verdict none(std::string text, std::vector<std::string> causes = {}) {
    return {Answer::none, std::move(text), std::move(causes)};
  }

  bool isYes() const { return answer == Answer::yes; }
  bool isNo() const { return answer == Answer::no; }
  bool isNone() const { return answer == Answer::none; }
  /// True, false, or nothing where there is no verdict.
  std::optional<bool> decided() const { return isNone() ? std::nullopt : std::optional<bool>(isYes()); }
  friend bool operator==(const Verdict& v, Answer expected) { return v.answer == expected; }
};

/// The answer of several verdicts together: yes if all are yes, no if any is no.
inline Verdict::Answer answerOf(const std::vector<Verdict>& verdicts) {
  const auto any = [&](Verdict::Answer answer) { return std::find(verdicts.begin(), verdicts.end(), answer); };
  if (any(Verdict::Answer::no) != verdicts.end()) return Verdict::Answer::no;
  return verdicts.empty() || any(Verdict::Answer::none) != verdicts.end() ? Verdict::Answer::none
                                                                          : Verdict::Answer::yes;
}

/// The fields of a verdict on covariances; see report/describe.hpp.
template <class V>
void describe(V& v, const Verdict& x) {
  v("verdict", x.text, "the verdict in a sentence")("consistent", x.decided(), "whether; null: no verdict");
  v("causes", x.causes, "tests that speak against it, each with its likely cause");
}

}  // namespace liestat
