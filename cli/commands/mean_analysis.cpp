#include <cli/commands/mean_analysis.hpp>

#include <cli/commands/mean_input.hpp>
#include <experiments/parallel.hpp>
#include <lie/crystal_orientation.hpp>
#include <stats/summarized_mean.hpp>

#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat::cli {
namespace {

/// The type whose charts show a feature: a rigid motion's are those of its frame, which to first order has the same
/// axes.
template <class M>
using ChartOf = std::conditional_t<Metric<M>, M, Frame3d>;

/// The measurements in the charts of the report, with rivals and near ties.
template <class M>
void setCharts(const Measurements& measurements, const std::vector<M>& features, MeanAnalysis& analysis) {
  const M y = featureOf<M>(analysis.mean);
  std::optional<SquareOf<M>> covariance;
  if (analysis.hasCovariance()) covariance = analysis.covariance;
  analysis.charts = chartScatter(features, measurements.weights, y, SquareOf<M>(analysis.dispersion), covariance);
  std::vector<M> rivals;
  for (const FeatureValue& rival : analysis.rivals) rivals.push_back(featureOf<M>(rival));
  for (const NearRival& tie : analysis.near_ties) rivals.push_back(featureOf<M>(tie.feature));
  if (rivals.empty()) return;
  ChartScatter charts = chartScatter(rivals, std::vector<double>(rivals.size(), 1.0), y);
  analysis.rivals_principal = std::move(charts.principal);
  analysis.rivals_centred = std::move(charts.centred);
}

template <class M>
MeanAnalysis analyse(const Measurements& measurements, const AnalysisOptions& options, const std::vector<M>& features) {
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
  for (NamedOutlier& x : analysis.outliers) x.line = measurements.file.lines[x.index];
  return analysis;
}

/// Rotations as orientations of crystals. Charts show the copies that are nearest to the mean.
MeanAnalysis analyseCrystals(const Measurements& measurements, const AnalysisOptions& options) {
  std::vector<CrystalOrientation> features;
  for (const SO3d& rotation : featuresOf<SO3d>(measurements.file)) features.emplace_back(rotation, *options.symmetry);
  MeanAnalysis analysis = analyse(measurements, options, features);
  analysis.feature = "crystal_orientation";
  if (options.charts) {
    std::vector<SO3d> copies;
    for (const CrystalOrientation& x : features) copies.push_back(x.nearestTo(featureOf<SO3d>(analysis.mean)));
    setCharts(measurements, copies, analysis);
  }
  return analysis;
}

}  // namespace

MeanAnalysis estimateMean(const Measurements& measurements, const AnalysisOptions& options) {
  if (options.symmetry) return analyseCrystals(measurements, options);
  return withFeature(measurements.feature, [&]<class M>() {
    MeanAnalysis analysis = analyse(measurements, options, featuresOf<M>(measurements.file));
    if (options.charts) {
      using Shown = ChartOf<M>;
      setCharts(measurements, featuresOf<Shown>(measurements.file), analysis);
    }
    return analysis;
  });
}

}  // namespace liestat::cli
