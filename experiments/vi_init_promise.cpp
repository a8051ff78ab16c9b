// The promises made about the rows of `liestat validate vi-init`; docs/validation.md says how they were measured.

#include <experiments/vi_init_validation.hpp>

#include <algorithm>
#include <array>
#include <span>

namespace liestat::experiments {
namespace {

using Check = ViInitCheck;
using Estimator = ViInitEstimator;
using Quantity = ViInitQuantity;

constexpr double none = std::numeric_limits<double>::infinity();

/// Median and 95 % quantile.
struct Bound {
  double median = none, p95 = none;
};

/// Errors in one kind of window, as promised and as an independent prototype has them.
struct Errors {
  ViInitWindow window;
  Bound speed, gravity, scale, other;
  Bound note_speed = {}, note_gravity = {}, note_scale = {}, note_other = {};
};

/// Sections 3.7 and 5. The other is the scale of the features.
constexpr std::array<Errors, 5> refined_errors = {{
    {{1, 11, 20}, {0.043, 0.14}, {0.5, 1.2}, {2.5, 10}, {2.1, 8.5}, {0.041, 0.13}, {0.52, 1.0}, {1.9, 6}},
    {{2, 11, 20}, {0.02, 0.054}, {0.35, 0.78}, {0.92, 3.9}, {0.69, 2.6}},
    {{2, 21, 20}, {0.016, 0.043}, {0.33, 0.73}, {0.73, 3.1}, {0.56, 2}, {0.016, 0.05}, {0.27, 0.6}, {0.7, 2}},
    {{3, 16, 20}, {0.0128, 0.032}, {0.24, 0.61}, {0.55, 2.4}, {0.39, 1.4}},
    {{2, 21, 50}, {0.0105, 0.027}, {0.285, 0.65}, {0.5, 2}, {0.37, 1.35}},
}};

/// The first table of section 5, which is that of least squares.
constexpr std::array<Errors, 4> least_squares_errors = {{
    {{1, 11, 20}, {0.029, 0.105}, {0.225, 0.75}, {1.6, 8}, {}, {0.17, 0.64}, {1, 3.3}, {12, 43}},
    {{2, 21, 20}, {0.0095, 0.027}, {0.044, 0.12}, {0.43, 2}, {}, {0.03, 0.14}, {0.12, 0.49}, {1.9, 10}},
    {{3, 31, 20}, {0.0064, 0.015}, {0.0245, 0.057}, {0.28, 1.2}, {}, {0.012, 0.042}, {0.04, 0.09}, {0.8, 3.1}},
    {{4, 41, 20}, {0.0058, 0.013}, {0.021, 0.046}, {0.235, 1.05}, {}, {0.011, 0.03}, {0.035, 0.07}, {0.75, 2.8}},
}};

/// The other is the bias.
constexpr std::array<Errors, 1> gyroscope_bias_errors = {
    {{{2, 21, 20}, {}, {0.078, 0.2}, {0.53, 2.35}, {0.00145, 0.0033}, {}, {0.2, 0.7}, {2.8, 15}, {0.0017, 0.008}}}};

constexpr std::array<Errors, 1> drift_errors = {
    {{{2, 21, 40}, {0.0087, 0.0235}, {0.0415, 0.108}, {0.38, 1.75}, {}, {0.03, none}}}};

std::optional<ViInitPromise> errorsOf(std::span<const Errors> list, const ViInitRow& row, bool only_note,
                                      std::size_t note_windows) {
  const auto found = std::find_if(list.begin(), list.end(), [&](const Errors& e) { return e.window == row.window; });
  if (found == list.end()) return {};
  const bool speed = row.quantity == Quantity::speed, gravity = row.quantity == Quantity::gravity;
  const bool scale = row.quantity == Quantity::scale;
  const Bound& own = speed ? found->speed : gravity ? found->gravity : scale ? found->scale : found->other;
  const Bound& note = speed     ? found->note_speed
                      : gravity ? found->note_gravity
                      : scale   ? found->note_scale
                                : found->note_other;
  ViInitPromise promise;
  if (!only_note) {
    promise.median = own.median;
    promise.p95 = own.p95;
  }
  promise.note_median = note.median;
  promise.note_p95 = note.p95;
  promise.note_windows = note_windows;
  return promise;
}

std::optional<ViInitPromise> distances(const ViInitRow& row) {
  ViInitPromise promise;
  if (row.check == Check::consistency || row.check == Check::walk) {
    promise.tolerance = {.index = 0.03, .ks = 0.02, .failure_fraction = 0.005, .tail = 0.002};
  } else if (row.check == Check::rest) {
    // A window at rest that is not called stationary counts as lost: a hundredth may be.
    promise.tolerance = {.index = 0.04, .ks = 0.03, .failure_fraction = 0.01, .tail = 0.003};
  } else if (row.quantity == Quantity::nees_all) {
    // Gravity and bias share a direction that is known far better than either: there the sphere's curvature counts.
    promise.tolerance = {.index = 0.12, .ks = 0.06, .failure_fraction = 0.003, .tail = 0.025};
  } else {
    promise.tolerance = {
        .index = 0.04, .ks = 0.03, .failure_fraction = row.window.seconds < 2 ? 0.01 : 0.003, .tail = 0.003};
  }
  return promise;
}

}  // namespace

std::optional<ViInitPromise> viInitPromise(const ViInitRow& row) {
  switch (statistic(row.quantity)) {
    case ViInitStatistic::distance:
      return distances(row);
    case ViInitStatistic::chi_squared: {
      ViInitPromise promise;
      promise.deviation = 0.01;
      return promise;
    }
    case ViInitStatistic::fraction: {
      if (row.quantity == Quantity::moving) return {};
      ViInitPromise promise;
      promise.fraction = row.check == Check::noise ? 0.9 : 0.99;
      return promise;
    }
    case ViInitStatistic::error:
      break;
  }
  switch (row.estimator) {
    case Estimator::refinement:
      return errorsOf(refined_errors, row, false, 50);
    case Estimator::closed_form:
      return errorsOf(least_squares_errors, row, false, 60);
    case Estimator::least_squares:
      return errorsOf(least_squares_errors, row, true, 60);
    case Estimator::bias_estimated:
      return errorsOf(gyroscope_bias_errors, row, false, 60);
    case Estimator::robust:
      return errorsOf(drift_errors, row, false, 60);
    default:
      return {};
  }
}

}  // namespace liestat::experiments
