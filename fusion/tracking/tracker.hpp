// Tracks of corners through the images of a recording, each observation with its standard deviation:
//
//   liestat::Tracker tracker(*library.pointFlow(), {.tracks = 300});
//   while (const liestat::GreyView image = sequence->next(); image.pixels) tracker.take(image);
//   for (const liestat::TrackedPoint& p : tracker.finish()) …
//
// Lucas–Kanade (PointFlow) leads to a pixel's neighbourhood and back; the place is that of the track's template
// (fusion/tracking/patch.hpp). A track ends where its template is not found, no longer looks alike, or where its blocks
// disagree. Where the image repeats itself round a corner (a correlation above 0.7), a track that moves by more than half of
// that distance against what was expected of it ends, too.
#pragma once

#include <fusion/tracking/images.hpp>
#include <fusion/tracking/patch.hpp>
#include <stats/words.hpp>

#include <array>
#include <cstddef>
#include <memory>
#include <vector>

namespace liestat {

struct TrackerOptions {
  std::size_t tracks = 300;  ///< so many are kept, if there are so many corners
  double apart = 0;          ///< px between corners; 0: as `tracks` of them fit, at most a patch's side
  double backward = 1;       ///< px: the way back ends no farther from its start
  std::size_t least = 8;     ///< observations (or all images, if they are fewer) without which a track is left out
};

/// A track as an image shows it. Errors of a track's observations are independent, the first one's are the template's.
struct TrackedPoint {
  std::size_t image = 0, track = 0;  ///< both counted from 0
  double u = 0, v = 0;               ///< px, the first pixel's centre is (0, 0)
  double sigma = 0;                  ///< px: of u and of v, the root of their mean variance
};

/// Why tracks ended.
enum class TrackEnd { last_image, flow, border, not_alike, scale, misfit, uncertain, repeated, crowded };
constexpr auto words(TrackEnd) {
  return std::array{"at the last image", "lost by the flow", "at the border",   "no longer alike", "out of scale",
                    "blocks disagree",   "uncertain",        "may be a repeat", "too near another"};
}
inline constexpr std::size_t track_ends = 9;

class Tracker {
 public:
  explicit Tracker(PointFlow& flow, const TrackerOptions& options = {}) : flow_(flow), options_(options) {}

  /// Takes the next image, of one size with the others.
  void take(const GreyView& image);
  /// Ends all tracks. Observations by images, then tracks; those that enough images showed, with two observations or more.
  std::vector<TrackedPoint> finish();

  std::size_t alive() const { return alive_.size(); }
  /// How many of these tracks ended so, by TrackEnd, after finish().
  const std::array<std::size_t, track_ends>& ends() const { return ends_; }

 private:
  struct Track {
    std::size_t number;
    std::vector<std::size_t> rows;  ///< its observations
    std::unique_ptr<Patch> patch;
    PatchMatch match;
    Eigen::Vector2d moved;
    double rival;  ///< px to the nearest place that looks alike; 0: none
  };

  struct Ended {
    std::size_t seen = 0;  ///< images that showed it; 0: it has no observations left
    TrackEnd why = TrackEnd::last_image;
  };

  void follow();
  void begin(int width, int height);
  void end(Track& track, TrackEnd why);
  void drop(Track& track, std::size_t kept);

  PointFlow& flow_;
  TrackerOptions options_;
  SmoothImage smooth_;
  std::vector<Track> alive_;
  std::vector<TrackedPoint> rows_;
  std::vector<Ended> ended_;  ///< by the numbers of the tracks
  std::array<std::size_t, track_ends> ends_{};
  std::size_t image_ = 0, numbers_ = 0, looked_ = 0;
};

}  // namespace liestat
