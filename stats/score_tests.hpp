// Tests of named suspects with one degree of freedom each: a χ² of a hundred degrees of freedom does not see one wrong
// quantity, a test in its direction does. Rows have whitened residuals u, their derivatives K by the parameters, to
// which they were fitted, and G by the suspects, which the model takes for known.
//
// The parameters leave g̃ = g - K C Σ Kᵀ g of a suspect g = G_j, whose score is U = Σ g̃ᵀ u, with I = Σ g̃ᵀ g̃:
// the residuals ask for η = -U/I, and z = -U/√V, sd(η) = √V/I. V is the variance of the score, with the dependence in
// time that the residuals show (stats/time_dependence.hpp): V = I for independent errors of known variance. Where
// suspects are unknowns, with or without a prior, they are eliminated like parameters, and a prior is one more row.
// docs/theory/score_tests.md has the derivation.
//
//   std::vector<liestat::TimedRow<6, 12 + 2>> rows;                // K and G side by side
//   const auto found = liestat::scoreTests<6, 12, 2>(rows, {});
//   if (found.suspects[0].significant) …
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <stats/score_tests_types.hpp>
#include <stats/time_dependence.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace liestat {

template <int G>
struct ScoreTestOptions {
  /// Standard deviations of priors: 0 if the suspect keeps its value, infinite if it is an unknown without a prior.
  std::array<double, static_cast<std::size_t>(G)> prior_sigmas = {};
  /// Values at which the residuals and derivatives were taken; priors are about zero.
  std::array<double, static_cast<std::size_t>(G)> values = {};
  /// The whitening is known; otherwise it is known up to a factor, which the residuals tell.
  bool known_noise = true;
};

/// The result of scoreTests() for G suspects beside P parameters.
template <int P, int G>
struct ScoreTests {
  /// In the order of the columns, without names.
  std::array<SuspectTest, static_cast<std::size_t>(G)> suspects;
  /// The movement of the parameters' estimate per unit by which a suspect is off.
  Eigen::Matrix<double, P, G> shifts = Eigen::Matrix<double, P, G>::Zero();
  /// Where suspects are unknowns: the step to the common estimate, first of the parameters, and its covariance. Zero
  /// for suspects that keep their values; NaN where the unknowns are not determined.
  Eigen::Matrix<double, P + G, 1> step = Eigen::Matrix<double, P + G, 1>::Zero();
  Eigen::Matrix<double, P + G, P + G> covariance = Eigen::Matrix<double, P + G, P + G>::Zero();
  TimeDependence dependence;
  int strongest = -1;  ///< the significant suspect of largest |z|, of those that keep their values; else -1
};

namespace detail {

/// The suspect beside the others, whose normal equations have `held` parameters taken out.
template <int N>
struct SuspectDirection {
  Eigen::Matrix<double, N, 1> w;  ///< its unit step and what the other unknowns do to undo it
  double information = 0, remaining = 0;

  SuspectDirection(const Eigen::Matrix<double, N, N>& information_of_all, int k,
                   const std::array<bool, static_cast<std::size_t>(N)>& held)
      : w(Eigen::Matrix<double, N, 1>::Zero()) {
    Eigen::Matrix<double, N, N> normal = information_of_all;
    Eigen::Matrix<double, N, 1> right = information_of_all.col(k);
    for (int j = 0; j < N; ++j) {
      if (!held[static_cast<std::size_t>(j)] && j != k) continue;
      holdParameter<N>(normal, j);
      right[j] = 0;
    }
    w = -Cholesky<double, N>(normal).template solve<1>(right);
    w[k] = 1;
    information = w.dot(information_of_all.col(k));
    remaining = information / information_of_all(k, k);
  }
};

}  // namespace detail

