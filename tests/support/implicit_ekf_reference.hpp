// The implicit filter at fixed sizes, for comparison: as the library had it before its core was compiled once
// (stats/detail/filter_core.hpp).
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <lie/detail/small_reduced.hpp>
#include <stats/detail/measurement_block.hpp>
#include <stats/implicit_ekf.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace liestat_test {

using namespace liestat;

/// The equations at exp(x, v) and exp(y, w), with derivatives by v and w. At zero nothing is moved, not even by rounding.
template <class Equation, Homogeneous X, Homogeneous M>
auto linearizedEquations(const Equation& equation, const X& x, const TangentOf<X>& v, const M& y,
                         const TangentOf<M>& w) {
  constexpr int P = detail::equation_count<Equation, X, M>, N = ManifoldTraits<X>::DoF, K = ManifoldTraits<M>::DoF;
  static_assert(P != Eigen::Dynamic, "equations return a vector of fixed size");
  const bool state_moved = !v.isZero(0), measurement_moved = !w.isZero(0);
  EquationDerivatives<P, N, K> J = equation.linearize(state_moved ? exp(x, v) : x, measurement_moved ? exp(y, w) : y);
  if (state_moved) J.by_parameter = detail::product(J.by_parameter, detail::expJacobian(x, v));
  if (measurement_moved) J.by_measurement = detail::product(J.by_measurement, detail::expJacobian(y, w));
  return J;
}

/// The largest change of a coordinate in standard deviations of P; along exact directions there is none.
template <int N>
double changeInDeviations(const Eigen::Matrix<double, N, 1>& change, const Eigen::Matrix<double, N, N>& P) {
  double largest = 0;
  for (int i = 0; i < N; ++i) {
    if (P(i, i) > 0) largest = std::max(largest, std::abs(change[i]) / std::sqrt(P(i, i)));
  }
  return largest;
}

/// The Gaussian whose tangent coordinates at x have the mean v and the given covariance, in its own frame.
template <Homogeneous X>
Gaussian<X> movedGaussian(const X& x, const TangentOf<X>& v, const SquareOf<X>& covariance) {
  const SquareOf<X> moved = detail::congruence(detail::expJacobian(x, v), covariance);
  return {exp(x, v), 0.5 * (moved + moved.transpose())};
}

/// The argument of updateAll()'s callback: sums over independent measurements, linear in their number.
template <Homogeneous X>
class ReferenceSums {
 public:
  static constexpr int N = ManifoldTraits<X>::DoF;

  /// One measurement y with its noise and equations. Where its own squared distance, rᵀ (C P Cᵀ + D R Dᵀ)⁻¹ r at the
  /// prior, exceeds `gate` (a χ² threshold for its equations), it is left out and counted.
  template <Homogeneous M, NoiseModel Noise, class Equation>
  void add(const M& y, const Noise& noise, const Equation& equation,
           double gate = std::numeric_limits<double>::infinity()) {
    static_assert(Noise::dimension == ManifoldTraits<M>::DoF, "the noise has as many coordinates as the measurement");
    using Block = detail::MeasurementBlock<detail::equation_count<Equation, X, M>, N, ManifoldTraits<M>::DoF>;
    if (!noise.valid()) {
      fail(FilterStatus::singular);
      return;
    }
    Block block;
    typename Block::Correction w = Block::Correction::Zero();
    const bool first = pass_ == 0;
    if (first || std::isfinite(gate)) {
      if (!build(block, y, noise, equation, TangentOf<X>::Zero(), w)) return;
      if (std::isfinite(gate) && !(distance(block) <= gate)) {
        gated_ += first;
        return;
      }
    }
    if (!first) {
      // The correction that the state at hand asks for: the equations hold at (state, exp(y, w)).
      for (int i = 0; i < 10; ++i) {
        if (!build(block, y, noise, equation, v_, w)) return;
        const typename Block::Correction next = block.correction(Step::Zero());
        const double change = (next - w).norm(), size = next.norm();
        w = next;
        if (!(change > 1e-10 * size)) break;
      }
      if (!build(block, y, noise, equation, v_, w)) return;
    }
    const typename Block::Values r = block.r + detail::product(block.C, v_);
    A_ += detail::product(block.C.transpose(), block.C);
    b_ += detail::product(block.C.transpose(), r);
    squared_ += block.r.squaredNorm();
    equations_ += block.root.rank();
    ++measurements_;
  }

