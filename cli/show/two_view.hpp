#pragma once

#include <formats/colmap.hpp>
#include <fusion/two_view/two_view_types.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

namespace liestat::cli {

/// The result that `liestat two-view` shows.
struct TwoViewMotionOutput {
  std::string file;
  std::vector<Eigen::Vector4d> matches;  ///< px
  TwoViewMotionEstimate estimate;
};
template <class V>
void describe(V& v, const TwoViewMotionOutput& output) {
  v("file", output.file);
  describe(v, output.estimate);
}

/// The results that `liestat two-view --motions` shows.
struct TwoViewMotionsOutput {
  std::string file;
  std::vector<Eigen::Vector4d> matches;  ///< px
  TwoViewMotions motions;
};
template <class V>
void describe(V& v, const TwoViewMotionsOutput& output) {
  v("file", output.file);
  describe(v, output.motions);
}

/// The pairs of a database of COLMAP.
struct ColmapOutput {
  std::string database;
  double sigma = 1;  ///< px
  std::vector<ColmapPair> pairs;
  std::vector<std::string> files;

  std::size_t written() const {
    return static_cast<std::size_t>(
        std::count_if(pairs.begin(), pairs.end(), [](const ColmapPair& p) { return p.isWritten(); }));
  }
};
template <class V>
void describe(V& v, const ColmapOutput& output) {
  v("database", output.database)("sigma", output.sigma, "of each coordinate", "px");
  v("pairs", output.pairs, "with matches")("written", output.written(), "pairs in the copy")("files", output.files);
}

/// The pairs by their configurations, and those that are not written with the reason.
std::string formatColmapPairs(const ColmapOutput& output);

/// The chosen model, its parameters and the lattice, for the terminal.
std::string formatTwoViewMotion(const TwoViewMotionOutput& output);

/// Writes a page with matches, errors and the lattice into a directory.
void writeTwoViewMotionReport(const std::string& directory, const std::string& command_line,
                              const TwoViewMotionOutput& output);

/// The same of several motions.
std::string formatTwoViewMotions(const TwoViewMotionsOutput& output);
void writeTwoViewMotionsReport(const std::string& directory, const std::string& command_line,
                               const TwoViewMotionsOutput& output);

}  // namespace liestat::cli
