#include <cli/show/two_view.hpp>

#include <formats/output_file.hpp>
#include <report/page.hpp>
#include <report/table.hpp>
#include <cli/show/units.hpp>

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace liestat::cli {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// Why a model was not chosen.
std::string rejectionOf(const TwoViewMotionEstimate& estimate, std::size_t m) {
  const TwoViewModelRow& row = estimate.lattice[m];
  if (!row.hasEstimate()) return row.draws > 0 ? "nothing found" : "not looked at";
  std::string verdict;
  if (row.rejection == Rejection::none) {
    verdict = m == estimate.chosen ? "- chosen" : "-";
  } else {
    verdict = fmt::format("{} of {}", name(row.rejection), row.rejected_by);
  }
  return row.unsupported && row.rejection == Rejection::none ? verdict + ", could be chance" : verdict;
}

TableRows latticeRows(const TwoViewMotionEstimate& estimate, ShownOn view) {
  using Row = TwoViewModelRow;
  const auto given = [](bool there, const auto& value) { return there ? std::optional(value) : std::nullopt; };
  return tableOf<Row>(
      {{"model", &Row::name},
       {"free", &Row::free_parameters},
       {"draws", [&](const Row& row) { return given(row.draws > 0, row.draws); }, ShownOn::page},
       {"inliers", [&](const Row& row) { return given(row.hasEstimate(), row.inliers); }},
       {"relevance", [&](const Row& row) { return given(row.hasEstimate(), row.relevance); }, fixed(3), ShownOn::page},
       {"rms px", [&](const Row& row) { return given(row.hasEstimate(), row.rms); }, 3},
       {"rejected by",
        [&](const Row& row) {
          return rejectionOf(estimate, static_cast<std::size_t>(&row - estimate.lattice.data()));
        }}},
      estimate.lattice, view);
}

/// A table and the line above it.
struct HeadedTable {
  std::string heading;
  TableRows table{{"parameter", "value", "sd", "unit"}};
};
void addParameters(TableRows& table, const PhysicalParameters& physical) {
  for (std::size_t i = 0; i < physical.size(); ++i) {
    const bool angle = physical.units[i] == "rad";
    const double unit = angle ? degrees : 1;
    table.rows.push_back({physical.names[i], number(unit * physical.values[static_cast<Eigen::Index>(i)], 5),
                          number(unit * physical.deviation(i), 2), angle ? "deg" : physical.units[i]});
  }
}
/// The parameters of a motion; the entries of its matrix, where they are all that is known.
std::vector<HeadedTable> parameterTables(const TwoViewMotionResult& e) {
  std::vector<HeadedTable> tables(e.physical.size());
  for (std::size_t k = 0; k < e.physical.size(); ++k) {
    const PhysicalParameters& physical = e.physical[k];
    if (e.physical.size() > 1) {
      tables[k].heading =
          k == 0 ? "of two poses that explain the plane, the one with more points in front of both cameras:\n"
                 : "the other one:\n";
    }
    addParameters(tables[k].table, physical);
  }
  if (!tables.empty() || e.matrix_covariance.rows() != 9) return tables;
  tables.resize(1);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const double variance = e.matrix_covariance(3 * j + i, 3 * j + i);
      tables[0].table.rows.push_back({fmt::format("{}{}{}", e.equations == 2 ? 'H' : 'F', i + 1, j + 1),
                                      number(e.matrix(i, j), 6), number(std::sqrt(variance), 2), "px, norm 1"});
    }
  }
  return tables;
}

/// The parameters of the motion; of a contested one those that all models of the set share, then each model's own.
std::vector<HeadedTable> parameterTables(const TwoViewMotionEstimate& e) {
  std::vector<HeadedTable> all;
  if (e.shared) {
    all.emplace_back().heading = "shared by all models of the set, with a covariance that covers each:\n";
    addParameters(all.back().table, *e.shared);
  }
  const auto add = [&](const TwoViewMotionResult& motion, const std::string& model) {
    for (HeadedTable& table : parameterTables(motion)) {
      if (!e.rivals.empty()) table.heading = "if it is " + model + ":\n" + table.heading;
      all.push_back(std::move(table));
    }
  };
  add(e, e.lattice.empty() ? "" : e.chosenModel().name);
  for (const TwoViewRival& rival : e.rivals) add(rival, rival.model);
  return all;
}

