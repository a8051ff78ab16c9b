// The gyroscope's bias out of a window of which up to half of the tracks are wrong, without a first guess and without
// the accelerometer: from the rotations between images alone. Where solveClosedFormRobustly begins when the bias is
// unknown: consensus on the motion fails from 0.05 rad/s on.
//
//   const auto start = liestat::estimateEpipolarGyroscopeBias(window, {.bearing_noise = 1. / 450});
//   if (start.ok()) … start.bias, start.covariance, start.inliers
//
// The directions u and u' of a feature from two images and the translation between these lie in a plane: for the right
// rotation all normals u × u' are orthogonal to one vector, whatever depths and speeds are. The bias is what makes them
// so for pairs of images 1, 2, 4 … steps apart, each with a translation of its own, in least squares of angles.
// Sources: L. Kneip and S. Lynen, "Direct optimization of frame-to-frame rotation", ICCV 2013; Y. He et al., "A
// rotation-translation-decoupled solution for robust and efficient visual-inertial initialization", CVPR 2023; here
// normals are weighted by their noise, translations are unknowns of the least squares (variable projection) instead of
// eigenvectors, whose eigenvalues noise shifts, and tracks have the weights of Geman and McClure until they are
// accepted or rejected.
//
// Without parallax normals are nothing but noise, and the constraint does not tell a rotation. Two rules keep that out:
// a window whose directions all stay where they are, after rotations that the bias explains, is solved for that,
// without translations (status no_parallax: at rest, pure rotation); in others a pair of images counts only if its
// directions have moved, beyond what any rotation explains, by `least_parallax` deviations. What both leave out, hardly
// any parallax, is `undetermined`. Several rotations may then explain the normals: a minimum must have its features in
// front of the camera, and no mean parallax far beyond the differences between parallaxes; `others` are those next to
// it. A lever arm of the camera only changes the translations. Residuals are weighted by the noise of bearings alone:
// the gyroscope's must be smaller over the window (3e-4 rad in two seconds of an ADIS16448, where a pixel is 2e-3).
#pragma once

#include <fusion/init/closed_form_types.hpp>
#include <fusion/detail/closed_form_input.hpp>
#include <fusion/detail/epipolar_problem.hpp>
#include <fusion/imu/window.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace liestat {

struct EpipolarBiasOptions {
  double bearing_noise = 0;                         ///< rad, as of the closed form; must be given
  Eigen::Vector3d prior = Eigen::Vector3d::Zero();  ///< rad/s
  double prior_deviation = 0.1;                     ///< rad/s
  /// Of a pair of images that is used: RMS by which its directions move, beyond what a rotation explains, in
  /// deviations.
  double least_parallax = 4;
  double misfit_deviations = 5;     ///< of a track's χ², beyond which it is rejected
  double least_consensus = 0.4;     ///< share of the tracks that must agree
  double largest_deviation = 0.02;  ///< rad/s, predicted, of the bias's least known direction
  int most_iterations = 30;         ///< of the last stage
};

enum class EpipolarBiasStatus {
  ok,
  no_parallax,    ///< found, by directions that stay: the body did not move, or features are far (then see covariance)
  undetermined,   ///< the data do not tell the bias well enough: too few tracks, or hardly any parallax; the bias is
                  ///< then the one that makes directions stay best
  no_consensus,   ///< too few tracks agree on a bias
  not_converged,  ///< the iterations ended first
  bad_input       ///< see fault
};

/// In words, for people.
inline const char* describe(EpipolarBiasStatus status) {
  switch (status) {
    case EpipolarBiasStatus::ok:
      return "the gyroscope's bias was found from rotations";
    case EpipolarBiasStatus::no_parallax:
      return "the gyroscope's bias was found from directions that stay";
    case EpipolarBiasStatus::undetermined:
      return "rotations between images do not determine the gyroscope's bias";
    case EpipolarBiasStatus::no_consensus:
      return "too few tracks agree on a bias of the gyroscope";
    case EpipolarBiasStatus::not_converged:
      return "the search for the gyroscope's bias did not converge";
    case EpipolarBiasStatus::bad_input:
      return "bad input";
  }
  return "";
}

