#include <cli/show/evaluation.hpp>

#include <formats/input_error.hpp>
#include <formats/output_file.hpp>
#include <formats/text.hpp>
#include <report/describe.hpp>
#include <report/outline.hpp>
#include <report/page.hpp>
#include <cli/show/pose_errors.hpp>
#include <report/table.hpp>
#include <cli/show/units.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace liestat::cli {
namespace {

std::string alignmentName(const Alignment& a) {
  if (a.model == AlignmentModel::none) return "none";
  const std::string how = a.weighted ? "weighted" : a.model == AlignmentModel::origin ? "first pose" : "least squares";
  return fmt::format("{} ({})", name(a.model), how);
}

double rootMeanSquare(const std::vector<double>& errors) {
  double sum = 0;
  for (const double e : errors) sum += e * e;
  return std::sqrt(sum / static_cast<double>(errors.size()));
}

std::string statisticsLine(const char* what, const ErrorStatistics& s, const std::string& unit) {
  return fmt::format("{}: rmse {} {}, mean {}, median {}, std {}, min {}, max {}, sse {}\n", what, number(s.rmse, 6),
                     unit, number(s.mean, 6), number(s.median, 6), number(s.std, 6), number(s.min, 6), number(s.max, 6),
                     number(s.sse, 6));
}

}  // namespace

std::string formatEvaluation(const EvaluationOutput& output) {
  std::string text;
  for (const EvaluatedEstimate& e : output.estimates) {
    const Verdict v = e.evaluation.verdict();
    text += fmt::format("{}: {}\n", e.name, v.text);
    for (const std::string& c : v.causes) text += "  " + c + "\n";
  }
  text += "\n";
  Table table({"estimate", "poses", "APE rmse", "mean", "max", "RPE rmse", "NEES/dof", "pos", "rot"});
  for (const EvaluatedEstimate& shown : output.estimates) {
    const TrajectoryEvaluation& e = shown.evaluation;
    const Consistency& c = e.consistency;
    const auto ratio = [](const ResidualTest& t) { return t.applies() ? number(t.ratio(), 3) : std::string(); };
    table.row({shown.name, fmt::format("{}", e.matched.size()), number(e.ape_statistics.rmse),
               number(e.ape_statistics.mean), number(e.ape_statistics.max), number(e.rpe_statistics.rmse),
               ratio(c.joint), ratio(c.position), ratio(c.rotation)});
  }
  text += table.str();
  text += fmt::format("APE in {}, RPE in {}; {}\n", output.setting().ape_unit, output.setting().rpe_unit,
                      output.setting().association);
  text += fmt::format("reference {}: {} poses{}\n", output.reference, output.setting().reference_poses,
                      output.reference_has_covariances ? ", with covariances" : ", taken as exact");
  for (const std::string& note : output.reference_notes) text += "  " + note + "\n";
  text += "\n";
  for (const EvaluatedEstimate& shown : output.estimates) {
    const TrajectoryEvaluation& e = shown.evaluation;
    text += fmt::format("{}: {} of {} poses matched\n", shown.name, e.matched.size(), e.poses);
    text += "  " + statisticsLine("APE", e.ape_statistics, e.ape_unit);
    if (!e.rpe.empty()) text += "  " + statisticsLine("RPE", e.rpe_statistics, e.rpe_unit);
    text += fmt::format("  alignment of APE and RPE: {}", alignmentName(e.alignment));
    if (e.alignment.scale != 1) text += fmt::format(", scale {}", number(e.alignment.scale, 7));
    text += "\n";
    if (!e.has_covariances) {
      for (const std::string& note : e.notes) text += "  " + note + "\n";
      continue;
    }
    const Consistency& c = e.consistency;
    text += fmt::format("  covariances: {}\n", e.covariance_convention);
    text += fmt::format("  alignment of the verdict: {}", alignmentName(e.weighted));
    if (e.weighted.parameters > 0 && e.weighted.ok) {
      text += fmt::format(", {} parameters from {} poses, condition {}", e.weighted.parameters, e.weighted.poses,
                          number(e.weighted.condition, 2));
    }
    text += "\n";
    if (e.weighted.ok && e.weighted.parameters > 0) {
      const auto sigma = [&](int k) { return std::sqrt(e.weighted.covariance(k, k)); };
      text += fmt::format("  its sd: translation {} {} {} m, rotation {} {} {} deg", number(sigma(0), 2),
                          number(sigma(1), 2), number(sigma(2), 2), number(degrees * sigma(3), 2),
                          number(degrees * sigma(4), 2), number(degrees * sigma(5), 2));
      if (e.weighted.model == AlignmentModel::sim3) {
        text += fmt::format("; scale {} +- {} (unbiased)", number(e.weighted.scale, 7),
                            number(e.weighted.scale * sigma(6), 2));
      }
      text += "\n";
    }
    const auto bounds = [](const ResidualTest& t) {
      return fmt::format("{} in [{}, {}], p {}", number(t.ratio(), 4), number(neesInterval(t.dof).low / t.dof, 4),
                         number(neesInterval(t.dof).high / t.dof, 4), number(t.p, 2));
    };
    if (c.ok) {
      text += fmt::format("  NEES/dof, joint: {} (95 %)\n", bounds(c.joint));
      if (c.position.applies()) text += fmt::format("  NEES/dof, position: {}\n", bounds(c.position));
      if (c.rotation.applies()) text += fmt::format("  NEES/dof, rotation: {}\n", bounds(c.rotation));
    }
    if (e.relative && e.relative->joint.applies()) {
      text += fmt::format("  RPE NEES/dof ({}): {}; {} pairs\n", name(*e.pairs_model), bounds(e.relative->joint),
                          e.relative->n);
    }
    if (e.relative && e.relative->indefinite > 0) {
      text += fmt::format("  {} pairs have no positive definite covariance under this model\n", e.relative->indefinite);
    }
    for (const std::string& note : e.notes) text += "  " + note + "\n";
  }
  for (const std::string& f : output.failed) text += "failed: " + f + "\n";
  return text;
}

