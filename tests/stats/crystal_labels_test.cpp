// A thousand sets of three and of four orientations for each point group against brute force over all labels; seeds are
// fixed. stats/crystal_mean_test does so with a few.

#include <support/crystal_labels.hpp>

#include <gtest/gtest.h>

namespace {

using liestat_test::certifiedMeanIsTheLeastOverLabels;

TEST(CrystalLabels, aThousandSetsOfThree) { certifiedMeanIsTheLeastOverLabels(3, 1000, 1000); }
TEST(CrystalLabels, aThousandSetsOfFour) { certifiedMeanIsTheLeastOverLabels(4, 1000, 1000); }

}  // namespace
