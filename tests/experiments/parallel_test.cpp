// The executor of the program: the order of the chunks, the same bits for any number of threads, exceptions.

#include <experiments/parallel.hpp>

#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>
#include <string>

namespace liestat::experiments {
namespace {

TEST(ProgramExecutor, combinesInTheOrderOfTheChunks) {
  const auto map = [](std::size_t chunk) { return std::to_string(chunk) + " "; };
  const auto append = [](std::string& left, const std::string& right) { left += right; };
  // More chunks than can be under way at the same time.
  for (const std::size_t n_chunks : {0U, 1U, 2U, 3U, 9U, 10U, 1000U}) {
    const std::string expected = SerialExecutor{}.reduce(n_chunks, map, append);
    for (const int threads : {0, 1, 2, 5}) {
      EXPECT_EQ(ProgramExecutor{threads}.reduce(n_chunks, map, append), expected) << n_chunks << ' ' << threads;
    }
  }
}

TEST(ProgramExecutor, givesTheSameBitsOnAnyNumberOfThreads) {
  const auto map = [](std::size_t chunk) { return 1 / (1 + static_cast<double>(chunk)); };
  const auto add = [](double a, double b) { return a + b; };
  const double serial = SerialExecutor{}.reduce(5000, map, add);
  for (const int threads : {0, 1, 3, 8}) EXPECT_EQ(ProgramExecutor{threads}.reduce(5000, map, add), serial);
}

TEST(ProgramExecutor, takesResultsThatCanOnlyBeMoved) {
  const auto sum = ProgramExecutor{3}.reduce(
      100, [](std::size_t chunk) { return std::make_unique<std::size_t>(chunk); },
      [](std::unique_ptr<std::size_t>& left, const std::unique_ptr<std::size_t>& right) { *left += *right; });
  EXPECT_EQ(*sum, 4950U);
}

TEST(ProgramExecutor, letsExceptionsThrough) {
  const auto add = [](int a, int b) { return a + b; };
  for (const int threads : {1, 4}) {
    EXPECT_THROW(ProgramExecutor{threads}.reduce(
                     50,
                     [](std::size_t chunk) {
                       if (chunk == 17) throw std::runtime_error("17");
                       return 1;
                     },
                     add),
                 std::runtime_error);
  }
}

}  // namespace
}  // namespace liestat::experiments
