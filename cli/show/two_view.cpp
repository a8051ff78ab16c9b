#include <cli/show/two_view.hpp>

#include <cli/io/output_file.hpp>
#include <cli/show/page.hpp>
#include <cli/show/table.hpp>
#include <cli/show/units.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace liestat::cli {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// True if the row's model has an estimate.
bool hasEstimate(const TwoViewModelRow& row) { return row.status != Status::too_few; }

std::string verdictOf(const TwoViewMotionEstimate& estimate, std::size_t m) {
  const TwoViewModelRow& row = estimate.lattice[m];
  if (!hasEstimate(row)) return row.draws > 0 ? "nothing found" : "not looked at";
  std::string verdict;
  if (row.rejection == Rejection::none) {
    verdict = m == estimate.chosen ? "- chosen" : "-";
  } else {
    verdict = fmt::format("{} of {}", name(row.rejection), row.rejected_by);
  }
  return row.unsupported && row.rejection == Rejection::none ? verdict + ", could be chance" : verdict;
}

const std::vector<std::string> lattice_headers{"model",     "free",   "draws",      "inliers",
                                               "relevance", "rms px", "rejected by"};
std::vector<std::vector<std::string>> latticeRows(const TwoViewMotionEstimate& estimate) {
  std::vector<std::vector<std::string>> rows;
  for (std::size_t m = 0; m < estimate.lattice.size(); ++m) {
    const TwoViewModelRow& row = estimate.lattice[m];
    const bool found = hasEstimate(row);
    rows.push_back({row.name, fmt::format("{}", row.free_parameters), row.draws > 0 ? fmt::format("{}", row.draws) : "",
                    found ? fmt::format("{}", row.inliers) : "", found ? fmt::format("{:.3f}", row.relevance) : "",
                    found ? number(row.rms, 3) : "", verdictOf(estimate, m)});
  }
  return rows;
}
/// The same for the terminal, which is narrower.
std::string latticeTable(const TwoViewMotionEstimate& estimate) {
  constexpr std::size_t draws = 2, relevance = 4;
  const auto narrow = [](std::vector<std::string> cells) {
    cells.erase(cells.begin() + relevance), cells.erase(cells.begin() + draws);
    return cells;
  };
  Table table(narrow(lattice_headers));
  for (const auto& row : latticeRows(estimate)) table.row(narrow(row));
  return table.str();
}

/// The entries of the matrix, where they are all that is known.
std::vector<std::vector<std::string>> matrixRows(const TwoViewMotionResult& e, bool homography) {
  std::vector<std::vector<std::string>> rows;
  if (e.matrix_covariance.rows() != 9) return rows;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const double variance = e.matrix_covariance(3 * j + i, 3 * j + i);
      rows.push_back({fmt::format("{}{}{}", homography ? 'H' : 'F', i + 1, j + 1), number(e.matrix(i, j), 6),
                      number(std::sqrt(variance), 2), "px, norm 1"});
    }
  }
  return rows;
}

const std::vector<std::string> parameter_headers{"parameter", "value", "sd", "unit"};
std::vector<std::vector<std::string>> parameterRows(const PhysicalParameters& physical) {
  std::vector<std::vector<std::string>> rows;
  for (std::size_t i = 0; i < physical.size(); ++i) {
    const bool angle = physical.units[i] == "rad";
    const double unit = angle ? degrees : 1;
    rows.push_back({physical.names[i], number(unit * physical.values[static_cast<Eigen::Index>(i)], 5),
                    number(unit * physical.deviation(i), 2), angle ? "deg" : physical.units[i]});
  }
  return rows;
}

