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
// frames. `autoDiff(f)` of stats/auto_diff.hpp makes one of a function that is generic in the scalar. Constraints are
// the same without m. Equations that are redundant by construction, such as the three of R a - b = 0 between unit vectors,
// say how many are independent, `static constexpr int rank = 2;`: away from the solution the others look independent.
//
// The estimator is compiled once (stats/detail/compiled.hpp); what is here tells it the problem.
#pragma once

#include <stats/constrained_types.hpp>
#include <stats/detail/constrained_core.hpp>
#include <stats/detail/constrained_problem.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/gaussian.hpp>
#include <stats/measurement_noise.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {

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
  static_assert(NoiseModel<Model>, "liestat: a noise of stats/measurement_noise.hpp, or a range of them");
  if constexpr (NoiseModel<Model>) {
    static_assert(Model::dimension == ManifoldTraits<M>::DoF,
                  "liestat: the noise has another dimension than the measurements: IsotropicNoise<2> for points of the "
                  "plane, IsotropicNoise<3> for rotations");
  }
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

/// The iteration, step by step: `while (estimator.iterate()) {}`. It keeps a reference to the channels.
template <Homogeneous Q, class Constraint, class... Channels>
class ConstrainedEstimator {
 public:
  static constexpr int N = ManifoldTraits<Q>::DoF;
  static_assert(std::is_same_v<ScalarOf<Q>, double>, "constrained estimates are made in double");

  /// Starts at `start`; bad input ends it at once.
  LIESTAT_ESTIMATION_API ConstrainedEstimator(const Q& start, const Constraint& constraint,
                                              const ConstrainedOptions<Q>& options, const Channels&... channels)
      : problem_(start, constraint, options),
        core_(Problem::functions, {detail::channelRecord<Q>(channels)...}, problem_.settings(options),
              problem_.valid() && (detail::isValid(channels) && ...)) {
    result_.measurements = (std::size_t{0} + ... + channels.size());
    update();
  }

  /// One step; true while there is more to do. A step is bounded in work: the line search has 30 halvings.
  bool iterate() {
    const bool more = core_.iterate(&problem_);
    update();
    return more;
  }
  /// Ends the iteration at what has been reached.
  void stop() {
    core_.stop(&problem_);
    update();
  }

  /// The state reached so far. Covariance and distances are set once the iteration has ended.
  const ConstrainedResult<Q>& result() const { return result_; }
  /// The corrected measurements of channel `I`, and one with the covariance of its error.
  template <std::size_t I = 0>
  auto corrected() const {
    using Channel = ChannelOf<I>;
    const auto& channel = *static_cast<const Channel*>(core_.channel(I).observed());
    std::vector<typename Channel::Measurement> list;
    for (std::size_t i = 0; i < core_.channel(I).size(); ++i) {
      list.push_back(detail::movedBy(channel.measurements[i], core_.channel(I).correction(i)));
    }
    return list;
  }
  /// V - V Dᵀ S⁻¹ D V + K Λ Kᵀ, K = V Dᵀ S⁻¹ C; first order, in coordinates at what was observed.
  template <std::size_t I = 0>
  auto correctedCovariance(std::size_t i) const {
    constexpr int K = ManifoldTraits<typename ChannelOf<I>::Measurement>::DoF;
    Eigen::Matrix<double, K, K> covariance;  // symmetric, so that the order of its numbers does not matter
    core_.channel(I).covarianceOf(i, core_.result().covariance, covariance.data());
    return covariance;
  }
  /// E‖m̃_i - m_i‖²_{Q_i} = p_i - tr(S_i⁻¹ C_i Λ C_iᵀ).
  template <std::size_t I = 0>
  double expectedCorrection(std::size_t i) const {
    return core_.channel(I).expectedSquare(i, core_.result().covariance);
  }
  /// How much of a measurement's equations the parameter fits by itself, tr(S_i⁻¹ C_i Λ C_iᵀ)/p_i: their mean is the
  /// number of free parameters over that of equations. At 1 the correction of the measurement says nothing about its
  /// error, and no other measurement checks it. 0 without equations.
  template <std::size_t I = 0>
  double leverage(std::size_t i) const {
    const int p = core_.channel(I).equationsOf(i);
    return p > 0 ? 1 - expectedCorrection<I>(i) / p : 0;
  }
  /// m̃_i - m_i, or on a manifold log(m_i, m̃_i).
  template <std::size_t I = 0>
  auto correction(std::size_t i) const {
    constexpr int K = ManifoldTraits<typename ChannelOf<I>::Measurement>::DoF;
    return detail::fromRows<K, 1>(core_.channel(I).correction(i));
  }

 private:
  using Problem = detail::ConstrainedProblem<Q, Constraint>;
  template <std::size_t I>
  using ChannelOf = std::tuple_element_t<I, std::tuple<Channels...>>;

