#include <cli/commands/trajectory_input.hpp>

#include <cli/io/input_error.hpp>
#include <cli/io/text.hpp>
#include <stats/convention_presets.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace liestat::cli {

void TrajectoryInputOptions::declare(const Command& command) {
  command.option("--format", estimate.format, "Format of the estimates (default auto)").oneOf(trajectoryFormatNames());
  command.option("--ref-format", reference.format, "Format of the reference (default auto)")
      .oneOf(trajectoryFormatNames());
  command.option("--cov-file", estimate.covariance_file,
                 "Side file with the covariances of the estimate (default: its name with .cov after it)");
  command.option("--cov-layout", layout, "Layout of the numbers after TUM's eight: full36, upper21, lower21 …");
  command
      .option("--association", association,
              "interpolate: the reference at the times of the estimate (default); nearest: the nearest stamps, as evo")
      .oneOf({"interpolate", "nearest"});
  command.option("--interpolation", interpolation, "Curve between two poses of the reference (default geodesic)")
      .oneOf({"geodesic", "slerp"});
  command
      .option("--max-gap", max_gap,
              "Largest distance of two stamps to interpolate between, s (default: five times the median distance)")
      .notNegative();
  command.option("--t_max_diff,--t-max-diff", max_difference, "Largest difference of nearest stamps, s (default 0.01)")
      .notNegative();
  command.option("--t_offset,--t-offset", offset, "Offset that is added to the estimate's times, s");
  command.option("--t_start,--t-start", start, "Poses of the reference from this time on");
  command.option("--t_end,--t-end", end, "Poses of the reference up to this time");
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
      throw InputError("--cov-layout", 0, "'" + printable(layout) + "'", "full36, upper21, lower21, blocks12 or diag6");
    }
    estimate.layout = c.layout;
  }
  for (const double value : {offset, start.value_or(0), end.value_or(0)}) {
    if (!std::isfinite(value)) throw InputError("liestat", 0, "a time that is not finite", "seconds");
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

void cutTimes(Trajectory& reference, const TrajectoryInputOptions& options) {
  if (!options.start && !options.end) return;
  if (!reference.hasTimes())
    throw InputError(reference.name, 0, "the file has no times", "times, for --t_start, --t_end");
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < reference.size(); ++i) {
    if (options.start && reference.times[i] < *options.start) continue;
    if (options.end && reference.times[i] > *options.end) continue;
    rows.push_back(i);
  }
  if (rows.empty()) {
    throw InputError(reference.name, 0, "no pose between --t_start and --t_end",
                     fmt::format("times from {} to {} s", reference.time_texts.front(), reference.time_texts.back()));
  }
  reference = rowsOf(reference, rows);
}

Trajectory rowsOf(const Trajectory& t, const std::vector<std::size_t>& rows) {
  Trajectory cut = t;
  cut.time_texts.clear(), cut.times.clear(), cut.poses.clear(), cut.covariances.clear(), cut.lines.clear();
  for (const std::size_t i : rows) {
    if (t.hasTimes()) cut.time_texts.push_back(t.time_texts[i]), cut.times.push_back(t.times[i]);
    cut.poses.push_back(t.poses[i]);
    if (t.hasCovariances()) cut.covariances.push_back(t.covariances[i]);
    cut.lines.push_back(t.lines[i]);
  }
  return cut;
}

namespace {

double medianStep(const std::vector<double>& times) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < times.size(); ++i) steps.push_back(times[i] - times[i - 1]);
  if (steps.empty()) return 0;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

std::string spanOf(const Trajectory& t) { return fmt::format("{:.10g} to {:.10g} s", t.times.front(), t.times.back()); }

}  // namespace

