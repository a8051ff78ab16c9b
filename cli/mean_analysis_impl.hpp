// The templates behind mean_analysis.hpp and split.hpp, compiled in features.cpp.
#pragma once

#include <cli/io/input_error.hpp>
#include <cli/mean_analysis.hpp>
#include <experiments/parallel.hpp>
#include <lie/lie.hpp>
#include <stats/covariance.hpp>
#include <stats/group_mean.hpp>
#include <stats/maha.hpp>
#include <stats/uniqueness.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

namespace liestat::cli::detail {

template <class M>
inline constexpr bool is_point = std::is_same_v<M, Eigen::Vector3d>;
template <class M>
inline constexpr bool is_direction = std::is_same_v<M, S2d>;
template <class M>
inline constexpr bool is_rotation = std::is_same_v<M, SO3d>;
template <class M>
inline constexpr bool is_se3 = std::is_same_v<M, SE3d>;

/// The Riemannian twin of a feature: Frame3 for rigid motions, else the feature itself.
template <class M>
using MetricTwin = std::conditional_t<is_se3<M>, Frame3d, M>;

template <class M>
std::vector<M> features(const FeatureFile& file) {
  std::vector<M> list;
  list.reserve(file.size());
  for (std::size_t i = 0; i < file.size(); ++i) {
    if constexpr (is_point<M>) {
      list.push_back(file.vectors[i]);
    } else if constexpr (is_direction<M>) {
      list.push_back(M::fromParams(file.vectors[i]));
    } else if constexpr (is_rotation<M>) {
      list.push_back(M::fromParams(file.rotations[i].coeffs()));
    } else {
      typename M::Params params;
      params << file.rotations[i].coeffs(), file.vectors[i];
      list.push_back(M::fromParams(params));
    }
  }
  return list;
}

template <class M>
FeatureValue describe(const M& x) {
  FeatureValue value;
  if constexpr (is_point<M>) {
    value.point = x;
  } else if constexpr (is_direction<M>) {
    value.direction = x.unit_vector();
  } else {
    const Eigen::Vector4d q = x.params().template head<4>();
    value.quaternion_xyzw = q[3] < 0 ? Eigen::Vector4d(-q) : q;
    value.rotation_vector = liestat::detail::So3Math<double>::log(q);
    if constexpr (!is_rotation<M>) value.translation = x.params().template tail<3>();
  }
  return value;
}

template <class M>
SquareOf<M> covarianceOf(const Covariance& covariance) {
  return covariance;
}

/// The measures with their covariances.
template <class M>
std::vector<Gaussian<M>> gaussians(const std::vector<M>& samples, const FeatureFile& file) {
  std::vector<Gaussian<M>> list;
  list.reserve(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) list.push_back({samples[i], covarianceOf<M>(file.covariances[i])});
  return list;
}

/// A mean with its covariance by the criterion of the measures, as the analysis and the splits need it.
template <class M>
struct Estimate {
  M mean;
  SquareOf<M> covariance;
  bool valid = false;
};

/// The noise of LSQ in the frame of the estimate: directions carry it along, for the others it is there already.
template <class M>
std::vector<SquareOf<M>> noiseAt(const M& mean, const std::vector<M>& samples, const FeatureFile& file,
                                 const std::vector<std::size_t>& rows) {
  std::vector<SquareOf<M>> noise;
  noise.reserve(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    SquareOf<M> V = covarianceOf<M>(file.covariances[rows.empty() ? i : rows[i]]);
    if constexpr (is_direction<M>) V = transport(Gaussian<M>{samples[i], V}, mean).covariance;
    noise.push_back(V);
  }
  return noise;
}

/// The frame of a Hessian withdrawn by kinks, as certifiedMean judges it, for a covariance that it has not seen.
template <Metric M>
bool isIllDefined(const std::vector<M>& samples, const std::vector<double>& weights, const MeanResult<M>& mean,
                  const SquareOf<M>& covariance) {
  const double sd =
      std::sqrt(std::max(0.0, covariance.diagonal().template tail<std::min(3, ManifoldTraits<M>::DoF)>().maxCoeff()));
  const CutLocusMass mass = cutLocusMass(samples, weights, mean, std::max(6 * sd, 0.2));
  return !(mass.hessian_change <= CertifiedMeanOptions<M>{}.largest_hessian_change);
}

inline constexpr const char* too_few_reason =
    "a covariance from residuals needs more measures than the feature has dimensions";
inline constexpr const char* cut_locus_reason =
    "too many features lie near the cut locus of the mean, where the squared distance has a kink: no first-order "
    "covariance is right";

template <class M>
void setStatus(MeanAnalysis& analysis, Status status, const std::string& reason) {
  analysis.status = analysis.covariance_status = status;
  analysis.reason = reason;
}

template <Metric M>
void setUniqueness(MeanAnalysis& analysis, const UniquenessResult<M>& result) {
  analysis.unique = liestat::name(result.unique);
  analysis.proof = result.proof;
  analysis.r_star = result.r_star;
  analysis.cells = result.cells;
  for (const M& rival : result.rivals) analysis.rivals.push_back(describe(rival));
}

template <class M, class Result>
void setIterations(MeanAnalysis& analysis, const Result& result) {
  analysis.converged = result.converged;
  analysis.iterations = result.iterations;
  analysis.residual = result.residual;
  analysis.tolerance = result.tolerance;
}

/// The Riemannian mean of the measures with what can be said about its uniqueness: the passes over the data run on all
/// threads, the certificates start where those ended.
template <Metric M>
CertifiedMean<M> certified(const std::vector<M>& samples, const std::vector<double>& weights,
                           const AnalysisOptions& options, MeanResult<M>& first) {
  first = mean(experiments::ProgramExecutor{options.threads}, samples, weights);
  CertifiedMeanOptions<M> how;
  how.mean.start = first.mean;
  how.uniqueness.branch_and_bound = options.certify;
  how.uniqueness.budget = options.budget;
  return certifiedMean(samples, weights, how);
}

/// LSQ and WLSQ. Returns the mean.
template <Metric M>
M leastSquares(const Measures& measures, const std::vector<M>& samples, const AnalysisOptions& options,
               MeanAnalysis& analysis) {
  MeanResult<M> first;
  const CertifiedMean<M> result = certified(samples, measures.weights, options, first);
  setIterations<M>(analysis, result.uniqueness.improved || !first.converged ? result.mean : first);
  setUniqueness(analysis, result.uniqueness);
  analysis.cut_locus_mass = result.cut_locus.mass;
  setStatus<M>(analysis, result.status, result.reason);
  const M& y = result.mean.mean;
  const bool enough = result.status == Status::ok;
  if (measures.known_noise && (enough || result.status == Status::too_few)) {
    const SquareOf<M> covariance =
        covarianceFromNoise(result.mean, measures.weights, noiseAt(y, samples, measures.file, {}));
    analysis.covariance_from = "noise";
    if (!covariance.allFinite()) {
      setStatus<M>(analysis, Status::ill_defined, "the Hessian of the criterion is not positive definite at the mean");
    } else if (!enough && isIllDefined(samples, measures.weights, result.mean, covariance)) {
      setStatus<M>(analysis, Status::ill_defined, cut_locus_reason);
    } else {
      setStatus<M>(analysis, Status::ok, "");
      analysis.covariance = covariance;
    }
  } else if (enough) {
    analysis.covariance = result.estimate->covariance;
    analysis.covariance_from = "residuals";
  } else if (result.status == Status::too_few) {
    setStatus<M>(analysis, Status::not_applicable, too_few_reason);
  }
  return y;
}

/// The group's barycentre. Its rotation is the Riemannian mean of the rotations, and the translation follows from that:
/// it is unique if that is.
template <LieGroup M>
M barycentre(const Measures& measures, const std::vector<M>& samples, const AnalysisOptions& options,
             MeanAnalysis& analysis) {
  const std::vector<MetricTwin<M>> frames = features<MetricTwin<M>>(measures.file);
  MeanResult<MetricTwin<M>> first;
  const CertifiedMean<MetricTwin<M>> twin = certified(frames, measures.weights, options, first);
  const auto from = [&](const MetricTwin<M>& start) {
    return groupMean(samples, measures.weights, std::optional<M>(start.se3()));
  };
  const GroupMeanResult<M> result = from(twin.mean.mean);
  setIterations<M>(analysis, result);
  UniquenessResult<MetricTwin<M>> uniqueness = twin.uniqueness;
  uniqueness.rivals.clear();
  setUniqueness(analysis, uniqueness);
  for (const MetricTwin<M>& rival : twin.uniqueness.rivals) analysis.rivals.push_back(describe(from(rival).mean));
  analysis.cut_locus_mass = twin.cut_locus.mass;
  setStatus<M>(analysis, twin.status, twin.reason);
  if (!result.converged) {
    setStatus<M>(analysis, Status::not_converged, "the iteration for the mean did not converge");
  } else if (twin.status == Status::too_few) {
    setStatus<M>(analysis, Status::not_applicable, too_few_reason);
  } else if (twin.status == Status::ok) {
    const SquareOf<M> covariance = result.covarianceFromResiduals();
    if (covariance.allFinite()) {
      analysis.covariance = covariance;
      analysis.covariance_from = "residuals";
    } else {
      setStatus<M>(analysis, Status::ill_defined, "the equations of the barycentre are singular");
    }
  }
  return result.mean;
}

/// Squared Mahalanobis distance of a measure from the mean.
template <class M>
double squaredDistance(const Gaussian<M>& measure, const M& mean, CovarianceAt at) {
  const TangentOf<M> z = at == CovarianceAt::measured ? log(measure.mean, mean) : log(mean, measure.mean);
  return mahalanobisSquared<double, ManifoldTraits<M>::DoF>(z, measure.covariance);
}

/// MAHA from several starts: there is no certificate for its minimum. A weighted least-squares mean is the first start,
/// its rivals are others, and it says where the cut locus would spoil a covariance.
template <class M>
M mahalanobis(const Measures& measures, const std::vector<M>& samples, const AnalysisOptions& options,
              MeanAnalysis& analysis) {
  using Twin = MetricTwin<M>;
  const std::vector<Gaussian<M>> data = gaussians(samples, measures.file);
  std::vector<double> weights;
  weights.reserve(data.size());
  for (const Gaussian<M>& g : data) weights.push_back(scalarWeight(g.covariance));

  AnalysisOptions bounded = options;
  bounded.budget = std::min<std::size_t>(options.budget, 100000);
  MeanResult<Twin> first;
  const CertifiedMean<Twin> twin = certified(features<Twin>(measures.file), weights, bounded, first);
  const auto start = [](const Twin& x) {
    if constexpr (is_point<M>) {
      return x;
    } else {
      return M::fromParams(x.params());
    }
  };
  std::vector<M> starts{start(twin.mean.mean)};
  for (const Twin& rival : twin.uniqueness.rivals) starts.push_back(start(rival));
  if constexpr (!is_point<M>) {
    const std::size_t several = samples.size() > 20000 ? 1 : std::min<std::size_t>(6, samples.size());
    for (std::size_t i = 0; i < several; ++i) starts.push_back(samples[i * samples.size() / several]);
  }

  std::vector<MahaResult<M>> results;
  for (const M& x : starts) {
    MahaOptions<M> how;
    how.start = x;
    how.likelihood = measures.likelihood;
    results.push_back(maha(experiments::ProgramExecutor{options.threads}, data, measures.covariance_at, how));
  }
  const auto better = [](const MahaResult<M>& a, const MahaResult<M>& b) {
    if (a.converged != b.converged) return a.converged;
    return a.cost < b.cost;
  };
  // The first of equals is the one from the weighted mean.
  const MahaResult<M>& best = *std::min_element(results.begin(), results.end(), better);
  setIterations<M>(analysis, best);

  constexpr double tie = 1e-9;
  std::vector<M> minima{best.mean};
  for (const MahaResult<M>& other : results) {
    if (other.status != Status::ok || !(other.cost <= best.cost + tie * (1 + std::abs(best.cost)))) continue;
    const bool known =
        std::any_of(minima.begin(), minima.end(), [&](const M& m) { return log(m, other.mean).norm() < 1e-4; });
    if (!known) minima.push_back(other.mean);
  }
  for (std::size_t i = 1; i < minima.size(); ++i) analysis.rivals.push_back(describe(minima[i]));
  if constexpr (is_point<M>) {
    analysis.unique = "unique";
    analysis.proof = "the manifold is flat";
    analysis.r_star = std::numeric_limits<double>::infinity();
  } else {
    analysis.unique = minima.size() > 1 ? "ambiguous" : "not_certified";
    analysis.proof = minima.size() > 1 ? "several minima of equal cost"
                                       : "the best minimum from several starts; there is no certificate for maha";
  }

  setStatus<M>(analysis, best.status, "");
  analysis.cut_locus_mass = twin.cut_locus.mass;
  if (best.status == Status::not_converged) {
    setStatus<M>(analysis, best.status, "the iteration for the mean did not converge");
  } else if (best.status == Status::ill_defined) {
    setStatus<M>(analysis, best.status, "the Hessian of the criterion is not positive definite at the mean");
  } else if (best.status != Status::ok) {
    setStatus<M>(analysis, best.status, "this criterion has no answer for these measures");
  } else if (minima.size() > 1) {
    setStatus<M>(analysis, Status::ambiguous, "another feature explains the data as well");
  } else if (twin.status == Status::ill_defined) {
    setStatus<M>(analysis, Status::ill_defined, cut_locus_reason);
  } else {
    analysis.covariance = best.covariance;
    analysis.covariance_from = "noise";
  }
  double fit = 0;
  for (const Gaussian<M>& g : data) fit += squaredDistance(g, best.mean, measures.covariance_at);
  analysis.fit = fit;
  analysis.fit_dof = ManifoldTraits<M>::DoF * (static_cast<double>(data.size()) - 1);
  return best.mean;
}

/// Dispersion of the measures about a feature and the farthest of them.
template <class M>
void setDispersion(const Measures& measures, const std::vector<M>& samples, const M& y, MeanAnalysis& analysis) {
  const std::vector<TangentPart> parts = tangentParts(measures.feature);
  SquareOf<M> sum = SquareOf<M>::Zero();
  double weight = 0;
  analysis.largest.assign(parts.size(), {});
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const TangentOf<M> z = log(y, samples[i]);
    sum += measures.weights[i] * z * z.transpose();
    weight += measures.weights[i];
    for (std::size_t p = 0; p < parts.size(); ++p) {
      const double size = z.segment(parts[p].begin, parts[p].size).norm();
      if (size > analysis.largest[p].value || i == 0) analysis.largest[p] = {size, measures.file.lines[i]};
    }
  }
  analysis.dispersion = sum / weight;
}

