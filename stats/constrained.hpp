// Estimation of a parameter from measurements under implicit equations: measurements m_i, each with an information
// matrix Q_i, equations c_i(q, m_i) = 0 between them and the parameter q, constraints c_0(q) = 0 of the parameter. The
// estimate minimises
//
//   L² = ½ ‖q - q_0‖²_{Q_0} + ½ Σ ‖m̃_i - m_i‖²_{Q_i}   subject to   c_0(q) = 0,  c_i(q, m̃_i) = 0
//
// over q and the corrected measurements m̃_i (T. Viéville, D. Lingrand, F. Gaspard, "Implementing a variant of the
// Kanatani's estimation method", INRIA RR-4050, 2000, sections 2 and 3). docs/constrained.md has the mathematics, where
// it differs from the report and why.
//
//   struct Conic {                                     // an ellipse through the points
//     template <class S>
//     auto operator()(const Vector6<S>& q, const Vector2<S>& m) const { … return Eigen::Matrix<S, 1, 1>(…); }
//   };
//   const auto result = constrainedEstimate(start, measurements(points, IsotropicNoise<2>(0.01), autoDiff(Conic{})),
//                                           autoDiff(UnitNorm{}));
//   if (result.ok()) use(result.parameter, result.covariance);
//
// Parameter and measurements are points of manifolds, to which fixed-size vectors belong. What a manifold says by itself
// needs no constraint: a rotation is an SO3d, or nine numbers and six equations, and both give the same estimate.
//
// Equations are function objects: `e(q, m)` returns the values, `e.linearize(q, m)` an EquationDerivatives in local
// frames. `autoDiff(f)` of stats/compat/jet.hpp makes one of a function that is generic in the scalar. Constraints are
// the same without m. Equations that are redundant by construction, such as the three of R a - b = 0 between unit vectors,
// say how many are independent, `static constexpr int rank = 2;`: away from the solution the others look independent.
#pragma once

#include <stats/constrained_types.hpp>
#include <stats/detail/constrained_channel.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/detail/tangent_system.hpp>
#include <stats/gaussian.hpp>
#include <stats/measurement_noise.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {

/// The parameter is constrained by its manifold alone.
struct NoConstraint {};

/// P linear constraints G q = f of a vector, which are eliminated once.
template <int P, int N>
struct LinearConstraint {
  Eigen::Matrix<double, P, N> G;
  Eigen::Matrix<double, P, 1> f;

  Eigen::Matrix<double, P, 1> operator()(const Eigen::Matrix<double, N, 1>& q) const { return G * q - f; }
  ConstraintDerivatives<P, N> linearize(const Eigen::Matrix<double, N, 1>& q) const { return {(*this)(q), G}; }
};

namespace detail {

/// A list of one element that stands for all measurements, or a range with an element for each.
template <class T>
struct OneOrMany {
  using type = T;
  static std::vector<T> list(const T& one) { return {one}; }
};
template <AnyRange R>
struct OneOrMany<R> {
  using type = ElementOf<R>;
  static std::vector<type> list(const R& range) { return {std::begin(range), std::end(range)}; }
};

}  // namespace detail

/// Measurements of one kind: what was observed, how it may be corrected, the equations. Made by measurements().
template <Homogeneous M, NoiseModel Noise_, class Equation_>
struct MeasurementChannel {
  using Measurement = M;
  using Noise = Noise_;
  using Equation = Equation_;

  std::vector<M> measurements;
  std::vector<Noise> noises;        ///< one, or as many as measurements
  std::vector<Equation> equations;  ///< one, or as many as measurements
  std::vector<M> corrected = {};    ///< where the iteration starts, where that is known from an earlier estimate

  std::size_t size() const { return measurements.size(); }
  const Noise& noiseOf(std::size_t i) const { return noises[noises.size() == 1 ? 0 : i]; }
  const Equation& equationOf(std::size_t i) const { return equations[equations.size() == 1 ? 0 : i]; }
  bool valid() const {
    const auto fits = [&](std::size_t n, std::size_t least) { return n == least || n == size(); };
    return fits(noises.size(), 1) && fits(equations.size(), 1) && fits(corrected.size(), 0);
  }
};

