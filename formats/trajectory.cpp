#include <formats/trajectory.hpp>

#include <formats/bag.hpp>
#include <formats/detail/feature_formats.hpp>
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

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <numeric>
#include <utility>

namespace liestat {
namespace {

/// The format that the options name, or the one that recognises the beginning of a text; null if none does.
const detail::TrajectoryFormat* formatOf(const detail::TrajectoryBeginning& beginning,
                                         const TrajectoryOptions& options) {
  if (options.format != "auto") return &detail::trajectoryFormat(options.format);
  if (detail::columnsByNumber(options.reading.columns)) return &detail::trajectoryFormat("csv");
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

/// The layouts by which a row of so many numbers would be TUM's eight and a covariance, as the beginning of a list.
std::string layoutsAfter(std::size_t numbers) {
  std::string text;
  for (const char* layout : {"full36", "upper21", "lower21", "blocks12", "diag6"}) {
    Convention c;
    setConventionField(c, "layout", layout);
    if (numbers == 8 + layoutSize(c.layout)) text += fmt::format("{} (TUM and --cov-layout {}), ", numbers, layout);
  }
  return text;
}

/// Seconds instead of the stamps of a file, whose unit is that of the option, or the one in which all of them lie
/// between 1973 and 2286. No clock counts so many seconds.
void settleStamps(Trajectory& t, const detail::TrajectoryFormat& format, std::optional<StampUnit> unit) {
  if (!t.hasTimes()) return;
  if (format.time_decimals > 0 || t.stamp_decimals > 0) {
    if (!unit || *unit == (t.stamp_decimals == 9 || format.time_decimals == 9 ? StampUnit::ns : StampUnit::us)) return;
    throw InputError(t.name, 0, fmt::format("--time-unit {} for a file of the format {}", name(*unit), format.name),
                     "no such option: the format says what its stamps are in");
  }
  const auto [least, most] = std::minmax_element(t.times.begin(), t.times.end());
  for (const StampUnit candidate : {StampUnit::ms, StampUnit::us, StampUnit::ns}) {
    const double per_second = std::pow(1e3, static_cast<double>(candidate));
    if (unit || *least < 1e8 * per_second || *most > 1e10 * per_second) continue;
    unit = candidate;
    t.notes.push_back(fmt::format("the stamps are taken as {} since 1970", name(candidate)));
  }
  if (!unit || *unit == StampUnit::s) return;
  t.stamp_decimals = 3 * static_cast<std::size_t>(*unit);
  TextList texts;
  for (std::size_t i = 0; i < t.times.size(); ++i) {
    texts.push_back(detail::secondsOfTicks(t.time_texts[i], t.stamp_decimals));
    parseNumber(texts.back(), t.times[i]);
  }
  t.time_texts = std::move(texts);
}

/// True if two rows have the same pose and covariance.
bool samePose(const Trajectory& t, std::size_t i, std::size_t j) {
  constexpr double rounding = 1e-9;
  if (i == j) return true;
  const SE3d between = t.poses[i].inverse() * t.poses[j];
  if (between.translation().norm() > rounding || between.so3().log().norm() > rounding) return false;
  if (!t.hasCovariances()) return true;
  const Matrix6d &C = t.covariances[i], &D = t.covariances[j];
  const auto same = (C - D).array().abs() <= rounding * C.array().abs() || (C.array().isNaN() && D.array().isNaN());
  return same.all();
}

/// The mean of some poses: of the positions, and of the rotations by Gauss-Newton from the first.
SE3d meanPose(const std::vector<SE3d>& poses, std::span<const std::size_t> rows) {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  for (const std::size_t i : rows) position += poses[i].translation() / static_cast<double>(rows.size());
  SO3d rotation = poses[rows[0]].so3();
  for (int step = 0; step < 10; ++step) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const std::size_t i : rows)
      mean += (rotation.inverse() * poses[i].so3()).log() / static_cast<double>(rows.size());
    rotation = rotation * SO3d::exp(mean);
  }
  return SE3d(rotation, position);
}

template <class List>
void keepRows(List& list, std::span<const std::size_t> rows) {
  if (list.empty()) return;
  List kept;
  kept.reserve(rows.size());
  for (const std::size_t i : rows) kept.push_back(list[i]);
  list = std::move(kept);
}

}  // namespace

std::vector<std::string> trajectoryFormatNames(bool with_read_only) {
  std::vector<std::string> names = {"auto"};
  for (const detail::TrajectoryFormat& format : detail::trajectoryFormats()) {
    if (with_read_only || format.write != nullptr) names.emplace_back(format.name);
  }
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
  beginning.comment = reader.comment();
  splitFields(beginning.line, Separator::comma_or_blanks, fields);
  if (detail::looksNumeric(fields)) beginning.numbers = fields.size();
  const detail::TrajectoryFormat* const format = formatOf(beginning, options);
  if (format == nullptr) {
    throw InputError(
        trajectory.name, reader.number(), fmt::format("{} numbers without a header", beginning.numbers),
        layoutsAfter(beginning.numbers) +
            "8 between blanks (TUM), 12 (KITTI), 16 (a 4x4 matrix), 20 (OpenVINS), EuRoC's nanoseconds, a header that "
            "names the columns, or --columns t=1,tx=2,... by their numbers");
  }
  trajectory.format = std::string(format->name);
  if (options.layout && !format->takes_layout) {
    throw InputError(trajectory.name, 0, fmt::format("--cov-layout for a file of the format {}", format->name),
                     "a TUM file with further columns; the other formats have a layout of their own");
  }
  format->read({text, *format, options}, trajectory);
  if (trajectory.poses.empty()) throw InputError(trajectory.name, 0, "the file has no poses", "at least one");
  settleStamps(trajectory, *format, options.time_unit);
  trajectory.fixed_order = format->order;
  if (trajectory.hasCovariances() && !format->preset.empty()) {
    trajectory.stated_convention = conventionPreset(format->preset);
  }
  return trajectory;
}

