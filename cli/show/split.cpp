#include <cli/show/split.hpp>

#include <cli/show/mean.hpp>
#include <cli/show/page.hpp>
#include <cli/show/table.hpp>
#include <cli/show/units.hpp>
#include <cli/show/validation.hpp>
#include <experiments/interruption.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace liestat::cli {
namespace {

std::string seriesInWords(const char* what, const SplitSeries& s) {
  if (s.distances.empty()) return fmt::format("{:<22} none was done\n", what);
  return fmt::format("{:<22} index {} (expected {} +- {}), p = {}\n", what, number(s.index), number(s.dof),
                     number(s.standardError(), 2), number(s.pValue(), 2));
}

JsonObject toJson(const SplitSeries& s) {
  JsonObject o;
  o.set("splits", s.distances.size()).set("failures", s.failures).set("index", s.index).set("index_expected", s.dof);
  o.set("index_se", s.standardError()).set("effective_dof", s.effective_dof).set("p", s.pValue());
  o.set("factor", s.factor()).set("factor_low", s.factorLow()).set("factor_high", s.factorHigh());
  return o;
}

JsonObject toJson(const HalfMean& half, Feature feature) {
  JsonObject o;
  o.set("n", half.n).set("mean", toJson(half.mean));
  if (half.covariance.size() > 0) {
    o.set("covariance", half.covariance).set("standard_deviations", standardDeviations(feature, half.covariance));
  } else {
    o.set("covariance", nullptr).set("standard_deviations", nullptr);
  }
  return o;
}

std::vector<std::string> halfRow(const char* what, const HalfMean& half, Feature feature) {
  std::string sd;
  for (const TangentBlock& part : experiments::info(feature).tangent) {
    if (half.covariance.size() == 0) continue;
    const Eigen::VectorXd variances = half.covariance.diagonal().segment(part.begin, part.size);
    sd += fmt::format("{}{} {}", sd.empty() ? "" : ", ",
                      number(unitOf(part).scale * std::sqrt(variances.maxCoeff()), 3), unitOf(part).name);
  }
  return {what, fmt::format("{}", half.n), oneLine(half.mean), sd.empty() ? "none" : sd};
}

std::vector<std::vector<std::string>> halfRows(const FileSplit& split) {
  const SplitResult& result = split.result;
  return {halfRow("first half", result.first, split.feature), halfRow("second half", result.second, split.feature),
          halfRow("merged", result.merged, split.feature)};
}

}  // namespace

std::string adviceOf(const SplitOutcome& outcome) {
  const SplitSeries& blocks = outcome.by_blocks;
  const experiments::TrialsOfRun& run = experiments::trials_of_run;
  if (run.incomplete()) {
    std::string text = fmt::format("INTERRUPTED: {} of {} splits were done", run.done.load(), run.planned.load());
    if (blocks.distances.empty()) return text + ", none of them by blocks of time, from which the verdict comes.";
    return text +
           fmt::format(". Halves made of blocks of time differ by {} times the expected squared distance so far.",
                       number(blocks.factor(), 3));
  }
  if (outcome.passed()) {
    return fmt::format(
        "PASSED: halves made of blocks of time agree as well as their covariances say (factor {}, 95 %: {} to {}). "
        "Nothing speaks against independent errors.",
        number(blocks.factor(), 3), number(blocks.factorLow(), 3), number(blocks.factorHigh(), 3));
  }
  return fmt::format(
      "FAILED: halves made of blocks of time differ by {} times the expected squared distance{}. The errors of "
      "successive measurements are not independent: multiply the covariance of the mean by {} (95 %: {} to {}), its "
      "standard deviations by {}; by more if the errors hold on for longer than a block.",
      number(blocks.factor(), 3),
      outcome.random.pValue() < split_false_alarm ? "" : ", which halves at random do not show",
      number(blocks.factor(), 3), number(blocks.factorLow(), 3), number(blocks.factorHigh(), 3),
      number(std::sqrt(blocks.factor()), 3));
}

