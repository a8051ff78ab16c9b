#include <cli/commands/validation_command.hpp>
#include <experiments/robust_validation.hpp>
#include <report/table.hpp>

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

std::string percent(double share) { return std::isnan(share) ? "" : fmt::format("{:.1f}", 100 * share); }

/// The names of the scores, for narrow columns.
const char* shortName(RobustScore score) {
  constexpr const char* names[] = {"relevance", "truncated", "count", "quantile"};
  return names[static_cast<std::size_t>(score)];
}

// In per cent: share of outliers, trials that found the structure, inliers and outliers among the estimate's inliers,
// coverage of the 95 % region.
const Columns<RobustRow> search_columns{
    {"out %", [](const RobustRow& row) { return fmt::format("{:g}", 100 * row.outliers); }},
    {"score", [](const RobustRow& row) { return shortName(row.score); }},
    {"found", [](const RobustRow& r) { return percent(static_cast<double>(r.found) / static_cast<double>(r.trials)); }},
    {"draws", &RobustRow::draws, fixed(0)},
    {"needed", &RobustRow::needed},
    {"right %", [](const RobustRow& row) { return percent(row.right); }},
    {"wrong %", [](const RobustRow& row) { return percent(row.wrong); }},
    {"index", Judged::index, 3},
    {"95 %", [](const RobustRow& row) { return percent(row.report.coverage[2].observed); }},
    {"verdict", [](const RobustRow& row) { return verdictCell(row.answer()); }}};

const Columns<ThresholdRow> threshold_columns{
    {"outliers %", [](const ThresholdRow& row) { return fmt::format("{:g}", 100 * row.outliers); }},
    {"histogram %", [](const ThresholdRow& row) { return percent(row.histogram_found); }},
    {"mean", &ThresholdRow::histogram_mean, 3},
    {"sd", &ThresholdRow::histogram_sd, 2},
    {"moments %", [](const ThresholdRow& row) { return percent(row.moments_found); }},
    {"median", &ThresholdRow::moments_median, 3},
    {"one in ten below", &ThresholdRow::moments_tenth, 3}};

ValidationTable searchTable(const RobustValidationResult& result, RobustStructure structure) {
  const auto rows = selected(result.rows, [&](const RobustRow& row) { return row.structure == structure; });
  ValidationTable table{.table = tablesOf(search_columns, rows)};
  if (rows.empty()) return table;
  const RobustRow& last = rows.back();
  table.title = fmt::format("{}: index {} expected, distances over {:.3f} (cut errors)",
                            structure == RobustStructure::conic ? "Conic, samples of 5" : "Homography, samples of 4",
                            last.report.dof, last.cut_factor);
  table.plots = {histogramPlot(
      "distances_" + name(structure), rows,
      [](const RobustRow& row) { return fmt::format("{:g} %, {}", 100 * row.outliers, name(row.score)); },
      "Squared distances of the truth with the density that they should have.")};
  return table;
}

Plot curvesPlot(const std::string& name, const std::string& caption, Axis x, Axis y,
                const std::vector<FigureCurve>& curves) {
  Panel panel{.x = std::move(x), .y = std::move(y)};
  for (std::size_t k = 0; k < curves.size(); ++k) {
    Series series = seriesOf(curves[k].name, Style::lines, k);
    series.x = curves[k].x, series.y = curves[k].y;
    panel.series.push_back(series);
  }
  return {.name = name, .caption = caption, .panels = {panel}};
}

const Columns<StewartRow> stewart_columns_shown{{"score", &StewartRow::score},
                                                {"outliers", &StewartRow::e0, fixed(1)},
                                                {"first mode", &StewartRow::e1, fixed(1)},
                                                {"distance", &StewartRow::delta, fixed(0)},
                                                {"bias", &StewartRow::mean, fixed(2)},
                                                {"sd", &StewartRow::deviation, fixed(2)},
                                                {"printed", &StewartRow::printed}};

