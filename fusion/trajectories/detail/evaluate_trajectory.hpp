// Definitions of fusion/evaluate.hpp.
#pragma once

#include <fusion/evaluate.hpp>
#include <fusion/trajectories/detail/quaternion_order.hpp>
#include <fusion/trajectories/detail/run_misfit.hpp>
#include <fusion/trajectory_misfit.hpp>
#include <lie/euler.hpp>
#include <lie/units.hpp>
#include <stats/quantile.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace liestat {

namespace detail {

inline constexpr double degrees_per_radian = 1 / units::degree;

inline bool ascendsStrictly(std::span<const double> times) {
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (!std::isfinite(times[i]) || (i > 0 && !(times[i] > times[i - 1]))) return false;
  }
  return true;
}

inline std::string spanInWords(std::span<const double> times) {
  return significant(times.front(), 10) + " to " + significant(times.back(), 10) + " s";
}

inline std::string inWords(const AssociationOptions& o) {
  return o.rule == AssociationRule::nearest ? "nearest stamps within " + significant(o.max_difference, 6) + " s"
                                            : std::string("reference interpolated (") + name(o.interpolation) + ")";
}

/// A trajectory without the poses that the options leave out. Where they leave out none, nothing is copied.
class ThinnedTrajectory {
 public:
  ThinnedTrajectory(const PoseTrajectory& whole, const EvaluationOptions& o) : whole_(whole) {
    if (o.downsample > 0 && size() > o.downsample) spaceEvenly(o.downsample);
    if (o.motion_filter && size() > 0) keepMoved(*o.motion_filter);
  }

  /// Keeps some of the rows that are left.
  void keep(std::span<const std::size_t> of_left) {
    std::vector<std::size_t> rows;
    for (const std::size_t i : of_left) rows.push_back(rowOf(i));
    take(std::move(rows));
  }

  std::span<const double> times() const { return rows_ ? times_ : whole_.times; }
  const NoisyPoses& poses() const { return rows_ ? poses_ : whole_.poses; }
  std::size_t rowOf(std::size_t of_left) const { return rows_ ? (*rows_)[of_left] : of_left; }

 private:
  std::size_t size() const { return poses().size(); }
  const SE3d& pose(std::size_t i) const { return whole_.poses.mean(rowOf(i)); }

  /// evo's rows: whole parts of evenly spaced numbers, with the first and the last one.
  void spaceEvenly(std::size_t count) {
    const std::size_t last = size() - 1;
    std::vector<std::size_t> rows;
    for (std::size_t k = 0; k < count; ++k) {
      const double at =
          count == 1 ? 0 : static_cast<double>(k) * (static_cast<double>(last) / static_cast<double>(count - 1));
      rows.push_back(std::min(last, static_cast<std::size_t>(at)));
    }
    if (count > 1) rows.back() = last;
    take(std::move(rows));
  }

  /// evo's rows: the path is summed from pose to pose, the angle is that from the last pose that was kept.
  void keepMoved(const MotionThinning& least) {
    std::vector<std::size_t> rows{rowOf(0)};
    double path = 0;
    std::size_t kept = 0;
    for (std::size_t i = 1; i < size(); ++i) {
      path += (pose(i).translation() - pose(i - 1).translation()).norm();
      const double turned = degrees_per_radian * (pose(kept).so3().inverse() * pose(i).so3()).log().norm();
      if (path < least.distance && turned < least.degrees) continue;
      rows.push_back(rowOf(i));
      path = 0, kept = i;
    }
    take(std::move(rows));
  }

  void take(std::vector<std::size_t> rows) {
    times_.clear();
    for (const std::size_t i : rows) {
      if (!whole_.times.empty()) times_.push_back(whole_.times[i]);
    }
    poses_ = whole_.poses.rows(rows);
    rows_ = std::move(rows);
  }

  const PoseTrajectory& whole_;
  std::optional<std::vector<std::size_t>> rows_;  // that are left, unless all are
  std::vector<double> times_;
  NoisyPoses poses_;
};

inline SE3d projected(const SE3d& T, CoordinatePlane plane) {
  const int normal = plane == CoordinatePlane::xy ? 2 : plane == CoordinatePlane::xz ? 1 : 0;
  Eigen::Vector3d t = T.translation(), axis = Eigen::Vector3d::Zero();
  t[normal] = 0;
  axis[normal] = toRollPitchYaw(T.so3())[normal];
  return SE3d(SO3d::exp(axis), t);
}

