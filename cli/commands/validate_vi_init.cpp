#include <cli/commands/commands.hpp>
#include <cli/io/input_error.hpp>
#include <experiments/vi_init_validation.hpp>
#include <experiments/two_solutions.hpp>
#include <experiments/table1.hpp>
#include <cli/commands/validation_command.hpp>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

#include <cmath>
#include <memory>

namespace liestat::cli {
using namespace experiments;
namespace {

struct Options {
  std::vector<std::string> checks;
  std::vector<double> windows;
  double noise = 1;
  std::size_t trials = 0;
  std::uint64_t seed = 1;
  int threads = 0;
  bool full = false, table1 = false;
  std::string scene;
  ValidationOutput output;
};

JsonObject toJson(const ViInitRow& row) {
  JsonObject o;
  o.set("check", name(row.check)).set("estimator", name(row.estimator)).set("quantity", name(row.quantity));
  o.set("unit", unit(row.quantity));
  o.set("window", row.window.seconds).set("images", row.window.images).set("features", row.window.features);
  o.set("in_domain", row.promise.has_value());
  if (row.report) {
    setStatistics(o, *row.report);
  } else {
    o.set("trials", row.trials);
    for (const char* field :
         {"dof", "law", "index", "index_se", "index_expected", "variance", "ks_statistic", "ks_p", "coverage95"}) {
      o.set(field, nullptr);
    }
  }
  o.set("failures", row.failures).set("median", row.median).set("p95", row.p95);
  o.set("value", row.value).set("value_se", row.value_se);
  const ViInitPromise promise = row.promise.value_or(ViInitPromise{});
  o.set("promised_median", promise.median).set("promised_p95", promise.p95);
  o.set("note_median", promise.note_median).set("note_p95", promise.note_p95);
  o.set("passed", row.passed);
  return o;
}

JsonObject toJson(const Table1Row& row) {
  JsonObject o;
  const Table1Entry& entry = table1Entries()[row.entry];
  o.set("row", row.entry + 1).set("cases", entry.cases).set("paper", entry.paper).set("case", row.name);
  o.set("corrections", row.corrections).set("data", row.noisy ? "noise" : "exact");
  o.set("images", row.images).set("features", row.features).set("bias", row.bias).set("scenes", row.scenes);
  o.set("null", row.noisy ? std::nullopt : std::optional<int>(row.null));
  o.set("null_right", row.noisy ? std::nullopt : std::optional<std::size_t>(row.null_right));
  o.set("one_solution", row.solutions[0]).set("two_solutions", row.solutions[1]);
  o.set("infinite_solutions", row.solutions[2]);
  JsonObject statuses;
  for (const auto& [status, count] : row.statuses) statuses.set(name(status), count);
  o.set("recognised", statuses);
  std::vector<std::string> expected;
  for (const FusionStatus status : row.expected) expected.push_back(name(status));
  o.set("expected", expected).set("otherwise", row.wrong).set("passed", row.passed);
  return o;
}

int runTable1(const Options& options, const Invocation& invocation) {
  const std::size_t scenes = options.trials != 0 ? options.trials : options.full ? 1000 : 100;
  const std::vector<Table1Row> rows = withProgressBar("validate vi-init --table1", [&](const auto& progress) {
    return recogniseTable1(scenes, options.seed, options.threads, progress);
  });
  return publish(
      options.output, invocation, options.seed, table1_false_alarm, rows, formatTable1,
      [](const Table1Row& row) { return toJson(row); }, writeTable1Report);
}

JsonObject toJson(const TwoSolutions& found, const std::string& command_line, std::uint64_t seed) {
  JsonObject o = jsonEnvelope(command_line, seed);
  o.set("figure", found.figure).set("scene_seed", found.seed).set("images", found.scene.times.size());
  o.set("features", found.scene.features.size()).set("times", found.scene.times);
  o.set("status", name(found.result.status)).set("null_dimension", found.result.null_dimension);
  o.set("singular_values", found.result.singular_values).set("features_scale", measuredScale(found));
  o.set("axes", "body at the first image");
  std::vector<JsonObject> solutions;
  for (std::size_t k = 0; k < found.result.solutions.size(); ++k) {
    const ClosedFormSolution& solution = found.result.solutions[k];
    JsonObject s;
    s.set("truth", k == found.truth).set("velocity", solution.velocity).set("gravity", solution.gravity);
    s.set("roll", solution.roll()).set("pitch", solution.pitch()).set("cost", solution.cost);
    Eigen::Matrix3Xd features(3, static_cast<Eigen::Index>(solution.features.size()));
    for (std::size_t i = 0; i < solution.features.size(); ++i) {
      features.col(static_cast<Eigen::Index>(i)) = solution.features[i];
    }
    s.set("negative_depths", solution.negative_depths).set("features", Eigen::MatrixXd(features.transpose()));
    solutions.push_back(s);
  }
  return o.set("solutions", solutions);
}

int runScene(const Options& options, const Invocation& invocation) {
  if (options.output.report.empty()) {
    throw InputError("--scene", 0, "draws into a directory and none is named", "--report DIR");
  }
  const auto found = twoSolutions(options.scene == "fig1" ? 1 : 2, options.seed);
  if (!found) {
    std::fputs("no scene with two solutions that can be drawn among a thousand seeds\nFAILED\n", stdout);
    return exit_validation_failed;
  }
  if (options.output.json != "-") std::fputs(formatTwoSolutions(*found).c_str(), stdout);
  if (!options.output.json.empty()) {
    writeJson(options.output.json, toJson(*found, invocation.command_line, options.seed));
  }
  writeTwoSolutionsReport(options.output.report, invocation.command_line, *found);
  return exit_fine;
}

int runCommand(const Options& options, const Invocation& invocation) {
  if (!options.scene.empty()) return runScene(options, invocation);
  if (options.table1) return runTable1(options, invocation);
  ViInitValidation validation;
  validation.checks = chosen(all_vi_init_checks, options.checks);
  validation.windows = options.windows;
  validation.trials = options.trials != 0 ? options.trials : options.full ? 4000 : 600;
  validation.noise = options.noise;
  validation.seed = options.seed;
  validation.threads = options.threads;
  const std::vector<ViInitRow> rows =
      withProgressBar("validate vi-init", [&](const auto& progress) { return validateViInit(validation, progress); });
  if (rows.empty()) throw InputError("--window", 0, "none of these checks has windows of this length");
  return publish(
      options.output, invocation, options.seed, vi_init_false_alarm, rows, formatViInitTables,
      [](const ViInitRow& row) { return toJson(row); }, writeViInitReport);
}

}  // namespace

void addValidateViInitCommand(CLI::App& validate, Invocation& invocation) {
  auto options = std::make_shared<Options>();
  CLI::App* app = validate.add_subcommand(
      "vi-init", "Visual-inertial initialisation: accuracy, covariances, and the cases it recognises");
  app->add_option("--check", options->checks,
                  "consistency, closed_form, accuracy, gyroscope_bias, drift: a comma list (default: all)")
      ->delimiter(',')
      ->check(CLI::IsMember(names(all_vi_init_checks)));
  app->add_option("--window", options->windows, "Only windows of so many seconds, of 1, 2, 3, 4: a comma list")
      ->delimiter(',')
      ->check(CLI::IsMember({1., 2., 3., 4.}));
  app->add_option("--noise", options->noise,
                  "Noise that is simulated over the one that the estimators are told (default 1)")
      ->check(CLI::Range(0.01, 100.0));
  app->add_flag("--full", options->full, "4000 windows a row; no time limit");
  auto* table1 = app->add_flag("--table1", options->table1, "The paper's table of cases, as it is recognised");
  auto* scene = app->add_option("--scene", options->scene,
                                "fig1, fig2: draws the paper's figure of two solutions into the directory of --report")
                    ->check(CLI::IsMember({"fig1", "fig2"}));
  table1->excludes("--check")->excludes("--window")->excludes("--noise");
  scene->excludes(table1)->excludes("--check")->excludes("--window")->excludes("--noise")->excludes("--full");
  addRunOptions(*app, "600, with --full 4000; scenes of --table1: 100, 1000", options->trials, options->seed,
                options->threads, options->output);
  app->callback(
      [options, &invocation] { invocation.run = [options, &invocation] { return runCommand(*options, invocation); }; });
}

}  // namespace liestat::cli
