// A constrained problem as the records of functions that its core reads (stats/detail/constrained_core.hpp): points of
// manifolds, equations and noises of fixed size become rows of numbers. Element by element, which costs a compiler
// nothing.
#pragma once

#include <lie/manifold.hpp>
#include <lie/rn.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <stats/constrained_types.hpp>
#include <stats/detail/constrained_core.hpp>
#include <stats/detail/number_rows.hpp>
#include <stats/measurement_noise.hpp>

#include <Eigen/Core>

#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>
#include <utility>

namespace liestat {

/// The parameter is constrained by its manifold alone.
struct NoConstraint {};

namespace detail {

/// The derivative of log(y, x) by x alone, errorVector(y, x).by_feature.
template <Homogeneous M>
SquareOf<M> logJacobian(const M& y, const M& x) {
  using T = ManifoldTraits<M>;
  const typename T::Group f = T::placement(y).inverse();
  SquareOf<M> dlog = T::dlogOrigin(T::act(f, x));
  if constexpr (HasTrivialIsotropy<M>) {
    return dlog;
  } else {
    return product(dlog, SquareOf<M>(T::isotropy(f, x)));
  }
}
/// Derivatives with respect to exp(x, v) at v where they are known with respect to a local step at y = exp(x, v).
template <Homogeneous M, int P>
Eigen::Matrix<double, P, ManifoldTraits<M>::DoF> inCoordinatesAt(
    const M& x, const M& y, const Eigen::Matrix<double, P, ManifoldTraits<M>::DoF>& J) {
  if constexpr (is_vector<M>) {
    return J;
  } else {
    const SquareOf<M> to_step = inverse<ScalarOf<M>, ManifoldTraits<M>::DoF>(logJacobian(x, y));
    return product(J, to_step.template cast<double>());
  }
}

/// The functions of a channel for a parameter Q.
template <Homogeneous Q, class Channel>
struct ChannelFront {
  using M = typename Channel::Measurement;
  static constexpr int N = ManifoldTraits<Q>::DoF, K = ManifoldTraits<M>::DoF;
  static constexpr int P =
      std::remove_cvref_t<decltype(std::declval<const typename Channel::Equation&>()
                                       .linearize(std::declval<const Q&>(), std::declval<const M&>())
                                       .value)>::RowsAtCompileTime;
  static_assert(P != Eigen::Dynamic, "equations return a vector of fixed size");
  static_assert(Channel::Noise::dimension == K, "the noise has as many coordinates as the measurement");

  static void linearize(const void* channel, const void* q, std::size_t first, std::size_t count, const double* at,
                        double* values, double* by_parameter, double* by_measurement) {
    const Channel& c = *static_cast<const Channel*>(channel);
    for (std::size_t i = first; i < first + count; ++i) {
      const M m = movedBy(c.measurements[i], at);
      const auto J = c.equationOf(i).linearize(*static_cast<const Q*>(q), m);
      toValues<P>(J.value, values);
      toRows<P, N>(J.by_parameter, by_parameter);
      if constexpr (is_vector<M>) {
        toRows<P, K>(J.by_measurement, by_measurement);
      } else {
        toRows<P, K>(inCoordinatesAt<M, P>(c.measurements[i], m, J.by_measurement.template cast<double>()),
                     by_measurement);
      }
      at += K, values += P, by_parameter += P * N, by_measurement += P * K;
    }
  }
  static void evaluate(const void* channel, const void* q, std::size_t first, std::size_t count, const double* at,
                       double* values) {
    const Channel& c = *static_cast<const Channel*>(channel);
    for (std::size_t i = first; i < first + count; ++i, at += K, values += P) {
      toValues<P>(c.equationOf(i)(*static_cast<const Q*>(q), movedBy(c.measurements[i], at)), values);
    }
  }
  static constexpr ChannelFunctions functions{
      P, equationRank<typename Channel::Equation, P>(), K, is_vector<M>, &linearize, &evaluate};
};

/// Adds a noise to those of a channel.
template <NoiseModel Noise>
void addNoise(NoiseTable& table, const Noise& noise) {
  constexpr int K = Noise::dimension;
  using N = NoiseNumbers<Noise>;
  const auto grown = [](Numbers& list, std::size_t n) {
    list.resize(list.size() + n);
    return list.data() + list.size() - n;
  };
  table.form = N::form;
  N::covariance(noise, grown(table.covariance, N::count));
  N::information(noise, grown(table.information, N::count));
  if constexpr (HasFreeDirections<Noise>) {
    table.can_be_free = true;
    table.null_dimension.push_back(noise.freeDimension());
    toRows<K, K>(noise.freeBasis(), grown(table.null_basis, std::size_t{K} * K));
  }
}

/// Numbers of measurements, noises and equations that go together, finite measurements, positive noises.
template <class Channel>
bool isValid(const Channel& channel) {
  constexpr int K = ManifoldTraits<typename Channel::Measurement>::DoF;
  bool valid = channel.valid();
  for (std::size_t i = 0; i < channel.noises.size() && valid; ++i) valid = channel.noises[i].valid();
  std::array<double, static_cast<std::size_t>(K)> coordinates;
  for (std::size_t i = 0; i < channel.size() && valid; ++i) {
    toCoordinates(channel.measurements[i], coordinates.data());
    valid = areFinite(coordinates.data(), K);
  }
  return valid;
}

template <Homogeneous Q, class Channel>
ChannelRecord channelRecord(const Channel& channel) {
  using M = typename Channel::Measurement;
  constexpr int K = ManifoldTraits<M>::DoF;
  // Lists that do not go together are bad input, of which nothing is read.
  ChannelRecord record{&ChannelFront<Q, Channel>::functions, &channel, channel.valid() ? channel.size() : 0};
  record.noise.dimension = K;
  record.noise.one = channel.noises.size() == 1;
  for (const auto& noise : channel.noises) addNoise(record.noise, noise);
  if constexpr (is_vector<M>) {
    record.coordinates.resize(K * channel.size());
    for (std::size_t i = 0; i < channel.size(); ++i) {
      toCoordinates(channel.measurements[i], record.coordinates.data() + K * i);
    }
  }
  record.start.resize(K * channel.corrected.size());
  for (std::size_t i = 0; i < channel.corrected.size() && i < channel.size(); ++i) {
    toRows<K, 1>(log(channel.measurements[i], channel.corrected[i]), record.start.data() + K * i);
  }
  return record;
}

/// The parameter, its constraint and its prior.
template <Homogeneous Q, class Constraint>
class ConstrainedProblem {
 public:
  static constexpr int N = ManifoldTraits<Q>::DoF;
  static constexpr bool constrained = !std::is_same_v<Constraint, NoConstraint>;

