// Faults of a whole trajectory that pass for errors of its poses: a late clock, a wrong scale, another frame on the body,
// inverted poses, w first, exchanged or mirrored axes. They come before any statistics of the errors. (Needs Boost.Math.)
//
//   const liestat::MisfitSearch m = liestat::findMisfit(estimate, truth, times, stream, liestat::AlignmentModel::se3);
//   if (m.found()) std::puts(m.sentence().c_str());
//
// Readings of the poses (inverses, orders of the quaternion, signed permutations of the axes) are tried with all of
// clock, scale, body and world left free. The noise is what the best of these fits leaves, with its dependence in time;
// for it all subsets of faults are fitted once more. A fault is named only if the likelihood pays for it, and what
// explains the errors equally well, with no more faults, is named beside it. docs/evaluate.md has the power.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/pose_stream.hpp>
#include <fusion/trajectories_types.hpp>
#include <fusion/trajectory_misfit_types.hpp>

#include <span>

namespace liestat {

/// `estimate` and `reference` are pairs of poses, `times` (s, ascending) those of the estimate on the reference's clock
/// as far as it is known, `stream` the reference by itself; without both nothing is said of the clock. What `alignment`
/// leaves free is no fault. `offset` (s) is already in the times: delays are told with it. Fewer than 20 pairs are not
/// searched. At most 300 pairs, evenly spaced, are used.
LIESTAT_TRAJECTORIES_API MisfitSearch findMisfit(std::span<const SE3d> estimate, std::span<const SE3d> reference,
                                                 std::span<const double> times, const PoseStream& stream,
                                                 AlignmentModel alignment, double offset = 0);

/// The unit of an estimate's times, or their speed: of the reference's clock is time_factor · t + delay. The motions
/// tell it, angles and distances over equal spans of time, whatever the worlds and frames. Powers of 1000 are tried,
/// and where the times (with `offset`, s, added) overlap any factor up to half more or less than that of the spans,
/// each with the zeros that a file can have: that of the reference, or its beginning. Named only if the motions then
/// correlate by 0.9, and lack a quarter of what they lack as the times stand; another speed only if rotations and
/// displacements do. Fewer than 20 poses are not searched.
LIESTAT_TRAJECTORIES_API MisfitSearch findTimeScale(const PoseStream& estimate, const PoseStream& reference,
                                                    double offset = 0);

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/trajectories/detail/find_misfit.hpp>
#include <fusion/trajectories/detail/misfit_times.hpp>
#endif
