// Pairs of points for the filters of fusion/motion/, from tracks as they come frame by frame.
//
//   liestat::TrackPairs tracks({.frames = 4});
//   for (…) filter.update(tracks.add(observations));
//
// A pair joins the newest position of a track with its oldest within `frames` frames. Over k frames the motion is k
// times as large and the noise the same, so that noise which drowns the motion of one frame (8 pixels at 5° per frame)
// does not drown that of four: with Flow::midpoint the direction and the rotation, per frame, are those of the middle of
// the interval, k/2 frames ago. It asks for a motion that hardly changes over k frames, and for no more than some 30° of
// rotation in them.
#pragma once

#include <fusion/motion/types.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace liestat {

/// A point of a frame.
struct TrackObservation {
  std::uint64_t track = 0;
  Eigen::Vector2d at = Eigen::Vector2d::Zero();  ///< calibrated coordinates
  double sigma = 0;                              ///< standard deviation of each, > 0
};

struct TrackPairsOptions {
  std::size_t frames = 1;  ///< longest interval
  /// Pairs of shorter intervals, of younger tracks, too (for Flow::forward and Flow::midpoint).
  bool shorter = true;
};

/// Remembers the last frames of the tracks that are still seen. Allocates only for more tracks than before.
class TrackPairs {
 public:
  explicit TrackPairs(const TrackPairsOptions& options = {}) : options_(options) {
    options_.frames = std::max<std::size_t>(options_.frames, 1);
  }

  /// The pairs that end in this frame, in the order of their tracks' numbers. Of several observations of a track in one
  /// frame the first counts; those that are not finite are left out, and end their track.
  std::span<const PointPair> add(std::span<const TrackObservation> observations) {
    const std::size_t slots = options_.frames + 1, slot = frame_ % slots;
    order_.clear();
    for (std::size_t i = 0; i < observations.size(); ++i) {
      if (observations[i].at.allFinite() && std::isfinite(observations[i].sigma)) order_.push_back(i);
    }
    std::sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) {
      const std::uint64_t first = observations[a].track, second = observations[b].track;
      return first < second || (first == second && a < b);
    });
    next_.clear(), next_places_.clear(), pairs_.clear(), tracks_.clear();
    std::size_t old = 0;
    for (std::size_t i = 0; i < order_.size(); ++i) {
      const TrackObservation& seen = observations[order_[i]];
      if (i > 0 && observations[order_[i - 1]].track == seen.track) continue;
      while (old < known_.size() && known_[old].track < seen.track) ++old;
      const bool continues = old < known_.size() && known_[old].track == seen.track;
      next_.push_back(continues ? known_[old] : Known{seen.track, 0});
      const std::size_t from = next_places_.size();
      next_places_.resize(from + slots);
      if (continues) {
        const auto begin = places_.begin() + static_cast<std::ptrdiff_t>(old * slots);
        std::copy(begin, begin + static_cast<std::ptrdiff_t>(slots),
                  next_places_.begin() + static_cast<std::ptrdiff_t>(from));
      }
      next_places_[from + slot] = {seen.at, seen.sigma};
      Known& known = next_.back();
      const std::size_t age = std::min(known.frames, options_.frames);
      if (age == options_.frames || (age > 0 && options_.shorter)) {
        const Place& first = next_places_[from + (frame_ + slots - age) % slots];
        const double sigma = std::sqrt(0.5 * (first.sigma * first.sigma + seen.sigma * seen.sigma));
        pairs_.push_back({first.at, seen.at, sigma, static_cast<double>(age)});
        tracks_.push_back(seen.track);
      }
      ++known.frames;
    }
    std::swap(known_, next_), std::swap(places_, next_places_);
    ++frame_;
    return pairs_;
  }
  /// The pairs of the last frame.
  std::span<const PointPair> pairs() const { return pairs_; }
  /// The track of each of them.
  std::span<const std::uint64_t> tracks() const { return tracks_; }

 private:
  struct Known {
    std::uint64_t track;
    std::size_t frames;  ///< in which it has been seen without a break
  };
  struct Place {
    Eigen::Vector2d at = Eigen::Vector2d::Zero();
    double sigma = 0;
  };

  TrackPairsOptions options_;
  std::size_t frame_ = 0;
  std::vector<Known> known_, next_;
  std::vector<Place> places_, next_places_;  ///< a ring of frames + 1 for each known track
  std::vector<std::size_t> order_;           ///< indices of the observations, by track
  std::vector<PointPair> pairs_;
  std::vector<std::uint64_t> tracks_;
};

/// The pairs of this interval, each as one step of time: those of an epipolar constraint.
inline void pairsOver(double interval, std::span<const PointPair> pairs, std::vector<PointPair>& steps) {
  steps.clear();
  for (const PointPair& pair : pairs) {
    if (pair.frames != interval) continue;
    steps.push_back(pair);
    steps.back().frames = 1;
  }
}

}  // namespace liestat
