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
#include <cstdint>
#include <functional>
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

/// Rows that are computed when they are needed, a block at a time: a long list of them takes more memory than all that
/// they are made of. Few are kept.
template <int C, int P>
class TimedRows {
 public:
  using Row = TimedRow<C, P>;
  /// Computes row i but for its time.
  using Compute = std::function<void(std::size_t i, Row& row)>;

  TimedRows() = default;
  TimedRows(std::vector<Row> rows) : kept_(std::move(rows)) { sortByTime(); }
  /// As many rows as times, in any order.
  TimedRows(std::vector<double> times, Compute compute) : times_(std::move(times)), compute_(std::move(compute)) {
    if (times_.size() <= block) {
      for (std::size_t i = 0; i < times_.size(); ++i) {
        Row& row = kept_.emplace_back();
        compute_(i, row);
        row.time = times_[i];
      }
      times_.clear(), compute_ = nullptr;
      sortByTime();
      return;
    }
    order_.resize(times_.size());
    std::iota(order_.begin(), order_.end(), 0U);
    std::stable_sort(order_.begin(), order_.end(), [&](auto i, auto k) { return times_[i] < times_[k]; });
  }

  std::size_t size() const { return compute_ ? times_.size() : kept_.size(); }
  double time(std::size_t i) const { return compute_ ? times_[order_[i]] : kept_[i].time; }
  /// Takes the step's effect off the residuals.
  void subtract(const Eigen::Matrix<double, P, 1>& step) {
    for (Row& row : kept_) row.residual() -= row.columns() * step;
    step_ = step;
  }
  /// Calls take(first, rows) for blocks of rows, in the order of their times.
  template <class Take>
  void forEachBlock(std::size_t begin, std::size_t end, Take&& take) const {
    if (!compute_) return take(begin, std::span<const Row>(kept_).subspan(begin, end - begin));
    std::vector<Row> rows(std::min(end - begin, small_block));
    for (std::size_t first = begin; first < end; first += small_block) {
      const std::size_t count = std::min(end - first, small_block);
      for (std::size_t k = 0; k < count; ++k) {
        Row& row = rows[k];
        compute_(order_[first + k], row);
        row.time = time(first + k);
        row.residual() -= row.columns() * step_;
      }
      take(first, std::span<const Row>(rows).first(count));
    }
  }
  template <class Take>
  void forEachBlock(Take&& take) const {
    forEachBlock(0, size(), std::forward<Take>(take));
  }

 private:
  static constexpr std::size_t block = 4096, small_block = 256;

  /// Equal times keep their order, so that the sums do.
  void sortByTime() {
    const auto earlier = [](const Row& x, const Row& y) { return x.time < y.time; };
    if (!std::is_sorted(kept_.begin(), kept_.end(), earlier)) std::stable_sort(kept_.begin(), kept_.end(), earlier);
  }

  std::vector<Row> kept_;
  std::vector<double> times_;  // of rows that are computed, in their own order
  std::vector<std::uint32_t> order_;
  Compute compute_;
  Eigen::Matrix<double, P, 1> step_ = Eigen::Matrix<double, P, 1>::Zero();
};

namespace detail {

/// The columns and the residuals of rows side by side, [K u].
template <int C, int P>
using TimedColumns = Eigen::Matrix<double, C, P + 1>;

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

/// Variances and gains of a scalar Kalman filter over rows with the share f of a Gauss–Markov process.
struct CellGains {
  double f, variance = f, log_det = 0, gain = 0, total = 1;
  bool started = false;

  /// Goes on by a row whose process has faded by `phi` since the row before; the state fades by what is returned.
  double next(double phi) {
    if (started) {
      variance = phi * phi * variance + f * (1 - phi * phi);
    } else {
      phi = 0, started = true;
    }
    total = variance + 1 - f, gain = variance / total;
    log_det += std::log(total);
    variance *= 1 - gain;
    return phi;
  }
};

/// [K u]ᵀ R⁻¹ [K u] and log det R of a cell, by the innovations of a scalar Kalman filter.
template <int C, int P>
struct CellSums {
  CellGains gains;
  TimedColumns<C, P> state = TimedColumns<C, P>::Zero();
  Eigen::Matrix<double, P + 1, P + 1> upper = Eigen::Matrix<double, P + 1, P + 1>::Zero();

