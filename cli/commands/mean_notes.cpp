// Apart from the estimators, which cost a compiler enough without the laws of Boost.
#include <cli/commands/mean_analysis.hpp>
#include <cli/commands/split.hpp>

#include <stats/mean_notes.hpp>
#include <stats/time_blocks.hpp>

namespace liestat::cli {

MeanAnalysis analyseMean(const Measurements& measurements, const AnalysisOptions& options) {
  MeanAnalysis analysis = estimateMean(measurements, options);
  analysis.notes = measurements.notes;
  addMeanNotes(analysis, measurements.size());
  return analysis;
}

void compareBlocks(MeanAnalysis& analysis, const Measurements& measurements, const AnalysisOptions& options) {
  if (measurements.file.times.empty() || !analysis.hasCovariance()) return;
  const auto by_blocks = [&](const SplitOptions& split) {
    return splitMeasurements(measurements, {split, options.threads}).by_blocks;
  };
  setTimeBlocks(analysis,
                compareTimeBlocks(measurements.size(), degreesOfFreedom(measurements.feature), measurements.known_noise,
                                  by_blocks),
                options.inflate);
}

}  // namespace liestat::cli
