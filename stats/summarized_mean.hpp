// summarizedMean: the mean of features by any criterion, certified, as a result that is the same for all types. The
// program and Python's module compute their means by it. Needs Eigen alone.
//
//   const MeanInput<SO3d> input{.features = rotations};
//   const MeanSummary mean = summarizedMean(SerialExecutor{}, input);
#pragma once

#include <lie/crystal_orientation.hpp>
#include <lie/s2.hpp>
#include <stats/certified_group_mean.hpp>
#include <stats/certified_maha.hpp>
#include <stats/certified_mean.hpp>
#include <stats/concentration.hpp>
#include <stats/covariance.hpp>
#include <stats/detail/any_executor.hpp>
#include <stats/detail/mean_dependence.hpp>
#include <stats/dispersion.hpp>
#include <stats/mean_summary.hpp>
#include <stats/robust_mean.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {

/// Measurements of one type, and how they are averaged. The lists must outlive the call.
template <Homogeneous M>
struct MeanInput {
  Criterion criterion = Metric<M> ? Criterion::lsq : Criterion::barycentre;
  std::span<const M> features = {};
  std::span<const double> weights = {};  ///< one for each feature, or none; not for maha
  /// Covariances of the features' errors, one for each feature or a single one, as in CertifiedMeanOptions and maha();
  /// none: the covariance of the mean comes from the residuals.
  std::vector<SquareOf<M>> covariances = {};
  /// Factors of these, which have more digits, for maha: one for each feature or a single one, or none.
  std::vector<SquareOf<M>> factors = {};
  CovarianceAt covariance_at = CovarianceAt::measured;  ///< frame of the covariances, for maha
  bool likelihood = false;                              ///< maha: with the volume element
  /// The fate of covariances that the measurements refute; for lsq, wlsq and barycentre.
  RefutedNoise refuted_noise = RefutedNoise::withheld;
  ResidualNoise weights_are = ResidualNoise::precision;  ///< for a covariance from residuals
  bool scale_noise = false;                              ///< Birge's factor, where they are not refuted
  MeanRegion region = MeanRegion::law;                   ///< of a covariance from residuals; not for maha
  /// Times of the features, in any unit, one for each or none: whether errors depend on them is tested then, up to
  /// `max_timed_rows` features.
  std::span<const double> times = {};
  bool inflate = false;  ///< widens the covariance by the dependence on time
  static constexpr std::size_t max_timed_rows = 200000;

  /// What is wrong with the lists, or nothing: each has one entry for each feature, covariances and factors may have a
  /// single one, and times are finite.
  std::string fault() const {
    const auto wrong = [&](std::size_t n, bool single) {
      return n != 0 && n != features.size() && !(single && n == 1);
    };
    const auto sentence = [&](const char* list, std::size_t n) {
      return std::string(list) + ": " + std::to_string(n) + " for " + std::to_string(features.size()) + " features";
    };
    if (wrong(weights.size(), false)) return sentence("weights", weights.size());
    if (wrong(covariances.size(), true)) return sentence("covariances", covariances.size());
    if (wrong(factors.size(), true)) return sentence("factors", factors.size());
    if (wrong(times.size(), false)) return sentence("times", times.size());
    const auto finite = [](double t) { return std::isfinite(t); };
    if (!std::all_of(times.begin(), times.end(), finite)) return "times that are not finite";
    if (isRobust(criterion)) {
      if constexpr (!Metric<M> && !HasMetricTwin<M>) return "a robust mean of a type without a metric";
      if (weighted()) return "a robust mean of weighted features";
      if (!covariances.empty()) return "a robust mean of features with covariances, which it does not use";
      if (inflate || region != MeanRegion::law)
        return "a robust mean with inflate or a bootstrap, which it does not have";
    }
    if (criterion == Criterion::maha && covariances.empty()) return "a Mahalanobis mean without covariances";
    if constexpr (std::is_same_v<M, CrystalOrientation>) {
      if (criterion == Criterion::maha) return "a Mahalanobis mean of orientations of crystals, which have none";
      const auto differs = [&](const M& x) { return !(x.group() == features.front().group()); };
      if (std::any_of(features.begin(), features.end(), differs)) return "orientations of several point groups";
    }
    return {};
  }
  bool weighted() const {
    return std::any_of(weights.begin(), weights.end(), [&](double w) { return w != weights.front(); });
  }
  /// The features with their covariances.
  std::vector<Gaussian<M>> gaussians() const {
    std::vector<Gaussian<M>> list;
    list.reserve(features.size());
    for (const M& x : features) list.push_back({x, covariances[covariances.size() == 1 ? 0 : list.size()]});
    return list;
  }
  /// The features with the factors.
  std::vector<FactoredGaussian<M>> factoredGaussians() const {
    std::vector<FactoredGaussian<M>> list;
    list.reserve(features.size());
    for (const M& x : features) list.push_back({x, factors[factors.size() == 1 ? 0 : list.size()]});
    return list;
  }
};

