#include <cli/commands/validation_command.hpp>
#include <experiments/hand_eye_validation.hpp>
#include <report/table.hpp>
#include <cli/show/units.hpp>

#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

using Row = HandEyeRow;
using Experiment = HandEyeExperiment;

std::string orNothing(double value, int digits = 3) { return std::isnan(value) ? "" : number(value, digits); }
template <double Row::*Angle>
std::string inDegrees(const Row& row) {
  return orNothing(degrees * (row.*Angle));
}
template <double Row::*Length>
std::string inMillimetres(const Row& row) {
  return orNothing(1e3 * (row.*Length));
}
bool hasDistances(const Row& row) { return row.report.index > 0; }
std::string indexOf(const Row& row) { return hasDistances(row) ? number(row.report.index, 3) : ""; }
std::string coverage(const Row& row) {
  return hasDistances(row) ? fmt::format("{:.3f}", row.report.coverage[2].observed) : "";
}
std::string right(const Row& row) { return fmt::format("{}/{}", row.right, row.trials); }
std::string answer(const Row& row) { return verdictCell(row.answer()); }

/// One table: its rows and its columns.
struct Part {
  Experiment experiment;
  bool fit;
  const char* title;
  const char* caption;
  Columns<Row> columns;
};

const Part parts[] = {
    {Experiment::accuracy,
     false,
     "AX = YB: errors of X and its covariance",
     "RMS errors beside a prototype's (note); mean squared distance, 6 expected.",
     {{"noise", noiseName},
      {"n", &Row::pairs},
      {"deg", inDegrees<&Row::rms_rotation>},
      {"note", inDegrees<&Row::note_rotation>},
      {"mm", inMillimetres<&Row::rms_translation>},
      {"note", inMillimetres<&Row::note_translation>},
      {"index", indexOf},
      {"95 %", coverage},
      {"chi2/dof", &Row::chi2_per_dof, 3},
      {"verdict", answer}}},
    {Experiment::accuracy,
     true,
     "AX = YB: squared distance of the poses from the corrected ones",
     "It follows a chi-square law with 6 n - 12 degrees of freedom.",
     {{"noise", noiseName},
      {"n", &Row::pairs},
      {"r", Judged::dof},
      {"mean", Judged::index},
      {"K-S p", Judged::kolmogorov, 2},
      {"verdict", answer}}},
    {Experiment::motions,
     false,
     "Motions: the directions that they leave open",
     "Trials with the right number; index and coverage of the rest, k expected.",
     {{"problem", [](const Row& r) { return r.formulation == HandEyeFormulation::poses ? "AX = YB" : "AX = XB"; }},
      {"motion", [](const Row& row) { return name(row.motion); }},
      {"open", [](const Row& row) { return openDimension(row.motion); }},
      {"right", right},
      {"k", Judged::dof},
      {"index", indexOf},
      {"95 %", coverage},
      {"verdict", answer}}},
    {Experiment::outliers,
     false,
     "Three wrong pairs of ten",
     "Trials in which all were found; right pairs lost, 0.1 % expected.",
     {{"noise", noiseName},
      {"wrong pairs", [](const Row& row) { return name(*row.outliers); }},
      {"found", right},
      {"lost %", [](const Row& row) { return 100 * row.lost; }, fixed(2)},
      {"index", indexOf},
      {"95 %", coverage},
      {"verdict", answer}}},
    {Experiment::formulations,
     false,
     "The same poses as relative motions, for comparison",
     "Pairs that share a pose are correlated, and chi2/dof does not show it.",
     {{"pairs of motions",
       [](const Row& row) {
         return row.formulation == HandEyeFormulation::poses ? "none: AX = YB" : name(row.formulation);
       }},
      {"n", &Row::pairs},
      {"deg", inDegrees<&Row::rms_rotation>},
      {"mm", inMillimetres<&Row::rms_translation>},
      {"index", indexOf},
      {"95 %", coverage},
      {"chi2/dof", &Row::chi2_per_dof, 3}}}};

ValidationTable tableOf(const Part& part, const std::vector<Row>& all) {
  const auto is_of = [&](const Row& row) { return row.experiment == part.experiment && row.fit == part.fit; };
  const auto drawn = selected(all, [&](const Row& row) { return is_of(row) && hasDistances(row); });
  return {.title = part.title,
          .caption = part.caption,
          .table = tablesOf(part.columns, selected(all, is_of)),
          .plots = {histogramPlot(fmt::format("histograms_{}", &part - parts), drawn,
                                  [](const Row& row) { return label(row); })}};
}

ValidationView viewOf(const std::vector<Row>& rows) {
  ValidationView view{
      .title = "Hand-eye calibration: do errors, residuals and open directions follow their laws?",
      .introduction =
          "Each trial draws the poses of a camera on a gripper that looks at a target, with noise in both poses, and "
          "estimates gripper_T_camera from them. The squared Mahalanobis distance of the truth follows a chi-square "
          "law with as many degrees of freedom as the motion determines, that of the poses from the corrected ones a "
          "law with the residual degrees of freedom.",
      .judgement = judgementOf(rows),
      .fields = [&rows](JsonObject& object) { object("rows", rows); }};
  for (const Part& part : parts) view.tables.push_back(tableOf(part, rows));
  return view;
}

}  // namespace

void addValidateHandEyeCommand(const CommandList& validate) {
  auto options = std::make_shared<ValidationOptions<HandEyeValidation>>();
  const Command app = validate.add(
      "hand-eye", "Hand-eye calibration: errors, covariance, open directions of degenerate motions, wrong pairs");
  declareNames(app, "--experiment", options->names, all_hand_eye_experiments,
               "accuracy, motions, outliers, formulations: a comma list (default: all)");
  app.option("--noise-factor", options->validation.noise_factor,
             "Standard deviation of the noise over what the estimator is told (default 1)")
      .range(0.01, 100.0);
  app.flag("--full", options->run.full, "2000 trials a row, and rows with 200 pairs");
  options->run.declare(app, "100, with --full 2000");
  const auto compute = [](const auto& given, const RunProgress& progress) {
    HandEyeValidation validation = given.validation;
    validation.experiments = chosen(all_hand_eye_experiments, given.names);
    validation.run = given.run.size(100, 2000);
    validation.many_pairs = given.run.full;
    return validateHandEye(validation, progress);
  };
  runValidation(app, options, "validate hand-eye", compute, viewOf);
}

}  // namespace liestat::cli
