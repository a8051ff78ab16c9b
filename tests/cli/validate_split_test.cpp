// `liestat validate split` after an interrupt.

#include <cli/commands/measurement_options.hpp>
#include <cli/commands/split.hpp>
#include <cli/show/split.hpp>
#include <support/temporary_directory.hpp>
#include <experiments/interruption.hpp>
#include <stats/random.hpp>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <string>
#include <vector>

namespace liestat::cli {
namespace {

/// Points with covariances, in the order of time.
std::string pointsFile(std::size_t n) {
  CounterRng rng(5);
  std::string text = "x,y,z,cov_00,cov_01,cov_02,cov_11,cov_12,cov_22\n";
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3d x = rng.normalVector<3>();
    text += fmt::format("{},{},{},1,0,0,1,0,1\n", x[0], x[1], x[2]);
  }
  return text;
}

struct StoppedSplits {
  Measurements measurements;
  SplitSettings settings;

  StoppedSplits() {
    const TemporaryDirectory directory;
    MeasurementInput input;
    input.file = directory.write("f.csv", pointsFile(60));
    measurements = input.read("test");
    settings.threads = 1;
    settings.split.splits = 20;
  }
  ~StoppedSplits() { start(0); }
  SplitSummary run(std::size_t splits) {
    settings.split.splits = splits;
    start(splits);
    return splitMeasurements(measurements, settings);
  }
  /// An interrupt comes after so many splits of both kinds.
  SplitSummary stoppedAfter(std::size_t count) {
    settings.split.splits = 20;
    start(20);
    std::size_t done = 0;
    return splitMeasurements(measurements, settings, [&] { experiments::trials_of_run.stop = ++done >= count; });
  }
  void start(std::size_t splits) const {
    experiments::TrialsOfRun& run = experiments::trials_of_run;
    run.stop = false, run.done = 0, run.planned = 2 * splits;
  }
  /// The lines on the terminal, as they are now.
  static std::string textOf(const SplitSummary& result) {
    const FileSplit split{result, "f.csv", "", {}};
    return formatSplit(split);
  }
};

std::vector<double> firstOf(const std::vector<double>& list, std::size_t n) {
  return {list.begin(), list.begin() + static_cast<std::ptrdiff_t>(n)};
}

TEST(ValidateSplit, anInterruptLeavesTheFirstSplitsWithTheirDegreesOfFreedom) {
  StoppedSplits splits;
  const SplitSummary whole = splits.run(20), seven = splits.run(7);
  const SplitSummary early = splits.stoppedAfter(7);
  EXPECT_EQ(experiments::trials_of_run.done, 7U);
  EXPECT_EQ(early.random.distances, firstOf(whole.random.distances, 7));
  EXPECT_EQ(early.random.effective_dof, seven.random.effective_dof);
  EXPECT_NE(early.random.effective_dof, whole.random.effective_dof);
  EXPECT_TRUE(early.by_blocks.distances.empty());
  EXPECT_EQ(early.merged.mean.point, whole.merged.mean.point);
  const std::string text = splits.textOf(early);
  EXPECT_NE(text.find("halves of 10 blocks    none was done\n"), std::string::npos) << text;
  EXPECT_NE(text.find("\nINTERRUPTED: 7 of 40 splits were done, none of them by blocks of time,"), std::string::npos)
      << text;

  const SplitSummary late = splits.stoppedAfter(27);
  EXPECT_EQ(late.random.distances, whole.random.distances);
  EXPECT_EQ(late.random.effective_dof, whole.random.effective_dof);
  EXPECT_EQ(late.by_blocks.distances, firstOf(whole.by_blocks.distances, 7));
  EXPECT_EQ(late.by_blocks.effective_dof, seven.by_blocks.effective_dof);
  EXPECT_NE(splits.textOf(late).find("\nINTERRUPTED: 27 of 40 splits were done. Halves"), std::string::npos);

  // One that comes after the last split interrupts nothing.
  const SplitSummary ended = splits.stoppedAfter(40);
  EXPECT_EQ(ended.by_blocks.distances, whole.by_blocks.distances);
  EXPECT_NE(splits.textOf(ended).find("\nPASSED: "), std::string::npos);
}

}  // namespace
}  // namespace liestat::cli
