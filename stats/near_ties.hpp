// Features that a sample does not tell from its mean: other minima of the criterion, higher by no more than the noise
// of the data explains. Needs Eigen alone.
//
// A certificate (stats/uniqueness.hpp) speaks of the sample's criterion. Of two clouds of rotations half a turn apart
// the mean lies on one side or the other by chance, and the next sample says the opposite. A rival at y is judged by
// the differences e_i = ½ p_i (d²(y, x_i) - d²(mean, x_i)), whose sum is how much higher it is: paired data, so
//     z = Σ e_i/(√n sd(e_i))
// is Student's t with n - 1 degrees of freedom where the truth has no preference. Where the noise is known the sum of
// e_i/variance is a log-likelihood ratio, and speaks for itself. A minimum within the 99 % region of the mean is no
// rival: the covariance covers it. For clouds the moments of the angles prove that there is no rival
// (stats/detail/sum_certificates.hpp). Otherwise rivals are found by descents from data and along the principal axes of
// the scatter, without a proof that there are no others.
#pragma once

#include <lie/detail/small_eigen.hpp>
#include <stats/covariance.hpp>
#include <stats/detail/averaged_slope.hpp>
#include <stats/detail/compact_part.hpp>
#include <stats/detail/find_uniqueness.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/detail/any_executor.hpp>
#include <stats/detail/weights.hpp>
#include <stats/detail/sum_certificates.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/executor.hpp>
#include <stats/gaussian.hpp>
#include <stats/mean.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <ranges>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {

/// A rival of a mean that the data do not exclude.
template <Homogeneous M>
struct NearTie {
  M feature = ManifoldTraits<M>::origin();
  double z = 0;  ///< how much higher its cost is, in standard deviations of that difference
  /// The same as a log-likelihood ratio, where the noise is known; NaN elsewhere.
  double log_likelihood_ratio = std::numeric_limits<double>::quiet_NaN();
};

/// Criteria by which nearTies() accepts a rival.
struct NearTieOptions {
  double significance = 0.00135;  ///< one-sided, of Student's law; that of three standard deviations of a normal one
  double log_likelihood_ratio = 4.5;  ///< where the noise is known: less is a rival; half of three squared
  double region = 0.01;               ///< minima that the mean's law reaches with this probability are no rivals
};

namespace detail {

/// Where descents to rivals start: some of the data, and both ways along the principal axes of the compact scatter,
/// twice its root mean square away, which is where the rival of two opposite clouds lies.
template <Metric M, class R>
std::vector<M> startsOfRivals(const R& samples, const MeanResult<M>& mean) {
  constexpr int K = averaged_dimension<M>, begin = averagedBegin<M>();
  const std::size_t n = std::ranges::size(samples);
  const std::size_t several = std::min<std::size_t>(n, n > 20000                                     ? 3
                                                       : compactFactor<M>() == CompactFactor::circle ? 64
                                                                                                     : 8);
  std::vector<M> starts;
  for (std::size_t i = 0; i < several; ++i) starts.push_back(M(samples[i * n / several]));
  const Eigen::Matrix<double, K, K> scatter =
      mean.scatter.template block<K, K>(begin, begin).template cast<double>() / mean.sum_of_weights;
  if (!scatter.allFinite()) return starts;
  const SymmetricEigen axes(scatter);
  for (int k = 0; k < K; ++k) {
    const double length = std::min(2 * std::sqrt(std::max(0.0, axes.values[k])), pi);
    for (const double sign : {1.0, -1.0}) {
      TangentOf<M> v = TangentOf<M>::Zero();
      v.template segment<K>(begin) = (sign * length * axes.vectors.col(k)).template cast<ScalarOf<M>>();
      starts.push_back(exp(mean.mean, v));
    }
  }
  return starts;
}

/// Every m-th of very many data with its weight, for descents that end near a minimum of all; else nothing.
template <Metric M>
struct Part {
  std::vector<M> features;
  std::vector<double> weights;

