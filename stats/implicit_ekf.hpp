// Implicit extended Kalman filter on manifolds: a state x, measurements y with their noise, and equations h(x, y) = 0
// that hold between the true values. Nothing has to be solved for the measurement.
//
//   ImplicitEkf<S2d> filter({start, covariance});
//   filter.predict(process_noise);
//   const auto result = filter.update(pair, IsotropicNoise<4>(sigma), autoDiff(Epipolar{}));       // dense form
//   const auto all = filter.updateAll([&](auto& sums) {                                            // information form
//     for (const Pair& pair : pairs) sums.add(pair, IsotropicNoise<4>(sigma), autoDiff(Epipolar{}));
//   });
//
// State and measurements are points of any manifold, errors are x·Exp(e) in local frames. Equations are those of
// stats/constrained.hpp: `e(x, y)` and `e.linearize(x, y)`, an EquationDerivatives in local frames, by hand or by
// `autoDiff` of stats/auto_diff.hpp; `static constexpr int rank` where they are redundant by construction. Noises are
// those of stats/measurement_noise.hpp.
//
// With h(exp(x, a), exp(y, b)) = h + C a + D b + …, prior covariance P and noise R the innovation h has the covariance
// S = C P Cᵀ + D R Dᵀ, the step is minus the gain times the innovation, -P Cᵀ S⁻¹ h, and the covariance
// (I - L C) P (I - L C)ᵀ + L D R Dᵀ Lᵀ (Joseph's form, positive semi-definite for any gain L). The information form sums
// Cᵀ (D R Dᵀ)⁻¹ C over independent measurements: linear in their number, the same result. Then the covariance is carried to
// the frame at the new estimate by the derivative of exp. With `max_iterations` above one the equations are linearised
// again at the new state and the corrected measurement, until the most probable state is reached.
//
// Nothing throws, and nothing is allocated but where a measurement has free directions; an update that fails leaves the
// state as it was. The updates are compiled once (stats/detail/compiled.hpp); what is here tells them state, noise and
// equations.
//
// Sources: S. Soatto and P. Perona, "Robust and efficient recovery of rigid motion from subspace constraints", 1994,
// section 3 (the sign of the step corrected); R. Steffen and C. Beder, "Recursive estimation with implicit constraints",
// DAGM 2007 (iteration). docs/implicit_ekf.md has the mathematics.
#pragma once

#include <lie/detail/small_products.hpp>
#include <lie/manifold.hpp>
#include <lie/rn.hpp>
#include <stats/constrained_types.hpp>
#include <stats/detail/filter_core.hpp>
#include <stats/detail/number_rows.hpp>
#include <stats/gaussian.hpp>
#include <stats/implicit_ekf_types.hpp>
#include <stats/measurement_noise.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <memory>
#include <type_traits>
#include <utility>

namespace liestat {
namespace detail {

/// Derivative of exp(x, v) with respect to v, local frame at exp(x, v); exact.
template <Homogeneous M>
SquareOf<M> expJacobian(const M& x, const TangentOf<M>& v) {
  using T = ManifoldTraits<M>;
  if constexpr (HasTrivialIsotropy<M>) {
    return T::dexpOrigin(v);
  } else {
    return product(SquareOf<M>(T::isotropy(T::placement(x), T::expOrigin(v))), SquareOf<M>(T::dexpOrigin(v)));
  }
}

/// The number of equations.
template <class Equation, class X, class M>
constexpr int equation_count =
    std::remove_cvref_t<decltype(std::declval<const Equation&>()
                                     .linearize(std::declval<const X&>(), std::declval<const M&>())
                                     .value)>::RowsAtCompileTime;

template <Homogeneous X>
bool isFinite(const Gaussian<X>& g) {
  return g.covariance.allFinite() && log(ManifoldTraits<X>::origin(), g.mean).allFinite();
}

/// A state before an update, and where the update has moved it.
template <Homogeneous X>
struct MovingState {
  static constexpr int N = ManifoldTraits<X>::DoF;
  const Gaussian<X>& before;
  X moved = before.mean;

  FilterState record() { return {N, is_vector<X>, before.covariance.data(), this, &move}; }

