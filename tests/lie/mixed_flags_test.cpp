// A program whose units have different flags: with one instruction set, both compute the same bits.
#include "mixed_flags/operations.hpp"

#include <lie/instruction_set.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <vector>

namespace liestat::test {
namespace {

TEST(MixedFlags, units_compute_the_same_bits) {
  std::mt19937_64 engine(5);
  std::normal_distribution<double> gauss;
  for (const std::size_t n : {5, 1003}) {
    std::vector<double> tangents(6 * n);
    for (double& c : tangents) c = 0.5 * gauss(engine);
    // Beyond the range of the polynomials, too; the mean's rotations stay together.
    tangents[3] += 8 * 3.14159;
    for (const InstructionSet set : {InstructionSet::baseline, InstructionSet::avx2, InstructionSet::avx512}) {
      if (set > supportedInstructionSet()) continue;
      useInstructionSet(set);
      const std::vector<double> plain = PlainUnit::results(tangents), native = NativeUnit::results(tangents);
      ASSERT_EQ(plain.size(), n * (7 + 6 + 7 + 36) + 4 + 9);
      ASSERT_EQ(plain.size(), native.size());
      EXPECT_EQ(std::memcmp(plain.data(), native.data(), plain.size() * sizeof(double)), 0) << name(set) << ' ' << n;
      for (const double x : plain) ASSERT_TRUE(std::isfinite(x));
    }
  }
}

// Else the test above compares a unit with its like.
TEST(MixedFlags, units_have_different_flags) {
  if (PlainUnit::compiledForAvx() || supportedInstructionSet() == InstructionSet::baseline) {
    GTEST_SKIP() << "both units are compiled for one set of instructions";
  }
  EXPECT_TRUE(NativeUnit::compiledForAvx());
}

}  // namespace
}  // namespace liestat::test
