#include <stats/executor.hpp>

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <numeric>

#include "executor_test_data.hpp"

namespace {

using liestat::chunkCount;
using liestat::ChunkRange;
using liestat::chunkRange;
using liestat::SerialExecutor;

struct NotAnExecutor {};
static_assert(liestat::Executor<SerialExecutor>);
static_assert(!liestat::Executor<NotAnExecutor>);

TEST(Chunks, coverEveryIndexOnceInOrder) {
  for (std::size_t n : {0u, 1u, 2u, 7u, 64u, 1000u}) {
    for (std::size_t n_chunks : {1u, 2u, 3u, 7u, 64u, 1001u}) {
      std::size_t next = 0, smallest = n, largest = 0;
      for (std::size_t chunk = 0; chunk < n_chunks; ++chunk) {
        const ChunkRange range = chunkRange(n, n_chunks, chunk);
        ASSERT_EQ(range.begin, next) << n << " in " << n_chunks;
        next = range.end;
        smallest = std::min(smallest, range.size());
        largest = std::max(largest, range.size());
      }
      EXPECT_EQ(next, n);
      EXPECT_LE(largest - smallest, 1u);
    }
  }
}

TEST(Chunks, countIsTheCeilingAndBoundsTheSize) {
  EXPECT_EQ(chunkCount(0, 10), 0u);
  EXPECT_EQ(chunkCount(1, 10), 1u);
  EXPECT_EQ(chunkCount(10, 10), 1u);
  EXPECT_EQ(chunkCount(11, 10), 2u);
  EXPECT_EQ(chunkCount(5, 0), 5u);
  const std::size_t huge = static_cast<std::size_t>(-1);
  const std::size_t n_chunks = chunkCount(huge, 1000);
  EXPECT_EQ(chunkRange(huge, n_chunks, n_chunks - 1).end, huge);
  EXPECT_LE(chunkRange(huge, n_chunks, 0).size(), 1000u);
}

TEST(Chunks, beyondTheLastAreEmpty) {
  EXPECT_EQ(chunkRange(10, 2, 2), (ChunkRange{10, 10}));
  EXPECT_EQ(chunkRange(10, 0, 0), (ChunkRange{10, 10}));
}

TEST(SerialExecutor, addsInTheOrderOfTheChunks) {
  const auto terms = liestat::test::nastyTerms(10007);
  double expected = 0;
  const std::size_t n_chunks = chunkCount(terms.size(), 100);
  for (std::size_t chunk = 0; chunk < n_chunks; ++chunk) {
    const ChunkRange range = chunkRange(terms.size(), n_chunks, chunk);
    double part = 0;
    for (std::size_t i = range.begin; i < range.end; ++i) part += terms[i];
    expected = chunk == 0 ? part : expected + part;
  }
  EXPECT_EQ(liestat::test::sum(SerialExecutor{}, terms, 100), expected);
  // The data are nasty: another cut gives another sum.
  EXPECT_NE(liestat::test::sum(SerialExecutor{}, terms, 101), expected);
}

TEST(SerialExecutor, combinesInOrder) {
  std::vector<std::size_t> expected(100);
  std::iota(expected.begin(), expected.end(), std::size_t{0});
  EXPECT_EQ(liestat::test::combinedOrder(SerialExecutor{}, 100), expected);
}

TEST(SerialExecutor, noChunksGiveTheValueInitialisedResult) {
  EXPECT_EQ(liestat::test::sum(SerialExecutor{}, {}, 10), 0.0);
  EXPECT_TRUE(liestat::test::combinedOrder(SerialExecutor{}, 0).empty());
}

TEST(SerialExecutor, takesCombinesOfEveryShapeAndTypesThatOnlyMove) {
  const SerialExecutor executor;
  const auto number = [](std::size_t chunk) { return static_cast<int>(chunk); };
  EXPECT_EQ(executor.reduce(5, number, std::plus<>()), 10);
  EXPECT_EQ(executor.reduce(5, number, [](int& a, const int& b) { a += b; }), 10);
  EXPECT_EQ(executor.reduce(5, number, [](int& a, const int& b) -> int& { return a += b; }), 10);
  EXPECT_EQ(executor.reduce(5, number, [](auto a, auto b) { return a + b; }), 10);
  const auto moved = executor.reduce(
      5, [](std::size_t chunk) { return std::make_unique<std::size_t>(chunk); },
      [](std::unique_ptr<std::size_t>& a, const std::unique_ptr<std::size_t>& b) { *a += *b; });
  EXPECT_EQ(*moved, 10u);
}

TEST(SerialExecutor, anExceptionOfMapLeaves) {
  EXPECT_THROW(liestat::test::throwing(SerialExecutor{}, 10, 7), std::runtime_error);
  EXPECT_EQ(liestat::test::throwing(SerialExecutor{}, 10, 10), 45u);
}

}  // namespace
