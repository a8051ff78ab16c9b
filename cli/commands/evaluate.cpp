#include <cli/commands/commands.hpp>
#include <cli/commands/trajectory_input.hpp>
#include <formats/bag.hpp>
#include <formats/evo_result.hpp>
#include <formats/input_error.hpp>
#include <formats/output_file.hpp>
#include <formats/text.hpp>
#include <cli/show/evaluation.hpp>
#include <fusion/convention_diagnosis.hpp>
#include <fusion/evaluate.hpp>
#include <report/describe.hpp>
#include <report/publish.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace liestat::cli {
namespace {

constexpr const char* evaluate_name = "liestat evaluate";

struct EvaluateOptions {
  std::string reference, cov_from, cov_ref, json, table, report, save_results, save_rpe;
  std::vector<std::string> estimates, fail_if;
  TrajectoryInputOptions input;
  bool align = false, correct_scale = false, align_origin = false;
  std::optional<AlignmentModel> alignment;
  std::vector<double> motion_filter;
  EvaluationOptions how;

  /// Takes over what is given by evo's flags, or apart. Throws InputError.
  void settle() {
    input.settle();
    how.association = input.association;
    how.alignment = alignment      ? *alignment
                    : align_origin ? AlignmentModel::origin
                    : align        ? (correct_scale ? AlignmentModel::sim3 : AlignmentModel::se3)
                                   : (correct_scale ? AlignmentModel::scale : AlignmentModel::none);
    if (!motion_filter.empty()) how.motion_filter = {motion_filter[0], motion_filter[1]};
  }
};

/// The names of files, with as much of their paths as tells them apart; a file that is given twice has a number as
/// well.
std::vector<std::string> namesOf(const std::vector<std::string>& paths) {
  std::vector<std::string> names;
  for (std::size_t k = 0; k < paths.size(); ++k) {
    const std::string path = "/" + paths[k];
    std::size_t begin = path.rfind('/', bagPath(paths[k]).file.size());  // a bag's topic has a stroke of its own
    const auto alone = [&] {
      const std::string_view end = std::string_view(path).substr(begin);
      return std::count_if(paths.begin(), paths.end(), [&](const auto& p) { return ("/" + p).ends_with(end); }) == 1;
    };
    while (begin > 0 && !alone()) begin = path.rfind('/', begin - 1);
    names.push_back(paths[k] == "-" ? sourceName(paths[k]) : printable(path.substr(begin + 1), 200));
    if (std::count(paths.begin(), paths.end(), paths[k]) < 2) continue;
    const auto before = paths.begin() + static_cast<std::ptrdiff_t>(k);
    names.back() += fmt::format(" ({})", 1 + std::count(paths.begin(), before, paths[k]));
  }
  return names;
}

/// A file as the library takes it, with the convention of its covariances if the file does not state it. The file's
/// poses are given up, of which millions would stand in memory twice, and so are its lines and the digits of its times
/// but for the first and the last.
PoseTrajectory poseTrajectory(Trajectory& t, const std::string& convention, std::string_view option) {
  PoseTrajectory p{.times = t.times, .has_covariances = t.hasCovariances(), .name = t.name};
  std::vector<std::size_t> lines = std::exchange(t.lines, {});
  if (t.time_texts.size() > 2) {
    TextList ends;
    ends.push_back(t.time_texts.front()), ends.push_back(t.time_texts.back());
    t.time_texts = std::move(ends);
  }
  if (!t.hasCovariances()) {
    p.poses = exactPoses(std::exchange(t.poses, {}));
    return p;
  }
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i] == 0) lines[i] = i + 1;
  }
  p.lines = std::move(lines);
  const auto given = convention.empty() ? std::nullopt : std::optional(conventionNamed(convention, option));
  const Convention c = conventionOf(t, given, option);
  p.covariance_convention = describe(c);
  p.poses = gaussiansOf(t, c);
  t.poses = {}, t.covariances = {};
  return p;
}

/// Throws InputError: about an option that only this command has, or as other commands do.
[[noreturn]] void refuse(const EvaluateOptions& o, const TrajectoryEvaluation& e, const Trajectory& reference,
                         const Trajectory& estimate) {
  switch (e.status) {
    case EvaluationStatus::bad_options:
      throw OptionError("--delta", fmt::format("{}", o.how.relative.delta), "a positive number, whole for frames");
    case EvaluationStatus::other_unit:
      throw OptionError(evaluate_name,
                        fmt::format("--change_unit {} of errors in {}", name(*o.how.change_unit), e.ape_unit),
                        "a unit of the same kind");
    case EvaluationStatus::overlapping_pairs:
      throw OptionError(evaluate_name, "--pairs-model with --all_pairs", "pairs that do not overlap");
    default:
      refuse(e.status, e.reason, reference, estimate, o.input);
  }
}

