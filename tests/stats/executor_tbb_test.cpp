#include <stats/compat/tbb.hpp>

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <numeric>
#include <set>
#include <thread>

#include "executor_test_data.hpp"
#include "front_doors.hpp"

namespace {

using liestat::SerialExecutor;
using liestat::TbbExecutor;

static_assert(liestat::Executor<TbbExecutor>);

TEST(TbbExecutor, givesTheBitsOfTheSerialExecutorOnAnyNumberOfThreads) {
  for (std::size_t n : {1u, 2u, 100u, 65537u}) {
    const auto terms = liestat::test::nastyTerms(n);
    for (std::size_t chunk_size : {1u, 64u, 1000u}) {
      const double serial = liestat::test::sum(SerialExecutor{}, terms, chunk_size);
      for (int threads : {0, 1, 2, 8}) {
        EXPECT_EQ(liestat::test::sum(TbbExecutor{threads}, terms, chunk_size), serial)
            << n << " terms in chunks of " << chunk_size << " on " << threads << " threads";
      }
    }
  }
}

TEST(TbbExecutor, combinesInOrderThoughChunksEndOutOfOrder) {
  std::vector<std::size_t> expected(60);
  std::iota(expected.begin(), expected.end(), std::size_t{0});
  for (int threads : {1, 2, 8}) {
    const auto order = TbbExecutor{threads}.reduce(
        60,
        [](std::size_t chunk) {
          std::this_thread::sleep_for(std::chrono::microseconds((chunk * 7919) % 1000));
          return std::vector<std::size_t>{chunk};
        },
        [](std::vector<std::size_t>& a, const std::vector<std::size_t>& b) { a.insert(a.end(), b.begin(), b.end()); });
    EXPECT_EQ(order, expected);
  }
}

TEST(TbbExecutor, usesNoMoreThreadsThanItWasTold) {
  // How many join below that is the scheduler's affair: on a busy machine one may do all the work.
  for (int threads : {1, 2, 4}) {
    std::mutex mutex;
    std::set<std::thread::id> seen;
    TbbExecutor{threads}.reduce(
        200,
        [&](std::size_t) {
          std::this_thread::sleep_for(std::chrono::milliseconds(1));
          const std::scoped_lock lock(mutex);
          seen.insert(std::this_thread::get_id());
          return 0;
        },
        [](int a, int b) { return a + b; });
    EXPECT_LE(seen.size(), static_cast<std::size_t>(threads));
    EXPECT_GE(seen.size(), 1u);
  }
}

/// Counts how many of its kind are alive.
struct Counted {
  Counted() {
    const int now = ++alive;
    for (int seen = most; now > seen && !most.compare_exchange_weak(seen, now);) {
    }
  }
  ~Counted() { --alive; }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;
  inline static std::atomic<int> alive{0}, most{0};
};

TEST(TbbExecutor, holdsFewResultsAtATime) {
  TbbExecutor{2}.reduce(
      10000, [](std::size_t) { return std::make_unique<Counted>(); },
      [](std::unique_ptr<Counted>&, const std::unique_ptr<Counted>&) {});
  EXPECT_EQ(Counted::alive, 0);
  EXPECT_LE(Counted::most, 2 * 4 + 1);  // four for each thread, and the one that they are combined into
}

TEST(TbbExecutor, noChunksGiveTheValueInitialisedResult) {
  EXPECT_EQ(liestat::test::sum(TbbExecutor{2}, {}, 10), 0.0);
  EXPECT_TRUE(liestat::test::combinedOrder(TbbExecutor{2}, 0).empty());
}

TEST(TbbExecutor, anExceptionOfMapOrCombineLeaves) {
  for (int threads : {1, 2, 8}) {
    EXPECT_THROW(liestat::test::throwing(TbbExecutor{threads}, 100, 0), std::runtime_error);
    EXPECT_THROW(liestat::test::throwing(TbbExecutor{threads}, 100, 57), std::runtime_error);
    EXPECT_EQ(liestat::test::throwing(TbbExecutor{threads}, 100, 100), 4950u);
    EXPECT_THROW(TbbExecutor{threads}.reduce(
                     10, [](std::size_t chunk) { return chunk; },
                     [](std::size_t, std::size_t) -> std::size_t { throw std::logic_error("combine"); }),
                 std::logic_error);
  }
}

TEST(TbbExecutor, mayBeNested) {
  const auto inner = [](std::size_t) {
    return TbbExecutor{2}.reduce(
        10, [](std::size_t chunk) { return chunk; }, std::plus<>());
  };
  EXPECT_EQ(TbbExecutor{2}.reduce(20, inner, std::plus<>()), 20u * 45u);
}

TEST(TbbExecutor, givesTheBitsOfTheSerialExecutorAtEveryFrontDoor) {
  const auto serial = liestat::test::frontDoors(SerialExecutor{});
  EXPECT_GT(serial.size(), 100u);
  for (int threads : {1, 3}) {
    EXPECT_EQ(liestat::test::firstDifference(liestat::test::frontDoors(TbbExecutor{threads}), serial), "")
        << threads << " threads";
  }
}

}  // namespace
