// Iterations of the means of rotations, started at the first measurement and stopped at 1e-10: the table of 2000
// to 4000 samples a cell that a correct implementation shows, within half an iteration.

#include <lie/so3.hpp>
#include <stats/maha.hpp>
#include <stats/mean.hpp>
#include <stats/printed.hpp>
#include <stats/sampling.hpp>

#include <gtest/gtest.h>

#include <vector>

#include "paper/full_run.hpp"

namespace liestat {
namespace {

enum class Noise { iid, isd, idd };

struct Row {
  Noise noise;
  std::size_t n;
  double fixed_point, newton, maha;
};

class Iterations : public testing::TestWithParam<Row> {};

TEST_P(Iterations, agreeWithTheTable) {
  const Row& row = GetParam();
  const Eigen::Vector3d variance(0.09, 0.36, 0.81);
  double fixed_point = 0, newton = 0, gauss_newton = 0, exact_newton = 0;
  const std::size_t trials = trialsOf(2000, 8);
  for (std::size_t t = 0; t < trials; ++t) {
    CounterRng rng(2718, t);
    const SO3d exact = sampleInCube<SO3d>(rng);
    std::vector<SO3d> x;
    std::vector<Gaussian<SO3d>> g;
    for (std::size_t i = 0; i < row.n; ++i) {
      Eigen::Vector3d v = variance;
      if (row.noise == Noise::isd) v /= static_cast<double>(i + 1);
      if (row.noise == Noise::idd) v = v.cwiseProduct(Eigen::Vector3d(rng.uniform(), rng.uniform(), rng.uniform()));
      const Eigen::Matrix3d V = v.asDiagonal();
      x.push_back(sample(Gaussian<SO3d>{exact, V}, rng));
      g.push_back({x.back(), V});
    }
    MeanOptions<SO3d> options{.method = MeanMethod::fixed_point, .tolerance = 1e-10, .start = x[0]};
    fixed_point += mean(x, options).iterations;
    options.method = MeanMethod::newton;
    newton += mean(x, options).iterations;
    MahaOptions<SO3d> maha_options{.method = MahaMethod::gauss_newton, .tolerance = 1e-10, .start = x[0]};
    gauss_newton += maha(g, maha_options).iterations;
    maha_options.method = MahaMethod::newton;
    exact_newton += maha(g, maha_options).iterations;
  }
  const double count = static_cast<double>(trials);
  EXPECT_NEAR(fixed_point / count, row.fixed_point, 0.5);
  EXPECT_NEAR(newton / count, row.newton, 0.5);
  EXPECT_NEAR(gauss_newton / count, row.maha, 0.5);
  // The exact Hessian of MAHA is what the library takes by default: quadratic as LSQ's.
  EXPECT_LT(exact_newton / count, row.newton + 1.5);
}

INSTANTIATE_TEST_SUITE_P(rotations, Iterations,
                         testing::Values(Row{Noise::iid, 10, 10.5, 4.0, 13.1}, Row{Noise::iid, 30, 10.8, 4.0, 13.3},
                                         Row{Noise::iid, 100, 10.9, 4.0, 13.4}, Row{Noise::isd, 10, 7.2, 3.5, 8.4},
                                         Row{Noise::isd, 30, 6.3, 3.3, 6.9}, Row{Noise::isd, 100, 5.6, 3.1, 5.9},
                                         Row{Noise::idd, 10, 8.3, 3.5, 8.7}, Row{Noise::idd, 30, 8.4, 3.5, 8.2},
                                         Row{Noise::idd, 100, 8.5, 3.5, 7.7}));

}  // namespace
}  // namespace liestat