EvaluatedEstimate evaluateOne(const EvaluateOptions& o, const Trajectory& reference,
                              const PoseTrajectory& reference_poses, const std::string& path,
                              const std::string& shown_name) {
  Trajectory estimate = readTimedTrajectory(path, o.input.estimate, o.input.duplicates);
  requireSameVertices(reference, estimate);
  if (!o.cov_from.empty() && !estimate.hasCovariances()) {
    throw InputError(estimate.name, 0, "the file has no covariances, and --cov-from is given",
                     "covariances (a file of its name with .cov after it, or a format that has them)");
  }
  EvaluatedEstimate e{
      .name = shown_name,
      .evaluation = evaluateTrajectory(reference_poses, poseTrajectory(estimate, o.cov_from, "--cov-from"), o.how)};
  if (!e.evaluation.ok()) refuse(o, e.evaluation, reference, estimate);
  e.evaluation.notes.insert(e.evaluation.notes.begin(), estimate.notes.begin(), estimate.notes.end());
  return e;
}

/// Conditions NAME>VALUE or NAME<VALUE that hold; NAME of describeFigures. A figure that does not apply fails.
void applyConditions(const EvaluateOptions& o, EvaluationOutput& output) {
  for (const std::string& condition : o.fail_if) {
    const std::size_t at = condition.find_first_of("<>");
    double bound = 0;
    const std::string figure = condition.substr(0, at);
    if (at == std::string::npos ||
        parseNumber(std::string_view(condition).substr(at + 1), bound) != NumberKind::finite) {
      throw OptionError("--fail-if", "'" + printable(condition) + "'", "a figure, < or >, and a number: ape_rmse>0.1");
    }
    for (const EvaluatedEstimate& e : output.estimates) {
      NamedFigures named_figures;
      describeFigures(named_figures, e.evaluation);
      const auto& figures = named_figures.figures();
      const auto found = std::find_if(figures.begin(), figures.end(), [&](const auto& f) { return f.first == figure; });
      if (found == figures.end()) {
        std::vector<std::string> names;
        for (const auto& f : figures) names.push_back(f.first);
        throw OptionError("--fail-if", "'" + printable(figure) + "'", "one of " + joined(names, ", "));
      }
      const double value = found->second;
      if (std::isnan(value)) {
        output.failed.push_back(fmt::format("{}: {} is not known", e.name, figure));
      } else if (condition[at] == '>' ? value > bound : value < bound) {
        output.failed.push_back(fmt::format("{}: {} is {:.6g}", e.name, condition, value));
      }
    }
  }
}

int runEvaluate(EvaluateOptions o, const Invocation& invocation) {
  o.settle();
  if (o.save_results.size() + o.save_rpe.size() > 0 && o.estimates.size() > 1) {
    throw OptionError(evaluate_name, "--save_results with several estimates", "one estimate");
  }
  if (std::count(o.estimates.begin(), o.estimates.end(), "-") + (o.reference == "-" ? 1 : 0) > 1) {
    throw OptionError(evaluate_name, "several files are standard input", "one");
  }
  // Segments of millions of poses take as long as everything else.
  o.how.segments = !o.json.empty() || !o.report.empty();
  EvaluationOutput output;
  output.reference = namesOf({o.reference})[0];
  Trajectory reference = readTimedTrajectory(o.reference, o.input.reference, o.input.duplicates);
  output.reference_notes = reference.notes;
  // A reference is exact unless its covariances are asked for by naming their convention, or it states it.
  if (o.cov_ref.empty() && !reference.stated_convention) reference.covariances.clear();
  output.reference_has_covariances = reference.hasCovariances();
  const PoseTrajectory reference_poses = poseTrajectory(reference, o.cov_ref, "--cov-ref");
  const std::vector<std::string> names = namesOf(o.estimates);
  for (std::size_t k = 0; k < o.estimates.size(); ++k) {
    output.estimates.push_back(evaluateOne(o, reference, reference_poses, o.estimates[k], names[k]));
  }
  applyConditions(o, output);
  publishResult(o.json, formatEvaluation(output), invocation.command_line, std::nullopt, output);
  if (!o.table.empty()) writeOutput(o.table, evaluationCsv(output));
  const EvaluatedEstimate& first = output.estimates[0];
  const auto save = [&](const std::string& path, EvoErrors errors) {
    if (path.empty()) return;
    writeOutput(path, evoResult(first.evaluation, o.how, errors, {output.reference, first.name}, path));
  };
  save(o.save_results, EvoErrors::ape), save(o.save_rpe, EvoErrors::rpe);
  if (!o.report.empty()) writeEvaluationReport(o.report, invocation.command_line, output);
  if (!output.failed.empty()) return exit_validation_failed;
  for (const EvaluatedEstimate& e : output.estimates) {
    if (e.evaluation.has_covariances && !e.evaluation.consistency.ok) return exit_not_trusted;
  }
  return exit_fine;
}

}  // namespace

