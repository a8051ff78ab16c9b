// Arrays of rotations and rigid motions of the plane.
#include "support/array_checks.hpp"

namespace liestat::test {

using Planar = testing::Types<SO2d, SO2f, SE2d, SE2f>;
INSTANTIATE_TYPED_TEST_SUITE_P(Planar, ArrayChecks, Planar);

template <class S>
void checkPlaneLogarithms() {
  constexpr double eps = std::numeric_limits<S>::epsilon();
  std::vector<Eigen::Matrix<S, 2, 1>> z;
  for (const double norm : {1e-3, 0.5, 0.9999, 1 - 1e-6, 1.0, 1 + 3e-6, 1.5, 1e4}) {
    for (int i = 0; i < 24; ++i) {
      const double angle = std::numbers::pi * i / 12;
      z.push_back((norm * Eigen::Vector2d(std::cos(angle), std::sin(angle))).cast<S>());
    }
    z.emplace_back(S(norm), S(0));
    z.emplace_back(S(-norm), S(0));
    z.emplace_back(S(0), S(norm));
    z.emplace_back(S(0), S(-norm));
  }
  z[17].setZero();
  std::vector<S> theta(z.size());
  for (const InstructionSet set : instructionSets()) {
    const InstructionSetGuard guard(set);
    arrays::log<SO2<S>>(ArrayView<const S>(z[0].data(), z.size(), 2, 1, 2),
                        ArrayView<S>(theta.data(), z.size(), 1, 1, 1));
    for (std::size_t i = 0; i < z.size(); ++i) {
      if (i == 17) {
        EXPECT_TRUE(std::isnan(theta[i])) << name(set);
        continue;
      }
      const double exact = std::atan2(static_cast<double>(z[i][1]), static_cast<double>(z[i][0]));
      EXPECT_LE(std::abs(theta[i] - exact), 12 * eps) << z[i].transpose() << name(set);
    }
  }
}
TEST(PlaneLogarithms, are_of_complex_numbers_of_any_norm) {
  checkPlaneLogarithms<double>();
  checkPlaneLogarithms<float>();
}

}  // namespace liestat::test
