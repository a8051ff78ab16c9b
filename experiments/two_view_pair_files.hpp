// Matches of real pairs of images, with labels or validation points.
#pragma once

#include <experiments/two_view_pairs.hpp>

#include <string>
#include <vector>

namespace liestat::experiments {

/// Reads the matches of one pair: columns x1, y1, x2, y2 and, by the family, `validation` (1 for points that validate,
/// else 0), `structure` (0 for wrong matches, else the number of its structure) or `inlier` (1 or 0). The image is the
/// bounding box of all points. Throws InputError.
experiments::TwoViewPair readTwoViewPair(const std::string& path, experiments::PairFamily family);

/// Reads all pairs of a directory: the files NAME.csv, but for NAME_model.csv, in its folders homogr, kusvod2,
/// adelaide-rmf and evd, as far as it has them, in the order of their names. Where there is a file manifest.csv with the
/// columns family, pair and note, the note `imsize=HEIGHTxWIDTH` is the size of a pair's images. Throws InputError.
std::vector<experiments::TwoViewPair> readTwoViewPairs(const std::string& directory);

}  // namespace liestat::experiments
