#include <report/table.hpp>
#include <cli/show/validations.hpp>
#include <experiments/two_view_pairs.hpp>

#include <fmt/format.h>

#include <string>
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

Rows checkRows(const std::vector<Promise>& checks) {
  Rows rows;
  for (const Promise& check : checks) {
    rows.push_back(
        {check.text, number(check.value), check.passed ? number(check.bound) : "", verdictCell(check.passed)});
  }
  return rows;
}

}  // namespace

ValidationView viewOf(const TwoViewPairsResult& result) {
  ValidationView view{.title = "Two-view motion: what the hierarchy makes of real pairs",
                      .introduction = "",
                      .judgement = judgementOf(result),
                      .fields = [&result](JsonObject& object) { object.fieldsOf(result); }};
  for (const PairFamily family : {PairFamily::homogr, PairFamily::kusvod2}) {
    view.tables.push_back({.title = titleOf(family),
                           .headers = choice_headers,
                           .rows = choiceRows(result.choices, family),
                           .page_caption = choice_notes});
  }
  view.tables.push_back({.title = "adelaide-rmf: planes one after the other, against labels",
                         .headers = structure_headers,
                         .rows = structureRows(result.structures),
                         .page_title = "adelaide-rmf: planes one after the other",
                         .page_caption = structure_notes});
  view.tables.push_back({.title = "evd: a plane from far apart, few right matches",
                         .headers = plane_headers,
                         .rows = planeRows(result.planes),
                         .page_title = "evd: a plane from far apart",
                         .page_caption = plane_notes});
  view.tables.push_back({.headers = {"promise", "measured", "bound", "verdict"},
                         .rows = checkRows(result.checks),
                         .page_title = "Promises"});
  return view;
}

}  // namespace liestat::cli
