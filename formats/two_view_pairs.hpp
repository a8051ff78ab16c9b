// Matches of real pairs of images, with labels or validation points.
//
// Four kinds of pairs, by the folder that they are in:
//
//   homogr         a plane or a rotation; validation points, which satisfy a homography
//   kusvod2        scenes in depth; validation points, which satisfy a fundamental matrix
//   adelaide-rmf   several planes, each match labelled with its own
//   evd            one plane seen from far apart, inliers labelled
#pragma once

#include <stats/words.hpp>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace liestat {

/// Which of the four kinds a pair is.
enum class PairFamily { homogr, kusvod2, adelaide, evd };
/// The names of the folders.
constexpr auto words(PairFamily) { return std::array{"homogr", "kusvod2", "adelaide-rmf", "evd"}; }

/// A pair of images: matches (x, y, x', y') in px.
struct TwoViewPair {
  PairFamily family = PairFamily::homogr;
  std::string name;
  std::vector<Eigen::Vector4d> matches;  ///< tentative
  /// Structure of each match, where the family has labels; 0 for a wrong match.
  std::vector<std::size_t> labels;
  std::vector<Eigen::Vector4d> validation;  ///< right matches that no estimate sees
  /// A corner of both images, and width and height (px).
  Eigen::Vector2d corner = Eigen::Vector2d::Zero(), size = Eigen::Vector2d::Ones();
};

/// Reads the matches of one pair: columns x1, y1, x2, y2 and, by the family, `validation` (1 for points that validate,
/// else 0), `structure` (0 for wrong matches, else the number of its structure) or `inlier` (1 or 0). The image is the
/// bounding box of all points. Throws InputError.
TwoViewPair readTwoViewPair(const std::string& path, PairFamily family);

/// Reads all pairs of a directory: the files NAME.csv, but for NAME_model.csv, in its folders homogr, kusvod2,
/// adelaide-rmf and evd, as far as it has them, in the order of their names. Where there is a file manifest.csv with the
/// columns family, pair and note, the note `imsize=HEIGHTxWIDTH` is the size of a pair's images. Throws InputError.
std::vector<TwoViewPair> readTwoViewPairs(const std::string& directory);

}  // namespace liestat
