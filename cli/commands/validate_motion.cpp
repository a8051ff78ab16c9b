#include <cli/commands/validation_command.hpp>
#include <experiments/motion_validation.hpp>
#include <report/table.hpp>

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

std::string titleOf(MotionMethod method) {
  constexpr const char* names[] = {"Subspace filter, 32 starts, midpoint flow",
                                   "Subspace filter, one start anywhere",
                                   "Subspace filter, the report's forward difference",
                                   "Subspace filter, discrete flow without a gyroscope",
                                   "Subspace filter, covariance without second derivatives",
                                   "Subspace filter, depths of either sign",
                                   "Subspace filter, one start 10 degrees off",
                                   "Search over 300 directions (Heeger and Jepson)",
                                   "Essential filter, 32 starts",
                                   "Essential filter, start 30 % off",
                                   "Composition: subspace filter, then essential filter",
                                   "Subspace filter, pairs of up to six frames (orbit) or four",
                                   "Subspace filter with a gyroscope",
                                   "Subspace filter with a gyroscope, its bias a state",
                                   "Subspace filter with a gyroscope among outliers",
                                   "Essential filter with a gyroscope, its bias a state",
                                   "Composition, misled: which frames does it call usable?"};
  return names[static_cast<std::size_t>(method)];
}

std::string degrees(double value) { return fmt::format("{:.{}f}", value, value < 9.995 ? 2 : 1); }
double successes(const MotionRow& row, std::size_t k) {
  return static_cast<double>(row.successes[k]) / static_cast<double>(row.trials);
}
template <std::size_t k>
std::string atFrame(const MotionRow& row) {
  return fmt::format("{:3.0f} {:>5}", 100 * successes(row, k), degrees(row.median[k]));
}
bool hasCovariance(const MotionRow& row) { return std::isfinite(row.consistency.back()); }
const Columns<MotionRow> columns{
    {"scene", sceneOf},
    {"px", [](const MotionRow& row) { return fmt::format("{:g}", row.scene.sigma); }},
    {"20: % deg", atFrame<0>},
    {"50: % deg", atFrame<1>},
    {"100: % deg", atFrame<2>},
    {"xPx/2", [](const MotionRow& r) { return hasCovariance(r) ? fmt::format("{:.2f}", r.consistency.back()) : ""; }},
    {"95 %", [](const MotionRow& r) { return hasCovariance(r) ? fmt::format("{:.1f}", 100 * r.coverage) : ""; }},
    {"verdict", [](const MotionRow& row) { return verdictCell(row.passed); }}};

/// A share of the frames in percent, with its standard error.
std::string percent(double mean, double error) { return fmt::format("{:.2f} +- {:.2f}", 100 * mean, 100 * error); }
const Columns<MotionRow> upset_columns{
    {"scene", sceneOf},
    {"usable %", [](const MotionRow& row) { return percent(row.usable_frames, row.usable_error); }},
    {"usable, > 10 deg %", [](const MotionRow& row) { return percent(row.wrong_frames, row.wrong_error); }},
    {"at most", [](const MotionRow& r) { return r.promise ? fmt::format("{:g}", 100 * r.promise->wrong_frames) : ""; }},
    {"verdict", [](const MotionRow& row) { return verdictCell(row.passed); }}};

ValidationTable tableOf(const std::vector<MotionRow>& rows, MotionMethod method) {
  const auto own = selected(rows, [&](const MotionRow& row) { return row.method == method; });
  ValidationTable table{.title = titleOf(method),
                        .table = tablesOf(method == MotionMethod::upset ? upset_columns : columns, own)};
  if (method == MotionMethod::upset) return table;
  Panel success{
      "errors below 10 degrees", {.label = "frame", .low = 0.0}, {.label = "share", .low = 0.0, .high = 1.05}};
  Panel median{"median error", {.label = "frame", .low = 0.0}, {.label = "degrees", .logarithmic = true}};
  for (const MotionRow& row : own) {
    Series share{.name = fmt::format("{}, {:g} px", sceneOf(row), row.scene.sigma), .style = Style::linespoints};
    Series error = share;
    for (std::size_t k = 0; k < motion_frames.size(); ++k) {
      share.add(motion_frames[k], successes(row, k)), error.add(motion_frames[k], row.median[k]);
    }
    success.series.push_back(share), median.series.push_back(error);
  }
  table.plots = {{.name = name(method), .caption = "", .panels = {success, median}}};
  return table;
}

ValidationView viewOf(const std::vector<MotionRow>& rows) {
  ValidationView view{
      .title = "Recursive motion: is the direction found, how well, and is its covariance true?",
      .introduction =
          "Each trial moves a camera among points for 100 frames and runs a filter over their tracks. A run is a "
          "success where the direction of translation is off by less than 10 degrees. Where the covariance is right, "
          "half of the squared error in its units is 1 on average, and 95 % of the errors are in its 95 % region; "
          "below 1 it is an upper bound.",
      .judgement = judgementOf(rows),
      .fields = [&rows](JsonObject& object) { object("rows", rows); },
      .legend = fmt::format("\nSuccess: errors below {:g} degrees (%); median error (deg); at frames 20, 50, 100.\n"
                            "xPx/2: squared errors of the successes in units of their covariance, at most 1.\n",
                            motion_success)};
  for (const MotionMethod method : all_motion_methods) view.tables.push_back(tableOf(rows, method));
  return view;
}

}  // namespace

void addValidateMotionCommand(const CommandList& validate) {
  auto options = std::make_shared<ValidationOptions<MotionValidation>>();
  const Command app = validate.add(
      "motion", "Recursive motion from tracks: is the direction found, how well, and is its covariance true?");
  declareNames(app, "--method", options->names, all_motion_methods,
               "subspace, essential, composition, gyroscope …: a comma list (default: all; docs/validation.md)");
  app.option("--noise-factor", options->validation.noise_factor,
             "Standard deviation of the noise over what the filters are told (default 1)")
      .range(0.01, 100.0);
  app.flag("--full", options->run.full, "2000 trials a row");
  options->run.declare(app, "300, with --full 2000");
  const auto compute = [](const auto& given, const RunProgress& progress) {
    MotionValidation validation = given.validation;
    validation.methods = chosen(all_motion_methods, given.names);
    validation.run = given.run.size(300, 2000);
    return validateMotion(validation, progress);
  };
  runValidation(app, options, "validate motion", compute, viewOf);
}

}  // namespace liestat::cli
