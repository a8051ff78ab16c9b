#include <report/table.hpp>
#include <cli/show/validations.hpp>
#include <experiments/two_view_answers.hpp>
#include <experiments/two_view_validation.hpp>
#include <experiments/two_view_rules.hpp>
#include <experiments/two_view_pairs.hpp>
#include <cli/commands/validation_command.hpp>
#include <cli/commands/commands.hpp>
#include <formats/two_view_pairs.hpp>

#include <fmt/format.h>

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

constexpr const char* short_names[] = {"none", "rtrans", "zoom", "rdisp", "rot", "homog", "trans", "ess", "fund"};
static_assert(std::size(short_names) == default_two_view_motions.size());

std::string percent(std::size_t count, const TwoViewChoice& choice) {
  return fmt::format("{:.1f}", 100 * static_cast<double>(count) / static_cast<double>(choice.trials));
}
/// Shares of the chosen models in per cent.
Columns<TwoViewChoice> choiceColumns() {
  Columns<TwoViewChoice> columns{
      {"truth", [](const TwoViewChoice& choice) { return short_names[static_cast<std::size_t>(choice.truth)]; }}};
  for (std::size_t m = 0; m < default_two_view_motions.size(); ++m) {
    columns.push_back({short_names[m], [m](const TwoViewChoice& choice) { return percent(choice.chosen[m], choice); }});
  }
  return columns;
}
/// The share of the optional model of a motion, and what was chosen instead of it.
const Columns<TwoViewChoice> optional_columns{
    {"truth", [](const TwoViewChoice& choice) { return nameOf(choice.truth); }},
    {"chosen, %", [](const TwoViewChoice& choice) { return percent(choice.right(), choice); }},
    {"others, %", [](const TwoViewChoice& choice) {
       std::string others;
       for (std::size_t m = 0; m < default_two_view_motions.size(); ++m) {
         if (choice.chosen[m] == 0) continue;
         others +=
             fmt::format("{}{} {}", others.empty() ? "" : ", ", short_names[m], percent(choice.chosen[m], choice));
       }
       return others;
     }}};
const Columns<TwoViewRow> distance_columns{{"model", [](const TwoViewRow& row) { return name(row.motion); }},
                                           {"k", Judged::dof},
                                           {"index", Judged::index},
                                           {"SE", Judged::indexError, 2},
                                           {"95 % covers", Judged::covered},
                                           {"K-S p", Judged::kolmogorov, 2},
                                           {"verdict", Judged::verdict}};

ValidationView viewOf(const TwoViewValidationResult& result) {
  const double average = 100 * result.average();
  const auto nine = selected(result.choices, [](const TwoViewChoice& choice) { return !choice.optional(); });
  const auto optional = selected(result.choices, [](const TwoViewChoice& choice) { return choice.optional(); });
  return {.title = "Two-view motion: is the right model chosen, and is its covariance true?",
          .introduction =
              "Each trial moves a camera by one motion, takes matches with noise and outliers, and runs the hierarchy "
              "of models over them. The table has the models that were chosen. For the true model's estimate the "
              "squared Mahalanobis distance of the true parameter follows a chi-square law if the covariance is true; "
              "its mean, the index, is then the number k of free parameters.",
          .judgement = judgementOf(result),
          .fields = [&result](JsonObject& object) { object.fieldsOf(result); },
          .tables = {{.title = "Models that were chosen, %",
                      .table = tablesOf(choiceColumns(), nine),
                      .below = fmt::format("mean of the diagonal: {:.1f} %\n", average),
                      .page_title = "Models that were chosen",
                      .page_caption = fmt::format("Per cent of the trials; mean of the diagonal {:.1f} %.", average)},
                     {.title = "Optional models, each beside the default lattice",
                      .table = tablesOf(optional_columns, optional),
                      .page_title = nine.empty() ? "Models that were chosen" : "",
                      .page_caption = "Optional models, each beside the default lattice."},
                     {.title = "Squared distance of the truth from the true model's estimate; index k expected",
                      .table = tablesOf(distance_columns, result.rows),
                      .plots = {histogramPlot(
                          "distances", result.rows, [](const TwoViewRow& row) { return name(row.motion); },
                          "Squared distances with the density that they should have.")},
                      .page_title = "Distances of the truth"}}};
}