std::string summary(const std::string& file, const TwoViewImageFrame& frame) {
  std::string text = fmt::format("{} matches of {}, noise {:g} px, images of {:.6g} x {:.6g} px\n", frame.matches, file,
                                 frame.sigma, frame.image_size.x(), frame.image_size.y());
  if (frame.size_from_matches) text += "that size is the bounding box of the matches: --image-size says it better\n";
  if (frame.repeated > 0) text += fmt::format("{} repeat another one, which counts for them\n", frame.repeated);
  if (frame.contradicted > 0) {
    text += fmt::format("{} contradict each other (one point matched with two) and take no part\n", frame.contradicted);
  }
  if (!frame.calibrated) {
    text +=
        "without intrinsics: the principal point is taken to be the centre of the image,\n"
        "rotation and essential are left out\n";
  }
  return text;
}
std::string answer(const TwoViewMotionOutput& output) {
  const TwoViewMotionEstimate& e = output.estimate;
  if (e.lattice.empty()) return "no model\n";
  std::string text = fmt::format("{}: {} of {} matches agree", e.chosenModel().name, e.inliers, output.matches.size());
  if (e.chosenModel().hasEstimate()) text += fmt::format(", rms {} px", number(e.chosenModel().rms, 3));
  text += "\n";
  if (const Verdict verdict = e.verdict(); verdict.isNo()) text += verdict.text + "\n";
  if (e.relative_curvature.widens()) {
    text += fmt::format(
        "standard deviations are {} times those of first order: the model is curved on the scale of the "
        "noise\n",
        number(std::sqrt(e.relative_curvature.widening()), 2));
  }
  return text;
}
/// The cameras' focal lengths and distortions as the matches see them.
TableRows suspectRows(const TwoViewMotionEstimate& estimate) {
  using Test = TwoViewSuspectTest;
  const auto told = [](const Test& x, double value) { return x.tested() ? std::optional(value) : std::nullopt; };
  return tableOf<Test>({{"taken for known", &Test::name},
                        {"off by", [&](const Test& x) { return told(x, x.estimate); }, 3},
                        {"sd", [&](const Test& x) { return told(x, x.sigma); }, 2},
                        {"p", [&](const Test& x) { return told(x, x.p); }, 2},
                        {"0.01 moves the estimate by, sd", [&](const Test& x) { return told(x, 0.01 * x.shift); }, 2}},
                       estimate.suspects);
}
/// Each match as a line from its first to its second point.
void addMatch(Series& lines, Series& ends, const Eigen::Vector4d& m) {
  lines.add(m[0], m[1]), lines.add(m[2], m[3]), lines.add(nan, nan);
  ends.add(m[2], m[3]);
}
/// Some of the matches, in the frame of the image.
Panel matchPanel(const std::string& title, const std::vector<std::size_t>& chosen, std::size_t colour,
                 const std::vector<Eigen::Vector4d>& matches, const TwoViewImageFrame& frame) {
  Series lines{.style = Style::lines, .colour = colour}, ends{.style = Style::points, .colour = colour};
  for (const std::size_t i : chosen) addMatch(lines, ends, matches[i]);
  Panel panel{.title = title,
              .x = {.label = "x, px"},
              .y = {.label = "y, px"},  // points down
              .series = {lines, ends},
              .equal_aspect = true};
  const Eigen::Vector2d low = frame.image_corner, high = low + frame.image_size;
  panel.x.low = low.x(), panel.x.high = high.x();
  panel.y.low = high.y(), panel.y.high = low.y();
  return panel;
}
Plot matchPlot(const TwoViewMotionOutput& output) {
  Plot plot{.name = "matches",
            .caption =
                "Matches that agree with the chosen model, and the others: lines go from the point in the first "
                "image to the dot, the point in the second."};
  for (const bool inlier : {true, false}) {
    std::vector<std::size_t> chosen;
    for (std::size_t i = 0; i < output.matches.size(); ++i) {
      if (output.estimate.inlier[i] == inlier) chosen.push_back(i);
    }
    plot.panels.push_back(matchPanel(fmt::format("{} {}", chosen.size(), inlier ? "inliers" : "outliers"), chosen,
                                     inlier ? 0 : 1, output.matches, output.estimate));
  }
  return plot;
}
/// The models by their free parameters, with lines to the models that they contain.
Plot latticePlot(const TwoViewMotionEstimate& estimate) {
  std::map<std::string, Eigen::Vector2d> at;
  // Homographies on the left, epipolar geometries on the right; levels are staggered, so that lines do not run through the
  // names between them.
  std::map<std::pair<int, int>, int> on_level, seen;
  const auto level = [](const TwoViewModelRow& row) { return std::pair(row.equations, row.free_parameters); };
  for (const TwoViewModelRow& row : estimate.lattice) ++on_level[level(row)];
  for (const TwoViewModelRow& row : estimate.lattice) {
    const double k = seen[level(row)]++ - 0.5 * (on_level[level(row)] - 1);
    const double middle = (row.equations == 2 ? -0.75 : 0.95) + (row.free_parameters % 2 == 0 ? -0.2 : 0.2);
    at[row.name] = {middle + 1.25 * k, row.free_parameters};
  }
  Panel panel{{}, {.low = -1.9, .high = 1.9, .numbers = false}, {.label = "free parameters", .low = -0.6, .high = 8.9}};
  Series edges{.style = Style::lines, .colour = 6, .dashed = true};
  for (const TwoViewModelRow& row : estimate.lattice) {
    for (const std::string& parent : row.parents) {
      const auto p = at.find(parent);
      if (p == at.end()) continue;
      for (const Eigen::Vector2d& end : {at[row.name], p->second, Eigen::Vector2d(nan, nan)})
        edges.add(end.x(), end.y());
    }
  }
  panel.series.push_back(edges);
  Series chosen{.name = "chosen", .style = Style::stars, .colour = 2};
  Series rejected{.name = "rejected", .style = Style::points, .colour = 1};
  Series idle{.name = "not estimated", .style = Style::points, .colour = 5};
  Series others{.name = "not rejected", .style = Style::points, .colour = 0};
  std::vector<Series> labels;
  for (std::size_t m = 0; m < estimate.lattice.size(); ++m) {
    const TwoViewModelRow& row = estimate.lattice[m];
    Series& kind = m == estimate.chosen               ? chosen
                   : !row.hasEstimate()               ? idle
                   : row.rejection == Rejection::none ? others
                                                      : rejected;
    kind.add(at[row.name].x(), at[row.name].y());
    std::string text = row.name;
    if (row.hasEstimate()) text += fmt::format(": {} inliers, {} px", row.inliers, number(row.rms, 2));
    labels.push_back({.name = text, .style = Style::label, .x = {at[row.name].x()}, .y = {at[row.name].y() + 0.38}});
  }
  panel.add({chosen, rejected, others, idle});
  panel.series.insert(panel.series.end(), labels.begin(), labels.end());
  return {.name = "lattice",
          .caption =
              "The models, the number of their free parameters, the matches that agree with each and the noise "
              "that these show. A line leads down from a model to one that it contains.",
          .panels = {panel}};
}
Plot errorPlot(const TwoViewMotionOutput& output) {
  std::vector<double> errors;
  const double limit = std::sqrt(output.estimate.threshold) * output.estimate.sigma;
  for (const double e : output.estimate.errors) errors.push_back(output.estimate.sigma * std::sqrt(e));
  Panel panel{{}, {"error, px"}, {"matches"}};
  panel.series = {histogram("", errors, 0, 4 * limit, 40, false)};
  panel.references = {{ReferenceLine::Direction::vertical, limit}};
  return {.name = "errors",
          .caption =
              "Distances of the matches from the chosen model (in four dimensions, of both images). The dotted "
              "line is the threshold of inliers; larger errors than four times that are not shown.",
          .panels = {panel}};
}

}  // namespace