/// Indices are the window's. Tracks that no pair of images in use has in common are in neither list.
struct EpipolarBiasResult {
  EpipolarBiasStatus status = EpipolarBiasStatus::bad_input;
  ClosedFormFault fault = ClosedFormFault::none;
  std::size_t fault_index = 0;

  Eigen::Vector3d bias = Eigen::Vector3d::Zero();  ///< rad/s, whole: not the change of the one that was integrated
  /// From the noise of the accepted tracks, of the gyroscope where the motions were integrated with it, and the prior;
  /// to first order. Pairs of images share bearings: it is not the inverse of the normal equations. With no_parallax a
  /// parallax that is too small or too even to be seen is not in it: the bias is then off by speed over distance.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  std::vector<std::size_t> inliers, outliers;  ///< ascending; a drift along the epipolar lines is not seen
  std::vector<double> residuals;               ///< of each track, RMS in deviations; infinite in neither list
  /// Other biases for which many tracks agree, the best first: what else to try where this one turns out to be wrong.
  std::vector<Eigen::Vector3d> others;
  std::size_t pairs_used = 0;  ///< of images
  int starts = 0, iterations = 0;
  int integrations = 0;  ///< how often the readings were integrated anew

  /// Whether the residuals of the accepted tracks are noise, by χ², and their features in front of the camera. If not:
  /// the minimum may be a wrong one, or there is more noise than was said.
  bool consistent = false;

  bool ok() const {
    return (status == EpipolarBiasStatus::ok || status == EpipolarBiasStatus::no_parallax) && consistent;
  }
};