/// A range of measurements, with one noise for all or a range of noises, and one equation or a range of equations.
template <detail::AnyRange R, class Noise, class Equation>
auto measurements(R&& range, const Noise& noise, const Equation& equation) {
  using M = SampleOf<R>;
  using Model = typename detail::OneOrMany<Noise>::type;
  using Single = typename detail::OneOrMany<Equation>::type;
  static_assert(NoiseModel<Model>, "a noise of stats/measurement_noise.hpp, or a range of them");
  const auto samples = detail::asSamples(range);
  return MeasurementChannel<M, Model, Single>{{samples.begin(), samples.end()},
                                              detail::OneOrMany<Noise>::list(noise),
                                              detail::OneOrMany<Equation>::list(equation)};
}
/// Measurements with their covariances.
template <Homogeneous M, class Equation>
auto measurements(const std::vector<Gaussian<M>>& gaussians, const Equation& equation) {
  using Noise = CovarianceNoise<ManifoldTraits<M>::DoF>;
  MeasurementChannel<M, Noise, Equation> channel{{}, {}, {equation}};
  for (const Gaussian<M>& g : gaussians) {
    channel.measurements.push_back(g.mean);
    channel.noises.emplace_back(g.covariance.template cast<double>());
  }
  return channel;
}

namespace detail {

/// The number of constraints; one where there are none, which is never looked at.
template <class Q, class Constraint>
constexpr int constraintCount() {
  if constexpr (std::is_same_v<Constraint, NoConstraint>) {
    return 1;
  } else {
    return std::remove_cvref_t<
        decltype(std::declval<const Constraint&>().linearize(std::declval<const Q&>()).value)>::RowsAtCompileTime;
  }
}

}  // namespace detail

/// The iteration, step by step: `while (estimator.iterate()) {}`. It keeps a reference to the channels.
template <Homogeneous Q, class Constraint, class... Channels>
class ConstrainedEstimator {
 public:
  static constexpr int N = ManifoldTraits<Q>::DoF;
  static_assert(std::is_same_v<ScalarOf<Q>, double>, "constrained estimates are made in double");

  /// Starts at `start`; bad input ends it at once.
  ConstrainedEstimator(const Q& start, const Constraint& constraint, const ConstrainedOptions<Q>& options,
                       const Channels&... channels)
      : constraint_(constraint), options_(options), states_(detail::ChannelState<Q, Channels>(channels)...) {
    result_.parameter = start;
    bool valid = (channels.valid() && ...);
    if (options.prior) {
      // Positive semi-definite; zero is none.
      valid = valid && detail::SemidefiniteParts<N>(options.prior->information.template cast<double>()).valid;
      if (valid && !hasPrior()) options_.prior.reset();
    }
    forAll([&](const auto& state) { valid = valid && state.valid(); });
    valid = valid && coordinates(start).allFinite();
    if (options_.prior) valid = valid && coordinates(options_.prior->mean).allFinite();
    if (!valid) result_.end = ConstrainedEnd::bad_input;
    forAll([&](const auto& state) { result_.measurements += state.size(); });
  }

  /// One step; true while there is more to do. A step is bounded in work: the line search has 30 halvings.
  bool iterate() {
    if (result_.end != ConstrainedEnd::running) return false;
    if (result_.iterations >= options_.max_iterations) return finish(ConstrainedEnd::capped);
    const bool curved = slow_steps_ >= 3 && options_.curvature && result_.iterations > 0;
    linearize();
    if (!finite_ || !A_.allFinite() || !b_.allFinite() || !constraint_values_.allFinite()) {
      return finish(result_.iterations == 0 ? ConstrainedEnd::bad_input : ConstrainedEnd::stalled);
    }
    ++result_.iterations;
    result_.used_curvature = result_.used_curvature || curved;
    if (curved) linearizeCurved();
    return step(curved);
  }
  /// Ends the iteration at what has been reached.
  void stop() {
    if (result_.end == ConstrainedEnd::running) finish(ConstrainedEnd::stopped);
  }

