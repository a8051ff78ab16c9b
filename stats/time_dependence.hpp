// Errors of successive measurements that are not independent: the covariance of an estimate from rows with times, by
// the dependence that the rows themselves show. The estimate stays what it is, its covariance is widened.
//
// The whitened residuals u_i of n rows are a Gauss–Markov process and white noise, in each channel alike:
// E[u_i u_j] = s² ρ(t_i - t_j), ρ(Δ) = f e^(-|Δ|/τ) + (1 - f)[Δ = 0]. The restricted likelihood of (τ, f), s² being
// maximised, weighs the cells of a grid and white noise, which has a prior of 0.8; the mean c(Δ) of s² ρ(Δ) under these
// weights makes the sandwich C M C, M = Σ_ij c(t_i - t_j) K_iᵀ K_j, round C = (Σ K_iᵀ K_i)⁻¹, K_i the whitened columns.
// Likelihoods come from a scalar Kalman filter whose gains all channels and columns share: O(n) a cell. Residuals alone
// cannot show an error that the parameters explain, so that no block or sandwich of residuals will do; a model
// extrapolates (docs/hand_eye.md, "Dependence in time").
#pragma once

#include <lie/detail/small_eigen.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <stats/time_dependence_types.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

namespace liestat {

/// A row: whitened residuals in C channels, and their derivatives by P parameters, in the same units.
template <int C, int P>
struct TimedRow {
  double time = 0;  ///< s
  Eigen::Matrix<double, C, 1> residual;
  Eigen::Matrix<double, C, P> columns;
};

/// The dependence of rows and the covariance that holds with it.
template <int P>
struct TimedCovariance {
  TimeDependence dependence;
  Eigen::Matrix<double, P, P> covariance;  ///< not below the plain one in any direction; that, if nothing was tested
};

namespace detail {

/// The columns and the residuals of a row side by side.
template <int C, int P>
using TimedColumns = Eigen::Matrix<double, C, P + 1>;

/// exp(-Δ/τ) between successive rows.
inline std::vector<double> decays(std::span<const double> gaps, double time_constant) {
  std::vector<double> list;
  for (const double gap : gaps) list.push_back(std::exp(-gap / time_constant));
  return list;
}

/// A cell of the grid.
struct TimeCell {
  double time_constant = 0, share = 0, prior = 1;
  /// Variance s² and log likelihood, up to a constant: restricted, and of the residuals as they are.
  struct Judged {
    double variance = 1, log_likelihood = -std::numeric_limits<double>::infinity();
  };
  Judged restricted = {}, profile = {};
  double weight = 0;
};

/// [K u]ᵀ R⁻¹ [K u] and log det R of a cell, by the innovations of a scalar Kalman filter. `decay` is that from the row
/// before.
template <int P>
struct CellSums {
  Eigen::Matrix<double, P + 1, P + 1> gram = Eigen::Matrix<double, P + 1, P + 1>::Zero();
  double log_det = 0;
};
template <int C, int P, class Rows>
CellSums<P> cellSums(double f, const Rows& rows, std::span<const double> decay) {
  CellSums<P> sums;
  TimedColumns<C, P> state = TimedColumns<C, P>::Zero();
  double variance = f;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (i > 0) {
      const double phi = decay[i - 1];
      state *= phi;
      variance = phi * phi * variance + f * (1 - phi * phi);
    }
    const double total = variance + 1 - f;
    const TimedColumns<C, P> innovation = rows[i] - state;
    for (int j = 0; j <= P; ++j) {
      const Eigen::Matrix<double, C, 1> column = innovation.col(j) * (1 / total);
      for (int k = 0; k <= j; ++k) sums.gram(k, j) += innovation.col(k).dot(column);
    }
    sums.log_det += C * std::log(total);
    const double gain = variance / total;
    state += gain * innovation;
    variance *= 1 - gain;
  }
  for (int j = 0; j <= P; ++j) {
    for (int k = j + 1; k <= P; ++k) sums.gram(k, j) = sums.gram(j, k);
  }
  return sums;
}

/// The likelihoods of a cell.
template <int C, int P, class Rows>
void judgeCell(TimeCell& cell, const Rows& rows, std::span<const double> decay) {
  const auto [gram, log_det] = cellSums<C, P>(cell.share, rows, decay);
  const Cholesky<double, P> normal(gram.template topLeftCorner<P, P>());
  const double freedom = static_cast<double>(C) * static_cast<double>(rows.size()) - P;
  if (!normal.ok() || !(freedom > 0)) return;
  const Eigen::Matrix<double, P, 1> right = gram.template topRightCorner<P, 1>();
  const double squares = gram(P, P) - normal.template halfSolve<1>(right).squaredNorm();
  if (!(squares > 0)) return;
  const auto judged = [&, log_determinant = log_det](double sum, double more) -> TimeCell::Judged {
    const double s2 = sum / freedom;
    return {s2, -0.5 * (freedom * std::log(s2) + log_determinant + more) + std::log(cell.prior)};
  };
  cell.restricted = judged(squares, normal.logDeterminant());
  cell.profile = judged(gram(P, P), 0);
}

/// Σ_ij c(t_i - t_j) K_iᵀ K_j of a cell, for s² = 1.
template <int C, int P, class Rows>
Eigen::Matrix<double, P, P> cellSandwich(const TimeCell& cell, const Rows& rows, std::span<const double> decay) {
  Eigen::Matrix<double, P, P> equal = Eigen::Matrix<double, P, P>::Zero(), past = equal;
  Eigen::Matrix<double, C, P> sum = Eigen::Matrix<double, C, P>::Zero();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Eigen::Matrix<double, C, P> K = rows[i].template leftCols<P>();
    if (i > 0 && cell.share > 0) {
      sum = decay[i - 1] * sum;
      past += K.transpose() * sum;
    }
    equal += K.transpose() * K;
    sum += K;
  }
  return equal + cell.share * (past + past.transpose());
}

