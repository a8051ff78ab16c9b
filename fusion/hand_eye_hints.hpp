// The convention that would explain the residuals of a hand-eye calibration: covariances that mean something else than
// the library takes them for, and poses that are inverses of what they should be.
//
//   const auto result = liestat::estimateRobotWorld(poses);
//   if (const auto hint = liestat::explainHandEye(poses, result)) use(hint->reading);
//
// Nothing is guessed: each reading is fitted. Wrong covariances show themselves by χ² per degree of freedom of 20 to
// 40; the right reading has one. Not all errors show: where poses of both files are inverses, X and Y are exchanged and
// fit as well.
#pragma once

#include <fusion/hand_eye.hpp>
#include <fusion/hand_eye_types.hpp>
#include <stats/conventions.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/propagation.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace liestat {

/// The pose that is meant, with its covariance in the library's convention.
inline Gaussian<SE3d> readPose(const Gaussian<SE3d>& given, const PoseReading& reading) {
  Gaussian<SE3d> pose = given;
  switch (reading.covariance) {
    case CovarianceReading::right:
      break;
    case CovarianceReading::left:
      pose = fromLeftCovariance<SE3d>(given.mean, given.covariance);
      break;
    case CovarianceReading::rotation_then_translation:
      pose.covariance = covarianceFromOrder<SE3d>(given.covariance, rotation_first);
      break;
    case CovarianceReading::world_axes:
      pose = fromWorldAxesCovariance<SE3d>(given.mean, given.covariance);
      break;
  }
  return reading.inverted ? inverse(pose) : pose;
}
inline PosePair readPair(const PosePair& given, const HandEyeReading& reading) {
  return {readPose(given.a, reading.a), readPose(given.b, reading.b)};
}

struct HandEyeHintOptions {
  HandEyeReading reading = {};  ///< the one that the result was made with
  /// True if the covariances may have been meant otherwise; false where they come from a model and not from a file.
  bool doubt_a = true, doubt_b = true;
  HandEyeOptions estimate = {};  ///< options of the estimate
};

/// True where the residuals ask for an explanation: `inconsistent`, not converged, χ²/dof of 5 or more, or more than a
/// third of the pairs rejected.
inline bool asksForExplanation(const HandEyeResult& result) {
  if (result.status == FusionStatus::bad_input) return false;
  const bool refuted =
      result.status == FusionStatus::inconsistent && (result.p < refutation_level || !result.isSuspicious());
  return refuted || result.status == FusionStatus::not_converged || !(result.chi2 < 5 * result.degrees_of_freedom) ||
         3 * result.outliers.size() > result.pairs.size();
}

/// The pairs, of n, that an explanation is sought with: not more than are needed, spread over the poses B, `pose(i)`,
/// so that their order does not matter.
template <class Pose>
std::vector<std::size_t> pairsToExplain(std::size_t n, const Pose& pose) {
  constexpr std::size_t max_pairs = 40;
  std::vector<std::size_t> all(n), some;
  std::iota(all.begin(), all.end(), std::size_t{0});
  const std::size_t step = (n + max_pairs - 1) / max_pairs;
  if (step < 2) return all;
  std::sort(all.begin(), all.end(), [&](std::size_t i, std::size_t k) {
    const SE3d::Params p = pose(i).params(), q = pose(k).params();
    return std::lexicographical_compare(p.data(), p.data() + p.size(), q.data(), q.data() + q.size());
  });
  for (std::size_t i = 0; i < n; i += step) some.push_back(all[i]);
  return some;
}

namespace detail {

/// The fits of other readings of some pairs.
class HandEyeExplanation {
 public:
  HandEyeExplanation(std::span<const PosePair> given, bool world, const HandEyeHintOptions& options)
      : given_(some(given)), world_(world), options_(options) {
    // Some of the pairs are no rows of a stream, and what makes a stream fit is no reading of poses.
    HandEyeOptions& o = options_.estimate;
    o.times = {}, o.stream_of_a = {}, o.interpolate = false, o.largest_delay = 0;
  }

