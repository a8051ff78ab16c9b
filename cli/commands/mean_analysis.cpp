#include <cli/commands/mean_analysis.hpp>

#include <cli/commands/mean_input.hpp>
#include <experiments/parallel.hpp>
#include <stats/summarized_mean.hpp>

#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat::cli {
namespace {

/// The type whose charts show a feature: a rigid motion's are those of its frame, which to first order has the same axes.
template <class M>
using ChartOf = std::conditional_t<Metric<M>, M, Frame3d>;

/// The measurements in the charts of the report, with rivals and near ties.
template <class M>
void setCharts(const Measurements& measurements, MeanAnalysis& analysis) {
  const M y = featureOf<M>(analysis.mean);
  std::optional<SquareOf<M>> covariance;
  if (analysis.hasCovariance()) covariance = analysis.covariance;
  analysis.charts = chartScatter(featuresOf<M>(measurements.file), measurements.weights, y,
                                 SquareOf<M>(analysis.dispersion), covariance);
  std::vector<M> rivals;
  for (const FeatureValue& rival : analysis.rivals) rivals.push_back(featureOf<M>(rival));
  for (const NearRival& tie : analysis.near_ties) rivals.push_back(featureOf<M>(tie.feature));
  if (rivals.empty()) return;
  ChartScatter charts = chartScatter(rivals, std::vector<double>(rivals.size(), 1.0), y);
  analysis.rivals_principal = std::move(charts.principal);
  analysis.rivals_centred = std::move(charts.centred);
}

template <class M>
MeanAnalysis analyse(const Measurements& measurements, const AnalysisOptions& options) {
  const std::vector<M> features = featuresOf<M>(measurements.file);
  MeanSummaryOptions how;
  how.uniqueness.progress = options.progress;
  how.uniqueness.stop = options.stop;
  how.uniqueness.branch_and_bound = options.certify;
  how.uniqueness.budget = options.budget;
  MeanInput<M> input = meanInput(measurements, features);
  input.refuted_noise = options.refuted_noise;
  input.scale_noise = options.birge;
  input.weights_are = options.weights_are;
  input.region = options.region;
  input.times = measurements.file.times;
  input.inflate = options.inflate;
  MeanAnalysis analysis{summarizedMean(experiments::ProgramExecutor{options.threads}, input, how)};
  analysis.feature = name(measurements.feature);
  for (FarthestMeasurement& f : analysis.farthest) f.line = measurements.file.lines[f.index];
  if (options.charts) setCharts<ChartOf<M>>(measurements, analysis);
  return analysis;
}

}  // namespace

MeanAnalysis estimateMean(const Measurements& measurements, const AnalysisOptions& options) {
  return withFeature(measurements.feature, [&]<class M>() { return analyse<M>(measurements, options); });
}

}  // namespace liestat::cli