  ConstrainedProblem(const Q& start, const Constraint& constraint, const ConstrainedOptions<Q>& options)
      : points_{start, start, start}, constraint_(constraint) {
    std::array<double, static_cast<std::size_t>(N)> coordinates;
    toCoordinates(start, coordinates.data());
    valid_ = areFinite(coordinates.data(), N);
    if (!options.prior) return;
    prior_ = options.prior->mean;
    toCoordinates(prior_, coordinates.data());
    // Positive semi-definite; zero is none.
    const SemidefiniteParts<N> parts(options.prior->information);
    prior_rank_ = N - parts.null_dimension;
    valid_ = valid_ && parts.valid && (prior_rank_ == 0 || areFinite(coordinates.data(), N));
  }
  bool valid() const { return valid_; }
  ConstrainedSettings settings(const ConstrainedOptions<Q>& options) const {
    ConstrainedSettings settings{options.max_iterations, options.tolerance, options.curvature, options.second_order,
                                 options.noise};
    settings.prior_rank = prior_rank_;
    if (prior_rank_ > 0) {
      settings.prior_information.resize(N * N);
      toRows<N, N>(options.prior->information, settings.prior_information.data());
    }
    return settings;
  }
  const Q& current() const { return points_[0]; }

 private:
  static constexpr int constraintCount() {
    if constexpr (constrained) {
      return std::remove_cvref_t<
          decltype(std::declval<const Constraint&>().linearize(std::declval<const Q&>()).value)>::RowsAtCompileTime;
    }
    return 0;
  }
  static constexpr int P = constraintCount();

  static const ConstrainedProblem& of(const void* problem) { return *static_cast<const ConstrainedProblem*>(problem); }
  const Q& at(ParameterPoint point) const { return points_[static_cast<std::size_t>(point)]; }

  static void move(void* problem, ParameterPoint from, ParameterPoint to, const double* step) {
    auto& points = static_cast<ConstrainedProblem*>(problem)->points_;
    const Q& x = points[static_cast<std::size_t>(from)];
    points[static_cast<std::size_t>(to)] = step ? movedBy(x, step) : x;
  }
  static const void* point(const void* problem, ParameterPoint point) { return &of(problem).at(point); }
  static void coordinates(const void* problem, double* values) { toCoordinates(of(problem).points_[0], values); }
  static void transport(const void* problem, double* matrix) {
    const ConstrainedProblem& p = of(problem);
    toRows<N, N>(inverse<double, N>(logJacobian(p.current(), p.at(ParameterPoint::shifted))), matrix);
  }
  static void constraint(const void* problem, ParameterPoint point, double* values) {
    toValues<P>(of(problem).constraint_(of(problem).at(point)), values);
  }
  static void linearizeConstraint(const void* problem, ParameterPoint point, double* values, double* by_parameter) {
    const auto J = of(problem).constraint_.linearize(of(problem).at(point));
    toValues<P>(J.value, values);
    toRows<P, N>(J.by_parameter, by_parameter);
  }
  static void priorError(const void* problem, ParameterPoint point, double* error, double* by_parameter) {
    const ConstrainedProblem& p = of(problem);
    if constexpr (is_vector<Q>) {
      for (int k = 0; k < N; ++k) error[k] = p.at(point)[k] - p.prior_[k];
      for (int k = 0; k < N * N && by_parameter; ++k) by_parameter[k] = k % (N + 1) == 0;
    } else {
      toRows<N, 1>(log(p.prior_, p.at(point)), error);
      if (by_parameter) toRows<N, N>(logJacobian(p.prior_, p.at(point)), by_parameter);
    }
  }
  static constexpr bool is_linear = requires { Constraint::G; };
  static constexpr ParameterFunctions describe() {
    ParameterFunctions f{N,       P,       is_vector<Q>, is_linear,  &move, &point, &coordinates,
                         nullptr, nullptr, nullptr,      &priorError};
    if constexpr (!is_vector<Q>) f.transport = &transport;
    if constexpr (constrained) f.constraint = &constraint, f.linearizeConstraint = &linearizeConstraint;
    return f;
  }

  std::array<Q, 3> points_;
  Constraint constraint_;
  Q prior_ = ManifoldTraits<Q>::origin();
  int prior_rank_ = 0;
  bool valid_ = true;

 public:
  static constexpr ParameterFunctions functions = describe();
};

}  // namespace detail
}  // namespace liestat
