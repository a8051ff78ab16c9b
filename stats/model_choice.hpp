// The choice between two models of the same measurements: the tests of support and of cost between a model and one that
// contains it, and the criteria that they are measured against. Needs Eigen alone; the exact F test is in
// stats/model_choice_f_test.hpp.
//
// Source: T. Viéville, D. Lingrand, F. Gaspard, "Implementing a variant of the Kanatani's estimation method", INRIA
// RR-4050, 2000, section 5, (36), (37), appendix B, with the residual degrees of freedom in place of (7)
// (docs/theory/constrained.md, section 9, says what differs and why).
#pragma once

#include <stats/detail/tail_probabilities.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

namespace liestat {

/// The fit of a model to some measurements. Two fits are compared over the same measurements.
struct ModelFit {
  double chi2 = 0;            ///< 2 L², the sum of squared errors in units of the noise
  std::size_t equations = 0;  ///< Σ p_i, of the measurements that the sum is over
  int free_parameters = 0;    ///< k = n - p

  /// r, residual ones: Σ p_i - k. Without any the fit says nothing.
  double degreesOfFreedom() const { return static_cast<double>(equations) - free_parameters; }
  /// 2 L²/r, one on average for a right model.
  double normalised() const { return chi2 / degreesOfFreedom(); }
};

/// Φ = exp(-κ δ/r), δ = r - r', (37) with residual degrees of freedom r of the specific model and r' of the general one.
/// For many measurements it rejects the specific model where χ²_δ/δ > 1 + κ.
struct ExponentialPhi {
  double kappa = 8.8;
  double operator()(double r, double r_general) const { return std::exp(-kappa * (r - r_general) / r); }
};

/// True if the general model fits better by more than its freedom explains, L²'/r' < Φ(r, r') L²/r, (36). False where it
/// has no fewer residual degrees of freedom, or one of the two has none.
template <class Phi>
bool fitRejects(const ModelFit& specific, const ModelFit& general, const Phi& phi) {
  const double r = specific.degreesOfFreedom(), r_general = general.degreesOfFreedom();
  if (!(r_general > 0 && r > r_general)) return false;
  return general.chi2 / r_general < phi(r, r_general) * specific.chi2 / r;
}

/// The smallest k that a binomial law of n trials does not exceed with the given probability.
inline std::size_t binomialQuantile(double probability, std::size_t n, double share) {
  if (!(share > 0) || n == 0) return 0;
  if (!(share < 1)) return n;
  const auto trials = static_cast<double>(n);
  // P(X <= k) = I_{1-share}(n - k, k + 1).
  const auto reaches = [&](std::size_t k) {
    return k >= n || detail::incompleteBeta(trials - static_cast<double>(k), static_cast<double>(k) + 1, 1 - share) >=
                         probability;
  };
  std::size_t low = 0, high = n;
  while (low < high) {
    const std::size_t middle = low + (high - low) / 2;
    if (reaches(middle)) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  return low;
}

/// The smallest k that the number of successes of independent trials with these chances does not exceed with the given
/// probability: Poisson's binomial law.
inline std::size_t poissonBinomialQuantile(double probability, std::span<const double> chances) {
  std::vector<double> law = {1};  // of the trials so far
  for (const double q : chances) {
    law.push_back(0);
    for (std::size_t k = law.size(); k-- > 0;) law[k] = (1 - q) * law[k] + (k > 0 ? q * law[k - 1] : 0);
  }
  std::size_t k = 0;
  for (double sum = law[0]; sum < probability && k < chances.size(); sum += law[k]) ++k;
  return k;
}

/// The excess of squared noise that is believed at most: noise of more than three times what was stated is not noise.
inline constexpr double max_excess_noise = 9;

/// A squared error in units of the stated variance, with χ² of `equations` degrees of freedom for right measurements.
struct SquaredError {
  double value = 0, threshold = 0;
  int equations = 1;
};

/// The excess noise s²: errors of right measurements follow s² χ². By maximum likelihood with a background of chance,
/// from the errors below nine times their threshold (over the inliers alone a true 4 would be estimated as 2.5 to 3.5),
/// with the degrees of freedom less the model's free parameters. `chance` is the share of random measurements below
/// nine thresholds. Within [0, 9]; 9 where no degree of freedom is left, of which nothing is known.
inline double excessNoise(std::span<const SquaredError> errors, int free_parameters, double chance) {
  double within = 0, beyond = 0;
  int equations = 1;
  double limit = 0;
  for (const SquaredError& e : errors) {
    (e.value < max_excess_noise * e.threshold ? within : beyond) += 1;
    equations = e.equations, limit = max_excess_noise * e.threshold;
  }
  if (within == 0) return max_excess_noise;
  const double background = std::min(0.99, chance < 1 ? beyond * chance / (1 - chance) / within : 0);
  double s2 = 1;
  constexpr int passes = 30;
  for (int pass = 0; pass < passes; ++pass) {
    // Both densities have the factor e^(p/2 - 1), which their ratio does not.
    const double p = equations, half = 0.5 * p;
    const double inside = 1 - detail::chiSquaredTail(limit / s2, static_cast<std::size_t>(equations));
    const double scale = (1 - background) / (std::pow(2 * s2, half) * std::tgamma(half) * inside);
    const double floor = background * half / std::pow(limit, half);
    double sum = 0, freedom = 0;
    for (const SquaredError& e : errors) {
      if (!(e.value < max_excess_noise * e.threshold)) continue;
      const double likely = scale * std::exp(-0.5 * e.value / s2);
      const double w = likely / (likely + floor);
      sum += w * e.value, freedom += w * e.equations;
    }
    freedom -= free_parameters;
    if (!(freedom > 0.5)) return max_excess_noise;
    // The mean of the law that is cut at the limit.
    const double cut = (1 - detail::chiSquaredTail(limit / s2, static_cast<std::size_t>(equations) + 2)) / inside;
    const double next = std::clamp(sum / freedom / cut, 1e-6, max_excess_noise);
    const bool ended = std::abs(next - s2) < 1e-4 * s2;
    s2 = next;
    if (ended) break;
  }
  return s2;
}

/// The test of support: measurements that a general model explains and a specific one is far from.
struct SupportTest {
  /// Far is beyond this multiple of the threshold of squared errors, which protects the specific model where noise is
  /// larger than stated. Empty: the excess noise of the general model, at most 9, and measurements that noise of any
  /// size explains, equal in all directions, count as chance. 1: the stated noise is right.
  std::optional<double> guard = {};
  double probability = 0.999;  ///< with which chance explains no more

  /// The number of such measurements that chance and the freedom of the general model explain:
  /// ⌈f/p'⌉ + Binom⁻¹(P; far, π'), f its freedom beyond the specific model, π' the share of random measurements that it
  /// takes for inliers.
  std::size_t explained(std::size_t far, int freedom, int general_equations, double share) const {
    return ownShare(freedom, general_equations) + binomialQuantile(probability, far, share);
  }
  /// The same where chances differ: Poisson's binomial law.
  std::size_t explained(std::span<const double> chances, int freedom, int general_equations) const {
    return ownShare(freedom, general_equations) + poissonBinomialQuantile(probability, chances);
  }

 private:
  static std::size_t ownShare(int freedom, int general_equations) {
    return static_cast<std::size_t>((std::max(0, freedom) + general_equations - 1) / general_equations);
  }
};

/// The probability that a general model of p' equations takes for an inlier, below T', a measurement that has the error
/// e under a specific one of p > p' equations, if all that is wrong with it is noise of any size and law that is equal
/// in all directions: e'/e then follows a beta law.
inline double chanceOfIsotropicNoise(double error, double general_threshold, int general_equations, int equations) {
  const double x = std::min(1.0, general_threshold / error);
  if (general_equations == 1 && equations == 2) return 2 / std::numbers::pi * std::asin(std::sqrt(x));
  return detail::incompleteBeta(0.5 * general_equations, 0.5 * (equations - general_equations), x);
}

/// The test of cost between models of p > p' equations, over the inliers of the one with fewer, where selection by its
/// errors does not bias the rest: under the specific model (e - e')/v follows χ² of d = p - p' degrees of freedom. Each
/// measurement counts at most c = d + 2 √(2 d), so that few wrong ones cannot decide.
struct CostTest {
  /// v, and κ of the variance, by the excess noise of the general model: estimated a fifth too small at worst.
  static double scale(double excess_noise) { return std::clamp(1.2 * excess_noise, 1.0, max_excess_noise); }
  static double most(int d) { return d + 2 * std::sqrt(2.0 * d); }
  /// The standard deviations by which the sum of n' costs exceeds what the freedom beyond the specific model explains.
  static double excess(double sum, std::size_t n, int d, int freedom, double v) {
    const double c = most(d);
    const auto degrees = static_cast<std::size_t>(d);
    const double tail = detail::chiSquaredTail(c, degrees);
    const double mean = d * (1 - detail::chiSquaredTail(c, degrees + 2)) + c * tail;
    const double square = d * (d + 2.0) * (1 - detail::chiSquaredTail(c, degrees + 4)) + c * c * tail;
    const auto number = static_cast<double>(n);
    const double kappa = v > 1 ? 2 : 1;
    return (sum - number * mean - freedom) / std::sqrt(kappa * number * (square - mean * mean));
  }
};

/// A pair of nested models of which it is known whether the general one is right.
struct LabelledPair {
  ModelFit specific, general;
  bool general_is_right = false;
};

/// κ of ExponentialPhi that decides most of the pairs as they are labelled: the middle of the widest range of such values
/// within [0, 100]. NaN without a pair that can be compared.
inline double fitKappa(std::span<const LabelledPair> pairs) {
  struct Change {
    double kappa;
    int gain;  // by what the number of right decisions changes where κ grows beyond this
  };
  std::vector<Change> changes;
  for (const LabelledPair& pair : pairs) {
    const double r = pair.specific.degreesOfFreedom(), r_general = pair.general.degreesOfFreedom();
    if (!(r_general > 0 && r > r_general)) continue;
    // The general model is chosen below this κ.
    const double at = -std::log(pair.general.normalised() / pair.specific.normalised()) * r / (r - r_general);
    if (!std::isnan(at)) changes.push_back({std::clamp(at, 0.0, 100.0), pair.general_is_right ? -1 : 1});
  }
  if (changes.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(changes.begin(), changes.end(), [](const Change& a, const Change& b) { return a.kappa < b.kappa; });
  double kappa = 0, widest = -1, from = 0;
  int right = 0, best = std::numeric_limits<int>::min();
  const auto consider = [&](double to) {
    if (to > from && (right > best || (right == best && to - from > widest))) {
      best = right, widest = to - from, kappa = 0.5 * (from + to);
    }
  };
  for (const Change& change : changes) {
    consider(change.kappa);
    right += change.gain, from = change.kappa;
  }
  consider(100);
  return kappa;
}

/// The data of a model that the criteria below use: squared errors of all measurements in units of the noise, the
/// dimension of a measurement and that of the set of true ones, d = n_i - p_i.
struct CriterionInput {
  std::span<const double> errors;
  int measurement_dimension = 1, equations = 1, free_parameters = 0;
  int structureDimension() const { return measurement_dimension - equations; }
};

/// The information criterion for known noise of one object: Σ_I e + λ d |I| + (M - |I|) (T + λ n_i) + λ k with
/// λ = -2 ln(σ/reference), reference a length of the scene in the unit of σ (two images: the focal length). Smaller is
/// better. Errors that are NaN are outliers.
inline double informationCriterion(const CriterionInput& model, double threshold, double sigma_over_reference) {
  const double lambda = -2 * std::log(sigma_over_reference);
  double sum = lambda * model.free_parameters;
  for (const double e : model.errors) {
    sum += e < threshold ? e + lambda * model.structureDimension() : threshold + lambda * model.measurement_dimension;
  }
  return sum;
}

/// Torr's geometric robust information criterion (P. Torr, "Bayesian model estimation and selection for epipolar
/// geometry and generic manifold fitting", IJCV 50, 2002), λ₁ = ln n_i, λ₂ = ln(n_i M), λ₃ = 2. Smaller is better.
inline double gric(const CriterionInput& model) {
  const double n = model.measurement_dimension, d = model.structureDimension();
  const auto all = static_cast<double>(model.errors.size());
  double sum = std::log(n) * d * all + std::log(n * all) * model.free_parameters;
  for (const double e : model.errors) sum += e < 2 * (n - d) ? e : 2 * (n - d);
  return sum;
}

/// Kanatani's geometric AIC, with errors cut at a threshold: Σ min(e, T) + 2 (d M + k). Smaller is better.
inline double geometricAic(const CriterionInput& model, double threshold) {
  double sum = 2 * (model.structureDimension() * static_cast<double>(model.errors.size()) + model.free_parameters);
  for (const double e : model.errors) sum += e < threshold ? e : threshold;
  return sum;
}

}  // namespace liestat
