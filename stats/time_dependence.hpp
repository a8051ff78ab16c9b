// Errors of successive measurements that are not independent: the covariance of an estimate from rows with times, by
// the dependence that the rows themselves show. The estimate stays what it is, its covariance is widened.
//
// The whitened residuals u_i of n rows are a Gauss–Markov process and white noise, in each channel alike:
// E[u_i u_j] = s² ρ(t_i - t_j), ρ(Δ) = f e^(-|Δ|/τ) + (1 - f)[Δ = 0]. The restricted likelihood of (τ, f), s² being
// maximised, weighs the cells of a grid and white noise, which has a prior of 0.8; the mean c(Δ) of s² ρ(Δ) under these
// weights makes the sandwich C M C, M = Σ_ij c(t_i - t_j) K_iᵀ K_j, round C = (Σ K_iᵀ K_i)⁻¹, K_i the whitened columns.
// Where the record holds many time constants, each principal axis of the residuals has an s², a τ and an f of its own:
// of a planar target's poses the loud channels are nearly white, and the quiet ones, which decide, last for seconds.
// Likelihoods come from a scalar Kalman filter whose gains all channels and columns share: O(n) a cell. Residuals alone
// cannot show an error that the parameters explain, so that no block or sandwich of residuals will do; a model
// extrapolates (docs/hand_eye.md, "Dependence in time").
#pragma once

#include <lie/detail/small_eigen.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/noise_fit.hpp>
#include <stats/time_dependence_types.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

namespace liestat {

/// A row: whitened residuals in C channels, and their derivatives by P parameters, in the same units.
template <int C, int P>
struct TimedRow {
  double time = 0;                         ///< s
  Eigen::Matrix<double, C, P + 1> values;  ///< the derivatives, then the residual

  auto columns() { return values.template leftCols<P>(); }
  auto columns() const { return values.template leftCols<P>(); }
  auto residual() { return values.col(P); }
  auto residual() const { return values.col(P); }
};

/// The dependence of rows and the covariance that holds with it.
template <int P>
struct TimedCovariance {
  TimeDependence dependence;
  Eigen::Matrix<double, P, P> covariance;  ///< not below the plain one in any direction; that, if nothing was tested
};

namespace detail {

/// The columns and the residuals of rows side by side, [K u].
template <int C, int P>
using TimedColumns = Eigen::Matrix<double, C, P + 1>;
template <int C, int P>
struct AllChannels {
  std::span<const TimedRow<C, P>> rows;
  std::size_t size() const { return rows.size(); }
  const TimedColumns<C, P>& operator[](std::size_t i) const { return rows[i].values; }
};
/// The same of one channel.
template <int C, int P>
struct OneChannel {
  std::span<const TimedRow<C, P>> rows;
  int channel;
  std::size_t size() const { return rows.size(); }
  Eigen::Matrix<double, 1, P + 1> operator[](std::size_t i) const { return rows[i].values.row(channel); }
};

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

/// Σ of the innovations' squares of each channel, and log det R, which the channels share.
template <int C, int P, class Rows>
std::pair<Eigen::Matrix<double, C, 1>, double> channelSums(double f, const Rows& rows, std::span<const double> decay) {
  Eigen::Matrix<double, C, 1> squares = Eigen::Matrix<double, C, 1>::Zero(), state = squares;
  double log_det = 0, variance = f;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (i > 0) {
      const double phi = decay[i - 1];
      state *= phi;
      variance = phi * phi * variance + f * (1 - phi * phi);
    }
    const double total = variance + 1 - f, gain = variance / total;
    const Eigen::Matrix<double, C, 1> innovation = rows[i].col(P) - state;
    squares += innovation.cwiseAbs2() * (1 / total);
    log_det += std::log(total);
    state += gain * innovation;
    variance *= 1 - gain;
  }
  return {squares, log_det};
}

/// Σ_i K_iᵀ K_i.
template <int P, class Rows>
Eigen::Matrix<double, P, P> ownProducts(const Rows& rows) {
  Eigen::Matrix<double, P, P> sum = Eigen::Matrix<double, P, P>::Zero();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto K = rows[i].template leftCols<P>().eval();
    sum += K.transpose() * K;
  }
  return sum;
}
/// Σ_{i≠j} e^(-|t_i - t_j|/τ) K_iᵀ K_j.
template <int P, class Rows>
Eigen::Matrix<double, P, P> pastProducts(const Rows& rows, std::span<const double> decay) {
  Eigen::Matrix<double, P, P> past = Eigen::Matrix<double, P, P>::Zero();
  auto sum = rows[0].template leftCols<P>().eval();
  for (std::size_t i = 1; i < rows.size(); ++i) {
    const auto K = rows[i].template leftCols<P>().eval();
    sum = decay[i - 1] * sum;
    past += K.transpose() * sum;
    sum += K;
  }
  return past + past.transpose();
}

