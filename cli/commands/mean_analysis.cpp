#include <cli/commands/mean_analysis.hpp>

#include <experiments/feature.hpp>
#include <experiments/parallel.hpp>
#include <stats/certified_group_mean.hpp>
#include <stats/certified_maha.hpp>
#include <stats/certified_mean.hpp>
#include <stats/dispersion.hpp>

#include <algorithm>
#include <cmath>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat::cli {
namespace {

using experiments::ProgramExecutor;

/// A feature that is a group without an invariant metric.
template <class M>
inline constexpr bool is_group = !Metric<M>;

UniquenessOptions uniquenessOptions(const AnalysisOptions& options) {
  UniquenessOptions how;
  how.progress = options.progress;
  how.stop = options.stop;
  how.branch_and_bound = options.certify;
  how.budget = options.budget;
  return how;
}

/// Rivals and near ties in the charts of the report; a rigid motion's are those of its frame.
template <class M, class Certified>
void setRivalCharts(MeanAnalysis& analysis, const M& y, const Certified& result) {
  using Chart = std::conditional_t<is_group<M>, Frame3d, M>;
  std::vector<Chart> rivals;
  for (const M& rival : result.uniqueness.rivals) rivals.emplace_back(rival);
  for (const auto& tie : result.near_ties) rivals.emplace_back(tie.feature);
  if (rivals.empty()) return;
  ChartScatter charts = chartScatter(rivals, std::vector<double>(rivals.size(), 1.0), Chart(y));
  analysis.rivals_principal = std::move(charts.principal);
  analysis.rivals_centred = std::move(charts.centred);
}

/// Copies what every certified estimate says: its iteration, uniqueness, status and covariance, which comes from the
/// residuals or from noise. Returns the mean.
template <class M, class Iteration, class Certified>
M setEstimate(MeanAnalysis& analysis, const Iteration& iteration, const Certified& result, const char* from) {
  analysis.n = iteration.n;
  analysis.converged = converged(iteration.status);
  analysis.iterations = iteration.iterations;
  analysis.residual = iteration.residual;
  analysis.tolerance = iteration.tolerance;
  analysis.unique = result.uniqueness.unique;
  analysis.proof = result.uniqueness.proof;
  analysis.r_star = result.uniqueness.r_star;
  analysis.cells = result.uniqueness.cells;
  for (const M& rival : result.uniqueness.rivals) analysis.rivals.push_back(describe(rival));
  analysis.more_rivals = result.uniqueness.more_rivals;
  setRivalCharts(analysis, iteration.mean, result);
  for (const auto& tie : result.near_ties) analysis.near_ties.push_back({describe(tie.feature), tie.z});
  analysis.cut_locus_mass = result.cut_locus.mass;
  analysis.hessian_change = result.hessian_change;
  analysis.status = analysis.covariance_status = result.status;
  analysis.reason = result.reason;
  if (result.status == Status::too_few) {
    // There is a mean, and that is the answer.
    analysis.status = analysis.covariance_status = Status::not_applicable;
    analysis.reason = "a covariance from residuals needs more measurements than the feature has dimensions";
  }
  if (result.estimate) {
    analysis.covariance = result.estimate->covariance;
    analysis.covariance_from = from;
  }
  return iteration.mean;
}

/// LSQ, WLSQ, and the barycentre of a group.
template <class M>
M leastSquares(const Measurements& measurements, const std::vector<M>& samples, const AnalysisOptions& options,
               MeanAnalysis& analysis) {
  const ProgramExecutor executor{options.threads};
  if constexpr (is_group<M>) {
    CertifiedGroupMeanOptions how;
    how.uniqueness = uniquenessOptions(options);
    const auto result = certifiedGroupMean(executor, samples, measurements.weights, how);
    return setEstimate<M>(analysis, result.mean, result, "residuals");
  } else {
    CertifiedMeanOptions<M> how;
    how.uniqueness = uniquenessOptions(options);
    if (measurements.known_noise) how.known_noise = covariancesOf<M>(measurements.file);
    const auto result = certifiedMean(executor, samples, measurements.weights, how);
    return setEstimate<M>(analysis, result.mean, result, measurements.known_noise ? "noise" : "residuals");
  }
}

template <class M>
M mahalanobisMean(const Measurements& measurements, const AnalysisOptions& options, MeanAnalysis& analysis) {
  CertifiedMahaOptions<M> how;
  how.maha.likelihood = measurements.likelihood;
  const std::size_t most = how.uniqueness.budget;
  how.uniqueness = uniquenessOptions(options);
  how.uniqueness.budget = std::min(options.budget, most);
  const CertifiedMaha<M> result = certifiedMaha(ProgramExecutor{options.threads}, gaussiansOf<M>(measurements.file),
                                                measurements.covariance_at, how);
  analysis.fit = result.fit;
  analysis.fit_dof = result.fit_dof;
  return setEstimate<M>(analysis, result.maha, result, "noise");
}

/// Dispersion of the measurements about the mean and the farthest of them.
template <class M>
void setDispersion(const Measurements& measurements, const std::vector<M>& samples, const M& y,
                   MeanAnalysis& analysis) {
  const Dispersion<M> dispersion = dispersionAbout(samples, measurements.weights, y);
  analysis.dispersion = dispersion.covariance;
  for (const FarthestFeature& f : dispersion.farthest) {
    analysis.largest.push_back({f.distance, measurements.file.lines[f.index]});
  }
}

/// The measurements in both charts; a rigid motion's are those of its frame, which to first order has the same axes.
template <class M>
ChartScatter chartsOf(const Measurements& measurements, const std::vector<M>& samples, const M& y,
                      const MeanAnalysis& analysis) {
  if constexpr (is_group<M>) {
    return chartsOf<Frame3d>(measurements, featuresOf<Frame3d>(measurements.file), Frame3d(y), analysis);
  } else {
    std::optional<SquareOf<M>> covariance;
    if (analysis.covariance.size() > 0) covariance = analysis.covariance;
    return chartScatter(samples, measurements.weights, y, SquareOf<M>(analysis.dispersion), covariance);
  }
}

template <class M>
MeanAnalysis analyse(const Measurements& measurements, const AnalysisOptions& options) {
  const std::vector<M> samples = featuresOf<M>(measurements.file);
  MeanAnalysis analysis;
  const M y = measurements.criterion == Criterion::maha ? mahalanobisMean<M>(measurements, options, analysis)
                                                        : leastSquares(measurements, samples, options, analysis);
  analysis.mean = describe(y);
  setDispersion(measurements, samples, y, analysis);
  if constexpr (std::is_same_v<M, S2d>) {
    analysis.tangent_basis = ManifoldTraits<M>::placement(y).matrix().template leftCols<2>();
  }
  if (options.charts) analysis.charts = chartsOf(measurements, samples, y, analysis);
  return analysis;
}

}  // namespace

MeanAnalysis analyseMean(const Measurements& measurements, const AnalysisOptions& options) {
  MeanAnalysis analysis =
      experiments::withFeature(measurements.feature, [&]<class M>() { return analyse<M>(measurements, options); });
  explain(analysis, measurements.size());
  return analysis;
}

}  // namespace liestat::cli
