#include <cli/show/hand_eye.hpp>

#include <formats/output_file.hpp>
#include <formats/text.hpp>
#include <report/page.hpp>
#include <report/table.hpp>
#include <cli/show/units.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace liestat::cli {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

std::string fixed(double value) {
  const std::string text = std::isfinite(value) ? fmt::format("{:.5f}", value) : "n/a";
  return text == "-0.00000" ? "0.00000" : text;
}

TableRows poseRows(const CalibratedPose& unknown, const std::string& heading = "") {
  const Vector6 sigma = unknown.sigmas;
  const Eigen::Vector3d t = unknown.pose.mean.translation(), r = degrees * unknown.pose.mean.so3().log();
  const auto row = [](const std::string& title, const auto& v, const char* unit, auto&& cell) {
    return std::vector<std::string>{title, cell(v[0]), cell(v[1]), cell(v[2]), unit};
  };
  const bool none = !unknown.has_covariance && !unknown.rotation_is_open;
  const auto sigmas = [none](double x) {
    return std::isfinite(x) ? fmt::format("{:.2g}", x) : std::string(none ? "n/a" : "open");
  };
  return {{heading, "x", "y", "z", "unit"},
          {row("translation", t, "m", fixed), row("  sd", Eigen::Vector3d(sigma.head<3>()), "m", sigmas),
           row("rotation vector", r, "deg", fixed),
           row("  sd", Eigen::Vector3d(degrees * sigma.tail<3>()), "deg", sigmas)}};
}
std::string quaternionOf(const SE3d& pose) {
  Eigen::Vector4d q = pose.so3().params();
  if (q[3] < 0) q = -q;
  return fmt::format("quaternion x y z w: {:.8f} {:.8f} {:.8f} {:.8f}", q[0] + 0.0, q[1] + 0.0, q[2] + 0.0, q[3] + 0.0);
}

