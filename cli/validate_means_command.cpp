#include <cli/commands.hpp>
#include <cli/input_error.hpp>
#include <cli/json_output.hpp>
#include <cli/progress.hpp>
#include <cli/validate_means.hpp>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

#include <cmath>
#include <cstdio>
#include <memory>

namespace liestat::cli {
namespace {

struct Options {
  std::vector<std::string> features, noises, criteria;
  std::vector<std::size_t> n;
  std::vector<double> spreads;
  std::string covariance_at = "estimated", json, report;
  std::size_t trials = 0;
  std::uint64_t seed = 1;
  int threads = 0;
  bool certify = false, full = false;
};

/// The names of all members of a list of enumerators.
template <class List>
std::vector<std::string> names(const List& list) {
  std::vector<std::string> all;
  for (const auto value : list) all.push_back(name(value));
  return all;
}

/// The enumerators with the given names, all of them for none. CLI11 has checked the names.
template <class List>
auto chosen(const List& list, const std::vector<std::string>& wanted) {
  std::vector<typename List::value_type> values;
  for (const auto value : list) {
    for (const std::string& w : wanted) {
      if (w == name(value)) values.push_back(value);
    }
  }
  return wanted.empty() ? std::vector<typename List::value_type>(list.begin(), list.end()) : values;
}

JsonObject toJson(const MeansRow& row) {
  const MeansExperiment& e = row.experiment;
  const ValidationReport& r = row.report;
  const bool frame = e.feature == Feature::frame || e.feature == Feature::semi_oriented_frame ||
                     e.feature == Feature::non_oriented_frame;
  JsonObject o;
  o.set("feature", name(e.feature)).set("noise", name(e.noise)).set("criterion", name(row.method.criterion));
  if (frame && row.method.criterion == Criterion::maha) {
    o.set("covariance_at", name(e.covariance_at));
  } else {
    o.set("covariance_at", nullptr);
  }
  o.set("formula", row.method.corrected ? "corrected" : "printed").set("known_noise", row.method.known_noise);
  o.set("in_domain", row.promise.has_value());
  o.set("n", e.n).set("spread", e.spread).set("trials", r.trials).set("dof", r.dof).set("law", r.law.name());
  o.set("index", r.index).set("index_se", r.index_se).set("index_expected", r.law.mean()).set("variance", r.variance);
  o.set("ks_statistic", r.ks_statistic).set("ks_p", r.ks_p_value).set("coverage95", r.coverage[2].observed);
  o.set("tail", static_cast<double>(r.tailCount()) / static_cast<double>(r.size()));
  o.set("iterations", r.mean_iterations).set("failures", r.failures);
  o.set("ratio_rotation", row.ratio(log_ratio_rotation))
      .set("ratio_rotation_logsd", row.logDeviation(log_ratio_rotation));
  o.set("ratio_translation", row.ratio(log_ratio_translation));
  o.set("ratio_translation_logsd", row.logDeviation(log_ratio_translation));
  o.set("passed", row.passed);
  return o;
}

int runCommand(const Options& options, const Invocation& invocation) {
  MeansValidation validation;
  validation.features = chosen(all_features, options.features);
  validation.noises = chosen(all_noises, options.noises);
  validation.criteria = chosen(all_criteria, options.criteria);
  if (!options.n.empty()) validation.n = options.n;
  validation.spreads = options.spreads;
  if (options.full && validation.spreads.empty()) validation.spreads = {1.0 / 3, 1.0};
  validation.covariance_at = options.covariance_at == "measured" ? CovarianceAt::measured : CovarianceAt::estimated;
  validation.trials = options.trials != 0 ? options.trials : options.full ? 4000 : 1000;
  validation.seed = options.seed;
  validation.threads = options.threads;
  validation.certify = options.certify || options.full;
  validation.all_printed = options.full;

  std::vector<MeansRow> rows;
  {
    // The bar counts in thousandths, as the amount of work is known only inside.
    Progress bar("validate means", 1000);
    rows = validateMeans(validation, [&bar](std::uint64_t done, std::uint64_t all) {
      const std::uint64_t now = all == 0 ? 1000 : 1000 * done / all;
      if (now > bar.done()) bar.advance(now - bar.done());
    });
  }
  std::fputs(formatMeansTables(rows).c_str(), stdout);
  if (!options.json.empty()) {
    JsonObject object = jsonEnvelope(invocation.command_line, options.seed);
    std::vector<JsonObject> list;
    for (const MeansRow& row : rows) list.push_back(toJson(row));
    object.set("false_alarm", run_false_alarm).set("rows", list);
    writeJson(options.json, object);
  }
  if (!options.report.empty()) writeMeansReport(options.report, invocation.command_line, rows);
  bool passed = true;
  for (const MeansRow& row : rows) passed = passed && row.passed.value_or(true);
  return passed ? exit_fine : exit_validation_failed;
}

}  // namespace

void addValidateMeansCommand(CLI::App& validate, Invocation& invocation) {
  auto options = std::make_shared<Options>();
  CLI::App* app = validate.add_subcommand("means", "Means of features: Monte-Carlo validation of their covariances");
  app->add_option("--feature", options->features, "Features, a comma list")
      ->delimiter(',')
      ->check(CLI::IsMember(names(all_features)));
  app->add_option("--noise", options->noises, "Noises, a comma list")
      ->delimiter(',')
      ->check(CLI::IsMember(names(all_noises)));
  app->add_option("--criterion", options->criteria, "Criteria, a comma list")
      ->delimiter(',')
      ->check(CLI::IsMember(names(all_criteria)));
  app->add_option("--n", options->n, "Numbers of measures, a comma list (default 5,10,20,30,50,100)")
      ->delimiter(',')
      ->check(CLI::Range(std::size_t{2}, std::size_t{1000000}));
  app->add_option("--spread", options->spreads,
                  "Factors of the report's standard deviations, a comma list (default 1, frames 1/3)")
      ->delimiter(',')
      ->check(CLI::Range(1e-9, 10.0));
  app->add_option("--covariance-at", options->covariance_at,
                  "Frame in which the noise of frames is Gaussian and MAHA takes its covariances")
      ->check(CLI::IsMember({"estimated", "measured"}));
  app->add_option("--trials", options->trials, "Trials a row (default 1000, with --full 4000)")
      ->check(CLI::Range(std::size_t{1}, std::size_t{100000000}));
  app->add_option("--seed", options->seed, "Seed; the same seed gives the same bits on any number of threads");
  app->add_option("--threads", options->threads, "Threads (default: all)")->check(CLI::Range(0, 4096));
  app->add_flag("--certify", options->certify, "Certify the global minimum of LSQ and WLSQ by branch and bound");
  app->add_flag("--full", options->full,
                "4000 trials, both spreads, certified minima, all printed formulas; no time limit");
  app->add_option("--json", options->json, "Write the rows to a JSON file ('-': standard output)");
  app->add_option("--report", options->report, "Write a page with plots into this directory");
  app->callback(
      [options, &invocation] { invocation.run = [options, &invocation] { return runCommand(*options, invocation); }; });
}

}  // namespace liestat::cli
