#include <cli/show/mean.hpp>

#include <formats/text.hpp>
#include <report/table.hpp>
#include <cli/show/units.hpp>
#include <report/page.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

namespace liestat::cli {
namespace {

std::string criterionInWords(const Measurements& measurements) {
  switch (measurements.criterion) {
    case Criterion::lsq:
      return "least squares";
    case Criterion::wlsq:
      return "weighted least squares";
    case Criterion::maha:
      return std::string("least Mahalanobis distances") +
             (measurements.likelihood ? " with the likelihood's volume term" : "") +
             (!measurements.covariance_at_matters                    ? ""
              : measurements.covariance_at == CovarianceAt::measured ? ", covariances in the frames of the measurements"
                                                                     : ", covariances in the frame of the mean");
    case Criterion::huber:
      return "Huber's loss of geodesic distances";
    case Criterion::median:
      return "least geodesic distances (the median)";
    case Criterion::barycentre:
      break;
  }
  return measurements.weighted ? "weighted exponential barycentre of the group" : "exponential barycentre of the group";
}

/// The digits of a value that its standard deviation leaves: two beyond the deviation's first, nine in all at least.
std::string withDigitsOf(double value, double sd) {
  if (!(sd > 0) || !std::isfinite(sd)) return number(value, 12);
  const int decimals = 2 - static_cast<int>(std::floor(std::log10(sd)));
  const int before = value == 0 ? 1 : 1 + static_cast<int>(std::floor(std::log10(std::abs(value))));
  if (before + decimals <= 9) return number(value, 9);
  // A double has no more digits than seventeen.
  return fmt::format("{:.{}f}", value, std::clamp(decimals, 0, std::clamp(17 - before, 0, 20)));
}

/// The value that belongs to a part of the tangent vector, as it is shown.
struct ShownPart {
  const char* name = "";
  Eigen::Vector3d value;
  std::string unit;
  double per_sd = 1;  ///< units of the value in one of the part's standard deviation
  int size = 3;
};

ShownPart shownPart(const TangentBlock& part, const FeatureValue& value) {
  if (isAngular(part.part)) {
    if (value.heading_deg) return {"heading", {*value.heading_deg, 0, 0}, "deg", 1, 1};
    if (value.direction) return {"direction", *value.direction, "", 1 / degrees};
    return {"rotation vector", degrees * *value.rotation_vector, "deg"};
  }
  return value.translation ? ShownPart{"translation", *value.translation, "m"} : ShownPart{"point", *value.point, "m"};
}

}  // namespace

TableRows meanRows(const Measurements& measurements, const MeanAnalysis& analysis) {
  TableRows table{{"", "x", "y", "z", "unit"}};
  std::vector<std::vector<std::string>>& rows = table.rows;
  const auto add = [&](const std::string& what, const std::vector<double>& list, const TangentBlock& part) {
    std::vector<std::string> row{what};
    for (const double sd : list) row.push_back(number(sd));
    row.resize(4);
    row.push_back(unitOf(part).name);
    rows.push_back(row);
  };
  for (const TangentBlock& part : info(measurements.feature).tangent) {
    const ShownPart shown = shownPart(part, analysis.mean);
    const bool has_covariance = analysis.hasCovariance();
    double least = 0;
    if (has_covariance) {
      const auto world = worldDeviations(part, analysis.mean, analysis.covariance);
      const std::vector<double> list = world ? *world : deviations(part, analysis.covariance);
      least = shown.per_sd * *std::min_element(list.begin(), list.end());
    }
    std::vector<std::string> row{shown.name};
    for (int i = 0; i < shown.size; ++i) row.push_back(withDigitsOf(shown.value[i], least));
    row.resize(4);
    row.push_back(shown.unit);
    rows.push_back(row);
    const std::string own_axes = analysis.mean.direction         ? ", tangent axes"
                                 : analysis.mean.quaternion_xyzw ? ", body axes"
                                                                 : "";
    const auto addBoth = [&](const std::string& what, const Eigen::MatrixXd& covariance) {
      if (const auto world = worldDeviations(part, analysis.mean, covariance)) add(what + ", world axes", *world, part);
      add(what + own_axes, deviations(part, covariance), part);
    };
    if (has_covariance) addBoth("  sd", analysis.covariance);
    addBoth("  dispersion", analysis.dispersion);
  }
  return table;
}

std::string oneLine(const FeatureValue& value) {
  std::string text;
  const auto add = [&](const char* what, const auto& v, double scale, const char* unit) {
    if (!v) return;
    if (!text.empty()) text += ", ";
    text += fmt::format("{} ({:.9g}, {:.9g}, {:.9g}){}", what, scale * (*v)[0], scale * (*v)[1], scale * (*v)[2], unit);
  };
  add("rotation vector", value.rotation_vector, degrees, " deg");
  add("translation", value.translation, 1, " m");
  add("point", value.point, 1, " m");
  add("direction", value.direction, 1, "");
  if (value.heading_deg) text += fmt::format("heading {:.9g} deg", *value.heading_deg);
  return text;
}

std::string measurementsInWords(const std::string& source, const Measurements& measurements) {
  const FeatureInfo& feature = info(measurements.feature);
  std::string text = fmt::format("{}: {} {} ({})", sourceName(source), measurements.size(),
                                 measurements.size() == 1 ? feature.name : feature.plural, measurements.file.format);
  if (measurements.file.n_normalised > 0) {
    text += fmt::format(", {} normalised (largest error {:.2g})", measurements.file.n_normalised,
                        measurements.file.largest_norm_error);
  }
  return text;
}

namespace {

/// The origin of the covariance and how it is to be read, or the reason why there is none.
std::string covarianceInWords(const Measurements& measurements, const MeanAnalysis& analysis) {
  if (analysis.covariance.size() == 0) {
    return analysis.status == Status::not_applicable ? "none: " + analysis.reason : "withdrawn";
  }
  const int k = degreesOfFreedom(measurements.feature);
  const std::string law = analysis.fromResiduals()
                              ? fmt::format("Hotelling's law with k = {}, n = {}", k, significant(analysis.law_n, 4))
                              : fmt::format("chi-square with {} degrees of freedom", k);
  return fmt::format("from {}, in the local frame of the mean; squared distances follow {}",
                     analysis.fromResiduals() ? "the residuals" : "the measurements' own covariances", law);
}

/// As many decimals as the standard deviation of the rotation leaves, nine at least.
int quaternionDecimals(Feature feature, const MeanAnalysis& analysis) {
  if (analysis.covariance.size() == 0) return 9;
  for (const TangentBlock& part : info(feature).tangent) {
    if (!isAngular(part.part)) continue;
    const double least = analysis.covariance.diagonal().segment(part.begin, part.size).minCoeff();
    if (least > 0) return std::clamp(2 - static_cast<int>(std::floor(0.5 * std::log10(least))), 9, 16);
  }
  return 9;
}

}  // namespace

std::string formatMean(const std::string& source, const Measurements& measurements, const MeanAnalysis& analysis) {
  std::string text = measurementsInWords(source, measurements) + "\n";
  text += fmt::format("mean by {}: {} after {} {}\n\n", criterionInWords(measurements),
                      analysis.converged ? "converged" : "not converged", analysis.iterations,
                      analysis.iterations == 1 ? "step" : "steps");
  text += Table(meanRows(measurements, analysis)).str() + "\n";
  if (analysis.mean.quaternion_xyzw) {
    const Eigen::Vector4d& q = *analysis.mean.quaternion_xyzw;
    const int decimals = quaternionDecimals(measurements.feature, analysis);
    text +=
        fmt::format("quaternion x y z w  {0:.{4}f} {1:.{4}f} {2:.{4}f} {3:.{4}f}\n", q[0], q[1], q[2], q[3], decimals);
  }
  if (!analysis.symmetry_in_words.empty()) text += "symmetry     " + analysis.symmetry_in_words + "\n";
  text += "uniqueness   " + analysis.uniquenessInWords() + "\n";
  for (const FeatureValue& rival : analysis.rivals) text += "  rival      " + oneLine(rival) + "\n";
  if (analysis.more_rivals) text += "  rival      and others: these are not all\n";
  for (const NearRival& rival : analysis.near_ties) {
    text += fmt::format("  near tie   {}: worse by {:.2g} standard deviations\n", oneLine(rival.feature), rival.z);
  }
  if (analysis.valley) {
    text += fmt::format("  valley     {}: {:.3g} deg from the mean, worse by {:.2g} standard deviations\n",
                        oneLine(analysis.valley->feature), degrees * analysis.valley_angle, analysis.valley->z);
  }
  text += "covariance   " + covarianceInWords(measurements, analysis) + "\n";
  constexpr std::size_t most_outliers = 10;
  for (std::size_t i = 0; i < std::min(most_outliers, analysis.outliers.size()); ++i) {
    const NamedOutlier& x = analysis.outliers[i];
    text += fmt::format("{}line {}: {:.4g} {} away, p {:.2g}\n", i == 0 ? "outliers     " : "             ",
                        x.line.value_or(0), x.shown(), unitOf(x.part).name, x.p);
  }
  if (analysis.outliers.size() > most_outliers) {
    text += fmt::format("             and {} more\n", analysis.outliers.size() - most_outliers);
  }
  if (analysis.dependence.tested) {
    text += "in time      " + analysis.dependence.inWords();
    text += analysis.inflated ? ", by which the covariance is widened\n" : "\n";
  }
  for (const FarthestMeasurement& f : analysis.farthest) {
    if (measurements.size() < 2) break;
    text += fmt::format("farthest     {} {} in {}, line {}\n", number(f.shown()), unitOf(f.part).name, name(f.part),
                        f.line.value_or(0));
  }
  for (const std::string& note : analysis.notes) text += "note         " + note + "\n";
  if (!analysis.trusted()) text += "\n" + analysis.verdict().text + "\n";
  return text;
}

namespace {

// The palette's colours by what they stand for.
constexpr std::size_t mean_colour = 1, measurement_colour = 0, barycentre_colour = 2, rival_colour = 3,
                      frontier_colour = 6;
constexpr double ellipsoid_chi2 = 6, dispersion_chi2 = 5;

constexpr double gap = std::numeric_limits<double>::quiet_NaN();

/// Two coordinates of a chart.
struct Plane {
  int a = 0, b = 1;

