// Definitions of fusion/trajectory_conversion.hpp.
#pragma once

#include <fusion/trajectory_conversion.hpp>
#include <stats/convention_losses.hpp>
#include <stats/convention_sampling.hpp>
#include <stats/words.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace liestat {

LIESTAT_FUSION_INLINE const char* name(ConversionFault fault) {
  constexpr std::array names{"indefinite",       "far_origin",    "near_pole",
                             "undefined_angles", "unknown_cross", "undetermined"};
  return names[static_cast<std::size_t>(fault)];
}

LIESTAT_FUSION_INLINE Verdict TrajectoryConversion::verdict() const {
  const std::string all = std::to_string(matrices.size());
  if (matrices.empty()) return Verdict::none("no verdict: there are no covariances");
  if (!faults.empty()) {
    return Verdict::no("not converted: " + std::to_string(faults.size()) + " of " + all + " matrices",
                       {faults[0].found});
  }
  if (!indefinite.empty()) {
    return Verdict::no("not trusted: " + std::to_string(indefinite.size()) + " of " + all + " matrices are indefinite");
  }
  return Verdict::yes("converted: " + all + " matrices from " + conventionName(*from, false) + " to " +
                      conventionName(*to, false));
}

namespace detail {

/// Converts matrices one by one and keeps account.
class TrajectoryConverter {
 public:
  TrajectoryConverter(const ConversionOptions& options, TrajectoryConversion& result)
      : options_(options), from_(*result.from), to_(*result.to), result_(result) {}

  /// The matrix in the other convention; NaN with a fault.
  Matrix6d convert(std::size_t row, const SE3d& pose, Matrix6d matrix) {
    const std::size_t n_faults = result_.faults.size();
    const Matrix6d converted = tryConvert(row, pose, matrix);
    return result_.faults.size() == n_faults ? converted
                                             : Matrix6d(Matrix6d::Constant(std::numeric_limits<double>::quiet_NaN()));
  }

 private:
  Matrix6d tryConvert(std::size_t row, const SE3d& pose, Matrix6d& matrix) {
    if (options_.assume_uncorrelated && assumeUncorrelated(matrix)) ++result_.assumed_uncorrelated;
    if (matrix.array().isNaN().all()) {
      ++result_.unknown;
      return matrix;
    }
    if (matrix.array().isNaN().any()) ++result_.partly_unknown;
    if ((matrix.diagonal().array() == 0).any()) ++result_.zero_variances;
    if (!isSemidefinite(matrix)) {
      result_.indefinite.push_back(row);
      if (from_.content != CovarianceContent::covariance || to_.content != CovarianceContent::covariance) {
        fault(ConversionFault::indefinite, row, "the matrix is indefinite",
              "a positive definite one, to change its content");
        return matrix;
      }
    }
    Convention same = from_;
    same.layout = to_.layout;
    if (same == to_) return matrix;
    const Gaussian<SE3d> g = fromConvention(from_, pose, matrix);
    if (!look(g, row)) return matrix;
    if (options_.sampled && family(from_.perturbation) != family(to_.perturbation) && g.covariance.allFinite()) {
      const SampledMoments moments = sampledConversion(from_, to_, pose, covarianceFromContent(from_.content, matrix),
                                                       options_.samples, options_.seed, row);
      result_.sampling_error = std::max(result_.sampling_error, moments.relative_error);
      return covarianceAsContent(to_.content, moments.second_moment);
    }
    Matrix6d converted = convertConvention(from_, to_, pose, matrix);
    if (converted.array().isNaN().all()) {
      const bool cross = matrix.diagonal().allFinite();
      fault(cross ? ConversionFault::unknown_cross : ConversionFault::undetermined, row,
            "the matrix does not determine one of '" + conventionName(to_, false) + "'",
            cross ? "all covariances between components, or `assume_uncorrelated`" : "the whole matrix");
    }
    return converted;
  }

