#include <cli/show/vi_init.hpp>

#include <report/table.hpp>
#include <cli/show/units.hpp>
#include <stats/quantile.hpp>
#include <lie/s2.hpp>
#include <report/page.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
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
std::string contradictionsInWords(const std::vector<ComparedStretch>& fusions, bool noise_is_verified) {
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
      : noise_is_verified
          ? ", and the stretches are not ok. There the errors are larger than in the rest of the recording: see "
            "--inflate"
          : ", and the stretches are not ok. The sensor's noise in motion is larger than its densities: see "
            "--noise-factor, or --inflate");
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

/// The windows' findings; noise that is not verified is a note.
std::string noiseInWords(const NoiseCalibration& found) {
  const double dof = static_cast<double>(found.degrees_of_freedom);
  const bool calibrated = found.evidence == NoiseEvidence::calibrated;
  const auto factorOf = [&](const NoiseFactor& factor) {
    return inWords(factor) + (calibrated && !factor.isTold() ? ", not told" : "");
  };
  const std::string factors =
      found.hasTwoFactors() ? fmt::format("gyroscope's densities times {}, accelerometer's {}",
                                          factorOf(found.gyroscope), factorOf(found.accelerometer))
                            : fmt::format("all densities times {}; gyroscope and accelerometer cannot be told apart",
                                          factorOf(found.common));
  if (!calibrated) {
    return fmt::format(
        "noise confirmed by {} meetings of windows, whose chi2 per degree of freedom is {:.2f}. They tell: {}\n",
        found.meetings, found.chi2 / dof, factors);
  }
  return fmt::format(
      "noise calibrated by {} meetings of windows: {}. Their chi2 per degree of freedom is {:.2f}, was {:.2f}\n",
      found.meetings, factors, found.calibrated_chi2 / dof, found.chi2 / dof);
}

/// The start of a filter with its standard deviations, in the order of its convention.
std::string filterStartInWords(const FilterStart& start) {
  if (!start.hasState()) return fmt::format("filter start: none ({})\n", start.word());
  const auto list = [](const auto& values, const char* format) {
    std::string text;
    for (Eigen::Index i = 0; i < values.size(); ++i)
      text += (i > 0 ? " " : "") + fmt::format(fmt::runtime(format), values[i]);
    return text;
  };
  const Eigen::Matrix<double, 15, 1> sigmas = start.covarianceAs(start.convention).diagonal().cwiseSqrt();
  return fmt::format(
      "filter start at {:.3f} s{}, {}; the world's z axis is up\n  quaternion xyzw {}\n  position {} m, velocity {} "
      "m/s\n"
      "  biases: gyroscope {} rad/s, accelerometer {} m/s2\n  standard deviations ({}: {})\n   {}\n",
      start.time, start.from_rest ? " from rest" : "", start.word(),
      list(Eigen::Vector4d(start.state.so3().params()), "{:.6f}"),
      list(Eigen::Vector3d(start.state.translation()), "{:.4f}"),
      list(Eigen::Vector3d(start.state.velocity()), "{:.4f}"), list(start.bias.gyroscope, "{:.5f}"),
      list(start.bias.accelerometer, "{:.4f}"), name(start.convention), orderOf(start.convention),
      list(sigmas, "{:.2g}"));
}

}  // namespace

std::string viInitTable(const ViRecording& recording, const ViInitResult& result) {
  const bool with_truth = !recording.truth.empty();
  std::string text;
  for (const std::string& line : recording.found) text += line + "\n";
  if (!recording.found.empty()) text += "\n";
  text += windowTable(result, with_truth);
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
    text += contradictionsInWords(result.stretches, result.noiseIsVerified());
  }
  if (result.noise_calibration && result.noiseIsVerified()) text += "\n" + noiseInWords(*result.noise_calibration);
  if (result.show_filter_start) text += "\n" + filterStartInWords(result.filter_start);
  for (const std::string& note : result.notes()) text += "note: " + note + "\n";
  for (const std::string& note : recording.imu.notes) text += "note: " + note + "\n";
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

