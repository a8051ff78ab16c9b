#pragma once

#include <fusion/two_view/two_view_types.hpp>

#include <Eigen/Core>

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