std::string noiseOf(const HandEyeFile& file) {
  switch (file.noise) {
    case PoseNoise::columns:
      return "covariances of the file";
    case PoseNoise::option:
      if (file.sigma.isZero(0)) return "exact";
      break;
    case PoseNoise::assumed:
      break;
  }
  const Eigen::Vector3d t = file.sigma.head<3>(), r = degrees * file.sigma.tail<3>();
  const auto equal = [](const Eigen::Vector3d& v) { return v[0] == v[1] && v[1] == v[2]; };
  const auto text = [&](const Eigen::Vector3d& v) {
    return equal(v) ? fmt::format("{:g}", v[0]) : fmt::format("({:g}, {:g}, {:g})", v[0], v[1], v[2]);
  };
  return fmt::format("sigma {} deg, {} m{}", text(r), text(t), file.noise == PoseNoise::assumed ? " (assumed)" : "");
}
std::string fileInWords(const HandEyeOutput& output, bool is_a) {
  const HandEyeFile& file = is_a ? output.a : output.b;
  const bool world = output.result.world;
  std::string pose = is_a ? "motions of the gripper" : "motions of the camera";
  if (world) pose = is_a ? "base_T_gripper" : "target_T_camera";
  return fmt::format("{}: {}{}, {}; {}", is_a ? "A" : "B", file.path, file.inverted ? " inverted" : "", pose,
                     noiseOf(file));
}
std::string summary(const HandEyeOutput& output) {
  std::string text = output.result.world ? "A X = Y B: absolute poses\n" : "A X = X B: independent motions\n";
  text += fileInWords(output, true) + "\n" + fileInWords(output, false) + "\n";
  if (output.by_time) {
    text += fmt::format("{} pairs by time, at most {:.3g} s apart (tolerance {:g} s)", output.rows.size(),
                        output.largest_gap, output.tolerance);
    if (output.a.unmatched + output.b.unmatched > 0) {
      text += fmt::format("; without a partner: {} of {} rows of A, {} of {} of B", output.a.unmatched, output.a.rows,
                          output.b.unmatched, output.b.rows);
    }
    text += "\n";
  } else {
    text += fmt::format("{} pairs by row\n", output.rows.size());
  }
  for (const std::string& note : output.notes) text += note + "\n";
  if (const auto& x = output.result.interpolation) {
    text += fmt::format("A interpolated at the times of B, rms error {:.2g} m, {:.2g} deg", x->translation,
                        x->rotation * degrees);
    if (x->in_gaps > 0) text += fmt::format("; {} pairs lie in gaps of A and keep the nearest row", x->in_gaps);
    text += "\n";
  }
  return text;
}
std::string fitInWords(const HandEyeOutput& output) {
  const HandEyeResult& r = output.result;
  std::string text = fmt::format("{} of {} pairs used", r.pairs.size() - r.outliers.size(), r.pairs.size());
  text += fmt::format("; chi2/dof {} ({} degrees of freedom", number(r.chi2 / r.degrees_of_freedom, 3),
                      r.degrees_of_freedom);
  if (output.options.known_noise) text += fmt::format(", p {}", number(r.p, 2));
  text += fmt::format("); {} starts\n", r.starts);
  if (r.dependence.tested || r.dependence.unequal_axes) text += r.dependence.inWords() + "\n";
  for (const HandEyeSuspectTest& x : r.suspects) {
    if (!(x.prior_sigma > 0)) continue;
    text += fmt::format("{} {} +- {}{}\n", x.name, number(x.value, 4), number(x.value_sigma, 2),
                        x.unit.empty() ? "" : " " + x.unit);
  }
  if (!output.options.known_noise) {
    text += fmt::format(
        "the noise is not known: the covariances are scaled by chi2/dof = {}, and the residuals are no\n"
        "test of them (--sigma-a and --sigma-b, or columns cov_00 ... of both files, make them one)\n",
        number(r.variance_factor, 3));
  }
  return text;
}
std::string rowInWords(const PoseRows& rows) {
  std::string text =
      rows.a == rows.b ? fmt::format("row {}", rows.a + 1) : fmt::format("rows {} and {}", rows.a + 1, rows.b + 1);
  text += rows.line_a == rows.line_b ? fmt::format(" (line {}", rows.line_a)
                                     : fmt::format(" (lines {} and {}", rows.line_a, rows.line_b);
  if (rows.time) text += fmt::format(", {:.10g} s", *rows.time);
  return text + ")";
}
std::string outliersInWords(const HandEyeOutput& output) {
  constexpr std::size_t most = 20;
  const HandEyeResult& r = output.result;
  if (r.outliers.empty()) return "";
  std::string text = fmt::format("{} wrong {}:\n", r.outliers.size(), r.outliers.size() == 1 ? "pair" : "pairs");
  for (std::size_t k = 0; k < std::min(most, r.outliers.size()); ++k) {
    const std::size_t i = r.outliers[k];
    const Vector6& e = r.pairs[i].error;
    text +=
        fmt::format("  {}: {} deg, {} m off, chi2 {}\n", rowInWords(output.rows[i]),
                    number(degrees * e.tail<3>().norm(), 3), number(e.head<3>().norm(), 3), number(r.pairs[i].chi2, 3));
  }
  if (r.outliers.size() > most) text += fmt::format("  and {} more (--json lists all)\n", r.outliers.size() - most);
  return text;
}
std::string directionsInWords(const HandEyeOutput& output) {
  std::string text;
  for (const OpenDirection& d : output.result.directions) {
    text += fmt::format("  {}: {} (excitation {})\n", d.weak ? "weak" : "open", describe(d, "gripper"),
                        number(d.excitation, 3));
  }
  if (text.empty()) return text;
  text = "directions that the motions do not determine:\n" + text;
  if (output.result.rotationIsOpen()) {
    text += "X may turn by any angle, so that there is no covariance\n";
  } else {
    text += "standard deviations and covariances hold with these directions fixed\n";
  }
  return text + "X is one of those that fit; rotations about several axes would determine it\n";
}
std::string rivalInWords(const HandEyeResult& r) {
  if (!r.rival) return "";
  const Eigen::Vector3d t = r.rival->translation(), v = degrees * r.rival->so3().log();
  return fmt::format(
      "X may as well be: translation ({:.4g}, {:.4g}, {:.4g}) m, rotation vector ({:.4g}, {:.4g}, {:.4g}) deg\n", t[0],
      t[1], t[2], v[0], v[1], v[2]);
}

