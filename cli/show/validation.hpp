#pragma once

// The parts that the views of the validations share.

#include <report/json.hpp>
#include <report/page.hpp>
#include <experiments/judged_report.hpp>

#include <optional>
#include <string>
#include <string_view>

namespace liestat::cli {

/// The fields of a row in JSON that are the same in every validation.
void setStatistics(JsonObject& o, const ValidationReport& report);

/// The verdict in JSON: `passed`, which is false after an interrupt, and then the fields of setInterrupted().
JsonObject& setVerdict(JsonObject& o, bool passed);

/// After an interrupt `interrupted` (true) with the numbers of trials, `trials_done` and `trials_planned`; else nothing.
JsonObject& setInterrupted(JsonObject& o);

/// Says so where an interrupt came before any trial ended, so that there is nothing to show.
bool endedBeforeTrials();

/// A cell of a table: pass, FAIL, or empty where nothing was judged.
std::string verdictCell(const std::optional<bool>& passed);

/// The last lines on the terminal: how many of the judged rows pass, where they are (`in the promised domain`), and
/// PASSED or FAILED, which a run without a judged row has too, or INTERRUPTED after how many trials.
std::string verdictLines(const experiments::Tally& tally, const std::string& where);

/// The last lines of a run in which an interrupt left trials undone: how many `units` (trials, splits) were done, what they
/// say `so far`, and INTERRUPTED.
std::string interruptedLines(const std::string& units, const std::string& so_far);

/// The same verdict on the page: `text` is what the terminal shows, which ends with verdictLines().
void showVerdict(Report& report, std::string_view text);

/// Histogram of the squared distances with the density that they should have.
Panel histogramPanel(const experiments::JudgedReport& row, const std::string& title);

}  // namespace liestat::cli
