// Promises of certifiedMean on scattered features: of all samples at most 7 % get a 95 % region without the truth, and
// of those that get one, where they are half of all, 93 % have the truth in it. Thinned rows of the table of
// docs/uniqueness.md; the whole one is `liestat validate means --full`. Seeds are fixed.

#include <support/verdicts.hpp>

#include <gtest/gtest.h>

namespace {

using namespace liestat;
using namespace liestat_test;

TEST(ScatteredFeatures, directions) {
  keepsThePromise<S2d>("directions", 0, 10, 600);
  keepsThePromise<S2d>("directions", 0, 30, 300);
  keepsThePromise<S2d>("directions", 0.2, 30, 400);
  keepsThePromise<S2d>("directions", 0.5, 100, 300);
  keepsThePromise<S2d>("directions", 1, 30, 600);
  keepsThePromise<S2d>("directions", 1, 100, 300);
  keepsThePromise<S2d>("directions", 2, 30, 600, 0.95);
  keepsThePromise<S2d>("directions", 4, 10, 2000, 0.95);
  keepsThePromise<S2d>("directions", 20, 10, 1000, 0.95);
}
TEST(ScatteredFeatures, rotations) {
  keepsThePromise<SO3d>("rotations", 0, 10, 600);
  keepsThePromise<SO3d>("rotations", 0.5, 30, 200);
  keepsThePromise<SO3d>("rotations", 1, 100, 80);
  keepsThePromise<SO3d>("rotations", 2, 10, 1000);
  keepsThePromise<SO3d>("rotations", 2, 30, 400);
  keepsThePromise<SO3d>("rotations", 4, 10, 2000, 0.95);
  keepsThePromise<SO3d>("rotations", 20, 10, 1000, 0.95);
}
TEST(ScatteredFeatures, quotientFrames) {
  keepsThePromise<SemiOrientedFrame3d>("semi-oriented", 0, 30, 150);
  keepsThePromise<SemiOrientedFrame3d>("semi-oriented", 2, 10, 400);
  keepsThePromise<SemiOrientedFrame3d>("semi-oriented", 4, 30, 300);
  keepsThePromise<SemiOrientedFrame3d>("semi-oriented", 20, 10, 500, 0.95);
  keepsThePromise<NonOrientedFrame3d>("non-oriented", 0, 30, 150);
  keepsThePromise<NonOrientedFrame3d>("non-oriented", 4, 10, 400);
  keepsThePromise<NonOrientedFrame3d>("non-oriented", 4, 30, 300);
  keepsThePromise<NonOrientedFrame3d>("non-oriented", 20, 10, 500, 0.95);
}
TEST(ScatteredFeatures, circlesAndPlanarFrames) {
  keepsThePromise<SO2d>("circle", 0, 30, 1000);
  keepsThePromise<SO2d>("circle", 0.5, 100, 1000);
  keepsThePromise<SO2d>("circle", 1, 30, 2000);
  keepsThePromise<SO2d>("circle", 4, 10, 2000, 0.95);
  keepsThePromise<Frame2d>("planar frames", 0.5, 30, 1000);
  keepsThePromise<Frame2d>("planar frames", 1, 100, 600);
  keepsThePromise<Frame2d>("planar frames", 4, 10, 1000, 0.95);
}
TEST(ScatteredFeatures, knownNoise) {
  for (const double kappa : {0.5, 2.0}) {
    keepsThePromise<S2d>("directions, known noise", kappa, 30, 400, 0, true);
    keepsThePromise<SO3d>("rotations, known noise", kappa, 10, 400, 0, true);
  }
  keepsThePromise<SO3d>("rotations, known noise", 20, 3, 1000, 0.95, true);
  keepsThePromise<S2d>("directions, known noise", 20, 2, 1000, 0.95, true);
}

}  // namespace
