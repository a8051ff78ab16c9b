// Random samples of products, and their parts.
#pragma once

#include <lie/product.hpp>
#include <stats/random.hpp>
#include <stats/sampling.hpp>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace liestat_test {

using liestat::CounterRng, liestat::Gaussian, liestat::sample, liestat::sampleInCube;

/// The I-th parts.
template <std::size_t I, class M>
auto parts(const std::vector<M>& samples) {
  std::vector<typename M::template Part<I>> result;
  for (const M& x : samples) result.push_back(x.template get<I>());
  return result;
}

/// n samples around a random point, with standard deviations sd in every coordinate.
template <class M>
std::vector<M> scattered(int n, double sd, std::uint64_t seed = 1) {
  CounterRng rng(seed, 0);
  Gaussian<M> g;
  g.mean = sampleInCube<M>(rng);
  g.covariance *= sd * sd;
  std::vector<M> samples;
  for (int i = 0; i < n; ++i) samples.push_back(sample(g, rng));
  return samples;
}

}  // namespace liestat_test
