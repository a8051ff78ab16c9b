#include <cli/show/diagnosis.hpp>

#include <cli/commands/command_line.hpp>
#include <cli/show/outline.hpp>
#include <cli/show/page.hpp>
#include <cli/show/table.hpp>
#include <stats/convention_presets.hpp>
#include <stats/laws.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {
namespace {

/// Rows of the tables of hypotheses.
constexpr std::size_t most_shown = 20;

/// The file read in one convention.
struct Reading {
  std::string name;
  Convention convention;
  std::vector<Gaussian<SE3d>> poses;
  Consistency consistency;  ///< not ok without a truth, or with covariances that are not positive definite
};

Reading readingOf(const DiagnosedFile& file, const Convention& convention, bool has_truth) {
  Reading reading{conventionName(convention, false), convention, {}, {}};
  std::vector<MatchedPose> matched;
  for (const DiagnosedPose& p : file.poses) {
    Eigen::Matrix<double, 6, 6> matrix = p.matrix;
    // An unknown cross block counts as zero, as in the diagnosis.
    for (int i = 0; i < 3; ++i) {
      for (int j = 3; j < 6; ++j) {
        if (std::isnan(matrix(i, j))) matrix(i, j) = matrix(j, i) = 0;
      }
    }
    reading.poses.push_back(fromConvention(convention, p.estimate, matrix));
    matched.push_back({exactPoses(std::vector<SE3d>{p.truth}).front(), reading.poses.back()});
  }
  if (has_truth) reading.consistency = evaluateConsistency(matched, alignWeighted(matched, file.alignment));
  return reading;
}

/// True if plots can show errors of this reading.
bool hasErrors(const Reading& reading) {
  const std::vector<PoseError>& errors = reading.consistency.errors;
  return std::any_of(errors.begin(), errors.end(), [](const PoseError& e) { return std::isfinite(e.nees); });
}

std::vector<double> neesOf(const Reading& reading) {
  std::vector<double> values;
  for (const PoseError& e : reading.consistency.errors) {
    if (std::isfinite(e.nees)) values.push_back(e.nees);
  }
  return values;
}

/// The convention that explains the errors, else the likeliest one.
std::optional<Convention> bestOf(const DiagnosisOutput& output) {
  const std::vector<Convention>* accepted = output.diagnosis ? &output.diagnosis->accepted
                                            : output.chain   ? &output.chain->accepted
                                                             : nullptr;
  if (accepted != nullptr && !accepted->empty()) return accepted->front();
  if (!output.diagnosis || output.diagnosis->fits.empty()) return std::nullopt;
  const HypothesisFit& first = output.diagnosis->fits.front();
  return std::isinf(first.log_likelihood) ? std::nullopt : std::optional(first.convention);
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
    const bool is_right = explains(d.accepted, f.convention) && f.fault == d.fault;
    const double below = 0 - f.log_likelihood;
    if (rows.size() < most_shown) {
      const std::string remark = f.indefinite > 0 ? fmt::format("{} matrices not positive definite", f.indefinite)
                                 : f.fault == MatrixFault::none ? ""
                                                                : describe(f.fault);
      rows.push_back({conventionName(f.convention, false), number(f.nees_ratio, 3),
                      std::isinf(below) ? "" : number(below, 4), is_right ? "yes" : "no", describe(f.convention),
                      remark});
    }
    if (std::isinf(below)) {
      ++indefinite;
      continue;
    }
    Series& series = is_right ? right : wrong;
    series.x.push_back(below + 1), series.y.push_back(f.nees_ratio);
  }
  report.paragraph(
      fmt::format("{} hypotheses were compared by the likelihood of the errors. One explains them if it is at most {} "
                  "nats below the "
                  "best; the calibration index is NEES over its degrees of freedom, 1 if the covariances are right.",
                  d.fits.size(), number(d.margin, 3)));
  report.table({"--cov-from", "calibration index", "nats below the best", "explains", "in words", "remark"}, rows,
               rows.size() < d.fits.size() ? fmt::format("The likeliest {} of them.", rows.size()) : std::string());
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
    rows.push_back({conventionName(f.convention, false), number(100 * f.indefinite, 3),
                    explains(c.accepted, f.convention) ? "yes" : "no", describe(f.convention)});
  }
  report.table({"--cov-from", "steps that shrink, %", "explains", "in words"}, rows,
               fmt::format("The first {} of {} conventions.", rows.size(), c.fits.size()));
}

