#include <report/table.hpp>
#include <cli/show/units.hpp>
#include <cli/show/vi_init.hpp>

#include <stats/quantile.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

namespace liestat::cli {
namespace {

std::string windowTable(const ViInitResult& result, bool with_truth) {
  // With the errors it still fits into 80 columns.
  std::vector<std::string> headers = {"s", "status", "m/s", "roll", "pitch", "sd %", "chi2", "tracks"};
  if (with_truth) headers.insert(headers.end(), {"off m/s", "deg", "%"});
  Table table(headers);
  for (const ComparedWindow& w : result.windows) {
    std::vector<std::string> cells = {fmt::format("{:.1f}", w.begin), std::string(name(w.verdict()))};
    if (!w.fault && w.hasSolution()) {
      const ClosedFormSolution best = w.best();
      const bool has_scale = w.hasScale();
      cells.push_back(has_scale ? fmt::format("{:.2f}", best.velocity.norm()) : "");
      cells.push_back(fmt::format("{:.1f}", degrees * best.roll()));
      cells.push_back(fmt::format("{:.1f}", degrees * best.pitch()));
      cells.push_back(has_scale ? fmt::format("{:.1f}", 100 * w.scaleSigma()) : "");
      cells.push_back(has_scale ? fmt::format("{:.2f}", w.costPerDegree()) : "");
      cells.push_back(fmt::format("{}/{}", w.found.inliers.size(), w.tracks.size()));
      if (const auto& error = w.error(); error && has_scale) {
        cells.push_back(fmt::format("{:.3f}", error->speed));
        cells.push_back(fmt::format("{:.2f}", degrees * error->gravity));
        cells.push_back(fmt::format("{:.1f}", 100 * error->scale));
      }
    }
    table.row(cells);
  }
  return table.str();
}

std::string fusionTable(const ViInitResult& result, bool with_truth) {
  std::vector<std::string> headers = {"to s", "n", "chi2/dof", "p", "sd deg", "rad/s", "m/s2"};
  if (with_truth) headers.insert(headers.end(), {"off m/s", "deg", "rad/s", "m/s2"});
  Table table(headers);
  for (const ComparedStretch& f : result.stretches) {
    if (!f.has_state) continue;
    const std::size_t dof = f.degrees_of_freedom;
    std::vector<std::string> cells = {fmt::format("{:.1f}", f.end),
                                      fmt::format("{}", f.windows.size()),
                                      dof == 0 ? "" : fmt::format("{:.2f}", f.chi2 / static_cast<double>(dof)),
                                      dof == 0 ? "" : fmt::format("{:.1g}", f.p),
                                      fmt::format("{:.2f}", degrees * f.down_sigma),
                                      fmt::format("{:.4f}", f.gyroscope_sigma),
                                      fmt::format("{:.3f}", f.accelerometer_sigma)};
    if (f.speed_error) {
      cells.push_back(fmt::format("{:.3f}", *f.speed_error));
      cells.push_back(fmt::format("{:.2f}", degrees * *f.gravity_error));
      cells.push_back(fmt::format("{:.4f}", *f.gyroscope_error));
      cells.push_back(fmt::format("{:.3f}", *f.accelerometer_error));
    }
    table.row(cells);
  }
  return table.str();
}

/// Stretches whose windows contradict each other.
std::string contradictionsInWords(const std::vector<ComparedStretch>& fusions) {
  std::size_t with_state = 0, contradict = 0, inflated = 0;
  double largest_p = 0, least = std::numeric_limits<double>::infinity(), largest = 0;
  for (const ComparedStretch& f : fusions) {
    with_state += f.has_state;
    if (!f.has_state || f.p >= min_p_of_fusion) continue;
    ++contradict;
    inflated += f.inflated;
    largest_p = std::max(largest_p, f.p);
    least = std::min(least, f.inflation), largest = std::max(largest, f.inflation);
  }
  if (contradict == 0) return {};
  return fmt::format(
      "in {} of {} stretches windows contradict each other (p {:.1g} at most): their covariances are too small by "
      "factors of {:.3g} to {:.3g}{}\n",
      contradict, with_state, largest_p, least, largest,
      inflated > 0 ? ", which the fused states' were multiplied by"
                   : ", and the stretches are not ok. The sensor's noise in motion is larger than its densities: see "
                     "--calibrate-noise and --noise-factor, or --inflate");
}

/// Medians and 95 %.
std::string inWords(const InitialisationErrors& e) {
  return fmt::format("{:.3g} / {:.3g} m/s, {:.3g} / {:.3g} deg, scale {:.3g} / {:.3g} %", quantile(e.speed, 0.5),
                     quantile(e.speed, 0.95), quantile(e.gravity, 0.5), quantile(e.gravity, 0.95),
                     quantile(e.scale, 0.5), quantile(e.scale, 0.95));
}

/// "4.1 (95 %: 3.2 to 5.3)", "1 (95 %: up to 2.1)".
std::string inWords(const NoiseFactor& factor) {
  const std::string range = factor.low > 0 && std::isfinite(factor.high)
                                ? fmt::format("{:.3g} to {:.3g}", factor.low, factor.high)
                            : factor.low > 0 ? fmt::format("from {:.3g}", factor.low)
                                             : fmt::format("up to {:.3g}", factor.high);
  return fmt::format("{:.3g} (95 %: {})", factor.factor, range);
}

std::string noiseInWords(const NoiseCalibration& found) {
  if (found.status != FusionStatus::ok) {
    return fmt::format("the sensor's noise was not calibrated, and its densities are as given: {}\n",
                       found.status == FusionStatus::undetermined
                           ? fmt::format("{} meetings of windows do not tell it", found.meetings)
                           : describe(found.status));
  }
  const double dof = static_cast<double>(found.degrees_of_freedom);
  const auto ends = [](const NoiseFactor& factor) { return factor.isTold() ? "" : ", not told"; };
  std::string text = fmt::format("noise calibrated by {} meetings of windows: ", found.meetings);
  if (found.separable || found.common_p < 0.05) {
    text += fmt::format("gyroscope's densities times {}{}, accelerometer's {}{}", inWords(found.gyroscope),
                        ends(found.gyroscope), inWords(found.accelerometer), ends(found.accelerometer));
  } else {
    text += fmt::format("all densities times {}{}; gyroscope and accelerometer cannot be told apart",
                        inWords(found.common), ends(found.common));
  }
  return text + fmt::format(". Their chi2 per degree of freedom is {:.2f}, was {:.2f}\n", found.calibrated_chi2 / dof,
                            found.chi2 / dof);
}

}  // namespace

std::string viInitTable(const ViRecording& recording, const ViInitResult& result) {
  const bool with_truth = !recording.truth.empty();
  std::string text = windowTable(result, with_truth);
  const InitialisationSummary summary = result.summary();
  if (result.windows_left > 0) {
    text += fmt::format("\ninterrupted: {} of {} windows\n", result.windows.size(),
                        result.windows.size() + result.windows_left);
  }
  text += fmt::format("\n{} windows:", result.windows.size());
  for (const auto& [status, count] : summary.statuses) text += fmt::format(" {} {}", count, status);
  text += "\n";
  if (with_truth) {
    const bool with_biases = result.biases_given;
    if (summary.closed_form.size() > 0) {
      text += fmt::format("errors of the {} windows with a scale, of which {} are not ok:\n", summary.compared,
                          summary.compared_not_ok);
      text += "closed form, median / 95 %: " + inWords(summary.closed_form) + "\n";
    }
    if (summary.refined.size() > 0) text += "refined, median / 95 %:     " + inWords(summary.refined) + "\n";
    if (!with_biases && !summary.gyroscope.empty()) {
      text += fmt::format("gyroscope's bias, median / 95 %: {:.2g} / {:.2g} rad/s\n",
                          liestat::quantile(summary.gyroscope, 0.5), liestat::quantile(summary.gyroscope, 0.95));
    }
    if (summary.with_nees > 0) {
      text += fmt::format("NEES of velocity and gravity: {:.3g} in the mean, 5 expected\n",
                          summary.nees / static_cast<double>(summary.with_nees));
    }
    const Verdict errors = result.againstTruth();
    if (!errors.isNone()) text += errors.text + "\n";
    for (const std::string& cause : errors.causes) text += "  " + cause + "\n";
  }
  if (summary.degrees_of_freedom > 0) {
    text += fmt::format("chi2 per degree of freedom of the refinements: {:.3f}\n",
                        summary.cost / static_cast<double>(summary.degrees_of_freedom));
  }
  if (!result.stretches.empty()) {
    text +=
        "\nDisjoint windows together, at the last image of each stretch; chi2 and its p say\nwhether they agree; then "
        "standard deviations of gravity and of the biases";
    text += with_truth ? ",\nand what is off:\n" : ":\n";
    text += fusionTable(result, with_truth);
    text += contradictionsInWords(result.stretches);
  }
  if (result.noise) text += "\n" + noiseInWords(*result.noise);
  std::vector<std::string> notes;
  if (recording.tracks.seen_once > 0) {
    notes.push_back(fmt::format("{} tracks were seen once", recording.tracks.seen_once));
  }
  if (result.images_outside > 0) {
    notes.push_back(fmt::format("{} images are outside of the readings", result.images_outside));
  }
  if (result.observations_outside > 0) {
    notes.push_back(fmt::format("{} pixels have no direction by the lens' model", result.observations_outside));
  }
  for (const std::string& note : notes) text += "note: " + note + ", and not used\n";
  for (const ComparedWindow& w : result.windows) {
    if (!w.fault) continue;
    text += fmt::format("note: the window from {:.3f} s has no result ({}): the readings fail at {:.6f} s\n", w.begin,
                        name(w.verdict()), w.fault_time);
  }
  if (recording.pose_assumed) {
    text +=
        "note: no calibration has the camera's pose on the inertial sensor, and --intrinsics has none: both are taken "
        "to have the same axes and origin\n";
  }
  return text;
}

}  // namespace liestat::cli
