#include <experiments/propagation_experiment.hpp>

#include <lie/sim3.hpp>
#include <stats/propagation.hpp>
#include <stats/sampling.hpp>

#include <cmath>

namespace liestat::experiments {
namespace {

/// The noise of a feature; tangent order is translation, rotation, logarithm of the scale.
template <int N>
Eigen::Matrix<double, N, N> noise(double spread) {
  Eigen::Matrix<double, 7, 1> sd;
  sd << 1.0 / 3, 2.0 / 3, 1, 1, 2.0 / 3, 1.0 / 3, 1.0 / 3;
  // Three coordinates are a point or a rotation.
  const int first = N == 3 ? 3 : 0;
  Eigen::Matrix<double, N, N> covariance;
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < N; ++j) {
      covariance(i, j) = spread * spread * sd[first + i] * sd[first + j] * std::pow(0.5, std::abs(i - j));
    }
  }
  return covariance;
}

/// The given estimates and the truth.
template <class M>
struct Drawn {
  Gaussian<M> given;
  M truth;

  Drawn(const M& mean, const SquareOf<M>& covariance, CounterRng& rng)
      : given{mean, covariance}, truth(sample(given, rng)) {}
};

template <class G>
std::vector<TrialOutcome> trial(const PropagationExperiment& experiment, CounterRng& rng) {
  using Point = Eigen::Vector3d;
  // Everything is drawn, whatever is asked for: so an operation's draws do not depend on the others that are run.
  const SquareOf<G> covariance = noise<G::DoF>(experiment.spread);
  std::vector<Drawn<G>> factors;
  for (std::size_t i = 0; i < chain_length; ++i) factors.emplace_back(G::sampleUniform(rng), covariance, rng);
  // The leading 53 bits, as sampleUniform() takes them.
  const auto coordinate = [&rng] { return 2 * (static_cast<double>(rng() >> 11) * 0x1p-53) - 1; };
  const double x = coordinate(), y = coordinate(), z = coordinate();
  const Drawn<Point> point(Point(x, y, z), noise<3>(experiment.spread), rng);
  const Drawn<G>&a = factors[0], &b = factors[1];

  const auto distance = [&](const PropagationMethod& method) {
    const auto product = method.fourth_order
                             ? [](const Gaussian<G>& f, const Gaussian<G>& g) { return composeFourthOrder(f, g); }
                             : [](const Gaussian<G>& f, const Gaussian<G>& g) { return compose(f, g); };
    switch (method.operation) {
      case Operation::compose:
        return mahalanobisSquared(product(a.given, b.given), G(a.truth * b.truth));
      case Operation::inverse:
        return mahalanobisSquared(inverse(a.given), G(a.truth.inverse()));
      case Operation::between:
        return mahalanobisSquared(between(a.given, b.given), G(a.truth.inverse() * b.truth));
      case Operation::act:
        return mahalanobisSquared(act(a.given, point.given), Point(a.truth * point.truth));
      case Operation::chain:
        break;
    }
    Gaussian<G> all = a.given;
    G truth = a.truth;
    for (std::size_t i = 1; i < chain_length; ++i) {
      all = product(all, factors[i].given);
      truth = truth * factors[i].truth;
    }
    return mahalanobisSquared(all, truth);
  };
  std::vector<TrialOutcome> outcomes;
  for (const PropagationMethod& method : experiment.methods) {
    TrialOutcome outcome;
    outcome.mu2 = distance(method);
    outcomes.push_back(outcome);
  }
  return outcomes;
}

}  // namespace

std::vector<TrialOutcome> propagationTrial(const PropagationExperiment& experiment, CounterRng& rng) {
  switch (experiment.feature) {
    case Propagated::rotation:
      return trial<SO3d>(experiment, rng);
    case Propagated::pose:
      return trial<SE3d>(experiment, rng);
    case Propagated::similarity:
      return trial<Sim3d>(experiment, rng);
  }
  return {};
}

}  // namespace liestat::experiments