 private:
  static void move(void* front, const double* step, double* by_step) {
    auto& state = *static_cast<MovingState*>(front);
    state.moved = movedBy(state.before.mean, step);
    if constexpr (!is_vector<X>) {
      toRows<N, N>(expJacobian(state.before.mean, fromRows<N, 1>(step)), by_step);
    }
  }
};

/// A measurement with its noise and equations as the core reads them, and memory for its update.
template <Homogeneous X, Homogeneous M, NoiseModel Noise, class Equation>
class FilterFront {
 public:
  static constexpr int N = ManifoldTraits<X>::DoF, K = ManifoldTraits<M>::DoF, P = equation_count<Equation, X, M>;
  static_assert(P != Eigen::Dynamic, "equations return a vector of fixed size");
  static_assert(Noise::dimension == K, "the noise has as many coordinates as the measurement");

  FilterFront(const MovingState<X>& state, const M& y, const Noise& noise, const Equation& equation)
      : state_(state), y_(y), equation_(equation), valid_noise_(noise.valid()) {
    NoiseNumbers<Noise>::covariance(noise, covariance_.data());
    if constexpr (HasFreeDirections<Noise>) {
      free_ = noise.freeDimension();
      if (free_ > 0) toRows<K, K>(noise.freeBasis(), free_basis_.data());
    }
  }
  FilterMeasurement record() const {
    return {P,
            equationRank<Equation, P>(),
            K,
            is_vector<M>,
            valid_noise_,
            NoiseNumbers<Noise>::form,
            covariance_.data(),
            free_,
            free_basis_.data(),
            this,
            &linearize};
  }
  /// No noise at all.
  bool isExact() const {
    return std::all_of(covariance_.begin(), covariance_.end(), [](double x) { return x == 0; });
  }
  FilterMemory memory() { return {numbers_, rows_}; }

 private:
  static void linearize(const void* front, bool moved, const double* step, double* values, double* by_state,
                        double* by_measurement, double* by_step) {
    const FilterFront& f = *static_cast<const FilterFront*>(front);
    const X& x = moved ? f.state_.moved : f.state_.before.mean;
    const EquationDerivatives<P, N, K> J =
        step ? f.equation_.linearize(x, movedBy(f.y_, step)) : f.equation_.linearize(x, f.y_);
    toValues<P>(J.value, values);
    toRows<P, N>(J.by_parameter, by_state);
    toRows<P, K>(J.by_measurement, by_measurement);
    if constexpr (!is_vector<M>) {
      if (step)
        toRows<K, K>(expJacobian(f.y_, TangentOf<M>(fromRows<K, 1>(step).template cast<ScalarOf<M>>())), by_step);
    }
  }

  const MovingState<X>& state_;
  const M& y_;
  const Equation& equation_;
  bool valid_noise_;
  int free_ = 0;
  std::array<double, NoiseNumbers<Noise>::count> covariance_;
  std::array<double, HasFreeDirections<Noise> ? std::size_t{K} * K : 1> free_basis_;
  double numbers_[filterNumbers(N, P, K)];
  int rows_[static_cast<std::size_t>(P)];
};

}  // namespace detail

/// The argument of updateAll()'s callback: sums over independent measurements, linear in their number.
template <Homogeneous X>
class InformationSums {
 public:
  static constexpr int N = ManifoldTraits<X>::DoF;

  /// One measurement y with its noise and equations. Where its own squared distance, rᵀ (C P Cᵀ + D R Dᵀ)⁻¹ r at the
  /// prior, exceeds `gate` (a χ² threshold for its equations), it is left out and counted.
  template <Homogeneous M, NoiseModel Noise, class Equation>
  LIESTAT_ESTIMATION_API void add(const M& y, const Noise& noise, const Equation& equation,
                                  double gate = std::numeric_limits<double>::infinity()) {
    detail::FilterFront<X, M, Noise, Equation> front(state_, y, noise, equation);
    detail::addToSums(sums_, front.record(), gate, front.memory());
  }

 private:
  template <Homogeneous>
  friend class ImplicitEkf;
  explicit InformationSums(const Gaussian<X>& prior) : state_{prior}, sums_{state_.record(), step_, by_step_, A_, b_} {}
  InformationSums(const InformationSums&) = delete;
  InformationSums& operator=(const InformationSums&) = delete;

  detail::MovingState<X> state_;
  double step_[static_cast<std::size_t>(N)], b_[static_cast<std::size_t>(N)];
  double by_step_[static_cast<std::size_t>(N * N)], A_[static_cast<std::size_t>(N * N)];
  detail::FilterSums sums_;
};

/// The filter: a state with its covariance, predictions and updates. See the header comment.
template <Homogeneous X>
class ImplicitEkf {
 public:
  static constexpr int N = ManifoldTraits<X>::DoF;
  static_assert(std::is_same_v<ScalarOf<X>, double>, "the filter works in double");

