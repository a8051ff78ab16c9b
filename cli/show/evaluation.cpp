#include <cli/show/evaluation.hpp>

#include <formats/input_error.hpp>
#include <formats/output_file.hpp>
#include <formats/text.hpp>
#include <report/page.hpp>
#include <cli/show/pose_errors.hpp>
#include <report/table.hpp>
#include <cli/show/units.hpp>

#include <fmt/format.h>

#include <array>
#include <cmath>

namespace liestat::cli {
namespace {

std::string alignmentName(const Alignment& a) {
  if (a.model == AlignmentModel::none) return "none";
  const std::string how = a.weighted ? "weighted" : a.model == AlignmentModel::origin ? "first pose" : "least squares";
  return fmt::format("{} ({})", name(a.model), how);
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
  text += fmt::format("reference {}: {} poses{}\n\n", output.reference, output.setting().reference_poses,
                      output.reference_has_covariances ? ", with covariances" : ", taken as exact");
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

// --- Page -------------------------------------------------------------------------------------------------------------

namespace {

Plot trajectoryPlot(const EvaluationOutput& output) {
  Plot plot{.name = "trajectories", .caption = "Reference and aligned estimates, from above and from the side, m."};
  for (const auto& [i, j] : {std::pair(0, 1), std::pair(0, 2)}) {
    constexpr std::array axes{"x, m", "y, m", "z, m"};
    Panel panel{{}, {axes[static_cast<std::size_t>(i)]}, {axes[static_cast<std::size_t>(j)]}};
    panel.equal_aspect = true;
    Series reference{.name = "reference"};
    for (const MatchedPose& p : output.setting().matched) {
      reference.add(p.reference.mean.translation()[i], p.reference.mean.translation()[j]);
    }
    panel.series.push_back(reference);
    for (const EvaluatedEstimate& e : output.estimates) {
      Series estimate{.name = e.name};
      for (const MatchedPose& p : e.evaluation.matched) {
        const Eigen::Vector3d t = e.evaluation.alignment(p.estimate.mean).translation();
        estimate.add(t[i], t[j]);
      }
      panel.series.push_back(estimate);
    }
    plot.panels.push_back(panel);
  }
  return plot;
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
  Panel panel = neesPanel(times);
  panel.series = {neesSeries("NEES", e.evaluation.consistency.errors, times)};
  return {.name = fmt::format("nees_{}", number_of),
          .caption = fmt::format("NEES of each pose of {}; {}", e.name, neesBounds()),
          .panels = {panel}};
}

}  // namespace

void writeEvaluationReport(const std::string& directory, const std::string& command_line,
                           const EvaluationOutput& output) {
  Report report(directory, "Trajectories against a reference");
  std::vector<Verdict> verdicts;
  std::string text;
  for (const EvaluatedEstimate& e : output.estimates) {
    verdicts.push_back(e.evaluation.verdict());
    text += (text.empty() ? "" : "; ") + fmt::format("{}: {}", e.name, verdicts.back().text);
  }
  report.verdict(output.failed.empty() ? answerOf(verdicts) : Verdict::Answer::no, text);
  report.code(command_line);
  report.section("Figures");
  std::vector<std::vector<std::string>> rows;
  for (const EvaluatedEstimate& shown : output.estimates) {
    const TrajectoryEvaluation& e = shown.evaluation;
    const Consistency& c = e.consistency;
    rows.push_back({shown.name, fmt::format("{}", e.matched.size()), number(e.ape_statistics.rmse),
                    number(e.ape_statistics.median), number(e.ape_statistics.max), number(e.rpe_statistics.rmse),
                    number(c.joint.ratio(), 3), number(c.joint.p, 2), number(c.position.ratio(), 3),
                    number(c.rotation.ratio(), 3)});
  }
  report.table({"estimate", "poses", "APE rmse " + output.setting().ape_unit, "APE median", "APE max",
                "RPE rmse " + output.setting().rpe_unit, "NEES/dof", "p", "position", "rotation"},
               rows, "Absolute and relative errors; NEES over its degrees of freedom after the weighted alignment.");
  report.code(formatEvaluation(output));
  report.section("Trajectories");
  report.plot(trajectoryPlot(output));
  for (std::size_t k = 0; k < output.estimates.size(); ++k) {
    const EvaluatedEstimate& e = output.estimates[k];
    if (!e.evaluation.consistency.ok) continue;
    report.section(fmt::format("Errors of {}", e.name));
    report.plot(errorPlot(e, k + 1));
    report.plot(neesPlot(e, k + 1));
  }
  printLines("\n" + report.write() + "\n");
}

}  // namespace liestat::cli