/// Everything in both charts. Covariances move with the charts' derivatives.
template <Metric M>
ChartScatter chartScatter(const std::vector<M>& samples, const std::vector<double>& weights, const M& y,
                          const MeanAnalysis& analysis) {
  using T = ManifoldTraits<M>;
  constexpr int k = T::DoF;
  const auto n = static_cast<Eigen::Index>(samples.size());
  ChartScatter s;
  s.principal.resize(k, n);
  s.centred.resize(k, n);
  TangentOf<M> sum = TangentOf<M>::Zero();
  double weight = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto row = static_cast<std::size_t>(i);
    const TangentOf<M> r = T::logOrigin(samples[row]);
    s.principal.col(i) = r;
    s.centred.col(i) = log(y, samples[row]);
    sum += weights[row] * r;
    weight += weights[row];
  }
  s.mean = T::logOrigin(y);
  const SquareOf<M> J = principalChartJacobian(y);
  s.dispersion = J * analysis.dispersion * J.transpose();
  if (analysis.covariance.size() > 0) s.mean_covariance = J * analysis.covariance * J.transpose();

  const TangentOf<M> b = sum / weight;
  s.barycentre = b;
  const M at_b = T::expOrigin(b);
  s.barycentre_centred = log(y, at_b);
  if (n > k) {
    SquareOf<M> scatter = SquareOf<M>::Zero();
    for (Eigen::Index i = 0; i < n; ++i) {
      const TangentOf<M> d = s.principal.col(i) - b;
      scatter += weights[static_cast<std::size_t>(i)] * d * d.transpose();
    }
    scatter /= weight * static_cast<double>(n - 1);
    const SquareOf<M> C = errorVector(y, at_b).by_feature * T::dexpOrigin(b);
    s.barycentre_covariance = scatter;
    s.barycentre_covariance_centred = C * scatter * C.transpose();
  }
  return s;
}

template <class M>
MeanAnalysis analyse(const Measures& measures, const AnalysisOptions& options) {
  const std::vector<M> samples = features<M>(measures.file);
  MeanAnalysis analysis;
  M y;
  if (measures.criterion == Criterion::maha) {
    y = mahalanobis(measures, samples, options, analysis);
  } else {
    if constexpr (is_se3<M>) {
      y = barycentre(measures, samples, options, analysis);
    } else {
      y = leastSquares(measures, samples, options, analysis);
    }
  }
  analysis.mean = describe(y);
  setDispersion(measures, samples, y, analysis);
  if constexpr (is_direction<M>) {
    analysis.tangent_basis = ManifoldTraits<M>::placement(y).matrix().template leftCols<2>();
  }
  if (options.charts) {
    if constexpr (is_se3<M>) {
      // To first order both have the same frame at the mean.
      analysis.charts = chartScatter(features<Frame3d>(measures.file), measures.weights, Frame3d(y), analysis);
    } else {
      analysis.charts = chartScatter(samples, measures.weights, y, analysis);
    }
  }
  return analysis;
}

}  // namespace liestat::cli::detail
