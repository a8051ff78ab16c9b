#pragma once

// The tracks of images, for the commands that track, and kept on disk for those that need them again.

#include <formats/images.hpp>
#include <fusion/tracking/tracker.hpp>

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace liestat::cli {

struct TrackedImages {
  std::size_t images = 0;
  std::vector<double> times;  ///< s, of each; empty: not known
  int width = 0, height = 0;
  std::vector<TrackedPoint> points;
  std::array<std::size_t, track_ends> ends{};
};

/// Tracks all images. Throws InputError where nothing is found twice, and as ImageReader does.
TrackedImages trackImages(ImageReader& images, const TrackerOptions& how, const std::string& user);

/// Rows frame,track,u,v,sigma and, where times are known, t_s.
std::string tracksText(const TrackedImages& tracked);

/// Tracks that were kept, or are now.
struct KeptTracks {
  std::string text;          ///< as tracksText() has it
  std::string file;          ///< where they are kept; empty: nowhere
  bool from_before = false;  ///< nothing was tracked
  std::string note;          ///< why they are not kept
  int width = 0, height = 0;
};

/// The tracks of a recording out of a file that keeps them, or tracked now and kept there. The file's first line is the
/// state of the images (names, sizes, times of change, stamps), the options, the program's version and a checksum of its
/// rows: where one of these is another, the images are tracked anew. `file` may be empty.
KeptTracks keptTracks(const std::string& images, const std::string& times, const TrackerOptions& how,
                      const std::string& file, const std::string& user);

/// The file that keeps the tracks of a folder of images: in the folder `cache`, if it is given; beside the output,
/// if that is a file or folder outside of the recording; else in the user's cache ($XDG_CACHE_HOME, ~/.cache). Empty:
/// there is no such place. Throws OptionError where `cache` is within the recording.
std::string trackFile(const std::string& recording, const std::string& images, const std::string& cache,
                      const std::string& output, const std::string& user);

}  // namespace liestat::cli
