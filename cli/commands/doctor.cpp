#include <cli/commands/commands.hpp>
#include <cli/commands/trajectory_input.hpp>
#include <cli/io/input_error.hpp>
#include <cli/io/output_file.hpp>
#include <cli/io/pose_graph_file.hpp>
#include <cli/io/text.hpp>
#include <cli/show/diagnosis.hpp>
#include <stats/convention_presets.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

namespace liestat::cli {
namespace {

constexpr const char* doctor_name = "liestat doctor";

struct DoctorOptions {
  std::vector<std::string> files;
  std::string json, report, align;
  TrajectoryInputOptions input;
  bool no_truth = false, plan = false, runs = false, everything = false;
  std::optional<double> at;
  double alpha = 1e-3;
};

const std::map<std::string, AlignmentModel> doctor_alignments{
    {"posyaw", AlignmentModel::posyaw}, {"se3", AlignmentModel::se3}, {"sim3", AlignmentModel::sim3}};

/// A content that format or file fixes leaves fewer hypotheses.
std::vector<Convention> possible(const std::optional<CovarianceOrder>& order,
                                 const std::optional<CovarianceContent>& content) {
  std::vector<Convention> list = conventionHypotheses();
  std::erase_if(
      list, [&](const Convention& c) { return (order && c.order != *order) || (content && c.content != *content); });
  return list;
}

Trajectory readWithCovariances(const std::string& path, const TrajectoryOptions& options) {
  Trajectory t = readTimedTrajectory(path, options);
  if (!t.hasCovariances()) {
    throw InputError(t.name, 0, "the file has no covariances",
                     "them beside the poses, or in a file of its name with .cov after it");
  }
  return t;
}

/// Poses of an estimate with the truth at their times.
std::vector<DiagnosedPose> withTruth(const Trajectory& estimate, const Trajectory& truth, const DoctorOptions& o,
                                     std::vector<double>* times, std::vector<std::string>& notes) {
  const Associated associated = associate(truth, estimate, o.input);
  const std::vector<Gaussian<SE3d>> exact = exactPoses(truth.poses), poses = exactPoses(estimate.poses);
  const std::vector<MatchedPose> matched =
      matchedPoses(associated.matches, exact, poses,
                   o.input.interpolation == "slerp" ? PoseInterpolation::slerp : PoseInterpolation::geodesic);
  std::vector<DiagnosedPose> list;
  for (std::size_t k = 0; k < matched.size(); ++k) {
    const std::size_t row = associated.matches[k].estimate;
    list.push_back({matched[k].estimate.mean, estimate.covariances[row], matched[k].reference.mean});
    if (times != nullptr) times->push_back(estimate.hasTimes() ? estimate.times[row] : static_cast<double>(row));
  }
  const std::string suspicion = suspectQuaternionOrder(matched, truth.name, estimate.name);
  if (!suspicion.empty()) notes.push_back(suspicion);
  if (matched.size() < estimate.size()) {
    notes.push_back(fmt::format("{} of {} poses of {} have a partner in {}", matched.size(), estimate.size(),
                                estimate.name, truth.name));
  }
  return list;
}

/// Edges of a graph and the relative poses of its vertices, or of those of another file.
std::vector<DiagnosedPose> edgesOf(const PoseGraph& graph, const std::vector<GraphVertex>& vertices, bool has_truth) {
  std::unordered_map<std::int64_t, SE3d> poses;
  for (const GraphVertex& v : vertices) poses.emplace(v.id, v.pose);
  std::vector<DiagnosedPose> list;
  for (const GraphEdge& e : graph.edges) {
    DiagnosedPose p{e.measurement, e.matrix, e.measurement};
    if (has_truth) {
      const auto from = poses.find(e.from), to = poses.find(e.to);
      if (from == poses.end() || to == poses.end()) continue;
      p.truth = from->second.inverse() * to->second;
    }
    list.push_back(p);
  }
  return list;
}

bool isGraph(const std::string& path, const std::string& format, TextFile& file) {
  if (format != "auto" || path == "-") return false;
  file = loadText(path);
  return looksLikeGraph(file.text);
}

void diagnose(const DoctorOptions& o, const std::vector<DiagnosedPose>& poses, const DiagnosisOptions& options,
              DiagnosisOutput& output) {
  output.structure = matrixStructure(poses);
  if (output.mode == "plan") {
    std::vector<Convention> of;
    // Those that differ in axes, order and unit; contents are told apart at once.
    for (const Convention& c : options.hypotheses) {
      const CovarianceContent content = options.hypotheses.front().content;
      if (c.content == content && (o.everything || c.unit == RotationUnit::radian)) of.push_back(c);
    }
    output.plan = planDiagnosis(poses, of, options);
  } else if (output.mode == "chain") {
    output.chain = diagnoseChain(poses, options.hypotheses);
  } else {
    output.diagnosis = diagnoseConventions(poses, options);
  }
}

int runDoctor(DoctorOptions o, const Invocation& invocation) {
  o.input.settle();
  DiagnosisOutput output;
  DiagnosedFile file;
  output.mode = o.plan ? "plan" : o.no_truth ? "chain" : "diagnosis";
  DiagnosisOptions options;
  options.alpha = o.alpha;
  if (!o.align.empty()) options.alignment = doctor_alignments.at(o.align);
  const bool has_truth = output.mode == "diagnosis";
  std::vector<std::string> estimates = o.files;
  std::string truth_path;
  if (has_truth || (o.plan && estimates.size() > 1)) {
    if (estimates.size() < 2) {
      throw InputError(doctor_name, 0, "no ground truth", "ESTIMATE REFERENCE, or --no-truth, or --plan");
    }
    truth_path = estimates.back();
    estimates.pop_back();
  }
  if (!has_truth && estimates.size() > 1) throw InputError(doctor_name, 0, "several estimates", "one without a truth");
  std::vector<DiagnosedPose>& poses = file.poses;
  TextFile text;
  if (isGraph(estimates.front(), o.input.estimate.format, text)) {
    if (o.no_truth) throw InputError(text.name, 0, "edges, and --no-truth", "a trajectory, or the true vertices");
    if (estimates.size() > 1) throw InputError(doctor_name, 0, "several graphs", "one, and its truth");
    const PoseGraph graph = parseGraph(text.text, text.name, true);
    if (graph.planar)
      throw InputError(graph.name, 0, "planar edges", "EDGE_SE3:QUAT or EDGE3, whose matrices have six rows");
    std::vector<GraphVertex> vertices;
    if (has_truth) {
      const TextFile truth = loadText(truth_path);
      if (!looksLikeGraph(truth.text)) {
        throw InputError(truth.name, 0, "no vertices", "a graph whose vertices are the truth (VERTEX_SE3:QUAT)");
      }
      vertices = parseGraph(truth.text, truth.name, true).vertices;
      output.reference = truth.name;
    }
    poses = edgesOf(graph, vertices, has_truth);
    if (poses.empty()) {
      throw InputError(graph.name, 0, "no edge joins two vertices of the truth", "vertices with the same numbers");
    }
    output.what = "edges", output.files = {graph.name};
    options.hypotheses = possible(std::nullopt, CovarianceContent::information);
    file.assumed.content = CovarianceContent::information;
    // Successive edges are independent measurements.
    options.alignment = AlignmentModel::none;
  } else {
    std::optional<CovarianceOrder> order;
    Trajectory truth;
    if (!truth_path.empty()) {
      truth = readTimedTrajectory(truth_path, o.input.reference);
      cutTimes(truth, o.input);
      output.reference = truth.name;
    }
    std::vector<std::vector<DiagnosedPose>> runs;
    std::vector<std::vector<double>> times;
    for (const std::string& path : estimates) {
      const Trajectory estimate = readWithCovariances(path, o.input.estimate);
      output.files.push_back(estimate.name);
      order = estimate.fixed_order;
      file.times.by_time = estimate.hasTimes();
      if (estimate.stated_convention) {
        output.notes.push_back(fmt::format("{} states {}", estimate.covariance_source,
                                           conventionName(*estimate.stated_convention, false)));
      }
      std::vector<DiagnosedPose> list;
      std::vector<double> at;
      if (has_truth) {
        list = withTruth(estimate, truth, o, &at, output.notes);
      } else {
        for (std::size_t i = 0; i < estimate.size(); ++i) {
          list.push_back({estimate.poses[i], estimate.covariances[i], estimate.poses[i]});
        }
        if (estimate.hasTimes()) at = estimate.times;
      }
      runs.push_back(list), times.push_back(at);
    }
    options.hypotheses = possible(order, std::nullopt);
    file.assumed.order = order.value_or(file.assumed.order);
    output.what = "poses";
    if (runs.size() == 1) {
      poses = runs[0];
      file.times.values = times[0];
    } else {
      // One residual of each run, at one time: they are independent of each other.
      double last = std::numeric_limits<double>::infinity();
      for (const auto& t : times) last = std::min(last, t.back());
      const double at = o.at.value_or(last);
      for (std::size_t r = 0; r < runs.size(); ++r) {
        const auto nearest = std::min_element(times[r].begin(), times[r].end(),
                                              [&](double a, double b) { return std::abs(a - at) < std::abs(b - at); });
        poses.push_back(runs[r][static_cast<std::size_t>(nearest - times[r].begin())]);
      }
      options.ordered = false;
      options.alignment = AlignmentModel::none;
      if (!o.align.empty())
        throw InputError(doctor_name, 0, "--align with several runs", "runs in the world of the truth");
      output.what = fmt::format("runs at {:.10g} s", at);
    }
  }
  diagnose(o, poses, options, output);
  file.alignment = options.alignment;
  if (file.times.values.empty()) {
    file.times.by_time = false;
    for (std::size_t i = 0; i < poses.size(); ++i) file.times.values.push_back(static_cast<double>(i));
  }
  if (o.json != "-") printLines(formatDiagnosis(output));
  if (!o.json.empty()) {
    JsonObject object = jsonEnvelope(invocation.command_line);
    setDiagnosis(object, output);
    writeJson(o.json, object);
  }
  if (!o.report.empty()) writeDiagnosisReport(o.report, invocation.command_line, output, file);
  return exitCodeOf(output);
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
  command.option("--align", o->align, "The truth is in another world: align each hypothesis by its covariances")
      .oneOf({"posyaw", "se3", "sim3"});
  const Option no_truth =
      command.flag("--no-truth", o->no_truth, "Dead reckoning without a truth: the covariance may only grow");
  command.flag("--plan", o->plan, "What the file can decide and with how many poses, before any error is seen")
      .excludes(no_truth);
  command.flag("--all-units", o->everything, "With --plan: hypotheses with half and double angles and degrees too");
  command.option("--at", o->at, "With several runs: the time of their residuals, s (default: the last common one)");
  command.option("--alpha", o->alpha, "Probability of rejecting the true convention (default 0.001)").range(1e-12, 0.5);
  command.option("--json", o->json, "Write the result to a JSON file ('-': standard output)");
  command.option("--report", o->report, "Write a page with plots into this directory");
  command.run([o](const Invocation& invocation) { return runDoctor(*o, invocation); });
}

}  // namespace liestat::cli
