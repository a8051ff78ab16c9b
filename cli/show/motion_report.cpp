#include <cli/show/motion.hpp>

#include <report/page.hpp>
#include <report/table.hpp>
#include <cli/show/units.hpp>
#include <stats/quantile.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace liestat::cli {

namespace {

constexpr double no_value = std::numeric_limits<double>::quiet_NaN();
constexpr double region_95 = 5.991;  // χ² of two degrees of freedom
constexpr std::size_t most_frames_drawn = 2000;
// The palette's colours by what they stand for.
constexpr std::size_t estimate_ink = 0, second_ink = 1, third_ink = 2, fourth_ink = 3, truth_ink = 6;
constexpr std::array<const char*, 3> axis_names = {"x", "y", "z"};
constexpr std::array<std::size_t, 3> axis_inks = {estimate_ink, second_ink, third_ink};

Series star(std::string name, const Eigen::Vector2d& at, std::size_t ink) {
  Series series = seriesOf(std::move(name), Style::stars, ink);
  series.add(at.x(), at.y());
  return series;
}

using Basis = Eigen::Matrix<double, 3, 2>;
Basis basisOf(const S2d& direction) { return ManifoldTraits<S2d>::placement(direction).matrix().leftCols<2>(); }

/// The true direction of what an estimate is that of.
Eigen::Vector3d trueDirection(const TrueMotion& truth, DirectionMeaning meaning) {
  return (meaning == DirectionMeaning::velocity ? truth.velocity : truth.translation()).normalized();
}

/// The axis' ends from values that should be seen: a margin about all of them, none without any.
struct Extents {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void add(double value) {
    if (std::isfinite(value)) low = std::min(low, value), high = std::max(high, value);
  }
  void set(Axis& axis) const {
    if (!(low <= high)) return;
    const double margin = std::max(0.08 * (high - low), 1e-6 + 1e-3 * std::abs(high));
    axis.low = low - margin, axis.high = high + margin;
  }
};

/// A quantity of three components over the frames: estimates, bands, truth.
struct Component {
  std::array<Series, 3> lines, bands, truths;
  Extents usable;              ///< range of the values worth seeing
  std::vector<double> sigmas;  ///< the same of two standard deviations

  /// `frames_apart`: larger gaps between frames are left open.
  explicit Component(std::size_t frames_apart) : step_(static_cast<double>(frames_apart)) {
    for (std::size_t k = 0; k < 3; ++k) {
      lines[k] = seriesOf(axis_names[k], Style::lines, axis_inks[k]);
      bands[k] = seriesOf("", Style::filled_curve, axis_inks[k]);
      truths[k] = seriesOf(k == 0 ? "truth" : "", Style::lines, truth_ink, true);
    }
  }
  void add(double frame, const Eigen::Vector3d& value, const Eigen::Vector3d& sigma, bool ok) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      if (!lines[k].x.empty() && frame - lines[k].x.back() > step_) {
        lines[k].add(no_value, no_value);
        bands[k].addBand(no_value, no_value, no_value);
      }
      lines[k].add(frame, value[i]);
      bands[k].addBand(frame, value[i] - 2 * sigma[i], value[i] + 2 * sigma[i]);
      if (ok) usable.add(value[i]), sigmas.push_back(2 * sigma[i]);
    }
  }
  void addTruth(double frame, const Eigen::Vector3d& value) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (!truths[k].x.empty() && frame - truths[k].x.back() > step_) truths[k].add(no_value, no_value);
      truths[k].add(frame, value[static_cast<Eigen::Index>(k)]);
      usable.add(truths[k].y.back());
    }
  }
  void drawOn(Panel& panel, std::size_t components = 3) const {
    for (std::size_t k = 0; k < components; ++k) panel.series.push_back(bands[k]);
    for (std::size_t k = 0; k < components; ++k) panel.add({truths[k]});
    for (std::size_t k = 0; k < components; ++k) panel.series.push_back(lines[k]);
    // A frame that hardly says anything would take the scale.
    Extents seen = usable;
    if (!sigmas.empty() && seen.low <= seen.high) {
      const double most = liestat::quantile(sigmas, 0.95);
      seen.low -= most, seen.high += most;
    }
    seen.set(panel.y);
  }

 private:
  double step_;
};