const Columns<TwoViewRuleRow> rule_columns{
    {"rule", &TwoViewRuleRow::rule},
    {"right %", [](const TwoViewRuleRow& row) { return 100 * row.average(); }, fixed(1)},
    {"least %", [](const TwoViewRuleRow& row) { return 100 * row.share(row.worst()); }, fixed(1)},
    {"of motion", [](const TwoViewRuleRow& row) { return nameOf(default_two_view_motions[row.worst()]); }}};

/// Shares of right choices, a bar of each motion.
Panel panelOf(const TwoViewRuleRow& row) {
  Panel panel{row.rule, {"motion, numbered as in the table"}, {.label = "right choices, %", .low = 0.0, .high = 100.0}};
  Series bars{.style = Style::boxes};
  for (std::size_t k = 0; k < row.trials.size(); ++k) {
    if (row.trials[k] == 0) continue;
    bars.x.push_back(static_cast<double>(k + 1)), bars.y.push_back(100 * row.share(k)), bars.width.push_back(0.8);
  }
  panel.x.low = 0.5, panel.x.high = static_cast<double>(row.trials.size()) + 0.5;
  panel.series = {bars};
  return panel;
}

ValidationView viewOf(const std::vector<TwoViewRuleRow>& rows) {
  ValidationTable rules{.title = "Rules of choice over the same trials, all models estimated",
                        .table = tablesOf(rule_columns, rows),
                        .page_title = "",
                        .page_caption = "Shares of right choices over all motions, and of the motion with the fewest."};
  Plot plot{.name = "rules", .caption = "Shares of right choices of each rule and motion.", .columns = 3};
  for (const TwoViewRuleRow& row : rows) plot.panels.push_back(panelOf(row));
  ValidationView view{.title = "Rules by which a model of two-view motion is chosen",
                      .introduction = "",
                      .fields = [&rows](JsonObject& object) { object("rules", rows); },
                      .tables = {std::move(rules)}};
  if (rows.empty()) return view;
  view.verdict = verdictOf(rows);
  view.page = [&rows, table = view.tables[0], plot](Report& report) {
    report.table(table.table.page, *table.page_caption);
    std::vector<std::vector<std::string>> motions;
    for (std::size_t k = 0; k < default_two_view_motions.size(); ++k) {
      motions.push_back({fmt::format("{}", k + 1), nameOf(default_two_view_motions[k]),
                         fmt::format("{}", rows.front().trials[k]), number(100 * rows.front().share(k))});
    }
    report.table({"number", "motion", "trials", "right by default, %"}, motions);
    report.plot(plot);
  };
  return view;
}

std::string share(std::size_t count, std::size_t of) {
  return of == 0 ? "" : fmt::format("{:.1f}", 100 * static_cast<double>(count) / static_cast<double>(of));
}
using AnswerRow = TwoViewAnswerRow;
const Columns<AnswerRow> answer_columns{
    {"scene", &AnswerRow::scene},
    {"right %", [](const AnswerRow& row) { return share(row.right, row.trials); }},
    {"marked %", [](const AnswerRow& row) { return share(row.marked, row.trials); }},
    {"wrong %", [](const AnswerRow& row) { return share(row.wrong, row.trials); }},
    {"promised", [](const AnswerRow& row) { return fmt::format("{:.0f}", 100 * row.max_wrong); }},
    {"contested %", [](const AnswerRow& row) { return share(row.contested, row.trials); }},
    {"in set %", [](const AnswerRow& row) { return share(row.right_in_set, row.contested); }},
    {"poses", &AnswerRow::poses},
    {"outside %", [](const AnswerRow& row) { return share(row.outside, row.poses); }},
    {"verdict", [](const AnswerRow& row) { return verdictCell(row.passed); }}};

ValidationView viewOf(const std::vector<AnswerRow>& rows) {
  return {.title = "Two-view motion: are wrong answers marked?",
          .introduction =
              "Each trial moves a camera by one motion and asks for it as a user does. right: ok, and the right model; "
              "wrong: ok, and another one; marked: not ok. in set: of the contested answers those whose set has the "
              "right model. outside: of the right poses those with the truth beyond the region of 95 %.",
          .judgement = judgementOf(rows),
          .fields = [&rows](JsonObject& object) { object("answers", rows); },
          .tables = {{.title = "Answers", .table = tablesOf(answer_columns, rows), .page_title = "Answers"}}};
}

std::string shortName(const std::string& model) {
  if (model == "retinal translation") return "rtrans";
  if (model == "retinal displacement") return "rdisp";
  return model.substr(0, 5) == "trans" ? "trans" : model.substr(0, 5);
}

