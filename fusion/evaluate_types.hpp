// Input, options and result of evaluateTrajectory (fusion/evaluate.hpp). (Needs Boost.Math.)
#pragma once

#include <fusion/trajectories_types.hpp>
#include <fusion/trajectory_misfit_types.hpp>
#include <stats/verdict.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace liestat {

// Input
// ------------------------------------------------------------------------------------------------------------------

/// Poses with their times. What is in words is for sentences alone.
struct PoseTrajectory {
  std::vector<double> times = {};          ///< s, strictly ascending; empty: pose i belongs to the other's pose i
  NoisyPoses poses = {};                   ///< world_T_body; covariances in the library's convention
  bool has_covariances = false;            ///< false: those of the poses are taken as zero
  std::string name = {};                   ///< "est.tum"; empty: "the estimate", "the reference"
  std::string covariance_convention = {};  ///< the convention from which the covariances were converted
  std::vector<std::size_t> lines = {};     ///< line of the file for each pose; empty: there is none
};

// Options
// ----------------------------------------------------------------------------------------------------------------

/// The pose of the reference that an estimated pose is compared with.
enum class AssociationRule {
  interpolate,  ///< at the time of the estimate, between two stamps
  nearest       ///< at the nearest stamp, as evo: the motion in between becomes a part of the error
};
constexpr auto words(AssociationRule) { return std::array{"interpolate", "nearest"}; }

struct AssociationOptions {
  AssociationRule rule = AssociationRule::interpolate;
  PoseInterpolation interpolation = PoseInterpolation::cubic;
  /// s, between two stamps of the reference; else five times their median distance.
  std::optional<double> max_gap = {};
  double max_difference = 0.01;                ///< s, of nearest stamps
  double offset = 0;                           ///< s, added to the estimate's times
  std::optional<double> start = {}, end = {};  ///< s, of the reference; the estimate keeps all of its poses
};

/// A plane of the world. Positions are projected into it, rotations to the angle about its normal.
enum class CoordinatePlane { xy, xz, yz };
constexpr auto words(CoordinatePlane) { return std::array{"xy", "xz", "yz"}; }

/// A unit of errors.
enum class ErrorUnit { mm, cm, m, km, deg, rad };
constexpr auto words(ErrorUnit) { return std::array{"mm", "cm", "m", "km", "deg", "rad"}; }

/// Keeps poses after which the body has moved so far along its path since the last one that was kept, or is turned so
/// far against it: as evo.
struct MotionThinning {
  double distance = 0, degrees = 0;  ///< m, degrees
};

/// Options of evaluateTrajectory. Those of evo have its meaning.
struct EvaluationOptions {
  AssociationOptions association = {};
  PoseRelation pose_relation = PoseRelation::trans_part;
  AlignmentModel alignment = AlignmentModel::none;       ///< least-squares alignment for APE and RPE
  std::optional<AlignmentModel> verdict_alignment = {};  ///< weighted by the covariances; else the same
  std::size_t n_to_align = 0;                            ///< the first poses; 0: all
  std::optional<CoordinatePlane> project_to_plane = {};  ///< both, after the alignment
  std::optional<ErrorUnit> change_unit = {};             ///< unit of APE, and of RPE if it has the same unit
  std::size_t downsample = 0;                            ///< so many poses of each, evenly spaced; 0: all
  std::optional<MotionThinning> motion_filter = {};      ///< applied to both, after downsample
  RelativeOptions relative = {};                         ///< pairs of RPE
  std::optional<PairsModel> pairs_model = {};            ///< NEES of relative motions; else there is none
  bool segments = true;                                  ///< errors by the length of a segment
  bool misfit = false;                                   ///< looks for faults of the whole run (findMisfit)

  /// The model of the weighted alignment. A scale alone has none: positions that need a scale are aligned by sim3.
  AlignmentModel verdictAlignment() const {
    const AlignmentModel model = verdict_alignment.value_or(alignment);
    return model == AlignmentModel::scale ? AlignmentModel::sim3 : model;
  }
};

