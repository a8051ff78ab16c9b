// Files whose fault or convention is in no list: the diagnosis may not name it. The generators of covariance_faults.hpp
// know nothing of the diagnosis; those with an even number tuned it, these here judge it. docs/doctor.md has the
// figures.

#include "covariance_faults.hpp"

#include <experiments/trajectory_scene.hpp>
#include <fusion/convention_diagnosis.hpp>
#include <stats/convention_presets.hpp>

#include <gtest/gtest.h>

#include <cstdio>
#include <string>
#include <vector>

namespace liestat {
namespace {

faults::Poses runOf(std::size_t n, CounterRng& rng) {
  const auto scene = experiments::independentScene({.n = n}, rng);
  faults::Poses poses;
  for (std::size_t i = 0; i < n; ++i) {
    poses.push_back({scene.estimate[i].mean, scene.estimate[i].covariance, scene.truth[i]});
  }
  return poses;
}

bool isNamed(const ConventionDiagnosis& d) {
  return d.verdict == DiagnosisVerdict::inconsistent && d.reason.find("unknown") == std::string::npos;
}

class ClosedList : public testing::TestWithParam<std::size_t> {};

TEST_P(ClosedList, NamesAreRightAndForeignConventionsAreNotIdentified) {
  const std::size_t n = GetParam();
  const std::vector<faults::Fault> all = faults::all();
  ASSERT_GE(all.size(), 100u);
  int runs = 0, flagged = 0, named = 0, right = 0, foreign = 0, identified = 0, conventions = 0, told = 0;
  for (std::size_t k = 1; k < all.size(); k += 2) {
    const faults::Fault& fault = all[k];
    for (std::uint64_t trial = 0; trial < 2; ++trial) {
      CounterRng rng(4711, trial, static_cast<std::uint32_t>(k));
      faults::Poses poses = runOf(n, rng);
      fault.plant(poses, rng);
      const ConventionDiagnosis d = diagnoseConventions(poses);
      const bool is_identified = d.verdict == DiagnosisVerdict::identified;
      if (!fault.convention.empty()) {
        Convention c = *parseConvention(fault.convention);
        if (c.perturbation == Perturbation::body_axes) c.perturbation = Perturbation::right;
        c.layout = Convention{}.layout;
        ++conventions, told += is_identified && d.accepted.front() == c;
        EXPECT_TRUE(!is_identified || d.accepted.front() == c) << fault.what << ": " << d.reason;
        continue;
      }
      ++runs, flagged += !is_identified && d.verdict != DiagnosisVerdict::undecidable;
      if (isNamed(d)) {
        const bool is_right = !fault.name.empty() && d.reason.find(fault.name) != std::string::npos;
        ++named, right += is_right;
        if (!is_right) std::printf("  %s: %s\n", fault.what.c_str(), d.reason.c_str());
      }
      foreign += fault.foreign, identified += fault.foreign && is_identified;
      if (fault.foreign && is_identified) std::printf("  %s: %s\n", fault.what.c_str(), d.reason.c_str());
    }
  }
  std::printf(
      "n = %zu: flagged %d of %d, named %d, of them right %d; foreign conventions identified %d of %d; conventions of "
      "the list told %d of %d\n",
      n, flagged, runs, named, right, identified, foreign, told, conventions);
  EXPECT_GE(flagged, 0.75 * runs);
  EXPECT_GE(right, 0.9 * named);
  EXPECT_GE(named, 0.1 * runs);
  EXPECT_LE(identified, 1);
  EXPECT_GE(told, 0.85 * conventions);
}
INSTANTIATE_TEST_SUITE_P(Poses, ClosedList, testing::Values(60, 200));

}  // namespace
}  // namespace liestat
