// The rate of an inertial sensor, measured from the times of its readings, some of which may be missing.
#pragma once

#include <fusion/imu/readings.hpp>

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

namespace liestat {

/// Readings per second (Hz) that a sensor gives, out of the times of those that arrived: one over the mean of the steps
/// that are not longer than others for want of a reading, which half of the readings may be. Times of arrival in
/// bunches do not show the sensor's steps: for them it is the number of readings over their time. Steps that do not
/// ascend, or of more than `max_gap` s, are passed over. Zero for less than two readings.
template <class S>
S readingRate(std::span<const ImuSample<S>> samples, const S& max_gap = S(0.1)) {
  S sum(0), shortest = max_gap, longest(0);
  std::size_t n = 0;
  // False for NaN too.
  const auto counts = [&](const S& step) { return step > S(0) && step <= max_gap; };
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const S step = samples[i].time - samples[i - 1].time;
    if (!counts(step)) continue;
    sum += step, ++n;
    shortest = std::min(shortest, step), longest = std::max(longest, step);
  }
  if (n == 0) return S(0);
  const S mean = sum / S(static_cast<double>(n));
  // A missing reading doubles a step; clocks jitter by less than half of one.
  constexpr double missing = 1.5;
  if (longest <= S(missing) * shortest) return S(1) / mean;
  std::vector<S> steps;
  steps.reserve(n);
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const S step = samples[i].time - samples[i - 1].time;
    if (counts(step)) steps.push_back(step);
  }
  // A fifth of the steps is whole even where more than half of the readings are missing.
  const auto fifth = steps.begin() + static_cast<std::ptrdiff_t>(n / 5);
  std::nth_element(steps.begin(), fifth, steps.end());
  const S bound = S(missing) * *fifth;
  S whole(0), count(0);
  for (const S& step : steps) {
    if (step < bound) whole += step, count += S(1);
  }
  const S period = whole / count;
  // If readings are missing independently, a fraction `count`/n of the steps is whole, and the mean is period·n/count.
  constexpr double bunched = 3;
  return S(1) / (mean * count > S(bunched) * period * S(static_cast<double>(n)) ? mean : period);
}

}  // namespace liestat
