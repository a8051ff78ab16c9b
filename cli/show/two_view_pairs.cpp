#include <cli/show/two_view_pairs.hpp>

#include <report/page.hpp>
#include <report/table.hpp>
#include <cli/show/validation.hpp>
#include <experiments/interruption.hpp>

#include <fmt/format.h>

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

using Rows = std::vector<std::vector<std::string>>;

const std::vector<std::string> choice_headers{"pair", "kept/n", "chosen", "H", "F", "far", "new", "max", "plane", "px"};
const std::vector<std::string> structure_headers{"pair", "n",      "planes", "found",      "wrong",
                                                 "%",    "purity", "cover",  "first wrong"};
const std::vector<std::string> plane_headers{"pair", "n", "right", "found", "inliers", "of them right", "distance, px"};

std::string shortName(const std::string& model) {
  if (model == "retinal translation") return "rtrans";
  if (model == "retinal displacement") return "rdisp";
  return model.substr(0, 5) == "trans" ? "trans" : model.substr(0, 5);
}

Rows choiceRows(const std::vector<PairChoice>& choices, PairFamily family) {
  Rows rows;
  for (const PairChoice& row : choices) {
    if (row.family != family) continue;
    std::string chosen;
    for (const auto& [model, count] : row.chosen) {
      chosen += fmt::format("{}{} {}", chosen.empty() ? "" : ", ", shortName(model), count);
    }
    rows.push_back({row.name, fmt::format("{}/{}", row.kept, row.tentative), chosen, number(row.homography_inliers),
                    number(row.fundamental_inliers), number(row.far), number(row.explained), number(row.allowed),
                    fmt::format("{}", row.degenerate), fmt::format("{:.2f}", row.validation_error)});
  }
  return rows;
}
Rows structureRows(const std::vector<PairStructures>& structures) {
  Rows rows;
  for (const PairStructures& row : structures) {
    rows.push_back({row.name, fmt::format("{}", row.matches), fmt::format("{}", row.labelled), number(row.found),
                    number(row.wrong), fmt::format("{:.1f}", 100 * row.wrong / static_cast<double>(row.matches)),
                    fmt::format("{:.2f}", row.purity), fmt::format("{:.2f}", row.coverage),
                    row.labelled == 1 ? number(row.first_wrong) : ""});
  }
  return rows;
}
Rows planeRows(const std::vector<PairPlane>& planes) {
  Rows rows;
  for (const PairPlane& row : planes) {
    rows.push_back({row.name, fmt::format("{}", row.matches), fmt::format("{}", row.labelled),
                    fmt::format("{} of {}", row.supported, row.runs), number(row.inliers), number(row.right),
                    number(row.label_error, 3)});
  }
  return rows;
}

const char* titleOf(PairFamily family) {
  return family == PairFamily::homogr ? "homogr: a plane or a rotation; right is a homography"
                                      : "kusvod2: scenes in depth; right is a fundamental matrix";
}
constexpr const char* choice_notes =
    "kept: different tentative matches that no other one contradicts; chosen: models, and in how many runs. Medians "
    "over the "
    "runs: "
    "inliers of homography (H) and fundamental matrix (F); far: matches far from the homography; new: those of them "
    "that "
    "the fundamental matrix explains; max: so many chance and its freedom explain. plane: runs in which five of the "
    "seven "
    "matches that made the best fundamental matrix are on a plane (DEGENSAC's rule). px: distance of the validation "
    "points "
    "from the right model's estimate, median of medians.";
constexpr const char* structure_notes =
    "Labelled planes, homographies that were found one after the other, and with the best assignment of the found ones "
    "to the labels: wrong labels, share of inliers with the right label, share of labelled matches that were found; "
    "wrong labels of the first homography alone where there is one plane.";
constexpr const char* plane_notes =
    "Matches that are labelled right; runs that found a homography which chance does not explain; medians: its "
    "inliers, "
    "those that are right, and the distance of the right ones from it.";

std::string cellsAsTable(const std::vector<std::string>& headers, const Rows& rows) {
  Table table(headers);
  for (const auto& row : rows) table.row(row);
  return table.str();
}

}  // namespace

