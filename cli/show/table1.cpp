#include <report/table.hpp>
#include <cli/show/validations.hpp>
#include <experiments/table1.hpp>

#include <fmt/format.h>

namespace liestat::cli {
using namespace experiments;
namespace {

std::string label(const Table1Row& row) {
  return row.corrections.empty() ? row.name : fmt::format("{} [{}]", row.name, row.corrections);
}

/// "1: 46, 2: 54": how many scenes had so many solutions.
std::string solutions(const Table1Row& row) {
  std::string text;
  const char* names[] = {"1", "2", "∞"};
  for (std::size_t k = 0; k < 3; ++k) {
    if (row.solutions[k] == 0) continue;
    text += fmt::format("{}{}: {}", text.empty() ? "" : ", ", names[k], row.solutions[k]);
  }
  return text;
}

std::string statuses(const Table1Row& row) {
  std::string text;
  for (const auto& [status, count] : row.statuses) {
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", name(status), count);
  }
  return text;
}

std::string null(const Table1Row& row) {
  if (row.noisy) return "";
  return row.null_right == row.scenes ? fmt::format("{}", row.null)
                                      : fmt::format("{} in {} of {}", row.null, row.null_right, row.scenes);
}

std::string verdict(const Table1Row& row) { return *row.passed ? "" : "FAIL"; }

std::string heading(const Table1Entry& entry) {
  return std::string(entry.cases) + (*entry.paper == '\0' ? "" : fmt::format("; paper: {}", entry.paper));
}

std::string table1Text(const std::vector<Table1Row>& rows) {
  std::string text =
      "Table 1 of A. Martinelli (2012) as it was recognised: number of solutions, case by case.\nn images, N features. "
      "With noise: a pixel of 1/450 rad, ADIS16448. Solutions: scenes that had\nso many, with all features in front of "
      "the camera. [a] and so on: see below.\n";
  const auto& entries = table1Entries();
  for (std::size_t e = 0; e < entries.size(); ++e) {
    for (const bool noisy : {false, true}) {
      const auto own = selected(rows, [&](const Table1Row& row) { return row.entry == e && row.noisy == noisy; });
      Columns<Table1Row> columns{{noisy ? "with noise" : "exact", label},
                                 {"solutions", solutions},
                                 {"recognised as", statuses},
                                 {"", verdict}};
      if (!noisy) columns.insert(columns.begin() + 1, {"null", null});
      if (!noisy) text += fmt::format("\n{}\n", heading(entries[e]));
      if (!own.empty()) text += Table(tableOf(columns, own)).str(110);
    }
  }
  text += "\n";
  for (const Table1Correction& c : table1Corrections()) {
    text += wrapped(fmt::format("[{}] {}{}", c.letter, c.corrects ? "correction: " : "", c.text), 96, 4);
  }
  return text;
}

/// The page: a table for each row of the paper's table, and the corrections.
void drawPage(Report& report, const std::vector<Table1Row>& rows) {
  const auto& entries = table1Entries();
  for (std::size_t e = 0; e < entries.size(); ++e) {
    report.section(heading(entries[e]));
    const Columns<Table1Row> columns{{"case", &Table1Row::name},
                                     {"data", [](const Table1Row& row) { return row.noisy ? "noise" : "exact"; }},
                                     {"n", &Table1Row::images},
                                     {"N", &Table1Row::features},
                                     {"paper", [&](const Table1Row&) { return entries[e].paper; }},
                                     {"null", null},
                                     {"solutions: scenes", solutions},
                                     {"recognised as", statuses},
                                     {"corrections", &Table1Row::corrections},
                                     {"verdict", [](const Table1Row& row) { return verdictCell(row.passed); }}};
    report.table(tableOf(columns, selected(rows, [&](const Table1Row& row) { return row.entry == e; })));
  }
  report.section("Corrections");
  std::vector<std::vector<std::string>> list;
  for (const Table1Correction& c : table1Corrections())
    list.push_back({std::string(1, c.letter), c.corrects ? "correction" : "addition", c.text});
  report.table({"letter", "", "what is true"}, list);
}

}  // namespace

ValidationView viewOf(const std::vector<Table1Row>& rows) {
  return {.title = "Closed form: the paper's table of cases as it is recognised",
          .introduction =
              "A. Martinelli's Table 1 (2012) says how many solutions there are, by motion, images n and features N. "
              "Here is what the closed form recognises in random scenes, with exact data and with a pixel of 1/450 rad "
              "and the noise of an ADIS16448. A solution counts if all features are in front of the camera. Letters "
              "are corrections of the paper and additions to it, below.",
          .judgement = judgementOf(rows),
          .fields = [&rows](JsonObject& object) { object("rows", rows); },
          .head = table1Text(rows),
          .page = [&rows](Report& report) { drawPage(report, rows); }};
}

}  // namespace liestat::cli