Associated associate(const Trajectory& reference, const Trajectory& estimate, const TrajectoryInputOptions& options) {
  Associated a;
  if (reference.hasTimes() != estimate.hasTimes()) {
    throw InputError(reference.hasTimes() ? estimate.name : reference.name, 0, "the file has no times",
                     "times in both files, or in none");
  }
  a.by_time = reference.hasTimes();
  if (!a.by_time) {
    if (reference.size() != estimate.size()) {
      throw InputError(
          estimate.name, 0,
          fmt::format("{} poses without times, and {} in {}", estimate.size(), reference.size(), reference.name),
          "as many in both, since row belongs to row");
    }
    for (std::size_t i = 0; i < estimate.size(); ++i) a.matches.push_back({i, i, 0, 0});
    return a;
  }
  if (options.association == "nearest") {
    a.max_gap = options.max_difference;
    a.matches = associateNearest(reference.times, estimate.times, options.max_difference, options.offset);
  } else {
    a.max_gap = options.max_gap.value_or(5 * medianStep(reference.times));
    a.matches = associateByInterpolation(reference.times, estimate.times, a.max_gap, options.offset);
  }
  if (!a.matches.empty()) return a;
  const bool overlap = reference.times.front() <= estimate.times.back() + options.offset &&
                       estimate.times.front() + options.offset <= reference.times.back();
  if (!overlap) {
    throw InputError(estimate.name, 0,
                     fmt::format("its times, {}, do not overlap those of {}, {}", spanOf(estimate), reference.name,
                                 spanOf(reference)),
                     "times of one clock, or --t_offset");
  }
  throw InputError(
      estimate.name, 0,
      options.association == "nearest"
          ? fmt::format("no stamp is within {:g} s of one of {}", options.max_difference, reference.name)
          : fmt::format("no stamp lies between two of {} that are {:g} s apart at most", reference.name, a.max_gap),
      options.association == "nearest" ? "a larger --t_max_diff, or --association interpolate" : "a larger --max-gap");
}

namespace {

/// The pose that the four numbers of the quaternion mean if w comes first.
SO3d wFirst(const SO3d& R) {
  const Eigen::Vector4d q = R.params();  // x y z w as read, that is w x y z of the file
  return SO3d(Eigen::Quaterniond(q[0], q[1], q[2], q[3]));
}

/// Median angle between the relative rotations of both trajectories over a fifth of the run.
double rotationDisagreement(const std::vector<MatchedPose>& poses, bool swap_reference, bool swap_estimate) {
  std::vector<double> angles;
  const std::size_t lag = std::max<std::size_t>(1, poses.size() / 5);
  const std::size_t step = std::max<std::size_t>(1, poses.size() / 500);
  for (std::size_t i = 0; i + lag < poses.size(); i += step) {
    const auto relative = [&](const SE3d& a, const SE3d& b, bool swapped) {
      const SO3d A = a.so3(), B = b.so3();
      return swapped ? SO3d(wFirst(A).inverse() * wFirst(B)) : SO3d(A.inverse() * B);
    };
    const SO3d reference = relative(poses[i].reference.mean, poses[i + lag].reference.mean, swap_reference);
    const SO3d estimate = relative(poses[i].estimate.mean, poses[i + lag].estimate.mean, swap_estimate);
    angles.push_back((reference.inverse() * estimate).log().norm());
  }
  if (angles.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(angles.begin(), angles.end());
  return angles[angles.size() / 2];
}

}  // namespace

std::string suspectQuaternionOrder(const std::vector<MatchedPose>& poses, const std::string& reference,
                                   const std::string& estimate) {
  if (poses.size() < 10) return {};
  const double as_read = rotationDisagreement(poses, false, false);
  if (!(as_read > 0.1)) return {};
  const double of_estimate = rotationDisagreement(poses, false, true),
               of_reference = rotationDisagreement(poses, true, false);
  const double better = std::min(of_estimate, of_reference);
  if (!(better < 0.2 * as_read)) return {};
  return fmt::format(
      "the quaternions of {} look as if w came first: relative rotations then differ by {:.3g} rad, and by {:.3g} rad "
      "as x y "
      "z w",
      of_estimate <= of_reference ? estimate : reference, better, as_read);
}

}  // namespace liestat::cli
