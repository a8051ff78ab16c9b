#include <formats/pose_graph.hpp>

#include <formats/input_error.hpp>
#include <formats/numeric_table.hpp>
#include <formats/text.hpp>
#include <formats/detail/trajectory_rows.hpp>
#include <lie/euler.hpp>
#include <stats/convention_layouts.hpp>
#include <stats/convention_presets.hpp>

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>
#include <iterator>
#include <utility>

namespace liestat {
namespace {

/// A kind of line: its tag, what follows the ids, and the layout of an edge's matrix.
struct GraphTag {
  GraphFormat format;
  std::string_view tag;
  bool edge, planar;
  std::size_t pose;  ///< numbers of a pose: 3 planar, 6 with angles, 7 with a quaternion
  CovarianceLayout layout = CovarianceLayout::upper21;
};
constexpr GraphTag graph_tags[] = {
    {GraphFormat::g2o, "VERTEX_SE3:QUAT", false, false, 7},
    {GraphFormat::g2o, "EDGE_SE3:QUAT", true, false, 7},
    {GraphFormat::g2o, "VERTEX_SE2", false, true, 3},
    {GraphFormat::g2o, "EDGE_SE2", true, true, 3, CovarianceLayout::planar6},
    {GraphFormat::toro, "VERTEX3", false, false, 6},
    {GraphFormat::toro, "EDGE3", true, false, 6},
    {GraphFormat::toro, "VERTEX2", false, true, 3},
    {GraphFormat::toro, "EDGE2", true, true, 3, CovarianceLayout::toro6},
    // TORO's own files write these too.
    {GraphFormat::toro, "VERTEX", false, true, 3},
    {GraphFormat::toro, "EDGE", true, true, 3, CovarianceLayout::toro6},
};

constexpr std::string_view parameters = "PARAMS_";

const GraphTag* graphTag(std::string_view word) {
  for (const GraphTag& tag : graph_tags) {
    if (tag.tag == word) return &tag;
  }
  return nullptr;
}
const GraphTag& graphTag(GraphFormat format, bool edge, bool planar) {
  for (const GraphTag& tag : graph_tags) {
    if (tag.format == format && tag.edge == edge && tag.planar == planar) return tag;
  }
  return graph_tags[0];
}

/// Reads the lines of one text.
class GraphReader {
 public:
  GraphReader(std::string_view text, std::string name, bool ignore_unknown, double norm_tolerance)
      : reader_(text), ignore_unknown_(ignore_unknown), norm_tolerance_(norm_tolerance) {
    requireText(text, name);
    graph_.name = name;
    scratch_.name = std::move(name);
  }

  PoseGraph read() {
    while (reader_.next()) readLine();
    if (graph_.vertices.empty() && graph_.edges.empty())
      throw InputError(graph_.name, 0, "the file has no vertices and no edges", "g2o or TORO");
    graph_.n_normalised = scratch_.n_normalised;
    graph_.stated_convention = statedConvention(graph_.format, graph_.planar);
    return std::move(graph_);
  }

 private:
  std::size_t line() const { return reader_.number(); }

  std::int64_t id(std::size_t k) const {
    const std::string_view field = fields_[k];
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    if (error != std::errc() || end != field.data() + field.size()) {
      throw InputError(graph_.name, line(), fmt::format("the vertex is '{}'", printable(field)), "a whole number");
    }
    return value;
  }
  double number(std::size_t k) const {
    return numberField(fields_[k], fmt::format("field {} of {}", k, fields_[0]), graph_.name, line());
  }