std::size_t strideOf(const MotionResult& result) {
  return (result.frames.size() + most_frames_drawn - 1) / most_frames_drawn;
}
std::string thinned(const MotionResult& result) {
  const std::size_t step = strideOf(result);
  return step > 1 ? fmt::format(" One frame in {} is drawn.", step) : std::string();
}

Plot estimatesPlot(const MotionResult& result) {
  Component direction(strideOf(result)), rotation(strideOf(result));
  for (std::size_t i = 0; i < result.frames.size(); i += strideOf(result)) {
    const MotionFrame& frame = result.frames[i];
    const auto at = static_cast<double>(frame.frame);
    const Gaussian<S2d>& d = frame.motion.direction;
    const Eigen::Matrix3d P = basisOf(d.mean) * d.covariance * basisOf(d.mean).transpose();
    direction.add(at, d.mean.unit_vector(), P.diagonal().cwiseMax(0).cwiseSqrt(), frame.motion.ok());
    // From the local frame to the rotation vector.
    const Eigen::Vector3d Omega = frame.motion.rotation.mean.log();
    const Eigen::Matrix3d J = SO3d::rightJacobianInverse(Omega);
    const Eigen::Matrix3d Q = J * frame.motion.rotation.covariance * J.transpose();
    rotation.add(at, degrees * Omega, degrees * Q.diagonal().cwiseMax(0).cwiseSqrt(), frame.motion.ok());
    if (!frame.truth) continue;
    rotation.addTruth(at, degrees * frame.truth->rotation);
    if (frame.direction_error) direction.addTruth(at, trueDirection(*frame.truth, frame.motion.meaning));
  }
  Plot plot{
      .name = "estimates",
      .caption =
          "Direction of motion and rotation over one frame, of the points in the camera's axes (x right, y down, z "
          "forward), with bands of two standard deviations (figures 2 to 4). The direction is that of the velocity, "
          "and of the translation from one frame to the next where the essential filter is in charge." +
          thinned(result)};
  Panel directions{.title = "direction", .x = {.label = "frame"}, .y = {.label = "component"}};
  direction.drawOn(directions);
  directions.y.low = -1.05, directions.y.high = 1.05;
  Panel rotations{.title = "rotation", .x = {.label = "frame"}, .y = {.label = "deg per frame"}};
  rotation.drawOn(rotations);
  plot.panels = {directions, rotations};
  return plot;
}

Plot errorsPlot(const MotionResult& result) {
  Component direction(strideOf(result)), rotation(strideOf(result));
  for (std::size_t i = 0; i < result.frames.size(); i += strideOf(result)) {
    const MotionFrame& frame = result.frames[i];
    if (!frame.truth) continue;
    const auto at = static_cast<double>(frame.frame);
    const MotionEstimate& motion = frame.motion;
    const Eigen::Vector3d turn = (motion.rotation.mean.inverse() * SO3d::exp(frame.truth->rotation)).log();
    rotation.add(at, -degrees * turn, degrees * motion.rotation.covariance.diagonal().cwiseMax(0).cwiseSqrt(),
                 motion.ok());
    if (!frame.direction_error) continue;
    const Gaussian<S2d>& d = motion.direction;
    const Eigen::Vector2d error = log(d.mean, S2d(trueDirection(*frame.truth, motion.meaning)));
    const Eigen::Vector2d sigma = d.covariance.diagonal().cwiseMax(0).cwiseSqrt();
    direction.add(at, -degrees * error.homogeneous(), degrees * Eigen::Vector3d(sigma.x(), sigma.y(), 0), false);
    if (!motion.ok()) continue;
    for (int k = 0; k < 2; ++k) {
      direction.usable.add(-degrees * error[k]);
      direction.sigmas.push_back(2 * degrees * sigma[k]);
    }
  }
  for (std::size_t k = 0; k < 2; ++k) direction.lines[k].name = k == 0 ? "first" : "second";
  Plot plot{.name = "errors",
            .caption =
                "Estimate minus truth with bands of two standard deviations (figures 2 and 3), in the coordinates of "
                "the covariances: the direction's two tangent coordinates, the rotation's axes of the first "
                "frame. The scales are those of the frames that may be used." +
                thinned(result)};
  Panel directions{"error of the direction", {"frame"}, {"tangent coordinate, deg"}};
  directions.references = {{.at = 0}};
  direction.drawOn(directions, 2);
  Panel rotations{"error of the rotation", {"frame"}, {"deg per frame"}};
  rotations.references = {{.at = 0}};
  rotation.drawOn(rotations);
  plot.panels = {directions, rotations};
  return plot;
}

