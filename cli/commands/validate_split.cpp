#include <cli/commands/commands.hpp>
#include <cli/io/input_error.hpp>
#include <cli/show/json.hpp>
#include <cli/show/mean.hpp>
#include <cli/commands/measures_options.hpp>
#include <cli/show/progress.hpp>
#include <cli/show/page.hpp>
#include <cli/split.hpp>
#include <cli/io/stereo.hpp>
#include <cli/show/table.hpp>
#include <cli/io/tracks.hpp>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>

namespace liestat::cli {
namespace {

constexpr const char* command_name = "liestat validate split";

struct Options {
  MeasuresInput input;
  SplitOptions split;
  std::string stereo, json, report;
};

/// What the program did, whatever the input was.
struct Outcome {
  std::string source, description;
  Feature feature = Feature::point;
  SplitSeries random, by_blocks;
  bool known_noise = true;

  bool passed() const { return !(by_blocks.pValue() < split_false_alarm); }
};

/// One object of a stereo track set.
struct LandmarkSplit {
  std::size_t track = 0;
  SplitResult split;
  MeanAnalysis whole;
  std::optional<Eigen::Vector3d> survey = {};

  double surveyDistance() const {
    return survey ? (*whole.mean.point - *survey).norm() : std::numeric_limits<double>::quiet_NaN();
  }
  double squaredSurveyDistance() const {
    if (!survey || whole.covariance.rows() != 3) return std::numeric_limits<double>::quiet_NaN();
    const Eigen::Vector3d d = *whole.mean.point - *survey;
    return d.dot(Eigen::Matrix3d(whole.covariance).llt().solve(d));
  }
};

std::string seriesInWords(const char* what, const SplitSeries& s) {
  return fmt::format("{:<22} index {} (expected {} +- {}), p = {}\n", what, number(s.index), number(s.dof),
                     number(s.standardError(), 2), number(s.pValue(), 2));
}

std::string verdict(const Outcome& outcome, const SplitOptions& options) {
  const SplitSeries& blocks = outcome.by_blocks;
  std::string text = seriesInWords("halves at random", outcome.random);
  text += seriesInWords(fmt::format("halves of {} blocks", options.blocks).c_str(), blocks);
  const std::size_t failures = outcome.random.failures + blocks.failures;
  if (failures > 0) text += fmt::format("{} splits had no estimate and are left out.\n", failures);
  text += "\n";
  const bool random_fails = outcome.random.pValue() < split_false_alarm;
  if (random_fails) {
    text += fmt::format(
        "Already at random the halves differ by {} times the expected squared distance: the measures "
        "scatter more than their covariances say.\n",
        number(outcome.random.factor(), 3));
  }
  if (outcome.passed()) {
    text += fmt::format(
        "PASS: halves made of blocks of time agree as well as their covariances say (factor {}, 95 %: {} to {}). "
        "Nothing speaks against independent errors.\n",
        number(blocks.factor(), 3), number(blocks.factorLow(), 3), number(blocks.factorHigh(), 3));
  } else {
    text += fmt::format(
        "FAIL: halves made of blocks of time differ by {} times the expected squared distance{}. The errors of "
        "successive measures are not independent: multiply the covariance of the mean by {} (95 %: {} to {}), its "
        "standard deviations by {}; by more if the errors hold on for longer than a block.\n",
        number(blocks.factor(), 3), random_fails ? "" : ", which halves at random do not show",
        number(blocks.factor(), 3), number(blocks.factorLow(), 3), number(blocks.factorHigh(), 3),
        number(std::sqrt(blocks.factor()), 3));
  }
  return text;
}

JsonObject toJson(const SplitSeries& s) {
  JsonObject o;
  o.set("splits", s.distances.size()).set("failures", s.failures).set("index", s.index).set("index_expected", s.dof);
  o.set("index_se", s.standardError()).set("effective_dof", s.effective_dof).set("p", s.pValue());
  o.set("factor", s.factor()).set("factor_low", s.factorLow()).set("factor_high", s.factorHigh());
  return o;
}

JsonObject toJson(const HalfMean& half, Feature feature) {
  JsonObject o;
  o.set("n", half.n).set("mean", toJson(half.mean));
  if (half.covariance.size() > 0) {
    o.set("covariance", half.covariance).set("standard_deviations", standardDeviations(feature, half.covariance));
  } else {
    o.set("covariance", nullptr).set("standard_deviations", nullptr);
  }
  return o;
}

/// The fields that every input has.
JsonObject envelope(const Outcome& outcome, const Options& options, const Invocation& invocation) {
  JsonObject o = jsonEnvelope(invocation.command_line, options.split.seed);
  o.set("file", outcome.source).set("feature", name(outcome.feature)).set("dof", degreesOfFreedom(outcome.feature));
  o.set("known_noise", outcome.known_noise).set("splits", options.split.splits).set("blocks", options.split.blocks);
  o.set("random", toJson(outcome.random)).set("by_blocks", toJson(outcome.by_blocks));
  o.set("inflation", outcome.by_blocks.factor()).set("inflation_low", outcome.by_blocks.factorLow());
  o.set("inflation_high", outcome.by_blocks.factorHigh());
  o.set("false_alarm", split_false_alarm).set("passed", outcome.passed());
  return o;
}

/// Both distributions of the squared distances, each with its own axis as they may differ by orders of magnitude.
void plotSplits(Report& report, const Outcome& outcome) {
  const auto panel = [&](const char* title, const SplitSeries& s) {
    double high = 0;
    for (const double d : s.distances) high = std::max(high, std::isfinite(d) ? d : 0);
    if (!(high > 0)) high = 1;
    Series boxes = histogram("splits", s.distances, 0, high, 30, true);
    Panel p{.title = title,
            .x = {.label = "squared distance of the halves", .low = 0.0},
            .y = {.label = "density", .low = 0.0},
            .series = {boxes}};
    p.references = {{.direction = ReferenceLine::Direction::vertical, .at = s.dof}};
    return p;
  };
  report.plot(
      {.name = "splits",
       .caption = "Squared distances of the two halves' means under both covariances, over the splits; the line "
                  "is what is expected on average.",
       .panels = {panel("Halves at random", outcome.random), panel("Halves of blocks of time", outcome.by_blocks)}});
}

std::vector<std::string> halfRow(const char* what, const HalfMean& half, Feature feature) {
  std::string sd;
  for (const TangentPart& part : tangentParts(feature)) {
    if (half.covariance.size() == 0) continue;
    const Eigen::VectorXd variances = half.covariance.diagonal().segment(part.begin, part.size);
    sd += fmt::format("{}{} {}", sd.empty() ? "" : ", ", number(part.scale() * std::sqrt(variances.maxCoeff()), 3),
                      part.unit());
  }
  return {what, fmt::format("{}", half.n), oneLine(half.mean), sd.empty() ? "none" : sd};
}

int splitFile(const Options& options, const Invocation& invocation) {
  const Measures measures = options.input.read(command_name);
  const std::size_t fewest = fewestMeasures(measures, options.split);
  if (measures.size() < fewest) {
    throw InputError(options.input.file, 0, fmt::format("{} measures, too few to be split", measures.size()),
                     fmt::format("{} at least (--blocks is {})", fewest, options.split.blocks));
  }
  SplitResult result;
  {
    Progress bar("validate split", 2 * options.split.splits);
    result = splitMeasures(measures, options.split, [&bar] { bar.advance(); });
  }
  const Outcome outcome{.source = options.input.file,
                        .description = measuresInWords(options.input.file, measures),
                        .feature = measures.feature,
                        .random = result.random,
                        .by_blocks = result.by_blocks,
                        .known_noise = measures.known_noise};
  std::string text = outcome.description + "\n";
  text += fmt::format("means by {}, covariances from {}\n\n", name(measures.criterion),
                      measures.known_noise ? "the measures' own" : "the residuals");
  const std::vector<std::vector<std::string>> halves{halfRow("first half", result.first, measures.feature),
                                                     halfRow("second half", result.second, measures.feature),
                                                     halfRow("merged", result.merged, measures.feature)};
  for (const auto& row : halves) text += fmt::format("{:<12} {} (largest sd {})\n", row[0], row[2], row[3]);
  text += fmt::format("squared distance of both halves {} ({}, p = {})\n\n", number(result.squared_distance),
                      result.law, number(result.p_value, 2));
  text += verdict(outcome, options.split);
  for (const std::string& note : measures.notes) text += "note: " + note + "\n";
  if (options.json != "-") std::fputs(text.c_str(), stdout);

  if (!options.json.empty()) {
    JsonObject object = envelope(outcome, options, invocation);
    object.set("n", result.n).set("criterion", name(measures.criterion));
    if (measures.covariance_at_matters) {
      object.set("covariance_at", measures.covariance_at == CovarianceAt::measured ? "measured" : "estimated");
    } else {
      object.set("covariance_at", nullptr);
    }
    setCovarianceWords(object, measures.feature);
    object.set("first", toJson(result.first, measures.feature)).set("second", toJson(result.second, measures.feature));
    object.set("merged", toJson(result.merged, measures.feature));
    object.set("squared_distance", result.squared_distance).set("law", result.law).set("p", result.p_value);
    writeJson(options.json, object);
  }
  if (!options.report.empty()) {
    Report report(options.report, "Split of the measures in " + options.input.file);
    report.paragraph(outcome.description + ".");
    report.code(invocation.command_line);
    report.code(text);
    report.table({"", "n", "mean", "largest standard deviations"}, halves, "Halves in time, and both merged.");
    plotSplits(report, outcome);
    report.write();
  }
  return outcome.passed() ? exit_fine : exit_validation_failed;
}

/// The measures of one landmark as a file would have them.
Measures measuresOf(const LandmarkMeasures& landmark, const MeasuresOptions& options) {
  FeatureFile file;
  file.kind = Feature::point;
  file.format = "stereo";
  for (std::size_t i = 0; i < landmark.points.size(); ++i) {
    file.vectors.push_back(landmark.points[i].mean);
    file.covariances.emplace_back(landmark.points[i].covariance);
    file.times.push_back(landmark.times[i]);
    file.lines.push_back(landmark.frames[i]);
  }
  return chooseMeasures(std::move(file), options, command_name);
}

int splitStereo(const Options& options, const Invocation& invocation) {
  const std::string& prefix = options.stereo;
  const StereoCamera camera = readStereoCamera(prefix + "_camera.csv");
  if (!camera.pixel_variance) {
    throw InputError(prefix + "_camera.csv", 0, "there are no pixel variances", "the rows y_var0 ... y_var3");
  }
  const std::vector<LandmarkMeasures> landmarks =
      backProject(readStereoTracks(prefix + "_tracks.csv"), readCameraPoses(prefix + "_poses.csv"), camera);
  std::vector<Eigen::Vector3d> survey;
  if (std::filesystem::exists(prefix + "_landmarks.csv")) survey = readLandmarks(prefix + "_landmarks.csv");

  std::vector<LandmarkSplit> rows;
  std::size_t skipped = 0;
  Outcome outcome{.source = prefix, .description = {}, .random = {}, .by_blocks = {}};
  Criterion criterion = Criterion::maha;
  {
    Progress bar("validate split", 2 * options.split.splits * landmarks.size());
    for (const LandmarkMeasures& landmark : landmarks) {
      const Measures measures = measuresOf(landmark, options.input.options);
      criterion = measures.criterion;
      outcome.known_noise = measures.known_noise;
      if (measures.size() < fewestMeasures(measures, options.split)) {
        ++skipped;
        continue;
      }
      AnalysisOptions how;
      how.threads = options.split.threads;
      LandmarkSplit row{.track = landmark.track,
                        .split = splitMeasures(measures, options.split, [&bar] { bar.advance(); }),
                        .whole = analyseMean(measures, how)};
      if (landmark.track < survey.size()) row.survey = survey[landmark.track];
      rows.push_back(std::move(row));
    }
  }
  if (rows.empty()) {
    throw InputError(prefix + "_tracks.csv", 0, "no landmark was seen often enough to be split",
                     fmt::format("{} observations of one", options.split.blocks));
  }
  std::vector<SplitSeries> random, by_blocks;
  std::vector<std::vector<std::string>> cells;
  double squares = 0, mahalanobis = 0;
  for (const LandmarkSplit& row : rows) {
    random.push_back(row.split.random);
    by_blocks.push_back(row.split.by_blocks);
    squares += std::pow(row.surveyDistance(), 2);
    mahalanobis += row.squaredSurveyDistance();
    cells.push_back({fmt::format("{}", row.track), fmt::format("{}", row.split.n), number(row.split.random.index),
                     number(row.split.by_blocks.index), number(row.split.by_blocks.factor()),
                     number(1000 * row.surveyDistance()), number(row.squaredSurveyDistance())});
  }
  outcome.random = pooled(random);
  outcome.by_blocks = pooled(by_blocks);
  const auto count = static_cast<double>(rows.size());
  outcome.description = fmt::format("{}: {} landmarks seen by a stereo camera, {} with too few observations left out",
                                    prefix, rows.size() + skipped, skipped);
  std::string text = outcome.description + "\n";
  text += fmt::format("means by {}, covariances from {}\n\n", name(criterion),
                      outcome.known_noise ? "the stereo geometry and the pixels' variances" : "the residuals");
  const std::vector<std::string> headers{"track", "n", "random", "blocks", "factor", "survey (mm)", "squared distance"};
  Table table(headers);
  for (const auto& row : cells) table.row(row);
  text += table.str() + "\n";
  if (!survey.empty()) {
    text += fmt::format("to the survey: {} mm RMS, mean squared distance {} where 3 is expected\n",
                        number(1000 * std::sqrt(squares / count)), number(mahalanobis / count));
  }
  text += verdict(outcome, options.split);
  if (options.json != "-") std::fputs(text.c_str(), stdout);

  if (!options.json.empty()) {
    JsonObject object = envelope(outcome, options, invocation);
    object.set("criterion", name(criterion)).set("skipped", skipped);
    if (survey.empty()) {
      object.set("survey_rms", nullptr).set("survey_squared_distance", nullptr);
    } else {
      object.set("survey_rms", std::sqrt(squares / count)).set("survey_squared_distance", mahalanobis / count);
    }
    std::vector<JsonObject> list;
    for (const LandmarkSplit& row : rows) {
      JsonObject o;
      o.set("track", row.track).set("n", row.split.n).set("random", row.split.random.index);
      o.set("by_blocks", row.split.by_blocks.index).set("inflation", row.split.by_blocks.factor());
      o.set("mean", *row.whole.mean.point).set("squared_distance", row.split.squared_distance);
      o.set("survey_distance", row.surveyDistance()).set("survey_squared_distance", row.squaredSurveyDistance());
      list.push_back(std::move(o));
    }
    object.set("landmarks", list);
    writeJson(options.json, object);
  }
  if (!options.report.empty()) {
    Report report(options.report, "Split of the landmarks in " + prefix);
    report.paragraph(outcome.description + ".");
    report.code(invocation.command_line);
    report.code(text);
    report.table(headers, cells, "Indices of the splits, and the mean of all measures against the survey.");
    plotSplits(report, outcome);
    report.write();
  }
  return outcome.passed() ? exit_fine : exit_validation_failed;
}

int runCommand(const Options& options, const Invocation& invocation) {
  if (options.stereo.empty() == options.input.file.empty()) {
    throw InputError(command_name, 0, "one input is needed, a FILE or --stereo PREFIX");
  }
  if (options.split.blocks % 2 != 0) throw InputError(command_name, 0, "--blocks must be even");
  return options.stereo.empty() ? splitFile(options, invocation) : splitStereo(options, invocation);
}

}  // namespace

void addValidateSplitCommand(CLI::App& validate, Invocation& invocation) {
  auto options = std::make_shared<Options>();
  CLI::App* command = validate.add_subcommand(
      "split", "Real measures split in two, at random and by blocks of time: do the halves agree?");
  options->input.declare(*command, false);
  command->add_option("--stereo", options->stereo,
                      "Instead of FILE: PREFIX_tracks.csv, _poses.csv, _camera.csv and, if there, _landmarks.csv");
  command->add_option("--splits", options->split.splits, "Splits of each kind (default 200)")
      ->check(CLI::Range(std::size_t{1}, std::size_t{1000000}));
  command->add_option("--blocks", options->split.blocks, "Blocks of time, an even number (default 10)")
      ->check(CLI::Range(std::size_t{2}, std::size_t{1000}));
  command->add_option("--seed", options->split.seed,
                      "Seed; the same seed gives the same bits on any number of threads");
  command->add_option("--threads", options->split.threads, "Threads (default: all)")->check(CLI::Range(0, 4096));
  command->add_option("--json", options->json, "Write the result to a JSON file ('-': standard output)");
  command->add_option("--report", options->report, "Write a page with plots into this directory");
  command->callback(
      [options, &invocation] { invocation.run = [options, &invocation] { return runCommand(*options, invocation); }; });
}

}  // namespace liestat::cli