std::string splitVerdict(const SplitOutcome& outcome) {
  const SplitSeries& blocks = outcome.by_blocks;
  std::string text = seriesInWords("halves at random", outcome.random);
  text += seriesInWords(fmt::format("halves of {} blocks", outcome.settings.blocks).c_str(), blocks);
  const std::size_t failures = outcome.random.failures + blocks.failures;
  if (failures > 0) text += fmt::format("{} splits had no estimate and are left out.\n", failures);
  text += "\n";
  const bool random_fails = outcome.random.pValue() < split_false_alarm;
  if (random_fails) {
    text +=
        wrapped(fmt::format("Already at random the halves differ by {} times the expected squared distance: the "
                            "measurements scatter more than their covariances say.",
                            number(outcome.random.factor(), 3)));
  }
  return text + wrapped(adviceOf(outcome));
}

JsonObject splitEnvelope(const SplitOutcome& outcome, const std::string& command_line) {
  JsonObject o = jsonEnvelope(command_line, outcome.settings.seed);
  o.set("file", outcome.source).set("feature", name(outcome.feature)).set("dof", degreesOfFreedom(outcome.feature));
  o.set("known_noise", outcome.known_noise)
      .set("splits", outcome.settings.splits)
      .set("blocks", outcome.settings.blocks);
  o.set("random", toJson(outcome.random)).set("by_blocks", toJson(outcome.by_blocks));
  o.set("inflation", outcome.by_blocks.factor()).set("inflation_low", outcome.by_blocks.factorLow());
  o.set("inflation_high", outcome.by_blocks.factorHigh());
  o.set("false_alarm", split_false_alarm);
  return setVerdict(o, outcome.passed());
}

void plotSplits(Report& report, const SplitOutcome& outcome) {
  const auto panel = [&](const char* title, const SplitSeries& s) {
    double high = 0;
    for (const double d : s.distances) high = std::max(high, std::isfinite(d) ? d : 0);
    if (!(high > 0)) high = 1;
    Series boxes = histogram("splits", s.distances, 0, high, 30, true);
    Panel p{.title = title,
            .x = {.label = "squared distance of the halves", .low = 0.0},
            .y = {.label = "density", .low = 0.0},
            .series = {boxes}};
    p.references = {{.direction = ReferenceLine::Direction::vertical, .at = s.dof}};
    return p;
  };
  std::vector<Panel> panels = {panel("Halves at random", outcome.random)};
  if (!outcome.by_blocks.distances.empty()) panels.push_back(panel("Halves of blocks of time", outcome.by_blocks));
  report.plot({.name = "splits",
               .caption =
                   "Squared distances of the two halves' means under both covariances, over the splits; the line "
                   "is what is expected on average.",
               .panels = panels});
}

std::string formatSplit(const FileSplit& split) {
  std::string text = split.description + "\n";
  text += fmt::format("means by {}, covariances from {}\n\n", name(split.criterion),
                      split.known_noise ? "the measurements' own" : "the residuals");
  for (const auto& row : halfRows(split)) text += fmt::format("{:<12} {} (largest sd {})\n", row[0], row[2], row[3]);
  text += fmt::format("squared distance of both halves {} ({}, p = {})\n\n", number(split.result.squared_distance),
                      split.result.law, number(split.result.p_value, 2));
  text += splitVerdict(split);
  for (const std::string& note : split.notes) text += "note: " + note + "\n";
  return text;
}

JsonObject toJson(const FileSplit& split, const std::string& command_line) {
  const SplitResult& result = split.result;
  JsonObject object = splitEnvelope(split, command_line);
  object.set("n", result.n).set("criterion", name(split.criterion));
  if (split.covariance_at_matters) {
    object.set("covariance_at", split.covariance_at == CovarianceAt::measured ? "measured" : "estimated");
  } else {
    object.set("covariance_at", nullptr);
  }
  setCovarianceWords(object, split.feature);
  object.set("first", toJson(result.first, split.feature)).set("second", toJson(result.second, split.feature));
  object.set("merged", toJson(result.merged, split.feature));
  return object.set("squared_distance", result.squared_distance).set("law", result.law).set("p", result.p_value);
}

void writeSplitReport(const std::string& directory, const std::string& command_line, const FileSplit& split) {
  Report report(directory, "Split of the measurements in " + split.source);
  report.verdict(split.passed(), adviceOf(split));
  report.paragraph(split.description + ".");
  report.code(command_line);
  report.code(formatSplit(split));
  report.table({"", "n", "mean", "largest standard deviations"}, halfRows(split), "Halves in time, and both merged.");
  plotSplits(report, split);
  report.write();
}

}  // namespace liestat::cli
