// Repeated rows: found in data without a grid and beside one, not where values are merely rounded.
#include <stats/random.hpp>
#include <stats/repeated_rows.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

using namespace liestat;
using Eigen::Index;
using Eigen::MatrixXd;

namespace {

MatrixXd normals(Index n, Index d, double grid, std::uint64_t seed) {
  CounterRng rng(seed, 77);
  MatrixXd x(n, d);
  for (double& value : x.reshaped()) value = grid > 0 ? grid * std::round(rng.normal() / grid) : rng.normal();
  return x;
}
bool matters(const MatrixXd& x) {
  return repeatedRows(static_cast<std::size_t>(x.rows()), static_cast<int>(x.cols()),
                      [&](std::size_t i) { return Eigen::VectorXd(x.row(static_cast<Index>(i)).transpose()); })
      .matters;
}

TEST(RepeatedRows, areFoundWhereAllStandTwice) {
  for (const Index n : {10, 100, 3000}) {
    for (const Index d : {1, 3, 6}) {
      for (const double grid : {0.0, 0.01}) {
        const MatrixXd once = normals(n, d, grid, 1);
        MatrixXd twice(2 * n, d);
        twice << once, once;
        EXPECT_FALSE(matters(once)) << n << ", " << d << ", " << grid;
        // Of 6000 numbers on a grid of some 600 chance repeats all.
        if (d > 1 || grid == 0) {
          EXPECT_TRUE(matters(twice)) << n << ", " << d << ", " << grid;
        }
      }
    }
  }
}

TEST(RepeatedRows, areFoundWhereAThirdStandsTwice) {
  for (const Index d : {1, 3}) {
    MatrixXd x = normals(100, d, 0, 2);
    x.topRows(33) = x.bottomRows(33).eval();
    EXPECT_TRUE(matters(x));
    x.topRows(30) = normals(30, d, 0, 3);
    EXPECT_FALSE(matters(x)) << "three of a hundred change nothing";
  }
}

TEST(RepeatedRows, areNotThoseOfAGrid) {
  // Rounded to whole degrees, to a third of a standard deviation, and each row the same.
  int found = 0;
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    for (const double grid : {0.03, 0.3, 1.0}) {
      found += matters(normals(40, 1, grid, seed)) ? 1 : 0;
      found += matters(normals(400, 2, grid, seed)) ? 1 : 0;
      MatrixXd mixed = normals(200, 3, grid, seed);
      mixed.col(0) = normals(200, 1, 0.01, seed + 1000);
      found += matters(mixed) ? 1 : 0;
    }
  }
  EXPECT_LE(found, 2) << "of 108";
  EXPECT_FALSE(matters(MatrixXd::Ones(50, 2)));
}

}  // namespace