std::string formatTwoViewMotion(const TwoViewMotionOutput& output) {
  const TwoViewMotionEstimate& e = output.estimate;
  std::string text = summary(output.file, output.estimate) + "\n" + answer(output);
  for (const HeadedTable& t : parameterTables(e)) text += "\n" + t.heading + Table(t.table).str();
  if (e.focalLengthsOpen()) text += "the focal lengths are not determined: the optical axes meet, or noise decides\n";
  return text + "\n" + Table(latticeRows(e, ShownOn::terminal)).str();
}

void writeTwoViewMotionReport(const std::string& directory, const std::string& command_line,
                              const TwoViewMotionOutput& output) {
  const TwoViewMotionEstimate& e = output.estimate;
  Report report(directory, "The motion between two images");
  report.verdict(e.verdict().answer, answer(output));
  report.code(command_line);
  report.paragraph(summary(output.file, output.estimate));
  const std::vector<HeadedTable> parameters = parameterTables(e);
  if (!parameters.empty()) report.section("Parameters");
  for (const HeadedTable& t : parameters) report.table(t.table, t.heading);
  if (!e.suspects.empty()) {
    report.section("Cameras");
    report.table(suspectRows(e),
                 "By how much the matches ask for another focal length (relative) or another radial distortion. Where "
                 "nothing is given the motion itself explains all that it would do.");
  }
  report.section("Matches");
  report.plot(matchPlot(output));
  if (e.threshold > 0) report.plot(errorPlot(output));
  report.section("Models");
  report.plot(latticePlot(e));
  report.table(latticeRows(e, ShownOn::page),
               "The chosen model is the most specific one that no model which contains it rejects: by more support "
               "among matches that the specific one is far from, by a better fit to the common inliers, or, of fewer "
               "equations, by the cost of its inliers.");
  printLines("\n" + report.write() + "\n");
}