struct FlowMap {
  Flow flow;
  const char* name;
  const ResidualMap& map;
};
using FlowMaps = std::array<FlowMap, 3>;

Grid gridOf(const ResidualMap& map) { return {map.grid.x, map.grid.y, map.grid.value}; }

Axis tangentAxis(int number) {
  return {.label = fmt::format("{} tangent coordinate, deg", number == 0 ? "first" : "second"), .low = -93, .high = 93};
}
Series othersOf(const ResidualMap& map) {
  Series others = seriesOf("other local minima", Style::points, fourth_ink);
  for (const Eigen::Vector2d& other : map.others) others.add(other.x(), other.y());
  return others;
}
/// The image of a map.
Panel mapPanel(std::string title, const ResidualGrid& grid, const Axis& colour) {
  Series image{.name = "residual", .style = Style::image, .value = grid.value};
  for (const double y : grid.y) {
    for (const double x : grid.x) image.add(x, y);
  }
  return {.title = std::move(title),
          .x = tangentAxis(0),
          .y = tangentAxis(1),
          .colour = colour,
          .series = {image},
          .equal_aspect = true};
}

/// From the least residual to what nearly all directions are below, three decades at most, so that a few do not take all
/// colours.
Axis colourAxis(std::initializer_list<const ResidualGrid*> grids) {
  std::vector<double> values;
  for (const ResidualGrid* grid : grids) {
    for (const double value : grid->value) {
      if (std::isfinite(value) && value > 0) values.push_back(value);
    }
  }
  Axis axis{.label = "residual per degree of freedom", .logarithmic = true};
  if (values.empty()) return axis;
  std::sort(values.begin(), values.end());
  axis.high = std::max(values[values.size() * 98 / 100], 1.5 * values.front());
  axis.low = std::max(values.front(), 1e-3 * *axis.high);
  return axis;
}