std::string formatTwoViewPairs(const TwoViewPairsResult& result) {
  std::string text;
  const auto add = [&](const char* title, const std::vector<std::string>& headers, const Rows& rows) {
    if (!rows.empty()) text += fmt::format("\n{}\n{}", title, cellsAsTable(headers, rows));
  };
  for (const PairFamily family : {PairFamily::homogr, PairFamily::kusvod2}) {
    add(titleOf(family), choice_headers, choiceRows(result.choices, family));
  }
  add("adelaide-rmf: planes one after the other, against labels", structure_headers, structureRows(result.structures));
  add("evd: a plane from far apart, few right matches", plane_headers, planeRows(result.planes));
  Table checks({"promise", "measured", "bound", "verdict"});
  for (const PairCheck& check : result.checks) {
    checks.row({check.text, number(check.value), check.passed ? number(check.bound) : "", verdictCell(check.passed)});
  }
  if (!result.checks.empty()) text += "\n" + checks.str();
  const Tally count = result.tally();
  if (trials_of_run.incomplete()) {
    return text + "\n" + verdictLines(count, "of promises");
  }
  return text + fmt::format("\n{} of {} promises are kept\n{}\n", count.judged - count.failed, count.judged,
                            count.judged == 0 ? "nothing was promised"
                            : count.passed()  ? "PASSED"
                                              : "FAILED");
}

JsonObject toJson(const TwoViewPairsResult& result, JsonObject envelope) {
  std::vector<JsonObject> choices, structures, planes, checks;
  for (const PairChoice& row : result.choices) {
    JsonObject chosen;
    for (const auto& [model, count] : row.chosen) chosen.set(model, count);
    choices.push_back(JsonObject()
                          .set("family", name(row.family))
                          .set("pair", row.name)
                          .set("tentative", row.tentative)
                          .set("kept", row.kept)
                          .set("runs", row.runs)
                          .set("right", row.right)
                          .set("chosen", chosen)
                          .set("homography_inliers", row.homography_inliers)
                          .set("fundamental_inliers", row.fundamental_inliers)
                          .set("far", row.far)
                          .set("explained", row.explained)
                          .set("explained_by_chance", row.allowed)
                          .set("homography_cost", row.homography_cost)
                          .set("fundamental_cost", row.fundamental_cost)
                          .set("degenerate_samples", row.degenerate)
                          .set("validation_error_px", row.validation_error));
  }
  for (const PairStructures& row : result.structures) {
    structures.push_back(JsonObject()
                             .set("pair", row.name)
                             .set("matches", row.matches)
                             .set("planes", row.labelled)
                             .set("found", row.found)
                             .set("wrong", row.wrong)
                             .set("purity", row.purity)
                             .set("coverage", row.coverage)
                             .set("first_wrong", row.first_wrong));
  }
  for (const PairPlane& row : result.planes) {
    planes.push_back(JsonObject()
                         .set("pair", row.name)
                         .set("matches", row.matches)
                         .set("right", row.labelled)
                         .set("runs", row.runs)
                         .set("runs_found", row.supported)
                         .set("inliers", row.inliers)
                         .set("inliers_right", row.right)
                         .set("distance_px", row.label_error));
  }
  for (const PairCheck& check : result.checks) {
    checks.push_back(JsonObject()
                         .set("promise", check.text)
                         .set("measured", check.value)
                         .set("bound", check.bound)
                         .set("passed", check.passed));
  }
  return envelope.set("choices", choices).set("structures", structures).set("planes", planes).set("checks", checks);
}

void writeTwoViewPairsReport(const std::string& directory, const std::string& command_line,
                             const TwoViewPairsResult& result) {
  Report report(directory, "Two-view motion: what the hierarchy makes of real pairs");
  if (result.tally().judged > 0) showVerdict(report, formatTwoViewPairs(result));
  report.code(command_line);
  const auto add = [&](const char* title, const std::vector<std::string>& headers, const Rows& rows,
                       const char* notes) {
    if (rows.empty()) return;
    report.section(title);
    report.table(headers, rows, notes);
  };
  for (const PairFamily family : {PairFamily::homogr, PairFamily::kusvod2}) {
    add(titleOf(family), choice_headers, choiceRows(result.choices, family), choice_notes);
  }
  add("adelaide-rmf: planes one after the other", structure_headers, structureRows(result.structures), structure_notes);
  add("evd: a plane from far apart", plane_headers, planeRows(result.planes), plane_notes);
  if (!result.checks.empty()) {
    report.section("Promises");
    Rows rows;
    for (const PairCheck& check : result.checks) {
      rows.push_back(
          {check.text, number(check.value), check.passed ? number(check.bound) : "", verdictCell(check.passed)});
    }
    report.table({"promise", "measured", "bound", "verdict"}, rows);
  }
  report.write();
}

}  // namespace liestat::cli