std::string evaluationCsv(const EvaluationOutput& output) {
  std::string text;
  for (const EvaluatedEstimate& e : output.estimates) {
    NamedFigures named_figures;
    describeFigures(named_figures, e.evaluation);
    if (text.empty()) {
      text = "file";
      for (const auto& [figure, value] : named_figures.figures()) text += "," + figure;
      text += '\n';
    }
    std::string file;
    for (const char c : e.name) file += c == '"' ? std::string("\"\"") : std::string(1, c);
    text += '"' + file + '"';
    for (const auto& [figure, value] : named_figures.figures()) text += fmt::format(",{}", value);
    text += '\n';
  }
  return text;
}

// --- Page
// -------------------------------------------------------------------------------------------------------------

namespace {

/// Every k-th place of a list, so many at most: no screen shows more.
std::vector<std::size_t> shownPlaces(std::size_t n, std::size_t most = 2000) {
  std::vector<std::size_t> places;
  const std::size_t step = std::max<std::size_t>(1, (n + most - 1) / most);
  for (std::size_t i = 0; i < n; i += step) places.push_back(i);
  return places;
}

constexpr std::array axis_labels{"x, m", "y, m", "z, m"};
constexpr std::array planes{std::pair(0, 1), std::pair(0, 2)};

Series referencePath(const TrajectoryEvaluation& e, int i, int j) {
  Series reference{.name = "reference", .colour = 6};
  for (const std::size_t k : shownPlaces(e.matched.size())) {
    const Eigen::Vector3d p = e.matched[k].reference.mean.translation();
    reference.add(p[i], p[j]);
  }
  return reference;
}

Plot trajectoryPlot(const EvaluationOutput& output) {
  Plot plot{.name = "trajectories", .caption = "Reference and aligned estimates, from above and from the side, m."};
  for (const auto& [i, j] : planes) {
    Panel panel{{}, {axis_labels[static_cast<std::size_t>(i)]}, {axis_labels[static_cast<std::size_t>(j)]}};
    panel.equal_aspect = true;
    panel.series.push_back(referencePath(output.setting(), i, j));
    for (const EvaluatedEstimate& e : output.estimates) {
      Series estimate{.name = e.name};
      for (const std::size_t k : shownPlaces(e.evaluation.matched.size())) {
        const Eigen::Vector3d t = e.evaluation.alignment(e.evaluation.matched[k].estimate.mean).translation();
        estimate.add(t[i], t[j]);
      }
      panel.series.push_back(estimate);
    }
    plot.panels.push_back(panel);
  }
  return plot;
}

/// Errors of all estimates over the time since the first of them began.
Plot errorsOverTime(const EvaluationOutput& output) {
  double start = std::numeric_limits<double>::infinity();
  for (const EvaluatedEstimate& e : output.estimates) start = std::min(start, e.evaluation.times.front());
  Panel position{.y = {.label = "position error, m", .low = 0.0}},
      rotation{.y = {.label = "rotation error, deg", .low = 0.0}};
  for (const EvaluatedEstimate& shown : output.estimates) {
    const TrajectoryEvaluation& e = shown.evaluation;
    const TimesOfPoses times{e.times, e.by_time, start};
    position.x.label = rotation.x.label = times.label();
    Series p{.name = shown.name}, r{.name = shown.name};
    for (std::size_t i = 0; i < times.values.size(); ++i) {
      p.add(times.values[i], e.position_errors[i]), r.add(times.values[i], degrees * e.rotation_errors[i]);
    }
    position.series.push_back(outlineOf(p)), rotation.series.push_back(outlineOf(r));
  }
  return {.name = "errors_over_time",
          .caption = fmt::format("Length of the position error and angle of the rotation error after the alignment of "
                                 "APE ({}).",
                                 alignmentName(output.setting().alignment)),
          .panels = {position, rotation}};
}

Plot colouredPath(const EvaluatedEstimate& shown, std::size_t number_of) {
  const TrajectoryEvaluation& e = shown.evaluation;
  Plot plot{
      .name = fmt::format("path_{}", number_of),
      .caption = fmt::format("Path of {}, coloured by its position error (m), from above and from the side; grey: "
                             "the reference.",
                             shown.name)};
  for (const auto& [i, j] : planes) {
    Panel panel{{}, {axis_labels[static_cast<std::size_t>(i)]}, {axis_labels[static_cast<std::size_t>(j)]}};
    panel.equal_aspect = true;
    Series reference = referencePath(e, i, j);
    reference.name.clear();
    Series path{.name = shown.name, .style = Style::contours};
    for (const std::size_t k : shownPlaces(e.matched.size())) {
      const Eigen::Vector3d t = e.alignment(e.matched[k].estimate.mean).translation();
      path.add(t[i], t[j]), path.value.push_back(e.position_errors[k]);
    }
    panel.series = {reference, path};
    plot.panels.push_back(panel);
  }
  return plot;
}

/// Box plots by the length of a segment; the estimates side by side.
Plot segmentPlot(const EvaluationOutput& output) {
  Panel translation{.x = {.label = "length of the segment, m"}, .y = {.label = "translation error, m", .low = 0.0}};
  Panel rotation{.x = {.label = "length of the segment, m"}, .y = {.label = "rotation error, deg", .low = 0.0}};
  const auto n = static_cast<double>(output.estimates.size());
  for (std::size_t k = 0; k < output.estimates.size(); ++k) {
    const EvaluatedEstimate& e = output.estimates[k];
    if (e.evaluation.segments.empty()) continue;
    const double step = e.evaluation.segments.front().length, width = 0.7 * step / n;
    for (auto& [panel, quantiles] : {std::pair(&translation, &SegmentErrors::translation_quantiles),
                                     std::pair(&rotation, &SegmentErrors::rotation_quantiles)}) {
      Series box{.style = Style::spans, .colour = k}, bar{.name = e.name, .style = Style::errorbars, .colour = k};
      for (const SegmentErrors& s : e.evaluation.segments) {
        const std::array<double, 5>& q = s.*quantiles;
        const double at = s.length + width * (static_cast<double>(k) - 0.5 * (n - 1));
        box.add(at, q[2]), box.addBand(at, q[1], q[3]), box.width.push_back(width);
        bar.add(at, q[2]), bar.addBand(at, q[0], q[4]);
      }
      panel->series.push_back(box), panel->series.push_back(bar);
    }
  }
  return {.name = "segments",
          .caption =
              "Errors of the relative motion over all segments of a length along the reference: median, box from "
              "25 to 75 %, bar from 5 to 95 %. The segments overlap.",
          .panels = {translation, rotation}};
}

Plot errorPlot(const EvaluatedEstimate& e, std::size_t number_of) {
  return {
      .name = fmt::format("errors_{}", number_of),
      .caption = fmt::format("Errors of {} after the weighted alignment, in the body's axes, with the band of three "
                             "standard deviations that the covariances and the alignment give.",
                             e.name),
      .panels = errorPanels(e.evaluation.consistency.errors, {e.evaluation.times, e.evaluation.by_time}),
      .columns = 3};
}

Plot neesPlot(const EvaluatedEstimate& e, std::size_t number_of) {
  const TimesOfPoses times{e.evaluation.times, e.evaluation.by_time};
  const int dof = e.evaluation.consistency.tests.components.count();
  Panel panel = neesPanel(times, dof);
  panel.series = {neesSeries("NEES", e.evaluation.consistency.errors, times)};
  return {.name = fmt::format("nees_{}", number_of),
          .caption = fmt::format("NEES of each pose of {}; {}", e.name, neesBounds(dof)),
          .panels = {panel}};
}

}  // namespace