std::string modelsOf(const PairChoice& row) {
  std::string chosen;
  for (const auto& [model, count] : row.chosen) {
    chosen += fmt::format("{}{} {}", chosen.empty() ? "" : ", ", shortName(model), count);
  }
  return chosen;
}
const Columns<PairChoice> pair_columns{
    {"pair", &PairChoice::name},
    {"kept/n", [](const PairChoice& row) { return fmt::format("{}/{}", row.kept, row.tentative); }},
    {"chosen", modelsOf},
    {"H", &PairChoice::homography_inliers},
    {"F", &PairChoice::fundamental_inliers},
    {"far", &PairChoice::far},
    {"new", &PairChoice::explained},
    {"max", &PairChoice::allowed},
    {"plane", &PairChoice::degenerate},
    {"px", &PairChoice::validation_error, fixed(2)}};
const Columns<PairStructures> structure_columns{
    {"pair", &PairStructures::name},
    {"n", &PairStructures::matches},
    {"planes", &PairStructures::labelled},
    {"found", &PairStructures::found},
    {"wrong", &PairStructures::wrong},
    {"%", [](const PairStructures& row) { return 100 * row.wrong / static_cast<double>(row.matches); }, fixed(1)},
    {"purity", &PairStructures::purity, fixed(2)},
    {"cover", &PairStructures::coverage, fixed(2)},
    {"first wrong", [](const PairStructures& row) { return row.labelled == 1 ? number(row.first_wrong) : ""; }}};
const Columns<PairPlane> plane_columns{
    {"pair", &PairPlane::name},
    {"n", &PairPlane::matches},
    {"right", &PairPlane::labelled},
    {"found", [](const PairPlane& row) { return fmt::format("{} of {}", row.supported, row.runs); }},
    {"inliers", &PairPlane::inliers},
    {"of them right", &PairPlane::right},
    {"distance, px", &PairPlane::label_error, 3}};
const Columns<Promise> check_columns{
    {"promise", &Promise::text},
    {"measured", &Promise::value},
    {"bound", [](const Promise& check) { return check.passed ? number(check.bound) : ""; }},
    {"verdict", [](const Promise& check) { return verdictCell(check.passed); }}};

const char* titleOf(PairFamily family) {
  return family == PairFamily::homogr ? "homogr: a plane or a rotation; right is a homography"
                                      : "kusvod2: scenes in depth; right is a fundamental matrix";
}
constexpr const char* choice_notes =
    "kept: different tentative matches that no other one contradicts; chosen: models, and in how many runs. Medians "
    "over the runs: inliers of homography (H) and fundamental matrix (F); far: matches far from the homography; new: "
    "those of them that the fundamental matrix explains; max: so many chance and its freedom explain. plane: runs in "
    "which five of the seven matches that made the best fundamental matrix are on a plane (DEGENSAC's rule). px: "
    "distance of the validation points from the right model's estimate, median of medians.";
constexpr const char* structure_notes =
    "Labelled planes, homographies that were found one after the other, and with the best assignment of the found ones "
    "to the labels: wrong labels, share of inliers with the right label, share of labelled matches that were found; "
    "wrong labels of the first homography alone where there is one plane.";
constexpr const char* plane_notes =
    "Matches that are labelled right; runs that found a homography which chance does not explain; medians: its "
    "inliers, those that are right, and the distance of the right ones from it.";

}  // namespace

ValidationView viewOf(const TwoViewPairsResult& result) {
  ValidationView view{.title = "Two-view motion: what the hierarchy makes of real pairs",
                      .introduction = "",
                      .judgement = judgementOf(result),
                      .fields = [&result](JsonObject& object) { object.fieldsOf(result); }};
  for (const PairFamily family : {PairFamily::homogr, PairFamily::kusvod2}) {
    view.tables.push_back(
        {.title = titleOf(family),
         .table = tablesOf(pair_columns,
                           selected(result.choices, [&](const PairChoice& row) { return row.family == family; })),
         .page_caption = choice_notes});
  }
  view.tables.push_back({.title = "adelaide-rmf: planes one after the other, against labels",
                         .table = tablesOf(structure_columns, result.structures),
                         .page_title = "adelaide-rmf: planes one after the other",
                         .page_caption = structure_notes});
  view.tables.push_back({.title = "evd: a plane from far apart, few right matches",
                         .table = tablesOf(plane_columns, result.planes),
                         .page_title = "evd: a plane from far apart",
                         .page_caption = plane_notes});
  view.tables.push_back({.table = tablesOf(check_columns, result.checks), .page_title = "Promises"});
  return view;
}

