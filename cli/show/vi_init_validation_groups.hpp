// The rows of `liestat validate vi-init` as its tables and its page show them: by check, estimator and kind of window.
#pragma once

#include <experiments/vi_init_validation.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

namespace liestat::cli {

/// The rows of one estimator in one kind of window.
struct ViInitGroup {
  std::vector<const experiments::ViInitRow*> rows;

  const experiments::ViInitRow& first() const { return *rows.front(); }
  const experiments::ViInitRow* of(experiments::ViInitQuantity quantity) const {
    const auto found = std::find_if(rows.begin(), rows.end(),
                                    [&](const experiments::ViInitRow* row) { return row->quantity == quantity; });
    return found == rows.end() ? nullptr : *found;
  }
  std::string window() const {
    const experiments::ViInitWindow& w = first().window;
    return fmt::format("{:g} s, {}, {}", w.seconds, w.images, w.features);
  }
  std::string verdict() const {
    bool judged = false, passed = true;
    for (const experiments::ViInitRow* row : rows) {
      judged = judged || row->passed;
      passed = passed && row->passed.value_or(true);
    }
    return !judged ? "" : passed ? "pass" : "FAIL";
  }
};

/// The groups of a check, in the order of the rows.
inline std::vector<ViInitGroup> groups(const std::vector<experiments::ViInitRow>& rows,
                                       experiments::ViInitCheck check) {
  std::vector<ViInitGroup> list;
  for (const experiments::ViInitRow& row : rows) {
    if (row.check != check) continue;
    const auto belongs = [&](const ViInitGroup& g) {
      const experiments::ViInitRow& other = g.first();
      return other.estimator == row.estimator && other.window == row.window;
    };
    auto group = std::find_if(list.begin(), list.end(), belongs);
    if (group == list.end()) group = list.insert(list.end(), ViInitGroup{});
    group->rows.push_back(&row);
  }
  return list;
}

/// The factors of the densities of gyroscope and accelerometer in the calibration's rows.
inline std::string inWords(experiments::ViInitEstimator estimator) {
  std::string text = name(estimator).substr(std::string_view("noise_").size());
  std::replace(text.begin(), text.end(), '_', ',');
  return text;
}

/// The subject of a check, in a line.
inline const char* describe(experiments::ViInitCheck check) {
  using Check = experiments::ViInitCheck;
  switch (check) {
    case Check::consistency:
      return "Refinement under its covariance, biases drawn from their priors: index (degrees of freedom)";
    case Check::walk:
      return "Refinement under its covariance, biases that also walk: index (degrees of freedom)";
    case Check::closed_form:
      return "Closed form under its covariance, image noise alone: index (degrees of freedom)";
    case Check::accuracy:
      return "Closed form with the sensor's noise, biases known: errors, median / 95 %";
    case Check::gyroscope_bias:
      return "A gyroscope's bias of 0.05 rad/s: errors, median / 95 %";
    case Check::noise:
      return "Densities that are g and a times the given ones: how often 95 % intervals of the calibration hold that";
    case Check::rest:
      return "At rest, and slow among features 2 to 8 m away: told right, that it moves, and the covariance at rest";
    case Check::drift:
      return "40 % of the tracks drift by 8 px an image: errors, median / 95 %";
  }
  return "";
}

}  // namespace liestat::cli