/// Options of summarizedMean().
struct MeanSummaryOptions {
  /// The budget is that of the search; for maha, which cannot certify, a tenth of the default at most.
  UniquenessOptions uniqueness = {};
  /// False: the iteration and its covariance alone, without a search for other minima; a tenth of the time for a
  /// million features. The farthest measurements are not looked for either.
  bool certificates = true;
};

/// Both models of covariances of the type's errors, in the frames of the measurements and in that of the mean, differ.
template <Homogeneous M>
constexpr bool covarianceFrameMatters() {
  return Metric<M> && ManifoldTraits<M>::Group::DoF == ManifoldTraits<M>::DoF && tangentPartsOf<M>().size() > 1;
}

namespace detail {

/// The fields of every estimate: its iteration.
template <class Iteration>
void setIteration(MeanSummary& mean, const Iteration& iteration) {
  mean.n = iteration.n;
  mean.law_n = static_cast<double>(iteration.n);
  mean.mean = featureValue(iteration.mean);
  mean.converged = converged(iteration.status);
  mean.iterations = iteration.iterations;
  mean.residual = static_cast<double>(iteration.residual);
  mean.tolerance = static_cast<double>(iteration.tolerance);
  if constexpr (requires { iteration.cost; }) mean.cost = static_cast<double>(iteration.cost);
}

/// The status of the mean with its covariance. Too few measurements for a covariance from residuals have a mean all the
/// same, and that is the answer.
inline void setStatus(MeanSummary& mean, Status status, const char* reason) {
  mean.status = status, mean.reason = reason;
  if (status == Status::too_few && mean.n > 0) {
    mean.status = Status::not_applicable;
    if (mean.reason == unbounded_region_reason) return void(mean.covariance_status = mean.status);
    mean.reason = "a covariance from residuals needs more measurements than the feature has dimensions";
  }
  mean.covariance_status = mean.status;
}

/// A certified estimate.
template <class Iteration, class Certified>
void setCertified(MeanSummary& mean, const Iteration& iteration, const Certified& result) {
  setIteration(mean, iteration);
  setStatus(mean, result.status, result.reason);
  mean.unique = result.uniqueness.unique;
  mean.proof = result.uniqueness.proof;
  mean.r_star = result.uniqueness.r_star;
  mean.cells = result.uniqueness.cells;
  mean.more_rivals = result.uniqueness.more_rivals;
  for (const auto& rival : result.uniqueness.rivals) mean.rivals.push_back(featureValue(rival));
  for (const auto& tie : result.near_ties) mean.near_ties.push_back({featureValue(tie.feature), tie.z});
  mean.cut_locus_mass = result.cut_locus.mass;
  mean.hessian_change = result.hessian_change;
  mean.fit = result.fit;
  mean.region_factor = result.region_factor;
  if (result.valley) {
    mean.valley = NearRival{featureValue(result.valley->feature), result.valley->z};
    mean.valley_angle = largestAngle(iteration.mean, result.valley->feature);
    if (result.status == Status::ambiguous && result.near_ties.empty()) mean.reason += ": " + mean.valleyInWords();
  }
  if (result.estimate) mean.covariance = result.estimate->covariance.template cast<double>();
}

/// An estimate without certificates: the iteration, and its covariance where the features show a mean at all and, with
/// `mean.fit` set, do not refute their noise.
template <Homogeneous M, class Iteration>
void setUncertified(MeanSummary& mean, const Iteration& iteration, const SquareOf<M>& covariance, bool concentrated) {
  setIteration(mean, iteration);
  const bool few = !mean.known_noise && iteration.n <= static_cast<std::size_t>(ManifoldTraits<M>::DoF);
  if (iteration.n == 0) return setStatus(mean, Status::too_few, "there are no features");
  if (!converged(iteration.status)) return setStatus(mean, iteration.status, not_converged_reason);
  if (few) return setStatus(mean, Status::too_few, too_few_reason);
  if (mean.known_noise && mean.fit.refuted()) return setStatus(mean, Status::inconsistent, refuted_reason);
  if (!concentrated) return setStatus(mean, Status::ill_defined, scattered_reason);
  if (!covariance.allFinite()) return setStatus(mean, Status::ill_defined, hessian_reason);
  setStatus(mean, Status::ok, "");
  mean.covariance = covariance.template cast<double>();
}

template <Homogeneous M>
void setDispersion(MeanSummary& mean, const MeanInput<M>& input, const M& y) {
  if (mean.n == 0) return;
  const Dispersion<M> dispersion =
      input.weights.empty() ? dispersionAbout(input.features, y) : dispersionAbout(input.features, input.weights, y);
  mean.dispersion = dispersion.covariance.template cast<double>();
  mean.order = dispersion.order;
  mean.skewness = dispersion.skewness;
  for (const FarthestFeature& f : dispersion.farthest) {
    mean.farthest.push_back({f.block.part, f.distance, f.index});
  }
}

/// The dependence of errors on the features' times.
template <Homogeneous M>
void setTimeDependence(MeanSummary& mean, const MeanInput<M>& input) {
  using T = ManifoldTraits<M>;
  constexpr int k = T::DoF;
  using Matrix = Eigen::Matrix<double, k, k>;
  if (input.times.empty() || !mean.hasCovariance()) return;
  if (mean.n > MeanInput<M>::max_timed_rows) return;
  const auto to_y = T::placement(featureOf<M>(mean.mean)).inverse();
  // Weights of any meaning but counts and precisions say nothing of the errors' sizes.
  const bool precisions = mean.weighted && mean.weights_are != ResidualNoise::importance;
  const auto scale = weightScale<double>(input.weights, input.weights.size());
  const auto counts = [&](std::size_t i) { return input.weights.empty() || scale.keeps(input.weights[i]); };
  std::vector<TimedRow<k, k>> rows;
  Matrix scatter = Matrix::Zero();
  rows.reserve(mean.n);
  for (std::size_t i = 0; i < input.features.size(); ++i) {
    if (!counts(i)) continue;
    const double root = precisions ? std::sqrt(scale(input.weights[i])) : 1;
    auto& row = rows.emplace_back();
    row.time = input.times[i];
    row.residual() = root * T::logOrigin(T::act(to_y, input.features[i])).template cast<double>();
    row.columns() = root * Matrix::Identity();
    scatter += row.residual() * row.residual().transpose() / static_cast<double>(mean.n);
  }
  Cholesky<double, k> noise(scatter);
  for (std::size_t i = 0, r = 0; i < input.features.size(); ++i) {
    if (!counts(i)) continue;
    if (mean.known_noise) {
      noise =
          Cholesky<double, k>(Matrix(input.covariances[input.covariances.size() > 1 ? i : 0].template cast<double>()));
    }
    if (!noise.ok()) return;
    auto& row = rows[r++];
    row.values = noise.template halfSolve<k + 1>(row.values);
  }
  setDependence<k>(mean, std::move(rows), input.inflate);
}

template <Metric M, Executor E>
void setLeastSquares(MeanSummary& mean, const E& executor, const MeanInput<M>& input,
                     const MeanSummaryOptions& options) {
  const bool ones = input.weights.empty();
  // Without certificates there is Hotelling's law for precisions alone.
  if (options.certificates || input.weights_are != ResidualNoise::precision || input.region != MeanRegion::law) {
    CertifiedMeanOptions<M> how;
    how.uniqueness = options.uniqueness;
    how.known_noise = input.covariances;
    how.refuted_noise = input.refuted_noise;
    how.noise = input.weights_are;
    how.scale_noise = input.scale_noise;
    how.region = input.region;
    const CertifiedMean<M> result = ones ? certifiedMean(executor, input.features, how)
                                         : certifiedMean(executor, input.features, input.weights, how);
    setCertified(mean, result.mean, result);
    mean.known_noise = result.from_noise;
    if (!result.from_noise && result.law_n > 0) mean.law_n = result.law_n;
    mean.region = result.region, mean.skew_factor = result.skew_factor;
    return setDispersion(mean, input, result.mean.mean);
  }
  const MeanResult<M> result =
      ones ? liestat::mean(executor, input.features) : liestat::mean(executor, input.features, input.weights);
  if (mean.known_noise && converged(result.status)) {
    mean.fit = fitToNoise<M>(executor, asSamples(input.features), input.covariances, result.mean);
    if (input.refuted_noise == RefutedNoise::residuals) mean.known_noise = !mean.fit.refuted();
  }
  const SquareOf<M> covariance = !mean.known_noise ? covarianceFromResiduals(result)
                                 : ones            ? covarianceFromNoise(result, input.covariances)
                                                   : covarianceFromNoise(result, input.weights, input.covariances);
  const Concentration found =
      ones ? concentration(input.features, result.mean) : concentration(input.features, input.weights, result.mean);
  setUncertified<M>(mean, result, covariance, found.concentrated);
  if (result.n > 0) mean.dispersion = result.dispersion().template cast<double>();
}

/// Huber's mean and the median; of rigid motions those of their frames, whose covariances have the same axes.
template <class M>
void setRobust(MeanSummary& mean, const MeanInput<M>& input) {
  if constexpr (Metric<M>) {
    const RobustMean<M> result =
        robustMean(input.features, input.criterion == Criterion::huber ? RobustLoss::huber : RobustLoss::median);
    setIteration(mean, result);
    mean.converged = converged(result.status) || (result.status == Status::too_few && result.n > 0);
    mean.status = mean.covariance_status =
        result.status == Status::too_few && result.n > 0 ? Status::not_applicable : result.status;
    mean.reason = result.reason;
    mean.unique = result.unique ? Uniqueness::unique : Uniqueness::not_certified;
    mean.proof = result.proof;
    if (result.rival) mean.near_ties.push_back({featureValue(*result.rival), result.rival_z});
    const std::vector<TangentBlock> parts = robustParts<M>();
    for (std::size_t b = 0; b < result.scales.size(); ++b) mean.scales.push_back({parts[b].part, result.scales[b]});
    for (const RobustOutlier& x : result.outliers) mean.outliers.push_back({{x.part, x.distance, x.index}, x.p});
    mean.shift_p = result.shift_p;
    if (result.estimate) mean.covariance = result.estimate->covariance.template cast<double>();
    setDispersion(mean, input, result.mean);
  } else if constexpr (HasMetricTwin<M>) {
    using Twin = std::remove_cvref_t<decltype(ManifoldTraits<M>::metricTwin(input.features[0]))>;
    std::vector<Twin> twins;
    twins.reserve(input.features.size());
    for (const M& x : input.features) twins.push_back(ManifoldTraits<M>::metricTwin(x));
    setRobust(mean, MeanInput<Twin>{.criterion = input.criterion, .features = twins});
    if (mean.n > 0) mean.mean = featureValue(M(ManifoldTraits<M>::fromMetricTwin(featureOf<Twin>(mean.mean))));
    for (NearRival& tie : mean.near_ties) {
      tie.feature = featureValue(M(ManifoldTraits<M>::fromMetricTwin(featureOf<Twin>(tie.feature))));
    }
  }
}

template <LieGroup G, Executor E>
void setBarycentre(MeanSummary& mean, const E& executor, const MeanInput<G>& input, const MeanSummaryOptions& options) {
  const bool ones = input.weights.empty();
  if (options.certificates || input.weights_are != ResidualNoise::precision || input.region != MeanRegion::law) {
    CertifiedGroupMeanOptions<G> how;
    how.uniqueness = options.uniqueness;
    how.known_noise = input.covariances;
    how.refuted_noise = input.refuted_noise;
    how.noise = input.weights_are;
    how.scale_noise = input.scale_noise;
    how.region = input.region;
    const CertifiedGroupMean<G> result = ones ? certifiedGroupMean(executor, input.features, how)
                                              : certifiedGroupMean(executor, input.features, input.weights, how);
    setCertified(mean, result.mean, result);
    mean.known_noise = result.from_noise;
    if (!result.from_noise && result.law_n > 0) mean.law_n = result.law_n;
    mean.region = result.region, mean.skew_factor = result.skew_factor;
    return setDispersion(mean, input, result.mean.mean);
  }
  const GroupMeanResult<G> result =
      ones ? groupMean(executor, input.features) : groupMean(executor, input.features, input.weights);
  // A covariance from noise is certified, or there is none.
  mean.known_noise = false;
  setUncertified<G>(mean, result, result.covarianceFromResiduals(), result.concentration.concentrated);
  setDispersion(mean, input, result.mean);
}

template <Homogeneous M, Executor E>
void setMahalanobis(MeanSummary& mean, const E& executor, const MeanInput<M>& input,
                    const MeanSummaryOptions& options) {
  const std::vector<Gaussian<M>> samples = input.gaussians();
  const bool factored = !input.factors.empty();
  if (options.certificates) {
    CertifiedMahaOptions<M> how;
    const std::size_t most = how.uniqueness.budget;
    how.maha.likelihood = input.likelihood;
    how.uniqueness = options.uniqueness;
    how.uniqueness.budget = std::min(options.uniqueness.budget, most);
    how.scale_noise = input.scale_noise;
    const CertifiedMaha<M> result = factored
                                        ? certifiedMaha(executor, input.factoredGaussians(), input.covariance_at, how)
                                        : certifiedMaha(executor, samples, input.covariance_at, how);
    if (factored) mean.covariance_factor = result.factor.template cast<double>();
    setCertified(mean, result.maha, result);
    return setDispersion(mean, input, result.maha.mean);
  }
  MahaOptions<M> how;
  how.likelihood = input.likelihood;
  const MahaResult<M> result = factored ? maha(executor, input.factoredGaussians(), input.covariance_at, how)
                                        : maha(executor, samples, input.covariance_at, how);
  mean.fit = result.fit;
  setUncertified<M>(mean, result, result.covariance, showAMean<M>(samples, result.mean));
  if (factored) {
    mean.covariance_factor = result.factor.template cast<double>();
    if (!mean.hasCovariance()) mean.covariance_factor.fill(std::numeric_limits<double>::quiet_NaN());
  }
  setDispersion(mean, input, result.mean);
}

}  // namespace detail

