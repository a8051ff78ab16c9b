#include <formats/trajectory.hpp>

#include <formats/detail/rows.hpp>
#include <formats/detail/trajectory_formats.hpp>
#include <formats/detail/trajectory_rows.hpp>
#include <formats/input_error.hpp>
#include <formats/numeric_table.hpp>
#include <formats/output_file.hpp>
#include <formats/text.hpp>
#include <stats/convention_layouts.hpp>
#include <stats/convention_losses.hpp>
#include <stats/convention_presets.hpp>

#include <fmt/format.h>

#include <filesystem>
#include <utility>

namespace liestat {
namespace {

/// The format that the options name, or the one that recognises the beginning of a text; null if none does.
const detail::TrajectoryFormat* formatOf(const detail::TrajectoryBeginning& beginning,
                                         const TrajectoryOptions& options) {
  if (options.format != "auto") return &detail::trajectoryFormat(options.format);
  const bool with_layout = options.layout && beginning.numbers == 8 + layoutSize(*options.layout);
  for (const detail::TrajectoryFormat& format : detail::trajectoryFormats()) {
    if (with_layout ? format.takes_layout : format.recognises(beginning)) return &format;
  }
  return nullptr;
}

/// A convention with what the format has of its own.
Convention conventionIn(const detail::TrajectoryFormat& format, Convention convention) {
  convention.order = format.order.value_or(convention.order);
  convention.layout = format.layout.value_or(convention.layout);
  return convention;
}

/// Covariances between translation and rotation that are known, not zero, and have no place in the layout.
std::size_t lostCrossBlocks(const Trajectory& trajectory, CovarianceLayout layout) {
  if (layout != CovarianceLayout::blocks12 && layout != CovarianceLayout::diag6) return 0;
  std::size_t n = 0;
  for (const Matrix6d& C : trajectory.covariances) n += (C.topRightCorner<3, 3>().array().abs() > 0).any() ? 1 : 0;
  return n;
}

}  // namespace

std::vector<std::string> trajectoryFormatNames() {
  std::vector<std::string> names = {"auto"};
  for (const detail::TrajectoryFormat& format : detail::trajectoryFormats()) names.emplace_back(format.name);
  return names;
}

Trajectory parseTrajectory(std::string_view text, std::string name, const TrajectoryOptions& options) {
  Trajectory trajectory;
  trajectory.name = std::move(name);
  requireText(text, trajectory.name);
  LineReader reader(text);
  if (!reader.next()) throw InputError(trajectory.name, 0, "the file has no data, only blank lines and comments");
  detail::TrajectoryBeginning beginning{reader.line(), text};
  std::vector<std::string_view> fields;
  splitFields(beginning.line, Separator::comma_or_blanks, fields);
  if (detail::looksNumeric(fields)) beginning.numbers = fields.size();
  const detail::TrajectoryFormat* const format = formatOf(beginning, options);
  if (format == nullptr) {
    throw InputError(trajectory.name, reader.number(), fmt::format("{} numbers without a header", beginning.numbers),
                     "8 (TUM), 12 (KITTI), 20 (OpenVINS), EuRoC's nanoseconds, or a header that names the columns; "
                     "--cov-layout says what follows TUM's eight");
  }
  trajectory.format = std::string(format->name);
  if (options.layout && !format->takes_layout) {
    throw InputError(trajectory.name, 0, fmt::format("--cov-layout for a file of the format {}", format->name),
                     "a TUM file with further columns; the other formats have a layout of their own");
  }
  format->read({text, *format, options}, trajectory);
  if (trajectory.poses.empty()) throw InputError(trajectory.name, 0, "the file has no poses", "at least one");
  trajectory.fixed_order = format->order;
  if (trajectory.hasCovariances() && !format->preset.empty()) {
    trajectory.stated_convention = conventionPreset(format->preset);
  }
  return trajectory;
}

Trajectory readTrajectory(const std::string& path, const TrajectoryOptions& options) {
  const TextFile file = loadText(path);
  Trajectory trajectory = parseTrajectory(file.text, file.name, options);
  std::string side = options.covariance_file;
  std::error_code ignored;
  if (side.empty() && options.side_file && path != "-" && std::filesystem::exists(path + ".cov", ignored)) {
    side = path + ".cov";
  }
  if (side.empty()) return trajectory;
  if (trajectory.hasCovariances()) {
    if (options.covariance_file.empty()) return trajectory;
    throw InputError(trajectory.name, 0, "the file has covariances, and " + sourceName(side) + " is given",
                     "one of them");
  }
  trajectory.fixed_order.reset();
  detail::readSideFile(side, trajectory);
  return trajectory;
}

std::vector<std::string> notesOf(const Trajectory& trajectory, const TrajectoryOptions& options) {
  std::vector<std::string> notes;
  if (trajectory.n_normalised > 0) {
    notes.push_back(fmt::format(
        "{} rotations were {}, off by {:.2g} at most", trajectory.n_normalised,
        trajectory.format == "kitti" || trajectory.format == "matrix" ? "projected from their matrices" : "normalised",
        trajectory.largest_norm_error));
  }
  if (trajectory.n_unmeasured > 0) {
    notes.push_back(fmt::format("{} rows have components with a variance of {:g} or more: not measured",
                                trajectory.n_unmeasured, options.unmeasured));
  }
  return notes;
}

Convention conventionNamed(const std::string& text, std::string_view option) {
  if (const auto convention = parseConvention(text)) return *convention;
  std::vector<std::string> names;
  for (const NamedConvention& c : convention_presets) names.emplace_back(c.name);
  for (const NamedConvention& c : convention_aliases) names.emplace_back(c.name);
  const std::string near = nearestName(text.substr(0, text.find(',')), names);
  throw OptionError(option,
                    fmt::format("there is no convention '{}'{}", printable(text),
                                near.empty() || near == text ? "" : " (is it '" + near + "'?)"),
                    fmt::format("one of {}, and after it order=tr|rt, unit=rad|half|double|deg, "
                                "content=covariance|information|sigmas, perturbation=...",
                                joined(names, ", ")));
}

Convention conventionOf(const Trajectory& trajectory, const std::optional<Convention>& given, std::string_view option) {
  Convention convention;
  if (!given && !trajectory.stated_convention) {
    throw InputError(trajectory.name, 0,
                     fmt::format("the format {} does not say what its covariances mean", trajectory.format),
                     fmt::format("{} with a convention (docs/which_convention.md)", option));
  }
  convention = given ? *given : *trajectory.stated_convention;
  if (trajectory.fixed_order) convention.order = *trajectory.fixed_order;
  if (given && trajectory.states_convention) {
    Convention stated = *trajectory.stated_convention;
    stated.layout = convention.layout;
    if (stated != convention) {
      throw InputError(trajectory.covariance_source, 0,
                       fmt::format("its covariances are '{}', and {} says '{}'", conventionName(stated, false), option,
                                   conventionName(convention, false)),
                       "the same, or no " + std::string(option));
    }
  }
  return convention;
}

std::vector<Gaussian<SE3d>> gaussiansOf(const Trajectory& trajectory, const Convention& convention) {
  std::vector<Gaussian<SE3d>> list;
  list.reserve(trajectory.size());
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    list.push_back(fromConvention(convention, trajectory.poses[i], trajectory.covariances[i]));
  }
  return list;
}