  /// The state reached so far. Covariance and distances are set once the iteration has ended.
  const ConstrainedResult<Q>& result() const { return result_; }
  /// The corrected measurements of channel `I`, and one with the covariance of its error.
  template <std::size_t I = 0>
  auto corrected() const {
    const auto& state = std::get<I>(states_);
    std::vector<typename std::remove_cvref_t<decltype(state)>::M> list;
    for (std::size_t i = 0; i < state.size(); ++i) list.push_back(state.corrected(i));
    return list;
  }
  /// V - V Dᵀ S⁻¹ D V + K Λ Kᵀ, K = V Dᵀ S⁻¹ C; first order, in coordinates at what was observed.
  template <std::size_t I = 0>
  auto correctedCovariance(std::size_t i) const {
    return std::get<I>(states_).covarianceOf(i, result_.covariance.template cast<double>());
  }
  /// E‖m̃_i - m_i‖²_{Q_i} = p_i - tr(S_i⁻¹ C_i Λ C_iᵀ).
  template <std::size_t I = 0>
  double expectedCorrection(std::size_t i) const {
    return std::get<I>(states_).expectedSquare(i, result_.covariance.template cast<double>());
  }
  /// How much of a measurement's equations the parameter fits by itself, tr(S_i⁻¹ C_i Λ C_iᵀ)/p_i: their mean is the
  /// number of free parameters over that of equations. At 1 the correction of the measurement says nothing about its
  /// error, and no other measurement checks it. 0 without equations.
  template <std::size_t I = 0>
  double leverage(std::size_t i) const {
    const int p = std::get<I>(states_).equationsOf(i);
    return p > 0 ? 1 - expectedCorrection<I>(i) / p : 0;
  }
  /// m̃_i - m_i, or on a manifold log(m_i, m̃_i).
  template <std::size_t I = 0>
  auto correction(std::size_t i) const {
    return std::get<I>(states_).correction(i);
  }

 private:
  using S = ScalarOf<Q>;
  static constexpr bool constrained = !std::is_same_v<Constraint, NoConstraint>;
  static constexpr int P = detail::constraintCount<Q, Constraint>();
  using ConstraintValues = Eigen::Matrix<double, P, 1>;
  using Basis = detail::ConstraintBasis<N, P>;
  using Step = Eigen::Matrix<double, N, 1>;
  using Square = Eigen::Matrix<double, N, N>;

  static Step coordinates(const Q& q) { return log(ManifoldTraits<Q>::origin(), q).template cast<double>(); }
  static Q moved(const Q& q, const Step& delta) { return exp(q, TangentOf<Q>(delta.template cast<S>())); }
  bool hasPrior() const { return options_.prior && options_.prior->information.cwiseAbs().maxCoeff() > S(0); }
  template <class F>
  void forAll(const F& f) {
    std::apply([&](auto&... state) { (f(state), ...); }, states_);
  }
  template <class F>
  void forAll(const F& f) const {
    std::apply([&](const auto&... state) { (f(state), ...); }, states_);
  }

  ConstraintValues constraintValues(const Q& q) const {
    if constexpr (!constrained) {
      return ConstraintValues::Zero();
    } else if constexpr (std::is_arithmetic_v<decltype(constraint_(q))>) {
      return ConstraintValues::Constant(constraint_(q));
    } else {
      return constraint_(q).template cast<double>();
    }
  }
  void linearizeConstraint() {
    if constexpr (constrained) {
      const auto J = constraint_.linearize(result_.parameter);
      constraint_values_ = J.value.template cast<double>();
      // The derivative of linear constraints is what it was.
      if (requires { Constraint::G; } && have_basis_) return;
      const Eigen::Matrix<double, P, N> C = J.by_parameter.template cast<double>();
      if (!C.allFinite()) constraint_values_.setConstant(std::numeric_limits<double>::quiet_NaN());
      basis_ = Basis(C.allFinite() ? C : Eigen::Matrix<double, P, N>(Eigen::Matrix<double, P, N>::Zero()));
      have_basis_ = true;
    }
  }
  void linearize() {
    A_.setZero(), b_.setZero();
    prior_cost_ = 0;
    if (options_.prior) {
      const ErrorVector<Q> error = errorVector(options_.prior->mean, result_.parameter);
      const Step e = error.z.template cast<double>();
      const Square J = error.by_feature.template cast<double>();
      const Square information = options_.prior->information.template cast<double>();
      const Square weighed = detail::product(J.transpose(), information);
      A_ += detail::product(weighed, J);
      b_ -= detail::product(weighed, e);
      prior_cost_ = e.dot(detail::product(information, e));
    }
    prior_slope_ = -b_;
    finite_ = true;
    forAll([&](auto& state) { finite_ = state.linearize(result_.parameter, A_, b_) && finite_; });
    linearizeConstraint();
    system_ = detail::TangentSystem<N>(A_, basis_.freeBasis(), N - basis_.rank());
  }