  void add(const TimedColumns<C, P>& row, double decay) {
    state *= gains.next(decay);
    const TimedColumns<C, P> innovation = row - state;
    for (int j = 0; j <= P; ++j) {
      const Eigen::Matrix<double, C, 1> column = innovation.col(j) * (1 / gains.total);
      for (int k = 0; k <= j; ++k) upper(k, j) += innovation.col(k).dot(column);
    }
    state += gains.gain * innovation;
  }
  Eigen::Matrix<double, P + 1, P + 1> gram() const {
    Eigen::Matrix<double, P + 1, P + 1> whole = upper;
    for (int j = 0; j <= P; ++j) {
      for (int k = j + 1; k <= P; ++k) whole(k, j) = whole(j, k);
    }
    return whole;
  }
};

/// The likelihoods of a cell after `rows` rows, of which the parameters in `held` are known.
template <int C, int P>
void judgeCell(TimeCell& cell, const CellSums<C, P>& sums, std::size_t rows,
               const std::array<bool, static_cast<std::size_t>(P)>& held) {
  Eigen::Matrix<double, P + 1, P + 1> gram = sums.gram();
  double freedom = static_cast<double>(C) * static_cast<double>(rows);
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
  const auto judged = [&](double sum, double more) -> TimeCell::Judged {
    const double s2 = sum / freedom;
    return {s2, -0.5 * (freedom * std::log(s2) + C * sums.gains.log_det + more) + std::log(cell.prior)};
  };
  cell.restricted = judged(squares, normal.logDeterminant());
  cell.profile = judged(gram(P, P), 0);
}

/// Σ_{i≠j} e^(-|t_i - t_j|/τ) K_iᵀ K_j of rows with R channels.
template <int R, int P>
struct PastProducts {
  Eigen::Matrix<double, R, P> sum = Eigen::Matrix<double, R, P>::Zero();
  Eigen::Matrix<double, P, P> past = Eigen::Matrix<double, P, P>::Zero();

  void add(const Eigen::Matrix<double, R, P>& K, double decay) {
    sum *= decay;
    past += K.transpose() * sum;
    sum += K;
  }
};

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
  using Residual = Eigen::Matrix<double, C, 1>;
  using Square = Eigen::Matrix<double, C, C>;
  using Rows = std::span<const TimedRow<C, P>>;

 public:
  TimeModel(TimedRows<C, P> rows, bool known_noise, const std::array<bool, static_cast<std::size_t>(P)>& held = {})
      : known_noise_(known_noise), held_(held), rows_(std::move(rows)) {
    const std::size_t n = rows_.size();
    const auto fitted = static_cast<std::size_t>(std::count(held_.begin(), held_.end(), false));
    const double duration = n > 0 ? rows_.time(n - 1) - rows_.time(0) : 0;
    const bool enough = n >= min_rows && C * n >= 3 * fitted;
    const bool timed = enough && duration > 0 && std::isfinite(duration);
    if (timed) makeCells(duration);
    readRows();
    if (timed) findDependence(duration, fitted);
    if (enough && !known_noise_ && (!channels_.empty() || !isDependent())) judgeSizes(static_cast<double>(fitted));
  }

  const TimeDependence& dependence() const { return found_; }
  /// True where the rows speak for a dependence.
  bool isDependent() const { return found_.tested && found_.white < white_prior; }
  /// True where the sandwich is another than Σ K_iᵀ K_i times a factor.
  bool widens() const { return isDependent() || found_.unequal_axes; }
  /// Σ K_iᵀ K_i.
  const Matrix& information() const { return information_; }
  /// Σ u_iᵀ u_i.
  double power() const { return power_; }
  /// Σ_ij c(t_i - t_j) K_iᵀ K_j under the weights of the cells. With channels of their own not below that of all alike,
  /// which has more residuals for each of its numbers.
  Matrix sandwich() const {
    constexpr auto channels = static_cast<std::size_t>(C);
    Sandwich<C> of_all(amounts_);
    std::vector<Sandwich<1>> of_each;
    for (const std::vector<double>& amounts : channels_) of_each.emplace_back(amounts);
    rows_.forEachBlock([&](std::size_t first, Rows rows) {
      Decays decays(*this, first, rows.size());
      for (std::size_t i = 0; i < rows.size(); ++i) {
        const Eigen::Matrix<double, C, P> K = rows[i].columns();
        of_all.add(K, decays, i);
        if (of_each.empty()) continue;
        const Eigen::Matrix<double, C, P> turned = axes_ * K;
        for (std::size_t c = 0; c < channels; ++c) {
          of_each[c].add(Eigen::Matrix<double, 1, P>(turned.row(static_cast<int>(c))), decays, i);
        }
      }
    });
    if (of_each.empty()) return of_all.matrix();
    Matrix middle = Matrix::Zero();
    for (const Sandwich<1>& one : of_each) middle += one.matrix();
    return amounts_.empty() ? middle : LargerMatrix<P>(middle, of_all.matrix()).matrix;
  }

 private:
  static constexpr std::size_t min_rows = 20;
  static constexpr int steps = 9;
  static constexpr double white_prior = 0.8, min_weight = 1e-5, min_time_constants = 10, max_hidden = 3;
  static constexpr std::array shares{.1, .25, .5, .75, .9, .97, 1 - 1e-6};

