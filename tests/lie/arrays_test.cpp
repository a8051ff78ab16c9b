// Arrays of rotations. Motions are in arrays_motions_test.cpp.
#include "support/array_checks.hpp"

namespace liestat::test {

using Rotations = testing::Types<SO3d, SO3f>;
INSTANTIATE_TYPED_TEST_SUITE_P(Rotations, ArrayChecks, Rotations);

template <class S>
void checkLogarithmsOfAnyNorm() {
  constexpr double eps = std::numeric_limits<S>::epsilon();
  std::mt19937_64 engine(3);
  std::normal_distribution<double> gauss;
  std::vector<Eigen::Quaternion<S>> q;
  for (const double norm : {1e-3, 0.5, 0.99, 0.9999, 1 - 1e-6, 1 + 3e-6, 1.001, 1.5, 1e4}) {
    for (int i = 0; i < 9; ++i) {
      const Eigen::Vector4d v = Eigen::Vector4d::NullaryExpr([&] { return gauss(engine); }).normalized();
      q.emplace_back((norm * v).cast<S>());
    }
  }
  q[17].coeffs().setZero();
  std::vector<Eigen::Matrix<S, 3, 1>> v(q.size());
  for (const InstructionSet set : instructionSets()) {
    const InstructionSetGuard guard(set);
    arrays::log<SO3<S>>(q, v);
    for (std::size_t i = 0; i < q.size(); ++i) {
      if (i == 17) {
        EXPECT_TRUE(v[i].array().isNaN().all()) << name(set);
        continue;
      }
      const Eigen::Vector3d exact = SO3d(q[i].template cast<double>()).log();
      EXPECT_LE((v[i].template cast<double>() - exact).norm(), 16 * eps) << q[i].coeffs().transpose() << name(set);
    }
  }
}
TEST(ArrayLogarithms, are_of_quaternions_of_any_norm) {
  checkLogarithmsOfAnyNorm<double>();
  checkLogarithmsOfAnyNorm<float>();
}

}  // namespace liestat::test
