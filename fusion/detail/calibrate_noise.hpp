// The definition of fusion/noise_calibration.hpp.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/detail/visual_inertial_run.hpp>
#include <fusion/noise_calibration.hpp>
#include <fusion/visual_inertial.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

namespace liestat {

namespace detail {

/// Minus twice the log-likelihood of a recording's meetings, as a function of the logarithms of the factors of the
/// gyroscope's and the accelerometer's densities.
class MeetingLikelihood {
 public:
  using Vector2 = Eigen::Vector2d;

  /// The windows are those of initialiseRecording().
  MeetingLikelihood(const VisualInertialRecording& recording, const RecordingRun& run,
                    const std::vector<InitialisedWindow>& windows, std::function<void()> advance)
      : recording_(recording), run_(run), windows_(windows), advance_(std::move(advance)) {
    for (FusedStretch& stretch : run.stretchesOf(windows, [](const InitialisedWindow& w) {
           return w.closedForm().status == FusionStatus::ok && w.isRefined();
         })) {
      if (stretch.windows.size() > 1) stretches_.push_back(std::move(stretch));
    }
  }

  struct Value {
    double cost = std::numeric_limits<double>::infinity();
    double chi2 = 0;
    std::size_t degrees_of_freedom = 0, windows = 0;
  };

  /// Of all meetings; an infinite cost where windows fell out that others have kept.
  Value operator()(const Vector2& log_factor) {
    ImuNoise<double> noise = recording_.noise;
    noise.gyroscope *= std::exp(log_factor[0]), noise.gyroscope_walk *= std::exp(log_factor[0]);
    noise.accelerometer *= std::exp(log_factor[1]), noise.accelerometer_walk *= std::exp(log_factor[1]);
    const RecordingRun run = run_.withNoise(noise);
    std::vector<InitialisedWindow> windows = windows_;
    Value value;
    double cost = 0;
    for (FusedStretch stretch : stretches_) {
      for (const std::size_t i : stretch.windows) windows[i].measured = windows_[i].measured.withNoise(noise);
      cost += run.fuse(windows, stretch);
      cost += stretch.chi2;
      value.chi2 += stretch.chi2;
      value.degrees_of_freedom += stretch.degrees_of_freedom;
      value.windows += stretch.windows.size();
    }
    if (degrees_of_freedom_ == 0) degrees_of_freedom_ = value.degrees_of_freedom;
    if (value.degrees_of_freedom == degrees_of_freedom_ && std::isfinite(cost)) value.cost = cost;
    if (advance_) advance_();
    return value;
  }

