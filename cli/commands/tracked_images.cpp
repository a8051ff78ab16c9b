#include <cli/commands/tracked_images.hpp>

#include <cli/commands/command_line.hpp>
#include <cli/show/progress.hpp>
#include <formats/input_error.hpp>
#include <formats/output_file.hpp>
#include <formats/text.hpp>
#include <report/json.hpp>

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <memory>
#include <string_view>
#include <system_error>

namespace liestat::cli {
namespace {

namespace fs = std::filesystem;

/// FNV-1a: sees what has changed by accident, not by malice.
std::uint64_t fingerprint(std::string_view text) {
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
  return hash;
}

/// True of a path that is a folder or lies in it, links resolved.
bool isWithin(const std::string& path, const std::string& folder) {
  std::error_code error;
  const fs::path inner = fs::weakly_canonical(fs::absolute(path, error), error), outer = fs::canonical(folder, error);
  const fs::path relative = inner.lexically_relative(outer);
  return !relative.empty() && *relative.begin() != "..";
}

/// All that the tracks depend on.
std::string stateOf(const ImageRecording& recording, const TrackerOptions& how) {
  std::string state = fmt::format("{} {} {} {} {}\n", programVersion(), how.tracks, how.apart, how.backward, how.least);
  for (const std::string& file : recording.files) {
    std::error_code error;
    const auto changed = fs::last_write_time(file, error).time_since_epoch();
    fmt::format_to(std::back_inserter(state), "{} {} {}\n", file, fs::file_size(file, error), changed.count());
  }
  for (const double t : recording.times) fmt::format_to(std::back_inserter(state), "{:.17g}\n", t);
  return state;
}

}  // namespace

TrackedImages trackImages(ImageReader& images, const TrackerOptions& how, const std::string& user) {
  const std::unique_ptr<PointFlow> flow = imageLibrary(user).pointFlow();
  Tracker tracker(*flow, how);
  TrackedImages result;
  Progress progress("track", images.count());
  for (GreyView image = images.next(); image.pixels != nullptr; image = images.next()) {
    result.width = image.width, result.height = image.height;
    ++result.images;
    if (!std::isnan(images.time())) result.times.push_back(images.time());
    tracker.take(image);
    progress.advance(images.every());
  }
  result.points = tracker.finish();
  if (result.points.empty()) {
    throw InputError(images.name(), 0, "no corner was found again in another image",
                     "images with texture that are not black, and overlap");
  }
  result.ends = tracker.ends();
  return result;
}

std::string tracksText(const TrackedImages& tracked) {
  const bool times = !tracked.times.empty();
  std::string text = times ? "frame,track,u,v,sigma,t_s\n" : "frame,track,u,v,sigma\n";
  for (const TrackedPoint& p : tracked.points) {
    fmt::format_to(std::back_inserter(text), "{},{},{:.5f},{:.5f},{:.5f}", p.image, p.track, p.u, p.v, p.sigma);
    if (times) fmt::format_to(std::back_inserter(text), ",{:.9f}", tracked.times[p.image]);
    text += '\n';
  }
  return text;
}

KeptTracks keptTracks(const std::string& images, const std::string& times, const TrackerOptions& how,
                      const std::string& file, const std::string& user) {
  KeptTracks kept;
  kept.file = file;
  const std::uint64_t state = fingerprint(stateOf(imagesOf({images}, times), how));
  const auto header = [state](std::string_view rows) {
    return fmt::format("# kept by liestat: {:016x} {:016x} ", state, fingerprint(rows));
  };
  std::error_code error;
  if (!file.empty() && fs::is_regular_file(file, error)) {
    const std::string before = loadText(file).text;
    const std::size_t end = before.find('\n');
    if (end != std::string::npos) kept.text = before.substr(end + 1);
    const std::string first = header(kept.text);
    kept.from_before = before.starts_with(first) &&
                       std::sscanf(before.c_str() + first.size(), "%d %d", &kept.width, &kept.height) == 2;
    if (kept.from_before) return kept;
  }
  ImageReader reader({images}, times, 1, user);
  const TrackedImages tracked = trackImages(reader, how, user);
  kept.text = tracksText(tracked);
  kept.width = tracked.width, kept.height = tracked.height;
  if (file.empty()) return kept;
  try {
    createDirectory(fs::path(file).parent_path().string());
    writeOutput(file, fmt::format("{}{} {}\n{}", header(kept.text), kept.width, kept.height, kept.text));
  } catch (const InputError& fault) {
    kept.note = fmt::format("tracks are not kept: {}", fault.what());
    kept.file.clear();
  }
  return kept;
}

std::string trackFile(const std::string& recording, const std::string& images, const std::string& cache,
                      const std::string& output, const std::string& user) {
  std::error_code error;
  const std::string place = fs::canonical(images, error).string();
  const std::string name = fmt::format("tracks-{:016x}.csv", fingerprint(place));
  if (!cache.empty()) {
    if (isWithin(cache, recording)) {
      throw OptionError(user, "--cache " + cache + " is within the recording", "a folder outside of it");
    }
    return (fs::path(cache) / name).string();
  }
  if (!output.empty() && output != "-") {
    const fs::path folder = fs::absolute(output, error).lexically_normal().parent_path();
    if (!isWithin(folder.string(), recording)) return (folder / name).string();
  }
  const auto variable = [](const char* of) {
    const char* const value = std::getenv(of);
    return fs::path(value == nullptr ? "" : value);
  };
  fs::path user_cache = variable("XDG_CACHE_HOME");
  if (!user_cache.is_absolute() && variable("HOME").is_absolute()) user_cache = variable("HOME") / ".cache";
  if (!user_cache.is_absolute() || isWithin(user_cache.string(), recording)) return {};
  return (user_cache / "liestat" / name).string();
}

}  // namespace liestat::cli