namespace {

constexpr double gap = std::numeric_limits<double>::quiet_NaN();
// The palette's colours by what they stand for.
constexpr std::size_t estimate_colour = 0, second_colour = 1, fused_colour = 2, truth_colour = 6;

Series bars(std::string name, std::size_t colour) { return seriesOf(std::move(name), Style::errorbars, colour); }
Series dots(std::string name, std::size_t colour) { return seriesOf(std::move(name), Style::points, colour); }
Series line(std::string name, std::size_t colour, bool dashed = false) {
  return seriesOf(std::move(name), Style::lines, colour, dashed);
}

/// The rotation that makes gravity point along -z, heading left as it is.
SO3d levelling(const Eigen::Vector3d& gravity) {
  return ManifoldTraits<S2d>::placement(S2d(Eigen::Vector3d(-gravity))).inverse();
}

/// Windows as curves: at the truth's pose of their first image where that is known, else levelled, from the origin.
Panel trajectoryPanel(const ViRecording& recording, const ViInitResult& result, int horizontal, int vertical) {
  const char* labels[] = {"x, m", "y, m", "z (upwards), m"};
  Panel panel{vertical == 2 ? "from the side" : "from above", {labels[horizontal]}, {labels[vertical]}};
  panel.equal_aspect = true;
  Series truth = line("truth", truth_colour, true), found = line("windows", estimate_colour);
  Series starts = dots("their first images", second_colour);
  if (!result.windows.empty()) {
    for (const GroundTruth& g : recording.truth) {
      if (g.time < result.windows.front().begin || g.time > result.windows.back().end) continue;
      truth.add(g.state.translation()[horizontal], g.state.translation()[vertical]);
    }
  }
  for (const ComparedWindow& w : result.windows) {
    if (!w.ok()) continue;
    SO3d world_R_body;
    Eigen::Vector3d start = Eigen::Vector3d::Zero();
    if (const auto at = truthAt(recording.truth, w.begin)) {
      world_R_body = at->state.so3();
      start = at->state.translation();
    } else if (recording.truth.empty()) {
      world_R_body = levelling(w.best().gravity);
    } else {
      continue;
    }
    for (const SE23d& x : w.states()) {
      const Eigen::Vector3d p = start + world_R_body * Eigen::Vector3d(x.translation());
      found.add(p[horizontal], p[vertical]);
    }
    found.add(gap, gap);
    starts.add(start[horizontal], start[vertical]);
  }
  panel.add({truth, found});
  if (!recording.truth.empty()) panel.add({starts});
  return panel;
}

/// The truth, ten times a second over the windows.
template <class Value>
Series truthLine(const ViRecording& recording, const ViInitResult& result, const Value& value) {
  Series series = line("truth", truth_colour);
  if (recording.truth.empty() || result.windows.empty()) return series;
  const double end = result.windows.back().end;
  double previous = 0;
  for (double t = result.windows.front().begin; t <= end;
       t += std::max(0.1, (end - result.windows.front().begin) / 2000)) {
    const auto at = truthAt(recording.truth, t);
    if (!at) continue;
    const double y = value(*at);
    // An angle that goes round is no stroke across the picture.
    const bool round = !series.x.empty() && std::abs(y - previous) > 180;
    series.add(t, round ? gap : y);
    previous = y;
  }
  return series;
}

/// Roll or pitch at the first image of each window.
Panel anglePanel(const ViRecording& recording, const ViInitResult& result, bool roll) {
  const auto angle = [roll](const Eigen::Vector3d& gravity) {
    ClosedFormSolution motion;
    motion.gravity = gravity;
    return degrees * (roll ? motion.roll() : motion.pitch());
  };
  Panel panel{.title = roll ? "roll" : "pitch", .x = {.label = "s"}, .y = {.label = "deg"}};
  Series found = dots("windows", estimate_colour);
  for (const ComparedWindow& w : result.windows) {
    if (w.closedForm().solutions.empty()) continue;
    found.add(w.begin, angle(w.best().gravity));
  }
  const Series truth = truthLine(recording, result, [&](const GroundTruth& g) {
    return angle(SO3d(g.state.so3()).inverse() * Eigen::Vector3d(0, 0, -1));
  });
  panel.add({truth, found});
  return panel;
}

/// The length of V at the first image of each window: the scale.
Panel speedPanel(const ViRecording& recording, const ViInitResult& result) {
  Panel panel{.title = "speed", .x = {.label = "s"}, .y = {.label = "m/s", .low = 0}};
  Series found = bars("windows, two standard deviations", estimate_colour);
  const Series truth = truthLine(recording, result, [](const GroundTruth& g) { return g.state.velocity().norm(); });
  for (const ComparedWindow& w : result.windows) {
    if (!w.isRefined()) continue;
    const Eigen::Vector3d V = w.refined->velocity(), u = V.normalized();
    found.addBar(w.begin, V.norm(),
                 2 * std::sqrt(u.dot(w.refined->covariance.of<InitialCovariance::first_velocity>() * u)));
  }
  panel.add({truth, found});
  return panel;
}

Panel scalePanel(const ViInitResult& result) {
  Panel panel{"scale of the trajectory against the truth", {"s"}, {"%"}};
  panel.references = {{.at = 0}};
  Series closed = dots("closed form", second_colour), refined = dots("refined", estimate_colour);
  for (const ComparedWindow& w : result.windows) {
    if (w.closed_form_error && w.closedForm().status == FusionStatus::ok) {
      closed.add(w.begin, 100 * w.closed_form_error->scale);
    }
    if (w.refined_error) refined.add(w.begin, 100 * w.refined_error->scale);
  }
  panel.series = {closed, refined};
  return panel;
}

Panel gravityErrorPanel(const ViInitResult& result) {
  Panel panel{.title = "gravity against the truth", .x = {.label = "s"}, .y = {.label = "deg", .low = 0}};
  Series refined = dots("windows", estimate_colour), fused = dots("fused", fused_colour);
  for (const ComparedWindow& w : result.windows) {
    if (w.error()) refined.add(w.begin, degrees * w.error()->gravity);
  }
  for (const ComparedStretch& f : result.stretches) {
    if (f.gravity_error) fused.add(f.end, degrees * *f.gravity_error);
  }
  panel.series = {refined, fused};
  return panel;
}

Panel biasPanel(const ViRecording& recording, const ViInitResult& result, bool gyroscope, int axis) {
  const char* axes[] = {"x", "y", "z"};
  Panel panel{.title = fmt::format("{}'s bias, {}", gyroscope ? "gyroscope" : "accelerometer", axes[axis]),
              .x = {.label = "s"},
              .y = {.label = gyroscope ? "rad/s" : "m/s²"}};
  Series found = bars("windows", estimate_colour), fused = bars("fused", fused_colour);
  const auto of = [&](const ImuBias<double>& b) { return (gyroscope ? b.gyroscope : b.accelerometer)[axis]; };
  const Series truth = truthLine(recording, result, [&](const GroundTruth& g) { return of(g.bias); });
  for (const ComparedWindow& w : result.windows) {
    if (!w.isRefined()) continue;
    const int i = (gyroscope ? InitialCovariance::gyroscope_bias : InitialCovariance::accelerometer_bias) + axis;
    found.addBar(w.begin, of(w.refined->bias), 2 * std::sqrt(w.refined->covariance.joint(i, i)));
  }
  for (const ComparedStretch& f : result.stretches) {
    if (!f.has_state) continue;
    fused.addBar(f.end, (gyroscope ? f.gyroscope_bias : f.accelerometer_bias)[axis],
                 2 * (gyroscope ? f.gyroscope_sigma : f.accelerometer_sigma));
  }
  panel.add({truth, found, fused});
  return panel;
}

/// Both solutions of a window as the body at the first image sees them, trajectory and features.
Panel solutionsPanel(const ComparedWindow& w) {
  const ClosedFormResult& closed = w.closedForm();
  const double more = closed.solutions[1].cost - closed.solutions[0].cost;
  Panel panel{.title = fmt::format("{:.1f} s: {}, chi2 {:.3g} more", w.begin, name(closed.status), more),
              .x = {.label = "body's x, m"},
              .y = {.label = "body's y, m"},
              .equal_aspect = true};
  const std::vector<BiasedImage> images = biasedImages(w.measured.motions(), w.measured.bias());
  double reach = 0.1;
  for (std::size_t k = 0; k < 2; ++k) {
    const ClosedFormSolution& s = closed.solutions[k];
    const std::size_t colour = k == 0 ? estimate_colour : second_colour;
    Series body = line(fmt::format("solution {}", k + 1), colour);
    Series features{.style = Style::points, .colour = colour};
    const auto add = [&reach](Series& series, const Eigen::Vector3d& p) {
      series.add(p.x(), p.y());
      reach = std::max({reach, std::abs(p.x()), std::abs(p.y())});
    };
    for (const BiasedImage& b : images) {
      const double t = b.image.time;
      add(body, t * s.velocity + (0.5 * t * t) * s.gravity + b.image.displacement +
                    b.image.displacement_by_bias * s.accelerometer_bias);
    }
    for (const Eigen::Vector3d& P : s.features) {
      if (P.allFinite()) add(features, P);
    }
    panel.series.push_back(features);
    panel.series.push_back(body);
  }
  panel.x.low = panel.y.low = -1.05 * reach;
  panel.x.high = panel.y.high = 1.05 * reach;
  return panel;
}

/// The windows of which two solutions are left come first; of the others those whose second is the nearest.
void addSolutions(Report& report, const ViInitResult& result) {
  constexpr std::size_t most = 4;
  std::vector<const ComparedWindow*> windows;
  std::size_t left = 0;
  for (const ComparedWindow& w : result.windows) {
    if (w.closedForm().solutions.size() < 2) continue;
    windows.push_back(&w);
    left += w.closedForm().status != FusionStatus::ok;
  }
  report.section("Two solutions");
  if (windows.empty()) {
    report.paragraph("No window has a second solution.");
    return;
  }
  const auto rank = [](const ComparedWindow* w) {
    const auto& s = w->closedForm().solutions;
    return std::pair(w->closedForm().status == FusionStatus::ok, s[1].cost - s[0].cost);
  };
  std::stable_sort(windows.begin(), windows.end(),
                   [&](const ComparedWindow* a, const ComparedWindow* b) { return rank(a) < rank(b); });
  const std::size_t all = windows.size();
  windows.resize(std::min(all, most));
  std::vector<Panel> panels;
  for (const ComparedWindow* w : windows) panels.push_back(solutionsPanel(*w));
  report.plot(
      {.name = "two_solutions",
       .caption = fmt::format("Lines: the body; points: features. {} of {} windows have a second minimum, in {} "
                              "of them the data leave both; else its chi2 is too large.",
                              all, result.windows.size(), left),
       .panels = panels,
       .columns = 2});
}

}  // namespace

