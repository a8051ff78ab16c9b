// Images as the tracker sees them, and what it asks of a library of images: no header of one is needed here.
#pragma once

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace liestat {

struct Target;      // fusion/targets/target_pose.hpp
struct SeenTarget;  // likewise

/// A grey image that somebody else holds. Pixel (u, v) is pixels[v * stride + u]; its centre is at (u, v).
struct GreyView {
  const std::uint8_t* pixels = nullptr;
  int width = 0, height = 0;
  std::ptrdiff_t stride = 0;
};

/// The images of a recording, one after another.
class ImageSequence {
 public:
  virtual ~ImageSequence() = default;
  /// The next image, valid until the next call; without pixels at the end, and where `fault` says why it can't be read.
  /// Colour and 16 bits are converted: grey values of 16 bits by the factor that takes the first image's brightest to 255.
  virtual GreyView next() = 0;
  /// Passes over an image; false at the end.
  virtual bool skip() = 0;
  /// The stamp of the last image, s, of a video; NaN of files.
  virtual double time() const = 0;
  /// The last image's fault in words; empty: none.
  virtual const std::string& fault() const = 0;
};

/// Corners, and points followed from one image to the next, to a pixel or so.
class PointFlow {
 public:
  virtual ~PointFlow() = default;
  /// Takes the next image in; the one before is kept.
  virtual void take(const GreyView& image) = 0;
  /// The strongest corners (smaller eigenvalue of the structure tensor) of the last image: at most `most` of them,
  /// whole pixels, `apart` from each other and from `taken`, `margin` from the border.
  virtual std::vector<Eigen::Vector2i> corners(const std::vector<Eigen::Vector2d>& taken, std::size_t most,
                                               double apart, int margin) = 0;
  /// Places in the last image of points of the one before, by pyramidal Lucas–Kanade from a guess, and back again.
  /// NaN where one way fails or the way back ends more than `apart` pixels from the point.
  virtual std::vector<Eigen::Vector2d> follow(const std::vector<Eigen::Vector2d>& from,
                                              const std::vector<Eigen::Vector2d>& guess, double apart) = 0;
};

/// A library of images, opened on demand (fusion/compat/opencv.cpp is one).
class ImageLibrary {
 public:
  virtual ~ImageLibrary() = default;
  virtual std::unique_ptr<ImageSequence> openFiles(std::vector<std::string> files) const = 0;
  /// Null where it is no video that can be read.
  virtual std::unique_ptr<ImageSequence> openVideo(const std::string& file) const = 0;
  virtual std::unique_ptr<PointFlow> pointFlow() const = 0;
  /// Targets of a kind in an image, to some pixels; of another identity, too, and none where there is none. `lacking` is
  /// what this build lacks to look for them, in words; empty: nothing.
  virtual std::vector<SeenTarget> findTargets(const GreyView& image, const Target& target,
                                              std::string& lacking) const = 0;
};

}  // namespace liestat