std::vector<Gaussian<SE3d>> gaussiansOf(const Trajectory& trajectory, std::string_view convention) {
  std::optional<Convention> given;
  if (!convention.empty()) given = conventionNamed(std::string(convention), "convention");
  if (trajectory.hasCovariances()) {
    const Convention stated = conventionOf(trajectory, given, "convention");
    for (std::size_t i = 0; i < trajectory.size(); ++i) {
      if (isSemidefinite(trajectory.covariances[i])) continue;
      throw InputError(trajectory.covariance_source.empty() ? trajectory.name : trajectory.covariance_source,
                       trajectory.covariance_source == trajectory.name ? trajectory.lines[i] : 0,
                       fmt::format("the matrix of pose {} is indefinite", i), "a positive semidefinite one");
    }
    return gaussiansOf(trajectory, stated);
  }
  std::vector<Gaussian<SE3d>> list;
  for (const SE3d& pose : trajectory.poses) list.push_back({pose, Matrix6d::Constant(unknown_entry)});
  return list;
}

Trajectory trajectoryOf(std::span<const Gaussian<SE3d>> poses, std::span<const double> times) {
  Trajectory trajectory;
  trajectory.name = "trajectory";
  for (const Gaussian<SE3d>& pose : poses) {
    trajectory.poses.push_back(pose.mean);
    trajectory.covariances.push_back(pose.covariance);
  }
  trajectory.lines.assign(poses.size(), 0);
  trajectory.times.assign(times.begin(), times.end());
  for (const double time : times) trajectory.time_texts.push_back(fmt::format("{}", time));
  trajectory.stated_convention = Convention{};
  return trajectory;
}

