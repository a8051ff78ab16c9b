// Options and results of uniqueness() of stats/uniqueness.hpp.
#pragma once

#include <lie/manifold.hpp>

#include <cstddef>
#include <functional>
#include <vector>

namespace liestat {

/// Uniqueness of the criterion's minimum.
enum class Uniqueness {
  unique,        ///< proven: no other feature has as small a cost
  ambiguous,     ///< there are others of equal cost, up to the tolerance
  not_certified  ///< neither was proven within the budget
};

/// The name used in files and messages.
constexpr const char* name(Uniqueness uniqueness) {
  switch (uniqueness) {
    case Uniqueness::unique:
      return "unique";
    case Uniqueness::ambiguous:
      return "ambiguous";
    case Uniqueness::not_certified:
      return "not_certified";
  }
  return "unknown";
}

/// Options of uniqueness().
struct UniquenessOptions {
  /// Search globally where the cheap certificates fail: microseconds for tight data, some seconds at the budget.
  bool branch_and_bound = true;
  /// Limit of the search: looks from a cell at a datum, or at a bin of data where there are thousands, each some 20 to
  /// 40 ns. Ten data are searched by millions of cells, a thousand by tens of thousands.
  std::size_t budget = 100'000'000;
  /// Minima are rivals if their costs differ by less than this, relative (at least 64 eps of the scalar), and they are
  /// 1e-3 rad apart: the search does not resolve nearer ones.
  double tie_tolerance = 1e-9;
  std::size_t max_rivals = 16;  ///< the search stops when it has found so many
  /// Is told from time to time, by the calling thread, which part of the budget is spent.
  std::function<void(double)> progress = {};
  /// Asked again and again, by the calling thread; once it says true, the search ends as if the budget were spent.
  std::function<bool()> stop = {};
};

/// The result of uniqueness().
template <Homogeneous M>
struct UniquenessResult {
  Uniqueness unique = Uniqueness::not_certified;
  /// The best minimum that was found: the given mean, unless `improved`.
  M minimiser = ManifoldTraits<M>::origin();
  bool improved = false;  ///< the given mean is not the minimum: `minimiser` is lower
  ScalarOf<M> cost = 0;   ///< C at the minimiser
  std::vector<M> rivals;  ///< the other minimisers of equal cost that were found
  /// r*, the radius about the minimiser in which the criterion is convex and has no other minimum, rad (localRadius());
  /// for directions in a cloud a lower bound of it.
  double r_star = 0;
  std::size_t cells = 0;     ///< cells of the global search; 0: it was not needed
  const char* proof = "";    ///< which certificate holds, in words
  bool more_rivals = false;  ///< ambiguous, and `rivals` are not all: they form a continuum, or the search ended early
};

}  // namespace liestat