  Eigen::Vector2d of(const Eigen::VectorXd& v) const { return {v[a], v[b]}; }
  Eigen::Matrix2d of(const Eigen::MatrixXd& m) const {
    Eigen::Matrix2d block;
    block << m(a, a), m(a, b), m(b, a), m(b, b);
    return block;
  }
};

Series scatter(std::string name, Style style, std::size_t colour, const Eigen::MatrixXd& data, Plane plane) {
  Series series{.name = std::move(name), .style = style, .colour = colour};
  for (Eigen::Index i = 0; i < data.cols(); ++i) {
    series.add(data(plane.a, i), data(plane.b, i));
  }
  return series;
}

/// An upright or a diagonal cross, which shows on top of a cloud of discs; half as wide and high as the size.
Series cross(std::string name, const Eigen::Vector2d& at, const Eigen::Vector2d& size, bool diagonal,
             std::size_t colour) {
  const Eigen::Vector2d s = diagonal ? Eigen::Vector2d(size / std::numbers::sqrt2) : size;
  const Eigen::Vector2d u(s.x(), diagonal ? s.y() : 0), v(diagonal ? s.x() : 0, diagonal ? -s.y() : s.y());
  return {.name = std::move(name),
          .style = Style::lines,
          .x = {at.x() - u.x(), at.x() + u.x(), gap, at.x() - v.x(), at.x() + v.x()},
          .y = {at.y() - u.y(), at.y() + u.y(), gap, at.y() - v.y(), at.y() + v.y()},
          .colour = colour};
}

Series coloured(Series series, std::size_t colour, bool dashed = false) {
  series.colour = colour;
  series.dashed = dashed;
  return series;
}

/// One chart: measurements, mean and barycentre with their uncertainty, the dispersion.
struct ChartPanel {
  std::string title = {};
  std::vector<std::string> labels;
  const Eigen::MatrixXd& data;
  Eigen::VectorXd mean;
  Eigen::MatrixXd mean_covariance, dispersion;
  Eigen::VectorXd barycentre = {};
  Eigen::MatrixXd barycentre_covariance = {};
  double frontier = 0;          ///< radius, 0 for none
  Eigen::MatrixXd rivals = {};  ///< columns; empty: the mean has none