/// A pose of one of the files, or its inverse.
std::string poseName(bool is_a, bool inverse, bool world) {
  if (!world) return inverse ? "the inverse motions" : "the motions";
  if (is_a) return inverse ? "gripper_T_base" : "base_T_gripper";
  return inverse ? "camera_T_target" : "target_T_camera";
}
std::string readingInWords(CovarianceReading reading, bool is_a, const HandEyeFile& file, bool world) {
  switch (reading) {
    case CovarianceReading::right:
      return "right perturbations, translation first";
    case CovarianceReading::left:
      return fmt::format("those of {}, or of left perturbations Exp(e) T, which is the same",
                         poseName(is_a, !file.inverted, world));
    case CovarianceReading::rotation_then_translation:
      return "ones with the rotation's block first";
    case CovarianceReading::world_axes:
      return "ones along the axes of the world, rotation and translation apart";
  }
  return "";
}
std::string hintInWords(const HandEyeOutput& output) {
  if (!output.hint) return "";
  const HandEyeHint& hint = *output.hint;
  const bool world = output.result.world;
  std::vector<std::string> parts;
  if (hint.reading.b.inverted != output.b.inverted) {
    const auto flag = [](const HandEyeFile& file, const char* name) {
      return fmt::format("{} --invert-{}", file.inverted ? "without" : "with", name);
    };
    parts.push_back(fmt::format("the poses of one file inverted ({}, or {}; the pairs do not tell which{})",
                                flag(output.a, "a"), flag(output.b, "b"), world ? ": X and Y change places" : ""));
  }
  const CovarianceReading a = hint.reading.a.covariance, b = hint.reading.b.covariance;
  if (a != CovarianceReading::right && a == b && a != CovarianceReading::left) {
    parts.push_back(fmt::format("the covariances of A and B read as {}", readingInWords(a, true, output.a, world)));
  } else {
    for (const bool is_a : {true, false}) {
      const CovarianceReading reading = is_a ? a : b;
      if (reading == CovarianceReading::right) continue;
      parts.push_back(fmt::format("the covariances of {} read as {}", is_a ? "A" : "B",
                                  readingInWords(reading, is_a, is_a ? output.a : output.b, world)));
    }
  }
  std::string text = fmt::format("hint: with {} ", joined(parts, " and "));
  const std::string figures = std::isfinite(hint.p)
                                  ? fmt::format("chi2/dof {}, p {}", number(hint.chi2_per_degree, 3), number(hint.p, 2))
                                  : fmt::format("chi2/dof {}", number(hint.chi2_per_degree, 3));
  return text + (hint.agrees ? fmt::format("the residuals agree ({})\n", figures)
                             : fmt::format("the residuals are far smaller ({})\n", figures));
}
std::string answer(const HandEyeOutput& output) { return output.result.verdict().text + "\n" + hintInWords(output); }
std::string rest(const HandEyeOutput& output) {
  return fitInWords(output) + directionsInWords(output) + rivalInWords(output.result) + outliersInWords(output);
}

// --- Page -----------------------------------------------------------------------------------------------------------

constexpr std::size_t inlier_colour = 0, outlier_colour = 1;

