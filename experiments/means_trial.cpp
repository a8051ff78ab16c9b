// The trials for every type of feature, in one unit: they share nearly all that they instantiate, so that a second type
// costs a compiler an eighth of the first. The harness around them is elsewhere.

#include <experiments/means_trial.hpp>
#include <lie/lie.hpp>
#include <stats/covariance.hpp>
#include <stats/maha.hpp>
#include <stats/printed.hpp>
#include <stats/sampling.hpp>
#include <stats/certified_mean.hpp>

#include <cmath>
#include <cstddef>
#include <type_traits>
#include <vector>

namespace liestat::experiments {
namespace {

/// The report's covariance Σ of a feature, in the library's tangent order.
template <class M>
SquareOf<M> reportCovariance(double spread) {
  TangentOf<M> sd;
  if constexpr (std::is_same_v<M, Eigen::Vector3d>) {
    sd << spread * 1, spread * 5, spread * 10;
  } else if constexpr (ManifoldTraits<M>::DoF == 2) {
    sd << spread * 0.3, spread * 0.6;
  } else if constexpr (ManifoldTraits<M>::DoF == 3) {
    sd << spread * 0.3, spread * 0.6, spread * 0.9;
  } else {
    sd << 1, 5, 10, spread * 0.3, spread * 0.6, spread * 0.9;
  }
  return sd.cwiseAbs2().asDiagonal();
}

/// Measurements of one feature.
template <class M>
struct Scene {
  M exact;
  std::vector<M> measurements;
  std::vector<SquareOf<M>> noise;     ///< V_i, in the frame of the exact feature
  std::vector<Gaussian<M>> attached;  ///< the measurements with the covariances that MAHA is given
  std::vector<double> weights;        ///< WLSQ's
};

template <class M>
Scene<M> drawScene(const MeansExperiment& experiment, CounterRng& rng) {
  using T = ManifoldTraits<M>;
  Scene<M> scene;
  scene.exact = sampleInCube<M>(rng, 100);
  const SquareOf<M> sigma = reportCovariance<M>(experiment.spread);
  for (std::size_t i = 0; i < experiment.n; ++i) {
    SquareOf<M> V = sigma;
    if (experiment.noise == Noise::isd) V /= static_cast<double>(i + 1);
    if (experiment.noise == Noise::idd || experiment.noise == Noise::exp) {
      for (int k = 0; k < T::DoF; ++k) {
        const double u = rng.uniform();
        V(k, k) *= experiment.noise == Noise::idd ? u : std::exp(-5 * u * u);
      }
    }
    const TangentOf<M> e = V.diagonal().cwiseSqrt().cwiseProduct(rng.normalVector<T::DoF>());
    M x = exp(scene.exact, e);
    SquareOf<M> attached = V;
    if constexpr (T::Group::DoF == T::DoF) {
      // Gaussian in the measurement's own frame: log(x_i, x) = e.
      if (experiment.covariance_at == CovarianceAt::measured) {
        x = T::act(T::placement(scene.exact) * T::placement(T::expOrigin(e)).inverse(), T::origin());
      }
      if constexpr (Quotient<M>) {
        // The representative that a sensor reports is arbitrary; a covariance attached to it moves along.
        const int index = static_cast<int>(rng() % 4);
        const bool member = index == 0 || T::num_representatives == 4 || index == 3;
        if (member) {
          x = T::representative(x, index);
          if (experiment.covariance_at == CovarianceAt::measured) {
            const SquareOf<M> K = T::representativeJacobian(index);
            attached = K * V * K.transpose();
          }
        }
      }
    } else {
      // No frame is common to all points: the covariance travels to the measurement by parallel transport.
      attached = transport(Gaussian<M>{scene.exact, V}, x).covariance;
    }
    scene.measurements.push_back(x);
    scene.noise.push_back(V);
    scene.attached.push_back({x, attached});
    scene.weights.push_back(experiment.noise == Noise::iid   ? 1.0
                            : experiment.noise == Noise::isd ? static_cast<double>(i + 1)
                                                             : scalarWeight<double, T::DoF>(V));
  }
  return scene;
}

/// Angle and length of the error of an estimate.
template <class M>
void setErrors(const M& estimate, const M& exact, MethodOutcome& outcome) {
  const TangentOf<M> z = log(estimate, exact);
  if constexpr (std::is_same_v<M, Eigen::Vector3d>) {
    outcome.translation_error = z.norm();
  } else if constexpr (ManifoldTraits<M>::DoF <= 3) {
    outcome.rotation_error = z.norm();
  } else {
    outcome.rotation_error = z.template tail<3>().norm(), outcome.translation_error = z.template head<3>().norm();
  }
}

/// Mean from the first measurement and from the exact feature, the better of the two.
template <class M, class W>
MeanResult<M> globalMean(const Scene<M>& scene, const W& weights, bool certify, int& iterations_from_first) {
  MeanOptions<M> options{.tolerance = 1e-10, .start = scene.measurements.front()};
  MeanResult<M> best = mean(scene.measurements, weights, options);
  iterations_from_first = best.iterations;
  options.start = scene.exact;
  const MeanResult<M> other = mean(scene.measurements, weights, options);
  if (!converged(best.status) || (converged(other.status) && other.cost < best.cost)) best = other;
  if (certify) {
    const auto certified = certifiedMean(scene.measurements, weights);
    if (converged(certified.mean.status) && certified.mean.cost < best.cost) best = certified.mean;
  }
  return best;
}

template <class M>
void leastSquares(const MeansExperiment& experiment, const Scene<M>& scene, const std::vector<double>& weights,
                  Criterion criterion, MethodOutcomes& outcomes) {
  const auto outcome = [&](bool corrected, bool known) -> MethodOutcome& {
    return outcomes[methodIndex({criterion, corrected, known})];
  };
  int iterations = 0;
  const MeanResult<M> result = globalMean(scene, weights, experiment.certify, iterations);
  // The noise in the frame of the estimate: that of the exact feature, up to the frame's transport.
  std::vector<SquareOf<M>> noise = scene.noise;
  if constexpr (ManifoldTraits<M>::Group::DoF != ManifoldTraits<M>::DoF) {
    for (SquareOf<M>& V : noise) V = transport(Gaussian<M>{scene.exact, V}, result.mean).covariance;
  }
  std::vector<SquareOf<M>> attached;
  for (const Gaussian<M>& g : scene.attached) attached.push_back(g.covariance);

  const auto set = [&](bool corrected, bool known, const SquareOf<M>& covariance) {
    MethodOutcome& o = outcome(corrected, known);
    o.iterations = iterations;
    setErrors(result.mean, scene.exact, o);
    if (converged(result.status))
      o.mahalanobis_squared = mahalanobisSquared(Gaussian<M>{result.mean, covariance}, scene.exact);
  };
  set(true, true, covarianceFromNoise(result, weights, noise));
  set(false, true, printed::covarianceFromNoise(scene.measurements, weights, attached, result.mean));
  set(true, false, covarianceFromResiduals(result));
  set(false, false, printed::covarianceFromResiduals(result));
}

template <class M>
void mahalanobisMeans(const MeansExperiment& experiment, const Scene<M>& scene, bool corrected,
                      MethodOutcome& outcome) {
  // On directions the covariances are attached to the measurements, whatever the option says for frames.
  constexpr bool measured_only = ManifoldTraits<M>::Group::DoF != ManifoldTraits<M>::DoF;
  const CovarianceAt at = measured_only ? CovarianceAt::measured : experiment.covariance_at;
  const auto from = [&](const M& start) {
    const MahaOptions<M> options{.method = experiment.maha_method,
                                 .tolerance = 1e-10,
                                 .start = start,
                                 .likelihood = experiment.maha_likelihood,
                                 .refutation_level = 0};
    return corrected ? maha(scene.attached, at, options) : printed::maha(scene.attached, options);
  };
  MahaResult<M> best = from(scene.measurements.front());
  outcome.iterations = best.iterations;
  const MahaResult<M> other = from(scene.exact);
  if (best.status != Status::ok || (other.status == Status::ok && other.cost < best.cost)) best = other;
  setErrors(best.mean, scene.exact, outcome);
  if (best.status == Status::ok) outcome.mahalanobis_squared = mahalanobisSquared(best.estimate(), scene.exact);
}

template <class M>
MethodOutcomes trial(const MeansExperiment& experiment, CounterRng& rng) {
  const Scene<M> scene = drawScene<M>(experiment, rng);
  MethodOutcomes outcomes{};
  const auto wanted = [&](Criterion criterion) {
    for (std::size_t m = 0; m < methods.size(); ++m) {
      if (experiment.wanted[m] && methods[m].criterion == criterion) return true;
    }
    return false;
  };
  const bool same = experiment.noise == Noise::iid;  // all weights are one
  if (wanted(Criterion::lsq) || (same && wanted(Criterion::wlsq))) {
    leastSquares(experiment, scene, std::vector<double>(experiment.n, 1.0), Criterion::lsq, outcomes);
  }
  if (wanted(Criterion::wlsq) && same) {
    for (const bool corrected : {true, false}) {
      for (const bool known : {true, false}) {
        outcomes[methodIndex({Criterion::wlsq, corrected, known})] =
            outcomes[methodIndex({Criterion::lsq, corrected, known})];
      }
    }
  } else if (wanted(Criterion::wlsq)) {
    leastSquares(experiment, scene, scene.weights, Criterion::wlsq, outcomes);
  }
  for (const bool corrected : {true, false}) {
    const std::size_t m = methodIndex({Criterion::maha, corrected, true});
    if (experiment.wanted[m]) mahalanobisMeans(experiment, scene, corrected, outcomes[m]);
  }
  return outcomes;
}

}  // namespace

MethodOutcomes meansTrial(const MeansExperiment& experiment, CounterRng& rng) {
  return withFeature(experiment.feature, [&]<ExperimentFeature M>() { return trial<M>(experiment, rng); });
}

}  // namespace liestat::experiments