/// Figures 7, 8, 9 and 18 of the report, on the page alone.
void addFigures(ValidationView& view, const VievilleFigures& figures) {
  if (figures.densities.empty()) return;
  ValidationTable table{.title = "Figures of Viéville, Lingrand and Gaspard, INRIA RR-4050, 2000",
                        .table = {{}, tableOf(stewart_columns_shown, figures.biases, ShownOn::page)}};
  table.above = {
      curvesPlot("figure_7",
                 "Figure 7: densities of the errors |x - v| under Stewart's distribution, a fifth of outliers, four "
                 "fifths of the others at 10 and the rest at 20. The true value, v = 10, has the sharpest curve.",
                 {"|x - v|"}, {"density"}, figures.densities),
      curvesPlot(
          "figure_9",
          "Figure 9: the best relevance over the draws, of a conic on 40 of 100 points. It rises seldom, and by a "
          "jump where the first sample of good points is drawn; local optimisation of each new best saves most "
          "of the draws.",
          {.label = "draws", .low = 0.0}, {.label = "best relevance"}, figures.relevance),
      curvesPlot(
          "figure_18",
          "Figure 18: the exact F test's factor, by the degrees of freedom d' of the general model, of which the "
          "specific one has one more, and that of the report's code, which exchanges the degrees of freedom of F.",
          {"d'"}, {.label = "Phi_P(d' + 1, d')", .low = 0.0}, figures.phi)};
  table.page_caption =
      "Figure 8: biases of relevance R, of a count of inliers S_A and of a trimmed quantile S_B on Stewart's "
      "distribution, 50 samples of 1000. The printed ones are of one sample each, among candidates up to the second "
      "mode.";
  view.tables.push_back(std::move(table));
}

ValidationView viewOf(const RobustValidationResult& result) {
  ValidationView view{
      .title = "Robust search: is the structure found, and is the covariance of what is found true?",
      .introduction =
          "Each trial draws measurements of a structure among outliers and searches until, with the confidence that "
          "was asked for, one of the draws was of inliers alone. The structure counts as found where nine tenths of "
          "its measurements are inliers of the refined estimate. Of these trials the squared Mahalanobis distance of "
          "the truth follows a chi-square law if the covariance is true.",
      .judgement = judgementOf(result),
      .fields = [&result](JsonObject& object) { object.fieldsOf(result); }};
  for (const RobustStructure structure : all_robust_structures) view.tables.push_back(searchTable(result, structure));
  view.tables.push_back({.title = "Thresholds found in the errors (% of the trials), in standard deviations",
                         .table = tablesOf(threshold_columns, result.thresholds),
                         .page_caption = "Of the conic. The moments of normal errors give 4.42."});
  addFigures(view, result.figures);
  return view;
}

}  // namespace

void addValidateRobustCommand(const CommandList& validate) {
  auto options = std::make_shared<ValidationOptions<RobustValidation>>();
  const Command app = validate.add(
      "robust", "Robust search among outliers: is the structure found, and is the covariance of what is found true?");
  declareNames(app, "--structure", options->names, all_robust_structures,
               "conic, homography: a comma list (default: both)");
  declareNames(app, "--score", options->more_names, all_robust_scores,
               "relevance, truncated_cost, inlier_count, trimmed_quantile: a comma list (default: all)");
  app.option("--outliers", options->validation.outliers,
             "Shares of wrong measurements, a comma list (default 0,0.3,0.5,0.7)")
      .list()
      .range(0.0, 0.9);
  app.option("--measurements", options->validation.measurements, "Measurements of a trial (default 100)")
      .range(std::size_t{20}, std::size_t{100000});
  app.option("--confidence", options->validation.confidence,
             "Probability with which one of the draws is of inliers alone (default 0.99)")
      .range(0.1, 0.999999);
  app.option("--draws", options->validation.draw_factor, "So many times the draws that this takes (default 1)")
      .range(0.01, 1000.0);
  app.option("--noise-factor", options->validation.noise_factor,
             "Standard deviation of the noise over what the search is told (default 1)")
      .range(0.01, 100.0);
  app.flag("--full", options->run.full, "2000 trials a row");
  options->run.declare(app, "100, with --full 2000");
  const auto compute = [](const auto& given, const RunProgress& progress) {
    RobustValidation validation = given.validation;
    validation.structures = chosen(all_robust_structures, given.names);
    validation.scores = chosen(all_robust_scores, given.more_names);
    validation.figures = !given.run.report.empty();
    validation.run = given.run.size(100, 2000);
    return validateRobust(validation, progress);
  };
  runValidation(app, options, "validate robust", compute, viewOf);
}

}  // namespace liestat::cli
