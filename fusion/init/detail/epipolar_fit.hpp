// The gyroscope's bias from rotations between images, from one start: robust steps with tracks that may be wrong, then
// the minimum for those that agree.
#pragma once

#include <fusion/init/detail/epipolar_problem.hpp>
#include <fusion/detail/levenberg_marquardt.hpp>
#include <fusion/imu/window.hpp>
#include <fusion/init/options.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace liestat::detail {

/// The problem with its prior, where it stands, and the ways to move it.
class EpipolarFit {
 public:
  EpipolarProblem problem;
  bool rotation = true;  ///< directions that stay, in place of epipolar constraints

  EpipolarFit(const InertialWindow& window, const InitialisationOptions& options)
      : problem(window, options.bearing_noise), options_(options), accelerometer_(window.bias().accelerometer) {}

  const Eigen::Vector3d& bias() const { return problem.bias().gyroscope; }
  int iterations() const { return iterations_; }
  std::size_t pairs() const { return rotation ? problem.pairs().size() : problem.usedPairs(); }
  double meanSquare(std::size_t i) const { return problem.meanSquare(i); }
  bool isIn(std::size_t i) const { return problem.weight[i] > 0; }
  void setWindow(const InertialWindow& window) {
    problem.setWindow(window);
    setBias(bias());
  }

  /// Turns the directions by another bias.
  void setBias(const Eigen::Vector3d& bias) { problem.setBias({bias, accelerometer_}); }
  /// Counts all tracks alike.
  void equalWeights() { std::fill(problem.weight.begin(), problem.weight.end(), 1.); }

  /// The normal equations, with the prior.
  EpipolarProblem::Normal linearise() {
    EpipolarProblem::Normal n = problem.linearise(rotation);
    const Eigen::Vector3d error = bias() - options_.prior.mean.gyroscope;
    for (int k = 0; k < 3; ++k) n.H(k, k) += priorInformation();
    n.g += priorInformation() * error;
    n.cost += priorInformation() * error.squaredNorm();
    return n;
  }

  /// The cost of all tracks, each at most one, which is what one costs that is in no pair.
  double robustCost() const {
    double cost = 0;
    for (std::size_t i = 0; i < problem.weight.size(); ++i) {
      cost += problem.count[i] > 0 ? problem.meanSquare(i) / (3 + problem.meanSquare(i)) : 1;
    }
    return cost;
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
      if (!rotation) problem.moveTranslations(step);
      setBias(bias() + step);
      ++iterations_;
      problem.linearise(rotation);
      weigh();
      cost = robustCost();
      if (step.norm() < 1e-4) break;
    }
    return cost;
  }

  /// Weights of one and zero, by χ². Where most tracks are beyond noise it is the model that is: their median is the
  /// scale.
  void decide() {
    problem.linearise(rotation);
    const double scale = std::max(1., quantile(0.4));
    for (std::size_t i = 0; i < problem.weight.size(); ++i) {
      const double limit = 1 + options_.epipolar.misfit_sigmas * std::sqrt(2 / problem.freedom(i));
      problem.weight[i] = problem.count[i] > 0 && problem.meanSquare(i) <= scale * limit ? 1 : 0;
    }
  }

  /// To the minimum at fixed weights; whether it got there.
  bool minimise() {
    AtFixedWeights fixed{*this};
    const DampedSummary summary = minimiseDamped(
        fixed, {.max_iterations = options_.epipolar.max_iterations, .min_decrease = 1e-3, .damping = 1e-6});
    iterations_ += summary.iterations;
    return converged(summary.status);
  }

  /// Accepts and rejects tracks, and goes to the minimum for those that are accepted, until these stay (or six times:
  /// one at the limit may come and go); whether there is a minimum.
  bool settle() {
    for (int round = 0; round < 6; ++round) {
      const std::vector<double> before = problem.weight;
      decide();
      if (!rotation) {
        problem.fitTranslations();
        problem.selectByParallax(options_.epipolar.min_parallax);
        if (problem.usedPairs() == 0) return false;
      }
      if (!minimise()) return false;
      if (problem.weight == before) return true;
    }
    return true;
  }

  /// True if what is accepted differs by noise only (three sigmas of χ²), is a good part of all tracks, and is in
  /// front of the camera.
  bool isConsistent() const {
    double sum = 0, freedom = 0, in = 0;
    for (std::size_t i = 0; i < problem.weight.size(); ++i) {
      if (!isIn(i) || problem.count[i] == 0) continue;
      in += 1;
      sum += problem.freedom(i) * problem.meanSquare(i);
      freedom += problem.freedom(i);
    }
    return in >= std::max(2., options_.epipolar.min_consensus * static_cast<double>(problem.tracks())) &&
           sum <= freedom + 3 * std::sqrt(2 * freedom) && (rotation || problem.wrongWay() <= max_wrong_way);
  }

  /// True if a good part of the tracks agree after a start, to noise.
  bool isPromising() {
    const std::vector<double> soft = problem.weight;
    decide();
    const bool promising = isConsistent();
    problem.weight = soft;
    return promising;
  }

  /// Covariance of the bias; false where it is not determined.
  bool covariance(Eigen::Matrix3d& result) {
    const EpipolarProblem::Normal normal = linearise();
    Eigen::Matrix3d inverse;
    if (!invertPositive(normal.H, inverse)) return false;
    Eigen::Matrix3d sum = problem.gradientCovariance(rotation);
    for (int k = 0; k < 3; ++k) sum(k, k) += priorInformation();
    result = inverse * sum * inverse.transpose();
    return result.allFinite();
  }

  /// A quantile of some values, one of them; 1 for none.
  static double quantileOf(std::vector<double> values, double share) {
    if (values.empty()) return 1;
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
  }

 private:
  /// Below 0.0003 in 1300 windows that were right, above in most that were not; features without parallax add to it.
  static constexpr double max_wrong_way = 0.002;

  double priorInformation() const { return 1 / (options_.prior.gyroscope_sigma * options_.prior.gyroscope_sigma); }
  /// A quantile of the tracks' mean squares.
  double quantile(double share) const {
    std::vector<double> values;
    for (std::size_t i = 0; i < problem.weight.size(); ++i) {
      if (problem.count[i] > 0) values.push_back(problem.meanSquare(i));
    }
    return quantileOf(std::move(values), share);
  }
  /// Weights at a scale of what the better tracks leave.
  void weigh() {
    const double scale = 3 * std::max(1., quantile(0.4));
    for (std::size_t i = 0; i < problem.weight.size(); ++i) {
      const double part = scale / (scale + problem.meanSquare(i));
      problem.weight[i] = part * part;
    }
  }
  /// The bias, with the translations that are the best for it, as minimiseDamped() wants it.
  struct AtFixedWeights {
    EpipolarFit& fit;
    EpipolarProblem::Normal at = {}, next = {};
    Eigen::Vector3d from = Eigen::Vector3d::Zero(), step = Eigen::Vector3d::Zero();
    bool linearised = false;

    double linearise() {
      if (!linearised) at = fit.linearise();
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
      from = fit.bias();
      if (!fit.rotation) fit.problem.moveTranslations(step);
      fit.setBias(from + step);
      next = fit.linearise();
      return next.cost;
    }
    void accept() { at = next; }
    void reject() {
      fit.setBias(from);
      if (!fit.rotation) fit.problem.restoreTranslations();
      fit.linearise();
    }
  };

  const InitialisationOptions& options_;
  Eigen::Vector3d accelerometer_;
  int iterations_ = 0;
};

}  // namespace liestat::detail
