#include <formats/calibration.hpp>
#include <report/publish.hpp>
#include <cli/commands/camera.hpp>
#include <cli/commands/commands.hpp>
#include <cli/commands/imu_options.hpp>
#include <cli/commands/tracked_images.hpp>
#include <formats/images.hpp>
#include <formats/input_error.hpp>
#include <formats/recording.hpp>
#include <formats/text.hpp>
#include <cli/commands/validation_command.hpp>
#include <cli/commands/vi_init_result.hpp>
#include <cli/show/vi_init.hpp>
#include <experiments/interruption.hpp>
#include <fusion/visual_inertial.hpp>
#include <fusion/visual_inertial_truth.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace liestat::cli {
namespace {

constexpr const char* command_name = "liestat vi-init";

constexpr double default_pixel_noise = 1;

struct Options {
  ImuOptions imu;
  std::string recording, cache, tracks, image_times, truth, json, report, camera;
  std::vector<std::string> calibration;
  std::vector<double> intrinsics;
  std::optional<FilterConvention> filter_start;
  bool free_gravity = false, no_consensus = false, no_refinement = false, known_biases = false, true_biases = false;
  double gravity = 9.81, noise_factor = 1;
  std::optional<double> pixel_noise = {};
  VisualInertialOptions how;
};

/// The files of the options, what a folder adds to them, and what is missing all the same.
struct Sources {
  Options options;
  FoundRecording folder;
  Calibration calibration;
  std::vector<double> image_times;   ///< s, of a folder's images
  std::vector<std::string> missing;  ///< sentences
};

/// cam0, cam1: names that calibrations have, too.
bool isCameraName(const std::string& name) {
  return name.size() > 3 && name.starts_with("cam") && name.find_first_not_of("0123456789", 3) == std::string::npos;
}

Sources sourcesOf(const Options& given) {
  Sources s{given, {}, {}, {}, {}};
  Options& options = s.options;
  const bool in_folder = !options.recording.empty();
  const auto take = [](std::string& option, const std::string& file) {
    if (option.empty()) option = file;
  };
  if (in_folder) {
    s.folder = findRecording(options.recording, options.camera);
    take(options.imu.file, s.folder.imu), take(options.truth, s.folder.truth);
    take(options.image_times, s.folder.image_times);
    if (options.calibration.empty()) options.calibration = s.folder.calibration;
    // Tracks with times of their own may be of some of the images.
    if (!options.tracks.empty() && given.image_times.empty() && options.tracks != "-") {
      const std::string text = loadText(options.tracks).text;
      if (text.substr(0, text.find('\n')).find("t_s") != std::string::npos) options.image_times.clear();
    }
  }
  if (!options.calibration.empty()) s.calibration = readCalibration(options.calibration);
  const std::vector<CameraCalibration>& cameras = s.calibration.cameras;
  const bool known =
      std::any_of(cameras.begin(), cameras.end(), [&](const auto& c) { return c.name == options.camera; });
  if (in_folder && options.tracks.empty() && !cameras.empty() && !known) {
    if (isCameraName(s.folder.camera)) take(options.camera, s.folder.camera);
    // The name chose the images.
    if (options.camera == s.folder.camera && !isCameraName(options.camera)) options.camera.clear();
  }

  const auto lacks = [&](const char* found, const std::string& expected) {
    s.missing.push_back(errorLine(in_folder ? options.recording : command_name, 0, found, expected));
  };
  if (options.imu.file.empty()) {
    lacks("there are no readings of an inertial sensor",
          "imu0/data.csv as EuRoC has it or CSV with t,wx,wy,wz,ax,ay,az in the folder, or --imu FILE");
  }
  if (options.tracks.empty() && s.folder.images.empty()) {
    lacks("there are no images",
          "a folder of them (cam0/data, or the only one in the folder; png, jpg, pgm …), or --tracks FILE");
  }
  if (options.tracks.empty() && !s.folder.images.empty()) {
    s.image_times = imagesOf({s.folder.images}, options.image_times).times;
    if (s.image_times.empty()) {
      lacks("nothing says when the images were taken",
            "names in nanoseconds, cam0/data.csv (ns,file), CSV with frame,t_s in the folder, or --image-times FILE");
    }
  }
  if (cameras.empty() && options.intrinsics.empty()) {
    lacks("no camera is known",
          "cam0/sensor.yaml or a chain of Kalibr's in the folder, --calibration FILE with a camera, or --intrinsics "
          "fu,fv,cu,cv");
  }
  const ImuNoise<double> noise = options.imu.noiseOver(s.calibration.imu.value_or(ImuNoise<double>{}));
  if (!(noise.gyroscope > 0 && noise.accelerometer > 0)) {
    lacks("the inertial sensor's densities of noise are not known",
          "imu0/sensor.yaml or a YAML file with imu0 in the folder, --calibration FILE with an imu0, or --noise "
          "gyroscope,accelerometer");
  }
  return s;
}

CameraCalibration cameraOf(const Options& options, const Calibration& calibration) {
  CameraCalibration camera;
  if (!options.camera.empty()) {
    const auto named = std::find_if(calibration.cameras.begin(), calibration.cameras.end(),
                                    [&](const CameraCalibration& c) { return c.name == options.camera; });
    if (named == calibration.cameras.end()) {
      std::string names;
      for (const CameraCalibration& c : calibration.cameras) names += (names.empty() ? "" : ", ") + c.name;
      throw OptionError(command_name, fmt::format("no calibration has a camera {}", printable(options.camera)),
                        names.empty() ? "a calibration with a camera" : "one of " + names);
    }
    camera = *named;
  } else if (!calibration.cameras.empty()) {
    camera = calibration.cameras.front();
  }
  if (!options.intrinsics.empty()) camera.camera = cameraFromIntrinsics(options.intrinsics);
  return camera;
}

/// Throws an InputError where no image is within the readings: before any is tracked.
void refuseOtherClock(const Sources& s, const ViRecording& recording) {
  const ImuFile& imu = recording.imu;
  const double start = 1e-9 * static_cast<double>(imu.start_ns);
  const double first = s.image_times.front() - start, last = s.image_times.back() - start;
  if (first <= imu.samples.back().time && last >= imu.samples.front().time) return;
  throw InputError(
      s.folder.images, 0,
      fmt::format("images from {:.3f} to {:.3f} s, none within the readings' {:.3f} to {:.3f} s{}", first, last,
                  imu.samples.front().time, imu.samples.back().time, suspectedUnit(imu.start_ns, first)),
      "images that the readings cover, on the same clock");
}

/// The tracks of a folder's images, kept for the next time.
void trackRecording(const Sources& s, ViRecording& recording) {
  const Options& options = s.options;
  const std::string file =
      trackFile(options.recording, s.folder.images, options.cache,
                options.json.empty() || options.json == "-" ? options.report : options.json, command_name);
  const KeptTracks kept = keptTracks(s.folder.images, options.image_times, {}, file, command_name);
  const Camera& camera = recording.camera.camera;
  if (camera.width > 0 && (camera.width != kept.width || camera.height != kept.height)) {
    throw InputError(
        s.folder.images, 0, fmt::format("images of {} x {} pixels", kept.width, kept.height),
        fmt::format("{} x {}, which {} is calibrated for", camera.width, camera.height, recording.camera.name));
  }
  recording.tracks = parseImageTracks(kept.text, s.folder.images, "", "", recording.imu.start_ns);
  recording.found.push_back(fmt::format(
      "  tracks       {} in {} images{}", recording.tracks.track_ids.size(), recording.tracks.times.size(),
      kept.file.empty() ? ""
                        : (kept.from_before ? ", kept from before in " : ", kept in ") + printable(kept.file, 500)));
  if (!kept.note.empty()) recording.found.push_back("note: " + kept.note);
}

/// A folder's findings, one a line.
void describeFolder(const Sources& s, ViRecording& recording) {
  const Options& options = s.options;
  const auto line = [&](const char* what, const std::string& found) {
    recording.found.push_back(fmt::format("  {:<12} {}", what, found));
  };
  const auto shortly = [&](const std::string& path) { return printable(s.folder.shortly(path), 500); };
  recording.found.push_back(printable(options.recording, 500));
  if (options.tracks.empty()) {
    line("images", fmt::format("{} in {}, times {}", s.image_times.size(), shortly(s.folder.images),
                               options.image_times.empty() ? "by their names" : "of " + shortly(options.image_times)));
  }
  line("readings", fmt::format("{} of {}", recording.imu.samples.size(), shortly(options.imu.file)));
  std::vector<std::string> files;
  for (const std::string& file : options.calibration) files.push_back(shortly(file));
  line("calibration", files.empty() ? "none but of the options" : joined(files, ", "));
  line("truth", options.truth.empty() ? "none: errors are not known" : shortly(options.truth));
}

ViRecording recordingOf(const Sources& s) {
  const Options& options = s.options;
  ViRecording recording;
  recording.imu = readImu(options.imu.file);
  recording.camera = cameraOf(options, s.calibration);
  recording.pose_assumed = s.calibration.cameras.empty();
  recording.noise = options.imu.noiseOver(s.calibration.imu.value_or(ImuNoise<double>{}));
  if (!options.recording.empty()) describeFolder(s, recording);
  if (options.tracks.empty()) {
    refuseOtherClock(s, recording);
    trackRecording(s, recording);
  } else {
    recording.tracks = readImageTracks(options.tracks, options.image_times, recording.imu.start_ns);
  }
  for (const std::string& note : s.folder.notes) recording.found.push_back("note: " + printable(note, 500));
  if (!options.truth.empty()) recording.truth = readGroundTruth(options.truth, recording.imu.start_ns);
  if (options.true_biases && recording.truth.empty()) {
    throw OptionError(command_name, "--true-biases without --truth");
  }
  return recording;
}

/// The library's view of a recording, which must outlive it.
VisualInertialRecording measurementsOf(const ViRecording& recording, const Options& options) {
  VisualInertialRecording measured;
  measured.readings = recording.imu.samples;
  measured.noise = recording.noise;
  for (double* density : {&measured.noise.gyroscope, &measured.noise.accelerometer, &measured.noise.gyroscope_walk,
                          &measured.noise.accelerometer_walk}) {
    *density *= options.noise_factor;
  }
  for (const double t : recording.tracks.times) {
    measured.image_times.push_back(t + recording.camera.timeshift_cam_imu);
  }
  measured.cameras = {recording.camera.imu_T_cam};
  for (const PixelObservation& seen : recording.tracks.observations) {
    const double sigma = options.pixel_noise.value_or(seen.sigma > 0 ? seen.sigma : default_pixel_noise);
    const auto ray = recording.camera.camera.bearingWithSigma({seen.u, seen.v}, sigma);
    if (ray) measured.observations.push_back({seen.image, seen.track, ray->direction, ray->sigma});
  }
  return measured;
}

VisualInertialOptions optionsOf(const ViRecording& recording, const Options& options) {
  VisualInertialOptions how = options.how;
  InitialisationOptions& steps = how.initialisation;
  steps.gravity = options.free_gravity ? std::nullopt : std::optional(options.gravity);
  steps.prior.mean = options.imu.bias();
  how.filter_start.convention = options.filter_start.value_or(FilterConvention::liestat);
  how.scheme = options.imu.scheme;
  how.max_gap = options.imu.largest_gap;
  how.consensus = !options.no_consensus;
  how.refinement = !options.no_refinement;
  if (options.true_biases) {
    // Without a truth at the time its biases are not known.
    how.known_bias = [&recording](double time) {
      const auto truth = truthAt(recording.truth, time);
      return truth ? std::optional(truth->bias) : std::nullopt;
    };
  } else if (options.known_biases) {
    how.known_bias = [bias = steps.prior.mean](double) { return std::optional(bias); };
  }
  return how;
}

/// Throws an InputError in the command's name for the fault of a recording as a whole.
void refuseFault(const VisualInertialResult& found, const VisualInertialRecording& measured, std::int64_t start_ns,
                 const VisualInertialOptions& how) {
  if (!found.fault) return;
  const std::vector<double>& times = measured.image_times;
  const std::span<const ImuSample<double>> readings = measured.readings;
  if (times.empty() || readings.empty()) {
    throw OptionError(command_name, times.empty() ? "there are no images" : "there are no readings",
                      "a recording of both");
  }
  const double begin = how.begin.value_or(times.front()), end = how.end.value_or(times.back());
  if (found.fault != FaultKind::too_few_images) {
    const double windows = (end - begin) / (how.stride > 0 ? how.stride : how.window);
    throw OptionError(command_name, fmt::format("{:.3g} windows from {:.3f} to {:.3f} s", windows, begin, end),
                      fmt::format("at most {}", how.max_windows));
  }
  const double images_last = times.back() - times.front(), readings_last = readings.back().time - readings.front().time;
  // As many decimals as tell the ends apart.
  const double apart = std::max(std::min(images_last, readings_last), 1e-9);
  const int decimals = std::clamp(2 - static_cast<int>(std::floor(std::log10(apart))), 3, 9);
  // The clocks themselves tell more than how long they ran, if they count from 1970.
  std::string suspicion = suspectedUnit(start_ns, times.front());
  const double ratio = images_last / readings_last;
  // A thousand apart, as µs and ns are, or ms and µs.
  const bool unit = (ratio > 300 && ratio < 3000) || (1 / ratio > 300 && 1 / ratio < 3000);
  if (suspicion.empty() && unit) suspicion = "; does one clock count in µs where the other counts in ns?";
  throw OptionError(
      command_name,
      fmt::format("no window of {} s fits: {} images from {:.{}f} to {:.{}f} s, {} of them outside of the "
                  "readings' {:.{}f} to {:.{}f} s{}",
                  how.window, times.size(), times.front(), decimals, times.back(), decimals, found.images_outside,
                  readings.front().time, decimals, readings.back().time, decimals, suspicion),
      "images that the readings cover, on the same clock");
}

int runCommand(const Options& options, const Invocation& invocation) {
  const Sources sources = sourcesOf(options);
  if (!sources.missing.empty()) {
    for (const std::string& sentence : sources.missing) std::fputs((sentence + "\n").c_str(), stderr);
    return exit_bad_input;
  }
  const ViRecording recording = recordingOf(sources);
  const VisualInertialRecording measured = measurementsOf(recording, options);
  VisualInertialOptions how = optionsOf(recording, options);
  how.stop = experiments::runStopped;
  VisualInertialResult found = runTrials("vi-init", [&](const auto& progress) {
    return initialiseRecording(measured, how, [&](std::size_t done, std::size_t all) { progress(done, all); });
  });
  if (found.windows.empty() && found.windows_left > 0) {
    std::fputs("liestat: interrupted before the first window ended: there is nothing to write\n", stderr);
    return exit_interrupted;
  }
  refuseFault(found, measured, recording.imu.start_ns, how);
  ViInitResult result;
  static_cast<ComparedRecording&>(result) =
      compareWithTruth(std::move(found), measured.image_times, recording.truth, how.initialisation.gravity);
  // The file's numbers.
  for (ComparedWindow& w : result.windows) {
    for (std::uint64_t& track : w.track_names) track = recording.tracks.track_ids[track];
  }
  result.show_filter_start = options.filter_start.has_value();
  result.biases_given = options.known_biases || options.true_biases;
  result.observations_outside = recording.tracks.observations.size() - measured.observations.size();
  publishResult(options.json, viInitTable(recording, result), invocation.command_line,
                how.initialisation.consensus.seed,
                [&](JsonObject& object) { object.fieldsOf(recording).fieldsOf(result); });
  if (!options.report.empty()) writeViInitReport(options.report, invocation.command_line, recording, result);
  if (result.windows_left > 0) return exit_interrupted;
  return result.verdict().isNo() ? exit_not_trusted : exit_fine;
}

}  // namespace

