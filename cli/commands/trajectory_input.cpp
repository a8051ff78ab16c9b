#include <cli/commands/trajectory_input.hpp>

#include <formats/input_error.hpp>
#include <formats/text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace liestat::cli {

void TrajectoryInputOptions::declare(const Command& command) {
  command.option("--format", estimate.format, "Format of the estimates (default auto)").oneOf(trajectoryFormatNames());
  command.option("--ref-format", reference.format, "Format of the reference (default auto)")
      .oneOf(trajectoryFormatNames());
  command.option("--cov-file", estimate.covariance_file,
                 "Side file with the covariances of the estimate (default: its name with .cov after it)");
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
  declareReading(command, estimate, duplicates);
  command.option("--ref-columns", reference.reading.columns, "The same as --columns for the reference").list();
  command.choice("--ref-time-unit", reference.time_unit, "The same as --time-unit for the reference");
}

void TrajectoryInputOptions::settle() {
  std::vector<std::string> columns = std::move(reference.reading.columns);
  reference.reading = estimate.reading, reference.reading.columns = std::move(columns);
  reference.unmeasured = estimate.unmeasured;
  for (const double value : {association.offset, association.start.value_or(0), association.end.value_or(0)}) {
    if (!std::isfinite(value)) throw OptionError("liestat", "a time that is not finite", "seconds");
  }
}

Trajectory readTimedTrajectory(const std::string& path, const TrajectoryOptions& options,
                               std::optional<DuplicateRule> duplicates) {
  return readTimedTrajectory(path, loadTrajectoryText(path, options.reading.largest_file), options, duplicates);
}

Trajectory readTimedTrajectory(const std::string& path, const TextFile& file, const TrajectoryOptions& options,
                               std::optional<DuplicateRule> duplicates) {
  Trajectory t = readTrajectory(path, file, options);
  orderInTime(t, duplicates);
  t.notes = notesOf(t, options);
  return t;
}

void requireSameVertices(const Trajectory& reference, const Trajectory& estimate) {
  if (reference.ids.empty() || estimate.ids.empty() || reference.ids == estimate.ids) return;
  const auto [a, b] =
      std::mismatch(reference.ids.begin(), reference.ids.end(), estimate.ids.begin(), estimate.ids.end());
  const bool lacks = b == estimate.ids.end() || (a != reference.ids.end() && *a < *b);
  throw InputError(lacks ? estimate.name : reference.name, 0, fmt::format("there is no vertex {}", lacks ? *a : *b),
                   "the same vertices in both graphs");
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
