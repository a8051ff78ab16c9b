// The search for the gyroscope's bias from rotations between images: where to start, and which minimum to believe.
#pragma once

#include <fusion/init/detail/epipolar_fit.hpp>
#include <fusion/imu/window.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace liestat::detail {

/// The stages of the search: from anywhere to the minimum that most tracks agree on.
class EpipolarSearch {
 public:
  EpipolarSearch(const InertialWindow& window, const InitialisationOptions& options)
      : options_(options), fit_(window, options) {}

  /// Where it stands.
  EpipolarFit& fit() { return fit_; }
  int starts() const { return starts_; }

  /// From the prior to near the minimum, with soft weights; whether directions stay. Pairs far apart, where what is
  /// wrong with a track and parallax have grown, are the most robust.
  bool searchRotation() {
    fit_.rotation = true;
    fit_.problem.setPairs(fit_.problem.bestStep(), fit_.problem.bestStep());
    fit_.equalWeights();
    fit_.setBias(options_.prior.mean.gyroscope);
    fit_.follow(10);
    fromRotation_ = fit_.bias();
    reach_ = max_even * EpipolarFit::quantileOf(fit_.problem.rates(), 0.5);
    fit_.problem.setAllPairs();
    fit_.follow(10);
    return fit_.settle() && fit_.isConsistent();
  }
  /// The same for epipolar constraints, from several starts. A start that looks right is followed to the end at once,
  /// the best few of the others where none was. Whether it settled.
  bool searchEpipolar() {
    fit_.rotation = false;
    std::vector<Candidate> candidates, followed;
    Candidate best{std::numeric_limits<double>::infinity(), options_.prior.mean.gyroscope, fit_.problem.weight, false};
    for (starts_ = 0; starts_ < max_starts;) {
      fit_.problem.setPairs(fit_.problem.bestStep(), fit_.problem.bestStep());
      fit_.equalWeights();
      fit_.setBias(start(starts_++));
      fit_.problem.fitTranslations();
      fit_.problem.selectByParallax(0);
      const double cost = fit_.follow(12);
      if (!std::isfinite(cost) || !isInReach()) continue;
      const Candidate candidate{cost, fit_.bias(), fit_.problem.weight, false};
      visited_.push_back({cost, fit_.bias()});
      candidates.push_back(candidate);
      if (!fit_.isPromising() || isKnown(candidate, followed)) continue;
      followed.push_back(candidate);
      if (finish(candidate, best)) return true;
    }
    std::sort(candidates.begin(), candidates.end(),
              [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
    for (const Candidate& candidate : candidates) {
      if (isKnown(candidate, followed)) continue;
      if (followed.size() >= max_followed) break;
      followed.push_back(candidate);
      if (finish(candidate, best)) return true;
    }
    fit_.problem.setAllPairs();
    if (!std::isfinite(best.cost)) {
      giveUp();
      return false;
    }
    fit_.problem.weight = best.weight;
    fit_.setBias(best.bias);
    fit_.problem.fitTranslations();
    fit_.problem.selectByParallax(options_.epipolar.min_parallax);
    return fit_.problem.usedPairs() > 0 && fit_.minimise() && best.settled;
  }
  /// Without any pair to go by: the bias that makes directions stay best.
  void giveUp() {
    fit_.equalWeights();
    fit_.setBias(fromRotation_);
    fit_.problem.fitTranslations();
    fit_.problem.selectByParallax(std::numeric_limits<double>::infinity());
    fit_.linearise();
  }

  /// Biases that were come by, the best first, at most so many, and none near the one that was found.
  std::vector<Eigen::Vector3d> others(std::size_t max) {
    std::sort(visited_.begin(), visited_.end(), [](const Visited& a, const Visited& b) { return a.cost < b.cost; });
    std::vector<Eigen::Vector3d> kept{fit_.bias()};
    for (const Visited& visited : visited_) {
      const auto isNear = [&](const Eigen::Vector3d& other) { return (other - visited.bias).norm() < 0.01; };
      if (kept.size() <= max && std::none_of(kept.begin(), kept.end(), isNear)) kept.push_back(visited.bias);
    }
    kept.erase(kept.begin());
    return kept;
  }

 private:
  static constexpr int max_starts = 16;
  static constexpr std::size_t max_followed = 4;
  /// How much larger the mean of all parallaxes may be than their differences: a wall seen at a right angle.
  static constexpr double max_even = 8;

  struct Candidate {
    double cost;
    Eigen::Vector3d bias;
    std::vector<double> weight;
    bool settled;
  };
  struct Visited {
    double cost;
    Eigen::Vector3d bias;
  };

  /// True if the candidate is at the minimum of another one.
  static bool isKnown(const Candidate& candidate, const std::vector<Candidate>& others) {
    return std::any_of(others.begin(), others.end(),
                       [&](const Candidate& other) { return (other.bias - candidate.bias).norm() < 0.01; });
  }
  /// To the minimum with all pairs; keeps it if it is the best so far, and says if there is no need to look further.
  bool finish(const Candidate& candidate, Candidate& best) {
    fit_.problem.weight = candidate.weight;
    fit_.setBias(candidate.bias);
    fit_.problem.setAllPairs();
    fit_.problem.fitTranslations();
    fit_.problem.selectByParallax(options_.epipolar.min_parallax);
    fit_.follow(10);
    const bool settled = fit_.settle();
    // One that is not consistent is but a last resort.
    const bool consistent = fit_.isConsistent();
    const double cost = fit_.robustCost() + (consistent ? 0 : static_cast<double>(fit_.problem.weight.size()));
    if (!isInReach()) return false;
    visited_.push_back({cost, fit_.bias()});
    if (cost < best.cost) best = {cost, fit_.bias(), fit_.problem.weight, settled};
    const auto in =
        std::count_if(fit_.problem.weight.begin(), fit_.problem.weight.end(), [](double w) { return w > 0; });
    return settled && consistent && 2 * static_cast<std::size_t>(in) >= fit_.problem.weight.size();
  }

  /// The translation turns directions too, by speed over distance, but not all by the same: how far the bias may be
  /// from what directions say that stay, in terms of how little they do.
  bool isInReach() const { return (fit_.bias() - fromRotation_).norm() <= reach_; }
  /// The prior, what directions say that stay, and biases around these.
  Eigen::Vector3d start(int k) const {
    const bool is_near = reach_ < 2 * options_.prior.gyroscope_sigma;
    Eigen::Vector3d centre = is_near ? fromRotation_ : options_.prior.mean.gyroscope;
    if (k == 0) return centre;
    if (k == 1) return is_near ? options_.prior.mean.gyroscope : fromRotation_;
    Eigen::Vector3d around = Eigen::Vector3d::Zero();
    if (k < 8) {
      around[(k - 2) / 2] = k % 2 == 0 ? -1.5 : 1.5;
    } else {
      for (int i = 0; i < 3; ++i) around[i] = (k >> i) % 2 == 0 ? -1 : 1;
    }
    return centre + std::min(options_.prior.gyroscope_sigma, 0.5 * reach_) * around;
  }

  const InitialisationOptions& options_;
  EpipolarFit fit_;
  Eigen::Vector3d fromRotation_ = Eigen::Vector3d::Zero();
  double reach_ = 0;
  std::vector<Visited> visited_;
  int starts_ = 0;
};

}  // namespace liestat::detail
