// Recordings of images: folders, lists of files, videos; and the library that decodes them.
#pragma once

#include <fusion/tracking/images.hpp>

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace liestat {

/// Which images there are, and when they were taken.
struct ImageRecording {
  std::vector<std::string> files;  ///< in their natural order (2 before 10); none of a video
  std::string video;
  std::vector<double> times;  ///< s, one an image, ascending; empty: not known, or the video's own
};

/// The images of a folder, of two files or more, or a video. `times`: CSV frame,t_s with a row an image, or EuRoC's data.csv
/// (nanoseconds, and the names of files, by which images are found), or empty: names that are nanoseconds are times, too.
/// Throws InputError where there are no two images, where a number is left out in a series without times, where times do
/// not fit the images or do not ascend.
ImageRecording imagesOf(const std::vector<std::string>& paths, const std::string& times);

/// True of a name that ends as images' do (png, jpg, pgm, tif, bmp, webp …).
bool isImageName(const std::string& path);
/// Natural order: numbers in names count as numbers, 2 before 10.
bool naturallyBefore(const std::string& a, const std::string& b);

/// The library of images, in the module liestat_opencv.so beside the program (or in ../lib/liestat): opened at the first
/// call. Throws InputError in the name of `user` where there is none, with the packages that bring it.
const ImageLibrary& imageLibrary(const std::string& user);

/// The images of a recording, one after another, each with its number and its time.
class ImageReader {
 public:
  /// Takes one image of `every`. Throws as imagesOf and imageLibrary do, and where a video can't be opened.
  ImageReader(const std::vector<std::string>& paths, const std::string& times, std::size_t every,
              const std::string& user);

  /// The next image, valid until the next call; without pixels at the end. Throws InputError for an image that can't be read
  /// or has another size, a stamp that does not ascend, and an end before the second image.
  GreyView next();
  /// The number of the last image in the recording, from 0.
  std::size_t frame() const { return frame_; }
  /// s; NaN where no times are known.
  double time() const { return time_; }
  /// True of a file that is one of those to read.
  bool reads(const std::string& path) const;
  /// The images that are read, as they were given, and which share of them.
  const std::string& name() const { return name_; }
  std::size_t every() const { return every_; }
  /// How many images there are, passed-over ones too; 0: not known.
  std::size_t count() const { return recording_.files.empty() ? recording_.times.size() : recording_.files.size(); }

 private:
  ImageRecording recording_;
  std::string name_, times_;
  std::unique_ptr<ImageSequence> images_;
  std::size_t every_, frame_ = 0, taken_ = 0;
  int width_ = 0, height_ = 0;
  double time_;
};

}  // namespace liestat
