// The covariances of a trajectory, or of the edges of a pose graph, from one convention to another, with an account of
// what is lost. (Needs Random123.)
//
//   const auto to = *liestat::parseConvention("ros-fixed");
//   const auto conversion = liestat::convertTrajectory(poses, matrices, *liestat::parseConvention("gtsam"), to);
//   if (conversion.verdict().isYes()) use(conversion.matrices);
//   for (const auto& fault : conversion.faults) std::cerr << fault.row << ": " << fault.found << '\n';
//
// Unknown entries are NaN and stay so; what depends on them is unknown. Conversions are exact within a family of
// perturbations and of first order between them (stats/convention_losses.hpp). Derivations: docs/theory/conventions.md.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <stats/convention_presets.hpp>
#include <stats/verdict.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace liestat {

struct ConversionOptions {
  bool assume_uncorrelated = false;  ///< unknown covariances between known components are 0
  bool sampled = false;              ///< second moments by sampling between families of perturbations
  int samples = 2000;                ///< for each pose
  std::uint64_t seed = 1;
  /// The line of each row in its file, for sentences; empty, or 0: the row's number is said.
  std::vector<std::size_t> lines = {};
};

/// A reason why a matrix was not converted: the result would not be a covariance.
enum class ConversionFault {
  indefinite,        ///< it is not positive semidefinite, and another content is asked for
  far_origin,        ///< to a perturbation about an origin so far away that digits cancel
  near_pole,         ///< to Euler angles at a pitch of nearly 90°
  undefined_angles,  ///< to Euler angles with so large standard deviations that they mean nothing
  unknown_cross,     ///< covariances between components are needed and not known
  undetermined       ///< unknown entries leave nothing of the result
};
/// The enumerator's name, for files.
const char* name(ConversionFault fault);

/// A matrix that was not converted. Sentences put names of options between backquotes.
struct UnconvertedMatrix {
  ConversionFault fault = ConversionFault::undetermined;
  std::size_t row = 0;
  std::string found, expected;  ///< the error, and the values that are accepted; `expected` may be empty
};

struct TrajectoryConversion {
  std::optional<Convention> from, to;                 ///< nothing if there was nothing to convert
  std::vector<Eigen::Matrix<double, 6, 6>> matrices;  ///< in the convention `to`; NaN for unknown entries and faults
  std::vector<UnconvertedMatrix> faults;
  std::size_t unknown = 0, partly_unknown = 0;  ///< matrices without any known entry, and with some unknown ones
  std::size_t assumed_uncorrelated = 0;         ///< matrices in which correlations were taken as 0
  std::vector<std::size_t> indefinite;          ///< rows whose matrix is not positive semidefinite
  std::size_t zero_variances = 0;               ///< matrices with a variance of 0
  std::size_t far_input = 0;                    ///< matrices whose digits were lost before: about a far origin
  std::size_t beyond_first_order = 0;           ///< rotations for which the first order fails
  double round_trip_bound = 0;                  ///< rounding of there and back, the largest, in sigmas
  double largest_rotation_sigma = 0;            ///< rad
  double sampling_error = 0;                    ///< standard error of sampled variances, relative, the largest
  std::vector<std::string> notes;

  /// Yes: every matrix was converted as told. No: some are indefinite, or were not converted. None: no covariances.
  Verdict verdict() const;
};

/// Converts the matrices that belong to poses, one for each, layouts undone (unpackCovariance). A matrix with a fault is
/// NaN in the result; the others are converted.
LIESTAT_TRAJECTORIES_API TrajectoryConversion convertTrajectory(std::span<const SE3d> poses,
                                                                std::span<const Eigen::Matrix<double, 6, 6>> matrices,
                                                                const Convention& from, const Convention& to,
                                                                const ConversionOptions& options = {});

/// See report/describe.hpp.
template <class V>
void describe(V& v, const TrajectoryConversion& c) {
  v("covariances", c.matrices.size(), "their number")("covariance_from", c.from, "null: the file has no covariances");
  v("covariance_to", c.to)("unknown", c.unknown, "matrices without any known entry");
  v("partly_unknown", c.partly_unknown, "matrices with some unknown entries");
  v("assumed_uncorrelated", c.assumed_uncorrelated, "matrices whose missing blocks were taken to be zero");
  v("indefinite", c.indefinite.size(), "matrices that are not positive semidefinite");
  v("zero_variances", c.zero_variances, "matrices with a variance of 0");
  v("round_trip_bound", c.round_trip_bound, "rounding of there and back", "sigma");
  v("largest_rotation_sigma_rad", c.largest_rotation_sigma, "", "rad");
  v("beyond_first_order", c.beyond_first_order, "rotations for which the first order fails");
  v("sampling_error", c.sampling_error, "standard error of sampled variances, relative")("notes", c.notes);
}
template <class V>
void describe(V& v, const UnconvertedMatrix& f) {
  v("fault", name(f.fault))("row", f.row, "of the pose, from 0")("found", f.found, "in words")("expected", f.expected);
}
template <class V>
void describeSeries(V& v, const TrajectoryConversion& c) {
  v("matrices", c.matrices, "in the convention of the result")("faults", c.faults, "matrices that were not converted");
}

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/trajectories/detail/convert_trajectory.hpp>
#endif
