// The definition of fusion/noise_calibration.hpp.
#pragma once

#include <lie/detail/small_eigen.hpp>
#include <fusion/detail/compiled.hpp>
#include <fusion/init/detail/visual_inertial_run.hpp>
#include <fusion/noise_calibration.hpp>
#include <fusion/visual_inertial.hpp>
#include <lie/detail/small_matrix.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/noise_fit.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

namespace liestat {

namespace detail {

/// The probability that minus twice the log-likelihood is so much larger at the true factor than at the best one: of χ²₁
/// for many meetings. Few tell their own scatter badly: then that of Student's law squared.
inline double probabilityOfRise(double rise, std::size_t meetings) {
  return 2 * studentTail(std::sqrt(std::max(0., rise)), static_cast<double>(meetings));
}

/// Logarithms of the factors of the gyroscope's and the accelerometer's densities.
struct LogFactors {
  static constexpr double least = -2.5, most = 6;  ///< 0.08 to 400
  double gyroscope = 0, accelerometer = 0;

  ImuNoise<double> of(ImuNoise<double> noise) const {
    noise.gyroscope *= std::exp(gyroscope), noise.gyroscope_walk *= std::exp(gyroscope);
    noise.accelerometer *= std::exp(accelerometer), noise.accelerometer_walk *= std::exp(accelerometer);
    return noise;
  }
};

/// Where a function of one variable is least between two bounds, and its value there: a grid, then the golden section.
template <class Function>
std::pair<double, double> minimumOf(const Function& f, double low, double high) {
  constexpr int steps = 10;
  const double step = (high - low) / steps;
  std::pair<double, double> best{low, f(low)};
  for (int i = 1; i <= steps; ++i) {
    const double x = low + i * step;
    if (const double y = f(x); y < best.second) best = {x, y};
  }
  constexpr double ratio = 0.6180339887498949;
  double from = std::max(low, best.first - step), to = std::min(high, best.first + step);
  double a = to - ratio * (to - from), b = from + ratio * (to - from), at_a = f(a), at_b = f(b);
  while (to - from > 0.01) {
    if (at_a < at_b) {
      to = b, b = a, at_b = at_a, a = to - ratio * (to - from), at_a = f(a);
    } else {
      from = a, a = b, at_a = at_b, b = from + ratio * (to - from), at_b = f(b);
    }
  }
  if (at_a < best.second) best = {a, at_a};
  if (at_b < best.second) best = {b, at_b};
  return best;
}

/// The 95 % interval around a minimum.
template <class Function>
NoiseFactor intervalOf(const Function& f, const std::pair<double, double>& minimum, std::size_t meetings) {
  const auto isOutside = [&](double x) { return probabilityOfRise(f(x) - minimum.second, meetings) < 0.05; };
  const auto end = [&](double outside) {
    if (!isOutside(outside)) return outside;
    double inside = minimum.first;
    while (std::abs(outside - inside) > 0.01) {
      const double middle = 0.5 * (inside + outside);
      (isOutside(middle) ? outside : inside) = middle;
    }
    return 0.5 * (inside + outside);
  };
  const double low = end(LogFactors::least), high = end(LogFactors::most);
  NoiseFactor factor{.factor = std::exp(minimum.first)};
  if (low > LogFactors::least) factor.low = std::exp(low);
  if (high < LogFactors::most) factor.high = std::exp(high);
  return factor;
}

/// Minus twice the log-likelihood of meetings near the factors at which they were computed: to either density squared
/// the covariance of a difference is nearly linear, and the difference hardly moves.
class MeetingModel {
 public:
  using Meetings = std::vector<RecordingRun::Meeting>;

