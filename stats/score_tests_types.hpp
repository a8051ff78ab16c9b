// Named suspects: what a model leaves out that may be wrong all the same. The tests are in stats/score_tests.hpp.
// (Needs the standard library alone.)
#pragma once

#include <stats/shown.hpp>
#include <stats/words.hpp>

#include <limits>
#include <string>

namespace liestat {

/// The tests of all suspects together have this probability of a false alarm.
inline constexpr double suspicion_level = 0.006;

/// A quantity that the model takes for known, such as a delay, and what the residuals say about it.
struct SuspectTest {
  std::string name;
  std::string unit;  ///< of `estimate` and `sigma`; empty for a ratio, "1" for another plain number
  /// The deviation that the residuals ask for, with its standard deviation; of a suspect with a prior that by the
  /// residuals alone. NaN where the estimate's own parameters explain all that it would do.
  double estimate = std::numeric_limits<double>::quiet_NaN(), sigma = estimate;
  /// Its deviation from zero in standard deviations, those of the prior included, and the probability of a larger one.
  double z = estimate, p = estimate;
  bool significant = false;  ///< p is below its part of `suspicion_level`
  /// Not to be told apart from the strongest suspect, which is significant.
  bool in_group = false;

  bool tested() const { return z == z; }
  /// By how much it is off, with the standard deviation, in words.
  std::string inWords() const {
    const bool time = unit == "s", ratio = unit.empty();
    const double scale = time ? 1e3 : ratio ? 100 : 1;
    return name + " off by " + liestat::significant(scale * estimate, 3) + " +- " +
           liestat::significant(scale * sigma, 2) +
           (time    ? " ms"
            : ratio ? " %"
                    : "");
  }
};

/// The suspects that cannot be told from the strongest, joined by "or"; empty where none is significant.
template <class Suspects>
std::string suspectsInWords(const Suspects& suspects) {
  std::string group;
  for (const auto& x : suspects) {
    if (x.in_group) group += (group.empty() ? "" : " or ") + x.inWords();
  }
  return group;
}

template <class V>
void describe(V& v, const SuspectTest& x) {
  v("name", x.name)("unit", x.unit, "of the estimate; empty: a ratio");
  v("estimate", x.estimate, "that the residuals ask for; null: the parameters explain all that it would do");
  v("standard_deviation", x.sigma, "of the estimate")("z", x.z, "deviation from zero in standard deviations");
  v("p", x.p, "probability of a larger |z|")("significant", x.significant, "whether");
  v("in_group", x.in_group, "of the suspects that can't be told from the strongest");
}

}  // namespace liestat