namespace detail {

/// The stages of the search: from anywhere, with tracks that are right and wrong, to the minimum for those that agree.
class EpipolarSearch {
 public:
  EpipolarSearch(const InertialWindow& window, const EpipolarBiasOptions& options)
      : options_(options),
        accelerometer_(window.motions[0].options().bias.accelerometer),
        problem_(window, options.bearing_noise) {}

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
    setBias(options_.prior);
    follow(10);
    fromRotation_ = bias();
    reach_ = most_even * quantileOf(problem_.rates(), 0.5);
    problem_.setAllPairs();
    follow(10);
    return settle() && isConsistent();
  }
  /// The same for epipolar constraints, from several starts. A start that looks right is followed to the end at once,
  /// the best few of the others where none was. Whether it settled.
  bool searchEpipolar() {
    rotation_ = false;
    std::vector<Candidate> candidates, followed;
    Candidate best{std::numeric_limits<double>::infinity(), options_.prior, problem_.weight, false};
    for (starts_ = 0; starts_ < most_starts;) {
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
      if (followed.size() >= most_followed) break;
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
    problem_.selectByParallax(options_.least_parallax);
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
        problem_.selectByParallax(options_.least_parallax);
        if (problem_.usedPairs() == 0) return false;
      }
      if (!minimise()) return false;
      if (problem_.weight == before) return true;
    }
    return true;
  }

  /// Whether what is accepted differs by noise only (three deviations of χ²), is a good part of all tracks, and is in
  /// front of the camera.
  bool isConsistent() const {
    double sum = 0, freedom = 0, in = 0;
    for (std::size_t i = 0; i < problem_.weight.size(); ++i) {
      if (!isIn(i) || problem_.count[i] == 0) continue;
      in += 1;
      sum += problem_.freedom(i) * problem_.meanSquare(i);
      freedom += problem_.freedom(i);
    }
    return in >= std::max(2., options_.least_consensus * static_cast<double>(problem_.tracks())) &&
           sum <= freedom + 3 * std::sqrt(2 * freedom) && (rotation_ || problem_.wrongWay() <= most_wrong_way);
  }

  /// Biases that were come by, the best first, at most so many, and none near the one that was found.
  std::vector<Eigen::Vector3d> others(std::size_t most) {
    std::sort(visited_.begin(), visited_.end(), [](const Visited& a, const Visited& b) { return a.cost < b.cost; });
    std::vector<Eigen::Vector3d> kept{bias()};
    for (const Visited& visited : visited_) {
      const auto isNear = [&](const Eigen::Vector3d& other) { return (other - visited.bias).norm() < 0.01; };
      if (kept.size() <= most && std::none_of(kept.begin(), kept.end(), isNear)) kept.push_back(visited.bias);
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
  static constexpr int most_starts = 16;
  static constexpr std::size_t most_followed = 4;
  /// How much larger the mean of all parallaxes may be than their differences: a wall seen at a right angle.
  static constexpr double most_even = 8;
  /// Below 0.0003 in 1300 windows that were right, above in most that were not; features without parallax add to it.
  static constexpr double most_wrong_way = 0.002;

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
    problem_.selectByParallax(options_.least_parallax);
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

  double priorInformation() const { return 1 / (options_.prior_deviation * options_.prior_deviation); }
  void setBias(const Eigen::Vector3d& bias) { problem_.setBias({bias, accelerometer_}); }
  void equalWeights() { std::fill(problem_.weight.begin(), problem_.weight.end(), 1.); }

  /// The translation turns directions too, by speed over distance, but not all by the same: how far the bias may be
  /// from what directions say that stay, in terms of how little they do.
  bool isInReach() const { return (bias() - fromRotation_).norm() <= reach_; }
  /// The prior, what directions say that stay, and biases around these.
  Eigen::Vector3d start(int k) const {
    const bool is_near = reach_ < 2 * options_.prior_deviation;
    Eigen::Vector3d centre = is_near ? fromRotation_ : options_.prior;
    if (k == 0) return centre;
    if (k == 1) return is_near ? options_.prior : fromRotation_;
    Eigen::Vector3d around = Eigen::Vector3d::Zero();
    if (k < 8) {
      around[(k - 2) / 2] = k % 2 == 0 ? -1.5 : 1.5;
    } else {
      for (int i = 0; i < 3; ++i) around[i] = (k >> i) % 2 == 0 ? -1 : 1;
    }
    return centre + std::min(options_.prior_deviation, 0.5 * reach_) * around;
  }

  EpipolarProblem::Normal linearise() {
    EpipolarProblem::Normal n = problem_.linearise(rotation_);
    const Eigen::Vector3d error = bias() - options_.prior;
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
  /// Gauss' and Newton's steps with weights that follow; returns the robust cost.
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
  /// measure.
  void decide() {
    problem_.linearise(rotation_);
    const double measure = std::max(1., quantile(0.4));
    for (std::size_t i = 0; i < problem_.weight.size(); ++i) {
      const double limit = 1 + options_.misfit_deviations * std::sqrt(2 / problem_.freedom(i));
      problem_.weight[i] = problem_.count[i] > 0 && problem_.meanSquare(i) <= measure * limit ? 1 : 0;
    }
  }

  /// Levenberg's and Marquardt's method at fixed weights.
  bool minimise() {
    EpipolarProblem::Normal at = linearise();
    double damping = 1e-6;
    for (int k = 0; k < options_.most_iterations; ++k) {
      Eigen::Matrix3d H = at.H, inverse;
      for (int i = 0; i < 3; ++i) H(i, i) *= 1 + damping;
      if (!invertPositive(H, inverse)) return false;
      const Eigen::Vector3d from = bias(), step = -inverse * at.g;
      if (!(step.norm() <= 1)) return false;
      if (!rotation_) problem_.moveTranslations(step);
      setBias(from + step);
      ++iterations_;
      const EpipolarProblem::Normal next = linearise();
      const double gain = at.cost - next.cost;
      // Written so that NaN is no gain.
      if (!(gain >= -1e-9 * at.cost)) {
        setBias(from);
        if (!rotation_) problem_.restoreTranslations();
        linearise();
        damping *= 10;
        if (damping > 1e6) return false;
        continue;
      }
      at = next;
      if (gain < 1e-3 && damping <= 1e-2) return true;
      damping = std::max(1e-9, 0.1 * damping);
    }
    return false;
  }

  const EpipolarBiasOptions& options_;
  Eigen::Vector3d accelerometer_;
  EpipolarProblem problem_;
  bool rotation_ = true;
  Eigen::Vector3d fromRotation_ = Eigen::Vector3d::Zero();
  double reach_ = 0;
  std::vector<Visited> visited_;
  int starts_ = 0, iterations_ = 0;
};

}  // namespace detail

/// The bias that the rotations between images say. `integrate(bias)` integrates the readings of the window anew: it
/// returns motions as in InertialWindow, and is called where a first-order update will not do.
template <class Integrate>
EpipolarBiasResult estimateEpipolarGyroscopeBias(const InertialWindow& window, const EpipolarBiasOptions& options,
                                                 const Integrate& integrate) {
  EpipolarBiasResult found;
  found.bias = options.prior;
  const auto positive = [](double x) { return x > 0 && std::isfinite(x); };
  if (!positive(options.bearing_noise) || !options.prior.allFinite() || !positive(options.prior_deviation) ||
      !(options.least_parallax > 0) || !(options.misfit_deviations > 0) || !(options.largest_deviation > 0) ||
      !(options.least_consensus > 0 && options.least_consensus <= 1)) {
    found.fault = ClosedFormFault::bad_option;
    return found;
  }
  if (window.motions.empty()) {
    found.fault = ClosedFormFault::too_few_images;
    return found;
  }
  const Eigen::Vector3d accelerometer = window.motions[0].options().bias.accelerometer;
  found.fault = detail::faultOf(closedFormWindow(window, {options.prior, accelerometer}),
                                {.bearing_noise = options.bearing_noise}, found.fault_index);
  if (found.fault != ClosedFormFault::none) return found;

  detail::EpipolarSearch search(window, options);
  const bool still = search.searchRotation();
  bool settled = still || search.searchEpipolar();
  // Motions for the bias that was found, where the change was large.
  InertialWindow anew;
  const ImuBias<double> bias{search.bias(), accelerometer};
  const auto far = [&](const Preintegration<double>& motion) { return motion.mustReintegrate(bias); };
  if (search.pairs() > 0 && std::any_of(window.motions.begin(), window.motions.end(), far)) {
    anew.motions = integrate(bias);
    if (anew.motions.size() == window.motions.size()) {
      ++found.integrations;
      search.setWindow(anew);
      settled = search.settle();
    }
  }
  if (search.pairs() == 0) search.giveUp();
  found.bias = search.bias();
  found.others = search.others(8);
  found.starts = search.starts();
  found.iterations = search.iterations();
  found.pairs_used = search.pairs();
  const bool regular = search.covariance(found.covariance);
  found.consistent = search.isConsistent();
  for (std::size_t i = 0; i < window.features.size(); ++i) {
    found.residuals.push_back(std::sqrt(search.meanSquare(i)));
    if (std::isfinite(found.residuals.back())) (search.isIn(i) ? found.inliers : found.outliers).push_back(i);
  }
  const auto tracks = static_cast<double>(found.inliers.size() + found.outliers.size());
  if (found.pairs_used == 0 || !regular) {
    found.status = EpipolarBiasStatus::undetermined;
  } else if (static_cast<double>(found.inliers.size()) < options.least_consensus * tracks) {
    found.status = EpipolarBiasStatus::no_consensus;
  } else if (!settled) {
    found.status = EpipolarBiasStatus::not_converged;
  } else {
    const detail::SmallSvd svd(detail::SmallMatrix::of<3, 3>(found.covariance));
    const bool known = std::sqrt(svd.value(0)) <= options.largest_deviation;
    found.status = !known  ? EpipolarBiasStatus::undetermined
                   : still ? EpipolarBiasStatus::no_parallax
                           : EpipolarBiasStatus::ok;
  }
  return found;
}

/// The same without readings: motions are updated to first order, whatever the change.
inline EpipolarBiasResult estimateEpipolarGyroscopeBias(const InertialWindow& window,
                                                        const EpipolarBiasOptions& options = {}) {
  return estimateEpipolarGyroscopeBias(window, options,
                                       [](const ImuBias<double>&) { return std::vector<Preintegration<double>>(); });
}

}  // namespace liestat