inline std::string unitOf(PoseRelation relation, bool is_relative) {
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

/// The factor from a unit to another one of its kind; NaN where they are of two kinds.
inline double unitFactor(std::string_view from, ErrorUnit to) {
  struct Scale {
    bool is_angle;
    double per_base;  // units in one metre or radian
  };
  constexpr std::array<Scale, 6> scales{
      {{false, 1e3}, {false, 1e2}, {false, 1}, {false, 1e-3}, {true, degrees_per_radian}, {true, 1}}};
  if (from == name(to)) return 1;
  const std::optional<ErrorUnit> known = named<ErrorUnit>(from);
  if (!known) return not_a_number;
  const Scale a = scales[static_cast<std::size_t>(*known)], b = scales[static_cast<std::size_t>(to)];
  return a.is_angle == b.is_angle ? b.per_base / a.per_base : not_a_number;
}

/// Median angle between the relative rotations of both trajectories over a fifth of the run.
inline double rotationDisagreement(MatchedRange poses, bool swap_reference, bool swap_estimate) {
  std::vector<double> angles;
  const std::size_t lag = std::max<std::size_t>(1, poses.size() / 5);
  const std::size_t step = std::max<std::size_t>(1, poses.size() / 500);
  const auto relative = [](const SE3d& a, const SE3d& b, bool swapped) {
    const SO3d A = a.so3(), B = b.so3();
    return swapped ? SO3d(wFirst(A).inverse() * wFirst(B)) : SO3d(A.inverse() * B);
  };
  for (std::size_t i = 0; i + lag < poses.size(); i += step) {
    const SO3d reference = relative(poses.reference(i), poses.reference(i + lag), swap_reference);
    const SO3d estimate = relative(poses.estimate(i), poses.estimate(i + lag), swap_estimate);
    angles.push_back((reference.inverse() * estimate).log().norm());
  }
  if (angles.empty()) return not_a_number;
  std::sort(angles.begin(), angles.end());
  return angles[angles.size() / 2];
}

inline std::string noteOfCoarseReference(const TrajectoryEvaluation& e) {
  const auto part = [](double error, const std::vector<double>& errors) {
    return significant(std::round(100 * error / errorStatistics(errors).rmse)) + " %";
  };
  return "the reference is coarse: its interpolation is off by " + significant(e.interpolation.position, 3) +
         " m and " + significant(e.interpolation.rotation, 3) + " rad (rms, by leaving out every second stamp), " +
         part(e.interpolation.position, e.position_errors) + " and " +
         part(e.interpolation.rotation, e.rotation_errors) +
         " of the errors; NEES allows for it, APE and RPE contain it";
}

/// Errors by the length of a segment: multiples of 8 m, or of 8 times 1, 2, 5 · 10ᵏ m where a path is too short or too
/// long for three to eight of them.
inline std::vector<SegmentErrors> segmentErrors(const MatchedPoses& poses, const Alignment& alignment) {
  double path = 0;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    path += (poses.reference.mean(i).translation() - poses.reference.mean(i - 1).translation()).norm();
  }
  std::vector<SegmentErrors> segments;
  if (!(path > 1e-6) || !(path < 1e12)) return segments;
  double step = 0;
  for (int k = -8; k < 12 && step == 0; ++k) {
    for (const double factor : {8.0, 16.0, 40.0}) {
      if (step == 0 && 9 * factor * std::pow(10, k) > 0.8 * path) step = factor * std::pow(10, k);
    }
  }
  if (step < 8 && 3 * 8 <= 0.8 * path) step = 8;
  for (double length = step; length <= 0.8 * path && segments.size() < 8; length += step) {
    auto pairs =
        posePairs(poses, alignment,
                  {.delta = length, .unit = DeltaUnit::meters, .all_pairs = true, .pairs_from_reference = true});
    SegmentErrors s{.length = length, .pairs = pairs.size()};
    if (pairs.empty()) continue;
    const auto fill = [&](PoseRelation relation, ErrorStatistics& statistics, std::array<double, 5>& quantiles) {
      const std::vector<double> errors = relativeErrors(poses, alignment, pairs, relation);
      statistics = errorStatistics(errors);
      constexpr std::array shares{0.05, 0.25, 0.5, 0.75, 0.95};
      for (std::size_t q = 0; q < shares.size(); ++q) quantiles[q] = quantile(errors, shares[q]);
    };
    fill(PoseRelation::trans_part, s.translation, s.translation_quantiles);
    fill(PoseRelation::angle_deg, s.rotation, s.rotation_quantiles);
    segments.push_back(s);
  }
  return segments;
}

