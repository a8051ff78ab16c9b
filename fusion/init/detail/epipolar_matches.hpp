// The tracks of a window as pairs of images have them in common: who was seen where, and which pairs are looked at.
#pragma once

#include <fusion/init/detail/closed_form_input.hpp>
#include <fusion/imu/window.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cstddef>
#include <vector>

namespace liestat::detail {

/// A direction in which a track was seen.
struct EpipolarSight {
  std::size_t image;        ///< its time
  Eigen::Vector3d bearing;  ///< in the body
  Eigen::Vector3d u;        ///< in t0
  double variance;          ///< rad²
};
/// A track that two images have in common.
struct EpipolarMatch {
  std::size_t track, first, second;  ///< sights
};
/// Two images of one camera.
struct EpipolarPair {
  std::size_t first, second;  ///< images of one camera
  std::size_t begin, end;     ///< matches
  Eigen::Vector3d t;          ///< direction of the translation
  bool used;
};

/// Sights by track, camera and image, and the pairs of images in use with the matches of each, one after the other.
class EpipolarMatches {
 public:
  std::vector<EpipolarSight> sights;
  std::vector<EpipolarPair> pairs;
  std::vector<EpipolarMatch> matches;

  EpipolarMatches(const InertialWindow& window, double bearing_noise)
      : tracks_(window.features.size()), cameras_(window.cameras.size()), images_(window.motions().size() + 1) {
    slot_.assign(cameras_ * images_ * tracks_, 0);
    for (std::size_t i = 0; i < tracks_; ++i) {
      for (const TrackedBearing& seen : window.features[i]) {
        std::size_t& own = slot_[(i * cameras_ + seen.camera) * images_ + seen.image];
        // Twice in an image: the first.
        if (own != 0) continue;
        const double sigma = bearing_noise * seen.relative_sigma;
        const Eigen::Vector3d bearing = bearingInBody(window.cameras, seen);
        sights.push_back({seen.image, bearing, bearing, sigma * sigma});
        own = sights.size();
      }
    }
  }

  /// Pairs of all steps.
  void setAllPairs() { setPairs(1, images_ - 1); }
  /// Pairs whose images are `shortest` steps apart, twice as many, and so on up to `longest`.
  void setPairs(std::size_t shortest, std::size_t longest) {
    pairs.clear();
    matches.clear();
    for (std::size_t step = shortest; step <= longest; step *= 2) {
      for (std::size_t c = 0; c < cameras_; ++c) {
        for (std::size_t j = 0; j + step < images_; ++j) {
          EpipolarPair pair{j, j + step, matches.size(), 0, Eigen::Vector3d::UnitX(), true};
          for (std::size_t i = 0; i < tracks_; ++i) {
            const std::size_t a = slot(i, c, j), b = slot(i, c, j + step);
            if (a != 0 && b != 0) matches.push_back({i, a - 1, b - 1});
          }
          pair.end = matches.size();
          if (pair.end > pair.begin) pairs.push_back(pair);
        }
      }
    }
  }
  /// The step, a power of two, of the pairs that say most: long, and with many tracks that reach.
  std::size_t bestStep() const {
    std::size_t best = 1, most = 0;
    for (std::size_t step = 1; step < images_; step *= 2) {
      std::size_t both = 0;
      for (std::size_t i = 0; i < tracks_; ++i) {
        for (std::size_t c = 0; c < cameras_; ++c) {
          for (std::size_t j = 0; j + step < images_; ++j) both += slot(i, c, j) != 0 && slot(i, c, j + step) != 0;
        }
      }
      if (both * step > most) {
        most = both * step;
        best = step;
      }
    }
    return best;
  }
  /// Degrees of freedom of a track's residuals: pairs share its bearings, which are independent.
  double freedom(std::size_t i) const {
    double seen = 0;
    for (std::size_t c = 0; c < cameras_; ++c) {
      for (std::size_t j = 0; j < images_; ++j) seen += slot(i, c, j) != 0;
    }
    return std::max(1., seen - 1);
  }

 private:
  /// The sight of a track in an image of a camera + 1, or 0.
  std::size_t slot(std::size_t track, std::size_t camera, std::size_t image) const {
    return slot_[(track * cameras_ + camera) * images_ + image];
  }

  std::size_t tracks_, cameras_, images_;
  std::vector<std::size_t> slot_;
};

}  // namespace liestat::detail