Trajectory readTrajectory(const std::string& path, const TrajectoryOptions& options) {
  return readTrajectory(path, loadTrajectoryText(path, options.reading.largest_file), options);
}

TextFile loadTrajectoryText(const std::string& path, std::optional<double> largest) {
  return isBag(path) ? TextFile{sourceName(path), {}} : loadText(path, largest);
}

Trajectory readTrajectory(const std::string& path, const TextFile& file, const TrajectoryOptions& options) {
  Trajectory trajectory = file.text.empty() && isBag(path) ? detail::readBagTrajectory(path, options)
                                                           : parseTrajectory(file.text, file.name, options);
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
  detail::readSideFile(side, trajectory, options);
  return trajectory;
}

void orderInTime(Trajectory& t, std::optional<DuplicateRule> duplicates) {
  const std::vector<double>& times = t.times;
  const auto not_after = std::adjacent_find(times.begin(), times.end(), std::greater_equal<>());
  if (not_after == times.end()) return;
  const auto place = [&](std::size_t i) {
    return t.lines[i] > 0 ? fmt::format("line {}", t.lines[i]) : fmt::format("pose {}", i);
  };
  std::vector<std::size_t> order(times.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::size_t moved = 0, first_moved = 0;
  for (std::size_t i = 1; i < times.size(); ++i) {
    if (times[i] < times[i - 1] && moved++ == 0) first_moved = i;
  }
  if (moved > 0) {
    std::stable_sort(order.begin(), order.end(), [&](std::size_t i, std::size_t j) { return times[i] < times[j]; });
    t.notes.push_back(fmt::format("{} {} before the row above (first {}): sorted by time", moved,
                                  moved == 1 ? "time is" : "times are", place(first_moved)));
  }
  std::vector<std::size_t> kept;
  std::size_t repeated = 0, first_repeated = 0, several = 0, first_several = 0;
  for (std::size_t a = 0, b = 0; a < order.size(); a = b) {
    const std::size_t first = order[a];
    kept.push_back(first);
    const std::span<const std::size_t> rows(order.begin() + static_cast<std::ptrdiff_t>(a), order.end());
    for (b = a + 1; b < order.size() && times[order[b]] == times[first]; ++b) {
      if (repeated + several == 0) first_repeated = order[b];
      if (samePose(t, first, order[b])) ++repeated;
    }
    const std::span<const std::size_t> stamp = rows.first(b - a);
    const auto other = std::find_if(stamp.begin(), stamp.end(), [&](std::size_t i) { return !samePose(t, first, i); });
    if (other == stamp.end()) continue;
    if (!duplicates) {
      throw InputError(t.name, t.lines[*other],
                       fmt::format("the time {} stands in {} too, with another pose{}", t.time_texts[*other],
                                   place(first), t.hasCovariances() ? " or covariance" : ""),
                       "each time once, or --duplicates drop (keeps the first) or mean");
    }
    if (*duplicates == DuplicateRule::mean && t.hasCovariances()) {
      throw InputError(t.name, t.lines[*other], "--duplicates mean of poses with covariances",
                       "--duplicates drop: matrices of a convention that is not yet known have no mean");
    }
    if (several++ == 0) first_several = *other;
    if (*duplicates == DuplicateRule::mean) t.poses[first] = meanPose(t.poses, stamp);
  }
  if (repeated > 0) {
    t.notes.push_back(fmt::format("{} {} stamp and pose of an earlier one (first {}): dropped", repeated,
                                  repeated == 1 ? "row repeats" : "rows repeat", place(first_repeated)));
  }
  if (several > 0) {
    t.notes.push_back(fmt::format("{} {} different poses (first {}): {}", several,
                                  several == 1 ? "stamp has" : "stamps have", place(first_several),
                                  *duplicates == DuplicateRule::mean ? "their mean is taken" : "the first is taken"));
  }
  TextList texts;
  for (const std::size_t i : kept) texts.push_back(t.time_texts[i]);
  t.time_texts = std::move(texts);
  keepRows(t.times, kept), keepRows(t.poses, kept), keepRows(t.lines, kept), keepRows(t.covariances, kept);
}

std::vector<std::string> notesOf(const Trajectory& trajectory, const TrajectoryOptions& options) {
  std::vector<std::string> notes = trajectory.notes;
  const bool of_matrices = trajectory.format == "kitti" || trajectory.format == "matrix";
  // Quaternions of six digits are off by as much; a matrix of few digits is worth a word.
  if (trajectory.n_normalised > 0 && (of_matrices || trajectory.largest_norm_error > 1e-6)) {
    notes.push_back(fmt::format("{} rotations were {}, off by {:.2g} at most", trajectory.n_normalised,
                                of_matrices ? "projected from their matrices" : "normalised",
                                trajectory.largest_norm_error));
  }
  const auto diagonal = std::count_if(trajectory.covariances.begin(), trajectory.covariances.end(), [](const auto& C) {
    return C.diagonal().allFinite() && C.array().isNaN().count() == 30;
  });
  if (diagonal > 0) {
    notes.push_back(
        fmt::format("{} matrices are known on their diagonals alone (layout diag6); the other entries are "
                    "unknown, not zero: convert --assume-uncorrelated makes them zero",
                    diagonal));
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

// --- Writing
// ----------------------------------------------------------------------------------------------------------

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
  if (row.write == nullptr) {
    throw OptionError(format, "trajectories of this format are read, not written",
                      joined(trajectoryFormatNames(false), ", ").substr(6));
  }
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
