#include <cli/commands/commands.hpp>
#include <cli/show/fit.hpp>
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
  FitModel model = FitModel::line;
  std::optional<double> sigma;
  bool birge = false;
};

int runCommand(const Options& options, const Invocation& invocation) {
  const std::vector<std::string> columns = coordinateNames(options.model);
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
  output.fit = summarizedFit(options.model, output.points, options.sigma, how);
  publishResult(options.json, formatFit(output), invocation.command_line, std::nullopt, output);
  if (!options.report.empty()) writeFitReport(options.report, invocation.command_line, output);
  return output.fit.verdict().isNo() ? exit_not_trusted : exit_fine;
}

}  // namespace

void addFitCommand(const CommandList& program) {
  auto options = std::make_shared<Options>();
  const Command command =
      program.add("fit", "A curve, a surface or a map between images through noisy points, with its covariance");
  command
      .option("file", options->file,
              "CSV with the columns x,y, of a surface or line3 x,y,z, of a map x1,y1,x2,y2; '-' is standard input")
      .required();
  command
      .choice("--model", options->model,
              "circle, ellipse, conic, line (of the plane), sphere, plane, line3 (of space), homography, fundamental")
      .required();
  command.option("--sigma", options->sigma, "Standard deviation of every coordinate (default: that of the residuals)")
      .positive();
  command.flag("--birge", options->birge,
               "Multiply the covariance by Birge's factor where the points scatter more than sigma says");
  command.option("--json", options->json, "Write the result to a JSON file ('-': standard output)");
  command.option("--report", options->report, "Directory for a page with the curve, distances and the covariance");
  command.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
