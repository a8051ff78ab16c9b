#include <formats/ebsd.hpp>
#include <formats/input_error.hpp>
#include <report/publish.hpp>
#include <cli/commands/commands.hpp>
#include <cli/commands/split.hpp>
#include <cli/commands/states.hpp>
#include <cli/show/mean.hpp>
#include <cli/show/progress.hpp>
#include <experiments/interruption.hpp>
#include <stats/mean_notes.hpp>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <cli/commands/measurement_options.hpp>

namespace liestat::cli {
namespace {

struct Options {
  MeasurementInput input;
  AnalysisOptions analysis;
  bool no_certify = false;
  std::string symmetry, phase;
  std::optional<Criterion> robust;
  std::optional<HexagonalAxes> axes;
  std::string json, report;
  StateOptions states;
  double memory = 1;

  /// An option that needs the measurements in memory, or nothing.
  const char* needsMemory() const {
    if (!report.empty()) return "--report";
    if (!symmetry.empty()) return "--symmetry";
    if (robust) return "--robust";
    if (isEbsdName(input.file)) return "a map of orientations";
    if (analysis.inflate) return "--inflate";
    if (analysis.region == MeanRegion::bootstrap) return "--region bootstrap";
    if (analysis.weights_are != ResidualNoise::precision) return "--weights-are";
    if (analysis.birge || analysis.refuted_noise == RefutedNoise::residuals) return "--birge and --refuted";
    if (input.options.criterion.value_or(Criterion::lsq) == Criterion::maha) return "--criterion maha";
    return nullptr;
  }
  /// The file is larger than the memory that it may take, and need not be in memory as a whole.
  bool streams() const {
    return hasFeatureChunks(input.file) && static_cast<double>(std::filesystem::file_size(input.file)) > 1e9 * memory;
  }
};

/// The group, and how the file's rotations are taken.
std::string symmetryInWords(PointGroup group, const std::string& asked, const char* axis) {
  const bool hexagonal = group.name().find_first_of("36") == 0;
  return std::string(group.name()) + (asked == group.name() ? "" : ", the rotations of " + asked) +
         ": each orientation R, from the crystal's axes to the sample's, has " + std::to_string(group.order()) +
         (group.order() == 1 ? " copy" : " copies") + " R k" +
         (hexagonal ? std::string("; x along ") + axis + ", z along c" : "");
}

/// The points of one phase of a map as rotations; the group and the axes are the map's unless they are given.
Measurements readMap(const Options& options, std::string& symmetry, HexagonalAxes& axes) {
  const EbsdFile map = readEbsdFile(options.input.file, options.input.reading.largest_file);
  std::vector<const EbsdPhase*> chosen;
  std::string list;
  for (const EbsdPhase& phase : map.phases) {
    if (phase.n == 0) continue;
    const bool asked = options.phase == std::to_string(phase.number) || options.phase == phase.name;
    if (options.phase.empty() || asked) chosen.push_back(&phase);
    list += (list.empty() ? "" : ", ") + std::to_string(phase.number) + " (" + phase.name + ", " + phase.symmetry +
            ", " + std::to_string(phase.n) + " points)";
  }
  if (chosen.size() != 1) throw OptionError("liestat mean", "--phase is to name one of the map's phases", list);
  const EbsdPhase& phase = *chosen.front();
  axes = options.axes.value_or(map.axes());
  if (symmetry.empty()) {
    if (!phase.group) {
      throw OptionError("liestat mean", "the symmetry of the phase is unknown: " + phase.symmetry, "--symmetry");
    }
    symmetry = phase.symmetry;
  }
  FeatureFile file;
  file.kind = Feature::rotation;
  file.format = map.format;
  for (std::size_t i = 0; i < map.rotations.size(); ++i) {
    if (map.phase[i] != phase.number) continue;
    file.rotations.push_back(map.rotations[i].unit_quaternion());
    file.lines.push_back(map.lines[i]);
  }
  Measurements measurements = chooseMeasurements(std::move(file), options.input.options, "liestat mean");
  measurements.notes.push_back("phase " + std::to_string(phase.number) + ", " + phase.name + ": " +
                               std::to_string(phase.n) + " of the " + std::to_string(map.rotations.size()) +
                               " points that were indexed; " + std::to_string(map.n_unindexed) + " were not");
  return measurements;
}

/// The options with the robust criterion, whose covariance has no variants.
Options withCriterion(Options options) {
  if (!options.robust) return options;
  const AnalysisOptions& how = options.analysis;
  const char* const other = options.input.options.criterion               ? "--criterion"
                            : how.inflate                                 ? "--inflate"
                            : how.region != MeanRegion::law               ? "--region"
                            : how.weights_are != ResidualNoise::precision ? "--weights-are"
                            : how.birge                                   ? "--birge"
                            : how.refuted_noise != RefutedNoise::withheld ? "--refuted"
                                                                          : nullptr;
  if (other != nullptr) {
    throw OptionError("liestat mean", std::string("--robust with ") + other, "--robust without it");
  }
  options.input.options.criterion = options.robust;
  return options;
}

int runCommand(const Options& given, const Invocation& invocation) {
  const Options options = withCriterion(given);
  const bool with_state = !options.states.state.empty();
  if (!with_state && !options.states.after.empty()) {
    throw OptionError("liestat mean", "--after without --state", "--state OUT, where the sums go");
  }
  const bool stream = !with_state && options.streams();
  if (const char* const option = options.needsMemory(); option != nullptr && (with_state || stream)) {
    throw OptionError("liestat mean", std::string(option) + " needs the measurements in memory",
                      with_state ? "no --state" : "--memory with more GB than the file has");
  }
  if (with_state) return writeState(options.input, options.states, options.json, invocation);
  if (stream) return streamMean(options.input, options.json, invocation);
  AnalysisOptions how = options.analysis;
  std::string symmetry = options.symmetry;
  HexagonalAxes axes = options.axes.value_or(HexagonalAxes::x_along_a);
  const bool is_map = isEbsdName(options.input.file);
  if (!options.phase.empty() && !is_map) {
    throw OptionError("liestat mean", "--phase with a file that is no map", "a file *.ang or *.ctf");
  }
  const Measurements measurements = is_map ? readMap(options, symmetry, axes) : options.input.read("liestat mean");
  const bool residuals = how.refuted_noise == RefutedNoise::residuals;
  if ((how.birge || residuals) && !measurements.known_noise) {
    throw OptionError(
        "liestat mean",
        how.birge ? "--birge without the measurements' noise" : "--refuted residuals without the measurements' noise",
        "covariances in the file (columns cov_00 ...) that the mean uses");
  }
  if (measurements.feature == Feature::heading && !options.report.empty()) {
    throw OptionError("liestat mean", "--report shows features in the plane and in space, and headings are a circle");
  }
  if (residuals && measurements.criterion == Criterion::maha) {
    throw OptionError("liestat mean", "--refuted residuals with maha, whose weights are the refuted covariances",
                      "--criterion lsq or wlsq");
  }
  if (how.region == MeanRegion::bootstrap && measurements.known_noise) {
    throw OptionError("liestat mean", "--region bootstrap with the measurements' noise, whose region is chi-squared's",
                      "measurements whose covariances the mean does not use");
  }
  if (!symmetry.empty()) {
    how.symmetry = PointGroup::fromName(symmetry, axes);
    if (!how.symmetry) {
      throw OptionError("liestat mean", "--symmetry " + symmetry + ": no such point group",
                        "1, 2, 222, 3, 32, 4, 422, 6, 622, 23, 432, another of the 32 point groups or a Laue class");
    }
    if (measurements.feature != Feature::rotation) {
      throw OptionError("liestat mean", "--symmetry with " + std::string(info(measurements.feature).plural),
                        "rotations, or --feature rotation to take those of poses");
    }
    if (measurements.criterion == Criterion::maha) {
      throw OptionError("liestat mean", "--symmetry with maha, which orientations of crystals do not have",
                        "--criterion lsq or wlsq");
    }
  }
  how.certify = !options.no_certify;
  how.charts = !options.report.empty();
  Progress progress("searching for other means", 1000);
  how.progress = [&](double fraction) {
    const auto done = static_cast<std::uint64_t>(1000 * fraction);
    if (done > progress.done()) progress.advance(done - progress.done());
  };
  how.stop = experiments::runStopped;
  MeanAnalysis analysis = [&] {
    const StopOnInterrupt watch;
    return analyseMean(measurements, how);
  }();
  progress.finish();
  const bool interrupted = experiments::runStopped();
  if (interrupted) analysis.notes.emplace_back("interrupted: the search for other means did not go on");
  if (how.inflate && !analysis.dependence.tested) {
    throw OptionError("liestat mean", "--inflate, but the dependence of errors on time cannot be tested",
                      "rows with times (a column t), from 20 to 200000, and a mean with a covariance");
  }
  if (how.symmetry) {
    analysis.symmetry_in_words =
        symmetryInWords(*how.symmetry, symmetry, axes == HexagonalAxes::x_along_a ? "a" : "a*");
  }
  publishResult(options.json, formatMean(options.input.file, measurements, analysis), invocation.command_line,
                std::nullopt, [&](JsonObject& object) {
                  if (interrupted) object("interrupted", true);
                  object("file", options.input.file).fieldsOf(measurements.file).fieldsOf<MeanSummary>(analysis);
                });
  if (!options.report.empty()) {
    writeMeanReport(options.report, invocation.command_line, options.input.file, measurements, analysis);
  }
  if (interrupted) return exit_interrupted;
  return analysis.trusted() ? exit_fine : exit_not_trusted;
}

}  // namespace

MeanAnalysis analyseMean(const Measurements& measurements, const AnalysisOptions& options) {
  MeanAnalysis analysis = estimateMean(measurements, options);
  analysis.notes = measurements.notes;
  addMeanNotes(analysis, measurements.size());
  return analysis;
}

void addMeanCommand(const CommandList& app) {
  auto options = std::make_shared<Options>();
  const Command command = app.add("mean", "Mean, covariance, dispersion and uniqueness of the features in a file");
  options->input.declare(command, true);
  command.flag("--no-certify", options->no_certify, "Do without branch and bound where cheap certificates fail");
  command
      .option("--budget", options->analysis.budget,
              "Looks of branch and bound at measurements or bins of them, some 30 ns each (default 100000000)")
      .range(std::size_t{1}, std::size_t{1000000000000});
  command.option("--symmetry", options->symmetry,
                 "Rotations are orientations of crystals of this point group or Laue class (432, m-3m, 6/mmm ...)");
  command.choice<HexagonalAxes>(
      "--hexagonal-axes", options->axes, {{"a", HexagonalAxes::x_along_a}, {"a*", HexagonalAxes::x_along_a_star}},
      "What the x axis of hexagonal and trigonal crystals is along: a (default; .ang) or a* (.ctf)");
  command.option("--phase", options->phase, "The phase of a map (*.ang, *.ctf) of several: its number or name");
  command.choice("--weights-are", options->analysis.weights_are,
                 {{"precision", ResidualNoise::precision},
                  {"importance", ResidualNoise::importance},
                  {"frequency", ResidualNoise::frequency}},
                 "Meaning of the weights: precision (inverse variances, default), importance or frequency (counts)");
  command.choice<Criterion>("--robust", options->robust, {{"huber", Criterion::huber}, {"median", Criterion::median}},
                            "Huber's mean or the geodesic median, which outliers do not break");
  command.choice(
      "--region", options->analysis.region, {{"law", MeanRegion::law}, {"bootstrap", MeanRegion::bootstrap}},
      "The region of a covariance from residuals: Hotelling's law (default), or widened by a bootstrap where "
      "the noise is skewed");
  command.choice("--refuted", options->analysis.refuted_noise,
                 {{"withheld", RefutedNoise::withheld}, {"residuals", RefutedNoise::residuals}},
                 "The covariance where the scatter refutes the file's: withheld (default) or from the residuals");
  command.flag("--birge", options->analysis.birge,
               "Multiply the covariance by Birge's factor where the measurements scatter more than the file's say");
  command.flag("--inflate", options->analysis.inflate,
               "Widen the covariance by the dependence of the rows' errors on time");
  command
      .option(
          "--memory", options->memory,
          "GB of a file (.npy, or a text that is not compressed) beyond which it is not taken into memory (default 1)")
      .notNegative();
  command.option("--state", options->states.state,
                 "Write a state that liestat merge takes, of one pass over rotations or directions");
  command.option("--after", options->states.after, "The merged state of the pass before, at whose mean sums are taken");
  command.option("--largest-weight", options->states.largest_weight, "Weights of a state are at most this (default 1)")
      .positive();
  command.option("--threads", options->analysis.threads, "Threads (default: all)").range(0, 4096);
  command.option("--json", options->json, "Write the result to a JSON file ('-': standard output)");
  command.option("--report", options->report, "Write a page with plots into this directory");
  command.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