  /// The same with the curvature of all equations under the multipliers of the last step.
  void linearizeCurved() {
    Square A = Square::Zero();
    Step b = Step::Zero();
    if (options_.prior) {
      const SquareOf<Q> J = errorVector(options_.prior->mean, result_.parameter).by_feature;
      A += detail::congruence(SquareOf<Q>(J.transpose()), options_.prior->information).template cast<double>();
      b -= prior_slope_;
    }
    forAll([&](auto& state) { state.linearizeCurved(result_.parameter, A, b); });
    if constexpr (constrained) A += constraintCurvature();
    if (!A.allFinite() || !b.allFinite()) return;
    curved_A_ = A, curved_b_ = b;
    curved_system_ = detail::TangentSystem<N>(A, basis_.freeBasis(), N - basis_.rank(), true);
  }
  Square constraintCurvature() const {
    Square H;
    const Q& q = result_.parameter;
    const double h = detail::differenceStep(q);
    const auto gradient = [&](const Step& delta) -> Step {
      const Q y = moved(q, delta);
      const Eigen::Matrix<double, P, N> J = constraint_.linearize(y).by_parameter.template cast<double>();
      return detail::product(detail::inCoordinatesAt<Q, P>(q, y, J).transpose(), constraint_multipliers_);
    };
    for (int k = 0; k < N; ++k) {
      Step delta = Step::Zero();
      delta[k] = h;
      H.col(k) = (gradient(delta) - gradient(-delta)) / (2 * h);
    }
    return 0.5 * (H + H.transpose());
  }

  struct Merit {
    double cost = 0, violation = 0, squared_violation = 0, constraint = 0;
  };
  Merit meritOf(const detail::ChannelMerit& sum, double prior_cost, const ConstraintValues& constraints) const {
    return {sum.cost + prior_cost, sum.violation, sum.squared_violation, basis_.shortestLength(constraints)};
  }
  double priorCost(const Q& q) const {
    if (!options_.prior) return 0;
    const Step e = log(options_.prior->mean, q).template cast<double>();
    return e.dot(detail::product(Square(options_.prior->information.template cast<double>()), e));
  }
  double phi(const Merit& merit) const {
    return 0.5 * merit.cost + penalty_ * merit.violation + constraint_penalty_ * merit.constraint;
  }
  static void join(detail::ChannelMerit& sum, const detail::ChannelMerit& part) {
    sum.cost += part.cost, sum.violation += part.violation, sum.squared_violation += part.squared_violation;
  }

  bool step(bool curved) {
    const Step wanted = basis_.shortest(-constraint_values_);
    Step delta = curved ? curved_system_.solve(curved_b_, wanted) : system_.solve(b_, wanted);
    Merit here;
    double slope = 0, length = 0;
    for (bool with_curvature = curved;; with_curvature = false) {
      double largest = 0, squared = 0, free = 0, along = 0;
      detail::ChannelMerit sum;
      forAll([&](auto& state) {
        largest = std::max(largest, state.step(delta, with_curvature));
        squared += state.stepSquared();
        along += state.slope();
        free = std::max(free, state.freeStep());
        join(sum, state.merit());
      });
      const Step gradient = detail::product(A_, delta) - b_;
      penalty_ = std::max(penalty_, 2 * largest);
      if (basis_.rank() > 0) {
        // At least a millionth of what an error of one standard deviation would ask for: where the measurements are met as
        // they stand, constraints that are not must have a price, or any step is as good as another.
        const double least = 1e-6 * std::sqrt(A_.trace() / N);
        constraint_penalty_ = std::max({constraint_penalty_, 2 * basis_.fixedLength(gradient), least});
        constraint_multipliers_ = basis_.multipliers(-gradient);
      }
      here = meritOf(sum, prior_cost_, constraint_values_);
      slope = along + prior_slope_.dot(delta) - penalty_ * here.violation - constraint_penalty_ * here.constraint;
      length = std::sqrt(std::max(0.0, squared + delta.dot(detail::product(A_, delta))));
      free_step_ = free;
      if (!with_curvature || slope < 0 || length <= options_.tolerance) break;
      // Not a direction of descent: the step without curvature is one.
      delta = system_.solve(b_, wanted);
    }
    if (!std::isfinite(length) || !std::isfinite(slope)) return finish(ConstrainedEnd::stalled);

    const double size = parameterSize(), parameter_step = delta.norm() / size;
    const bool met = here.constraint <= 1e-9 * size;
    // As small as asked, or as rounding lets it be.
    const double tolerance = std::max(options_.tolerance, 4 * rounding());
    if (length <= tolerance && std::sqrt(here.squared_violation) <= 10 * tolerance && free_step_ <= 1e-9 && met &&
        parameter_step <= 1e-6) {
      return take(delta, ConstrainedEnd::converged);
    }
    const double ratio = last_length_ > 0 ? length / last_length_ : 0;
    // Linear convergence: the curvature joins, and stays.
    slow_steps_ = ratio > 0.4 || cut_ ? slow_steps_ + 1 : slow_steps_ >= 3 ? slow_steps_ : 0;
    last_length_ = length;
    return search(delta, here, slope, length, parameter_step, met);
  }

