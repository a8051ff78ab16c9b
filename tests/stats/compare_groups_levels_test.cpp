// The level of comparisons of groups from 10⁴ trials a cell, as docs/comparing_groups.md has them, and the power on points.
#include <lie/frame3.hpp>
#include <lie/rn.hpp>
#include <lie/s2.hpp>
#include <lie/so2.hpp>
#include <lie/so3.hpp>
#include <stats/compare_groups.hpp>
#include <stats/random.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <vector>

using namespace liestat;

namespace {

/// Groups of normal features: their standard deviations along each axis, and sizes in multiples of max(10, 4 d).
struct Cell {
  const char* name;
  std::vector<double> deviations;
  std::vector<std::size_t> sizes;
  double away = 0;  ///< of the last group's mean, standard deviations of the first one's mean
};

int trialsOf() {
  const char* const given = std::getenv("LIESTAT_TRIALS");
  return given == nullptr ? 10000 : std::atoi(given);
}

template <class M>
void judge(const Cell& cell, std::uint32_t stream, double low = 0.04, double high = 0.06) {
  constexpr int d = ManifoldTraits<M>::DoF;
  constexpr std::size_t least = std::max(10, 4 * d);
  const int trials = trialsOf();
  const bool alike =
      std::all_of(cell.deviations.begin(), cell.deviations.end(), [&](double s) { return s == cell.deviations[0]; });
  ComparisonOptions options;
  options.resamples = 199;
  int means = 0, if_alike = 0, dispersions = 0, compared = 0;
  for (int trial = 0; trial < trials; ++trial) {
    options.seed = static_cast<std::uint64_t>(trial) + 1;  // one seed's 199 draws would have one error in all trials
    CounterRng rng(options.seed, 1, stream);
    std::vector<std::vector<M>> groups(cell.deviations.size());
    for (std::size_t g = 0; g < groups.size(); ++g) {
      M centre = ManifoldTraits<M>::origin();
      if (g + 1 == groups.size() && cell.away > 0) {
        centre = exp(centre,
                     TangentOf<M>(cell.away * cell.deviations[0] / std::sqrt(double(least)) * TangentOf<M>::Unit(0)));
      }
      for (std::size_t i = 0; i < cell.sizes[g] * least; ++i) {
        groups[g].push_back(exp(centre, TangentOf<M>(cell.deviations[g] * rng.normalVector<d>())));
      }
    }
    const GroupComparison found = compareGroups(groups, options);
    if (!found.ok()) continue;
    ++compared;
    means += found.means.p <= 0.05 ? 1 : 0, if_alike += found.means_if_alike.p < 0.05 ? 1 : 0;
    dispersions += found.dispersions.p <= 0.05 ? 1 : 0;
  }
  const auto rate = [&](int count) { return static_cast<double>(count) / compared; };
  std::printf("| %s | %zu | %.2f | %.2f | %.2f |\n", cell.name, least, 100 * rate(means), 100 * rate(if_alike),
              100 * rate(dispersions));
  std::fflush(stdout);
  EXPECT_GE(compared, 0.99 * trials) << cell.name;
  EXPECT_GE(rate(means), low) << cell.name;
  EXPECT_LE(rate(means), high) << cell.name;
  if (!alike || cell.away > 0) {
    if (cell.away > 0) {
      EXPECT_NEAR(rate(means), rate(if_alike), 0.02) << "power is not Hotelling's: " << cell.name;
    }
    return;
  }
  EXPECT_GE(rate(if_alike), low) << cell.name;
  EXPECT_LE(rate(if_alike), high) << cell.name;
  EXPECT_GE(rate(dispersions), low) << cell.name;
  EXPECT_LE(rate(dispersions), high) << cell.name;
}

TEST(CompareGroupsLevels, oneMean) {
  using Vector3 = Eigen::Vector3d;
  judge<Vector3>({"points, two groups", {1, 1}, {1, 1}}, 1);
  judge<SO2d>({"headings, 0.5 rad", {0.5, 0.5}, {1, 1}}, 2);
  judge<S2d>({"directions, 0.3 rad", {0.3, 0.3}, {1, 1}}, 3);
  judge<S2d>({"directions, 0.3 and 0.1 rad", {0.3, 0.1}, {1, 1}}, 4);
  judge<S2d>({"directions, 0.3 and 0.1 rad, the second thrice as many", {0.3, 0.1}, {1, 3}}, 5);
  judge<SO3d>({"rotations, 0.3 rad", {0.3, 0.3}, {1, 1}}, 6);
  judge<SO3d>({"rotations, 0.6 rad", {0.6, 0.6}, {1, 1}}, 7);
  judge<SO3d>({"rotations, 0.3 and 0.1 rad, the second thrice as many", {0.3, 0.1}, {1, 3}}, 8);
  judge<Frame3d>({"frames, 0.2 rad and m", {0.2, 0.2}, {1, 1}}, 9);
  judge<Frame3d>({"frames, 0.3 and 0.1 rad and m", {0.3, 0.1}, {1, 1}}, 10);
  judge<S2d>({"directions, three groups", {0.3, 0.3, 0.3}, {1, 1, 1}}, 11);
  judge<SO3d>({"rotations, three groups", {0.3, 0.3, 0.3}, {1, 1, 1}}, 12);
  judge<SO3d>({"rotations, three groups, 0.3, 0.1 and 0.1 rad", {0.3, 0.1, 0.1}, {1, 1, 1}}, 13);
  judge<SO3d>({"rotations, five groups", {0.3, 0.3, 0.3, 0.3, 0.3}, {1, 1, 1, 1, 1}}, 14);
}

TEST(CompareGroupsLevels, powerOnPoints) {
  judge<Eigen::Vector3d>({"points, the second mean 4 standard errors away", {1, 1}, {1, 1}, 4}, 15, 0, 1);
}

}  // namespace