Plot residualPlot(const MotionFrameStudy& at, const FlowMaps& maps) {
  Plot plot{
      .name = "residual",
      .caption = fmt::format(
          "The residual of frame {} over the hemisphere about the filter's estimate, which is at the origin (figures "
          "5 and 6), and below on the right its minima near the estimate with their 95 % regions: those of "
          "the minima by the curvature of one frame, that of the estimate by all frames.",
          at.frame)};
  const Axis colour = colourAxis({&maps[0].map.grid, &maps[1].map.grid, &maps[2].map.grid});
  Panel near{"near the estimate", {"first tangent coordinate, deg"}, {"second tangent coordinate, deg"}};
  near.equal_aspect = true;
  double reach = 1;
  for (std::size_t k = 0; k < maps.size(); ++k) {
    const FlowMap& of = maps[k];
    Panel panel = mapPanel(of.name, of.map.grid, colour);
    panel.add({othersOf(of.map)});
    panel.series.push_back(star("estimate", Eigen::Vector2d::Zero(), estimate_ink));
    panel.series.push_back(star("minimum", of.map.minimum, second_ink));
    const HemisphereChart chart(at.directionOf(of.flow).mean.unit_vector());
    if (at.truthOf(of.flow)) panel.series.push_back(star("truth", chart(*at.truthOf(of.flow)), truth_ink));
    plot.panels.push_back(panel);
    near.series.push_back(star(of.name, of.map.minimum, k + 1));
    if (of.map.minimum.norm() < 45) reach = std::max(reach, of.map.minimum.norm());
    if (!of.map.covariance) continue;
    Series region = ellipse("", of.map.minimum, *of.map.covariance, region_95);
    region.colour = k + 1, region.dashed = true;
    near.series.push_back(region);
    reach = std::max(reach, std::min(45.0, of.map.minimum.norm() + std::sqrt(region_95 * of.map.covariance->trace())));
  }
  near.series.push_back(star("estimate", Eigen::Vector2d::Zero(), estimate_ink));
  const Eigen::Matrix2d P = degrees * degrees * at.velocity.covariance;
  Series region = ellipse("", Eigen::Vector2d::Zero(), P, region_95);
  region.colour = estimate_ink;
  near.series.push_back(region);
  reach = std::max(reach, std::sqrt(region_95 * P.trace()));
  if (at.true_velocity) {
    const Eigen::Vector2d truth = HemisphereChart(at.velocity.mean.unit_vector())(*at.true_velocity);
    near.series.push_back(star("truth", truth, truth_ink));
    if (truth.norm() < 45) reach = std::max(reach, truth.norm());
  }
  reach = std::min(1.25 * reach, 90.0);
  near.x.low = near.y.low = -reach, near.x.high = near.y.high = reach;
  plot.panels.push_back(near);
  return plot;
}

void residualTable(Report& report, const MotionFrameStudy& at, const FlowMaps& maps) {
  std::vector<std::vector<std::string>> rows;
  for (const FlowMap& of : maps) {
    const HemisphereChart chart(at.directionOf(of.flow).mean.unit_vector());
    const Eigen::Vector3d V = chart.direction(of.map.minimum);
    const auto& truth = at.truthOf(of.flow);
    const Eigen::Matrix2d both = of.map.covariance.value_or(Eigen::Matrix2d::Constant(no_value)) +
                                 degrees * degrees * at.directionOf(of.flow).covariance;
    const double squared = of.map.minimum.dot(both.inverse() * of.map.minimum);
    rows.push_back({of.name, fmt::format("{:.4f} {:.4f} {:.4f}", V.x(), V.y(), V.z()), number(of.map.residual, 3),
                    number(of.map.minimum.norm(), 3), number(squared, 3),
                    truth ? number(degrees * std::acos(std::min(1.0, std::abs(truth->dot(V)))), 3) : "n/a",
                    fmt::format("{}", of.map.others.size())});
  }
  report.table(
      {"flow", "minimum", "residual", "from the estimate deg", "chi2", "from the truth deg", "other minima"}, rows,
      "The minimum of the residual for each flow: its residual per degree of freedom, its angle from the filter's "
      "estimate with the squared Mahalanobis distance by the covariances of both (two degrees of freedom), its "
      "angle from the truth, and the number of other local minima.");
}

/// The part of a way that is on one side of the chart.
Series onSide(std::string name, const MotionTrace& trace, const HemisphereChart& chart, bool far, std::size_t ink) {
  Series series = seriesOf(std::move(name), Style::linespoints, ink);
  Eigen::Vector3d before = trace.start;
  const auto add = [&](const Eigen::Vector3d& direction) {
    // The turn to the antipode is no way across the hemisphere.
    if (direction.dot(before) < 0) series.add(no_value, no_value);
    before = direction;
    const bool here = chart.holds(direction) != far;
    const Eigen::Vector2d at = chart(direction);
    series.add(here ? at.x() : no_value, here ? at.y() : no_value);
  };
  add(trace.start);
  for (const Eigen::Vector3d& direction : trace.directions) add(direction);
  return series;
}

