#include <cli/show/diagnosis.hpp>

#include <formats/text.hpp>
#include <stats/convention_presets.hpp>
#include <report/outline.hpp>
#include <report/page.hpp>
#include <cli/show/pose_errors.hpp>
#include <stats/laws.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

namespace liestat::cli {
namespace {

std::string optionOf(const Convention& c) { return conventionName(c, false); }
std::string nameOf(const ConventionReading& reading) { return optionOf(reading.convention); }

/// Options to copy, of conventions in which the matrices can be used as they are: not those behind faults and wrong
/// scales.
std::string acceptedInWords(const CovarianceDiagnosis& r) {
  constexpr std::size_t most = 12;
  std::string text;
  if (r.verdict().isNo() || r.misfit.found()) return text;
  const std::vector<Convention> accepted = r.accepted();
  for (std::size_t k = 0; k < std::min(most, accepted.size()); ++k) {
    text += fmt::format("  --cov-from {}: {}\n", optionOf(accepted[k]), describe(accepted[k]));
  }
  if (accepted.size() > most) text += fmt::format("  and {} more\n", accepted.size() - most);
  return text;
}

std::string testsInWords(const WhitenedResidualTests& tests) {
  Table table({"test", "statistic", "expected", "p", ""});
  const auto all = tests.all();
  for (std::size_t k = 0; k < all.size(); ++k) {
    const auto kind = static_cast<ResidualTestKind>(k);
    if (!all[k].applies()) continue;
    const double expected = kind == ResidualTestKind::lag ? 0 : all[k].dof;
    table.row(
        {name(kind), number(all[k].statistic), number(expected), number(all[k].p, 2), all[k].fires() ? "fires" : ""});
  }
  return table.str();
}

std::string chainInWords(const ChainDiagnosis& c) {
  std::string text =
      fmt::format("chain condition, {} steps: share of steps in which the covariance shrinks\n", c.steps);
  for (std::size_t k = 0; k < std::min<std::size_t>(5, c.fits.size()); ++k) {
    text += fmt::format("  {:.3f}  {}\n", c.fits[k].indefinite, optionOf(c.fits[k].convention));
  }
  if (c.increments.applies()) {
    text += fmt::format("  NEES of the increments is {} of its expectation (p {})\n", number(c.increments.ratio(), 3),
                        number(c.increments.p, 2));
  }
  return text;
}

std::string planInWords(const std::vector<PlanRow>& plan) {
  std::string text = "What this file can decide, from its poses and matrices alone:\n\n";
  Table table({"if the truth is", "nearest other", "nats per pose", "poses needed", "equal to"});
  for (const PlanRow& row : plan) {
    std::vector<std::string> equal;
    for (const Convention& c : row.equal) equal.push_back(optionOf(c));
    table.row({optionOf(row.convention), row.poses > 0 ? optionOf(row.nearest) : "none", number(row.divergence, 3),
               row.poses > 0 ? number(row.poses, 6) : "none", joined(equal, " ")});
  }
  return text + table.str() +
         "\nequal to: conventions that write the same matrices here; no number of poses decides between them\n";
}

}  // namespace

std::string formatDiagnosis(const DiagnosisOutput& output) {
  const CovarianceDiagnosis& r = output.result;
  std::string text =
      r.mode == DiagnosisMode::plan ? planInWords(r.plan) : r.verdict().text + "\n" + acceptedInWords(r) + "\n";
  text += fmt::format("{}: {} {}{}\n", joined(output.files, ", "), r.structure.n, r.what,
                      output.reference.empty() ? "" : ", truth " + output.reference);
  for (const std::string& note : r.file_notes) text += note + "\n";
  if (!r.diagnosis) {
    for (const std::string& line : r.structure.words()) text += line + "\n";
    if (r.chain) text += chainInWords(*r.chain);
    return text;
  }
  const ConventionDiagnosis& d = *r.diagnosis;
  if (d.skipped > 0) text += fmt::format("{} {} without a usable matrix\n", d.skipped, r.what);
  for (const std::string& note : d.notes) text += note + "\n";
  if (d.correlated) {
    text +=
        fmt::format("neighbouring errors are correlated (lag test {}): no hypothesis is ranked on absolute errors\n",
                    number(d.tests.lag.statistic, 3));
    if (std::isfinite(d.growth))
      text += fmt::format("NEES of the second half over the first: {}\n", number(d.growth, 3));
  }
  if (!d.fits.empty()) {
    text += fmt::format("\nhypotheses, in nats below the best one (margin {})\n", number(d.margin, 3));
    Table table({"nats", "NEES/dof", "convention", "fault"});
    for (std::size_t k = 0; k < std::min<std::size_t>(6, d.fits.size()); ++k) {
      const HypothesisFit& f = d.fits[k];
      if (std::isinf(f.log_likelihood)) break;
      table.row({number(0 - f.log_likelihood, 4), number(f.nees_ratio, 3), optionOf(f.convention),
                 f.fault == MatrixFault::none ? "" : name(f.fault)});
    }
    text += table.str();
  }
  if (!d.correlated || d.increments_as_absolute) text += "\n" + testsInWords(d.tests);
  if (d.scale) {
    text += "\nscales of the blocks, free: ";
    text += fmt::format("translation {}, rotation {} (variances, +- {:.0f} %)\n", number(d.scale->translation, 3),
                        number(d.scale->rotation, 3), 100 * d.scale->relative_sigma);
  }
  if (d.chain) text += "\n" + chainInWords(*d.chain);
  return text;
}

namespace {

/// Rows of the tables of hypotheses.
constexpr std::size_t most_shown = 20;

/// The times of the poses, or the numbers of their rows.
TimesOfPoses timesOf(const CovarianceDiagnosis& d) {
  TimesOfPoses times{d.times, !d.times.empty()};
  for (std::size_t i = 0; i < d.poses.size() && !times.by_time; ++i) times.values.push_back(static_cast<double>(i));
  return times;
}

/// True if plots can show errors of this reading.
bool hasErrors(const ConventionReading& reading) {
  const std::vector<PoseError>& errors = reading.consistency.errors;
  return std::any_of(errors.begin(), errors.end(), [](const PoseError& e) { return std::isfinite(e.nees); });
}

std::vector<double> neesOf(const ConventionReading& reading) {
  std::vector<double> values;
  for (const PoseError& e : reading.consistency.errors) {
    if (std::isfinite(e.nees)) values.push_back(e.nees);
  }
  return values;
}

/// True if the likelihood of a hypothesis comes with errors that follow its covariances.
bool areExplained(const ConventionDiagnosis& d) {
  return d.verdict == DiagnosisVerdict::identified || d.verdict == DiagnosisVerdict::undecidable ||
         d.fault != MatrixFault::none || d.increments_as_absolute;
}

bool explains(const std::vector<Convention>& accepted, const Convention& c) {
  return std::find(accepted.begin(), accepted.end(), c) != accepted.end();
}

void showHypotheses(Report& report, const ConventionDiagnosis& d) {
  report.section("Conventions tried");
  if (d.fits.empty()) {
    report.paragraph(
        "Neighbouring errors are correlated, so that no convention is ranked on absolute errors (see the tests "
        "below).");
    return;
  }
  std::vector<std::vector<std::string>> rows;
  Series right{.name = "explain the errors", .style = Style::stars, .colour = 2};
  Series wrong{.name = "do not", .style = Style::points, .colour = 0};
  std::size_t indefinite = 0;
  for (const HypothesisFit& f : d.fits) {
    const bool is_right = areExplained(d) && explains(d.accepted, f.convention) && f.fault == d.fault;
    const double below = 0 - f.log_likelihood;
    if (rows.size() < most_shown) {
      const std::string remark = f.indefinite > 0 ? fmt::format("{} matrices not positive definite", f.indefinite)
                                 : f.fault == MatrixFault::none ? ""
                                                                : describe(f.fault);
      rows.push_back({optionOf(f.convention), number(f.nees_ratio, 3), std::isinf(below) ? "" : number(below, 4),
                      is_right ? "yes" : "no", describe(f.convention), remark});
    }
    if (std::isinf(below)) {
      ++indefinite;
      continue;
    }
    Series& series = is_right ? right : wrong;
    series.add(below + 1, f.nees_ratio);
  }
  report.paragraph(
      fmt::format("{} hypotheses were compared by the likelihood of the errors. One explains them if it is at most {} "
                  "nats below the "
                  "best; the calibration index is NEES over its degrees of freedom, 1 if the covariances are right.",
                  d.fits.size(), number(d.margin, 3)));
  Panel panel{
      .x = {.label = "nats below the best, plus one", .logarithmic = true},
      .y = {.label = "calibration index (NEES/dof)", .logarithmic = true},
      .series = {wrong, right},
      .references = {{ReferenceLine::Direction::horizontal, 1}, {ReferenceLine::Direction::vertical, d.margin + 1}}};
  report.plot(
      {.name = "conventions",
       .caption = fmt::format("Each hypothesis; those left of the upright dotted line explain the errors, and on "
                              "the level one the errors are as large as the covariances say.{}",
                              indefinite > 0 ? fmt::format(" {} with matrices that are not positive definite are "
                                                           "left out.",
                                                           indefinite)
                                             : std::string()),
       .panels = {panel}});
  report.table({"--cov-from", "calibration index", "nats below the best", "explains", "in words", "remark"}, rows,
               rows.size() < d.fits.size() ? fmt::format("The likeliest {} of them.", rows.size()) : std::string());
}

void showChain(Report& report, const ChainDiagnosis& c) {
  report.section("Chain condition");
  report.paragraph(fmt::format(
      "Dead reckoning in the right convention has a covariance that grows in each of its {} steps. {}", c.steps,
      c.increments.applies() ? fmt::format("The increments' calibration index is {} (p {}).",
                                           number(c.increments.ratio(), 3), number(c.increments.p, 2))
                             : std::string()));
  std::vector<std::vector<std::string>> rows;
  for (const ChainFit& f : c.fits) {
    if (rows.size() == most_shown) break;
    rows.push_back({optionOf(f.convention), number(100 * f.indefinite, 3),
                    explains(c.accepted, f.convention) ? "yes" : "no", describe(f.convention)});
  }
  report.table({"--cov-from", "steps that shrink, %", "explains", "in words"}, rows,
               fmt::format("The first {} of {} conventions.", rows.size(), c.fits.size()));
}

void showPlan(Report& report, const std::vector<PlanRow>& plan) {
  report.section("Conventions that can be told apart");
  std::vector<std::vector<std::string>> rows;
  for (const PlanRow& row : plan) {
    std::string equal;
    for (const Convention& c : row.equal) equal += (equal.empty() ? "" : " ") + optionOf(c);
    const bool any = row.poses > 0;
    rows.push_back({optionOf(row.convention), any ? optionOf(row.nearest) : "none",
                    any ? number(row.divergence, 3) : "", any ? number(std::ceil(row.poses), 6) : "", equal});
  }
  report.table({"if the truth is", "nearest other", "nats per pose", "poses needed", "equal to"}, rows,
               "No number of poses decides between conventions that are equal here.");
}

/// The calibration of readings: their indices, the distribution of NEES, NEES over the times.
void showCalibration(Report& report, const TimesOfPoses& times, const std::vector<const ConventionReading*>& readings) {
  report.section("Calibration");
  std::vector<std::vector<std::string>> rows;
  Panel coverage{.title = "Share of poses within an error ellipsoid",
                 .x = {.label = "probability of the ellipsoid, %", .low = 0.0, .high = 100.0},
                 .y = {.label = "share of poses, %", .low = 0.0, .high = 100.0}};
  coverage.series.push_back(
      {.name = "as it should be", .style = Style::lines, .x = {0, 100}, .y = {0, 100}, .colour = 6, .dashed = true});
  const int judged = readings.back()->consistency.tests.components.count();
  Panel nees = neesPanel(times, judged);
  nees.title = "NEES of each pose";
  for (std::size_t k = 0; k < readings.size(); ++k) {
    const ConventionReading& r = *readings[k];
    std::vector<double> values = neesOf(r);
    std::sort(values.begin(), values.end());
    const auto n = static_cast<double>(values.size());
    const int dof = r.consistency.tests.components.count();
    const double bound = chiSquaredThreshold(0.05, dof);
    const auto inside = static_cast<double>(std::upper_bound(values.begin(), values.end(), bound) - values.begin());
    const Consistency& c = r.consistency;
    rows.push_back({nameOf(r), fmt::format("{}", values.size()), number(c.joint.ratio(), 3), number(c.joint.p, 2),
                    number(c.position.ratio(), 3), number(c.rotation.ratio(), 3), number(100 * inside / n, 3)});
    // The first reading at the back of both panels.
    const std::size_t colour = k == 0 ? 1 : 0;
    Series curve{.name = nameOf(r), .style = Style::lines, .x = {0}, .y = {0}, .colour = colour};
    const std::size_t step = std::max<std::size_t>(1, values.size() / 500);
    for (std::size_t i = step - 1; i < values.size(); i += step) {
      curve.add(100 * (1 - chiSquaredSurvival(values[i], dof)), 100 * static_cast<double>(i + 1) / n);
    }
    curve.add(100, 100);
    coverage.series.push_back(curve);
    nees.series.push_back(neesSeries(nameOf(r), c.errors, times));
    nees.series.back().colour = colour;
  }
  const auto table = [&] {
    report.table(
        {"read as", "poses", "calibration index", "p", "position", "rotation", "within 95 %, %"}, rows,
        "NEES over its degrees of freedom, of poses, of positions and of rotations (1 expected), and the share of "
        "poses within the ellipsoid of 95 %.");
  };
  report.plot(
      {.name = "calibration",
       .caption = "Left: a curve above the diagonal is that of covariances that are too large, below it of those "
                  "that are too small. Right: NEES of each pose; " +
                  neesBounds(judged),
       .panels = {coverage, nees}});
  table();
}

/// Errors over the times with the bands of the best reading, and of the assumed one.
void showErrors(Report& report, const TimesOfPoses& times, const ConventionReading& best,
                const ConventionReading* assumed) {
  report.section("Errors over time");
  Plot plot{.name = "errors", .columns = 3};
  plot.panels = errorPanels(best.consistency.errors, times);
  for (int k = 0; k < 6; ++k) {
    Panel& panel = plot.panels[static_cast<std::size_t>(k)];
    panel.series[0].name = "3 sd, " + nameOf(best);
    if (assumed == nullptr) continue;
    double reach = 0;
    for (const double high : panel.series[0].high) reach = std::max(reach, high);
    for (const double error : panel.series[1].y) reach = std::max(reach, std::abs(error));
    if (reach > 0) panel.y.low = -1.1 * reach, panel.y.high = 1.1 * reach;
    const double unit = coordinateOfError(k).second;
    Series band{.style = Style::filled_curve};
    for (std::size_t i = 0; i < assumed->consistency.errors.size(); ++i) {
      const double sigma = 3 * unit * std::sqrt(assumed->consistency.errors[i].covariance(k, k));
      band.addBand(times.values[i], -sigma, sigma);
    }
    band = outlineOf(band);
    panel.series.push_back(
        {.name = "3 sd, " + nameOf(*assumed), .x = band.x, .y = band.high, .colour = 3, .dashed = true});
    panel.series.push_back({.x = band.x, .y = band.low, .colour = 3, .dashed = true});
  }
  bool is_outline = false;
  for (Panel& panel : plot.panels) {
    for (Series& series : panel.series) {
      const std::size_t all = series.x.size();
      series = outlineOf(series);
      is_outline = is_outline || series.x.size() < all;
    }
  }
  plot.caption = fmt::format(
      "Errors in the body's axes with the band of three standard deviations that the covariances have if read as {}{}.",
      nameOf(best),
      assumed == nullptr ? "" : fmt::format("; dashed: as {}, drawn as far as it fits", nameOf(*assumed)));
  report.plot(plot);
}

/// Standard deviations over the poses, where there is no truth.
void showDeviations(Report& report, const TimesOfPoses& times, const std::vector<const ConventionReading*>& readings) {
  report.section("Standard deviations");
  Plot plot{.name = "deviations",
            .caption =
                "The largest standard deviation of each pose's position and of its rotation, by the convention in "
                "which the file is read."};
  for (const int from : {0, 3}) {
    Panel panel{.x = {.label = times.label()},
                .y = {.label = from == 0 ? "sd of position, m" : "sd of rotation, deg", .logarithmic = true}};
    for (std::size_t k = 0; k < readings.size(); ++k) {
      Series line{.name = nameOf(*readings[k]), .colour = k == 0 ? 1 : 0};
      for (std::size_t i = 0; i < readings[k]->poses.size(); ++i) {
        const double variance = readings[k]->poses[i].covariance.diagonal().segment<3>(from).maxCoeff();
        line.add(times.values[i], coordinateOfError(from).second * std::sqrt(variance));
      }
      panel.series.push_back(outlineOf(line));
    }
    plot.panels.push_back(panel);
  }
  report.plot(plot);
}

}  // namespace

void writeDiagnosisReport(const std::string& directory, const std::string& command_line, const DiagnosisOutput& output,
                          const std::vector<ConventionReading>& readings) {
  Report report(directory, "Convention of the covariances in " + output.files.front());
  const CovarianceDiagnosis& r = output.result;
  report.verdict(r.verdict());
  report.code(command_line);
  const bool has_truth = r.diagnosis.has_value();
  const TimesOfPoses times = timesOf(r);
  std::vector<const ConventionReading*> shown;
  for (const ConventionReading& reading : readings) {
    if (!has_truth || hasErrors(reading)) shown.push_back(&reading);
  }
  if (!has_truth) {
    showDeviations(report, times, shown);
  } else if (shown.empty()) {
    report.paragraph("No matrix is a covariance as it stands, so that there are no errors to draw.");
  } else {
    if (r.diagnosis->fault != MatrixFault::none) {
      report.paragraph("The plots below show the matrices as the file has them, with their fault.");
    }
    showCalibration(report, times, shown);
    showErrors(report, times, *shown.back(), shown.size() > 1 ? shown.front() : nullptr);
  }
  if (r.diagnosis) showHypotheses(report, *r.diagnosis);
  if (r.mode == DiagnosisMode::plan) showPlan(report, r.plan);
  if (r.chain) showChain(report, *r.chain);
  if (r.diagnosis && r.diagnosis->chain) showChain(report, *r.diagnosis->chain);
  report.section("Result");
  report.code(formatDiagnosis(output));
  report.write();
}

}  // namespace liestat::cli
