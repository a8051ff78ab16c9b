#include <formats/tracks.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <utility>

#include <formats/input_error.hpp>
#include <formats/detail/rows.hpp>
#include <formats/numeric_table.hpp>
#include <formats/text.hpp>

namespace liestat {
namespace {

/// Two times of one frame that differ by more contradict each other, s. Seconds since 1970 have a quarter of a
/// microsecond as doubles, and files print six decimals.
constexpr double time_tolerance = 1e-5;

/// Seconds of a clock that shows start_ns at zero. Whole seconds first: nanoseconds since 1970 do not fit into a
/// double.
double sinceStart(double seconds, std::int64_t start_ns) {
  constexpr std::int64_t second = 1000000000;
  const std::int64_t whole = start_ns / second, rest = start_ns % second;
  return (seconds - static_cast<double>(whole)) - 1e-9 * static_cast<double>(rest);
}

/// Places in an ImageTracks by the frames' numbers.
using Places = std::unordered_map<std::size_t, std::size_t>;

Places readTimes(std::string_view text, const std::string& name, std::int64_t start_ns, ImageTracks& result) {
  Places places;
  std::vector<std::size_t> lines;
  const auto add = [&](std::size_t frame, double time, std::size_t line) {
    if (!result.times.empty()) detail::requireAscending(result.times.back(), lines.back(), time, name, line);
    const auto [place, is_new] = places.emplace(frame, result.times.size());
    if (!is_new) {
      throw InputError(name, line, fmt::format("frame {} again, as in line {}", frame, lines[place->second]),
                       "it once");
    }
    result.times.push_back(time);
    result.frames.push_back(frame);
    lines.push_back(line);
  };
  LineReader first(text);
  std::vector<std::string_view> fields;
  if (first.next()) splitFields(first.line(), Separator::comma, fields);
  if (!fields.empty() && detail::isNanoseconds(fields[0])) {
    result.format = "euroc";
    detail::StampedRows rows(text, name, {});
    while (rows.next()) {
      add(result.times.size(), 1e-9 * static_cast<double>(rows.stamp() - start_ns), rows.line());
    }
  } else {
    result.format = "csv";
    const NumericTable table = parseTable(text, name, {"frame", "t_s"});
    for (std::size_t row = 0; row < table.rows(); ++row)
      add(table.index(row, 0), sinceStart(table(row, 1), start_ns), table.line(row));
  }
  return places;
}

/// The times that the tracks themselves have.
Places timesOfTracks(const NumericTable& table, std::int64_t start_ns, ImageTracks& result) {
  result.format = "t_s";
  const std::size_t t_s = table.column("t_s");
  struct Image {
    std::size_t frame;
    double time;
    std::size_t line;
  };
  std::vector<Image> images;
  Places seen;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::size_t frame = table.index(row, 0);
    if (seen.emplace(frame, 0).second)
      images.push_back({frame, sinceStart(table(row, t_s), start_ns), table.line(row)});
  }
  std::sort(images.begin(), images.end(), [](const Image& a, const Image& b) { return a.frame < b.frame; });
  for (std::size_t i = 0; i < images.size(); ++i) {
    if (i > 0)
      detail::requireAscending(images[i - 1].time, images[i - 1].line, images[i].time, table.file(), images[i].line);
    result.times.push_back(images[i].time);
    result.frames.push_back(images[i].frame);
    seen[images[i].frame] = i;
  }
  return seen;
}

NumericTable tableOfTracks(std::string_view text, const std::string& name, bool with_times) {
  NumericTable table = parseTable(text, name, {"frame", "track"}, {"u", "v", "uL", "vL", "t_s", "sigma"});
  const bool pixels = (table.has("u") && table.has("v")) || (table.has("uL") && table.has("vL"));
  // The reader of tables knows best how to say what is missing.
  if (!pixels) return parseTable(text, name, {"frame", "track", "u", "v"});
  if (!with_times && !table.has("t_s")) {
    throw InputError(name, 0, "there is no column 't_s', and no file of the images' times", "one of them");
  }
  return table;
}

}  // namespace

double sigmaOfTrack(const NumericTable& table, std::size_t row, std::size_t column) {
  const double sigma = table(row, column);
  if (!(sigma > 0)) throw InputError(table.file(), table.line(row), fmt::format("sigma {:g}", sigma), "above 0, px");
  return sigma;
}