  /// The conversion's losses; false where the result would not be a covariance any more.
  bool look(const Gaussian<SE3d>& g, std::size_t row) {
    const ConversionLoss loss = conversionLoss(from_, to_, g);
    result_.round_trip_bound = std::max(result_.round_trip_bound, loss.round_trip);
    result_.largest_rotation_sigma = std::max(result_.largest_rotation_sigma, loss.rotation_sigma);
    if (loss.firstOrderFails()) ++result_.beyond_first_order;
    const std::string lost = "a round trip within " + significant(largest_round_trip, 6) + " sigma, this one loses " +
                             significant(loss.round_trip, 2);
    switch (loss.problem) {
      case ConversionProblem::none:
        return true;
      case ConversionProblem::far_origin:
        // Losses before this file are its writer's.
        if (to_.perturbation != Perturbation::left) {
          ++result_.far_input;
          return true;
        }
        fault(ConversionFault::far_origin, row,
              "|p| is " + significant(g.mean.translation().norm(), 6) + " m: " + message(loss.problem), lost);
        return false;
      case ConversionProblem::near_pole:
        fault(ConversionFault::near_pole, row, message(loss.problem), lost);
        return false;
      case ConversionProblem::undefined_angles:
        fault(ConversionFault::undefined_angles, row, message(loss.problem), {});
        return false;
    }
    return true;
  }

  void fault(ConversionFault kind, std::size_t row, std::string found, std::string expected) {
    result_.faults.push_back({kind, row, std::move(found), std::move(expected)});
  }

  const ConversionOptions& options_;
  Convention from_, to_;
  TrajectoryConversion& result_;
};

/// The first rows of a list in words: "line 3, 8", or "row 2" where a file has no lines.
inline std::string placesInWords(const std::vector<std::size_t>& rows, const std::vector<std::size_t>& lines) {
  const bool by_line = !lines.empty() && lines[rows[0]] > 0;
  std::string text = by_line ? "line " : "row ";
  for (std::size_t k = 0; k < rows.size() && k < 3; ++k) {
    text += (k > 0 ? ", " : "") + std::to_string(by_line ? lines[rows[k]] : rows[k]);
  }
  return text + (rows.size() > 3 ? ", ..." : "");
}

inline void addConversionNotes(TrajectoryConversion& c, const ConversionOptions& options) {
  const auto note = [&c](std::size_t count, const std::string& text) {
    if (count > 0) c.notes.push_back(std::to_string(count) + " " + text);
  };
  note(c.unknown, "covariances are unknown as a whole, and stay so");
  note(c.partly_unknown, "covariances have unknown entries; what depends on them is unknown");
  note(c.assumed_uncorrelated, "covariances: unknown correlations taken as 0");
  if (!c.indefinite.empty()) {
    note(c.indefinite.size(), "of " + std::to_string(c.matrices.size()) + " matrices are indefinite (" +
                                  placesInWords(c.indefinite, options.lines) + ")");
  }
  note(c.zero_variances, "matrices have a variance of 0: rounded away by whoever wrote the file?");
  note(c.far_input, "matrices are about an origin so far away that digits have cancelled: bound " +
                        significant(c.round_trip_bound, 2) + " sigma");
  if (!options.sampled) {
    note(c.beyond_first_order, "rotations have a sigma above " + significant(first_order_sigma, 6) + " rad (largest " +
                                   significant(c.largest_rotation_sigma, 3) + "): first order fails, use `sampled`");
  } else if (c.sampling_error > 0) {
    c.notes.push_back("second moments by sampling, standard error " + significant(c.sampling_error, 2) +
                      " of the variances at most");
  }
}

}  // namespace detail

LIESTAT_FUSION_INLINE TrajectoryConversion convertTrajectory(std::span<const SE3d> poses,
                                                             std::span<const Eigen::Matrix<double, 6, 6>> matrices,
                                                             const Convention& from, const Convention& to,
                                                             const ConversionOptions& options) {
  TrajectoryConversion c;
  c.from = from, c.to = to;
  detail::TrajectoryConverter converter(options, c);
  for (std::size_t i = 0; i < std::min(poses.size(), matrices.size()); ++i) {
    c.matrices.push_back(converter.convert(i, poses[i], matrices[i]));
  }
  detail::addConversionNotes(c, options);
  return c;
}

}  // namespace liestat