 private:
  template <Homogeneous>
  friend class ReferenceEkf;
  using Step = Eigen::Matrix<double, N, 1>;
  using Square = Eigen::Matrix<double, N, N>;

  explicit ReferenceSums(const Gaussian<X>& prior) : prior_(&prior) {}
  void begin(int pass, const Step& v) {
    pass_ = pass, v_ = v;
    A_.setZero(), b_.setZero();
    squared_ = 0, equations_ = 0, measurements_ = 0;
  }
  void fail(FilterStatus status) {
    if (status_ == FilterStatus::ok) status_ = status;
  }

  template <class Block, Homogeneous M, class Noise, class Equation>
  bool build(Block& block, const M& y, const Noise& noise, const Equation& equation, const Step& v,
             const typename Block::Correction& w) {
    constexpr int P = Block::Values::RowsAtCompileTime, rank = detail::equationRank<Equation, P>();
    const auto J = linearizedEquations(equation, prior_->mean, v, y, w);
    block.build(noise, J.value, J.by_parameter, J.by_measurement, w, rank);
    if (!block.finite || !block.C.allFinite() || !block.D.allFinite()) {
      fail(FilterStatus::not_finite);
      return false;
    }
    // An exact constraint of the state has no finite information: a row without noise that is not made of others.
    if (block.free.dimension == 0 && block.root.rank() < rank) {
      const auto S = detail::product(J.by_measurement, noise.template spread<P>(J.by_measurement));
      const Eigen::Matrix<double, P, P> X_rows = block.root.template halfSolve<P>(S);
      const Eigen::Matrix<double, P, N> left = J.by_parameter - detail::product(X_rows.transpose(), block.C);
      for (int i = 0; i < P; ++i) {
        bool kept = false;
        for (int k = 0; k < block.root.rank(); ++k) kept = kept || block.root.row(k) == i;
        if (kept || !(left.row(i).norm() > 1e-6 * J.by_parameter.row(i).norm())) continue;
        fail(FilterStatus::singular);
        return false;
      }
    }
    return true;
  }
  /// r̂ᵀ (I + Ĉ P Ĉᵀ)⁻¹ r̂ of whitened equations; those that are left out are zero.
  template <class Block>
  double distance(const Block& block) const {
    constexpr int P = Block::Values::RowsAtCompileTime;
    Eigen::Matrix<double, P, P> S = detail::congruence(block.C, prior_->covariance);
    S.diagonal().array() += 1;
    return detail::Cholesky<double, P>(S).template halfSolve<1>(block.r).squaredNorm();
  }

  const Gaussian<X>* prior_;
  Step v_ = Step::Zero(), b_ = Step::Zero();
  Square A_ = Square::Zero();
  double squared_ = 0;
  int pass_ = 0, equations_ = 0;
  std::size_t measurements_ = 0, gated_ = 0;
  FilterStatus status_ = FilterStatus::ok;
};

/// The filter: a state with its covariance, predictions and updates. See the header comment.
template <Homogeneous X>
class ReferenceEkf {
 public:
  static constexpr int N = ManifoldTraits<X>::DoF;
  static_assert(std::is_same_v<ScalarOf<X>, double>, "the filter works in double");

  explicit ReferenceEkf(const Gaussian<X>& start, const ImplicitEkfOptions& options = {})
      : state_(start), options_(options) {}

  /// The estimate; its covariance is in the local frame at its mean.
  const Gaussian<X>& state() const { return state_; }
  /// Starts again, or takes over what another step made of the state.
  void reset(const Gaussian<X>& state) { state_ = state; }

