#include <report/publish.hpp>
#include <cli/commands/commands.hpp>
#include <cli/commands/trajectory_input.hpp>
#include <formats/input_error.hpp>
#include <formats/pose_graph.hpp>
#include <formats/text.hpp>
#include <cli/show/diagnosis.hpp>
#include <fusion/convention_diagnosis.hpp>
#include <stats/convention_presets.hpp>

#include <fmt/format.h>

#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

namespace liestat::cli {
namespace {

constexpr const char* doctor_name = "liestat doctor";

struct DoctorOptions {
  std::vector<std::string> files;
  std::string json, report;
  std::optional<AlignmentModel> align;
  TrajectoryInputOptions input;
  bool no_truth = false, plan = false, everything = false, misfit = false;
  std::optional<double> at;
  double alpha = 1e-3;
};

Trajectory readWithCovariances(const std::string& path, const TextFile& file, const TrajectoryInputOptions& input) {
  Trajectory t = readTimedTrajectory(path, file, input.estimate, input.duplicates);
  if (!t.hasCovariances()) {
    throw InputError(t.name, 0, "the file has no covariances",
                     "them beside the poses, or in a file of its name with .cov after it");
  }
  return t;
}

/// Notes on a file with its name, for they stand among those of others.
std::vector<std::string> notesOfReading(const Trajectory& t) {
  std::vector<std::string> notes = t.notes;
  for (std::string& note : notes) note.insert(0, t.name + ": ");
  return notes;
}

/// The poses of a file with their matrices as they stand there, unless it is a truth.
PoseTrajectory posesOf(const Trajectory& t, bool with_matrices) {
  PoseTrajectory poses{
      .times = t.times, .poses = exactPoses(t.poses), .has_covariances = with_matrices, .name = t.name};
  for (std::size_t i = 0; with_matrices && i < t.size(); ++i) poses.poses.setCovariance(i, t.covariances[i]);
  return poses;
}

/// Edges of a graph and the relative poses of its vertices, or of those of another file.
DiagnosedRun edgesOf(const PoseGraph& graph, const std::vector<GraphVertex>& vertices, bool has_truth) {
  std::unordered_map<std::int64_t, SE3d> poses;
  for (const GraphVertex& v : vertices) poses.emplace(v.id, v.pose);
  DiagnosedRun run;
  for (const GraphEdge& e : graph.edges) {
    DiagnosedPose p{e.measurement, e.matrix, e.measurement};
    if (has_truth) {
      const auto from = poses.find(e.from), to = poses.find(e.to);
      if (from == poses.end() || to == poses.end()) continue;
      p.truth = from->second.inverse() * to->second;
    }
    run.poses.push_back(p);
  }
  return run;
}

int runDoctor(DoctorOptions o, const Invocation& invocation) {
  o.input.settle();
  DiagnosisOutput output;
  CovarianceDiagnosisOptions options;
  options.mode = o.plan ? DiagnosisMode::plan : o.no_truth ? DiagnosisMode::chain : DiagnosisMode::diagnosis;
  options.alpha = o.alpha, options.all_units = o.everything, options.at = o.at, options.misfit = o.misfit;
  options.alignment = o.align.value_or(options.alignment);
  const bool has_truth = options.mode == DiagnosisMode::diagnosis;
  std::vector<std::string> estimates = o.files;
  std::string truth_path;
  if (has_truth || (o.plan && estimates.size() > 1)) {
    if (estimates.size() < 2) {
      throw OptionError(doctor_name, "no ground truth", "ESTIMATE REFERENCE, or --no-truth, or --plan");
    }
    truth_path = estimates.back();
    estimates.pop_back();
  }
  if (!has_truth && estimates.size() > 1) throw OptionError(doctor_name, "several estimates", "one without a truth");
  std::vector<DiagnosedRun> runs;
  const auto load = [&](const std::string& path) {
    return loadTrajectoryText(path, o.input.estimate.reading.largest_file);
  };
  TextFile text = load(estimates.front());
  const std::string& format = o.input.estimate.format;
  if (named<GraphFormat>(format) || (format == "auto" && looksLikeGraph(text.text))) {
    if (o.no_truth) throw InputError(text.name, 0, "edges, and --no-truth", "a trajectory, or the true vertices");
    if (estimates.size() > 1) throw OptionError(doctor_name, "several graphs", "one, and its truth");
    const double tolerance = o.input.estimate.reading.norm_tolerance;
    const PoseGraph graph = parseGraph(text.text, text.name, true, tolerance);
    if (graph.n_unknown == graph.edges.size()) {
      throw InputError(graph.name, 0, "the edges have no information matrices", "them, which are what is to be judged");
    }
    if (graph.planar)
      throw InputError(graph.name, 0, "planar edges", "EDGE_SE3:QUAT or EDGE3, whose matrices have six rows");
    std::vector<GraphVertex> vertices;
    if (has_truth) {
      const TextFile truth = load(truth_path);
      if (!looksLikeGraph(truth.text)) {
        throw InputError(truth.name, 0, "no vertices", "a graph whose vertices are the truth (VERTEX_SE3:QUAT)");
      }
      vertices = parseGraph(truth.text, truth.name, true, tolerance).vertices;
      output.reference = truth.name;
    }
    runs.push_back(edgesOf(graph, vertices, has_truth));
    if (runs[0].poses.empty()) {
      throw InputError(graph.name, 0, "no edge joins two vertices of the truth", "vertices with the same numbers");
    }
    output.files = {graph.name};
    options.edges = true, options.content = CovarianceContent::information;
  } else {
    Trajectory truth;
    if (!truth_path.empty()) {
      truth = readTimedTrajectory(truth_path, o.input.reference, o.input.duplicates);
      output.reference = truth.name;
    }
    for (std::size_t k = 0; k < estimates.size(); ++k) {
      if (k > 0) text = load(estimates[k]);
      const Trajectory estimate = readWithCovariances(estimates[k], text, o.input);
      output.files.push_back(estimate.name);
      options.order = estimate.fixed_order;
      DiagnosedRun run{{}, estimate.times};
      if (has_truth) {
        RunAgainstTruth found = runAgainstTruth(posesOf(truth, false), posesOf(estimate, true), o.input.association);
        if (!found.ok()) refuse(found.status, found.reason, truth, estimate, o.input);
        run = std::move(found.run);
      } else {
        for (std::size_t i = 0; i < estimate.size(); ++i) {
          run.poses.push_back({estimate.poses[i], estimate.covariances[i], estimate.poses[i]});
        }
      }
      std::vector<std::string> notes = k == 0 ? notesOfReading(truth) : std::vector<std::string>();
      for (std::string& note : notesOfReading(estimate)) notes.push_back(std::move(note));
      run.notes.insert(run.notes.begin(), notes.begin(), notes.end());
      if (estimate.stated_convention) {
        run.notes.insert(run.notes.begin(), fmt::format("{} states {}", estimate.covariance_source,
                                                        conventionName(*estimate.stated_convention, false)));
      }
      runs.push_back(std::move(run));
    }
    if (runs.size() > 1 && o.align)
      throw OptionError(doctor_name, "--align with several runs", "runs in the world of the truth");
  }
  output.result = diagnoseCovariances(runs, options);
  publishResult(o.json, formatDiagnosis(output), invocation.command_line, std::nullopt, output);
  const Verdict verdict = output.result.verdict();
  if (!o.report.empty()) {
    // The reading that is assumed without a diagnosis, at the back, and the best one.
    const std::optional<AlignmentModel> alignment = has_truth ? std::optional(output.result.alignment) : std::nullopt;
    std::vector<Convention> read{output.result.assumed};
    const std::optional<Convention> best = output.result.best();
    if (best && *best != read[0]) read.push_back(*best);
    std::vector<ConventionReading> readings;
    for (const Convention& c : read) readings.push_back(readInConvention(output.result.poses, c, alignment));
    writeDiagnosisReport(o.report, invocation.command_line, output, readings);
  }
  return verdict.isYes() ? exit_fine : verdict.isNone() ? exit_undecidable : exit_inconsistent;
}

}  // namespace

void addDoctorCommand(const CommandList& program) {
  auto o = std::make_shared<DoctorOptions>();
  const Command command =
      program.add("doctor", "Which convention are the covariances of a file in, and are they right?");
  command
      .option(
          "FILES", o->files,
          "ESTIMATE [further runs …] REFERENCE; a graph of g2o or TORO and one with the true vertices; with --no-truth "
          "or --plan the estimate alone")
      .required();
  o->input.declare(command);
  using Alignments = std::vector<std::pair<std::string, AlignmentModel>>;
  command.choice(
      "--align", o->align,
      Alignments{{"posyaw", AlignmentModel::posyaw}, {"se3", AlignmentModel::se3}, {"sim3", AlignmentModel::sim3}},
      "The truth is in another world: align each hypothesis by its covariances");
  const Option no_truth =
      command.flag("--no-truth", o->no_truth, "Dead reckoning without a truth: the covariance may only grow");
  command.flag("--plan", o->plan, "What the file can decide and with how many poses, before any error is seen")
      .excludes(no_truth);
  command.flag("--all-units", o->everything, "With --plan: hypotheses with half and double angles and degrees too");
  command.flag("--misfit", o->misfit, "Of one run: look first for faults that are no noise, as evaluate --misfit does");
  command.option("--at", o->at, "With several runs: the time of their residuals, s (default: the last common one)");
  command.option("--alpha", o->alpha, "Probability of rejecting the true convention (default 0.001)").range(1e-12, 0.5);
  command.option("--json", o->json, "Write the result to a JSON file ('-': standard output)");
  command.option("--report", o->report, "Write a page with plots into this directory");
  command.run([o](const Invocation& invocation) { return runDoctor(*o, invocation); });
}

}  // namespace liestat::cli
