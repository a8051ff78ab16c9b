// The windows of `liestat vi-init` in a few numbers, for the terminal and for JSON.
#pragma once

#include <cli/commands/vi_init_result.hpp>
#include <cli/show/json.hpp>
#include <cli/show/units.hpp>
#include <experiments/summary.hpp>

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

namespace liestat::cli {

/// Medians and 95 % of what is known of errors.
class ViErrorSummary {
 public:
  void add(const ViError& e) {
    speed_.push_back(e.speed);
    gravity_.push_back(degrees * e.gravity);
    scale_.push_back(100 * std::abs(e.scale));
  }
  std::size_t size() const { return speed_.size(); }
  std::string str() const {
    return fmt::format("{:.3g} / {:.3g} m/s, {:.3g} / {:.3g} deg, scale {:.3g} / {:.3g} %",
                       experiments::quantile(speed_, 0.5), experiments::quantile(speed_, 0.95),
                       experiments::quantile(gravity_, 0.5), experiments::quantile(gravity_, 0.95),
                       experiments::quantile(scale_, 0.5), experiments::quantile(scale_, 0.95));
  }
  JsonObject json() const {
    JsonObject o;
    o.set("windows", size());
    o.set("speed_median", experiments::quantile(speed_, 0.5)).set("speed_95", experiments::quantile(speed_, 0.95));
    o.set("gravity_deg_median", experiments::quantile(gravity_, 0.5))
        .set("gravity_deg_95", experiments::quantile(gravity_, 0.95));
    o.set("scale_percent_median", experiments::quantile(scale_, 0.5))
        .set("scale_percent_95", experiments::quantile(scale_, 0.95));
    return o;
  }

 private:
  std::vector<double> speed_, gravity_, scale_;
};

/// Errors and test values over all windows of a result.
struct ViInitSummary {
  std::map<std::string, std::size_t> statuses;
  ViErrorSummary closed_form, refined;
  std::vector<double> gyroscope;
  double nees = 0, cost = 0;
  std::size_t with_nees = 0, degrees_of_freedom = 0;
  std::size_t compared = 0, compared_not_ok = 0;  ///< windows whose errors these are

  explicit ViInitSummary(const ViInitResult& result) {
    for (const ViWindow& w : result.windows) {
      ++statuses[std::string(name(w.verdict()))];
      // Errors are those of all windows that claim a scale, not only of those that came out well.
      const FusionStatus status = w.closedForm().status;
      if (status == FusionStatus::scale_unobservable || status == FusionStatus::stationary) continue;
      if (w.closed_form_error) {
        closed_form.add(*w.closed_form_error);
        ++compared;
        compared_not_ok += !w.ok();
      }
      if (w.refined_error) refined.add(*w.refined_error);
      if (w.refined_error && w.gyroscope_error) gyroscope.push_back(*w.gyroscope_error);
      if (w.nees) {
        nees += *w.nees;
        ++with_nees;
      }
      if (w.isRefined()) {
        cost += w.refined->cost;
        degrees_of_freedom += w.refined->degrees_of_freedom;
      }
    }
  }
};

}  // namespace liestat::cli