  double parameterSize() const { return 1 + (detail::is_vector<Q> ? coordinates(result_.parameter).norm() : 0); }
  /// The length of one rounding error in each coordinate, in units of the noise.
  double rounding() const {
    double squared = 0;
    forAll([&](const auto& state) { squared += state.roundingSquared(); });
    const Step q = detail::is_vector<Q> ? coordinates(result_.parameter) : Step(Step::Ones());
    const double of_parameter = std::abs(q.dot(detail::product(A_, q)));
    return std::sqrt(squared + of_parameter * std::pow(std::numeric_limits<double>::epsilon(), 2));
  }

  bool search(const Step& delta, const Merit& here, double slope, double length, double parameter_step, bool met) {
    // Rounding of the sum, and of equations that are met as well as rounding lets them be.
    const double value = phi(here);
    const double slack = 1e-13 * (1 + std::abs(value)) +
                         4 * penalty_ * std::sqrt(static_cast<double>(result_.measurements)) * rounding();
    double alpha = 1;
    for (int halving = 0; halving < 30; ++halving, alpha *= 0.5) {
      const Q q = moved(result_.parameter, alpha * delta);
      detail::ChannelMerit sum;
      forAll([&](auto& state) { join(sum, state.tryStep(q, alpha)); });
      const double there = phi(meritOf(sum, priorCost(q), constraintValues(q)));
      cut_ = halving > 0;
      if (there <= value + 1e-4 * alpha * slope + slack) return accept(q);
      if (halving > 6) continue;
      // Second-order correction: the equations at the trial point, linearised as here. Repeated, because one leaves what
      // is of third order, and that is much of a long step.
      Q corrected = q;
      double violation = std::numeric_limits<double>::infinity();
      for (int k = 0; k < 4; ++k) {
        Step b = Step::Zero();
        forAll([&](const auto& state) { state.addCorrectionSums(b); });
        const Step further = system_.solve(b, basis_.shortest(-constraintValues(corrected)));
        corrected = moved(corrected, further);
        detail::ChannelMerit after;
        forAll([&](auto& state) { join(after, state.tryCorrected(corrected, further)); });
        const Merit merit = meritOf(after, priorCost(corrected), constraintValues(corrected));
        if (phi(merit) <= value + 1e-4 * alpha * slope + slack) return accept(corrected);
        const double left = phi(merit) - 0.5 * merit.cost;
        if (!(left < 0.5 * violation)) break;
        violation = left;
      }
    }
    if (length <= 1e-6 && parameter_step <= 1e-7 && met) return finish(ConstrainedEnd::converged);
    return finish(ConstrainedEnd::stalled);
  }
  bool accept(const Q& q) {
    result_.parameter = q;
    forAll([](auto& state) { state.accept(); });
    return true;
  }
  bool take(const Step& delta, ConstrainedEnd end) {
    result_.parameter = moved(result_.parameter, delta);
    forAll([](auto& state) { state.acceptFull(); });
    return finish(end);
  }