namespace {

TableRows structureRows(const TwoViewMotions& motions) {
  const std::vector<TwoViewStructure>& all = motions.structures;
  return tableOf<TwoViewStructure>({{"motion", [&](const TwoViewStructure& s) { return &s - all.data() + 1; }},
                                    {"model", &TwoViewStructure::model},
                                    {"matches", [](const TwoViewStructure& s) { return s.inliers.size(); }},
                                    {"rms px", &TwoViewStructure::rms, 3},
                                    {"status", [](const TwoViewStructure& s) { return name(s.status); }}},
                                   all);
}
std::string endOf(const TwoViewMotionsOutput& output) {
  std::string text = fmt::format("{} matches belong to none\n", output.motions.rest.size());
  if (const Verdict verdict = output.motions.verdict(); verdict.isNo()) text += verdict.text + "\n";
  return text;
}

}  // namespace

std::string formatTwoViewMotions(const TwoViewMotionsOutput& output) {
  std::string text =
      summary(output.file, output.motions) + "\n" + Table(structureRows(output.motions)).str() + endOf(output);
  for (std::size_t k = 0; k < output.motions.structures.size(); ++k) {
    const TwoViewStructure& s = output.motions.structures[k];
    text += fmt::format("\n{}: {}\n", k + 1, s.model);
    for (const HeadedTable& t : parameterTables(s)) text += t.heading + Table(t.table).str();
  }
  return text;
}

void writeTwoViewMotionsReport(const std::string& directory, const std::string& command_line,
                               const TwoViewMotionsOutput& output) {
  Report report(directory, "Motions between two images");
  report.code(command_line);
  report.paragraph(summary(output.file, output.motions));
  report.table(structureRows(output.motions), endOf(output));
  std::vector<std::pair<std::string, std::vector<std::size_t>>> groups;
  for (std::size_t k = 0; k < output.motions.structures.size(); ++k) {
    const TwoViewStructure& s = output.motions.structures[k];
    groups.emplace_back(fmt::format("{}: {}, {} matches", k + 1, s.model, s.inliers.size()), s.inliers);
  }
  groups.emplace_back(fmt::format("{} matches of none", output.motions.rest.size()), output.motions.rest);
  Plot plot{.name = "matches",
            .caption =
                "The matches of each motion, in the order in which they were found: lines go from the point in the "
                "first image to the dot, the point in the second."};
  for (std::size_t k = 0; k < groups.size(); ++k) {
    plot.panels.push_back(matchPanel(groups[k].first, groups[k].second, k, output.matches, output.motions));
  }
  report.plot(plot);
  for (std::size_t k = 0; k < output.motions.structures.size(); ++k) {
    const std::vector<HeadedTable> parameters = parameterTables(output.motions.structures[k]);
    if (!parameters.empty()) report.section(groups[k].first);
    for (const HeadedTable& t : parameters) report.table(t.table, t.heading);
  }
  printLines("\n" + report.write() + "\n");
}

std::string formatColmapPairs(const ColmapOutput& output) {
  constexpr std::size_t most = 40;
  std::string text = fmt::format(
      "{} pairs with matches of {}, noise {:g} px; pixels are COLMAP's, (0.5, 0.5) is the centre of the first\n\n",
      output.pairs.size(), output.database, output.sigma);
  struct Group {
    std::size_t pairs = 0, matches = 0, inliers = 0, edges = 0;
  };
  std::map<std::pair<std::string, std::string>, Group> groups;
  std::string refused;
  std::size_t n_refused = 0;
  for (const ColmapPair& p : output.pairs) {
    Group& g = groups[{p.isWritten() ? name(p.config) : "not written", p.isWritten() ? p.model : p.status}];
    ++g.pairs, g.matches += p.matches, g.inliers += p.inliers, g.edges += p.edge.has_value();
    if (p.isWritten() || ++n_refused > most) continue;
    refused += fmt::format("  {} - {}: {}{}\n", printable(p.first_name), printable(p.second_name), p.status,
                           p.reason.empty() ? "" : ": " + p.reason);
  }
  Table table({"configuration", "model", "pairs", "matches", "inliers", "edges"});
  for (const auto& [names, g] : groups) {
    table.row({names.first, names.second, cell(g.pairs), cell(g.matches), cell(g.inliers), cell(g.edges)});
  }
  text += table.str();
  if (!refused.empty()) text += "\nnot written, because they are not to be trusted:\n" + refused;
  if (n_refused > most) text += fmt::format("  and {} more (--json has all)\n", n_refused - most);
  for (const std::string& file : output.files)
    text += (&file == &output.files[0] ? "\nwritten: " : "written: ") + file + "\n";
  return text;
}

}  // namespace liestat::cli
