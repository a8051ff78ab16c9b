#include <cli/show/units.hpp>
#include <cli/show/validations.hpp>
#include <experiments/closed_form_cases.hpp>
#include <experiments/two_solutions.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

using Vector3 = Eigen::Vector3d;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// t0's axes turned so that the true vertical is z and the features are ahead, in the plane of x and z.
Eigen::Matrix3d drawingAxes(const TwoSolutions& found) {
  const Vector3 up = -found.scene.gravity.normalized();
  Vector3 ahead = Vector3::Zero();
  for (const Vector3& P : found.scene.features) ahead += P;
  ahead = (ahead - ahead.dot(up) * up).normalized();
  Eigen::Matrix3d axes;
  axes << ahead.transpose(), up.cross(ahead).transpose(), up.transpose();
  return axes;
}

/// Points in the drawing's axes; NaN breaks a line.
struct Curve {
  std::string name;
  Style style = Style::lines;
  std::size_t colour = 0;
  bool dashed = false;
  std::vector<Vector3> points;
};

/// The body's three axes at a position.
void addAxes(Curve& curve, const Vector3& at, const Eigen::Matrix3d& body, double length) {
  for (int k = 0; k < 3; ++k) {
    curve.points.insert(curve.points.end(), {at, at + length * body.col(k), Vector3::Constant(nan)});
  }
}

std::vector<Curve> curves(const TwoSolutions& found) {
  const InertialScene& scene = found.scene;
  const Eigen::Matrix3d axes = drawingAxes(found);
  const double size = std::max(extent(scene, found.result.solutions[0]), extent(scene, found.result.solutions[1]));
  const double length = 0.04 * size;
  constexpr std::size_t black = 6;
  std::vector<Curve> list, above;
  for (std::size_t k = 0; k < 2; ++k) {
    const ClosedFormSolution& s = found.result.solutions[k];
    const std::string label = fmt::format("solution {}", k + 1);
    Curve rays{.name = "", .colour = k, .dashed = true, .points = {}};
    Curve stars{.name = label + ": features", .style = Style::stars, .colour = k, .points = {}};
    for (const Vector3& P : s.features) {
      stars.points.push_back(axes * P);
      rays.points.insert(rays.points.end(), {Vector3::Zero(), axes * P, Vector3::Constant(nan)});
    }
    Curve path{.name = label + ": body", .colour = k, .points = {}};
    const double end = scene.times.back();
    for (int i = 0; i <= 60; ++i) path.points.push_back(axes * positionAt(scene, s, end * i / 60));
    Curve bodies{.name = "", .colour = k, .points = {}};
    for (std::size_t j = 1; j < scene.times.size(); ++j) {
      addAxes(bodies, axes * positionAt(scene, s, scene.times[j]), axes * scene.window.images[j].rotation, length);
    }
    Curve places{.name = "", .style = Style::points, .colour = k, .points = {}};
    for (std::size_t j = 1; j < scene.times.size(); ++j) {
      places.points.push_back(axes * positionAt(scene, s, scene.times[j]));
    }
    Curve down{.name = label + ": down", .colour = k == 0 ? std::size_t{5} : std::size_t{4}, .points = {}};
    down.points = {Vector3::Zero(), 0.2 * size * (axes * s.gravity).normalized()};
    list.insert(list.end(), {rays, path, bodies, places});
    above.insert(above.end(), {down, stars});
  }
  Curve start{.name = "at t0, of both", .colour = black, .points = {}};
  addAxes(start, Vector3::Zero(), axes, 1.6 * length);
  above.push_back(start);
  list.insert(list.end(), above.begin(), above.end());
  return list;
}

Panel projection(const std::vector<Curve>& list, const std::string& title, int horizontal, int vertical) {
  const char* labels[] = {"x, m (towards the features)", "y, m", "z, m (upwards)"};
  Panel panel{.title = title, .x = {.label = labels[horizontal]}, .y = {.label = labels[vertical]}};
  panel.equal_aspect = true;
  for (const Curve& c : list) {
    Series series{.name = c.name, .style = c.style, .colour = c.colour, .dashed = c.dashed};
    for (const Vector3& p : c.points) {
      series.x.push_back(p[horizontal]);
      series.y.push_back(p[vertical]);
    }
    panel.series.push_back(series);
  }
  return panel;
}

std::string vectorText(const Vector3& v) { return fmt::format("{:.3f}, {:.3f}, {:.3f}", v.x(), v.y(), v.z()); }

