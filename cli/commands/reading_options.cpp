#include <cli/commands/reading_options.hpp>

#include <stats/conventions.hpp>

#include <utility>
#include <vector>

namespace liestat::cli {

void declareReading(const Command& command, ReadingOptions& reading) {
  command
      .option(
          "--columns", reading.columns,
          "Names of CSV columns that are not ours: tx=px,r00=R00 (ours=the file's); without a header their numbers: "
          "t=1,tx=2")
      .list();
  command.flag("--ignore-unknown", reading.ignore_unknown,
               "Pass over CSV columns, and lines of graphs, without a meaning");
  command
      .option("--norm-tolerance", reading.norm_tolerance,
              "Quaternions, directions and matrices that are off by less are normalised (default 0.001)")
      .range(0.0, 0.5);
  command.option("--largest-file", reading.largest_file, "Largest text that is read, expanded, GB (default 1)")
      .positive();
  command.option("--frames", reading.frames,
                 "Of bags without a topic: map:base_link, the pose of base_link in map by /tf and /tf_static");
}

void declareReading(const Command& command, TrajectoryOptions& reading, std::optional<DuplicateRule>& duplicates) {
  declareReading(command, reading.reading);
  using Layouts = std::vector<std::pair<std::string, CovarianceLayout>>;
  command.choice("--cov-layout", reading.layout,
                 Layouts{{"full36", CovarianceLayout::full36},
                         {"upper21", CovarianceLayout::upper21},
                         {"lower21", CovarianceLayout::lower21},
                         {"blocks12", CovarianceLayout::blocks12},
                         {"diag6", CovarianceLayout::diag6}},
                 "Layout of the numbers after TUM's eight");
  command
      .option("--unmeasured-above", reading.unmeasured,
              "Variances in messages from which on a component is not measured (default 90000)")
      .positive();
  command.choice("--time-unit", reading.time_unit,
                 "Unit of stamps that are no seconds (default s; stamps since 1970 are recognised)");
  command.choice("--duplicates", duplicates,
                 "Rows of one stamp with different poses: the first of them, or their mean");
}

}  // namespace liestat::cli
