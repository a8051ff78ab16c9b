// Which matches between two images say something of their own. Detectors find a point several times, and descriptors of
// repeated structure match one point with many; to a robust estimate that is not evidence but the same error counted
// often: twenty points matched with one lie on the epipolar lines of every geometry whose epipole that one is, and a
// homography that shrinks enough maps them all to it. On the pairs of kusvod2 and homogr a quarter of the tentative
// matches repeat another one. Needs Eigen alone.
#pragma once

#include <fusion/two_view/errors.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

namespace liestat {

enum class MatchKind : unsigned char {
  distinct,  ///< its points are no other match's
  repeated,  ///< both points are those of another match, which is not called repeated
  ambiguous  ///< one of its points is that of another match, the other one is not: one of the two is wrong at least
};

/// The kind of each match. Points closer than `reach` standard deviations of their coordinates are the same. Matches that
/// are not numbers are distinct. The answer does not depend on the order, but for which of equal matches is not the
/// repeated one (the first). O(n log n) where few points share an abscissa.
inline std::vector<MatchKind> matchKinds(std::span<const Eigen::Vector4d> matches, const MatchNoise& noise,
                                         double reach = 2) {
  const std::size_t n = matches.size();
  const double first = reach * noise.first, second = reach * noise.second;
  const auto same = [&](std::size_t i, std::size_t j, bool in_second) {
    const auto distance = (matches[i] - matches[j]).segment<2>(in_second ? 2 : 0).norm();
    return distance <= (in_second ? second : first);
  };
  std::vector<MatchKind> kinds(n, MatchKind::distinct);
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < n; ++i) {
    if (matches[i].allFinite()) order.push_back(i);
  }
  /// Calls f(i, j) for all matches whose points in an image are the same, i before j in the order of its abscissae.
  const auto forEachPair = [&](bool in_second, const auto& f) {
    const Eigen::Index x = in_second ? 2 : 0;
    std::sort(order.begin(), order.end(), [&](std::size_t i, std::size_t j) {
      for (Eigen::Index k = 0; k < 4; ++k) {
        const Eigen::Index c = (x + k) % 4;
        if (matches[i][c] != matches[j][c]) return matches[i][c] < matches[j][c];
      }
      return i < j;
    });
    for (std::size_t a = 0; a < order.size(); ++a) {
      for (std::size_t b = a + 1; b < order.size(); ++b) {
        if (matches[order[b]][x] - matches[order[a]][x] > (in_second ? second : first)) break;
        if (same(order[a], order[b], in_second)) f(order[a], order[b]);
      }
    }
  };
  forEachPair(false, [&](std::size_t i, std::size_t j) {
    if (kinds[i] == MatchKind::distinct && same(i, j, true)) kinds[j] = MatchKind::repeated;
  });
  const auto compare = [&](bool in_second) {
    forEachPair(in_second, [&](std::size_t i, std::size_t j) {
      if (kinds[i] == MatchKind::repeated || kinds[j] == MatchKind::repeated || same(i, j, !in_second)) return;
      kinds[i] = kinds[j] = MatchKind::ambiguous;
    });
  };
  compare(false), compare(true);
  return kinds;
}

/// The places of the distinct matches, ascending.
inline std::vector<std::size_t> distinctMatches(std::span<const Eigen::Vector4d> matches, const MatchNoise& noise,
                                                double reach = 2) {
  const std::vector<MatchKind> kinds = matchKinds(matches, noise, reach);
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    if (kinds[i] == MatchKind::distinct) places.push_back(i);
  }
  return places;
}

}  // namespace liestat
