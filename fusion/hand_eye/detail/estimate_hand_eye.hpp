// Definitions of fusion/hand_eye.hpp.
#pragma once

#include <fusion/hand_eye/detail/hand_eye_directions.hpp>
#include <fusion/hand_eye/detail/hand_eye_problem.hpp>
#include <fusion/hand_eye/detail/hand_eye_refine.hpp>
#include <fusion/hand_eye/detail/hand_eye_starts.hpp>
#include <fusion/detail/median.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/random.hpp>
#include <stats/score_tests.hpp>
#include <stats/time_dependence.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace liestat {
namespace detail {

/// One calibration, from the pairs to the result: AX = YB (`world`) or AX = XB.
template <bool world>
class HandEyeRun {
 public:
  using Indices = std::vector<std::size_t>;

  HandEyeRun(PosePairList pairs, HandEyeOptions options)
      : options_(std::move(options)), pairs_(std::move(pairs)), order_(pairs_.size()) {
    result_.world = world, result_.known_noise = options_.known_noise;
    std::iota(order_.begin(), order_.end(), std::size_t{0});
  }

  HandEyeResult run() {
    result_.fault = fault();
    if (result_.fault) return std::move(result_);
    stream_ = PoseStream(std::exchange(options_.stream_of_a, {}));
    if (options_.interpolate) interpolate();
    if (!options_.times.empty()) values_[0] = startOfDelay();
    sortByContent();
    const Indices all = allPairs();
    if (isUnknown() || !values_.isZero(0)) {
      for (std::size_t i = 0; i < pairs_.size(); ++i) given_.push_back({pairs_.a.mean(i), pairs_.b.mean(i)});
    }
    takeIn();
    fitAll(all);
    estimateSuspects();
    // Where the noise is not known, wrong pairs may have been taken for noise.
    const bool suspicious = !options_.known_noise || *std::max_element(errors_.begin(), errors_.end()) > options_.gate;
    if (options_.find_outliers && pairs_.size() >= min_pairs_for_search && suspicious) {
      findOutliers();
      estimateSuspects();
    }
    estimate();
    return std::move(result_);
  }

 private:
  static constexpr int parameters = world ? 12 : 6;
  using Covariance = Eigen::Matrix<double, parameters, parameters>;  // of X and Y, or of X
  /// With fewer, three pairs and one more that agree by chance would be a majority.
  static constexpr std::size_t min_pairs_for_search = 6;
  /// The median of χ²₆.
  static constexpr double median_error = 5.348120627447116;

