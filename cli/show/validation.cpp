#include <cli/show/validation.hpp>
#include <experiments/interruption.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <vector>

namespace liestat::cli {

using namespace experiments;

void setStatistics(JsonObject& o, const ValidationReport& r) {
  o.set("trials", r.trials).set("dof", r.dof).set("law", r.law.name());
  o.set("index", r.index).set("index_se", r.index_se).set("index_expected", r.law.mean()).set("variance", r.variance);
  o.set("ks_statistic", r.ks_statistic).set("ks_p", r.ks_p_value).set("coverage95", r.coverage[2].observed);
}

std::string verdictCell(const std::optional<bool>& passed) {
  if (!passed) return "";
  return *passed ? "pass" : "FAIL";
}

JsonObject& setVerdict(JsonObject& o, bool passed) {
  o.set("passed", passed && !trials_of_run.incomplete());
  return setInterrupted(o);
}

JsonObject& setInterrupted(JsonObject& o) {
  const TrialsOfRun& run = trials_of_run;
  if (!run.incomplete()) return o;
  return o.set("interrupted", true).set("trials_done", run.done.load()).set("trials_planned", run.planned.load());
}

bool endedBeforeTrials() {
  if (!trials_of_run.incomplete() || trials_of_run.done > 0) return false;
  std::fputs("liestat: interrupted before the first trial ended: there is nothing to write\n", stderr);
  return true;
}

std::string interruptedLines(const std::string& units, const std::string& so_far) {
  return fmt::format("partial: {} of {} {} were done{}\nINTERRUPTED\n", trials_of_run.done.load(),
                     trials_of_run.planned.load(), units, so_far);
}

std::string verdictLines(const Tally& tally, const std::string& where) {
  if (trials_of_run.incomplete()) {
    return interruptedLines(
        "trials", fmt::format(", and {} of {} rows {} pass so far", tally.judged - tally.failed, tally.judged, where));
  }
  if (tally.judged == 0) return fmt::format("no row is {}: nothing was judged\nFAILED\n", where);
  return fmt::format("{} of {} rows {} pass; false alarms: one in {:g} runs\n{}\n", tally.judged - tally.failed,
                     tally.judged, where, 1 / run_false_alarm, tally.passed() ? "PASSED" : "FAILED");
}

void showVerdict(Report& report, std::string_view text) {
  std::vector<std::string_view> lines;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    if (end > 0) lines.push_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  if (lines.size() < 2) return;
  // A run that was interrupted has no verdict.
  report.verdict(lines.back() == "PASSED"   ? Verdict::Answer::yes
                 : lines.back() == "FAILED" ? Verdict::Answer::no
                                            : Verdict::Answer::none,
                 fmt::format("{}: {}", lines.back(), lines[lines.size() - 2]));
}

Panel histogramPanel(const JudgedReport& row, const std::string& title) {
  Panel panel{.title = title,
              .x = {.label = "squared Mahalanobis distance", .low = 0.0},
              .y = {.label = "density", .low = 0.0}};
  Series boxes{.name = "trials", .style = Style::boxes}, density{.name = row.report.law.name(), .style = Style::lines};
  for (const HistogramBin& bin : row.histogram) {
    for (Series* series : {&boxes, &density}) series->x.push_back(0.5 * (bin.lower + bin.upper));
    boxes.y.push_back(bin.density);
    density.y.push_back(bin.expected);
  }
  panel.series = {boxes, density};
  return panel;
}

}  // namespace liestat::cli