  /// One measurement, or several in one vector or Product with a joint noise. Nothing is inverted but the innovation's
  /// covariance, where that is singular its independent rows: the noise may be zero (an exact constraint of the state), the
  /// covariance of the state singular. `gate`: the NIS beyond which the state is left as it was.
  template <Homogeneous M, NoiseModel Noise, class Equation>
  auto update(const M& y, const Noise& noise, const Equation& equation,
              double gate = std::numeric_limits<double>::infinity()) {
    constexpr int P = detail::equation_count<Equation, X, M>, K = ManifoldTraits<M>::DoF;
    constexpr int independent = detail::equationRank<Equation, P>();
    static_assert(Noise::dimension == K, "the noise has as many coordinates as the measurement");
    static_assert(!detail::HasFreeDirections<Noise>, "free directions of a measurement need updateAll()");
    using Values = Eigen::Matrix<double, P, 1>;
    DenseFilterUpdate<X, P> result;
    const SquareOf<X>& prior = state_.covariance;
    const auto ended = [&](FilterStatus status) {
      result.status = status;
      return result;
    };
    if (!noise.valid() && !noise.covariance().isZero(0)) return ended(FilterStatus::singular);

    TangentOf<X> v = TangentOf<X>::Zero();
    TangentOf<M> w = TangentOf<M>::Zero();
    Gaussian<X> posterior = state_;
    const int passes = std::max(1, options_.max_iterations);
    result.status = passes > 1 ? FilterStatus::not_converged : FilterStatus::ok;
    while (result.iterations < passes) {
      const bool first = result.iterations == 0;
      const auto J = linearizedEquations(equation, state_.mean, v, y, w);
      const Values r = J.value - detail::product(J.by_parameter, v) - detail::product(J.by_measurement, w);
      const Eigen::Matrix<double, N, P> PC = detail::productTransposed(prior, J.by_parameter);
      const Eigen::Matrix<double, K, P> RD = noise.template spread<P>(J.by_measurement);
      const Eigen::Matrix<double, P, P> S = detail::product(J.by_parameter, PC) + detail::product(J.by_measurement, RD);
      if (!r.allFinite() || !S.allFinite() || !PC.allFinite()) {
        if (first) return ended(FilterStatus::not_finite);
        break;
      }
      const detail::ReducedRoot<double, P> root(S, detail::Pivoting::largest, independent);
      const Values whitened = root.template halfSolve<1>(r);
      if (first) {
        result.innovation = r;
        result.innovation_covariance = S;
        result.nis = whitened.squaredNorm();
        result.degrees_of_freedom = root.rank();
        if (root.rank() < independent) result.inconsistency = inconsistency(root, S, r, whitened);
        if (root.rank() == 0 || !(result.inconsistency <= options_.max_inconsistency)) {
          return ended(FilterStatus::singular);
        }
      } else if (root.rank() == 0) {
        break;
      }
      const Values multipliers = root.halfSolveTransposed(whitened);
      const TangentOf<X> next = -detail::product(PC, multipliers);
      const double change = changeInDeviations<N>(next - v, prior);
      v = next, w = -detail::product(RD, multipliers);
      ++result.iterations;
      if (first) {
        result.step = v;
        if (!(result.nis <= gate)) {
          result.gated = 1;
          return ended(FilterStatus::gated);
        }
      }
      const bool settled = !first && change <= options_.tolerance;
      if (first || settled) {
        const Gaussian<X> found = movedGaussian(state_.mean, v, josephForm(J, root, PC, noise));
        if (!detail::isFinite(found)) return ended(FilterStatus::not_finite);
        posterior = found;
        result.step = v;
      }
      if (settled) {
        result.status = FilterStatus::ok;
        break;
      }
    }
    result.measurements = 1;
    state_ = posterior;
    return result;
  }