Plot convergencePlot(const MotionFrameStudy& at, const MotionWindowRuns& runs, const ResidualMap& map) {
  Plot plot{
      .name = "convergence",
      .caption = fmt::format(
          "The way of the filter over {} frames, on the residual of frame {} (figures 7 and 8): of the start that wins "
          "among many, and from the farthest start that arrives, with the sign of the depths held and released, on the "
          "side from which the latter goes to the rubbery state; until the depths turn the direction round the two are "
          "the same. Left the hemisphere about the estimate, right that about its antipode with the same residual, "
          "each direction at the coordinates of its antipode on the left.",
          runs.released.frames.size(), at.frame)};
  const HemisphereChart chart(at.velocity.mean.unit_vector());
  const Axis colour = colourAxis({&map.grid});
  for (const bool far : {false, true}) {
    Panel panel = mapPanel(far ? "about the antipode: depths negative" : "about the estimate", map.grid, colour);
    panel.series.push_back(onSide("sign released", runs.released, chart, far, second_ink));
    panel.series.push_back(onSide("sign held", runs.held, chart, far, fourth_ink));
    if (!runs.winner.directions.empty()) {
      panel.series.push_back(onSide("winning start", runs.winner, chart, far, estimate_ink));
    }
    panel.series.push_back(star(far ? "antipode" : "estimate", Eigen::Vector2d::Zero(), truth_ink));
    plot.panels.push_back(panel);
  }
  return plot;
}

double angleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return degrees * std::atan2(a.cross(b).norm(), a.dot(b));
}

/// The start is shown one frame before the first.
double beforeFirst(const MotionTrace& trace) { return static_cast<double>(trace.frames.front()) - 1; }

Panel tracePanel(std::string title, const MotionTrace& trace, const Eigen::Vector3d& reference) {
  Panel panel{std::move(title), {"frame"}, {.label = "component", .low = -1.05, .high = 1.05}};
  for (std::size_t k = 0; k < 3; ++k) {
    Series line = seriesOf(axis_names[k], Style::lines, axis_inks[k]);
    line.add(beforeFirst(trace), trace.start[static_cast<Eigen::Index>(k)]);
    for (std::size_t i = 0; i < trace.frames.size(); ++i) {
      line.add(static_cast<double>(trace.frames[i]), trace.directions[i][static_cast<Eigen::Index>(k)]);
    }
    panel.series.push_back(line);
  }
  for (std::size_t k = 0; k < 3; ++k) {
    Series line = seriesOf(k == 0 ? "estimate" : "", Style::lines, axis_inks[k], true);
    line.colour = truth_ink;
    for (const std::size_t end : {trace.frames.front(), trace.frames.back()}) {
      line.add(static_cast<double>(end), reference[static_cast<Eigen::Index>(k)]);
    }
    panel.series.push_back(line);
  }
  return panel;
}

/// Traces with the sign of the depths held and released, their angle from the estimate, and the evidence for the sign.
Plot signPlot(std::string name, std::string caption, const MotionTrace& held, const MotionTrace& released,
              const Eigen::Vector3d& reference) {
  Plot plot{.name = std::move(name), .caption = std::move(caption)};
  plot.panels.push_back(tracePanel("sign of the depths held", held, reference));
  plot.panels.push_back(tracePanel("sign released", released, reference));
  Panel angles{"angle from the estimate", {"frame"}, {.label = "deg", .low = -5, .high = 185}};
  Panel evidence{"evidence for positive depths", {"frame"}, {"standard deviations"}};
  evidence.references = {{.at = 0}};
  for (const bool free : {false, true}) {
    const MotionTrace& trace = free ? released : held;
    Series angle = seriesOf(free ? "released" : "held", Style::linespoints, free ? second_ink : estimate_ink);
    Series sign = angle;
    angle.add(beforeFirst(trace), angleBetween(trace.start, reference));
    for (std::size_t i = 0; i < trace.frames.size(); ++i) {
      const auto at = static_cast<double>(trace.frames[i]);
      angle.add(at, angleBetween(trace.directions[i], reference));
      sign.add(at, trace.evidence[i]);
    }
    angles.series.push_back(angle), evidence.series.push_back(sign);
  }
  plot.panels.push_back(angles), plot.panels.push_back(evidence);
  return plot;
}