void addEvaluateCommand(const CommandList& program) {
  auto o = std::make_shared<EvaluateOptions>();
  const Command command =
      program.add("evaluate", "Trajectories against a reference: APE, RPE, and are the covariances right?");
  command.option("REFERENCE", o->reference, "Ground truth: TUM, KITTI, EuRoC, CSV, BAG:TOPIC … ('-': standard input)")
      .required();
  command.option("ESTIMATE", o->estimates, "Estimates, any number of them").required();
  command.option("--cov-from", o->cov_from, "Convention of the estimates' covariances: ros-fixed, left,order=rt …");
  command.option("--cov-ref", o->cov_ref,
                 "Convention of the reference's covariances; without it the reference is exact");
  o->input.declare(command);
  command.choice("-r,--pose_relation,--pose-relation", o->how.pose_relation,
                 "Number that is made of an error (default trans_part)");
  command.flag("-a,--align", o->align, "Align positions by least squares (Umeyama)");
  command.flag("-s,--correct_scale,--correct-scale", o->correct_scale, "Scale too; alone: the scale only");
  const Option origin = command.flag("--align_origin,--align-origin", o->align_origin, "Make the first poses agree");
  command.choice("--alignment", o->alignment, "Instead of these: the model by its name").excludes(origin);
  command.choice("--verdict-alignment", o->how.verdict_alignment,
                 "Model of the weighted alignment of the verdict (default: the same)");
  command.option("--n_to_align,--n-to-align", o->how.n_to_align, "Align with the first poses only (default: all)");
  command.choice("--project_to_plane,--project-to-plane", o->how.project_to_plane, "Project both after alignment");
  command.choice("--change_unit,--change-unit", o->how.change_unit, "Unit of APE and RPE");
  command.option("--downsample", o->how.downsample, "Keep so many poses of each file, evenly spaced");
  command
      .option("--motion_filter,--motion-filter", o->motion_filter,
              "Keep poses after which the body moved: DISTANCE,DEGREES (m, deg)")
      .list(2, 2)
      .notNegative();
  command.flag("--misfit", o->how.misfit,
               "Look for faults of the whole run: clock, scale, frame, inverses, order of quaternions, axes");
  RelativeOptions& relative = o->how.relative;
  command.option("-d,--delta", relative.delta, "Distance of the poses of a pair (default 1)").positive();
  command.choice("-u,--delta_unit,--delta-unit", relative.unit, "Its unit: frames, deg, rad, m (default f)");
  command
      .option("-t,--delta_tol,--delta-tol", relative.relative_tolerance,
              "Relative tolerance of the distance, for all pairs (default 0.1)")
      .notNegative();
  command.flag("--all_pairs,--all-pairs", relative.all_pairs, "All pairs instead of consecutive ones");
  command.flag("--pairs_from_reference,--pairs-from-reference", relative.pairs_from_reference,
               "Measure the distance along the reference");
  command.choice("--pairs-model", o->how.pairs_model,
                 "NEES of relative motions, if errors of a pair are independent, or a chain (dead reckoning)");
  command.option("--fail-if", o->fail_if, "Exit with 1 if a figure is beyond a bound: ape_rmse>0.1,consistent<1")
      .list();
  command.option("--save_results,--save-results", o->save_results, "Write APE as a result file of evo (.zip)");
  command.option("--save_rpe,--save-rpe", o->save_rpe, "Write RPE as a result file of evo (.zip)");
  command.option("--json", o->json, "Write the result to a JSON file ('-': standard output)");
  command.option("--table", o->table, "Write a CSV file with a row for each estimate ('-': standard output)");
  command.option("--report", o->report, "Directory for a page with errors over time, paths, segments and NEES");
  command.run([o](const Invocation& invocation) { return runEvaluate(*o, invocation); });
}

}  // namespace liestat::cli
