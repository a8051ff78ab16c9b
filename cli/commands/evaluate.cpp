#include <cli/commands/commands.hpp>
#include <cli/commands/trajectory_input.hpp>
#include <cli/io/input_error.hpp>
#include <cli/io/output_file.hpp>
#include <cli/io/text.hpp>
#include <cli/show/evaluation.hpp>
#include <cli/show/units.hpp>
#include <fusion/convention_diagnosis.hpp>
#include <lie/euler.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace liestat::cli {
namespace {

constexpr const char* evaluate_name = "liestat evaluate";

struct EvaluateOptions {
  std::string reference, cov_from, cov_ref, json, report, save_results, save_rpe;
  std::vector<std::string> estimates, fail_if;
  TrajectoryInputOptions input;
  PoseRelation relation = PoseRelation::trans_part;
  bool align = false, correct_scale = false, align_origin = false;
  std::string alignment, verdict_alignment, plane, unit, pairs_model, delta_unit = "f";
  std::size_t n_to_align = 0, downsample = 0;
  std::vector<double> motion_filter;
  RelativeOptions relative;
};

const std::map<std::string, AlignmentModel> alignment_models{{"none", AlignmentModel::none},
                                                             {"origin", AlignmentModel::origin},
                                                             {"posyaw", AlignmentModel::posyaw},
                                                             {"se3", AlignmentModel::se3},
                                                             {"sim3", AlignmentModel::sim3}};

/// The alignment of APE and RPE.
AlignmentModel errorAlignment(const EvaluateOptions& o) {
  if (!o.alignment.empty()) return alignment_models.at(o.alignment);
  if (o.align_origin) return AlignmentModel::origin;
  if (o.align) return o.correct_scale ? AlignmentModel::sim3 : AlignmentModel::se3;
  return o.correct_scale ? AlignmentModel::scale : AlignmentModel::none;
}
/// The one of the verdict, of the same kind. A scale alone has none, so that sim3 takes its place.
AlignmentModel verdictAlignment(const EvaluateOptions& o) {
  if (!o.verdict_alignment.empty()) return alignment_models.at(o.verdict_alignment);
  const AlignmentModel model = errorAlignment(o);
  return model == AlignmentModel::scale ? AlignmentModel::sim3 : model;
}

/// Evenly spaced poses, and those after which the body has moved, as evo thins a trajectory out.
void thinOut(Trajectory& t, const EvaluateOptions& o) {
  if (o.downsample > 0 && t.size() > o.downsample) {
    std::vector<std::size_t> rows;
    for (std::size_t k = 0; k < o.downsample; ++k) {
      const double at =
          o.downsample == 1
              ? 0
              : static_cast<double>(k) * (static_cast<double>(t.size() - 1) / static_cast<double>(o.downsample - 1));
      rows.push_back(std::min(t.size() - 1, static_cast<std::size_t>(at)));
    }
    if (o.downsample > 1) rows.back() = t.size() - 1;
    t = rowsOf(t, rows);
  }
  if (o.motion_filter.empty()) return;
  std::vector<std::size_t> rows{0};
  double path = 0, turned = 0;
  for (std::size_t i = 1; i < t.size(); ++i) {
    path += (t.poses[i].translation() - t.poses[i - 1].translation()).norm();
    turned += degrees * (t.poses[i - 1].so3().inverse() * t.poses[i].so3()).log().norm();
    if (path < o.motion_filter[0] && turned < o.motion_filter[1]) continue;
    rows.push_back(i);
    path = turned = 0;
  }
  t = rowsOf(t, rows);
}

/// Position into a plane, rotation to the angle about its normal.
SE3d projected(const SE3d& T, int normal) {
  Eigen::Vector3d t = T.translation(), axis = Eigen::Vector3d::Zero();
  t[normal] = 0;
  axis[normal] = toRollPitchYaw(T.so3())[normal];
  return SE3d(SO3d::exp(axis), t);
}

/// A unit of evo's, with what it is a multiple of.
struct NamedUnit {
  const char* base;
  double per_base;
};
const std::map<std::string, NamedUnit> named_units{{"mm", {"m", 1e3}},  {"cm", {"m", 1e2}},  {"m", {"m", 1}},
                                                   {"km", {"m", 1e-3}}, {"rad", {"rad", 1}}, {"deg", {"rad", degrees}}};

std::string unitOfRelation(PoseRelation relation, bool is_relative) {
  switch (relation) {
    case PoseRelation::trans_part:
    case PoseRelation::point_distance:
      return "m";
    case PoseRelation::point_distance_error_ratio:
      return is_relative ? "%" : "m";
    case PoseRelation::angle_deg:
      return "deg";
    case PoseRelation::angle_rad:
      return "rad";
    default:
      return "unit-less";
  }
}
const char* wordsOfRelation(PoseRelation relation) {
  switch (relation) {
    case PoseRelation::full:
      return "full transformation";
    case PoseRelation::trans_part:
      return "translation part";
    case PoseRelation::rot_part:
      return "rotation part";
    case PoseRelation::angle_deg:
    case PoseRelation::angle_rad:
      return "rotation angle";
    case PoseRelation::point_distance:
      return "point distance";
    case PoseRelation::point_distance_error_ratio:
      return "point distance error ratio";
  }
  return "";
}

/// The factor to --change_unit, whose name replaces that of the unit.
double changeUnit(const EvaluateOptions& o, std::string& unit) {
  if (o.unit.empty() || o.unit == unit) return 1;
  const NamedUnit to = named_units.at(o.unit);
  const auto from = named_units.find(unit);
  if (from == named_units.end() || std::string(from->second.base) != to.base) {
    throw InputError(evaluate_name, 0, fmt::format("--change_unit {} of errors in {}", o.unit, unit),
                     "a unit of the same kind");
  }
  unit = o.unit;
  return to.per_base / from->second.per_base;
}

/// evo's words after the title, or others where evo has no such alignment.
std::string alignmentTitle(const EvaluateOptions& o) {
  const AlignmentModel model = errorAlignment(o);
  std::string title = model == AlignmentModel::se3      ? "\n(with SE(3) Umeyama alignment)"
                      : model == AlignmentModel::sim3   ? "\n(with Sim(3) Umeyama alignment)"
                      : model == AlignmentModel::scale  ? "\n(scale corrected)"
                      : model == AlignmentModel::origin ? ""
                      : model == AlignmentModel::posyaw ? "\n(with position and yaw alignment)"
                                                        : "\n(not aligned)";
  if (o.n_to_align > 0 && model != AlignmentModel::none && model != AlignmentModel::origin) {
    title += fmt::format(" (aligned poses: {})", o.n_to_align);
  }
  if (model == AlignmentModel::origin) title += "\n(with origin alignment)";
  if (!o.plane.empty()) title += fmt::format("\n(projected to {} plane)", o.plane);
  if (o.input.association != "nearest") title += "\n(reference interpolated)";
  return title;
}
/// A float as Python prints it, frames as integers.
std::string deltaOf(const RelativeOptions& r) {
  if (r.unit == DeltaUnit::frames) return fmt::format("{}", static_cast<long long>(r.delta));
  const std::string text = fmt::format("{}", r.delta);
  return text.find_first_of(".e") == std::string::npos ? text + ".0" : text;
}
const char* deltaWord(DeltaUnit unit) {
  switch (unit) {
    case DeltaUnit::frames:
      return "frames";
    case DeltaUnit::degrees:
      return "deg";
    case DeltaUnit::radians:
      return "rad";
    case DeltaUnit::meters:
      return "m";
  }
  return "";
}

std::string fileOf(const std::string& path) {
  return path == "-" ? sourceName(path) : printable(std::filesystem::path(path).filename().string(), 200);
}

/// Poses of a file as Gaussians in the library's convention, exact where it has no covariances.
std::vector<Gaussian<SE3d>> gaussiansIn(const Trajectory& t, const std::string& named, std::string_view option,
                                        std::string* words) {
  if (!t.hasCovariances()) {
    if (!named.empty() && words != nullptr) {
      throw InputError(t.name, 0, fmt::format("the file has no covariances, and {} is given", option),
                       "covariances (a file of its name with .cov after it, or a format that has them)");
    }
    return exactPoses(t.poses);
  }
  const std::optional<Convention> given = named.empty() ? std::nullopt : std::optional(conventionNamed(named, option));
  const Convention c = conventionOf(t, given, option);
  if (words != nullptr) *words = describe(c);
  return gaussiansOf(t, c);
}

void noteIndefinite(EvaluatedEstimate& e, const std::vector<std::size_t>& lines) {
  if (e.consistency.indefinite.empty()) return;
  std::string where;
  const std::size_t count = e.consistency.indefinite.size();
  for (std::size_t k = 0; k < std::min<std::size_t>(5, count); ++k) {
    where += fmt::format("{}{}", k > 0 ? ", " : "", lines[e.consistency.indefinite[k]]);
  }
  e.notes.push_back(fmt::format("{} of {} covariances are not positive definite or not known (line{} {}{}): no NEES",
                                count, e.matched.size(), count > 1 ? "s" : "", where, count > 5 ? ", ..." : ""));
}

EvaluatedEstimate evaluateOne(const EvaluateOptions& o, const Trajectory& reference,
                              const std::vector<Gaussian<SE3d>>& reference_poses, const std::string& path,
                              EvaluationOutput& output) {
  EvaluatedEstimate e;
  e.name = fileOf(path);
  Trajectory estimate = readTimedTrajectory(path, o.input.estimate);
  e.poses = estimate.size();
  thinOut(estimate, o);
  const std::vector<Gaussian<SE3d>> poses = gaussiansIn(estimate, o.cov_from, "--cov-from", &e.convention);
  const Associated associated = associate(reference, estimate, o.input);
  e.by_time = associated.by_time;
  e.matched = matchedPoses(associated.matches, reference_poses, poses,
                           o.input.interpolation == "slerp" ? PoseInterpolation::slerp : PoseInterpolation::geodesic);
  if (e.matched.size() < 2) {
    throw InputError(estimate.name, 0, fmt::format("{} pose has a partner in {}", e.matched.size(), reference.name),
                     "at least two");
  }
  std::vector<std::size_t> lines;
  for (const TimeMatch& m : associated.matches) {
    e.times.push_back(associated.by_time ? estimate.times[m.estimate] : static_cast<double>(m.estimate));
    lines.push_back(estimate.lines[m.estimate] > 0 ? estimate.lines[m.estimate] : m.estimate + 1);
  }
  const std::string suspicion = suspectQuaternionOrder(e.matched, reference.name, estimate.name);
  if (!suspicion.empty()) e.notes.push_back(suspicion);

  e.alignment = alignUmeyama(e.matched, errorAlignment(o), o.n_to_align);
  if (!e.alignment.ok) {
    throw InputError(estimate.name, 0, fmt::format("no {} alignment: {}", name(errorAlignment(o)), e.alignment.fault),
                     "another --alignment");
  }
  std::vector<MatchedPose> compared = e.matched;
  Alignment applied = e.alignment;
  if (!o.plane.empty()) {
    const int normal = o.plane == "xy" ? 2 : o.plane == "xz" ? 1 : 0;
    for (MatchedPose& p : compared) {
      p.reference.mean = projected(p.reference.mean, normal);
      p.estimate.mean = projected(e.alignment(p.estimate.mean), normal);
    }
    applied = Alignment{.ok = true};
  }
  e.ape = absoluteErrors(compared, applied, o.relation);
  e.pairs = posePairs(compared, applied, o.relative);
  e.rpe = relativeErrors(compared, applied, e.pairs, o.relation);
  if (e.rpe.empty()) e.notes.push_back("no pairs of poses at the distance of --delta: no RPE");
  output.ape_unit = unitOfRelation(o.relation, false), output.rpe_unit = unitOfRelation(o.relation, true);
  const std::string ape_unit_given = output.ape_unit;
  const double ape_factor = changeUnit(o, output.ape_unit);
  const double rpe_factor = output.rpe_unit == ape_unit_given ? changeUnit(o, output.rpe_unit) : 1;
  for (double& x : e.ape) x *= ape_factor;
  for (double& x : e.rpe) x *= rpe_factor;
  e.ape_statistics = errorStatistics(e.ape), e.rpe_statistics = errorStatistics(e.rpe);
  // Titles name the unit in which the errors are first computed.
  e.ape_title = fmt::format("APE w.r.t. {} ({}){}", wordsOfRelation(o.relation), output.ape_unit, alignmentTitle(o));
  e.rpe_title = fmt::format("RPE w.r.t. {} ({})\nfor delta = {} ({}) using {} pairs{}", wordsOfRelation(o.relation),
                            output.rpe_unit, deltaOf(o.relative), deltaWord(o.relative.unit),
                            o.relative.all_pairs ? "all" : "consecutive", alignmentTitle(o));
  if (!e.hasCovariances()) return e;
  e.weighted = alignWeighted(e.matched, verdictAlignment(o), o.n_to_align);
  e.consistency = evaluateConsistency(e.matched, e.weighted.ok ? e.weighted : Alignment{.ok = true});
  if (!e.weighted.ok) {
    e.consistency.ok = false;
    e.consistency.fault = "no weighted alignment: " + e.weighted.fault;
  }
  noteIndefinite(e, lines);
  if (!o.pairs_model.empty() && !e.pairs.empty()) {
    if (o.relative.all_pairs) {
      throw InputError(evaluate_name, 0, "--pairs-model with --all_pairs", "pairs that do not overlap");
    }
    e.relative =
        relativeConsistency(e.matched, e.pairs, o.pairs_model == "chain" ? PairsModel::chain : PairsModel::independent,
                            e.weighted.ok ? e.weighted.scale : 1);
  }
  return e;
}

/// Conditions NAME>VALUE or NAME<VALUE that hold; NAME of figuresOf. A figure that does not apply fails.
void applyConditions(const EvaluateOptions& o, EvaluationOutput& output) {
  for (const std::string& condition : o.fail_if) {
    const std::size_t at = condition.find_first_of("<>");
    double bound = 0;
    const std::string figure = condition.substr(0, at);
    if (at == std::string::npos ||
        parseNumber(std::string_view(condition).substr(at + 1), bound) != NumberKind::finite) {
      throw InputError("--fail-if", 0, "'" + printable(condition) + "'",
                       "a figure, < or >, and a number: ape_rmse>0.1");
    }
    for (const EvaluatedEstimate& e : output.estimates) {
      const auto figures = figuresOf(e);
      const auto found = std::find_if(figures.begin(), figures.end(), [&](const auto& f) { return f.first == figure; });
      if (found == figures.end()) {
        std::vector<std::string> names;
        for (const auto& f : figures) names.push_back(f.first);
        throw InputError("--fail-if", 0, "'" + printable(figure) + "'", "one of " + joined(names, ", "));
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
  o.input.settle();
  constexpr DeltaUnit units[] = {DeltaUnit::frames, DeltaUnit::degrees, DeltaUnit::radians, DeltaUnit::meters};
  o.relative.unit = units[std::string_view("fdrm").find(o.delta_unit.front())];
  if (!(o.relative.delta > 0) ||
      (o.relative.unit == DeltaUnit::frames && o.relative.delta != std::floor(o.relative.delta))) {
    throw InputError("--delta", 0, fmt::format("{}", o.relative.delta), "a positive number, whole for frames");
  }
  if (o.save_results.size() + o.save_rpe.size() > 0 && o.estimates.size() > 1) {
    throw InputError(evaluate_name, 0, "--save_results with several estimates", "one estimate");
  }
  if (std::count(o.estimates.begin(), o.estimates.end(), "-") + (o.reference == "-" ? 1 : 0) > 1) {
    throw InputError(evaluate_name, 0, "several files are standard input", "one");
  }
  EvaluationOutput output;
  output.reference = fileOf(o.reference);
  Trajectory reference = readTimedTrajectory(o.reference, o.input.reference);
  output.reference_poses = reference.size();
  thinOut(reference, o);
  cutTimes(reference, o.input);
  // A reference is exact unless its covariances are asked for by naming their convention, or it states it.
  Trajectory used = reference;
  if (o.cov_ref.empty() && !used.stated_convention) used.covariances.clear();
  output.reference_has_covariances = used.hasCovariances();
  const std::vector<Gaussian<SE3d>> reference_poses = gaussiansIn(used, o.cov_ref, "--cov-ref", nullptr);
  output.pairs_model = o.pairs_model;
  output.association = o.input.association == "nearest"
                           ? fmt::format("nearest stamps within {:g} s", o.input.max_difference)
                           : fmt::format("reference interpolated ({})", o.input.interpolation);
  for (const std::string& path : o.estimates) {
    output.estimates.push_back(evaluateOne(o, reference, reference_poses, path, output));
  }
  applyConditions(o, output);
  if (o.json != "-") printLines(formatEvaluation(output));
  if (!o.json.empty()) {
    JsonObject object = jsonEnvelope(invocation.command_line);
    setEvaluation(object, output);
    writeJson(o.json, object);
  }
  if (!o.save_results.empty())
    writeOutput(o.save_results, evoResult(output, output.estimates[0], false, o.save_results));
  if (!o.save_rpe.empty()) writeOutput(o.save_rpe, evoResult(output, output.estimates[0], true, o.save_rpe));
  if (!o.report.empty()) writeEvaluationReport(o.report, invocation.command_line, output);
  if (!output.failed.empty()) return exit_validation_failed;
  for (const EvaluatedEstimate& e : output.estimates) {
    if (e.hasCovariances() && !e.consistency.ok) return exit_not_trusted;
  }
  return exit_fine;
}

}  // namespace

void addEvaluateCommand(const CommandList& program) {
  auto o = std::make_shared<EvaluateOptions>();
  const Command command =
      program.add("evaluate", "Trajectories against a reference: APE, RPE, and are the covariances right?");
  command.option("REFERENCE", o->reference, "Ground truth: TUM, KITTI, EuRoC, CSV … ('-': standard input)").required();
  command.option("ESTIMATE", o->estimates, "Estimates, any number of them").required();
  command.option("--cov-from", o->cov_from, "Convention of the estimates' covariances: ros-fixed, left,order=rt …");
  command.option("--cov-ref", o->cov_ref,
                 "Convention of the reference's covariances; without it the reference is exact");
  o->input.declare(command);
  command.choice("-r,--pose_relation,--pose-relation", o->relation,
                 {{"full", PoseRelation::full},
                  {"trans_part", PoseRelation::trans_part},
                  {"rot_part", PoseRelation::rot_part},
                  {"angle_deg", PoseRelation::angle_deg},
                  {"angle_rad", PoseRelation::angle_rad},
                  {"point_distance", PoseRelation::point_distance},
                  {"point_distance_error_ratio", PoseRelation::point_distance_error_ratio}},
                 "Number that is made of an error (default trans_part)");
  command.flag("-a,--align", o->align, "Align positions by least squares (Umeyama)");
  command.flag("-s,--correct_scale,--correct-scale", o->correct_scale, "Scale too; alone: the scale only");
  const Option origin = command.flag("--align_origin,--align-origin", o->align_origin, "Make the first poses agree");
  command.option("--alignment", o->alignment, "Instead of these: the model by its name")
      .oneOf({"none", "origin", "posyaw", "se3", "sim3"})
      .excludes(origin);
  command
      .option("--verdict-alignment", o->verdict_alignment,
              "Model of the weighted alignment of the verdict (default: the same)")
      .oneOf({"none", "origin", "posyaw", "se3", "sim3"});
  command.option("--n_to_align,--n-to-align", o->n_to_align, "Align with the first poses only (default: all)");
  command.option("--project_to_plane,--project-to-plane", o->plane, "Project both after alignment")
      .oneOf({"xy", "xz", "yz"});
  command.option("--change_unit,--change-unit", o->unit, "Unit of APE and RPE")
      .oneOf({"mm", "cm", "m", "km", "deg", "rad"});
  command.option("--downsample", o->downsample, "Keep so many poses of each file, evenly spaced");
  command
      .option("--motion_filter,--motion-filter", o->motion_filter,
              "Keep poses after which the body moved: DISTANCE,DEGREES (m, deg)")
      .list(2, 2)
      .notNegative();
  command.option("-d,--delta", o->relative.delta, "Distance of the poses of a pair (default 1)").positive();
  command.option("-u,--delta_unit,--delta-unit", o->delta_unit, "Its unit: frames, deg, rad, m (default f)")
      .oneOf({"f", "d", "r", "m"});
  command
      .option("-t,--delta_tol,--delta-tol", o->relative.relative_tolerance,
              "Relative tolerance of the distance, for all pairs (default 0.1)")
      .notNegative();
  command.flag("--all_pairs,--all-pairs", o->relative.all_pairs, "All pairs instead of consecutive ones");
  command.flag("--pairs_from_reference,--pairs-from-reference", o->relative.pairs_from_reference,
               "Measure the distance along the reference");
  command
      .option("--pairs-model", o->pairs_model,
              "NEES of relative motions, if errors of a pair are independent, or a chain (dead reckoning)")
      .oneOf({"independent", "chain"});
  command.option("--fail-if", o->fail_if, "Exit with 1 if a figure is beyond a bound: ape_rmse>0.1,consistent<1")
      .list();
  command.option("--save_results,--save-results", o->save_results, "Write APE as a result file of evo (.zip)");
  command.option("--save_rpe,--save-rpe", o->save_rpe, "Write RPE as a result file of evo (.zip)");
  command.option("--json", o->json, "Write the result to a JSON file ('-': standard output)");
  command.option("--report", o->report, "Directory for a page with trajectories, errors and NEES over time");
  command.run([o](const Invocation& invocation) { return runEvaluate(*o, invocation); });
}

}  // namespace liestat::cli