  template <class R, class W>
  Part(const R& samples, const W& all_weights) {
    const std::size_t n = std::ranges::size(samples), stride = n > 20000 ? n / max_averaged : n + 1;
    for (std::size_t i = 0; stride <= n && i < n; i += stride) {
      features.push_back(M(samples[i]));
      weights.push_back(static_cast<double>(all_weights[i]));
    }
  }
};

/// Data within a third of the injectivity radius of their mean are twice as far from any place that might rival it:
/// their cut loci are this far from the mean, rad.
template <Metric M>
double farFromRivals(const M& mean) {
  return 2.0 / 3 * static_cast<double>(injectivityRadiusAt(mean));
}
/// True if no cut locus is nearer to the mean than that, by what its last pass has seen.
template <Metric M>
bool isFarFromRivals(const MeanResult<M>& mean) {
  return leastDistanceToCutLocus(mean) >= farFromRivals(mean.mean);
}

/// The noise of the data where it is not known.
struct NoNoise {};

/// The noise of the I-th factor of a product.
template <std::size_t I, Metric M, class Noise>
struct FactorNoise {
  const Noise& noise;
  auto operator()(std::size_t i) const {
    using F = std::tuple_element_t<I, FactorsOf<M>>;
    constexpr int k = ManifoldTraits<F>::DoF, begin = factorOffset<I, M>();
    return SquareOf<F>(noise(i).template block<k, k>(begin, begin));
  }
};

/// `noise(i)` is the covariance of datum i's noise, or NoNoise; `residual_law`: `covariance` is from residuals.
template <Metric M, Executor E, class R, class W, class Noise>
std::vector<NearTie<M>> findNearTies(const E& executor, const R& samples, const W& weights, const MeanResult<M>& mean,
                                     const SquareOf<M>& covariance, bool residual_law, const Noise& noise,
                                     const NearTieOptions& options) {
  constexpr bool known_noise = !std::is_same_v<Noise, NoNoise>;
  using T = ManifoldTraits<M>;
  std::vector<NearTie<M>> ties;
  const std::size_t n = std::ranges::size(samples);
  if (n < 2 || !covariance.allFinite()) return ties;
  if constexpr (Factored<M>) {
    forEachIndex<std::tuple_size_v<FactorsOf<M>>>([&](auto i) {
      using F = std::tuple_element_t<i, FactorsOf<M>>;
      constexpr int k = ManifoldTraits<F>::DoF, begin = factorOffset<i, M>();
      const auto noise_of_factor = [&] {
        if constexpr (known_noise) {
          return FactorNoise<i, M, Noise>{noise};
        } else {
          return NoNoise{};
        }
      }();
      const auto of_factor = findNearTies<F>(
          executor, FactorRange<i, M, R>{samples}, weights, factorMean<i>(executor, samples, weights, mean),
          SquareOf<F>(covariance.template block<k, k>(begin, begin)), residual_law, noise_of_factor, options);
      for (const NearTie<F>& tie : of_factor) {
        auto factors = FactorsOf<M>(T::factors(mean.mean));
        std::get<i>(factors) = tie.feature;
        ties.push_back({M(T::fromFactors(factors)), tie.z, tie.log_likelihood_ratio});
      }
    });
  } else if constexpr (compactFactor<M>() != CompactFactor::none) {
    constexpr int K = averaged_dimension<M>, begin = averagedBegin<M>();
    using Vector = Eigen::Matrix<double, K, 1>;
    const Eigen::Matrix<double, K, K> region = covariance.template block<K, K>(begin, begin).template cast<double>();
    if (isFarFromRivals(mean)) return ties;
    if constexpr (has_compact_factor<M> && !known_noise) {
      if (haveNoNearTiesBySums(mean, weightSums(weights, n), options.significance)) return ties;
    }
    if (!(distanceToCutLocus(samples, mean.mean) < farFromRivals(mean.mean))) return ties;
    const auto squaredAngle = [](const typename T::Group& to_y, const M& x) {
      const TangentOf<M> z = T::logOrigin(T::act(to_y, x));
      return static_cast<double>(z.dot(T::metricWeights().cwiseProduct(z)));
    };
    const auto to_mean = T::placement(mean.mean).inverse();
    const auto isAmong = [](const std::vector<M>& list, const M& y) {
      return std::any_of(list.begin(), list.end(),
                         [&](const M& x) { return static_cast<double>(log(x, y).norm()) < 1e-3; });
    };
    const Part<M> part(samples, weights);
    std::vector<M> seen{mean.mean}, seen_by_part;
    for (const M& start : startsOfRivals(samples, mean)) {
      MeanOptions<M> how;
      how.start = start;
      if (!part.features.empty()) {
        const MeanResult<M> near = frechetMean<M>(executor, asSamples(part.features), asWeights(part.weights), how);
        if (!converged(near.status) || isAmong(seen_by_part, near.mean)) continue;
        seen_by_part.push_back(near.mean);
        how.start = near.mean;
      }
      const MeanResult<M> found = frechetMean<M>(executor, samples, weights, how);
      if (!converged(found.status) || isAmong(seen, found.mean)) continue;
      seen.push_back(found.mean);
      // The other coordinates of a minimum of the criterion are those of the mean.
      const Vector error = log(mean.mean, found.mean).template segment<K>(begin).template cast<double>();
      const double squared = mahalanobisSquared<double, K>(error, region);
      if ((residual_law ? hotellingTail(squared, K, static_cast<double>(n)) : chiSquaredTail(squared, std::size_t{K})) >
          options.region) {
        continue;
      }
      const auto to_rival = T::placement(found.mean).inverse();
      double sum = 0, squares = 0, ratio = 0;
      for (std::size_t i = 0; i < n; ++i) {
        const M& x = samples[i];
        const double half = 0.5 * (squaredAngle(to_rival, x) - squaredAngle(to_mean, x));
        const double e = static_cast<double>(weights[i]) * half;
        sum += e, squares += e * e;
        if constexpr (known_noise) {
          ratio += half * K / static_cast<double>(noise(i).template block<K, K>(begin, begin).trace());
        }
      }
      const double count = static_cast<double>(n), average = sum / count;
      const double sd = std::sqrt(std::max(0.0, squares - count * average * average) / (count - 1));
      NearTie<M> tie{found.mean, sum / (std::sqrt(count) * sd)};
      const bool undecided = !(studentTail(tie.z, count - 1) < options.significance);
      if (known_noise) tie.log_likelihood_ratio = ratio;
      if (known_noise ? ratio < options.log_likelihood_ratio : undecided) ties.push_back(tie);
    }
    std::sort(ties.begin(), ties.end(), [](const NearTie<M>& a, const NearTie<M>& b) { return a.z < b.z; });
  }
  return ties;
}

}  // namespace detail