template <class Value>
Panel pairPanel(const HandEyeOutput& output, const std::string& label, Value&& value) {
  Panel panel{.x = {.label = "pair"}, .y = {.label = label, .logarithmic = true}};
  for (const bool inlier : {true, false}) {
    Series series = seriesOf(inlier ? "used" : "wrong", Style::points, inlier ? inlier_colour : outlier_colour);
    for (std::size_t i = 0; i < output.result.pairs.size(); ++i) {
      if (output.result.pairs[i].inlier != inlier) continue;
      series.add(static_cast<double>(i + 1), value(output.result.pairs[i]));
    }
    panel.add({series});
  }
  return panel;
}
Plot residualPlot(const HandEyeOutput& output) {
  Plot plot{.name = "residuals",
            .caption = fmt::format("Residuals of the pairs in the order of the table: rotation, translation, and the "
                                   "squared length in units of the noise. Dotted: the gate of wrong pairs, {:.4g}.",
                                   output.options.gate),
            .columns = 3};
  plot.panels.push_back(
      pairPanel(output, "rotation, deg", [](const PairFit& f) { return degrees * f.error.tail<3>().norm(); }));
  plot.panels.push_back(
      pairPanel(output, "translation, mm", [](const PairFit& f) { return 1e3 * f.error.head<3>().norm(); }));
  plot.panels.push_back(pairPanel(output, "chi2 (6 degrees of freedom)", [](const PairFit& f) { return f.chi2; }));
  plot.panels.back().references = {{ReferenceLine::Direction::horizontal, output.options.gate}};
  return plot;
}
Plot excitationPlot(const HandEyeOutput& output) {
  const HandEyeOptions& o = output.options;
  constexpr double lowest = 0.1;
  Series open{.name = "open", .style = Style::boxes, .colour = outlier_colour};
  Series weak{.name = "weak", .style = Style::boxes, .colour = 3};
  Series good{.name = "determined", .style = Style::boxes, .colour = inlier_colour};
  double highest = o.trusted_excitation;
  for (int k = 0; k < 6; ++k) {
    const double value = output.result.excitations[k];
    Series& series = value < o.min_excitation ? open : value < o.trusted_excitation ? weak : good;
    series.add(k + 1, std::max(value, 1.02 * lowest)), series.width.push_back(0.6);
    if (std::isfinite(value)) highest = std::max(highest, value);
  }
  Panel panel{.x = {.label = "direction", .low = 0.4, .high = 6.6},
              .y = {.label = "excitation", .low = lowest, .high = 3 * highest, .logarithmic = true},
              .references = {{ReferenceLine::Direction::horizontal, o.min_excitation},
                             {ReferenceLine::Direction::horizontal, o.trusted_excitation}}};
  panel.add({open, weak, good});
  return {.name = "excitation",
          .caption = fmt::format(
              "Information of the motions over that which noise alone would make up, in the six directions of the "
              "unknown. Dotted: {:g}, below which a direction is open, and {:g}, from which on it is determined.",
              o.min_excitation, o.trusted_excitation),
          .panels = {panel}};
}
/// The planes of X's covariance in which no open direction lies.
Plot covariancePlot(const CalibratedPose& X, bool rotation) {
  constexpr double chi2_95 = 5.991464547107979;  // two degrees of freedom
  const Matrix6 covariance = X.covariance_of_coordinates;
  const Vector6& sigma = X.sigmas;
  const double scale = rotation ? degrees : 1e3;
  const int first = rotation ? 3 : 0;
  const std::array axes{"x", "y", "z"};
  Plot plot{.name = rotation ? "rotation_covariance" : "translation_covariance",
            .caption = rotation ? "95 % ellipses of the error of X's rotation vector."
                                : "95 % ellipses of the error of X's translation, along the gripper's axes.",
            .columns = 3};
  for (const auto& [i, j] : {std::pair(0, 1), std::pair(0, 2), std::pair(1, 2)}) {
    if (!std::isfinite(sigma[first + i]) || !std::isfinite(sigma[first + j])) continue;
    Eigen::Matrix2d block;
    block << covariance(first + i, first + i), covariance(first + i, first + j), covariance(first + j, first + i),
        covariance(first + j, first + j);
    Panel panel{.x = {.label = fmt::format("{}, {}", axes[static_cast<std::size_t>(i)], rotation ? "deg" : "mm")},
                .y = {.label = fmt::format("{}, {}", axes[static_cast<std::size_t>(j)], rotation ? "deg" : "mm")},
                .equal_aspect = true};
    panel.series.push_back(ellipse("", Eigen::Vector2d::Zero(), scale * scale * block, chi2_95));
    const double reach = 1.1 * scale * std::sqrt(chi2_95 * block.diagonal().maxCoeff());
    if (reach > 0) panel.x.low = panel.y.low = -reach, panel.x.high = panel.y.high = reach;
    plot.panels.push_back(panel);
  }
  return plot;
}

}  // namespace