namespace {

struct Options {
  TwoViewValidation validation;
  std::vector<std::string> motions;
  std::optional<double> sigma;
  bool rules = false, answers = false;
  std::string pairs;
  bool all_matches = false;
  RunOptions run;
};

constexpr const char* bar = "validate two-view";

int runPairs(const Options& options, const Invocation& invocation) {
  const std::vector<TwoViewPair> pairs = readTwoViewPairs(options.pairs);
  TwoViewPairsValidation validation{.run = options.run.size(10), .contradicted = options.all_matches};
  validation.sigma = options.sigma.value_or(validation.sigma);
  const auto result =
      runTrials(bar, [&](const auto& progress) { return validateTwoViewPairs(pairs, validation, progress); });
  return publish(options.run, invocation, cli::viewOf(result));
}

int judgeAnswers(const Options& options, const Invocation& invocation) {
  TwoViewAnswers answers{
      .run = options.run.size(20, 500), .matches = options.validation.matches, .outliers = options.validation.outliers};
  answers.sigma = options.sigma.value_or(answers.sigma);
  const auto rows = runTrials(bar, [&](const auto& progress) { return validateTwoViewAnswers(answers, progress); });
  return publish(options.run, invocation, viewOf(rows));
}

int compareRules(const Options& options, const Invocation& invocation) {
  TwoViewRuleComparison comparison{
      .run = options.run.size(20, 500), .matches = options.validation.matches, .outliers = options.validation.outliers};
  comparison.sigma = options.sigma.value_or(comparison.sigma);
  const auto rows = runTrials(bar, [&](const auto& progress) { return compareTwoViewRules(comparison, progress); });
  return publish(options.run, invocation, viewOf(rows));
}

int runCommand(const Options& options, const Invocation& invocation) {
  options.run.begin(invocation);
  if (!options.pairs.empty()) return runPairs(options, invocation);
  if (options.rules) return compareRules(options, invocation);
  if (options.answers) return judgeAnswers(options, invocation);
  TwoViewValidation validation = options.validation;
  validation.sigma = options.sigma.value_or(validation.sigma);
  if (options.run.full || !options.motions.empty()) validation.motions = chosen(all_two_view_motions, options.motions);
  validation.run = options.run.size(50, 500);
  const auto result = runTrials(bar, [&](const auto& progress) { return validateTwoView(validation, progress); });
  return publish(options.run, invocation, viewOf(result));
}

std::string optionalNames() {
  std::string text;
  for (const TwoViewMotion motion : optional_two_view_motions) text += (text.empty() ? "" : ", ") + name(motion);
  return text;
}

}  // namespace

void addValidateTwoViewCommand(const CommandList& validate) {
  auto options = std::make_shared<Options>();
  const Command app =
      validate.add("two-view", "Motion between two images: is the right model chosen, and does its covariance hold?");
  app.option("--motion", options->motions,
             "none, retinal_translation, zoom, retinal_displacement, rotation, homography, translation, essential, "
             "fundamental, and of optional models " +
                 optionalNames() + ": a comma list (default: the first nine, with --full all)")
      .list()
      .oneOf(names(all_two_view_motions));
  app.option("--matches", options->validation.matches, "Matches of a trial (default 100)")
      .range(std::size_t{10}, std::size_t{100000});
  app.option("--outliers", options->validation.outliers, "Share of wrong matches (default 0.2)").range(0.0, 0.9);
  app.option("--sigma", options->sigma, "Standard deviation of image coordinates, px (default 0.5, of real pairs 1)")
      .range(1e-3, 10.0);
  app.flag("--full", options->run.full, "500 trials a motion, optional models too");
  app.option("--pairs", options->pairs,
             "Real pairs instead: a directory with the folders homogr, kusvod2, adelaide-rmf, evd, or some of them")
      .excludes("--motion")
      .excludes("--matches")
      .excludes("--outliers")
      .excludes("--full");
  app.flag("--all-matches", options->all_matches, "Also matches of --pairs that contradict each other");
  app.flag("--rules", options->rules,
           "Compare rules by which the model may be chosen instead; all models are estimated")
      .excludes("--pairs")
      .excludes("--motion");
  app.flag("--answers", options->answers,
           "Judge the answers of `liestat two-view` instead: their statuses, also where baselines come near the noise")
      .excludes("--pairs")
      .excludes("--motion")
      .excludes("--rules");
  options->run.declare(app, "50, with --full 500, of real pairs 10");
  app.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