  /// Meetings at these factors, and with the one or the other raised by `step`. Those that are not in all are left out.
  MeetingModel(const LogFactors& at, double step, const Meetings& here, const Meetings& gyroscope,
               const Meetings& accelerometer)
      : at_(at) {
    const double rise = std::expm1(2 * step);
    const auto find = [](const Meetings& meetings, std::size_t window) {
      const auto found =
          std::find_if(meetings.begin(), meetings.end(), [&](const auto& m) { return m.window == window; });
      return found == meetings.end() ? nullptr : &*found;
    };
    for (const RecordingRun::Meeting& meeting : here) {
      const auto *by_g = find(gyroscope, meeting.window), *by_a = find(accelerometer, meeting.window);
      const Matrix11& S = meeting.outcome.difference_covariance;
      const Cholesky<double, 11> factor(S);
      if (!by_g || !by_a || !factor.ok()) continue;
      // In units of S, of which each density has a part from 0 to all.
      const auto part = [&](const Matrix11& raised) {
        const Matrix11 half = factor.halfSolve<11>(Matrix11((raised - S) / rise));
        return atLeast(0, Matrix11(factor.halfSolve<11>(Matrix11(half.transpose()))));
      };
      Term term{factor.halfSolve<1>(meeting.outcome.difference),
                factor.logDeterminant(),
                {},
                part(by_g->outcome.difference_covariance),
                part(by_a->outcome.difference_covariance)};
      term.rest = atLeast(1e-6, Matrix11(Matrix11::Identity() - term.gyroscope - term.accelerometer));
      terms_.push_back(term);
    }
  }

  std::size_t meetings() const { return terms_.size(); }
  double operator()(const LogFactors& x) const {
    const double by_g = std::exp(2 * (x.gyroscope - at_.gyroscope));
    const double by_a = std::exp(2 * (x.accelerometer - at_.accelerometer));
    double cost = 0;
    for (const Term& term : terms_) {
      const Cholesky<double, 11> factor(Matrix11(term.rest + by_g * term.gyroscope + by_a * term.accelerometer));
      if (!factor.ok()) return std::numeric_limits<double>::infinity();
      cost += factor.halfSolve<1>(term.d).squaredNorm() + factor.logDeterminant() + term.log_determinant;
    }
    return cost;
  }

  /// The best of one factor, given the other.
  std::pair<double, double> bestGyroscope(double accelerometer) const {
    return minimumOf([&](double x) { return (*this)({x, accelerometer}); }, LogFactors::least, LogFactors::most);
  }
  std::pair<double, double> bestAccelerometer(double gyroscope) const {
    return minimumOf([&](double x) { return (*this)({gyroscope, x}); }, LogFactors::least, LogFactors::most);
  }
  double gyroscopeProfile(double x) const { return bestAccelerometer(x).second; }
  double accelerometerProfile(double x) const { return bestGyroscope(x).second; }
  double common(double x) const { return (*this)({x, x}); }
  /// The best of both.
  LogFactors best() const {
    const double x =
        minimumOf([&](double g) { return gyroscopeProfile(g); }, LogFactors::least, LogFactors::most).first;
    return {x, bestAccelerometer(x).first};
  }

 private:
  /// The difference and the parts of its covariance S, whitened by S.
  struct Term {
    Eigen::Matrix<double, 11, 1> d;
    double log_determinant;  ///< log det S
    Matrix11 rest, gyroscope, accelerometer;
  };
  /// The symmetric matrix with its eigenvalues raised to a bound.
  static Matrix11 atLeast(double bound, const Matrix11& A) {
    const SymmetricEigen eigen(Matrix11(0.5 * (A + A.transpose())));
    return eigen.vectors * eigen.values.cwiseMax(bound).asDiagonal() * eigen.vectors.transpose();
  }

  LogFactors at_;
  std::vector<Term> terms_;
};

/// The meetings of a recording's windows, as functions of the densities.
class RecordingMeetings {
 public:
  /// The windows are those of initialiseRecording(), and are left with their last estimates.
  RecordingMeetings(const VisualInertialRecording& recording, const RecordingRun& run,
                    std::vector<InitialisedWindow>& windows)
      : recording_(recording), run_(run), windows_(windows) {
    // Not those that are ok: with densities that are too small, windows are refused which the calibration would mend.
    for (FusedStretch& stretch : run.stretchesOf(windows_, [](const InitialisedWindow& w) {
           return w.closedForm().status == FusionStatus::ok && !w.found.second && w.isRefined();
         })) {
      if (stretch.windows.size() > 1) stretches_.push_back(std::move(stretch));
    }
  }