/// Round levels between the least and the greatest residual.
std::vector<double> contourLevels(const ResidualGrid& grid) {
  Extents range;
  for (const double value : grid.value) {
    if (value > 0) range.add(value);
  }
  std::vector<double> levels;
  for (int exponent = -3; exponent <= 9; ++exponent) {
    for (const double digit : {1.0, 1.5, 2.0, 3.0, 5.0, 7.0}) {
      const double level = digit * std::pow(10.0, exponent);
      if (level > range.low && level < range.high) levels.push_back(level);
    }
  }
  return levels;
}

Plot contourPlot(const MotionFrameStudy& at, const ResidualMap& subspace, const ResidualMap& essential) {
  Plot plot{
      .name = "contours",
      .caption = fmt::format(
          "Contours of the residual of frame {} (figure 11): the subspace filter's, rotation eliminated, with {} "
          "other local minima, and the essential filter's at the rotation of the estimate, with {}. The latter "
          "is a slice through a function of five unknowns; its least value over the rotations is the discrete flow's "
          "residual above.",
          at.frame, subspace.others.size(), essential.others.size())};
  for (const bool second : {false, true}) {
    const ResidualMap& map = second ? essential : subspace;
    Axis colour = colourAxis({&map.grid});
    colour.high = std::nullopt;
    Panel panel{second ? "essential filter, rotation of the estimate" : "subspace filter", tangentAxis(0),
                tangentAxis(1)};
    panel.colour = colour;
    panel.series = {contours("residual", gridOf(map), contourLevels(map.grid))};
    panel.equal_aspect = true;
    panel.add({othersOf(map), star("minimum", map.minimum, second_ink),
               star("estimate", Eigen::Vector2d::Zero(), estimate_ink)});
    plot.panels.push_back(panel);
  }
  return plot;
}

/// Depth over one coordinate: the last positions with two standard deviations, and where they come from.
Panel structurePanel(std::string title, const MotionInterpretation& seen, int coordinate) {
  Panel panel{std::move(title),
              {coordinate == 0 ? "to the right, translations of one frame" : "downwards, translations of one frame"},
              {"depth, translations of one frame"}};
  Series ways = seriesOf("last frames", Style::lines, 5),
         points = seriesOf("last position", Style::errorbars, estimate_ink);
  std::vector<double> depths;
  Extents across, along;
  const std::size_t n = seen.points.back().size();
  for (std::size_t i = 0; i < n; ++i) {
    for (const auto& frame : seen.points) {
      const Eigen::Vector3d X = frame[i].position();
      ways.add(X[coordinate], X.z());
      if (std::isfinite(X.z())) depths.push_back(X.z());
    }
    ways.add(no_value, no_value);
    const StructurePoint& p = seen.points.back()[i];
    const Eigen::Vector3d X = p.position();
    const double sigma = 2 * std::sqrt(p.variance), nearest = 1 / (p.inverse_depth + sigma);
    points.add(X[coordinate], X.z());
    points.low.push_back(nearest > 0 ? nearest : 0);
    points.high.push_back(p.inverse_depth > sigma ? 1 / (p.inverse_depth - sigma) : no_value);
  }
  // Points far behind the rest would leave it no room.
  const double most = depths.empty() ? 1 : 1.6 * liestat::quantile(depths, 0.9);
  along.add(0);
  for (std::size_t k = 0; k < ways.x.size(); ++k) {
    if (ways.y[k] > 0 && ways.y[k] < most) across.add(ways.x[k]), along.add(ways.y[k]);
  }
  for (double& high : points.high) {
    // The bar of a depth that is not told from infinity goes beyond the panel.
    if (std::isnan(high)) high = 10 * most;
    along.add(std::min(high, most));
  }
  across.set(panel.x), along.set(panel.y);
  panel.y.low = 0;
  panel.series = {ways, points};
  return panel;
}

