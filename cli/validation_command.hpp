#pragma once

// What the commands `validate means`, `validate propagation` and the like have in common: lists of names on the command
// line, a progress bar, rows in JSON, the exit code.

#include <cli/commands.hpp>
#include <cli/json_output.hpp>
#include <cli/progress.hpp>
#include <stats/validation.hpp>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace liestat::cli {

/// The names of all members of a list of enumerators.
template <class List>
std::vector<std::string> names(const List& list) {
  std::vector<std::string> all;
  for (const auto value : list) all.push_back(name(value));
  return all;
}

/// The enumerators with the given names, each once and in their own order; all of them for none. CLI11 has checked the
/// names.
template <class List>
auto chosen(const List& list, const std::vector<std::string>& wanted) {
  std::vector<typename List::value_type> values;
  for (const auto value : list) {
    if (wanted.empty() || std::find(wanted.begin(), wanted.end(), name(value)) != wanted.end()) values.push_back(value);
  }
  return values;
}

/// What run(progress) returns, with a bar on the terminal while it runs; progress(done, all) takes amounts of work.
template <class Run>
auto withProgressBar(const std::string& label, const Run& run) {
  // The bar counts in thousandths, as the amount of work is known only inside.
  Progress bar(label, 1000);
  const std::function<void(std::uint64_t, std::uint64_t)> progress = [&bar](std::uint64_t done, std::uint64_t all) {
    const std::uint64_t now = all == 0 ? 1000 : 1000 * done / all;
    if (now > bar.done()) bar.advance(now - bar.done());
  };
  return run(progress);
}

/// The fields of a row that are the same in every validation.
inline void setStatistics(JsonObject& o, const ValidationReport& r) {
  o.set("trials", r.trials).set("dof", r.dof).set("law", r.law.name());
  o.set("index", r.index).set("index_se", r.index_se).set("index_expected", r.law.mean()).set("variance", r.variance);
  o.set("ks_statistic", r.ks_statistic).set("ks_p", r.ks_p_value).set("coverage95", r.coverage[2].observed);
}

/// Writes rows, each by toJson(row), to a JSON file; nothing for an empty path.
template <class Row, class ToJson>
void writeRows(const std::string& path, const Invocation& invocation, std::uint64_t seed, double false_alarm,
               const std::vector<Row>& rows, const ToJson& toJson) {
  if (path.empty()) return;
  JsonObject object = jsonEnvelope(invocation.command_line, seed);
  std::vector<JsonObject> list;
  for (const Row& row : rows) list.push_back(toJson(row));
  object.set("false_alarm", false_alarm).set("rows", list);
  writeJson(path, object);
}

/// The exit code of rows of which some were judged.
template <class Row>
int exitCodeOf(const std::vector<Row>& rows) {
  const bool passed = std::all_of(rows.begin(), rows.end(), [](const Row& row) { return row.passed.value_or(true); });
  return passed ? exit_fine : exit_validation_failed;
}

}  // namespace liestat::cli