/// Residuals have the power s² (N - tr C M) under a cell. False where they have less than a third of it: the cell has
/// taken what a shift of the parameters explains for a process that drifts, and claims errors that are not there.
template <int C, int P, class Rows>
bool isBelievable(const TimeCell& cell, const Rows& rows, std::span<const double> decay) {
  constexpr double min_share = 1. / 3;
  Eigen::Matrix<double, P, P> information = Eigen::Matrix<double, P, P>::Zero();
  double power = 0;
  for (const auto& row : rows) {
    information += row.template leftCols<P>().transpose() * row.template leftCols<P>();
    power += row.col(P).squaredNorm();
  }
  const Eigen::Matrix<double, P, P> sandwich = cellSandwich<C, P>(cell, rows, decay);
  const double taken = Cholesky<double, P>(information).template solve<P>(sandwich).trace();
  const double left = static_cast<double>(C) * static_cast<double>(rows.size()) - taken;
  return power >= min_share * cell.restricted.variance * left;
}

}  // namespace detail

/// Tests rows, in any order, and widens the covariance of their estimate, `plain`. White noise has the variance 1 in
/// units of the whitening if `known_noise`, else that of the residuals. At least 20 rows and three times as many
/// residuals as parameters are needed; rows of one time alone say nothing.
template <int C, int P>
TimedCovariance<P> timedCovariance(std::span<const TimedRow<C, P>> given, const Eigen::Matrix<double, P, P>& plain,
                                   bool known_noise) {
  constexpr std::size_t min_rows = 20;
  constexpr double white_prior = 0.8, min_weight = 1e-5, min_time_constants = 10;
  TimedCovariance<P> result{{}, plain};
  if (given.size() < min_rows || C * given.size() < 3 * P) return result;
  std::vector<std::size_t> order(given.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](auto i, auto k) { return given[i].time < given[k].time; });
  std::vector<detail::TimedColumns<C, P>> rows(given.size());
  std::vector<double> gaps;
  for (std::size_t i = 0; i < order.size(); ++i) {
    rows[i] << given[order[i]].columns, given[order[i]].residual;
    if (i > 0) gaps.push_back(given[order[i]].time - given[order[i - 1]].time);
  }
  const double duration = given[order.back()].time - given[order.front()].time;
  if (!(duration > 0) || !std::isfinite(duration)) return result;
  std::vector<double> sorted = gaps;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
  // Many rows may have one time; their median gap is then no scale.
  const double shortest = std::max(0.7 * sorted[sorted.size() / 2], 1e-6 * duration), longest = 2 * duration;

  constexpr std::array shares{.1, .25, .5, .75, .9, .97, 1 - 1e-6};
  constexpr int steps = 9;
  std::vector<detail::TimeCell> cells{{.prior = white_prior}};
  std::vector<std::vector<double>> decay{std::vector<double>(gaps.size(), 0.0)};
  for (int k = 0; k < steps; ++k) {
    const double time_constant = shortest * std::pow(longest / shortest, k / (steps - 1.0));
    decay.push_back(detail::decays(gaps, time_constant));
    for (const double share : shares) {
      cells.push_back({.time_constant = time_constant,
                       .share = share,
                       .prior = (1 - white_prior) / (steps * static_cast<double>(shares.size()))});
    }
  }
  const auto decayOf = [&](std::size_t cell) -> const std::vector<double>& {
    return decay[cell == 0 ? 0 : 1 + (cell - 1) / shares.size()];
  };
  for (std::size_t k = 0; k < cells.size(); ++k) detail::judgeCell<C, P>(cells[k], rows, decayOf(k));
  TimeDependence& found = result.dependence;
  // Weights, and what they say, by one of the likelihoods.
  const auto weigh = [&](detail::TimeCell::Judged detail::TimeCell::*likelihood) {
    double best = -std::numeric_limits<double>::infinity(), sum = 0;
    for (const detail::TimeCell& cell : cells) best = std::max(best, (cell.*likelihood).log_likelihood);
    if (!std::isfinite(best)) return false;
    for (detail::TimeCell& cell : cells) sum += cell.weight = std::exp((cell.*likelihood).log_likelihood - best);
    double log_time = 0, share = 0, others = 0;
    for (std::size_t k = 0; k < cells.size(); ++k) {
      detail::TimeCell& cell = cells[k];
      cell.weight /= sum;
      if (k == 0) continue;
      others += cell.weight, share += cell.weight * cell.share;
      log_time += cell.weight * std::log(cell.time_constant);
    }
    found.white = cells.front().weight;
    if (others > 0) found.share = share / others, found.time_constant = std::exp(log_time / others);
    return true;
  };
  // Over many time constants the residuals show the dependence by themselves. The restricted likelihood, which few of
  // them need, may take an error of the model that a shift of the parameters explains, such as a delay between streams,
  // for a process that drifts without end.
  if (!weigh(&detail::TimeCell::profile)) return result;
  auto likelihood = &detail::TimeCell::profile;
  if (C * given.size() < 20 * P || duration < min_time_constants * found.time_constant) {
    if (!weigh(&detail::TimeCell::restricted)) return result;
    const auto heaviest =
        std::max_element(cells.begin(), cells.end(), [](const auto& a, const auto& b) { return a.weight < b.weight; });
    const auto k = static_cast<std::size_t>(heaviest - cells.begin());
    if (k == 0 || detail::isBelievable<C, P>(*heaviest, rows, decayOf(k))) {
      likelihood = &detail::TimeCell::restricted;
    } else {
      weigh(likelihood);
    }
  }
  found.tested = true;
  // Where the rows do not speak for a dependence the covariance is to the last bit what it was.
  if (found.white >= white_prior) return result;
  Eigen::Matrix<double, P, P> middle = Eigen::Matrix<double, P, P>::Zero();
  for (std::size_t k = 0; k < cells.size(); ++k) {
    if (cells[k].weight <= min_weight) continue;  // each costs as much as any other
    const double variance = k == 0 && known_noise ? 1 : (cells[k].*likelihood).variance;
    middle += cells[k].weight * variance * detail::cellSandwich<C, P>(cells[k], rows, decayOf(k));
  }

  // In the coordinates where the plain covariance is the identity nothing becomes smaller.
  const detail::Cholesky<double, P> factor(plain);
  if (!factor.ok()) return result;
  const Eigen::Matrix<double, P, P> L = factor.lower();
  Eigen::Matrix<double, P, P> information = Eigen::Matrix<double, P, P>::Zero();
  for (const auto& row : rows) {
    information += row.template leftCols<P>().transpose() * row.template leftCols<P>();
  }
  const detail::Cholesky<double, P> normal(information);
  if (!normal.ok()) return result;
  const Eigen::Matrix<double, P, P> half = normal.template solve<P>(middle);
  const Eigen::Matrix<double, P, P> sandwich = normal.template solve<P>(half.transpose());
  const Eigen::Matrix<double, P, P> left = factor.template halfSolve<P>(sandwich);
  const Eigen::Matrix<double, P, P> scaled = factor.template halfSolve<P>(left.transpose());
  const detail::SymmetricEigen eigen(Eigen::Matrix<double, P, P>(0.5 * (scaled + scaled.transpose())));
  Eigen::Matrix<double, P, P> widened = Eigen::Matrix<double, P, P>::Identity();
  double trace = 0;
  for (int i = 0; i < P; ++i) {
    const double more = std::max(0.0, eigen.values[i] - 1);
    trace += 1 + more;
    widened += more * eigen.vectors.col(i) * eigen.vectors.col(i).transpose();
  }
  found.correlation_factor = trace / P;
  const Eigen::Matrix<double, P, P> covariance = detail::congruence(L, widened);
  result.covariance = 0.5 * (covariance + covariance.transpose());
  return result;
}

}  // namespace liestat
