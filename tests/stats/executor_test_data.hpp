#pragma once

// Data on which floating-point addition is as far from associative as it gets; shared by the executors' tests.

#include <stats/executor.hpp>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

namespace liestat::test {

/// Terms of both signs whose magnitudes spread over forty decades: a different order of addition gives different bits.
inline std::vector<double> nastyTerms(std::size_t n) {
  std::vector<double> terms(n);
  std::uint64_t state = 88172645463325252u;
  for (double& term : terms) {
    state = state * 6364136223846793005u + 1442695040888963407u;
    const double mantissa = static_cast<double>(state >> 11) * 0x1p-53 - 0.5;
    term = std::ldexp(mantissa, static_cast<int>(state % 130) - 65);
  }
  return terms;
}

template <class E>
double sum(const E& executor, const std::vector<double>& terms, std::size_t chunk_size) {
  const std::size_t n_chunks = chunkCount(terms.size(), chunk_size);
  return executor.reduce(
      n_chunks,
      [&](std::size_t chunk) {
        double total = 0;
        const ChunkRange range = chunkRange(terms.size(), n_chunks, chunk);
        for (std::size_t i = range.begin; i < range.end; ++i) total += terms[i];
        return total;
      },
      [](double a, double b) { return a + b; });
}

/// The chunk numbers in the order in which they were combined.
template <class E>
std::vector<std::size_t> combinedOrder(const E& executor, std::size_t n_chunks) {
  return executor.reduce(
      n_chunks, [](std::size_t chunk) { return std::vector<std::size_t>{chunk}; },
      [](std::vector<std::size_t>& a, const std::vector<std::size_t>& b) { a.insert(a.end(), b.begin(), b.end()); });
}

/// Throws std::runtime_error in chunk `bad`.
template <class E>
std::size_t throwing(const E& executor, std::size_t n_chunks, std::size_t bad) {
  return executor.reduce(
      n_chunks,
      [bad](std::size_t chunk) {
        if (chunk == bad) throw std::runtime_error("chunk " + std::to_string(chunk));
        return chunk;
      },
      [](std::size_t a, std::size_t b) { return a + b; });
}

}  // namespace liestat::test
