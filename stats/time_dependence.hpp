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

/// Takes a parameter out of normal equations: its row and column become those of the identity.
template <int N>
void holdParameter(Eigen::Matrix<double, N, N>& normal, int k) {
  normal.row(k).setZero(), normal.col(k).setZero();
  normal(k, k) = 1;
}

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

/// The likelihoods of a cell, of which the parameters in `held` are known.
template <int C, int P, class Rows>
void judgeCell(TimeCell& cell, const Rows& rows, std::span<const double> decay,
               const std::array<bool, static_cast<std::size_t>(P)>& held) {
  auto [gram, log_det] = cellSums<C, P>(cell.share, rows, decay);
  double freedom = static_cast<double>(C) * static_cast<double>(rows.size());
  for (int k = 0; k < P; ++k) {
    if (held[static_cast<std::size_t>(k)]) {
      holdParameter<P + 1>(gram, k);
    } else {
      --freedom;
    }
  }
  const Cholesky<double, P> normal(gram.template topLeftCorner<P, P>());
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

/// The dependence that rows show, for the covariance of scores of their columns. Parameters in `held` are known: their
/// columns stand beside the others, and the residuals were not fitted to them.
template <int C, int P>
class TimeModel {
 public:
  TimeModel(std::span<const TimedRow<C, P>> given, bool known_noise,
            const std::array<bool, static_cast<std::size_t>(P)>& held = {})
      : known_noise_(known_noise), held_(held) {
    std::vector<std::size_t> order(given.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(), [&](auto i, auto k) { return given[i].time < given[k].time; });
    rows_.resize(given.size());
    std::vector<double> gaps;
    for (std::size_t i = 0; i < order.size(); ++i) {
      rows_[i] << given[order[i]].columns, given[order[i]].residual;
      if (i > 0) gaps.push_back(given[order[i]].time - given[order[i - 1]].time);
    }
    const auto fitted = static_cast<std::size_t>(std::count(held_.begin(), held_.end(), false));
    if (given.size() < min_rows || C * given.size() < 3 * fitted) return;
    const double duration = given[order.back()].time - given[order.front()].time;
    if (duration > 0 && std::isfinite(duration)) findDependence(gaps, duration, fitted);
  }

  const TimeDependence& dependence() const { return found_; }
  /// True where the rows speak for a dependence.
  bool isDependent() const { return found_.tested && found_.white < white_prior; }
  /// Σ K_iᵀ K_i.
  Eigen::Matrix<double, P, P> information() const {
    Eigen::Matrix<double, P, P> sum = Eigen::Matrix<double, P, P>::Zero();
    for (const auto& row : rows_) sum += row.template leftCols<P>().transpose() * row.template leftCols<P>();
    return sum;
  }
  /// Σ u_iᵀ u_i.
  double power() const {
    double sum = 0;
    for (const auto& row : rows_) sum += row.col(P).squaredNorm();
    return sum;
  }
  /// Σ_ij c(t_i - t_j) K_iᵀ K_j under the weights of the cells.
  Eigen::Matrix<double, P, P> sandwich() const {
    Eigen::Matrix<double, P, P> middle = Eigen::Matrix<double, P, P>::Zero();
    for (std::size_t k = 0; k < cells_.size(); ++k) {
      if (cells_[k].weight <= min_weight) continue;  // each costs as much as any other
      const double variance = k == 0 && known_noise_ ? 1 : (cells_[k].*likelihood_).variance;
      middle += cells_[k].weight * variance * cellSandwich<C, P>(cells_[k], rows_, decayOf(k));
    }
    return middle;
  }

 private:
  static constexpr std::size_t min_rows = 20;
  static constexpr double white_prior = 0.8, min_weight = 1e-5, min_time_constants = 10;
  static constexpr std::array shares{.1, .25, .5, .75, .9, .97, 1 - 1e-6};

  const std::vector<double>& decayOf(std::size_t cell) const {
    return decay_[cell == 0 ? 0 : 1 + (cell - 1) / shares.size()];
  }
  void findDependence(const std::vector<double>& gaps, double duration, std::size_t fitted) {
    std::vector<double> sorted = gaps;
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
    // Many rows may have one time; their median gap is then no scale.
    const double shortest = std::max(0.7 * sorted[sorted.size() / 2], 1e-6 * duration), longest = 2 * duration;
    constexpr int steps = 9;
    cells_.push_back({.prior = white_prior});
    decay_.push_back(std::vector<double>(gaps.size(), 0.0));
    for (int k = 0; k < steps; ++k) {
      const double time_constant = shortest * std::pow(longest / shortest, k / (steps - 1.0));
      decay_.push_back(decays(gaps, time_constant));
      for (const double share : shares) {
        cells_.push_back({.time_constant = time_constant,
                          .share = share,
                          .prior = (1 - white_prior) / (steps * static_cast<double>(shares.size()))});
      }
    }
    judgeCells();
    // Over many time constants the residuals show the dependence by themselves. The restricted likelihood, which few of
    // them need, may take an error of the model that a shift of the parameters explains, such as a delay between
    // streams, for a process that drifts without end.
    if (!weigh()) return;
    if (C * rows_.size() < 20 * fitted || duration < min_time_constants * found_.time_constant) {
      likelihood_ = &TimeCell::restricted;
      if (!weigh()) return;
      const auto heaviest = std::max_element(cells_.begin(), cells_.end(),
                                             [](const auto& a, const auto& b) { return a.weight < b.weight; });
      const auto k = static_cast<std::size_t>(heaviest - cells_.begin());
      if (k != 0 && !isBelievable(*heaviest, decayOf(k))) {
        likelihood_ = &TimeCell::profile;
        weigh();
      }
    }
    found_.tested = true;
  }
  /// Judges the cells; where there are many rows, white noise and those cells alone that a block in the middle does not
  /// rule out.
  void judgeCells() {
    constexpr std::size_t many = 20000, block = 10000;
    constexpr double ruled_out = 40;  // of a logarithm of likelihoods
    std::vector<bool> worth(cells_.size(), true);
    if (rows_.size() > many) {
      const std::size_t first = (rows_.size() - block) / 2;
      const auto some = std::span<const TimedColumns<C, P>>(rows_).subspan(first, block);
      TimeCell::Judged restricted, profile;
      for (std::size_t k = 0; k < cells_.size(); ++k) {
        TimeCell& cell = cells_[k];
        judgeCell<C, P>(cell, some, std::span<const double>(decayOf(k)).subspan(first, block - 1), held_);
        restricted.log_likelihood = std::max(restricted.log_likelihood, cell.restricted.log_likelihood);
        profile.log_likelihood = std::max(profile.log_likelihood, cell.profile.log_likelihood);
      }
      for (std::size_t k = 0; k < cells_.size(); ++k) {
        TimeCell& cell = cells_[k];
        worth[k] = k == 0 || cell.restricted.log_likelihood > restricted.log_likelihood - ruled_out ||
                   cell.profile.log_likelihood > profile.log_likelihood - ruled_out;
        cell.restricted = cell.profile = {};
      }
    }
    for (std::size_t k = 0; k < cells_.size(); ++k) {
      if (worth[k]) judgeCell<C, P>(cells_[k], rows_, decayOf(k), held_);
    }
  }
  /// Weights, and what they say, by the likelihood.
  bool weigh() {
    double best = -std::numeric_limits<double>::infinity(), sum = 0;
    for (const TimeCell& cell : cells_) best = std::max(best, (cell.*likelihood_).log_likelihood);
    if (!std::isfinite(best)) return false;
    for (TimeCell& cell : cells_) sum += cell.weight = std::exp((cell.*likelihood_).log_likelihood - best);
    double log_time = 0, share = 0, others = 0;
    for (std::size_t k = 0; k < cells_.size(); ++k) {
      TimeCell& cell = cells_[k];
      cell.weight /= sum;
      if (k == 0) continue;
      others += cell.weight, share += cell.weight * cell.share;
      log_time += cell.weight * std::log(cell.time_constant);
    }
    found_.white = cells_.front().weight;
    if (others > 0) found_.share = share / others, found_.time_constant = std::exp(log_time / others);
    return true;
  }
  /// Residuals have the power s² (N - tr C M) under a cell. False where they have less than a third of it: the cell has
  /// taken what a shift of the parameters explains for a process that drifts, and claims errors that are not there.
  bool isBelievable(const TimeCell& cell, std::span<const double> decay) const {
    constexpr double min_share = 1. / 3;
    Eigen::Matrix<double, P, P> normal = information(), sandwich = cellSandwich<C, P>(cell, rows_, decay);
    double known = 0;
    for (int k = 0; k < P; ++k) {
      if (!held_[static_cast<std::size_t>(k)]) continue;
      holdParameter<P>(normal, k), holdParameter<P>(sandwich, k);
      ++known;
    }
    const double taken = Cholesky<double, P>(normal).template solve<P>(sandwich).trace() - known;
    const double left = static_cast<double>(C) * static_cast<double>(rows_.size()) - taken;
    return power() >= min_share * cell.restricted.variance * left;
  }

  bool known_noise_;
  std::array<bool, static_cast<std::size_t>(P)> held_;
  std::vector<TimedColumns<C, P>> rows_;    // sorted by time
  std::vector<TimeCell> cells_;             // white noise first
  std::vector<std::vector<double>> decay_;  // of white noise, then of each time constant
  TimeCell::Judged TimeCell::*likelihood_ = &TimeCell::profile;
  TimeDependence found_;
};

/// A covariance not below `plain` in any direction, and the mean factor by which it is larger.
template <int P>
struct WidenedCovariance {
  Eigen::Matrix<double, P, P> covariance;
  double factor = 1;

  /// C M C for the information C⁻¹ where it is larger; `plain` where a factor fails.
  WidenedCovariance(const Eigen::Matrix<double, P, P>& plain, const Eigen::Matrix<double, P, P>& information,
                    const Eigen::Matrix<double, P, P>& middle)
      : covariance(plain) {
    // In the coordinates where the plain covariance is the identity nothing becomes smaller.
    const Cholesky<double, P> root(plain), normal(information);
    if (!root.ok() || !normal.ok()) return;
    const Eigen::Matrix<double, P, P> L = root.lower();
    const Eigen::Matrix<double, P, P> half = normal.template solve<P>(middle);
    const Eigen::Matrix<double, P, P> sandwich = normal.template solve<P>(half.transpose());
    const Eigen::Matrix<double, P, P> left = root.template halfSolve<P>(sandwich);
    const Eigen::Matrix<double, P, P> scaled = root.template halfSolve<P>(left.transpose());
    const SymmetricEigen eigen(Eigen::Matrix<double, P, P>(0.5 * (scaled + scaled.transpose())));
    Eigen::Matrix<double, P, P> widened = Eigen::Matrix<double, P, P>::Identity();
    double trace = 0;
    for (int i = 0; i < P; ++i) {
      const double more = std::max(0.0, eigen.values[i] - 1);
      trace += 1 + more;
      widened += more * eigen.vectors.col(i) * eigen.vectors.col(i).transpose();
    }
    factor = trace / P;
    const Eigen::Matrix<double, P, P> larger = congruence(L, widened);
    covariance = 0.5 * (larger + larger.transpose());
  }
};

}  // namespace detail

/// Tests rows, in any order, and widens the covariance of their estimate, `plain`. White noise has the variance 1 in
/// units of the whitening if `known_noise`, else that of the residuals. At least 20 rows and three times as many
/// residuals as parameters are needed; rows of one time alone say nothing.
template <int C, int P>
TimedCovariance<P> timedCovariance(std::span<const TimedRow<C, P>> given, const Eigen::Matrix<double, P, P>& plain,
                                   bool known_noise) {
  const detail::TimeModel<C, P> model(given, known_noise);
  TimedCovariance<P> result{model.dependence(), plain};
  // Where the rows do not speak for a dependence the covariance is to the last bit what it was.
  if (!model.isDependent()) return result;
  const detail::WidenedCovariance<P> widened(plain, model.information(), model.sandwich());
  result.dependence.correlation_factor = widened.factor;
  result.covariance = widened.covariance;
  return result;
}

}  // namespace liestat
