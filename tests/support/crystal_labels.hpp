// The mean of orientations of crystals against brute force over all labels, for each proper point group but 1.
#pragma once

#include <lie/crystal_orientation.hpp>
#include <stats/certified_mean.hpp>
#include <stats/random.hpp>
#include <stats/uniqueness.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace liestat_test {

using namespace liestat;

inline constexpr std::array proper{"2", "222", "3", "32", "4", "422", "6", "622", "23", "432"};

inline PointGroup groupOf(const char* name) { return *PointGroup::fromName(name); }
inline SO3d uniformRotation(CounterRng& rng) { return SO3d::fromParams(rng.unitQuaternion().coeffs()); }

/// The mean of rotations by Newton's method on ½ Σ θ², and its cost.
inline double costOfRotations(const std::vector<SO3d>& rotations) {
  const MeanResult<SO3d> found = mean(rotations);
  return converged(found.status) ? found.cost : std::numeric_limits<double>::infinity();
}

/// The least cost over the labels of all data but the first, |G|^(n-1) means of rotations. A datum's label is right
/// where it is the nearest copy, so the least of all of them is the minimum of the quotient's criterion; labels that
/// cost more than the best by their closest pair alone are passed over.
inline double leastOverLabels(const std::vector<CrystalOrientation>& x) {
  using Traits = ManifoldTraits<CrystalOrientation>;
  const std::size_t n = x.size(), g = Traits::representativesOf(x[0]).size();
  const auto copy = [&](std::size_t i, std::size_t k) {
    return Traits::representative(x[i], Traits::representativesOf(x[i])[k]).rotation();
  };
  double best = std::numeric_limits<double>::infinity();
  std::vector<SO3d> rotations{x[0].rotation()};
  const auto extend = [&](const auto& self) -> void {
    if (rotations.size() == n) {
      best = std::min(best, costOfRotations(rotations));
      return;
    }
    for (std::size_t k = 0; k < g; ++k) {
      rotations.push_back(copy(rotations.size(), k));
      // θ_i² + θ_j² >= d_ij²/2 of any pair.
      double bound = 0;
      for (const SO3d& a : rotations)
        bound = std::max(bound, 0.25 * (a.inverse() * rotations.back()).log().squaredNorm());
      if (bound <= best) self(self);
      rotations.pop_back();
    }
  };
  extend(extend);
  return best;
}

/// Sets of n uniform orientations: the search finds the least cost over all labels, and proves it.
inline void certifiedMeanIsTheLeastOverLabels(std::size_t n, int sets_of_small_groups, int sets_of_large_groups) {
  for (const char* name : proper) {
    const PointGroup group = groupOf(name);
    const int sets = group.order() > 8 ? sets_of_large_groups : sets_of_small_groups;
    int certified = 0;
    for (int set = 0; set < sets; ++set) {
      CounterRng rng(39, static_cast<std::uint64_t>(100000 * group.number() + set));
      std::vector<CrystalOrientation> x;
      for (std::size_t i = 0; i < n; ++i) x.emplace_back(uniformRotation(rng), group);
      const auto result = uniqueness(x, mean(x));
      const double least = leastOverLabels(x);
      EXPECT_NEAR(result.cost, least, 1e-9 * least) << name << " set " << set;
      certified += result.unique == Uniqueness::unique;
      for (const CrystalOrientation& rival : result.rivals) EXPECT_GT(distance(rival, result.minimiser), 1e-4);
    }
    EXPECT_EQ(certified, sets) << name;
  }
}

}  // namespace liestat_test
