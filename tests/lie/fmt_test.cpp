// Formatting of owned values and of views.

#include <lie/compat/fmt.hpp>
#include <lie/lie.hpp>

#include <gtest/gtest.h>

#include <sstream>

namespace {

using namespace liestat;

TEST(Fmt, AFormatAppliesToEachNumber) {
  const SE3d x(SO3d(), Eigen::Vector3d(1, -2.5, 1.0 / 3));
  EXPECT_EQ(fmt::format("{:.2f}", x), "0.00 0.00 0.00 1.00 1.00 -2.50 0.33");
  EXPECT_EQ(fmt::format("<{}>", SO2d()), "<1 0>");
  EXPECT_EQ(fmt::format("{:5.1f}", S2f()), "  0.0   0.0   1.0");
  EXPECT_EQ(fmt::format("{:.1f}", Eigen::Map<const SO3d>(x.data())), "0.0 0.0 0.0 1.0");
  EXPECT_EQ(fmt::format("{:.0e}", NonOrientedFrame3d(x)), "0e+00 0e+00 0e+00 1e+00 1e+00 -2e+00 3e-01");
  EXPECT_THROW(static_cast<void>(fmt::format(fmt::runtime("{:s}"), x)), fmt::format_error);
}

TEST(Fmt, TheStreamsOperatorPrintsTheSameNumbers) {
  const Sim2d x(Eigen::Vector2d(1, 2), Eigen::Vector2d(3, 4));
  std::ostringstream text;
  text << x;
  EXPECT_EQ(text.str(), fmt::format("{}", x));
}

}  // namespace