/// A symmetric matrix not below `first`, to which it is equal where the other is below, nor below `second` in any
/// direction, and the mean factor by which it is larger than the first.
template <int P>
struct LargerMatrix {
  Eigen::Matrix<double, P, P> matrix;
  double factor = 1;

  LargerMatrix(const Eigen::Matrix<double, P, P>& first, const Eigen::Matrix<double, P, P>& second) : matrix(first) {
    // In the coordinates where the first is the identity; one that leaves directions open is taken as it is.
    const Cholesky<double, P> root(first);
    Eigen::Matrix<double, P, P> more = second - first;
    if (root.ok()) {
      const Eigen::Matrix<double, P, P> left = root.template halfSolve<P>(more);
      more = root.template halfSolve<P>(left.transpose());
    }
    const SymmetricEigen eigen(Eigen::Matrix<double, P, P>(0.5 * (more + more.transpose())));
    more.setZero();
    for (int i = 0; i < P; ++i) {
      if (eigen.values[i] > 0) more += eigen.values[i] * eigen.vectors.col(i) * eigen.vectors.col(i).transpose();
    }
    if (root.ok()) factor += more.trace() / P, more = congruence(Eigen::Matrix<double, P, P>(root.lower()), more);
    matrix += 0.5 * (more + more.transpose());
  }
};

/// The dependence that rows show, for the covariance of scores of their columns. Parameters in `held` are known: their
/// columns stand beside the others, and the residuals were not fitted to them.
template <int C, int P>
class TimeModel {
  using Matrix = Eigen::Matrix<double, P, P>;

 public:
  TimeModel(std::vector<TimedRow<C, P>> rows, bool known_noise,
            const std::array<bool, static_cast<std::size_t>(P)>& held = {})
      : known_noise_(known_noise), held_(held), rows_(std::move(rows)) {
    sortByTime();
    std::vector<double> gaps;
    for (std::size_t i = 1; i < rows_.size(); ++i) gaps.push_back(rows_[i].time - rows_[i - 1].time);
    const auto fitted = static_cast<std::size_t>(std::count(held_.begin(), held_.end(), false));
    if (rows_.size() < min_rows || C * rows_.size() < 3 * fitted) return;
    const double duration = rows_.back().time - rows_.front().time;
    if (duration > 0 && std::isfinite(duration)) findDependence(gaps, duration, fitted);
    if (!known_noise_ && (!channels_.empty() || !isDependent())) judgeSizes(static_cast<double>(fitted));
  }

  const TimeDependence& dependence() const { return found_; }
  /// True where the rows speak for a dependence.
  bool isDependent() const { return found_.tested && found_.white < white_prior; }
  /// True where the sandwich is another than Σ K_iᵀ K_i times a factor.
  bool widens() const { return isDependent() || found_.unequal_axes; }
  /// Σ K_iᵀ K_i.
  Matrix information() const { return ownProducts<P>(all()); }
  /// Σ u_iᵀ u_i.
  double power() const {
    double sum = 0;
    for (const auto& row : rows_) sum += row.residual().squaredNorm();
    return sum;
  }
  /// Σ_ij c(t_i - t_j) K_iᵀ K_j under the weights of the cells. With channels of their own not below that of all alike,
  /// which has more residuals for each of its numbers.
  Matrix sandwich() const {
    if (channels_.empty()) return sandwichOf(all(), amounts_);
    Matrix middle = Matrix::Zero();
    for (int c = 0; c < C; ++c) {
      middle += sandwichOf(OneChannel<C, P>{rows_, c}, channels_[static_cast<std::size_t>(c)]);
    }
    return amounts_.empty() ? middle : LargerMatrix<P>(middle, sandwichOf(all(), amounts_)).matrix;
  }

