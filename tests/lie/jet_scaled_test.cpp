// The groups with a scale through ceres::Jet: as jet_group_test.cpp, on both sides of where the series ends.

#include <support/jet_group.hpp>

namespace {

using namespace liestat_test;

TEST(JetScaled, RxSO2) { checkGroup<liestat::RxSO2>(0, {0, 1e-9, -0.4, 1.2}); }
TEST(JetScaled, RxSO3) { checkGroup<liestat::RxSO3>(0, {0, 1e-9, -0.4, 1.2}); }
TEST(JetScaled, Sim2) { checkGroup<liestat::Sim2>(2, {0, 1e-9, -0.4, 1.2}); }
TEST(JetScaled, Sim3) { checkGroup<liestat::Sim3>(3, {0, 1e-9, -0.4, 1.2}); }

}  // namespace