inline std::string noteOfIndefinite(const TrajectoryEvaluation& e, const std::vector<std::size_t>& lines) {
  constexpr std::size_t shown = 5;
  const std::vector<std::size_t>& indefinite = e.consistency.indefinite;
  std::string where;
  for (std::size_t k = 0; k < std::min(shown, indefinite.size()); ++k) {
    const std::size_t row = e.rows[indefinite[k]];
    where += (k > 0 ? ", " : "") + std::to_string(lines.empty() ? row : lines[row]);
  }
  return std::to_string(indefinite.size()) + " of " + std::to_string(e.matched.size()) +
         " covariances are not positive definite or not known (" + (lines.empty() ? "pose" : "line") +
         (indefinite.size() > 1 ? "s " : " ") + where + (indefinite.size() > shown ? ", ..." : "") + "): no NEES";
}

}  // namespace detail

LIESTAT_FUSION_INLINE Associated associate(const PoseStamps& reference, const PoseStamps& estimate,
                                           const AssociationOptions& options) {
  Associated a;
  const std::string reference_name(reference.name);
  const auto refuse = [&a](EvaluationStatus status, std::string reason) {
    a.status = status, a.reason = std::move(reason);
    return a;
  };
  for (const PoseStamps* t : {&reference, &estimate}) {
    if ((!t->times.empty() && t->times.size() != t->poses) || !detail::ascendsStrictly(t->times)) {
      return refuse(EvaluationStatus::bad_times,
                    std::string(t->name) + " does not have ascending times, one for each pose");
    }
  }
  if (reference.times.empty() != estimate.times.empty()) {
    const auto& [without, with] =
        reference.times.empty() ? std::pair(&reference, &estimate) : std::pair(&estimate, &reference);
    return refuse(EvaluationStatus::times_missing,
                  std::string(without->name) + " has no times, and " + std::string(with->name) + " has");
  }
  a.by_time = !reference.times.empty();
  if (!a.by_time) {
    if (reference.poses != estimate.poses) {
      return refuse(EvaluationStatus::unequal_rows, std::to_string(estimate.poses) + " poses without times, and " +
                                                        std::to_string(reference.poses) + " in " + reference_name);
    }
    for (std::size_t i = 0; i < estimate.poses; ++i) a.matches.push_back({i, i, 0, 0});
    return a;
  }
  const bool nearest = options.rule == AssociationRule::nearest;
  a.max_gap = nearest ? options.max_difference : options.max_gap ? *options.max_gap : 5 * medianStep(reference.times);
  a.matches = nearest ? associateNearest(reference.times, estimate.times, a.max_gap, options.offset)
                      : associateByInterpolation(reference.times, estimate.times, a.max_gap, options.offset);
  if (!a.matches.empty()) return a;
  const bool overlap = reference.times.front() <= estimate.times.back() + options.offset &&
                       estimate.times.front() + options.offset <= reference.times.back();
  if (!overlap) {
    return refuse(EvaluationStatus::no_overlap, "its times, " + detail::spanInWords(estimate.times) +
                                                    ", do not overlap those of " + reference_name + ", " +
                                                    detail::spanInWords(reference.times));
  }
  const std::string gap = significant(a.max_gap, 6);
  return refuse(EvaluationStatus::no_match,
                nearest ? "no stamp is within " + gap + " s of one of " + reference_name
                        : "no stamp lies between two of " + reference_name + " that are " + gap + " s apart at most");
}

LIESTAT_FUSION_INLINE std::vector<std::size_t> rowsBetween(std::span<const double> times, std::optional<double> start,
                                                           std::optional<double> end) {
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < times.size(); ++i) {
    if ((!start || times[i] >= *start) && (!end || times[i] <= *end)) rows.push_back(i);
  }
  return rows;
}

LIESTAT_FUSION_INLINE std::string suspectQuaternionOrder(MatchedRange poses, std::string_view reference,
                                                         std::string_view estimate) {
  if (poses.size() < 10) return {};
  const double as_read = detail::rotationDisagreement(poses, false, false);
  if (!(as_read > 0.1)) return {};
  const double of_estimate = detail::rotationDisagreement(poses, false, true),
               of_reference = detail::rotationDisagreement(poses, true, false);
  const double better = std::min(of_estimate, of_reference);
  if (!(better < 0.2 * as_read)) return {};
  return "the quaternions of " + std::string(of_estimate <= of_reference ? estimate : reference) +
         " look as if w came first: relative rotations then differ by " + significant(better, 3) + " rad, and by " +
         significant(as_read, 3) + " rad as x y z w";
}