  explicit ImplicitEkf(const Gaussian<X>& start, const ImplicitEkfOptions& options = {})
      : state_(start), options_(options) {}

  /// The estimate; its covariance is in the local frame at its mean.
  const Gaussian<X>& state() const { return state_; }
  /// Starts again, or takes over what another step made of the state.
  void reset(const Gaussian<X>& state) { state_ = state; }

  /// The state stays where it is and becomes less certain: P + Q, Q in the local frame. ok or not_finite.
  FilterStatus predict(const SquareOf<X>& process_noise) { return predict(state_, process_noise); }
  /// The state moves. `moved` is f(x) or f(x, u) with its covariance, which propagate() of stats/propagation.hpp makes of
  /// the model, its Jacobian and an input u with or without noise (stats/auto_diff.hpp finds the Jacobian by itself):
  ///   filter.predict(propagate(filter.state(), f, jacobian), Q);
  FilterStatus predict(const Gaussian<X>& moved, const SquareOf<X>& process_noise) {
    Gaussian<X> next = moved;
    next.covariance += process_noise;
    if (!detail::isFinite(next)) return FilterStatus::not_finite;
    state_ = next;
    return FilterStatus::ok;
  }

  /// One measurement, or several in one vector or Product with a joint noise. Nothing is inverted but the innovation's
  /// covariance, where that is singular its independent rows: the noise may be zero (an exact constraint of the state), the
  /// covariance of the state singular. `gate`: the NIS beyond which the state is left as it was.
  template <Homogeneous M, NoiseModel Noise, class Equation>
  LIESTAT_ESTIMATION_API auto update(const M& y, const Noise& noise, const Equation& equation,
                                     double gate = std::numeric_limits<double>::infinity()) {
    static_assert(!detail::HasFreeDirections<Noise>, "free directions of a measurement need updateAll()");
    detail::MovingState<X> moving{state_};
    detail::FilterFront<X, M, Noise, Equation> front(moving, y, noise, equation);
    detail::FilterMeasurement measurement = front.record();
    measurement.valid_noise = measurement.valid_noise || front.isExact();
    DenseFilterUpdate<X, front.P> result;
    SquareOf<X> covariance;
    const detail::FilterRows rows{result.step.data(), covariance.data(), result.innovation.data(),
                                  result.innovation_covariance.data()};
    const auto found = detail::updateDense(moving.record(), measurement, options_, gate, rows, front.memory());
    result.inconsistency = found.inconsistency;
    take(found, {moving.moved, covariance}, result);
    return result;
  }

  /// Independent measurements in information form. `visit` adds them to an InformationSums<X>, the same ones each time it is
  /// called: once, or for each iteration. The covariance of the state must be regular, and so must the noise of the
  /// equations (no exact constraint of the state).
  template <class Visit>
  LIESTAT_ESTIMATION_API FilterUpdate<X> updateAll(Visit&& visit) {
    FilterUpdate<X> result;
    if (!detail::isFinite(state_)) {
      result.status = FilterStatus::not_finite;
      return result;
    }
    InformationSums<X> sums(state_);
    SquareOf<X> covariance;
    double numbers[detail::filterNumbers(N, 0, 0)];
    struct Visitor {
      InformationSums<X>* sums;
      std::remove_reference_t<Visit>* visit;
    } visitor{&sums, std::addressof(visit)};
    const auto found = detail::updateSums(
        sums.sums_, options_, {result.step.data(), covariance.data()}, {numbers, nullptr},
        [](void* front) { (*static_cast<Visitor*>(front)->visit)(*static_cast<Visitor*>(front)->sums); }, &visitor);
    take(found, {sums.state_.moved, covariance}, result);
    return result;
  }

 private:
  /// Takes over what the core has found.
  void take(const detail::FilterOutcome& found, const Gaussian<X>& posterior, FilterUpdate<X>& result) {
    result.status = found.status;
    result.nis = found.nis;
    result.degrees_of_freedom = found.degrees_of_freedom;
    result.iterations = found.iterations;
    result.measurements = found.measurements, result.gated = found.gated;
    if (!found.moved) return;
    if (detail::isFinite(posterior)) {
      state_ = posterior;
    } else {
      result.status = FilterStatus::not_finite;
    }
  }

  Gaussian<X> state_;
  ImplicitEkfOptions options_;
};

template <Homogeneous X>
ImplicitEkf(const Gaussian<X>&) -> ImplicitEkf<X>;
template <Homogeneous X>
ImplicitEkf(const Gaussian<X>&, const ImplicitEkfOptions&) -> ImplicitEkf<X>;

}  // namespace liestat