 private:
  static constexpr std::size_t min_rows = 20;
  static constexpr double white_prior = 0.8, min_weight = 1e-5, min_time_constants = 10, max_hidden = 3;
  static constexpr std::array shares{.1, .25, .5, .75, .9, .97, 1 - 1e-6};

  AllChannels<C, P> all() const { return {rows_}; }
  /// Equal times keep their order, so that the sums do.
  void sortByTime() {
    const auto earlier = [](const auto& x, const auto& y) { return x.time < y.time; };
    if (std::is_sorted(rows_.begin(), rows_.end(), earlier)) return;
    std::vector<std::size_t> order(rows_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](auto i, auto k) { return earlier(rows_[i], rows_[k]); });
    // In place, cycle by cycle: a row is large.
    for (std::size_t first = 0; first < order.size(); ++first) {
      const TimedRow<C, P> kept = rows_[first];
      std::size_t to = first;
      for (std::size_t from = order[to]; from != first; from = order[to]) {
        rows_[to] = rows_[from];
        order[to] = to;
        to = from;
      }
      rows_[to] = kept;
      order[to] = to;
    }
  }
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
    amounts_ = amountsOf(likelihood_);
    if (C > 1 && likelihood_ == &TimeCell::profile) judgeChannels(static_cast<double>(fitted));
  }
  Eigen::Matrix<double, C, C> scatter() const {
    Eigen::Matrix<double, C, C> sum = Eigen::Matrix<double, C, C>::Zero();
    for (const auto& row : rows_) sum += row.residual() * row.residual().transpose();
    return sum;
  }
  void turnToPrincipalAxes() {
    using Square = Eigen::Matrix<double, C, C>;
    const Square all = scatter(), off = all - Square(all.trace() / C * Square::Identity());
    // Axes of the same variance are as good as any others.
    if (!(off.cwiseAbs().maxCoeff() > 1e-8 * all.trace())) return;
    const Square axes = SymmetricEigen(all).vectors.transpose();
    for (auto& row : rows_) row.values = (axes * row.values).eval();
  }
  /// The likelihood ratio of axes of equal variances (Mauchly, with Bartlett's factor): noise that is known up to a factor
  /// is stated to have them, and the residuals may refute it. Each principal axis then has its own.
  void judgeSizes(double fitted) {
    if (C == 1) return;
    const double freedom = static_cast<double>(rows_.size()) - fitted / C;
    const Eigen::Matrix<double, C, C> covariance = scatter() / freedom;
    const Cholesky<double, C> root(covariance);
    if (!root.ok()) return;
    const double ratio = freedom * (C * std::log(covariance.trace() / C) - root.logDeterminant());
    const double bartlett = 1 - (2.0 * C * C + C + 2) / (6 * C * freedom);
    constexpr std::size_t degrees = C * (C + 1) / 2 - 1;
    found_.unequal_axes = chiSquaredTail(bartlett * ratio, degrees) < refutation_level;
    if (!found_.unequal_axes || !channels_.empty()) return;
    turnToPrincipalAxes();
    for (int c = 0; c < C; ++c) channels_.push_back({scatter()(c, c) / freedom});
  }
  /// Turns the rows to the principal axes of their residuals, and weighs the cells for each of them.
  void judgeChannels(double fitted) {
    const double freedom = static_cast<double>(rows_.size()) - fitted / C;
    turnToPrincipalAxes();
    const double of_white = std::pow(white_prior, 1.0 / C);
    const double of_others = (1 - of_white) / (static_cast<double>(cells_.size()) - 1);
    std::vector<Eigen::Matrix<double, C, 1>> squares;
    std::vector<double> log_dets;
    for (std::size_t k = 0; k < cells_.size(); ++k) {
      const auto [sum, log_det] = channelSums<C, P>(cells_[k].share, all(), decayOf(k));
      squares.push_back(sum), log_dets.push_back(log_det);
    }
    const TimeDependence of_all = found_;
    double white = 1, dependent = 0, share = 0, log_time = 0;
    for (int c = 0; c < C; ++c) {
      for (std::size_t k = 0; k < cells_.size(); ++k) {
        const double s2 = squares[k][c] / freedom;
        const double prior = k == 0 ? of_white : of_others;
        // A process has more variance than its residuals show, but over many time constants not much more.
        cells_[k].profile = {std::min(s2, max_hidden * squares[0][c] / freedom),
                             -0.5 * (freedom * std::log(s2) + log_dets[k]) + std::log(prior)};
      }
      // A channel without errors has no likelihood.
      if (!weigh()) {
        channels_.clear();
        found_ = of_all;
        return;
      }
      white *= found_.white;
      const double weight = 1 - found_.white;
      if (weight > 0) {
        dependent += weight, share += weight * found_.share, log_time += weight * std::log(found_.time_constant);
      }
      channels_.push_back(amountsOf(&TimeCell::profile));
    }
    found_.white = white;
    if (dependent > 0) found_.share = share / dependent, found_.time_constant = std::exp(log_time / dependent);
  }
  /// The variance that each cell adds under the weights.
  std::vector<double> amountsOf(TimeCell::Judged TimeCell::*likelihood) const {
    std::vector<double> list;
    for (const TimeCell& cell : cells_) {
      const double variance = list.empty() && known_noise_ ? 1 : (cell.*likelihood).variance;
      list.push_back(cell.weight > min_weight ? cell.weight * variance : 0);
    }
    return list;
  }
  template <class Rows>
  Matrix sandwichOf(const Rows& rows, const std::vector<double>& amounts) const {
    Matrix middle = std::accumulate(amounts.begin(), amounts.end(), 0.0) * ownProducts<P>(rows);
    for (std::size_t first = 1; first < amounts.size(); first += shares.size()) {
      double lasting = 0;
      for (std::size_t k = first; k < first + shares.size(); ++k) lasting += amounts[k] * cells_[k].share;
      if (lasting > 0) middle += lasting * pastProducts<P>(rows, decayOf(first));
    }
    return middle;
  }
  /// Judges the cells; where there are many rows, white noise and those cells alone that a block in the middle does not
  /// rule out.
  void judgeCells() {
    constexpr std::size_t many = 20000, block = 10000;
    constexpr double ruled_out = 40;  // of a logarithm of likelihoods
    std::vector<bool> worth(cells_.size(), true);
    if (rows_.size() > many) {
      const std::size_t first = (rows_.size() - block) / 2;
      const AllChannels<C, P> some{std::span<const TimedRow<C, P>>(rows_).subspan(first, block)};
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
      if (worth[k]) judgeCell<C, P>(cells_[k], all(), decayOf(k), held_);
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
    constexpr double min_share = 1 / max_hidden;
    Matrix normal = information();
    Matrix sandwich = normal + cell.share * pastProducts<P>(all(), decay);
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
  std::vector<TimedRow<C, P>> rows_;        // sorted by time; residuals along their principal axes, where channels are
  std::vector<TimeCell> cells_;             // white noise first
  std::vector<std::vector<double>> decay_;  // of white noise, then of each time constant
  std::vector<double> amounts_;             // of the cells, in all channels alike
  std::vector<std::vector<double>> channels_;  // the same of each channel; else empty
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
    const Cholesky<double, P> normal(information);
    if (!Cholesky<double, P>(plain).ok() || !normal.ok()) return;
    const Eigen::Matrix<double, P, P> half = normal.template solve<P>(middle);
    const LargerMatrix<P> larger(plain, normal.template solve<P>(half.transpose()));
    covariance = larger.matrix, factor = larger.factor;
  }
};

}  // namespace detail

/// Tests rows, in any order, and widens the covariance of their estimate, `plain`. White noise has the variance 1 in
/// units of the whitening if `known_noise`, else that of the residuals. At least 20 rows and three times as many
/// residuals as parameters are needed; rows of one time alone say nothing.
template <int C, int P>
TimedCovariance<P> timedCovariance(std::vector<TimedRow<C, P>> rows, const Eigen::Matrix<double, P, P>& plain,
                                   bool known_noise) {
  const detail::TimeModel<C, P> model(std::move(rows), known_noise);
  TimedCovariance<P> result{model.dependence(), plain};
  // Where the rows do not speak for a dependence the covariance is to the last bit what it was.
  if (!model.widens()) return result;
  const detail::WidenedCovariance<P> widened(plain, model.information(), model.sandwich());
  result.dependence.correlation_factor = widened.factor;
  result.covariance = widened.covariance;
  return result;
}

}  // namespace liestat