std::vector<std::vector<std::string>> solutionRows(const TwoSolutions& found) {
  std::vector<std::vector<std::string>> rows;
  const Vector3 first = found.result.solutions[0].gravity;
  for (std::size_t k = 0; k < found.result.solutions.size(); ++k) {
    const ClosedFormSolution& s = found.result.solutions[k];
    std::string features;
    for (const Vector3& P : s.features) features += (features.empty() ? "" : "; ") + vectorText(P);
    const double tilt = std::atan2(first.cross(s.gravity).norm(), first.dot(s.gravity)) * degrees;
    rows.push_back({fmt::format("{}{}", k + 1, k == found.truth ? " (the truth)" : ""), vectorText(s.velocity),
                    vectorText(s.gravity), fmt::format("{:.2f}", s.roll() * degrees),
                    fmt::format("{:.2f}", s.pitch() * degrees), fmt::format("{:.2f}", tilt), features,
                    fmt::format("{:.1e}", s.cost)});
  }
  return rows;
}

std::string summary(const TwoSolutions& found) {
  const InertialScene& scene = found.scene;
  std::string text = fmt::format("{} feature{} in {} images over {:g} s, {}; null dimension {}.", scene.features.size(),
                                 scene.features.size() == 1 ? "" : "s", scene.times.size(), scene.times.back(),
                                 found.figure == 1 ? "an acceleration that varies" : "a constant acceleration",
                                 found.result.null_dimension);
  if (found.figure == 2) {
    const auto& images = scene.window.images;
    const Vector3 A = meanSpecificForce(images[3], images[6]);
    const double predicted = secondSolutionScale(A, found.result.solutions[0].gravity);
    text += fmt::format(
        " Specific force {:.3f} m/s² against g = {:.2f}: the second solution is the first one's scene scaled by "
        "(|A|² - g²)/|a|² = {:.6f}; its features are scaled by {:.6f}.",
        A.norm(), InertialScene::g, predicted, measuredScale(found));
  } else {
    text += " The second solution is not a scaled copy of the first.";
  }
  return text;
}

std::string textOf(const TwoSolutions& found) {
  std::string text = fmt::format("Figure {} of A. Martinelli (2012), scene of seed {}\n{}\n\n", found.figure,
                                 found.seed, summary(found));
  for (std::size_t k = 0; k < 2; ++k) {
    const ClosedFormSolution& s = found.result.solutions[k];
    text += fmt::format("solution {}{}\n  V       {} m/s\n  G       {} m/s²\n", k + 1,
                        k == found.truth ? " (the truth)" : "", vectorText(s.velocity), vectorText(s.gravity));
    for (const Vector3& P : s.features) text += fmt::format("  feature {} m\n", vectorText(P));
  }
  return text;
}

/// The page: both solutions drawn, and tables of them.
void drawPage(Report& report, const TwoSolutions& found) {
  const std::vector<Curve> list = curves(found);
  report.plot({.name = fmt::format("fig{}", found.figure),
               .caption = "Positions and axes of the body and features (stars) of both solutions.",
               .panels = {projection(list, "from above", 0, 1), projection(list, "from the side", 0, 2)}});
  report.table({"solution", "V m/s", "G m/s²", "roll deg", "pitch deg", "vertical off the first's, deg",
                "features P_i m", "cost"},
               solutionRows(found), "In the body's axes at t0.");
  std::vector<std::vector<std::string>> times;
  for (std::size_t j = 0; j < found.scene.times.size(); ++j) {
    const double t = found.scene.times[j];
    times.push_back({fmt::format("{}", j), fmt::format("{:.4f}", t),
                     vectorText(positionAt(found.scene, found.result.solutions[0], t)),
                     vectorText(positionAt(found.scene, found.result.solutions[1], t))});
  }
  report.table({"image", "t s", "body, solution 1, m", "body, solution 2, m"}, times, "In the body's axes at t0.");
}

}  // namespace

ValidationView viewOf(const TwoSolutions& found) {
  const char* figure = found.figure == 1
                           ? "A. Martinelli's figure 1 (2012): one feature seen in four images, two distinct solutions."
                           : "A. Martinelli's figure 2 (2012): three features in seven images, constant acceleration, "
                             "two distinct solutions.";
  return {.title = fmt::format("Two solutions: figure {} of the paper", found.figure),
          .introduction = fmt::format(
              "{}\n{}\nThe paper gives no numbers for its figures: this scene is a simulated one, the first from the "
              "seed on that has two solutions with all features in front of the camera and can be drawn. Both "
              "solutions are the closed form's, from exact bearings and readings. The body at t0 is the same for both; "
              "the axes are its own, turned so that the true vertical is z. Each solution has a vertical of its own "
              "(its direction down is drawn at t0). Strokes are the body's axes at the images, dashed lines the "
              "feature's first bearing, which both solutions share.",
              figure, summary(found)),
          .fields = [&found](JsonObject& object) { object.fieldsOf(found); },
          .head = textOf(found),
          .page = [&found](Report& report) { drawPage(report, found); }};
}

}  // namespace liestat::cli
