#include <cli/show/preintegration.hpp>

#include <report/table.hpp>
#include <cli/show/units.hpp>
#include <stats/quantile.hpp>
#include <report/outline.hpp>
#include <report/page.hpp>
#include <stats/laws.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

namespace liestat::cli {
namespace {

/// Where the readings of windows without a result fail.
std::string faultLines(const std::vector<RecordingWindow>& windows) {
  std::string text;
  for (const RecordingWindow& w : windows) {
    if (w.ok() || !w.fault_time) continue;
    text += fmt::format("window from {:.3f} s: {} ", w.begin, w.status());
    text += w.result.fault == FaultKind::gap && w.time_before_fault
                ? fmt::format("in the readings from {:.6f} to {:.6f} s\n", *w.time_before_fault, *w.fault_time)
                : fmt::format("at the reading of {:.6f} s\n", *w.fault_time);
  }
  return text.empty() ? text : "\n" + text;
}

std::string errorSummary(const RecordingWindows& result) {
  std::vector<double> rotation, velocity, position;
  for (const RecordingWindow& w : result.windows) {
    if (!w.error) continue;
    rotation.push_back(w.error->segment<3>(3).norm());
    velocity.push_back(w.error->tail<3>().norm());
    position.push_back(w.error->head<3>().norm());
  }
  if (rotation.empty()) return {};
  std::string text =
      fmt::format("\nagainst the truth, {} windows: medians {:.3g} rad, {:.3g} m/s, {:.3g} m\n", rotation.size(),
                  quantile(rotation, 0.5), quantile(velocity, 0.5), quantile(position, 0.5));
  if (const auto test = result.test()) {
    text += fmt::format("squared distance under the covariance: {:.4g} in the mean, 9 expected\n", 9 * test->ratio());
  }
  return text;
}

TableRows preintegrationTable(const RecordingWindows& result) {
  TableRows table{{"begin s", "duration", "turn deg", "velocity m/s", "position m"}};
  std::vector<std::string>& headers = table.headers;
  if (result.with_noise) headers.insert(headers.end(), {"sd turn deg", "sd velocity", "sd position"});
  if (result.with_truth) headers.insert(headers.end(), {"error deg", "error m/s", "error m"});
  for (const RecordingWindow& w : result.windows) {
    const SE23d& x = w.result.motion.increment();
    if (!w.ok()) {
      table.rows.push_back({number(w.begin, 9), w.status()});
      continue;
    }
    std::vector<std::string> cells = {number(w.begin, 9), number(w.result.motion.duration()),
                                      number(degrees * x.so3().log().norm()), number(x.velocity().norm()),
                                      number(x.translation().norm())};
    if (result.with_noise) {
      const IncrementSigmas sd = incrementSigmas(w.result.motion);
      for (const double value : {degrees * sd.rotation, sd.velocity, sd.position}) cells.push_back(number(value, 3));
    }
    if (result.with_truth && w.error) {
      for (const double e :
           {degrees * w.error->segment<3>(3).norm(), w.error->tail<3>().norm(), w.error->head<3>().norm()})
        cells.push_back(number(e, 3));
    }
    table.rows.push_back(cells);
  }
  return table;
}

/// The lines below the table: where readings fail, and the errors against the truth.
std::string preintegrationRemarks(const RecordingWindows& result) {
  return faultLines(result.windows) + errorSummary(result);
}

}  // namespace

std::string formatPreintegration(const RecordingWindows& result) {
  std::string text = Table(preintegrationTable(result)).str() + preintegrationRemarks(result);
  for (const std::string& note : result.notes()) text += "note: " + note + "\n";
  if (!result.with_truth) return text;
  const Verdict verdict = result.verdict();
  for (const std::string& cause : verdict.causes) text += cause + "\n";
  return text + verdict.text + "\n";
}

namespace {

/// Rows of the table of windows; the plots' CSV has all.
constexpr std::size_t most_rows = 200;

/// A part of an increment: its name, its unit, and how many of it make the unit that is computed in.
struct IncrementPart {
  const char *name, *unit;
  double scale;
  double IncrementSigmas::*sigma;
  int begin;  ///< first index of its block in the nine coordinates
};
constexpr std::array increment_parts{IncrementPart{"rotation", "deg", degrees, &IncrementSigmas::rotation, 3},
                                     IncrementPart{"velocity", "m/s", 1, &IncrementSigmas::velocity, 6},
                                     IncrementPart{"position", "m", 1, &IncrementSigmas::position, 0}};

void showWindows(Report& report, const RecordingWindows& result) {
  report.section("Windows");
  TableRows table = preintegrationTable(result);
  // A page has the room for the units that the terminal leaves out.
  for (std::string& header : table.headers) {
    header += header == "duration" ? " s" : header == "sd velocity" ? " m/s" : header == "sd position" ? " m" : "";
  }
  const std::size_t all = table.rows.size();
  if (all > most_rows) table.rows.resize(most_rows);
  std::string caption = "Lengths of the increments";
  if (result.with_noise) caption += ", the largest of their standard deviations along the axes";
  if (result.with_truth) caption += ", lengths of their errors";
  if (all > most_rows) caption += fmt::format("; the first {} of {} windows", most_rows, all);
  report.table(table, caption + ".");
  const std::string remarks = preintegrationRemarks(result);
  if (!remarks.empty()) report.code(remarks.substr(remarks.find_first_not_of('\n')));
}

void showIncrements(Report& report, const RecordingWindows& result) {
  if (result.okWindows() < 2) return;
  report.section("Increments");
  // Bars of more windows would cover each other.
  const bool bars = result.with_noise && result.windows.size() <= 1000;
  Plot plot{.name = "increments",
            .caption = bars ? "Length of each window's increment, with the largest of its standard deviations."
                            : "Length of each window's increment.",
            .columns = 3};
  for (const IncrementPart& part : increment_parts) {
    Series points{.style = bars ? Style::errorbars : Style::points};
    for (const RecordingWindow& w : result.windows) {
      if (!w.ok()) continue;
      const SE23d& x = w.result.motion.increment();
      const double length = part.scale * (part.begin == 3   ? x.so3().log().norm()
                                          : part.begin == 6 ? x.velocity().norm()
                                                            : x.translation().norm());
      if (bars) {
        points.addBar(w.begin, length, part.scale * incrementSigmas(w.result.motion).*part.sigma);
      } else {
        points.add(w.begin, length);
      }
    }
    plot.panels.push_back({.x = {.label = "beginning of the window, s"},
                           .y = {.label = fmt::format("{}, {}", part.name, part.unit)},
                           .series = {points}});
  }
  report.plot(plot);
}

void showGrowth(Report& report, const PreintegratedReadings& readings) {
  report.section("Growth of the standard deviations");
  const ImuNoise<double>& noise = readings.noise;
  report.paragraph(fmt::format(
      "Predicted from the densities of noise: gyroscope {:g} rad/s/√Hz, accelerometer {:g} m/s²/√Hz, walks of their "
      "biases {:g} rad/s²/√Hz and {:g} m/s³/√Hz.",
      noise.gyroscope, noise.accelerometer, noise.gyroscope_walk, noise.accelerometer_walk));
  Plot plot{
      .name = "growth",
      .caption = fmt::format("The largest standard deviation along the axes of an increment that begins at {} s, by "
                             "its duration.",
                             number(readings.growth_begin, 6)),
      .columns = 3};
  for (const IncrementPart& part : increment_parts) {
    Series line;
    for (const IncrementSigmas& d : readings.growth) {
      line.add(d.duration, part.scale * d.*part.sigma);
    }
    plot.panels.push_back({.x = {.label = "duration, s", .low = 0.0},
                           .y = {.label = fmt::format("sd of {}, {}", part.name, part.unit), .low = 0.0},
                           .series = {line}});
  }
  report.plot(plot);
}

void showErrors(Report& report, const RecordingWindows& result) {
  if (std::none_of(result.windows.begin(), result.windows.end(), [](const auto& w) { return w.error.has_value(); })) {
    return;
  }
  report.section("Errors against the truth");
  Plot plot{.name = "errors",
            .caption = result.with_noise
                           ? "Errors of each window along the axes of the body at its end, with the band of "
                             "three standard deviations."
                           : "Errors of each window along the axes of the body at its end.",
            .columns = 3};
  for (const IncrementPart& part : increment_parts) {
    for (int k = 0; k < 3; ++k) {
      Series band{.name = "3 sd", .style = Style::filled_curve}, error{.name = "error", .style = Style::points};
      for (const RecordingWindow& w : result.windows) {
        if (!w.error) continue;
        error.add(w.begin, part.scale * (*w.error)[part.begin + k]);
        if (!result.with_noise) continue;
        const double variance = w.result.motion.gaussian().covariance(part.begin + k, part.begin + k);
        const double reach = 3 * part.scale * std::sqrt(variance);
        band.addBand(w.begin, -reach, reach);
      }
      Panel panel{{}, {"beginning of the window, s"}, {fmt::format("{} {}, {}", part.name, "xyz"[k], part.unit)}};
      // A band needs two windows.
      if (band.x.size() > 1) panel.series.push_back(outlineOf(band));
      panel.series.push_back(error);
      plot.panels.push_back(panel);
    }
  }
  report.plot(plot);
  if (!result.with_noise) return;
  const double low = chiSquaredQuantile(0.025, 9), high = chiSquaredThreshold(0.025, 9);
  Series points{.style = Style::points};
  for (const RecordingWindow& w : result.windows) {
    if (w.squared_distance) points.add(w.begin, *w.squared_distance);
  }
  Panel panel{{}, {"beginning of the window, s"}, {.label = "squared distance to the truth", .logarithmic = true}};
  panel.series = {points};
  for (const double at : {low, high}) panel.references.push_back({ReferenceLine::Direction::horizontal, at});
  report.plot(
      {.name = "distances",
       .caption = fmt::format("Squared Mahalanobis distance of each window to the truth; 95 % of them lie between "
                              "the dotted lines, {} and {}, if the noise of the calibration is true.",
                              number(low, 3), number(high, 3)),
       .panels = {panel}});
}

void showReadings(Report& report, const PreintegratedReadings& readings) {
  report.section("Readings");
  std::vector<double> intervals;  // ms
  Series rate{.name = "gyroscope"}, force{.name = "accelerometer"}, interval{.style = Style::points};
  double largest = 0, largest_at = 0;
  std::size_t gaps = 0, n = 0;
  const ImuSample<double>* before = nullptr;
  for (const ImuSample<double>& s : readings.imu.samples) {
    if (s.time < readings.begin || s.time > readings.end) continue;
    ++n;
    rate.add(s.time, s.angular_rate.norm());
    force.add(s.time, s.specific_force.norm());
    if (before != nullptr) {
      const double step = s.time - before->time;
      intervals.push_back(1000 * step);
      interval.add(s.time, 1000 * step);
      gaps += step > readings.largest_gap;
      if (step > largest) largest = step, largest_at = before->time;
    }
    before = &s;
  }
  const double median = liestat::quantile(intervals, 0.5);
  report.table(
      {"readings", "duration, s", "median interval, ms", "median rate, Hz", "largest interval, ms", "at, s", "gaps"},
      {{fmt::format("{}", n), number(readings.end - readings.begin, 6), number(median), number(1000 / median),
        number(1000 * largest), number(largest_at, 6), fmt::format("{}", gaps)}},
      fmt::format("Readings of {}; a gap is an interval above {:g} ms (--max-gap) and discards the windows that it "
                  "touches.",
                  readings.source, 1000 * readings.largest_gap));
  // Both the intervals and the bound are seen.
  double low = 1000 * readings.largest_gap, high = low;
  for (const double step : intervals) low = std::min(low, step), high = std::max(high, step);
  const Axis time{.label = "time, s", .low = readings.begin, .high = readings.end};
  Panel panels[] = {
      {.title = "Angular rate", .x = time, .y = {.label = "length, rad/s", .low = 0.0}, .series = {outlineOf(rate)}},
      {.title = "Specific force", .x = time, .y = {.label = "length, m/s²", .low = 0.0}, .series = {outlineOf(force)}},
      {.title = "Intervals",
       .x = time,
       .y = {.label = "since the reading before, ms", .low = 0.8 * low, .high = 1.25 * high, .logarithmic = true},
       .series = {outlineOf(interval)},
       .references = {{ReferenceLine::Direction::horizontal, 1000 * readings.largest_gap}}}};
  report.plot(
      {.name = "readings",
       .caption =
           "Readings as the sensor gives them, biases and gravity included; of long recordings the smallest and the "
           "largest of each thousandth is drawn. The dotted line is the largest interval that is accepted.",
       .panels = {std::begin(panels), std::end(panels)},
       .columns = 3});
}

}  // namespace

void writePreintegrationReport(const std::string& directory, const std::string& command_line,
                               const RecordingWindows& result, const PreintegratedReadings& readings) {
  Report report(directory, "Preintegrated motions of " + readings.source);
  report.verdict(result.outcome());
  report.code(command_line);
  showIncrements(report, result);
  if (readings.growth.size() > 1) showGrowth(report, readings);
  showErrors(report, result);
  showReadings(report, readings);
  showWindows(report, result);
  report.write();
}

}  // namespace liestat::cli
