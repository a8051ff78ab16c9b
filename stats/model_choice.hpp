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

/// The test of support: measurements that a general model explains and a specific one is far from.
struct SupportTest {
  /// Far is beyond this multiple of the threshold of squared errors. Measurements that are only a little noisier than
  /// said would else speak for the general model.
  double guard = 9;
  double probability = 0.999;  ///< with which chance explains no more

  /// The number of such measurements that chance and the freedom of the general model explain:
  /// ⌈f/p'⌉ + Binom⁻¹(P; far, π'), f its freedom beyond the specific model, π' the share of random measurements that it
  /// takes for inliers.
  std::size_t explained(std::size_t far, int freedom, int general_equations, double share) const {
    return static_cast<std::size_t>((std::max(0, freedom) + general_equations - 1) / general_equations) +
           binomialQuantile(probability, far, share);
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
