// Pose graphs in the files of g2o and TORO: vertices, and edges with the matrices beside them as they are.
#pragma once

#include <formats/trajectory.hpp>
#include <stats/words.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace liestat {

/// The program whose file it is. In three dimensions g2o's edges have quaternions, TORO's roll, pitch and yaw.
enum class GraphFormat { g2o, toro };
constexpr auto words(GraphFormat) { return std::array{"g2o", "toro"}; }

/// A pose, and the line of the file that it stands in.
struct GraphVertex {
  std::int64_t id = 0;
  SE3d pose;
  std::size_t line = 0;
};

/// An edge: the measured from_T_to.
struct GraphEdge {
  std::int64_t from = 0, to = 0;
  SE3d measurement;
  Matrix6d matrix;  ///< in the convention of the file, of which only the layout is undone; NaN where unknown
  std::size_t line = 0;
};

/// The vertices and edges of a file. Planar ones are rotated about z and have z = 0; their matrices know x, y and yaw.
struct PoseGraph {
  std::string name;  ///< the file's name, for messages
  GraphFormat format = GraphFormat::g2o;
  bool planar = false;
  std::vector<GraphVertex> vertices;
  std::vector<GraphEdge> edges;
  std::vector<std::int64_t> fixed;              ///< FIX of g2o
  std::optional<Convention> stated_convention;  ///< that of the format; nothing if it is for the user to say
  std::size_t n_unknown = 0;                    ///< edges without a matrix
  std::size_t n_normalised = 0;                 ///< rotations that were off their norm by more than rounding
};

/// The format of a text that begins like a file of vertices and edges; nothing for others.
std::optional<GraphFormat> graphFormatOf(std::string_view text);
inline bool looksLikeGraph(std::string_view text) { return graphFormatOf(text).has_value(); }

/// The convention that a format fixes for the matrices of its edges; nothing where it is for the user to say.
std::optional<Convention> statedConvention(GraphFormat format, bool planar);

/// Reads a graph from a file, or from memory; throws InputError. Tags that are none of theirs are passed over if asked for, and an error otherwise.
PoseGraph readPoseGraph(const std::string& path, bool ignore_unknown = false, double norm_tolerance = 1e-3);
PoseGraph parseGraph(std::string_view text, std::string name, bool ignore_unknown = false,
                     double norm_tolerance = 1e-3);

/// The convention of the edges' matrices: that of the format, or the one that the user names with an option. g2o's
/// three-dimensional edges and TORO's planar ones need the latter; the angle of planar edges is always in radians (or
/// degrees), since halves belong to quaternions. Throws InputError.
Convention conventionOf(const PoseGraph& graph, const std::optional<Convention>& given, std::string_view option);

/// The text of a graph in a format, numbers with 17 digits. The matrices are in the convention, whose content has to be
/// said. Edges without a matrix are written without one in TORO's format and are an InputError in g2o's.
std::string formatGraph(const PoseGraph& graph, GraphFormat format, const Convention& convention);

}  // namespace liestat