// --- Writing ----------------------------------------------------------------------------------------------------------

Convention conventionToWrite(std::string_view format, const std::string& asked, const std::string& caller,
                             std::string_view option) {
  const detail::TrajectoryFormat& row = detail::trajectoryFormat(format);
  if (!asked.empty()) {
    Convention given = conventionNamed(asked, option);
    const bool names_layout = asked.find("layout=") != std::string::npos;
    if (row.selfDescribing() && !names_layout) given.layout = CovarianceLayout::upper21;
    const Convention c = conventionIn(row, given);
    if (c.layout != given.layout && names_layout) {
      throw OptionError(caller, fmt::format("{} {}, but the format {} has its own layout", option, asked, format),
                        std::string(name(c.layout)));
    }
    return c;
  }
  if (row.selfDescribing()) return conventionIn(row, {.layout = CovarianceLayout::upper21});
  if (!row.preset.empty()) return *conventionPreset(row.preset);
  throw OptionError(caller, fmt::format("the format {} cannot say what its covariances mean", format),
                    fmt::format("{} with a convention (docs/which_convention.md)", option));
}

std::vector<std::string> notesOf(const TrajectoryText& text, std::string_view format, const Convention& convention) {
  std::vector<std::string> notes;
  if (text.n_rounded_times > 0) {
    notes.push_back(fmt::format("{} times have digits that the format {} has not; they were cut off",
                                text.n_rounded_times, format));
  }
  if (text.n_lost_cross > 0) {
    notes.push_back(fmt::format("{} covariances have a cross block, for which the layout {} has no place",
                                text.n_lost_cross, name(convention.layout)));
  }
  if (text.n_marked > 0) {
    notes.push_back(fmt::format("{} unknown components are written as a variance of 1e6", text.n_marked));
  }
  return notes;
}

TrajectoryText formatTrajectory(const Trajectory& trajectory, std::string_view format, const Convention& convention) {
  const detail::TrajectoryFormat& row = detail::trajectoryFormat(format);
  if (row.times == detail::TrajectoryTimes::required && !trajectory.hasTimes()) {
    throw InputError(trajectory.name, 0, "the file has no times",
                     fmt::format("--times with a file of one time for each pose: the format {} needs them", format));
  }
  const Convention written = conventionIn(row, convention);
  detail::TrajectorySink sink(trajectory, row, written);
  row.write(sink);
  if (row.covariances == detail::CovariancePlace::side_file && trajectory.hasCovariances()) sink.sideFile();
  TrajectoryText result = sink.take();
  result.n_lost_cross = lostCrossBlocks(trajectory, written.layout);
  return result;
}

std::vector<std::string> writeTrajectory(const std::string& path, const Trajectory& trajectory,
                                         const TrajectoryWritingOptions& options) {
  const std::string& format = options.format.empty() ? trajectory.format : options.format;
  Convention to;
  Trajectory written = trajectory;
  if (trajectory.hasCovariances()) {
    to = options.convention ? conventionIn(detail::trajectoryFormat(format), *options.convention)
                            : conventionToWrite(format, {}, sourceName(path), "the option convention");
    const Convention from = conventionOf(trajectory, std::nullopt, "stated_convention");
    for (std::size_t i = 0; i < written.size(); ++i) {
      written.covariances[i] = convertConvention(from, to, written.poses[i], written.covariances[i]);
    }
  }
  const TrajectoryText text = formatTrajectory(written, format, to);
  if (!text.side_file.empty()) {
    if (path == "-") {
      throw InputError(sourceName(path), 0, "the covariances go to a file beside the poses, which it has not",
                       "a file for the output, or a format that has them in its rows (csv)");
    }
    writeOutput(path + ".cov", text.side_file);
  }
  writeOutput(path, text.text);
  return notesOf(text, format, to);
}

}  // namespace liestat