  /// The time constant of a cell, by its number: 0 is white noise.
  static std::size_t timeOf(std::size_t cell) { return cell == 0 ? 0 : 1 + (cell - 1) / shares.size(); }
  /// exp(-Δ/τ) of the rows of a block from the row before, by the number of a time constant.
  class Decays {
   public:
    Decays(const TimeModel& model, std::size_t first, std::size_t count)
        : model_(model), first_(first), count_(count), lists_(model.time_constants_.size()) {}
    double operator()(std::size_t time, std::size_t i) {
      std::vector<double>& list = lists_[time];
      if (list.empty()) {
        const double tau = model_.time_constants_[time];
        for (std::size_t k = first_; k < first_ + count_; ++k) {
          const double gap = k > 0 ? model_.rows_.time(k) - model_.rows_.time(k - 1) : 0;
          list.push_back(tau > 0 ? std::exp(-gap / tau) : 0);
        }
      }
      return list[i];
    }

   private:
    const TimeModel& model_;
    std::size_t first_, count_;
    std::vector<std::vector<double>> lists_;
  };

  /// Σ_ij c(t_i - t_j) K_iᵀ K_j for the variances that the cells add.
  template <int R>
  struct Sandwich {
    explicit Sandwich(const std::vector<double>& amounts)
        : all(std::accumulate(amounts.begin(), amounts.end(), 0.0)), lasting(1), past(1) {
      for (std::size_t first = 1; first < amounts.size(); first += shares.size()) {
        double sum = 0;
        for (std::size_t k = 0; k < shares.size(); ++k) sum += amounts[first + k] * shares[k];
        lasting.push_back(sum), past.emplace_back();
      }
    }
    void add(const Eigen::Matrix<double, R, P>& K, Decays& decays, std::size_t i) {
      if (all == 0) return;
      own += K.transpose() * K;
      for (std::size_t time = 1; time < lasting.size(); ++time) {
        if (lasting[time] > 0) past[time].add(K, decays(time, i));
      }
    }
    Matrix matrix() const {
      Matrix middle = all * own;
      for (std::size_t time = 1; time < lasting.size(); ++time) {
        if (lasting[time] > 0) middle += lasting[time] * Matrix(past[time].past + past[time].past.transpose());
      }
      return middle;
    }

    double all;
    std::vector<double> lasting;
    std::vector<PastProducts<R, P>> past;
    Matrix own = Matrix::Zero();
  };