void showPlan(Report& report, const DiagnosisOutput& output) {
  report.section("Conventions that can be told apart");
  std::vector<std::vector<std::string>> rows;
  for (const PlanRow& row : output.plan) {
    std::string equal;
    for (const Convention& c : row.equal) equal += (equal.empty() ? "" : " ") + conventionName(c, false);
    const bool any = row.poses > 0;
    rows.push_back({conventionName(row.convention, false), any ? conventionName(row.nearest, false) : "none",
                    any ? number(row.divergence, 3) : "", any ? number(std::ceil(row.poses), 6) : "", equal});
  }
  report.table({"if the truth is", "nearest other", "nats per pose", "poses needed", "equal to"}, rows,
               "No number of poses decides between conventions that are equal here.");
}

/// The calibration of readings: their indices, the distribution of NEES, NEES over the times.
void showCalibration(Report& report, const DiagnosedFile& file, const std::vector<const Reading*>& readings) {
  report.section("Calibration");
  const double bound = chiSquaredThreshold(0.05, 6);
  std::vector<std::vector<std::string>> rows;
  Panel coverage{.title = "Share of poses within an error ellipsoid",
                 .x = {.label = "probability of the ellipsoid, %", .low = 0.0, .high = 100.0},
                 .y = {.label = "share of poses, %", .low = 0.0, .high = 100.0}};
  coverage.series.push_back(
      {.name = "as it should be", .style = Style::lines, .x = {0, 100}, .y = {0, 100}, .colour = 6, .dashed = true});
  Panel nees = neesPanel(file.times);
  nees.title = "NEES of each pose";
  for (std::size_t k = 0; k < readings.size(); ++k) {
    const Reading& r = *readings[k];
    std::vector<double> values = neesOf(r);
    std::sort(values.begin(), values.end());
    const auto n = static_cast<double>(values.size());
    const auto inside = static_cast<double>(std::upper_bound(values.begin(), values.end(), bound) - values.begin());
    const Consistency& c = r.consistency;
    rows.push_back({r.name, fmt::format("{}", values.size()), number(c.joint.ratio(), 3), number(c.joint.p, 2),
                    number(c.position.ratio(), 3), number(c.rotation.ratio(), 3), number(100 * inside / n, 3)});
    // The first reading at the back of both panels.
    const std::size_t colour = k == 0 ? 1 : 0;
    Series curve{.name = r.name, .style = Style::lines, .x = {0}, .y = {0}, .colour = colour};
    const std::size_t step = std::max<std::size_t>(1, values.size() / 500);
    for (std::size_t i = step - 1; i < values.size(); i += step) {
      curve.x.push_back(100 * (1 - chiSquaredSurvival(values[i], 6)));
      curve.y.push_back(100 * static_cast<double>(i + 1) / n);
    }
    curve.x.push_back(100), curve.y.push_back(100);
    coverage.series.push_back(curve);
    nees.series.push_back(neesSeries(r.name, c.errors, file.times));
    nees.series.back().colour = colour;
  }
  report.table(
      {"read as", "poses", "calibration index", "p", "position", "rotation", "within 95 %, %"}, rows,
      "NEES over its degrees of freedom, of poses, of positions and of rotations (1 expected), and the share of "
      "poses within the ellipsoid of 95 %.");
  report.plot(
      {.name = "calibration",
       .caption = "Left: a curve above the diagonal is that of covariances that are too large, below it of those "
                  "that are too small. Right: NEES of each pose; " +
                  neesBounds(),
       .panels = {coverage, nees}});
}

/// Errors over the times with the bands of the best reading, and of the assumed one.
void showErrors(Report& report, const DiagnosedFile& file, const Reading& best, const Reading* assumed) {
  report.section("Errors over time");
  Plot plot{.name = "errors", .columns = 3};
  plot.panels = errorPanels(best.consistency.errors, file.times);
  for (int k = 0; k < 6; ++k) {
    Panel& panel = plot.panels[static_cast<std::size_t>(k)];
    panel.series[0].name = "3 sd, " + best.name;
    if (assumed == nullptr) continue;
    double reach = 0;
    for (const double high : panel.series[0].high) reach = std::max(reach, high);
    for (const double error : panel.series[1].y) reach = std::max(reach, std::abs(error));
    if (reach > 0) panel.y.low = -1.1 * reach, panel.y.high = 1.1 * reach;
    const double unit = coordinateOfError(k).second;
    Series band{.style = Style::filled_curve};
    for (std::size_t i = 0; i < assumed->consistency.errors.size(); ++i) {
      const double sigma = 3 * unit * std::sqrt(assumed->consistency.errors[i].covariance(k, k));
      band.x.push_back(file.times.values[i]), band.low.push_back(-sigma), band.high.push_back(sigma);
    }
    band = outlineOf(band);
    panel.series.push_back(
        {.name = "3 sd, " + assumed->name, .x = band.x, .y = band.high, .colour = 3, .dashed = true});
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
      best.name, assumed == nullptr ? "" : fmt::format("; dashed: as {}, drawn as far as it fits", assumed->name));
  report.plot(plot);
}