 private:
  const VisualInertialRecording& recording_;
  const RecordingRun& run_;
  const std::vector<InitialisedWindow>& windows_;
  std::function<void()> advance_;
  std::vector<FusedStretch> stretches_;
  std::size_t degrees_of_freedom_ = 0;
};

/// χ² of one degree of freedom stays below with a probability of 95 %.
inline constexpr double likelihood_drop = 3.841458820694124;
/// Logarithms of the factors that are looked at: 0.02 to 400.
inline constexpr double least_log_factor = -4, most_log_factor = 6;

/// The minimum of a function of one variable with one minimum, by a grid and the golden section.
template <class Function>
std::pair<double, double> minimise(const Function& f) {
  std::pair<double, double> best{0, std::numeric_limits<double>::infinity()};
  for (double x = -1.5; x <= 5; x += 1.5) {
    if (const double y = f(x); y < best.second) best = {x, y};
  }
  constexpr double ratio = 0.6180339887498949;
  double low = best.first - 1.5, high = best.first + 1.5;
  double a = high - ratio * (high - low), b = low + ratio * (high - low), at_a = f(a), at_b = f(b);
  while (high - low > 0.06) {
    if (at_a < at_b) {
      high = b, b = a, at_b = at_a, a = high - ratio * (high - low), at_a = f(a);
    } else {
      low = a, a = b, at_a = at_b, b = low + ratio * (high - low), at_b = f(b);
    }
  }
  return at_a < at_b ? std::pair{a, at_a} : std::pair{b, at_b};
}

/// Where the function has risen by likelihood_drop on the way to `end`; `end` where it has not.
template <class Function>
double edge(const Function& f, std::pair<double, double> minimum, double end) {
  double inside = minimum.first, outside = inside;
  const double step = end > inside ? 0.5 : -0.5, limit = minimum.second + likelihood_drop;
  for (double width = step; outside == inside; width *= 2) {
    const double x = end > inside ? std::min(end, inside + width) : std::max(end, inside + width);
    if (f(x) > limit) {
      outside = x;
    } else if (x == end) {
      return end;
    } else {
      inside = outside = x;
    }
  }
  while (std::abs(outside - inside) > 0.05) {
    const double middle = 0.5 * (inside + outside);
    (f(middle) > limit ? outside : inside) = middle;
  }
  return 0.5 * (inside + outside);
}

/// Both factors by themselves, by Newton's method on differences from the common one.
template <class Function>
bool separate(const Function& f, double common, NoiseCalibration& result) {
  using Matrix2 = Eigen::Matrix2d;
  using Vector2 = Eigen::Vector2d;
  constexpr double h = 0.35;
  Vector2 x(common, common);
  double at_x = f(x);
  Matrix2 H = Matrix2::Zero();
  for (int pass = 0; pass < 8; ++pass) {
    const Vector2 e0(h, 0), e1(0, h);
    const double p0 = f(x + e0), m0 = f(x - e0), p1 = f(x + e1), m1 = f(x - e1);
    const double mixed = f(x + e0 + e1) - f(x + e0 - e1) - f(x - e0 + e1) + f(x - e0 - e1);
    const Vector2 g((p0 - m0) / (2 * h), (p1 - m1) / (2 * h));
    H << (p0 - 2 * at_x + m0) / (h * h), mixed / (4 * h * h), 0, (p1 - 2 * at_x + m1) / (h * h);
    H(1, 0) = H(0, 1);
    if (!H.allFinite() || !(H(0, 0) > 0) || !(H.determinant() > 1e-3 * H(0, 0) * H(0, 0))) return false;
    Vector2 step = -H.inverse() * g;
    if (const double length = step.norm(); length > 1) step /= length;
    double next = f(x + step);
    for (int half = 0; half < 4 && !(next < at_x); ++half) step *= 0.5, next = f(x + step);
    if (!(next < at_x)) break;
    x += step, at_x = next;
    if (step.norm() < 0.05) break;
    if (x.minCoeff() < least_log_factor || x.maxCoeff() > most_log_factor) return false;
  }
  const Matrix2 covariance = 2 * H.inverse();
  const auto factorOf = [&](int i) {
    const double sd = std::sqrt(covariance(i, i));
    return NoiseFactor{std::exp(x[i]), std::exp(x[i] - 1.96 * sd), std::exp(x[i] + 1.96 * sd)};
  };
  if (!(covariance(0, 0) > 0 && covariance(1, 1) > 0)) return false;
  result.gyroscope = factorOf(0), result.accelerometer = factorOf(1);
  const auto isNarrow = [](const NoiseFactor& factor) { return factor.high < 6 * factor.low; };
  return isNarrow(result.gyroscope) && isNarrow(result.accelerometer);
}

}  // namespace detail

LIESTAT_FUSION_INLINE NoiseCalibration
calibrateNoise(const VisualInertialRecording& recording, const VisualInertialOptions& options,
               const std::function<void(std::size_t done, std::size_t all)>& progress) {
  NoiseCalibration result;
  VisualInertialOptions how = options;
  how.refinement = true;
  const double stretch = how.stretch > 0 ? how.stretch : VisualInertialOptions{}.stretch;
  how.stretch = 0;
  constexpr std::size_t trials = 80;
  std::size_t windows = 0, done = 0;
  const VisualInertialResult initial = initialiseRecording(recording, how, [&](std::size_t k, std::size_t all) {
    windows = all;
    if (progress) progress(k, all + trials);
  });
  result.fault = initial.fault;
  if (result.fault) return result;
  how.stretch = stretch;
  VisualInertialResult unused;
  const detail::RecordingRun run(recording, how, unused);
  detail::MeetingLikelihood likelihood(recording, run, initial.windows, [&] {
    done = std::min(done + 1, trials);
    if (progress) progress(windows + done, windows + trials);
  });
  const auto given = likelihood({0, 0});
  result.windows = given.windows;
  result.degrees_of_freedom = given.degrees_of_freedom;
  result.meetings = given.degrees_of_freedom / 11;
  result.chi2 = given.chi2;
  result.status = FusionStatus::undetermined;
  if (result.meetings == 0) return result;
  const auto common = [&](double x) { return likelihood({x, x}).cost; };
  const std::pair<double, double> minimum = detail::minimise(common);
  if (!std::isfinite(minimum.second)) return result;
  const double low = detail::edge(common, minimum, detail::least_log_factor);
  const double high = detail::edge(common, minimum, detail::most_log_factor);
  result.common = {std::exp(minimum.first), low <= detail::least_log_factor ? 0 : std::exp(low),
                   high >= detail::most_log_factor ? std::numeric_limits<double>::infinity() : std::exp(high)};
  result.calibrated_chi2 = likelihood({minimum.first, minimum.first}).chi2;
  if (result.common.low == 0 && std::isinf(result.common.high)) return result;
  result.status = FusionStatus::ok;
  result.separable =
      detail::separate([&](const Eigen::Vector2d& x) { return likelihood(x).cost; }, minimum.first, result);
  return result;
}

}  // namespace liestat
