// The measurements of one kind in a constrained estimate: their corrections, their linearised equations, their sums.
#pragma once

#include <lie/manifold.hpp>
#include <lie/rn.hpp>
#include <lie/detail/small_matrix.hpp>
#include <stats/detail/measurement_block.hpp>
#include <stats/measurement_noise.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat::detail {

/// Fixed-size vectors: exp and log are sums and differences.
template <class M>
constexpr bool is_vector = std::is_base_of_v<Eigen::MatrixBase<M>, M>;

/// Derivatives with respect to exp(x, v) at v where they are known with respect to a local step at y = exp(x, v).
template <Homogeneous M, int P>
Eigen::Matrix<double, P, ManifoldTraits<M>::DoF> inCoordinatesAt(
    const M& x, const M& y, const Eigen::Matrix<double, P, ManifoldTraits<M>::DoF>& J) {
  if constexpr (is_vector<M>) {
    return J;
  } else {
    const SquareOf<M> to_step = inverse<ScalarOf<M>, ManifoldTraits<M>::DoF>(errorVector(x, y).by_feature);
    return product(J, to_step.template cast<double>());
  }
}

/// How many equations are independent: all of them, unless they say how many.
template <class Equation, int P>
constexpr int equationRank() {
  if constexpr (requires { Equation::rank; }) {
    static_assert(Equation::rank > 0 && Equation::rank <= P, "between one and the number of equations");
    return Equation::rank;
  } else {
    return P;
  }
}

/// Step of the differences by which curvatures are found.
template <Homogeneous M>
double differenceStep(const M& x) {
  double size = 1;
  if constexpr (is_vector<M>) {
    size = x.template cast<double>().cwiseAbs().maxCoeff();
    if (!(size > 0)) size = 1;
  }
  return 6e-6 * size;
}

/// Criterion and equations at some point.
struct ChannelMerit {
  double cost = 0;       ///< Σ ‖ε‖²_Q
  double violation = 0;  ///< Σ ‖c‖ in units of the noise
  double squared_violation = 0;
};

template <Homogeneous Q, class Channel>
class ChannelState {
 public:
  using M = typename Channel::Measurement;
  using Noise = typename Channel::Noise;
  static constexpr int N = ManifoldTraits<Q>::DoF, K = ManifoldTraits<M>::DoF;
  static constexpr int P =
      std::remove_cvref_t<decltype(std::declval<const typename Channel::Equation&>()
                                       .linearize(std::declval<const Q&>(), std::declval<const M&>())
                                       .value)>::RowsAtCompileTime;
  static_assert(P != Eigen::Dynamic, "equations return a vector of fixed size");
  static_assert(Noise::dimension == K, "the noise has as many coordinates as the measurement");
  static constexpr int rank = equationRank<typename Channel::Equation, P>();
  using Block = MeasurementBlock<P, N, K>;
  using Step = typename Block::Step;
  using Correction = typename Block::Correction;
  using Values = typename Block::Values;
  using Square = Eigen::Matrix<double, N, N>;

  explicit ChannelState(const Channel& channel)
      : channel_(&channel), at_(channel.size(), Correction::Zero()), next_(at_), trial_(at_), blocks_(channel.size()) {
    for (std::size_t i = 0; i < at_.size() && i < channel.corrected.size(); ++i) {
      at_[i] = asDouble(log(channel.measurements[i], channel.corrected[i]));
    }
  }

  std::size_t size() const { return at_.size(); }
  bool valid() const {
    for (std::size_t i = 0; i < size(); ++i) {
      if (!channel_->noiseOf(i).valid()) return false;
      if (!asDouble(log(ManifoldTraits<M>::origin(), channel_->measurements[i])).allFinite()) return false;
    }
    return true;
  }

  /// Linearises at q and at the corrections; adds to A and b. False if something is not finite.
  bool linearize(const Q& q, Square& A, Step& b) {
    bool finite = true;
    for (std::size_t i = 0; i < size(); ++i) {
      const auto [values, by_parameter, by_measurement] = derivatives(q, i, at_[i]);
      Block& block = blocks_[i];
      block.build(channel_->noiseOf(i), values, by_parameter, by_measurement, at_[i], rank);
      finite = finite && block.finite;
      addSums(block.C, block.r, A, b);
    }
    return finite;
  }
  /// The same with the curvature of the equations, after linearize() and with the multipliers of the last step.
  void linearizeCurved(const Q& q, Square& A, Step& b) {
    curved_.clear();
    curved_.reserve(size());
    for (std::size_t i = 0; i < size(); ++i) {
      const Block& block = blocks_[i];
      curved_.emplace_back(block, channel_->noiseOf(i).information(), at_[i],
                           curvature(q, i, block.lagrange(multipliers_[i])));
      if (curved_.back().valid) {
        A += curved_.back().A, b += curved_.back().b;
      } else {
        addSums(block.C, block.r, A, b);
      }
    }
  }

