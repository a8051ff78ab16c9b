#pragma once

#include <formats/pose_pairs.hpp>
#include <fusion/hand_eye_types.hpp>

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {

/// Where the covariances of a file's poses come from.
enum class PoseNoise {
  columns,  ///< covariance columns of the file
  option,   ///< --sigma-a, --sigma-b
  assumed   ///< a default; its factor is found in the residuals
};

/// One of the files of `liestat hand-eye`.
struct HandEyeFile {
  std::string path;
  PoseNoise noise = PoseNoise::assumed;
  Eigen::Matrix<double, 6, 1> sigma;  ///< m, rad; where it does not come from columns
  bool inverted = false;
  std::size_t rows = 0, unmatched = 0;
};

template <class V>
void describe(V& v, const HandEyeFile& f) {
  constexpr std::array noises = {"columns", "option", "assumed"};
  v("file", f.path)("rows", f.rows)("unmatched", f.unmatched, "rows without a partner")("inverted", f.inverted);
  v("noise", noises[static_cast<std::size_t>(f.noise)], "where its covariances come from");
  v("sigma", f.noise == PoseNoise::columns ? std::nullopt : std::optional(LocalPoseSigmas{{f.sigma}}));
}

/// A pair of poses that was used, or found to be wrong.
struct HandEyePair {
  PoseRows rows;
  PairFit fit;
};
template <class V>
void describe(V& v, const HandEyePair& pair) {
  v("row_a", pair.rows.a + 1)("row_b", pair.rows.b + 1)("line_a", pair.rows.line_a)("line_b", pair.rows.line_b);
  v("time", pair.rows.time, "", "s");
  describe(v, pair.fit);
}

/// A hint with its sentence.
struct WordedHint {
  HandEyeHint hint;
  std::string text;
  bool one_file_inverted = false;
};
template <class V>
void describe(V& v, const WordedHint& h) {
  constexpr std::array readings = {"right", "left", "rotation_first", "world_axes"};
  const auto reading = [&](const PoseReading& r) { return readings[static_cast<std::size_t>(r.covariance)]; };
  v("text", h.text)("covariance_a", reading(h.hint.reading.a))("covariance_b", reading(h.hint.reading.b));
  v("one_file_inverted", h.one_file_inverted)("chi2_per_degree", h.hint.chi2_per_degree)("p", h.hint.p);
  v("agrees", h.hint.agrees, "the residuals are within the noise");
}

/// The results and settings that `liestat hand-eye` shows.
struct HandEyeOutput {
  HandEyeFile a, b;
  std::vector<PoseRows> rows;
  bool by_time = false;
  double tolerance = 0, largest_gap = 0;  ///< s, where by time
  HandEyeOptions options;
  HandEyeResult result;
  std::optional<HandEyeHint> hint;
  std::vector<std::string> notes;  ///< on the files

  /// The hint, if there is one.
  std::vector<WordedHint> hints() const;
  std::vector<HandEyePair> pairs() const;
};
template <class V>
void describe(V& v, const HandEyeOutput& o) {
  const auto by_time = [&](double value) { return o.by_time ? std::optional(value) : std::nullopt; };
  describe(v, o.result);
  v("hints", o.hints(), "other readings of the files that fit better")("notes", o.notes)("A", o.a)("B", o.b);
  v("association", o.by_time ? "time" : "row")("tolerance", by_time(o.tolerance), "", "s");
  v("largest_gap", by_time(o.largest_gap), "", "s")("pairs", o.pairs());
}

/// The verdict, X and Y, the fit, wrong pairs, open directions and hints, for the terminal.
std::string formatHandEye(const HandEyeOutput& output);

/// Writes a page with residuals, excitations and the covariance of X into a directory.
void writeHandEyeReport(const std::string& directory, const std::string& command_line, const HandEyeOutput& output);

}  // namespace liestat::cli
