// The computations of the two units of tests/lie/mixed_flags_test.cpp, over plain numbers: one is compiled for plain
// x86-64, the other with -march=native.
#pragma once

#include <vector>

namespace liestat::test {

/// exp, log, product and inverse Jacobian of arrays of SE3 and SO3, and the mean of the rotations with its covariance,
/// from n tangent vectors of six numbers: all results one behind the other.
struct PlainUnit {
  static std::vector<double> results(const std::vector<double>& tangents);
  static bool compiledForAvx();
};
struct NativeUnit {
  static std::vector<double> results(const std::vector<double>& tangents);
  static bool compiledForAvx();
};

}  // namespace liestat::test