/// The options by their names in the program and in Python.
template <class V>
void describe(V& v, const EvaluationOptions& o) {
  const auto word = [](const auto& choice) {
    return choice ? std::optional<std::string>(name(*choice)) : std::nullopt;
  };
  v("association", name(o.association.rule))("interpolation", name(o.association.interpolation));
  v("max_gap", o.association.max_gap, "", "s")("t_max_diff", o.association.max_difference, "", "s");
  v("t_offset", o.association.offset, "", "s");
  v("t_start", o.association.start, "", "s")("t_end", o.association.end, "", "s");
  v("pose_relation", name(o.pose_relation))("alignment", name(o.alignment));
  v("verdict_alignment", word(o.verdict_alignment))("n_to_align", o.n_to_align);
  v("project_to_plane", word(o.project_to_plane))("change_unit", word(o.change_unit))("downsample", o.downsample);
  v("motion_filter",
    o.motion_filter ? std::optional(Eigen::Vector2d(o.motion_filter->distance, o.motion_filter->degrees))
                    : std::nullopt,
    "", "m, deg");
  v("delta", o.relative.delta)("delta_unit", name(o.relative.unit))("delta_tol", o.relative.relative_tolerance);
  v("all_pairs", o.relative.all_pairs)("pairs_from_reference", o.relative.pairs_from_reference);
  v("pairs_model", word(o.pairs_model))("misfit", o.misfit);
}

// Result
// -----------------------------------------------------------------------------------------------------------------

/// How an evaluation ended; what is not `ok` comes with a reason.
enum class EvaluationStatus {
  ok,
  bad_options,        ///< delta is not positive, or no whole number of frames
  other_unit,         ///< change_unit is not of the kind of the errors
  bad_times,          ///< times that do not ascend, or fewer or more than poses
  times_missing,      ///< one trajectory has times, the other has none; or a part is asked for without times
  unequal_rows,       ///< without times, and not as many poses in both
  empty_interval,     ///< no pose of the reference between start and end
  no_overlap,         ///< the times do not overlap
  no_match,           ///< they overlap, but no pose has a partner
  too_few,            ///< fewer than two poses have a partner
  not_aligned,        ///< the positions do not determine the alignment: there are no errors
  overlapping_pairs,  ///< a pairs_model with all_pairs, whose motions are not independent
};
constexpr auto words(EvaluationStatus) {
  return std::array{"ok",           "bad_options",      "other_unit", "bad_times", "times_missing",
                    "unequal_rows", "empty_interval",   "no_overlap", "no_match",  "too_few",
                    "not_aligned",  "overlapping_pairs"};
}

/// The partners of poses.
struct Associated {
  EvaluationStatus status = EvaluationStatus::ok;
  std::string reason = {};
  std::vector<TimeMatch> matches = {};
  bool by_time = true;  ///< false: pose i with pose i
  double max_gap = 0;   ///< s, as it was applied

  bool ok() const { return status == EvaluationStatus::ok; }
};

/// Errors of the relative motion over all segments of a length, measured along the reference.
struct SegmentErrors {
  double length = 0;                                ///< m
  std::size_t pairs = 0;                            ///< segments, which overlap
  ErrorStatistics translation = {}, rotation = {};  ///< m, deg
  /// Quantiles at 5, 25, 50, 75 and 95 %.
  std::array<double, 5> translation_quantiles = {}, rotation_quantiles = {};
};
template <class V>
void describe(V& v, const SegmentErrors& s) {
  v("length", s.length, "along the reference", "m")("pairs", s.pairs, "segments");
  v("translation", s.translation, "", "m")("rotation", s.rotation, "", "deg");
}

/// A trajectory against a reference. Lists with one entry for each matched pose are in the order of the estimate.
struct TrajectoryEvaluation {
  EvaluationStatus status = EvaluationStatus::ok;
  std::string reason = {};

  std::size_t reference_poses = 0, poses = 0;  ///< that were given
  std::string association = {};                ///< in words
  std::string ape_unit = {}, rpe_unit = {};
  std::optional<PairsModel> pairs_model = {};
  std::string covariance_convention = {};
  bool has_covariances = false;  ///< the estimate has covariances

