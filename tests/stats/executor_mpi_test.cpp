// Run under mpirun with any number of ranks: every rank makes every comparison, and every rank must agree.

#include <lie/so3.hpp>
#include <stats/compat/mpi.hpp>
#include <stats/mean.hpp>

#include <gtest/gtest.h>
#include <mpi.h>

#include <chrono>
#include <cmath>
#include <numeric>
#include <thread>
#include <vector>

#include "executor_test_data.hpp"
#include "front_doors.hpp"
#include "mpi_test_main.hpp"

namespace {

using liestat::MpiExecutor;
using liestat::SerialExecutor;

static_assert(liestat::Executor<MpiExecutor>);

/// Sums with Eigen inside: not trivially copyable, so they travel as doubles.
struct Moments {
  double n = 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();

  std::vector<double> pack() const { return {n, sum[0], sum[1], sum[2]}; }
  static Moments unpack(std::span<const double> v) { return {v[0], Eigen::Vector3d(v[1], v[2], v[3])}; }
};
static_assert(liestat::Packable<Moments>);

TEST(MpiExecutor, givesTheBitsOfTheSerialExecutor) {
  for (std::size_t n : {1u, 2u, 100u, 65537u}) {
    const auto terms = liestat::test::nastyTerms(n);
    for (std::size_t chunk_size : {7u, 64u, 1000u, 100000u}) {
      EXPECT_EQ(liestat::test::sum(MpiExecutor{}, terms, chunk_size),
                liestat::test::sum(SerialExecutor{}, terms, chunk_size))
          << n << " terms in chunks of " << chunk_size;
    }
  }
}

TEST(MpiExecutor, ranksAgreeOnTheSmallestInstructionSet) {
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  const liestat::InstructionSet all = liestat::supportedInstructionSet();
  EXPECT_EQ(MpiExecutor{}.instructionSet(), all);
  // One rank on a machine with less.
  if (rank == 0) liestat::useInstructionSet(liestat::InstructionSet::baseline);
  EXPECT_EQ(MpiExecutor{}.instructionSet(), liestat::InstructionSet::baseline);
  std::vector<liestat::SO3d> rotations;
  for (int i = 0; i < 5000; ++i)
    rotations.push_back(liestat::SO3d::exp({0.3 * std::sin(i), 0.2 * std::cos(3 * i), 0.1}));
  const auto shared = liestat::mean(MpiExecutor{}, rotations);
  liestat::useInstructionSet(liestat::InstructionSet::baseline);
  const auto alone = liestat::mean(rotations);
  EXPECT_EQ(shared.mean.params(), alone.mean.params());
  EXPECT_EQ(shared.scatter, alone.scatter);
  liestat::useInstructionSet(all);
}

TEST(MpiExecutor, combinesInOrderThoughChunksEndOutOfOrder) {
  std::vector<std::size_t> expected(60);
  std::iota(expected.begin(), expected.end(), std::size_t{0});
  const auto order = MpiExecutor{}.reduce(
      60,
      [](std::size_t chunk) {
        std::this_thread::sleep_for(std::chrono::microseconds((chunk * 7919) % 1000));
        return std::vector<std::size_t>{chunk};
      },
      [](std::vector<std::size_t>& a, const std::vector<std::size_t>& b) { a.insert(a.end(), b.begin(), b.end()); });
  EXPECT_EQ(order, expected);
}

TEST(MpiExecutor, sendsEigenMatricesAndPackedTypes) {
  const auto map = [](std::size_t chunk) -> Eigen::Matrix3d {
    return Eigen::Matrix3d::Constant(std::ldexp(1.1, static_cast<int>(chunk % 60)));
  };
  const auto add = [](Eigen::Matrix3d& a, const Eigen::Matrix3d& b) { a += b; };
  EXPECT_EQ(MpiExecutor{}.reduce(100, map, add), SerialExecutor{}.reduce(100, map, add));

  const auto moments = [](std::size_t chunk) {
    return Moments{1, Eigen::Vector3d(0.1, 1e10, -1e-10) * static_cast<double>(chunk)};
  };
  const auto addMoments = [](Moments& a, const Moments& b) {
    a.n += b.n;
    a.sum += b.sum;
  };
  const Moments mpi = MpiExecutor{}.reduce(101, moments, addMoments);
  const Moments serial = SerialExecutor{}.reduce(101, moments, addMoments);
  EXPECT_EQ(mpi.n, serial.n);
  EXPECT_EQ(mpi.sum, serial.sum);
}

TEST(MpiExecutor, takesLongMessages) {
  // 4 MB a chunk, beyond what any MPI sends without waiting for the receiver.
  const auto map = [](std::size_t chunk) { return std::vector<double>(500000, static_cast<double>(chunk)); };
  const auto add = [](std::vector<double>& a, const std::vector<double>& b) {
    for (std::size_t i = 0; i < a.size(); ++i) a[i] += b[i];
  };
  EXPECT_EQ(MpiExecutor{}.reduce(40, map, add), std::vector<double>(500000, 780.0));
}

TEST(MpiExecutor, noChunksGiveTheValueInitialisedResult) {
  EXPECT_EQ(liestat::test::sum(MpiExecutor{}, {}, 10), 0.0);
  EXPECT_TRUE(liestat::test::combinedOrder(MpiExecutor{}, 0).empty());
}

TEST(MpiExecutor, anExceptionAnywhereIsThrownByEveryRank) {
  for (std::size_t bad : {0u, 1u, 2u, 3u, 50u, 99u}) {
    try {
      liestat::test::throwing(MpiExecutor{}, 100, bad);
      ADD_FAILURE() << "no exception for chunk " << bad;
    } catch (const std::runtime_error& error) {
      EXPECT_EQ(error.what(), "chunk " + std::to_string(bad));
    }
    // The executor is usable afterwards: nothing of the failed run is left in the pipes.
    EXPECT_EQ(liestat::test::throwing(MpiExecutor{}, 100, 100), 4950u);
  }
  EXPECT_THROW(MpiExecutor{}.reduce(
                   10, [](std::size_t chunk) { return chunk; },
                   [](std::size_t, std::size_t) -> std::size_t { throw std::runtime_error("combine"); }),
               std::runtime_error);
}

TEST(MpiExecutor, aFailureStopsTheOtherRanks) {
  // Ten seconds of work in all, which a failure in the first chunk makes unnecessary.
  const auto start = std::chrono::steady_clock::now();
  EXPECT_THROW(MpiExecutor{}.reduce(
                   2000,
                   [](std::size_t chunk) {
                     if (chunk == 0) throw std::runtime_error("first");
                     std::this_thread::sleep_for(std::chrono::milliseconds(5));
                     return chunk;
                   },
                   std::plus<>()),
               std::runtime_error);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(2));
}

TEST(MpiExecutor, givesTheBitsOfTheSerialExecutorAtEveryFrontDoor) {
  EXPECT_EQ(liestat::test::firstDifference(liestat::test::frontDoors(MpiExecutor{}),
                                           liestat::test::frontDoors(SerialExecutor{})),
            "");
}

}  // namespace
