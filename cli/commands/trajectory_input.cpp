#include <cli/commands/trajectory_input.hpp>

#include <formats/input_error.hpp>
#include <formats/text.hpp>
#include <stats/convention_presets.hpp>

#include <fmt/format.h>

#include <cmath>
#include <utility>

namespace liestat::cli {

void TrajectoryInputOptions::declare(const Command& command) {
  command.option("--format", estimate.format, "Format of the estimates (default auto)").oneOf(trajectoryFormatNames());
  command.option("--ref-format", reference.format, "Format of the reference (default auto)")
      .oneOf(trajectoryFormatNames());
  command.option("--cov-file", estimate.covariance_file,
                 "Side file with the covariances of the estimate (default: its name with .cov after it)");
  command.option("--cov-layout", layout, "Layout of the numbers after TUM's eight: full36, upper21, lower21 …");
  command.choice(
      "--association", association.rule,
      "interpolate: the reference at the times of the estimate (default); nearest: the nearest stamps, as evo");
  command.choice("--interpolation", association.interpolation,
                 "Curve between two poses of the reference (default cubic)");
  command
      .option("--max-gap", association.max_gap,
              "Largest distance of two stamps to interpolate between, s (default: five times the median distance)")
      .notNegative();
  command
      .option("--t_max_diff,--t-max-diff", association.max_difference,
              "Largest difference of nearest stamps, s (default 0.01)")
      .notNegative();
  command.option("--t_offset,--t-offset", association.offset, "Offset that is added to the estimate's times, s");
  command.option("--t_start,--t-start", association.start, "Poses of the reference from this time on");
  command.option("--t_end,--t-end", association.end, "Poses of the reference up to this time");
  command
      .option("--norm-tolerance", estimate.reading.norm_tolerance,
              "Quaternions that are off by less are normalised (default 0.001)")
      .range(0.0, 0.5);
}

void TrajectoryInputOptions::settle() {
  reference.reading = estimate.reading;
  if (!layout.empty()) {
    Convention c;
    if (!setConventionField(c, "layout", layout)) {
      throw OptionError("--cov-layout", "'" + printable(layout) + "'", "full36, upper21, lower21, blocks12 or diag6");
    }
    estimate.layout = c.layout;
  }
  for (const double value : {association.offset, association.start.value_or(0), association.end.value_or(0)}) {
    if (!std::isfinite(value)) throw OptionError("liestat", "a time that is not finite", "seconds");
  }
}

Trajectory readTimedTrajectory(const std::string& path, const TrajectoryOptions& options) {
  Trajectory t = readTrajectory(path, options);
  for (std::size_t i = 1; i < t.times.size(); ++i) {
    if (t.times[i] > t.times[i - 1]) continue;
    const bool same = t.times[i] == t.times[i - 1];
    throw InputError(
        t.name, t.lines[i],
        same ? fmt::format("the time {} stands in line {} too", t.time_texts[i], t.lines[i - 1])
             : fmt::format("the time {} is before {} of line {}", t.time_texts[i], t.time_texts[i - 1], t.lines[i - 1]),
        "times that ascend, each once");
  }
  return t;
}

void refuse(EvaluationStatus status, const std::string& reason, const Trajectory& reference, const Trajectory& estimate,
            const TrajectoryInputOptions& options) {
  const AssociationOptions& times = options.association;
  switch (status) {
    case EvaluationStatus::times_missing:
      if (!reference.hasTimes() && (times.start || times.end)) {
        throw InputError(reference.name, 0, "the file has no times", "times, for --t_start, --t_end");
      }
      throw InputError(reference.hasTimes() ? estimate.name : reference.name, 0, "the file has no times",
                       "times in both files, or in none");
    case EvaluationStatus::unequal_rows:
      throw InputError(estimate.name, 0, reason, "as many in both, since row belongs to row");
    case EvaluationStatus::empty_interval:
      throw InputError(reference.name, 0, "no pose between --t_start and --t_end",
                       fmt::format("times from {} to {} s", reference.time_texts.front(), reference.time_texts.back()));
    case EvaluationStatus::no_overlap:
      throw InputError(estimate.name, 0, reason, "times of one clock, or --t_offset");
    case EvaluationStatus::no_match:
      throw InputError(estimate.name, 0, reason,
                       times.rule == AssociationRule::nearest ? "a larger --t_max_diff, or --association interpolate"
                                                              : "a larger --max-gap");
    case EvaluationStatus::too_few:
      throw InputError(estimate.name, 0, reason, "at least two");
    case EvaluationStatus::not_aligned:
      throw InputError(estimate.name, 0, reason, "another --alignment");
    default:
      throw InputError(estimate.name, 0, reason, "another file or other options");
  }
}

}  // namespace liestat::cli