  /// Takes over what the core has found.
  void update() {
    const detail::ConstrainedOutcome& found = core_.result();
    result_.end = found.end;
    result_.parameter = problem_.current();
    result_.iterations = found.iterations;
    result_.used_curvature = found.used_curvature;
    if (found.end == ConstrainedEnd::running) return;
    result_.information = detail::fromRows<N, N>(found.information.data());
    result_.covariance = detail::fromRows<N, N>(found.covariance.data());
    result_.chi2 = found.chi2;
    result_.degrees_of_freedom = found.degrees_of_freedom;
    result_.equation_error = found.equation_error;
    result_.free_parameters = found.free_parameters;
    result_.equations = found.equations;
    result_.dropped_equations = found.dropped_equations;
    result_.constraints = found.constraints;
    result_.dropped_constraints = found.dropped_constraints;
    result_.uninformative = found.uninformative;
    result_.unobservable = found.unobservable;
    result_.unobservable_basis = detail::fromRows<N, N>(found.unobservable_basis.data());
    result_.determined_covariance = detail::fromRows<N, N>(found.determined_covariance.data());
    result_.fit_p = found.fit_p;
    result_.active_bounds = found.active_bounds;
    result_.minimum_checked = found.minimum_checked;
    result_.relative_curvature = found.relative_curvature;
    result_.widening = found.widening;
  }

  Problem problem_;
  detail::ConstrainedCore core_;
  ConstrainedResult<Q> result_;
};

namespace detail {

/// A function has derivatives: linearize() of its own, or by autoDiff().
template <class F, class... Arguments>
concept Linearizes = requires(const F& f, const Arguments&... arguments) {
  f.linearize(arguments...);
};

/// States in one sentence why there is no constrained estimate; `ok` where there is one. That noise and measurements
/// have one dimension is said by measurements().
template <class Q, class Constraint, class... Channels>
struct RequireEstimate {
  static constexpr bool ok = false;
  static_assert(sizeof(Q) == 0,  // never: what gives this template has no manifold
                "liestat: the parameter of a constrained estimate is a point of a manifold or a vector of fixed size, "
                "such as Eigen::Matrix<double, 6, 1>, not Eigen::VectorXd.");
};
template <Homogeneous Q, class Constraint, class... Channels>
struct RequireEstimate<Q, Constraint, Channels...> {
  static constexpr bool one_dimension =
      ((Channels::Noise::dimension == ManifoldTraits<typename Channels::Measurement>::DoF) && ...);
  static constexpr bool linear = std::is_same_v<Constraint, NoConstraint> || Linearizes<Constraint, Q>;
  static constexpr bool equations = (Linearizes<typename Channels::Equation, Q, typename Channels::Measurement> && ...);
  static constexpr bool ok = one_dimension && equations && linear;
  static_assert(!one_dimension || equations,
                "liestat: an equation has no linearize(q, m): wrap the function, generic in the scalar, in "
                "liestat::autoDiff() of stats/auto_diff.hpp. A function of doubles alone has no derivatives.");
  static_assert(!one_dimension || !equations || linear,
                "liestat: the constraint has no linearize(q): wrap the function, generic in the scalar, in "
                "liestat::autoDiff() of stats/auto_diff.hpp. A function of doubles alone has no derivatives.");
};
template <class Q>
using ParameterInSignature = std::conditional_t<Homogeneous<Q>, Q, SO3<double>>;

}  // namespace detail

/// The estimate of a parameter from measurements of one kind or several, started at `start`. A `Status` that is not ok
/// says what is wrong; nothing throws.
template <class Q, class Constraint = NoConstraint, class... Channels>
LIESTAT_ESTIMATION_API ConstrainedResult<detail::ParameterInSignature<Q>> constrainedEstimate(
    const Q& start, const std::tuple<Channels...>& channels, const Constraint& constraint = {},
    const ConstrainedOptions<detail::ParameterInSignature<std::type_identity_t<Q>>>& options = {}) {
  if constexpr (detail::RequireEstimate<Q, Constraint, Channels...>::ok) {
    return std::apply(
        [&](const auto&... channel) {
          ConstrainedEstimator<Q, Constraint, Channels...> estimator(start, constraint, options, channel...);
          while (estimator.iterate()) {
          }
          return estimator.result();
        },
        channels);
  } else {
    return {};
  }
}
template <class Q, Homogeneous M, class Noise, class Equation, class Constraint = NoConstraint>
LIESTAT_ESTIMATION_API ConstrainedResult<detail::ParameterInSignature<Q>> constrainedEstimate(
    const Q& start, const MeasurementChannel<M, Noise, Equation>& channel, const Constraint& constraint = {},
    const ConstrainedOptions<detail::ParameterInSignature<std::type_identity_t<Q>>>& options = {}) {
  using Channel = MeasurementChannel<M, Noise, Equation>;
  if constexpr (detail::RequireEstimate<Q, Constraint, Channel>::ok) {
    ConstrainedEstimator<Q, Constraint, Channel> estimator(start, constraint, options, channel);
    while (estimator.iterate()) {
    }
    return estimator.result();
  } else {
    return {};
  }
}

}  // namespace liestat
