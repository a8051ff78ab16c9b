// Times of several candidates, taken in turns: each round runs every candidate once, so that whatever else the machine
// does falls on all of them alike, and the median over the rounds is what a table compares.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <functional>
#include <vector>

namespace liestat::bench {

/// Keeps the compiler from dropping a computation whose result nobody reads.
template <class T>
void keep(const T& value) {
  asm volatile("" : : "m"(value) : "memory");
}

/// One read of memory: the sum of all numbers, in lanes enough that the additions do not count.
inline double readOnce(const double* p, std::size_t n) {
  constexpr std::size_t lanes = 32;
  double sums[lanes] = {};
  for (std::size_t i = 0; i + lanes <= n; i += lanes) {
    for (std::size_t l = 0; l < lanes; ++l) sums[l] += p[i + l];
  }
  double sum = 0;
  for (const double s : sums) sum += s;
  return sum;
}

/// Median time of one call of each candidate, in ns. A candidate is called as often in each round as fills
/// round_seconds, at least once.
inline std::vector<double> interleavedMedians(const std::vector<std::function<void()>>& candidates, int rounds,
                                              double round_seconds) {
  using Clock = std::chrono::steady_clock;
  const auto seconds = [](const std::function<void()>& f, int calls) {
    const auto begin = Clock::now();
    for (int i = 0; i < calls; ++i) f();
    return std::chrono::duration<double>(Clock::now() - begin).count();
  };
  std::vector<int> calls;
  for (const auto& f : candidates) {
    f();  // first touch of the data and of the code
    calls.push_back(std::max(1, static_cast<int>(std::lround(round_seconds / std::max(seconds(f, 1), 1e-9)))));
  }
  std::vector<std::vector<double>> times(candidates.size());
  for (int round = 0; round < rounds; ++round) {
    for (std::size_t c = 0; c < candidates.size(); ++c) times[c].push_back(seconds(candidates[c], calls[c]) / calls[c]);
  }
  std::vector<double> medians;
  for (auto& t : times) {
    const auto middle = t.begin() + static_cast<std::ptrdiff_t>(t.size() / 2);
    std::nth_element(t.begin(), middle, t.end());
    medians.push_back(*middle * 1e9);
  }
  return medians;
}

}  // namespace liestat::bench