/// Tests G suspects, whose columns stand behind those of P parameters; the residuals are those of a fit. Rows without
/// times have the same one.
template <int C, int P, int G>
ScoreTests<P, G> scoreTests(TimedRows<C, P + G> rows, const ScoreTestOptions<G>& options) {
  constexpr int N = P + G;
  // Less is rounding: the parameters do all that the suspect would.
  constexpr double min_remaining = 1e-9;
  // The 0.99 quantile of χ²₁: what another suspect may be worse and still be the one.
  constexpr double group_limit = 6.634896601021213;
  using Matrix = Eigen::Matrix<double, N, N>;
  using Vector = Eigen::Matrix<double, N, 1>;
  ScoreTests<P, G> result;
  std::array<bool, static_cast<std::size_t>(N)> held = {};
  int unknowns = P;
  Vector prior = Vector::Zero();  // information
  for (int j = 0; j < G; ++j) {
    const auto k = static_cast<std::size_t>(j);
    const double sigma = options.prior_sigmas[k];
    held[k + P] = !(sigma > 0);
    if (sigma > 0) prior[P + j] = 1 / (sigma * sigma), ++unknowns;
  }
  Matrix of_rows = Matrix::Zero();
  Vector score = Vector::Zero();
  rows.forEachBlock([&](std::size_t, std::span<const TimedRow<C, N>> block) {
    for (const TimedRow<C, N>& row : block) {
      of_rows += row.columns().transpose() * row.columns();
      score += row.columns().transpose() * row.residual();
    }
  });
  // Noise and its dependence are what is left when all suspects that can be told apart have been fitted: one that is
  // wrong would pass for an error that lasts.
  std::array<bool, static_cast<std::size_t>(N)> left_out = {};
  for (int k = P; k < N; ++k) left_out[static_cast<std::size_t>(k)] = true;
  int fitted = P;
  for (int k = P; k < N; ++k) {
    if (!(detail::SuspectDirection<N>(of_rows, k, left_out).remaining > min_remaining)) continue;
    left_out[static_cast<std::size_t>(k)] = false, ++fitted;
  }
  Matrix normal_of_all = of_rows;
  Vector off_of_all = score;
  for (int k = P; k < N; ++k) {
    if (left_out[static_cast<std::size_t>(k)]) detail::holdParameter<N>(normal_of_all, k), off_of_all[k] = 0;
  }
  const Vector step_of_all = detail::Cholesky<double, N>(normal_of_all).template solve<1>(off_of_all);
  const double freedom = static_cast<double>(C) * static_cast<double>(rows.size()) - fitted;
  rows.subtract(step_of_all);
  const detail::TimeModel<C, N> model(std::move(rows), options.known_noise, left_out);
  result.dependence = model.dependence();
  const double found = freedom > 0 ? model.power() / freedom : 1;
  // Noise that is larger than stated is no suspect.
  const double variance = options.known_noise ? std::max(1.0, found) : found;
  const Matrix middle = model.widens() ? model.sandwich() : Matrix(variance * of_rows);
  for (int j = 0; j < G; ++j) score[P + j] += prior[P + j] * options.values[static_cast<std::size_t>(j)];

  int tested = 0;
  for (int j = 0; j < G; ++j) {
    SuspectTest& test = result.suspects[static_cast<std::size_t>(j)];
    const int k = P + j;
    // Its own prior is what is tested, and stays out.
    Matrix information = of_rows, spread = middle;
    Vector off = score;
    for (int i = P; i < N; ++i) {
      if (i != k) information(i, i) += prior[i], spread(i, i) += prior[i];
    }
    const double value = options.values[static_cast<std::size_t>(j)];
    off[k] -= prior[k] * value;
    const detail::SuspectDirection<N> direction(information, k, held);
    result.shifts.col(j) = direction.w.template head<P>();
    if (!(direction.remaining > min_remaining)) continue;
    // A sandwich that is narrower than independent errors is an accident of the time constants.
    const double least = options.known_noise ? direction.information : 0;
    const double V = std::max(least, direction.w.dot(spread * direction.w));
    test.estimate = value - direction.w.dot(off) / direction.information;
    test.sigma = std::sqrt(V) / direction.information;
    const double sigma = options.prior_sigmas[static_cast<std::size_t>(j)];
    test.z = test.estimate / (sigma > 0 ? std::hypot(test.sigma, sigma) : test.sigma);
    test.p = std::erfc(std::abs(test.z) / std::sqrt(2.0));
    ++tested;
  }
  const auto at = [](int suspect) { return static_cast<std::size_t>(P) + static_cast<std::size_t>(suspect); };
  for (int j = 0; j < G; ++j) {
    SuspectTest& test = result.suspects[static_cast<std::size_t>(j)];
    test.significant = test.tested() && test.p * tested < suspicion_level;
    if (!test.significant || !held[at(j)]) continue;
    if (result.strongest < 0 ||
        std::abs(test.z) > std::abs(result.suspects[static_cast<std::size_t>(result.strongest)].z)) {
      result.strongest = j;
    }
  }
  if (result.strongest >= 0) {
    const double most = result.suspects[static_cast<std::size_t>(result.strongest)].z;
    for (int j = 0; j < G; ++j) {
      SuspectTest& test = result.suspects[static_cast<std::size_t>(j)];
      test.in_group = held[at(j)] && test.tested() && most * most - test.z * test.z < group_limit;
    }
  }

  // The common estimate.
  if (unknowns == P) return result;
  Matrix information = of_rows, spread = middle;
  information.diagonal() += prior, spread.diagonal() += prior;
  Matrix plain = variance * of_rows;
  plain.diagonal() += prior;
  for (int k = P; k < N; ++k) {
    if (!held[static_cast<std::size_t>(k)]) continue;
    detail::holdParameter<N>(information, k), detail::holdParameter<N>(spread, k), detail::holdParameter<N>(plain, k);
    score[k] = 0;
  }
  const detail::Cholesky<double, N> normal(information);
  result.step = -normal.template solve<1>(score);
  const Matrix half = normal.template solve<N>(plain);
  const Matrix independent = normal.template solve<N>(half.transpose());
  const detail::WidenedCovariance<N> widened(0.5 * (independent + independent.transpose()), information, spread);
  result.covariance = widened.covariance;
  // Suspects that keep their values count as one each in the mean.
  if (model.widens()) result.dependence.correlation_factor = 1 + (widened.factor - 1) * N / unknowns;
  for (int k = P; k < N; ++k) {
    if (held[static_cast<std::size_t>(k)]) result.covariance(k, k) = 0;
  }
  return result;
}