std::string formatHandEye(const HandEyeOutput& output) {
  const HandEyeResult& r = output.result;
  std::string text = answer(output) + "\n";
  for (const CalibratedPose& unknown : calibratedPoses(r)) {
    text += Table(poseRows(unknown, fmt::format("{} = {}", unknown.symbol, unknown.name()))).str() +
            quaternionOf(unknown.pose.mean) + "\n\n";
  }
  return text + summary(output) + rest(output);
}

std::vector<WordedHint> HandEyeOutput::hints() const {
  if (!hint) return {};
  const std::string text = hintInWords(*this);
  const std::size_t begin = text.find(": ") + 2;
  return {{*hint, text.substr(begin, text.size() - 1 - begin), hint->reading.b.inverted != b.inverted}};
}
std::vector<HandEyePair> HandEyeOutput::pairs() const {
  std::vector<HandEyePair> list;
  for (std::size_t i = 0; i < result.pairs.size(); ++i) list.push_back({rows[i], result.pairs[i]});
  return list;
}

void writeHandEyeReport(const std::string& directory, const std::string& command_line, const HandEyeOutput& output) {
  const HandEyeResult& r = output.result;
  Report report(directory, "Hand-eye calibration");
  report.verdict(r.verdict().answer, answer(output));
  report.code(command_line);
  report.section("Result");
  const std::vector<CalibratedPose> unknowns = calibratedPoses(r);
  for (const CalibratedPose& unknown : unknowns) {
    report.table(poseRows(unknown),
                 fmt::format("{} = {}; {}", unknown.symbol, unknown.name(), quaternionOf(unknown.pose.mean)));
  }
  report.code(summary(output) + rest(output));
  report.section("Residuals");
  report.plot(residualPlot(output));
  report.section("What the motions determine");
  report.plot(excitationPlot(output));
  if (!unknowns.front().has_covariance) {
    report.paragraph("X has no covariance.");
  } else {
    for (const bool rotation : {false, true}) {
      const Plot plot = covariancePlot(unknowns.front(), rotation);
      if (!plot.panels.empty()) report.plot(plot);
    }
  }
  report.section("Pairs");
  std::vector<std::vector<std::string>> rows;
  for (std::size_t i = 0; i < r.pairs.size(); ++i) {
    const PairFit& fit = r.pairs[i];
    const PoseRows& from = output.rows[i];
    rows.push_back({fmt::format("{}", i + 1), fmt::format("{}", from.a + 1), fmt::format("{}", from.b + 1),
                    from.time ? fmt::format("{:.10g}", *from.time) : "",
                    number(degrees * fit.error.tail<3>().norm(), 3), number(1e3 * fit.error.head<3>().norm(), 3),
                    number(fit.chi2, 3), fit.inlier ? "used" : "wrong"});
  }
  report.table({"pair", "row of A", "row of B", "time s", "rotation deg", "translation mm", "chi2", ""}, rows);
  printLines("\n" + report.write() + "\n");
}

}  // namespace liestat::cli