  /// Independent measurements in information form. `visit` adds them to an ReferenceSums<X>, the same ones each time it is
  /// called: once, or for each iteration. The covariance of the state must be regular, and so must the noise of the
  /// equations (no exact constraint of the state).
  template <class Visit>
  FilterUpdate<X> updateAll(Visit&& visit) {
    FilterUpdate<X> result;
    const auto ended = [&](FilterStatus status) {
      result.status = status;
      return result;
    };
    if (!detail::isFinite(state_)) return ended(FilterStatus::not_finite);
    const detail::Cholesky<double, N> prior(state_.covariance);
    if (!prior.ok()) return ended(FilterStatus::singular);
    const SquareOf<X> prior_information = prior.inverse();

    ReferenceSums<X> sums(state_);
    Gaussian<X> posterior = state_;
    TangentOf<X> v = TangentOf<X>::Zero();
    const int passes = std::max(1, options_.max_iterations);
    result.status = passes > 1 ? FilterStatus::not_converged : FilterStatus::ok;
    while (result.iterations < passes) {
      const bool first = result.iterations == 0;
      sums.begin(result.iterations, v);
      visit(sums);
      if (first) {
        if (sums.status_ != FilterStatus::ok) return ended(sums.status_);
        result.measurements = sums.measurements_, result.gated = sums.gated_;
        result.degrees_of_freedom = sums.equations_;
        if (result.measurements == 0) return ended(result.gated > 0 ? FilterStatus::gated : FilterStatus::ok);
      }
      const detail::Cholesky<double, N> information(prior_information + sums.A_);
      if (sums.status_ != FilterStatus::ok || !information.ok()) {
        if (first) return ended(sums.A_.allFinite() ? FilterStatus::singular : FilterStatus::not_finite);
        break;
      }
      const TangentOf<X> next = information.template solve<1>(sums.b_);
      const double change = changeInDeviations<N>(next - v, state_.covariance);
      v = next;
      ++result.iterations;
      const bool settled = !first && change <= options_.tolerance;
      if (first || settled) {
        const Gaussian<X> found = movedGaussian(state_.mean, v, information.inverse());
        if (!detail::isFinite(found)) return ended(FilterStatus::not_finite);
        posterior = found;
        result.step = v;
      }
      // Woodbury's identity: hᵀ (C P Cᵀ + R)⁻¹ h = hᵀ R⁻¹ h - bᵀ (P⁻¹ + A)⁻¹ b.
      if (first) result.nis = std::max(0.0, sums.squared_ - sums.b_.dot(v));
      if (settled) {
        result.status = FilterStatus::ok;
        break;
      }
    }
    state_ = posterior;
    return result;
  }

 private:
  /// How far the rows that were left out are from what those that were kept say of them.
  template <int P>
  static double inconsistency(const detail::ReducedRoot<double, P>& root, const Eigen::Matrix<double, P, P>& S,
                              const Eigen::Matrix<double, P, 1>& r, const Eigen::Matrix<double, P, 1>& whitened) {
    const Eigen::Matrix<double, P, P> rows = root.template halfSolve<P>(S);
    double largest = 0;
    for (int i = 0; i < P; ++i) {
      bool kept = false;
      for (int k = 0; k < root.rank(); ++k) kept = kept || root.row(k) == i;
      if (kept) continue;
      double left = r[i], scale = 0;
      for (int k = 0; k < root.rank(); ++k) {
        left -= rows(k, i) * whitened[k];
        scale += std::abs(rows(k, i) * whitened[k]);
      }
      // Rounding alone is no contradiction, however small the deviation.
      if (!(std::abs(left) > 1e-10 * (std::abs(r[i]) + scale))) continue;
      largest = std::max(largest, std::abs(left) / std::sqrt(S(i, i)));
    }
    return largest;
  }

  /// (I - L C) P (I - L C)ᵀ + L D R Dᵀ Lᵀ in coordinates at the prior.
  template <int P, int K, class Noise>
  SquareOf<X> josephForm(const EquationDerivatives<P, N, K>& J, const detail::ReducedRoot<double, P>& root,
                         const Eigen::Matrix<double, N, P>& PC, const Noise& noise) const {
    const Eigen::Matrix<double, P, N> half = root.template halfSolve<N>(PC.transpose());
    Eigen::Matrix<double, N, P> gain;
    for (int i = 0; i < N; ++i) gain.row(i) = root.halfSolveTransposed(half.col(i)).transpose();
    const SquareOf<X> left = SquareOf<X>::Identity() - detail::product(gain, J.by_parameter);
    const Eigen::Matrix<double, N, K> by_noise = detail::product(gain, J.by_measurement);
    const SquareOf<X> covariance =
        detail::congruence(left, state_.covariance) + detail::product(by_noise, noise.template spread<N>(by_noise));
    return 0.5 * (covariance + covariance.transpose());
  }

  Gaussian<X> state_;
  ImplicitEkfOptions options_;
};

}  // namespace liestat_test