  Fault fault() const {
    const HandEyeOptions& o = options_;
    if (!(o.gate > 0 && o.samples >= 0 && o.min_excitation > 0 && o.trusted_excitation >= o.min_excitation &&
          o.min_p >= 0 && std::isfinite(o.delay_start) && o.largest_delay >= 0 && std::isfinite(o.largest_delay) &&
          (o.times.empty() || o.times.size() == pairs_.size()))) {
      return FaultKind::bad_option;
    }
    const bool has_stream = !o.times.empty() && !o.stream_of_a.empty();
    if ((o.interpolate || o.largest_delay > 0) && !has_stream) return FaultKind::bad_option;
    for (const double sigma : o.suspect_sigmas) {
      if (!(sigma >= 0)) return FaultKind::bad_option;
    }
    for (const TimedPose& pose : o.stream_of_a) {
      if (!std::isfinite(pose.time) || !pose.pose.params().allFinite()) return FaultKind::bad_option;
    }
    for (const double time : o.times) {
      if (!std::isfinite(time)) return FaultKind::bad_option;
    }
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      if (!pairs_.a.mean(i).params().allFinite() || !pairs_.b.mean(i).params().allFinite())
        return {FaultKind::pose_not_finite, i};
      // Six equations need six errors; whether these are independent shows in the frames of the estimate.
      if (i > 0 && !pairs_.a.keepsEach() && !pairs_.b.keepsEach()) continue;
      if (!coverAllDirections(pairs_.a.covariance(i), pairs_.b.covariance(i))) return {FaultKind::bad_covariance, i};
    }
    if (pairs_.size() < (world ? 3 : 2)) return {FaultKind::too_few_poses, pairs_.size()};
    return {};
  }
  /// A at the times of the pairs; with noise that is known up to a factor its error, in metres, can't be added.
  void interpolate() {
    HandEyeInterpolation done;
    const Matrix6 error = stream_.interpolationError();
    done.translation = std::sqrt(error.topLeftCorner<3, 3>().trace());
    done.rotation = std::sqrt(error.bottomRightCorner<3, 3>().trace());
    std::vector<std::size_t> interpolated;
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      const std::optional<SE3d> pose = stream_.at(options_.times[i]);
      if (pose) pairs_.a.mean(i) = *pose, interpolated.push_back(i);
    }
    done.in_gaps = pairs_.size() - interpolated.size();
    if (options_.known_noise && done.in_gaps == 0) pairs_.a.addCovariance(std::nullopt, error);
    if (options_.known_noise && done.in_gaps > 0) {
      for (const std::size_t i : interpolated) pairs_.a.addCovariance(i, error);
    }
    result_.interpolation = done;
  }
  double startOfDelay() const {
    if (!(options_.largest_delay > 0)) return options_.delay_start;
    std::vector<TimedPose> of_b;
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      of_b.push_back({options_.times[i] + options_.delay_start, pairs_.b.mean(i)});
    }
    return options_.delay_start + delayOfSpeeds(stream_, PoseStream(std::move(of_b)), options_.largest_delay);
  }
  /// By the numbers in the pairs, so that sums and samples do not depend on the order of the input.
  void sortByContent() {
    const auto before = [](std::span<const double> x, std::span<const double> y) {
      const auto [at, other] = std::mismatch(x.begin(), x.end(), y.begin());
      return at == x.end() ? 0 : *at < *other ? -1 : 1;
    };
    const auto numbers = [](const auto& list) {
      return std::span<const double>(list.data(), static_cast<std::size_t>(list.size()));
    };
    const auto compared = [&](std::size_t i, std::size_t k) {
      for (const PackedPoses* poses : {&pairs_.b, &pairs_.a}) {
        const int sign = before(numbers(poses->mean(i).params()), numbers(poses->mean(k).params()));
        if (sign != 0) return sign;
      }
      for (const PackedPoses* poses : {&pairs_.b, &pairs_.a}) {
        if (!poses->keepsEach()) continue;
        const int sign = before(numbers(poses->covariance(i)), numbers(poses->covariance(k)));
        if (sign != 0) return sign;
      }
      return i < k ? -1 : 1;
    };
    std::sort(order_.begin(), order_.end(), [&](std::size_t i, std::size_t k) { return i != k && compared(i, k) < 0; });
    pairs_.a = pairs_.a.rows(order_), pairs_.b = pairs_.b.rows(order_);
  }

  void rescale(double factor) {
    if (!(factor > 0 && std::isfinite(factor))) return;
    pairs_.a.scaleCovariances(factor), pairs_.b.scaleCovariances(factor);
    for (double& error : errors_) error /= factor;
    for (HandEyeFit& fit : candidates_) fit.cost /= factor;
    result_.variance_factor *= factor;
  }

  HandEyeFit refined(const HandEyeFit& fit, const Indices& indices, int iterations = 30, double factor = 1) const {
    return refineHandEye(fit, pairs_, indices, world, options_.trusted_excitation, iterations, factor);
  }
  /// The squared errors of the pairs of a list.
  std::vector<double> errorsAt(const HandEyeValue& value, const Indices& list) const {
    std::vector<double> errors;
    errors.reserve(list.size());
    for (const std::size_t i : list) {
      const double error = handEyeSquaredError(value, pairs_[i]);
      errors.push_back(std::isfinite(error) ? error : std::numeric_limits<double>::max());
    }
    return errors;
  }
  std::vector<double> errorsAt(const HandEyeValue& value) const { return errorsAt(value, allPairs()); }
  /// Those of a list whose errors, in its order, are below a bound.
  static Indices below(const std::vector<double>& errors, double bound, const Indices& list) {
    Indices below;
    for (std::size_t i = 0; i < errors.size(); ++i) {
      if (errors[i] <= bound) below.push_back(list[i]);
    }
    return below;
  }
  Indices allPairs() const {
    Indices all(pairs_.size());
    std::iota(all.begin(), all.end(), std::size_t{0});
    return all;
  }
  static double truncated(const std::vector<double>& errors, double bound) {
    double sum = 0;
    for (const double error : errors) sum += std::min(error, bound);
    return sum;
  }
  void take(const std::vector<HandEyeFit>& fits, Indices inliers) {
    candidates_ = fits;
    inliers_ = std::move(inliers);
    errors_ = errorsAt(fits.front().value, inliers_);
  }

  /// The best of all starts, from all pairs. Where the noise is not known its factor follows from the median error,
  /// which a minority of wrong pairs does not move much; what is excited depends on it, so that it is found twice.
  void fitAll(const Indices& all) {
    const Indices some = evenly(all);
    const int rounds = options_.known_noise ? 1 : 3;
    for (int round = 0; round < rounds; ++round) {
      std::vector<HandEyeFit> fits;
      for (const HandEyeValue& value : handEyeStarts(pairs_, some, world, options_.seed)) {
        const double cost = handEyeCost(value, pairs_, some);
        if (std::isfinite(cost)) fits.push_back({value, cost, false});
      }
      result_.starts = static_cast<int>(fits.size());
      if (fits.empty()) fits.push_back({});
      keepBest(fits);
      for (HandEyeFit& fit : fits) fit = refined(fit, some);
      keepBest(fits);
      const bool last = round + 1 == rounds;
      if (some.size() < all.size() && last) refineDifferent(fits, all);
      take(fits, last ? all : some);
      if (!options_.known_noise) {
        const double share = 1 - static_cast<double>(parameters) / (6 * static_cast<double>(pairs_.size()));
        rescale(median(errors_) / (median_error * share));
      }
    }
  }
  /// Refines the fits that are not the same one, which have converged to it, from all pairs.
  void refineDifferent(std::vector<HandEyeFit>& fits, const Indices& all) const {
    constexpr double same = 1e-3;  // m, rad
    std::vector<HandEyeFit> different;
    for (const HandEyeFit& fit : fits) {
      const auto equals = [&](const HandEyeFit& x) {
        return (x.value.X.inverse() * fit.value.X).log().norm() + (x.value.Y.inverse() * fit.value.Y).log().norm() <
               same;
      };
      if (std::none_of(different.begin(), different.end(), equals)) different.push_back(fit);
    }
    for (HandEyeFit& fit : different) {
      fit.cost = handEyeCost(fit.value, pairs_, all);
      fit = refined(fit, all);
    }
    fits = std::move(different);
    keepBest(fits);
  }
  static void keepBest(std::vector<HandEyeFit>& fits) {
    std::stable_sort(fits.begin(), fits.end(), [](const auto& x, const auto& y) { return x.cost < y.cost; });
    if (fits.size() > 3) fits.resize(3);
  }

  /// Wrong pairs by consensus: minimal samples of three pairs in closed form, the three best refined from the pairs
  /// within a gate that closes. A minimal estimate has errors of its own, which inflate those of right pairs; hence the
  /// wide gates at first.
  void findOutliers() {
    const bool known = options_.known_noise;
    const Indices all = allPairs(), some = evenly(all);
    std::vector<HandEyeFit> fits;
    for (int s = 0; s < options_.samples; ++s) {
      CounterRng rng(options_.seed, static_cast<std::uint64_t>(s), 2);
      std::array<std::size_t, 3> sample;
      for (std::size_t k = 0; k < 3; ++k) {
        do {
          sample[k] = static_cast<std::size_t>(rng() % pairs_.size());
        } while (std::find(sample.begin(), sample.begin() + static_cast<std::ptrdiff_t>(k), sample[k]) !=
                 sample.begin() + static_cast<std::ptrdiff_t>(k));
      }
      std::sort(sample.begin(), sample.end());
      const HandEyeMoments moments(pairs_, sample, world);
      const HandEyeValue value = closedFormStart(moments, pairs_, sample, world);
      const std::vector<double> errors = errorsAt(value, some);
      fits.push_back({value, known ? truncated(errors, 4 * options_.gate) : median(errors), false});
      if (fits.size() > 64) keepBest(fits);
    }
    if (fits.empty()) return;
    keepBest(fits);
    for (HandEyeFit& fit : fits) {
      std::vector<double> errors = errorsAt(fit.value, some);
      for (double widening : {4.0, 2.0, 1.0}) {
        // A scale that was found in the errors has grown with them.
        if (!known) widening = 1;
        const double gate = gateFor(errors);
        const Indices inliers = below(errors, widening * gate, some);
        if (inliers.size() < 3) break;
        fit = refined(fit, inliers, 5, gate / options_.gate);
        errors = errorsAt(fit.value, some);
      }
      fit.cost = known ? truncated(errors, options_.gate) : median(errors);
    }
    keepBest(fits);
    HandEyeFit best = fits.front();
    std::vector<double> errors = errorsAt(best.value);
    double gate = gateFor(errors);
    Indices inliers = below(errors, gate, all);
    for (int round = 0; round < 20 && inliers.size() >= 3; ++round) {
      best = refined(best, inliers, 30, gate / options_.gate);
      errors = errorsAt(best.value);
      gate = gateFor(errors);
      Indices next = below(errors, gate, all);
      const bool same = next == inliers;
      inliers = std::move(next);
      if (same) break;
    }
    // Less than half is no consensus: the residuals are not those of the noise, whichever pairs are taken.
    if (2 * inliers.size() < pairs_.size() || inliers.size() < 4) return;
    fits.front() = best;
    // Candidates are compared on the pairs of the best.
    for (HandEyeFit& fit : fits) fit.cost = handEyeCost(fit.value, pairs_, inliers);
    take(fits, inliers);
    if (!known) rescale(gate / options_.gate);
  }
  /// The gate in units of the given covariances.
  double gateFor(const std::vector<double>& errors) const {
    if (options_.known_noise) return options_.gate;
    // The median of all, which wrong pairs can only have moved up, then the mean of those within its gate.
    const double most = median(errors) / median_error;
    double factor = most;
    for (int k = 0; k < 3; ++k) {
      double sum = 0, freedom = -parameters;
      for (const double error : errors) {
        if (error <= factor * options_.gate) sum += error, freedom += 6;
      }
      if (freedom <= 0) break;
      factor = std::min(most, sum / freedom);
    }
    return factor * options_.gate;
  }

  void estimate() {
    HandEyeValue value = candidates_.front().value;
    if (!std::isfinite(candidates_.front().cost)) {
      result_.status = FusionStatus::not_converged;
      return;
    }
    HandEyeExcitation excitation = handEyeExcitation(value, pairs_, evenly(inliers_), world);
    int open = openDirections(excitation, options_.trusted_excitation);
    StrictHandEye strict;
    // Open directions are known at the estimate, and the estimate holds open directions: at most a few rounds.
    for (int round = 0; round < 4; ++round) {
      strict = strictHandEye(value, pairs_, inliers_, world, excitation, open);
      if (!strict.converged) break;
      value = strict.value;
      if (const int freedom = 6 * static_cast<int>(inliers_.size()) - parameters + open;
          !options_.known_noise && freedom > 0) {
        const double change = strict.chi2 / freedom;
        rescale(change);
        strict.chi2 /= change, strict.covariance *= change;
      }
      excitation = handEyeExcitation(value, pairs_, inliers_, world);
      const int now_open = openDirections(excitation, options_.trusted_excitation);
      // A factor of all covariances changes neither X nor the corrected poses.
      if (std::exchange(open, now_open) == now_open) break;
    }
    report(value, strict, excitation, open);
  }

  void report(const HandEyeValue& value, const StrictHandEye& strict, const HandEyeExcitation& excitation, int open) {
    HandEyeResult& r = result_;
    r.X.mean = value.X, r.Y.mean = value.Y;
    const bool converged = strict.converged;
    // Corrections of thousands of standard deviations have no limit to converge to; the first estimate has their cost.
    const double chi2 = converged ? strict.chi2 : candidates_.front().cost;
    r.chi2 = chi2 * r.variance_factor;
    r.degrees_of_freedom = 6 * static_cast<int>(inliers_.size()) - parameters + open;
    if (options_.known_noise) {
      r.p = chiSquaredTail(chi2, static_cast<std::size_t>(std::max(0, r.degrees_of_freedom)));
    }
    r.excitations = excitation.values;
    const GripperMotion motion(pairs_, inliers_, world);
    appendOpenDirections(r.directions, excitation, open, value, motion, world);
    for (OpenDirection& d : r.directions) d.weak = d.excitation >= options_.min_excitation;

    r.pairs.resize(pairs_.size());
    errors_ = errorsAt(value);
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      PairFit& fit = r.pairs[order_[i]];
      fit.error = handEyeError(value, pairs_.a.mean(i), pairs_.b.mean(i));
      fit.chi2 = errors_[i];
    }
    for (const std::size_t i : inliers_) r.pairs[order_[i]].inlier = true;
    for (std::size_t i = 0; i < r.pairs.size(); ++i) {
      if (!r.pairs[i].inlier) r.outliers.push_back(i);
    }

    if (converged && !r.rotationIsOpen())
      setCovariance(open > 0 ? ownPart(strict.covariance) : widened(ownPart(strict.covariance), value));
    if (converged && open == 0) testSuspects(value);
    r.status = statusOf(strict, value, open);
  }

  // Suspects.

  static constexpr int suspects = static_cast<int>(hand_eye_suspects), columns = parameters + suspects;
  /// Fewer pairs say little about X itself.
  static constexpr std::size_t min_pairs_for_suspects = 10;

  /// The pairs with the values of the suspects taken in.
  void takeIn() {
    if (values_.isZero(0)) return;
    const double delay = values_[0];
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      pairs_.a.mean(i) = given_[i].first, pairs_.b.mean(i) = given_[i].second;
      if (delay != 0) {
        const double time = options_.times[order_[i]];
        const std::optional<SE3d> now = stream_.at(time), then = stream_.at(time + delay);
        if (now && then) pairs_.a.mean(i) = given_[i].first * (now->inverse() * *then);
      }
      SE3d& B = pairs_.b.mean(i);
      const Eigen::Vector3d target = -(B.so3().inverse() * B.translation());
      Vector6 step = Vector6::Zero();
      step.head<3>() = -values_[1] * target - Eigen::Vector3d(values_[3], values_[4], values_[2]) * target.z();
      B = B * SE3d::exp(step);
    }
  }
  /// Whitened errors and their derivatives by X, Y and the suspects, at the corrected poses: at the measured ones noise
  /// is in both.
  TimedRows<6, columns> suspectRows(const HandEyeValue& value) const {
    return TimedRows<6, columns>(timesOfInliers(), [this, value](std::size_t j, TimedRow<6, columns>& row) {
      const std::size_t i = inliers_[j];
      const PosePair pair = pairs_[i];
      const HandEyeJacobians at(value, pair.a.mean, pair.b.mean);
      const Cholesky<double, 6> S = handEyeErrorFactor(at.A, at.B, pair);
      const Vector6 k = S.solve<1>(at.e);
      const Vector6 a = -product(pair.a.covariance, product(at.A.transpose(), k));
      const Vector6 b = -product(pair.b.covariance, product(at.B.transpose(), k));
      const SE3d B = pair.b.mean * SE3d::exp(b);
      const HandEyeJacobians J(value, pair.a.mean * SE3d::exp(a), B);
      row.values.setZero();
      row.residual() = S.halfSolve<1>(at.e);
      if constexpr (world) {
        row.values.template leftCols<12>() << S.halfSolve<6>(J.X), S.halfSolve<6>(J.Y);
      } else {
        row.values.template leftCols<6>() = S.halfSolve<6>(Matrix6(J.X + J.Y));
      }
      if (!options_.times.empty()) {
        if (const auto velocity = stream_.velocity(options_.times[order_[i]] + values_[0])) {
          row.values.col(parameters) = S.halfSolve<1>(product(J.A, *velocity));
        }
      }
      const Eigen::Vector3d target = -(B.so3().inverse() * B.translation());
      const auto by = [&](int suspect, const Eigen::Vector3d& shift) {
        Vector6 step = Vector6::Zero();
        step.head<3>() = -shift;
        row.values.col(parameters + suspect) = S.halfSolve<1>(product(J.B, step));
      };
      by(1, target);
      if constexpr (world) {
        by(2, target.z() * Eigen::Vector3d::UnitZ());
        by(3, target.z() * Eigen::Vector3d::UnitX()), by(4, target.z() * Eigen::Vector3d::UnitY());
      }
    });
  }
  /// Zeros where there are none.
  std::vector<double> timesOfInliers() const {
    std::vector<double> times(inliers_.size(), 0.0);
    for (std::size_t k = 0; k < times.size() && !options_.times.empty(); ++k) {
      times[k] = options_.times[order_[inliers_[k]]];
    }
    return times;
  }
  ScoreTests<parameters, suspects> scoresAt(const HandEyeValue& value) const {
    ScoreTestOptions<suspects> options{.prior_sigmas = options_.suspect_sigmas, .known_noise = options_.known_noise};
    for (std::size_t k = 0; k < hand_eye_suspects; ++k) options.values[k] = values_[static_cast<int>(k)];
    // A prior on what is not in the rows would be all that is known about it.
    if (options_.times.empty() || stream_.poses().empty()) options.prior_sigmas[0] = 0;
    if (!world) options.prior_sigmas[2] = options.prior_sigmas[3] = options.prior_sigmas[4] = 0;
    return scoreTests<6, parameters, suspects>(suspectRows(value), options);
  }
  bool isUnknown() const {
    return std::any_of(options_.suspect_sigmas.begin(), options_.suspect_sigmas.end(), [](double s) { return s > 0; });
  }
  bool hasUnknownSuspects() const { return isUnknown() && inliers_.size() >= min_pairs_for_suspects; }
  /// Gauss–Newton over suspects, the pairs being made again and X refined at each step.
  void estimateSuspects() {
    if (!hasUnknownSuspects() || !std::isfinite(candidates_.front().cost)) return;
    constexpr int max_rounds = 20;
    constexpr double small = 1e-2;  // standard deviations
    for (int round = 0; round < max_rounds; ++round) {
      const auto scores = scoresAt(candidates_.front().value);
      const Eigen::Matrix<double, suspects, 1> step = scores.step.template tail<suspects>();
      if (!step.allFinite()) break;
      values_ += step;
      takeIn();
      candidates_.front() = refined(candidates_.front(), inliers_);
      double largest = 0;
      for (int k = 0; k < suspects; ++k) {
        const double variance = scores.covariance(parameters + k, parameters + k);
        if (variance > 0) largest = std::max(largest, std::abs(step[k]) / std::sqrt(variance));
      }
      if (largest < small) break;
    }
    candidates_.resize(1);
    take({candidates_.front()}, Indices(inliers_));
  }
  void testSuspects(const HandEyeValue& value) {
    if (inliers_.size() < min_pairs_for_suspects) return;
    const auto scores = scoresAt(value);
    for (std::size_t k = 0; k < hand_eye_suspects; ++k) {
      HandEyeSuspectTest& test = result_.suspects.emplace_back();
      static_cast<SuspectTest&>(test) = scores.suspects[k];
      test.name = name(static_cast<HandEyeSuspect>(k));
      test.unit = k == 0 ? "s" : "";
      test.prior_sigma = options_.suspect_sigmas[k];
      const int column = static_cast<int>(k);
      test.value = values_[column];
      test.value_sigma = std::sqrt(scores.covariance(parameters + column, parameters + column));
      if (test.tested()) test.shift_of_X = scores.shifts.col(column).template head<6>();
    }
    if (hasUnknownSuspects()) {
      setCovariance(scores.covariance.template topLeftCorner<parameters, parameters>());
      result_.dependence = scores.dependence;
    }
    if (scores.strongest < 0) return;
    const Covariance covariance = result_.covariance.template topLeftCorner<parameters, parameters>();
    const auto [step, spread] = groupMixture<parameters, suspects>(scores, covariance);
    result_.X_over_suspects = {value.X * SE3d::exp(Vector6(step.template head<6>())),
                               Matrix6(spread.template topLeftCorner<6, 6>())};
  }
  /// The covariance with the dependence in time and the sizes that the whitened errors show.
  Covariance widened(const Covariance& covariance, const HandEyeValue& value) {
    TimedRows<6, parameters> rows(timesOfInliers(), [this, value](std::size_t j, TimedRow<6, parameters>& row) {
      const PosePair pair = pairs_[inliers_[j]];
      const HandEyeJacobians J(value, pair.a.mean, pair.b.mean);
      const Cholesky<double, 6> S = handEyeErrorFactor(J.A, J.B, pair);
      row.residual() = S.halfSolve<1>(J.e);
      if constexpr (world) {
        row.columns() << S.halfSolve<6>(J.X), S.halfSolve<6>(J.Y);
      } else {
        row.columns() = S.halfSolve<6>(Matrix6(J.X + J.Y));
      }
    });
    const auto timed = timedCovariance<6, parameters>(std::move(rows), covariance, options_.known_noise);
    result_.dependence = timed.dependence;
    return timed.covariance;
  }
  void setCovariance(const Covariance& covariance) {
    if constexpr (world) {
      result_.covariance = covariance;
    } else {
      result_.covariance << covariance, covariance, covariance, covariance;
    }
    result_.X.covariance = result_.covariance.topLeftCorner<6, 6>();
    result_.Y.covariance = result_.covariance.bottomRightCorner<6, 6>();
  }
  static Covariance ownPart(const Eigen::Matrix<double, 12, 12>& both) {
    return both.topLeftCorner<parameters, parameters>();
  }
  FusionStatus statusOf(const StrictHandEye& strict, const HandEyeValue& value, int open) {
    if (result_.p < options_.min_p && candidates_.front().converged) return FusionStatus::inconsistent;
    if (!strict.converged) return FusionStatus::not_converged;
    if (open > 0) return FusionStatus::undetermined;
    // A second minimum whose cost noise may have made larger, and which is another solution.
    for (std::size_t k = 1; k < candidates_.size(); ++k) {
      const HandEyeFit& other = candidates_[k];
      const Vector6 off = (value.X.inverse() * other.value.X).log();
      const Matrix6 V = result_.X.covariance;
      if (other.converged && other.cost < candidates_.front().cost + 16 && mahalanobisSquared<double, 6>(off, V) > 50) {
        result_.rival = other.value.X;
        return FusionStatus::ambiguous;
      }
    }
    return result_.isSuspicious() ? FusionStatus::inconsistent : FusionStatus::ok;
  }

  HandEyeOptions options_;
  PosePairList pairs_;                        // sorted, covariances rescaled
  std::vector<std::size_t> order_;            // index in the input of each
  Indices inliers_;                           // ascending, of the sorted pairs
  std::vector<HandEyeFit> candidates_;        // the best first
  std::vector<double> errors_;                // squared, at the best
  std::vector<std::pair<SE3d, SE3d>> given_;  // the sorted pairs as they were given, where suspects are taken in
  PoseStream stream_;
  Eigen::Matrix<double, suspects, 1> values_ = Eigen::Matrix<double, suspects, 1>::Zero();
  HandEyeResult result_;
};

}  // namespace detail

LIESTAT_FUSION_INLINE HandEyeResult estimateRobotWorld(PosePairList poses, HandEyeOptions options) {
  return detail::HandEyeRun<true>(std::move(poses), std::move(options)).run();
}
LIESTAT_FUSION_INLINE HandEyeResult estimateRobotWorld(std::span<const PosePair> poses, const HandEyeOptions& options) {
  return estimateRobotWorld(PosePairList(poses), options);
}

LIESTAT_FUSION_INLINE HandEyeResult estimateHandEye(PosePairList motions, HandEyeOptions options) {
  return detail::HandEyeRun<false>(std::move(motions), std::move(options)).run();
}
LIESTAT_FUSION_INLINE HandEyeResult estimateHandEye(std::span<const PosePair> motions, const HandEyeOptions& options) {
  return estimateHandEye(PosePairList(motions), options);
}

}  // namespace liestat
