// The search for the gyroscope's bias from rotations between images: many starts, tracks that may be wrong.
#pragma once

#include <fusion/detail/epipolar_problem.hpp>
#include <fusion/detail/levenberg_marquardt.hpp>
#include <fusion/imu/window.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace liestat::detail {

/// The stages of the search: from anywhere, with tracks that are right and wrong, to the minimum for those that agree.
class EpipolarSearch {
 public:
  EpipolarSearch(const InertialWindow& window, const InitialisationOptions& options)
      : options_(options), accelerometer_(window.bias().accelerometer), problem_(window, options.bearing_noise) {}

  const Eigen::Vector3d& bias() const { return problem_.bias().gyroscope; }
  int starts() const { return starts_; }
  int iterations() const { return iterations_; }
  std::size_t pairs() const { return rotation_ ? problem_.pairs().size() : problem_.usedPairs(); }
  double meanSquare(std::size_t i) const { return problem_.meanSquare(i); }
  bool isIn(std::size_t i) const { return problem_.weight[i] > 0; }
  void setWindow(const InertialWindow& window) {
    problem_.setWindow(window);
    setBias(bias());
  }

  /// From the prior to near the minimum, with soft weights; whether directions stay. Pairs far apart, where what is
  /// wrong with a track and parallax have grown, are the most robust.
  bool searchRotation() {
    rotation_ = true;
    problem_.setPairs(problem_.bestStep(), problem_.bestStep());
    equalWeights();
    setBias(options_.prior.mean.gyroscope);
    follow(10);
    fromRotation_ = bias();
    reach_ = max_even * quantileOf(problem_.rates(), 0.5);
    problem_.setAllPairs();
    follow(10);
    return settle() && isConsistent();
  }
  /// The same for epipolar constraints, from several starts. A start that looks right is followed to the end at once,
  /// the best few of the others where none was. Whether it settled.
  bool searchEpipolar() {
    rotation_ = false;
    std::vector<Candidate> candidates, followed;
    Candidate best{std::numeric_limits<double>::infinity(), options_.prior.mean.gyroscope, problem_.weight, false};
    for (starts_ = 0; starts_ < max_starts;) {
      problem_.setPairs(problem_.bestStep(), problem_.bestStep());
      equalWeights();
      setBias(start(starts_++));
      problem_.fitTranslations();
      problem_.selectByParallax(0);
      const double cost = follow(12);
      if (!std::isfinite(cost) || !isInReach()) continue;
      const Candidate candidate{cost, bias(), problem_.weight, false};
      visited_.push_back({cost, bias()});
      candidates.push_back(candidate);
      if (!isPromising() || isKnown(candidate, followed)) continue;
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
    problem_.setAllPairs();
    if (!std::isfinite(best.cost)) {
      giveUp();
      return false;
    }
    problem_.weight = best.weight;
    setBias(best.bias);
    problem_.fitTranslations();
    problem_.selectByParallax(options_.epipolar.min_parallax);
    return problem_.usedPairs() > 0 && minimise() && best.settled;
  }
  /// Without any pair to go by: the bias that makes directions stay best.
  void giveUp() {
    equalWeights();
    setBias(fromRotation_);
    problem_.fitTranslations();
    problem_.selectByParallax(std::numeric_limits<double>::infinity());
    linearise();
  }

  /// Accepts and rejects tracks, and goes to the minimum for those that are accepted, until these stay (or six
  /// times: one at the limit may come and go); whether there is a minimum.
  bool settle() {
    for (int round = 0; round < 6; ++round) {
      const std::vector<double> before = problem_.weight;
      decide();
      if (!rotation_) {
        problem_.fitTranslations();
        problem_.selectByParallax(options_.epipolar.min_parallax);
        if (problem_.usedPairs() == 0) return false;
      }
      if (!minimise()) return false;
      if (problem_.weight == before) return true;
    }
    return true;
  }

  /// Whether what is accepted differs by noise only (three sigmas of χ²), is a good part of all tracks, and is in
  /// front of the camera.
  bool isConsistent() const {
    double sum = 0, freedom = 0, in = 0;
    for (std::size_t i = 0; i < problem_.weight.size(); ++i) {
      if (!isIn(i) || problem_.count[i] == 0) continue;
      in += 1;
      sum += problem_.freedom(i) * problem_.meanSquare(i);
      freedom += problem_.freedom(i);
    }
    return in >= std::max(2., options_.epipolar.min_consensus * static_cast<double>(problem_.tracks())) &&
           sum <= freedom + 3 * std::sqrt(2 * freedom) && (rotation_ || problem_.wrongWay() <= max_wrong_way);
  }

  /// Biases that were come by, the best first, at most so many, and none near the one that was found.
  std::vector<Eigen::Vector3d> others(std::size_t max) {
    std::sort(visited_.begin(), visited_.end(), [](const Visited& a, const Visited& b) { return a.cost < b.cost; });
    std::vector<Eigen::Vector3d> kept{bias()};
    for (const Visited& visited : visited_) {
      const auto isNear = [&](const Eigen::Vector3d& other) { return (other - visited.bias).norm() < 0.01; };
      if (kept.size() <= max && std::none_of(kept.begin(), kept.end(), isNear)) kept.push_back(visited.bias);
    }
    kept.erase(kept.begin());
    return kept;
  }

  /// Covariance of the bias; false where it is not determined.
  bool covariance(Eigen::Matrix3d& result) {
    const EpipolarProblem::Normal normal = linearise();
    Eigen::Matrix3d inverse;
    if (!invertPositive(normal.H, inverse)) return false;
    Eigen::Matrix3d sum = problem_.gradientCovariance(rotation_);
    for (int k = 0; k < 3; ++k) sum(k, k) += priorInformation();
    result = inverse * sum * inverse.transpose();
    return result.allFinite();
  }

 private:
  static constexpr int max_starts = 16;
  static constexpr std::size_t max_followed = 4;
  /// How much larger the mean of all parallaxes may be than their differences: a wall seen at a right angle.
  static constexpr double max_even = 8;
  /// Below 0.0003 in 1300 windows that were right, above in most that were not; features without parallax add to it.
  static constexpr double max_wrong_way = 0.002;

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
  /// The same minimum.
  static bool isKnown(const Candidate& candidate, const std::vector<Candidate>& others) {
    return std::any_of(others.begin(), others.end(),
                       [&](const Candidate& other) { return (other.bias - candidate.bias).norm() < 0.01; });
  }
  /// Whether a good part of the tracks agree after a start, to noise.
  bool isPromising() {
    const std::vector<double> soft = problem_.weight;
    decide();
    const bool promising = isConsistent();
    problem_.weight = soft;
    return promising;
  }
  /// To the minimum with all pairs; keeps it if it is the best so far, and says if there is no need to look further.
  bool finish(const Candidate& candidate, Candidate& best) {
    problem_.weight = candidate.weight;
    setBias(candidate.bias);
    problem_.setAllPairs();
    problem_.fitTranslations();
    problem_.selectByParallax(options_.epipolar.min_parallax);
    follow(10);
    const bool settled = settle();
    // One that is not consistent is but a last resort.
    const bool consistent = isConsistent();
    const double cost = robustCost() + (consistent ? 0 : static_cast<double>(problem_.weight.size()));
    if (!isInReach()) return false;
    visited_.push_back({cost, bias()});
    if (cost < best.cost) best = {cost, bias(), problem_.weight, settled};
    const auto in = std::count_if(problem_.weight.begin(), problem_.weight.end(), [](double w) { return w > 0; });
    return settled && consistent && 2 * static_cast<std::size_t>(in) >= problem_.weight.size();
  }

  double priorInformation() const { return 1 / (options_.prior.gyroscope_sigma * options_.prior.gyroscope_sigma); }
  void setBias(const Eigen::Vector3d& bias) { problem_.setBias({bias, accelerometer_}); }
  void equalWeights() { std::fill(problem_.weight.begin(), problem_.weight.end(), 1.); }

  /// The translation turns directions too, by speed over distance, but not all by the same: how far the bias may be
  /// from what directions say that stay, in terms of how little they do.
  bool isInReach() const { return (bias() - fromRotation_).norm() <= reach_; }
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

  EpipolarProblem::Normal linearise() {
    EpipolarProblem::Normal n = problem_.linearise(rotation_);
    const Eigen::Vector3d error = bias() - options_.prior.mean.gyroscope;
    for (int k = 0; k < 3; ++k) n.H(k, k) += priorInformation();
    n.g += priorInformation() * error;
    n.cost += priorInformation() * error.squaredNorm();
    return n;
  }

  /// A quantile of the tracks' mean squares.
  double quantile(double share) const {
    std::vector<double> values;
    for (std::size_t i = 0; i < problem_.weight.size(); ++i) {
      if (problem_.count[i] > 0) values.push_back(problem_.meanSquare(i));
    }
    return quantileOf(std::move(values), share);
  }
  static double quantileOf(std::vector<double> values, double share) {
    if (values.empty()) return 1;
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
  }
  /// Of tracks, each at most one, which is what one costs that is in no pair.
  double robustCost() const {
    double cost = 0;
    for (std::size_t i = 0; i < problem_.weight.size(); ++i) {
      cost += problem_.count[i] > 0 ? problem_.meanSquare(i) / (3 + problem_.meanSquare(i)) : 1;
    }
    return cost;
  }
  /// Weights at a scale of what the better tracks leave.
  void weigh() {
    const double scale = 3 * std::max(1., quantile(0.4));
    for (std::size_t i = 0; i < problem_.weight.size(); ++i) {
      const double part = scale / (scale + problem_.meanSquare(i));
      problem_.weight[i] = part * part;
    }
  }
  /// Gauss–Newton steps with weights that follow; returns the robust cost.
  double follow(int steps) {
    double cost = std::numeric_limits<double>::infinity();
    for (int k = 0; k < steps; ++k) {
      const EpipolarProblem::Normal n = linearise();
      Eigen::Matrix3d inverse;
      if (!invertPositive(n.H, inverse)) break;
      Eigen::Vector3d step = -inverse * n.g;
      if (!step.allFinite()) break;
      step *= std::min(1., 0.2 / std::max(step.norm(), 1e-300));
      if (!rotation_) problem_.moveTranslations(step);
      setBias(bias() + step);
      ++iterations_;
      problem_.linearise(rotation_);
      weigh();
      cost = robustCost();
      if (step.norm() < 1e-4) break;
    }
    return cost;
  }

  /// Weights of one and zero, by χ². Where most tracks are beyond noise it is the model that is: their median is the
  /// scale.
  void decide() {
    problem_.linearise(rotation_);
    const double scale = std::max(1., quantile(0.4));
    for (std::size_t i = 0; i < problem_.weight.size(); ++i) {
      const double limit = 1 + options_.epipolar.misfit_sigmas * std::sqrt(2 / problem_.freedom(i));
      problem_.weight[i] = problem_.count[i] > 0 && problem_.meanSquare(i) <= scale * limit ? 1 : 0;
    }
  }

  /// To the minimum at fixed weights; whether it got there.
  bool minimise() {
    AtFixedWeights problem{*this};
    const DampedSummary summary = minimiseDamped(
        problem, {.max_iterations = options_.epipolar.max_iterations, .min_decrease = 1e-3, .damping = 1e-6});
    iterations_ += summary.iterations;
    return summary.converged;
  }

  /// The bias, with the translations that are the best for it, as minimiseDamped() wants it.
  struct AtFixedWeights {
    EpipolarSearch& search;
    EpipolarProblem::Normal at = {}, next = {};
    Eigen::Vector3d from = {}, step = {};
    bool linearised = false;

    double linearise() {
      if (!linearised) at = search.linearise();
      linearised = true;
      return at.cost;
    }
    bool solve(double damping) {
      Eigen::Matrix3d H = at.H, inverse;
      for (int i = 0; i < 3; ++i) H(i, i) *= 1 + damping;
      if (!invertPositive(H, inverse)) return false;
      step = -inverse * at.g;
      return step.norm() <= 1;
    }
    double costAfterStep() {
      from = search.bias();
      if (!search.rotation_) search.problem_.moveTranslations(step);
      search.setBias(from + step);
      next = search.linearise();
      return next.cost;
    }
    void accept() { at = next; }
    void reject() {
      search.setBias(from);
      if (!search.rotation_) search.problem_.restoreTranslations();
      search.linearise();
    }
  };

  const InitialisationOptions& options_;
  Eigen::Vector3d accelerometer_;
  EpipolarProblem problem_;
  bool rotation_ = true;
  Eigen::Vector3d fromRotation_ = Eigen::Vector3d::Zero();
  double reach_ = 0;
  std::vector<Visited> visited_;
  int starts_ = 0, iterations_ = 0;
};

}  // namespace liestat::detail
