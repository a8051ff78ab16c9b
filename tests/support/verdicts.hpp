#pragma once

// Rates of the verdicts of the front doors, and the promise about them. Bounds are four standard errors of the trials.

#include <lie/lie.hpp>
#include <stats/certified_mean.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/random.hpp>

#include <experiments/scattered_features.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

namespace liestat_test {

using namespace liestat;
using experiments::FisherLaw;

/// Four standard errors of a rate.
inline double fourErrors(double rate, double trials) { return 4 * std::sqrt(rate * (1 - rate) / trials); }

/// Rates of the verdicts in many trials.
struct Verdicts {
  double trials = 0, kept = 0, outside = 0, ambiguous = 0, ill_defined = 0;

  /// `covers`: the 95 % region holds the truth.
  void add(Status status, bool covers) {
    ++trials;
    kept += status == Status::ok;
    outside += status == Status::ok && !covers;
    ambiguous += status == Status::ambiguous;
    ill_defined += status == Status::ill_defined;
  }
  /// The promise: at most 7 % of all trials are handed out a region without the truth; of those that are handed out
  /// one, where they are half of all, at least 93 % have it in there.
  void expectPromise(const std::string& what) const {
    std::printf("%-44s kept %.3f, ok but outside %.3f, coverage %.3f, ambiguous %.3f\n", what.c_str(), kept / trials,
                outside / trials, kept > 0 ? 1 - outside / kept : 1, ambiguous / trials);
    EXPECT_LE(outside / trials, 0.07 + fourErrors(0.07, trials)) << what;
    if (kept >= 0.5 * trials) {
      EXPECT_GE(1 - outside / kept, 0.93 - fourErrors(0.93, kept)) << what;
    }
  }
};

/// The cheap search is enough here: what counts is what becomes of the mean.
template <class M>
CertifiedMeanOptions<M> quick() {
  CertifiedMeanOptions<M> options;
  options.uniqueness.budget = 200'000;
  return options;
}

template <class M>
bool covers(const Gaussian<M>& estimate, const M& truth, std::size_t n, bool known_noise) {
  const double squared = mahalanobisSquared(estimate, truth);
  constexpr int k = ManifoldTraits<M>::DoF;
  return (known_noise ? detail::chiSquaredTail(squared, k) : detail::hotellingTail(squared, k, double(n))) > 0.05;
}

template <class M>
Verdicts scattered(double kappa, int n, std::uint64_t trials, bool known_noise = false) {
  const FisherLaw<M> law(kappa);
  const M truth = ManifoldTraits<M>::origin();
  CertifiedMeanOptions<M> options = quick<M>();
  if (known_noise) {
    CounterRng rng(100);
    SquareOf<M> V = SquareOf<M>::Zero();
    for (int i = 0; i < 20000; ++i) {
      const TangentOf<M> z = log(truth, law.draw(rng));
      V.diagonal() += z.cwiseAbs2() / 20000;
    }
    options.known_noise = {V};
  }
  Verdicts verdicts;
  for (std::uint64_t t = 0; t < trials; ++t) {
    CounterRng rng(11, t);
    std::vector<M> samples;
    for (int i = 0; i < n; ++i) samples.push_back(law.draw(rng));
    const auto result = certifiedMean(samples, options);
    verdicts.add(result.status, result.estimate && covers(*result.estimate, truth, samples.size(), known_noise));
  }
  return verdicts;
}

template <class M>
void keepsThePromise(const char* what, double kappa, int n, std::uint64_t trials, double min_kept = 0,
                     bool known_noise = false) {
  const Verdicts verdicts = scattered<M>(kappa, n, trials, known_noise);
  const std::string name =
      std::string(what) + ", kappa " + std::to_string(kappa).substr(0, 4) + ", n = " + std::to_string(n);
  verdicts.expectPromise(name);
  EXPECT_GE(verdicts.kept / verdicts.trials, min_kept - fourErrors(min_kept, verdicts.trials)) << name;
  if (kappa == 0) {
    EXPECT_LE(verdicts.kept / verdicts.trials, 0.02 + fourErrors(0.02, verdicts.trials)) << name;
  }
}

}  // namespace liestat_test