  bool by_time = true;
  std::vector<std::size_t> rows = {};  ///< rows of the estimate: the matched poses
  std::vector<double> times = {};      ///< s; without times the numbers of the rows that were not thinned out
  MatchedPoses matched = {};
  Alignment alignment = {};                                        ///< alignment for APE and RPE
  std::vector<double> ape = {}, rpe = {};                          ///< in their units
  std::vector<std::pair<std::size_t, std::size_t>> pairs = {};     ///< pairs of matched poses for RPE
  std::vector<double> position_errors = {}, rotation_errors = {};  ///< m and rad, whatever the pose relation
  ErrorStatistics ape_statistics = {}, rpe_statistics = {};
  std::vector<SegmentErrors> segments = {};  ///< by ascending length; empty if they were not asked for
  InterpolationError interpolation = {};     ///< of the reference; the verdict allows for it
  Alignment weighted = {};                   ///< alignment for the verdict
  Consistency consistency = {};
  std::optional<RelativeConsistency> relative = {};
  MisfitSearch misfit = {};  ///< faults of the whole run, where they were asked for
  std::vector<std::string> notes = {};

  bool ok() const { return status == EvaluationStatus::ok; }
  /// The interpolation's error is more than a tenth of the estimate's errors.
  bool referenceIsCoarse() const;
  /// Verdict on the covariances of the estimate: are they to be trusted?
  Verdict verdict() const;
};

inline bool TrajectoryEvaluation::referenceIsCoarse() const {
  constexpr double share = 0.1;
  const auto exceeds = [](double error, const std::vector<double>& errors) {
    double squares = 0;
    for (const double e : errors) squares += e * e;
    return error * error * static_cast<double>(errors.size()) > share * share * squares;
  };
  return exceeds(interpolation.position, position_errors) || exceeds(interpolation.rotation, rotation_errors);
}

inline Verdict TrajectoryEvaluation::verdict() const {
  if (!ok()) return Verdict::none("no verdict: " + reason);
  if (!has_covariances) return Verdict::none("no verdict: the estimate has no covariances");
  const Consistency& c = consistency;
  if (!c.ok) return Verdict::none("no verdict: " + c.fault);
  const auto judged = [&](bool good, std::string text) {
    return Verdict{good ? Verdict::Answer::yes : Verdict::Answer::no, std::move(text), c.tests.causes()};
  };
  const auto share = [](const ResidualTest& t) { return significant(t.ratio(), 3) + " of its expectation"; };
  const std::string where = c.tests.components.omits() ? " in " + c.tests.components.judged() : "";
  if (c.tests.lag.fires() && c.tests.lag.statistic > 0) {
    // Errors of any dependence are not as large as this.
    if (c.tests.gross.fires()) {
      return judged(false, "OVERCONFIDENT" + where +
                               ": errors are correlated in time, but a fifth of the poses has a NEES above " +
                               significant(c.tests.gross.statistic, 3) + " of " + significant(c.tests.gross.dof, 2) +
                               " expected, which no correlation explains (p " + significant(c.tests.gross.p, 2) + ")");
    }
    if (!relative || !relative->joint.applies()) {
      return Verdict::none("no verdict: errors are correlated in time, and NEES of absolute errors (" + share(c.joint) +
                               ") is no test then; " +
                               (referenceIsCoarse() ? "between the stamps of a coarse reference they always are"
                                                    : "--pairs-model chain tests dead reckoning, doctor looks further"),
                           c.tests.causes());
    }
    const bool good = !relative->joint.fires();
    return judged(good, std::string(good ? "consistent" : "INCONSISTENT") +
                            ": errors are correlated in time, and NEES of relative motions is " +
                            share(relative->joint) + " (p " + significant(relative->joint.p, 2) + ")");
  }
  const bool good = c.tests.consistent();
  if (!good && !c.joint.fires()) {
    return judged(
        false, "INCONSISTENT" + where + ": NEES is " + share(c.joint) + ", but errors do not follow the covariances");
  }
  return judged(good, std::string(good                  ? "consistent"
                                  : c.joint.ratio() > 1 ? "OVERCONFIDENT"
                                                        : "UNDERCONFIDENT") +
                          where + ": NEES is " + share(c.joint) + " (p " + significant(c.joint.p, 2) + ", " +
                          significant(c.joint.dof, 17) + " degrees of freedom)");
}

// Descriptions
// -----------------------------------------------------------------------------------------------------------

