#include <cli/commands/validation_command.hpp>
#include <experiments/estimator_validation.hpp>
#include <report/table.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

using Row = EstimatorRow;
using Quantity = EstimatorQuantity;

/// A number where there is one.
std::string orNothing(double value, int digits = 4) { return std::isnan(value) ? "" : number(value, digits); }
std::string experimentOf(const Row& row) { return name(row.experiment); }
std::string noted(const Row& row) { return orNothing(row.note_index); }
std::string iterations(const Row& row) {
  return row.has_iterations ? fmt::format("{:.1f}", row.report.mean_iterations) : "";
}

const Columns<Row> criterion_columns{
    {"experiment", experimentOf},     {"sigma", &Row::sigma},        {"r", Judged::dof},
    {"mean", Judged::index},          {"SE", Judged::indexError, 2}, {"note", noted},
    {"K-S p", Judged::kolmogorov, 2}, {"iterations", iterations},    {"verdict", Judged::verdict}};
const Columns<Row> parameter_columns{{"experiment", experimentOf},
                                     {"sigma", &Row::sigma},
                                     {"k", Judged::dof},
                                     {"index", Judged::index},
                                     {"SE", Judged::indexError, 2},
                                     {"note", noted},
                                     {"95 % covers", Judged::covered, fixed(1)},
                                     {"note", [](const Row& row) { return orNothing(100 * row.note_coverage); }},
                                     {"verdict", Judged::verdict}};
const Columns<Row> point_columns{
    {"quantity", [](const Row& row) { return name(row.quantity); }},
    {"k", Judged::dof},
    {"index", Judged::index},
    {"SE", Judged::indexError, 2},
    {"95 % covers", Judged::covered, fixed(1)},
    {"covariance off, %", [](const Row& row) { return orNothing(100 * row.covariance_deviation, 2); }},
    {"verdict", Judged::verdict}};

/// A table: the rows of some quantities.
ValidationTable tableOf(const std::vector<Row>& all, std::vector<Quantity> quantities, const Columns<Row>& columns,
                        const char* title, const char* caption) {
  const auto rows = selected(all, [&](const Row& row) {
    return std::find(quantities.begin(), quantities.end(), row.quantity) != quantities.end();
  });
  return {.title = title,
          .caption = caption,
          .table = tablesOf(columns, rows),
          .plots = {histogramPlot(
              fmt::format("histograms_{}", static_cast<int>(quantities.front())), rows, [](const Row& row) {
                return fmt::format("{}, sigma {:g}, {}", name(row.experiment), row.sigma, name(row.quantity));
              })}};
}

ValidationView viewOf(const std::vector<Row>& rows) {
  return {
      .title = "Constrained estimation: do minimum, covariance and corrections follow their laws?",
      .introduction =
          "Each trial draws measurements with noise and estimates a parameter from them under implicit equations and "
          "constraints. To first order in the noise the minimum 2 L2 follows a chi-square law with the residual "
          "degrees of freedom, and the squared Mahalanobis distance of the truth one with as many as there are free "
          "parameters. Rows without a verdict are of a noise at which curvature counts; a prototype's figures stand "
          "beside them.",
      .judgement = judgementOf(rows),
      .fields = [&rows](JsonObject& object) { object("rows", rows); },
      .tables = {tableOf(rows, {Quantity::criterion}, criterion_columns, "2 L2, the minimum",
                         "Its mean is to be the number r of degrees of freedom."),
                 tableOf(rows, {Quantity::parameter}, parameter_columns,
                         "Squared Mahalanobis distance of the true parameter", "Its mean, the index, is to be k."),
                 tableOf(rows, {Quantity::correction, Quantity::corrected_point}, point_columns,
                         "Corrected measurements: a conic through 12 points",
                         "Squared correction over its expectation; squared distance of the true point.")}};
}

}  // namespace

void addValidateEstimatorCommand(const CommandList& validate) {
  auto options = std::make_shared<ValidationOptions<EstimatorValidation>>();
  const Command app = validate.add(
      "estimator", "Constrained estimation: do minimum, covariance and corrected measurements follow their laws?");
  declareNames(app, "--experiment", options->names, all_estimator_experiments,
               "conic, corrected_points, rotation_numbers, rotation, prior_numbers, prior, homography, fundamental: a "
               "comma list (default: all)");
  app.option("--noise-factor", options->validation.noise_factor,
             "Standard deviation of the noise over what the estimator is told (default 1)")
      .range(0.01, 100.0);
  app.flag("--full", options->run.full, "40000 trials a row");
  options->run.declare(app, "2000, with --full 40000");
  const auto compute = [](const auto& given, const RunProgress& progress) {
    EstimatorValidation validation = given.validation;
    validation.experiments = chosen(all_estimator_experiments, given.names);
    validation.run = given.run.size(2000, 40000);
    return validateEstimator(validation, progress);
  };
  runValidation(app, options, "validate estimator", compute, viewOf);
}

}  // namespace liestat::cli
