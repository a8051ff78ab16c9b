#include <cli/commands/commands.hpp>
#include <cli/commands/measurement_options.hpp>
#include <cli/commands/validation_command.hpp>
#include <formats/input_error.hpp>
#include <formats/output_file.hpp>
#include <formats/text.hpp>
#include <formats/tracks.hpp>
#include <fusion/stereo.hpp>
#include <report/json.hpp>
#include <cli/show/mean.hpp>
#include <cli/show/progress.hpp>
#include <cli/show/split.hpp>
#include <cli/commands/split.hpp>

#include <fmt/format.h>

#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace liestat::cli {
namespace {

constexpr const char* command_name = "liestat validate split";

struct Options {
  MeasurementInput input;
  SplitSettings settings;
  std::string stereo, json, report;
  SharedRun shared;
};

FileSplit splitFile(const Options& options) {
  const Measurements measurements = options.input.read(command_name);
  const std::size_t fewest = fewestMeasurements(measurements, options.settings.split);
  if (measurements.size() < fewest) {
    throw InputError(sourceName(options.input.file), 0,
                     fmt::format("{} measurements, too few to be split", measurements.size()),
                     fmt::format("{} at least (--blocks is {})", fewest, options.settings.split.blocks));
  }
  const StopOnInterrupt watch;
  Progress bar("validate split", 2 * options.settings.split.splits);
  experiments::trials_of_run.planned += 2 * options.settings.split.splits;
  return {splitMeasurements(measurements, options.settings, [&bar] { bar.advance(); }), options.input.file,
          measurementsInWords(options.input.file, measurements), measurements.notes};
}

/// The measurements of one landmark as a file would have them.
Measurements measurementsOf(const LandmarkMeasurements& landmark, const MeasurementOptions& options) {
  FeatureFile file;
  file.kind = Feature::point;
  file.format = "stereo";
  for (std::size_t i = 0; i < landmark.points.size(); ++i) {
    file.positions.push_back(landmark.points[i].mean);
    file.covariances.emplace_back(landmark.points[i].covariance);
    file.times.push_back(landmark.times[i]);
    file.lines.push_back(landmark.frames[i]);
  }
  return chooseMeasurements(std::move(file), options, command_name);
}

LandmarkSplits splitStereo(const Options& options) {
  const std::string& prefix = options.stereo;
  const StereoCamera camera = readStereoCamera(prefix + "_camera.csv");
  if (!camera.pixel_variance) {
    throw InputError(prefix + "_camera.csv", 0, "there are no pixel variances", "the rows y_var0 ... y_var3");
  }
  const std::vector<LandmarkMeasurements> landmarks =
      backProject(readStereoTracks(prefix + "_tracks.csv"), readCameraPoses(prefix + "_poses.csv"), camera);
  std::vector<Eigen::Vector3d> survey;
  if (std::filesystem::exists(prefix + "_landmarks.csv")) survey = readLandmarks(prefix + "_landmarks.csv");

  LandmarkSplits all;
  all.source = prefix;
  all.feature = name(Feature::point), all.dof = degreesOfFreedom(Feature::point);
  all.settings = options.settings.split;
  all.surveyed = !survey.empty();
  std::vector<std::pair<std::size_t, Measurements>> enough;  // landmarks that can be split: track, measurements
  for (const LandmarkMeasurements& landmark : landmarks) {
    Measurements measurements = measurementsOf(landmark, options.input.options);
    all.criterion = measurements.criterion;
    all.known_noise = measurements.known_noise;
    if (measurements.size() < fewestMeasurements(measurements, options.settings.split)) {
      ++all.skipped;
    } else {
      enough.emplace_back(landmark.track, std::move(measurements));
    }
  }
  if (enough.empty()) {
    throw InputError(prefix + "_tracks.csv", 0, "no landmark was seen often enough to be split",
                     fmt::format("{} observations of one", options.settings.split.blocks));
  }
  all.objects = enough.size();
  std::vector<SplitSeries> random, by_blocks;
  const StopOnInterrupt watch;
  Progress bar("validate split", 2 * options.settings.split.splits * enough.size());
  experiments::trials_of_run.planned += 2 * options.settings.split.splits * enough.size();
  for (const auto& [track, measurements] : enough) {
    if (experiments::runStopped()) break;
    const SplitSummary split = splitMeasurements(measurements, options.settings, [&bar] { bar.advance(); });
    if (split.random.distances.empty()) continue;
    AnalysisOptions how;
    how.threads = options.settings.threads;
    LandmarkSplit& row = all.landmarks.emplace_back();
    row.track = track;
    row.split = split;
    row.whole = analyseMean(measurements, how);
    if (track < survey.size()) row.survey = survey[track];
    random.push_back(split.random);
    if (!split.by_blocks.distances.empty()) by_blocks.push_back(split.by_blocks);
  }
  if (random.empty()) return all;  // an interrupt came first
  all.random = pooled(random);
  if (by_blocks.empty()) {
    all.by_blocks.index = std::numeric_limits<double>::quiet_NaN(), all.by_blocks.dof = all.random.dof;
  } else {
    all.by_blocks = pooled(by_blocks);
  }
  all.description = fmt::format("{}: {} landmarks seen by a stereo camera, {} with too few observations left out",
                                prefix, landmarks.size(), all.skipped);
  return all;
}

template <class Split>
int show(const Split& split, const Options& options, const Invocation& invocation) {
  if (const std::optional<int> code = options.shared.end()) return *code;
  if (endedBeforeTrials()) return exit_interrupted;
  if (options.json != "-") printLines(formatSplit(split));
  if (!options.json.empty()) {
    JsonObject object = jsonEnvelope(invocation.command_line, options.settings.split.seed);
    writeJson(options.json, object.set("file", split.source).fieldsOf(split));
  }
  if (!options.report.empty()) writeSplitReport(options.report, invocation.command_line, split);
  return exitCode(split.passed());
}

int runCommand(const Options& options, const Invocation& invocation) {
  if (options.stereo.empty() == options.input.file.empty()) {
    throw OptionError(command_name, "one input is needed, a FILE or --stereo PREFIX");
  }
  if (options.settings.split.blocks % 2 != 0) throw OptionError(command_name, "--blocks must be even");
  options.shared.begin(invocation, {options.json, options.report});
  return options.stereo.empty() ? show(splitFile(options), options, invocation)
                                : show(splitStereo(options), options, invocation);
}

}  // namespace

void addValidateSplitCommand(const CommandList& validate) {
  auto options = std::make_shared<Options>();
  const Command command =
      validate.add("split", "Real measurements split in two, at random and by blocks of time: do the halves agree?");
  options->input.declare(command, false);
  command.option("--stereo", options->stereo,
                 "Instead of FILE: PREFIX_tracks.csv, _poses.csv, _camera.csv and, if there, _landmarks.csv");
  command.option("--splits", options->settings.split.splits, "Splits of each kind (default 200)")
      .range(std::size_t{1}, std::size_t{1000000});
  command.option("--blocks", options->settings.split.blocks, "Blocks of time, an even number (default 10)")
      .range(std::size_t{2}, std::size_t{1000});
  command.option("--seed", options->settings.split.seed,
                 "Seed; the same seed gives the same bits on any number of threads");
  command.option("--threads", options->settings.threads, "Threads (default: all)").range(0, 4096);
  command.option("--json", options->json, "Write the result to a JSON file ('-': standard output)");
  command.option("--report", options->report, "Write a page with plots into this directory");
  options->shared.declare(command);
  command.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
