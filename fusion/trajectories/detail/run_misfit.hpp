// Faults of a whole run of matched poses: what evaluateTrajectory() and diagnoseCovariances() share.
#pragma once

#include <fusion/evaluate_types.hpp>
#include <fusion/noisy_poses.hpp>
#include <fusion/pose_stream.hpp>
#include <fusion/trajectories.hpp>
#include <fusion/trajectory_misfit.hpp>
#include <stats/quantile.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace liestat::detail {

/// A trajectory as a stream by itself; without times an empty one.
inline PoseStream streamOf(std::span<const double> times, const NoisyPoses& poses) {
  std::vector<TimedPose> stream;
  for (std::size_t i = 0; i < times.size(); ++i) stream.push_back({times[i], poses.mean(i)});
  return PoseStream(stream);
}

/// Faults of a whole run: of its times first, where most poses have no partner, or none that moves alike.
inline MisfitSearch misfitOf(const MatchedPoses& matched, std::span<const double> matched_times,
                             const PoseStream& truth, AlignmentModel alignment, double offset) {
  std::vector<SE3d> estimate, reference;
  std::vector<TimedPose> stream;
  std::vector<double> times;
  for (std::size_t i = 0; i < matched.size(); ++i) {
    estimate.push_back(matched.estimate.mean(i)), reference.push_back(matched.reference.mean(i));
    if (truth.poses().empty()) continue;
    stream.push_back({matched_times[i], estimate.back()});
    times.push_back(matched_times[i] + offset);
  }
  MisfitSearch of_times = findTimeScale(PoseStream(stream), truth, offset);
  if (of_times.found()) return of_times;
  return findMisfit(estimate, reference, times, truth, alignment, offset);
}

/// True if the times of both are in order, and yet no pose has a partner.
inline bool lacksPartners(EvaluationStatus status) {
  return status == EvaluationStatus::no_overlap || status == EvaluationStatus::no_match;
}
/// True if a tenth of the poses or less has a partner.
inline bool fewPartners(std::size_t matched, std::size_t poses) { return 10 * matched < poses; }

/// The reason why poses have no partners, with the unit of their times where their motion tells it, or where the steps
/// of the two differ by powers of 1000.
inline std::string reasonWithTimes(std::string reason, std::span<const double> estimate_times,
                                   const NoisyPoses& estimate, std::span<const double> truth_times,
                                   const NoisyPoses& truth, double offset) {
  const MisfitSearch times = findTimeScale(streamOf(estimate_times, estimate), streamOf(truth_times, truth), offset);
  if (times.found()) return reason + "; " + times.sentence();
  if (std::min(estimate_times.size(), truth_times.size()) < 3) return reason;
  const double a = medianStep(truth_times), b = medianStep(estimate_times);
  const double power = std::round(std::log10(b / a) / 3);
  if (!(std::abs(power) >= 1 && std::abs(power) <= 3)) return reason;
  const MisfitExplanation unit{.faults = {Misfit::time_scale}, .time_factor = std::pow(1e3, -power)};
  return reason + "; its median step is " + significant(b, 3) + " s, and the reference's " + significant(a, 3) +
         " s: perhaps " + unit.text();
}

}  // namespace liestat::detail
