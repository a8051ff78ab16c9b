// Matches between two images that contradict each other: one point matched with two. Descriptors of repeated structure do
// that, and to a robust estimate it is the same error counted often: ten points matched with one lie on the epipolar
// lines of every geometry whose epipole that one is, and a homography that shrinks enough maps them all to it. At most
// one of them is right; without the others the choice between models is a better one (docs/two_view.md). And matches that
// are equal: detectors find one point several times, at several scales or turns, with the same coordinates. Their noise is
// the same, too, so that they are one measurement. Needs Eigen alone.
#pragma once

#include <fusion/two_view/errors.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

namespace liestat {

/// True for a match that another contradicts: they have one point in common, and not the other. Points within `reach`
/// standard deviations of a coordinate are one point; those beyond twice that are two, for noise takes one point that was
/// found twice so far apart in two of a hundred cases (exp(-reach²)). Matches that are not numbers contradict none. Nothing
/// depends on the order. O(n log n) where few points have the same abscissa.
inline std::vector<bool> contradictedMatches(std::span<const Eigen::Vector4d> matches, const MatchNoise& noise,
                                             double reach = 2) {
  std::vector<bool> contradicted(matches.size(), false);
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (matches[i].allFinite()) order.push_back(i);
  }
  for (const Eigen::Index image : {0, 2}) {
    const double here = reach * (image == 0 ? noise.first : noise.second);
    const double apart = 2 * reach * (image == 0 ? noise.second : noise.first);
    std::sort(order.begin(), order.end(),
              [&](std::size_t i, std::size_t j) { return matches[i][image] < matches[j][image]; });
    for (std::size_t a = 0; a < order.size(); ++a) {
      for (std::size_t b = a + 1; b < order.size(); ++b) {
        const Eigen::Vector4d difference = matches[order[b]] - matches[order[a]];
        if (difference[image] > here) break;
        if (difference.segment<2>(image).norm() <= here && difference.segment<2>(2 - image).norm() > apart) {
          contradicted[order[a]] = contradicted[order[b]] = true;
        }
      }
    }
  }
  return contradicted;
}

/// For each match the place of the first one that is equal to it, its own if it is that. Matches that are not numbers are
/// equal to none. O(n log n).
inline std::vector<std::size_t> firstOfEqualMatches(std::span<const Eigen::Vector4d> matches) {
  std::vector<std::size_t> first(matches.size()), order;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    first[i] = i;
    if (matches[i].allFinite()) order.push_back(i);
  }
  std::sort(order.begin(), order.end(), [&](std::size_t i, std::size_t j) {
    for (int k = 0; k < 4; ++k) {
      if (matches[i][k] != matches[j][k]) return matches[i][k] < matches[j][k];
    }
    return i < j;
  });
  for (std::size_t a = 1; a < order.size(); ++a) {
    if (matches[order[a]] == matches[order[a - 1]]) first[order[a]] = first[order[a - 1]];
  }
  return first;
}

/// The places of the matches that count as measurements of their own, ascending: of equal ones the first, and none that
/// another one contradicts, unless these are to be kept.
inline std::vector<std::size_t> independentMatches(std::span<const Eigen::Vector4d> matches, const MatchNoise& noise,
                                                   bool keep_contradictions = false) {
  const std::vector<std::size_t> first = firstOfEqualMatches(matches);
  std::vector<std::size_t> places;
  std::vector<Eigen::Vector4d> distinct;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (first[i] == i) places.push_back(i), distinct.push_back(matches[i]);
  }
  if (keep_contradictions) return places;
  const std::vector<bool> contradicted = contradictedMatches(distinct, noise);
  std::size_t kept = 0;
  for (std::size_t k = 0; k < places.size(); ++k) {
    if (!contradicted[k]) places[kept++] = places[k];
  }
  places.resize(kept);
  return places;
}

}  // namespace liestat