  void readLine() {
    splitFields(reader_.line(), Separator::blanks, fields_);
    if (fields_[0] == "FIX") {
      for (std::size_t k = 1; k < fields_.size(); ++k) graph_.fixed.push_back(id(k));
      return;
    }
    const GraphTag* const tag = graphTag(fields_[0]);
    if (tag == nullptr) {
      // Only edges of other kinds than ours refer to parameters.
      if (ignore_unknown_ || fields_[0].substr(0, parameters.size()) == parameters) return;
      throw InputError(graph_.name, line(), fmt::format("a line of '{}'", printable(fields_[0])),
                       "vertices and edges of g2o (VERTEX_SE3:QUAT, EDGE_SE3:QUAT, VERTEX_SE2, EDGE_SE2, FIX) or TORO "
                       "(VERTEX3, EDGE3, VERTEX2, EDGE2); --ignore-unknown passes over others");
    }
    if (graph_.vertices.empty() && graph_.edges.empty()) graph_.format = tag->format, graph_.planar = tag->planar;
    if (graph_.format != tag->format || graph_.planar != tag->planar) {
      throw InputError(graph_.name, line(),
                       fmt::format("{} in a file of {}", tag->tag, graphTag(graph_.format, true, graph_.planar).tag),
                       "one format, and one dimension");
    }
    const std::size_t ids = tag->edge ? 2 : 1, begin = 1 + ids, end = begin + tag->pose;
    const std::size_t matrix = tag->edge ? layoutSize(tag->layout) : 0;
    // Public files of edges exist without their matrices.
    const bool bare = tag->edge && fields_.size() == end;
    if (fields_.size() != end + matrix && !bare) {
      throwWrongWidth(fields_.size(), end + matrix, fmt::format("of {}", tag->tag), graph_.name, line());
    }
    const SE3d pose = readPose(*tag, begin);
    if (!tag->edge) {
      graph_.vertices.push_back({id(1), pose, line()});
      return;
    }
    std::vector<double> numbers(matrix, unknown_entry);
    if (bare) {
      ++graph_.n_unknown;
    } else {
      for (std::size_t k = 0; k < matrix; ++k) numbers[k] = number(end + k);
    }
    scratch_.covariances.clear();
    detail::appendCovariance(scratch_, {.layout = tag->layout}, numbers, line());
    graph_.edges.push_back({id(1), id(2), pose, scratch_.covariances.back(), line()});
  }

  SE3d readPose(const GraphTag& tag, std::size_t begin) {
    if (tag.planar) {
      return SE3d(SO3d::rotZ(number(begin + 2)), Eigen::Vector3d(number(begin), number(begin + 1), 0));
    }
    const Eigen::Vector3d position(number(begin), number(begin + 1), number(begin + 2));
    if (tag.pose == 6) {
      return SE3d(fromRollPitchYaw(number(begin + 3), number(begin + 4), number(begin + 5)), position);
    }
    const Eigen::Vector4d xyzw(number(begin + 3), number(begin + 4), number(begin + 5), number(begin + 6));
    return detail::poseOf(position, xyzw, norm_tolerance_, scratch_, line());
  }