void addViInitCommand(const CommandList& app) {
  auto options = std::make_shared<Options>();
  VisualInertialOptions& how = options->how;
  InitialisationOptions& steps = how.initialisation;
  const Command command =
      app.add("vi-init", "Velocity, gravity and scale from a camera and an inertial sensor, without an initial guess");
  command.option("RECORDING", options->recording,
                 "EuRoC's mav0, or a folder with images and a CSV of readings: tracks its images, and finds all files "
                 "that the options below do not name");
  command.option("--cache", options->cache,
                 "Folder that keeps a recording's tracks (default: beside --json or --report, else ~/.cache/liestat)");
  addImuOptions(command, options->imu, ": as it is expected (default 0)");
  command.option("--tracks", options->tracks, "CSV with frame,track,u,v and, without --image-times, t_s");
  command.option("--image-times", options->image_times, "EuRoC's cam0/data.csv, or CSV with frame,t_s");
  command.option("--calibration", options->calibration,
                 "YAML of camera and inertial sensor (Kalibr, OpenVINS, EuRoC); several files are merged");
  command.option("--camera", options->camera, "Which of the calibration's cameras (default: the first)");
  command.option("--intrinsics", options->intrinsics, "fu,fv,cu,cv: go before the calibration's").list(4, 4);
  command.option("--noise-factor", options->noise_factor, "Multiplies these densities (default 1)").range(1e-3, 1e6);
  command.flag(
      "--calibrate-noise,!--no-calibrate-noise", how.calibrate_noise,
      "Test these densities where windows meet, and multiply them by the factors at which windows agree if they "
      "refute them (default); --no-calibrate-noise: use them as they are");
  command
      .option("--pixel-noise", options->pixel_noise,
              "Standard deviation of u and of v, pixels (default: the tracks' column sigma, else 1)")
      .range(1e-6, 1e3);
  command.option("--window", how.window, "s (default 2)").range(0.1, 60.);
  command.option("--stride", how.stride, "s from one window's start to the next (default: the window)")
      .range(1e-3, 1e4);
  command.option("--image-rate", how.image_rate, "Hz: images that are used, at most (default 10; 0: all)")
      .range(0., 1e4);
  command.option("--features", how.max_features, "Most features of a window (default 50; 0: all)");
  command.option("--min-observations", how.min_observations, "Fewest observations of a feature in a window (default 4)")
      .range(std::size_t{2}, std::size_t{1000});
  command.option("--gravity", options->gravity, "|G|, m/s^2 (default 9.81)").range(1e-3, 1e3);
  command.flag("--free-gravity", options->free_gravity, "|G| is not known");
  command.option("--gyroscope-bias-sigma", steps.prior.gyroscope_sigma, "rad/s, of its expected bias (default 0.1)")
      .range(1e-9, 10.);
  command
      .option("--accelerometer-bias-sigma", steps.prior.accelerometer_sigma,
              "m/s^2, of its expected bias (default 0.15)")
      .range(1e-9, 100.);
  command.flag("--known-biases", options->known_biases, "Biases are as they are expected: nothing is estimated");
  command.flag("--true-biases", options->true_biases, "Those of the ground truth are used: nothing is estimated");
  command.flag("--no-consensus", options->no_consensus, "All tracks are right");
  command.flag("--no-refinement", options->no_refinement, "The closed form alone");
  command.option("--fuse", how.stretch, "s: disjoint windows of such stretches are fused (default 12; 0: none)")
      .range(0., 1e6);
  command.flag("--inflate", how.inflate,
               "Multiply the covariance of windows together by the factor by which they disagree, where p < 0.001");
  command.choice(
      "--filter-start", options->filter_start,
      "liestat, openvins, gtsam, basalt: print the start of a filter, covariance in that library's convention");
  command
      .option("--heading-sigma", how.filter_start.heading_sigma,
              "rad, of a filter's start, whose heading is free (default 0.001)")
      .range(1e-9, 10.);
  command.option("--position-sigma", how.filter_start.position_sigma, "m, likewise (default 0.001)").range(1e-9, 1e6);
  command.option("--begin", how.begin, "s since the first reading, or the file's seconds (default: the first image)");
  command.option("--end", how.end, "The same (default: the last image)");
  command.option("--truth", options->truth, "EuRoC's ground truth, to compare with");
  command.option("--seed", steps.consensus.seed, "Seed of the consensus");
  command.option("--json", options->json, "Write everything to a JSON file ('-': standard output)");
  command.option("--report", options->report, "Write a page with plots into this directory");
  command.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