Plot structurePlot(const MotionWindowRuns& runs) {
  Plot plot{.name = "structure",
            .caption = fmt::format(
                "The points as seen from above and from the side, with two standard deviations of their depth, and "
                "their ways over {} frames (figure 12): the rigid interpretation, and what is seen of the direction "
                "turned round, depths brought in front of the camera.",
                runs.frames.size())};
  plot.panels = {
      structurePanel("rigid, from above", runs.rigid, 0), structurePanel("rubbery, from above", runs.rubbery, 0),
      structurePanel("rigid, from the side", runs.rigid, 1), structurePanel("rubbery, from the side", runs.rubbery, 1)};
  return plot;
}

Plot distancesPlot(const MotionWindowRuns& runs) {
  Plot plot{.name = "distances",
            .caption =
                "Distances between pairs of points, no point in two of them, over their first value: they stay in "
                "the rigid interpretation and change in the rubbery one."};
  std::vector<double> changes;
  for (const bool rubbery : {false, true}) {
    const MotionInterpretation& seen = rubbery ? runs.rubbery : runs.rigid;
    Panel panel{rubbery ? "rubbery" : "rigid", {"frame"}, {"change of the distance, %"}};
    panel.references = {{.at = 0}};
    Series lines = seriesOf("distances", Style::lines, rubbery ? second_ink : estimate_ink);
    for (std::size_t i = 1; i < seen.points.front().size(); i += 2) {
      const auto length = [&](std::size_t k) {
        return (seen.points[k][i].position() - seen.points[k][i - 1].position()).norm();
      };
      for (std::size_t k = 0; k < seen.points.size(); ++k) {
        const double change = 100 * (length(k) / length(0) - 1);
        if (std::isfinite(change)) changes.push_back(std::abs(change));
        lines.add(static_cast<double>(runs.frames[k]), change);
      }
      lines.add(no_value, no_value);
    }
    panel.series.push_back(lines);
    plot.panels.push_back(panel);
  }
  if (changes.empty()) return plot;
  // Points near infinity would leave the rest no room.
  const double most = std::max(1.0, 1.3 * liestat::quantile(changes, 0.97));
  for (Panel& panel : plot.panels) panel.y.low = -most, panel.y.high = most;
  return plot;
}

std::string rigidityVerdict(const RigidityComparison& c) {
  if (c.first_is_rigid()) {
    return fmt::format(
        "Flag: RIGID. {} of {} separate distances vary less in the interpretation of the estimate; by "
        "chance that has a probability of {:.2g} (Wilcoxon's signed-rank test).",
        c.steadier, c.distances, c.p_value);
  }
  return fmt::format(
      "Flag: UNDECIDED. {} of {} separate distances vary less in the interpretation of the estimate, which by chance "
      "has a probability of {:.2g} (Wilcoxon's signed-rank test; 0.01 decides, which takes seven distances).",
      c.steadier, c.distances, c.p_value);
}