  void makeCells(double duration) {
    std::vector<double> gaps;
    for (std::size_t i = 1; i < rows_.size(); ++i) gaps.push_back(rows_.time(i) - rows_.time(i - 1));
    const auto middle = gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2);
    std::nth_element(gaps.begin(), middle, gaps.end());
    // Many rows may have one time; their median gap is then no scale.
    const double shortest = std::max(0.7 * *middle, 1e-6 * duration), longest = 2 * duration;
    cells_.push_back({.prior = white_prior});
    time_constants_.push_back(0);
    for (int k = 0; k < steps; ++k) {
      time_constants_.push_back(shortest * std::pow(longest / shortest, k / (steps - 1.0)));
      for (const double share : shares) {
        cells_.push_back({.time_constant = time_constants_.back(),
                          .share = share,
                          .prior = (1 - white_prior) / (steps * static_cast<double>(shares.size()))});
      }
    }
  }
  /// Sums over all rows, and over those cells that a block in the middle does not rule out where there are many.
  void readRows() {
    constexpr std::size_t many = 20000, block = 10000;
    constexpr double ruled_out = 40;  // of a logarithm of likelihoods
    std::vector<bool> worth(cells_.size(), true);
    if (rows_.size() > many) {
      const std::size_t first = (rows_.size() - block) / 2;
      judgeCells(first, first + block, worth, [](const TimedRow<C, P>&) {});
      TimeCell::Judged restricted, profile;
      for (const TimeCell& cell : cells_) {
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
    residuals_.reserve(rows_.size());
    judgeCells(0, rows_.size(), worth, [this](const TimedRow<C, P>& row) {
      information_ += row.columns().transpose() * row.columns();
      power_ += row.residual().squaredNorm();
      residuals_.push_back(row.residual());
    });
  }
  template <class Take>
  void judgeCells(std::size_t begin, std::size_t end, const std::vector<bool>& worth, const Take& take) {
    std::vector<CellSums<C, P>> sums;
    for (const TimeCell& cell : cells_) sums.push_back({{cell.share}});
    rows_.forEachBlock(begin, end, [&](std::size_t first, Rows rows) {
      Decays decays(*this, first, rows.size());
      for (std::size_t k = 0; k < cells_.size(); ++k) {
        if (!worth[k]) continue;
        for (std::size_t i = 0; i < rows.size(); ++i) sums[k].add(rows[i].values, decays(timeOf(k), i));
      }
      for (const TimedRow<C, P>& row : rows) take(row);
    });
    for (std::size_t k = 0; k < cells_.size(); ++k) {
      if (worth[k]) judgeCell<C, P>(cells_[k], sums[k], end - begin, held_);
    }
  }
  void findDependence(double duration, std::size_t fitted) {
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
      if (k != 0 && !isBelievable(*heaviest, timeOf(k))) {
        likelihood_ = &TimeCell::profile;
        weigh();
      }
    }
    found_.tested = true;
    amounts_ = amountsOf(likelihood_);
    if (C > 1 && likelihood_ == &TimeCell::profile) judgeChannels(static_cast<double>(fitted));
  }
  Square scatter() const {
    Square sum = Square::Zero();
    for (const Residual& u : residuals_) sum += u * u.transpose();
    return sum;
  }
  void turnToPrincipalAxes() {
    const Square all = scatter(), off = all - Square(all.trace() / C * Square::Identity());
    // Axes of the same variance are as good as any others.
    if (!(off.cwiseAbs().maxCoeff() > 1e-8 * all.trace())) return;
    axes_ = SymmetricEigen(all).vectors.transpose();
    for (Residual& u : residuals_) u = (axes_ * u).eval();
  }
  /// The likelihood ratio of axes of equal variances (Mauchly, with Bartlett's factor): noise that is known up to a
  /// factor is stated to have them, and the residuals may refute it. Each principal axis then has its own.
  void judgeSizes(double fitted) {
    if (C == 1) return;
    const double freedom = static_cast<double>(rows_.size()) - fitted / C;
    const Square covariance = scatter() / freedom;
    const Cholesky<double, C> root(covariance);
    if (!root.ok()) return;
    const double ratio = freedom * (C * std::log(covariance.trace() / C) - root.logDeterminant());
    const double bartlett = 1 - (2.0 * C * C + C + 2) / (6 * C * freedom);
    constexpr std::size_t degrees = C * (C + 1) / 2 - 1;
    found_.unequal_axes = chiSquaredTail(bartlett * ratio, degrees) < refutation_level;
    if (!found_.unequal_axes || !channels_.empty()) return;
    turnToPrincipalAxes();
    const Square turned = scatter();
    for (int c = 0; c < C; ++c) channels_.push_back({turned(c, c) / freedom});
  }
  /// Turns the residuals to their principal axes, and weighs the cells for each of them.
  void judgeChannels(double fitted) {
    const double freedom = static_cast<double>(rows_.size()) - fitted / C;
    turnToPrincipalAxes();
    const double of_white = std::pow(white_prior, 1.0 / C);
    const double of_others = (1 - of_white) / (static_cast<double>(cells_.size()) - 1);
    std::vector<Residual> squares;
    std::vector<double> log_dets;
    for (const TimeCell& cell : cells_) {
      CellGains gains{cell.share};
      Residual sum = Residual::Zero(), state = sum;
      const double tau = cell.time_constant;
      for (std::size_t i = 0; i < residuals_.size(); ++i) {
        state *= gains.next(tau > 0 && i > 0 ? std::exp((rows_.time(i - 1) - rows_.time(i)) / tau) : 0);
        const Residual innovation = residuals_[i] - state;
        sum += innovation.cwiseAbs2() * (1 / gains.total);
        state += gains.gain * innovation;
      }
      squares.push_back(sum), log_dets.push_back(gains.log_det);
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
  bool isBelievable(const TimeCell& cell, std::size_t time) const {
    constexpr double min_share = 1 / max_hidden;
    PastProducts<C, P> past;
    rows_.forEachBlock([&](std::size_t first, Rows rows) {
      Decays decays(*this, first, rows.size());
      for (std::size_t i = 0; i < rows.size(); ++i) past.add(rows[i].columns(), decays(time, i));
    });
    Matrix normal = information();
    Matrix sandwich = normal + cell.share * Matrix(past.past + past.past.transpose());
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
  TimedRows<C, P> rows_;
  std::vector<Residual> residuals_;  // in the order of times; along their principal axes, where channels are
  Square axes_ = Square::Identity();
  Matrix information_ = Matrix::Zero();
  double power_ = 0;
  std::vector<TimeCell> cells_;                // white noise first
  std::vector<double> time_constants_;         // of white noise, 0, then those of the grid
  std::vector<double> amounts_;                // of the cells, in all channels alike
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
TimedCovariance<P> timedCovariance(TimedRows<C, P> rows, const Eigen::Matrix<double, P, P>& plain, bool known_noise) {
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