void writeEvaluationReport(const std::string& directory, const std::string& command_line,
                           const EvaluationOutput& output) {
  Report report(directory, "Trajectories against a reference");
  const TrajectoryEvaluation& setting = output.setting();
  std::vector<Verdict> verdicts;
  std::string text;
  for (const EvaluatedEstimate& e : output.estimates) {
    verdicts.push_back(e.evaluation.verdict());
    text += (text.empty() ? "" : "; ") + fmt::format("{}: APE rmse {} {}, {}", e.name,
                                                     number(e.evaluation.ape_statistics.rmse), setting.ape_unit,
                                                     verdicts.back().text);
  }
  report.verdict(output.failed.empty() ? answerOf(verdicts) : Verdict::Answer::no, text);
  for (const std::string& failed : output.failed) report.paragraph("failed: " + failed);
  report.section("Figures");
  const bool any_covariances = std::any_of(output.estimates.begin(), output.estimates.end(),
                                           [](const EvaluatedEstimate& e) { return e.evaluation.has_covariances; });
  std::vector<std::string> headers{"estimate",
                                   "poses matched",
                                   "APE rmse, " + setting.ape_unit,
                                   "median",
                                   "max",
                                   "RPE rmse, " + setting.rpe_unit,
                                   "position rmse, m",
                                   "rotation rmse, deg"};
  if (any_covariances) headers.insert(headers.end(), {"NEES/dof", "p", "of positions", "of rotations"});
  std::vector<std::vector<std::string>> rows;
  for (const EvaluatedEstimate& shown : output.estimates) {
    const TrajectoryEvaluation& e = shown.evaluation;
    const Consistency& c = e.consistency;
    rows.push_back({shown.name, fmt::format("{}", e.matched.size()), number(e.ape_statistics.rmse),
                    number(e.ape_statistics.median), number(e.ape_statistics.max), number(e.rpe_statistics.rmse),
                    number(rootMeanSquare(e.position_errors)), number(degrees * rootMeanSquare(e.rotation_errors))});
    if (!any_covariances) continue;
    for (const double figure : {c.joint.ratio(), c.joint.p, c.position.ratio(), c.rotation.ratio()}) {
      rows.back().push_back(number(figure, 3));
    }
  }
  report.table(headers, rows,
               any_covariances
                   ? "Absolute and relative errors; NEES over its degrees of freedom after the weighted alignment."
                   : "Absolute and relative errors.");
  report.section("Errors over time");
  report.plot(errorsOverTime(output));
  report.section("Path by error");
  for (std::size_t k = 0; k < output.estimates.size(); ++k) report.plot(colouredPath(output.estimates[k], k + 1));
  if (output.estimates.size() > 1) report.plot(trajectoryPlot(output));
  if (std::any_of(output.estimates.begin(), output.estimates.end(),
                  [](const auto& e) { return !e.evaluation.segments.empty(); })) {
    report.section("Errors by the length of a segment");
    report.plot(segmentPlot(output));
  }
  for (std::size_t k = 0; k < output.estimates.size(); ++k) {
    const EvaluatedEstimate& e = output.estimates[k];
    if (!e.evaluation.consistency.ok) continue;
    report.section(fmt::format("Errors of {} against its covariances", e.name));
    report.plot(errorPlot(e, k + 1));
    report.plot(neesPlot(e, k + 1));
  }
  report.section("All that the program said");
  report.code(command_line);
  report.code(formatEvaluation(output));
  printLines("\n" + report.write() + "\n");
}

}  // namespace liestat::cli
