#include <cli/commands/commands.hpp>
#include <cli/commands/tracked_images.hpp>
#include <formats/images.hpp>
#include <formats/input_error.hpp>
#include <formats/output_file.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace liestat::cli {
namespace {

constexpr const char* track_name = "liestat track";

struct TrackCommandOptions {
  std::vector<std::string> paths;
  std::string times, output;
  std::size_t every = 1;
  TrackerOptions how;
};

std::string summaryOf(const TrackedImages& tracked) {
  std::vector<double> sigmas;
  std::size_t last = 0;
  std::vector<std::size_t> tracks;
  for (const TrackedPoint& p : tracked.points) {
    sigmas.push_back(p.sigma);
    tracks.push_back(p.track);
    last = std::max(last, p.image);
  }
  std::sort(tracks.begin(), tracks.end());
  const auto number = static_cast<std::size_t>(std::unique(tracks.begin(), tracks.end()) - tracks.begin());
  std::sort(sigmas.begin(), sigmas.end());
  const auto quantile = [&](double q) {
    return sigmas[static_cast<std::size_t>(q * static_cast<double>(sigmas.size() - 1))];
  };
  const double images = static_cast<double>(tracked.images), points = static_cast<double>(tracked.points.size());
  std::string text = fmt::format("{} images of {} x {}, {} tracks, {} observations ({:.1f} an image, {:.1f} a track)\n",
                                 tracked.images, tracked.width, tracked.height, number, tracked.points.size(),
                                 points / images, points / static_cast<double>(number));
  text += fmt::format("sigma: median {:.3f} px, 5 to 95 % {:.3f} to {:.3f} px\n", quantile(0.5), quantile(0.05),
                      quantile(0.95));
  text += "ends:";
  for (std::size_t i = 0; i < track_ends; ++i) {
    if (tracked.ends[i] > 0) text += fmt::format(" {} {},", tracked.ends[i], name(static_cast<TrackEnd>(i)));
  }
  text.back() = '\n';
  if (tracked.times.empty()) text += "note: no times are known; vi-init needs --image-times\n";
  if (last + 1 < tracked.images) {
    text += fmt::format("note: nothing is seen after image {}\n", last);
  }
  return text;
}

int runCommand(const TrackCommandOptions& options) {
  ImageReader images(options.paths, options.times, options.every, track_name);
  if (images.reads(options.output)) {
    throw OptionError(track_name, "--output " + options.output + ", which is read", "another file");
  }
  const TrackedImages tracked = trackImages(images, options.how, track_name);
  if (options.output != "-") printLines(summaryOf(tracked));
  writeOutput(options.output, tracksText(tracked));
  return exit_fine;
}

}  // namespace

void addTrackCommand(const CommandList& app) {
  auto options = std::make_shared<TrackCommandOptions>();
  const Command command = app.add("track", "Tracks of corners through images or a video, each point with its sigma");
  command.option("IMAGES", options->paths, "A folder, a video, or two images or more (in the natural order of names)")
      .required();
  command.option("--output", options->output, "CSV frame,track,u,v,sigma and t_s if known ('-': standard output)")
      .required();
  command.option("--times", options->times, "CSV frame,t_s with a row an image, or EuRoC's cam0/data.csv");
  command.option("--every", options->every, "Take one image of so many, and number those (default 1)")
      .range<std::size_t>(std::size_t{1}, std::size_t{1000});
  command.option("--tracks", options->how.tracks, "Tracks at a time (default 300)")
      .range<std::size_t>(std::size_t{8}, std::size_t{5000});
  command.option("--least", options->how.least, "Images that must show a track, or all if they are fewer (default 8)")
      .range<std::size_t>(std::size_t{2}, std::size_t{1000});
  command.run([options](const Invocation&) { return runCommand(*options); });
}

}  // namespace liestat::cli