  LIESTAT_FUSION_API std::optional<HandEyeHint> best() {
    const HandEyeHint found = fit(options_.reading);
    // With the poses of A inverted instead, X and Y are exchanged and the fit is the same.
    HandEyeReading inverted = options_.reading;
    inverted.b.inverted = !inverted.b.inverted;
    const HandEyeHint other = fit(inverted);
    std::vector<HandEyeHint> hints = {other};
    if (options_.estimate.known_noise) {
      addReadings(hints, options_.reading);
      if (!other.agrees && isMuchBetter(other, found)) addReadings(hints, inverted);
    }
    const HandEyeHint* nearest = nullptr;
    for (const HandEyeHint& hint : hints) {
      if (hint.agrees && (nearest == nullptr || off(hint) < off(*nearest))) nearest = &hint;
    }
    if (nearest != nullptr) return *nearest;
    return isMuchBetter(other, found) ? std::optional(other) : std::nullopt;
  }

 private:
  static std::vector<PosePair> some(std::span<const PosePair> given) {
    std::vector<PosePair> pairs;
    for (const std::size_t i : pairsToExplain(given.size(), [&](std::size_t k) { return given[k].b.mean; })) {
      pairs.push_back(given[i]);
    }
    return pairs;
  }
  LIESTAT_FUSION_API HandEyeHint fit(const HandEyeReading& reading) const {
    std::vector<PosePair> pairs;
    for (const PosePair& pair : given_) pairs.push_back(readPair(pair, reading));
    const HandEyeResult result =
        world_ ? estimateRobotWorld(pairs, options_.estimate) : estimateHandEye(pairs, options_.estimate);
    HandEyeHint hint{reading, result.chi2 / result.degrees_of_freedom, result.p, result.outliers.size()};
    // Covariances that are much too large fit everything.
    hint.agrees = asksForExplanation(result) ? false : result.p >= 1e-3 && hint.chi2_per_degree > 0.5;
    return hint;
  }
  static double off(const HandEyeHint& hint) { return std::abs(std::log(hint.chi2_per_degree)); }
  static bool isMuchBetter(const HandEyeHint& hint, const HandEyeHint& than) {
    return hint.outliers <= than.outliers && 10 * hint.chi2_per_degree < than.chi2_per_degree;
  }
  /// Other covariances of A, of B, and of both where both may have been written by one program.
  LIESTAT_FUSION_API void addReadings(std::vector<HandEyeHint>& hints, const HandEyeReading& from) const {
    for (const CovarianceReading covariance : all_covariance_readings) {
      for (const auto& [a, b] : {std::pair(true, false), std::pair(false, true), std::pair(true, true)}) {
        if ((a && !options_.doubt_a) || (b && !options_.doubt_b)) continue;
        HandEyeReading reading = from;
        if (a) reading.a.covariance = covariance;
        if (b) reading.b.covariance = covariance;
        if (!(reading == from)) hints.push_back(fit(reading));
      }
    }
  }

  std::vector<PosePair> given_;
  bool world_;
  HandEyeHintOptions options_;
};

}  // namespace detail

/// The reading of the given poses, other than that which the result was made with, under which they agree best: χ²/dof
/// nearest to one, with p ≥ 1e-3 and no more than a third of the pairs rejected. Where none does, inverse poses if they
/// make χ²/dof at least ten times smaller. Of more than 40 pairs a part is fitted. Empty where nothing asks for an
/// explanation, and where nothing explains it.
LIESTAT_FUSION_API inline std::optional<HandEyeHint> explainHandEye(std::span<const PosePair> given,
                                                                    const HandEyeResult& result,
                                                                    const HandEyeHintOptions& options = {}) {
  if (!asksForExplanation(result)) return std::nullopt;
  return detail::HandEyeExplanation(given, result.world, options).best();
}

}  // namespace liestat
