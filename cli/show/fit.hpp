#pragma once

#include <stats/directional_laws.hpp>
#include <stats/fit_summary_types.hpp>

#include <Eigen/Core>

#include <string>

namespace liestat::cli {

/// The result that `liestat fit` shows.
struct FitOutput {
  std::string file;
  Eigen::MatrixXd points;  ///< one in each row
  FitSummary fit;
};
template <class V>
void describe(V& v, const FitOutput& output) {
  v("file", output.file);
  describe(v, output.fit);
  describeSeries(v, output.fit);
}

/// A law that `liestat fit --law` shows.
struct LawOutput {
  std::string file;
  LawFit fit;
};
template <class V>
void describe(V& v, const LawOutput& output) {
  v("file", output.file);
  describe(v, output.fit);
}
std::string formatLaw(const LawOutput& output);
void writeLawReport(const std::string& directory, const std::string& command_line, const LawOutput& output);

/// Verdict and parameters, for the terminal.
std::string formatFit(const FitOutput& output);

/// Writes a page with the curve through the points, their distances and the parameters into a directory.
void writeFitReport(const std::string& directory, const std::string& command_line, const FitOutput& output);

}  // namespace liestat::cli