  /// Corrections for a step; returns the largest multiplier in units of the noise.
  double step(const Step& delta, bool curved) {
    double largest = 0;
    multipliers_.resize(size());
    for (std::size_t i = 0; i < size(); ++i) {
      multipliers_[i] = blocks_[i].multipliers(delta);
      largest = std::max(largest, multipliers_[i].norm());
      next_[i] = curved && curved_[i].valid ? Correction(curved_[i].base + product(curved_[i].slope, delta))
                                            : blocks_[i].correction(delta);
    }
    return largest;
  }
  /// ‖Δε‖² of the step, in units of the noise; ε·Q Δε; the length of the step along free directions.
  double stepSquared() const {
    double sum = 0;
    for (std::size_t i = 0; i < size(); ++i) sum += channel_->noiseOf(i).squaredNorm(next_[i] - at_[i]);
    return sum;
  }
  double slope() const {
    double sum = 0;
    for (std::size_t i = 0; i < size(); ++i) {
      const auto& noise = channel_->noiseOf(i);
      sum += 0.5 * (noise.squaredNorm(next_[i]) - noise.squaredNorm(at_[i]) - noise.squaredNorm(next_[i] - at_[i]));
    }
    return sum;
  }
  /// The squared length of one rounding error in each coordinate, in units of the noise.
  double roundingSquared() const {
    constexpr double eps = std::numeric_limits<double>::epsilon();
    double sum = 0;
    for (std::size_t i = 0; i < size(); ++i) {
      Correction rounded = Correction::Constant(eps);
      if constexpr (is_vector<M>) rounded = eps * channel_->measurements[i].template cast<double>();
      sum += channel_->noiseOf(i).squaredNorm(rounded);
    }
    return sum;
  }
  double freeStep() const {
    double largest = 0;
    if constexpr (HasFreeDirections<Noise>) {
      for (std::size_t i = 0; i < size(); ++i) {
        if (blocks_[i].free.dimension == 0) continue;
        largest = std::max(largest, (next_[i] - at_[i]).norm() / (1 + measurementSize(i)));
      }
    }
    return largest;
  }

  /// Criterion and equations where the iteration stands, and where a step of a part `alpha` leads.
  ChannelMerit merit() const {
    ChannelMerit sum;
    for (std::size_t i = 0; i < size(); ++i) add(sum, i, at_[i], blocks_[i].value);
    return sum;
  }
  ChannelMerit tryStep(const Q& q, double alpha) {
    ChannelMerit sum;
    values_.resize(size());
    for (std::size_t i = 0; i < size(); ++i) {
      trial_[i] = at_[i] + alpha * (next_[i] - at_[i]);
      evaluate(sum, q, i);
    }
    return sum;
  }
  /// Sums of the second-order correction: the step that takes the equations at the trial point to zero.
  void addCorrectionSums(Step& b) const {
    for (std::size_t i = 0; i < size(); ++i) {
      b -= product(blocks_[i].C.transpose(), blocks_[i].whitened(values_[i]));
    }
  }
  /// Squared length of that correction.
  double correctionSquared(const Step& delta) const {
    double sum = 0;
    for (std::size_t i = 0; i < size(); ++i) {
      sum += channel_->noiseOf(i).squaredNorm(blocks_[i].correctionOf(values_[i], delta));
    }
    return sum;
  }
  ChannelMerit tryCorrected(const Q& q, const Step& delta) {
    ChannelMerit sum;
    for (std::size_t i = 0; i < size(); ++i) {
      trial_[i] += blocks_[i].correctionOf(values_[i], delta);
      evaluate(sum, q, i);
    }
    return sum;
  }
  void accept() { at_.swap(trial_); }
  void acceptFull() { at_ = next_; }

  int keptEquations() const {
    int sum = 0;
    for (const Block& block : blocks_) sum += block.root.rank();
    return sum;
  }
  int droppedEquations() const {
    int sum = 0;
    for (const Block& block : blocks_) {
      sum += rank - block.root.rank();
      // Those that find the free directions are not lost.
      if (block.free.dimension > 0) sum -= rank - std::min(rank, selected(block));
    }
    return sum;
  }
  /// Those among them that do not hold, because the coordinates that they depend on are exact.
  int unmetEquations(const Q& q) const {
    int sum = 0;
    for (std::size_t i = 0; i < size(); ++i) {
      const Block& block = blocks_[i];
      if (block.free.dimension > 0 || block.root.rank() >= rank) continue;
      const Derivatives J = derivatives(q, i, at_[i]);
      sum +=
          detail::unmetEquations<P, K>(block.root, J.values, J.by_measurement, typicalDeviation(channel_->noiseOf(i)));
    }
    return sum;
  }
  std::size_t uninformative() const {
    std::size_t sum = 0;
    for (const Block& block : blocks_) sum += block.free.dimension > 0 && selected(block) == 0;
    return sum;
  }