/// Standard deviations over the poses, where there is no truth.
void showDeviations(Report& report, const DiagnosedFile& file, const std::vector<const Reading*>& readings) {
  report.section("Standard deviations");
  Plot plot{.name = "deviations",
            .caption =
                "The largest standard deviation of each pose's position and of its rotation, by the convention in "
                "which the file is read."};
  for (const int from : {0, 3}) {
    Panel panel{.x = {.label = file.times.label()},
                .y = {.label = from == 0 ? "sd of position, m" : "sd of rotation, deg", .logarithmic = true}};
    for (std::size_t k = 0; k < readings.size(); ++k) {
      Series line{.name = readings[k]->name, .colour = k == 0 ? 1 : 0};
      for (std::size_t i = 0; i < readings[k]->poses.size(); ++i) {
        const double variance = readings[k]->poses[i].covariance.diagonal().segment<3>(from).maxCoeff();
        line.x.push_back(file.times.values[i]);
        line.y.push_back(coordinateOfError(from).second * std::sqrt(variance));
      }
      panel.series.push_back(outlineOf(line));
    }
    plot.panels.push_back(panel);
  }
  report.plot(plot);
}

std::string planVerdict(const DiagnosisOutput& output) {
  const auto n = static_cast<double>(output.structure.n);
  const auto decided = std::count_if(output.plan.begin(), output.plan.end(), [n](const PlanRow& row) {
    return row.equal.empty() && row.poses > 0 && row.poses <= n;
  });
  return fmt::format("With its {} {} this file tells {} of {} conventions from all others.", output.structure.n,
                     output.what, decided, output.plan.size());
}

}  // namespace

void writeDiagnosisReport(const std::string& directory, const std::string& command_line, const DiagnosisOutput& output,
                          const DiagnosedFile& file) {
  Report report(directory, "Convention of the covariances in " + output.files.front());
  const bool plan = output.mode == "plan";
  report.verdict(exitCodeOf(output) == exit_fine, plan ? planVerdict(output) : verdictOf(output));
  report.code(command_line);
  if (output.diagnosis) showHypotheses(report, *output.diagnosis);
  if (plan) showPlan(report, output);
  const ChainDiagnosis* chain = output.chain                                  ? &*output.chain
                                : output.diagnosis && output.diagnosis->chain ? &*output.diagnosis->chain
                                                                              : nullptr;
  if (chain != nullptr) showChain(report, *chain);

  // The reading that is assumed without a diagnosis, at the back, and the best one.
  const std::optional<Convention> best_convention = bestOf(output);
  const bool has_truth = output.diagnosis.has_value();
  const Reading assumed = readingOf(file, file.assumed, has_truth);
  const Reading best = best_convention ? readingOf(file, *best_convention, has_truth) : assumed;
  const bool two = best.convention != assumed.convention;
  std::vector<const Reading*> readings;
  for (const Reading* r : {&assumed, &best}) {
    if ((r == &best || two) && (!has_truth || hasErrors(*r))) readings.push_back(r);
  }
  if (!has_truth) {
    showDeviations(report, file, readings);
  } else if (readings.empty()) {
    report.paragraph("No matrix is a covariance as it stands, so that there are no errors to draw.");
  } else {
    if (output.diagnosis->fault != MatrixFault::none) {
      report.paragraph("The plots below show the matrices as the file has them, with their fault.");
    }
    showCalibration(report, file, readings);
    showErrors(report, file, *readings.back(), readings.size() > 1 ? readings.front() : nullptr);
  }
  report.section("Result");
  report.code(formatDiagnosis(output));
  report.write();
}

}  // namespace liestat::cli