/// The parameters as a mixture over the suspects of the group: the movement of their estimate, whose covariance is
/// `covariance`, and the covariance that the mixture has. Each suspect has the weight e^(z²/2), the likelihood of its
/// estimate; one that stays alone is the estimate with it as an unknown. Nothing moves where there is no group.
template <int P, int G>
std::pair<Eigen::Matrix<double, P, 1>, Eigen::Matrix<double, P, P>> groupMixture(
    const ScoreTests<P, G>& tests, const Eigen::Matrix<double, P, P>& covariance) {
  Eigen::Matrix<double, P, 1> mean = Eigen::Matrix<double, P, 1>::Zero();
  Eigen::Matrix<double, P, P> spread = covariance;
  if (tests.strongest < 0) return {mean, spread};
  const double most = tests.suspects[static_cast<std::size_t>(tests.strongest)].z;
  double sum = 0;
  std::array<double, static_cast<std::size_t>(G)> weights = {};
  for (std::size_t j = 0; j < G; ++j) {
    const SuspectTest& test = tests.suspects[j];
    if (!test.in_group) continue;
    sum += weights[j] = std::exp(0.5 * (test.z * test.z - most * most));
  }
  const auto moved = [&](std::size_t j) -> Eigen::Matrix<double, P, 1> {
    return tests.suspects[j].estimate * tests.shifts.col(static_cast<Eigen::Index>(j));
  };
  for (std::size_t j = 0; j < G; ++j) {
    if (weights[j] > 0) mean += weights[j] / sum * moved(j);
  }
  for (std::size_t j = 0; j < G; ++j) {
    if (!(weights[j] > 0)) continue;
    const Eigen::Matrix<double, P, 1> off = moved(j) - mean;
    const Eigen::Matrix<double, P, 1> shift = tests.suspects[j].sigma * tests.shifts.col(static_cast<Eigen::Index>(j));
    spread += weights[j] / sum * (off * off.transpose() + shift * shift.transpose());
  }
  return {mean, spread};
}

}  // namespace liestat