void structureTable(Report& report, const MotionWindowRuns& runs, const Eigen::Vector3d& Omega) {
  std::vector<std::vector<std::string>> rows;
  for (const bool rubbery : {false, true}) {
    const MotionInterpretation& seen = rubbery ? runs.rubbery : runs.rigid;
    const Eigen::Vector3d& turn = seen.rotation;
    rows.push_back(
        {rubbery ? "rubbery" : "rigid", number(100 * seen.spread, 3),
         fmt::format("{}/{}", rubbery ? runs.comparison.distances - runs.comparison.steadier : runs.comparison.steadier,
                     runs.comparison.distances),
         number(degrees * turn.norm(), 3), number(angleBetween(turn, Omega), 3)});
  }
  report.table({"interpretation", "spread of distances %", "steadier in", "turn deg", "from the rotation's axis deg"},
               rows,
               fmt::format("Over {} frames: the median relative standard deviation of all distances; how many separate "
                           "distances vary less than in the other interpretation; the rotation of the points as a "
                           "whole, and the angle of its axis from that of the estimated rotation (near 180: it turns "
                           "the other way).",
                           runs.frames.size()));
}

void reportFrame(Report& report, const MotionFrameStudy& at) {
  const Eigen::Vector3d V = at.velocity.mean.unit_vector(), T = at.translation.mean.unit_vector();
  const MotionWindowRuns& runs = at.runs;
  report.section(fmt::format("The residual of frame {}", at.frame));
  report.paragraph(fmt::format(
      "Figures from here on are of images alone: frames {} to {}, and the residual of {} pairs of the last one. The "
      "motion turns by {:.3g} deg in this frame.",
      at.first_frame, at.frame, at.pairs.size(), degrees * at.motion.rotation.mean.log().norm()));
  if (!at.hasMaps()) {
    report.paragraph(fmt::format("This frame has {} usable pairs of points, and its figures need {}.", at.usablePairs(),
                                 at.min_pairs));
    return;
  }
  if (!at.motion.ok()) {
    report.paragraph("The filter's estimate of this frame is not one that may be used: look at its flags.");
  }
  const FlowMaps maps{FlowMap{Flow::forward, "forward", at.forward}, FlowMap{Flow::midpoint, "midpoint", at.midpoint},
                      FlowMap{Flow::discrete, "discrete", at.discrete}};
  report.plot(residualPlot(at, maps));
  residualTable(report, at, maps);
  report.plot(contourPlot(at, at.midpoint, at.essential));

  report.section("Convergence");
  report.plot(convergencePlot(at, runs, at.midpoint));
  report.plot(signPlot("sign",
                       "The subspace filter from the farthest start that arrives, with the sign of the depths held and "
                       "released (figures 9 and 10); dashed the estimate of the last frame.",
                       runs.held, runs.released, V));
  report.plot(
      signPlot("essential",
               "The essential filter from the rubbery state, the estimate with its translation turned round, with "
               "the sign of the depths held and released (figure 13); dashed the estimate of the last frame.",
               runs.essential_held, runs.essential_released, T));

  report.section("Structure");
  if (!runs.hasStructure()) {
    report.paragraph("No four tracks have a depth in two successive frames up to this one.");
    return;
  }
  report.paragraph(rigidityVerdict(runs.comparison));
  structureTable(report, runs, at.motion.rotation.mean.log());
  report.plot(structurePlot(runs));
  report.plot(distancesPlot(runs));
}

}  // namespace

void writeMotionReport(const std::string& directory, const std::string& command_line, const MotionResult& result,
                       const MotionFrameStudy& study) {
  Report report(directory, "Motion from point tracks");
  const Verdict verdict = result.verdict();
  // The page has a colour for what the terminal says in capitals.
  constexpr std::string_view loud = "NOT TO BE TRUSTED", calm = "Not to be trusted";
  std::string text = verdict.text + ".";
  if (text.starts_with(loud)) text.replace(0, loud.size(), calm);
  report.verdict(verdict.answer, text);
  report.code(command_line);
  report.section("Estimates");
  report.plot(estimatesPlot(result));
  if (result.with_truth) report.plot(errorsPlot(result));
  report.code(formatMotion(result));
  reportFrame(report, study);
  report.write();
}

}  // namespace liestat::cli