/// The mean of the measurements by their criterion, with its covariance if that can be trusted, its certificates and
/// the dispersion; `feature` and notes are left to the caller (stats/mean_notes.hpp). A criterion that the type does
/// not have (barycentre of a type with a metric, lsq without) is taken for the one that it has. The result has the same
/// bits on any executor. Lists of the wrong length give `not_applicable` with the reason, and nothing else.
template <Homogeneous M, Executor E>
MeanSummary summarizedMean(const E& executor, const MeanInput<M>& input, const MeanSummaryOptions& options = {}) {
  decltype(auto) any = detail::erased(executor);
  MeanSummary mean;
  mean.parts = tangentPartsOf<M>();
  mean.group = !Metric<M>;
  mean.criterion = input.criterion;
  mean.likelihood = input.likelihood;
  mean.weighted = input.weighted();
  mean.weights_are = input.weights_are;
  mean.known_noise = !input.covariances.empty();
  if (mean.known_noise && covarianceFrameMatters<M>()) mean.covariance_at = input.covariance_at;
  if (mean.reason = input.fault(); !mean.reason.empty()) {
    mean.status = mean.covariance_status = Status::not_applicable;
    return mean;
  }
  constexpr bool is_crystal = std::is_same_v<M, CrystalOrientation>;
  if constexpr (is_crystal) {
    if (!input.features.empty()) mean.symmetry = input.features.front().group().name();
  }
  if (isRobust(input.criterion)) {
    detail::setRobust(mean, input);
  } else if (!is_crystal && input.criterion == Criterion::maha) {
    if constexpr (!is_crystal) detail::setMahalanobis(mean, any, input, options);
  } else if constexpr (is_crystal || Metric<M>) {
    detail::setLeastSquares(mean, any, input, options);
  } else {
    detail::setBarycentre(mean, any, input, options);
  }
  if (input.features.size() <= MeanInput<M>::max_timed_rows) {
    mean.repeated = repeatedRows(input.features.size(), ManifoldTraits<M>::DoF, [&](std::size_t i) -> decltype(auto) {
      if constexpr (requires { input.features[i].params(); }) {
        return input.features[i].params();
      } else {
        return (input.features[i]);
      }
    });
  }
  mean.noise_scaled = input.scale_noise && mean.known_noise && mean.hasCovariance() && mean.fit.tested();
  if (mean.noise_scaled && !options.certificates) mean.covariance *= mean.fit.factor();
  if (!isRobust(input.criterion)) detail::setTimeDependence(mean, input);
  if constexpr (std::is_same_v<M, S2<ScalarOf<M>>>) {
    const M y = featureOf<M>(mean.mean);
    mean.tangent_basis = ManifoldTraits<M>::placement(y).matrix().template leftCols<2>().template cast<double>();
  }
  return mean;
}

}  // namespace liestat