  const Correction& correction(std::size_t i) const { return at_[i]; }
  M corrected(std::size_t i) const { return moved(i, at_[i]); }
  /// The covariance of the corrected measurement, coordinates at what was observed; Λ that of the parameter.
  Eigen::Matrix<double, K, K> covarianceOf(std::size_t i, const Square& covariance) const {
    const Block& block = blocks_[i];
    const Eigen::Matrix<double, K, K> V = channel_->noiseOf(i).covariance();
    const Eigen::Matrix<double, K, N> slope = product(block.G, block.C);
    return V - productTransposed(block.G, block.G) + congruence(slope, covariance);
  }
  /// p_i - tr(S⁻¹ C Λ Cᵀ), what ‖m̃ - m‖²_Q is expected to be.
  double expectedSquare(std::size_t i, const Square& covariance) const {
    return blocks_[i].root.rank() - congruence(blocks_[i].C, covariance).trace();
  }
  int equationsOf(std::size_t i) const { return blocks_[i].root.rank(); }

 private:
  struct Derivatives {
    Values values;
    typename Block::ByParameter by_parameter;
    typename Block::ByMeasurement by_measurement;
  };

  template <class Vector>
  static Correction asDouble(const Vector& v) {
    return v.template cast<double>();
  }
  M moved(std::size_t i, const Correction& correction) const {
    return exp(channel_->measurements[i], TangentOf<M>(correction.template cast<ScalarOf<M>>()));
  }
  double measurementSize(std::size_t i) const {
    if constexpr (is_vector<M>) return channel_->measurements[i].template cast<double>().norm();
    return 0;
  }
  Derivatives derivatives(const Q& q, std::size_t i, const Correction& at) const {
    const M m = moved(i, at);
    const auto J = channel_->equationOf(i).linearize(q, m);
    return {J.value.template cast<double>(), J.by_parameter.template cast<double>(),
            inCoordinatesAt<M, P>(channel_->measurements[i], m, J.by_measurement.template cast<double>())};
  }
  static void addSums(const typename Block::ByParameter& C, const Values& r, Square& A, Step& b) {
    for (int k = 0; k < P; ++k) {
      for (int j = 0; j < N; ++j) {
        b[j] += C(k, j) * r[k];
        for (int l = 0; l < N; ++l) A(l, j) += C(k, l) * C(k, j);
      }
    }
  }
  void add(ChannelMerit& sum, std::size_t i, const Correction& correction, const Values& whitened) const {
    sum.cost += channel_->noiseOf(i).squaredNorm(correction);
    sum.violation += whitened.norm();
    sum.squared_violation += whitened.squaredNorm();
  }
  void evaluate(ChannelMerit& sum, const Q& q, std::size_t i) {
    values_[i] = asValues(channel_->equationOf(i)(q, moved(i, trial_[i])));
    add(sum, i, trial_[i], blocks_[i].whitened(values_[i]));
  }
  template <class Vector>
  static Values asValues(const Vector& values) {
    if constexpr (std::is_arithmetic_v<Vector>) {
      return Values::Constant(values);
    } else {
      return values.template cast<double>();
    }
  }
  static int selected(const Block& block) {
    int rows = 0;
    for (int k = 0; k < P; ++k) rows += block.free.selection.row(k).squaredNorm() > 0;
    return rows;
  }
  /// Second derivatives of λᵀ c with respect to parameter and measurement, by central differences of the first.
  Eigen::Matrix<double, N + K, N + K> curvature(const Q& q, std::size_t i, const Values& lambda) const {
    using Gradient = Eigen::Matrix<double, N + K, 1>;
    Eigen::Matrix<double, N + K, N + K> H;
    const auto gradient = [&](const Step& delta, const Correction& at) {
      const Q y = exp(q, TangentOf<Q>(delta.template cast<ScalarOf<Q>>()));
      const Derivatives J = derivatives(y, i, at);
      Gradient g;
      g << product(inCoordinatesAt<Q, P>(q, y, J.by_parameter).transpose(), lambda),
          product(J.by_measurement.transpose(), lambda);
      return g;
    };
    const double step_q = differenceStep(q), step_m = differenceStep(channel_->measurements[i]);
    for (int k = 0; k < N + K; ++k) {
      Step delta = Step::Zero();
      Correction by = Correction::Zero();
      const double h = k < N ? step_q : step_m;
      if (k < N) {
        delta[k] = h;
      } else {
        by[k - N] = h;
      }
      H.col(k) = (gradient(delta, at_[i] + by) - gradient(-delta, at_[i] - by)) / (2 * h);
    }
    return 0.5 * (H + H.transpose());
  }

  const Channel* channel_;
  std::vector<Correction> at_, next_, trial_;
  std::vector<Block> blocks_;
  std::vector<CurvedBlock<P, N, K>> curved_;
  std::vector<Values> multipliers_, values_;
};

}  // namespace liestat::detail