  const std::string& label(int i) const { return labels[static_cast<std::size_t>(i)]; }
};

Panel panelOf(const ChartPanel& chart, Plane plane) {
  Panel panel{chart.title, {chart.label(plane.a)}, {chart.label(plane.b)}};
  panel.equal_aspect = true;
  Eigen::Vector2d size = Eigen::Vector2d::Constant(chart.frontier);  // half of what is seen
  if (chart.frontier > 0) {
    panel.x.low = panel.y.low = -1.05 * chart.frontier;
    panel.x.high = panel.y.high = 1.05 * chart.frontier;
    panel.series.push_back(
        coloured(ellipse("", Eigen::Vector2d::Zero(), Eigen::Matrix2d::Identity(), chart.frontier * chart.frontier),
                 frontier_colour));
  } else {
    // The data and the dispersion's ellipse fit; a square, unless the cloud is so flat that nothing would be seen.
    Eigen::Vector2d low(chart.data.row(plane.a).minCoeff(), chart.data.row(plane.b).minCoeff());
    Eigen::Vector2d high(chart.data.row(plane.a).maxCoeff(), chart.data.row(plane.b).maxCoeff());
    const Eigen::Vector2d reach = (dispersion_chi2 * plane.of(chart.dispersion).diagonal()).cwiseSqrt();
    low = low.cwiseMin(plane.of(chart.mean) - reach);
    high = high.cwiseMax(plane.of(chart.mean) + reach);
    for (Eigen::Index i = 0; i < chart.rivals.cols(); ++i) {
      const Eigen::Vector2d rival = plane.of(Eigen::VectorXd(chart.rivals.col(i)));
      low = low.cwiseMin(rival), high = high.cwiseMax(rival);
    }
    const Eigen::Vector2d middle = 0.5 * (low + high);
    Eigen::Vector2d half = 0.525 * (high - low);
    panel.equal_aspect = half.maxCoeff() < 4 * half.minCoeff();
    if (panel.equal_aspect) half.setConstant(half.maxCoeff());
    size = half;
    if (half.minCoeff() > 0) {
      panel.x.low = middle.x() - half.x(), panel.x.high = middle.x() + half.x();
      panel.y.low = middle.y() - half.y(), panel.y.high = middle.y() + half.y();
    }
  }
  panel.series.push_back(scatter("measurements", Style::points, measurement_colour, chart.data, plane));
  if (chart.dispersion.size() > 0) {
    panel.series.push_back(coloured(
        ellipse("dispersion", plane.of(chart.mean), plane.of(chart.dispersion), dispersion_chi2), mean_colour, true));
  }
  if (chart.barycentre.size() > 0) {
    if (chart.barycentre_covariance.size() > 0) {
      panel.series.push_back(
          coloured(ellipse("", plane.of(chart.barycentre), plane.of(chart.barycentre_covariance), ellipsoid_chi2),
                   barycentre_colour));
    }
    panel.series.push_back(
        cross("chart barycentre", plane.of(chart.barycentre), 0.035 * size, true, barycentre_colour));
  }
  if (chart.mean_covariance.size() > 0) {
    panel.series.push_back(
        coloured(ellipse("", plane.of(chart.mean), plane.of(chart.mean_covariance), ellipsoid_chi2), mean_colour));
  }
  if (chart.rivals.cols() > 0) {
    panel.series.push_back(scatter("rivals of the mean", Style::stars, rival_colour, chart.rivals, plane));
  }
  panel.series.push_back(cross("mean", plane.of(chart.mean), 0.035 * size, false, mean_colour));
  return panel;
}

Eigen::MatrixXd blockOf(const Eigen::MatrixXd& m, const TangentBlock& part) {
  if (m.size() == 0) return {};
  return m.block(part.begin, part.begin, part.size, part.size);
}

/// The largest distance of a rotation or direction from the origin, rad.
double largestAngle(Feature feature) {
  return feature == Feature::non_oriented_frame ? 2 * std::numbers::pi / 3 : std::numbers::pi;
}

/// The rows of the rivals' coordinates, if there are rivals.
Eigen::MatrixXd rivalsOf(const Eigen::MatrixXd& rivals, const TangentBlock& part) {
  if (rivals.cols() == 0) return {};
  return rivals.middleRows(part.begin, part.size);
}

/// True if a cloud is large enough to be drawn with its space's frontier; a small one would become a dot.
bool fillsItsSpace(const Eigen::MatrixXd& centred, const Eigen::MatrixXd& principal) {
  const Eigen::VectorXd first = principal.col(0);
  // In the principal chart even a small cloud may lie on both sides of the frontier.
  return centred.colwise().norm().maxCoeff() > 0.8 || (principal.colwise() - first).colwise().norm().maxCoeff() > 3;
}

/// Figure 2 of Pennec 1998.
void plotAngles(Report& report, const Measurements& measurements, const MeanAnalysis& analysis,
                const TangentBlock& part) {
  const ChartScatter& charts = *analysis.charts;
  const Eigen::MatrixXd principal = charts.principal.middleRows(part.begin, part.size);
  const Eigen::MatrixXd centred = charts.centred.middleRows(part.begin, part.size);
  const bool direction = part.size == 2;
  const std::vector<std::string> labels =
      direction ? std::vector<std::string>{"first coordinate (rad)", "second coordinate (rad)"}
                : std::vector<std::string>{"r_x (rad)", "r_y (rad)", "r_z (rad)"};
  const Eigen::MatrixXd rivals_principal = rivalsOf(analysis.rivals_principal, part);
  const Eigen::MatrixXd rivals_centred = rivalsOf(analysis.rivals_centred, part);
  const bool far_rival = rivals_centred.cols() > 0 && rivals_centred.colwise().norm().maxCoeff() > 0.8;
  const double frontier = far_rival || fillsItsSpace(centred, principal) ? largestAngle(measurements.feature) : 0;
  ChartPanel left{.title = "Principal chart",
                  .labels = labels,
                  .data = principal,
                  .mean = charts.mean.segment(part.begin, part.size),
                  .mean_covariance = blockOf(charts.mean_covariance, part),
                  .dispersion = blockOf(charts.dispersion, part),
                  .barycentre = charts.barycentre.segment(part.begin, part.size),
                  .barycentre_covariance = blockOf(charts.barycentre_covariance, part),
                  .frontier = frontier,
                  .rivals = rivals_principal};
  ChartPanel right{.title = "Exponential chart about the mean",
                   .labels = labels,
                   .data = centred,
                   .mean = Eigen::VectorXd::Zero(part.size),
                   .mean_covariance = blockOf(analysis.covariance, part),
                   .dispersion = blockOf(analysis.dispersion, part),
                   .barycentre = charts.barycentre_centred.segment(part.begin, part.size),
                   .barycentre_covariance = blockOf(charts.barycentre_covariance_centred, part),
                   .frontier = frontier,
                   .rivals = rivals_centred};
  const std::string what = direction ? "directions" : "rotation vectors";
  std::string caption = fmt::format(
      "The {}{}: left about the origin, right about the mean. Crosses: the mean, and the plain mean of the coordinates "
      "of the left chart, with their covariance ellipsoids at chi-square {:g}; dashed, the dispersion at {:g}.",
      what, direction ? "" : " seen along the third axis", ellipsoid_chi2, dispersion_chi2);
  if (rivals_centred.cols() > 0) {
    caption += " Stars: other features that the measurements do not exclude, so that the mean is one of several.";
  }
  if (frontier > 0) caption += fmt::format(" The circle is where the charts end, at {:.4g} rad.", frontier);
  report.plot({.name = "mean", .caption = caption, .panels = {panelOf(left, {0, 1}), panelOf(right, {0, 1})}});
  if (!direction) {
    report.plot({.name = "mean_other_coordinates",
                 .caption = "The other coordinates in the chart about the mean.",
                 .panels = {panelOf(right, {0, 2}), panelOf(right, {1, 2})}});
  }
}

/// Points, or the translations of frames, in the coordinates of the file.
void plotPositions(Report& report, const MeanAnalysis& analysis, const TangentBlock& part) {
  const ChartScatter& charts = *analysis.charts;
  const Eigen::MatrixXd data = charts.principal.middleRows(part.begin, part.size);
  const ChartPanel chart{.labels = {"x (m)", "y (m)", "z (m)"},
                         .data = data,
                         .mean = charts.mean.segment(part.begin, part.size),
                         .mean_covariance = blockOf(charts.mean_covariance, part),
                         .dispersion = blockOf(charts.dispersion, part),
                         .rivals = rivalsOf(analysis.rivals_principal, part)};
  report.plot({.name = std::string(name(part.part)) + "s",
               .caption = fmt::format("The {}s in the file's coordinates with their mean, its covariance ellipsoid at "
                                      "chi-square {:g} and, dashed, the dispersion at {:g}.",
                                      name(part.part), ellipsoid_chi2, dispersion_chi2),
               .panels = {panelOf(chart, {0, 1}), panelOf(chart, {0, 2})}});
}

}  // namespace

void writeMeanReport(const std::string& directory, const std::string& command_line, const std::string& source,
                     const Measurements& measurements, const MeanAnalysis& analysis) {
  Report report(directory, "Mean of the measurements in " + source);
  report.verdict(analysis.verdict());
  report.paragraph(measurementsInWords(source, measurements) + ".");
  report.code(command_line);
  const std::span<const TangentBlock> parts = info(measurements.feature).tangent;
  if (analysis.charts) {
    for (auto part = parts.rbegin(); part != parts.rend(); ++part) {
      if (isAngular(part->part)) {
        plotAngles(report, measurements, analysis, *part);
      } else {
        plotPositions(report, analysis, *part);
      }
    }
  }
  report.section("Numbers");
  report.table(meanRows(measurements, analysis));
  report.section("All that the program said");
  report.code(formatMean(source, measurements, analysis));
  if (analysis.covariance.size() > 0) {
    report.section("Covariance");
    std::vector<std::vector<std::string>> matrix;
    for (Eigen::Index i = 0; i < analysis.covariance.rows(); ++i) {
      std::vector<std::string> row;
      for (Eigen::Index j = 0; j < analysis.covariance.cols(); ++j) row.push_back(number(analysis.covariance(i, j), 6));
      matrix.push_back(std::move(row));
    }
    report.table(std::vector<std::string>(matrix.size(), ""), matrix, covarianceInWords(measurements, analysis));
  }
  report.write();
}

}  // namespace liestat::cli