  std::size_t stretches() const { return stretches_.size(); }
  /// How many windows took part, and their distances, at the last factors asked for.
  std::size_t windows() const { return fused_; }
  double chi2() const { return chi2_; }
  std::size_t degrees_of_freedom() const { return degrees_of_freedom_; }

  /// Windows estimated anew, on from the last estimates.
  MeetingModel::Meetings at(const LogFactors& factors) { return meetings(factors, true); }
  MeetingModel modelAt(const LogFactors& factors) {
    constexpr double step = 0.1;
    const auto here = at(factors);
    // Estimates hardly move by a step: their covariances there are enough.
    const auto gyroscope = meetings({factors.gyroscope + step, factors.accelerometer}, false);
    const auto accelerometer = meetings({factors.gyroscope, factors.accelerometer + step}, false);
    return {factors, step, here, gyroscope, accelerometer};
  }

 private:
  MeetingModel::Meetings meetings(const LogFactors& factors, bool estimate) {
    const ImuNoise<double> noise = factors.of(recording_.noise);
    const RecordingRun run = run_.withNoise(noise);
    MeetingModel::Meetings all;
    double chi2 = 0;
    std::size_t dof = 0, fused = 0;
    for (FusedStretch stretch : stretches_) {
      for (const std::size_t i : stretch.windows) windows_[i].measured = windows_[i].measured.withNoise(noise);
      const std::vector<std::size_t> of = stretch.windows;
      // Estimates to a tenth of a standard deviation.
      const auto estimates =
          run.estimates(windows_, stretch, estimate ? 0.01 : std::numeric_limits<double>::infinity());
      const auto meetings = run.fuse(windows_, estimates, stretch);
      for (std::size_t k = 0; estimate && k < of.size(); ++k) {
        if (estimates[k] && estimates[k]->converged()) windows_[of[k]].refined = estimates[k];
      }
      all.insert(all.end(), meetings.begin(), meetings.end());
      chi2 += stretch.chi2;
      dof += stretch.degrees_of_freedom;
      fused += stretch.windows.size();
    }
    if (estimate) chi2_ = chi2, degrees_of_freedom_ = dof, fused_ = fused;
    return all;
  }