LIESTAT_FUSION_INLINE TrajectoryEvaluation evaluateTrajectory(const PoseTrajectory& reference, PoseTrajectory estimate,
                                                              const EvaluationOptions& o) {
  TrajectoryEvaluation e;
  const std::string reference_name = reference.name.empty() ? "the reference" : reference.name;
  const std::string estimate_name = estimate.name.empty() ? "the estimate" : estimate.name;
  const auto refuse = [&e](EvaluationStatus status, std::string reason) -> TrajectoryEvaluation& {
    e.status = status, e.reason = std::move(reason);
    return e;
  };
  e.reference_poses = reference.poses.size(), e.poses = estimate.poses.size();
  e.association = detail::inWords(o.association), e.pairs_model = o.pairs_model;
  e.has_covariances = estimate.has_covariances, e.covariance_convention = estimate.covariance_convention;
  e.ape_unit = detail::unitOf(o.pose_relation, false), e.rpe_unit = detail::unitOf(o.pose_relation, true);
  if (!(o.relative.delta > 0) ||
      (o.relative.unit == DeltaUnit::frames && o.relative.delta != std::floor(o.relative.delta))) {
    return refuse(EvaluationStatus::bad_options, "delta is " + significant(o.relative.delta, 6) +
                                                     ", and a positive number is expected, whole for frames");
  }
  const double factor = o.change_unit ? detail::unitFactor(e.ape_unit, *o.change_unit) : 1;
  if (!(factor > 0)) {
    return refuse(EvaluationStatus::other_unit, "errors in " + e.ape_unit + " have no unit " + name(*o.change_unit));
  }

  detail::ThinnedTrajectory truth(reference, o);
  const detail::ThinnedTrajectory left(estimate, o);
  if (o.association.start || o.association.end) {
    if (reference.times.empty()) {
      return refuse(EvaluationStatus::times_missing, reference_name + " has no times, and a part of it is asked for");
    }
    const auto rows = rowsBetween(truth.times(), o.association.start, o.association.end);
    if (rows.empty()) {
      return refuse(EvaluationStatus::empty_interval, "no pose of " + reference_name + " is between the given times");
    }
    truth.keep(rows);
  }
  Associated association = associate({truth.times(), truth.poses().size(), reference_name},
                                     {left.times(), left.poses().size(), estimate_name}, o.association);
  e.by_time = association.by_time;
  const auto withTimes = [&](std::string reason) {
    return detail::reasonWithTimes(std::move(reason), left.times(), left.poses(), truth.times(), truth.poses(),
                                   o.association.offset);
  };
  if (!association.ok()) {
    const bool times = detail::lacksPartners(association.status);
    return refuse(association.status, times ? withTimes(association.reason) : association.reason);
  }
  e.matched =
      matchedPoses(association.matches, truth.poses(), left.poses(), o.association.interpolation, truth.times());
  if (e.matched.size() < 2) {
    return refuse(EvaluationStatus::too_few,
                  withTimes(std::to_string(e.matched.size()) + " pose has a partner in " + reference_name));
  }
  // Times in another unit give next to no partners: that is said unasked.
  const bool few = e.by_time && detail::fewPartners(e.matched.size(), left.times().size());
  if (!o.misfit && !few) estimate.poses = {};
  if (!reference.has_covariances) e.matched.reference.forgetCovariances();
  if (!estimate.has_covariances) e.matched.estimate.forgetCovariances();
  // The verdict alone needs the covariances of the error, which would be most of the memory.
  e.interpolation = addInterpolationError(association.matches, truth.poses(), truth.times(),
                                          o.association.interpolation, e.matched, e.has_covariances ? 1 : 0);
  e.times.reserve(e.matched.size()), e.rows.reserve(e.matched.size());
  for (const TimeMatch& m : association.matches) {
    e.times.push_back(e.by_time ? left.times()[m.estimate] : static_cast<double>(m.estimate));
    e.rows.push_back(left.rowOf(m.estimate));
  }
  if (o.misfit || few) {
    // Where most have no partner all of them tell of their times.
    const PoseStream stream = detail::streamOf(e.by_time ? truth.times() : std::span<const double>(), truth.poses());
    if (e.by_time && 2 * e.matched.size() < left.times().size()) {
      e.misfit = findTimeScale(detail::streamOf(left.times(), left.poses()), stream, o.association.offset);
    }
    if (o.misfit && !e.misfit.found()) {
      e.misfit = detail::misfitOf(e.matched, e.times, stream, o.alignment, o.association.offset);
    }
  }
  estimate.poses = {}, estimate.times = {};
  if (!e.has_covariances) association.matches = {};
  const std::string suspicion = suspectQuaternionOrder(e.matched, reference_name, estimate_name);
  if (!suspicion.empty()) e.notes.push_back(suspicion);
  if (e.misfit.found()) e.notes.push_back(e.misfit.sentence());

  e.alignment = alignUmeyama(e.matched, o.alignment, o.n_to_align);
  if (!e.alignment.ok && e.has_covariances && alignWeighted(e.matched, o.verdictAlignment(), o.n_to_align).ok) {
    e.notes.push_back("APE and RPE are aligned by the first poses: " + e.alignment.fault +
                      ", but the verdict's alignment is determined by the poses and their covariances");
    e.alignment = alignUmeyama(e.matched, AlignmentModel::origin);
  }
  if (!e.alignment.ok) {
    return refuse(EvaluationStatus::not_aligned,
                  std::string("no ") + name(o.alignment) + " alignment: " + e.alignment.fault);
  }
  if (!e.has_covariances && e.alignment.parameters > 0) e.alignment.covariance.setConstant(detail::not_a_number);
  MatchedPoses flat;
  if (o.project_to_plane) {
    flat = e.matched;
    for (std::size_t i = 0; i < flat.size(); ++i) {
      SE3d &of_reference = flat.reference.mean(i), &of_estimate = flat.estimate.mean(i);
      of_reference = detail::projected(of_reference, *o.project_to_plane);
      of_estimate = detail::projected(e.alignment(of_estimate), *o.project_to_plane);
    }
  }
  const MatchedPoses& compared = o.project_to_plane ? flat : e.matched;
  const Alignment applied = o.project_to_plane ? Alignment{.ok = true} : e.alignment;
  e.position_errors = absoluteErrors(compared, applied, PoseRelation::trans_part);
  e.rotation_errors = absoluteErrors(compared, applied, PoseRelation::angle_rad);
  e.ape = absoluteErrors(compared, applied, o.pose_relation);
  e.pairs = posePairs(compared, applied, o.relative);
  e.rpe = relativeErrors(compared, applied, e.pairs, o.pose_relation);
  if (e.rpe.empty()) e.notes.push_back("no pairs of poses at the distance of --delta: no RPE");
  if (o.change_unit) {
    for (double& x : e.ape) x *= factor;
    if (e.rpe_unit == e.ape_unit) {
      for (double& x : e.rpe) x *= factor;
      e.rpe_unit = name(*o.change_unit);
    }
    e.ape_unit = name(*o.change_unit);
  }
  if (!e.interpolation.known) {
    e.notes.push_back("the error of the interpolated reference is not known: it has too few stamps to leave some out");
  } else if (e.referenceIsCoarse()) {
    e.notes.push_back(detail::noteOfCoarseReference(e));
  }
  e.ape_statistics = errorStatistics(e.ape), e.rpe_statistics = errorStatistics(e.rpe);
  if (o.segments) e.segments = detail::segmentErrors(compared, applied);
  if (!e.has_covariances) return e;

  if (o.pairs_model && o.relative.all_pairs) {
    return refuse(EvaluationStatus::overlapping_pairs,
                  "the motions of all pairs overlap: they fit no model of the pairs");
  }
  const auto judge = [&] {
    e.weighted = alignWeighted(e.matched, o.verdictAlignment(), o.n_to_align);
    e.consistency = evaluateConsistency(e.matched, e.weighted.ok ? e.weighted : Alignment{.ok = true});
    if (!e.weighted.ok) {
      e.consistency.ok = false;
      e.consistency.fault = "no weighted alignment: " + e.weighted.fault;
    }
    if (!o.pairs_model || e.pairs.empty()) return;
    e.relative = relativeConsistency(e.matched, e.pairs, *o.pairs_model, e.weighted.ok ? e.weighted.scale : 1,
                                     e.consistency.tests.components);
  };
  const auto interpolationTimes = [&](double times) {
    addInterpolationError(association.matches, truth.poses(), truth.times(), o.association.interpolation, e.matched,
                          times - e.interpolation.factor);
    e.interpolation.factor = times;
    judge();
  };
  judge();
  // A misfit that a factor within the error's own uncertainty explains is no fault of the covariances.
  if (e.referenceIsCoarse()) {
    for (const double times : {0.25, 0., 4.}) {
      if (e.verdict().isNo()) interpolationTimes(times);
    }
    if (e.verdict().isNo()) interpolationTimes(1);
  }
  for (std::string& omission : e.consistency.tests.components.omissions()) e.notes.push_back(std::move(omission));
  if (!e.consistency.indefinite.empty()) e.notes.push_back(detail::noteOfIndefinite(e, estimate.lines));
  return e;
}

}  // namespace liestat
