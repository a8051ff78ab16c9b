// Distances of uniform random orientations from the origin against their known means (docs/theory/means.md, section
// 1.5): a density on each quotient that every half-turn of the group shapes.

#include <lie/frame3.hpp>
#include <lie/non_oriented_frame3.hpp>
#include <lie/semi_oriented_frame3.hpp>

#include <stats/random.hpp>

#include <gtest/gtest.h>

#include <cmath>

namespace {

/// Mean and standard error.
struct Moment {
  double sum = 0, squares = 0;
  int n = 0;
  void add(double x) { sum += x, squares += x * x, ++n; }
  double mean() const { return sum / n; }
  double standardError() const { return std::sqrt((squares / n - mean() * mean()) / n); }
};

// 200000 draws at a fixed seed, bound of 5 standard errors of the draws and of the reference: a false alarm in each of
// the six comparisons once in 1.7 million seeds.
template <class M>
void compare(double mean, double mean_se, double square, double square_se) {
  Moment angle, angle2;
  for (std::uint64_t trial = 0; trial < 200000; ++trial) {
    liestat::CounterRng rng(2, trial);
    const M x(rng.unitQuaternion(), Eigen::Vector3d::Zero());
    const double d = liestat::distance(M(), x);
    angle.add(d);
    angle2.add(d * d);
  }
  EXPECT_NEAR(angle.mean(), mean, 5 * std::hypot(angle.standardError(), mean_se));
  EXPECT_NEAR(angle2.mean(), square, 5 * std::hypot(angle2.standardError(), square_se));
}

TEST(UniformOrientations, Rotations) {
  compare<liestat::Frame3d>(EIGEN_PI / 2 + 2 / EIGEN_PI, 0, EIGEN_PI * EIGEN_PI / 3 + 2, 0);
}
TEST(UniformOrientations, SemiOriented) { compare<liestat::SemiOrientedFrame3d>(1.7854, 0.0002, 3.5349, 0.0006); }
TEST(UniformOrientations, NonOriented) { compare<liestat::NonOrientedFrame3d>(1.3117, 0.0001, 1.8531, 0.0002); }

}  // namespace