void writeViInitReport(const std::string& directory, const std::string& command_line, const ViRecording& recording,
                       const ViInitResult& result) {
  const bool with_truth = !recording.truth.empty();
  Report report(directory, "Visual-inertial initialisation");
  report.verdict(result.verdict());
  report.code(command_line);
  report.code(viInitTable(recording, result));
  report.section("Trajectory");
  report.plot({.name = "trajectory",
               .caption = with_truth
                              ? "Each window from the truth's pose at its first image on: what departs from the "
                                "truth is the window's own."
                              : "Each window from its first image on, levelled by its gravity; headings are free.",
               .panels = {trajectoryPanel(recording, result, 0, 1), trajectoryPanel(recording, result, 0, 2)}});
  report.section("Gravity and scale");
  std::vector<Panel> panels = {anglePanel(recording, result, true), anglePanel(recording, result, false),
                               speedPanel(recording, result)};
  if (with_truth) {
    panels.push_back(gravityErrorPanel(result));
    panels.push_back(scalePanel(result));
  }
  report.plot({.name = "gravity_and_scale",
               .caption = "At the first image of each window; fused values at the end of their stretch.",
               .panels = panels});
  report.section("Biases");
  panels.clear();
  for (const bool gyroscope : {true, false}) {
    for (int axis = 0; axis < 3; ++axis) panels.push_back(biasPanel(recording, result, gyroscope, axis));
  }
  report.plot(
      {.name = "biases", .caption = "With two standard deviations on either side.", .panels = panels, .columns = 3});
  addSolutions(report, result);
  report.write();
}

}  // namespace liestat::cli
