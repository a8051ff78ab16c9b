#include <cli/commands/commands.hpp>
#include <cli/commands/reading_options.hpp>
#include <cli/show/fit.hpp>
#include <formats/features.hpp>
#include <formats/input_error.hpp>
#include <formats/numeric_table.hpp>
#include <report/publish.hpp>
#include <stats/fit_summary.hpp>

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {
namespace {

struct Options {
  std::string file, json, report;
  std::optional<FitModel> model;
  std::optional<LawModel> law;
  ReadingOptions reading;
  std::optional<double> sigma;
  bool birge = false;
};

Feature featureOf(LawModel law) {
  return parametersOf(law) == 2 ? Feature::heading : parametersOf(law) == 3 ? Feature::direction : Feature::rotation;
}

int fitFeatures(const Options& options, const Invocation& invocation) {
  const LawModel law = *options.law;
  if (options.sigma || options.birge) {
    throw OptionError("liestat fit", "--law with --sigma or --birge, which are about points of a curve", "--law alone");
  }
  const FeatureFile file = readFeatureFile(options.file, options.reading);
  const FeatureInfo& wanted = info(featureOf(law));
  if (file.kind != wanted.kind) {
    throw OptionError("liestat fit",
                      "--law " + std::string(name(law)) + " with a file of " + std::string(info(file.kind).plural),
                      "a file of " + std::string(wanted.plural));
  }
  LawOutput output{.file = options.file, .fit = {}};
  switch (parametersOf(law)) {
    case 2:
      output.fit = fitLaw(law, featuresOf<SO2d>(file));
      break;
    case 3:
      output.fit = fitLaw(law, featuresOf<S2d>(file));
      break;
    default:
      output.fit = fitLaw(law, featuresOf<SO3d>(file));
  }
  publishResult(options.json, formatLaw(output), invocation.command_line, std::nullopt, output);
  if (!options.report.empty()) writeLawReport(options.report, invocation.command_line, output);
  return output.fit.verdict().isNo() ? exit_not_trusted : exit_fine;
}

int runCommand(const Options& options, const Invocation& invocation) {
  if (options.law.has_value() == options.model.has_value()) {
    throw OptionError("liestat fit", options.law ? "--model and --law" : "neither --model nor --law", "one of them");
  }
  if (options.law) return fitFeatures(options, invocation);
  const std::vector<std::string> columns = coordinateNames(*options.model);
  const NumericTable table = readTable(options.file, columns);
  FitOutput output{.file = table.file(), .points = {}, .fit = {}};
  output.points.resize(static_cast<Eigen::Index>(table.rows()), static_cast<Eigen::Index>(columns.size()));
  for (std::size_t i = 0; i < table.rows(); ++i) {
    for (std::size_t k = 0; k < columns.size(); ++k) {
      output.points(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = table(i, table.column(columns[k]));
    }
  }
  FitOptions how;
  if (options.birge) how.noise = StatedNoise::scaled;
  output.fit = summarizedFit(*options.model, output.points, options.sigma, how);
  publishResult(options.json, formatFit(output), invocation.command_line, std::nullopt, output);
  if (!options.report.empty()) writeFitReport(options.report, invocation.command_line, output);
  return output.fit.verdict().isNo() ? exit_not_trusted : exit_fine;
}

}  // namespace

void addFitCommand(const CommandList& program) {
  auto options = std::make_shared<Options>();
  const Command command = program.add(
      "fit", "A curve, a surface or a map between images through noisy points, or a law of directions or rotations");
  command
      .option("file", options->file,
              "CSV with the columns x,y, of a surface or line3 x,y,z, of a map x1,y1,x2,y2; of --law features as of "
              "mean; '-' is "
              "standard input")
      .required();
  command.choice(
      "--model", options->model,
      "circle, ellipse, conic, line (of the plane), sphere, plane, line3 (of space), homography, fundamental");
  command.choice("--law", options->law,
                 "vmf, bingham (directions, axes), von-mises (headings), matrix-fisher, wrapped-normal (rotations)");
  command.option("--sigma", options->sigma, "Standard deviation of every coordinate (default: that of the residuals)")
      .positive();
  command.flag("--birge", options->birge,
               "Multiply the covariance by Birge's factor where the points scatter more than sigma says");
  declareReading(command, options->reading);
  command.option("--json", options->json, "Write the result to a JSON file ('-': standard output)");
  command.option("--report", options->report, "Directory for a page with the curve, distances and the covariance");
  command.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