ImageTracks parseImageTracks(std::string_view tracks_text, const std::string& tracks_name, std::string_view times_text,
                             const std::string& times_name, std::int64_t start_ns) {
  ImageTracks result;
  const bool with_times = !times_name.empty();
  const NumericTable table = tableOfTracks(tracks_text, tracks_name, with_times);
  const Places images =
      with_times ? readTimes(times_text, times_name, start_ns, result) : timesOfTracks(table, start_ns, result);
  const bool left = !(table.has("u") && table.has("v"));
  const std::size_t u = table.column(left ? "uL" : "u"), v = table.column(left ? "vL" : "v");
  const bool has_time = table.has("t_s");
  const std::size_t t_s = table.column("t_s");
  result.has_sigmas = table.has("sigma");
  const std::size_t sigma = table.column("sigma");

  result.observations.reserve(table.rows());
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::size_t line = table.line(row), frame = table.index(row, 0), track = table.index(row, 1);
    const auto image = images.find(frame);
    if (image == images.end()) {
      throw InputError(tracks_name, line, fmt::format("frame {} has no time in {}", frame, times_name),
                       fmt::format("a frame of its {} rows", result.times.size()));
    }
    if (has_time) {
      const double time = sinceStart(table(row, t_s), start_ns), known = result.times[image->second];
      if (!(std::abs(time - known) <= time_tolerance)) {
        throw InputError(tracks_name, line,
                         fmt::format("frame {} is at t_s {}, {:.6g} s from its time {}", frame, table(row, t_s),
                                     time - known, with_times ? "in " + times_name : "in an earlier line"),
                         "one time for a frame");
      }
    }
    result.track_ids.push_back(track);
    result.observations.push_back({image->second, track, table(row, u), table(row, v), line,
                                   result.has_sigmas ? sigmaOfTrack(table, row, sigma) : 0});
  }

  std::sort(result.track_ids.begin(), result.track_ids.end());
  result.track_ids.erase(std::unique(result.track_ids.begin(), result.track_ids.end()), result.track_ids.end());
  result.track_ids.shrink_to_fit();
  std::vector<std::size_t> seen(result.track_ids.size(), 0);
  for (PixelObservation& o : result.observations) {
    o.track = static_cast<std::size_t>(std::lower_bound(result.track_ids.begin(), result.track_ids.end(), o.track) -
                                       result.track_ids.begin());
    ++seen[o.track];
  }
  result.seen_once = static_cast<std::size_t>(std::count(seen.begin(), seen.end(), std::size_t{1}));
  std::sort(result.observations.begin(), result.observations.end(),
            [](const PixelObservation& a, const PixelObservation& b) {
              return std::pair(std::pair(a.image, a.track), a.line) < std::pair(std::pair(b.image, b.track), b.line);
            });
  const auto twice =
      std::adjacent_find(result.observations.begin(), result.observations.end(),
                         [](const auto& a, const auto& b) { return a.image == b.image && a.track == b.track; });
  if (twice != result.observations.end()) {
    throw InputError(tracks_name, (twice + 1)->line,
                     fmt::format("frame {} and track {} again, as in line {}", result.frames[twice->image],
                                 result.track_ids[twice->track], twice->line),
                     "them once");
  }
  return result;
}

std::string suspectedUnit(std::int64_t start_ns, double image_time) {
  const double start = static_cast<double>(start_ns), image = start + 1e9 * image_time;
  struct Unit {
    double per_ns;
    const char* name;
  };
  for (const Unit unit : {Unit{1e3, "microseconds"}, Unit{1e6, "milliseconds"}, Unit{1e9, "seconds"}}) {
    // Years apart, two recordings of today agree within a few parts in a hundred since 1970.
    const auto near = [&](double small, double large) {
      return small > 0 && large > 0 && std::abs(small * unit.per_ns / large - 1) < 0.1;
    };
    if (near(image, start)) return fmt::format("; are the images' times in {}?", unit.name);
    if (near(start, image)) return fmt::format("; are the readings' times in {}?", unit.name);
  }
  return {};
}

ImageTracks readImageTracks(const std::string& tracks, const std::string& image_times, std::int64_t start_ns) {
  const TextFile file = loadText(tracks);
  const TextFile times = image_times.empty() ? TextFile{} : loadText(image_times);
  return parseImageTracks(file.text, file.name, times.text, times.name, start_ns);
}

}  // namespace liestat
