// Stewart's distribution of good and bad data (Viéville, Lingrand and Gaspard 2000, (32)), and the bias of a score on
// it.
#pragma once

#include <stats/random.hpp>
#include <stats/robust.hpp>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <vector>

namespace liestat::experiments {

/// A share e0 of outliers uniform on [0, 100]; of the others a share e1 at 10, the rest at 10 + delta, with standard
/// deviation 5.
struct Stewart {
  double e0, e1, delta;

  double draw(CounterRng& rng) const {
    if (rng.uniform() < e0) return rng.uniform(0, 100);
    return 10 + (rng.uniform() < e1 ? 0 : delta) + 5 * rng.normal();
  }
  std::vector<double> sample(std::size_t n, CounterRng& rng) const {
    std::vector<double> x(n);
    for (double& value : x) value = draw(rng);
    return x;
  }
  double density(double x) const {
    const auto normal = [](double z) { return std::exp(-0.5 * z * z) / std::sqrt(2 * std::numbers::pi) / 5; };
    return (1 - e0) * (e1 * normal((x - 10) / 5) + (1 - e1) * normal((x - 10 - delta) / 5)) +
           (x >= 0 && x <= 100 ? e0 / 100 : 0);
  }
  /// Density of |x - v|: a curve of fig. 7.
  double curve(double v, double e) const { return density(v + e) + density(v - e); }
};

/// The ten columns of fig. 8.
inline constexpr Stewart stewart_columns[] = {{.1, 1, 0},   {.2, 1, 0},   {.5, 1, 0},   {.8, 1, 0},   {.2, .8, 50},
                                              {.2, .6, 50}, {.2, .8, 20}, {.2, .6, 20}, {.2, .8, 10}, {.2, .6, 10}};

/// The bias of a score: the integer of 0 to `last` with the best one, by its errors |x - v| or their squares, less the
/// mode at 10.
template <class Rule>
int stewartBias(const Rule& rule, const std::vector<double>& x, bool squared, int last) {
  double best = -std::numeric_limits<double>::infinity();
  int at = 0;
  std::vector<double> errors(x.size()), scratch;
  for (int v = 0; v <= last; ++v) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      const double e = std::abs(x[i] - v);
      errors[i] = squared ? e * e : e;
    }
    const double score = [&] {
      if constexpr (requires { rule(errors, scratch); }) {
        return rule(errors, scratch);
      } else {
        return rule(errors);
      }
    }();
    if (score > best) best = score, at = v;
  }
  return at - 10;
}

/// The biases of the four scores of fig. 8 on one sample: relevance of |e| and of e², S_A, S_B. The candidates go 20
/// beyond the second mode.
struct StewartBiases {
  int relevance, relevance_of_squares, count, quantile;
};
inline StewartBiases stewartBiases(const Stewart& law, const std::vector<double>& x) {
  const int last = static_cast<int>(10 + law.delta + 20);
  return {stewartBias(Relevance{10}, x, false, last), stewartBias(Relevance{25}, x, true, last),
          stewartBias(InlierCount{25}, x, true, last),
          stewartBias(TrimmedQuantile{(1 - law.e0) * law.e1 / 2}, x, true, last)};
}

}  // namespace liestat::experiments