  LineReader reader_;
  bool ignore_unknown_;
  double norm_tolerance_;
  PoseGraph graph_;
  Trajectory scratch_;  ///< receives covariances and counts from the readers that it shares with trajectories
  std::vector<std::string_view> fields_;
};

void writePose(std::back_insert_iterator<std::string> out, const GraphTag& tag, const SE3d& pose) {
  const Eigen::Vector3d p = pose.translation();
  if (tag.planar) {
    // From the quaternion: the matrix would cost a digit.
    const auto q = pose.unit_quaternion();
    const double sign = q.w() < 0 ? -1 : 1;
    fmt::format_to(out, " {:.17g} {:.17g} {:.17g}", p[0], p[1], 2 * std::atan2(sign * q.z(), sign * q.w()));
    return;
  }
  fmt::format_to(out, " {:.17g} {:.17g} {:.17g}", p[0], p[1], p[2]);
  if (tag.pose == 6) {
    // Plus zero: no negative one.
    const Eigen::Vector3d a = toRollPitchYaw(pose.so3()) + Eigen::Vector3d::Zero();
    fmt::format_to(out, " {:.17g} {:.17g} {:.17g}", a[0], a[1], a[2]);
  } else {
    const Eigen::Vector4d q = pose.unit_quaternion().coeffs();
    fmt::format_to(out, " {:.17g} {:.17g} {:.17g} {:.17g}", q[0], q[1], q[2], q[3]);
  }
}

}  // namespace

std::optional<Convention> statedConvention(GraphFormat format, bool planar) {
  if (format == GraphFormat::toro) return planar ? std::nullopt : conventionPreset("toro");
  if (!planar) return std::nullopt;
  return Convention{.perturbation = Perturbation::body_axes,
                    .content = CovarianceContent::information,
                    .layout = CovarianceLayout::planar6};
}

std::optional<GraphFormat> graphFormatOf(std::string_view text) {
  LineReader reader(text);
  std::vector<std::string_view> fields;
  // Lines of other kinds may stand above those that count.
  for (int line = 0; line < 100 && reader.next(); ++line) {
    splitFields(reader.line(), Separator::blanks, fields);
    if (const GraphTag* const tag = graphTag(fields[0])) return tag->format;
    const auto begins = [&](std::string_view word) { return fields[0].substr(0, word.size()) == word; };
    if (fields[0] == "FIX" || begins(parameters)) return GraphFormat::g2o;
    if (!begins("VERTEX") && !begins("EDGE")) break;
  }
  return std::nullopt;
}

PoseGraph readPoseGraph(const std::string& path, bool ignore_unknown, double norm_tolerance) {
  const TextFile file = loadText(path);
  return parseGraph(file.text, file.name, ignore_unknown, norm_tolerance);
}

PoseGraph parseGraph(std::string_view text, std::string name, bool ignore_unknown, double norm_tolerance) {
  return GraphReader(text, std::move(name), ignore_unknown, norm_tolerance).read();
}

Convention conventionOf(const PoseGraph& graph, const std::optional<Convention>& given, std::string_view option) {
  if (!given && !graph.stated_convention) {
    throw InputError(
        graph.name, 0,
        graph.planar ? "TORO's planar edges do not say along which axes their matrices are"
                     : "g2o's edges do not say whether their angles are halves (g2o itself) or whole "
                       "(GTSAM, SE-Sync)",
        graph.planar ? fmt::format("{} toro (axes of the pose that the edge leaves) or g2o-full (of the other)", option)
                     : fmt::format("{} g2o-half or g2o-full", option));
  }
  Convention convention = given ? *given : *graph.stated_convention;
  convention.layout = graphTag(graph.format, true, graph.planar).layout;
  if (graph.planar && convention.unit != RotationUnit::degree) convention.unit = RotationUnit::radian;
  return convention;
}

std::string formatGraph(const PoseGraph& graph, GraphFormat format, const Convention& convention) {
  const GraphTag& vertex = graphTag(format, false, graph.planar);
  const GraphTag& edge = graphTag(format, true, graph.planar);
  Convention layout = convention;
  layout.layout = edge.layout;
  std::string text;
  const auto out = std::back_inserter(text);
  for (const GraphVertex& v : graph.vertices) {
    fmt::format_to(out, "{} {}", vertex.tag, v.id);
    writePose(out, vertex, v.pose);
    text += '\n';
  }
  if (format == GraphFormat::g2o) {
    for (const std::int64_t id : graph.fixed) fmt::format_to(out, "FIX {}\n", id);
  }
  for (const GraphEdge& e : graph.edges) {
    fmt::format_to(out, "{} {} {}", edge.tag, e.from, e.to);
    writePose(out, edge, e.measurement);
    const PackedCovariance packed = packCovariance(layout, e.matrix);
    std::size_t n_unknown = 0;
    for (const double v : packed.numbers()) n_unknown += std::isnan(v);
    if (n_unknown > 0 && (n_unknown < packed.size || format == GraphFormat::g2o)) {
      throw InputError(graph.name, e.line,
                       fmt::format("{} of {} numbers of this edge's matrix are not known", n_unknown, packed.size),
                       fmt::format("all of them, which the format {} cannot do without", liestat::name(format)));
    }
    if (n_unknown == 0) {
      for (const double v : packed.numbers()) fmt::format_to(out, " {:.17g}", v);
    }
    text += '\n';
  }
  return text;
}

}  // namespace liestat