/// The rivals of a mean that descents find and the data do not exclude, the nearest tie first. `covariance` is that of
/// the mean from residuals. Of products the rivals of each factor.
template <detail::AnyRange R, class M = detail::MetricInSignature<R>>
std::vector<NearTie<M>> nearTies(R&& samples, const MeanResult<std::type_identity_t<M>>& mean,
                                 const SquareOf<M>& covariance, const NearTieOptions& options = {}) {
  if constexpr (detail::RequireMean<R>::ok) {
    const auto features = detail::asSamples(samples);
    return detail::findNearTies<M>(detail::erased(SerialExecutor{}), features, detail::ones(features.size()), mean,
                                   covariance, true, detail::NoNoise{}, options);
  } else {
    return {};
  }
}
template <detail::AnyRange R, detail::AnyRange W, class M = detail::MetricInSignature<R>>
std::vector<NearTie<M>> nearTies(R&& samples, W&& weights, const MeanResult<std::type_identity_t<M>>& mean,
                                 const SquareOf<M>& covariance, const NearTieOptions& options = {}) {
  if constexpr (detail::RequireMean<R>::ok && detail::RequireWeights<W>::ok) {
    return detail::withRelativeWeights<M>(
        detail::asSamples(samples), detail::asWeights(weights),
        [&](const auto& features, const auto& numbers, const detail::KeptRows&) {
          return detail::findNearTies<M>(detail::erased(SerialExecutor{}), features, numbers, mean, covariance, true,
                                         detail::NoNoise{}, options);
        },
        [] { return std::vector<NearTie<M>>(); });
  } else {
    return {};
  }
}

}  // namespace liestat