  const VisualInertialRecording& recording_;
  const RecordingRun& run_;
  std::vector<InitialisedWindow>& windows_;
  std::vector<FusedStretch> stretches_;
  std::size_t fused_ = 0, degrees_of_freedom_ = 0;
  double chi2_ = 0;
};

LIESTAT_FUSION_INLINE NoiseCalibration calibrateWindows(const VisualInertialRecording& recording,
                                                        const RecordingRun& run,
                                                        std::vector<InitialisedWindow>& windows,
                                                        const std::function<bool()>& goesOn) {
  NoiseCalibration result;
  result.noise = recording.noise;
  result.status = FusionStatus::undetermined;
  RecordingMeetings recorded(recording, run, windows);
  if (recorded.stretches() == 0) return result;

  LogFactors factors;
  std::optional<MeetingModel> model;
  for (std::size_t pass = 1;; ++pass) {
    model = recorded.modelAt(factors);
    if (pass == 1) {
      result.chi2 = result.calibrated_chi2 = recorded.chi2();
      result.degrees_of_freedom = recorded.degrees_of_freedom();
      result.windows = recorded.windows();
    }
    result.meetings = model->meetings();
    if (model->meetings() == 0) return result;
    const LogFactors best = model->best();
    // Meetings are computed where each density has a share in them that can be told: below, the model says as much.
    const LogFactors next{std::max({best.gyroscope, factors.gyroscope - 1, -1.}),
                          std::max({best.accelerometer, factors.accelerometer - 1, -1.})};
    // Over less than a standard deviation the model holds: its best factors are better than these.
    if ((*model)(factors) - (*model)(next) < 0.5) break;
    if (!goesOn() || pass + 1 == max_noise_passes) {
      result.status = FusionStatus::not_converged;
      return result;
    }
    // Differences move with the factors, so that full steps may go to and fro.
    const double length = pass < 4 ? 1 : 0.5;
    factors.gyroscope += length * (next.gyroscope - factors.gyroscope);
    factors.accelerometer += length * (next.accelerometer - factors.accelerometer);
  }

  const LogFactors best = model->best();
  const double least = (*model)(best);
  result.gyroscope =
      intervalOf([&](double x) { return model->gyroscopeProfile(x); }, {best.gyroscope, least}, result.meetings);
  result.accelerometer = intervalOf([&](double x) { return model->accelerometerProfile(x); },
                                    {best.accelerometer, least}, result.meetings);
  const auto common = [&](double x) { return model->common(x); };
  const auto best_common = minimumOf(common, LogFactors::least, LogFactors::most);
  result.common = intervalOf(common, best_common, result.meetings);
  result.common_p = probabilityOfRise(best_common.second - least, result.meetings);
  result.separable = result.gyroscope.isTold() && result.accelerometer.isTold();
  // Few meetings may refute the densities by their χ², and not tell the factors.
  const bool contradicted = chiSquaredTail(result.chi2, result.degrees_of_freedom) < refutation_level;
  if (std::isinf(result.common.high) && !contradicted) return result;
  bool told = result.common.isTold(), refuted = contradicted || result.common.refutesOne();
  // A factor that the recording does not determine stays as close to 1 as its interval permits; where none is determined,
  // and the densities are refuted, it is the most likely one.
  const auto held = [&](const NoiseFactor& factor) {
    return std::log(told || !contradicted ? std::clamp(1., factor.low, factor.high) : factor.factor);
  };
  if (result.hasTwoFactors()) {
    told = result.gyroscope.isTold() || result.accelerometer.isTold();
    refuted = contradicted || result.gyroscope.refutesOne() || result.accelerometer.refutesOne();
    // The other one goes with it.
    if (!result.gyroscope.isTold()) {
      const double x = held(result.gyroscope);
      result.gyroscope.factor = std::exp(x);
      result.accelerometer.factor = std::exp(model->bestAccelerometer(x).first);
    } else if (!result.accelerometer.isTold()) {
      const double x = held(result.accelerometer);
      result.accelerometer.factor = std::exp(x);
      result.gyroscope.factor = std::exp(model->bestGyroscope(x).first);
    }
    factors = {std::log(result.gyroscope.factor), std::log(result.accelerometer.factor)};
  } else {
    const double x = told ? best_common.first : held(result.common);
    result.common.factor = std::exp(x);
    factors = {x, x};
  }
  result.status = FusionStatus::ok;
  if (!refuted) {
    const bool bounded = result.hasTwoFactors()
                             ? result.gyroscope.excludesLarger() && result.accelerometer.excludesLarger()
                             : result.common.excludesLarger();
    if (bounded) result.evidence = NoiseEvidence::confirmed;
    return result;
  }
  if (told) result.evidence = NoiseEvidence::calibrated;
  recorded.at(factors);
  result.calibrated_chi2 = recorded.chi2();
  result.noise = factors.of(recording.noise);
  return result;
}

}  // namespace detail

LIESTAT_FUSION_INLINE NoiseCalibration
calibrateNoise(const VisualInertialRecording& recording, const VisualInertialOptions& options,
               const std::function<void(std::size_t done, std::size_t all)>& progress) {
  VisualInertialOptions how = options;
  how.refinement = true;
  how.calibrate_noise = false;
  if (!(how.stretch > 0)) how.stretch = VisualInertialOptions{}.stretch;
  std::size_t windows = 0, done = 0;
  VisualInertialResult initial;
  {
    VisualInertialOptions alone = how;
    alone.stretch = 0;
    initial = initialiseRecording(recording, alone, [&](std::size_t k, std::size_t all) {
      windows = all;
      if (progress) progress(k, all + detail::max_noise_passes);
    });
  }
  if (initial.fault) {
    NoiseCalibration refused;
    refused.noise = recording.noise;
    refused.fault = initial.fault;
    return refused;
  }
  VisualInertialResult unused;
  const detail::RecordingRun run(recording, how, unused);
  return detail::calibrateWindows(recording, run, initial.windows, [&] {
    if (progress) progress(windows + ++done, windows + detail::max_noise_passes);
    return true;
  });
}

}  // namespace liestat