/// Fields that are the same for all estimates of a run.
template <class V>
void describeSetting(V& v, const TrajectoryEvaluation& e) {
  v("reference_poses", e.reference_poses, "their number")("association", e.association, "in words");
  v("ape_unit", e.ape_unit, "m, deg, … or empty")("rpe_unit", e.rpe_unit, "likewise");
  v("pairs_model", e.pairs_model ? std::optional<std::string>(name(*e.pairs_model)) : std::nullopt,
    "independent or chain: the errors of a pair");
}

template <class V>
void describe(V& v, const TrajectoryEvaluation& e) {
  describe(v, e.verdict());
  v("poses", e.poses, "of the estimate")("matched", e.matched.size(), "of them that have a partner");
  v("by_time", e.by_time, "false: pose i with pose i");
  v("ape", e.ape_statistics, "absolute errors")("rpe", e.rpe_statistics, "relative errors");
  v("rpe_pairs", e.pairs.size(), "pairs of RPE")("alignment", e.alignment, "of APE and RPE");
  v("interpolation_position", e.interpolation.position, "error of the interpolated reference, rms", "m");
  v("interpolation_rotation", e.interpolation.rotation, "likewise", "rad");
  v("weighted_alignment", e.weighted, "of the verdict");
  v("covariance_convention", e.has_covariances ? std::optional(e.covariance_convention) : std::nullopt,
    "of the file; null: it has no covariances");
  v("misfit", e.misfit, "faults of the whole run that are no noise");
  v("judged", e.consistency.tests.components.judged(), "components of the errors that carry noise");
  v("omissions", e.consistency.tests.components.omissions(), "the other components, with the reason");
  v("tests", e.consistency.tests, "of the whitened errors");
  v("rpe_nees", e.relative ? std::optional(e.relative->joint) : std::nullopt, "of relative motions");
  v("indefinite", e.consistency.indefinite, "matched poses whose covariance is not positive definite");
  v("notes", e.notes, "what is remarkable, in sentences");
  v("segments", e.segments, "errors by the length of a segment");
}

/// One row for each matched pose, or for each pair of RPE.
template <class V>
void describeSeries(V& v, const TrajectoryEvaluation& e) {
  const std::vector<PoseError>& errors = e.consistency.errors;
  const auto n = static_cast<Eigen::Index>(errors.size());
  Eigen::Matrix<double, Eigen::Dynamic, 6> xi(n, 6);
  Eigen::Matrix<double, Eigen::Dynamic, 36> covariances(n, 36);
  std::vector<double> nees;
  for (Eigen::Index i = 0; i < n; ++i) {
    const PoseError& error = errors[static_cast<std::size_t>(i)];
    xi.row(i) = error.error.transpose();
    for (int k = 0; k < 36; ++k) covariances(i, k) = error.covariance(k / 6, k % 6);
    nees.push_back(error.nees);
  }
  std::vector<std::size_t> from, to;
  for (const auto& [i, j] : e.pairs) from.push_back(i), to.push_back(j);
  v("rows", e.rows, "of the estimate")("times", e.times, "", "s");
  v("ape_errors", e.ape, "", "ape_unit")("rpe_errors", e.rpe, "of the pairs", "rpe_unit")("pairs_from", from)(
      "pairs_to", to);
  v("position_errors", e.position_errors, "", "m")("rotation_errors", e.rotation_errors, "", "rad");
  v("errors", xi, "after the weighted alignment, translation before rotation, body axes", "m, rad");
  v("covariances", covariances, "of the errors, row by row", "m, rad")(
      "nees", nees, "chi-squared of the number of judged components");
}

/// The figures that pipelines compare with bounds (`--fail-if`), by their short names; see NamedFigures in
/// report/describe.hpp.
template <class V>
void describeFigures(V& v, const TrajectoryEvaluation& e) {
  const Consistency& c = e.consistency;
  const ResidualTest relative = e.relative ? e.relative->joint : ResidualTest{};
  v("ape", e.ape_statistics)("rpe", e.rpe_statistics)("nees", c.joint.ratio())("nees_p", c.joint.p);
  v("position_nees", c.position.ratio())("rotation_nees", c.rotation.ratio());
  v("rpe_nees", relative.ratio())("rpe_nees_p", relative.p)("consistent", e.verdict().decided());
  v("matched", e.matched.size());
  v("matched_share", static_cast<double>(e.matched.size()) / static_cast<double>(std::max<std::size_t>(1, e.poses)));
}

}  // namespace liestat
