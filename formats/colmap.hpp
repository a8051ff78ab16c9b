// Databases of COLMAP (SQLite): cameras, keypoints and matches of pairs of images, and the motions of these pairs back
// into a copy. Layout: COLMAP's page "Database Format", of version 3.8. docs/two_view.md, "Pairs of COLMAP".
#pragma once

#include <fusion/camera.hpp>
#include <fusion/two_view/edge.hpp>
#include <fusion/two_view/two_view_types.hpp>
#include <stats/words.hpp>

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace liestat {

/// The codes of a pair in two_view_geometries. A pair that is not written is `undefined`.
enum class ColmapConfig {
  undefined,
  degenerate,
  calibrated,
  uncalibrated,
  planar,
  panoramic,
  planar_or_panoramic,
};
constexpr auto words(ColmapConfig) {
  return std::array{"UNDEFINED", "DEGENERATE", "CALIBRATED",         "UNCALIBRATED",
                    "PLANAR",    "PANORAMIC",  "PLANAR_OR_PANORAMIC"};
}

/// Two images and their matches. Pixels are COLMAP's, throughout: (0.5, 0.5) is the centre of the first one, so that
/// the corner of an image is (0, 0).
struct ColmapMatches {
  std::uint32_t first = 0, second = 0;  ///< numbers of the images
  std::string first_name, second_name;
  std::vector<std::array<std::uint32_t, 2>> places;  ///< of the keypoints of each match
  std::vector<Eigen::Vector4d> matches;              ///< px
  /// Set where the focal lengths of both are known (prior_focal_length); two where the images have two.
  std::optional<Camera> first_camera, second_camera;
  Eigen::Vector2d first_size = Eigen::Vector2d::Zero(), second_size = Eigen::Vector2d::Zero();  ///< px
  std::string fault;  ///< why the pair cannot be estimated, in words; the matches are then empty
};

/// Calls a function with each pair of a database that has matches, in the order of their numbers; `pairs`, if there is
/// one, is called first with their number. Only one pair is in memory at a time. Throws InputError where it is no
/// such database, a table is damaged, or the build has no SQLite.
void forEachColmapPair(const std::string& database, const std::function<void(std::size_t)>& pairs,
                       const std::function<void(ColmapMatches&&)>& take);

/// The motion of a pair, as it goes into the database.
struct ColmapPair {
  std::uint32_t first = 0, second = 0;
  std::string first_name = {}, second_name = {};
  std::size_t matches = 0, inliers = 0;
  std::string status = {}, model = {};
  ColmapConfig config = ColmapConfig::undefined;
  std::string reason = {};                           ///< why the pair is not written, or has no edge
  double rms = 0;                                    ///< px
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();  ///< F, or H
  std::optional<TwoViewEdge> edge = {};
  std::vector<std::array<std::uint32_t, 2>> inlier_places = {};

  bool isWritten() const { return config != ColmapConfig::undefined; }
};

/// The motion of a pair by its estimate. An estimate that is not ok is not written, with the reason. Of the models
/// with calibrated cameras rotation and none are PANORAMIC, homography PLANAR, essential, upright and translation
/// CALIBRATED; every other epipolar geometry is UNCALIBRATED, every other homography PLANAR_OR_PANORAMIC: it may be
/// that of a plane.
ColmapPair colmapPairOf(const ColmapMatches& matches, const TwoViewMotionEstimate& estimate);

/// Writes a copy of a database, whose two-view geometries are those of the pairs alone, in one transaction, to a path
/// where there is no file yet. Whoever reads that path sees all of the copy. Throws InputError.
void writeColmapPairs(const std::string& database, const std::string& copy, const std::vector<ColmapPair>& pairs);

/// The edges with an information matrix as a graph of g2o (its own convention, half angles): second_T_first from the
/// number of the second image to that of the first, without vertices.
std::string formatColmapGraph(const std::vector<ColmapPair>& pairs);
/// All edges as CSV: images, pose, the 21 numbers of the covariance's upper triangle (convention `right`), NaN where
/// open.
std::string formatColmapEdges(const std::vector<ColmapPair>& pairs);

template <class V>
void describe(V& v, const ColmapPair& p) {
  v("first", p.first, "number of the first image")("second", p.second, "of the second");
  v("first_name", p.first_name)("second_name", p.second_name)("matches", p.matches, "their number");
  v("status", p.status, "of the estimate")("model", p.model, "the chosen one")("inliers", p.inliers, "their number");
  v("rms", p.rms, "noise that the inliers show", "px");
  v("config", name(p.config), "as COLMAP names it; UNDEFINED: not written");
  v("reason", p.reason.empty() ? std::nullopt : std::optional(p.reason), "why it is not written, or has no edge");
  v("edge", p.edge.has_value(), "in the CSV")("information", p.edge && p.edge->information, "in the graph of g2o");
}

}  // namespace liestat
