// The program's readers and writer of trajectories and pose graphs for Python.
#include <formats/bag.hpp>
#include <formats/input_error.hpp>
#include <formats/pose_graph.hpp>
#include <formats/text.hpp>
#include <formats/trajectory.hpp>
#include <python/src/array_operations.hpp>
#include <python/src/described.hpp>
#include <stats/convention_presets.hpp>

#include <pybind11/stl.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace liestat::python {
namespace {

DoubleArray arrayOfPoses(const std::vector<SE3d>& poses) {
  DoubleArray array({static_cast<py::ssize_t>(poses.size()), py::ssize_t{7}});
  for (std::size_t i = 0; i < poses.size(); ++i) storePoint(poses[i], array.mutable_data() + 7 * i);
  return array;
}
template <class List, class Matrix>
DoubleArray arrayOfMatrices(const List& list, Matrix matrix) {
  DoubleArray array({static_cast<py::ssize_t>(list.size()), py::ssize_t{6}, py::ssize_t{6}});
  for (std::size_t i = 0; i < list.size(); ++i) store(matrix(list[i]), array.mutable_data() + 36 * i);
  return array;
}
py::object nameOf(const std::optional<Convention>& c) {
  return c ? py::object(text(conventionName(*c, false))) : py::none();
}

TrajectoryOptions readingOptions(const std::string& format, const std::string& covariance_file,
                                 const std::string& layout, double unmeasured, const std::vector<std::string>& columns,
                                 bool ignore_unknown, double norm_tolerance, const std::string& time_unit,
                                 double largest_file, const std::string& frames) {
  TrajectoryOptions options;
  options.reading.frames = frames;
  options.format = format, options.covariance_file = covariance_file, options.unmeasured = unmeasured;
  options.reading.columns = columns, options.reading.ignore_unknown = ignore_unknown;
  options.reading.norm_tolerance = norm_tolerance, options.reading.largest_file = largest_file;
  options.time_unit = named<StampUnit>(time_unit);
  Convention c;
  if (!layout.empty() && setConventionField(c, "layout", layout)) options.layout = c.layout;
  return options;
}

py::dict readTrajectory(const std::string& path, const std::string& convention, const std::string& format,
                        const std::string& covariance_file, const std::string& layout, double unmeasured,
                        const std::vector<std::string>& columns, bool ignore_unknown, double norm_tolerance,
                        const std::string& time_unit, const std::string& duplicates, double largest_file,
                        const std::string& frames) {
  const TrajectoryOptions options = readingOptions(format, covariance_file, layout, unmeasured, columns, ignore_unknown,
                                                   norm_tolerance, time_unit, largest_file, frames);
  const Trajectory t = [&] {
    const py::gil_scoped_release released;
    Trajectory read = liestat::readTrajectory(path, options);
    if (!duplicates.empty()) orderInTime(read, named<DuplicateRule>(duplicates));
    return read;
  }();
  py::dict d;
  d["poses"] = arrayOfPoses(t.poses);
  d["times"] = t.hasTimes() ? py::object(arrayOf(t.times, {static_cast<py::ssize_t>(t.times.size())})) : py::none();
  py::list texts;
  for (std::size_t i = 0; i < t.time_texts.size(); ++i) texts.append(t.time_texts[i]);
  d["time_texts"] = t.hasTimes() ? py::object(texts) : py::none();
  for (const char* part : {"covariances", "matrices", "convention"}) d[part] = py::none();
  if (t.hasCovariances()) {
    d["matrices"] = arrayOfMatrices(t.covariances, [](const Matrix6d& m) -> const Matrix6d& { return m; });
    if (convention != "unknown") {
      std::optional<Convention> given;
      if (!convention.empty()) given = conventionNamed(convention, "convention");
      const Convention c = conventionOf(t, given, "convention");
      d["convention"] = nameOf(c);
      d["covariances"] = arrayOfMatrices(gaussiansOf(t, c), [](const auto& g) { return g.covariance; });
    }
  }
  d["stated_convention"] = nameOf(t.stated_convention);
  d["order"] = t.fixed_order ? py::object(text(name(*t.fixed_order))) : py::none();
  d["format"] = t.format;
  d["lines"] = DictView::of(t.lines);
  d["frames"] = t.frames;
  d["notes"] = notesOf(t, options);
  return d;
}

py::dict readPoseGraph(const std::string& path, bool ignore_unknown, double norm_tolerance) {
  const PoseGraph graph = [&] {
    const py::gil_scoped_release released;
    return liestat::readPoseGraph(path, ignore_unknown, norm_tolerance);
  }();
  std::vector<SE3d> poses, measurements;
  std::vector<std::int64_t> ids, from, to;
  std::vector<std::size_t> lines;
  for (const GraphVertex& v : graph.vertices) poses.push_back(v.pose), ids.push_back(v.id);
  for (const GraphEdge& e : graph.edges) {
    measurements.push_back(e.measurement), from.push_back(e.from), to.push_back(e.to), lines.push_back(e.line);
  }
  py::dict d;
  d["format"] = name(graph.format), d["planar"] = graph.planar;
  d["ids"] = DictView::of(ids), d["poses"] = arrayOfPoses(poses);
  d["sources"] = DictView::of(from), d["targets"] = DictView::of(to);
  d["measurements"] = arrayOfPoses(measurements);
  d["matrices"] = arrayOfMatrices(graph.edges, [](const GraphEdge& e) -> const Matrix6d& { return e.matrix; });
  d["stated_convention"] = nameOf(graph.stated_convention);
  d["lines"] = DictView::of(lines);
  return d;
}

/// The convention in which a format is written, as a name with its layout.
std::string conventionToWrite(const std::string& format, const std::string& asked) {
  return conventionName(liestat::conventionToWrite(format, asked, "write_trajectory", "convention"));
}

/// The text of a file, of its side file, and notes. The matrices are in the convention that conventionToWrite returned.
py::tuple formatTrajectory(const DoubleArray& poses, const std::optional<DoubleArray>& matrices,
                           const std::vector<std::string>& times, const std::string& format,
                           const std::string& convention, const std::vector<std::string>& frames) {
  Trajectory t;
  t.name = "write_trajectory", t.format = format, t.frames = frames;
  for (const std::string& time : times) {
    t.time_texts.push_back(time);
    double value = 0;
    if (parseNumber(time, value) != NumberKind::finite) {
      throw InputError(t.name, 0, "the time '" + printable(time) + "'", "a finite number of seconds");
    }
    t.times.push_back(value);
  }
  for (py::ssize_t i = 0; i < poses.shape(0); ++i) {
    t.poses.push_back(point<SE3d>(poses.data() + 7 * i));
    if (matrices) t.covariances.push_back(square<6>(matrices->data() + 36 * i));
    t.lines.push_back(0);
  }
  const Convention c = convention.empty() ? Convention{} : *parseConvention(convention);
  const TrajectoryText file = liestat::formatTrajectory(t, format, c);
  return py::make_tuple(file.text, file.side_file, notesOf(file, format, c));
}

}  // namespace

void bindTrajectoryFiles(py::module_& module) {
  module.def("read_trajectory", &readTrajectory);
  module.def("list_bag", [](const std::string& path, double largest_file) {
    const BagContents bag = [&] {
      const py::gil_scoped_release released;
      return listBag(path, largest_file);
    }();
    return DictView::of(bag);
  });
  module.def("read_pose_graph", &readPoseGraph);
  module.def("convention_to_write", &conventionToWrite);
  module.def("format_trajectory", &formatTrajectory);
  module.attr("TRAJECTORY_FORMATS") = py::tuple(py::cast(trajectoryFormatNames()));
  module.attr("WRITTEN_TRAJECTORY_FORMATS") = py::tuple(py::cast(trajectoryFormatNames(false)));
}

}  // namespace liestat::python