std::string summary(const std::string& file, std::size_t matches, double sigma, const TwoViewImageFrame& frame) {
  std::string text = fmt::format("{} matches of {}, noise {:g} px, images of {:.6g} x {:.6g} px\n", matches, file,
                                 sigma, frame.image_size.x(), frame.image_size.y());
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
std::string summary(const TwoViewMotionOutput& output) {
  return summary(output.file, output.matches.size(), output.sigma, output.estimate);
}
std::string answer(const TwoViewMotionOutput& output) {
  const TwoViewMotionEstimate& e = output.estimate;
  if (e.lattice.empty()) return "no model\n";
  std::string text = fmt::format("{}: {} of {} matches agree", e.chosenModel().name, e.inliers, output.matches.size());
  if (hasEstimate(e.chosenModel())) text += fmt::format(", rms {} px", number(e.chosenModel().rms, 3));
  text += "\n";
  if (!e.ok()) text += fmt::format("NOT TO BE TRUSTED ({}): {}\n", name(e.status), e.reason);
  return text;
}
/// The line above a table of physical parameters where there are two tables.
std::string headingOf(const TwoViewMotionResult& e, std::size_t i) {
  if (e.physical.size() < 2) return "";
  return i == 0 ? "of two poses that explain the plane, the one with more points in front of both cameras:\n"
                : "the other one:\n";
}

JsonObject toJson(const PhysicalParameters& physical) {
  JsonObject o;
  std::vector<double> values(physical.values.begin(), physical.values.end()), deviations;
  for (std::size_t i = 0; i < physical.size(); ++i) deviations.push_back(physical.deviation(i));
  return o.set("names", physical.names)
      .set("units", physical.units)
      .set("values", values)
      .set("deviations", deviations)
      .set("covariance", physical.covariance);
}
/// The fields of a motion.
void setMotion(JsonObject& object, const TwoViewMotionResult& motion, bool homography) {
  object.set("matrix", motion.matrix);
  object.set("matrix_acts_on", homography ? "second ~ matrix * first, pixels" : "second' * matrix * first = 0, pixels");
  if (motion.matrix_covariance.rows() == 9) {
    object.set("matrix_covariance", motion.matrix_covariance);
  } else {
    object.set("matrix_covariance", nullptr);
  }
  std::vector<JsonObject> physical;
  for (const PhysicalParameters& p : motion.physical) physical.push_back(toJson(p));
  object.set("parameters", physical);
  if (motion.relative_pose) {
    const Essentiald& mean = motion.relative_pose->mean;
    JsonObject pose;
    pose.set("quaternion_xyzw", Eigen::Vector4d(mean.so3().params()));
    pose.set("direction", Eigen::Vector3d(mean.direction().unit_vector()));
    pose.set("covariance", motion.relative_pose->covariance);
    pose.set("covariance_order", "direction (2), rotation (3), rad, axes across and along the direction");
    object.set("second_T_first", pose);
  } else {
    object.set("second_T_first", nullptr);
  }
}
JsonObject toJson(const TwoViewMotionEstimate& estimate, std::size_t m) {
  const TwoViewModelRow& row = estimate.lattice[m];
  JsonObject o;
  o.set("model", row.name).set("parents", row.parents).set("free_parameters", row.free_parameters);
  o.set("equations", row.equations).set("evaluated", row.evaluated).set("draws", row.draws);
  if (!hasEstimate(row)) return o.set("status", nullptr);
  o.set("status", name(row.status)).set("inliers", row.inliers).set("relevance", row.relevance);
  o.set("chi2", row.chi2).set("degrees_of_freedom", row.degrees_of_freedom).set("rms", row.rms);
  o.set("unsupported", row.unsupported).set("rejection", name(row.rejection));
  return row.rejected_by.empty() ? o.set("rejected_by", nullptr) : o.set("rejected_by", row.rejected_by);
}

/// Each match as a line from its first to its second point.
void addMatch(Series& lines, Series& ends, const Eigen::Vector4d& m) {
  lines.x.insert(lines.x.end(), {m[0], m[2], nan});
  lines.y.insert(lines.y.end(), {m[1], m[3], nan});
  ends.x.push_back(m[2]), ends.y.push_back(m[3]);
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
  Panel panel{.x = {.low = -1.9, .high = 1.9, .numbers = false},
              .y = {.label = "free parameters", .low = -0.6, .high = 8.9}};
  Series edges{.style = Style::lines, .colour = 6, .dashed = true};
  for (const TwoViewModelRow& row : estimate.lattice) {
    for (const std::string& parent : row.parents) {
      const auto p = at.find(parent);
      if (p == at.end()) continue;
      edges.x.insert(edges.x.end(), {at[row.name].x(), p->second.x(), nan});
      edges.y.insert(edges.y.end(), {at[row.name].y(), p->second.y(), nan});
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
                   : !hasEstimate(row)                ? idle
                   : row.rejection == Rejection::none ? others
                                                      : rejected;
    kind.x.push_back(at[row.name].x()), kind.y.push_back(at[row.name].y());
    std::string text = row.name;
    if (hasEstimate(row)) text += fmt::format(": {} inliers, {} px", row.inliers, number(row.rms, 2));
    labels.push_back({.name = text, .style = Style::label, .x = {at[row.name].x()}, .y = {at[row.name].y() + 0.38}});
  }
  for (const Series& kind : {chosen, rejected, others, idle}) {
    if (!kind.x.empty()) panel.series.push_back(kind);
  }
  panel.series.insert(panel.series.end(), labels.begin(), labels.end());
  return {.name = "lattice",
          .caption =
              "The models, the number of their free parameters, the matches that agree with each and the noise "
              "that these show. A line leads down from a model to one that it contains.",
          .panels = {panel}};
}
Plot errorPlot(const TwoViewMotionOutput& output) {
  std::vector<double> errors;
  const double limit = std::sqrt(output.estimate.threshold) * output.sigma;
  for (const double e : output.estimate.errors) errors.push_back(output.sigma * std::sqrt(e));
  Panel panel{.x = {.label = "error, px"},
              .y = {.label = "matches"},
              .series = {histogram("", errors, 0, 4 * limit, 40, false)},
              .references = {{ReferenceLine::Direction::vertical, limit}}};
  return {.name = "errors",
          .caption =
              "Distances of the matches from the chosen model (in four dimensions, of both images). The dotted "
              "line is the threshold of inliers; larger errors than four times that are not shown.",
          .panels = {panel}};
}

}  // namespace

std::string formatTwoViewMotion(const TwoViewMotionOutput& output) {
  const TwoViewMotionEstimate& e = output.estimate;
  std::string text = summary(output) + "\n" + answer(output);
  for (std::size_t i = 0; i < e.physical.size(); ++i) {
    Table table(parameter_headers);
    for (const auto& row : parameterRows(e.physical[i])) table.row(row);
    text += "\n" + headingOf(e, i) + table.str();
  }
  if (e.physical.empty() && e.matrix_covariance.rows() == 9) {
    Table table(parameter_headers);
    for (const auto& row : matrixRows(e, e.chosenModel().equations == 2)) table.row(row);
    text += "\n" + table.str();
    if (e.chosenModel().name == "fundamental") {
      text += "the focal lengths are not determined: the optical axes meet, or noise decides\n";
    }
  }
  return text + "\n" + latticeTable(e);
}

void setTwoViewMotion(JsonObject& object, const TwoViewMotionOutput& output) {
  const TwoViewMotionEstimate& e = output.estimate;
  object.set("file", output.file).set("matches", output.matches.size()).set("sigma", output.sigma);
  object.set("calibrated", e.calibrated).set("image_corner", e.image_corner).set("image_size", e.image_size);
  object.set("size_from_matches", e.size_from_matches);
  object.set("repeated", e.repeated).set("contradicted", e.contradicted);
  object.set("status", name(e.status));
  if (e.reason.empty()) {
    object.set("reason", nullptr);
  } else {
    object.set("reason", e.reason);
  }
  object.set("model", e.chosenModel().name).set("inliers", e.inliers);
  setMotion(object, e, e.chosenModel().equations == 2);
  std::vector<JsonObject> lattice;
  for (std::size_t m = 0; m < e.lattice.size(); ++m) lattice.push_back(toJson(e, m));
  object.set("lattice", lattice);
  std::vector<double> inlier, errors;
  for (std::size_t i = 0; i < e.inlier.size(); ++i) inlier.push_back(e.inlier[i] ? 1 : 0);
  object.set("inlier", inlier).set("squared_errors", e.errors);
}

void writeTwoViewMotionReport(const std::string& directory, const std::string& command_line,
                              const TwoViewMotionOutput& output) {
  const TwoViewMotionEstimate& e = output.estimate;
  Report report(directory, "The motion between two images");
  report.verdict(e.ok(), answer(output));
  report.code(command_line);
  report.paragraph(summary(output));
  if (!e.physical.empty()) report.section("Parameters");
  for (std::size_t i = 0; i < e.physical.size(); ++i) {
    report.table(parameter_headers, parameterRows(e.physical[i]), headingOf(e, i));
  }
  if (e.physical.empty() && e.matrix_covariance.rows() == 9) {
    report.section("Parameters");
    report.table(parameter_headers, matrixRows(e, e.chosenModel().equations == 2));
  }
  report.section("Matches");
  report.plot(matchPlot(output));
  if (e.threshold > 0) report.plot(errorPlot(output));
  report.section("Models");
  report.plot(latticePlot(e));
  report.table(lattice_headers, latticeRows(e),
               "The chosen model is the most specific one that no model which contains it rejects: by more support "
               "among matches that the specific one is far from, or by a better fit to the common inliers.");
  printLines("\n" + report.write() + "\n");
}

namespace {

const std::vector<std::string> structure_headers{"motion", "model", "matches", "rms px"};
std::vector<std::vector<std::string>> structureRows(const TwoViewMotions& motions) {
  std::vector<std::vector<std::string>> rows;
  for (std::size_t k = 0; k < motions.structures.size(); ++k) {
    const TwoViewStructure& s = motions.structures[k];
    rows.push_back({fmt::format("{}", k + 1), s.model, fmt::format("{}", s.inliers.size()), number(s.rms, 3)});
  }
  return rows;
}
std::string endOf(const TwoViewMotionsOutput& output) {
  std::string text = fmt::format("{} matches belong to none\n", output.motions.rest.size());
  if (output.motions.status != Status::ok) {
    text += fmt::format("NOT TO BE TRUSTED ({}): {}\n", name(output.motions.status), output.motions.reason);
  } else if (output.motions.structures.empty()) {
    text += "NOT TO BE TRUSTED: no model is supported, inliers could be chance\n";
  }
  return text;
}
/// The parameters of a motion, or its matrix.
std::vector<std::vector<std::string>> rowsOf(const TwoViewStructure& structure, std::size_t i) {
  return structure.physical.empty() ? matrixRows(structure, structure.equations == 2)
                                    : parameterRows(structure.physical[i]);
}
std::size_t tablesOf(const TwoViewStructure& structure) {
  if (!structure.physical.empty()) return structure.physical.size();
  return structure.matrix_covariance.rows() == 9 ? 1 : 0;
}

}  // namespace

std::string formatTwoViewMotions(const TwoViewMotionsOutput& output) {
  Table table(structure_headers);
  for (const auto& row : structureRows(output.motions)) table.row(row);
  std::string text =
      summary(output.file, output.matches.size(), output.sigma, output.motions) + "\n" + table.str() + endOf(output);
  for (std::size_t k = 0; k < output.motions.structures.size(); ++k) {
    const TwoViewStructure& s = output.motions.structures[k];
    text += fmt::format("\n{}: {}\n", k + 1, s.model);
    for (std::size_t i = 0; i < tablesOf(s); ++i) {
      Table parameters(parameter_headers);
      for (const auto& row : rowsOf(s, i)) parameters.row(row);
      text += headingOf(s, i) + parameters.str();
    }
  }
  return text;
}

void setTwoViewMotions(JsonObject& object, const TwoViewMotionsOutput& output) {
  const TwoViewMotions& m = output.motions;
  object.set("file", output.file).set("matches", output.matches.size()).set("sigma", output.sigma);
  object.set("calibrated", m.calibrated).set("image_corner", m.image_corner).set("image_size", m.image_size);
  object.set("size_from_matches", m.size_from_matches);
  object.set("repeated", m.repeated).set("contradicted", m.contradicted);
  object.set("status", name(m.status));
  if (m.reason.empty()) {
    object.set("reason", nullptr);
  } else {
    object.set("reason", m.reason);
  }
  std::vector<double> motion(output.matches.size(), 0);  // of each match: the number of its motion, 0 for none
  std::vector<JsonObject> list;
  for (std::size_t k = 0; k < m.structures.size(); ++k) {
    const TwoViewStructure& s = m.structures[k];
    JsonObject o;
    o.set("model", s.model).set("status", name(s.status)).set("inliers", s.inliers.size()).set("rms", s.rms);
    setMotion(o, s, s.equations == 2);
    list.push_back(o);
    for (const std::size_t i : s.inliers) motion[i] = static_cast<double>(k + 1);
  }
  object.set("motions", list).set("motion", motion);
}

void writeTwoViewMotionsReport(const std::string& directory, const std::string& command_line,
                               const TwoViewMotionsOutput& output) {
  Report report(directory, "Motions between two images");
  report.code(command_line);
  report.paragraph(summary(output.file, output.matches.size(), output.sigma, output.motions));
  report.table(structure_headers, structureRows(output.motions), endOf(output));
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
    const TwoViewStructure& s = output.motions.structures[k];
    if (tablesOf(s) > 0) report.section(groups[k].first);
    for (std::size_t i = 0; i < tablesOf(s); ++i) report.table(parameter_headers, rowsOf(s, i), headingOf(s, i));
  }
  printLines("\n" + report.write() + "\n");
}

}  // namespace liestat::cli