  /// Fills in the result; always false.
  bool finish(ConstrainedEnd end) {
    result_.end = end;
    if (end == ConstrainedEnd::bad_input) return false;
    linearize();
    detail::ChannelMerit sum;
    int dropped = 0, kept = 0, unmet = 0;
    result_.uninformative = 0;
    forAll([&](const auto& state) {
      join(sum, state.merit());
      kept += state.keptEquations();
      dropped += state.droppedEquations();
      unmet += state.unmetEquations(result_.parameter);
      result_.uninformative += state.uninformative();
    });
    result_.equations = kept;
    result_.dropped_equations = dropped;
    result_.constraints = basis_.rank();
    result_.dropped_constraints = (constrained ? P : 0) - result_.constraints;
    result_.free_parameters = N - result_.constraints;
    result_.information = A_.template cast<S>();
    result_.covariance = system_.covariance().template cast<S>();
    result_.unobservable = system_.nullDimension();
    result_.unobservable_basis = system_.nullBasis().template cast<S>();
    result_.chi2 = sum.cost + prior_cost_;
    result_.equation_error = equationError();
    result_.degrees_of_freedom = result_.constraints + kept + priorRank() - N + result_.unobservable;
    if (end != ConstrainedEnd::converged && end != ConstrainedEnd::stalled) return false;
    if (basis_.largest(constraint_values_) > 1e-7 * parameterSize() ||
        (end == ConstrainedEnd::converged && unmet > 0)) {
      result_.end = ConstrainedEnd::contradictory;
    } else if (end == ConstrainedEnd::converged && kept == 0 && !options_.prior && result_.unobservable > 0) {
      result_.end = ConstrainedEnd::too_few;
    } else if (end == ConstrainedEnd::converged && result_.unobservable > 0) {
      result_.end = ConstrainedEnd::unobservable;
    }
    return false;
  }
  /// E²: the squared length of the second-order correction at the end.
  double equationError() {
    detail::ChannelMerit sum;
    forAll([&](auto& state) { join(sum, state.tryStep(result_.parameter, 0)); });
    Step b = Step::Zero();
    forAll([&](const auto& state) { state.addCorrectionSums(b); });
    const Step delta = system_.solve(b, basis_.shortest(-constraint_values_));
    double squared = 0;
    forAll([&](const auto& state) { squared += state.correctionSquared(delta); });
    if (options_.prior) {
      squared += delta.dot(detail::product(Square(options_.prior->information.template cast<double>()), delta));
    }
    return squared;
  }
  int priorRank() const {
    if (!options_.prior) return 0;
    return N - detail::SemidefiniteParts<N>(options_.prior->information.template cast<double>()).null_dimension;
  }

  Constraint constraint_;
  ConstrainedOptions<Q> options_;
  std::tuple<detail::ChannelState<Q, Channels>...> states_;
  ConstrainedResult<Q> result_;
  Square A_ = Square::Zero(), curved_A_ = Square::Zero();
  Step b_ = Step::Zero(), curved_b_ = Step::Zero(), prior_slope_ = Step::Zero();
  Basis basis_;
  detail::TangentSystem<N> system_, curved_system_;
  ConstraintValues constraint_values_ = ConstraintValues::Zero(), constraint_multipliers_ = ConstraintValues::Zero();
  bool have_basis_ = false, finite_ = true;
  double prior_cost_ = 0, penalty_ = 0, constraint_penalty_ = 0, last_length_ = 0, free_step_ = 0;
  int slow_steps_ = 0;
  bool cut_ = false;  // the last step was
};

/// The estimate of a parameter from measurements of one kind or several, started at `start`. A `Status` that is not ok
/// says what is wrong; nothing throws.
template <Homogeneous Q, class Constraint, class... Channels>
ConstrainedResult<Q> constrainedEstimate(const Q& start, const std::tuple<Channels...>& channels,
                                         const Constraint& constraint,
                                         const ConstrainedOptions<std::type_identity_t<Q>>& options = {}) {
  return std::apply(
      [&](const auto&... channel) {
        ConstrainedEstimator<Q, Constraint, Channels...> estimator(start, constraint, options, channel...);
        while (estimator.iterate()) {
        }
        return estimator.result();
      },
      channels);
}
template <Homogeneous Q, Homogeneous M, class Noise, class Equation, class Constraint = NoConstraint>
ConstrainedResult<Q> constrainedEstimate(const Q& start, const MeasurementChannel<M, Noise, Equation>& channel,
                                         const Constraint& constraint = {},
                                         const ConstrainedOptions<std::type_identity_t<Q>>& options = {}) {
  ConstrainedEstimator<Q, Constraint, MeasurementChannel<M, Noise, Equation>> estimator(start, constraint, options,
                                                                                        channel);
  while (estimator.iterate()) {
  }
  return estimator.result();
}

}  // namespace liestat
