// Options and report of the contract's checkers (lie/testing.hpp), without a test framework.
#pragma once

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <ostream>
#include <sstream>
#include <string>
#include <vector>

namespace liestat {

/// How much checkContract tries.
struct ContractOptions {
  std::uint64_t seed = 1;  ///< another seed tries other inputs
  int samples = 5;         ///< directions tried for each angle
  /// Typical size of the coordinates that are no angles; 0, 1e-3 and 10 times as much are tried too.
  double length = 1;
};

/// A named input of a check: a tangent vector, from which points and transformations were made.
struct ContractInput {
  const char* name;
  Eigen::VectorXd value;
};

/// One invariant: of all inputs tried, the one that came nearest to its tolerance or exceeded it most.
struct ContractCheck {
  std::string invariant;
  double error = 0;      ///< error of the worst input; NaN where a result was not finite
  double tolerance = 0;  ///< tolerance for that input
  std::string input;     ///< the worst input
  int cases = 0;         ///< how many inputs were tried
  bool ok() const { return error <= tolerance; }
};

/// The results of the checkers.
class ContractReport {
 public:
  const std::vector<ContractCheck>& checks() const { return checks_; }
  /// True if something was checked and every check holds.
  bool ok() const {
    return !checks_.empty() &&
           std::all_of(checks_.begin(), checks_.end(), [](const ContractCheck& c) { return c.ok(); });
  }
  /// Adds the outcome of one input to the check of that name.
  void record(const char* invariant, double error, double tolerance, std::initializer_list<ContractInput> inputs) {
    auto check =
        std::find_if(checks_.begin(), checks_.end(), [&](const ContractCheck& c) { return c.invariant == invariant; });
    const bool first = check == checks_.end();
    if (first) check = checks_.insert(check, ContractCheck{invariant, 0, 0, "", 0});
    ++check->cases;
    if (std::isnan(check->error)) return;
    // Written so that NaN is worse than everything.
    if (!first && error * check->tolerance <= check->error * tolerance) return;
    check->error = error;
    check->tolerance = tolerance;
    std::ostringstream text;
    text.precision(17);
    for (const ContractInput& i : inputs) {
      if (text.tellp() > 0) text << ", ";
      text << i.name << " = (";
      for (Eigen::Index k = 0; k < i.value.size(); ++k) text << (k > 0 ? " " : "") << i.value[k];
      text << ")";
    }
    check->input = text.str();
  }

 private:
  std::vector<ContractCheck> checks_;
};

/// One line an invariant; those that failed with their input.
inline std::ostream& operator<<(std::ostream& os, const ContractReport& report) {
  for (const ContractCheck& c : report.checks()) {
    os << (c.ok() ? "ok    " : "FAILS ") << c.invariant << ": error " << c.error << " of " << c.tolerance
       << " allowed, " << c.cases << " cases";
    if (!c.ok()) os << ", at " << c.input;
    os << "\n";
  }
  return os;
}

}  // namespace liestat
